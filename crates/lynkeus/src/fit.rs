//! Parameters and noises from logs, by their likelihood, and what the logs cannot tell.
//!
//! `docs/fit.md` says what is made least, how, and what every figure of the answer is.

mod errors;
mod experiment;
mod json;
mod known;
mod logs;
#[cfg(feature = "plot")]
mod picture;
mod plant;
mod problem;
mod search;
mod told;
mod uncertainty;
pub(crate) mod unknown;

use std::ops::ControlFlow;

use lynkeus_expr::Spent;
use lynkeus_observers::kalman::EKF;
use lynkeus_run::{Method, Step};
use lynkeus_study::{Name, Objective};
use lynkeus_words::short;
use nalgebra::DVector;

use crate::crew::{Watch, every};
use crate::prepare::{self, Prepared, systems};
use crate::{Error, Study, Table};
use errors::Errors;
use experiment::Ahead;
#[cfg(test)]
pub(crate) use json::FitReport;
use known::Exact;
use logs::FittedLog;
use problem::{Point, Problem, Term};
use search::{Found, search};
use uncertainty::Uncertainty;
use unknown::{Kind, Unknown};

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
    /// what the logs do not tell
    pub undetermined: Vec<String>,
    pub(crate) exact: Exact,
    /// where that is asked
    pub(crate) ahead: Option<Ahead>,
    pub(crate) errors: Vec<Errors>,
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
    /// by how many of them
    pub found: usize,
}

/// Fits a study to logs.
///
/// # Errors
/// A `[fit]` that does not fit the study, logs without the columns that it reads, bounds that exclude the start, a
/// likelihood that has no value at any start. What the logs do not tell is an answer: [`Fit::undetermined`].
pub fn fit(
    study: &Study,
    tables: &[Table],
    options: FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Fit, Error> {
    let (study, notes) = with_filter(study)?;
    let plant = prepare::plant(&study)?;
    let prepared = Prepared::new(&study, &plant)?;
    let design = prepared.design()?;
    let Some(tuning) = &design.observer.filter else {
        return Err(Error::input("fit needs a filter").at(&study.file));
    };
    if tables.is_empty() {
        return Err(Error::input("fit needs a log").at(&study.file));
    }
    let logs = tables
        .iter()
        .map(|table| FittedLog::new(&prepared, &design, table));
    let logs = logs.collect::<Result<Vec<_>, _>>()?;
    let symbolic = plant::symbolic(&study)?;
    let unknowns = unknown::unknowns(&prepared, &symbolic, &logs)?;
    let seen = prepare::seen_by(&study, &symbolic, &prepare::sensors(&study, &symbolic))?;
    let is_alone = study.fit.objective == Objective::Simulation;
    let source = plant::Source {
        prepared: &prepared,
        symbolic: &seen,
        tuning,
        is_alone,
        further: &[],
    };
    let terms_of = |is_alone: bool| -> Result<Vec<Term>, Error> {
        let plant = plant::Source { is_alone, ..source };
        terms(&plant, &unknowns, &logs)
    };
    let terms = terms_of(is_alone)?;
    // without corrections nothing says what an unknown input does
    let is_driven = prepared.augmented().states.len() == prepared.augmented().plant_states();
    let alone = match is_driven {
        true if is_alone => Some(terms.clone()),
        true => Some(terms_of(true)?),
        false => None,
    };
    // half a likelihood is none
    if let Some(spent) = study.budget.spent() {
        return Err(Error::ended(spent).at(&study.file));
    }
    let exact = known::exact(&prepared, &symbolic, &unknowns, &tuning.initial_variance)?;
    let problem = Problem {
        unknowns: &unknowns,
        logs: &logs,
        terms,
        step: Step::Auto,
        evaluations: 0,
    };
    let mut work = Work {
        study: &study,
        source,
        options,
        problem,
        alone,
        exact,
        warnings: vec![],
        notes,
    };
    work.notes
        .extend(logs.iter().flat_map(|log| log.notes.clone()));
    work.warnings
        .extend(logs.iter().flat_map(|log| log.warnings.clone()));
    if tuning.gate.is_some() || tuning.projects {
        work.notes
            .push("the gate and `bounds` of [observer] are left out of the likelihood".to_owned());
    }
    let outputs = seen
        .outputs
        .iter()
        .map(|o| o.variable.name.clone())
        .collect();
    work.done(&plant.name, outputs, watch)
}

/// One per log; logs whose states start alike have one likelihood.
fn terms(
    plant: &plant::Source<'_>,
    unknowns: &[Unknown],
    logs: &[FittedLog],
) -> Result<Vec<Term>, Error> {
    let mut terms: Vec<Term> = vec![];
    for (place, log) in logs.iter().enumerate() {
        let is_own = |kind: Kind| !matches!(kind, Kind::Start { log, .. } if log != place);
        let own: Vec<(usize, &Unknown)> = (unknowns.iter().enumerate())
            .filter(|(_, unknown)| is_own(unknown.kind))
            .collect();
        let places = own.iter().map(|(place, _)| *place).collect();
        let likelihood = match terms.first() {
            Some(first) if log.starts == logs[0].starts => first.likelihood.clone(),
            _ => plant.likelihood(&own, &log.starts)?,
        };
        terms.push(Term { likelihood, places });
    }
    Ok(terms)
}

/// The study by the filter whose innovations are fitted.
fn with_filter(study: &Study) -> Result<(Study, Vec<String>), Error> {
    let mut own = study.clone();
    let mut notes = vec![];
    let family = study
        .observer
        .family
        .as_ref()
        .map(|name| name.text.as_str());
    if family != Some(EKF.name()) {
        if let (Some(family), Objective::Innovations) = (family, study.fit.objective) {
            notes.push(format!(
                "the likelihood is that of family = \"ekf\": {family} has none whose derivatives are known"
            ));
        }
        own.observer.family = Some(Name::from(EKF.name()));
    }
    Ok((own, notes))
}

/// A fit under way.
struct Work<'w> {
    study: &'w Study,
    source: plant::Source<'w>,
    options: FitOptions,
    problem: Problem<'w>,
    /// the plant alone, log by log
    alone: Option<Vec<Term>>,
    exact: Exact,
    warnings: Vec<String>,
    notes: Vec<String>,
}

/// What −log L may change by where steps are halved.
const SETTLED: f64 = 1e-4;

/// The same as a share of −log L, at the start: there nothing fits yet.
const NEARLY: f64 = 1e-5;

/// Most halvings of the usual interval between rows, at the start and at the end.
const HALVINGS: [usize; 2] = [5, 8];

/// One row of so many may be one at which the plant has no value where the estimate is.
const CONFINED: usize = 10;

impl Work<'_> {
    fn done(
        mut self,
        plant: &str,
        outputs: Vec<String>,
        watch: &mut Watch<'_>,
    ) -> Result<Fit, Error> {
        let begin = self.begin()?;
        if begin.value.is_finite() {
            let flat = known::undetermined(&mut self.problem, &begin)?;
            if !flat.is_empty() {
                return self.untold(plant, outputs, begin, &flat);
            }
        }
        let mut ends = self.searches(&begin, watch)?;
        ends.retain(|found| found.point.value.is_finite());
        ends.sort_by(|a, b| a.point.value.total_cmp(&b.point.value));
        let optima = optima(&ends);
        let Some(best) = ends.into_iter().next() else {
            return Err(self.no_value());
        };
        let mut best = self.settled(best)?;
        // a filter that is put back at every other row is none whose likelihood means something
        let rows: usize = self.problem.logs.iter().map(|log| log.fitted).sum();
        best.is_converged &= CONFINED * best.point.confined <= rows;
        self.told(plant, outputs, &begin, best, optima)
    }

    /// The study's own values, at steps that are short enough.
    fn begin(&mut self) -> Result<Point, Error> {
        let starts = self.problem.unknowns.iter().map(|u| u.start);
        let z = self.problem.searched(starts);
        if let Method::Rk4(step) = systems::method(&self.study.estimate.method) {
            self.problem.step = step;
            return self.problem.at(z);
        }
        let intervals = self.problem.logs.iter().map(FittedLog::interval);
        let interval = intervals.fold(f64::INFINITY, f64::min);
        self.problem.step = Step::AtMost(interval);
        let mut point = self.problem.at(z)?;
        for _ in 0..HALVINGS[0] {
            if self.study.budget.spent().is_some() {
                break;
            }
            let tolerance = SETTLED.max(NEARLY * point.value.abs());
            let Some(next) = self.halved(&point, tolerance)? else {
                return Ok(point);
            };
            point = next;
        }
        Ok(point)
    }

    /// The same point at half the steps, which are kept where that changes it.
    fn halved(&mut self, coarse: &Point, tolerance: f64) -> Result<Option<Point>, Error> {
        let Step::AtMost(length) = self.problem.step else {
            return Ok(None);
        };
        self.problem.step = Step::AtMost(0.5 * length);
        let fine = self.problem.at(coarse.z.clone())?;
        if (fine.value - coarse.value).abs() < tolerance {
            self.problem.step = Step::AtMost(length);
            return Ok(None);
        }
        Ok(Some(fine))
    }

    /// From the study's own values, and from those that are spread over the bounds.
    fn searches(&mut self, begin: &Point, watch: &mut Watch<'_>) -> Result<Vec<Found>, Error> {
        let starts = starts(
            &self.problem,
            begin,
            self.study.fit.starts,
            self.study.fit.seed,
        );
        let budget = &self.study.budget;
        let free = vec![false; begin.z.len()];
        let run = |problem: &Problem<'_>, k: usize, watch: &mut Watch<'_>| {
            if k > 0 && budget.spent().is_some() {
                return Ok((ended(begin.clone()), 0));
            }
            let mut own = problem.clone();
            own.evaluations = 0;
            let mut steps = 0.0;
            let mut pulse = || {
                steps += 1.0;
                let is_stopped = watch(1.0 - 1.0 / (1.0 + 0.1 * steps)).is_break();
                match is_stopped || budget.spent().is_some() {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let found = search(&mut own, starts[k].clone(), &free, &mut pulse)?;
            Ok((found, own.evaluations))
        };
        let ends = every(starts.len(), &self.problem, &run, watch)?;
        self.problem.evaluations += ends.iter().map(|(_, count)| count).sum::<usize>();
        Ok(ends.into_iter().map(|(found, _)| found).collect())
    }

    /// At steps that are short enough there, too, and with noises at their least where that is as good.
    fn settled(&mut self, mut best: Found) -> Result<Found, Error> {
        let mut is_settled = false;
        for _ in 0..HALVINGS[1] {
            if best.is_ended {
                break;
            }
            let Some(fine) = self.halved(&best.point, SETTLED)? else {
                is_settled = true;
                break;
            };
            let free = vec![false; fine.z.len()];
            best = self.again(fine.z, &free)?;
        }
        if let (false, false, Step::AtMost(step)) = (is_settled, best.is_ended, self.problem.step) {
            self.warnings.push(format!(
                "\u{2212}log L still changes by more than {SETTLED} where steps of {} are halved: the plant is stiff, or it jumps; method = \"rk4\" with a `step` in [estimate] says which steps count",
                short(step)
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
                best = self.again(z, &held)?;
                best.is_bound[i] = true;
            }
        }
        Ok(best)
    }

    fn again(&mut self, z: DVector<f64>, held: &[bool]) -> Result<Found, Error> {
        let budget = self.study.budget.clone();
        let mut pulse = || match budget.spent() {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        };
        let mut found = search(&mut self.problem, z, held, &mut pulse)?;
        for (is_bound, held) in found.is_bound.iter_mut().zip(held) {
            *is_bound |= held;
        }
        Ok(found)
    }

    fn no_value(&self) -> Error {
        Error::refused("the likelihood has no value at the study's own values, nor at any other start")
            .at(&self.study.file)
            .hint("start nearer to the plant, by [parameters] and `initial`, or try more `starts` in [fit] with narrower `bounds`")
    }

    /// What the logs do not tell, before any search.
    fn untold(
        self,
        plant: &str,
        outputs: Vec<String>,
        begin: Point,
        flat: &[usize],
    ) -> Result<Fit, Error> {
        let undetermined: Vec<String> = flat
            .iter()
            .map(|&i| self.problem.unknowns[i].label())
            .collect();
        let found = Found {
            is_ended: false,
            ..ended(begin)
        };
        let mut fit = self.answer(plant, outputs, &found.point.clone(), found, vec![])?;
        fit.undetermined = undetermined;
        Ok(fit)
    }

    fn told(
        mut self,
        plant: &str,
        outputs: Vec<String>,
        begin: &Point,
        best: Found,
        optima: Vec<Optimum>,
    ) -> Result<Fit, Error> {
        let free: Vec<usize> = (0..best.point.z.len())
            .filter(|&i| !best.is_bound[i])
            .collect();
        let flat = match best.is_ended {
            true => vec![],
            false => known::flat(&best.hessian, &free),
        };
        self.warn(&best, &optima);
        let mut fit = self.answer(plant, outputs, begin, best, optima)?;
        fit.undetermined = flat.iter().map(|&i| fit.unknowns[i].label()).collect();
        Ok(fit)
    }

    fn warn(&mut self, best: &Found, optima: &[Optimum]) {
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
                    (true, true) => format!("{}: the log cannot tell it from 0", unknown.words()),
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
                short(second.nll - first.nll)
            ));
        }
    }

    fn answer(
        mut self,
        plant: &str,
        outputs: Vec<String>,
        begin: &Point,
        found: Found,
        optima: Vec<Optimum>,
    ) -> Result<Fit, Error> {
        let is_ended = found.is_ended;
        let mut uncertainty = uncertainty::uncertainty(&self.problem, &found);
        self.profiles(&found, &mut uncertainty)?;
        let ahead = self.ahead(&found)?;
        let values = self.problem.values(&found.point.z);
        let alone = self.alone.as_mut();
        let alone = alone.map(|terms| Problem {
            terms: std::mem::take(terms),
            ..self.problem.clone()
        });
        let mut alone = alone;
        let (errors, rows) = errors::errors(&mut self.problem, alone.as_mut(), &outputs, &values)?;
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
            exact: self.exact,
            ahead,
            errors,
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

    /// The next experiment, where it is asked for.
    fn ahead(&mut self, found: &Found) -> Result<Option<Ahead>, Error> {
        if !self.options.next_experiment {
            return Ok(None);
        }
        let (ahead, notes) = experiment::ahead(self.source, self.study, &self.problem, found)?;
        self.notes.extend(notes);
        Ok(Some(ahead))
    }

    /// Intervals by profile likelihood, where they are asked for, and of what is at a bound; noises that are no more
    /// than nothing are told of.
    fn profiles(&mut self, found: &Found, uncertainty: &mut Uncertainty) -> Result<(), Error> {
        if found.is_ended || !found.is_converged {
            return Ok(());
        }
        let budget = self.study.budget.clone();
        let mut pulse = || match budget.spent() {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        };
        for (i, known) in uncertainty.known.iter_mut().enumerate() {
            let unknown = &self.problem.unknowns[i];
            let is_noise = unknown.reaches_zero() && !known.is_bound;
            let told = format!("{}: the log cannot tell it from 0", unknown.words());
            let own = *known;
            let is_nothing =
                is_noise && uncertainty::is_nothing(&mut self.problem, found, i, &own, &mut pulse)?;
            if is_nothing {
                self.warnings.push(told);
            }
            if self.options.profiles || known.is_bound {
                let problem = &mut self.problem;
                let sides = uncertainty::profile(problem, found, i, &own, is_nothing, &mut pulse)?;
                known.interval = sides.or(known.interval);
            }
        }
        Ok(())
    }
}

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

/// How far searches of noises, and of what has no bounds, start from the study's own values: a factor of 10, or that
/// share of the value.
const APART: f64 = 10.0;

/// The study's own values, then points that fill the bounds evenly (the additive recurrence of M. Roberts, *The
/// unreasonable effectiveness of quasirandom sequences*, 2018), moved by the seed.
fn starts(problem: &Problem<'_>, begin: &Point, count: usize, seed: u64) -> Vec<DVector<f64>> {
    let n = begin.z.len();
    // the positive root of r^(n + 1) = r + 1
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (n as f64 + 1.0));
    }
    let ends = problem.unknowns.iter().zip(&begin.z).map(|(unknown, &z)| {
        let (low, high) = (
            unknown.searched(unknown.low),
            unknown.searched(unknown.high),
        );
        let reach = match unknown.is_log {
            true => APART.ln(),
            false => z.abs().max(1.0),
        };
        let is_open = unknown.kind.is_noise() || !(high - low).is_finite();
        match is_open {
            true => ((z - reach).max(low), (z + reach).min(high)),
            false => (low, high),
        }
    });
    let ends: Vec<(f64, f64)> = ends.collect();
    let shift = |i: usize| {
        // SplitMix64
        let mut x = seed.wrapping_add((i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x >> 11) as f64 / (1_u64 << 53) as f64
    };
    let further = (1..count).map(|k| {
        DVector::from_fn(n, |i, _| {
            let share = (shift(i) + k as f64 / root.powi(i as i32 + 1)).fract();
            let (low, high) = ends[i];
            low + share * (high - low)
        })
    });
    std::iter::once(begin.z.clone()).chain(further).collect()
}

/// Ends as one where their −log L differs by no more than this.
const SAME: f64 = 1e-3;

/// Different ends of searches that converged, the best first.
fn optima(ends: &[Found]) -> Vec<Optimum> {
    let mut all: Vec<Optimum> = vec![];
    for end in ends.iter().filter(|end| end.is_converged) {
        match all.last_mut() {
            Some(last) if (end.point.nll - last.nll).abs() <= SAME => last.found += 1,
            _ => all.push(Optimum {
                nll: end.point.nll,
                found: 1,
            }),
        }
    }
    all
}
