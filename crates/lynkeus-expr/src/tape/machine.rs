//! What code runs on.

use super::{Code, Instruction, System};
use crate::{Algebra, Binary, Reals};

/// Registers over one algebra, for one [`Code`].
#[derive(Clone)]
pub(super) struct Machine<A: Algebra> {
    algebra: A,
    pub registers: Vec<A::Value>,
    /// the arguments of the system that is being solved
    system: Vec<A::Value>,
}

impl<A: Algebra> Machine<A> {
    /// With the code's constants in their places.
    pub fn new(code: &Code, algebra: A) -> Self {
        let mut registers = vec![algebra.constant(0.0); code.registers];
        let places = registers.iter_mut().skip(code.inputs);
        for (place, &constant) in places.zip(&code.constants) {
            *place = algebra.constant(constant);
        }
        Self {
            algebra,
            registers,
            system: vec![],
        }
    }

    pub fn run(&mut self, code: &Code, inputs: &[A::Value]) {
        self.enter(code, inputs);
        for instruction in &code.instructions {
            self.step(code, instruction);
        }
    }

    pub fn enter(&mut self, code: &Code, inputs: &[A::Value]) {
        assert_eq!(inputs.len(), code.inputs, "one value per input of the tape");
        self.registers[..inputs.len()].clone_from_slice(inputs);
    }

    /// What the outputs' registers hold.
    pub fn outputs<'a>(&'a self, code: &'a Code) -> impl Iterator<Item = &'a A::Value> {
        let outputs = code.outputs.iter();
        outputs.map(|&register| &self.registers[register as usize])
    }

    #[inline(always)]
    pub fn step(&mut self, code: &Code, instruction: &Instruction) {
        let (algebra, r) = (&self.algebra, &mut self.registers[..]);
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
            Instruction::Solve(index) => self.solve(code, index),
        }
    }

    fn solve(&mut self, code: &Code, index: u32) {
        let slots = &code.systems[index as usize];
        let r = &mut self.registers;
        self.system.clear();
        let arguments = slots.arguments.iter();
        self.system
            .extend(arguments.map(|&a| r[a as usize].clone()));
        match &slots.system {
            System::Linear(n) => {
                let (a, x) = self.system.split_at_mut(n * n);
                let rcond = self.algebra.solve_in_place(a, x);
                for &(entry, to) in &slots.results {
                    r[to as usize].clone_from(x.get(entry).unwrap_or(&rcond));
                }
            }
            System::Implicit(function) => {
                let z = self.algebra.implicit(function, &self.system);
                for &(entry, to) in &slots.results {
                    r[to as usize].clone_from(&z[entry]);
                }
            }
        }
    }
}

impl Machine<Reals> {
    /// Why the instruction that was just run found no root, where it looked for one.
    pub fn failure(&self, code: &Code, instruction: &Instruction) -> Option<String> {
        let Instruction::Solve(index) = *instruction else {
            return None;
        };
        match &code.systems[index as usize].system {
            System::Linear(_) => None,
            System::Implicit(function) => function.root(&self.system).err().map(|f| f.to_string()),
        }
    }
}
