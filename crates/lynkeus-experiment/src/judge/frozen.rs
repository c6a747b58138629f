//! Sensors that hang: readings that repeat although their noise would not let them.

use lynkeus_words::figures;
use serde::Serialize;

use crate::Series;
use crate::words::instant;
use lynkeus_study::Noise;
use lynkeus_table::series::points;

/// Fewer equal readings in a row are none of our business.
const FEWEST: usize = 5;
/// The expected number of false alarms of a channel.
const ALARMS: f64 = 1e-6;
/// Differences of white noise, taken three times, change their sign in this share of the pairs at
/// least: 1/2 + asin(3/4)/π = 0.77 is expected; of a smooth signal hardly ever.
const ALTERNATING: f64 = 0.65;
/// Readings on which a channel's noise rests.
const ENOUGH: usize = 30;
/// No more of them are looked at.
const LOOKED_AT: usize = 20_000;

/// A sensor whose readings are one number for improbably long.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Frozen {
    /// the measured output
    pub output: String,
    /// the number that it repeats
    pub value: f64,
    /// time of the first of the equal readings
    pub from: f64,
    /// time of the last of the equal readings
    pub to: f64,
    /// number of them
    pub rows: usize,
    /// no reading of the log is larger, or none smaller: an end of the sensor's range as well
    #[serde(rename = "at_end_of_range")]
    pub at_end: bool,
}

/// What is known of a channel beside its readings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Channel {
    /// readings at these are the sensor's ends
    pub limits: Option<(f64, f64)>,
    pub noise: Option<Noise>,
}

/// Where a channel hangs. It has to show white noise, of a deviation above its quantisation step,
/// so that equal neighbours are a matter of chance: at most of the chance that the noise gives them
/// and of their share in the rest of the log. Runs so long that less than a
/// millionth of them is expected are not by chance.
pub(crate) fn frozen(
    output: &str,
    time: &Series,
    readings: &Series,
    channel: Channel,
) -> Vec<Frozen> {
    let all = Totals::of(runs(time, readings));
    if !all.has_long {
        return vec![];
    }
    let Some(noise) = Scatter::of(runs(time, readings)) else {
        return dead(output, &all, channel).into_iter().collect();
    };
    let is_improbable = |run: &Run| {
        let own = run.rows - 1;
        let others = (all.points - 1 - own) as f64;
        let share = ((all.equal - own) as f64 + 1.0) / (others + 2.0);
        let chance = share.max(noise.chance);
        all.points as f64 * chance.powf(own as f64) < ALARMS
    };
    runs(time, readings)
        .filter(|run| run.rows >= FEWEST)
        .filter(is_improbable)
        .filter(|run| !channel.explains(run.value, noise.step))
        .map(|run| Frozen {
            output: output.to_owned(),
            value: run.value,
            from: run.from,
            to: run.to,
            rows: run.rows,
            at_end: all.low == run.value || all.high == run.value,
        })
        .collect()
}

/// A sensor that shows one number for the whole log, though its declared noise is white and above the last digit
/// of that number.
fn dead(output: &str, all: &Totals, channel: Channel) -> Option<Frozen> {
    let Some(Noise::Absolute(deviation)) = channel.noise else {
        return None;
    };
    let digits = format!("{:e}", all.low);
    let (mantissa, exponent) = digits.split_once('e')?;
    let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len());
    let step = 10_f64.powi(exponent.parse::<i32>().ok()? - decimals as i32);
    let is_dead = all.low == all.high && all.points >= ENOUGH && deviation >= 2.0 * step;
    (is_dead && !channel.explains(all.low, step)).then(|| Frozen {
        output: output.to_owned(),
        value: all.low,
        from: all.from,
        to: all.to,
        rows: all.points,
        at_end: true,
    })
}

/// Equal readings, one after the other.
#[derive(Clone, Copy, Debug)]
struct Run {
    from: f64,
    to: f64,
    value: f64,
    rows: usize,
}

/// The readings that are there as runs, one long or longer.
fn runs(time: &Series, readings: &Series) -> impl Iterator<Item = Run> {
    let mut points = points(time, readings).peekable();
    std::iter::from_fn(move || {
        let (from, value) = points.next()?;
        let mut run = Run {
            from,
            to: from,
            value,
            rows: 1,
        };
        while let Some((to, _)) = points.next_if(|(_, y)| *y == value) {
            run.to = to;
            run.rows += 1;
        }
        Some(run)
    })
}

/// What all runs are together.
struct Totals {
    points: usize,
    /// times of the first and the last
    from: f64,
    to: f64,
    /// readings that equal the one before them
    equal: usize,
    low: f64,
    high: f64,
    /// some run is long enough to be looked at
    has_long: bool,
}

impl Totals {
    fn of(runs: impl Iterator<Item = Run>) -> Self {
        let mut all = Self {
            points: 0,
            from: f64::NAN,
            to: f64::NAN,
            equal: 0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            has_long: false,
        };
        for run in runs {
            if all.points == 0 {
                all.from = run.from;
            }
            all.to = run.to;
            all.points += run.rows;
            all.equal += run.rows - 1;
            all.low = all.low.min(run.value);
            all.high = all.high.max(run.value);
            all.has_long |= run.rows >= FEWEST;
        }
        all
    }
}

impl Channel {
    /// Whether a healthy sensor may well repeat the value: it is at an end of its range, or its
    /// noise, a share of it, is less than its quantisation.
    fn explains(self, value: f64, step: f64) -> bool {
        let is_limit = self
            .limits
            .is_some_and(|(low, high)| value <= low || value >= high);
        let is_quiet = match self.noise {
            Some(Noise::Relative(share)) => share * value.abs() < step,
            _ => false,
        };
        is_limit || is_quiet
    }
}

/// A channel's noise where it does not hang.
struct Scatter {
    /// smallest difference between neighbours that differ
    step: f64,
    /// that two neighbours are equal
    chance: f64,
}

impl Scatter {
    /// None where the channel shows no white noise above its quantisation.
    fn of(runs: impl Iterator<Item = Run>) -> Option<Self> {
        let mut seen = Differences::default();
        for run in runs {
            match run.rows >= FEWEST {
                // what is left where nothing hangs, in pieces
                true => seen.last.clear(),
                false => (0..run.rows).for_each(|_| seen.take(run.value)),
            }
        }
        let Differences { pairs, step, .. } = seen;
        if pairs.len() < ENOUGH {
            return None;
        }
        let alternating = pairs.iter().filter(|(a, b)| a * b < 0.0).count();
        let mut sizes: Vec<f64> = pairs.iter().map(|(a, _)| a.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        // the third difference of white noise has 20 times its variance
        let deviation = 1.4826 * sizes[sizes.len() / 2] / 20_f64.sqrt();
        let step = step?;
        let is_noise = alternating as f64 >= ALTERNATING * pairs.len() as f64 && deviation >= step;
        // a difference of deviation √2 σ that rounds to none
        let chance = step / (2.0 * deviation * std::f64::consts::PI.sqrt());
        is_noise.then_some(Self { step, chance })
    }
}

/// Differences between neighbours, reading by reading.
#[derive(Debug, Default)]
struct Differences {
    /// the readings before, at most four
    last: Vec<f64>,
    /// third differences of neighbours, the first of them
    pairs: Vec<(f64, f64)>,
    /// the smallest first difference that is none
    step: Option<f64>,
}

impl Differences {
    fn take(&mut self, value: f64) {
        if let Some(before) = self.last.last() {
            let step = (value - before).abs();
            if step > 0.0 {
                self.step = Some(self.step.map_or(step, |least| least.min(step)));
            }
        }
        self.last.push(value);
        if let &[a, b, c, d, e] = &self.last[..] {
            if self.pairs.len() < LOOKED_AT {
                let third = |a: f64, b: f64, c: f64, d: f64| d - 3.0 * c + 3.0 * b - a;
                self.pairs.push((third(a, b, c, d), third(b, c, d, e)));
            }
            self.last.remove(0);
        }
    }
}

impl Frozen {
    /// In words.
    pub(crate) fn words(&self) -> String {
        let cause = match self.at_end {
            true => "it is frozen, or at an end of its range (then say so: limits under [sensors])",
            false => "it is frozen",
        };
        format!(
            "the sensor {} is frozen at {} from t = {} to {} ({} rows), although it has noise: {cause}; a family without `gate` believes it",
            self.output,
            figures(self.value, 6),
            instant(self.from),
            instant(self.to),
            self.rows
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in ±1, the same in every run.
    fn noise(count: usize) -> Vec<f64> {
        let mut state = 7_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    fn found(readings: &[f64]) -> Vec<(usize, usize)> {
        with(readings, Channel::default())
    }

    /// First row and number of rows of what hangs.
    fn with(readings: &[f64], channel: Channel) -> Vec<(usize, usize)> {
        let time: Vec<f64> = (0..readings.len()).map(|k| k as f64).collect();
        let found = frozen("y", &time.into(), &readings.to_vec().into(), channel);
        found.iter().map(|f| (f.from as usize, f.rows)).collect()
    }

    fn wave(amplitude: f64) -> Vec<f64> {
        let noise = noise(600).into_iter().enumerate();
        noise
            .map(|(k, n)| amplitude * (0.05 * k as f64).sin() + 0.01 * n)
            .collect()
    }

    #[test]
    fn a_noisy_sensor_that_hangs_is_found_wherever_it_does() {
        for amplitude in [0.0, 0.3, 1.0] {
            let healthy = wave(amplitude);
            assert_eq!(found(&healthy), []);
            for from in [0, 200, 593] {
                let mut y = healthy.clone();
                let value = y[from];
                y[from..from + 7].fill(value);
                assert_eq!(found(&y), [(from, 7)], "{amplitude}");
            }
            let mut twice = healthy.clone();
            twice[100..140].fill(0.2);
            twice[300..330].fill(0.2);
            twice[310] = f64::NAN;
            assert_eq!(found(&twice), [(100, 40), (300, 29)]);
        }
    }

    #[test]
    fn signals_that_repeat_by_themselves_are_healthy() {
        // nothing happens; a noise-free signal that comes to rest; an encoder that moves, then stands
        assert_eq!(found(&[2.5; 400]), []);
        let rest: Vec<f64> = (0..600).map(|k| (-0.2 * f64::from(k)).exp()).collect();
        assert_eq!(found(&rest), []);
        let encoder = |k: f64| (40.0 * (0.02 * k).sin()).round();
        let stands: Vec<f64> = (0..600).map(|k| encoder(f64::from(k).min(300.0))).collect();
        assert_eq!(found(&stands), []);
        // a slow sensor whose last reading a logger repeats
        let noisy = noise(600);
        let held: Vec<f64> = (0..600).map(|k| noisy[k / 12]).collect();
        assert_eq!(found(&held), []);
        // noise of about a quantisation step: five in a row happen
        let coarse: Vec<f64> = noise(20_000).iter().map(|n| (1.2 * n).round()).collect();
        assert_eq!(found(&coarse), []);
    }

    #[test]
    fn a_quantised_noisy_sensor_has_to_hang_for_longer() {
        let mut y: Vec<f64> = noise(2000).iter().map(|n| (2.5 * n).round()).collect();
        y[700..708].fill(1.0);
        assert_eq!(found(&y), []);
        y[700..760].fill(1.0);
        let hung = found(&y);
        assert_eq!(hung.len(), 1);
        assert!(
            hung[0].0.abs_diff(700) < 3 && hung[0].1.abs_diff(60) < 5,
            "{hung:?}"
        );
    }

    #[test]
    fn an_end_of_the_range_is_told_from_hanging() {
        let clipped: Vec<f64> = wave(1.0).into_iter().map(|y| y.min(0.8)).collect();
        let time: Vec<f64> = (0..600).map(f64::from).collect();
        let hung = frozen(
            "y",
            &time.into(),
            &clipped.clone().into(),
            Channel::default(),
        );
        assert!(!hung.is_empty() && hung.iter().all(|f| f.at_end && f.value == 0.8));
        assert!(hung[0].words().contains("limits under [sensors]"));
        let limits = Some((-2.0, 0.8));
        assert_eq!(
            with(
                &clipped,
                Channel {
                    limits,
                    noise: None
                }
            ),
            []
        );
        // noise of 1 % of nothing
        let mut empty = wave(1.0);
        empty[200..300].fill(0.0);
        let noise = Some(Noise::Relative(0.01));
        assert_eq!(
            with(
                &empty,
                Channel {
                    limits: None,
                    noise
                }
            ),
            []
        );
        assert_eq!(found(&empty), [(200, 100)]);
    }
}
