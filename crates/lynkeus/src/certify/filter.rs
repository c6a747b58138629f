//! What is proved of a study's extended Kalman filter, from the starts that the study asks about.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Interval};
use lynkeus_model::Variable;
use lynkeus_observers::Tuning;
use lynkeus_proof::tube::{End, Sampled};
use lynkeus_structure::{AugmentedPlant, Standing};

use super::tube::{Ranges, Row, Seen, until};
use crate::Error;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::words::number;
use system::System;

mod system;
pub(crate) mod told;

/// What is proved of the filter's error and of its covariance.
#[derive(Clone, Debug)]
pub struct FilterTube {
    /// whether the error has these bounds until the time asked for
    pub verdict: Standing,
    /// when it starts
    pub from: f64,
    /// until when it is asked
    pub until: f64,
    /// the time from one sample to the next
    pub every: Option<f64>,
    /// where plant and unknown inputs start
    pub start: Ranges,
    /// where the estimate starts
    pub estimate: Vec<(String, f64)>,
    /// bounds of the noise of readings, by output
    pub readings: Vec<(String, f64)>,
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

/// The error x̂ − x and the filter's own standard deviations along the tube, state by state.
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
    /// parts of the time, each with ranges of the errors, then of the standard deviations
    pub rows: Vec<Row>,
    /// why it ends before the time asked for
    obstacle: Option<String>,
}

impl FilterTube {
    /// For a study with an extended filter that asks about starts; none for others.
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
        if design.observer.filter.is_none() {
            return Ok(None);
        }
        let (from, until) = until(prepared)?;
        let mut found = Self {
            verdict: Standing::Undecided,
            from,
            until,
            every: None,
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
        self.every = Some(system.every);
        self.start = names(&system.states)
            .into_iter()
            .zip(flow.start.iter().copied())
            .collect();
        self.estimate = names(&system.states)
            .into_iter()
            .zip(system.estimate.iter().copied())
            .collect();
        let errors = system.sampled.errors.iter().copied();
        self.readings = system.outputs.iter().cloned().zip(errors).collect();
        self.inputs = names(&system.inputs)
            .into_iter()
            .zip(flow.inputs.iter().copied())
            .collect();
        self.notes.clone_from(&system.notes);
        // of the time that is left: some remains for what is asked after this
        let noisy = self.followed(system, &system.sampled, &budget.part(0.5));
        self.obstacle.clone_from(&noisy.obstacle);
        if self.obstacle.is_none() {
            self.verdict = Standing::Proved;
        }
        self.noisy = Some(noisy);
        let mut exact = system.sampled.clone();
        // after the noise of each output stands what disturbs them, which stays
        exact.errors[..system.outputs.len()].fill(0.0);
        self.exact = Some(self.followed(system, &exact, &budget.part(0.5)));
    }

    fn followed(&self, system: &System, sampled: &Sampled, budget: &Budget) -> Followed {
        let told = |z: &[Interval]| -> Vec<Interval> {
            let errors = system.errors().map(|i| z[i]);
            let deviations = system.variances().map(|i| root(z[i]));
            errors.chain(deviations).collect()
        };
        let mut seen = Seen::new(self.from, self.until);
        let (end, reached, last) = sampled.reach(self.until, budget, &mut |from, to, z| {
            seen.add(from, to, &told(z));
            ControlFlow::Continue(())
        });
        seen.reached = reached;
        if !last.is_empty() {
            seen.end = told(&last);
        }
        seen.cut();
        let obstacle = match end {
            End::Reached | End::Stopped => None,
            End::Stuck => Some(format!(
                "from {} on no step could be proved: what is known of the error is too wide there for the curvature of the model; a smaller `start`, less noise or an earlier `until` may help",
                number(reached)
            )),
            End::Spent(spent) => Some(format!("it had come to {}: {spent}", number(reached))),
        };
        let n = system.states.len();
        let halves = |all: Vec<Interval>| -> (Vec<Interval>, Vec<Interval>) {
            (
                all.iter().take(n).copied().collect(),
                all.into_iter().skip(n).collect(),
            )
        };
        let (error, deviation) = halves(seen.range());
        let (error_end, deviation_end) = halves(seen.end);
        Followed {
            reached,
            error,
            error_end,
            deviation,
            deviation_end,
            rows: seen.rows,
            obstacle,
        }
    }
}

/// The root of a variance, which is not negative whatever its enclosure is.
fn root(variance: Interval) -> Interval {
    let positive = Interval::new(0.0, f64::INFINITY).unwrap_or(Interval::ENTIRE);
    variance.intersection(positive).sqrt()
}
