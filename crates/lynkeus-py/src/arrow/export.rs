//! Results as streams of Arrow.

use lynkeus::Series;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use super::ffi::{self, Batches, Part};

/// Rows that go out at a time: 1 MiB of each column.
const BATCH: usize = 1 << 17;

/// Headers and kinds of a table of numbers.
///
/// # Errors
/// What Python reports.
pub fn schema<'py>(py: Python<'py>, names: &[String]) -> PyResult<Bound<'py, PyCapsule>> {
    ffi::capsule(py, ffi::schema(names))
}

/// The columns, read as they are asked for; a NaN is a null.
///
/// # Errors
/// What Python reports.
pub fn stream(py: Python<'_>, columns: Vec<(String, Series)>) -> PyResult<Bound<'_, PyCapsule>> {
    let (names, columns): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
    let rows = columns.iter().map(Series::len).min().unwrap_or(0);
    let rest = Rest {
        names,
        columns,
        row: 0,
        rows,
    };
    ffi::capsule(py, ffi::stream(Box::new(rest)))
}

/// What is not yet given of a table.
struct Rest {
    names: Vec<String>,
    columns: Vec<Series>,
    row: usize,
    rows: usize,
}

impl Batches for Rest {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn next(&mut self) -> Result<Option<Vec<Part>>, String> {
        if self.row >= self.rows {
            return Ok(None);
        }
        let count = BATCH.min(self.rows - self.row);
        let columns = self.columns.iter();
        let parts = columns.map(|column| Part::of(column.part(self.row, count)));
        let parts = parts.collect();
        for column in &self.columns {
            column.check().map_err(|error| error.to_string())?;
        }
        self.row += count;
        Ok(Some(parts))
    }
}
