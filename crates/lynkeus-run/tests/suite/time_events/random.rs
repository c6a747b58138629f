//! Random pulses against closed forms and brute force.

use std::f64::consts::{PI, TAU};

use lynkeus_expr::Expr;
use lynkeus_run::{Method, Step};
use proptest::prelude::*;
use proptest::{collection, sample};

use super::{c, integral, modulo, window};

/// A truth value of time whose instants are known in closed form.
#[derive(Clone, Debug)]
enum Atom {
    /// mod(t, period) < width
    Pulse { period: f64, width: f64 },
    /// |mod(t, period) − period/2| < half
    Tent { period: f64, half: f64 },
    /// sin(omega t + phase) > level
    Wave { omega: f64, phase: f64, level: f64 },
    /// from < t and t < from + width
    Window { from: f64, width: f64 },
}

impl Atom {
    fn expr<'g>(&self, t: Expr<'g>) -> Expr<'g> {
        match *self {
            Self::Pulse { period, width } => modulo(t, period).less(c(t, width)),
            Self::Tent { period, half } => {
                (modulo(t, period) - 0.5 * period).abs().less(c(t, half))
            }
            Self::Wave {
                omega,
                phase,
                level,
            } => (t * omega + phase).sin().greater(c(t, level)),
            Self::Window { from, width } => window(t, from, from + width),
        }
    }

    fn holds(&self, t: f64) -> bool {
        match *self {
            Self::Pulse { period, width } => t.rem_euclid(period) < width,
            Self::Tent { period, half } => (t.rem_euclid(period) - 0.5 * period).abs() < half,
            Self::Wave {
                omega,
                phase,
                level,
            } => (omega * t + phase).sin() > level,
            Self::Window { from, width } => from < t && t < from + width,
        }
    }

    fn instants(&self, until: f64) -> Vec<f64> {
        let (period, offsets) = match *self {
            Self::Pulse { period, width } => (period, vec![0.0, width]),
            Self::Tent { period, half } => (period, vec![0.5 * period - half, 0.5 * period + half]),
            Self::Wave {
                omega,
                phase,
                level,
            } => {
                let angles = [level.asin(), PI - level.asin()];
                (
                    TAU / omega,
                    angles.map(|angle| (angle - phase) / omega).to_vec(),
                )
            }
            Self::Window { from, width } => (2.0 * until, vec![from, from + width]),
        };
        let turns = (until / period).ceil() as i32 + 1;
        (-1..=turns)
            .flat_map(|k| {
                offsets
                    .iter()
                    .map(move |offset| offset + f64::from(k) * period)
            })
            .filter(|t| 0.0 < *t && *t < until)
            .collect()
    }
}

fn atom() -> impl Strategy<Value = Atom> {
    prop_oneof![
        (0.5..30.0_f64, 0.001..0.999_f64).prop_map(|(period, duty)| Atom::Pulse {
            period,
            width: duty * period
        }),
        (0.5..30.0_f64, 0.001..0.499_f64).prop_map(|(period, duty)| Atom::Tent {
            period,
            half: duty * period
        }),
        (0.1..10.0_f64, -4.0..4.0_f64, -0.9999..0.9999_f64).prop_map(|(omega, phase, level)| {
            Atom::Wave {
                omega,
                phase,
                level,
            }
        }),
        (0.0..100.0_f64, 1e-4..50.0_f64).prop_map(|(from, width)| Atom::Window { from, width }),
    ]
}

/// How the atoms are put together.
#[derive(Clone, Copy, Debug)]
enum Joined {
    And,
    Or,
    Select,
    Product,
    Largest,
}

const JOINED: [Joined; 5] = [
    Joined::And,
    Joined::Or,
    Joined::Select,
    Joined::Product,
    Joined::Largest,
];

impl Joined {
    fn expr<'g>(self, a: Expr<'g>, b: Expr<'g>, d: Expr<'g>) -> Expr<'g> {
        match self {
            Self::And => a.and(b).and(d),
            Self::Or => a.or(b).or(d),
            Self::Select => a.select(b, d),
            Self::Product => (a - 0.5) * (b + 0.25) * (d - 2.0),
            Self::Largest => (a * 0.5).max(b * 0.7 - 0.1).min(d + 0.3),
        }
    }

    fn value(self, [a, b, d]: [bool; 3]) -> f64 {
        let number = |truth| f64::from(u8::from(truth));
        match self {
            Self::And => number(a && b && d),
            Self::Or => number(a || b || d),
            Self::Select => number(if a { b } else { d }),
            Self::Product => (number(a) - 0.5) * (number(b) + 0.25) * (number(d) - 2.0),
            Self::Largest => (number(a) * 0.5)
                .max(number(b) * 0.7 - 0.1)
                .min(number(d) + 0.3),
        }
    }
}

/// ∫ of the joined atoms, from the instants in closed form.
fn exact(joined: Joined, atoms: &[Atom; 3], until: f64) -> f64 {
    let mut times: Vec<f64> = atoms.iter().flat_map(|a| a.instants(until)).collect();
    times.extend([0.0, until]);
    times.sort_by(f64::total_cmp);
    let pieces = times.windows(2).map(|pair| {
        let middle = 0.5 * (pair[0] + pair[1]);
        let truths = [0, 1, 2].map(|i: usize| atoms[i].holds(middle));
        (pair[1] - pair[0]) * joined.value(truths)
    });
    pieces.sum()
}

/// Measure of {t in [a, b]: g(t) > 0} for |g'| ≤ slope: a cell is cut until its middle
/// decides it.
fn positive(g: &impl Fn(f64) -> f64, slope: f64, a: f64, b: f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let value = g(middle);
    if value > slope * half {
        b - a
    } else if value < -slope * half || b - a < 1e-10 {
        0.0
    } else {
        positive(g, slope, a, middle) + positive(g, slope, middle, b)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn any_pulses_match_the_closed_form(
        atoms in [atom(), atom(), atom()],
        joined in sample::select(&JOINED[..]),
        until in 20.0..400.0_f64,
        rows in 1..40_u32,
        fixed: bool,
    ) {
        let method = if fixed { Method::Rk4(Step::Auto) } else { Method::default() };
        let found = integral(
            |t| {
                let [a, b, d] = [0, 1, 2].map(|i: usize| atoms[i].expr(t));
                joined.expr(a, b, d)
            },
            until,
            until / f64::from(rows),
            method,
        )
        .unwrap();
        let expected = exact(joined, &atoms, until);
        prop_assert!((found - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{} {}", found, expected);
    }

    #[test]
    fn any_sum_of_waves_matches_brute_force(
        waves in collection::vec((0.2..6.0_f64, -3.0..3.0_f64, 0.1..1.0_f64), 1..4),
        level in -1.0..1.5_f64,
        drift in -0.02..0.02_f64,
    ) {
        let until = 50.0;
        let g = |t: f64| {
            let waves = waves.iter().map(|&(omega, phase, size)| (omega * t + phase).sin() * size);
            waves.sum::<f64>() + drift * t - level
        };
        let slope = waves.iter().map(|&(omega, _, size)| omega * size).sum::<f64>() + drift.abs();
        let expected = positive(&g, slope, 0.0, until);
        let found = integral(
            |t| {
                let sum = waves.iter().fold(t * drift, |sum, &(omega, phase, size)| {
                    sum + (t * omega + phase).sin() * size
                });
                sum.greater(c(t, level))
            },
            until,
            until,
            Method::default(),
        )
        .unwrap();
        prop_assert!((found - expected).abs() < 1e-6, "{} {}", found, expected);
    }
}
