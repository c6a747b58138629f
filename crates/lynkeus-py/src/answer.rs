//! Answers of the library as objects of Python.

use std::sync::{Mutex, OnceLock};

use lynkeus::{Corrections, Error, Origin, Series};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::arrow::export;
use crate::errors::exception;

/// An answer of a command.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Answer {
    /// a graph in it may be used by one thread at a time
    found: Mutex<Box<dyn lynkeus::Answer>>,
    /// made when first asked for
    columns: OnceLock<Vec<(String, Series)>>,
}

impl Answer {
    pub fn of(found: impl lynkeus::Answer + 'static) -> Self {
        Self {
            found: Mutex::new(Box::new(found)),
            columns: OnceLock::new(),
        }
    }

    fn columns(&self, py: Python<'_>) -> &[(String, Series)] {
        match self.columns.get() {
            Some(known) => known,
            None => {
                let made = self.ask(py, |found| found.columns());
                self.columns.get_or_init(|| made)
            }
        }
    }

    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        question: impl FnOnce(&dyn lynkeus::Answer) -> T + Send,
    ) -> T {
        py.detach(|| {
            let found = self.found.lock().unwrap_or_else(|e| e.into_inner());
            question(found.as_ref())
        })
    }
}

/// A column under its header.
type Named<'py> = (String, Bound<'py, PyArray1<f64>>);
/// Names of sensors, names of states, and arrays.
type Kept<'py> = (Vec<String>, Vec<String>, Vec<Named<'py>>);

/// Names of sensors, names of states, and numbers by what they are.
type Entries = (
    Vec<String>,
    Vec<String>,
    Vec<(&'static str, Result<Vec<f64>, Error>)>,
);

/// What a filter's corrections are made of, each part row after row.
fn entries(kept: &Corrections) -> Entries {
    let likelihood = std::slice::from_ref(&kept.log_likelihood);
    let parts: [(&str, &[Series]); 6] = [
        ("predicted", &kept.predicted),
        ("innovation", &kept.innovation),
        ("innovation_covariance", &kept.innovation_covariance),
        ("log_likelihood", likelihood),
        ("gain", &kept.gain),
        ("covariance", &kept.covariance),
    ];
    let parts = parts.map(|(name, columns)| (name, by_row(columns)));
    (kept.sensors.clone(), kept.states.clone(), parts.into())
}

/// The numbers of columns, row after row.
fn by_row(columns: &[Series]) -> Result<Vec<f64>, Error> {
    let rows = columns.first().map_or(0, Series::len);
    let mut cells: Vec<_> = columns.iter().map(Series::iter).collect();
    let mut values = Vec::with_capacity(rows * columns.len());
    for _ in 0..rows {
        values.extend(cells.iter_mut().filter_map(Iterator::next));
    }
    columns.iter().try_for_each(Series::check)?;
    Ok(values)
}

#[pymethods]
impl Answer {
    fn text(&self, py: Python<'_>) -> String {
        self.ask(py, |found| found.text())
    }

    /// Words and tables for a notebook, without the picture.
    fn html(&self, py: Python<'_>) -> String {
        self.ask(py, |found| found.html())
    }

    fn json(&self, py: Python<'_>) -> String {
        self.ask(py, |found| found.to_json().to_string())
    }

    fn headers(&self, py: Python<'_>) -> Vec<String> {
        let headers = self.columns(py).iter().map(|(header, _)| header.clone());
        headers.collect()
    }

    /// The number of rows.
    fn rows(&self, py: Python<'_>) -> usize {
        self.columns(py)
            .first()
            .map_or(0, |(_, column)| column.len())
    }

    fn column<'py>(
        &self,
        py: Python<'py>,
        place: usize,
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let Some((_, column)) = self.columns(py).get(place) else {
            return Ok(None);
        };
        let values = py.detach(|| {
            let values = column.to_vec();
            column.check().map(|()| values)
        });
        let values = values.map_err(|e| exception(&e))?;
        Ok(Some(values.into_pyarray(py)))
    }

    /// The headers for Arrow.
    fn arrow_schema<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        export::schema(py, &self.headers(py))
    }

    /// The columns for Arrow, read as they are asked for.
    fn arrow_stream<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        export::stream(py, self.columns(py).to_vec())
    }

    /// The label of the time axis, and name and caption of each panel of the picture, from the top; none where
    /// the picture is not one over time.
    #[allow(clippy::type_complexity, reason = "a pair of lists for Python")]
    fn panels(&self, py: Python<'_>) -> PyResult<Option<(String, Vec<(String, String)>)>> {
        let figure = self.ask(py, |found| found.panels());
        let figure = figure.map_err(|e| exception(&e))?;
        Ok(figure.map(|figure| {
            let panels = figure.panels.into_iter();
            let captions = panels.map(|panel| (panel.name, panel.caption)).collect();
            (figure.label, captions)
        }))
    }

    /// Names of sensors and states, and by name the entries of what a filter's corrections are made of, row
    /// after row; none where nothing was kept.
    fn corrections<'py>(&self, py: Python<'py>) -> PyResult<Option<Kept<'py>>> {
        let kept = self.ask(py, |found| found.corrections().map(entries));
        let Some((sensors, states, parts)) = kept else {
            return Ok(None);
        };
        let parts = parts.into_iter().map(|(name, values)| {
            let values = values.map_err(|e| exception(&e))?;
            Ok((name.to_owned(), values.into_pyarray(py)))
        });
        Ok(Some((sensors, states, parts.collect::<PyResult<_>>()?)))
    }

    /// What stands for zero where times are dates: nanoseconds since 1970, and whether that is UTC.
    fn origin(&self, py: Python<'_>) -> Option<(i64, bool, f64)> {
        let Origin { instant, unit } = self.ask(py, |found| found.origin())?;
        let nanoseconds = i64::try_from(instant.nanoseconds()).ok()?;
        Some((nanoseconds, instant.is_zoned(), unit))
    }

    fn svg(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.ask(py, |found| found.svg()).map_err(|e| exception(&e))
    }

    /// The exception that speaks against it, to be raised or told.
    fn refusal(&self, py: Python<'_>) -> Option<PyErr> {
        self.ask(py, |found| found.refusal()).map(|e| exception(&e))
    }

    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        self.ask(py, |found| found.warnings().to_vec())
    }

    fn log<'py>(&self, py: Python<'py>) -> PyResult<Vec<Named<'py>>> {
        let columns = self
            .ask(py, |found| found.log())
            .map_err(|e| exception(&e))?;
        let columns = columns.into_iter();
        Ok(columns
            .map(|(name, x)| (name, x.to_vec().into_pyarray(py)))
            .collect())
    }
}
