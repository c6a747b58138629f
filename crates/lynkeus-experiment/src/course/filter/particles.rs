//! What is to be said of a particle filter.

use lynkeus_observers::Design;
use lynkeus_run::filter::{FilterKind, Health};
use lynkeus_words::figures;

use crate::Error;
use crate::course::Course;
use crate::course::doubt::{Doubt, Kind, Level};
use crate::prepare::Prepared;

/// Updates in a row after which hardly more than one particle counted: what is told of the estimate is then one of them.
const LOST: usize = 10;

/// Fewer particles that count tell little of what hardly wanders: it keeps the values of these.
const FEW: f64 = 10.0;

/// A share of the updates that is worth a word.
const OFTEN: f64 = 0.05;

/// That particles are asked for nothing that they do not have: a smoother; and as an ensemble, events.
///
/// # Errors
/// They are.
pub(super) fn refuse(prepared: &Prepared<'_>, kind: &FilterKind) -> Result<(), Error> {
    let FilterKind::Particles(settings) = kind else {
        return Ok(());
    };
    let study = prepared.study();
    let clause = prepared.plant().whens.clauses.first();
    if let (true, Some(clause)) = (settings.inflation.is_some(), clause) {
        let message = format!(
            "proposal = \"ensemble\": the state of '{}' jumps at events (`when` of line {}), and a correction that moves all particles together takes the mean of those on either side of one",
            prepared.plant().name,
            clause.line
        );
        return Err(Error::refused(message)
            .at(&study.file)
            .hint("leave `proposal` out: then particles have weights, and each goes through events of its own"));
    }
    if study.estimate.smoothing.is_none() {
        return Ok(());
    }
    let message = "family = \"particle\" has no smoother, and `smooth` or `lag` of [estimate] asks for one: after repeated resampling particles have few different pasts";
    Err(Error::input(message)
        .at(&study.file)
        .hint("leave the key out, or take family = \"ekf\", \"ukf\" or \"mhe\""))
}

/// How the particles went, and what that says against the estimate.
pub(super) fn tell(
    prepared: &Prepared<'_>,
    design: &Design,
    densities: &[f64],
    health: &Health,
    course: &mut Course,
) {
    let tuning = design.observer.filter.as_ref().map(|filter| &filter.kind);
    let (Some(FilterKind::Particles(settings)), Some(told)) = (tuning, health.particles) else {
        return;
    };
    course.particles = Some((settings.count, told));
    if told.updates > 0 && settings.inflation.is_none() {
        course.notes.push(format!(
            "particles: resampled {} times in {} updates; at least {} of {} counted",
            told.resampled,
            told.updates,
            figures(told.lowest, 3),
            settings.count
        ));
    }
    if told.put_back > 0 {
        course.notes.push(format!(
            "the model has no value where noise took particles: {} times one was put back into the declared ranges",
            told.put_back
        ));
    }
    // an ensemble draws nothing anew
    if settings.inflation.is_some() {
        return;
    }
    course
        .notes
        .extend(never_renewed(prepared, design, densities));
    let share = told.alone as f64 / told.updates.max(1) as f64;
    let text = if told.starved > 0 {
        format!(
            "no particle explains the readings of {} of {} updates: they moved nothing",
            told.starved, told.updates
        )
    } else if told.longest_alone >= LOST {
        format!(
            "after {} updates in a row one of {} particles has all the weight: they have degenerated",
            told.longest_alone, settings.count
        )
    } else if share > OFTEN {
        format!(
            "after {} of {} updates one of {} particles has all the weight",
            told.alone, told.updates, settings.count
        )
    } else if told.lowest < FEW {
        format!(
            "once only {} of {} particles counted: what hardly wanders, as constants do, keeps the values of these, and its deviation may be too small",
            figures(told.lowest, 2),
            settings.count
        )
    } else {
        return;
    };
    course.doubts.push(Doubt {
        kind: Kind::Particles,
        name: "particles".to_owned(),
        text,
        level: match told.starved > 0 || told.longest_alone >= LOST {
            true => Level::Refusal,
            false => Level::Warning,
        },
    });
}

/// States whose particles are those of the start, fewer each time that they are drawn anew.
fn never_renewed(prepared: &Prepared<'_>, design: &Design, densities: &[f64]) -> Option<String> {
    let filter = design.observer.filter.as_ref()?;
    let states = &prepared.augmented().states;
    let derivatives = &design.observer.derivatives;
    let graph = prepared.augmented().graph();
    let stays = |place: usize| graph.constant_value(derivatives[place]) == Some(0.0);
    let mut places = 0..states.len().min(densities.len());
    let place = places.find(|&i| {
        let state = &states[i];
        stays(i) && !state.discrete && densities[i] == 0.0 && filter.initial_variance[i] > 0.0
    })?;
    Some(format!(
        "{} is a constant without process noise: each resampling leaves fewer different values of it; give it a small density under [process_noise]",
        states[place].name
    ))
}
