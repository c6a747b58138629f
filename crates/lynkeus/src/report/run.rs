//! The estimates of a page: on which samples, and with which fixed steps.

use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::Design;
use lynkeus_words::short;

use super::knob::Fixed;
use crate::{Accuracy, Error, ErrorKind, Outcome, Quantity, Study, Table};
use lynkeus_experiment::course::sampling::{Resolution, Sampling, sampling};
use lynkeus_experiment::estimated;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::systems;

/// Errors that differ by no more than this share of the larger one are the same,
const SAME: f64 = 0.25;
/// and those that are below this share of the largest error.
const NONE: f64 = 0.01;

/// With fixed steps an estimate is to differ from the one with controlled steps by no more than
/// this share of its largest value.
const NEAR: f64 = 0.01;
/// How often steps are halved for that.
const HALVINGS: u32 = 8;

/// What a run is told of, and what may stop it.
pub(super) type Watch<'w> = &'w mut dyn FnMut(f64) -> ControlFlow<()>;

/// The study's plant as a logger would have it, with what is true.
pub(super) fn simulated(
    prepared: &Prepared<'_>,
    study: &Study,
    plant: &Plant,
    notes: &mut Vec<String>,
) -> Result<Sampling, Error> {
    let settings = systems::settings(study).map_err(|error| {
        error.hint("give a log after the study, or add [simulate] with `until` and `inputs`")
    })?;
    let errors = &mut |table: &Table| errors(prepared, table);
    let found = sampling(
        study,
        plant,
        errors,
        &|coarse, fine| matches!((coarse, fine), (Some(coarse), Some(fine)) if are_same(coarse, fine)),
    )?;
    if found.resolution != Resolution::Study && found.step < settings.row_step() {
        notes.push(format!(
            "the simulation is sampled every {}, as the study says neither `noise` nor `sample_step`",
            short(found.step)
        ));
    }
    Ok(found)
}

/// Errors on a log; none where the run does not reach its end.
fn errors(prepared: &Prepared<'_>, table: &Table) -> Result<Option<Vec<Accuracy>>, Error> {
    match estimated(prepared, table, &mut |_| ControlFlow::Continue(())) {
        Ok(outcome) => Ok(outcome.ended.is_none().then_some(outcome.accuracies)),
        Err(error) if error.kind() == ErrorKind::Refused => Ok(None),
        Err(error) => Err(error),
    }
}

fn are_same(coarse: &[Accuracy], fine: &[Accuracy]) -> bool {
    coarse.iter().zip(fine).all(|(a, b)| {
        let (x, y) = (a.rms.unwrap_or(a.peak), b.rms.unwrap_or(b.peak));
        let allowed = (SAME * x.max(y)).max(NONE * a.peak.max(b.peak));
        (x - y).abs() <= allowed
    })
}

/// The estimates with fixed steps: the study's own, those of `step`, or such as give nearly what
/// controlled steps give.
///
/// # Errors
/// The first is why the observer cannot run in a page; the second one that no estimate has.
pub(super) fn fixed(
    prepared: &Prepared<'_>,
    design: &Design,
    step: Option<f64>,
    table: &Table,
    watch: Watch<'_>,
) -> Result<Result<(Fixed, Outcome), Error>, Error> {
    let run = |shorter: u32, watch: Watch<'_>| -> Result<Result<(Fixed, Outcome), Error>, Error> {
        let fixed = match Fixed::new(prepared, design, step, f64::from(shorter)) {
            Ok(fixed) => fixed,
            Err(why) => return Ok(Err(why)),
        };
        let outcome = estimated(&prepared.run_by(&fixed.study)?, table, watch)?;
        Ok(Ok((fixed, outcome)))
    };
    let mut best = match run(1, watch)? {
        Ok(best) if best.0.is_chosen => best,
        done => return Ok(done),
    };
    // what controlled steps give, where they reach the end
    let Ok(reference) = estimated(prepared, table, watch) else {
        return Ok(Ok(best));
    };
    if reference.ended.is_some() {
        return Ok(Ok(best));
    }
    for halving in 1..=HALVINGS {
        if apart(&reference, &best.1) <= NEAR {
            return Ok(Ok(best));
        }
        best = match run(1 << halving, watch)? {
            Ok(finer) => finer,
            Err(why) => return Ok(Err(why)),
        };
    }
    if apart(&reference, &best.1) <= NEAR {
        return Ok(Ok(best));
    }
    Ok(Err(Error::refused(format!(
        "it needs fixed steps, and {} do not give what steps controlled by their error give",
        best.0.own.steps
    ))))
}

/// How far two runs are apart, each estimate in units of its largest value.
fn apart(reference: &Outcome, other: &Outcome) -> f64 {
    if other.ended.is_some() {
        return f64::INFINITY;
    }
    let pairs = reference.quantities.iter().zip(&other.quantities);
    let of = |(a, b): (&Quantity, &Quantity)| {
        let (Some(a), Some(b)) = (&a.estimate, &b.estimate) else {
            return 0.0;
        };
        let size = a.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let off = a.iter().zip(b.iter());
        let off = off.fold(0.0, |most: f64, (x, y)| most.max((x - y).abs()));
        if off > 0.0 { off / size } else { 0.0 }
    };
    pairs.map(of).fold(0.0, f64::max)
}

/// What is to be said of the steps.
pub(super) fn told(fixed: &Fixed, notes: &mut Vec<String>) {
    if fixed.is_chosen {
        notes.push(format!(
            "{}, as [estimate] has no method = \"rk4\" with `step`: a fixed step with which the estimates are nearly those of a step controlled by its error",
            fixed.own.steps
        ));
    }
}
