//! From a program to machine code in one pass: each value goes into a register when it is made,
//! and to the frame when its register is needed more urgently by another.

use crate::assemble::{Address, Assembler, Base, Operand, Register, Width};
use crate::frame::Frame;
use crate::library;
use crate::record::{Id, Program, Value};

/// Registers that values live in; the two above are for the operations' own use.
const REGISTERS: usize = 14;
pub(crate) const TEMPORARY: [Register; 2] = [14, 15];

/// What code takes, and how often.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shape {
    /// number of first inputs that stand apart
    pub shared: usize,
    /// distance of the outputs of one group of lanes from those of the next, in values; none for
    /// code that does one group
    pub spacing: Option<usize>,
}

/// What was compiled.
#[derive(Debug)]
pub(crate) struct Emitted {
    pub code: Vec<u8>,
    pub constants: Vec<f64>,
    /// length of the frame, in values
    pub frame: usize,
}

/// Where a value is.
#[derive(Clone, Copy, Default)]
struct Home {
    register: Option<Register>,
    memory: Option<Address>,
    /// a slot of the frame that is the value's own
    slot: Option<usize>,
}

pub(crate) struct Emitter<'p, const LANES: usize> {
    program: &'p Program,
    pub assembler: Assembler,
    pub frame: Frame,
    homes: Vec<Home>,
    holds: [Option<Id>; REGISTERS],
    /// every place where a value is used, the next one last
    uses: Vec<Vec<u32>>,
    /// outputs that a value is
    results: Vec<Vec<u32>>,
    /// where each linear system stands in the frame
    systems: Vec<usize>,
    /// registers that the operation at hand reads
    pinned: Vec<Register>,
    /// slots that the operation at hand may still read, free from the next one on
    leaving: Vec<usize>,
}

/// Code for a program.
pub(crate) fn emit<const LANES: usize>(program: &Program, shape: Shape) -> Emitted {
    let mut emitter = Emitter::<LANES>::new(program, shape.shared);
    emitter.assembler.enter();
    let first = emitter.assembler.bytes.len();
    for (i, &value) in program.values.iter().enumerate() {
        emitter.step(i as Id, value);
    }
    if let Some(spacing) = shape.spacing {
        let own = program.inputs - shape.shared;
        let [inputs, outputs] = [own, spacing].map(|values| (values * 8 * LANES) as i32);
        emitter.assembler.repeat(first, inputs, outputs);
    }
    emitter.assembler.leave();
    Emitted {
        code: emitter.assembler.bytes,
        frame: emitter.frame.len(),
        constants: emitter.frame.constants,
    }
}

impl<'p, const LANES: usize> Emitter<'p, LANES> {
    const BYTES: usize = 8 * LANES;

    fn new(program: &'p Program, shared: usize) -> Self {
        let count = program.values.len();
        let mut results = vec![vec![]; count];
        for (i, &output) in program.outputs.iter().enumerate() {
            results[output as usize].push(i as u32);
        }
        let mut uses: Vec<Vec<u32>> = vec![vec![]; count];
        for (i, &value) in program.values.iter().enumerate().rev() {
            let is_idle = uses[i].is_empty() && results[i].is_empty();
            if is_idle && Program::is_pure(value) {
                continue;
            }
            program.each_argument(value, |argument| uses[argument as usize].push(i as u32));
        }
        let width = if LANES == 1 {
            Width::Scalar
        } else {
            Width::Lanes
        };
        let mut emitter = Self {
            program,
            assembler: Assembler::new(width),
            frame: Frame::default(),
            homes: vec![Home::default(); count],
            holds: [None; REGISTERS],
            uses,
            results,
            systems: vec![],
            pinned: vec![],
            leaving: vec![],
        };
        emitter.place_leaves(shared);
        emitter
    }

    /// Constants, inputs and systems have their places before anything is computed.
    fn place_leaves(&mut self, shared: usize) {
        for constant in crate::operations::CONSTANTS {
            self.frame.constant(constant);
        }
        for (i, &value) in self.program.values.iter().enumerate() {
            self.homes[i].memory = match value {
                Value::Constant(c) => Some(Frame::address(self.frame.add(c), Self::BYTES)),
                Value::Input(k) => {
                    let k = k as usize;
                    let (base, place) = match k.checked_sub(shared) {
                        Some(own) => (Base::Inputs, own),
                        None => (Base::Shared, k),
                    };
                    Some(Address {
                        base,
                        offset: (place * Self::BYTES) as i32,
                    })
                }
                _ => None,
            };
        }
        for system in &self.program.systems {
            self.systems.push(self.frame.block(system.len() + 1));
        }
    }

    fn step(&mut self, id: Id, value: Value) {
        for slot in self.leaving.drain(..) {
            self.frame.release(slot);
        }
        let is_idle = self.uses[id as usize].is_empty() && self.results[id as usize].is_empty();
        if is_idle && Program::is_pure(value) {
            return;
        }
        match value {
            Value::Input(_) | Value::Constant(_) => {}
            Value::Entry(system, k) => {
                let matrix = self.size(system).pow(2);
                let place = self.systems[system as usize] + matrix + k as usize;
                self.homes[id as usize].memory = Some(Frame::address(place, Self::BYTES));
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
        self.deliver(id);
        self.drop_if_dead(id);
    }

    /// Number of unknowns of a system, which has n² + n arguments.
    fn size(&self, system: u32) -> usize {
        let count = self.program.systems[system as usize].len();
        (0..=count).find(|n| n * n + n >= count).unwrap_or(0)
    }

    /// Writes a value to the outputs that it is.
    fn deliver(&mut self, id: Id) {
        for output in std::mem::take(&mut self.results[id as usize]) {
            let to = Address {
                base: Base::Outputs,
                offset: (output as usize * Self::BYTES) as i32,
            };
            let from = match self.homes[id as usize].register {
                Some(register) => register,
                None => self.loaded(id, TEMPORARY[0]),
            };
            self.assembler.store(from, to);
        }
    }

    fn loaded(&mut self, id: Id, to: Register) -> Register {
        // what is in no register is in memory
        if let Some(address) = self.homes[id as usize].memory {
            self.assembler.load(to, address);
        }
        to
    }

    /// The uses of the operation at hand are over; what is not needed again gives its place.
    pub fn consume(&mut self, at: Id, arguments: &[Id]) {
        for &argument in arguments {
            let uses = &mut self.uses[argument as usize];
            while uses.last().is_some_and(|&next| next <= at) {
                uses.pop();
            }
            self.drop_if_dead(argument);
        }
    }

    fn drop_if_dead(&mut self, id: Id) {
        if !self.uses[id as usize].is_empty() {
            return;
        }
        let home = &mut self.homes[id as usize];
        if let Some(register) = home.register.take() {
            self.holds[register as usize] = None;
        }
        if let Some(slot) = home.slot.take() {
            self.leaving.push(slot);
        }
    }

    /// The value in a register, which stays until the operation is over.
    pub fn register(&mut self, id: Id) -> Register {
        let register = match self.homes[id as usize].register {
            Some(register) => register,
            None => {
                let register = self.vacant();
                self.loaded(id, register);
                self.settle(id, register);
                register
            }
        };
        self.pinned.push(register);
        register
    }

    /// The value as a last operand: in memory where it always stands there or is not used again.
    pub fn operand(&mut self, id: Id) -> Operand {
        let home = self.homes[id as usize];
        let is_leaf = home.slot.is_none();
        match (home.register, home.memory) {
            (None, Some(address)) if is_leaf || self.uses[id as usize].len() < 2 => {
                Operand::Memory(address)
            }
            _ => Operand::Register(self.register(id)),
        }
    }

    /// Whether a value is not in a register.
    pub fn is_elsewhere(&self, id: Id) -> bool {
        self.homes[id as usize].register.is_none()
    }

    /// A constant of the operations.
    pub fn constant(&mut self, value: f64) -> Operand {
        let place = self.frame.constant(value);
        Operand::Memory(Frame::address(place, Self::BYTES))
    }

    /// A register for the result of the operation at hand, whose arguments are consumed.
    pub fn result(&mut self, id: Id, arguments: &[Id]) -> Register {
        self.consume(id, arguments);
        self.pinned.clear();
        let register = self.vacant();
        self.settle(id, register);
        register
    }

    fn settle(&mut self, id: Id, register: Register) {
        self.holds[register as usize] = Some(id);
        self.homes[id as usize].register = Some(register);
    }

    /// A free register; where there is none, that of the value whose next use is farthest.
    fn vacant(&mut self) -> Register {
        let next = |holds: &Option<Id>| match holds {
            None => u32::MAX,
            Some(id) => self.uses[*id as usize]
                .last()
                .map_or(u32::MAX, |&use_| use_),
        };
        let open = (0..REGISTERS).filter(|&r| !self.pinned.contains(&(r as Register)));
        let register = open
            .max_by_key(|&r| (next(&self.holds[r]), std::cmp::Reverse(r)))
            .unwrap_or(0) as Register;
        self.vacate(register);
        register
    }

    fn vacate(&mut self, register: Register) {
        if let Some(id) = self.holds[register as usize].take() {
            self.spill(id, register);
            self.homes[id as usize].register = None;
        }
    }

    /// Sees that a value is in memory.
    fn spill(&mut self, id: Id, register: Register) -> Address {
        if let Some(address) = self.homes[id as usize].memory {
            return address;
        }
        let slot = self.frame.slot();
        let address = Frame::address(slot, Self::BYTES);
        self.assembler.store(register, address);
        let home = &mut self.homes[id as usize];
        (home.memory, home.slot) = (Some(address), Some(slot));
        address
    }

    /// A call changes every register.
    fn vacate_all(&mut self) {
        for register in 0..REGISTERS as Register {
            self.vacate(register);
        }
        self.pinned.clear();
    }

    fn solve(&mut self, id: Id, system: u32) {
        let first = self.systems[system as usize];
        let arguments = &self.program.systems[system as usize];
        for (i, &argument) in arguments.iter().enumerate() {
            let from = match self.homes[argument as usize].register {
                Some(register) => register,
                None => self.loaded(argument, TEMPORARY[0]),
            };
            let to = Frame::address(first + i, Self::BYTES);
            self.assembler.store(from, to);
        }
        self.consume(id, arguments);
        self.vacate_all();
        self.assembler.pass(0, Frame::address(first, Self::BYTES));
        self.assembler.pass_number(self.size(system) as u32);
        self.assembler.call(library::solver::<LANES>());
    }

    /// A function: arguments and result go by register, one number or four in each.
    fn call(&mut self, id: Id, function: usize, arguments: &[Id]) {
        // to the temporaries first: an argument may stand where another one goes
        for (&argument, temporary) in arguments.iter().zip(TEMPORARY) {
            match self.homes[argument as usize].register {
                Some(register) => self.assembler.copy(temporary, register),
                None => {
                    self.loaded(argument, temporary);
                }
            }
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
