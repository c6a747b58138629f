//! Graphs compiled to straight-line code, and its evaluation.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use crate::code::{Code, Instruction, Register, System, SystemSlots, Tape};
use crate::fuse::Fusion;
use crate::{Algebra, Binary, Graph, Node, Op, Reals};

/// An expression depends on a symbol that is not among the inputs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the expression depends on '{name}', which is not among the inputs of the tape")]
pub struct MissingInput {
    /// name of the symbol
    pub name: String,
}

impl Tape {
    /// Compiles `outputs` as functions of the symbols `inputs`.
    ///
    /// # Errors
    /// [`MissingInput`] where an output depends on another symbol.
    pub fn new(graph: &Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        Self::compiled(graph, inputs, outputs, Fusion::default())
    }

    /// As [`Tape::new`], but a product that nothing reads but sums is part of these: it is not rounded by itself
    /// ([`Algebra::fused`]).
    ///
    /// # Errors
    /// As [`Tape::new`].
    pub fn fused(graph: &Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        Self::compiled(graph, inputs, outputs, Fusion::new(graph, outputs))
    }

    fn compiled(
        graph: &Graph,
        inputs: &[Node],
        outputs: &[Node],
        fusion: Fusion,
    ) -> Result<Self, MissingInput> {
        let code = Compiler::new(graph, inputs, outputs, fusion)?.run(outputs);
        Ok(Self {
            code: Arc::new(code),
        })
    }

    /// An evaluator over the numbers.
    pub fn evaluator(&self) -> Evaluator {
        self.evaluator_in(Reals)
    }

    /// An evaluator over any algebra, for many evaluations: it keeps its registers.
    pub fn evaluator_in<A: Algebra>(&self, algebra: A) -> Evaluator<A> {
        Evaluator {
            registers: self.code.memory(&algebra),
            algebra,
            tape: self.clone(),
        }
    }

    /// The outputs over any algebra, once.
    ///
    /// # Panics
    /// If `inputs` has not [`Tape::inputs`] entries.
    pub fn eval_in<A: Algebra>(&self, algebra: &A, inputs: &[A::Value]) -> Vec<A::Value> {
        let mut registers = self.code.memory(algebra);
        self.code.run(algebra, &mut registers, inputs);
        let outputs = self.code.outputs.iter();
        outputs.map(|&r| registers[r as usize].clone()).collect()
    }

    /// Names the first operation that makes a NaN or an infinity out of finite
    /// arguments at these inputs; of an algebraic loop also how the search ended.
    pub fn first_nonfinite(&self, graph: &Graph, inputs: &[f64]) -> Option<String> {
        let code = &*self.code;
        let mut registers = code.memory(&Reals);
        registers[..code.inputs].copy_from_slice(inputs);
        for (instruction, &source) in code.instructions.iter().zip(&code.sources) {
            code.step(&Reals, &mut registers, instruction);
            // no instruction writes to inputs and constants, and those before wrote numbers
            let first = code.inputs + code.constants.len();
            let mut written = registers[first..code.registers].iter();
            if let Some(value) = written.find(|value| !value.is_finite()) {
                let failure = code.failure(instruction, &registers);
                let failure = failure.map_or_else(String::new, |how| format!(": {how}"));
                return Some(format!("{} is {value}{failure}", graph.render(source, 160)));
            }
        }
        None
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
    algebra: A,
    registers: Vec<A::Value>,
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
        let code = &*self.tape.code;
        let places = code.outputs.len();
        assert_eq!(outputs.len(), places, "one place per output of the tape");
        code.run(&self.algebra, &mut self.registers, inputs);
        for (output, &register) in outputs.iter_mut().zip(&code.outputs) {
            output.clone_from(&self.registers[register as usize]);
        }
    }

    /// The value at `inputs` of a tape's first output, or only one.
    ///
    /// # Panics
    /// If `inputs` has not [`Tape::inputs`] entries, or the tape has no output.
    pub fn value(&mut self, inputs: &[A::Value]) -> A::Value {
        let code = &*self.tape.code;
        code.run(&self.algebra, &mut self.registers, inputs);
        self.registers[code.outputs[0] as usize].clone()
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
    fusion: Fusion,
    code: Code,
}

impl<'g> Compiler<'g> {
    pub fn new(
        graph: &'g Graph,
        inputs: &[Node],
        outputs: &[Node],
        fusion: Fusion,
    ) -> Result<Self, MissingInput> {
        let mut nodes = graph.reachable(outputs);
        nodes.retain(|node| !fusion.is_part(*node));
        let mut compiler = Self {
            graph,
            fusion,
            register: inputs.iter().copied().zip(0..).collect(),
            uses: HashMap::new(),
            free: vec![],
            code: Code {
                inputs: inputs.len(),
                registers: inputs.len(),
                ..Code::default()
            },
            nodes,
        };
        compiler.place_leaves(outputs)?;
        compiler.count_uses(outputs);
        Ok(compiler)
    }

    fn place_leaves(&mut self, outputs: &[Node]) -> Result<(), MissingInput> {
        // a system has results but no value of its own
        let valueless = |&&node: &&Node| self.graph.op(node).is_system();
        if let Some(&node) = outputs.iter().find(valueless) {
            let name = self.graph.render(node, 20);
            return Err(MissingInput { name });
        }
        for &node in &self.nodes {
            match self.graph.op(node) {
                Op::Constant(value) => {
                    self.register.insert(node, self.code.registers as Register);
                    self.code.constants.push(value);
                    self.code.registers += 1;
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
            for argument in self.arguments(node) {
                *self.uses.entry(argument).or_default() += 1;
            }
        }
        for &output in outputs {
            // never released: one use that does not come
            *self.uses.entry(output).or_default() += 1;
        }
    }

    /// What the instruction of a node reads.
    fn arguments(&self, node: Node) -> Vec<Node> {
        match self.fusion.sum(node) {
            Some((_, arguments)) => arguments.to_vec(),
            None => self.graph.arguments(node),
        }
    }

    pub fn run(mut self, outputs: &[Node]) -> Code {
        for node in std::mem::take(&mut self.nodes) {
            self.emit(node);
        }
        self.code.outputs = outputs.iter().map(|o| self.register[o]).collect();
        self.code
    }

    fn emit(&mut self, node: Node) {
        let op = self.graph.op(node);
        if let Op::Constant(_) | Op::Symbol(_) = op {
            return;
        }
        if let Op::Entry(solve, entry) = op {
            return self.emit_entry(node, solve, entry);
        }
        let arguments = self.arguments(node);
        let from: Vec<Register> = arguments.iter().map(|a| self.register[a]).collect();
        let fused = self.fusion.sum(node);
        let instruction = match op {
            _ if let Some((op, _)) = fused => Instruction::Fused(
                op,
                self.result(node, &arguments),
                [from[0], from[1], from[2]],
            ),
            Op::System(_) => {
                // results must not land on arguments: arguments are released after
                self.code.room = self.code.room.max(from.len());
                let system = self.graph.system(node).map(|call| call.system);
                self.code.systems.push(SystemSlots {
                    system: system.unwrap_or(System::Linear(0)),
                    arguments: from,
                    results: vec![],
                });
                let index = self.code.systems.len() as u32 - 1;
                self.register.insert(node, index);
                Instruction::Solve(index)
            }
            Op::Unary(op, _) => Instruction::Unary(op, self.result(node, &arguments), from[0]),
            Op::Powi(_, n) => Instruction::Powi(n, self.result(node, &arguments), from[0]),
            Op::Binary(op, ..) => {
                Instruction::binary(op, self.result(node, &arguments), from[0], from[1])
            }
            _ => Instruction::Select(self.result(node, &arguments), from[0], from[1], from[2]),
        };
        if let Instruction::Solve(_) = instruction {
            self.release(&arguments);
        }
        self.code.instructions.push(instruction);
        self.code.sources.push(node);
    }

    /// Results of a system are written when it is solved, so each takes a fresh
    /// register: one that was free now might have been busy then.
    fn emit_entry(&mut self, node: Node, solve: Node, entry: u32) {
        let register = self.code.registers as Register;
        self.code.registers += 1;
        let system = self.register[&solve];
        self.code.systems[system as usize]
            .results
            .push((entry as usize, register));
        self.register.insert(node, register);
    }

    /// A register for the result; arguments not needed any more give theirs.
    fn result(&mut self, node: Node, arguments: &[Node]) -> Register {
        self.release(arguments);
        let register = self.free.pop().unwrap_or_else(|| {
            self.code.registers += 1;
            self.code.registers as Register - 1
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

/// Evaluation over registers that hold the values of one algebra.
impl Code {
    /// Registers with the constants in their places.
    fn memory<A: Algebra>(&self, algebra: &A) -> Vec<A::Value> {
        let mut registers = vec![algebra.constant(0.0); self.registers + self.room];
        let places = registers.iter_mut().skip(self.inputs);
        for (place, &constant) in places.zip(&self.constants) {
            *place = algebra.constant(constant);
        }
        registers
    }

    fn run<A: Algebra>(&self, algebra: &A, r: &mut [A::Value], inputs: &[A::Value]) {
        assert_eq!(inputs.len(), self.inputs, "one value per input of the tape");
        r[..inputs.len()].clone_from_slice(inputs);
        for instruction in &self.instructions {
            self.step(algebra, r, instruction);
        }
    }

    #[inline(always)]
    fn step<A: Algebra>(&self, algebra: &A, r: &mut [A::Value], instruction: &Instruction) {
        match *instruction {
            Instruction::Add(to, x, y) => {
                r[to as usize] = algebra.binary(Binary::Add, &r[x as usize], &r[y as usize]);
            }
            Instruction::Sub(to, x, y) => {
                r[to as usize] = algebra.binary(Binary::Sub, &r[x as usize], &r[y as usize]);
            }
            Instruction::Mul(to, x, y) => {
                r[to as usize] = algebra.binary(Binary::Mul, &r[x as usize], &r[y as usize]);
            }
            Instruction::Div(to, x, y) => {
                r[to as usize] = algebra.binary(Binary::Div, &r[x as usize], &r[y as usize]);
            }
            Instruction::Unary(op, to, x) => r[to as usize] = algebra.unary(op, &r[x as usize]),
            Instruction::Powi(n, to, x) => r[to as usize] = algebra.powi(&r[x as usize], n),
            Instruction::Binary(op, to, x, y) => {
                r[to as usize] = algebra.binary(op, &r[x as usize], &r[y as usize]);
            }
            Instruction::Select(to, c, x, y) => {
                r[to as usize] = algebra.select(&r[c as usize], &r[x as usize], &r[y as usize]);
            }
            Instruction::Fused(op, to, [x, y, z]) => {
                let [x, y, z] = [x, y, z].map(|from| &r[from as usize]);
                r[to as usize] = algebra.fused(op, x, y, z);
            }
            Instruction::Solve(index) => self.solve(algebra, r, index),
        }
    }

    /// The arguments are copied to the room behind the registers.
    fn solve<A: Algebra>(&self, algebra: &A, r: &mut [A::Value], index: u32) {
        let slots = &self.systems[index as usize];
        let (r, room) = r.split_at_mut(self.registers);
        let room = &mut room[..slots.arguments.len()];
        for (place, &argument) in room.iter_mut().zip(&slots.arguments) {
            place.clone_from(&r[argument as usize]);
        }
        match &slots.system {
            System::Linear(n) => {
                let (a, x) = room.split_at_mut(n * n);
                let rcond = algebra.solve_in_place(a, x);
                for &(entry, to) in &slots.results {
                    r[to as usize].clone_from(x.get(entry).unwrap_or(&rcond));
                }
            }
            System::Implicit(function) => {
                let z = algebra.implicit(function, room);
                for &(entry, to) in &slots.results {
                    r[to as usize].clone_from(&z[entry]);
                }
            }
        }
    }

    /// Why the instruction that was just run found no root, where it looked for one.
    fn failure(&self, instruction: &Instruction, r: &[f64]) -> Option<String> {
        let Instruction::Solve(index) = *instruction else {
            return None;
        };
        let slots = &self.systems[index as usize];
        match &slots.system {
            System::Linear(_) => None,
            System::Implicit(function) => {
                let p = &r[self.registers..][..slots.arguments.len()];
                function.root(p).err()
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
