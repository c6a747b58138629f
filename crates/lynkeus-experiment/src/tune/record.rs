//! A log as every value of a sweep is judged on it.

use std::borrow::Cow;

use lynkeus_observers::Design;

use super::errors::rms;
use super::holdout::{FEWER, Plan};
use crate::course::columns::Log;
use crate::course::ended::{interrupted_on, is_observers_answer};
use crate::course::inputs::{Source, are_logged};
use crate::course::run::course_of;
use crate::course::{Course, Samples, lines, replay};
use crate::crew::Watch;
use crate::prepare::Prepared;
use crate::prepare::systems::run_settings;
use crate::thrifty::thrifty;
use crate::words::in_words;
use crate::{Error, Series, Study, Table};
use lynkeus_study::{BetweenSamples, Records};

/// What is the same for all values.
#[derive(Clone, Debug)]
pub(super) struct Record<'t> {
    pub log: Log<'t>,
    pub plan: Plan,
    /// filters take the samples that there are, observers have a switch
    pub is_filters: bool,
    /// every sample
    pub whole: Replayed,
    /// with samples held out
    pub parts: Replayed,
    /// what the user should know
    pub notes: Vec<String>,
}

/// Samples for a filter, or for a switchable observer: the switch is the last of the inputs.
#[derive(Clone, Debug)]
pub(super) struct Replayed {
    pub samples: Samples,
    pub between: BetweenSamples,
}

impl<'t> Record<'t> {
    /// A table as `estimate` takes it.
    ///
    /// # Errors
    /// As of [`Log::read`] and [`Plan::new`]; a sensor of which nothing is left.
    pub fn new(prepared: &Prepared<'_>, table: &'t Table, is_filters: bool) -> Result<Self, Error> {
        let log = Log::read(prepared, table)?;
        let study = prepared.study();
        let plan = Plan::new(study, &log.samples)?;
        let between = study.estimate.between_samples;
        let parts = match is_filters {
            true => held_out(&log.samples, &plan, BetweenSamples::Hold),
            // the switch alone decides, and no value stands in for another
            false if !log.samples.have_gaps() => log.samples.clone(),
            false => held_out(&log.samples, &plan, between),
        };
        let notes = [
            &log.warnings[..],
            &log.notes,
            &unscored(prepared, &log, &plan, &parts)?,
        ];
        // an observer whose readings lie on lines knows what comes
        let causal = match between {
            BetweenSamples::Linear if !is_filters => BetweenSamples::Hold,
            between => between,
        };
        let off = vec![0.0; plan.held_out.len()];
        let switched = |samples, switch| match is_filters {
            true => samples,
            false => switched(samples, switch),
        };
        Ok(Self {
            whole: Replayed {
                samples: switched(log.samples.clone(), off),
                between: causal,
            },
            parts: Replayed {
                samples: switched(parts, plan.held_out.clone()),
                between,
            },
            notes: notes.concat(),
            is_filters,
            log,
            plan,
        })
    }

    /// The same with the inputs as an observer reads them.
    ///
    /// # Errors
    /// Columns that the log does not have, or not as numbers.
    pub fn supplied(
        &self,
        prepared: &Prepared<'_>,
        sources: &[Source],
    ) -> Result<Cow<'_, Self>, Error> {
        if are_logged(prepared, sources) {
            return Ok(Cow::Borrowed(self));
        }
        let inputs = self.log.inputs(prepared, sources)?;
        let mut record = self.clone();
        for replayed in [&mut record.whole, &mut record.parts] {
            let known = self.log.samples.inputs.len();
            let own = &mut replayed.samples.inputs;
            own.splice(..known, inputs.iter().cloned());
        }
        Ok(Cow::Owned(record))
    }

    /// The readings of the measured outputs, by output.
    pub fn readings(&self) -> &[Series] {
        &self.log.samples.readings
    }

    /// The root mean square over outputs of each one's error on the scored rows, over the span
    /// of its values on the whole log; outputs that do not report there are left out.
    pub fn held_out_error(&self, predicted: &[Series]) -> Option<f64> {
        let error = |(values, prediction): (&Series, &Series)| {
            let rows = values.iter().zip(prediction).zip(self.plan.scored());
            let scored = rows.filter(|((y, _), is_scored)| *is_scored && y.is_finite());
            let errors: Vec<f64> = scored.map(|((y, hat), _)| y - hat).collect();
            (!errors.is_empty()).then(|| rms(&errors) / span(values))
        };
        let pairs = self.readings().iter().zip(predicted);
        let errors: Vec<f64> = pairs.filter_map(error).collect();
        (!errors.is_empty()).then(|| rms(&errors))
    }
}

/// Notes of outputs of which no reading is scored.
///
/// # Errors
/// An output of which no reading is left.
fn unscored(
    prepared: &Prepared<'_>,
    log: &Log<'_>,
    plan: &Plan,
    parts: &Samples,
) -> Result<Vec<String>, Error> {
    let mut notes = vec![];
    for (i, output) in prepared.augmented().outputs.iter().enumerate() {
        let name = &output.variable.name;
        let is_left = |readings: &Series| readings.iter().any(f64::is_finite);
        if !parts.readings.get(i).is_some_and(is_left) {
            return Err(Error::input(format!("every reading of {name} is held out"))
                .at(&prepared.study().file)
                .hint(FEWER));
        }
        let scored = log.samples.readings.get(i).into_iter().flatten();
        let mut scored = scored.zip(plan.scored());
        if !scored.any(|(y, is_scored)| is_scored && y.is_finite()) {
            notes.push(format!(
                "no reading of {name} is held out after the first block: it is not among the held-out samples that are judged; fewer `blocks` of [tune] may change that"
            ));
        }
    }
    Ok(notes)
}

/// From the least to the greatest of the values that are there, or the magnitude of a constant,
/// or 1.
pub(super) fn span(values: &Series) -> f64 {
    let low = values.iter().fold(f64::INFINITY, f64::min);
    let high = values.iter().fold(f64::NEG_INFINITY, f64::max);
    match high - low {
        span if span > 0.0 => span,
        _ if high.abs() > 0.0 => high.abs(),
        _ => 1.0,
    }
}

fn switched(mut samples: Samples, switch: Vec<f64>) -> Samples {
    samples.inputs.push(switch.into());
    samples
}

/// Samples with gaps less those that are held out. Lines between samples end where samples are
/// held out: across, they would tell what comes after.
fn held_out(samples: &Samples, plan: &Plan, between: BetweenSamples) -> Samples {
    let left = |readings: &Series| {
        let rows = readings.iter().zip(&plan.held_out);
        let left = rows.map(|(y, out)| if *out > 0.0 { f64::NAN } else { y });
        let left = Series::gathered(readings.store(), left);
        match between {
            BetweenSamples::Linear => lines::within(&samples.time, &left, plan.stretches()),
            BetweenSamples::Hold | BetweenSamples::Predict => left,
        }
    };
    Samples {
        readings: samples.readings.iter().map(left).collect(),
        ..samples.clone()
    }
}

/// What `estimate` makes of samples, as far as a figure depends on it, or why its estimate is none;
/// `place` is what an error of theirs is told of.
///
/// # Errors
/// A study or samples that cannot be used.
pub(super) fn course(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    between: BetweenSamples,
    place: &str,
    watch: &mut Watch<'_>,
) -> Result<Result<Course, String>, Error> {
    let mut study = prepared.study().clone();
    study.estimate.between_samples = between;
    study.estimate.deviations = false;
    study.estimate.innovations = false;
    study.estimate.smoothing = None;
    study.records = match design.observer.filter {
        Some(_) => Records::Likelihood,
        None => Records::Nothing,
    };
    let prepared = prepared.run_by(&study)?;
    let mut run = run_settings(&study.estimate);
    run.method = thrifty(run.method, samples.time.len() as f64);
    let watch = &mut replay::Watch::only(watch);
    let mut course = course_of(&prepared, design, samples, run, watch)?;
    course.check()?;
    let told = told(&mut course, place, &study)?;
    Ok(told.map(|()| course))
}

/// Why the estimate of a run is none, where it is none.
///
/// # Errors
/// A run that ended early for another reason.
pub(super) fn told(
    course: &mut Course,
    place: &str,
    study: &Study,
) -> Result<Result<(), String>, Error> {
    match course.ended.take() {
        None => Ok(Ok(())),
        Some(error) if is_observers_answer(&error) => Ok(Err(in_words(&error))),
        Some(error) => Err(interrupted_on(error, place, &study.file)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prepare;
    use std::path::Path;

    /// A log of 60 rows, every third of them empty, whose readings that are held out say `lie`.
    fn parts(between: BetweenSamples, lie: f64) -> Vec<f64> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/two-tanks");
        let mut study = Study::load(folder.join("study.toml")).unwrap();
        study.estimate.between_samples = between;
        study.tune.blocks = 4;
        let plant = prepare::plant(&study).unwrap();
        let prepared = Prepared::new(&study, &plant).unwrap();
        let log = |held_out: &dyn Fn(usize) -> bool| {
            let level = |row: usize| match (row.is_multiple_of(3), held_out(row)) {
                (true, _) => f64::NAN,
                (_, true) => lie,
                _ => 4.0 + (row as f64).sin(),
            };
            Table::from_columns(vec![
                ("t".to_owned(), (0..60).map(f64::from).collect()),
                ("level".to_owned(), (0..60).map(level).collect()),
            ])
            .unwrap()
        };
        let honest = log(&|_| false);
        let plan = Record::new(&prepared, &honest, false).unwrap().plan;
        let table = log(&|row| plan.held_out[row] > 0.0);
        let record = Record::new(&prepared, &table, false).unwrap();
        assert_eq!(record.plan, plan);
        record.parts.samples.readings[0].to_vec()
    }

    /// Neither before, by a line towards it, nor after.
    #[test]
    fn what_is_held_out_is_read_nowhere() {
        use BetweenSamples::{Hold, Linear, Predict};
        for between in [Hold, Predict, Linear] {
            let [a, b] = [-7.0, 9.0].map(|lie| parts(between, lie));
            let same = a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{between:?}: {a:?} {b:?}");
            let is_whole = a.iter().all(|y| y.is_finite());
            assert_eq!(is_whole, between == Linear);
        }
    }
    #[test]
    fn gaps_are_no_part_of_what_values_span() {
        assert_eq!(span(&vec![f64::NAN, 2.0, -1.0, f64::NAN].into()), 3.0);
        assert_eq!(span(&vec![f64::NAN, -2.0].into()), 2.0);
    }
}
