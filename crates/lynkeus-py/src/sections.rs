//! A study's text as dictionaries: Python's own reader knows an older TOML than the engine's.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyInt, PyList};
use toml::de::{DeTable, DeValue};

use crate::errors::exception;

/// Keys and sections in the order in which they are written.
///
/// # Errors
/// The text is no TOML.
pub fn of<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyDict>> {
    let parsed = DeTable::parse(text);
    let parsed = parsed.map_err(|error| exception(&lynkeus::explain(error)))?;
    table(py, parsed.get_ref())
}

fn table<'py>(py: Python<'py>, table: &DeTable<'_>) -> PyResult<Bound<'py, PyDict>> {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    let found = PyDict::new(py);
    for (key, entry) in entries {
        found.set_item(key.get_ref().as_ref(), value(py, entry.get_ref())?)?;
    }
    Ok(found)
}

fn value<'py>(py: Python<'py>, value: &DeValue<'_>) -> PyResult<Bound<'py, PyAny>> {
    match value {
        DeValue::String(text) => Ok(text.as_ref().into_pyobject(py)?.into_any()),
        DeValue::Integer(x) => py.get_type::<PyInt>().call1((x.as_str(), x.radix())),
        DeValue::Float(x) => py.get_type::<PyFloat>().call1((x.as_str(),)),
        DeValue::Boolean(flag) => Ok(flag.into_pyobject(py)?.to_owned().into_any()),
        // no study has one
        DeValue::Datetime(date) => Ok(date.to_string().into_pyobject(py)?.into_any()),
        DeValue::Array(items) => {
            let items = items.iter().map(|item| self::value(py, item.get_ref()));
            let items = items.collect::<PyResult<Vec<_>>>()?;
            Ok(PyList::new(py, items)?.into_any())
        }
        DeValue::Table(inner) => Ok(table(py, inner)?.into_any()),
    }
}
