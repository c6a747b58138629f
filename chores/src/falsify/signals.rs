//! What acts on plant and observer over time, within what the study allows.

use std::f64::consts::FRAC_PI_2;

use super::case::{Role, Side};
use crate::numbers::Numbers;

#[derive(Clone, Debug, PartialEq)]
pub enum Signal {
    Constant(f64),
    /// one end, then the other
    Bang {
        ends: [f64; 2],
        period: f64,
        phase: f64,
    },
    Wave {
        middle: f64,
        amplitude: f64,
        pace: f64,
        phase: f64,
    },
    /// up and down between the ends at a constant slope
    Triangle {
        ends: [f64; 2],
        slope: f64,
    },
    /// one end or the other by the sign of an error: the worst that can be done to it
    Feedback {
        ends: [f64; 2],
        of: usize,
        sharpness: f64,
    },
}

impl Signal {
    pub fn value(&self, t: f64, error: &[f64]) -> f64 {
        match self {
            Self::Constant(x) => *x,
            Self::Bang {
                ends,
                period,
                phase,
            } => {
                let half = ((t - phase) / period).floor().rem_euclid(2.0);
                ends[usize::from(half >= 1.0)]
            }
            Self::Wave { middle, .. } => middle + self.wave(t, 0),
            Self::Triangle {
                ends: [low, high],
                slope,
            } => {
                let width = high - low;
                let way = (t * slope).rem_euclid(2.0 * width);
                (low + if way > width { 2.0 * width - way } else { way }).clamp(*low, *high)
            }
            Self::Feedback {
                ends: [low, high],
                of,
                sharpness,
            } => {
                let e = error.get(*of).copied().unwrap_or(0.0);
                let share = 0.5 + 0.5 * (e * sharpness).tanh();
                low + share * (high - low)
            }
        }
    }

    /// The derivative of that order; zero for those that have none.
    pub fn derivative(&self, t: f64, order: usize) -> f64 {
        self.wave(t, order)
    }

    fn wave(&self, t: f64, order: usize) -> f64 {
        match self {
            Self::Wave {
                amplitude,
                pace,
                phase,
                ..
            } => {
                let angle = pace * t + phase + order as f64 * FRAC_PI_2;
                amplitude * pace.powi(order as i32) * angle.sin()
            }
            _ => 0.0,
        }
    }

    pub fn next_break(&self, t: f64) -> f64 {
        let (period, phase) = match self {
            Self::Bang { period, phase, .. } => (*period, *phase),
            Self::Triangle {
                ends: [low, high],
                slope,
            } => ((high - low) / slope, 0.0),
            _ => return f64::INFINITY,
        };
        let next = phase + (((t - phase) / period).floor() + 1.0) * period;
        // rounding must not give the same instant again
        if next > t { next } else { next + period }
    }
}

/// Any signal in the range.
pub fn free(numbers: &mut Numbers, [low, high]: [f64; 2], errors: usize) -> Signal {
    let ends = match numbers.chance(0.5) {
        true => [low, high],
        false => [high, low],
    };
    match numbers.below(7) {
        0 => Signal::Constant(low),
        1 => Signal::Constant(high),
        2 => Signal::Constant(numbers.between(low, high)),
        3 => Signal::Bang {
            ends,
            period: numbers.size(0.02, 5.0),
            phase: numbers.unit(),
        },
        4 => wave(numbers, [low, high], numbers.clone().size(0.2, 30.0)),
        _ => Signal::Feedback {
            ends,
            of: numbers.below(errors),
            sharpness: numbers.size(1.0, 1e3),
        },
    }
}

fn wave(numbers: &mut Numbers, [low, high]: [f64; 2], pace: f64) -> Signal {
    let amplitude = numbers.unit() * (high - low) / 2.0;
    Signal::Wave {
        middle: numbers.between(low + amplitude, high - amplitude),
        amplitude,
        pace,
        phase: numbers.between(0.0, 6.3),
    }
}

/// A known input; with a bound of all its derivatives where one is declared.
pub fn known(numbers: &mut Numbers, side: &Side, slope: Option<f64>, errors: usize) -> Signal {
    let range = [side.low, side.high];
    let Some(slope) = slope else {
        return free(numbers, range, errors);
    };
    let constant = Signal::Constant(numbers.between(side.low, side.high));
    let pace = numbers.size(0.2, 1.0);
    match wave(numbers, range, pace) {
        _ if numbers.chance(0.3) => constant,
        Signal::Wave {
            middle,
            amplitude,
            pace,
            phase,
        } => Signal::Wave {
            middle,
            amplitude: amplitude.min(slope / pace),
            pace,
            phase,
        },
        other => other,
    }
}

/// What an input does, by its role; all that is unknown at rest where `quiet`.
pub fn of_role(
    numbers: &mut Numbers,
    side: &Side,
    role: Role,
    slope: Option<f64>,
    quiet: bool,
    errors: usize,
) -> Signal {
    let range = [side.low, side.high];
    match role {
        Role::Known => known(numbers, side, slope, errors),
        Role::Disturbance if quiet => Signal::Constant(0.0),
        Role::Disturbance => free(numbers, range, errors),
        Role::Unknown(Some(slew)) if !quiet && slew > 0.0 => match numbers.chance(0.7) {
            true => Signal::Triangle {
                ends: range,
                slope: slew,
            },
            false => {
                let amplitude = 0.5 * side.width();
                Signal::Wave {
                    middle: side.middle(),
                    amplitude,
                    pace: slew / amplitude,
                    phase: numbers.between(0.0, 6.3),
                }
            }
        },
        Role::Unknown(_) => Signal::Constant(numbers.between(side.low, side.high)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_stay_in_their_range_and_within_their_slope() {
        let mut numbers = Numbers::new(1, 2);
        let side = Side {
            name: "v".into(),
            low: -0.3,
            high: 0.7,
        };
        for _ in 0..200 {
            let signal = of_role(
                &mut numbers,
                &side,
                Role::Unknown(Some(0.2)),
                None,
                false,
                2,
            );
            let known = known(&mut numbers, &side, Some(0.4), 2);
            for step in 0..100 {
                let (t, h) = (f64::from(step) * 0.1 - 3.0, 1e-4);
                let x = signal.value(t, &[]);
                assert!((-0.3..=0.7).contains(&x), "{signal:?} at {t}: {x}");
                let slope = (signal.value(t + h, &[]) - x) / h;
                assert!(slope.abs() <= 0.2 + 1e-6, "{signal:?} at {t}: {slope}");
                assert!(known.derivative(t, 1).abs() <= 0.4 + 1e-12);
                let difference = (known.value(t + h, &[]) - known.value(t - h, &[])) / (2.0 * h);
                assert!((difference - known.derivative(t, 1)).abs() < 1e-6);
            }
        }
    }
}
