//! From a graph to straight-line code.

use std::collections::HashMap;

use super::{Code, Instruction, MissingInput, Register, System, SystemSlots};
use crate::{Graph, Node, Op};

/// Linear-scan register allocation over the reachable nodes.
pub(super) struct Compiler<'g> {
    graph: &'g Graph,
    nodes: Vec<Node>,
    register: HashMap<Node, Register>,
    /// how many uses of a node are still to come
    uses: HashMap<Node, usize>,
    free: Vec<Register>,
    code: Code,
}

impl<'g> Compiler<'g> {
    pub fn new(graph: &'g Graph, inputs: &[Node], outputs: &[Node]) -> Result<Self, MissingInput> {
        let nodes = graph.reachable(outputs);
        let mut compiler = Self {
            graph,
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
            for argument in self.graph.arguments(node) {
                *self.uses.entry(argument).or_default() += 1;
            }
        }
        for &output in outputs {
            // never released: one use that does not come
            *self.uses.entry(output).or_default() += 1;
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
        let arguments = self.graph.arguments(node);
        let from: Vec<Register> = arguments.iter().map(|a| self.register[a]).collect();
        let instruction = match op {
            Op::Solve(_) | Op::Implicit(_) => {
                // results must not land on arguments: arguments are released after
                self.code.systems.push(SystemSlots {
                    system: self.system(node),
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

    fn system(&self, node: Node) -> System {
        match self.graph.implicit_call(node) {
            Some(call) => System::Implicit(call.function),
            None => System::Linear(self.graph.system(node).map_or(0, |system| system.size())),
        }
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
