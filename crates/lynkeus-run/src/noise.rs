//! Measurement noise that can be repeated.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

use crate::Error;

/// Noise on measured outputs, Gaussian or uniform, drawn anew every `sample_step` and
/// held in between.
///
/// Every output has a random stream of its own: the ChaCha8 generator seeded
/// with `seed` (as `SeedableRng::seed_from_u64` does), on the stream whose number
/// is the 64-bit FNV-1a hash of the output's name, turned by `rand_distr` 0.6 into normal
/// deviates (the ziggurat method) or into uniform ones. The same seed gives the same noise on
/// every machine, and a sensor added to a study leaves the noise of the others
/// as it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Noise {
    /// seed of all streams
    pub seed: u64,
    /// time between two draws; the output step where it is left out
    pub sample_step: Option<f64>,
    /// how strong, by the output's name; outputs left out are exact
    pub levels: BTreeMap<String, Level>,
    /// process noise: the spectral density q of white noise on a state's derivative (variance per
    /// unit of time), by the state's name. It is drawn with the samples and held in between, with
    /// variance q/Δ for a sampling time Δ. Its streams are those of the names with `'` before them
    pub process: BTreeMap<String, f64>,
}

/// The noise of one output: the standard deviation of a Gaussian one, or the bound of a
/// uniform one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// standard deviation, in the unit of the output
    Absolute(f64),
    /// standard deviation as a fraction of the present value: 0.05 is 5 %
    Relative(f64),
    /// every error from −a to a is equally likely, none is larger; a in the unit of the
    /// output. The standard deviation is a/√3
    Uniform(f64),
}

impl Level {
    /// The number that says how strong it is: a deviation, a fraction or a bound.
    #[must_use]
    pub fn size(self) -> f64 {
        match self {
            Level::Absolute(size) | Level::Relative(size) | Level::Uniform(size) => size,
        }
    }

    /// The variance of the noise where the output has a value.
    #[must_use]
    pub fn variance(self, value: f64) -> f64 {
        match self {
            Level::Absolute(deviation) => deviation.powi(2),
            Level::Relative(share) => (share * value).powi(2),
            Level::Uniform(bound) => bound.powi(2) / 3.0,
        }
    }
}

/// The noise of all outputs of a plant, in their order, and of its states.
#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    channels: Vec<Option<Channel>>,
    process: Vec<Option<Wander>>,
}

#[derive(Clone, Debug)]
struct Channel {
    level: Level,
    stream: ChaCha8Rng,
    deviate: f64,
}

/// What moves a state besides the plant.
#[derive(Clone, Debug)]
struct Wander {
    deviation: f64,
    stream: ChaCha8Rng,
    deviate: f64,
}

fn stream(seed: u64, name: &str) -> ChaCha8Rng {
    let mut stream = ChaCha8Rng::seed_from_u64(seed);
    stream.set_stream(fnv1a(name));
    stream
}

/// The standard normal deviate that a start or a parameter of this name has in the run of a seed,
/// from a stream of its own: that of the name with `±` before it (as in [`Noise`]).
#[must_use]
pub fn deviate(seed: u64, name: &str) -> f64 {
    StandardNormal.sample(&mut stream(seed, &format!("±{name}")))
}

impl Sensors {
    /// For a plant with these outputs and states, sampled every `step`.
    pub(crate) fn new(
        noise: &Noise,
        outputs: &[String],
        states: &[String],
        step: f64,
    ) -> Result<Self, Error> {
        for (name, level) in &noise.levels {
            if !outputs.contains(name) {
                let expected = format!("one of the outputs: {}", outputs.join(", "));
                return Err(Error::setting("noise of", expected, format!("'{name}'")));
            }
            let value = level.size();
            if !(value >= 0.0 && value.is_finite()) {
                let what = format!("noise of '{name}'");
                return Err(Error::setting(what, "a finite number, 0 or above", value));
            }
        }
        let channel = |name: &String| {
            Some(Channel {
                level: *noise.levels.get(name)?,
                stream: stream(noise.seed, name),
                deviate: 0.0,
            })
        };
        let wander = |name: &String| {
            let density = *noise.process.get(name).filter(|density| **density > 0.0)?;
            Some(Wander {
                deviation: (density / step).sqrt(),
                stream: stream(noise.seed, &format!("'{name}")),
                deviate: 0.0,
            })
        };
        Self::check_process(&noise.process, states)?;
        Ok(Self {
            channels: outputs.iter().map(channel).collect(),
            process: states.iter().map(wander).collect(),
        })
    }

    fn check_process(process: &BTreeMap<String, f64>, states: &[String]) -> Result<(), Error> {
        for (name, &density) in process {
            if !states.contains(name) {
                let expected = format!("one of the states: {}", states.join(", "));
                return Err(Error::setting(
                    "process noise of",
                    expected,
                    format!("'{name}'"),
                ));
            }
            if !(density >= 0.0 && density.is_finite()) {
                let what = format!("process noise of '{name}'");
                return Err(Error::setting(what, "a finite number, 0 or above", density));
            }
        }
        Ok(())
    }

    /// True where every output is exact and nothing but the plant moves its states.
    pub(crate) fn are_exact(&self) -> bool {
        self.channels.iter().all(Option::is_none) && self.process.iter().all(Option::is_none)
    }

    /// The states that noise moves, by place.
    pub(crate) fn moved(&self) -> impl Iterator<Item = usize> + '_ {
        let process = self.process.iter().enumerate();
        process.filter_map(|(i, wander)| wander.is_some().then_some(i))
    }

    /// What noise adds to the derivative of a state at present.
    pub(crate) fn drive(&self, state: usize) -> f64 {
        let wander = self.process[state].as_ref();
        wander.map_or(0.0, |wander| wander.deviation * wander.deviate)
    }

    /// What noise does at every sensor, then to every moved state, at present.
    pub(crate) fn disturbances(&self) -> impl Iterator<Item = f64> + '_ {
        let sensors = (0..self.channels.len()).map(|i| self.disturbance(i));
        sensors.chain(self.moved().map(|state| self.drive(state)))
    }

    /// Draws the next sample of every channel.
    pub(crate) fn draw(&mut self) {
        for wander in self.process.iter_mut().flatten() {
            wander.deviate = StandardNormal.sample(&mut wander.stream);
        }
        for channel in self.channels.iter_mut().flatten() {
            channel.deviate = match channel.level {
                Level::Absolute(_) | Level::Relative(_) => {
                    StandardNormal.sample(&mut channel.stream)
                }
                Level::Uniform(_) => {
                    let share: f64 = StandardUniform.sample(&mut channel.stream);
                    2.0 * share - 1.0
                }
            };
        }
    }

    /// What sensor `index` shows of the value.
    pub(crate) fn measured(&self, index: usize, value: f64) -> f64 {
        match self.disturbed(index) {
            Disturbed::Not => value,
            Disturbed::Added => value + self.disturbance(index),
            Disturbed::Multiplied => value * self.disturbance(index),
        }
    }

    /// What noise does at sensor `index`.
    pub(crate) fn disturbed(&self, index: usize) -> Disturbed {
        match self.channels[index].as_ref().map(|channel| channel.level) {
            None => Disturbed::Not,
            Some(Level::Absolute(_) | Level::Uniform(_)) => Disturbed::Added,
            Some(Level::Relative(_)) => Disturbed::Multiplied,
        }
    }

    /// The number that is added at sensor `index` at present, or multiplied with.
    pub(crate) fn disturbance(&self, index: usize) -> f64 {
        self.channels[index].as_ref().map_or(0.0, |channel| {
            let Channel { level, deviate, .. } = channel;
            match level {
                Level::Absolute(size) | Level::Uniform(size) => size * deviate,
                Level::Relative(fraction) => 1.0 + fraction * deviate,
            }
        })
    }
}

/// How noise meets a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Disturbed {
    Not,
    Added,
    Multiplied,
}

/// 64-bit FNV-1a.
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws(seed: u64, outputs: &[&str], of: usize, count: usize) -> Vec<f64> {
        draws_of(Level::Absolute(2.0), seed, outputs, of, count)
    }

    fn draws_of(level: Level, seed: u64, outputs: &[&str], of: usize, count: usize) -> Vec<f64> {
        let outputs: Vec<String> = outputs.iter().map(ToString::to_string).collect();
        let levels = outputs.iter().map(|n| (n.clone(), level));
        let noise = Noise {
            seed,
            sample_step: None,
            levels: levels.collect(),
            ..Noise::default()
        };
        let mut sensors = Sensors::new(&noise, &outputs, &[], 1.0).unwrap();
        let draw = |_| {
            sensors.draw();
            sensors.measured(of, 10.0)
        };
        (0..count).map(draw).collect()
    }

    #[test]
    fn a_sensor_keeps_its_noise_when_another_joins() {
        assert_eq!(draws(7, &["a"], 0, 50), draws(7, &["b", "a"], 1, 50));
        assert_ne!(draws(7, &["a"], 0, 50), draws(7, &["b", "a"], 0, 50));
        assert_ne!(draws(7, &["a"], 0, 50), draws(8, &["a"], 0, 50));
    }

    /// One draw per seed: mean 0, variance 1, and nothing in common with another name or the
    /// noise of a sensor that is called so.
    #[test]
    fn deviates_of_names_are_normal_and_independent() {
        let n = 20_000;
        let of = |name: &str| -> Vec<f64> { (0..n).map(|seed| deviate(seed, name)).collect() };
        let mean = |z: &mut dyn Iterator<Item = f64>| z.sum::<f64>() / n as f64;
        let (a, b) = (of("a"), of("b"));
        let noise: Vec<f64> = (0..n)
            .map(|s| draws(s, &["a"], 0, 1)[0] / 2.0 - 5.0)
            .collect();
        let four = 4.0 / (n as f64).sqrt();
        assert!(mean(&mut a.iter().copied()).abs() < four);
        let variance = mean(&mut a.iter().map(|z| z * z));
        assert!((variance - 1.0).abs() < four * 2.0_f64.sqrt(), "{variance}");
        for other in [&b, &noise] {
            let common = mean(&mut a.iter().zip(other).map(|(a, b)| a * b));
            assert!(common.abs() < four, "{common}");
        }
    }

    #[test]
    fn the_stream_is_fixed() {
        let expected = [10.756173956702993, 9.441604095252226, 6.108883197852315];
        let found = draws(1, &["y"], 0, 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn mean_deviation_and_tails_are_normal() {
        let n = 200_000;
        let z: Vec<f64> = draws(3, &["y"], 0, n)
            .iter()
            .map(|y| (y - 10.0) / 2.0)
            .collect();
        let mean = z.iter().sum::<f64>() / n as f64;
        let variance = z.iter().map(|z| z * z).sum::<f64>() / n as f64 - mean * mean;
        let beyond = z.iter().filter(|z| z.abs() > 1.959_964).count() as f64 / n as f64;
        let lag: f64 = z.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01 && lag.abs() < 0.01, "{mean} {lag}");
        assert!((variance - 1.0).abs() < 0.015, "{variance}");
        assert!((beyond - 0.05).abs() < 0.002, "{beyond}");
    }

    /// Mean 0, variance a²/3 and fourth moment a⁴/5; no error beyond the bound.
    #[test]
    fn uniform_noise_fills_its_bound_and_no_more() {
        let n = 200_000;
        let e: Vec<f64> = draws_of(Level::Uniform(0.5), 3, &["y"], 0, n)
            .iter()
            .map(|y| y - 10.0)
            .collect();
        let mean = |power: i32| e.iter().map(|e| e.powi(power)).sum::<f64>() / n as f64;
        // four standard errors of each moment
        assert!(mean(1).abs() < 4.0 * 0.5 / (3.0 * n as f64).sqrt());
        assert!((mean(2) / (0.25 / 3.0) - 1.0).abs() < 0.01, "{}", mean(2));
        assert!(
            (mean(4) / (0.0625 / 5.0) - 1.0).abs() < 0.015,
            "{}",
            mean(4)
        );
        let largest = e.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
        assert!(
            largest <= 0.5 * (1.0 + 1e-14) && largest > 0.4999,
            "{largest}"
        );
        let lag: f64 = e.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
        assert!(lag.abs() < 1e-3, "{lag}");
    }

    #[test]
    fn impossible_levels_are_refused() {
        let outputs = ["y".to_string()];
        for (name, level) in [
            ("z", Level::Absolute(1.0)),
            ("y", Level::Relative(-0.1)),
            ("y", Level::Uniform(f64::INFINITY)),
        ] {
            let noise = Noise {
                levels: [(name.to_string(), level)].into(),
                ..Noise::default()
            };
            let error = Sensors::new(&noise, &outputs, &[], 1.0).unwrap_err();
            assert!(matches!(error, Error::Setting { .. }), "{error}");
        }
    }
}
