//! Replay of a log through an observer.

use std::ops::ControlFlow;

use crate::{
    Error, Estimator, EstimatorSettings, Interrupted, Role, StepAdvice, System, Trajectory,
};

/// Measured signals over strictly increasing, possibly uneven times.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    names: Vec<String>,
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl Log {
    /// A log from its columns, each as long as `times`. Cells of columns that an
    /// observer does not read may be NaN.
    ///
    /// # Errors
    /// [`Error::NotANumber`] or [`Error::TimeOrder`] for a time that is not finite
    /// or does not increase; [`Error::Setting`] for no rows or columns of
    /// different lengths.
    pub fn new(names: Vec<String>, times: Vec<f64>, columns: Vec<Vec<f64>>) -> Result<Self, Error> {
        if times.is_empty() {
            return Err(Error::setting("rows of the log", "at least 1", 0));
        }
        if names.len() != columns.len() {
            let expected = format!("{}, one per name", names.len());
            return Err(Error::setting(
                "columns of the log",
                expected,
                columns.len(),
            ));
        }
        for (name, column) in names.iter().zip(&columns) {
            if column.len() != times.len() {
                let what = format!("rows of column '{name}'");
                let expected = format!("{}, one per time", times.len());
                return Err(Error::setting(what, expected, column.len()));
            }
        }
        check_times(&times)?;
        Ok(Self {
            names,
            times,
            columns,
        })
    }

    /// Names of the columns, without time.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The times of the rows.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The values of one column, the first of that name.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let place = self.names.iter().position(|n| n == name)?;
        Some(&self.columns[place])
    }

    /// The columns of the observer's signals, in their order.
    fn signals(&self, observer: &System) -> Result<Vec<&[f64]>, Error> {
        let column = |name: &String| {
            let mut named = self.names.iter().filter(|n| *n == name);
            if named.next().is_some() && named.next().is_some() {
                return Err(Error::Ambiguous {
                    reader: "observer",
                    name: name.clone(),
                });
            }
            self.column(name).ok_or_else(|| Error::Unconnected {
                reader: "observer",
                name: name.clone(),
                available: self.names.join(", "),
            })
        };
        observer.signals().iter().map(column).collect()
    }
}

fn check_times(times: &[f64]) -> Result<(), Error> {
    if let Some(i) = times.iter().position(|t| !t.is_finite()) {
        return Err(Error::NotANumber {
            row: i + 1,
            column: "t".to_owned(),
            value: times[i],
        });
    }
    match times.windows(2).position(|w| w[1] <= w[0]) {
        None => Ok(()),
        Some(i) => Err(Error::TimeOrder {
            row: i + 2,
            previous: times[i],
            time: times[i + 1],
        }),
    }
}

/// The result of [`estimate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    /// the estimates at the log's times, columns ([`Role::Estimate`]) as [`System::estimates`]
    pub trajectory: Trajectory,
    /// for fixed steps: the step in use beside the step that the observer needs
    pub advice: Option<StepAdvice>,
}

/// Replays a log through an observer: an [`Estimator`] pushed row by row. The
/// observer's signals are columns of the log, by name; it starts at its start
/// values at the log's first time.
///
/// # Errors
/// With the rows made before: [`Error::Unconnected`] or [`Error::Ambiguous`] for a column
/// that is missing or there twice, [`Error::NotANumber`] for a cell, and those of [`Estimator::push`].
pub fn estimate(
    observer: &System,
    log: &Log,
    settings: EstimatorSettings,
) -> Result<Estimates, Box<Interrupted>> {
    estimate_watched(observer, log, settings, &mut |_| ControlFlow::Continue(()))
}

/// As [`estimate`]; `watch` is told the fraction done after every row and may
/// stop the replay.
///
/// # Errors
/// As [`estimate`], and [`Error::Cancelled`].
pub fn estimate_watched(
    observer: &System,
    log: &Log,
    settings: EstimatorSettings,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Estimates, Box<Interrupted>> {
    let mut result = Estimates {
        trajectory: Trajectory::default().with(Role::Estimate, observer.estimates()),
        advice: None,
    };
    match replay(observer, log, settings, watch, &mut result) {
        Ok(()) => Ok(result),
        Err(error) => Err(Box::new(Interrupted {
            error,
            partial: result.trajectory,
        })),
    }
}

fn replay(
    observer: &System,
    log: &Log,
    settings: EstimatorSettings,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    result: &mut Estimates,
) -> Result<(), Error> {
    let columns = log.signals(observer)?;
    let mut estimator = Estimator::new(observer, settings)?;
    let mut signals = vec![0.0; columns.len()];
    for (k, &t) in log.times.iter().enumerate() {
        for ((signal, column), name) in signals.iter_mut().zip(&columns).zip(observer.signals()) {
            *signal = column[k];
            if !signal.is_finite() {
                return Err(Error::NotANumber {
                    row: k + 1,
                    column: name.clone(),
                    value: *signal,
                });
            }
        }
        let estimates = estimator.push(t, &signals)?;
        result.trajectory.push(t, estimates);
        result.advice = estimator.advice();
        if watch((k + 1) as f64 / log.times.len() as f64).is_break() {
            return Err(Error::Cancelled { time: t });
        }
    }
    Ok(())
}
