//! Logs out of streams and arrays of Arrow.

use lynkeus::table::{Gathered, Gathering};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use super::ffi::{self, Array, Schema, Stream, View};
use super::kind::Kind;

/// What to do about a column that cannot be read.
pub const HINT: &str = "convert it before, or name another column under [estimate] columns";

/// Where the arrays come from.
enum Source {
    Stream(Stream),
    /// the only one
    Array(Option<Array>),
}

impl Source {
    fn next(&mut self) -> Result<Option<Array>, String> {
        match self {
            Self::Stream(stream) => stream.next(),
            Self::Array(array) => Ok(array.take()),
        }
    }
}

/// What an object gives by `__arrow_c_stream__` or `__arrow_c_array__`.
struct Given {
    source: Source,
    schema: Schema,
}

fn failed(why: String) -> PyErr {
    PyValueError::new_err(format!("the Arrow stream ends with: {why}"))
}

impl Given {
    fn by(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = object.py();
        if let Some(stream) = object.getattr_opt("__arrow_c_stream__")? {
            let mut stream: Stream = ffi::taken(&stream.call0()?)?;
            // the producer may need the interpreter on a thread of its own
            let schema = py.detach(|| stream.schema()).map_err(failed)?;
            let source = Source::Stream(stream);
            return Ok(Self { source, schema });
        }
        let array = object.call_method0("__arrow_c_array__")?;
        let (schema, array): (Bound<'_, PyAny>, Bound<'_, PyAny>) = array.extract()?;
        Ok(Self {
            schema: ffi::taken(&schema)?,
            source: Source::Array(Some(ffi::taken(&array)?)),
        })
    }
}

/// The columns of a table.
///
/// # Errors
/// It is no table, or its producer fails.
pub fn table(object: &Bound<'_, PyAny>, log: &Gathering) -> PyResult<Vec<Gathered>> {
    let given = Given::by(object)?;
    if given.schema.format() != "+s" {
        let kind = object.get_type();
        return Err(PyTypeError::new_err(format!(
            "expected a table with named columns, found a single column ({kind})"
        )));
    }
    let fields = given.schema.children().map(|f| Field::of(f, f.name()));
    let fields = fields.collect();
    gathered(object.py(), given.source, fields, true, log)
}

/// A column by this header.
///
/// # Errors
/// As [`table`].
pub fn column(object: &Bound<'_, PyAny>, name: &str, log: &Gathering) -> PyResult<Gathered> {
    let given = Given::by(object)?;
    let fields = vec![Field::of(&given.schema, name)];
    let mut columns = gathered(object.py(), given.source, fields, false, log)?;
    // one field, one column
    columns.pop().ok_or_else(|| failed("no column".into()))
}

/// A column by its header and what it holds.
struct Field {
    name: String,
    kind: Result<Kind, &'static str>,
}

impl Field {
    fn of(schema: &Schema, name: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind: Kind::of(schema),
        }
    }

    fn begun(&self, log: &Gathering) -> Gathered {
        match self.kind {
            Ok(_) => log.column(&self.name),
            Err(found) => log.refused(
                &self.name,
                &format!("expected numbers or instants, found {found}"),
                HINT,
            ),
        }
    }
}

/// An array of the stream: a table, or a single column.
struct Batch {
    view: View,
    is_table: bool,
}

impl Batch {
    fn of(array: Array, is_table: bool) -> Result<Self, String> {
        let view = View::of(array)?;
        Ok(Self { view, is_table })
    }

    fn column(&self, place: usize) -> Result<View, String> {
        match self.is_table {
            true => self.view.child(place),
            false => Ok(self.view.clone()),
        }
    }

    /// The column as it lies there, where it is numbers in every row. Nobody may change it from then
    /// on, which is Arrow's contract.
    fn lent(&self, place: usize, field: &Field, log: &Gathering) -> Option<Gathered> {
        let view = self.column(place).ok()?;
        let is_whole = view.validity().is_none() && !(self.is_table && self.has_gaps());
        let numbers = (field.kind == Ok(Kind::Float(8)) && is_whole).then(|| view.lent())??;
        Some(log.lent(&field.name, std::sync::Arc::new(numbers)))
    }

    fn has_gaps(&self) -> bool {
        self.view.validity().is_some()
    }

    fn read(&self, place: usize, field: &Field, to: &mut Gathered) -> Result<(), String> {
        let Ok(kind) = field.kind else {
            return Ok(());
        };
        let parent = self.view.validity().filter(|_| self.is_table);
        kind.read(&self.column(place)?, parent, to)
    }
}

/// Everything that the stream gives; a single array stays where it is.
fn gathered(
    py: Python<'_>,
    mut source: Source,
    fields: Vec<Field>,
    is_table: bool,
    log: &Gathering,
) -> PyResult<Vec<Gathered>> {
    let mut next = || loop {
        py.check_signals()?;
        let array = py.detach(|| source.next()).map_err(failed)?;
        let batch = array.map(|array| Batch::of(array, is_table)).transpose();
        match batch.map_err(failed)? {
            Some(batch) if batch.view.rows() == 0 => {}
            batch => return Ok::<_, PyErr>(batch),
        }
    };
    let numbered = || fields.iter().enumerate();
    let (first, mut second) = (next()?, None);
    if first.is_some() {
        second = next()?;
    }
    let begun = |(place, field): (usize, &Field)| match (&first, &second) {
        (Some(only), None) => match only.lent(place, field, log) {
            Some(lent) => Ok(lent),
            None => {
                let mut column = field.begun(log);
                only.read(place, field, &mut column).map(|()| column)
            }
        },
        _ => Ok(field.begun(log)),
    };
    let columns = py.detach(|| numbered().map(begun).collect::<Result<Vec<_>, _>>());
    let mut columns = columns.map_err(failed)?;
    let mut now = first.filter(|_| second.is_some());
    while let Some(batch) = now {
        let read = py.detach(|| {
            let mut pairs = numbered().zip(&mut columns);
            pairs.try_for_each(|((place, field), to)| batch.read(place, field, to))
        });
        read.map_err(failed)?;
        now = match second.take() {
            Some(batch) => Some(batch),
            None => next()?,
        };
    }
    Ok(columns)
}
