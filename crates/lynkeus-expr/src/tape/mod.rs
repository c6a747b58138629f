//! Graphs compiled to straight-line code.

mod compiler;
mod machine;

use std::fmt;
use std::sync::Arc;

use crate::{Algebra, Binary, Graph, Implicit, Node, Reals, Unary};
use compiler::Compiler;
use machine::Machine;

type Register = u32;

/// The four operations that most code is made of stand beside the others: one jump to them
/// instead of two.
#[derive(Clone, Copy, Debug)]
enum Instruction {
    Add(Register, Register, Register),
    Sub(Register, Register, Register),
    Mul(Register, Register, Register),
    Div(Register, Register, Register),
    Unary(Unary, Register, Register),
    Powi(i32, Register, Register),
    Binary(Binary, Register, Register, Register),
    Select(Register, Register, Register, Register),
    /// index among the tape's linear systems and implicit functions
    Solve(u32),
}

impl Instruction {
    fn binary(op: Binary, to: Register, x: Register, y: Register) -> Self {
        match op {
            Binary::Add => Self::Add(to, x, y),
            Binary::Sub => Self::Sub(to, x, y),
            Binary::Mul => Self::Mul(to, x, y),
            Binary::Div => Self::Div(to, x, y),
            _ => Self::Binary(op, to, x, y),
        }
    }
}

/// What a system computes from its arguments.
#[derive(Clone, Debug)]
enum System {
    /// A x = b of n unknowns, from A and b
    Linear(usize),
    /// z with g(z, p) = 0, from p
    Implicit(Implicit),
}

/// Registers of one system: its arguments, and where its used results go.
#[derive(Clone, Debug)]
struct SystemSlots {
    system: System,
    arguments: Vec<Register>,
    /// (which result, register)
    results: Vec<(usize, Register)>,
}

/// An expression depends on a symbol that is not among the inputs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the expression depends on '{name}', which is not among the inputs of the tape")]
pub struct MissingInput {
    /// name of the symbol
    pub name: String,
}

/// Straight-line code for some outputs as functions of some inputs. Only what
/// the outputs need is computed and registers are reused. A clone shares the code.
#[derive(Clone, Debug)]
pub struct Tape {
    code: Arc<Code>,
}

#[derive(Debug, Default)]
struct Code {
    inputs: usize,
    /// constants live in the registers after the inputs
    constants: Vec<f64>,
    registers: usize,
    instructions: Vec<Instruction>,
    /// the node each instruction computes
    sources: Vec<Node>,
    systems: Vec<SystemSlots>,
    outputs: Vec<Register>,
}

impl Tape {
    /// Compiles `outputs` as functions of the symbols `inputs`.
    ///
    /// # Errors
    /// [`MissingInput`] where an output depends on another symbol.
    pub fn new(graph: &Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        let code = Compiler::new(graph, inputs, outputs)?.run(outputs);
        Ok(Self {
            code: Arc::new(code),
        })
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.code.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.code.outputs.len()
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.code.instructions.len()
    }

    /// True where nothing has to be computed.
    pub fn is_empty(&self) -> bool {
        self.code.instructions.is_empty()
    }

    /// Number of registers: inputs, constants and temporaries.
    pub fn registers(&self) -> usize {
        self.code.registers
    }

    /// An evaluator over the numbers.
    pub fn evaluator(&self) -> Evaluator {
        self.evaluator_in(Reals)
    }

    /// An evaluator over any algebra, for many evaluations: it keeps its registers.
    pub fn evaluator_in<A: Algebra>(&self, algebra: A) -> Evaluator<A> {
        Evaluator {
            machine: Machine::new(&self.code, algebra),
            tape: self.clone(),
        }
    }

    /// The outputs over any algebra, once.
    ///
    /// # Panics
    /// If `inputs` has not [`Tape::inputs`] entries.
    pub fn eval_in<A: Algebra>(&self, algebra: &A, inputs: &[A::Value]) -> Vec<A::Value> {
        let mut machine = Machine::new(&self.code, algebra);
        machine.run(&self.code, inputs);
        machine.outputs(&self.code).cloned().collect()
    }

    /// Names the first operation that makes a NaN or an infinity out of finite
    /// arguments at these inputs; of an algebraic loop also how the search ended.
    pub fn first_nonfinite(&self, graph: &Graph, inputs: &[f64]) -> Option<String> {
        let code = &*self.code;
        let mut machine = Machine::new(code, Reals);
        machine.enter(code, inputs);
        for (instruction, &source) in code.instructions.iter().zip(&code.sources) {
            machine.step(code, instruction);
            let mut written = code.written(instruction);
            let bad = written.find_map(|r| {
                let value = machine.registers[r as usize];
                (!value.is_finite()).then_some(value)
            });
            if let Some(value) = bad {
                let failure = machine.failure(code, instruction);
                let failure = failure.map_or_else(String::new, |how| format!(": {how}"));
                return Some(format!("{} is {value}{failure}", graph.render(source, 160)));
            }
        }
        None
    }
}

impl Code {
    fn written(&self, instruction: &Instruction) -> impl Iterator<Item = Register> {
        let (single, many): (Option<Register>, &[(usize, Register)]) = match *instruction {
            Instruction::Add(to, ..)
            | Instruction::Sub(to, ..)
            | Instruction::Mul(to, ..)
            | Instruction::Div(to, ..)
            | Instruction::Unary(_, to, _)
            | Instruction::Powi(_, to, _)
            | Instruction::Binary(_, to, ..)
            | Instruction::Select(to, ..) => (Some(to), &[]),
            Instruction::Solve(index) => (None, &self.systems[index as usize].results),
        };
        single.into_iter().chain(many.iter().map(|&(_, r)| r))
    }
}

/// Evaluates a [`Tape`] again and again over one algebra, by default the numbers. It shares
/// the tape's code and keeps its registers: over `f64` nothing is allocated.
///
/// ```
/// use lynkeus_expr::{Graph, Interval, Tape, interval::Intervals};
///
/// let g = Graph::new();
/// let x = g.symbol("x");
/// let tape = Tape::new(&g, &[x.node()], &[(x * x).node()])?;
/// let mut bounds = tape.evaluator_in(Intervals);
/// let mut square = [Interval::ZERO];
/// for side in [1.0, 2.0, 3.0] {
///     bounds.eval(&[Interval::new(0.0, side).expect("in order")], &mut square);
///     assert!(square[0].contains(side * side));
/// }
/// # Ok::<(), lynkeus_expr::MissingInput>(())
/// ```
#[derive(Clone)]
pub struct Evaluator<A: Algebra = Reals> {
    tape: Tape,
    machine: Machine<A>,
}

impl<A: Algebra> fmt::Debug for Evaluator<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Evaluator({} instructions)", self.tape.len())
    }
}

impl<A: Algebra> Evaluator<A> {
    /// The tape.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// Writes the outputs at `inputs`.
    ///
    /// # Panics
    /// If the slices have not the tape's numbers of inputs and outputs.
    pub fn eval(&mut self, inputs: &[A::Value], outputs: &mut [A::Value]) {
        let Self { tape, machine } = self;
        machine.run(&tape.code, inputs);
        assert_eq!(
            outputs.len(),
            tape.outputs(),
            "one place per output of the tape"
        );
        for (output, value) in outputs.iter_mut().zip(machine.outputs(&tape.code)) {
            output.clone_from(value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dead_code_is_left_out_and_registers_are_reused() {
        let g = Graph::new();
        let x = g.symbol("x");
        let _unused = x.exp() + x.cos();
        let sum = (0..50).fold(x, |sum, k| (sum + f64::from(k % 3)).sin());
        let tape = Tape::new(&g, &[x.node()], &[sum.node()]).unwrap();
        assert_eq!(tape.len(), 100);
        assert!(
            tape.registers() <= 1 + 3 + 2,
            "{} registers",
            tape.registers()
        );
    }

    #[test]
    fn a_missing_input_is_named() {
        let g = Graph::new();
        let error = Tape::new(&g, &[], &[g.symbol("pump").node()]).unwrap_err();
        assert_eq!(error.name, "pump");
    }

    #[test]
    fn the_operation_that_makes_a_nan_is_named() {
        let g = Graph::new();
        let x = g.symbol("x");
        let f = (x - 1.0).sqrt() * 2.0 + 1.0;
        let tape = Tape::new(&g, &[x.node()], &[f.node()]).unwrap();
        assert_eq!(tape.first_nonfinite(&g, &[2.0]), None);
        assert_eq!(
            tape.first_nonfinite(&g, &[0.0]).unwrap(),
            "sqrt(x - 1) is NaN"
        );
    }

    #[test]
    fn results_of_a_system_survive_register_reuse() {
        let g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
        let system = [a.exp(), b, c, a + b].map(|e| e.node());
        let solution = g.solve(&system, &[(a * b).node(), (b * c).node()]);
        let x: Vec<_> = solution.x.iter().map(|&x| g.expr(x)).collect();
        let residual = a.exp() * x[0] + b * x[1] - a * b;
        let tape = Tape::new(&g, &[a, b, c].map(|e| e.node()), &[residual.node()]).unwrap();
        let mut out = [1.0];
        tape.evaluator().eval(&[0.3, 0.8, -0.5], &mut out);
        assert!(out[0].abs() < 1e-15);
    }
}
