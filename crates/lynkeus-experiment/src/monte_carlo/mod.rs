//! Many runs of a study: plant and observer with noise, starts and parameters of their own.
//!
//! Run k has the study's seed + k, so that [`simulate`](crate::simulate()) with that seed repeats it
//! alone; up to how functions such as exp are rounded where runs go on together ([`Again`]). What a run draws follows from its seed, and the runs are put together in order: the
//! result does not depend on the number of processors.

mod apart;
mod ends;
#[cfg(feature = "plot")]
mod picture;
mod portions;
mod report;
mod runs;
mod statistics;
mod together;

use std::ops::{ControlFlow, RangeInclusive};
use std::sync::OnceLock;

use lynkeus_model::{Plant, Variable};
use lynkeus_run::Role;

use crate::course::rig::Rig;
use crate::prepare::Prepared;
use crate::prepare::headers::Headers;
use crate::prepare::manifold::firsts;
use crate::prepare::systems::column_of;
use crate::{Error, Study, prepare, prepare::systems};
use apart::{Job, room};
use ends::Sensor;
#[cfg(feature = "schema")]
pub use report::MonteCarloReport;
pub use report::Settled;
use report::headers_of;
use runs::Followed;
pub use runs::{Again, Bands, Failure, MonteCarlo, Scattered};
use together::{Figures, Together};

/// Runs the study's plant with its observer `runs` times, on all processors; `watch` is told the
/// fraction done, which never falls, and may stop it. A run that diverges or is refused is counted, and in no figure.
///
/// # Errors
/// A study that cannot be run, runs that would not fit into the memory, or no run that reached its
/// end.
pub fn monte_carlo(
    study: &Study,
    runs: usize,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<MonteCarlo, Error> {
    let settings = systems::settings(study)?;
    let count = u64::try_from(runs).ok().filter(|count| *count > 0);
    let last = count.and_then(|count| settings.seed.checked_add(count - 1));
    let Some(last) = last else {
        let message = format!(
            "expected at least one run, and seeds from {} on that are numbers of 64 bits, found {runs} runs",
            settings.seed
        );
        return Err(Error::input(message).at(&study.file));
    };
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    let rig = Rig::new(&prepared)?;
    let followed = followed(&plant, &rig);
    let seeds = || seeds_of(settings.seed..=last, runs).map_err(|error| error.at(&study.file));
    // runs that are done once more begin again
    let mut most = 0.0_f64;
    let watch = &mut |done: f64| {
        most = most.max(done);
        watch(most)
    };
    let sensors = ends::sensors(&prepared, &plant);
    let together = Together {
        prepared: &prepared,
        rig: &rig,
        followed: &followed,
        sensors: &sensors,
    };
    let job = Job {
        study,
        followed: &followed,
        sensors: &sensors,
        time: OnceLock::new(),
    };
    let told = |figures: Figures| {
        let clipped = figures.clipped_in_words(&sensors, &rig);
        let mut told = reported(&prepared, &rig, &followed, runs, figures);
        told.notes.extend(clipped);
        told
    };
    let fits = || room(study, &rig, runs, followed.len());
    if together.can(runs)? {
        // what a limit of time leaves has to be kept
        if study.budget.left().is_some() && fits().is_ok() {
            if let Some(done) = together.portions(&job, &plant, &seeds()?, watch)? {
                return job.gathered(done.singles, done.again).map(told);
            }
        } else if let Some(done) = together.figures(&seeds()?, watch)? {
            return job.screened(&plant, &rig, done, watch).map(told);
        }
    }
    fits()?;
    let singles = job.singles(&plant, &rig, &seeds()?, watch)?;
    job.gathered(singles, Again::Alone).map(told)
}

/// The seeds of so many runs. Where memory has no limit of ours, the machine's may be less.
fn seeds_of(runs: RangeInclusive<u64>, count: usize) -> Result<Vec<u64>, Error> {
    let mut seeds = vec![];
    let reserved = seeds.try_reserve_exact(count);
    reserved.map_err(|_| Error::input(format!("{count} runs: there is no memory for so many")))?;
    seeds.extend(runs);
    Ok(seeds)
}

/// Estimates whose truth a run has.
fn followed(plant: &Plant, rig: &Rig) -> Vec<Followed> {
    let estimates = rig.design.observer.estimates.iter().enumerate();
    let known = estimates.filter_map(|(estimate, e)| {
        let truth = column_of(plant, &e.variable)?;
        Some(Followed {
            estimate,
            truth,
            rotation: None,
        })
    });
    let mut known: Vec<Followed> = known.collect();
    for (place, name) in firsts(&plant.states) {
        let node = plant.states[place].node;
        let mut estimates = rig.design.observer.estimates.iter();
        let Some(estimate) = estimates.position(|e| e.variable.node == node) else {
            continue;
        };
        let columns = std::array::from_fn(|i| Role::State.at(place + i));
        known.push(Followed {
            estimate,
            truth: columns[0],
            rotation: Some((name, columns)),
        });
    }
    known
}

impl Figures {
    fn clipped_in_words(&self, sensors: &[Sensor], rig: &Rig) -> Option<String> {
        let (runs, rows) = (self.seeds.len(), self.time.len());
        ends::told(sensors, &self.clipped, rig, runs, rows)
    }
}

/// The figures under their names.
fn reported(
    prepared: &Prepared<'_>,
    rig: &Rig,
    followed: &[Followed],
    asked: usize,
    figures: Figures,
) -> MonteCarlo {
    let (study, plant) = (prepared.study(), prepared.plant());
    let Figures {
        seeds,
        failures,
        doubtful,
        time,
        found,
        again,
        ..
    } = figures;
    let mut headers = Headers::beside(plant);
    let time_header = headers.time();
    let estimates = &rig.design.observer.estimates;
    let quantities = followed.iter().zip(found).map(|(f, found)| {
        let estimate = &estimates[f.estimate];
        let whole = f.rotation.as_ref().map(|(name, _)| Variable {
            name: name.clone(),
            unit: Some("rad".to_owned()),
            description: Some("angle of the rotation between truth and estimate".to_owned()),
            ..estimate.variable.clone()
        });
        let variable = whole.as_ref().unwrap_or(&estimate.variable);
        Scattered {
            unknown_input: estimate.unknown_input,
            is_measured: is_measured(prepared, variable),
            headers: headers_of(&variable.name, &mut headers),
            name: variable.name.clone(),
            unit: variable.unit.clone(),
            description: variable.description.clone(),
            truth: found.truth,
            error: found.error,
            error_worst: found.error_worst,
            rms: found.rms,
            coverage: found.coverage,
            worst_run: found.worst_run,
            worst_course: found.worst_course,
        }
    });
    let quantities = quantities.collect();
    let mut notes = rig.design.notes.clone();
    notes.append(&mut headers.notes);
    notes.extend_from_slice(&rig.notes);
    if !rig.is_random() {
        notes.push("nothing differs from run to run: `noise` of [sensors], [process_noise] and `spread` of [simulate] draw by the seed".to_owned());
    }
    let done = seeds.len() + failures.len();
    let limit = study.budget.marked();
    let limit = limit.map(|spent| format!("{done} of {asked} runs: {spent}"));
    MonteCarlo {
        plant: plant.name.clone(),
        family: rig.design.examination.family.name(),
        file: study.file.clone(),
        time_unit: study.time_unit.clone(),
        show: study.show.clone(),
        asked,
        seeds,
        failures,
        doubtful,
        limit,
        again,
        time,
        time_header,
        quantities,
        notes,
    }
}

fn is_measured(prepared: &Prepared<'_>, variable: &Variable) -> bool {
    let outputs = &prepared.augmented().outputs;
    outputs.iter().any(|o| o.variable.node == variable.node)
}

#[cfg(test)]
mod tests;
