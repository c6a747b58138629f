//! Logs: tables from files, and from columns that Python holds.

use std::borrow::Cow;
use std::path::PathBuf;

use lynkeus::table::{Cell, Gathered, Gathering, Instant};
use lynkeus::{Error, Study, Table};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::arrow::import;
use crate::away::{Terms, away};
use crate::errors::{exception, text, unexpected, wrong};

/// What messages call a log that is no file.
const NAME: &str = "log";

/// A table of named columns of equal length.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Log {
    pub table: Table,
}

/// A log that is held, or a file that is read within the limits of the call.
#[derive(FromPyObject)]
pub enum Given {
    Held(Py<Log>),
    File(PathBuf),
}

impl Given {
    /// The table, of a file what the study asks for.
    pub fn table(&self, study: &Study) -> Result<Cow<'_, Table>, Error> {
        match self {
            Self::Held(log) => Ok(Cow::Borrowed(&log.get().table)),
            Self::File(path) => lynkeus::log(study, path).map(Cow::Owned),
        }
    }
}

/// A column that Python holds.
#[derive(FromPyObject)]
enum Column<'py> {
    Numbers(PyReadonlyArray1<'py, f64>),
    /// counts of so many nanoseconds since 1970, the least of all where one is missing; in UTC,
    /// or in no zone
    Instants(PyReadonlyArray1<'py, i64>, i64, bool),
    /// what each row holds (see [`cell`]), its number and its nanoseconds since 1970
    Cells(
        PyReadonlyArray1<'py, u8>,
        PyReadonlyArray1<'py, f64>,
        PyReadonlyArray1<'py, i64>,
    ),
    /// seconds since an instant
    Since(PyReadonlyArray1<'py, f64>, String),
    /// why it can be no column
    Refused(String),
    /// has `__arrow_c_stream__` or `__arrow_c_array__`
    Arrow(Bound<'py, PyAny>),
}

impl Column<'_> {
    fn gathered(&self, name: &str, log: &Gathering) -> PyResult<Gathered> {
        match self {
            Self::Numbers(values) => Ok(log.owned(name, numbers(values))),
            Self::Since(values, origin) => log
                .since(name, numbers(values), origin)
                .map_err(|error| exception(&error)),
            Self::Instants(counts, unit, zoned) => {
                let mut column = log.column(name);
                let counts = counts.as_array();
                column.instants(counts.iter().map(|&count| {
                    let nanoseconds = i128::from(count) * i128::from(*unit);
                    (count != i64::MIN).then(|| Instant::at(nanoseconds, *zoned))
                }));
                Ok(column)
            }
            Self::Cells(kinds, numbers, instants) => {
                let mut column = log.column(name);
                let (kinds, numbers) = (kinds.as_array(), numbers.as_array());
                let parts = kinds.iter().zip(numbers).zip(instants.as_array());
                parts.for_each(|((kind, x), at)| column.cell(cell(*kind, *x, *at)));
                Ok(column)
            }
            Self::Refused(why) => Ok(log.refused(name, why, import::HINT)),
            Self::Arrow(object) => import::column(object, name, log),
        }
    }
}

fn numbers(values: &PyReadonlyArray1<'_, f64>) -> Vec<f64> {
    match values.as_slice() {
        Ok(values) => values.to_vec(),
        Err(_) => values.as_array().to_vec(),
    }
}

/// What a row holds: 1 a number, 2 an instant in no zone, 3 one in UTC, else nothing.
fn cell(kind: u8, number: f64, nanoseconds: i64) -> Cell {
    match kind {
        1 => Cell::Number(number),
        2 | 3 => Cell::Instant(Instant::at(nanoseconds.into(), kind == 3)),
        _ => Cell::Missing,
    }
}

impl Log {
    fn of(py: Python<'_>, log: &Gathering, columns: Vec<Gathered>) -> PyResult<Self> {
        let table = py.detach(|| log.table(columns));
        let table = table.map_err(|e| exception(&e))?;
        Ok(Self { table })
    }
}

impl Log {
    /// A file as a study says that it is written, all of its columns.
    pub fn whole(py: Python<'_>, study: &Study, path: &Bound<'_, PyAny>) -> PyResult<Self> {
        let file = path.extract::<PathBuf>();
        let path = file.map_err(|error| wrong("path", "a path", path, error))?;
        let study = study.clone();
        let table = away(py, &Terms::default(), |budget, _| {
            lynkeus::whole_log(&Study { budget, ..study }, &path)
        })?;
        Ok(Self { table })
    }
}

#[pymethods]
impl Log {
    /// A CSV or Parquet file.
    #[staticmethod]
    fn load(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::whole(py, &Study::default(), path)
    }

    /// Columns in the forms that `_logs.py` gives them.
    #[staticmethod]
    fn from_columns(py: Python<'_>, columns: &Bound<'_, PyAny>) -> PyResult<Self> {
        let named = columns.extract::<Vec<(String, Column<'_>)>>();
        let columns = named.map_err(|error| {
            let expected = "pairs of a name and a column";
            wrong("columns", expected, columns, error)
        })?;
        let log = Gathering::new(NAME);
        let columns = columns.iter();
        let gathered = columns.map(|(name, column)| column.gathered(name, &log));
        let gathered = gathered.collect::<PyResult<_>>()?;
        Self::of(py, &log, gathered)
    }

    /// Anything with `__arrow_c_stream__` or `__arrow_c_array__` that is a table. A single array of it
    /// is read where it lies, as long as the log lives.
    #[staticmethod]
    fn from_arrow(py: Python<'_>, table: &Bound<'_, PyAny>) -> PyResult<Self> {
        if !table.hasattr("__arrow_c_stream__")? && !table.hasattr("__arrow_c_array__")? {
            let expected = "an object with __arrow_c_stream__ or __arrow_c_array__";
            return Err(unexpected("table", expected, table));
        }
        let log = Gathering::new(NAME);
        let columns = import::table(table, &log)?;
        Self::of(py, &log, columns)
    }

    fn headers(&self) -> Vec<String> {
        self.table.names().map(str::to_owned).collect()
    }

    fn column<'py>(
        &self,
        py: Python<'py>,
        name: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let name = text("name", name)?;
        let values = py.detach(|| self.table.times(&name).map(lynkeus::Series::to_vec));
        Ok(values.map_err(|e| exception(&e))?.into_pyarray(py))
    }

    /// Why a column cannot be read, where that is so.
    fn refusal(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.table.refusal(&text("name", name)?))
    }

    /// A column as it is, NaN where a reading is missing; `None` where it cannot be read.
    fn values<'py>(
        &self,
        py: Python<'py>,
        name: &Bound<'_, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let name = text("name", name)?;
        let values = py.detach(|| self.table.get(&name).map(lynkeus::Series::to_vec));
        Ok(values.map(|values| values.into_pyarray(py)))
    }

    /// What stands for zero in a column of dates and times.
    fn origin(&self, name: &Bound<'_, PyAny>) -> PyResult<Option<&str>> {
        Ok(self.table.origin(&text("name", name)?))
    }

    fn __len__(&self) -> usize {
        self.table.rows()
    }
}
