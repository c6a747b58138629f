//! Plant and observer together.

use std::ops::ControlFlow;

use lynkeus_model::Variable;
use lynkeus_run::Role;

use crate::course::Course;
use crate::course::fixed_steps::unlocated;
use crate::course::plant::Ran;
use crate::course::recorded::Recorded;
use crate::course::rig::Rig;
use crate::judge::outcome::{Raw, measurements};
use crate::prepare::systems::{self, method, settings};
use crate::prepare::{self, Prepared, StudyDesign};
use crate::{Error, Outcome, Quantity, Study};

/// Runs the study's plant with its observer; `watch` is told the fraction done
/// and may stop the run.
///
/// # Errors
/// A study that cannot be run, conditions that are refuted, an estimate that diverges. One that
/// is not credible is a result: [`Outcome::refusal`].
pub fn simulate(
    study: &Study,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    settings(study)?;
    let plant = prepare::plant(study)?;
    simulated(&Prepared::new(study, &plant)?, watch)
}

/// The same of a study that is prepared.
pub fn simulated(
    prepared: &Prepared<'_>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    simulated_by(prepared, Rig::new(prepared)?, watch)
}

/// The same of a plant with its observer.
pub fn simulated_by(
    prepared: &Prepared<'_>,
    rig: Rig,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let Ran { run, mut course } = rig.run(prepared, settings(prepared.study())?.seed, watch)?;
    course.notes.extend(rig.notes);
    outcome(prepared, rig.design, &run, course)
}

/// A run with what is to be said of it.
pub(crate) fn outcome(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    run: &Recorded,
    mut course: Course,
) -> Result<Outcome, Error> {
    let plant = prepared.plant();
    let deviations = prepared.study().estimate.deviations;
    let mut quantity = |variable: &Variable, role: Role, place: usize| {
        let estimates = &design.observer.estimates;
        let own = |e: &lynkeus_observers::Estimate| e.variable.node == variable.node;
        let estimated = estimates.iter().position(own);
        let mut quantity = Quantity {
            name: variable.name.clone(),
            unit: variable.unit.clone(),
            description: variable.description.clone(),
            truth: run.column(role.at(place)).cloned(),
            unknown_input: estimated.is_some_and(|i| estimates[i].unknown_input),
            is_input: role == Role::Input,
            measured: (role == Role::Input)
                .then(|| run.column(Role::Read.at(place)).cloned())
                .flatten(),
            ..Quantity::default()
        };
        if let Some(i) = estimated {
            course.give(i, deviations, &mut quantity);
        }
        quantity
    };
    let states = plant.states.iter().enumerate();
    let mut quantities: Vec<Quantity> = states.map(|(i, v)| quantity(v, Role::State, i)).collect();
    let inputs = plant.inputs.iter().enumerate();
    quantities.extend(inputs.map(|(i, v)| quantity(v, Role::Input, i)));
    let mut notes = design.notes.clone();
    let settings = prepared.study().simulate.as_ref();
    notes.extend(settings.and_then(|s| unlocated(plant, method(&s.method))));
    let measured = |signal: &lynkeus_observers::Signal| {
        let output = systems::output_of(plant, signal)?;
        run.column(Role::Measured.at(output)).cloned()
    };
    Raw {
        time: run.time.clone(),
        origin: None,
        quantities,
        measurements: measurements(&design, measured),
        replayed: false,
        frozen: vec![],
        intervals: None,
        notes,
        course,
        prepared,
        design,
    }
    .finish()
}
