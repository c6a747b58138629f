//! From a program to machine code, in one pass: what each operation becomes. Most are a few
//! instructions, with the meaning that they have over `f64`; the others are [called](library).

use lynkeus_expr::{Binary, Fused, Unary};

use crate::assemble::{Assembler, Factors, Mask, Opcode, Operand, Register, Relation};
use crate::library;
use crate::record::{Id, Program, Value};
use crate::registers::{Emitter, TEMPORARY};

/// Bits other than the sign.
const MAGNITUDE: f64 = f64::from_bits(!(1 << 63));

/// Code for a program, of whose inputs the first `shared` stand apart. With `spacing`, the distance in
/// values of the outputs of one group of lanes from those of the next, it goes over many groups.
pub(crate) fn emit<const LANES: usize>(
    program: &Program,
    shared: usize,
    spacing: Option<usize>,
    is_extended: bool,
) -> Emitter<'_, LANES> {
    let calls = program.values.iter().any(|&value| calls::<LANES>(value));
    let assembler = Assembler::new(LANES, is_extended, calls);
    let mut emitter = Emitter::<LANES>::new(program, shared, assembler);
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

/// Whether a value is made by a call.
pub(crate) fn calls<const LANES: usize>(value: Value) -> bool {
    match value {
        Value::Unary(op, _) => library::unary::<LANES>(op).is_some(),
        Value::Binary(op, ..) => library::binary::<LANES>(op).is_some(),
        Value::Solve(_) => true,
        _ => false,
    }
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
            Value::Fused(op, arguments) => self.fused(id, op, arguments),
            Value::Select(c, x, y) => self.select(id, c, x, y),
            Value::Choice(relation, compared, x, y) => {
                let relation = match relation {
                    Binary::Less => Relation::Less,
                    Binary::LessEq => Relation::LessEqual,
                    _ => Relation::Equal,
                };
                self.choose(id, relation, compared, x, y);
            }
        }
        self.finish(id);
    }

    /// A number as a last operand.
    fn number(&mut self, value: f64) -> Operand {
        Operand::Memory(self.constant(value))
    }

    fn unary(&mut self, id: Id, op: Unary, x: Id) {
        let from = self.register(x);
        // it may be the same register
        let to = self.result(id, &[x]);
        match op {
            Unary::Sign => {
                let [zero, one, minus_one] = [0.0, 1.0, -1.0].map(|c| self.number(c));
                let [above, below] = [Mask::First, Mask::Second];
                self.assembler.compare(Relation::Greater, above, from, zero);
                self.assembler.compare(Relation::Less, below, from, zero);
                self.assembler.blend(to, from, one, above);
                self.assembler.blend(to, to, minus_one, below);
            }
            Unary::Not => {
                let zero = self.number(0.0);
                self.assembler
                    .compare(Relation::Equal, Mask::First, from, zero);
                self.hold(to);
            }
            Unary::Sqrt => self.assembler.sqrt(to, from),
            Unary::Floor => self.assembler.floor(to, from),
            Unary::Abs => {
                let magnitude = self.number(MAGNITUDE);
                self.assembler.apply(Opcode::And, to, from, magnitude);
            }
            Unary::Neg => {
                let sign = self.number(-0.0);
                self.assembler.apply(Opcode::Xor, to, from, sign);
            }
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
            Binary::And => self.truth(id, true, x, y),
            Binary::Or => self.truth(id, false, x, y),
            Binary::Min => self.smaller(id, x, y),
            Binary::Max => self.larger(id, x, y),
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

    /// The result takes the place of an argument, of one that is not needed again where there is one. What is not in a
    /// register may be the last operand.
    fn fused(&mut self, id: Id, op: Fused, [x, y, z]: [Id; 3]) {
        let (x, y) = if self.is_elsewhere(x) { (y, x) } else { (x, y) };
        let first = self.register(x);
        if self.is_elsewhere(z) {
            let second = self.register(y);
            let term = self.operand(z);
            let (to, other) = match self.result_in(id, &[x, y, z], &[first, second]) {
                Some(to) if to == second => (to, first),
                Some(to) => (to, second),
                None => (self.result_apart(id), second),
            };
            self.assembler
                .copy(to, if other == first { second } else { first });
            return self
                .assembler
                .fuse(op, Factors::FirstSecond, to, other, term);
        }
        let term = self.register(z);
        let last = self.operand(y);
        let dying: &[Register] = match last {
            Operand::Register(second) => &[term, first, second],
            Operand::Memory(_) => &[term, first],
        };
        let found = self.result_in(id, &[x, y, z], dying);
        let to = found.unwrap_or_else(|| self.result_apart(id));
        let other = Operand::Register(term);
        match last {
            _ if to == term => self
                .assembler
                .fuse(op, Factors::SecondLast, to, first, last),
            Operand::Register(second) if to == second => {
                self.assembler
                    .fuse(op, Factors::FirstSecond, to, first, other);
            }
            Operand::Register(second) if to == first => {
                self.assembler
                    .fuse(op, Factors::FirstSecond, to, second, other);
            }
            _ if to == first => self.assembler.fuse(op, Factors::FirstLast, to, term, last),
            _ => {
                self.assembler.copy(to, term);
                self.assembler
                    .fuse(op, Factors::SecondLast, to, first, last);
            }
        }
    }

    /// The truth value of the first mask.
    fn hold(&mut self, to: Register) {
        let one = self.constant(1.0);
        self.assembler.pick(to, one, Mask::First);
    }

    fn relation(&mut self, id: Id, relation: Relation, x: Id, y: Id) {
        let first = self.register(x);
        let second = self.operand(y);
        self.assembler.compare(relation, Mask::First, first, second);
        let to = self.result(id, &[x, y]);
        self.hold(to);
    }

    /// Anything but zero is true, NaN too.
    fn truth(&mut self, id: Id, is_and: bool, x: Id, y: Id) {
        let (first, second) = (self.register(x), self.register(y));
        let zero = self.number(0.0);
        for (mask, value) in [(Mask::First, first), (Mask::Second, second)] {
            self.assembler
                .compare(Relation::NotEqual, mask, value, zero);
        }
        self.assembler.join(is_and);
        let to = self.result(id, &[x, y]);
        self.hold(to);
    }

    /// The smaller of two values in registers, NaN if either is; of two zeros −0 if one is. An extreme of
    /// the processor is its second operand in these cases: so both orders have the bits between them.
    fn least(&mut self, to: Register, [one, other]: [Register; 2], x: Register, y: Register) {
        self.assembler
            .apply(Opcode::Min, one, x, Operand::Register(y));
        self.assembler
            .apply(Opcode::Min, other, y, Operand::Register(x));
        self.assembler
            .apply(Opcode::Or, to, one, Operand::Register(other));
    }

    fn smaller(&mut self, id: Id, x: Id, y: Id) {
        let (first, second) = (self.register(x), self.register(y));
        let to = self.result(id, &[x, y]);
        self.least(to, TEMPORARY, first, second);
    }

    /// The negative of the smaller one of the negatives.
    fn larger(&mut self, id: Id, x: Id, y: Id) {
        let (first, second) = (self.register(x), self.register(y));
        let to = self.result(id, &[x, y]);
        let sign = self.number(-0.0);
        let [a, b] = TEMPORARY;
        self.assembler.apply(Opcode::Xor, a, first, sign);
        self.assembler.apply(Opcode::Xor, b, second, sign);
        self.least(to, [to, a], a, b);
        self.assembler.apply(Opcode::Xor, to, to, sign);
    }

    /// `if c then x else y`; NaN where nobody knows.
    fn select(&mut self, id: Id, c: Id, x: Id, y: Id) {
        let condition = self.register(c);
        let (first, second) = (self.register(x), self.register(y));
        let [zero, nan] = [0.0, f64::NAN].map(|c| self.number(c));
        let own = Operand::Register(condition);
        self.assembler
            .compare(Relation::NotEqual, Mask::First, condition, zero);
        self.assembler
            .compare(Relation::Unordered, Mask::Second, condition, own);
        let to = self.result(id, &[c, x, y]);
        self.assembler
            .blend(to, second, Operand::Register(first), Mask::First);
        self.assembler.blend(to, to, nan, Mask::Second);
    }

    /// `x` where the relation of `a` and `b` holds, else `y`.
    fn choose(&mut self, id: Id, relation: Relation, [a, b]: [Id; 2], x: Id, y: Id) {
        let (first, second) = (self.register(a), self.operand(b));
        self.assembler.compare(relation, Mask::First, first, second);
        let (yes, no) = (self.register(x), self.register(y));
        let to = self.result(id, &[a, b, x, y]);
        self.assembler
            .blend(to, no, Operand::Register(yes), Mask::First);
    }

    /// Number of unknowns of a system, which has n² + n arguments.
    fn size(&self, system: u32) -> usize {
        self.program.systems[system as usize].len().isqrt()
    }

    fn solve(&mut self, id: Id, system: u32) {
        let arguments = &self.program.systems[system as usize];
        for (i, &argument) in arguments.iter().enumerate() {
            let from = self.source(argument, TEMPORARY[0]);
            self.assembler.store(from, self.place(system, i));
        }
        self.consume(id, arguments);
        self.vacate_all();
        let (place, size) = (self.place(system, 0), self.size(system) as u32);
        self.assembler
            .call_plain(library::solver::<LANES>(), place, size);
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
