//! A log through the study's observer.

use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::Design;
use lynkeus_run::{EstimatorSettings, Log, System, estimate_watched};

use crate::outcome::{alarms, interrupted_on, measurements, show_measurements, watches};
use crate::prepare::Prepared;
use crate::study::{BetweenSamples, EstimateSettings};
use crate::systems::{self, hat, method};
use crate::{Error, Outcome, Quantity, Study, Table, prepare};

/// Replays a log; `watch` is told the fraction done and may stop the replay.
///
/// # Errors
/// A study that does not fit the plant, a log without the columns that the
/// observer reads, conditions that are refuted, an estimate that diverges.
pub fn estimate(
    study: &Study,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let settings = &study.estimate;
    let plant = prepare::plant(study)?;
    let design = Prepared::new(study, &plant)?.design()?;
    refuse_derivatives(study, &design)?;
    let observer = systems::observer(&plant, &design.observer)?;
    refuse_stray_columns(&plant, settings)?;
    let log = log(table, settings, &observer)?;
    let run = run_settings(settings);
    let between = run.between;
    let estimates = estimate_watched(&observer, &log, run, watch)
        .map_err(|error| interrupted_on(error.error, table.file(), &study.file))?;
    let mut notes = design.notes.clone();
    if between == lynkeus_run::BetweenSamples::Linear {
        notes.push(
            "between_samples = \"linear\" looks ahead one sample: the estimate at a row is that of an off-line replay".to_owned(),
        );
    }
    if let Some(advice) = estimates
        .advice
        .filter(lynkeus_run::StepAdvice::is_unstable)
    {
        notes.push(format!(
            "the step {} is too long for this observer: its fastest mode needs {:.3e} or less",
            advice.used, advice.needed
        ));
    }
    let trajectory = &estimates.trajectory;
    let logged = |name: &str| logged(table, settings, name);
    let mut quantities = quantities(&design, &logged, &|name| trajectory.column(&hat(name)));
    let measurements = measurements(&design, logged);
    show_measurements(&plant, &measurements, &mut quantities);
    let watches = watches(&design, trajectory);
    notes.extend(alarms(&watches));
    Ok(Outcome {
        plant: plant.name.clone(),
        time: trajectory.times().to_vec(),
        design,
        quantities,
        measurements,
        watches,
        notes,
    })
}

/// The study's settings as the runner has them.
pub(crate) fn run_settings(settings: &EstimateSettings) -> EstimatorSettings {
    EstimatorSettings {
        between: match settings.between_samples {
            BetweenSamples::Hold => lynkeus_run::BetweenSamples::Hold,
            BetweenSamples::Linear => lynkeus_run::BetweenSamples::Linear,
        },
        method: method(&settings.method),
    }
}

/// A log has no derivatives of the inputs.
pub(crate) fn refuse_derivatives(study: &Study, design: &Design) -> Result<(), Error> {
    let Some(needed) = design.observer.input_derivatives.first() else {
        return Ok(());
    };
    Err(Error::input(format!(
        "this observer reads {}, the derivative of order {} of the input \"{}\", which no log holds",
        needed.signal.name, needed.order, needed.input
    ))
    .at(&study.file)
    .hint("set variant = \"practical\" in [observer], which estimates it"))
}

/// The header under which the log has a signal of the plant.
pub(crate) fn header<'a>(settings: &'a EstimateSettings, name: &'a str) -> &'a str {
    let given = settings
        .columns
        .iter()
        .find(|(plant, _)| plant.text == name);
    given.map_or(name, |(_, header)| header)
}

pub(crate) fn refuse_stray_columns(
    plant: &Plant,
    settings: &EstimateSettings,
) -> Result<(), Error> {
    let names = || {
        plant
            .outputs
            .iter()
            .chain(&plant.inputs)
            .map(|v| v.name.as_str())
    };
    match settings
        .columns
        .iter()
        .find(|(name, _)| !names().any(|n| n == name.text))
    {
        None => Ok(()),
        Some((name, _)) => Err(name.blame(
            Error::input(format!(
                "columns: the plant '{}' has no output or input named \"{name}\"",
                plant.name
            ))
            .hint(crate::near::suggest(&name.text, names())),
        )),
    }
}

fn log(table: &Table, settings: &EstimateSettings, observer: &System) -> Result<Log, Error> {
    let time = table.time(&settings.time)?.to_vec();
    let names = observer.signals().to_vec();
    let column = |name: &String| Ok(table.column(header(settings, name))?.to_vec());
    let columns = names
        .iter()
        .map(column)
        .collect::<Result<Vec<_>, Error>>()?;
    Log::new(names, time, columns).map_err(|error| Error::from_source(error).at(table.file()))
}

/// A column of the log, if it has one with numbers.
fn logged(table: &Table, settings: &EstimateSettings, name: &str) -> Option<Vec<f64>> {
    let values = table.get(header(settings, name))?;
    values
        .iter()
        .any(|x| x.is_finite())
        .then(|| values.to_vec())
}

/// Everything estimated, with its true value where the log happens to have it.
fn quantities(
    design: &Design,
    logged: &dyn Fn(&str) -> Option<Vec<f64>>,
    estimate: &dyn Fn(&str) -> Option<Vec<f64>>,
) -> Vec<Quantity> {
    let quantity = |e: &lynkeus_observers::Estimate| Quantity {
        name: e.variable.name.clone(),
        unit: e.variable.unit.clone(),
        description: e.variable.description.clone(),
        truth: logged(&e.variable.name),
        measured: None,
        estimate: estimate(&e.variable.name),
        unknown_input: e.unknown_input,
        is_input: e.unknown_input,
    };
    design.observer.estimates.iter().map(quantity).collect()
}
