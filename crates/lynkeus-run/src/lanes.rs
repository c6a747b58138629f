//! A tape in lanes: as machine code, or interpreted.

use lynkeus_expr::lanes::{self, Lanes, Portable};
use lynkeus_expr::{Evaluator, Graph, Node, Op, Tape};
use lynkeus_native::Function;

use crate::Backend;

/// Largest tape that is compiled.
const LARGEST: usize = 200_000;

/// Whether there is a function that lanes round in their own way.
pub(crate) fn have_functions(graph: &Graph, outputs: &[Node]) -> bool {
    let rounds = |node: &Node| match graph.op(*node) {
        Op::Unary(op, _) => lanes::unary::<Portable<1>>(op).is_some(),
        Op::Binary(op, ..) => lanes::binary::<Portable<1>>(op).is_some(),
        _ => false,
    };
    graph.reachable(outputs).iter().any(rounds)
}

/// Machine code, or a tape. Both give the same values to the bit.
#[derive(Clone, Debug)]
pub(crate) enum Engine<const L: usize> {
    Native(Function<L>),
    Interpreted(Box<Evaluator<Lanes<L>>>),
}

impl<const L: usize> Engine<L> {
    pub fn new(tape: &Tape, compile: impl FnOnce(&Tape) -> Option<Function<L>>) -> Self {
        let is_wanted = Backend::compiles_at_once() && tape.len() <= LARGEST;
        match is_wanted.then(|| compile(tape)).flatten() {
            Some(function) => Self::Native(function),
            None => Self::Interpreted(Box::new(tape.evaluator_in(Lanes))),
        }
    }

    /// Writes the outputs at `inputs`.
    pub fn eval(&mut self, inputs: &[[f64; L]], outputs: &mut [[f64; L]]) {
        match self {
            Self::Native(function) => function.eval(inputs, outputs),
            Self::Interpreted(tape) => tape.eval(inputs, outputs),
        }
    }
}
