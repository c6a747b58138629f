//! Errors as exceptions, with the same text and the place as an attribute.

use lynkeus::{Error, ErrorKind, visible};
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
    exception(&Error::from_source(error))
}
