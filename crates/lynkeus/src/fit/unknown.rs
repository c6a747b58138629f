//! What a fit finds: its names, where the search starts, within what, and what was known before.

use lynkeus_model::{Home, Plant, Variable};
use lynkeus_study::{Chosen, FitSettings, Name, Noise, Objective, Prior};

use crate::{Error, Study, near};
use lynkeus_experiment::course::filter::noise;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::words::number;

use super::logs::FittedLog;

/// What kind of number it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// a parameter of the plant
    Parameter,
    /// the noise of the output of this place: a deviation, a share or a bound, as the study has it
    Noise(usize),
    /// the spectral density on the state of this place
    Density(usize),
    /// the start of the state of this place, in the log of that one
    Start { state: usize, log: usize },
}

/// What a number is in the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    Plain,
    /// a noise as a share of the output, in percent
    Share,
    /// the bound of a uniform noise
    Bound,
}

/// A number that is found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unknown {
    pub kind: Kind,
    /// of the parameter, output or state
    pub name: String,
    /// where the search starts
    pub start: f64,
    pub low: f64,
    pub high: f64,
    /// searched as a logarithm
    pub is_log: bool,
    pub prior: Option<Prior>,
    pub scale: Scale,
}

impl Kind {
    /// Whether it is a noise or a density.
    pub fn is_noise(self) -> bool {
        matches!(self, Self::Noise(_) | Self::Density(_))
    }

    /// Its section in the answer.
    fn section(self) -> Option<&'static str> {
        match self {
            Self::Parameter => None,
            Self::Noise(_) => Some("noise"),
            Self::Density(_) => Some("process_noise"),
            Self::Start { .. } => Some("initial"),
        }
    }
}

impl Unknown {
    /// `k1`, `noise.level`, `process_noise.x`, `initial.x[1]`: the last by the number of its log.
    pub fn label(&self) -> String {
        match self.kind {
            Kind::Start { log, .. } => format!("{}[{}]", self.key(), log + 1),
            _ => self.key(),
        }
    }

    /// The same without a log.
    pub fn key(&self) -> String {
        let name = &self.name;
        match self.kind.section() {
            Some(section) => format!("{section}.{name}"),
            None => name.clone(),
        }
    }

    /// The same in words.
    pub fn words(&self) -> String {
        let name = &self.name;
        match self.kind {
            Kind::Parameter => name.clone(),
            Kind::Noise(_) => format!("the noise of {name}"),
            Kind::Density(_) => format!("the process noise of {name}"),
            Kind::Start { log, .. } => format!("the start of {name} in log {}", log + 1),
        }
    }
}

/// Noises and densities without bounds of their own lie within this factor of their start.
const REACH: f64 = 1e8;

/// A range from less than so much of the start has nothing below it.
const NEARLY: f64 = 1e-6;

impl Unknown {
    /// Whether it is a noise whose least value stands for 0.
    pub fn reaches_zero(&self) -> bool {
        self.kind.is_noise() && self.low <= NEARLY * self.start
    }

    /// A prior that its bounds contradict.
    pub fn beside_its_prior(&self) -> Option<String> {
        let prior = self.prior?;
        let is_inside = (self.low..=self.high).contains(&prior.mean);
        (!is_inside).then(|| {
            format!(
                "the prior of {} has its mean, {}, outside of the bounds [{}, {}]",
                self.words(),
                number(prior.mean),
                number(self.low),
                number(self.high)
            )
        })
    }

    /// That it does not stand out.
    pub fn not_told_from_0(&self) -> String {
        format!("{}: the log cannot tell it from 0", self.words())
    }
}

/// All that a study asks for.
///
/// # Errors
/// Nothing is asked for, names that are nothing of their kind, bounds that exclude a start.
pub(crate) fn unknowns(
    prepared: &Prepared<'_>,
    symbolic: &Plant,
    logs: &[FittedLog],
) -> Result<Vec<Unknown>, Error> {
    let (study, settings) = (prepared.study(), &prepared.study().fit);
    let mut found = parameters(study, symbolic)?;
    found.extend(noises(prepared, logs)?);
    found.extend(densities(prepared, logs)?);
    found.extend(starts(prepared, logs)?);
    if found.is_empty() {
        return Err(Error::input("[fit] names nothing to find")
            .at(&study.file)
            .hint("add `parameters`, `noise`, `process_noise` or `initial` to [fit]"));
    }
    refuse_strays(study, settings, &found)?;
    for unknown in &mut found {
        bound(study, unknown)?;
    }
    Ok(found)
}

/// A name that stands for nothing of the kind.
fn stray<'n>(
    study: &Study,
    (key, kind): (&str, &str),
    name: &Name,
    known: impl Iterator<Item = &'n str>,
) -> Error {
    let known: Vec<&str> = known.collect();
    let message = format!("`{key}` of [fit]: no {kind} is called \"{name}\"");
    let refusal = Error::input(message).at(&study.file);
    name.blame(refusal.hint(near::suggest(&name.text, known)))
}

/// The variables that names mean, in the order of the names.
fn meant<'v>(
    study: &Study,
    (key, kind): (&str, &str),
    names: &[Name],
    variables: &'v [Variable],
) -> Result<Vec<&'v Variable>, Error> {
    let mut all: Vec<&Variable> = vec![];
    for name in names {
        let own: Vec<&Variable> = variables
            .iter()
            .filter(|v| name.is_or_has(&v.name))
            .collect();
        if own.is_empty() {
            let known = variables.iter().map(|v| v.name.as_str());
            return Err(stray(study, (key, kind), name, known));
        }
        if let Some(twice) = own.iter().find(|v| all.contains(v)) {
            let message = format!("`{key}` of [fit] names {} twice", twice.name);
            return Err(name.blame(Error::input(message)));
        }
        all.extend(own);
    }
    Ok(all)
}

fn unknown(kind: Kind, variable: &Variable, start: f64) -> Unknown {
    Unknown {
        kind,
        name: variable.name.clone(),
        start,
        low: variable.min,
        high: variable.max,
        is_log: false,
        prior: None,
        scale: Scale::Plain,
    }
}

/// What varies is no parameter any more.
fn refuse_unknown(study: &Study) -> Result<(), Error> {
    let is_unknown = |name: &&Name| {
        let mut unknown = study.sensors.unknown.iter();
        unknown.any(|other| other.is_or_has(&name.text) || name.is_or_has(&other.text))
    };
    let Some(name) = study.fit.parameters.iter().find(is_unknown) else {
        return Ok(());
    };
    let message = format!(
        "{} is in `unknown` of [sensors] and in `parameters` of [fit]",
        name.text
    );
    let hint = "keep one: `unknown` estimates it along with the states, `fit` finds one value for the whole log";
    Err(name.blame(Error::input(message).at(&study.file).hint(hint)))
}

fn parameters(study: &Study, symbolic: &Plant) -> Result<Vec<Unknown>, Error> {
    let settings = &study.fit;
    refuse_unknown(study)?;
    let variables: Vec<Variable> = (symbolic.parameters.iter())
        .map(|p| Variable {
            start: p.value,
            ..p.variable.clone()
        })
        .collect();
    let asked = meant(
        study,
        ("parameters", "parameter"),
        &settings.parameters,
        &variables,
    )?;
    let logs = meant(study, ("log", "parameter"), &settings.log, &variables)?;
    let strays = logs.iter().find(|v| !asked.contains(v));
    if let Some(variable) = strays {
        let message = format!(
            "`log` of [fit] names {}, which is not among its `parameters`",
            variable.name
        );
        let named = (settings.log.iter()).find(|name| name.is_or_has(&variable.name));
        let refusal = Error::input(message).at(&study.file);
        return Err(match named {
            Some(name) => name.blame(refusal),
            None => refusal,
        });
    }
    let of = |variable: &&Variable| {
        if variable.integer {
            let message = format!(
                "the parameter \"{}\" is an Integer: nothing can be found along a gradient of it",
                variable.name
            );
            return Err(Error::input(message)
                .at(&study.file)
                .hint("compare fits with one value each under [parameters], or declare it Real"));
        }
        let Some(start) = variable.start else {
            let message = format!(
                "the parameter \"{}\" has no value to start from",
                variable.name
            );
            return Err(Error::input(message)
                .at(&study.file)
                .hint("give it one under [parameters]"));
        };
        Ok(Unknown {
            is_log: logs.contains(variable),
            ..unknown(Kind::Parameter, variable, start)
        })
    };
    asked.iter().map(of).collect()
}

/// A noise, or a density, that starts here.
fn noise_of(kind: Kind, variable: &Variable, start: f64) -> Unknown {
    Unknown {
        low: start / REACH,
        high: start * REACH,
        is_log: true,
        ..unknown(kind, variable, start)
    }
}

fn noises(prepared: &Prepared<'_>, logs: &[FittedLog]) -> Result<Vec<Unknown>, Error> {
    let outputs = prepared.augmented().outputs.iter();
    let outputs: Vec<Variable> = outputs.map(|o| o.variable.clone()).collect();
    let asked = match &prepared.study().fit.noise {
        Chosen::All => outputs.iter().collect(),
        Chosen::Named(names) => meant(
            prepared.study(),
            ("noise", "measured output"),
            names,
            &outputs,
        )?,
    };
    let named = prepared.study().fit.deviations.iter();
    let named: Vec<Name> = named.map(|(output, _)| output.clone()).collect();
    meant(
        prepared.study(),
        ("noise", "measured output"),
        &named,
        &outputs,
    )?;
    let of = |variable: &Variable| {
        let place = outputs.iter().position(|o| o.name == variable.name);
        let place = place.unwrap_or_default();
        let declared = prepared.declared().noise.of(&variable.name);
        let declared = declared
            .map(|noise| noise.size())
            .filter(|size| *size > 0.0);
        let start = declared.unwrap_or_else(|| {
            let scatter = logs.iter().filter_map(|log| log.scatter(place));
            scatter.fold(0.0, f64::max)
        });
        let start = if start > 0.0 { start } else { 1.0 };
        let scale = match prepared.declared().noise.of(&variable.name) {
            Some(Noise::Relative(_)) => Scale::Share,
            Some(Noise::Uniform(_)) => Scale::Bound,
            _ => Scale::Plain,
        };
        Unknown {
            scale,
            ..noise_of(Kind::Noise(place), variable, start)
        }
    };
    Ok(asked.into_iter().map(of).collect())
}

fn densities(prepared: &Prepared<'_>, logs: &[FittedLog]) -> Result<Vec<Unknown>, Error> {
    let (augmented, study) = (prepared.augmented(), prepared.study());
    let declared = |v: &Variable| prepared.declared().process_noise.of(&v.name).copied();
    let is_declared = |v: &&Variable| declared(v).is_some_and(|q| q > 0.0);
    let asked: Vec<&Variable> = match &study.fit.process_noise {
        Chosen::All => augmented.states.iter().filter(is_declared).collect(),
        Chosen::Named(names) => meant(
            study,
            ("process_noise", "state or unknown input"),
            names,
            &augmented.states,
        )?,
    };
    if study.fit.process_noise == Chosen::All && asked.is_empty() {
        let message =
            "`process_noise = true` of [fit]: [process_noise] declares no density above 0";
        return Err(Error::input(message)
            .at(&study.file)
            .hint("name the states: process_noise = [\"…\"]"));
    }
    if study.fit.objective == Objective::Simulation && !asked.is_empty() {
        let message = "`process_noise` of [fit]: objective = \"simulation\" reads no densities: there all errors are the sensors'";
        return Err(Error::input(message)
            .at(&study.file)
            .hint("leave it out, or take objective = \"innovations\""));
    }
    let span = logs.iter().map(FittedLog::span).fold(0.0, f64::max);
    let of = |variable: &Variable| {
        let place = augmented.state_index(&variable.name).unwrap_or_default();
        let start = declared(variable).filter(|q| *q > 0.0);
        let start = start.unwrap_or_else(|| noise::guessed(variable, span));
        let mut own = noise_of(Kind::Density(place), variable, start);
        // one for the vector of a rotation
        if matches!(variable.home, Home::Rotation { .. }) {
            let array = own.name.rsplit_once('[').map(|(array, _)| array.to_owned());
            own.name = array.unwrap_or(own.name);
        }
        own
    };
    let is_own = |v: &&Variable| match v.home {
        Home::Rotation { element } => element == 0,
        _ => true,
    };
    Ok(asked.into_iter().filter(is_own).map(of).collect())
}

fn starts(prepared: &Prepared<'_>, logs: &[FittedLog]) -> Result<Vec<Unknown>, Error> {
    let augmented = prepared.augmented();
    let names = &prepared.study().fit.initial;
    let asked = meant(
        prepared.study(),
        ("initial", "state"),
        names,
        &augmented.states,
    )?;
    if let Some(variable) = asked
        .iter()
        .find(|v| matches!(v.home, Home::Rotation { .. }))
    {
        let message = format!(
            "`initial` of [fit]: {} is a number of a quaternion, and four numbers of length 1 are not found one by one",
            variable.name
        );
        let hint = "leave it out: the filter finds the attitude, from `initial` with `initial_variance` of [observer]";
        return Err(Error::input(message).at(&prepared.study().file).hint(hint));
    }
    let of = |(log, fitted): (usize, &FittedLog)| {
        let asked = asked.iter().map(move |variable| {
            let state = augmented.state_index(&variable.name).unwrap_or_default();
            unknown(Kind::Start { state, log }, variable, fitted.starts[state])
        });
        asked.collect::<Vec<_>>()
    };
    Ok(logs.iter().enumerate().flat_map(of).collect())
}

/// What the study says of it by its key; of a parameter, or where it is one thing only, by its name.
fn said<'s, T>(given: &'s [(Name, T)], unknown: &Unknown) -> Option<(&'s Name, &'s T)> {
    let key = unknown.key();
    let is_meant = |name: &Name| {
        name.text == key || (!unknown.kind.is_noise() && name.is_or_has(&unknown.name))
    };
    let mut meant = given.iter().filter(|(name, _)| is_meant(name));
    meant.next().map(|(name, value)| (name, value))
}

/// Bounds and priors of what is not found.
fn refuse_strays(study: &Study, settings: &FitSettings, found: &[Unknown]) -> Result<(), Error> {
    let bounds = settings.bounds.iter().map(|(name, _)| ("bounds", name));
    let priors = settings.priors.iter().map(|(name, _)| ("priors", name));
    for (key, name) in bounds.chain(priors) {
        let is_meant = |unknown: &Unknown| said(&[(name.clone(), ())], unknown).is_some();
        if !found.iter().any(is_meant) {
            let keys: Vec<String> = found.iter().map(Unknown::key).collect();
            let known = keys.iter().map(String::as_str);
            return Err(stray(study, (key, "quantity that is fitted"), name, known));
        }
    }
    Ok(())
}

/// Sets bounds and priors.
fn bound(study: &Study, unknown: &mut Unknown) -> Result<(), Error> {
    let place = |name: Option<&Name>, error: Error| match name {
        Some(name) => name.blame(error.at(&study.file)),
        None => error.at(&study.file),
    };
    unknown.prior = said(&study.fit.priors, unknown).map(|(_, prior)| *prior);
    let given = said(&study.fit.bounds, unknown).map(|(name, range)| (name.clone(), *range));
    if let Some((_, (low, high))) = given {
        (unknown.low, unknown.high) = (low, high);
    }
    let name = given.as_ref().map(|(name, _)| name);
    if unknown.is_log && unknown.low <= 0.0 {
        if unknown.kind.is_noise() && unknown.low == 0.0 && unknown.high > 0.0 {
            unknown.low = unknown.high.min(unknown.start) / REACH;
        } else if unknown.start > 0.0 && unknown.low.is_infinite() && !unknown.kind.is_noise() {
            unknown.low = f64::MIN_POSITIVE;
        } else {
            let message = format!(
                "{} is searched as a logarithm: expected a range above 0, found [{}, {}]",
                unknown.words(),
                unknown.low,
                unknown.high
            );
            return Err(place(name, Error::input(message)));
        }
    }
    if !(unknown.low..=unknown.high).contains(&unknown.start) {
        let message = format!(
            "the search for {} starts at {}, which its bounds [{}, {}] exclude",
            unknown.words(),
            unknown.start,
            unknown.low,
            unknown.high
        );
        let hint = "start it within its bounds, by [parameters], [sensors], [process_noise] or `initial`, or widen them: `bounds` of [fit]";
        return Err(place(name, Error::input(message).hint(hint)));
    }
    Ok(())
}
