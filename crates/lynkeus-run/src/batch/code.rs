//! Code for many trajectories side by side: what all of them have in common is computed once.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::lanes::{self, Lanes, Portable};
use lynkeus_expr::{Evaluator, Graph, MissingInput, Node, Op, Tape};
use lynkeus_native::{Function, Sweep, Sweeper};

use crate::routine::Backend;

/// Trajectories in a register.
pub(crate) const LANES: usize = 4;

pub(crate) type Lane = [f64; LANES];

/// Largest tape that is compiled for a batch.
const LARGEST: usize = 200_000;

/// A divided tape with its machine code, shared by all threads. Interpreter and machine code give
/// the same values to the bit.
#[derive(Debug)]
pub(crate) struct Code {
    tapes: Divided,
    common: Option<Function<LANES>>,
    own: Option<Sweep<LANES>>,
    /// from the outputs of one group of lanes to those of the next
    spacing: usize,
}

impl Code {
    pub fn new(tapes: Divided, spacing: usize) -> Self {
        let is_wanted = |tape: &Tape| Backend::compiles_at_once() && tape.len() <= LARGEST;
        let compiled = is_wanted(&tapes.common).then(|| Function::compile(&tapes.common));
        let shared = tapes.common.outputs();
        let sweep = is_wanted(&tapes.own).then(|| Sweep::compile(&tapes.own, shared, spacing));
        Self {
            common: compiled.flatten(),
            own: sweep.flatten(),
            tapes,
            spacing,
        }
    }

    /// Number of values that all trajectories share.
    pub fn shared(&self) -> usize {
        self.tapes.common.outputs()
    }

    /// Whether there is a function that lanes round in their own way.
    pub fn has_functions(&self) -> bool {
        self.tapes.has_functions
    }

    pub fn runner(&self) -> Runner {
        let engine = |tape: &Tape| Box::new(tape.evaluator_in(Lanes));
        Runner {
            spacing: self.spacing,
            own_inputs: self.tapes.own.inputs() - self.shared(),
            outputs: self.tapes.own.outputs(),
            scratch: vec![[0.0; LANES]; self.tapes.own.inputs()],
            common: match &self.common {
                Some(function) => Common::Native(function.evaluator()),
                None => Common::Interpreted(engine(&self.tapes.common)),
            },
            own: match &self.own {
                Some(sweep) => Own::Native(sweep.evaluator()),
                None => Own::Interpreted(engine(&self.tapes.own)),
            },
        }
    }
}

/// Runs one [`Code`] again and again, without allocating.
#[derive(Debug)]
pub(crate) struct Runner {
    common: Common,
    own: Own,
    spacing: usize,
    own_inputs: usize,
    outputs: usize,
    scratch: Vec<Lane>,
}

#[derive(Debug)]
enum Common {
    Native(lynkeus_native::Evaluator<LANES>),
    Interpreted(Box<Evaluator<Lanes<LANES>>>),
}

#[derive(Debug)]
enum Own {
    Native(Sweeper<LANES>),
    Interpreted(Box<Evaluator<Lanes<LANES>>>),
}

impl Runner {
    /// What all trajectories share at four instants: the lanes of `inputs`. Each instant has its
    /// place in `table`, of [`Code::shared`] values that have one number in all lanes.
    pub fn share(&mut self, inputs: &[Lane], table: &mut [Lane]) {
        let count = table.len() / LANES;
        let values = &mut self.scratch[..count];
        match &mut self.common {
            Common::Native(native) => native.eval(inputs, values),
            Common::Interpreted(tape) => tape.eval(inputs, values),
        }
        for (instant, places) in table.chunks_exact_mut(count.max(1)).enumerate() {
            for (place, value) in places.iter_mut().zip(values.iter()) {
                *place = [value[instant]; LANES];
            }
        }
    }

    /// The outputs of every group of lanes, from what is shared and what is its own.
    pub fn sweep(&mut self, groups: usize, shared: &[Lane], inputs: &[Lane], outputs: &mut [Lane]) {
        match &mut self.own {
            Own::Native(native) => native.eval(groups, shared, inputs, outputs),
            Own::Interpreted(tape) => {
                let arguments = &mut self.scratch[..shared.len() + self.own_inputs];
                arguments[..shared.len()].copy_from_slice(shared);
                for group in 0..groups {
                    let own = &inputs[group * self.own_inputs..][..self.own_inputs];
                    arguments[shared.len()..].copy_from_slice(own);
                    let to = &mut outputs[group * self.spacing..][..self.outputs];
                    tape.eval(arguments, to);
                }
            }
        }
    }
}

/// A tape in two: what follows from the shared inputs alone, and the rest.
#[derive(Debug)]
pub(crate) struct Divided {
    /// shared inputs → the values that the rest reads
    pub common: Tape,
    /// these values, then all other inputs → the outputs
    pub own: Tape,
    /// whether there is a function that lanes round in their own way
    pub has_functions: bool,
}

impl Divided {
    /// Divides `outputs`, functions of `inputs`; `is_shared` says of each input whether all
    /// trajectories have the same.
    ///
    /// # Errors
    /// None with outputs that read the inputs alone.
    pub fn new(
        g: &Graph,
        inputs: &[Node],
        outputs: &[Node],
        is_shared: impl Fn(usize) -> bool,
    ) -> Result<Self, MissingInput> {
        let (shared, own): (Vec<usize>, Vec<usize>) =
            (0..inputs.len()).partition(|&i| is_shared(i));
        let [shared, own] =
            [shared, own].map(|of| of.iter().map(|&i| inputs[i]).collect::<Vec<_>>());
        let mut frontier = Frontier {
            graph: g,
            own: own.iter().copied().collect(),
            read: HashMap::new(),
            values: vec![],
        };
        let mut has_functions = false;
        for node in g.reachable(outputs) {
            has_functions |= match g.op(node) {
                Op::Unary(op, _) => lanes::unary::<Portable<1>>(op).is_some(),
                Op::Binary(op, ..) => lanes::binary::<Portable<1>>(op).is_some(),
                _ => false,
            };
            frontier.meet(node);
        }
        outputs.iter().for_each(|&output| frontier.read(output));
        let Frontier { read, values, .. } = frontier;
        let symbols: Vec<Node> = values.iter().map(|value| read[value]).collect();
        Ok(Self {
            common: Tape::new(g, &shared, &values)?,
            own: Tape::new(g, &[symbols, own].concat(), &g.substitute(outputs, &read))?,
            has_functions,
        })
    }
}

/// The values that follow from the shared inputs alone and are read by others.
struct Frontier<'g> {
    graph: &'g Graph,
    /// nodes that differ between trajectories
    own: HashSet<Node>,
    /// each value with its symbol
    read: HashMap<Node, Node>,
    values: Vec<Node>,
}

impl Frontier<'_> {
    /// The next node, after its arguments.
    fn meet(&mut self, node: Node) {
        let arguments = self.graph.arguments(node);
        if arguments.iter().any(|argument| self.own.contains(argument)) {
            self.own.insert(node);
            arguments
                .into_iter()
                .for_each(|argument| self.read(argument));
        }
    }

    /// A value that is the trajectory's own, or read by what is.
    fn read(&mut self, value: Node) {
        let is_common = !self.own.contains(&value) && self.graph.constant_value(value).is_none();
        if is_common && !self.read.contains_key(&value) {
            self.read.insert(value, self.graph.fresh("shared").node());
            self.values.push(value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_depends_on_time_alone_is_computed_once() {
        let g = Graph::new();
        let [t, x, p] = ["t", "x", "p"].map(|name| g.symbol(name));
        let u = (t * 3.0).sin() * 2.0;
        let dx = x * u + u.exp() * p - x.sin();
        let (inputs, outputs) = ([t, x, p].map(|e| e.node()), [dx.node(), u.node()]);
        let tape = Tape::new(&g, &inputs, &outputs).unwrap();
        let divided = Divided::new(&g, &inputs, &outputs, |i| i == 0).unwrap();
        // u and eᵘ
        assert_eq!((divided.common.inputs(), divided.common.outputs()), (1, 2));
        assert_eq!((divided.own.inputs(), divided.own.len()), (4, 5));
        let common = divided.common.eval_in(&lynkeus_expr::Reals, &[0.7]);
        let inputs = [&common[..], &[0.3, -1.5]].concat();
        let mut expected = [0.0; 2];
        tape.evaluator().eval(&[0.7, 0.3, -1.5], &mut expected);
        assert_eq!(divided.own.eval_in(&lynkeus_expr::Reals, &inputs), expected);
    }
}
