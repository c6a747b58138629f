//! Which tuning is best: a sweep in simulation or on a log.
//!
//! Every value of the swept keys is a row of figures ([`Measure`]); the knee is the row whose
//! first figure is least: the mean error with noise in simulation; on a log the prediction error of
//! held-out samples, or for filters −log of the likelihood. `docs/tune.md` defines them all.

pub mod axis;
pub mod bench;
mod disturbed;
pub(crate) mod errors;
mod foretold;
mod holdout;
mod judge;
mod measures;
#[cfg(feature = "plot")]
mod picture;
mod pinned;
mod record;
mod reference;
mod replay;
mod report;
mod rewrite;
mod row;
mod speed;
mod trial;
pub mod whiteness;

use std::ops::ControlFlow;

use lynkeus_observers::Design;

pub use crate::rewrite::Change;
pub use axis::Axis;
pub use foretold::Foretold;
pub use measures::Measure;
#[cfg(feature = "schema")]
pub use report::SweepReport;
pub use report::shortened;
pub use row::{Peak, Row};

use crate::course::plant::sample_step;
use crate::course::taken::AT_ONCE;
use crate::crew::within;
use crate::prepare::Prepared;
use crate::prepare::declared::{Account, Declared};
use crate::{Error, Study, Table, crew, prepare, prepare::systems};
use bench::{Bench, Ground};
use lynkeus_study::Swept;
use pinned::pinned;
use record::Record;

/// Rows whose figure is at most this many times the least are nearly as good as the knee,
const NEARLY: f64 = 1.1;
/// and those whose logarithm of the likelihood is at most this less: 95 % by the likelihood ratio.
const LIKELY: f64 = 1.92;

/// What a sweep gives.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Name of the plant.
    pub plant: String,
    /// The log it ran on; none in simulation.
    pub log: Option<String>,
    /// The keys with their values.
    pub axes: Vec<Axis>,
    /// What the figures of a row are.
    pub measures: &'static [Measure],
    /// A row for every combination of values, the last key's fastest.
    pub rows: Vec<Row>,
    /// The figure that decides, by its place: the first, but for filters on a log whose rows count
    /// different readings.
    pub objective: usize,
    /// The row where it is least; none where every row failed.
    pub knee: Option<usize>,
    /// The unit of time, if the study states it.
    pub time_unit: Option<String>,
    /// Which of the study's declarations the figures count.
    pub declared: Account,
    /// What the user should know.
    pub notes: Vec<String>,
}

/// Sweeps the tuning of a study, in simulation or on a log, on all processors; `watch` is told
/// the fraction done and may stop it. A value whose estimate diverges is a row with the reason.
///
/// # Errors
/// A key that cannot be swept; a study that can be neither simulated nor replayed.
pub fn tune(
    study: &Study,
    log: Option<&Table>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Sweep, Error> {
    // what the study says wrongly is told before anything is computed
    let given = axis::axes(study);
    if !study.tune.keys.is_empty() {
        given?;
    }
    let plant = prepare::plant(study)?;
    let pinned = pinned(&Prepared::new(study, &plant)?)?;
    let study = &pinned.study;
    let mut axes = axis::axes(study)?;
    let is_proposed = |axis: &&mut Axis| match axis.swept() {
        Swept::Tuning(base, _) => pinned.proposed == Some(base),
        _ => false,
    };
    for axis in axes.iter_mut().filter(is_proposed) {
        axis.proposed = axis.present.take();
    }
    let grid = axis::grid(study, &axes)?;
    let prepared = Prepared::new(study, &plant)?;
    let is_filters = axis::is_filters(study);
    let filter = is_filters.then(|| prepared.design()).transpose()?;
    let ground = match log {
        Some(table) => Ground::Log(table),
        None => Ground::Simulation {
            step: sample_step(systems::settings(study)?),
        },
    };
    let bench = Bench::new(&prepared, filter.as_deref(), ground)?;
    let mut sweep = judged(&prepared, &bench, axes, &grid, watch)?;
    sweep.notes.splice(0..0, pinned.notes);
    sweep.declared = account(prepared.declared(), log.is_none(), is_filters);
    sweep.log = log.map(|table| table.file().to_owned());
    let at_an_end = sweep.at_an_end().map(|(axis, value)| {
        format!(
            "the knee, {} = {}, is at an end of what was swept: the best value may lie beyond; widen `keys` of [tune]",
            axis.label(),
            axis::shown(value)
        )
    });
    sweep.notes.extend(at_an_end);
    Ok(sweep)
}

/// What is said of the values of an axis, each with its study, by observers like a design.
///
/// # Errors
/// A study that cannot be simulated; a log that is too short.
pub fn along(
    prepared: &Prepared<'_>,
    design: &Design,
    axis: Axis,
    grid: &[(Vec<f64>, Study)],
    ground: Ground<'_>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Sweep, Error> {
    let filter = design.observer.filter.as_ref().map(|_| design);
    let bench = Bench::new(prepared, filter, ground)?;
    judged(prepared, &bench, vec![axis], grid, watch)
}

/// How well the observer of a study foretells a log, and why it does not to its end.
///
/// # Errors
/// A study or a log that cannot be used; a log that is too short.
pub(crate) fn foretold(
    prepared: &Prepared<'_>,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(Foretold, Option<String>), Error> {
    let design = prepared.design()?;
    let record = Record::new(prepared, table, design.observer.filter.is_some())?;
    let judged = replay::foretold(prepared, design, &record, watch)?;
    Ok((judged.foretold, judged.failure))
}

/// Every study of a grid on a bench.
fn judged(
    prepared: &Prepared<'_>,
    bench: &Bench<'_>,
    axes: Vec<Axis>,
    grid: &[(Vec<f64>, Study)],
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Sweep, Error> {
    let (study, plant) = (prepared.study(), prepared.plant());
    // what is proved here comes with every clone of the plant; a refusal is the rows' to tell
    let _ = prepared.examinations();
    let rows = crew::every(
        grid.len(),
        plant,
        &|plant, i, watch| match grid.get(i) {
            Some((values, study)) => {
                let ended = |spent| Ok(Row::empty(values, bench.measures().len()).failed(spent));
                if let Some(spent) = study.budget.spent() {
                    return ended(spent);
                }
                // of its own: what one value builds must not meet the next
                let plant = plant.clone();
                let watch = &mut within(&study.budget, watch);
                let row = bench.row(&Prepared::new(study, &plant)?, values, watch);
                match (row, study.budget.marked()) {
                    (Err(_), Some(spent)) => ended(spent),
                    (row, _) => row,
                }
            }
            None => Err(Error::input("no such value")),
        },
        watch,
    )?;
    let mut notes = bench.notes().to_vec();
    let objective = match are_of_the_same_readings(&rows) {
        true => measures::OBJECTIVE,
        false => {
            notes.push("the values take different numbers of readings, whose likelihoods cannot be compared: the knee is the least error on held-out samples".to_owned());
            measures::FILTERS_HELD_OUT
        }
    };
    let ended = |spent| format!("the sweep is not whole: {spent}");
    notes.extend(study.budget.marked().map(ended));
    Ok(Sweep {
        plant: plant.name.clone(),
        log: None,
        measures: bench.measures(),
        axes,
        objective,
        knee: least(&rows, objective),
        rows,
        time_unit: study.time_unit.clone(),
        declared: Account::default(),
        notes,
    })
}

/// Whether likelihoods, where rows have them, are of as many readings: a gate may keep some out.
fn are_of_the_same_readings(rows: &[Row]) -> bool {
    let mut counts = rows.iter().filter_map(|row| row.readings);
    let first = counts.next();
    counts.all(|count| Some(count) == first)
}

/// What the figures count; on a log they are of its own noise and samples, which filters weigh by the
/// study's.
fn account(declared: &Declared, is_simulated: bool, is_filters: bool) -> Account {
    let Declared {
        ranges,
        noise,
        limits,
        samples,
        process_noise,
        disturbances,
        slew,
        input_derivatives,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = declared;
    let measured = "the log's own is in its readings";
    let promised = "a promise of what the inputs do: `certify` counts it";
    Account::default()
        .counts(manifold)
        .counts_if(
            !is_simulated,
            screens,
            "they are of logs: every simulated reading counts",
        )
        .counts_if(!is_simulated, late, AT_ONCE)
        .counts(ranges)
        .counts(limits)
        .counts_if(is_simulated || is_filters, noise, measured)
        .counts_if(is_simulated || is_filters, process_noise, measured)
        .counts_if(is_simulated || is_filters, input_noise, measured)
        .counts_if(is_simulated || is_filters, correlation, measured)
        .counts_if(is_simulated, samples, "the log has its own")
        .leaves(
            disturbances,
            "what `inputs` of [simulate] and `disturbance` of [tune] make of them counts",
        )
        .leaves(slew, promised)
        .leaves(input_derivatives, promised)
}

fn least(rows: &[Row], objective: usize) -> Option<usize> {
    let judged = rows.iter().enumerate();
    judged
        .filter_map(|(i, row)| Some((i, row.figure(objective)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

impl Sweep {
    /// The row of the knee.
    pub fn chosen(&self) -> Option<&Row> {
        self.rows.get(self.knee?)
    }

    /// The range of the first key's values around the knee that are all nearly as good, the other
    /// keys being those of the knee: within 10 % of the least error, or as likely within 95 %.
    pub fn good(&self) -> Option<std::ops::RangeInclusive<f64>> {
        let knee = self.chosen()?;
        let at = *knee.values.first()?;
        let least = knee.figure(self.objective)?;
        let limit = match self.likely_readings() {
            Some(readings) => least + LIKELY / readings as f64,
            None => NEARLY * least,
        };
        let beside = self.points(self.objective, |row| self.beside_knee(row));
        let (up_to, beyond) = beside.split_at(beside.partition_point(|(x, _)| *x <= at));
        let is_good = |(_, y): &&(f64, f64)| *y <= limit;
        let low = up_to.iter().rev().take_while(is_good).last();
        let high = beyond.iter().take_while(is_good).last();
        let end = |found: Option<&(f64, f64)>| found.map_or(at, |(x, _)| *x);
        Some(end(low)..=end(high))
    }

    /// The readings of the knee, where a likelihood decides.
    fn likely_readings(&self) -> Option<usize> {
        let readings = self.chosen()?.readings;
        readings.filter(|_| self.objective == measures::OBJECTIVE)
    }

    /// What makes a value nearly as good as the best, which is called so.
    pub fn nearly(&self, best: &str) -> String {
        match self.likely_readings() {
            Some(_) => "as likely within 95 %".to_owned(),
            None => format!("within 10 % of {best}"),
        }
    }

    /// The axis at whose end the knee is: the best value may lie beyond.
    pub fn at_an_end(&self) -> Option<(&Axis, f64)> {
        let ends = |(axis, value): &(&Axis, &f64)| {
            let beyond =
                |x: &f64| axis.values.iter().all(|v| v <= x) || axis.values.iter().all(|v| v >= x);
            axis.values.len() > 1 && beyond(value)
        };
        let mut pairs = self.axes.iter().zip(&self.chosen()?.values);
        pairs.find(ends).map(|(axis, value)| (axis, *value))
    }

    /// True for rows that differ from the knee in the first key at most.
    fn beside_knee(&self, row: &Row) -> bool {
        let others = |row: &Row| row.values.get(1..).map(<[f64]>::to_vec);
        self.chosen().is_none_or(|knee| others(knee) == others(row))
    }

    /// (first key's value, figure) of some rows, in the order of the values.
    fn points(&self, measure: usize, of: impl Fn(&Row) -> bool) -> Vec<(f64, f64)> {
        let rows = self.rows.iter().filter(|row| of(row));
        let point = |row: &Row| {
            Some((
                *row.values.first()?,
                row.figure(measure).unwrap_or(f64::NAN),
            ))
        };
        let mut points: Vec<(f64, f64)> = rows.filter_map(point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// True where no value gave an estimate; the command's exit code is then 1.
    pub fn is_empty_handed(&self) -> bool {
        self.knee.is_none()
    }

    /// The refusal that says so, with the reason of the first row.
    pub fn refusal(&self) -> Error {
        let reason = self.rows.iter().find_map(|row| row.failure.clone());
        Error::refused(format!(
            "no value of {} gives an estimate: {}",
            self.axes
                .iter()
                .map(|a| a.key.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            reason.unwrap_or_else(|| "there is no error to judge by".to_owned())
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sweep of one key with these first figures.
    fn swept(figures: &[(f64, Option<f64>)]) -> Sweep {
        let row = |&(value, figure): &(f64, Option<f64>)| {
            let mut row = Row::empty(&[value], 1);
            row.set(measures::OBJECTIVE, figure);
            row
        };
        let rows: Vec<Row> = figures.iter().map(row).collect();
        Sweep {
            plant: String::new(),
            log: None,
            axes: vec![],
            measures: measures::of_log(false),
            objective: measures::OBJECTIVE,
            knee: least(&rows, measures::OBJECTIVE),
            rows,
            time_unit: None,
            declared: Account::default(),
            notes: vec![],
        }
    }

    #[test]
    fn nothing_within_the_good_range_is_worse() {
        let good = |figures: &[f64]| {
            let rows = figures.iter().enumerate();
            let rows: Vec<_> = rows
                .map(|(i, x)| (i as f64, Some(*x).filter(|x| !x.is_nan())))
                .collect();
            swept(&rows).good()
        };
        assert_eq!(good(&[9.0, 1.09, 1.0, 1.05, 1.2]), Some(1.0..=3.0));
        // another valley, or a failed run, lies apart
        assert_eq!(good(&[1.05, 2.0, 1.0, 1.05, 1.2]), Some(2.0..=3.0));
        assert_eq!(good(&[1.05, 1.0, f64::NAN, 1.05]), Some(0.0..=1.0));
        assert_eq!(good(&[f64::NAN]), None);
        // values in any order
        let rows = [(4.0, Some(1.0)), (1.0, Some(9.0)), (3.0, Some(1.01))];
        assert_eq!(swept(&rows).good(), Some(3.0..=4.0));
    }
}
