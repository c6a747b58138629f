//! Parameters and noises from logs, by their likelihood, and what the logs cannot tell.
//!
//! `docs/fit.md` says what is made least, how, and what every figure of the answer is.

mod errors;
mod experiment;
pub(crate) mod function;
mod json;
mod known;
mod logs;
#[cfg(feature = "plot")]
mod picture;
mod plant;
mod posed;
mod problem;
mod search;
mod starts;
mod steps;
mod told;
mod uncertainty;
pub(crate) mod unknown;

use std::ops::ControlFlow;

use lynkeus_expr::Spent;
use lynkeus_run::Step;
use lynkeus_study::Objective;
use lynkeus_words::{counted, short};
use nalgebra::DVector;

use crate::{Error, Study, Table};
use errors::Errors;
use experiment::{Ahead, Candidate};
#[cfg(test)]
pub(crate) use json::FitReport;
use known::Exact;
use lynkeus_experiment::crew::{Watch, every};
use lynkeus_experiment::prepare::{self, Prepared};
use lynkeus_experiment::{Doubt, DoubtLevel};
use posed::Posed;
use problem::{Point, Problem, Steps, Term};
use search::{Found, search};
use steps::SETTLED;
use uncertainty::Uncertainty;
use unknown::Unknown;

/// What is asked beside the study.
#[derive(Clone, Copy, Debug, Default)]
pub struct FitOptions {
    /// intervals by profile likelihood
    pub profiles: bool,
    /// how well the values would be known with one more log
    pub next_experiment: bool,
}

/// The answer of `lynkeus fit`.
#[derive(Clone, Debug)]
pub struct Fit {
    /// name of the plant
    pub plant: String,
    /// what was fitted to
    pub logs: Vec<String>,
    /// the unit of time, where the study names it
    pub time_unit: Option<String>,
    pub(crate) unknowns: Vec<Unknown>,
    /// −log L, without the share of priors
    pub nll: f64,
    /// that of the study's own values
    pub nll_at_start: f64,
    /// readings that were fitted
    pub readings: usize,
    /// how often −log L was computed
    pub evaluations: usize,
    /// whether nothing is left to gain nearby
    pub is_converged: bool,
    pub(crate) uncertainty: Uncertainty,
    pub(crate) optima: Vec<Optimum>,
    /// what the logs do not determine
    pub undetermined: Vec<String>,
    /// what is not told may be so because events on which it has a say do not happen at these values
    pub(crate) has_events: bool,
    pub(crate) exact: Exact,
    /// where that is asked
    pub(crate) ahead: Option<Ahead>,
    pub(crate) errors: Vec<Errors>,
    /// what the readings say against the values
    pub doubts: Vec<Doubt>,
    /// what speaks against the values
    pub warnings: Vec<String>,
    /// what the user should know
    pub notes: Vec<String>,
    pub(crate) rows: errors::Rows,
    /// the limit that ended the search
    pub ended: Option<Spent>,
    pub(crate) file: String,
}

/// Where searches ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Optimum {
    pub nll: f64,
    /// with the prior's share
    pub value: f64,
    /// by how many of them
    pub found: usize,
}

/// Fits a study to logs.
///
/// # Errors
/// A `[fit]` that does not fit the study, logs without the columns that it reads, bounds that exclude the start, a
/// likelihood that has no value at any start. What the logs do not determine is an answer: [`Fit::undetermined`].
pub fn fit(
    study: &Study,
    tables: &[Table],
    options: FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Fit, Error> {
    let (study, notes) = posed::with_filter(study)?;
    let plant = prepare::plant(&study)?;
    let prepared = Prepared::new(&study, &plant)?;
    let design = prepared.design()?;
    let logs = posed::logs(&prepared, &design, tables)?;
    let symbolic = plant::symbolic(&study)?;
    let posed = Posed::new(&prepared, &design, &symbolic, &logs)?;
    let is_alone = study.fit.objective == Objective::Simulation;
    let terms = posed.terms(is_alone)?;
    // without corrections nothing says what an unknown input does
    let is_driven = prepared.augmented().states.len() == prepared.augmented().plant_states();
    let alone = match is_driven {
        true if is_alone => Some(terms.clone()),
        true => Some(posed.terms(true)?),
        false => None,
    };
    let exact = posed.exact()?;
    let jumping = posed.jumping()?;
    let source = posed.source(is_alone);
    let planned = match (options.next_experiment, logs.first()) {
        (true, Some(log)) => Some(Candidate::all(source, &study, log)?),
        _ => None,
    };
    let problem = Problem {
        unknowns: &posed.unknowns,
        logs: &logs,
        terms,
        steps: Steps::default(),
        most_confined: usize::MAX,
        evaluations: 0,
        budget: study.budget.clone(),
    };
    let mut work = Work {
        study: &study,
        source,
        are_profiled: options.profiles,
        planned,
        problem,
        alone,
        outputs: posed.outputs(),
        exact,
        jumping,
        warnings: vec![],
        notes,
    };
    work.notes.extend(posed.notes());
    work.warnings.extend(posed.warnings());
    work.done(&plant.name, watch)
}

/// A fit under way.
struct Work<'w> {
    study: &'w Study,
    source: plant::Source<'w>,
    /// intervals of all values are by profile likelihood
    are_profiled: bool,
    /// the experiments that could be made next, where that is asked
    planned: Option<Vec<Candidate>>,
    problem: Problem<'w>,
    /// the plant alone, log by log
    alone: Option<Vec<Term>>,
    /// names of what is measured
    outputs: Vec<String>,
    exact: Exact,
    /// the parameters on which it depends where the model jumps, by their places
    jumping: Vec<usize>,
    warnings: Vec<String>,
    notes: Vec<String>,
}

/// Most halvings of the steps at the end.
const HALVINGS: usize = 8;

impl Work<'_> {
    fn done(mut self, plant: &str, watch: &mut Watch<'_>) -> Result<Fit, Error> {
        let begin = self.problem.begin(self.study)?;
        if let (false, Some(spent)) = (begin.value.is_finite(), self.study.budget.spent()) {
            return Err(Error::ended(spent).at(&self.study.file));
        }
        if begin.value.is_finite() {
            let flat = known::undetermined(&mut self.problem, &begin)?;
            if let Some(place) = flat.iter().find(|i| self.jumping.contains(i)) {
                return Err(self.no_slope(*place));
            }
            if !flat.is_empty() && !self.problem.is_spent() {
                return self.untold(plant, begin, &flat);
            }
        }
        let mut ends = self.ends(&begin, watch)?;
        ends.retain(|found| found.point.value.is_finite());
        ends.sort_by(|a, b| a.point.value.total_cmp(&b.point.value));
        let optima = optima(&ends);
        let Some(best) = ends.into_iter().next() else {
            return Err(self.no_value());
        };
        let mut best = self.settled(best)?;
        best.is_converged &= self.problem.is_sound(&best.point);
        self.told(plant, &begin, best, optima)
    }

    /// Where searches end: from the study's own values and as many further starts as it asks for. Where it asks for
    /// none, from some if the first end is doubtful.
    fn ends(&mut self, begin: &Point, watch: &mut Watch<'_>) -> Result<Vec<Found>, Error> {
        let settings = &self.study.fit;
        let count = settings.starts.unwrap_or(1);
        let from = starts::spread(&self.problem, &begin.z, count, settings.seed);
        let mut ends = self.searches(begin, &from, usize::MAX, watch)?;
        let done = ends.iter().filter(|end| !end.is_ended).count();
        if (1..ends.len()).contains(&done) {
            self.warnings.push(format!(
                "a limit ended the search: {done} of {} starts were searched from to the end",
                ends.len()
            ));
        }
        if settings.starts.is_some() || self.study.budget.spent().is_some() {
            return Ok(ends);
        }
        let Some(doubt) = self.doubt(&ends[0])? else {
            return Ok(ends);
        };
        let from = starts::best(&mut self.problem, &begin.z, settings.seed)?;
        if from.is_empty() {
            return Ok(ends);
        }
        let further = self.searches(begin, &from, MOST_STEPS, watch)?;
        if self.study.budget.spent().is_some() {
            self.warnings
                .push(format!("{doubt}; a limit cut further starts short"));
        }
        let least = ends[0].point.value - SAME;
        let is_better = |end: &&Found| end.point.value < least;
        let better = further.iter().filter(is_better).count();
        self.notes.push(format!(
            "{doubt}, so {} were tried: {better} ended better",
            counted(further.len(), "further start")
        ));
        let best = further.iter().filter(is_better);
        let best = best.min_by(|a, b| a.point.value.total_cmp(&b.point.value));
        match best {
            Some(best) if best.is_ended => ends.push(self.again(best.point.clone(), None)?),
            _ => {}
        }
        ends.extend(further.into_iter().filter(|end| !end.is_ended));
        Ok(ends)
    }

    /// What speaks against the end of a search.
    fn doubt(&mut self, end: &Found) -> Result<Option<String>, Error> {
        if !end.point.value.is_finite() {
            return Ok(Some(
                "the likelihood has no value at the study's own values".to_owned(),
            ));
        }
        if !end.is_converged {
            return Ok(Some("the first search did not converge".to_owned()));
        }
        let unknowns = self.problem.unknowns.iter().zip(&end.is_bound);
        let mut at_bounds = unknowns.filter(|(u, is_bound)| **is_bound && !u.kind.is_noise());
        if let Some((unknown, _)) = at_bounds.next() {
            let name = unknown.words();
            return Ok(Some(format!(
                "the first search ended with {name} at its bound"
            )));
        }
        let values = self.problem.values(&end.point.z);
        let (errors, rows) = errors::errors(&mut self.problem, None, &self.outputs, &values)?;
        if let Some(doubt) = rows.doubts(self.problem.logs).first() {
            return Ok(Some(format!("the first search ended where {}", doubt.text)));
        }
        let coloured = errors.iter().find(|own| own.are_coloured());
        Ok(coloured.map(|own| {
            format!(
                "the first search ended with errors of {} that are not white",
                own.output
            )
        }))
    }

    /// Each from its start, by so many steps at most.
    fn searches(
        &mut self,
        begin: &Point,
        starts: &[DVector<f64>],
        most: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Found>, Error> {
        let free = vec![false; begin.z.len()];
        let run = |problem: &Problem<'_>, k: usize, watch: &mut Watch<'_>| {
            if k > 0 && problem.is_spent() {
                return Ok((ended(begin.clone()), 0));
            }
            let mut own = problem.clone();
            own.evaluations = 0;
            let mut steps = 0;
            let mut pulse = || {
                steps += 1;
                let is_stopped = watch(1.0 - 1.0 / (1.0 + 0.1 * f64::from(steps))).is_break();
                match is_stopped || steps as usize > most {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let start = match starts[k] == begin.z {
                true => begin.clone(),
                false => own.at(starts[k].clone())?,
            };
            let found = search(&mut own, start, &free, &mut pulse)?;
            Ok((found, own.evaluations))
        };
        let ends = every(starts.len(), &self.problem, &run, watch)?;
        self.problem.evaluations += ends.iter().map(|(_, count)| count).sum::<usize>();
        Ok(ends.into_iter().map(|(found, _)| found).collect())
    }

    /// At steps that are short enough there, too, and with noises at their least where that is as good.
    fn settled(&mut self, mut best: Found) -> Result<Found, Error> {
        let mut is_settled = false;
        let mut steps = self.problem.steps;
        for _ in 0..HALVINGS {
            if best.is_ended || self.problem.is_shortest() || self.problem.is_spent() {
                break;
            }
            let Some(fine) = self.problem.halved(&best.point)? else {
                is_settled = true;
                break;
            };
            // an end that has a value is worth more than shorter steps that have none
            if !fine.value.is_finite() {
                continue;
            }
            let next = self.again(fine, None)?;
            if next.point.value.is_finite() {
                (best, steps) = (next, self.problem.steps);
            }
        }
        self.problem.step_as(steps);
        // what a limit cut short is not known to be the end
        best.is_ended |= self.problem.is_spent();
        if let (false, false, Step::AtMost(step)) =
            (is_settled, best.is_ended, self.problem.steps.length)
        {
            self.warn_of(format!(
                "\u{2212}log L still changes by more than {SETTLED} where steps of {} are halved: the plant is stiff, or it jumps; method = \"rk4\" with a `step` in [estimate] says which steps count",
                short(step / 2.0_f64.powi(self.problem.steps.halvings as i32))
            ));
        }
        let mut held = vec![false; best.point.z.len()];
        for i in 0..held.len() {
            let unknown = &self.problem.unknowns[i];
            if !unknown.kind.is_noise() || best.is_bound[i] || best.is_ended {
                continue;
            }
            let mut z = best.point.z.clone();
            z[i] = unknown.searched(unknown.low);
            let there = self.problem.at(z.clone())?;
            if there.value <= best.point.value + SETTLED {
                held[i] = true;
                best = self.again(there, Some(&held))?;
            }
        }
        best.is_ended |= self.problem.is_spent();
        Ok(best)
    }

    /// A warning, once.
    fn warn_of(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    /// From here; those that are `held` stay.
    fn again(&mut self, from: Point, held: Option<&[bool]>) -> Result<Found, Error> {
        let free = vec![false; from.z.len()];
        let held = held.unwrap_or(&free);
        let mut found = search(&mut self.problem, from, held, &mut || {
            ControlFlow::Continue(())
        })?;
        for (is_bound, held) in found.is_bound.iter_mut().zip(held) {
            *is_bound |= held;
        }
        Ok(found)
    }

    fn no_slope(&self, place: usize) -> Error {
        let name = self.problem.unknowns[place].words();
        let message = format!(
            "{name} moves where the model jumps: \u{2212}log L has steps along it, and no slope to search by"
        );
        Error::refused(message).at(&self.study.file).hint(
            "write the jump as a steep smooth step, such as 1/(1 + exp(-(time - tau)/w)), or compare the \u{2212}log L of fits with one value each under [parameters]",
        )
    }

    fn no_value(&self) -> Error {
        let mut failures = self
            .problem
            .terms
            .iter()
            .filter_map(|t| t.likelihood.failure());
        let why = failures
            .next()
            .map_or_else(String::new, |error| format!(" ({error})"));
        Error::refused(format!("the likelihood has no value at the study's own values, nor at any other start{why}"))
            .at(&self.study.file)
            .hint("start nearer to the plant, by [parameters] and `initial`, or try more `starts` in [fit] with narrower `bounds`")
    }

    /// What the logs do not determine, before any search.
    fn untold(self, plant: &str, begin: Point, flat: &[usize]) -> Result<Fit, Error> {
        let undetermined: Vec<String> = flat
            .iter()
            .map(|&i| self.problem.unknowns[i].label())
            .collect();
        let found = Found {
            is_ended: false,
            ..ended(begin)
        };
        let known = uncertainty::uncertainty(&self.problem, &found);
        let mut fit = self.answer(plant, &found.point.clone(), (found, known), vec![])?;
        fit.undetermined = undetermined;
        Ok(fit)
    }

    fn told(
        mut self,
        plant: &str,
        begin: &Point,
        best: Found,
        mut optima: Vec<Optimum>,
    ) -> Result<Fit, Error> {
        let (best, known) = self.known(best, &mut optima)?;
        let free: Vec<usize> = (0..best.point.z.len())
            .filter(|&i| !best.is_bound[i])
            .collect();
        // beside an edge of where the plant has values there is no Hessian
        let has_hessian = !best.is_ended && best.hessian.iter().all(|x| x.is_finite());
        // short of the end the Hessian says nothing yet of what the logs tell
        let flat = match has_hessian {
            true if best.is_converged => {
                let mut flat = known::flat(&best.hessian, &free);
                flat.extend(free.iter().filter(|&&i| self.is_faint(&best, i)));
                flat.sort_unstable();
                flat.dedup();
                flat
            }
            true => known::flat(&best.point.information, &free),
            false => vec![],
        };
        self.warn(&best, &optima);
        let mut fit = self.answer(plant, begin, (best, known), optima)?;
        fit.undetermined = flat.iter().map(|&i| fit.unknowns[i].label()).collect();
        Ok(fit)
    }

    /// Whether a value could be anything in its range and far beyond, as where all readings are at an end of theirs.
    fn is_faint(&self, best: &Found, i: usize) -> bool {
        let (low, high) = self.problem.ranges()[i];
        let range = Some(high - low).filter(|range| range.is_finite());
        let width = range.unwrap_or(1.0).max(best.point.z[i].abs());
        best.hessian[(i, i)].sqrt().recip() > FAINT * width
    }

    fn warn(&mut self, best: &Found, optima: &[Optimum]) {
        let jumping = self
            .jumping
            .iter()
            .map(|&i| self.problem.unknowns[i].words());
        let jumping: Vec<String> = jumping.collect();
        if !jumping.is_empty() {
            self.warnings.push(format!(
                "{} may move where the model jumps, and no derivative sees that: a better value may be near",
                jumping.join(", ")
            ));
        }
        let count = self.problem.unknowns.len();
        if best.point.readings <= count {
            self.warnings.push(format!(
                "{} for {}: nothing is left that could speak against them",
                counted(best.point.readings, "reading"),
                counted(count, "value")
            ));
        }
        if best.point.confined > 0 {
            self.warnings.push(format!(
                "the model has no value where the estimate was: at {} rows it was put back into its declared range",
                best.point.confined
            ));
        }
        for (i, unknown) in self.problem.unknowns.iter().enumerate() {
            if !best.is_bound[i] {
                continue;
            }
            let value = unknown.value(best.point.z[i]);
            let is_least = value <= unknown.low * (1.0 + 1e-9);
            self.warnings
                .push(match (unknown.reaches_zero(), is_least) {
                    (true, true) => unknown.not_told_from_0(),
                    _ => format!("{} is at its bound, {}", unknown.words(), short(value)),
                });
        }
        if best.is_ended {
            self.warnings
                .push("a limit ended the search: these are the best values so far".to_owned());
        } else if !best.is_converged {
            self.warnings
                .push("the search did not converge: something is left to gain nearby".to_owned());
        }
        if let [first, second, ..] = optima {
            self.warnings.push(format!(
                "{} optima: the next one has a −log L that is {} larger",
                optima.len(),
                short(second.value - first.value)
            ));
        }
    }

    fn answer(
        mut self,
        plant: &str,
        begin: &Point,
        (found, uncertainty): (Found, Uncertainty),
        optima: Vec<Optimum>,
    ) -> Result<Fit, Error> {
        let is_ended = found.is_ended;
        let ahead = self.ahead(&found)?;
        let values = self.problem.values(&found.point.z);
        let steps = self.problem.steps;
        let mut alone = self.alone.take().map(|terms| Problem {
            terms,
            ..self.problem.clone()
        });
        if let Some(alone) = &mut alone {
            alone.step_as(steps);
        }
        let (errors, rows) =
            errors::errors(&mut self.problem, alone.as_mut(), &self.outputs, &values)?;
        self.warn_of_certain(&rows);
        // of other values than those that were looked for nobody needs to be told
        let doubts = match found.is_converged {
            true => rows.doubts(self.problem.logs),
            false => vec![],
        };
        let warned = doubts.iter().filter(|d| d.level < DoubtLevel::Refusal);
        self.warnings.extend(warned.map(|d| d.text.clone()));
        let coloured = errors.iter().filter(|own| own.are_coloured());
        let coloured: Vec<&str> = coloured.map(|own| own.output.as_str()).collect();
        if !coloured.is_empty() && !is_ended {
            self.warnings.push(format!(
                "errors of {} are not white: the model misses something, and intervals are too narrow",
                coloured.join(", ")
            ));
        }
        Ok(Fit {
            plant: plant.to_owned(),
            logs: self
                .problem
                .logs
                .iter()
                .map(|log| log.place.clone())
                .collect(),
            time_unit: self.study.time_unit.clone(),
            unknowns: self.problem.unknowns.to_vec(),
            nll: found.point.nll,
            nll_at_start: begin.nll,
            readings: found.point.readings,
            evaluations: self.problem.evaluations,
            is_converged: found.is_converged,
            uncertainty,
            optima,
            undetermined: vec![],
            has_events: self.problem.has_knees(),
            exact: self.exact,
            ahead,
            errors,
            doubts,
            warnings: self.warnings,
            notes: self.notes,
            rows,
            ended: match is_ended {
                true => self.study.budget.spent(),
                false => None,
            },
            file: self.study.file.clone(),
        })
    }

    /// Readings that do not count: neither the model nor the sensor leaves room for an error.
    fn warn_of_certain(&mut self, rows: &errors::Rows) {
        for column in &rows.columns {
            let certain = column.deviation.iter().filter(|d| **d == 0.0).count();
            if certain > 0 {
                self.warnings.push(format!(
                    "{} of {} did not count: the model is certain of it, and a share of 0 is no noise; state the noise in the unit of the output",
                    counted(certain, "reading"),
                    column.output
                ));
            }
        }
    }

    /// The next experiment, where it is asked for.
    fn ahead(&mut self, found: &Found) -> Result<Option<Ahead>, Error> {
        let Some(planned) = self.planned.take() else {
            return Ok(None);
        };
        let (ahead, notes) = experiment::ahead(self.source, planned, &self.problem, found)?;
        self.notes.extend(notes);
        Ok(Some(ahead))
    }

    /// The end with how well it is known: intervals by profile likelihood, where they are asked for, and of what is at
    /// a bound; noises that are no more than nothing are told of. Where a profile meets a lower −log L, the search goes
    /// on from there.
    fn known(
        &mut self,
        mut best: Found,
        optima: &mut Vec<Optimum>,
    ) -> Result<(Found, Uncertainty), Error> {
        for _ in 0..ROUNDS {
            let mut uncertainty = uncertainty::uncertainty(&self.problem, &best);
            if best.is_ended || !best.is_converged {
                return Ok((best, uncertainty));
            }
            let (problem, are_all) = (&mut self.problem, self.are_profiled);
            let told = uncertainty::profiles(problem, &best, &mut uncertainty, are_all)?;
            let Some(better) = told.better else {
                self.warnings.extend(told.warnings);
                return Ok((best, uncertainty));
            };
            let before = best.point.value;
            let next = self.again(better, None)?;
            best = self.settled(next)?;
            best.is_converged &= self.problem.is_sound(&best.point);
            self.notes.push(format!(
                "a profile met a lower \u{2212}log L, and the search went on from there: it is {} lower",
                short(before - best.point.value)
            ));
            if best.is_converged {
                optima.insert(0, Optimum::of(&best.point));
            }
        }
        best.is_converged = false;
        let uncertainty = uncertainty::uncertainty(&self.problem, &best);
        Ok((best, uncertainty))
    }
}

/// Searches that go on from where a profile fell.
const ROUNDS: usize = 6;

/// A search that was told to stop before it began.
fn ended(point: Point) -> Found {
    let n = point.z.len();
    Found {
        is_bound: vec![false; n],
        hessian: nalgebra::DMatrix::zeros(n, n),
        is_converged: false,
        is_ended: true,
        point,
    }
}

/// Ends as one where their −log L differs by no more than this.
const SAME: f64 = 1e-3;

/// So many of its range a value's standard deviation is where the logs tell nothing of it.
const FAINT: f64 = 1e4;

/// Trials of a step, damped ones too, after which a further search ends; the best of those goes on where it is better
/// than the first.
const MOST_STEPS: usize = 25;

/// Different ends of searches that converged, the best first.
fn optima(ends: &[Found]) -> Vec<Optimum> {
    let mut all: Vec<Optimum> = vec![];
    for end in ends.iter().filter(|end| end.is_converged) {
        match all.last_mut() {
            Some(last) if (end.point.value - last.value).abs() <= SAME => last.found += 1,
            _ => all.push(Optimum::of(&end.point)),
        }
    }
    all
}

impl Optimum {
    fn of(point: &Point) -> Self {
        Self {
            nll: point.nll,
            value: point.value,
            found: 1,
        }
    }
}
