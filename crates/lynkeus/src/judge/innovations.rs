//! How readings went together with what was expected of them.

use lynkeus_observers::Design;
use lynkeus_run::filter::SensorHealth;
use lynkeus_words::figures;
use serde_json::{Value, json};

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

impl Innovations {
    /// For machines; `consistency` is the mean of (innovation/its standard deviation)².
    #[must_use]
    pub fn to_json(&self) -> Value {
        let SensorHealth {
            taken,
            missing,
            rejected,
            at_limit,
            ..
        } = self.all;
        json!({
            "taken": taken,
            "missing": missing,
            "rejected": rejected,
            "at_limit": at_limit,
            "consistency": self.all.consistency(),
            "consistency_last_half": self.late.consistency(),
        })
    }

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
