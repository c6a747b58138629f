//! How the measurements enter an observer, read from its own equations.

use lynkeus_expr::{MissingInput, Node, Tape, jacobian};
use lynkeus_structure::{AugmentedPlant, Dimension};
use nalgebra::DMatrix;

use super::error_system::{edges, hats, readings};
use super::refute::{finite, spread};
use crate::Observer;

/// Points at which the copy of the plant is recognised.
const POINTS: usize = 24;

/// Rounding of the terms that cancel there, relative to their size.
const ROUNDING: f64 = 1e-9;

/// How the measurements correct the estimate.
#[derive(Clone, Debug)]
pub enum Correction {
    /// x̂' = f(x̂, u) − K (ŷ − y) with this K: one row per augmented state, one column per
    /// measured output
    Gain(DMatrix<f64>),
    /// anything else: the entries of ∂F/∂y that are not 0
    Varying(Vec<Injection>),
}

/// ∂F_i/∂y_j of an observer z' = F(t, z, u, y).
#[derive(Clone, Debug, PartialEq)]
pub struct Injection {
    /// name of the observer's state
    pub state: String,
    /// name of the measured output
    pub output: String,
    /// the derivative as an expression of time, the observer's states and its signals
    pub node: Node,
}

impl Correction {
    /// The correction of an observer of the plant.
    ///
    /// # Errors
    /// [`MissingInput`] where an expression reads what the observer does not know.
    pub fn of(augmented: &AugmentedPlant<'_>, observer: &Observer) -> Result<Self, MissingInput> {
        let graph = augmented.graph();
        let measured: Vec<Node> = observer.measured.iter().map(|m| m.symbol).collect();
        let jacobian = jacobian::forward(graph, &observer.derivatives, &measured);
        let mut K = DMatrix::zeros(observer.states.len(), measured.len());
        let mut constant = edges(graph, &observer.derivatives, &measured).is_empty();
        for &(i, j, node) in &jacobian.entries {
            if graph.symbols_of(&[node]).is_empty() {
                K[(i, j)] = Tape::new(graph, &[], &[node])?.evaluator().value(&[]);
            } else {
                constant = false;
            }
        }
        if constant && is_copy(augmented, observer, &K)? {
            return Ok(Self::Gain(K));
        }
        let entries = jacobian.entries.iter().map(|&(i, j, node)| Injection {
            state: observer.states[i].0.name.clone(),
            output: observer.measured[j].name.clone(),
            node,
        });
        Ok(Self::Varying(entries.collect()))
    }
}

/// Whether the observer's states are the estimate and F(x̂, u, h(x̂)) = f(x̂, u), at
/// points spread over the box.
fn is_copy(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    K: &DMatrix<f64>,
) -> Result<bool, MissingInput> {
    let n = augmented.states.len();
    if !observer.is_the_estimate(n) || !observer.input_derivatives.is_empty() {
        return Ok(false);
    }
    let graph = augmented.graph();
    let hats = hats(augmented, observer);
    let measured = readings(augmented, observer);
    let signals = observer.measured.iter();
    let seen: Vec<Node> = signals.map(|m| measured[&m.symbol]).collect();
    let mut roots = graph.substitute(&observer.derivatives, &measured);
    roots.extend(graph.substitute(&augmented.derivatives, &hats));
    roots.extend(&seen);
    let mut region = augmented.region();
    for side in &mut region.dimensions {
        side.symbol = *hats.get(&side.symbol).unwrap_or(&side.symbol);
    }
    let sides: Vec<Dimension> = region.dimensions.iter().map(finite).collect();
    let mut evaluator = Tape::new(graph, &region.symbols(), &roots)?.evaluator();
    let mut values = vec![0.0; roots.len()];
    let mut compared = 0;
    for index in 0..POINTS {
        evaluator.eval(&spread(&sides, index), &mut values);
        if !values.iter().all(|x| x.is_finite()) {
            continue;
        }
        let (F, rest) = values.split_at(n);
        let (f, y) = rest.split_at(n);
        let close = |i: usize| {
            let through: f64 = y
                .iter()
                .enumerate()
                .map(|(j, y)| (K[(i, j)] * y).abs())
                .sum();
            (F[i] - f[i]).abs() <= ROUNDING * (F[i].abs() + f[i].abs() + through)
        };
        if !(0..n).all(close) {
            return Ok(false);
        }
        compared += 1;
    }
    Ok(compared > 0)
}
