//! Families on the same samples.

use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;
use std::time::Instant;

use lynkeus_model::{Home, Plant};
use lynkeus_observers::Family;

use crate::crew::within;
use crate::judge::accuracy::SETTLED;
use crate::prepare::Prepared;
use crate::tune::{self, Foretold, errors::Errors};
use crate::{Error, Outcome, Quantity, Study, Table, estimate};
use lynkeus_study::{BetweenSamples, Name};

/// Is told the fraction done and may stop the work.
pub(super) type Watch<'w> = &'w mut dyn FnMut(f64) -> ControlFlow<()>;

/// One family on the data.
#[derive(Debug)]
pub struct Compared {
    /// name of the family
    pub family: &'static str,
    /// its run, or why there is none
    pub run: Result<Run, String>,
}

/// What a family makes of the data.
#[derive(Debug)]
pub struct Run {
    /// the error of each quantity
    pub settled: Vec<Settled>,
    /// largest error after the first row, in widths of the declared ranges
    pub peak: Option<f64>,
    /// time until every error stays within 5 % of its range; none where it does not
    pub settling: Option<f64>,
    /// how rough the estimates are in the last half: the standard deviation of each about the
    /// line between its neighbours, in widths of its range, the largest of them
    pub roughness: Option<f64>,
    /// seconds of computing per sample, examination and design left out
    pub per_sample: f64,
    /// how well it foretells a log that has no true values
    pub foretold: Option<Foretold>,
    /// why that is not known, or not of all of the log
    pub unforetold: Option<String>,
    /// why the estimate is not credible, where it is not
    pub doubt: Option<String>,
    /// the estimates
    pub outcome: Outcome,
}

/// The error of a quantity once the start is forgotten.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// name of the quantity
    pub quantity: String,
    /// root of the mean square error over the last half of the rows, in its unit; none where its
    /// true value is not known
    pub rms: Option<f64>,
    /// width of its declared range, in its unit
    pub width: f64,
}

/// Each of the families on the same samples.
///
/// # Errors
/// The user ended it; a study that does not fit its plant.
pub(super) fn run_all(
    study: &Study,
    plant: &Plant,
    families: &[&'static dyn Family],
    table: &Table,
    watch: Watch<'_>,
) -> Result<Vec<Compared>, Error> {
    let count = families.len() as f64;
    let mut rows = vec![];
    for (i, &family) in families.iter().enumerate() {
        let own = of_family(study, family);
        let prepared = Prepared::new(&own, plant)?;
        let mut is_ended = false;
        let part = &mut |done: f64| {
            let told = watch((i as f64 + done) / count);
            is_ended |= told.is_break();
            told
        };
        let mut run = timed(&prepared, |p| estimate::estimated(p, table, part));
        if let Ok(run) = &mut run
            && run.peak.is_none()
        {
            let watch = &mut |_| part(1.0);
            let found = tune::foretold(&prepared, table, &mut within(&own.budget, watch));
            match found {
                Err(error) if is_ended => return Err(error),
                Err(error) => run.unforetold = Some(error.to_string()),
                Ok((foretold, failure)) => {
                    (run.foretold, run.unforetold) = (Some(foretold), failure);
                }
            }
        }
        match run {
            Err(error) if is_ended => return Err(error),
            run => rows.push(Compared {
                family: family.name(),
                run: run.map_err(|e| e.to_string()),
            }),
        }
    }
    Ok(rows)
}

/// The study for one family: its name, and of the keys those that it owns.
pub(super) fn of_family(study: &Study, family: &dyn Family) -> Study {
    let mut own = study.clone();
    own.observer.family = Some(Name::from(family.name()));
    own.observer.tuning.values.retain(|key, _| family.owns(key));
    if !family.smooths() {
        own.estimate.smoothing = None;
    }
    // their standard deviations are those of held samples
    if !family.is_filter() && own.estimate.between_samples == BetweenSamples::Linear {
        own.estimate.deviations = false;
        own.estimate.innovations = false;
    }
    own
}

fn timed<'p>(
    prepared: &'p Prepared<'p>,
    run: impl FnOnce(&'p Prepared<'p>) -> Result<Outcome, Error>,
) -> Result<Run, Error> {
    // the choice is made once; the design is found once more inside, which is not what is timed
    prepared.choice()?;
    let since = Instant::now();
    prepared.design()?;
    let designing = since.elapsed();
    let since = Instant::now();
    let outcome = run(prepared)?;
    let running = since.elapsed().saturating_sub(designing).as_secs_f64();
    Ok(judged(prepared, outcome, running))
}

fn judged(prepared: &Prepared<'_>, outcome: Outcome, seconds: f64) -> Run {
    let width = |quantity: &Quantity| {
        let states = prepared.augmented().states.iter();
        let mut own = states.filter(|s| s.name == quantity.name);
        let width = own.next().map_or(f64::INFINITY, |s| match s.home {
            Home::Circle { .. } => TAU,
            _ => s.max - s.min,
        });
        if width.is_finite() && width > 0.0 {
            width
        } else {
            size(quantity)
        }
    };
    let estimated = || outcome.quantities.iter().filter(|q| q.estimate.is_some());
    let scaled = estimated().filter_map(|q| {
        if let Some(rotation) = &q.rotation {
            let angles = rotation.error.as_ref()?;
            return Some(angles.iter().map(|angle| angle / PI).collect());
        }
        let width = width(q);
        Some(q.errors()?.map(|error| error / width).collect())
    });
    let errors = Errors {
        time: outcome.time.to_vec(),
        scaled: scaled.collect(),
    };
    let is_known = !errors.scaled.is_empty();
    let half = outcome.time.len() / 2;
    let rough = estimated().filter_map(|q| {
        let estimate = q.estimate.as_ref()?;
        let found = crate::course::filter::noise::scatter(&outcome.time, estimate, half)?;
        Some(found / width(q))
    });
    // of a quaternion the angle of its rotation
    let settled = |q: &Quantity| match (q.home, &q.rotation) {
        (Home::Rotation { .. }, None) => None,
        (_, Some(rotation)) => Some(Settled {
            quantity: rotation.name.clone(),
            rms: q.told_error().map(|(_, rms)| rms),
            width: PI,
        }),
        (_, None) => Some(Settled {
            quantity: q.name.clone(),
            rms: q.settled_error(),
            width: width(q),
        }),
    };
    Run {
        settled: estimated().filter_map(settled).collect(),
        peak: errors.peak().map(|peak| peak.2).filter(|_| is_known),
        settling: outcome
            .time
            .first()
            .filter(|_| is_known)
            .and_then(|first| errors.settling(&[first], SETTLED)),
        roughness: rough.reduce(f64::max),
        foretold: None,
        unforetold: None,
        per_sample: seconds / outcome.time.len().max(1) as f64,
        doubt: outcome.refusal().map(|e| e.to_string()),
        outcome,
    }
}

/// The span of a quantity without a declared range.
fn size(quantity: &Quantity) -> f64 {
    let values = quantity.truth.iter().chain(&quantity.estimate).flatten();
    let finite = || values.clone().filter(|x| x.is_finite());
    let (low, high) = (
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(f64::NEG_INFINITY, f64::max),
    );
    if high > low { high - low } else { 1.0 }
}
