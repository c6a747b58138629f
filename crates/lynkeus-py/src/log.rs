//! Logs: tables from files, and from columns that Python holds.

use std::path::PathBuf;

use lynkeus::Table;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::errors::exception;

/// A table of named columns of equal length.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Log {
    pub table: Table,
}

#[pymethods]
impl Log {
    /// A CSV or Parquet file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let table = py.detach(|| Table::load(&path));
        let table = table.map_err(|e| exception(&e))?;
        Ok(Self { table })
    }

    /// Columns of numbers; what is not finite is missing.
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        columns: Vec<(String, PyReadonlyArray1<'_, f64>)>,
    ) -> PyResult<Self> {
        let columns = columns.into_iter();
        let columns: Vec<_> = columns
            .map(|(name, values)| (name, values.as_array().iter().copied().collect()))
            .collect();
        let table = py.detach(|| Table::from_columns(columns));
        let table = table.map_err(|e| exception(&e))?;
        Ok(Self { table })
    }

    fn headers(&self) -> Vec<String> {
        self.table.names().map(str::to_owned).collect()
    }

    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = py.detach(|| self.table.readings(name).map(lynkeus::Series::to_vec));
        Ok(values.map_err(|e| exception(&e))?.into_pyarray(py))
    }

    fn __len__(&self) -> usize {
        self.table.rows()
    }
}
