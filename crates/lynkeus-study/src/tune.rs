//! `[tune]`: which keys are swept, and what a value is judged by.

use super::Name;
use super::keys::{RANGE, TUNE};
use super::section::Entry;
use super::simulate::{self, Expression};
use lynkeus_answer::Error;
use lynkeus_observers::Family;

/// Values of a range whose study does not say how many.
const POINTS: usize = 21;

/// Most values of one key.
const MOST_POINTS: u64 = 10_000;

/// What a key begins with that is a density, or all of them,
const DENSITY: &str = "process_noise";
/// and with that is the noise of an output.
const NOISE: &str = "noise";

/// What a key of a sweep means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Swept {
    /// a key of `[observer]`, and where within its value, counted from 0
    Tuning(String, Vec<usize>),
    /// the spectral density of an estimated quantity in `[process_noise]`; of none, all of them
    Density(Option<String>),
    /// the noise of an output in `[sensors]`; of none, that of all
    Noise(Option<String>),
}

impl Swept {
    /// `theta[1]` is the key `theta` and the index 0, `noise.y` the noise of the output y.
    #[must_use]
    pub fn read(key: &str) -> Option<Self> {
        let (section, name) = match key.split_once('.') {
            Some((section, name)) => (section, Some(name.to_owned())),
            None => (key, None),
        };
        match section {
            DENSITY => Some(Self::Density(name)),
            NOISE => Some(Self::Noise(name)),
            _ => {
                let (base, path) = place(key)?;
                Some(Self::Tuning(base.to_owned(), path))
            }
        }
    }

    /// Whether a family reads it: noises are what filters weigh readings by.
    #[must_use]
    pub fn is_of(&self, family: &dyn Family) -> bool {
        match self {
            Self::Tuning(base, _) => family.owns(base),
            Self::Density(_) | Self::Noise(_) => family.is_filter(),
        }
    }
}

/// `theta[1]` is the key `theta` and the index 0.
fn place(key: &str) -> Option<(&str, Vec<usize>)> {
    let Some((base, rest)) = key.split_once('[') else {
        return Some((key, vec![]));
    };
    let indices = rest.strip_suffix(']')?.split("][");
    let index = |text: &str| text.trim().parse::<usize>().ok()?.checked_sub(1);
    Some((base.trim(), indices.map(index).collect::<Option<_>>()?))
}

/// How a tuning is swept and judged.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneSettings {
    /// What to sweep ([`Swept`](crate::Swept)) with its values; empty lets the tool choose.
    pub keys: Vec<(Name, Values)>,
    /// The scaled error below which an estimate counts as settled.
    pub tolerance: f64,
    /// What is added to inputs of the plant for the ultimate bound, as expressions of time.
    pub disturbance: Vec<(Name, Expression)>,
    /// On a log: the share of each block of samples that is held out, in (0, 1).
    pub held_out: f64,
    /// On a log: the number of blocks, at least 2.
    pub blocks: usize,
}

impl Default for TuneSettings {
    fn default() -> Self {
        Self {
            keys: Vec::new(),
            tolerance: 0.05,
            disturbance: Vec::new(),
            held_out: 0.25,
            blocks: 20,
        }
    }
}

/// The values that a key takes in a sweep: its own, or factors on a key that is a list.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// These.
    Listed(Vec<f64>),
    /// Evenly spread.
    Spread {
        /// The first; `None` is a quarter of the study's value.
        from: Option<f64>,
        /// The last; `None` is four times the study's value.
        to: Option<f64>,
        /// How many, ends included.
        points: usize,
        /// Evenly in what sense.
        scale: Scale,
    },
}

impl Default for Values {
    fn default() -> Self {
        Self::Spread {
            from: None,
            to: None,
            points: POINTS,
            scale: Scale::Log,
        }
    }
}

/// How values are spread over a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal ratios.
    Log,
    /// Equal differences.
    Linear,
}

pub(super) fn read(entry: Entry<'_>) -> Result<TuneSettings, Error> {
    let mut section = entry.section("[tune]", &TUNE)?;
    let defaults = TuneSettings::default();
    let keys = section.optional("keys", |table| {
        let mut keys = vec![];
        for (name, entry) in table.pairs()? {
            let is_section = [DENSITY, NOISE].contains(&name.text.as_str());
            match is_section && entry.has_inner() {
                true => keys.extend(dotted(&name.text, entry)?),
                false => keys.push((name, values(entry)?)),
            }
        }
        Ok(keys)
    })?;
    Ok(TuneSettings {
        keys: keys.unwrap_or_default(),
        tolerance: section
            .optional("tolerance", share)?
            .unwrap_or(defaults.tolerance),
        disturbance: simulate::pairs(section.take("disturbance"), simulate::expression)?,
        held_out: section
            .optional("held_out", share)?
            .unwrap_or(defaults.held_out),
        blocks: section
            .optional("blocks", |e| e.whole(2))?
            .map_or(defaults.blocks, |n| {
                usize::try_from(n).unwrap_or(usize::MAX)
            }),
    })
}

/// `noise.y = …`, which TOML takes for a table `noise`.
fn dotted(section: &str, entry: Entry<'_>) -> Result<Vec<(Name, Values)>, Error> {
    let key = |(name, entry): (Name, Entry<'_>)| {
        let text = format!("{section}.{name}");
        Ok((Name { text, ..name }, values(entry)?))
    };
    entry.pairs()?.into_iter().map(key).collect()
}

/// A number between 0 and 1, ends excluded.
pub(super) fn share(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a number between 0 and 1");
    let number = entry.number().ok();
    number.filter(|x| *x > 0.0 && *x < 1.0).ok_or(refusal)
}

fn values(entry: Entry<'_>) -> Result<Values, Error> {
    if entry.is_list() {
        let refusal = entry.wrong("a list of at least one number");
        let numbers = entry.list_of(Entry::number)?;
        return match numbers.is_empty() {
            true => Err(refusal),
            false => Ok(Values::Listed(numbers)),
        };
    }
    if !entry.is_table() {
        return Err(entry.wrong(
            "a list of values, or a range such as { from = 1, to = 6, points = 21, scale = \"log\" }",
        ));
    }
    spread(entry)
}

fn spread(entry: Entry<'_>) -> Result<Values, Error> {
    let order = entry.wrong("a range whose `from` is below its `to`");
    let positive = entry.wrong("a range of positive numbers, or one with scale = \"linear\"");
    let mut range = entry.section("a range of `keys` of [tune]", &RANGE)?;
    let from = range.optional("from", Entry::number)?;
    let to = range.optional("to", Entry::number)?;
    let scales = [("log", Scale::Log), ("linear", Scale::Linear)];
    let scale = range.optional("scale", |e| e.choice(&scales))?;
    let scale = scale.unwrap_or(Scale::Log);
    if let (Some(from), Some(to)) = (from, to)
        && from >= to
    {
        return Err(order);
    }
    if scale == Scale::Log && [from, to].iter().flatten().any(|x| *x <= 0.0) {
        return Err(positive);
    }
    let points = range.optional("points", |e| {
        let refusal = e.wrong(&format!("at most {MOST_POINTS}"));
        e.whole(2)
            .and_then(|n| (n <= MOST_POINTS).then_some(n).ok_or(refusal))
    })?;
    Ok(Values::Spread {
        from,
        to,
        points: points.map_or(POINTS, |n| usize::try_from(n).unwrap_or(POINTS)),
        scale,
    })
}
