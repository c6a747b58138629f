//! What can be estimated from these sensors, by which observer, and what fails where.

mod json;
mod knowledge;
mod known;
mod next;
mod observability;
#[cfg(feature = "plot")]
mod picture;
mod report;
mod reserves;
mod uniform;

use std::collections::BTreeSet;
use std::time::Duration;

use lynkeus_answer::Document;
use lynkeus_answer::document::Line;
use lynkeus_expr::{Budget, Spent};
use lynkeus_model::Plant;
use lynkeus_observability::{Answer as Observable, Verdict};
use lynkeus_observers::{Examination, fit_word};
use lynkeus_structure::{Sensors, determined, uniformity};
use lynkeus_words::{Words, counted};
use serde_json::Value;

use crate::{Answer, Error, ErrorKind, Study};
#[cfg(test)]
pub(crate) use json::CheckReport;
use knowledge::Sorted;
pub use knowledge::{Assumption, Knowledge, Known, Reserve};
use lynkeus_experiment::course::run::refuse_settings;
use lynkeus_experiment::prepare;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::calibrate;
use lynkeus_experiment::prepare::declared::{Account, Declared};
use lynkeus_experiment::words::{condition, explain, listed};
use lynkeus_study::Name;
pub use next::Next;
pub use report::{CheckOptions, Report};
use reserves::View;
pub use uniform::Uniform;

/// The time for what can be known at all, where the study has no limit.
const OBSERVABILITY: Duration = Duration::from_secs(20);

/// The share of the time for the places where states cannot be told apart.
const UNIFORMITY: f64 = 0.2;

/// Examines the study's plant: what can be known, and by which of the families that the
/// study allows.
///
/// # Errors
/// A study that does not fit its plant, or whose observer refuses its keys; an expression of `about` that
/// cannot be read.
pub fn check(study: &Study, options: &CheckOptions) -> Result<Report, Error> {
    let symbolic = prepare::symbolic_plant(study, BTreeSet::new())?;
    Declared::new(study, &symbolic)?;
    study.refuse_strange_keys(true)?;
    let time = match study.budget.left() {
        Some(_) => study.budget.part(0.5),
        None => study.budget.within(OBSERVABILITY),
    };
    let sensors = prepare::sensors(study, &symbolic);
    let answer = observability::answer(study, &symbolic, options, &sensors, time.clone())?;
    let names = |of: &[lynkeus_model::Variable]| -> Vec<String> {
        of.iter().map(|v| v.name.clone()).collect()
    };
    let mut report = Report {
        plant: symbolic.name.clone(),
        states: names(&symbolic.states),
        measured: match &study.sensors.measured {
            Some(measured) => Name::meant(measured, &symbolic.outputs),
            None => names(&symbolic.outputs),
        },
        unknown: sensors.unknown,
        examinations: vec![],
        recommended: None,
        choice: None,
        knowledge: vec![],
        next: None,
        time_unit: study.time_unit.clone(),
        answer,
        uniform: None,
        parameters: options.parameters,
        warnings: symbolic.warnings.clone(),
        ended: None,
        declared: Account::default(),
    };
    let valued = symbolic.parameters.iter().all(|p| p.value.is_some());
    if valued && !options.parameters {
        match by_which(study, &symbolic, options, time, &mut report) {
            // what was found by then is told
            Err(_) if study.budget.marked() == Some(Spent::Cancelled) => {
                report.ended = Some(Spent::Cancelled);
            }
            done => done?,
        }
    }
    Ok(report)
}

/// Where states can be told apart, what can be known of each quantity, and by which family it
/// can be estimated.
fn by_which(
    study: &Study,
    symbolic: &Plant,
    options: &CheckOptions,
    time: Budget,
    report: &mut Report,
) -> Result<(), Error> {
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    let part = prepare::share(&study.budget, UNIFORMITY);
    let augmented = prepared.augmented();
    let graph = augmented.graph();
    let examine = || {
        let known = determined(augmented)?;
        let found = uniformity(augmented, &known)?;
        Ok((known, found))
    };
    let mut known = vec![false; augmented.states.len()];
    match graph.budgeted(part, examine) {
        Ok(examined) => {
            let examined: Result<_, lynkeus_expr::MissingInput> = examined;
            let (determined, examined) = examined.map_err(explain)?;
            known = determined;
            report.uniform =
                examined.map(|examined| Uniform::new(examined, &report.answer, &report.unknown));
        }
        Err(spent) => report.ended = Some(spent),
    }
    report.declared = account(prepared.declared());
    report.knowledge = knowledge(&prepared, &known, symbolic, options, report, time)?;
    report.examinations = prepared.examinations()?.to_vec();
    report.choice = prepared.choice()?.cloned();
    report.recommended = report.choice.as_ref().map(|choice| choice.family.name());
    if report.choice.is_some() {
        refuse(&prepared)?;
    }
    let next = |choice| Next::new(&prepared, choice);
    report.next = report.choice.as_ref().map(next);
    Ok(())
}

/// What [`estimate()`](crate::estimate()) would refuse whatever the log, in its words.
fn refuse(prepared: &Prepared<'_>) -> Result<(), Error> {
    let study = prepared.study();
    // a certified gain takes long to make; of the others what is at fault in the study counts, no answer of no
    if prepare::is_certified_gain(&study.observer.tuning) {
        return Ok(());
    }
    match prepared.design() {
        Ok(design) => refuse_settings(prepared, &design),
        Err(error) if error.kind() == ErrorKind::Input => Err(error),
        Err(_) => Ok(()),
    }
}

/// What the families' conditions and what is known count.
fn account(declared: &Declared) -> Account {
    let Declared {
        ranges,
        noise,
        limits,
        samples,
        process_noise,
        disturbances,
        slew,
        input_derivatives,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = declared;
    let elsewhere = "`certify` counts it, and `check --how-well`";
    Account::default()
        .counts(manifold)
        .leaves(screens, "they are of logs")
        .leaves(
            late,
            "what can be known does not depend on when a reading arrives: a late reading counts at the time of its sample",
        )
        .counts(ranges)
        .counts(input_derivatives)
        .leaves(noise, elsewhere)
        .leaves(process_noise, elsewhere)
        .leaves(input_noise, "`check --how-well` counts it")
        .leaves(correlation, "`check --how-well` counts it")
        .counts(limits)
        .leaves(samples, "`check --how-well` counts them")
        .counts(disturbances)
        .leaves(slew, "`certify` counts it")
}

/// What can be known of each quantity: whatever the unknown inputs do, and if they hardly move. `known`
/// are the augmented states known everywhere by elimination.
fn knowledge(
    prepared: &Prepared<'_>,
    known: &[bool],
    symbolic: &Plant,
    options: &CheckOptions,
    report: &mut Report,
    time: Budget,
) -> Result<Vec<Knowledge>, Error> {
    let study = prepared.study();
    let augmented = prepared.augmented();
    let mut asked = vec![];
    match report.unknown.is_empty() {
        true => asked.push((Assumption::NoneUnknown, report.answer.clone())),
        false => {
            asked.push((Assumption::Arbitrary, report.answer.clone()));
            let constant = calibrate::constant_inputs(symbolic.clone(), &report.unknown);
            let sensors = Sensors {
                unknown: vec![],
                ..prepare::sensors(study, symbolic)
            };
            let answer = observability::answer(study, &constant, options, &sensors, time.clone())?;
            let wander = &prepared.declared().process_noise;
            let declared = report.unknown.iter().all(|name| wander.of(name).is_some());
            asked.push((Assumption::Wandering { declared }, answer));
        }
    }
    let graph = augmented.graph();
    let view = View {
        prepared,
        symbolic,
        options,
        time,
    };
    let work = || -> Result<Vec<Knowledge>, Error> {
        let found = knowledge::Found {
            uniform: report.uniform.as_ref().map(Uniform::examined),
            determined: known,
        };
        let of = |(assumption, answer): &mut (Assumption, Observable)| {
            found.settle(augmented, *assumption, answer);
            let known = Knowledge::new(augmented, *assumption, answer, &found);
            let mut known = known.map_err(explain)?;
            view.reserve(&mut known)?;
            Ok(known)
        };
        asked.iter_mut().map(of).collect()
    };
    let known = match graph.budgeted(prepare::share(&study.budget, UNIFORMITY), work) {
        Ok(known) => known?,
        Err(_) => return Ok(vec![]),
    };
    if let Some((_, settled)) = asked.into_iter().next() {
        report.answer = settled;
    }
    Ok(known)
}

impl Report {
    /// True if a family with a theorem is chosen, if everything asked for can be known from the
    /// outputs (then a filter estimates it), or where no observer was asked for.
    pub fn is_positive(&self) -> bool {
        let chosen = self
            .examinations
            .iter()
            .find(|e| Some(e.family.name()) == self.recommended);
        let with_theorem = chosen.is_some_and(Examination::has_theorem);
        let hidden = |q: &(lynkeus_observability::Asked, _)| q.0.verdict == Verdict::Unobservable;
        // what was not decided is no refusal
        self.examinations.is_empty()
            || self.examinations.iter().any(|e| e.spent().is_some())
            || with_theorem
            || (chosen.is_some() && !self.answer.quantities.iter().any(hidden))
    }
}

lynkeus_experiment::displayed!(Report);

impl Answer for Report {
    fn document(&self) -> Document {
        let list = |names: &[String]| match names.is_empty() {
            true => "nothing".to_owned(),
            false => names.join(", "),
        };
        let mut document = Document::new(format!(
            "{}: {}, measured {}, unknown {}",
            self.plant,
            counted(self.states.len(), "state"),
            list(&self.measured),
            list(&self.unknown)
        ));
        document.part();
        for warning in &self.warnings {
            document.code(warning.to_string());
        }
        document.part();
        observability::tell(&mut document, self);
        if let Some(uniform) = &self.uniform {
            uniform::tell(
                &mut document,
                uniform,
                &knowledge::reserves(&self.knowledge),
            );
        }
        if let Some(spent) = self.ended {
            let families = match self.examinations.is_empty() {
                true => ", and which observer fits,",
                false => "",
            };
            document.part().line(format!(
                "where states can be told apart{families} is undecided: {spent}"
            ));
        }
        self.tell_known(&mut document);
        let decided = self.examinations.iter().filter(|e| e.spent().is_none());
        decided.for_each(|examination| tell_examination(&mut document, examination, false));
        if self.examinations.is_empty() {
            return document;
        }
        self.tell_ended(&mut document);
        document.part();
        self.declared.told().map(|told| document.line(told));
        document.part();
        self.conclude(&mut document);
        if let Some(next) = &self.next {
            next.tell(&mut document);
        }
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn is_positive(&self) -> bool {
        Self::is_positive(self)
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        match &self.uniform {
            Some(_) => self.picture()?.to_svg().map(Some),
            None => Ok(None),
        }
    }
}

/// A family with its conditions.
pub(crate) fn tell_examination(
    document: &mut Document,
    examination: &Examination,
    is_folded: bool,
) {
    let heading = Line::from(format!("{}: ", examination.family));
    let heading = heading.decided(fit_word(examination.fit()));
    match is_folded {
        true => document.folded(heading),
        false => document.heading(heading),
    };
    let conditions = examination.conditions().map(condition);
    document.item(examination.summary.words());
    document.conditions(conditions, "conditions on the whole box");
}

impl Report {
    /// What can be known of each quantity.
    pub(crate) fn tell_known(&self, document: &mut Document) {
        let unit = self.time_unit.as_deref().unwrap_or("unit of time");
        knowledge::tell(document, &self.knowledge, unit);
    }

    /// The families whose examination was not finished, each reason told once.
    fn tell_ended(&self, document: &mut Document) {
        let ended = self.examinations.iter().filter(|e| e.spent().is_some());
        let mut open: Vec<&Examination> = ended.collect();
        while let Some(reason) = open.first().map(|e| &e.summary) {
            let same = |e: &&Examination| e.summary == *reason;
            let (told, rest): (Vec<_>, Vec<_>) = open.iter().copied().partition(same);
            let names: Vec<&str> = told.iter().map(|e| e.family.name()).collect();
            let heading = Line::from(format!("{}: ", names.join(", "))).decided("undecided");
            document.heading(heading).item(reason.words());
            open = rest;
        }
    }

    /// That there is no observer, or that a limit ended the search for one.
    fn none(&self) -> String {
        let is_open = |e: &&Examination| e.spent().is_some_and(Spent::is_limit);
        let undecided = self.examinations.iter().filter(is_open);
        let names: Vec<&str> = undecided.map(|e| e.family.name()).collect();
        match names.is_empty() {
            true => "no observer of this version fits these sensors".to_owned(),
            false => format!(
                "undecided: the limits ended the examination of {}; `--time-limit` and `--memory-limit` move them",
                names.join(", ")
            ),
        }
    }

    fn conclude(&self, document: &mut Document) {
        let Some(family) = self.recommended else {
            document.line(self.none());
            return;
        };
        let Sorted {
            seen,
            follows,
            hidden,
            open,
        } = self.sorted();
        // under another assumption more may be known
        let more = self.knowledge.get(1).map(Knowledge::sorted);
        let is_more = |name: &&str| more.as_ref().is_some_and(|more| more.is_estimated(name));
        let (wandering, hidden): (Vec<&str>, Vec<&str>) = hidden.into_iter().partition(is_more);
        let unknown = self.unknown.join(", ");
        for (names, before, after) in [
            (
                seen,
                "can be estimated: ".to_owned(),
                format!(" (by {family})"),
            ),
            (
                follows,
                "in the end, as errors decay by themselves: ".to_owned(),
                format!(" (by {family})"),
            ),
            (
                wandering,
                format!("only if {unknown} hardly moves: "),
                format!(" (by {family})"),
            ),
            (
                hidden,
                "not from the outputs: ".to_owned(),
                format!("; what {family} gives for them follows from the model alone"),
            ),
            (
                open,
                "whether the outputs tell ".to_owned(),
                format!(" is not decided; {family} still gives an estimate"),
            ),
        ] {
            if !names.is_empty() {
                document.line(before + &listed(&names) + &after);
            }
        }
        if let Some(choice) = &self.choice {
            choice.tell(document);
        }
    }

    /// What is known, known in the end, not known, and not decided, whatever unknown inputs do.
    fn sorted(&self) -> Sorted<'_> {
        if let Some(knowledge) = self.knowledge.first() {
            return knowledge.sorted();
        }
        let quantities = self.answer.quantities.iter();
        Sorted::of_verdicts(quantities.map(|(asked, _)| (asked.name.as_str(), asked.verdict)))
    }
}
