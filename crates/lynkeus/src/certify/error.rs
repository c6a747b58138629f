//! What is proved of the error of a study's observer or filter, from the starts that the study asks about.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Interval};
use lynkeus_model::Variable;
use lynkeus_observers::Tuning;
use lynkeus_proof::tube::{End, Problem, Sampled};
use lynkeus_structure::{AugmentedPlant, Standing};
use lynkeus_study::BetweenSamples;

use super::tube::{Part, Ranges, Row, Seen, until};
use crate::Error;
pub use beside::Reading;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::words::number;
use system::System;

mod beside;
mod filter;
mod flow;
mod system;
pub(crate) mod told;

/// An error of so many boxes is of no interest.
const BEYOND: f64 = 1000.0;

/// What was seen of a tube, and how it ended.
type Run = (Seen, End);

/// What is proved of the error x̂ − x, and of a filter's covariance.
#[derive(Clone, Debug)]
pub struct ErrorTube {
    /// whether the error has these bounds until the time asked for
    pub verdict: Standing,
    /// when it starts
    pub from: f64,
    /// until when it is asked
    pub until: f64,
    /// whether the observer is an extended Kalman filter
    pub is_filter: bool,
    /// the time from one sample to the next; none for sensors that are read continuously
    pub every: Option<f64>,
    /// whether measurements follow the model between samples, or are held
    pub is_predicted: bool,
    /// names of the observer's monitors
    pub monitors: Vec<String>,
    /// where plant and unknown inputs start
    pub start: Ranges,
    /// where the estimate starts
    pub estimate: Vec<(String, f64)>,
    /// bounds of the noise of readings
    pub readings: Vec<Reading>,
    /// ranges of what may vary as it likes
    pub inputs: Ranges,
    /// with these errors of readings; none where nothing could be followed
    pub noisy: Option<Followed>,
    /// with readings without noise: what the start and disturbances leave
    pub exact: Option<Followed>,
    /// why it is not proved
    pub obstacle: Option<String>,
    /// what it leaves aside
    pub notes: Vec<String>,
}

/// The error x̂ − x, and a filter's own standard deviations, along the tube, state by state.
#[derive(Clone, Debug)]
pub struct Followed {
    /// until when this is proved
    pub reached: f64,
    /// ranges of the error over all of the time
    pub error: Vec<Interval>,
    /// the same at the end of it
    pub error_end: Vec<Interval>,
    /// ranges of the standard deviations over all of the time
    pub deviation: Vec<Interval>,
    /// the same at the end of it
    pub deviation_end: Vec<Interval>,
    /// ranges of the monitors over all of the time
    pub monitors: Vec<Interval>,
    /// parts of the time, each with ranges of the errors, then of the standard deviations, then of the monitors
    pub rows: Vec<Row>,
    /// why it ends before the time asked for
    obstacle: Option<String>,
}

impl ErrorTube {
    /// For a study that asks about starts; none for others.
    ///
    /// # Errors
    /// Inputs without value; names that the plant does not have.
    pub(super) fn of(
        prepared: &Prepared<'_>,
        place: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Option<Self>, Error> {
        let settings = &prepared.study().certify;
        let Some(start) = &settings.start else {
            return Ok(None);
        };
        let design = prepared.design_with(tuning)?;
        let (from, until) = until(prepared)?;
        let mut found = Self {
            verdict: Standing::Undecided,
            from,
            until,
            is_filter: design.observer.filter.is_some(),
            every: None,
            is_predicted: prepared.study().estimate.between_samples == BetweenSamples::Predict,
            monitors: vec![],
            start: vec![],
            estimate: vec![],
            readings: vec![],
            inputs: vec![],
            noisy: None,
            exact: None,
            obstacle: None,
            notes: vec![],
        };
        match System::of(prepared, place, &design.observer, start, (from, until))? {
            Ok(system) => found.fill(&system, &place.graph().budget()),
            Err(obstacle) => found.obstacle = Some(obstacle),
        }
        Ok(Some(found))
    }

    fn fill(&mut self, system: &System, budget: &Budget) {
        let names = |of: &[Variable]| of.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
        let flow = &system.sampled.flow;
        self.every = system.every;
        self.monitors.clone_from(&system.monitors.0);
        self.start = names(&system.states)
            .into_iter()
            .zip(flow.start.iter().copied())
            .collect();
        self.estimate = names(&system.states)
            .into_iter()
            .zip(system.estimate.iter().copied())
            .collect();
        self.readings.clone_from(&system.readings);
        self.inputs = names(&system.inputs)
            .into_iter()
            .zip(flow.inputs.iter().copied())
            .collect();
        self.notes.clone_from(&system.notes);
        // of the time that is left: some remains for what is asked after this
        let whole = vec![system.sampled.flow.clone()];
        let (noisy, parts) = self.followed(system, &system.sampled, whole, &budget.part(0.5));
        self.obstacle.clone_from(&noisy.obstacle);
        if self.obstacle.is_none() {
            self.verdict = Standing::Proved;
        }
        let exact = match system.is_noisy() {
            true => {
                let exact = system.exact();
                let parts = parts.into_iter().map(|part| Problem {
                    start: part.start,
                    ..exact.flow.clone()
                });
                let parts = parts.collect();
                self.followed(system, &exact, parts, &budget.part(0.5)).0
            }
            false => noisy.clone(),
        };
        (self.noisy, self.exact) = (Some(noisy), Some(exact));
    }

    /// Where the error is from all parts of the start set, which are halved where that helps, and the parts; or from the
    /// whole of it as far as that goes.
    fn followed(
        &self,
        system: &System,
        sampled: &Sampled,
        parts: Vec<Problem>,
        budget: &Budget,
    ) -> (Followed, Vec<Problem>) {
        let (seen, end, parts) = match self.in_parts(system, sampled, &parts, budget) {
            Ok((seen, parts)) => (seen, End::Reached, parts),
            Err(whole) => {
                let (seen, end) = whole.unwrap_or_else(|| self.run(system, sampled, budget));
                (seen, end, vec![sampled.flow.clone()])
            }
        };
        (self.told(system, seen, end), parts)
    }

    fn told(&self, system: &System, mut seen: Seen, end: End) -> Followed {
        seen.cut();
        let reached = number(seen.reached);
        let help = "a smaller `start`, less noise or an earlier `until` may help";
        let obstacle = match end {
            End::Reached => None,
            End::Stopped => Some(format!(
                "from {reached} on the error is only known to be within {BEYOND} times the box: {help}"
            )),
            End::Stuck => Some(format!(
                "from {reached} on no step could be proved: what is known of the error is too wide there for the curvature of the model; {help}"
            )),
            End::Spent(spent) => Some(format!("it had come to {reached}: {spent}")),
        };
        let n = system.states.len();
        let mut error = seen.range();
        let mut deviation = error.split_off(n.min(error.len()));
        let monitors = deviation.split_off(system.variances.len().min(deviation.len()));
        let mut error_end = seen.end;
        let mut deviation_end = error_end.split_off(n.min(error_end.len()));
        deviation_end.truncate(system.variances.len());
        Followed {
            reached: seen.reached,
            error,
            error_end,
            deviation,
            deviation_end,
            monitors,
            rows: seen.rows,
            obstacle,
        }
    }

    /// The tubes of parts of the start set, of their halves, and so on, if all come to the end. Else the tube of the part,
    /// if it is only one.
    fn in_parts(
        &self,
        system: &System,
        whole: &Sampled,
        parts: &[Problem],
        budget: &Budget,
    ) -> Result<(Seen, Vec<Problem>), Option<Run>> {
        let mut open: Vec<Part> = parts.iter().map(Part::whole).collect();
        let (mut first, mut all, mut done) = (None, None::<Seen>, vec![]);
        while let Some(part) = open.pop() {
            let sampled = Sampled {
                flow: part.problem.clone(),
                ..whole.clone()
            };
            let (seen, end) = self.run(system, &sampled, budget);
            if end == End::Reached {
                match &mut all {
                    Some(all) => all.join(&seen),
                    None => all = Some(seen),
                }
                done.push(part.problem);
                continue;
            }
            let is_open = matches!(end, End::Stuck | End::Stopped);
            let next = is_open.then(|| part.halves(&whole.flow, Some(seen.reached)));
            if parts.len() == 1 {
                first.get_or_insert((seen, end));
            }
            match next.flatten() {
                Some(next) => open.extend(next),
                None => return Err(first),
            }
        }
        all.map(|all| (all, done)).ok_or(first)
    }

    /// One tube: errors, deviations, monitors.
    fn run(&self, system: &System, sampled: &Sampled, budget: &Budget) -> Run {
        let told = |from: f64, to: f64, z: &[Interval]| -> Vec<Interval> {
            let errors = system.errors().map(|i| z[i]);
            let deviations = system.variances.iter().map(|&i| root(z[i]));
            let time = Interval::point(from).hull(Interval::point(to));
            let monitors = system.monitored(z, time);
            errors.chain(deviations).chain(monitors).collect()
        };
        let beyond = |errors: &[Interval]| {
            let mut sides = system.states.iter().zip(errors);
            sides.any(|(state, error)| error.magnitude() > BEYOND * (state.max - state.min))
        };
        let mut seen = Seen::new(self.from, self.until);
        let (end, reached, last) = sampled.reach(self.until, budget, &mut |from, to, z| {
            let now = told(from, to, z);
            seen.add(from, to, &now);
            match beyond(&now) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        seen.reached = reached;
        if !last.is_empty() {
            seen.end = told(reached, reached, &last);
        }
        (seen, end)
    }
}

/// The root of a variance, which is not negative whatever its enclosure is.
fn root(variance: Interval) -> Interval {
    let positive = Interval::new(0.0, f64::INFINITY).unwrap_or(Interval::ENTIRE);
    variance.intersection(positive).sqrt()
}
