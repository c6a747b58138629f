//! Code for many trajectories side by side: what all of them have in common is computed once.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use lynkeus_expr::lanes::{self, Lanes, Portable};
use lynkeus_expr::{
    Algebra, Binary, Evaluator, Graph, Implicit, MissingInput, Node, Nodes, Tape, Unary,
};
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
    /// Divides a tape; `is_shared` says of each input whether all trajectories have the same.
    ///
    /// # Errors
    /// None with a tape that reads its own inputs.
    pub fn new(tape: &Tape, is_shared: impl Fn(usize) -> bool) -> Result<Self, MissingInput> {
        let g = Graph::new();
        let inputs: Vec<Value> = (0..tape.inputs())
            .map(|i| Value {
                node: g.fresh("w").node(),
                is_shared: is_shared(i),
            })
            .collect();
        let division = Division {
            graph: &g,
            frontier: RefCell::default(),
            known: RefCell::default(),
            has_functions: Cell::default(),
        };
        let outputs = tape.eval_in(&division, &inputs);
        let outputs: Vec<Node> = outputs.iter().map(|v| division.own(v)).collect();
        let frontier = division.frontier.take();
        let of = |shared: bool| inputs.iter().filter(move |v| v.is_shared == shared);
        let shared: Vec<Node> = of(true).map(|v| v.node).collect();
        let (values, symbols): (Vec<Node>, Vec<Node>) = frontier.into_iter().unzip();
        let rest: Vec<Node> = symbols
            .into_iter()
            .chain(of(false).map(|v| v.node))
            .collect();
        Ok(Self {
            common: Tape::new(&g, &shared, &values)?,
            own: Tape::new(&g, &rest, &outputs)?,
            has_functions: division.has_functions.get(),
        })
    }
}

/// A node, and whether it follows from the shared inputs alone.
#[derive(Clone, Copy, Debug)]
struct Value {
    node: Node,
    is_shared: bool,
}

/// The nodes of a graph where shared values end in symbols.
struct Division<'g> {
    graph: &'g Graph,
    /// shared values that others read, each with its symbol
    frontier: RefCell<Vec<(Node, Node)>>,
    known: RefCell<HashMap<Node, Node>>,
    has_functions: Cell<bool>,
}

impl Division<'_> {
    /// The value as others read it.
    fn own(&self, value: &Value) -> Node {
        let Value { node, is_shared } = *value;
        if !is_shared || self.graph.constant_value(node).is_some() {
            return node;
        }
        let new = || {
            let symbol = self.graph.fresh("shared").node();
            self.frontier.borrow_mut().push((node, symbol));
            symbol
        };
        *self.known.borrow_mut().entry(node).or_insert_with(new)
    }

    fn made<T>(&self, arguments: &[Value], make: impl FnOnce(&[Node]) -> T) -> (T, bool) {
        let is_shared = arguments.iter().all(|v| v.is_shared);
        let nodes: Vec<Node> = match is_shared {
            true => arguments.iter().map(|v| v.node).collect(),
            false => arguments.iter().map(|v| self.own(v)).collect(),
        };
        (make(&nodes), is_shared)
    }

    /// Takes note of a function of lanes.
    fn see<F>(&self, function: Option<F>) {
        if function.is_some() {
            self.has_functions.set(true);
        }
    }

    fn one(&self, arguments: &[Value], make: impl FnOnce(&[Node]) -> Node) -> Value {
        let (node, is_shared) = self.made(arguments, make);
        Value { node, is_shared }
    }
}

impl Algebra for Division<'_> {
    type Value = Value;

    fn constant(&self, value: f64) -> Value {
        Value {
            node: self.graph.constant(value).node(),
            is_shared: true,
        }
    }

    fn unary(&self, op: Unary, x: &Value) -> Value {
        self.see(lanes::unary::<Portable<1>>(op));
        self.one(&[*x], |a| self.graph.unary(op, a[0]))
    }

    fn powi(&self, x: &Value, n: i32) -> Value {
        self.one(&[*x], |a| self.graph.powi(a[0], n))
    }

    fn binary(&self, op: Binary, x: &Value, y: &Value) -> Value {
        self.see(lanes::binary::<Portable<1>>(op));
        self.one(&[*x, *y], |a| self.graph.binary(op, a[0], a[1]))
    }

    fn select(&self, condition: &Value, x: &Value, y: &Value) -> Value {
        self.one(&[*condition, *x, *y], |a| {
            self.graph.select(a[0], a[1], a[2])
        })
    }

    fn solve(&self, a: &[Value], b: &[Value]) -> (Vec<Value>, Value) {
        let all = [a, b].concat();
        let solve = |n: &[Node]| {
            let (a, b) = n.split_at(a.len());
            Nodes(self.graph).solve(a, b)
        };
        let ((x, rcond), is_shared) = self.made(&all, solve);
        let value = |node: Node| Value { node, is_shared };
        (x.into_iter().map(value).collect(), value(rcond))
    }

    fn implicit(&self, function: &Implicit, p: &[Value]) -> Vec<Value> {
        let (z, is_shared) = self.made(p, |p| self.graph.implicit(function, p));
        z.into_iter()
            .map(|node| Value { node, is_shared })
            .collect()
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
        let tape = Tape::new(&g, &[t, x, p].map(|e| e.node()), &[dx.node(), u.node()]).unwrap();
        let divided = Divided::new(&tape, |i| i == 0).unwrap();
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
