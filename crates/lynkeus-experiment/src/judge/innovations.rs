//! How readings went together with what was expected of them.

use lynkeus_observers::Design;
use lynkeus_run::filter::SensorHealth;
use lynkeus_words::figures;
use serde::Serialize;

use crate::course::Course;
use crate::course::trace::Trace;

/// The innovations of one measured output.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovations {
    /// the output
    pub output: String,
    /// over the whole run
    pub all: SensorHealth,
    /// over the last half of its rows
    pub late: SensorHealth,
    /// by stretches of readings
    pub(crate) trace: Trace,
    /// the same beside what is expected once the start is forgotten
    pub(crate) settled: Trace,
}

/// The readings of a sensor beside what was expected of them.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct InnovationCounts {
    /// readings that were taken
    taken: usize,
    /// readings that were missing
    missing: usize,
    /// readings that the gate rejected
    rejected: usize,
    /// readings at a limit of the sensor
    at_limit: usize,
    /// mean of (innovation/its standard deviation)²: 1 where noise is as declared
    consistency: Option<f64>,
    /// the same over the last half of the rows
    consistency_last_half: Option<f64>,
}

impl From<&Innovations> for InnovationCounts {
    fn from(Innovations { all, late, .. }: &Innovations) -> Self {
        Self {
            taken: all.taken,
            missing: all.missing,
            rejected: all.rejected,
            at_limit: all.at_limit,
            consistency: all.consistency(),
            consistency_last_half: late.consistency(),
        }
    }
}

impl Innovations {
    fn words(&self) -> String {
        let SensorHealth {
            taken,
            missing,
            rejected,
            at_limit,
            ..
        } = self.all;
        let mut words = format!("{}: {taken} readings taken", self.output);
        for (count, what) in [
            (missing, "missing"),
            (rejected, "rejected by the gate"),
            (at_limit, "at a limit of the sensor"),
        ] {
            if count > 0 {
                words += &format!(", {count} {what}");
            }
        }
        if let Some(consistency) = self.late.consistency() {
            words += &format!(
                "; innovations {} times their declared size in the last half",
                figures(consistency.sqrt(), 2)
            );
        }
        words
    }
}

/// Outputs that are told of one by one.
const TOLD: usize = 6;

/// Those of a run, told in notes.
pub(crate) fn innovations(
    design: &Design,
    course: &Course,
    notes: &mut Vec<String>,
) -> Vec<Innovations> {
    let sensors = course.sensors.iter().zip(&course.late);
    let sensors = sensors.zip(course.traces.iter().zip(&course.settled));
    let found: Vec<Innovations> = sensors
        .zip(&design.observer.measured)
        .map(|(((all, late), (trace, settled)), signal)| Innovations {
            output: signal.name.clone(),
            all: *all,
            late: *late,
            trace: trace.clone(),
            settled: settled.clone(),
        })
        .collect();
    notes.extend(found.iter().take(TOLD).map(Innovations::words));
    if course.inputs_held > 0 {
        notes.push(format!(
            "{} values of known inputs are missing: the last one holds",
            course.inputs_held
        ));
    }
    found
}
