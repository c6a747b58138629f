//! What commands answer: a text, a JSON object, columns and a picture.

use std::sync::{Mutex, OnceLock};

use lynkeus::study::Name;
use lynkeus::{
    CertifyReport, Comparison, DesignReport, Error, Outcome, Series, Study,
    monte_carlo::MonteCarlo, precision, tune::Sweep, visible,
};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use serde_json::Value;

use crate::arrow::export;
use crate::errors::exception;

/// What an answer tells.
pub trait Told: Send {
    /// In words, as the command prints it.
    fn text(&self) -> String;
    /// As the command's `--json`.
    fn json(&self) -> Value;
    /// Its columns under their headers.
    fn columns(&self) -> Vec<(String, Series)> {
        vec![]
    }
    /// Its picture, where it has one.
    fn svg(&self) -> Result<Option<String>, Error> {
        Ok(None)
    }
    /// What speaks against it although it is there.
    fn refusal(&self) -> Option<Error> {
        None
    }
    /// What of a log contradicts itself, or counts nowhere.
    fn warnings(&self) -> Vec<String> {
        vec![]
    }
    /// Root mean square errors over the last half of the rows, of what is estimated.
    fn settled(&self) -> Vec<(String, f64)> {
        vec![]
    }
    /// What a logger would have seen.
    fn log(&self) -> Result<Vec<(String, Vec<f64>)>, Error> {
        Ok(vec![])
    }
}

/// An answer of a command.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Answer {
    /// a graph in it may be used by one thread at a time
    told: Mutex<Box<dyn Told>>,
    /// made when first asked for
    columns: OnceLock<Vec<(String, Series)>>,
}

impl Answer {
    pub fn of(told: impl Told + 'static) -> Self {
        Self {
            told: Mutex::new(Box::new(told)),
            columns: OnceLock::new(),
        }
    }

    fn columns(&self, py: Python<'_>) -> &[(String, Series)] {
        match self.columns.get() {
            Some(known) => known,
            None => {
                let made = self.ask(py, |told| told.columns());
                self.columns.get_or_init(|| made)
            }
        }
    }

    fn ask<T: Send>(&self, py: Python<'_>, question: impl FnOnce(&dyn Told) -> T + Send) -> T {
        py.detach(|| {
            let told = self.told.lock().unwrap_or_else(|e| e.into_inner());
            question(told.as_ref())
        })
    }
}

/// A column under its header.
type Named<'py> = (String, Bound<'py, PyArray1<f64>>);

#[pymethods]
impl Answer {
    fn text(&self, py: Python<'_>) -> String {
        self.ask(py, |told| visible::lines(&told.text()).into_owned())
    }

    fn json(&self, py: Python<'_>) -> String {
        self.ask(py, |told| told.json().to_string())
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

    fn svg(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.ask(py, |told| told.svg()).map_err(|e| exception(&e))
    }

    /// The exception that speaks against it, to be raised or told.
    fn refusal(&self, py: Python<'_>) -> Option<PyErr> {
        self.ask(py, |told| told.refusal()).map(|e| exception(&e))
    }

    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        self.ask(py, |told| told.warnings())
    }

    /// By name; none where one is no number.
    fn settled(&self, py: Python<'_>) -> Vec<(String, Option<f64>)> {
        let errors = self.ask(py, |told| told.settled()).into_iter();
        errors
            .map(|(name, error)| (name, Some(error).filter(|x| x.is_finite())))
            .collect()
    }

    fn log<'py>(&self, py: Python<'py>) -> PyResult<Vec<Named<'py>>> {
        let columns = self.ask(py, |told| told.log()).map_err(|e| exception(&e))?;
        let columns = columns.into_iter();
        Ok(columns
            .map(|(name, x)| (name, x.into_pyarray(py)))
            .collect())
    }
}

/// A run with what of its study tables and pictures need.
pub struct Ran {
    pub outcome: Outcome,
    pub study: Study,
    /// its true states are known
    pub is_simulated: bool,
}

impl Told for Ran {
    fn text(&self) -> String {
        let rows = self.outcome.time.len();
        let Outcome { plant, design, .. } = &self.outcome;
        let credible = match self.outcome.refusal() {
            None => "credible".to_owned(),
            Some(refusal) => format!("not credible: {refusal}"),
        };
        let family = design.examination.family;
        format!("{plant}: {family} observer, {rows} rows; {credible}")
    }

    fn json(&self) -> Value {
        self.outcome.to_json(self.is_simulated)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let columns = self.outcome.columns(self.is_simulated).into_iter();
        columns.map(|(name, x)| (name, x.clone())).collect()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        let (unit, show) = drawn(&self.study);
        lynkeus::figure(&self.outcome, unit, show)?
            .to_svg()
            .map(Some)
    }

    fn refusal(&self) -> Option<Error> {
        self.outcome.refusal()
    }

    fn warnings(&self) -> Vec<String> {
        self.outcome.warnings.clone()
    }

    fn settled(&self) -> Vec<(String, f64)> {
        let estimated = self.outcome.quantities.iter();
        let estimated = estimated.filter(|q| q.estimate.is_some());
        let errors = estimated.filter_map(|q| Some((q.name.clone(), q.settled_error()?)));
        errors.collect()
    }

    fn log(&self) -> Result<Vec<(String, Vec<f64>)>, Error> {
        let columns = self.outcome.log(&self.study.estimate);
        let columns = columns.map_err(|e| e.at(&self.study.file))?;
        let columns = columns.into_iter();
        Ok(columns.map(|(name, x)| (name, x.to_vec())).collect())
    }
}

/// What a study says of pictures.
fn drawn(study: &Study) -> (Option<&str>, Option<&[Name]>) {
    (study.time_unit.as_deref(), study.show.as_deref())
}

/// Something of a study, whose pictures need it.
pub struct Of<T> {
    pub found: T,
    pub study: Study,
}

impl Told for Of<MonteCarlo> {
    fn text(&self) -> String {
        self.found.to_string()
    }

    fn json(&self) -> Value {
        self.found.to_json()
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let columns = self.found.columns().into_iter();
        columns.map(|(name, x)| (name, x.to_vec().into())).collect()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        let (unit, show) = drawn(&self.study);
        self.found.figure(unit, show)?.to_svg().map(Some)
    }

    fn refusal(&self) -> Option<Error> {
        self.found.refusal()
    }
}

impl Told for Of<Comparison> {
    fn text(&self) -> String {
        self.found.to_string()
    }

    fn json(&self) -> Value {
        self.found.to_json()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        let picture = self.found.picture(self.study.time_unit.as_deref());
        picture.to_svg().map(Some)
    }

    fn warnings(&self) -> Vec<String> {
        self.found.warnings().to_vec()
    }
}

/// A column in which NaN stands where there is no value.
fn whole(values: impl Iterator<Item = Option<f64>>) -> Series {
    let values = values.map(|x| x.unwrap_or(f64::NAN));
    values.collect::<Vec<f64>>().into()
}

impl Told for Sweep {
    fn text(&self) -> String {
        self.to_string()
    }

    fn json(&self) -> Value {
        self.to_json()
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let keys = self.axes.iter().enumerate().map(|(place, axis)| {
            let values = self.rows.iter().map(|row| row.values.get(place).copied());
            (axis.key.clone(), whole(values))
        });
        let measures = self.measures.iter().enumerate();
        let figures = measures.map(|(place, measure)| {
            let values = self.rows.iter().map(|row| *row.figures.get(place)?);
            (measure.name.to_owned(), whole(values))
        });
        keys.chain(figures).collect()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        self.to_svg().map(Some)
    }
}

impl Told for precision::Report {
    fn text(&self) -> String {
        self.to_string()
    }

    fn json(&self) -> Value {
        self.to_json()
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let columns = Self::columns(self).into_iter();
        columns.map(|(name, x)| (name, x.into())).collect()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        self.to_svg().map(Some)
    }
}

impl Told for lynkeus::Report {
    fn text(&self) -> String {
        self.to_string()
    }

    fn json(&self) -> Value {
        self.to_json()
    }

    fn svg(&self) -> Result<Option<String>, Error> {
        match &self.uniform {
            Some(_) => self.picture()?.to_svg().map(Some),
            None => Ok(None),
        }
    }
}

impl Told for DesignReport {
    fn text(&self) -> String {
        self.to_string()
    }

    fn json(&self) -> Value {
        self.to_json()
    }
}

impl Told for CertifyReport {
    fn text(&self) -> String {
        self.to_string()
    }

    fn json(&self) -> Value {
        self.to_json()
    }
}
