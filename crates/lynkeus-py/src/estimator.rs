//! Live estimation, sample by sample.

use lynkeus::run::{self, filter::Reading};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString, PyTuple};

use crate::errors::{exception, from_source};

/// A study's estimator; a call is short, so that it keeps the interpreter's lock.
#[pyclass(module = "lynkeus._lynkeus")]
pub struct Estimator {
    estimator: run::Estimator,
    /// the Python study that it is of
    study: Py<PyAny>,
    /// names of the signals, interned
    signals: Vec<Py<PyString>>,
    /// names of what is estimated, interned
    names: Vec<Py<PyString>>,
    /// the signals of a call
    sample: Vec<f64>,
}

impl Estimator {
    pub fn of(py: Python<'_>, estimator: run::Estimator, study: Py<PyAny>) -> Self {
        let interned = |names: &[String]| {
            let names = names.iter();
            names
                .map(|name| PyString::intern(py, name).unbind())
                .collect()
        };
        Self {
            signals: interned(estimator.signals()),
            names: interned(estimator.names()),
            sample: vec![f64::NAN; estimator.signals().len()],
            estimator,
            study,
        }
    }

    /// Puts readings by name in their order; what is left out or None did not report.
    fn read(&mut self, readings: &Bound<'_, PyDict>) -> PyResult<()> {
        let py = readings.py();
        let mut taken = 0;
        for (place, name) in self.signals.iter().enumerate() {
            let found = readings.get_item(name.bind(py))?;
            taken += usize::from(found.is_some());
            self.sample[place] = match found {
                Some(value) if !value.is_none() => value
                    .extract()
                    .map_err(|_| wrong_reading(name.bind(py), &value))?,
                _ => f64::NAN,
            };
        }
        match taken == readings.len() {
            true => Ok(()),
            false => Err(self.stranger(readings)),
        }
    }

    fn by_name<'py>(&self, py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (name, value) in self.names.iter().zip(values) {
            found.set_item(name, value)?;
        }
        Ok(found)
    }

    /// A name that is no signal.
    fn stranger(&self, readings: &Bound<'_, PyDict>) -> PyErr {
        let known = self.estimator.signals();
        let names = readings.keys().into_iter();
        let mut names = names.map(|name| name.to_string());
        let name = names.find(|name| !known.contains(name)).unwrap_or_default();
        let message = format!(
            "no signal is called \"{name}\": expected some of {}",
            known.join(", ")
        );
        exception(&lynkeus::Error::input(message))
    }
}

fn wrong_reading(name: &Bound<'_, PyString>, value: &Bound<'_, PyAny>) -> PyErr {
    let kind = value.get_type();
    PyTypeError::new_err(format!("{name}: expected a number or None, found {kind}"))
}

#[pymethods]
impl Estimator {
    /// Goes to a time at which nothing is read.
    fn predict(&mut self, t: f64) -> PyResult<()> {
        self.estimator.predict(t).map_err(from_source)?;
        Ok(())
    }

    /// Goes to a time and takes what was read there, by name.
    fn update(&mut self, t: f64, readings: &Bound<'_, PyDict>) -> PyResult<()> {
        self.read(readings)?;
        self.estimator.push(t, &self.sample).map_err(from_source)?;
        Ok(())
    }

    /// The same with all signals in their order.
    fn push(&mut self, t: f64, signals: Vec<f64>) -> PyResult<()> {
        self.estimator.push(t, &signals).map_err(from_source)?;
        Ok(())
    }

    #[getter]
    fn signals(&self) -> Vec<String> {
        self.estimator.signals().to_vec()
    }

    /// How many of the signals are sensors; known inputs follow.
    #[getter]
    fn sensors(&self) -> usize {
        self.estimator.sensors()
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.estimator.names().to_vec()
    }

    #[getter]
    fn time(&self) -> Option<f64> {
        self.estimator.time()
    }

    /// What is estimated, by name.
    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_name(py, self.estimator.estimate())
    }

    /// Standard deviations by name, where the observer has them.
    #[getter]
    fn sd<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let deviations = self.estimator.deviations();
        deviations.map(|sd| self.by_name(py, sd)).transpose()
    }

    /// What is estimated, in the order of `names`.
    fn to_numpy<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.estimator.estimate().to_vec().into_pyarray(py)
    }

    /// By sensor what the last reading said beside what the model expected; of a filter.
    #[getter]
    fn innovations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sensors = PyDict::new(py);
        let names = self.signals.iter();
        for (name, innovation) in names.zip(self.estimator.innovations()) {
            let entry = PyDict::new(py);
            entry.set_item("innovation", innovation.value)?;
            entry.set_item("sd", innovation.deviation)?;
            entry.set_item("expected", innovation.predicted)?;
            entry.set_item("reading", word(innovation.reading))?;
            sensors.set_item(name, entry)?;
        }
        Ok(sensors)
    }

    /// Counts by sensor, and of what was held or confined.
    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let health = self.estimator.health();
        let sensors = PyDict::new(py);
        for (name, counts) in self.signals.iter().zip(&health.sensors) {
            let entry = PyDict::new(py);
            entry.set_item("taken", counts.taken)?;
            entry.set_item("missing", counts.missing)?;
            entry.set_item("rejected", counts.rejected)?;
            entry.set_item("at_limit", counts.at_limit)?;
            entry.set_item("locked_out", counts.locked_out)?;
            sensors.set_item(name, entry)?;
        }
        let found = PyDict::new(py);
        found.set_item("sensors", sensors)?;
        found.set_item("inputs_held", health.inputs_held)?;
        found.set_item("confined", health.confined)?;
        Ok(found)
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.estimator.snapshot())
    }

    fn restore(&mut self, snapshot: &[u8]) -> PyResult<()> {
        self.estimator.restore(snapshot).map_err(from_source)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let again = py.import("lynkeus.study")?.getattr("_resumed")?;
        let parts = (self.study.clone_ref(py), self.snapshot(py));
        (again, parts).into_pyobject(py)
    }
}

/// What became of a reading.
fn word(reading: Reading) -> &'static str {
    match reading {
        Reading::Missing => "missing",
        Reading::Taken => "taken",
        Reading::Rejected => "rejected",
        Reading::AtLimit => "at a limit",
    }
}
