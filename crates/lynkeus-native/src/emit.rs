//! From a program to machine code, in one pass: what each operation becomes. Most are a few
//! instructions, with the meaning that they have over `f64`; the others are [called](library).

use lynkeus_expr::{Binary, Unary};

use crate::assemble::{Opcode, Operand, Register, Relation};
use crate::library;
use crate::record::{Id, Program, Value};
use crate::registers::{Emitter, TEMPORARY};

/// Bits other than the sign.
const MAGNITUDE: f64 = f64::from_bits(!(1 << 63));

/// What the operations read from memory: the frame has to know them beforehand.
const CONSTANTS: [f64; 6] = [-0.0, MAGNITUDE, 0.0, 1.0, -1.0, f64::NAN];

const MASK: Register = TEMPORARY[0];
const OTHER: Register = TEMPORARY[1];

/// Code for a program, of whose inputs the first `shared` stand apart. With `spacing`, the distance in
/// values of the outputs of one group of lanes from those of the next, it goes over many groups.
pub(crate) fn emit<const LANES: usize>(
    program: &Program,
    shared: usize,
    spacing: Option<usize>,
) -> Emitter<'_, LANES> {
    let mut emitter = Emitter::<LANES>::new(program, shared, &CONSTANTS);
    emitter.assembler.enter();
    let first = emitter.assembler.bytes.len();
    for (i, &value) in program.values.iter().enumerate() {
        emitter.step(i as Id, value);
    }
    if let Some(spacing) = spacing {
        let own = program.inputs - shared;
        let [inputs, outputs] = [own, spacing].map(|values| (values * 8 * LANES) as i32);
        emitter.assembler.repeat(first, inputs, outputs);
    }
    emitter.assembler.leave();
    emitter
}

impl<const LANES: usize> Emitter<'_, LANES> {
    fn step(&mut self, id: Id, value: Value) {
        if !self.begin(id, value) {
            return;
        }
        match value {
            Value::Input(_) | Value::Constant(_) => {}
            Value::Entry(system, k) => {
                let matrix = self.size(system).pow(2);
                self.stands_at(id, self.place(system, matrix + k as usize));
            }
            Value::Solve(system) => self.solve(id, system),
            Value::Unary(op, x) => match library::unary::<LANES>(op) {
                Some(function) => self.call(id, function, &[x]),
                None => self.unary(id, op, x),
            },
            Value::Binary(op, x, y) => match library::binary::<LANES>(op) {
                Some(function) => self.call(id, function, &[x, y]),
                None => self.binary(id, op, x, y),
            },
            Value::Select(c, x, y) => self.select(id, c, x, y),
        }
        self.finish(id);
    }

    fn unary(&mut self, id: Id, op: Unary, x: Id) {
        let from = self.register(x);
        // it may be the same register
        let to = self.result(id, &[x]);
        let [zero, one, sign, magnitude] = [0.0, 1.0, -0.0, MAGNITUDE].map(|c| self.constant(c));
        match op {
            Unary::Sign => {
                let minus_one = self.constant(-1.0);
                self.assembler.compare(Relation::Greater, MASK, from, zero);
                self.assembler.compare(Relation::Less, OTHER, from, zero);
                self.assembler.blend(to, from, one, MASK);
                self.assembler.blend(to, to, minus_one, OTHER);
            }
            Unary::Not => {
                self.assembler.compare(Relation::Equal, MASK, from, zero);
                self.assembler.apply(Opcode::And, to, MASK, one);
            }
            Unary::Sqrt => self.assembler.sqrt(to, from),
            Unary::Floor => self.assembler.floor(to, from),
            Unary::Abs => self.assembler.apply(Opcode::And, to, from, magnitude),
            Unary::Neg => self.assembler.apply(Opcode::Xor, to, from, sign),
            // called, as `library` has them; named, so that a new operation does not compile before it has a place
            Unary::Exp
            | Unary::Ln
            | Unary::Sin
            | Unary::Cos
            | Unary::Tan
            | Unary::Asin
            | Unary::Acos
            | Unary::Atan
            | Unary::Sinh
            | Unary::Cosh
            | Unary::Tanh => {}
        }
    }

    fn binary(&mut self, id: Id, op: Binary, x: Id, y: Id) {
        match op {
            Binary::Add => self.arithmetic(id, Opcode::Add, x, y),
            Binary::Sub => self.arithmetic(id, Opcode::Sub, x, y),
            Binary::Mul => self.arithmetic(id, Opcode::Mul, x, y),
            Binary::Div => self.arithmetic(id, Opcode::Div, x, y),
            Binary::Less => self.relation(id, Relation::Less, x, y),
            Binary::LessEq => self.relation(id, Relation::LessEqual, x, y),
            Binary::Equal => self.relation(id, Relation::Equal, x, y),
            Binary::And => self.truth(id, Opcode::And, x, y),
            Binary::Or => self.truth(id, Opcode::Or, x, y),
            Binary::Min => self.extreme(id, Relation::Less, Opcode::And, x, y),
            Binary::Max => self.extreme(id, Relation::Greater, Opcode::AndNot, x, y),
            // called
            Binary::Pow | Binary::Atan2 => {}
        }
    }

    fn arithmetic(&mut self, id: Id, op: Opcode, x: Id, y: Id) {
        // a value that is in a register already comes first where the order is free
        let commutes = matches!(op, Opcode::Add | Opcode::Mul);
        let (x, y) = if commutes && self.is_elsewhere(x) && !self.is_elsewhere(y) {
            (y, x)
        } else {
            (x, y)
        };
        let first = self.register(x);
        let second = self.operand(y);
        let to = self.result(id, &[x, y]);
        self.assembler.apply(op, to, first, second);
    }

    fn relation(&mut self, id: Id, relation: Relation, x: Id, y: Id) {
        let first = self.register(x);
        let second = self.operand(y);
        let one = self.constant(1.0);
        self.assembler.compare(relation, MASK, first, second);
        let to = self.result(id, &[x, y]);
        self.assembler.apply(Opcode::And, to, MASK, one);
    }

    /// Anything but zero is true, NaN too.
    fn truth(&mut self, id: Id, op: Opcode, x: Id, y: Id) {
        let (first, second) = (self.register(x), self.register(y));
        let [zero, one] = [0.0, 1.0].map(|c| self.constant(c));
        self.assembler
            .compare(Relation::NotEqual, MASK, first, zero);
        self.assembler
            .compare(Relation::NotEqual, OTHER, second, zero);
        self.assembler
            .apply(op, MASK, MASK, Operand::Register(OTHER));
        let to = self.result(id, &[x, y]);
        self.assembler.apply(Opcode::And, to, MASK, one);
    }

    /// The smaller or the larger one, NaN if either is. Of two zeros the one whose sign is the
    /// extreme: `pick` takes x's sign where both are equal.
    fn extreme(&mut self, id: Id, relation: Relation, pick: Opcode, x: Id, y: Id) {
        let (first, second) = (self.register(x), self.register(y));
        let nan = self.constant(f64::NAN);
        let y_value = Operand::Register(second);
        self.assembler.compare(relation, MASK, first, y_value);
        self.assembler
            .compare(Relation::Equal, OTHER, first, y_value);
        self.assembler
            .apply(pick, OTHER, first, Operand::Register(OTHER));
        self.assembler
            .apply(Opcode::Or, MASK, MASK, Operand::Register(OTHER));
        self.assembler
            .compare(Relation::Unordered, OTHER, first, y_value);
        let to = self.result(id, &[x, y]);
        self.assembler
            .blend(to, second, Operand::Register(first), MASK);
        self.assembler.blend(to, to, nan, OTHER);
    }

    /// `if c then x else y`; NaN where nobody knows.
    fn select(&mut self, id: Id, c: Id, x: Id, y: Id) {
        let condition = self.register(c);
        let (first, second) = (self.register(x), self.register(y));
        let [zero, nan] = [0.0, f64::NAN].map(|c| self.constant(c));
        self.assembler
            .compare(Relation::NotEqual, MASK, condition, zero);
        self.assembler.compare(
            Relation::Unordered,
            OTHER,
            condition,
            Operand::Register(condition),
        );
        let to = self.result(id, &[c, x, y]);
        self.assembler
            .blend(to, second, Operand::Register(first), MASK);
        self.assembler.blend(to, to, nan, OTHER);
    }

    /// Number of unknowns of a system, which has n² + n arguments.
    fn size(&self, system: u32) -> usize {
        self.program.systems[system as usize].len().isqrt()
    }

    fn solve(&mut self, id: Id, system: u32) {
        let arguments = &self.program.systems[system as usize];
        for (i, &argument) in arguments.iter().enumerate() {
            let from = self.source(argument, MASK);
            self.assembler.store(from, self.place(system, i));
        }
        self.consume(id, arguments);
        self.vacate_all();
        self.assembler.pass(0, self.place(system, 0));
        self.assembler.pass_number(self.size(system) as u32);
        self.assembler.call(library::solver::<LANES>());
    }

    /// A function: arguments and result go by register, one number or four in each.
    fn call(&mut self, id: Id, function: usize, arguments: &[Id]) {
        // to the temporaries first: an argument may stand where another one goes
        for (&argument, temporary) in arguments.iter().zip(TEMPORARY) {
            let from = self.source(argument, temporary);
            self.assembler.copy(temporary, from);
        }
        self.consume(id, arguments);
        self.vacate_all();
        for (to, from) in (0..).zip(TEMPORARY).take(arguments.len()) {
            self.assembler.copy(to, from);
        }
        self.assembler.call(function);
        self.settle(id, 0);
    }
}
