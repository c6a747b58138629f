//! One value in simulation: an exact run, a noisy one, and one under the stated disturbance.

use std::ops::ControlFlow;

use lynkeus_expr::Node;
use lynkeus_observers::Design;
use lynkeus_run::{Dynamics, Error as RunError, Method, Role, Simulation, Tolerances, Trajectory};

use super::errors::run_away;
use super::judge::Judge;
use super::reference::Reference;
use super::speed::{longest_step, transparent};
use super::{Row, measures};
use crate::Error;
use crate::crew::{Watch, part};
use crate::outcome::interrupted;
use crate::prepare::Prepared;
use crate::simulate::{open_loop, settings};
use crate::systems::{self, monitor_column, named};

/// Most steps of an adaptive method from one row to the next: so many over the whole run, in equal
/// parts, but never fewer than the second number.
const STEPS: f64 = 5e5;
const STEPS_PER_ROW: f64 = 500.0;

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
    let trial = Trial {
        judge: Judge {
            study: prepared.study(),
            plant: prepared.plant(),
            observer: transparent(&design.observer),
            reference,
        },
    };
    match trial.judge(&mut row, watch)? {
        None => Ok(row),
        Some(reason) => Ok(row.failed(reason)),
    }
}

/// One value of the sweep.
struct Trial<'a> {
    /// its observer is transparent
    judge: Judge<'a>,
}

/// A run, or why its estimate is none.
type Ran = Result<Trajectory, String>;

impl Trial<'_> {
    /// Fills the row in; the reason where a run failed.
    fn judge(&self, row: &mut Row, watch: &mut Watch<'_>) -> Result<Option<String>, Error> {
        let judge = &self.judge;
        let disturbed = !judge.study.tune.disturbance.is_empty();
        let runs = if disturbed { 3 } else { 2 };
        let simulation = self.simulation()?;
        let exact_run = match self.run(&simulation, &mut part(watch, 0, runs))? {
            Ok(run) => run,
            Err(reason) => return Ok(Some(reason)),
        };
        let exact = judge.errors(&exact_run);
        if let Some(reason) = run_away(&exact.scaled) {
            return Ok(Some(reason));
        }
        judge.exact(row, &exact, &exact_run);
        row.set(
            measures::SAMPLING_MARGIN,
            self.margin(&simulation, &exact_run),
        );

        let noisy = Simulation {
            noise: judge.reference.noise.clone(),
            ..simulation
        };
        let mut failure = None;
        match self.run(&noisy, &mut part(watch, 1, runs))? {
            Ok(run) => judge.noisy(row, &exact, &run),
            Err(reason) => failure = Some(format!("with noise: {reason}")),
        }
        if disturbed {
            match self.run(&self.disturbed(noisy)?, &mut part(watch, 2, runs))? {
                Ok(run) => {
                    let bound = judge.errors(&run).from(judge.reference.tail);
                    row.set(measures::ULTIMATE_BOUND, bound.largest());
                }
                Err(reason) => {
                    row.set(measures::ULTIMATE_BOUND, None);
                    failure = failure.or(Some(format!("under the disturbance: {reason}")));
                }
            }
        }
        Ok(failure)
    }

    /// The exact run.
    fn simulation(&self) -> Result<Simulation, Error> {
        let Judge { study, plant, .. } = self.judge;
        let settings = settings(study)?;
        let plain = open_loop(study, settings, plant)?;
        let rows = (plain.until - plain.start) / plain.output_step;
        Ok(Simulation {
            observer: Some(systems::observer(plant, &self.judge.observer)?),
            inputs: systems::inputs(study, plant, settings, &self.judge.observer)?,
            noise: self.judge.reference.exact(),
            method: thrifty(plain.method, rows),
            ..plain
        })
    }

    /// The exact run with the stated disturbance on the plant's inputs; what the observer reads
    /// of them stays as it was.
    fn disturbed(&self, run: Simulation) -> Result<Simulation, Error> {
        let Judge { study, plant, .. } = self.judge;
        let settings = settings(study)?;
        let graph = &plant.graph;
        let mut inputs = systems::input_expressions(study, plant, settings)?;
        let derivatives = self
            .judge
            .observer
            .input_derivative_expressions(graph, &inputs)
            .map_err(Error::from_source)?;
        let mut signals: Vec<(String, Node)> = named(&plant.inputs);
        for (name, expression) in &study.tune.disturbance {
            let signal = signals.iter_mut().find(|(n, _)| *n == name.text);
            let input = inputs.iter().find(|(n, _)| *n == name.text);
            let (Some(signal), Some((_, input))) = (signal, input) else {
                return Err(name.blame(systems::unknown(plant, "input", &plant.inputs, name)));
            };
            let added = systems::expression(plant, expression)?;
            let sum = graph.expr(*input) + graph.expr(added);
            signal.0 = disturbed(&name.text);
            inputs.push((disturbed(&name.text), sum.node()));
        }
        inputs.extend(derivatives);
        Ok(Simulation {
            plant: systems::plant_reading(plant, settings, &signals)?,
            inputs: systems::of_time(plant, &inputs)?,
            noise: self.judge.reference.exact(),
            ..run
        })
    }

    fn run(
        &self,
        simulation: &Simulation,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Ran, Error> {
        match simulation.run_watched(watch) {
            Ok(run) => Ok(Ok(run)),
            Err(error) if is_answer(&error.error) => Ok(Err(error.error.to_string())),
            Err(error) => Err(interrupted(error.error, &self.judge.study.file)),
        }
    }

    /// The longest stable step over the step of the sensor.
    fn margin(&self, simulation: &Simulation, run: &Trajectory) -> Option<f64> {
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
        let step = longest_step(observer, run.len(), &mut |row, x, signals| {
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
        })?;
        Some(step / self.judge.reference.sample_step)
    }
}

/// The name of an input as the plant has it while the observer reads the undisturbed one.
fn disturbed(name: &str) -> String {
    // no name in a model's text has a blank, unless it is in quotes
    format!("{name} disturbed")
}

/// The method with fewer steps than it would take: an estimate on its way to infinity is then
/// given up in time. What is left is enough for any observer worth having.
pub(super) fn thrifty(method: Method, rows: f64) -> Method {
    let most = (STEPS / rows.max(1.0)).max(STEPS_PER_ROW) as usize;
    let fewer = |t: Tolerances| Tolerances {
        budget: t.budget.min(most),
        ..t
    };
    match method {
        Method::Adaptive(t) => Method::Adaptive(fewer(t)),
        Method::Explicit(t) => Method::Explicit(fewer(t)),
        Method::Stiff(t) => Method::Stiff(fewer(t)),
        fixed => fixed,
    }
}

/// Whether a run that ended early says something of the tuning.
pub(super) fn is_answer(error: &RunError) -> bool {
    matches!(
        error,
        RunError::Diverged { .. }
            | RunError::NotFinite { .. }
            | RunError::StepUnderflow { .. }
            | RunError::StepBudget { .. }
            | RunError::TooStiff { .. }
    )
}
