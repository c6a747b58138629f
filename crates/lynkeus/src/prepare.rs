//! From a study to its plant and its observer.

use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Design, DesignError, Examination, Family, Fit, Tuning, Value};
use lynkeus_structure::{Dimension, Extended, Region, Sensors, SensorsError, range};

use crate::study::Name;
use crate::{Error, Study, systems};

/// The plant of a study, with the study's parameters.
///
/// # Errors
/// No plant, a file that cannot be read, or a model that is refused.
pub fn plant(study: &Study) -> Result<Plant, Error> {
    load(study, false)
}

/// The plant with its parameters as symbols, also those without value.
///
/// # Errors
/// As [`plant`].
pub(crate) fn symbolic_plant(study: &Study) -> Result<Plant, Error> {
    load(study, true)
}

fn load(study: &Study, symbolic_parameters: bool) -> Result<Plant, Error> {
    let Some(path) = &study.plant else {
        let message = "the study names no plant: expected `plant = \"FILE.mo\"`";
        return Err(Error::input(message).at(&study.file));
    };
    crate::files::must_exist(path, "plant", &study.file)?;
    let options = LoadOptions {
        model: study.model.clone(),
        parameters: study.parameters.clone(),
        symbolic_parameters,
    };
    Plant::load(path, &options).map_err(|error| Error::input(error.to_string()))
}

/// The plant as the observer of a study sees it.
///
/// # Errors
/// Names among the sensors that the plant does not have.
pub fn extended<'p>(study: &Study, plant: &'p Plant) -> Result<Extended<'p>, Error> {
    let texts = |names: &[Name]| names.iter().map(|n| n.text.clone()).collect::<Vec<_>>();
    let sensors = Sensors {
        measured: texts(study.sensors.measured.as_deref().unwrap_or_default()),
        unknown: texts(&study.sensors.unknown),
        disturbances: texts(&study.sensors.disturbances),
    };
    let mut extended = Extended::new(plant, &sensors).map_err(|error| blame(study, &error))?;
    for (name, low, high) in &study.narrower {
        extended
            .narrow(&name.text, *low, *high)
            .map_err(|error| name.blame(Error::input(error.to_string())))?;
    }
    tube(study, &mut extended)?;
    Ok(extended)
}

/// Limits the states to a tube around their start values.
fn tube(study: &Study, extended: &mut Extended<'_>) -> Result<(), Error> {
    let Some(radius) = study.certify.tube else {
        return Ok(());
    };
    for state in extended.states.clone() {
        let Some(start) = state.start else {
            let message = format!(
                "`tube` of [certify]: the state '{}' has no start value",
                state.name
            );
            return Err(Error::input(message).at(&study.file));
        };
        let narrowed = extended.narrow(&state.name, start - radius, start + radius);
        narrowed.map_err(|error| Error::input(error.to_string()).at(&study.file))?;
    }
    Ok(())
}

/// The place in the study of a name that does not fit.
fn blame(study: &Study, error: &SensorsError) -> Error {
    let name = match error {
        SensorsError::NoSuchName { name, .. } | SensorsError::Twice { name, .. } => name,
        SensorsError::NothingMeasured { .. } => {
            return Error::input(error.to_string()).at(&study.file);
        }
    };
    let sensors = &study.sensors;
    let lists = [
        sensors.measured.as_deref().unwrap_or_default(),
        &sensors.unknown,
        &sensors.disturbances,
    ];
    let refusal = Error::input(error.to_string());
    match lists.into_iter().flatten().rfind(|n| n.text == *name) {
        Some(found) => found.blame(refusal),
        None => refusal.at(&study.file),
    }
}

/// What every family that the study allows finds in the plant.
///
/// # Errors
/// Keys of `[observer]` that cannot be used.
pub fn examinations(study: &Study, extended: &Extended<'_>) -> Result<Vec<Examination>, Error> {
    let examine = |family: &dyn Family| {
        family
            .examine(extended, &study.observer.tuning)
            .map_err(|error| refusal(study, &error))
    };
    study.observer.families().map(examine).collect()
}

/// The family to use: the first that fits, else the first that is undecided.
pub fn recommended(examinations: &[Examination]) -> Option<&Examination> {
    let with = |fit: Fit| examinations.iter().find(move |e| e.fit == fit);
    with(Fit::Fits).or_else(|| with(Fit::Undecided))
}

/// The observer of a study.
///
/// # Errors
/// No family fits ([`ErrorKind::Refused`](crate::ErrorKind)), or a key of
/// `[observer]` cannot be used.
pub fn design(study: &Study, extended: &Extended<'_>) -> Result<Design, Error> {
    design_with(study, extended, &study.observer.tuning)
}

/// Ranges of the known inputs over the simulated time where these are narrower than
/// the declared ones; a range in `[box]` is the user's own choice and stays.
pub(crate) fn simulated_inputs(
    study: &Study,
    extended: &Extended<'_>,
) -> Result<Vec<(String, f64, f64)>, Error> {
    let Some(settings) = &study.simulate else {
        return Ok(vec![]);
    };
    let plant = extended.plant;
    let time = Dimension {
        name: "time".into(),
        symbol: plant.time,
        min: settings.start,
        max: settings.until,
        integer: false,
    };
    let region = Region {
        dimensions: vec![time],
    };
    let mut narrower = vec![];
    let chosen = |name: &str| study.narrower.iter().any(|(side, ..)| side.text == name);
    for input in extended.inputs.iter().filter(|input| !chosen(&input.name)) {
        let node = systems::input_expression(study, plant, settings, input)?;
        let values =
            range(&plant.graph, node, &region).map_err(|error| Error::input(error.to_string()))?;
        let (low, high) = (
            values.enclosure.lo().max(input.min),
            values.enclosure.hi().min(input.max),
        );
        if low <= high && (low > input.min || high < input.max) {
            narrower.push((input.name.clone(), low, high));
        }
    }
    Ok(narrower)
}

/// The box of a certified gain: the known inputs as the study simulates them.
fn simulated_box<'p>(study: &Study, extended: &Extended<'p>) -> Result<Extended<'p>, Error> {
    let mut narrowed = self::extended(study, extended.plant)?;
    for (name, low, high) in simulated_inputs(study, extended)? {
        let narrow = narrowed.narrow(&name, low, high);
        narrow.map_err(|error| Error::input(error.to_string()).at(&study.file))?;
    }
    Ok(narrowed)
}

/// Whether the study asks for a certified gain.
pub(crate) fn is_certified_gain(tuning: &Tuning) -> bool {
    tuning.values.get("gain") == Some(&Value::Text("lmi".into()))
}

/// The same with another tuning.
pub(crate) fn design_with(
    study: &Study,
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Design, Error> {
    let examinations = examinations(study, extended)?;
    let Some(chosen) = recommended(&examinations) else {
        return Err(none_fits(study, &examinations));
    };
    let family = lynkeus_observers::find(chosen.family)
        .ok_or_else(|| Error::input(format!("no family is called {}", chosen.family)))?;
    let simulated = match is_certified_gain(tuning) {
        true => Some(simulated_box(study, extended)?),
        false => None,
    };
    family
        .design(simulated.as_ref().unwrap_or(extended), tuning)
        .map_err(|error| refusal(study, &error))
}

fn none_fits(study: &Study, examinations: &[Examination]) -> Error {
    let reasons: Vec<String> = examinations
        .iter()
        .map(|e| DesignError::Refused(Box::new(e.clone())).to_string())
        .collect();
    Error::refused(reasons.join("\n"))
        .at(&study.file)
        .hint("`lynkeus check` shows every condition")
}

pub(crate) fn refusal(study: &Study, error: &DesignError) -> Error {
    match error {
        DesignError::Tuning(error) => study.observer.blame(error, &study.file),
        DesignError::Refused(_) => Error::refused(error.to_string()).at(&study.file),
        DesignError::NoGain { key, .. } => study.observer.place(key, &study.file, error),
        DesignError::MissingInput(_) => Error::input(error.to_string()).at(&study.file),
    }
}
