//! Expressions with their derivatives by all parameters, some in each pass.

use lynkeus_expr::{Graph, Node, Tape, jacobian};
use lynkeus_native::Function;

use crate::Result;
use crate::lanes::Engine;

/// Numbers, then their derivatives by the parameters of a pass, one in each lane.
pub(super) type Bundle<const L: usize> = Vec<[f64; L]>;

/// Passes for so many parameters; one also for none, for the values.
pub(super) fn passes(parameters: usize, lanes: usize) -> usize {
    parameters.div_ceil(lanes).max(1)
}

/// Expressions of what is `known`, of bundles and of θ.
#[derive(Clone, Debug)]
pub(super) struct Code<const L: usize> {
    engine: Engine<L>,
    known: usize,
    moved: usize,
    parameters: usize,
    /// of each pass: what is known, values and tangents of the bundles, θ and its tangents
    inputs: Vec<Vec<[f64; L]>>,
    /// values, then tangents
    outputs: Bundle<L>,
}

impl<const L: usize> Code<L> {
    /// Of what is `known`, which has no tangent, then what `moves`, then θ.
    pub fn new(
        graph: &Graph,
        known: &[Node],
        moves: &[Node],
        parameters: &[Node],
        outputs: &[Node],
        compile: fn(&Tape) -> Option<Function<L>>,
    ) -> Result<Self> {
        let fresh = |nodes: &[Node]| -> Vec<Node> {
            let nodes = nodes.iter();
            nodes.map(|_| graph.fresh("d").node()).collect()
        };
        let [dmoves, dparameters] = [moves, parameters].map(fresh);
        let along = jacobian::along(
            graph,
            outputs,
            &[moves, parameters].concat(),
            &[&dmoves[..], &dparameters].concat(),
        );
        let inputs = [known, moves, &dmoves, parameters, &dparameters].concat();
        let all = [outputs, &along].concat();
        let tape = Tape::new(graph, &inputs, &all)?;
        let mut row = vec![[0.0; L]; inputs.len()];
        let seeds = inputs.len() - parameters.len();
        let inputs = (0..passes(parameters.len(), L)).map(|pass| {
            for (p, seed) in row[seeds..].iter_mut().enumerate() {
                *seed = std::array::from_fn(|lane| f64::from(u8::from(pass * L + lane == p)));
            }
            row.clone()
        });
        Ok(Self {
            inputs: inputs.collect(),
            engine: Engine::new(&tape, compile),
            known: known.len(),
            moved: moves.len(),
            parameters: parameters.len(),
            outputs: vec![[0.0; L]; all.len()],
        })
    }

    /// From now on at this θ.
    pub fn place(&mut self, parameters: &[f64]) {
        let begin = self.known + 2 * self.moved;
        for inputs in &mut self.inputs {
            let places = &mut inputs[begin..begin + self.parameters];
            for (place, value) in places.iter_mut().zip(parameters) {
                *place = [*value; L];
            }
        }
    }

    /// Values, then tangents, of one pass.
    pub fn run<const K: usize>(
        &mut self,
        pass: usize,
        known: [&[f64]; K],
        bundles: &[&[[f64; L]]],
    ) -> &[[f64; L]] {
        let inputs = &mut self.inputs[pass];
        let (first, rest) = inputs.split_at_mut(self.known);
        let known = known.into_iter().flatten();
        for (place, value) in first.iter_mut().zip(known) {
            *place = [*value; L];
        }
        let (values, tangents) = rest.split_at_mut(self.moved);
        let mut at = 0;
        for bundle in bundles {
            let count = bundle.len() / 2;
            let (own, along) = bundle.split_at(count);
            values[at..at + count].copy_from_slice(own);
            tangents[at..at + count].copy_from_slice(along);
            at += count;
        }
        self.engine.eval(inputs, &mut self.outputs);
        &self.outputs
    }
}
