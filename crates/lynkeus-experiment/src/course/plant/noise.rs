//! What a simulation draws, and what its sensors can show of it.

use lynkeus_model::{Home, Plant, Variable};
use lynkeus_run::{Level, Simulation, process_draws};
use lynkeus_words::figures;

use crate::prepare::declared::Declared;
use crate::{Error, Study};
use lynkeus_study::SimulateSettings;

/// The study's noises, by output and by state, and what its sensors can show. An unknown input has the
/// course that `inputs` gives it.
///
/// # Errors
/// Names that the plant does not have.
pub(crate) fn noise(
    study: &Study,
    settings: &SimulateSettings,
    plant: &Plant,
) -> Result<lynkeus_run::Noise, Error> {
    let declared = Declared::new(study, plant)?;
    let levels = declared.noise.iter();
    let limits = declared.limits.iter();
    let density = |state: &Variable| {
        let density = *declared.process_noise.of(&state.name)?;
        // what is drawn off the sphere is taken away again
        let share = match state.home {
            Home::Rotation { .. } => 0.25,
            _ => 1.0,
        };
        Some((state.name.clone(), share * density))
    };
    let states = plant.states.iter();
    Ok(lynkeus_run::Noise {
        seed: settings.seed,
        sample_step: settings.sample_step,
        levels: levels
            .map(|(name, noise)| (name.clone(), Level::from(*noise)))
            .collect(),
        process: states.filter_map(density).collect(),
        limits: limits
            .map(|(name, limits)| (name.clone(), *limits))
            .collect(),
        inputs: declared
            .input_noise
            .iter()
            .map(|(name, noise)| (name.clone(), Level::from(*noise)))
            .collect(),
        correlations: declared
            .correlation
            .iter()
            .flat_map(|(one, others)| {
                let others = others.iter();
                others.map(|(other, value)| (one.clone(), other.clone(), *value))
            })
            .collect(),
        process_draws: None,
    })
}

/// Settles how often process noise is drawn, for all runs alike; says so where it is not often enough.
pub(crate) fn stirred(simulation: &mut Simulation) -> Option<String> {
    let draws = process_draws(simulation);
    simulation.noise.process_draws = Some(draws.per_sample);
    (!draws.are_enough).then(|| {
        format!(
            "[process_noise]: a draw is held for {}, too coarse for the fastest states that it moves, which scatter too little: the run would need too many draws; a shorter `until`, or such a state left out of [process_noise]",
            figures(draws.hold, 2)
        )
    })
}
