//! Errors as exceptions, with the same text and the place as an attribute.

use lynkeus::{Error, ErrorKind, visible};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

/// The exception for an error.
pub fn exception(error: &Error) -> PyErr {
    let class = match error.kind() {
        ErrorKind::Refused => "RefusedError",
        ErrorKind::Ended => "LimitError",
        _ => "InputError",
    };
    let text = visible::lines(&error.to_string()).into_owned();
    let parts = (text, error.message(), error.place(), error.remedy());
    Python::attach(|py| {
        let made = py
            .import("lynkeus.errors")
            .and_then(|errors| errors.getattr(class))
            .and_then(|class| class.call1(parts));
        match made {
            Ok(exception) => PyErr::from_value(exception),
            // the package is incomplete
            Err(error) => error,
        }
    })
}

/// The exception for an error of a floor below.
pub fn from_source(error: impl std::error::Error + Send + Sync + 'static) -> PyErr {
    exception(&lynkeus::explain(error))
}

/// An argument that is not what was expected of it.
pub fn unexpected(argument: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    let made = found
        .py()
        .import("lynkeus.errors")
        .and_then(|errors| errors.getattr("ArgumentError"))
        .and_then(|class| class.call_method1("of", (argument, expected, found)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        // the package is incomplete
        Err(error) => error,
    }
}

/// An argument that cannot be converted; what its own conversion raises is passed on.
pub fn wrong(argument: &str, expected: &str, found: &Bound<'_, PyAny>, error: PyErr) -> PyErr {
    let py = found.py();
    let is_of_kind = error.is_instance_of::<PyTypeError>(py)
        || error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<PyOverflowError>(py);
    if !is_of_kind {
        return error;
    }
    let wrong = unexpected(argument, expected, found);
    wrong.set_cause(py, Some(error));
    wrong
}

/// An argument that is to be a number.
pub fn number(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let number = value.extract();
    number.map_err(|error| wrong(argument, "a number", value, error))
}

/// An argument that is to be a text.
pub fn text(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = value.extract();
    text.map_err(|error| wrong(argument, "a text", value, error))
}
