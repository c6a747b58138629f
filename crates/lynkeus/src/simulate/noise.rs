//! What a simulation draws, and what its sensors can show of it.

use std::collections::BTreeMap;

use lynkeus_model::Plant;
use lynkeus_run::Level;
use lynkeus_run::filter::Limits;

use crate::study::{Noise, SimulateSettings};
use crate::{Error, Study};

/// The study's noises, by output and by state, and what its sensors can show.
///
/// # Errors
/// Names of outputs that the plant does not have.
pub(super) fn noise(
    study: &Study,
    settings: &SimulateSettings,
    plant: &Plant,
) -> Result<lynkeus_run::Noise, Error> {
    let mut levels = BTreeMap::new();
    for (name, noise) in &study.sensors.noise {
        if !plant.outputs.iter().any(|o| o.name == name.text) {
            let outputs = plant.outputs.iter().map(|o| o.name.as_str());
            let refusal = Error::input(format!(
                "noise: the plant '{}' has no output named \"{name}\"",
                plant.name
            ))
            .hint(crate::near::suggest(&name.text, outputs));
            return Err(name.blame(refusal));
        }
        let level = match *noise {
            Noise::Absolute(deviation) => Level::Absolute(deviation),
            Noise::Relative(share) => Level::Relative(share),
            Noise::Uniform(bound) => Level::Uniform(bound),
        };
        levels.insert(name.text.clone(), level);
    }
    Ok(lynkeus_run::Noise {
        seed: settings.seed,
        sample_step: settings.sample_step,
        levels,
        process: process(study, plant),
        limits: limits(study, plant)?,
    })
}

/// The ranges that sensors can show, by output.
fn limits(study: &Study, plant: &Plant) -> Result<BTreeMap<String, Limits>, Error> {
    let mut found = BTreeMap::new();
    for (name, low, high) in &study.sensors.limits {
        let outputs = || plant.outputs.iter().map(|o| o.name.as_str());
        if !outputs().any(|output| output == name.text) {
            let message = format!(
                "limits: the plant '{}' has no output named \"{name}\"",
                plant.name
            );
            let hint = crate::near::suggest(&name.text, outputs());
            return Err(name.blame(Error::input(message).hint(hint)));
        }
        let (low, high) = (*low, *high);
        found.insert(name.text.clone(), Limits { low, high });
    }
    Ok(found)
}

/// The process noise of the plant's states; an unknown input has the course that `inputs` gives it.
fn process(study: &Study, plant: &Plant) -> BTreeMap<String, f64> {
    let mut densities = BTreeMap::new();
    for (name, density) in &study.process_noise {
        let states = plant.states.iter().filter(|s| name.is_or_has(&s.name));
        densities.extend(states.map(|s| (s.name.clone(), *density)));
    }
    densities
}
