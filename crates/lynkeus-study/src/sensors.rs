//! `[sensors]`: what is measured, what is unknown, how noisy.

use std::collections::BTreeMap;

use lynkeus_observers::{Tuning, Value};
use lynkeus_run::Level;

use super::Name;
use super::keys::{NOISE, SENSORS};
use super::section::{Entry, Section};
use lynkeus_answer::Error;

/// What the sensors see of the plant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors {
    /// The measured outputs, in the order of their chains; `None` means every output.
    pub measured: Option<Vec<Name>>,
    /// Inputs nobody measures, estimated along with the state.
    pub unknown: Vec<Name>,
    /// Inputs that act on the plant and that the observer takes as zero.
    pub disturbances: Vec<Name>,
    /// Measurement noise per measured output: added by `simulate`, counted by the filters.
    pub noise: Vec<(Name, Noise)>,
    /// The range that a sensor can show: (output, lowest, highest reading).
    pub limits: Vec<(Name, f64, f64)>,
    /// How wrong the readings of known inputs are, each from sample to sample.
    pub input_noise: Vec<(Name, Noise)>,
    /// Correlations of the noises of two outputs.
    pub correlation: Vec<(Name, Name, f64)>,
    /// Offsets to estimate: outputs and known inputs, with how far off they may be at the start.
    pub bias: Vec<(Name, f64)>,
    /// Which cells of a log are no readings, by output.
    pub screens: Vec<(Name, Screen)>,
    /// Whose readings come later than their samples are taken, by output.
    pub late: Vec<(Name, Late)>,
}

/// How much later than its sample is taken a reading comes.
#[derive(Clone, Debug, PartialEq)]
pub enum Late {
    /// By as much time, every one.
    By(f64),
    /// What this column of the log says: its header, or an expression of headers.
    TakenAt(Name),
}

impl Late {
    /// The key that says so.
    #[must_use]
    pub fn key(&self) -> &'static str {
        match self {
            Late::By(_) => "delay",
            Late::TakenAt(_) => "taken_at",
        }
    }
}

/// Why a cell of a log is no reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Screen {
    /// It is below the least or above the largest plausible one.
    Plausible(f64, f64),
    /// It equals the one before: what samples more slowly than the log was held.
    Repeats,
    /// So many before were equal to it: the sensor is stuck.
    Frozen(u64),
}

/// White measurement noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// Standard deviation, in the unit of the output.
    Absolute(f64),
    /// Standard deviation as a fraction of the present value: `"5%"` is 0.05.
    Relative(f64),
    /// Every error from −a to a is equally likely, none is larger: `{ uniform = a }`.
    Uniform(f64),
}

impl Noise {
    /// The number that says how strong it is: a deviation, a fraction or a bound.
    #[must_use]
    pub fn size(self) -> f64 {
        match self {
            Noise::Absolute(size) | Noise::Relative(size) | Noise::Uniform(size) => size,
        }
    }
}

impl From<Noise> for Level {
    fn from(noise: Noise) -> Self {
        match noise {
            Noise::Absolute(deviation) => Level::Absolute(deviation),
            Noise::Relative(share) => Level::Relative(share),
            Noise::Uniform(bound) => Level::Uniform(bound),
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<Sensors, Error> {
    let mut section = entry.section("[sensors]", &SENSORS)?;
    Ok(Sensors {
        measured: section.optional("measured", |e| {
            let refusal = e.wrong("a list with at least one output");
            let names = e.list_of(Entry::name)?;
            if names.is_empty() {
                Err(refusal)
            } else {
                Ok(names)
            }
        })?,
        unknown: names(section.take("unknown"))?,
        disturbances: names(section.take("disturbances"))?,
        limits: super::simulate::pairs(section.take("limits"), limits)?
            .into_iter()
            .map(|(name, (low, high))| (name, low, high))
            .collect(),
        bias: super::simulate::pairs(section.take("bias"), bias)?,
        screens: screens(&mut section)?,
        late: late(&mut section)?,
        noise: super::simulate::pairs(section.take("noise"), noise)?,
        input_noise: super::simulate::pairs(section.take("input_noise"), noise)?,
        correlation: super::simulate::pairs(section.take("correlation"), correlations)?
            .into_iter()
            .flat_map(|(one, others)| {
                let others = others.into_iter();
                others.map(move |(other, correlation)| (one.clone(), other, correlation))
            })
            .collect(),
    })
}

impl Sensors {
    /// What the filters take the offsets for at the start, beside what the study says of them.
    pub(super) fn doubt(&self, tuning: &mut Tuning) {
        for (name, deviation) in &self.bias {
            let all = tuning.values.entry("initial_variance".to_owned());
            // something else than a table is refused where it is read
            if let Value::Table(table) = all.or_insert(Value::Table(BTreeMap::new())) {
                let own = table.entry(bias_of(&name.text));
                own.or_insert(Value::Number(deviation * deviation));
            }
        }
    }
}

/// What the offset of a signal is called as a state: `gyro_bias[2]` that of `gyro[2]`.
pub fn bias_of(signal: &str) -> String {
    match signal.split_once('[') {
        Some((array, element)) => format!("{array}_bias[{element}"),
        None => format!("{signal}_bias"),
    }
}

fn bias(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a standard deviation > 0, in the unit of the signal");
    entry.number().ok().filter(|sd| *sd > 0.0).ok_or(refusal)
}

fn correlations(entry: Entry<'_>) -> Result<Vec<(Name, f64)>, Error> {
    super::simulate::pairs(Some(entry), |entry| {
        let refusal = entry.wrong("a correlation between -1 and 1");
        let correlation = entry.number().ok().filter(|c| c.abs() < 1.0);
        correlation.ok_or(refusal)
    })
}

fn screens(section: &mut Section<'_>) -> Result<Vec<(Name, Screen)>, Error> {
    let plausible =
        |entry: Entry<'_>| limits(entry).map(|(low, high)| Screen::Plausible(low, high));
    let repeats = |entry: Entry<'_>| entry.choice(&[("missing", Screen::Repeats)]);
    let frozen = |entry: Entry<'_>| entry.whole(1).map(Screen::Frozen);
    let mut all = super::simulate::pairs(section.take("plausible"), plausible)?;
    all.extend(super::simulate::pairs(section.take("repeats"), repeats)?);
    all.extend(super::simulate::pairs(section.take("frozen"), frozen)?);
    Ok(all)
}

fn late(section: &mut Section<'_>) -> Result<Vec<(Name, Late)>, Error> {
    let delay = |entry: Entry<'_>| {
        let refusal = entry.wrong("a time >= 0, in the unit of the plant's time");
        let delay = entry.number().ok().filter(|delay| *delay >= 0.0);
        delay.map(Late::By).ok_or(refusal)
    };
    let taken = |entry: Entry<'_>| entry.name().map(Late::TakenAt);
    let mut all = super::simulate::pairs(section.take("delay"), delay)?;
    for (name, taken) in super::simulate::pairs(section.take("taken_at"), taken)? {
        if all.iter().any(|(other, _)| *other == name) {
            let message = format!(
                "`delay` and `taken_at` of [sensors] both say when the samples of {name} are taken"
            );
            return Err(name.blame(Error::input(message).hint("keep one of them")));
        }
        all.push((name, taken));
    }
    Ok(all)
}

fn limits(entry: Entry<'_>) -> Result<(f64, f64), Error> {
    let refusal = entry.wrong("[lowest, highest reading]");
    match entry.list_of(Entry::number)?[..] {
        [low, high] if low < high => Ok((low, high)),
        _ => Err(refusal),
    }
}

fn names(entry: Option<Entry<'_>>) -> Result<Vec<Name>, Error> {
    entry.map_or(Ok(Vec::new()), |e| e.list_of(Entry::name))
}

pub(super) fn noise(entry: Entry<'_>) -> Result<Noise, Error> {
    let refusal = entry.wrong(
        "a standard deviation >= 0, a share such as \"5%\", or a bound such as { uniform = 0.05 }",
    );
    if entry.is_table() {
        let mut section = entry.section("noise of [sensors]", &NOISE)?;
        let bound = section.take("uniform").ok_or(refusal)?;
        let wrong = bound.wrong("a bound >= 0, in the unit of the output");
        let bound = bound.number().ok().filter(|a| *a >= 0.0);
        return bound.map(Noise::Uniform).ok_or(wrong);
    }
    let (value, kind): (Option<f64>, fn(f64) -> Noise) = match entry.as_text() {
        Some(text) => {
            let share = text.trim().strip_suffix('%');
            let percent = share.and_then(|p| p.trim().parse::<f64>().ok());
            (percent.map(|p| p / 100.0), Noise::Relative)
        }
        None => (entry.number().ok(), Noise::Absolute),
    };
    value
        .filter(|x| x.is_finite() && *x >= 0.0)
        .map(kind)
        .ok_or(refusal)
}
