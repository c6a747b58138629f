//! A tape as a list of values, each defined once.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use lynkeus_expr::{Algebra, Binary, Fused, Implicit, Tape, Unary};

/// A value: its place in [`Program::values`].
pub(crate) type Id = u32;

/// How a value is made. Arguments come before their users.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Input(u32),
    Constant(f64),
    Unary(Unary, Id),
    Binary(Binary, Id, Id),
    Fused(Fused, [Id; 3]),
    Select(Id, Id, Id),
    /// the third where this relation of the first two holds, else the fourth
    Choice(Binary, [Id; 2], Id, Id),
    /// solves the linear system of this index; has no value of its own
    Solve(u32),
    /// (system, which of its n + 1 results)
    Entry(u32, u32),
}

/// What a tape computes, in the order of its instructions.
#[derive(Debug, Default)]
pub(crate) struct Program {
    pub inputs: usize,
    pub values: Vec<Value>,
    /// arguments of the linear systems: A row by row, then b
    pub systems: Vec<Vec<Id>>,
    pub outputs: Vec<Id>,
}

impl Value {
    /// The same of other arguments.
    pub fn with_arguments(self, to: impl Fn(Id) -> Id) -> Self {
        match self {
            Self::Unary(op, a) => Self::Unary(op, to(a)),
            Self::Binary(op, a, b) => Self::Binary(op, to(a), to(b)),
            Self::Fused(op, arguments) => Self::Fused(op, arguments.map(to)),
            Self::Select(c, a, b) => Self::Select(to(c), to(a), to(b)),
            Self::Choice(op, [a, b], x, y) => Self::Choice(op, [to(a), to(b)], to(x), to(y)),
            Self::Input(_) | Self::Constant(_) | Self::Solve(_) | Self::Entry(..) => self,
        }
    }
}

impl Program {
    /// None where the tape has operations that are not compiled.
    pub fn record(tape: &Tape) -> Option<Self> {
        let recorder = Recorder::default();
        let inputs: Vec<Id> = (0..tape.inputs() as u32)
            .map(|i| recorder.push(Value::Input(i)))
            .collect();
        let outputs = tape.eval_in(&recorder, &inputs);
        let mut program = recorder.program.into_inner();
        program.inputs = inputs.len();
        program.outputs = outputs;
        (!recorder.is_beyond.get()).then_some(program)
    }

    /// Whether a value is only there for its users; a linear system is there for its entries.
    pub fn is_pure(value: Value) -> bool {
        !matches!(value, Value::Solve(_))
    }

    /// Hands over the arguments of a value.
    pub fn each_argument(&self, value: Value, mut give: impl FnMut(Id)) {
        match value {
            Value::Input(_) | Value::Constant(_) | Value::Entry(..) => {}
            Value::Unary(_, a) => give(a),
            Value::Binary(_, a, b) => [a, b].into_iter().for_each(give),
            Value::Fused(_, arguments) => arguments.into_iter().for_each(give),
            Value::Select(c, a, b) => [c, a, b].into_iter().for_each(give),
            Value::Choice(_, [a, b], x, y) => [a, b, x, y].into_iter().for_each(give),
            Value::Solve(system) => {
                let arguments = self.systems[system as usize].iter();
                arguments.copied().for_each(give);
            }
        }
    }
}

/// The algebra of instructions: evaluating writes them down.
#[derive(Default)]
struct Recorder {
    program: RefCell<Program>,
    constants: RefCell<HashMap<u64, Id>>,
    /// an operation was met that is not compiled
    is_beyond: Cell<bool>,
}

/// Largest linear system whose place is worth keeping in every frame.
const LARGEST_SYSTEM: usize = 64;

impl Recorder {
    /// What a value is the negative of.
    fn negated(&self, id: Id) -> Option<Id> {
        match self.program.borrow().values[id as usize] {
            Value::Unary(Unary::Neg, x) => Some(x),
            _ => None,
        }
    }

    fn push(&self, value: Value) -> Id {
        let values = &mut self.program.borrow_mut().values;
        values.push(value);
        values.len() as Id - 1
    }
}

impl Algebra for Recorder {
    type Value = Id;

    fn constant(&self, value: f64) -> Id {
        let mut known = self.constants.borrow_mut();
        let new = || self.push(Value::Constant(value));
        *known.entry(value.to_bits()).or_insert_with(new)
    }

    fn unary(&self, op: Unary, x: &Id) -> Id {
        self.push(Value::Unary(op, *x))
    }

    /// By repeated squaring, as the library's own power does.
    fn powi(&self, x: &Id, n: i32) -> Id {
        let one = self.constant(1.0);
        let mut square = *x;
        let mut left = n.unsigned_abs();
        let mut product = None;
        loop {
            if left & 1 != 0 {
                product = Some(match product {
                    Some(p) => self.binary(Binary::Mul, &p, &square),
                    None => square,
                });
            }
            left >>= 1;
            if left == 0 {
                break;
            }
            square = self.binary(Binary::Mul, &square, &square);
        }
        match (product, n < 0) {
            (None, _) => one,
            (Some(p), true) => self.binary(Binary::Div, &one, &p),
            (Some(p), false) => p,
        }
    }

    /// −x + y is y − x, and x − (−y) is x + y, to the bit.
    fn binary(&self, op: Binary, x: &Id, y: &Id) -> Id {
        let (op, x, y) = match (op, self.negated(*x), self.negated(*y)) {
            (Binary::Add, _, Some(y)) => (Binary::Sub, *x, y),
            (Binary::Add, Some(x), None) => (Binary::Sub, *y, x),
            (Binary::Sub, _, Some(y)) => (Binary::Add, *x, y),
            _ => (op, *x, *y),
        };
        self.push(Value::Binary(op, x, y))
    }

    /// A sign of a factor or of the term is one of the operation, to the bit.
    fn fused(&self, op: Fused, x: &Id, y: &Id, z: &Id) -> Id {
        let (mut op, mut factors, mut term) = (op, [*x, *y], *z);
        for factor in &mut factors {
            if let (Some(x), Fused::Add | Fused::From) = (self.negated(*factor), op) {
                *factor = x;
                op = if op == Fused::Add {
                    Fused::From
                } else {
                    Fused::Add
                };
            }
        }
        if let (Some(z), Fused::Add | Fused::Sub) = (self.negated(term), op) {
            term = z;
            op = if op == Fused::Add {
                Fused::Sub
            } else {
                Fused::Add
            };
        }
        let [x, y] = factors;
        self.push(Value::Fused(op, [x, y, term]))
    }

    /// A relation needs not be a number first.
    fn select(&self, condition: &Id, x: &Id, y: &Id) -> Id {
        let condition_value = self.program.borrow().values[*condition as usize];
        self.push(match condition_value {
            Value::Binary(op @ (Binary::Less | Binary::LessEq | Binary::Equal), a, b) => {
                Value::Choice(op, [a, b], *x, *y)
            }
            _ => Value::Select(*condition, *x, *y),
        })
    }

    fn solve(&self, a: &[Id], b: &[Id]) -> (Vec<Id>, Id) {
        if b.len() > LARGEST_SYSTEM {
            self.is_beyond.set(true);
        }
        let system = {
            let systems = &mut self.program.borrow_mut().systems;
            systems.push([a, b].concat());
            systems.len() as u32 - 1
        };
        self.push(Value::Solve(system));
        let x = (0..b.len() as u32)
            .map(|k| self.push(Value::Entry(system, k)))
            .collect();
        (x, self.push(Value::Entry(system, b.len() as u32)))
    }

    /// The interpreter finds roots.
    fn implicit(&self, function: &Implicit, _: &[Id]) -> Vec<Id> {
        self.is_beyond.set(true);
        vec![self.constant(0.0); function.size()]
    }
}
