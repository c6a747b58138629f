//! Live estimation, sample by sample.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use lynkeus::run::{self, filter::Reading};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMapping, PyString, PyTuple};

use crate::errors::{exception, from_source, number, wrong};

/// A study's estimator; a call is short, so that it keeps the interpreter's lock.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Estimator {
    /// threads take turns; nothing of Python is called while it is locked
    estimator: Mutex<run::Late>,
    /// the Python study that it is of
    study: Py<PyAny>,
    /// names of the signals, interned
    signals: Vec<Py<PyString>>,
    /// names of what is estimated, interned
    names: Vec<Py<PyString>>,
    /// how many of the signals are measured
    sensors: usize,
    /// as it was before its first sample
    fresh: Vec<u8>,
    /// samples in a row that the equations refused
    refused: AtomicUsize,
}

/// So many samples in a row that the equations refuse are behind an absurd reading that was taken: from the
/// next on the estimator starts anew, as exported code does.
const PATIENCE: usize = 5;

/// Signals of a call that need no room of their own.
const FEW: usize = 32;

impl Estimator {
    pub fn of(py: Python<'_>, estimator: run::Late, study: Py<PyAny>) -> Self {
        let interned = |names: &[String]| {
            let names = names.iter();
            names
                .map(|name| PyString::intern(py, name).unbind())
                .collect()
        };
        Self {
            signals: interned(estimator.signals()),
            names: interned(estimator.names()),
            sensors: estimator.sensors(),
            fresh: estimator.snapshot(),
            refused: AtomicUsize::new(0),
            estimator: Mutex::new(estimator),
            study,
        }
    }

    fn lock(&self) -> MutexGuard<'_, run::Late> {
        self.estimator
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts readings by name in their order; what is left out or None did not report.
    fn read(&self, readings: &Bound<'_, PyDict>, sample: &mut [f64]) -> PyResult<()> {
        let py = readings.py();
        let mut taken = 0;
        for (name, x) in self.signals.iter().zip(sample) {
            let Some(value) = readings.get_item(name.bind(py))? else {
                continue;
            };
            taken += 1;
            if !value.is_none() {
                *x = value.extract().map_err(|error| {
                    let name = name.bind(py).to_string();
                    wrong(&name, "a number or None", &value, error)
                })?;
            }
        }
        match taken == readings.len() {
            true => Ok(()),
            false => Err(self.stranger(readings)),
        }
    }

    fn taken(&self, t: f64, readings: &Bound<'_, PyDict>, sample: &mut [f64]) -> PyResult<()> {
        self.read(readings, sample)?;
        self.go(t, sample)
    }

    /// Takes a sample; anew where the equations have refused too many.
    fn go(&self, t: f64, sample: &[f64]) -> PyResult<()> {
        let mut estimator = self.lock();
        let pushed = estimator.push(t, sample).map(drop);
        match &pushed {
            Ok(()) => self.refused.store(0, Ordering::Relaxed),
            Err(
                run::Error::Diverged { .. }
                | run::Error::DeviationDiverged { .. }
                | run::Error::NotFinite { .. }
                | run::Error::StepUnderflow { .. }
                | run::Error::Singular { .. }
                | run::Error::TooStiff { .. },
            ) => {
                if self.refused.fetch_add(1, Ordering::Relaxed) + 1 >= PATIENCE {
                    self.refused.store(0, Ordering::Relaxed);
                    estimator.restore(&self.fresh).map_err(from_source)?;
                }
            }
            Err(_) => {}
        }
        drop(estimator);
        pushed.map_err(from_source)
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
        let known = self.signals();
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

/// A dictionary of any mapping.
fn mapped<'py>(readings: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    match readings.cast::<PyDict>() {
        Ok(known) => Ok(known.clone()),
        Err(_) => {
            let known = readings.cast::<PyMapping>().map_err(|error| {
                let expected = "a mapping of names to numbers";
                wrong("readings", expected, readings, error.into())
            })?;
            PyDict::from_sequence(known.items()?.as_any())
        }
    }
}

#[pymethods]
impl Estimator {
    /// Goes to a time at which nothing is read.
    fn predict(&self, t: &Bound<'_, PyAny>) -> PyResult<()> {
        let t = number("t", t)?;
        let predicted = self.lock().predict(t).map(drop);
        predicted.map_err(from_source)
    }

    /// Goes to a time and takes what was read there, by name.
    fn update(&self, t: &Bound<'_, PyAny>, readings: &Bound<'_, PyAny>) -> PyResult<()> {
        let (t, readings) = (number("t", t)?, &mapped(readings)?);
        match [f64::NAN; FEW].get_mut(..self.signals.len()) {
            Some(sample) => self.taken(t, readings, sample),
            None => self.taken(t, readings, &mut vec![f64::NAN; self.signals.len()]),
        }
    }

    /// The same with all signals in their order.
    fn push(&self, t: &Bound<'_, PyAny>, signals: &Bound<'_, PyAny>) -> PyResult<()> {
        let t = number("t", t)?;
        let signals: Vec<f64> = signals.extract().map_err(|error| {
            let expected = format!("a number for each of {}", self.signals().join(", "));
            wrong("signals", &expected, signals, error)
        })?;
        self.go(t, &signals)
    }

    #[getter]
    fn signals(&self) -> Vec<String> {
        self.lock().signals().to_vec()
    }

    /// How many of the signals are sensors; known inputs follow.
    #[getter]
    fn sensors(&self) -> usize {
        self.sensors
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.lock().names().to_vec()
    }

    #[getter]
    fn time(&self) -> Option<f64> {
        self.lock().time()
    }

    /// What is estimated, by name.
    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let estimate = self.lock().estimate().to_vec();
        self.by_name(py, &estimate)
    }

    /// Standard deviations by name, where the observer has them.
    #[getter]
    fn sd<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let deviations = self.lock().deviations().map(<[f64]>::to_vec);
        deviations.map(|sd| self.by_name(py, &sd)).transpose()
    }

    /// How long what comes late is waited for.
    #[getter]
    fn wait(&self) -> f64 {
        self.lock().wait()
    }

    /// The rows that the last call went over again.
    #[getter]
    fn revised<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let revised = self.lock().revised().to_vec();
        let rows = revised.into_iter().map(|row| {
            let found = PyDict::new(py);
            found.set_item("t", row.t)?;
            found.set_item("estimate", self.by_name(py, &row.estimate)?)?;
            let sd = row.deviations.map(|sd| self.by_name(py, &sd)).transpose()?;
            found.set_item("sd", sd)?;
            Ok(found)
        });
        rows.collect()
    }

    /// What is estimated, in the order of `names`.
    fn to_numpy<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let estimate = self.lock().estimate().to_vec();
        estimate.into_pyarray(py)
    }

    /// By sensor what the last reading said beside what the model expected; of a filter.
    #[getter]
    fn innovations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sensors = PyDict::new(py);
        let innovations = self.lock().innovations().to_vec();
        for (name, innovation) in self.signals.iter().zip(innovations) {
            let entry = PyDict::new(py);
            entry.set_item("innovation", innovation.value)?;
            entry.set_item("sd", innovation.deviation)?;
            entry.set_item("expected", innovation.predicted)?;
            entry.set_item("reading", word(innovation.reading))?;
            sensors.set_item(name, entry)?;
        }
        Ok(sensors)
    }

    /// Counts by sensor, and of what was held, confined or not solved.
    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let health = self.lock().health().clone();
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
        found.set_item("unsolved", health.unsolved)?;
        found.set_item("too_late", self.lock().too_late())?;
        Ok(found)
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.lock().snapshot())
    }

    fn restore(&self, snapshot: &Bound<'_, PyAny>) -> PyResult<()> {
        let bytes = snapshot.extract::<&[u8]>();
        let bytes = bytes.map_err(|error| wrong("snapshot", "bytes", snapshot, error.into()))?;
        let restored = self.lock().restore(bytes);
        restored.map_err(from_source)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let again = py.import("lynkeus.study")?.getattr("_resumed")?;
        let parts = (self.study.clone_ref(py), self.snapshot(py), self.wait());
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
