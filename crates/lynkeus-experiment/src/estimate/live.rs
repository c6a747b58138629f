//! A study's estimator for samples that come one by one.

use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Estimator, Late};

use crate::course::Samples;
use crate::course::inputs::{on_device, refuse_derivatives};
use crate::course::{filter, sampled};
use crate::prepare::systems::run_settings;
use crate::prepare::{self, Prepared};
use crate::words::explain;
use crate::{Error, Study};
use lynkeus_study::{BetweenSamples, EstimateSettings};

/// The estimator of a study, waiting for its first sample: measured outputs, then known inputs, in
/// the study's order, then derivatives of inputs where the observer reads any. It runs on its own, as `[estimate]` says, and knows neither files nor graph.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/two-tanks");
/// # let path = std::path::Path::new(folder).join("two_tanks.mo");
/// let mut study = lynkeus_study::Study::parse(
///     r#"
///     sensors = { measured = ["level"], unknown = ["pump"], noise = { level = 0.02 } }
///     process_noise = { pump = 0.001, lower = 1e-6, upper = 1e-6 }
///     observer = { family = "ekf" }
///     "#,
///     "live.toml",
/// )?;
/// # study.plant = Some(path);
/// let mut estimator = lynkeus_experiment::estimator(&study)?;
/// assert_eq!(estimator.signals(), ["level"]);
/// for k in 0..200 {
///     // a sensor that is silent now and then
///     let level = if k % 7 == 3 { f64::NAN } else { 4.0 };
///     estimator.push(4.0 * f64::from(k), &[level])?;
/// }
/// let lower = estimator.names().iter().position(|name| name == "lower").unwrap_or(0);
/// assert!((estimator.estimate()[lower] - 4.0).abs() < 0.1);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A study that does not fit its plant, no family that fits, and what only a log could tell: the
/// noise of a sensor or of an unknown input that the study does not declare, lines between
/// samples, smoothing, a sensor whose readings come late ([`late_estimator`]).
pub fn estimator(study: &Study) -> Result<Estimator, Error> {
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    if let Some((name, late)) = prepared.declared().late.iter().next() {
        let message = format!(
            "`{}` of [sensors]: the readings of {name} come later than their samples are taken, and this estimator takes each at the time of its row",
            late.key()
        );
        let hint = "take `late_estimator`, which goes back to where they belong";
        return Err(Error::input(message).at(&study.file).hint(hint));
    }
    live(&prepared)
}

/// The same where readings come late: those of sensors with a `delay` are put where their samples were taken, and so is
/// a row that comes up to `wait` later than another. A sensor with `taken_at` has its readings in rows of their own, at
/// the times of the samples.
///
/// # Errors
/// As [`estimator`], and a time to wait that is negative or no number.
pub fn late_estimator(study: &Study, wait: f64) -> Result<Late, Error> {
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    late(&prepared, live(&prepared)?, wait)
}

/// An estimator that goes back to where the readings of the study's sensors belong.
pub(super) fn late(
    prepared: &Prepared<'_>,
    estimator: Estimator,
    wait: f64,
) -> Result<Late, Error> {
    let declared = &prepared.declared().late;
    let outputs = prepared.augmented().outputs.iter();
    let delays = outputs.map(|output| match declared.of(&output.variable.name) {
        Some(lynkeus_study::Late::By(delay)) => *delay,
        _ => 0.0,
    });
    let delays: Vec<f64> = delays.collect();
    Late::new(estimator, &delays, wait).map_err(explain)
}

fn live(prepared: &Prepared<'_>) -> Result<Estimator, Error> {
    let mut design = prepared.design()?;
    on_device(prepared, &mut design)?;
    let blueprint = blueprint(prepared, &design)?;
    blueprint.estimator().map_err(explain)
}

/// What the estimator of a study is made of.
///
/// # Errors
/// As [`estimator`].
pub fn blueprint(prepared: &Prepared<'_>, design: &Design) -> Result<Blueprint, Error> {
    let study = prepared.study();
    refuse_derivatives(study, design, |_| true)?;
    refuse_looking_ahead(study, &study.estimate)?;
    let run = run_settings(&study.estimate);
    let none = Samples::default();
    // what is told of a log has no place here
    let notes = &mut vec![];
    if design.observer.filter.is_some() {
        need_noises(prepared, true)?;
        return filter::blueprint(prepared, design, &none, run, notes);
    }
    if study.estimate.deviations {
        need_noises(prepared, false)?;
    }
    let follows = study.estimate.deviations;
    let mut observer = sampled::observer(prepared, design, &none, follows, notes)?;
    // nobody judges a run that has no end
    observer.judges = false;
    observer.run.method = run.method;
    Ok(observer)
}

fn refuse_looking_ahead(study: &Study, settings: &EstimateSettings) -> Result<(), Error> {
    let key = match (settings.between_samples, settings.smoothing) {
        (BetweenSamples::Linear, _) => "between_samples = \"linear\"",
        (_, Some(_)) => "`smooth` or `lag`",
        _ => return Ok(()),
    };
    Err(Error::input(format!(
        "{key} of [estimate] looks ahead: expected what live samples allow"
    ))
    .at(&study.file)
    .hint("take between_samples = \"hold\" or \"predict\", and no smoothing"))
}

/// Without a log there is nothing to take a noise from.
fn need_noises(prepared: &Prepared<'_>, process: bool) -> Result<(), Error> {
    let (study, augmented) = (prepared.study(), prepared.augmented());
    let declared = prepared.declared();
    let missing = |what: String, hint: String| {
        let message =
            format!("{what}: expected in the study, where there is no log to take it from");
        Err(Error::input(message).at(&study.file).hint(hint))
    };
    let outputs = augmented.outputs.iter().map(|o| &o.variable.name);
    if let Some(name) = outputs
        .into_iter()
        .find(|name| declared.noise.of(name).is_none())
    {
        return missing(
            format!("the noise of {name}"),
            format!("write noise = {{ {name} = … }} under [sensors]"),
        );
    }
    let mut unknown = augmented.states.iter().skip(augmented.plant_states());
    let asleep = unknown.find(|input| declared.process_noise.of(&input.name).is_none());
    match asleep.map(|input| input.name.as_str()) {
        Some(name) => missing(
            format!("how fast {name} wanders"),
            format!("write {name} = … under [process_noise]"),
        ),
        None if process
            && !declared.process_noise.is_declared()
            && !declared.input_noise.acts() =>
        {
            missing(
                "what the model does not know".to_owned(),
                "write a density for some state under [process_noise], 0 where the model is exact"
                    .to_owned(),
            )
        }
        _ => Ok(()),
    }
}
