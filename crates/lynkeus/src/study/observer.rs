//! `[observer]`: the family and its tuning.

use super::Name;
use super::section::{Entry, Section};
use crate::Error;

const KEYS: &[&str] = &[
    "family",
    "theta",
    "delta",
    "r",
    "gain",
    "S",
    "partials",
    "chains",
    "initial",
    "clamp",
    // Words of families that are known and not built yet.
    "k",
    "correction",
    "S0",
    "variant",
    "poles",
    "filter_poles",
    "filter_initial",
    "partition",
    "rate",
    "gain_limit",
];

/// Keys that belong to families this version does not have.
const FOREIGN: &[(&str, &str)] = &[
    ("k", "block-triangular"),
    ("correction", "block-triangular"),
    ("S0", "state-affine"),
    ("variant", "drift-observable"),
    ("poles", "drift-observable"),
    ("filter_poles", "drift-observable"),
    ("filter_initial", "drift-observable"),
    ("partition", "unknown-input"),
    ("rate", "unknown-input"),
    ("gain_limit", "unknown-input"),
];

const FAMILIES: &[(&str, Option<Family>)] = &[
    ("auto", Some(Family::Auto)),
    ("triangular", Some(Family::Triangular)),
    ("block-triangular", None),
    ("state-affine", None),
    ("drift-observable", None),
    ("unknown-input", None),
    ("ekf", None),
    ("ukf", None),
];

/// The observer family.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Family {
    /// The first family that fits the plant.
    #[default]
    Auto,
    /// High gain on triangular chains (Hammouri, Targui, Armanet).
    Triangular,
}

/// The observer's tuning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObserverSettings {
    /// The family.
    pub family: Family,
    /// The gain parameter θ, in 1/(unit of time): one for all chains, or one per chain; empty
    /// where the study gives none.
    pub theta: Vec<f64>,
    /// The exponents δ of θ, one per chain; empty leaves the choice to the design.
    pub delta: Vec<f64>,
    /// The factors r of the gain: one for all chains, or one per chain; empty means 1.
    pub r: Vec<f64>,
    /// Where the matrices S come from.
    pub gain: Gain,
    /// Divide the gain by the chain's partials at the estimate.
    pub partials: bool,
    /// The states of each chain, where the user decides.
    pub chains: Option<Vec<Vec<Name>>>,
    /// Where the estimate starts.
    pub initial: InitialEstimate,
    /// Limit the estimate to [min, max] inside the model's functions.
    pub clamp: bool,
}

/// Where the matrices S of the triangular gain come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Gain {
    /// The construction in the proof of Lemma 1.
    #[default]
    Lemma1,
    /// Given, one per chain.
    Explicit(Vec<Tridiagonal>),
}

/// A symmetric tridiagonal matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Tridiagonal {
    /// The diagonal, n entries.
    pub diag: Vec<f64>,
    /// The entries beside the diagonal, n − 1.
    pub off: Vec<f64>,
}

/// Where the estimate starts; what is not given starts at the plant's own start value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InitialEstimate {
    /// The start of everything not listed in `values`.
    pub default: Option<f64>,
    /// Starts of single states and unknown inputs.
    pub values: Vec<(Name, f64)>,
}

pub(super) fn read(entry: Entry<'_>) -> Result<ObserverSettings, Error> {
    let mut section = entry.section("[observer]", KEYS)?;
    let family = section.optional("family", family)?.unwrap_or_default();
    refuse_foreign(&mut section)?;
    Ok(ObserverSettings {
        family,
        theta: positives(section.take("theta"))?,
        delta: positives(section.take("delta"))?,
        r: positives(section.take("r"))?,
        gain: gain(&mut section)?,
        partials: section
            .optional("partials", Entry::boolean)?
            .unwrap_or_default(),
        chains: section.optional("chains", chains)?,
        initial: section.optional("initial", initial)?.unwrap_or_default(),
        clamp: section
            .optional("clamp", Entry::boolean)?
            .unwrap_or_default(),
    })
}

fn family(entry: Entry<'_>) -> Result<Family, Error> {
    let absent = entry.wrong("\"auto\" or \"triangular\" in this version");
    entry.choice(FAMILIES)?.ok_or(absent)
}

fn refuse_foreign(section: &mut Section<'_>) -> Result<(), Error> {
    for (key, owner) in FOREIGN {
        if let Some(entry) = section.take(key) {
            return Err(entry
                .refuse_key(&format!(
                    "belongs to the {owner} family, which this version does not have"
                ))
                .hint(
                    "the triangular family takes theta, delta, r, gain, S, partials and chains",
                ));
        }
    }
    Ok(())
}

fn positives(entry: Option<Entry<'_>>) -> Result<Vec<f64>, Error> {
    entry.map_or(Ok(Vec::new()), |e| e.one_or_list(Entry::positive))
}

fn gain(section: &mut Section<'_>) -> Result<Gain, Error> {
    let lmi = section.optional("gain", |e| {
        let absent = e.wrong("\"lemma1\" in this version (or give S)");
        match e.choice(&[("lemma1", true), ("lmi", false)])? {
            true => Ok(()),
            false => Err(absent),
        }
    })?;
    match (section.take("S"), lmi) {
        (None, _) => Ok(Gain::Lemma1),
        (Some(entry), Some(())) => {
            Err(entry.refuse_key("and `gain` exclude each other: S gives the gain itself"))
        }
        (Some(entry), None) => Ok(Gain::Explicit(entry.list_of(tridiagonal)?)),
    }
}

fn tridiagonal(entry: Entry<'_>) -> Result<Tridiagonal, Error> {
    let shape = entry.wrong("{ diag = [n numbers], off = [n - 1 numbers] }");
    let mut section = entry.section("an entry of `S`", &["diag", "off"])?;
    let (Some(diag), Some(off)) = (section.take("diag"), section.take("off")) else {
        return Err(shape);
    };
    let matrix = Tridiagonal {
        diag: diag.list_of(Entry::number)?,
        off: off.list_of(Entry::number)?,
    };
    if matrix.diag.len() != matrix.off.len() + 1 {
        return Err(shape.hint(format!(
            "diag has {} numbers and off has {}",
            matrix.diag.len(),
            matrix.off.len()
        )));
    }
    Ok(matrix)
}

fn chains(entry: Entry<'_>) -> Result<Vec<Vec<Name>>, Error> {
    entry.list_of(|chain| {
        let refusal = chain.wrong("a list with at least one state");
        let names = chain.list_of(Entry::name)?;
        if names.is_empty() {
            Err(refusal)
        } else {
            Ok(names)
        }
    })
}

fn initial(entry: Entry<'_>) -> Result<InitialEstimate, Error> {
    let mut start = InitialEstimate::default();
    for (name, value) in entry.pairs()? {
        let value = value.number()?;
        if name.text == "default" {
            start.default = Some(value);
        } else {
            start.values.push((name, value));
        }
    }
    Ok(start)
}
