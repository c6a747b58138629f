//! The names that a study mentions: each is the plant's, whichever command reads its section.

use std::collections::HashSet;

use lynkeus_model::Plant;
use lynkeus_observers::{FAMILIES, Family};

use crate::prepare::declared::Declared;
use crate::prepare::headers::refuse_stray_columns;
use crate::prepare::spread::Spread;
use crate::{Error, Study, near, prepare::systems};
use lynkeus_study::{Name, Noise, Swept};

/// Refuses a study in which any section names what the plant does not have.
///
/// # Errors
/// The first such name, in the words of the command that reads it.
pub(crate) fn refuse_strangers(study: &Study, plant: &Plant) -> Result<(), Error> {
    refuse_other_lengths(study, plant)?;
    if let Some(settings) = &study.simulate {
        systems::check_inputs(plant, settings)?;
        systems::starts(plant, &settings.initial)?;
        Spread::new(plant, settings)?;
    }
    refuse_stray_columns(plant, &study.estimate)?;
    drawn(study, plant)?;
    for (name, expression) in &study.tune.disturbance {
        if !plant.inputs.iter().any(|input| input.name == name.text) {
            return Err(name.blame(systems::unknown(plant, "input", &plant.inputs, name)));
        }
        systems::expression(plant, expression)?;
    }
    {
        // another observer may have been put in the place of the one that is tuned
        study.refuse_strange_keys(false)?;
        refuse_strange_noises(study, plant)?;
        asked(study)?;
    }
    Ok(())
}

/// Refuses lists that are longer or shorter than their arrays; what is no array is refused by its name.
fn refuse_other_lengths(study: &Study, plant: &Plant) -> Result<(), Error> {
    let simulated = study.simulate.iter().flat_map(|settings| &settings.lists);
    for (name, count) in study.observer.lists.iter().chain(simulated) {
        let own = plant.states.iter().chain(&plant.inputs);
        let elements = own.filter(|v| name.is_or_has(&v.name)).count();
        if elements > 0 && elements != *count {
            let message = format!(
                "{name} has {elements} elements in the plant '{}', and this list {count}",
                plant.name
            );
            return Err(name.blame(Error::input(message).hint(format!(
                "write as many numbers, or some of them by name: \"{name}[1]\" = …"
            ))));
        }
    }
    Ok(())
}

/// Refuses noises to sweep of what has none.
fn refuse_strange_noises(study: &Study, plant: &Plant) -> Result<(), Error> {
    let mut declared = study.clone();
    let mut is_swept = false;
    for (name, _) in &study.tune.keys {
        let own = |text: String| Name {
            text,
            place: name.place.clone(),
        };
        match Swept::read(&name.text) {
            Some(Swept::Density(Some(of))) => declared.process_noise.push((own(of), 0.0)),
            Some(Swept::Noise(Some(of))) => {
                let noise = (own(of), Noise::Absolute(0.0));
                declared.sensors.noise.push(noise);
            }
            _ => continue,
        }
        is_swept = true;
    }
    match is_swept {
        true => Declared::new(&declared, plant).map(drop),
        false => Ok(()),
    }
}

/// Refuses `unknown` states: every observer estimates those. `plant` is the model's, no parameter of it a state.
///
/// # Errors
/// The name, and what to do.
pub(crate) fn refuse_unknown_states(study: &Study, plant: &Plant) -> Result<(), Error> {
    let inputs = plant.inputs.iter();
    let others = inputs.chain(plant.parameters.iter().map(|p| &p.variable));
    let others: Vec<&str> = others.map(|v| v.name.as_str()).collect();
    for name in &study.sensors.unknown {
        let is_other = others.iter().any(|other| name.is_or_has(other));
        if is_other || !plant.states.iter().any(|s| name.is_or_has(&s.name)) {
            continue;
        }
        let message = format!(
            "unknown: expected inputs and parameters, found \"{name}\", a state of the plant '{}': every state is estimated without being listed",
            plant.name
        );
        let hint = format!(
            "leave it out; inputs and parameters are: {}",
            near::list(others)
        );
        return Err(name.blame(Error::input(message).hint(hint)));
    }
    Ok(())
}

/// Refuses what no picture of the study has.
fn drawn(study: &Study, plant: &Plant) -> Result<(), Error> {
    let Some(show) = &study.show else {
        return Ok(());
    };
    let own = plant.states.iter().chain(&plant.inputs);
    let shown: HashSet<_> = plant.states.iter().map(|state| state.node).collect();
    let is_measured = |name: &str| {
        let measured = study.sensors.measured.as_ref();
        measured.is_none_or(|measured| measured.iter().any(|m| m.is_or_has(name)))
    };
    let outputs = plant.outputs.iter();
    let outputs = outputs.filter(|o| is_measured(&o.name) && !shown.contains(&o.node));
    let names: Vec<&str> = own.chain(outputs).map(|v| v.name.as_str()).collect();
    let stranger = show
        .iter()
        .find(|name| !names.contains(&name.text.as_str()));
    stranger.map_or(Ok(()), |name| Err(not_drawn(name, "nothing", &names)))
}

/// The refusal of a name that no picture has: `nothing`, or nothing of a kind, is called so.
pub(crate) fn not_drawn(name: &Name, nothing: &str, names: &[&str]) -> Error {
    let refusal = Error::input(format!("`show` of [plot]: {nothing} is called \"{name}\""));
    name.blame(refusal.hint(near::suggest(&name.text, names.iter().copied())))
}

/// The families that `[compare]` asks for.
///
/// # Errors
/// One that there is not.
pub(crate) fn asked(study: &Study) -> Result<Option<Vec<&'static dyn Family>>, Error> {
    let find = |name: &Name| {
        let found = lynkeus_observers::find(&name.text);
        let found = found.ok_or_else(|| {
            let names = FAMILIES.iter().map(|f| f.name());
            let message = format!("families of [compare]: no family is called \"{name}\"");
            name.blame(Error::input(message).hint(crate::near::suggest(&name.text, names)))
        })?;
        match found.is_filter() || !study.observer.is_curved {
            true => Ok(found),
            false => Err(name.blame(Error::input(format!(
                "families of [compare]: {name} takes no [manifold]: its theorem is about errors that are differences of real numbers"
            )))),
        }
    };
    let names = study.compare.as_ref();
    names
        .map(|names| names.iter().map(find).collect())
        .transpose()
}
