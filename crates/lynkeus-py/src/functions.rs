//! Plants and observers as functions that are called with numbers, and as texts in languages
//! that have such functions.

use std::sync::{Mutex, MutexGuard, OnceLock};

use lynkeus::Error;
use lynkeus::expr::{Budget, Evaluator, Graph, MissingInput, Node, Tape, jacobian};
use lynkeus::model::{Plant, Variable};
use lynkeus::observers::{self, Design};
use lynkeus::study::SimulateSettings;
use lynkeus_export::python::{Function, Namespace, Vector, module};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::away::{Terms, away};
use crate::errors::{exception, number};

type Values<'py> = PyReadonlyArray1<'py, f64>;

/// x' = f(t, x, u), y = h(t, x, u).
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Functions {
    about: About,
    equations: Mutex<Equations>,
    f: Compiled,
    h: Compiled,
    jacobian: OnceLock<Jacobian>,
}

/// What the functions are of.
struct About {
    /// for people
    title: String,
    states: Vector,
    inputs: Vector,
    outputs: Vec<String>,
    start: Vec<f64>,
    /// of an observer
    family: Option<&'static str>,
    /// whether there are updates besides the flow
    is_filter: bool,
    /// how many of the inputs are sensors
    sensors: usize,
}

/// Expressions over one graph.
struct Equations {
    graph: Graph,
    time: Node,
    states: Vec<Node>,
    inputs: Vec<Node>,
    derivatives: Vec<Node>,
    outputs: Vec<Node>,
}

impl Equations {
    fn compiled(&self, values: &[Node]) -> Result<Compiled, MissingInput> {
        let tape = Tape::new(&self.graph, &self.arguments(), values)?;
        Ok(Compiled(Mutex::new(tape.evaluator())))
    }

    /// The symbols of time, states and inputs.
    fn arguments(&self) -> Vec<Node> {
        [&[self.time][..], &self.states, &self.inputs].concat()
    }

    fn jacobian(&self) -> Result<Jacobian, MissingInput> {
        let found = jacobian::forward(&self.graph, &self.derivatives, &self.states);
        let entries: Vec<Node> = found.entries.iter().map(|&(.., node)| node).collect();
        let places = found.entries.iter().map(|&(row, column, _)| [row, column]);
        Ok(Jacobian {
            places: places.collect(),
            entries: self.compiled(&entries)?,
        })
    }
}

struct Compiled(Mutex<Evaluator>);

impl Compiled {
    fn at(&self, arguments: &[f64]) -> Vec<f64> {
        let mut evaluator = self.0.lock().unwrap_or_else(|e| e.into_inner());
        let mut found = vec![0.0; evaluator.tape().outputs()];
        evaluator.eval(arguments, &mut found);
        found
    }
}

/// The entries that are not zero everywhere.
struct Jacobian {
    /// row and column of each
    places: Vec<[usize; 2]>,
    entries: Compiled,
}

fn names(variables: &[Variable]) -> Vec<String> {
    variables.iter().map(|v| v.name.clone()).collect()
}

fn nodes(variables: &[Variable]) -> Vec<Node> {
    variables.iter().map(|v| v.node).collect()
}

fn vector(name: &str, entries: Vec<String>) -> Vector {
    Vector {
        name: name.to_owned(),
        entries,
    }
}

impl Functions {
    /// The plant; its start is that of `[simulate]` where the study has one.
    ///
    /// # Errors
    /// An equation reads what has no value, or a limit ended the work.
    pub fn of_plant(plant: &Plant, settings: Option<&SimulateSettings>) -> Result<Self, Error> {
        let initial = settings.map_or(&[][..], |settings| &settings.initial);
        let start = |state: &Variable| {
            let given = initial.iter().find(|(name, _)| name.text == state.name);
            given.map(|(_, x)| *x).or(state.start).unwrap_or(f64::NAN)
        };
        let equations = Equations {
            graph: plant.graph.clone(),
            time: plant.time,
            states: nodes(&plant.states),
            inputs: nodes(&plant.inputs),
            derivatives: plant.derivatives.clone(),
            outputs: nodes(&plant.outputs),
        };
        let about = About {
            title: format!("{}: x' = f(t, x, u), y = h(t, x, u)", plant.name),
            states: vector("x", names(&plant.states)),
            inputs: vector("u", names(&plant.inputs)),
            outputs: names(&plant.outputs),
            start: plant.states.iter().map(start).collect(),
            family: None,
            is_filter: false,
            sensors: 0,
        };
        Self::new(about, equations)
    }

    /// The observer: its inputs are the sensors, the known inputs and the derivatives of these
    /// that it reads; its outputs the estimates.
    ///
    /// # Errors
    /// As [`Functions::of_plant`].
    pub fn of_observer(plant: &Plant, design: &Design) -> Result<Self, Error> {
        let observer = &design.observer;
        let system = lynkeus::observer_system(plant, observer)?;
        let read = observer.measured.iter().chain(&observer.inputs);
        let signals = read.chain(observer.input_derivatives.iter().map(|d| &d.signal));
        let estimates = observer.estimates.iter();
        let equations = Equations {
            graph: plant.graph.clone(),
            time: observer.time,
            states: observer.states.iter().map(|(s, _)| s.symbol).collect(),
            inputs: signals.map(|signal| signal.symbol).collect(),
            derivatives: observer.derivatives.clone(),
            outputs: estimates.map(|estimate| estimate.node).collect(),
        };
        let outputs = system.outputs().iter().take(equations.outputs.len());
        let (family, name) = (design.examination.family.name(), &plant.name);
        let about = About {
            title: format!("{family} observer of {name}: z' = f(t, z, w), estimates h(t, z, w)"),
            states: vector("z", system.states().to_vec()),
            inputs: vector("w", system.signals().to_vec()),
            outputs: outputs.cloned().collect(),
            start: system.start().to_vec(),
            family: Some(family),
            is_filter: observer.filter.is_some(),
            sensors: observer.measured.len(),
        };
        Self::new(about, equations)
    }

    fn new(about: About, equations: Equations) -> Result<Self, Error> {
        let compiled = |values| equations.compiled(values).map_err(lynkeus::explain);
        let (f, h) = (
            compiled(&equations.derivatives)?,
            compiled(&equations.outputs)?,
        );
        // what a limit left of the graph says nothing
        if let Some(spent) = equations.graph.spent() {
            return Err(Error::ended(spent));
        }
        // the call ends here; later ones have limits of their own
        equations.graph.set_budget(Budget::default());
        Ok(Self {
            about,
            f,
            h,
            equations: Mutex::new(equations),
            jacobian: OnceLock::new(),
        })
    }

    fn arguments(
        &self,
        t: &Bound<'_, PyAny>,
        x: &Values<'_>,
        u: &Values<'_>,
    ) -> PyResult<Vec<f64>> {
        let mut arguments = vec![number("t", t)?];
        for (Vector { name, entries }, values) in [(&self.about.states, x), (&self.about.inputs, u)]
        {
            let values = values.as_array();
            if values.len() != entries.len() {
                return Err(exception(&Error::input(format!(
                    "{name}: expected {} values ({}), found {}",
                    entries.len(),
                    entries.join(", "),
                    values.len()
                ))));
            }
            arguments.extend(values);
        }
        Ok(arguments)
    }

    /// A function at a point.
    fn value<'py>(
        &self,
        py: Python<'py>,
        function: &Compiled,
        (t, x, u): (&Bound<'py, PyAny>, &Values<'_>, &Values<'_>),
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let arguments = self.arguments(t, x, u)?;
        Ok(function.at(&arguments).into_pyarray(py))
    }

    fn equations(&self) -> MutexGuard<'_, Equations> {
        self.equations.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Made when first asked for.
    fn slopes(&self, py: Python<'_>) -> PyResult<&Jacobian> {
        if let Some(known) = self.jacobian.get() {
            return Ok(known);
        }
        let made = away(py, &Terms::default(), |budget, _| {
            let equations = self.equations();
            let made = equations.graph.budgeted(budget, || equations.jacobian());
            made.map_err(Error::ended)?.map_err(lynkeus::explain)
        });
        let made = made?;
        Ok(self.jacobian.get_or_init(|| made))
    }
}

#[pymethods]
impl Functions {
    #[getter]
    fn title(&self) -> &str {
        &self.about.title
    }

    #[getter]
    fn states(&self) -> Vec<String> {
        self.about.states.entries.clone()
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.about.inputs.entries.clone()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.about.outputs.clone()
    }

    /// Start values, NaN where the model gives none.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.about.start.clone().into_pyarray(py)
    }

    #[getter]
    fn family(&self) -> Option<&'static str> {
        self.about.family
    }

    #[getter]
    fn is_filter(&self) -> bool {
        self.about.is_filter
    }

    #[getter]
    fn sensors(&self) -> usize {
        self.about.sensors
    }

    /// x'
    fn f<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        x: Values<'_>,
        u: Values<'_>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.value(py, &self.f, (t, &x, &u))
    }

    /// y
    fn h<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        x: Values<'_>,
        u: Values<'_>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.value(py, &self.h, (t, &x, &u))
    }

    /// ∂f/∂x, row by row of x'
    fn jacobian_x<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        x: Values<'_>,
        u: Values<'_>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let arguments = self.arguments(t, &x, &u)?;
        let slopes = self.slopes(py)?;
        let mut found = Array2::zeros([self.about.start.len(); 2]);
        for (&place, value) in slopes.places.iter().zip(slopes.entries.at(&arguments)) {
            found[place] = value;
        }
        Ok(found.into_pyarray(py))
    }

    /// A module with f and h, and whether it leaves linear systems to its namespace.
    fn source(&self, py: Python<'_>, language: &str) -> PyResult<(String, bool)> {
        let namespace = match language {
            "python" => Namespace::Numpy,
            "casadi" => Namespace::Casadi,
            other => {
                return Err(exception(&Error::input(format!(
                    "language: expected \"python\" (over NumPy or JAX) or \"casadi\", found \"{other}\""
                ))));
            }
        };
        let About {
            title,
            states,
            inputs,
            ..
        } = &self.about;
        let vectors = [states.clone(), inputs.clone()];
        let printed = py.detach(|| {
            let equations = &*self.equations();
            let arguments = equations.arguments();
            let values = [("f", &equations.derivatives), ("h", &equations.outputs)];
            let functions = values.map(|(name, outputs)| Function {
                name,
                graph: &equations.graph,
                inputs: &arguments,
                outputs,
            });
            module(title, &functions, &vectors, namespace)
        });
        let printed = printed.map_err(|e| exception(&Error::refused(e.to_string())))?;
        Ok((printed.text, printed.has_systems))
    }
}

/// The families of observers, and which of them are filters.
#[pyfunction]
pub fn families() -> Vec<(&'static str, bool)> {
    let families = observers::FAMILIES.iter();
    families.map(|f| (f.name(), f.is_filter())).collect()
}
