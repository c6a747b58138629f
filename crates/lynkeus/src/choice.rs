//! Which family is taken, and why: one decision for reports and for runs.
//!
//! `auto` takes the first family whose conditions are all proved, whose keys are there or were tried in
//! simulation, and whose error decays fast enough for the run of `[simulate]`; else one that is undecided, with
//! the same; else the first filter, for which nothing is asked and nothing is proved.

use std::fmt;

use lynkeus_observers::{Design, DesignError, Examination, Tuning, Value, find};
use lynkeus_structure::Standing;
use serde_json::{Value as Json, json};

use crate::modes::decay;
use crate::prepare::{Prepared, is_certified_gain};
use crate::propose::{Proposal, Speed, propose};
use crate::words::number;
use crate::{Error, study::SimulateSettings};

/// A run is long enough for an error that falls to e^−3 of itself, 5 %.
const FALLS: f64 = 3.0;

/// The family to use.
#[derive(Clone, Debug)]
pub struct Choice {
    /// its name
    pub family: &'static str,
    /// the study names it
    pub is_asked_for: bool,
    /// what stands behind it
    pub grounds: Grounds,
    /// a value for a key that the study leaves out
    pub proposal: Option<Proposal>,
    /// families that may fit and are not taken, with the reason
    pub passed: Vec<String>,
    /// made with the study's own keys
    pub(crate) design: Option<Design>,
}

/// What stands behind a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grounds {
    /// every condition of its theorem is proved; of several such families it is the first
    Proved {
        /// there are others
        first_of_several: bool,
    },
    /// nothing refutes its conditions
    Undecided,
    /// no theorem
    Filter,
}

/// What a family makes of the study.
enum Trial {
    Good(Box<Design>, Option<Proposal>),
    /// why not
    Bad(String),
    /// a key cannot be used
    Wrong(Error),
}

/// The decision; none where nothing fits.
///
/// # Errors
/// Keys of `[observer]` that cannot be used.
pub(crate) fn choose(prepared: &Prepared<'_>) -> Result<Option<Choice>, Error> {
    let study = prepared.study();
    // of several families one may own a key in another shape
    if study.observer.family.is_some() {
        for family in study.observer.families() {
            let verified = family.verify(prepared.extended(), &study.observer.tuning);
            verified.map_err(|error| prepared.refusal(error.into()))?;
        }
    }
    let examinations = prepared.examinations()?;
    let with = |fit: Standing| {
        let kept = examinations.iter().filter(|e| e.spent().is_none());
        kept.filter(move |e| e.fit() == fit)
    };
    if study.observer.family.is_some() {
        let asked = with(Standing::Proved)
            .chain(with(Standing::Undecided))
            .next();
        return asked.map(|e| asked_for(prepared, e)).transpose();
    }
    let mut passed = left_out(prepared);
    let proved: Vec<&Examination> = with(Standing::Proved).filter(|e| e.has_theorem()).collect();
    for examination in &proved {
        match tried(prepared, examination) {
            Trial::Bad(reason) => passed.push(format!("{} fits, but {reason}", examination.family)),
            // a family before it may have taken the same key in another shape
            Trial::Wrong(error) if examination.family == proved[0].family => return Err(error),
            Trial::Wrong(error) => passed.push(format!("{} fits, but {error}", examination.family)),
            Trial::Good(design, proposal) => {
                let grounds = Grounds::Proved {
                    first_of_several: proved.len() > 1,
                };
                return Ok(Some(chosen(examination, grounds, design, proposal, passed)));
            }
        }
    }
    for examination in with(Standing::Undecided) {
        let family = examination.family;
        match tried(prepared, examination) {
            Trial::Good(design, proposal)
                if has_keys(prepared, examination) || proposal.as_ref().is_some_and(settles_it) =>
            {
                return Ok(Some(chosen(
                    examination,
                    Grounds::Undecided,
                    design,
                    proposal,
                    passed,
                )));
            }
            Trial::Wrong(error) if proved.is_empty() => return Err(error),
            Trial::Wrong(error) => passed.push(format!("{family} may fit, but {error}")),
            Trial::Good(..) => passed.push(format!(
                "{family} may fit, but not every condition is proved"
            )),
            Trial::Bad(reason) => passed.push(format!("{family} may fit, but {reason}")),
        }
    }
    let filter = with(Standing::Proved).find(|e| !e.has_theorem());
    Ok(filter.map(|examination| Choice {
        family: examination.family,
        is_asked_for: false,
        grounds: Grounds::Filter,
        proposal: None,
        passed,
        design: None,
    }))
}

fn chosen(
    examination: &Examination,
    grounds: Grounds,
    design: Box<Design>,
    proposal: Option<Proposal>,
    passed: Vec<String>,
) -> Choice {
    Choice {
        family: examination.family,
        is_asked_for: false,
        design: Some(*design).filter(|_| proposal.is_none()),
        grounds,
        proposal,
        passed,
    }
}

/// The family that the study names; what its keys lack is proposed where that can be done.
fn asked_for(prepared: &Prepared<'_>, examination: &Examination) -> Result<Choice, Error> {
    let tuning = &prepared.study().observer.tuning;
    // a certified gain has no speed to be proposed, and making it takes long
    let lacked = match is_certified_gain(tuning) {
        true => None,
        false => lacked_speed(prepared, examination),
    };
    let proposal = lacked.and_then(|speed| propose(prepared, examination, speed));
    Ok(Choice {
        family: examination.family,
        is_asked_for: true,
        grounds: match (examination.has_theorem(), examination.fit()) {
            (false, _) => Grounds::Filter,
            (true, Standing::Proved) => Grounds::Proved {
                first_of_several: false,
            },
            (true, _) => Grounds::Undecided,
        },
        proposal,
        passed: vec![],
        design: None,
    })
}

/// Whether a family that is not proved to fit is taken with this value: a θ that did well in
/// simulation. Poles are no such sign, as a map that may be singular is met only somewhere.
fn settles_it(proposal: &Proposal) -> bool {
    proposal.is_tried && proposal.speed == Speed::Theta
}

/// The speed for want of which the design fails.
fn lacked_speed(prepared: &Prepared<'_>, examination: &Examination) -> Option<Speed> {
    let tuning = &prepared.study().observer.tuning;
    let family = find(examination.family)?;
    let absent =
        |speed: &Speed| family.owns(speed.key()) && !tuning.values.contains_key(speed.key());
    let speed = Speed::ALL.into_iter().find(absent)?;
    // it may be given in other words
    match prepared.designed(examination, prepared.extended(), tuning) {
        Err(DesignError::Tuning(e)) if e.absent && e.key == speed.key() => Some(speed),
        _ => None,
    }
}

/// Families that do not take every key of the study, and so were not examined.
fn left_out(prepared: &Prepared<'_>) -> Vec<String> {
    let observer = &prepared.study().observer;
    let examined = |name: &str| observer.families().any(|family| family.name() == name);
    let families = lynkeus_observers::FAMILIES
        .iter()
        .map(|family| family.name());
    let names: Vec<&str> = families.filter(|name| !examined(name)).collect();
    let keys: Vec<&str> = observer.tuning.values.keys().map(String::as_str).collect();
    match names.is_empty() {
        true => vec![],
        false => vec![format!(
            "not examined, as they do not take {}: {}",
            keys.join(" and "),
            names.join(", ")
        )],
    }
}

/// Whether the study has a key that belongs to families with a theorem.
fn has_keys(prepared: &Prepared<'_>, examination: &Examination) -> bool {
    let keys = &prepared.study().observer.tuning.values;
    keys.keys()
        .any(|key| find(examination.family).is_some_and(|family| family.owns(key)))
}

fn tried(prepared: &Prepared<'_>, examination: &Examination) -> Trial {
    let tuning = &prepared.study().observer.tuning;
    let mut proposal = None;
    let mut tuned = tuning.clone();
    if !is_certified_gain(tuning)
        && let Some(speed) = lacked_speed(prepared, examination)
    {
        // a value that nothing was tried with is for a bare model only, which has no run
        let is_bare = prepared.study().is_bare();
        proposal = propose(prepared, examination, speed).filter(|p| p.is_tried || is_bare);
        if let Some(Proposal { value, .. }) = &proposal {
            tuned
                .values
                .insert(speed.key().to_owned(), Value::Number(*value));
        }
    }
    let design = match prepared.designed(examination, prepared.extended(), &tuned) {
        Ok(design) => design,
        Err(DesignError::Tuning(e)) if e.absent => {
            let can_be_tried = Speed::ALL.iter().any(|speed| e.key == speed.key());
            let remedy = match can_be_tried && prepared.study().simulate.is_none() {
                true => "; with [simulate] one is proposed",
                false => "",
            };
            let reason = format!("it needs `{}` in [observer]: {}{remedy}", e.key, e.expected);
            return Trial::Bad(reason);
        }
        Err(DesignError::Tuning(e)) if proposal.is_none() => {
            return Trial::Wrong(prepared.refusal(DesignError::Tuning(e)));
        }
        Err(error) => return Trial::Bad(error.to_string()),
    };
    if let Some(run) = &prepared.study().simulate
        && let Some(rate) = decay(prepared.extended(), &design)
        && rate * (run.until - run.start) < FALLS
    {
        return Trial::Bad(too_slow(rate, run));
    }
    Trial::Good(Box::new(design), proposal)
}

fn too_slow(rate: f64, run: &SimulateSettings) -> String {
    let span = number(run.until - run.start);
    match rate > 0.0 {
        true => format!(
            "its error decays at {} only (linearised at the start), too slow for a run of {span}",
            number(rate)
        ),
        false => "its error does not decay at the start (linearised)".to_owned(),
    }
}

impl Choice {
    /// A tuning with what is proposed where it says nothing.
    pub(crate) fn completed(&self, tuning: &Tuning) -> Tuning {
        let mut tuned = tuning.clone();
        if let Some(Proposal { speed, value, .. }) = self.proposal {
            let slot = tuned.values.entry(speed.key().to_owned());
            slot.or_insert(Value::Number(value));
        }
        tuned
    }

    /// For machines.
    pub(crate) fn to_json(&self) -> Json {
        json!({
            "family": self.family,
            "asked_for": self.is_asked_for,
            "grounds": match self.grounds {
                Grounds::Proved { .. } => "proved",
                Grounds::Undecided => "undecided",
                Grounds::Filter => "filter",
            },
            "proposed": self.proposal.as_ref().map(Proposal::to_json),
            "passed_over": self.passed,
        })
    }

    /// What a run says of the decision.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.proposal.iter().map(Proposal::to_string).collect();
        if !self.is_asked_for && self.grounds == Grounds::Filter {
            notes.push(format!("{} ({})", self.loss(), self.passed_over()));
        }
        notes
    }

    fn passed_over(&self) -> String {
        match self.passed.is_empty() {
            true => "`lynkeus check` says why".to_owned(),
            false => self.passed.join("; "),
        }
    }

    /// What a filter has not.
    fn loss(&self) -> String {
        let family = self.family;
        let none = match self.passed.is_empty() {
            true => "no family with a theorem fits this plant and these sensors",
            false => "no family with a theorem is taken",
        };
        format!(
            "{none}: {family} estimates all the same and says how sure it is, but nothing is proved of its error: no rate, no bound, and from a start far off it may diverge"
        )
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let family = self.family;
        match self.grounds {
            Grounds::Proved {
                first_of_several: true,
            } => writeln!(
                f,
                "{family} comes first: of the families that fit, it has the simplest gain"
            )?,
            Grounds::Proved { .. } => {
                writeln!(f, "{family} is the one whose every condition is proved")?
            }
            Grounds::Undecided => writeln!(
                f,
                "{family} is not proved to fit, but nothing refutes it: what is undecided above says what would settle it"
            )?,
            Grounds::Filter if self.is_asked_for => writeln!(
                f,
                "{family} is the study's choice: it runs on any plant, and nothing is proved of its error"
            )?,
            Grounds::Filter => writeln!(f, "{}", self.loss())?,
        }
        for passed in &self.passed {
            writeln!(f, "  {passed}")?;
        }
        match &self.proposal {
            Some(proposal) => writeln!(f, "{proposal}"),
            None => Ok(()),
        }
    }
}
