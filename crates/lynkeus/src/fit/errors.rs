//! Errors of predictions at the values found: one step ahead, and of the plant alone.

use lynkeus_expr::Budget;

use super::logs::FittedLog;
use super::problem::{Problem, Rows as Which};
use crate::Error;
use lynkeus_experiment::judge::contradicted;
use lynkeus_experiment::tune::whiteness::{Whiteness, whiteness};
use lynkeus_experiment::{Doubt, DoubtLevel};

/// How well the readings of a sensor are predicted, in root mean square over all logs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Errors {
    pub output: String,
    pub fitted: Portion,
    /// over the rows that were held out
    pub held_out: Option<Portion>,
    /// of the innovations over their deviations, where they were fitted
    pub whiteness: Option<Whiteness>,
}

/// Ljung and Box's statistic over its lags above which nobody takes errors for white ones.
const COLOURED: f64 = 3.0;

impl Errors {
    /// Whether they can be foretold from those before.
    pub fn are_coloured(&self) -> bool {
        self.whiteness.is_some_and(|w| w.ljung_box > COLOURED)
    }
}

/// Over some of the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Portion {
    pub readings: usize,
    /// by what is fitted: of the innovations
    pub one_step: Option<f64>,
    /// the mean of the squared innovations over their variances: 1 where these are right
    pub squares: Option<f64>,
    /// of the plant alone, from its start without corrections
    pub free_run: Option<f64>,
}

/// The innovations of every reading.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    /// number of the log, and time
    pub at: Vec<(usize, f64)>,
    /// by output
    pub columns: Vec<Innovations>,
}

/// Of one output, row by row; no number where it did not report, or showed an end of its range.
#[derive(Clone, Debug, Default)]
pub(crate) struct Innovations {
    pub output: String,
    /// reading − prediction
    pub innovation: Vec<f64>,
    pub deviation: Vec<f64>,
    /// reading − what the plant alone does
    pub free_run: Vec<f64>,
}

impl Rows {
    /// What the readings that were fitted say against the values, as `estimate` judges a filter: of each output what
    /// weighs most in any of the logs, and no more than a note nowhere.
    pub fn doubts(&self, logs: &[FittedLog]) -> Vec<Doubt> {
        let own = |column: &Innovations| {
            let mut heaviest: Option<Doubt> = None;
            let mut first = 0;
            for (log, place) in logs.iter().zip(1..) {
                let fitted = first..first + log.fitted;
                first += log.time.len();
                let readings = fitted.map(|row| {
                    let z = column.innovation[row] / column.deviation[row];
                    (self.at[row].1, z)
                });
                let found = contradicted(&column.output, readings);
                let heavier = |d: &Doubt| heaviest.as_ref().is_none_or(|h| d.level > h.level);
                let Some(mut doubt) = found.filter(heavier) else {
                    continue;
                };
                if logs.len() > 1 {
                    doubt.text += &format!(" (log {place})");
                }
                heaviest = Some(doubt);
            }
            heaviest.filter(|doubt| doubt.level > DoubtLevel::Note)
        };
        let mut doubts: Vec<Doubt> = self.columns.iter().filter_map(own).collect();
        doubts.sort_by_key(|doubt| std::cmp::Reverse(doubt.level));
        doubts
    }
}

#[derive(Clone, Copy, Default)]
struct Sum {
    count: usize,
    squares: f64,
    scaled: f64,
}

impl Sum {
    fn add(&mut self, innovation: f64, variance: f64) {
        if variance == 0.0 {
            // it does not count, either
            return;
        }
        self.count += 1;
        self.squares += innovation * innovation;
        self.scaled += innovation * innovation / variance;
    }

    fn mean(&self, sum: f64) -> Option<f64> {
        let mean = sum / self.count as f64;
        mean.is_finite().then_some(mean)
    }
}

/// Runs all logs once more; `alone` is the same problem of the plant alone, where that means something.
///
/// # Errors
/// As [`Problem::at`].
pub(super) fn errors<'p>(
    problem: &mut Problem<'p>,
    alone: Option<&mut Problem<'p>>,
    outputs: &[String],
    values: &[f64],
) -> Result<(Vec<Errors>, Rows), Error> {
    let logs = problem.logs;
    let times = logs.iter().enumerate();
    let at: Vec<(usize, f64)> = times
        .flat_map(|(place, log)| log.time.iter().map(move |t| (place + 1, *t)))
        .collect();
    let column = || vec![f64::NAN; at.len()];
    let columns = outputs.iter().map(|output| Innovations {
        output: output.clone(),
        innovation: column(),
        deviation: column(),
        free_run: column(),
    });
    let mut rows = Rows {
        columns: columns.collect(),
        at,
    };
    let count = outputs.len();
    // by output: fitted and held out, of what is fitted and of the plant alone
    let mut sums = vec![[[Sum::default(); 2]; 2]; count];
    let mut scaled: Vec<Vec<f64>> = vec![vec![]; count];
    for (way, problem) in [Some(problem), alone].into_iter().enumerate() {
        let Some(problem) = problem else { continue };
        let mut first = 0;
        for (place, log) in logs.iter().enumerate() {
            // half a table is none
            problem.score(place, values, Which::All, &Budget::default(), |seen| {
                // of a reading at an end nobody knows how far it is off
                if seen.is_at_end {
                    return;
                }
                let is_held_out = usize::from(seen.row >= log.fitted);
                sums[seen.sensor][way][is_held_out].add(seen.innovation, seen.variance);
                let columns = &mut rows.columns[seen.sensor];
                let at = first + seen.row;
                if way == 1 {
                    columns.free_run[at] = seen.innovation;
                    return;
                }
                columns.innovation[at] = seen.innovation;
                columns.deviation[at] = seen.variance.sqrt();
                if is_held_out == 0 && seen.variance > 0.0 {
                    scaled[seen.sensor].push(seen.innovation / seen.variance.sqrt());
                }
            })?;
            first += log.time.len();
        }
    }
    let found = outputs.iter().enumerate().map(|(sensor, output)| {
        let portion = |k: usize| {
            let [own, alone] = [0, 1].map(|way| sums[sensor][way][k]);
            let root = |sum: Sum| sum.mean(sum.squares).map(f64::sqrt);
            Portion {
                readings: own.count,
                one_step: root(own),
                squares: own.mean(own.scaled),
                free_run: root(alone),
            }
        };
        let held_out = portion(1);
        Errors {
            output: output.clone(),
            fitted: portion(0),
            held_out: (held_out.readings > 0).then_some(held_out),
            whiteness: whiteness(&scaled[sensor]),
        }
    });
    Ok((found.collect(), rows))
}
