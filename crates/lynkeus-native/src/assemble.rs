//! Encodings of the AVX instructions that are used (Intel 64 and IA-32 Architectures Software
//! Developer's Manual, volume 2).

/// A vector register, 0 to 15.
pub(crate) type Register = u8;

/// What an address is counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    /// rbx
    Inputs,
    /// r14
    Outputs,
    /// r13
    Frame,
    /// r15
    Shared,
}

impl Base {
    fn number(self) -> u8 {
        match self {
            Self::Inputs => 3,
            Self::Outputs => 14,
            Self::Frame => 13,
            Self::Shared => 15,
        }
    }
}

/// A place in memory: bytes from a base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Address {
    pub base: Base,
    pub offset: i32,
}

/// The last operand of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operand {
    Register(Register),
    Memory(Address),
}

/// The opcode maps of the VEX prefix.
const OF: u8 = 1;
const OF_3A: u8 = 3;

/// Relations of `vcmp`; a NaN makes all false but [`Relation::NotEqual`] and
/// [`Relation::Unordered`].
#[derive(Clone, Copy)]
pub(crate) enum Relation {
    Equal = 0x00,
    Less = 0x11,
    LessEqual = 0x12,
    Unordered = 0x03,
    NotEqual = 0x04,
    Greater = 0x1e,
}

/// Three-operand arithmetic and logic, by the opcode.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Opcode {
    Add = 0x58,
    Mul = 0x59,
    Sub = 0x5c,
    Div = 0x5e,
    And = 0x54,
    /// not the first, and the second
    AndNot = 0x55,
    Or = 0x56,
    Xor = 0x57,
}

const PACKED: u8 = 1;
const SCALAR: u8 = 3;

/// Machine code that grows.
pub(crate) struct Assembler {
    pub bytes: Vec<u8>,
    /// four numbers in a register, not one
    is_wide: bool,
}

impl Assembler {
    pub fn new(is_wide: bool) -> Self {
        let bytes = vec![];
        Self { bytes, is_wide }
    }

    /// pp and L of arithmetic.
    fn numbers(&self) -> (u8, u8) {
        if self.is_wide {
            (PACKED, 1)
        } else {
            (SCALAR, 0)
        }
    }

    /// pp and L of what is done bit by bit.
    fn bits(&self) -> (u8, u8) {
        (PACKED, u8::from(self.is_wide))
    }

    /// `vvvv` is 0 where the instruction has no second operand.
    fn vex(&mut self, (pp, l): (u8, u8), map: u8, opcode: u8, reg: u8, vvvv: u8, rm: Operand) {
        let base = match rm {
            Operand::Register(r) => r,
            Operand::Memory(address) => address.base.number(),
        };
        let inverted = |number: u8, bit: u8| (!number >> 3 & 1) << bit;
        self.bytes.extend([
            0xc4,
            inverted(reg, 7) | 1 << 6 | inverted(base, 5) | map,
            (!vvvv & 15) << 3 | l << 2 | pp,
            opcode,
        ]);
        let low = (reg & 7) << 3 | base & 7;
        match rm {
            Operand::Register(_) => self.bytes.push(0xc0 | low),
            Operand::Memory(address) => {
                self.bytes.push(0x80 | low);
                self.bytes.extend(address.offset.to_le_bytes());
            }
        }
    }

    pub fn load(&mut self, to: Register, from: Address) {
        self.vex(self.numbers(), OF, 0x10, to, 0, Operand::Memory(from));
    }

    pub fn store(&mut self, from: Register, to: Address) {
        self.vex(self.numbers(), OF, 0x11, from, 0, Operand::Memory(to));
    }

    /// From one register to another.
    pub fn copy(&mut self, to: Register, from: Register) {
        if to != from {
            self.vex(self.bits(), OF, 0x28, to, 0, Operand::Register(from));
        }
    }

    pub fn apply(&mut self, op: Opcode, to: Register, x: Register, y: Operand) {
        use Opcode::{Add, Div, Mul, Sub};
        let prefix = match matches!(op, Add | Mul | Sub | Div) {
            true => self.numbers(),
            false => self.bits(),
        };
        self.vex(prefix, OF, op as u8, to, x, y);
    }

    /// All bits where the relation holds, else none.
    pub fn compare(&mut self, relation: Relation, to: Register, x: Register, y: Operand) {
        self.vex(self.numbers(), OF, 0xc2, to, x, y);
        self.bytes.push(relation as u8);
    }

    /// `y` where the mask's sign is set, else `x`.
    pub fn blend(&mut self, to: Register, x: Register, y: Operand, mask: Register) {
        self.vex(self.bits(), OF_3A, 0x4b, to, x, y);
        self.bytes.push(mask << 4);
    }

    pub fn sqrt(&mut self, to: Register, x: Register) {
        // the scalar form takes its upper half from a second operand
        let upper = if self.is_wide { 0 } else { x };
        self.vex(self.numbers(), OF, 0x51, to, upper, Operand::Register(x));
    }

    pub fn floor(&mut self, to: Register, x: Register) {
        let (opcode, upper) = if self.is_wide { (0x09, 0) } else { (0x0b, x) };
        let from = Operand::Register(x);
        self.vex(self.bits(), OF_3A, opcode, to, upper, from);
        // toward −∞, without the inexact flag
        self.bytes.push(9);
    }

    /// Saves what the caller owns, and takes the four pointers and the number of groups.
    pub fn enter(&mut self) {
        // push rbx, r12, r13, r14, r15: aligns the stack
        self.bytes
            .extend([0x53, 0x41, 0x54, 0x41, 0x55, 0x41, 0x56, 0x41, 0x57]);
        self.bytes.extend([0x48, 0x89, 0xfb]); // mov rbx, rdi
        self.bytes.extend([0x49, 0x89, 0xf6]); // mov r14, rsi
        self.bytes.extend([0x49, 0x89, 0xd5]); // mov r13, rdx
        self.bytes.extend([0x49, 0x89, 0xcf]); // mov r15, rcx
        self.bytes.extend([0x4d, 0x89, 0xc4]); // mov r12, r8
    }

    /// Goes back to `first` with the next inputs and outputs, so many bytes further, until every
    /// group is done.
    pub fn repeat(&mut self, first: usize, inputs: i32, outputs: i32) {
        self.bytes.extend([0x48, 0x81, 0xc3]); // add rbx, inputs
        self.bytes.extend(inputs.to_le_bytes());
        self.bytes.extend([0x49, 0x81, 0xc6]); // add r14, outputs
        self.bytes.extend(outputs.to_le_bytes());
        self.bytes.extend([0x49, 0xff, 0xcc]); // dec r12
        self.bytes.extend([0x0f, 0x85]); // jnz first
        let next = self.bytes.len() + 4;
        self.bytes
            .extend((first as i32 - next as i32).to_le_bytes());
    }

    pub fn leave(&mut self) {
        self.bytes.extend([0xc5, 0xf8, 0x77]); // vzeroupper
        // pop r15, r14, r13, r12, rbx; ret
        self.bytes
            .extend([0x41, 0x5f, 0x41, 0x5e, 0x41, 0x5d, 0x41, 0x5c, 0x5b, 0xc3]);
    }

    /// Calls what stands at an absolute address.
    pub fn call(&mut self, target: usize) {
        self.bytes.extend([0x48, 0xb8]); // mov rax, target
        self.bytes.extend((target as u64).to_le_bytes());
        self.bytes.extend([0xff, 0xd0]); // call rax
    }

    /// The next integer arguments of a call (rdi, rsi, rdx): addresses.
    pub fn pass(&mut self, argument: usize, address: Address) {
        const NUMBERS: [u8; 3] = [7, 6, 2];
        let base = address.base.number();
        self.bytes.extend([
            0x48 | base >> 3,
            0x8d,
            0x80 | NUMBERS[argument] << 3 | base & 7,
        ]);
        self.bytes.extend(address.offset.to_le_bytes());
    }

    /// The second integer argument of a call (esi): a number.
    pub fn pass_number(&mut self, number: u32) {
        self.bytes.push(0xbe);
        self.bytes.extend(number.to_le_bytes());
    }
}
