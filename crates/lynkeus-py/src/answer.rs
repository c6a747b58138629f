//! What commands answer: a text, a JSON object, columns and a picture.

use std::sync::{Mutex, OnceLock};

use lynkeus::plot::Figure;
use lynkeus::study::Name;
use lynkeus::table::Instant;
use lynkeus::{
    CertifyReport, Comparison, Corrections, DesignReport, Error, Outcome, Series, Study,
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
    /// The panels of its picture, where that is one over time.
    fn figure(&self) -> Result<Option<Figure>, Error> {
        Ok(None)
    }
    /// What a filter's corrections are made of, where it was kept.
    fn corrections(&self) -> Option<&Corrections> {
        None
    }
    /// What stands for zero where its times are dates.
    fn origin(&self) -> Option<Instant> {
        None
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

    /// The label of the time axis, and name and caption of each panel of the picture, from the top; none where
    /// the picture is not one over time.
    #[allow(clippy::type_complexity, reason = "a pair of lists for Python")]
    fn panels(&self, py: Python<'_>) -> PyResult<Option<(String, Vec<(String, String)>)>> {
        let figure = self.ask(py, |told| told.figure());
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
        let kept = self.ask(py, |told| told.corrections().map(entries));
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
    fn origin(&self, py: Python<'_>) -> Option<(i64, bool)> {
        let origin = self.ask(py, |told| told.origin())?;
        let nanoseconds = i64::try_from(origin.nanoseconds()).ok()?;
        Some((nanoseconds, origin.is_zoned()))
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
        self.figure()?.map(|figure| figure.to_svg()).transpose()
    }

    fn figure(&self) -> Result<Option<Figure>, Error> {
        let (unit, show) = drawn(&self.study);
        lynkeus::figure(&self.outcome, unit, show).map(Some)
    }

    fn corrections(&self) -> Option<&Corrections> {
        self.outcome.corrections.as_ref()
    }

    fn origin(&self) -> Option<Instant> {
        self.outcome.origin
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
        self.figure()?.map(|figure| figure.to_svg()).transpose()
    }

    fn figure(&self) -> Result<Option<Figure>, Error> {
        let (unit, show) = drawn(&self.study);
        self.found.figure(unit, show).map(Some)
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
