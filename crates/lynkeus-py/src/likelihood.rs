//! −log L of logs as a function of what `[fit]` names.

use std::sync::{Mutex, MutexGuard, PoisonError};

use lynkeus::{Error, LikelihoodFunction, LogInnovations, Table};
use numpy::ndarray::{Array1, Array2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::exception;
use crate::log::Log;

/// The function and its logs; threads take turns.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Likelihood {
    function: Mutex<LikelihoodFunction>,
    tables: Vec<Table>,
}

/// −log L, its gradient and Fisher's information.
type Point<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

impl Likelihood {
    pub fn new(function: LikelihoodFunction, tables: Vec<Table>) -> Self {
        Self {
            function: Mutex::new(function),
            tables,
        }
    }

    fn lock(&self) -> MutexGuard<'_, LikelihoodFunction> {
        self.function.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Something of the function, without the interpreter's lock.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        theta: &PyReadonlyArray1<'_, f64>,
        work: impl FnOnce(&mut LikelihoodFunction, &[f64]) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let theta: Vec<f64> = theta.as_array().to_vec();
        let found = py.detach(|| work(&mut self.lock(), &theta));
        found.map_err(|error| exception(&error))
    }
}

#[pymethods]
impl Likelihood {
    #[getter]
    fn plant(&self) -> String {
        self.lock().plant.clone()
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.lock().names()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.lock().outputs.clone()
    }

    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.lock().start().into_pyarray(py)
    }

    /// A row with the least and the largest of each value.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let bounds = self.lock().bounds();
        let bounds = Array2::from_shape_fn((bounds.len(), 2), |(i, end)| match end {
            0 => bounds[i].0,
            _ => bounds[i].1,
        });
        bounds.into_pyarray(py)
    }

    #[getter]
    fn is_log<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.lock().is_log().into_pyarray(py)
    }

    /// By name the mean and the standard deviation of what was known before.
    #[getter]
    fn priors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        let function = self.lock();
        for (name, prior) in function.names().iter().zip(function.priors()) {
            if let Some(prior) = prior {
                found.set_item(name, (prior.mean, prior.sd))?;
            }
        }
        Ok(found)
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.lock().notes.clone()
    }

    fn warnings(&self) -> Vec<String> {
        self.lock().warnings.clone()
    }

    /// What it was made of beside the study.
    fn logs(&self) -> Vec<Log> {
        let tables = self.tables.iter().cloned();
        tables.map(|table| Log { table }).collect()
    }

    fn at<'py>(&self, py: Python<'py>, theta: PyReadonlyArray1<'py, f64>) -> PyResult<Point<'py>> {
        let point = self.ask(py, &theta, LikelihoodFunction::at)?;
        let n = point.gradient.len();
        let gradient = point.gradient.into_pyarray(py);
        Ok((point.nll, gradient, matrix(py, n, n, &point.information)))
    }

    fn hessian<'py>(
        &self,
        py: Python<'py>,
        theta: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.ask(py, &theta, LikelihoodFunction::hessian)?;
        let n = theta.len()?;
        Ok(matrix(py, n, n, &found))
    }

    /// Of each log what `python/lynkeus/likelihood.py` calls its innovations.
    fn innovations<'py>(
        &self,
        py: Python<'py>,
        theta: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let found = self.ask(py, &theta, LikelihoodFunction::innovations)?;
        let outputs = self.lock().outputs.len();
        let each = found.into_iter().map(|log| entries(py, outputs, log));
        each.collect()
    }
}

fn entries<'py>(
    py: Python<'py>,
    outputs: usize,
    found: LogInnovations,
) -> PyResult<Bound<'py, PyDict>> {
    let rows = found.time.len();
    let entries = PyDict::new(py);
    let at_limit = Array2::from_shape_fn((rows, outputs), |(row, output)| {
        found.is_at_end[row * outputs + output]
    });
    entries.set_item("innovation", matrix(py, rows, outputs, &found.innovation))?;
    entries.set_item("variance", matrix(py, rows, outputs, &found.variance))?;
    entries.set_item("at_limit", at_limit.into_pyarray(py))?;
    entries.set_item("t", Array1::from_vec(found.time).into_pyarray(py))?;
    entries.set_item("log", found.log)?;
    entries.set_item("fitted", found.fitted)?;
    Ok(entries)
}

/// Of numbers row by row.
fn matrix<'py>(
    py: Python<'py>,
    rows: usize,
    columns: usize,
    numbers: &[f64],
) -> Bound<'py, PyArray2<f64>> {
    let matrix = Array2::from_shape_fn((rows, columns), |(i, j)| numbers[i * columns + j]);
    matrix.into_pyarray(py)
}
