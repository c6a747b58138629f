//! Modes of the plant and of an observer's error, linearised at the start of the model.

use lynkeus_expr::{Node, Tape, jacobian};
use lynkeus_observers::Design;
use lynkeus_proof::spectrum;
use lynkeus_structure::AugmentedPlant;
use nalgebra::DMatrix;

/// States beyond which no modes are computed.
const STATES: usize = 60;

/// The rate of the slowest mode of the observer's error, linearised at the start; none where the
/// observer has states of other kinds, or reads derivatives of inputs.
pub(crate) fn decay(augmented: &AugmentedPlant<'_>, design: &Design) -> Option<f64> {
    let observer = &design.observer;
    let is_copy = observer.states.len() == augmented.states.len()
        && augmented.states.len() <= STATES
        && observer.input_derivatives.is_empty()
        && observer
            .estimates
            .iter()
            .zip(&observer.states)
            .all(|(e, (s, _))| e.node == s.symbol);
    if !is_copy || observer.filter.is_some() {
        return None;
    }
    let graph = augmented.graph();
    let symbols: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    let slopes = jacobian::forward(graph, &observer.derivatives, &symbols);
    let start = Start::of(augmented);
    let readings = start.outputs(augmented)?;
    let own = observer
        .states
        .iter()
        .map(|(s, _)| s.symbol)
        .zip(start.states.iter().copied());
    let inputs = observer
        .inputs
        .iter()
        .map(|s| s.symbol)
        .zip(start.inputs.iter().copied());
    let measured = observer.measured.iter().map(|s| s.symbol).zip(readings);
    let known: Vec<(Node, f64)> = own
        .chain(inputs)
        .chain(measured)
        .chain([(observer.time, 0.0)])
        .collect();
    let nodes: Vec<Node> = slopes.entries.iter().map(|e| e.2).collect();
    let values = evaluated(augmented, &known, &nodes)?;
    let n = symbols.len();
    let mut J = DMatrix::zeros(n, n);
    for (entry, value) in slopes.entries.iter().zip(values) {
        J[(entry.0, entry.1)] = value;
    }
    slowest(&J)
}

/// −max Re λ; none where an entry has no value.
fn slowest(J: &DMatrix<f64>) -> Option<f64> {
    spectrum::abscissa(J.clone()).map(|largest| -largest)
}

/// Values at the start of the model.
pub struct Start {
    /// states and unknown inputs
    pub states: Vec<f64>,
    /// known inputs
    pub inputs: Vec<f64>,
}

impl Start {
    /// `start`, else the middle of the range, else 0.
    pub fn of(augmented: &AugmentedPlant<'_>) -> Self {
        let value = |v: &lynkeus_model::Variable| {
            let middle = (v.min + v.max) / 2.0;
            v.start
                .unwrap_or(if middle.is_finite() { middle } else { 0.0 })
        };
        Self {
            states: augmented.states.iter().map(value).collect(),
            inputs: augmented.inputs.iter().map(value).collect(),
        }
    }

    /// Symbols of the plant with their values.
    fn known(&self, augmented: &AugmentedPlant<'_>) -> Vec<(Node, f64)> {
        let states = augmented
            .states
            .iter()
            .map(|v| v.node)
            .zip(self.states.iter().copied());
        let inputs = augmented
            .inputs
            .iter()
            .map(|v| v.node)
            .zip(self.inputs.iter().copied());
        states
            .chain(inputs)
            .chain([(augmented.plant.time, 0.0)])
            .collect()
    }

    fn outputs(&self, augmented: &AugmentedPlant<'_>) -> Option<Vec<f64>> {
        let nodes: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
        evaluated(augmented, &self.known(augmented), &nodes)
    }

    /// ∂f/∂x of the plant there; none where an entry has no value, and for a large plant.
    pub fn jacobian(&self, augmented: &AugmentedPlant<'_>) -> Option<DMatrix<f64>> {
        if augmented.states.len() > STATES {
            return None;
        }
        let slopes = jacobian::forward(
            augmented.graph(),
            &augmented.derivatives,
            &augmented.symbols(),
        );
        let nodes: Vec<Node> = slopes.entries.iter().map(|e| e.2).collect();
        let values = evaluated(augmented, &self.known(augmented), &nodes)?;
        let n = augmented.states.len();
        let mut J = DMatrix::zeros(n, n);
        for (entry, value) in slopes.entries.iter().zip(values) {
            J[(entry.0, entry.1)] = value;
        }
        J.iter().all(|x| x.is_finite()).then_some(J)
    }
}

fn evaluated(
    augmented: &AugmentedPlant<'_>,
    known: &[(Node, f64)],
    nodes: &[Node],
) -> Option<Vec<f64>> {
    let (symbols, values): (Vec<Node>, Vec<f64>) = known.iter().copied().unzip();
    let tape = Tape::new(augmented.graph(), &symbols, nodes).ok()?;
    let mut found = vec![0.0; nodes.len()];
    tape.evaluator().eval(&values, &mut found);
    Some(found)
}
