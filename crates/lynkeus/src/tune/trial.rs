//! One value of an observer in simulation.

use lynkeus_observers::Design;
use lynkeus_run::{Events, Role, Simulation, Trajectory};

use super::Row;
use super::disturbed::disturbed;
use super::judge::{Judge, Runs, Under};
use super::reference::Reference;
use super::speed::{longest_step, transparent};
use crate::Error;
use crate::crew::Watch;
use crate::judge::outcome::{interrupted, is_observers_answer};
use crate::prepare::Prepared;
use crate::prepare::systems::settings;
use crate::prepare::systems::{self, monitor_column};
use crate::simulate::open_loop;
pub(super) use crate::thrifty::thrifty;
use crate::words::in_words;

/// Judges the tuning of a study; an estimate that diverges is a row without figures.
///
/// # Errors
/// A study that cannot be simulated.
pub(super) fn simulated(
    prepared: &Prepared<'_>,
    design: &Design,
    reference: &Reference,
    mut row: Row,
    watch: &mut Watch<'_>,
) -> Result<Row, Error> {
    let judge = Judge {
        study: prepared.study(),
        plant: prepared.plant(),
        observer: transparent(&design.observer),
        reference,
    };
    let trial = Trial {
        exact: exact(&judge)?,
        judge: &judge,
    };
    match judge.judge(&mut row, &trial, watch)? {
        None => Ok(row),
        Some(reason) => Ok(row.failed(reason)),
    }
}

/// One value of the sweep.
struct Trial<'a> {
    /// its observer is transparent
    judge: &'a Judge<'a>,
    /// the run without noise
    exact: Simulation,
}

/// Plant and observer, without noise.
fn exact(judge: &Judge<'_>) -> Result<Simulation, Error> {
    let Judge { study, plant, .. } = *judge;
    let settings = settings(study)?;
    let plain = open_loop(study, settings, plant)?;
    let rows = (plain.until - plain.start) / plain.output_step;
    Ok(Simulation {
        observer: Some(systems::observer(plant, &judge.observer)?),
        inputs: systems::inputs(study, plant, settings, &judge.observer)?,
        noise: judge.reference.exact(),
        method: thrifty(plain.method, rows),
        ..plain
    })
}

impl Runs for Trial<'_> {
    type Run = Trajectory;

    fn run(
        &self,
        under: Under,
        watch: &mut Watch<'_>,
    ) -> Result<Result<Trajectory, String>, Error> {
        let Judge { study, plant, .. } = *self.judge;
        let exact = self.exact.clone();
        let simulation = match under {
            Under::Exact => exact,
            Under::Noise => Simulation {
                noise: self.judge.reference.noise.clone(),
                ..exact
            },
            Under::Disturbance => disturbed(study, plant, &self.judge.observer, exact)?,
        };
        match simulation.run_watched(watch) {
            Ok(run) => Ok(Ok(run)),
            Err(error) if is_observers_answer(&error.error) => Ok(Err(in_words(&error.error))),
            Err(error) => Err(interrupted(error.error, &study.file)),
        }
    }

    fn margin(&self, exact: &Trajectory) -> Option<f64> {
        let step = self.longest_stable_step(exact)?;
        Some(step / self.judge.reference.sample_step)
    }
}

impl Trial<'_> {
    fn longest_stable_step(&self, run: &Trajectory) -> Option<f64> {
        let simulation = &self.exact;
        let observer = simulation.observer.as_ref()?;
        let mut inputs = simulation.inputs.evaluation();
        let mut u = vec![0.0; simulation.inputs.outputs().len()];
        let names = observer.signals().to_vec();
        // the first signals of an observer are its measured outputs
        let measured = self.judge.observer.measured.iter();
        let outputs: Vec<Option<&[f64]>> = measured
            .map(|signal| {
                let place = systems::output_of(self.judge.plant, signal)?;
                run.column(Role::Output.at(place))
            })
            .collect();
        let column = |signal: usize| outputs.get(signal).copied().flatten();
        let inputs_of_time = simulation.inputs.outputs();
        let input = |signal: usize| inputs_of_time.iter().position(|n| *n == names[signal]);
        longest_step(observer, run.len(), &mut |row, x, signals| {
            let t = *run.times().get(row)?;
            for (i, x) in x.iter_mut().enumerate() {
                *x = *run
                    .column(monitor_column(&self.judge.observer, i))?
                    .get(row)?;
            }
            inputs.enter(t);
            inputs.outputs(t, &[], &mut u);
            for (i, signal) in signals.iter_mut().enumerate() {
                *signal = match column(i) {
                    Some(values) => *values.get(row)?,
                    None => *u.get(input(i)?)?,
                };
            }
            Some(t)
        })
    }
}
