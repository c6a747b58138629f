//! The estimates of a page: on which samples, and with which fixed steps.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use lynkeus_model::Plant;
use lynkeus_observers::Design;
use lynkeus_words::short;

use super::data::ROWS;
use super::knob::Fixed;
use crate::prepare::Prepared;
use crate::{
    Accuracy, Error, ErrorKind, Outcome, Quantity, Study, Table, estimate, prepare::systems,
    simulate,
};

/// Errors that differ by no more than this share of the larger one are the same,
const SAME: f64 = 0.25;
/// and those that are below this share of the largest error.
const NONE: f64 = 0.01;
/// No more samples are asked for where those at hand took so long.
const LONG: Duration = Duration::from_secs(4);

/// With fixed steps an estimate is to differ from the one with controlled steps by no more than
/// this share of its largest value.
const NEAR: f64 = 0.01;
/// How often steps are halved for that.
const HALVINGS: u32 = 8;

/// What a run is told of, and what may stop it.
pub(super) type Watch<'w> = &'w mut dyn FnMut(f64) -> ControlFlow<()>;

/// Samples of a simulation.
pub(super) struct Simulated {
    pub table: Table,
    /// from one to the next
    pub step: f64,
}

/// The study's plant as a logger would have it, with what is true. Where the study says neither noise
/// nor `sample_step`, samples are so dense that holding them decides nothing.
pub(super) fn simulated(
    prepared: &Prepared<'_>,
    study: &Study,
    plant: &Plant,
    notes: &mut Vec<String>,
) -> Result<Simulated, Error> {
    let settings = systems::settings(study).map_err(|error| {
        error.hint("give a log after the study, or add [simulate] with `until` and `inputs`")
    })?;
    if let Some(step) = systems::sampled_every(study, settings) {
        let table = simulate::recorded(study, plant, step)?;
        return Ok(Simulated { table, step });
    }
    let since = Instant::now();
    let first = settings.row_step();
    let mut step = first;
    let mut coarse: Option<Vec<Accuracy>> = None;
    loop {
        let table = simulate::recorded(study, plant, step)?;
        let fine = errors(prepared, &table)?;
        let is_settled =
            matches!((&coarse, &fine), (Some(coarse), Some(fine)) if are_same(coarse, fine));
        let too_many = 2.0 * (settings.until - settings.start) / step > ROWS as f64;
        if is_settled || too_many || since.elapsed() > LONG || study.budget.spent().is_some() {
            if step < first {
                notes.push(format!(
                    "the simulation is sampled every {}, as the study says neither `noise` nor `sample_step`",
                    short(step)
                ));
            }
            return Ok(Simulated { table, step });
        }
        (coarse, step) = (fine, step / 2.0);
    }
}

/// Errors on a log; none where the run does not reach its end.
fn errors(prepared: &Prepared<'_>, table: &Table) -> Result<Option<Vec<Accuracy>>, Error> {
    match estimate::estimated(prepared, table, &mut |_| ControlFlow::Continue(())) {
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
        let outcome = estimate::estimated(&prepared.run_by(&fixed.study)?, table, watch)?;
        Ok(Ok((fixed, outcome)))
    };
    let mut best = match run(1, watch)? {
        Ok(best) if best.0.is_chosen => best,
        done => return Ok(done),
    };
    // what controlled steps give, where they reach the end
    let Ok(reference) = estimate::estimated(prepared, table, watch) else {
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
