//! `[fit]`: what is found from logs, within what, and by what it is judged.

use super::keys::{CANDIDATE, FIT, PRIOR};
use super::section::Entry;
use super::simulate::{self, Expression};
use super::{Name, Noise, sensors};
use lynkeus_answer::Error;

/// What `fit` finds.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// Parameters of the plant.
    pub parameters: Vec<Name>,
    /// Those of them that are searched as logarithms; noises and densities always are.
    pub log: Vec<Name>,
    /// Outputs whose noise is found.
    pub noise: Chosen,
    /// Outputs the standard deviation of whose noise is a parameter or a variable of the model: (output, which).
    pub deviations: Vec<(Name, Name)>,
    /// States and unknown inputs whose spectral density is found.
    pub process_noise: Chosen,
    /// States whose start is found, one for each log; nothing is then uncertain about it.
    pub initial: Vec<Name>,
    /// Ranges: (name, least, greatest value).
    pub bounds: Vec<(Name, (f64, f64))>,
    /// What was known before.
    pub priors: Vec<(Name, Prior)>,
    /// What is least at the best values.
    pub objective: Objective,
    /// The study's own values and so many further ones less one, from which the search starts; without a number
    /// from further ones where the first end is doubtful.
    pub starts: Option<usize>,
    /// Seed of those.
    pub seed: u64,
    /// The share at the end of each log that is not fitted, but predicted.
    pub held_out: Option<f64>,
    /// Experiments that could be made, by names of the user's own.
    pub candidates: Vec<(Name, Candidate)>,
}

/// An experiment that could be made; what it does not say is as in the first log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidate {
    /// Further sensors, by the outputs or states that they show.
    pub sensors: Vec<(Name, Noise)>,
    /// Known inputs as expressions of time.
    pub inputs: Vec<(Name, Expression)>,
    /// The usual time between two rows.
    pub every: Option<f64>,
    /// How long it lasts.
    pub duration: Option<f64>,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            parameters: vec![],
            log: vec![],
            noise: Chosen::Named(vec![]),
            deviations: vec![],
            process_noise: Chosen::Named(vec![]),
            initial: vec![],
            bounds: vec![],
            priors: vec![],
            objective: Objective::Innovations,
            starts: None,
            seed: 0,
            held_out: None,
            candidates: vec![],
        }
    }
}

/// All of a kind, or these.
#[derive(Clone, Debug, PartialEq)]
pub enum Chosen {
    /// Every one.
    All,
    /// These.
    Named(Vec<Name>),
}

/// A normal distribution that a value is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation, above 0.
    pub sd: f64,
}

/// What a fit makes least.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// −log L of the filter's innovations.
    Innovations,
    /// The same of the plant alone: from its start without corrections, all errors the sensors'.
    Simulation,
}

pub(super) fn read(entry: Entry<'_>) -> Result<FitSettings, Error> {
    let mut section = entry.section("[fit]", &FIT)?;
    let objectives = [
        ("innovations", Objective::Innovations),
        ("simulation", Objective::Simulation),
    ];
    let mut names = |key| {
        let names = section.optional(key, |e| e.list_of(Entry::name))?;
        Ok::<_, Error>(names.unwrap_or_default())
    };
    let (parameters, log, initial) = (names("parameters")?, names("log")?, names("initial")?);
    let (noise, deviations) = noise(section.take("noise"))?;
    Ok(FitSettings {
        parameters,
        log,
        initial,
        noise,
        deviations,
        process_noise: chosen(section.take("process_noise"))?,
        bounds: simulate::pairs(section.take("bounds"), range)?,
        priors: simulate::pairs(section.take("priors"), prior)?,
        objective: section
            .optional("objective", |e| e.choice(&objectives))?
            .unwrap_or(Objective::Innovations),
        starts: section.optional("starts", starts)?,
        seed: section.optional("seed", |e| e.whole(0))?.unwrap_or(0),
        held_out: section.optional("held_out", super::tune::share)?,
        candidates: simulate::pairs(section.take("candidates"), candidate)?,
    })
}

/// Most searches of a fit.
const STARTS: usize = 100_000;

fn starts(entry: Entry<'_>) -> Result<usize, Error> {
    let refusal = entry.wrong(&format!("a whole number from 1 to {STARTS}"));
    let whole = entry.whole(1).ok().and_then(|n| usize::try_from(n).ok());
    whole.filter(|n| *n <= STARTS).ok_or(refusal)
}

fn candidate(entry: Entry<'_>) -> Result<Candidate, Error> {
    let mut section = entry.section("a candidate of [fit]", &CANDIDATE)?;
    Ok(Candidate {
        sensors: simulate::pairs(section.take("sensors"), |entry| {
            let refusal = entry.wrong("a noise above 0: without noise one reading would tell all");
            let noise = sensors::noise(entry)?;
            (noise.size() > 0.0).then_some(noise).ok_or(refusal)
        })?,
        inputs: simulate::pairs(section.take("inputs"), simulate::expression)?,
        every: section.optional("every", Entry::positive)?,
        duration: section.optional("duration", Entry::positive)?,
    })
}

/// Outputs whose noise is found, and those whose noise the model names.
fn noise(entry: Option<Entry<'_>>) -> Result<(Chosen, Vec<(Name, Name)>), Error> {
    let table = match entry {
        Some(entry) if entry.is_table() => entry,
        other => return Ok((chosen(other)?, vec![])),
    };
    let (mut found, mut named) = (vec![], vec![]);
    for (output, value) in table.pairs()? {
        let refusal = value.wrong("true, or the name of a parameter or a variable of the model");
        match (value.as_boolean(), value.as_text()) {
            (Some(true), _) => found.push(output),
            (Some(false), _) => {}
            (None, Some(_)) => named.push((output, value.name()?)),
            (None, None) => return Err(refusal),
        }
    }
    Ok((Chosen::Named(found), named))
}

fn chosen(entry: Option<Entry<'_>>) -> Result<Chosen, Error> {
    let Some(entry) = entry else {
        return Ok(Chosen::Named(vec![]));
    };
    match entry.as_boolean() {
        Some(true) => Ok(Chosen::All),
        Some(false) => Ok(Chosen::Named(vec![])),
        None if entry.is_list() => Ok(Chosen::Named(entry.list_of(Entry::name)?)),
        None => Err(entry.wrong("true, false or a list of names")),
    }
}

fn range(entry: Entry<'_>) -> Result<(f64, f64), Error> {
    let refusal = entry.wrong("[least, greatest value]");
    match entry.list_of(Entry::number)?[..] {
        [low, high] if low < high => Ok((low, high)),
        _ => Err(refusal),
    }
}

fn prior(entry: Entry<'_>) -> Result<Prior, Error> {
    let [no_mean, no_deviation] = ["mean", "sd"].map(|key| {
        entry.wrong(&format!(
            "a table with `mean` and `sd`, such as {{ mean = 0.04, sd = 0.01 }}; `{key}` is missing"
        ))
    });
    let mut section = entry.section("a prior of [fit]", &PRIOR)?;
    let mean = section.optional("mean", Entry::number)?.ok_or(no_mean)?;
    let sd = section
        .optional("sd", Entry::positive)?
        .ok_or(no_deviation)?;
    Ok(Prior { mean, sd })
}
