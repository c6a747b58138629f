//! Columns of a log that may be another quantity than the model's: a wrong unit, a factor of ten, two that changed places.
//!
//! Where readings contradict the estimate, the beginning of the log is replayed once more with each of some usual changes
//! of a column. A change under which every sensor agrees with the model is named; where several do, or readings agree
//! however small they are, nothing is said.

use std::ops::ControlFlow;
use std::time::Instant;

use lynkeus_run::filter::SensorHealth;

use crate::Series;
use crate::course::computed::within_expression;
use crate::course::doubt::{Doubt, Kind, Level};
use crate::course::replay::Watch;
use crate::course::run::start_at_readings;
use crate::course::units::{CHANGES, Change};
use crate::course::{Course, Samples};
use crate::estimate::followed::followed;
use crate::prepare::headers::header;
use crate::prepare::systems::run_settings;
use crate::prepare::{Prepared, StudyDesign};

/// Rows of the log that are replayed: a change under which the first few contradict the model is not tried on more.
const ROWS: [usize; 3] = [20, 100, 500];
/// Seconds after which no other change is tried.
const LONGEST: f64 = 1.0;
/// Sensors of which changes are tried: those that contradict the estimate most.
const SENSORS: usize = 3;
/// Innovations so many times as large as expected are a contradiction.
const CONTRADICTS: f64 = 3.0;
/// From so many times on to [`MOST`] a sensor agrees with the model.
const LEAST: f64 = 0.3;
const MOST: f64 = 1.5;

/// Where readings that are still smaller agree as well, a change shows nothing: a plant may rest at 0.
const SMALLER: [f64; 2] = [0.2, 0.02];

/// A doubt that names the column of a log that seems to be another quantity; none where nothing contradicts the model,
/// or no single change explains it.
pub(super) fn suspected(
    prepared: &Prepared<'_>,
    design: &StudyDesign,
    samples: &Samples,
    course: &Course,
) -> Option<Doubt> {
    let mut suspects: Vec<(usize, f64)> = ratios(&course.late)
        .enumerate()
        .filter(|(_, ratio)| *ratio > CONTRADICTS)
        .collect();
    suspects.sort_by(|one, other| other.1.total_cmp(&one.1));
    let trial = Trial {
        prepared,
        design,
        samples,
        begun: Instant::now(),
    };
    let mut found = vec![];
    for &(sensor, _) in suspects.iter().take(SENSORS) {
        for change in &CHANGES {
            let agrees = |change: &Change, least: f64| {
                trial.agrees(least, |readings| {
                    readings[sensor] = change.of(&readings[sensor])
                })
            };
            let shows_nothing =
                || change.is_scale() && SMALLER.iter().any(|&by| agrees(&change.smaller(by), 0.0));
            if agrees(change, LEAST) && !shows_nothing() {
                found.push(trial.scaled(sensor, change));
            }
        }
        for other in (0..samples.readings.len()).filter(|&other| other != sensor) {
            let changed = |readings: &mut Vec<Series>| readings.swap(sensor, other);
            let is_seen = suspects.iter().any(|s| s.0 == other) && other < sensor;
            if !is_seen && trial.agrees(LEAST, changed) {
                found.push(trial.swapped(sensor, other));
            }
        }
    }
    found.pop().filter(|_| found.is_empty())
}

/// How many times as large as expected the innovations of each sensor are; of one whose readings the gate keeps out,
/// without end.
fn ratios(sensors: &[SensorHealth]) -> impl Iterator<Item = f64> {
    sensors.iter().map(|sensor| {
        let is_rejected = 2 * sensor.rejected > sensor.rejected + sensor.taken;
        let ratio = sensor.consistency().map_or(1.0, f64::sqrt);
        if is_rejected { f64::INFINITY } else { ratio }
    })
}

/// The first rows of a log.
fn beginning(samples: &Samples, rows: usize) -> Samples {
    let rows = samples.time.len().min(rows);
    let first = |column: &Series| Series::from(column.part(0, rows));
    Samples {
        time: first(&samples.time),
        readings: samples.readings.iter().map(first).collect(),
        inputs: samples.inputs.iter().map(first).collect(),
    }
}

struct Trial<'t, 'p> {
    prepared: &'t Prepared<'p>,
    design: &'t StudyDesign,
    samples: &'t Samples,
    begun: Instant,
}

impl Trial<'_, '_> {
    /// Whether the innovations of every sensor are as large as expected once the readings are changed: `least` to
    /// [`MOST`] times over the last half.
    fn agrees(&self, least: f64, change: impl Fn(&mut Vec<Series>)) -> bool {
        let last = self.samples.time.len().min(ROWS[ROWS.len() - 1]);
        ROWS.iter().all(|&rows| {
            let mut samples = beginning(self.samples, rows);
            change(&mut samples.readings);
            let most = if rows < last { CONTRADICTS } else { MOST };
            let is_good = |ratio| ratio <= most && (rows < last || ratio >= least);
            self.course(&samples)
                .is_some_and(|course| !course.late.is_empty() && ratios(&course.late).all(is_good))
        })
    }

    /// The whole course over these samples.
    fn course(&self, samples: &Samples) -> Option<Course> {
        let study = self.prepared.study();
        let is_over =
            || study.budget.spent().is_some() || self.begun.elapsed().as_secs_f64() > LONGEST;
        if is_over() {
            return None;
        }
        let mut design = self.design.clone();
        start_at_readings(self.prepared, samples, &mut design);
        let run = run_settings(&study.estimate);
        let watch = &mut |_| match is_over() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let found = followed(self.prepared, &design, samples, run, Watch::only(watch));
        found.ok().filter(|course| course.ended.is_none())
    }

    fn scaled(&self, sensor: usize, change: &Change) -> Doubt {
        let (name, header) = self.names(sensor);
        let expression = change.expression.replace("{}", &header);
        let text = format!(
            "{name} looks as if it were {}: the log agrees with the model where `columns = {{ {name} = \"{expression}\" }}` stands in [log]",
            change.cause
        );
        doubt(name, text)
    }

    fn swapped(&self, one: usize, other: usize) -> Doubt {
        let ((name, header), (second, of_second)) = (self.names(one), self.names(other));
        let text = format!(
            "{name} and {second} look as if they had changed places: the log agrees with the model where `columns = {{ {name} = \"{of_second}\", {second} = \"{header}\" }}` stands in [log]"
        );
        doubt(name, text)
    }

    /// The name of a sensor, and its column as an expression has it.
    fn names(&self, sensor: usize) -> (String, String) {
        let name = &self.design.observer.measured[sensor].name;
        let own = within_expression(header(&self.prepared.study().estimate, name));
        (name.clone(), own)
    }
}

fn doubt(name: String, text: String) -> Doubt {
    Doubt {
        kind: Kind::Innovations,
        name,
        text,
        level: Level::Warning,
    }
}
