//! Where values are while code is emitted: each goes into a register when it is made, and to the
//! frame when its register is needed more urgently by another.

use std::collections::HashMap;

use crate::assemble::{Address, Assembler, Base, Operand, Register};
use crate::record::{Id, Program, Value};

/// Registers for the operations' own use.
pub(crate) const TEMPORARY: [Register; 2] = [14, 15];

/// Registers that values live in, those that are encoded shortly first.
const REGISTERS: [Register; 30] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27,
    28, 29, 30, 31,
];

/// How many values registers hold, with AVX-512 or without.
pub(crate) fn registers(is_extended: bool) -> usize {
    let all = if is_extended { 32 } else { 16 };
    all - TEMPORARY.len()
}

/// Where a value is.
#[derive(Clone, Copy, Default)]
struct Home {
    register: Option<Register>,
    memory: Option<Address>,
    /// a slot of the frame that is the value's own
    slot: Option<usize>,
}

/// The frame is counted in units of one value (one number or four lanes).
pub(crate) struct Emitter<'p, const LANES: usize> {
    pub program: &'p Program,
    pub assembler: Assembler,
    /// what stands in the frame before the first value is made: constants where they are first needed, so
    /// that near places are those in use
    pub frame: Vec<f64>,
    constants: HashMap<u64, Address>,
    /// places whose values are not needed any more
    free: Vec<usize>,
    homes: Vec<Home>,
    holds: [Option<Id>; 32],
    /// the next use of what a register holds; the largest number where there is none
    next: [Id; 32],
    /// those that values live in
    registers: &'static [Register],
    /// every place where a value is used, the next one last
    uses: Vec<Vec<u32>>,
    /// outputs that a value is
    results: Vec<Vec<u32>>,
    /// where each linear system stands in the frame
    systems: Vec<usize>,
    /// a bit for each register that the operation at hand reads
    pinned: u32,
    /// slots that the operation at hand may still read, free from the next one on
    leaving: Vec<usize>,
}

impl<'p, const LANES: usize> Emitter<'p, LANES> {
    /// A place counted from a base, in values.
    fn address(base: Base, place: usize) -> Address {
        let offset = (place * 8 * LANES) as i32;
        Address { base, offset }
    }

    /// With inputs and systems in their places.
    pub fn new(program: &'p Program, shared: usize, assembler: Assembler) -> Self {
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
        let mut emitter = Self {
            program,
            frame: vec![],
            constants: HashMap::new(),
            free: vec![],
            homes: vec![Home::default(); count],
            holds: [None; 32],
            next: [Id::MAX; 32],
            registers: &REGISTERS[..registers(assembler.is_extended)],
            assembler,
            uses,
            results,
            systems: vec![],
            pinned: 0,
            leaving: vec![],
        };
        emitter.place_leaves(shared);
        emitter
    }

    /// Inputs and systems have their places before anything is computed.
    fn place_leaves(&mut self, shared: usize) {
        for (home, &value) in self.homes.iter_mut().zip(&self.program.values) {
            let Value::Input(k) = value else { continue };
            home.memory = Some(match (k as usize).checked_sub(shared) {
                Some(own) => Self::address(Base::Inputs, own),
                None => Self::address(Base::Shared, k as usize),
            });
        }
        for system in &self.program.systems {
            self.systems.push(self.frame.len());
            self.frame.resize(self.frame.len() + system.len() + 1, 0.0);
        }
    }

    /// A new place of the frame.
    fn slot(&mut self, value: f64) -> usize {
        self.frame.push(value);
        self.frame.len() - 1
    }

    /// Where a value stands in memory, if it does.
    fn memory(&mut self, id: Id) -> Option<Address> {
        if let Value::Constant(c) = self.program.values[id as usize] {
            return Some(self.constant(c));
        }
        self.homes[id as usize].memory
    }

    /// Whether a value is to be made: begins its operation. Slots that the operation before it may
    /// still have read are free from now on.
    pub fn begin(&mut self, id: Id, value: Value) -> bool {
        self.free.append(&mut self.leaving);
        let is_idle = self.uses[id as usize].is_empty() && self.results[id as usize].is_empty();
        !(is_idle && Program::is_pure(value))
    }

    /// Ends the operation: writes the value to the outputs that it is.
    pub fn finish(&mut self, id: Id) {
        for output in std::mem::take(&mut self.results[id as usize]) {
            let to = Self::address(Base::Outputs, output as usize);
            let from = self.source(id, TEMPORARY[0]);
            self.assembler.store(from, to);
        }
        self.drop_if_dead(id);
    }

    /// A place of a linear system: its arguments, where the solution stands afterwards.
    pub fn place(&self, system: u32, place: usize) -> Address {
        Self::address(Base::Frame, self.systems[system as usize] + place)
    }

    /// A value stands in memory.
    pub fn stands_at(&mut self, id: Id, address: Address) {
        self.homes[id as usize].memory = Some(address);
    }

    /// The register in which the value is: `temporary`, to which it is loaded, where it is in none.
    pub fn source(&mut self, id: Id, temporary: Register) -> Register {
        match self.homes[id as usize].register {
            Some(register) => register,
            None => self.loaded(id, temporary),
        }
    }

    fn loaded(&mut self, id: Id, to: Register) -> Register {
        // what is in no register is in memory
        if let Some(address) = self.memory(id) {
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
            self.look_ahead(argument);
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
            self.next[register as usize] = Id::MAX;
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
        self.pinned |= 1 << register;
        register
    }

    /// The value as a last operand: in memory where it always stands there or is not used again.
    pub fn operand(&mut self, id: Id) -> Operand {
        let home = self.homes[id as usize];
        let is_leaf = home.slot.is_none();
        match (home.register, self.memory(id)) {
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

    /// Where a number stands in the frame.
    pub fn constant(&mut self, value: f64) -> Address {
        if let Some(&address) = self.constants.get(&value.to_bits()) {
            return address;
        }
        let address = Self::address(Base::Frame, self.slot(value));
        self.constants.insert(value.to_bits(), address);
        address
    }

    /// A register for the result of the operation at hand, whose arguments are consumed.
    pub fn result(&mut self, id: Id, arguments: &[Id]) -> Register {
        self.consume(id, arguments);
        self.pinned = 0;
        let register = self.vacant();
        self.settle(id, register);
        register
    }

    /// As [`Emitter::result`], in the first of these registers that an argument gives back, if one does.
    pub fn result_in(&mut self, id: Id, arguments: &[Id], from: &[Register]) -> Option<Register> {
        self.consume(id, arguments);
        let is_free = |register: &&Register| self.holds[**register as usize].is_none();
        let register = *from.iter().find(is_free)?;
        self.pinned = 0;
        self.settle(id, register);
        Some(register)
    }

    /// After [`Emitter::result_in`] found none: a register that no argument is in.
    pub fn result_apart(&mut self, id: Id) -> Register {
        let register = self.vacant();
        self.pinned = 0;
        self.settle(id, register);
        register
    }

    pub fn settle(&mut self, id: Id, register: Register) {
        self.holds[register as usize] = Some(id);
        self.homes[id as usize].register = Some(register);
        self.look_ahead(id);
    }

    /// Notes when the value of a register is used next.
    fn look_ahead(&mut self, id: Id) {
        if let Some(register) = self.homes[id as usize].register {
            let next = self.uses[id as usize].last();
            self.next[register as usize] = next.copied().unwrap_or(Id::MAX);
        }
    }

    /// A free register; where there is none, that of the value whose next use is farthest.
    fn vacant(&mut self) -> Register {
        // one number to compare, for want of branches: the next use, then the lowest register
        let key = |&r: &Register| match self.pinned >> r & 1 {
            0 => u64::from(self.next[r as usize]) << 8 | u64::from(!r),
            _ => 0,
        };
        let register = !(self.registers.iter().map(key).max().unwrap_or(0) as Register);
        self.vacate(register);
        register
    }

    fn vacate(&mut self, register: Register) {
        if let Some(id) = self.holds[register as usize].take() {
            self.spill(id, register);
            self.homes[id as usize].register = None;
            self.next[register as usize] = Id::MAX;
        }
    }

    /// Sees that a value is in memory.
    fn spill(&mut self, id: Id, register: Register) -> Address {
        if let Some(address) = self.memory(id) {
            return address;
        }
        let slot = self.free.pop().unwrap_or_else(|| self.slot(0.0));
        let address = Self::address(Base::Frame, slot);
        self.assembler.store(register, address);
        let home = &mut self.homes[id as usize];
        (home.memory, home.slot) = (Some(address), Some(slot));
        address
    }

    /// A call changes every register.
    pub fn vacate_all(&mut self) {
        for &register in self.registers {
            self.vacate(register);
        }
        self.pinned = 0;
    }
}
