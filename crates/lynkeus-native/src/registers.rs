//! Where values are while code is emitted: each goes into a register when it is made, and to the
//! frame when its register is needed more urgently by another.

use crate::assemble::{Address, Assembler, Base, Operand, Register};
use crate::record::{Id, Program, Value};

/// Registers that values live in; the two above are for the operations' own use.
const REGISTERS: usize = 14;
pub(crate) const TEMPORARY: [Register; 2] = [14, 15];

/// Where things stand in the frame, in units of one value (one number or four lanes).
#[derive(Debug, Default)]
pub(crate) struct Frame {
    /// the constants stand first
    pub constants: Vec<f64>,
    /// places after the constants
    extra: usize,
    free: Vec<usize>,
}

impl Frame {
    /// A place for a constant; all of them come before the first [`Frame::slot`].
    pub fn constant(&mut self, value: f64) -> usize {
        let is_same = |c: &f64| c.to_bits() == value.to_bits();
        self.constants
            .iter()
            .position(is_same)
            .unwrap_or_else(|| self.add(value))
    }

    /// As [`Frame::constant`], for one that is known to be new.
    pub fn add(&mut self, value: f64) -> usize {
        self.constants.push(value);
        self.constants.len() - 1
    }

    /// A place for a value.
    pub fn slot(&mut self) -> usize {
        self.free.pop().unwrap_or_else(|| self.block(1))
    }

    /// Places side by side.
    pub fn block(&mut self, count: usize) -> usize {
        let first = self.constants.len() + self.extra;
        self.extra += count;
        first
    }

    /// The value of a slot is not needed any more.
    pub fn release(&mut self, slot: usize) {
        self.free.push(slot);
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.constants.len() + self.extra
    }

    /// The address of a place; a value has `bytes` bytes.
    pub fn address(place: usize, bytes: usize) -> Address {
        Address {
            base: Base::Frame,
            offset: (place * bytes) as i32,
        }
    }
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
    pub program: &'p Program,
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

impl<'p, const LANES: usize> Emitter<'p, LANES> {
    const BYTES: usize = 8 * LANES;

    /// With constants, inputs and systems in their places; `constants` are those that the operations
    /// read from memory.
    pub fn new(program: &'p Program, shared: usize, constants: &[f64]) -> Self {
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
            assembler: Assembler::new(LANES > 1),
            frame: Frame::default(),
            homes: vec![Home::default(); count],
            holds: [None; REGISTERS],
            uses,
            results,
            systems: vec![],
            pinned: vec![],
            leaving: vec![],
        };
        emitter.place_leaves(shared, constants);
        emitter
    }

    /// Constants, inputs and systems have their places before anything is computed.
    fn place_leaves(&mut self, shared: usize, constants: &[f64]) {
        for &constant in constants {
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

    /// Whether a value is to be made: begins its operation. Slots that the operation before it may
    /// still have read are free from now on.
    pub fn begin(&mut self, id: Id, value: Value) -> bool {
        for slot in self.leaving.drain(..) {
            self.frame.release(slot);
        }
        let is_idle = self.uses[id as usize].is_empty() && self.results[id as usize].is_empty();
        !(is_idle && Program::is_pure(value))
    }

    /// Ends the operation: writes the value to the outputs that it is.
    pub fn finish(&mut self, id: Id) {
        for output in std::mem::take(&mut self.results[id as usize]) {
            let to = Address {
                base: Base::Outputs,
                offset: (output as usize * Self::BYTES) as i32,
            };
            let from = self.source(id, TEMPORARY[0]);
            self.assembler.store(from, to);
        }
        self.drop_if_dead(id);
    }

    /// A place of a linear system: its arguments, where the solution stands afterwards.
    pub fn place(&self, system: u32, place: usize) -> Address {
        Frame::address(self.systems[system as usize] + place, Self::BYTES)
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

    pub fn settle(&mut self, id: Id, register: Register) {
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
    pub fn vacate_all(&mut self) {
        for register in 0..REGISTERS as Register {
            self.vacate(register);
        }
        self.pinned.clear();
    }
}
