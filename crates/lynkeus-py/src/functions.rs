//! A plant's equations as functions that are called with numbers.

use std::sync::Mutex;

use lynkeus::Error;
use lynkeus::expr::{Evaluator, Node, Tape};
use lynkeus::model::{Plant, Variable};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::errors::{exception, from_source};

/// x' = f(t, x, u), y = h(t, x, u).
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Functions {
    states: Vec<String>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    start: Vec<Option<f64>>,
    f: Mutex<Evaluator>,
    h: Mutex<Evaluator>,
}

fn names(variables: &[Variable]) -> Vec<String> {
    variables.iter().map(|v| v.name.clone()).collect()
}

impl Functions {
    /// # Errors
    /// An equation reads what has no value.
    pub fn of(plant: &Plant) -> PyResult<Self> {
        let nodes = |variables: &[Variable]| variables.iter().map(|v| v.node).collect::<Vec<_>>();
        let (states, inputs) = (nodes(&plant.states), nodes(&plant.inputs));
        let arguments = [&[plant.time][..], &states, &inputs].concat();
        let compiled = |values: &[Node]| {
            let tape = Tape::new(&plant.graph, &arguments, values).map_err(from_source)?;
            Ok::<_, PyErr>(Mutex::new(tape.evaluator()))
        };
        Ok(Self {
            states: names(&plant.states),
            inputs: names(&plant.inputs),
            outputs: names(&plant.outputs),
            start: plant.states.iter().map(|s| s.start).collect(),
            f: compiled(&plant.derivatives)?,
            h: compiled(&nodes(&plant.outputs))?,
        })
    }

    fn arguments(&self, t: f64, x: &[f64], u: &[f64]) -> PyResult<Vec<f64>> {
        let expect = |what: &str, names: &[String], values: &[f64]| match values.len() {
            found if found == names.len() => Ok(()),
            found => Err(exception(&Error::input(format!(
                "{what}: expected {} values ({}), found {found}",
                names.len(),
                names.join(", ")
            )))),
        };
        expect("x", &self.states, x)?;
        expect("u", &self.inputs, u)?;
        Ok([&[t], x, u].concat())
    }
}

fn evaluated(function: &Mutex<Evaluator>, arguments: &[f64], values: usize) -> Vec<f64> {
    let mut found = vec![0.0; values];
    let mut function = function.lock().unwrap_or_else(|e| e.into_inner());
    function.eval(arguments, &mut found);
    found
}

#[pymethods]
impl Functions {
    #[getter]
    fn states(&self) -> Vec<String> {
        self.states.clone()
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.inputs.clone()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.outputs.clone()
    }

    /// Start values, NaN where the model gives none.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let start = self.start.iter().map(|s| s.unwrap_or(f64::NAN));
        start.collect::<Vec<f64>>().into_pyarray(py)
    }

    /// x'
    #[pyo3(signature = (t, x, u=vec![]))]
    fn f<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Vec<f64>,
        u: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let arguments = self.arguments(t, &x, &u)?;
        Ok(evaluated(&self.f, &arguments, self.states.len()).into_pyarray(py))
    }

    /// y
    #[pyo3(signature = (t, x, u=vec![]))]
    fn h<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Vec<f64>,
        u: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let arguments = self.arguments(t, &x, &u)?;
        Ok(evaluated(&self.h, &arguments, self.outputs.len()).into_pyarray(py))
    }
}
