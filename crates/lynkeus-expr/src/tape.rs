//! Graphs compiled to straight-line code.

use std::collections::HashMap;

use crate::{Algebra, Binary, Graph, Node, Op, Reals, Unary};

type Register = u32;

#[derive(Clone, Debug)]
enum Instruction {
    Unary(Unary, Register, Register),
    Powi(i32, Register, Register),
    Binary(Binary, Register, Register, Register),
    Select(Register, Register, Register, Register),
    /// index among the tape's linear systems
    Solve(u32),
}

/// Registers of one linear system: A and b, and where its used results go.
#[derive(Clone, Debug)]
struct SolveSlots {
    n: usize,
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
/// the outputs need is computed and registers are reused.
#[derive(Clone, Debug)]
pub struct Tape {
    inputs: usize,
    /// constants live in the registers after the inputs
    constants: Vec<f64>,
    registers: usize,
    code: Vec<Instruction>,
    /// the node each instruction computes
    sources: Vec<Node>,
    systems: Vec<SolveSlots>,
    outputs: Vec<Register>,
}

impl Tape {
    /// Compiles `outputs` as functions of the symbols `inputs`.
    ///
    /// # Errors
    /// [`MissingInput`] where an output depends on another symbol.
    pub fn new(graph: &Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        Compiler::new(graph, inputs, outputs)?.run(outputs)
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.code.len()
    }

    /// True where nothing has to be computed.
    pub fn is_empty(&self) -> bool {
        self.code.is_empty()
    }

    /// Number of registers: inputs, constants and temporaries.
    pub fn registers(&self) -> usize {
        self.registers
    }

    /// An evaluator over `f64` that owns its registers.
    pub fn evaluator(&self) -> Evaluator {
        let mut registers = vec![0.0; self.registers];
        registers[self.inputs..self.inputs + self.constants.len()].copy_from_slice(&self.constants);
        Evaluator {
            tape: self.clone(),
            registers,
        }
    }

    /// The outputs over any algebra.
    ///
    /// # Panics
    /// If `inputs` has not [`Tape::inputs`] entries.
    pub fn eval_in<A: Algebra>(&self, algebra: &A, inputs: &[A::Value]) -> Vec<A::Value> {
        let mut registers = self.start(algebra, inputs);
        for instruction in &self.code {
            self.step(algebra, instruction, &mut registers);
        }
        let outputs = self.outputs.iter();
        outputs.map(|&r| registers[r as usize].clone()).collect()
    }

    /// Names the first operation that makes a NaN or an infinity out of finite
    /// arguments at these inputs.
    pub fn first_nonfinite(&self, graph: &Graph, inputs: &[f64]) -> Option<String> {
        let mut registers = self.start(&Reals, inputs);
        for (instruction, &source) in self.code.iter().zip(&self.sources) {
            self.step(&Reals, instruction, &mut registers);
            let bad = self
                .written(instruction)
                .find(|&r| !registers[r as usize].is_finite());
            if let Some(register) = bad {
                let value = registers[register as usize];
                return Some(format!("{} is {value}", graph.render(source, 160)));
            }
        }
        None
    }

    fn start<A: Algebra>(&self, algebra: &A, inputs: &[A::Value]) -> Vec<A::Value> {
        assert_eq!(inputs.len(), self.inputs, "one value per input of the tape");
        let mut registers = inputs.to_vec();
        registers.extend(self.constants.iter().map(|&c| algebra.constant(c)));
        registers.resize(self.registers, algebra.constant(0.0));
        registers
    }

    fn written(&self, instruction: &Instruction) -> impl Iterator<Item = Register> {
        let (single, many): (Option<Register>, &[(usize, Register)]) = match instruction {
            Instruction::Unary(_, to, _)
            | Instruction::Powi(_, to, _)
            | Instruction::Binary(_, to, ..)
            | Instruction::Select(to, ..) => (Some(*to), &[]),
            Instruction::Solve(index) => (None, &self.systems[*index as usize].results),
        };
        single.into_iter().chain(many.iter().map(|&(_, r)| r))
    }

    #[inline(always)]
    fn step<A: Algebra>(&self, algebra: &A, instruction: &Instruction, r: &mut [A::Value]) {
        match *instruction {
            Instruction::Unary(op, to, x) => r[to as usize] = algebra.unary(op, &r[x as usize]),
            Instruction::Powi(n, to, x) => r[to as usize] = algebra.powi(&r[x as usize], n),
            Instruction::Binary(op, to, x, y) => {
                r[to as usize] = algebra.binary(op, &r[x as usize], &r[y as usize]);
            }
            Instruction::Select(to, c, x, y) => {
                r[to as usize] = algebra.select(&r[c as usize], &r[x as usize], &r[y as usize]);
            }
            Instruction::Solve(index) => self.solve(algebra, index, r),
        }
    }

    fn solve<A: Algebra>(&self, algebra: &A, index: u32, r: &mut [A::Value]) {
        let slots = &self.systems[index as usize];
        let arguments: Vec<A::Value> = slots
            .arguments
            .iter()
            .map(|&a| r[a as usize].clone())
            .collect();
        let (a, b) = arguments.split_at(slots.n * slots.n);
        let (x, rcond) = algebra.solve(a, b);
        for &(entry, to) in &slots.results {
            r[to as usize] = x.get(entry).unwrap_or(&rcond).clone();
        }
    }
}

/// Evaluates a [`Tape`] over `f64` without allocating (linear systems apart).
#[derive(Clone, Debug)]
pub struct Evaluator {
    tape: Tape,
    registers: Vec<f64>,
}

impl Evaluator {
    /// The tape.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// Writes the outputs at `inputs`.
    ///
    /// # Panics
    /// If the slices have not the tape's numbers of inputs and outputs.
    pub fn eval(&mut self, inputs: &[f64], outputs: &mut [f64]) {
        let tape = &self.tape;
        let registers = &mut self.registers[..];
        registers[..tape.inputs].copy_from_slice(inputs);
        for instruction in &tape.code {
            tape.step(&Reals, instruction, registers);
        }
        assert_eq!(
            outputs.len(),
            tape.outputs.len(),
            "one place per output of the tape"
        );
        for (output, &register) in outputs.iter_mut().zip(&tape.outputs) {
            *output = registers[register as usize];
        }
    }
}

/// Linear-scan register allocation over the reachable nodes.
struct Compiler<'g> {
    graph: &'g Graph,
    nodes: Vec<Node>,
    register: HashMap<Node, Register>,
    /// how many uses of a node are still to come
    uses: HashMap<Node, usize>,
    free: Vec<Register>,
    tape: Tape,
}

impl<'g> Compiler<'g> {
    fn new(graph: &'g Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        let nodes = graph.reachable(outputs);
        let mut compiler = Self {
            graph,
            register: inputs.iter().copied().zip(0..).collect(),
            uses: HashMap::new(),
            free: vec![],
            tape: Tape {
                inputs: inputs.len(),
                constants: vec![],
                registers: inputs.len(),
                code: vec![],
                sources: vec![],
                systems: vec![],
                outputs: vec![],
            },
            nodes,
        };
        compiler.place_leaves(outputs)?;
        compiler.count_uses(outputs);
        Ok(compiler)
    }

    fn place_leaves(&mut self, outputs: &[Node]) -> Result<(), MissingInput> {
        // a system has results but no value of its own
        let valueless = |&&node: &&Node| matches!(self.graph.op(node), Op::Solve(_));
        if let Some(&node) = outputs.iter().find(valueless) {
            let name = self.graph.render(node, 20);
            return Err(MissingInput { name });
        }
        for &node in &self.nodes {
            match self.graph.op(node) {
                Op::Constant(value) => {
                    self.register.insert(node, self.tape.registers as Register);
                    self.tape.constants.push(value);
                    self.tape.registers += 1;
                }
                Op::Symbol(_) if !self.register.contains_key(&node) => {
                    let name = self.graph.symbol_name(node).unwrap_or_default();
                    return Err(MissingInput { name });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn count_uses(&mut self, outputs: &[Node]) {
        for &node in &self.nodes {
            for argument in self.graph.arguments(node) {
                *self.uses.entry(argument).or_default() += 1;
            }
        }
        for &output in outputs {
            // never released: one use that does not come
            *self.uses.entry(output).or_default() += 1;
        }
    }

    fn run(mut self, outputs: &[Node]) -> Result<Tape, MissingInput> {
        for node in std::mem::take(&mut self.nodes) {
            self.emit(node);
        }
        self.tape.outputs = outputs.iter().map(|o| self.register[o]).collect();
        Ok(self.tape)
    }

    fn emit(&mut self, node: Node) {
        let op = self.graph.op(node);
        if let Op::Constant(_) | Op::Symbol(_) = op {
            return;
        }
        if let Op::Entry(solve, entry) = op {
            return self.emit_entry(node, solve, entry);
        }
        let arguments = self.graph.arguments(node);
        let from: Vec<Register> = arguments.iter().map(|a| self.register[a]).collect();
        let instruction = match op {
            Op::Solve(index) => {
                let n = self.graph.system(index).n;
                // results must not land on arguments: arguments are released after
                self.tape.systems.push(SolveSlots {
                    n,
                    arguments: from,
                    results: vec![],
                });
                let index = self.tape.systems.len() as u32 - 1;
                self.register.insert(node, index);
                Instruction::Solve(index)
            }
            Op::Unary(op, _) => Instruction::Unary(op, self.result(node, &arguments), from[0]),
            Op::Powi(_, n) => Instruction::Powi(n, self.result(node, &arguments), from[0]),
            Op::Binary(op, ..) => {
                Instruction::Binary(op, self.result(node, &arguments), from[0], from[1])
            }
            _ => Instruction::Select(self.result(node, &arguments), from[0], from[1], from[2]),
        };
        if let Instruction::Solve(_) = instruction {
            self.release(&arguments);
        }
        self.tape.code.push(instruction);
        self.tape.sources.push(node);
    }

    /// Results of a system are written when it is solved, so each takes a fresh
    /// register: one that was free now might have been busy then.
    fn emit_entry(&mut self, node: Node, solve: Node, entry: u32) {
        let register = self.tape.registers as Register;
        self.tape.registers += 1;
        let system = self.register[&solve];
        self.tape.systems[system as usize]
            .results
            .push((entry as usize, register));
        self.register.insert(node, register);
    }

    /// A register for the result; arguments not needed any more give theirs.
    fn result(&mut self, node: Node, arguments: &[Node]) -> Register {
        self.release(arguments);
        let register = self.free.pop().unwrap_or_else(|| {
            self.tape.registers += 1;
            self.tape.registers as Register - 1
        });
        self.register.insert(node, register);
        register
    }

    fn release(&mut self, arguments: &[Node]) {
        for argument in arguments {
            let Some(left) = self.uses.get_mut(argument) else {
                continue;
            };
            *left -= 1;
            let leaf = matches!(self.graph.op(*argument), Op::Constant(_) | Op::Symbol(_));
            if *left == 0 && !leaf {
                self.free.push(self.register[argument]);
            }
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
