//! Measurement noise that can be repeated.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use lynkeus_expr::{Algebra, Binary, Reals};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

use crate::correlation::factor;
use crate::{Error, Result};

mod draws;

pub use draws::{ProcessDraws, process_draws};

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
    /// unit of time), by the state's name. It is drawn with the samples, and so often in between that
    /// a draw which is held for δ, with variance q/δ, acts as white noise. Its streams are those of the
    /// names with `'` before them
    pub process: BTreeMap<String, f64>,
    /// draws of process noise from one sample to the next; as [`process_draws`] finds where it is left out
    pub process_draws: Option<usize>,
    /// errors of the readings of known inputs, by the input's name: the plant has the input, what observes it reads it
    /// with an error that is held from one sample to the next. Their streams are those of the names with `~` before
    /// them
    pub inputs: BTreeMap<String, Level>,
    /// correlations of the noises of two outputs that both have normal ones. The normal deviates of the outputs are then
    /// the lower Cholesky factor of their matrix times those of their streams
    pub correlations: Vec<(String, String, f64)>,
    /// the range that a sensor can show, by the output's name: value and noise beyond an end of it
    /// are shown as that end
    pub limits: BTreeMap<String, Limits>,
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

    /// The variance of the noise where the output is known to be `predicted` with a variance
    /// `spread`: that of a share p is p²E[h²] = p²(ĥ² + spread). With it a linear filter has the least
    /// variance that one can have, and says which.
    pub(crate) fn expected_variance(self, predicted: f64, spread: f64) -> f64 {
        match self {
            Level::Relative(share) => share.powi(2) * (predicted.powi(2) + spread.max(0.0)),
            other => other.variance(predicted),
        }
    }

    /// The same given a reading that contradicts the prediction: p²E[h²] of what that reading with
    /// that noise leaves of the prediction, ĥ + aν with a variance (1 − a)·`spread` for the innovation ν
    /// and the gain a = spread/(spread + noise). The root of a cubic between 0 and 1, by halving.
    pub(crate) fn variance_after(self, reading: f64, predicted: f64, spread: f64) -> f64 {
        let Level::Relative(share) = self else {
            return self.variance(predicted);
        };
        if spread == 0.0 {
            // no reading moves what is certain
            return self.expected_variance(predicted, spread);
        }
        let innovation = reading - predicted;
        let noise = |gain: f64| {
            let value = predicted + gain * innovation;
            share * share * (value * value + spread * (1.0 - gain))
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let gain = 0.5 * (low + high);
            match gain * (spread + noise(gain)) < spread {
                true => low = gain,
                false => high = gain,
            }
        }
        noise(high)
    }
}

/// The range that a sensor can show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// its lower end
    pub low: f64,
    /// its upper end
    pub high: f64,
}

impl Limits {
    /// What the sensor shows of a value.
    #[must_use]
    pub fn shown(self, value: f64) -> f64 {
        self.shown_in(&Reals, &value)
    }

    fn shown_in<A: Algebra>(self, algebra: &A, value: &A::Value) -> A::Value {
        let capped = algebra.binary(Binary::Min, value, &algebra.constant(self.high));
        algebra.binary(Binary::Max, &capped, &algebra.constant(self.low))
    }

    /// Whether a reading only says "at most" or "at least".
    #[must_use]
    pub fn ends(self, reading: f64) -> bool {
        reading <= self.low || reading >= self.high
    }
}

/// The noise of all outputs of a plant, in their order, and of its states.
#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    channels: Vec<Option<Channel>>,
    /// what moves each state besides the plant
    process: Vec<Option<Channel>>,
    limits: Vec<Option<Limits>>,
    /// what each input is misread by
    inputs: Vec<Option<Channel>>,
    /// the lower factor of the correlations of the outputs' deviates, row by row, where there are any
    correlated: Option<Vec<f64>>,
}

/// What is drawn for one output or state.
#[derive(Clone, Debug)]
struct Channel {
    level: Level,
    stream: ChaCha8Rng,
    deviate: f64,
}

impl Channel {
    fn new(level: Level, seed: u64, name: &str) -> Self {
        Self {
            level,
            stream: stream(seed, name),
            deviate: 0.0,
        }
    }

    fn draw(&mut self) {
        self.deviate = match self.level {
            Level::Absolute(_) | Level::Relative(_) => StandardNormal.sample(&mut self.stream),
            Level::Uniform(_) => {
                let share: f64 = StandardUniform.sample(&mut self.stream);
                2.0 * share - 1.0
            }
        };
    }

    /// What is added at present, or multiplied with where the level is relative.
    fn disturbance(&self) -> f64 {
        match self.level {
            Level::Absolute(size) | Level::Uniform(size) => size * self.deviate,
            Level::Relative(fraction) => 1.0 + fraction * self.deviate,
        }
    }
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
    /// For a plant with these outputs and states under such inputs; process noise is held for `hold`.
    pub(crate) fn new(
        noise: &Noise,
        [outputs, states, inputs]: [&[String]; 3],
        hold: f64,
    ) -> Result<Self> {
        for (name, level) in &noise.levels {
            check_name("noise", name, "outputs", outputs)?;
            check_size("noise", name, level.size())?;
        }
        for (name, level) in &noise.inputs {
            check_name("input noise", name, "inputs", inputs)?;
            check_size("input noise", name, level.size())?;
        }
        for (name, &density) in &noise.process {
            check_name("process noise", name, "states", states)?;
            check_size("process noise", name, density)?;
        }
        for (name, Limits { low, high }) in &noise.limits {
            check_name("limits", name, "outputs", outputs)?;
            if low.partial_cmp(high) != Some(Ordering::Less) {
                let what = format!("limits of '{name}'");
                let found = format!("[{low}, {high}]");
                let expected = "a lower end below the upper one";
                return Err(Error::setting(what, expected, found));
            }
        }
        let channel = |name: &String| {
            let level = *noise.levels.get(name)?;
            Some(Channel::new(level, noise.seed, name))
        };
        let process = |name: &String| {
            let density = *noise.process.get(name).filter(|density| **density > 0.0)?;
            let level = Level::Absolute((density / hold).sqrt());
            Some(Channel::new(level, noise.seed, &format!("'{name}")))
        };
        let limits = |name: &String| noise.limits.get(name).copied();
        let misread = |name: &String| {
            let level = *noise.inputs.get(name).filter(|level| level.size() > 0.0)?;
            Some(Channel::new(level, noise.seed, &format!("~{name}")))
        };
        Ok(Self {
            limits: outputs.iter().map(limits).collect(),
            inputs: inputs.iter().map(misread).collect(),
            correlated: correlated(noise, outputs)?,
            channels: outputs.iter().map(channel).collect(),
            process: states.iter().map(process).collect(),
        })
    }

    /// True where no output is noisy and nothing but the plant moves its states.
    pub(crate) fn are_exact(&self) -> bool {
        let mut all = [&self.channels, &self.process, &self.inputs].into_iter();
        all.all(|channels| channels.iter().all(Option::is_none))
    }

    /// How many inputs are misread.
    pub(crate) fn misread(&self) -> usize {
        self.inputs.iter().flatten().count()
    }

    /// The states that noise moves, by place.
    pub(crate) fn moved(&self) -> impl Iterator<Item = usize> + '_ {
        let process = self.process.iter().enumerate();
        process.filter_map(|(i, channel)| channel.is_some().then_some(i))
    }

    /// What noise does at every sensor, then to every moved state, then to every input that is misread, at present.
    pub(crate) fn disturbances(&self) -> impl Iterator<Item = f64> + '_ {
        let at = |channel: &Option<Channel>| channel.as_ref().map_or(0.0, Channel::disturbance);
        let others = self.process.iter().chain(&self.inputs);
        let others = others.filter(|channel| channel.is_some());
        self.channels.iter().chain(others).map(at)
    }

    /// Draws what moves the states from here on, and the next sample of every channel, if it is time.
    pub(crate) fn draw(&mut self, is_sample: bool) {
        let read = self.channels.iter_mut().chain(&mut self.inputs);
        let read = read.filter(|_| is_sample);
        let drawn = self.process.iter_mut().chain(read).flatten();
        drawn.for_each(Channel::draw);
        if is_sample {
            self.correlate();
        }
    }

    /// Makes what was drawn for each sensor what it has in common with those before it, too.
    fn correlate(&mut self) {
        let Some(lower) = &self.correlated else {
            return;
        };
        let count = self.channels.len();
        let drawn = |channel: &Option<Channel>| channel.as_ref().map_or(0.0, |c| c.deviate);
        let own: Vec<f64> = self.channels.iter().map(drawn).collect();
        for (row, channel) in lower.chunks_exact(count.max(1)).zip(&mut self.channels) {
            if let Some(channel) = channel {
                channel.deviate = row.iter().zip(&own).map(|(l, z)| l * z).sum();
            }
        }
    }

    /// Inputs as they are read, given what disturbs those that are misread: numbers, or expressions.
    pub(crate) fn read<A: Algebra>(
        &self,
        algebra: &A,
        inputs: &[A::Value],
        disturbances: &[A::Value],
    ) -> Vec<A::Value> {
        let mut disturbances = disturbances.iter();
        let read = self.inputs.iter().zip(inputs).map(|(channel, value)| {
            let disturbance = channel.as_ref().and_then(|_| disturbances.next());
            disturbed(algebra, channel.as_ref(), value, disturbance)
        });
        read.collect()
    }

    /// What the sensors show of such values that are disturbed so: numbers, or expressions.
    pub(crate) fn shown<A: Algebra>(
        &self,
        algebra: &A,
        values: &[A::Value],
        disturbances: &[A::Value],
    ) -> Vec<A::Value> {
        let channels = self.channels.iter().zip(&self.limits);
        let shown = channels.zip(values.iter().zip(disturbances));
        let shown = shown.map(|((channel, limits), (value, disturbance))| {
            let disturbed = disturbed(algebra, channel.as_ref(), value, Some(disturbance));
            match limits {
                Some(limits) => limits.shown_in(algebra, &disturbed),
                None => disturbed,
            }
        });
        shown.collect()
    }
}

/// A value with what its channel does to it.
fn disturbed<A: Algebra>(
    algebra: &A,
    channel: Option<&Channel>,
    value: &A::Value,
    disturbance: Option<&A::Value>,
) -> A::Value {
    match (channel.map(|channel| channel.level), disturbance) {
        (None, _) | (_, None) => value.clone(),
        (Some(Level::Relative(_)), Some(by)) => algebra.binary(Binary::Mul, value, by),
        (Some(_), Some(by)) => algebra.binary(Binary::Add, value, by),
    }
}

/// The lower factor of the correlations of the outputs' deviates; none where there are none.
///
/// # Errors
/// [`Error::Setting`] for outputs without normal noise, and for a matrix that is not positive definite.
fn correlated(noise: &Noise, outputs: &[String]) -> Result<Option<Vec<f64>>> {
    if noise.correlations.is_empty() {
        return Ok(None);
    }
    let place = |name: &String| {
        check_name("correlation", name, "outputs", outputs)?;
        if !matches!(
            noise.levels.get(name),
            Some(Level::Absolute(_) | Level::Relative(_))
        ) {
            let what = format!("noise of '{name}', which has a correlation");
            return Err(Error::setting(what, "a standard deviation", "none"));
        }
        Ok(outputs.iter().position(|o| o == name).unwrap_or_default())
    };
    let pairs = noise.correlations.iter();
    let pairs = pairs.map(|(a, b, correlation)| Ok((place(a)?, place(b)?, *correlation)));
    let pairs: Vec<(usize, usize, f64)> = pairs.collect::<Result<_>>()?;
    match factor(outputs.len(), &pairs) {
        Some(lower) => Ok(Some(lower)),
        None => {
            let expected = "a positive definite matrix";
            Err(Error::setting("correlations", expected, "one that is not"))
        }
    }
}

/// # Errors
/// [`Error::Setting`] if the name is not among those that are known.
fn check_name(what: &str, name: &str, kind: &str, known: &[String]) -> Result<()> {
    if known.iter().any(|k| k == name) {
        return Ok(());
    }
    let expected = format!("one of the {kind}: {}", known.join(", "));
    let found = format!("'{name}'");
    Err(Error::setting(format!("{what} of"), expected, found))
}

/// # Errors
/// [`Error::Setting`] for what is no size of a noise.
pub(crate) fn check_size(what: &str, name: &str, size: f64) -> Result<()> {
    if size >= 0.0 && size.is_finite() {
        return Ok(());
    }
    let what = format!("{what} of '{name}'");
    Err(Error::setting(what, "a finite number, 0 or above", size))
}

/// 64-bit FNV-1a.
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests;
