//! A plant and its observer side by side.

use lynkeus_expr::{Evaluator, Node, Tape, jacobian};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Estimate, Observer, Signal};
use lynkeus_structure::{AugmentedPlant, Sensors};
use nalgebra::{DMatrix, DVector};

pub fn plant(text: &str) -> Plant {
    let read = Plant::from_modelica(text, "plant.mo", &LoadOptions::default());
    read.unwrap_or_else(|error| panic!("{error}\n{text}"))
}

pub fn augmented(plant: &Plant) -> AugmentedPlant<'_> {
    AugmentedPlant::new(plant, &Sensors::default()).unwrap()
}

/// x̂' = f(x̂, u) − K (h(x̂, u) − y), whatever K is; without K the plant's copy.
pub fn observer(augmented: &AugmentedPlant<'_>, K: &DMatrix<f64>) -> Observer {
    let graph = augmented.graph();
    let signal = |name: &str, symbol: String| Signal {
        name: name.to_owned(),
        symbol: graph.symbol(&symbol).node(),
    };
    let hats = augmented.states.iter();
    let hats: Vec<Signal> = hats
        .map(|s| signal(&s.name, format!("estimate of {}", s.name)))
        .collect();
    let outputs = augmented.outputs.iter();
    let measured: Vec<Signal> = outputs
        .map(|o| &o.variable.name)
        .map(|name| signal(name, format!("measured {name}")))
        .collect();
    let states = augmented.states.iter().zip(&hats);
    let seen = states
        .clone()
        .map(|(s, hat)| (s.node, hat.symbol))
        .collect();
    let mut derivatives = graph.substitute(&augmented.derivatives, &seen);
    let h: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
    let h = graph.substitute(&h, &seen);
    for (i, derivative) in derivatives.iter_mut().enumerate() {
        for (j, (h, y)) in h.iter().zip(&measured).enumerate() {
            let innovation = graph.expr(*h) - graph.expr(y.symbol);
            *derivative = (graph.expr(*derivative) - K[(i, j)] * innovation).node();
        }
    }
    let estimate = |(state, hat): (&lynkeus_model::Variable, &Signal)| Estimate {
        variable: state.clone(),
        node: hat.symbol,
        unknown_input: false,
    };
    let inputs = augmented.inputs.iter();
    Observer {
        time: augmented.plant.time,
        estimates: states.map(estimate).collect(),
        derivatives,
        inputs: inputs
            .map(|v| Signal {
                name: v.name.clone(),
                symbol: v.node,
            })
            .collect(),
        input_derivatives: vec![],
        generated: vec![],
        measured,
        monitors: vec![],
        filter: None,
        tunables: vec![],
        is_whole: false,
        states: hats.into_iter().map(|hat| (hat, 0.0)).collect(),
    }
}

/// Everything that the judge evaluates, compiled.
pub struct Pair {
    plant: Evaluator,
    outputs: Evaluator,
    observer: Evaluator,
    slopes: Evaluator,
    pub states: usize,
    measured: usize,
}

impl Pair {
    pub fn new(augmented: &AugmentedPlant<'_>, observer: &Observer) -> Self {
        let graph = augmented.graph();
        let inputs: Vec<Node> = augmented.inputs.iter().map(|v| v.node).collect();
        let hats: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
        let y: Vec<Node> = observer.measured.iter().map(|s| s.symbol).collect();
        let h: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
        let time = [augmented.plant.time];
        let seen = [&time[..], &augmented.symbols(), &inputs].concat();
        let own = [&time[..], &hats, &inputs, &y].concat();
        let evaluator = |symbols: &[Node], nodes: &[Node]| {
            Tape::new(graph, symbols, nodes).unwrap().evaluator()
        };
        let (n, zero) = (hats.len(), graph.constant(0.0).node());
        let jacobian = jacobian::forward(graph, &observer.derivatives, &hats);
        let entries = (0..n * n).map(|k| jacobian.get(k / n, k % n).unwrap_or(zero));
        Self {
            plant: evaluator(&seen, &augmented.derivatives),
            outputs: evaluator(&seen, &h),
            observer: evaluator(&own, &observer.derivatives),
            slopes: evaluator(&own, &entries.collect::<Vec<_>>()),
            states: n,
            measured: y.len(),
        }
    }

    pub fn outputs(&mut self, t: f64, x: &[f64], u: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.measured];
        self.outputs.eval(&[&[t], x, u].concat(), &mut y);
        y
    }

    /// x' of the plant.
    pub fn plant(&mut self, t: f64, x: &[f64], u: &[f64]) -> DVector<f64> {
        let mut out = vec![0.0; self.states];
        self.plant.eval(&[&[t], x, u].concat(), &mut out);
        DVector::from_vec(out)
    }

    /// x̂' of the observer.
    pub fn observer(&mut self, t: f64, hat: &[f64], u: &[f64], y: &[f64]) -> DVector<f64> {
        let mut out = vec![0.0; self.states];
        self.observer.eval(&[&[t], hat, u, y].concat(), &mut out);
        DVector::from_vec(out)
    }

    /// (x' , x̂') without disturbance.
    pub fn both(
        &mut self,
        t: f64,
        x: &[f64],
        hat: &[f64],
        u: &[f64],
    ) -> (DVector<f64>, DVector<f64>) {
        let y = self.outputs(t, x, u);
        (self.plant(t, x, u), self.observer(t, hat, u, &y))
    }

    /// ∂x̂'/∂x̂ where the estimate is right, by the derivatives of the expressions.
    pub fn jacobian(&mut self, t: f64, x: &[f64], u: &[f64]) -> DMatrix<f64> {
        let y = self.outputs(t, x, u);
        let mut out = vec![0.0; self.states * self.states];
        self.slopes.eval(&[&[t], x, u, &y].concat(), &mut out);
        DMatrix::from_row_slice(self.states, self.states, &out)
    }

    /// The same by differences of the right-hand side alone, to fourth order.
    pub fn differences(&mut self, t: f64, x: &[f64], u: &[f64], step: f64) -> DMatrix<f64> {
        let y = self.outputs(t, x, u);
        let mut jacobian = DMatrix::zeros(self.states, self.states);
        for j in 0..self.states {
            let mut at = |by: f64| {
                let mut moved = x.to_vec();
                moved[j] += by;
                self.observer(t, &moved, u, &y)
            };
            let (near, far) = (at(step) - at(-step), at(2.0 * step) - at(-2.0 * step));
            let column = (near * 8.0 - far) / (12.0 * step);
            jacobian.set_column(j, &column);
        }
        jacobian
    }
}

/// The largest real part of an eigenvalue.
pub fn abscissa(A: &DMatrix<f64>) -> f64 {
    let eigenvalues = A.complex_eigenvalues();
    eigenvalues
        .iter()
        .fold(f64::NEG_INFINITY, |m, λ| m.max(λ.re))
}
