//! How the family is decided on that is taken.
//!
//! `auto` takes the first family whose conditions are all proved, whose keys are there or were tried in
//! simulation, and whose error decays fast enough for the run of `[simulate]`; else one that is undecided, with
//! the same; else the first filter, for which nothing is asked and nothing is proved. Where a limit of time or memory
//! ended the examination or the trial of a family that comes before it, the decision says so.

pub(crate) mod propose;
pub(crate) mod runner;

use lynkeus_expr::Spent;
use lynkeus_observers::{Design, DesignError, Examination};
use lynkeus_structure::Standing;

use crate::Error;
use crate::choose::propose::{propose, time_scales};
use crate::prepare::choice::{Choice, Grounds, Proposal, Speed};
use crate::prepare::modes::decay;
use crate::prepare::{Prepared, is_certified_gain};
use crate::words::number;
use lynkeus_study::SimulateSettings;

/// A run is long enough for an error that falls to e^−3 of itself, 5 %.
const FALLS: f64 = 3.0;

impl Prepared<'_> {
    /// The family to use, and why: the same for every command.
    ///
    /// # Errors
    /// Keys of `[observer]` that cannot be used.
    pub fn choice(&self) -> Result<Option<&Choice>, Error> {
        if let Some(known) = self.chosen().get() {
            return Ok(known.as_ref());
        }
        let found = choose(self)?;
        Ok(self.chosen().get_or_init(|| found).as_ref())
    }
}

/// What a family makes of the study.
enum Trial {
    Good(Box<Design>, Option<Proposal>),
    /// why not
    Bad(String),
    /// a limit came first
    Ended(Spent),
    /// a key cannot be used
    Wrong(Error),
}

/// The decision; none where nothing fits.
///
/// # Errors
/// Keys of `[observer]` that cannot be used.
fn choose(prepared: &Prepared<'_>) -> Result<Option<Choice>, Error> {
    let study = prepared.study();
    // of several families one may own a key in another shape
    if study.observer.family.is_some() {
        for family in study.observer.families() {
            let verified = family.verify(prepared.augmented(), &study.observer.tuning);
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
    let mut passed = Passed {
        reasons: left_out(prepared),
        ended: None,
    };
    let proved: Vec<&Examination> = with(Standing::Proved).filter(|e| e.has_theorem()).collect();
    for examination in examinations {
        let family = examination.family;
        if let Some(spent) = examination.spent() {
            passed.at_limit(format!("{family} was not examined to its end"), spent);
            continue;
        }
        if !(examination.fit() == Standing::Proved && examination.has_theorem()) {
            continue;
        }
        match tried(prepared, examination) {
            Trial::Bad(reason) => passed.push(format!("{family} fits, but {reason}")),
            Trial::Ended(spent) => passed.at_limit(format!("{family} fits, but not tried"), spent),
            // a family before it may have taken the same key in another shape
            Trial::Wrong(error) if family == proved[0].family => return Err(error),
            Trial::Wrong(error) => passed.push(format!("{family} fits, but {error}")),
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
            Trial::Ended(spent) => {
                passed.at_limit(format!("{family} may fit, but was not tried"), spent);
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
        passed: passed.reasons,
        ended: passed.ended,
        design: None,
    }))
}

/// The families that come before the one that is taken.
struct Passed {
    reasons: Vec<String>,
    ended: Option<Spent>,
}

impl Passed {
    fn push(&mut self, reason: String) {
        self.reasons.push(reason);
    }

    /// One whose work was ended.
    fn at_limit(&mut self, what: String, spent: Spent) {
        self.reasons.push(format!("{what}: {spent}"));
        self.ended = self.ended.or(Some(spent).filter(|spent| spent.is_limit()));
    }
}

/// Whether the decision follows from plant, sensors and tuning alone: every family was examined to its
/// end, and no key that is missing was looked for in simulations, which depend on seed and noise.
pub(crate) fn is_fixed(prepared: &Prepared<'_>) -> bool {
    let is_lacking = |examination: &Examination| {
        examination.has_theorem()
            && examination.fit() != Standing::Refuted
            && lacked_speed(prepared, examination).is_some()
    };
    let is_asked_for_gain = is_certified_gain(&prepared.study().observer.tuning);
    prepared.examinations().is_ok_and(|examinations| {
        let is_whole = examinations.iter().all(|e| e.spent().is_none());
        is_whole && (is_asked_for_gain || !examinations.iter().any(is_lacking))
    })
}

fn chosen(
    examination: &Examination,
    grounds: Grounds,
    design: Box<Design>,
    proposal: Option<Proposal>,
    passed: Passed,
) -> Choice {
    Choice {
        family: examination.family,
        is_asked_for: false,
        design: Some(*design).filter(|_| proposal.is_none()),
        grounds,
        proposal,
        passed: passed.reasons,
        ended: passed.ended,
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
    let (proposal, ended) = match lacked {
        None => (None, None),
        Some(speed) => match propose(prepared, examination, speed) {
            Ok(proposal) => (proposal, None),
            Err(spent) => (time_scales(prepared, examination, speed), Some(spent)),
        },
    };
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
        ended,
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
    let family = examination.family;
    let absent =
        |speed: &Speed| family.owns(speed.key()) && !tuning.values.contains_key(speed.key());
    let speed = Speed::ALL.into_iter().find(absent)?;
    // it may be given in other words
    match family.design(prepared.augmented(), tuning) {
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
        .filter(|family| !family.is_sampled())
        .map(|family| family.name());
    let names: Vec<&str> = families.filter(|name| !examined(name)).collect();
    let keys: Vec<&str> = observer.tuning.values.keys().map(String::as_str).collect();
    match names.is_empty() {
        true => vec![],
        false if observer.is_curved => vec![format!(
            "not examined, as their theorems are about errors that are differences of real numbers, and [manifold] has others: {}",
            names.join(", ")
        )],
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
    keys.keys().any(|key| examination.family.owns(key))
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
        proposal = match propose(prepared, examination, speed) {
            Ok(proposal) => proposal.filter(|p| p.is_tried || is_bare),
            Err(spent) => return Trial::Ended(spent),
        };
        if let Some(Proposal { value, .. }) = &proposal {
            tuned.values.insert(speed.key().to_owned(), value.clone());
        }
    }
    let design = match examination.family.design(prepared.augmented(), &tuned) {
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
        Err(DesignError::Spent(spent)) => return Trial::Ended(spent),
        Err(error) => return Trial::Bad(error.to_string()),
    };
    if let Some(run) = &prepared.study().simulate
        && let Some(rate) = decay(prepared.augmented(), &design)
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
