//! Encodings of the vector instructions that are used (Intel 64 and IA-32 Architectures Software
//! Developer's Manual, volume 2): VEX, and EVEX where there is AVX-512. How many numbers a register holds
//! is data; instructions of both widths are written by the same lines.

use lynkeus_expr::Fused;

/// A vector register, 0 to 15, to 31 with AVX-512.
pub(crate) type Register = u8;

/// What an address is counted from: a register that holds a pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    Inputs,
    Outputs,
    Frame,
    Shared,
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

/// Where a comparison's result goes, one of two: a mask register with AVX-512, else a temporary.
#[derive(Clone, Copy)]
pub(crate) enum Mask {
    First,
    Second,
}

/// The opcode maps of the prefixes.
const OF: u8 = 1;
const OF_38: u8 = 2;
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
    Or = 0x56,
    Xor = 0x57,
    /// the second operand where either is NaN or both are zero
    Min = 0x5d,
}

const PACKED: u8 = 1;
const SCALAR: u8 = 3;

/// Which operands of [`Assembler::fuse`] are factors: of the destination, the second and the last one, those that the
/// digits name; the other one is the term.
#[derive(Clone, Copy)]
pub(crate) enum Factors {
    FirstLast = 0x98,
    FirstSecond = 0xa8,
    SecondLast = 0xb8,
}

/// How an instruction is encoded.
#[derive(Clone, Copy)]
struct Form {
    /// the prefix that it would have without VEX
    pp: u8,
    /// length of the registers: 128, 256 or 512 bits
    length: u8,
    map: u8,
    opcode: u8,
    /// bytes of an operand in memory
    unit: i32,
    /// only the lanes of this mask register
    mask: u8,
    /// and zero in the others
    is_zeroed: bool,
    /// has no VEX form
    is_evex: bool,
}

/// Registers of the four pointers and of the number of groups, in the order of [`Base`]. Those of code that
/// calls survive the calls; all pointers but r14 and r15 have short encodings.
const ARGUMENTS: [u8; 5] = [7, 6, 2, 1, 8];
const KEPT: [u8; 5] = [3, 14, 5, 15, 12];

/// Machine code that grows.
pub(crate) struct Assembler {
    pub bytes: Vec<u8>,
    /// numbers in a register: 1, 4 or 8
    lanes: usize,
    /// AVX-512 is there
    pub is_extended: bool,
    pointers: [u8; 5],
    /// how far the pointer of the frame stands from its beginning
    ahead: i32,
}

impl Assembler {
    /// For code that calls functions, or not.
    pub fn new(lanes: usize, is_extended: bool, calls: bool) -> Self {
        Self {
            bytes: vec![],
            lanes,
            is_extended,
            pointers: if calls { KEPT } else { ARGUMENTS },
            // offsets of a byte reach back as far as forward
            ahead: 128 * if lanes == 8 { 64 } else { 1 },
        }
    }

    /// The register of a mask without AVX-512: the last two.
    fn blended(mask: Mask) -> Register {
        14 + mask as Register
    }

    fn form(&self, pp: u8, map: u8, opcode: u8, numbers: usize) -> Form {
        Form {
            pp,
            length: self.lanes as u8 / 4,
            map,
            opcode,
            unit: 8 * numbers as i32,
            mask: 0,
            is_zeroed: false,
            is_evex: self.lanes == 8,
        }
    }

    /// Of arithmetic.
    fn numbers(&self, map: u8, opcode: u8) -> Form {
        let pp = if self.lanes > 1 { PACKED } else { SCALAR };
        self.form(pp, map, opcode, self.lanes)
    }

    /// Of what is done bit by bit: a single number has one beside it.
    fn bits(&self, map: u8, opcode: u8) -> Form {
        self.form(PACKED, map, opcode, self.lanes.max(2))
    }

    /// Of an instruction under a mask.
    fn masked(form: Form, mask: Mask, is_zeroed: bool) -> Form {
        Form {
            mask: 1 + mask as u8,
            is_zeroed,
            is_evex: true,
            ..form
        }
    }

    fn pointer(&self, base: Base) -> u8 {
        self.pointers[base as usize]
    }

    fn offset(&self, address: Address) -> i32 {
        match address.base {
            Base::Frame => address.offset - self.ahead,
            _ => address.offset,
        }
    }

    /// `second` is 0 where the instruction has no second operand.
    fn write(&mut self, form: Form, reg: u8, second: u8, rm: Operand) {
        let number = match rm {
            Operand::Register(r) => r,
            Operand::Memory(address) => self.pointer(address.base),
        };
        let is_evex = form.is_evex || reg.max(second).max(number) > 15;
        match is_evex {
            true => self.evex(form, reg, second, number),
            false => self.vex(form, reg, second, number),
        }
        self.bytes.push(form.opcode);
        let low = (reg & 7) << 3 | number & 7;
        match rm {
            Operand::Register(_) => self.bytes.push(0xc0 | low),
            Operand::Memory(address) => {
                let offset = self.offset(address);
                self.place(low, offset, if is_evex { form.unit } else { 1 });
            }
        }
    }

    fn vex(&mut self, form: Form, reg: u8, second: u8, rm: u8) {
        // what this map has here takes numbers of 64 bits
        let width = u8::from(form.map == OF_38) << 7;
        let last = width | (!second & 15) << 3 | form.length << 2 | form.pp;
        if form.map == OF && rm < 8 {
            self.bytes.extend([0xc5, inverted(reg, 3, 7) | last]);
        } else {
            let first = inverted(reg, 3, 7) | 1 << 6 | inverted(rm, 3, 5) | form.map;
            self.bytes.extend([0xc4, first, last]);
        }
    }

    fn evex(&mut self, form: Form, reg: u8, second: u8, rm: u8) {
        let registers = inverted(reg, 3, 7) | inverted(rm, 4, 6) | inverted(rm, 3, 5);
        self.bytes.extend([
            0x62,
            registers | inverted(reg, 4, 4) | form.map,
            1 << 7 | (!second & 15) << 3 | 1 << 2 | form.pp,
            u8::from(form.is_zeroed) << 7 | form.length << 5 | inverted(second, 4, 3) | form.mask,
        ]);
    }

    /// The operand in memory, whose offset takes a byte where it is a few units.
    fn place(&mut self, low: u8, offset: i32, unit: i32) {
        // 5 and 13 have no form without offset
        let is_bare = offset == 0 && low & 7 != 5;
        match i8::try_from(offset / unit) {
            Ok(_) if is_bare => self.bytes.push(low),
            Ok(units) if offset % unit == 0 => self.bytes.extend([0x40 | low, units as u8]),
            _ => {
                self.bytes.push(0x80 | low);
                self.bytes.extend(offset.to_le_bytes());
            }
        }
    }

    pub fn load(&mut self, to: Register, from: Address) {
        self.write(self.numbers(OF, 0x10), to, 0, Operand::Memory(from));
    }

    pub fn store(&mut self, from: Register, to: Address) {
        self.write(self.numbers(OF, 0x11), from, 0, Operand::Memory(to));
    }

    /// From one register to another.
    pub fn copy(&mut self, to: Register, from: Register) {
        if to != from {
            self.write(self.bits(OF, 0x28), to, 0, Operand::Register(from));
        }
    }

    pub fn apply(&mut self, op: Opcode, to: Register, x: Register, y: Operand) {
        use Opcode::{Add, And, Mul, Or, Xor};
        let form = match op {
            And | Or | Xor => self.bits(OF, op as u8),
            _ => self.numbers(OF, op as u8),
        };
        match y {
            // a high register is shorter in the middle
            Operand::Register(y) if y > x && matches!(op, Add | Mul | And | Or | Xor) => {
                self.write(form, to, y, Operand::Register(x));
            }
            _ => self.write(form, to, x, y),
        }
    }

    /// A product and a sum with one rounding; the destination is an operand, too.
    pub fn fuse(
        &mut self,
        op: Fused,
        factors: Factors,
        to: Register,
        second: Register,
        last: Operand,
    ) {
        let sign = match op {
            Fused::Add => 0,
            Fused::Sub => 2,
            Fused::From => 4,
        };
        let opcode = factors as u8 + sign + u8::from(self.lanes == 1);
        let form = self.form(PACKED, OF_38, opcode, self.lanes);
        self.write(form, to, second, last);
    }

    /// All bits where the relation holds, else none.
    pub fn compare(&mut self, relation: Relation, to: Mask, x: Register, y: Operand) {
        let form = self.numbers(OF, 0xc2);
        match self.is_extended {
            true => {
                let form = Form {
                    is_evex: true,
                    ..form
                };
                self.write(form, 1 + to as u8, x, y);
            }
            false => self.write(form, Self::blended(to), x, y),
        }
        self.bytes.push(relation as u8);
    }

    /// Both masks, or either, to the first.
    pub fn join(&mut self, is_and: bool) {
        let [first, second] = [Mask::First, Mask::Second].map(Self::blended);
        match (self.is_extended, is_and) {
            // kandb and korb k1, k1, k2
            (true, true) => self.bytes.extend([0xc5, 0xf5, 0x41, 0xca]),
            (true, false) => self.bytes.extend([0xc5, 0xf5, 0x45, 0xca]),
            (false, true) => self.apply(Opcode::And, first, first, Operand::Register(second)),
            (false, false) => self.apply(Opcode::Or, first, first, Operand::Register(second)),
        }
    }

    /// The number at an address where the mask is set, else 0.
    pub fn pick(&mut self, to: Register, from: Address, mask: Mask) {
        let from = Operand::Memory(from);
        match self.is_extended {
            true => self.write(
                Self::masked(self.numbers(OF, 0x10), mask, true),
                to,
                0,
                from,
            ),
            false => self.apply(Opcode::And, to, Self::blended(mask), from),
        }
    }

    /// `y` where the mask is set, else `x`.
    pub fn blend(&mut self, to: Register, x: Register, y: Operand, mask: Mask) {
        if self.is_extended {
            let form = Self::masked(self.bits(OF_38, 0x65), mask, false);
            self.write(form, to, x, y);
        } else {
            self.write(self.bits(OF_3A, 0x4b), to, x, y);
            self.bytes.push(Self::blended(mask) << 4);
        }
    }

    pub fn sqrt(&mut self, to: Register, x: Register) {
        // the scalar form takes its upper half from a second operand
        let upper = if self.lanes > 1 { 0 } else { x };
        self.write(self.numbers(OF, 0x51), to, upper, Operand::Register(x));
    }

    pub fn floor(&mut self, to: Register, x: Register) {
        let (opcode, upper) = if self.lanes > 1 { (0x09, 0) } else { (0x0b, x) };
        let from = Operand::Register(x);
        self.write(self.bits(OF_3A, opcode), to, upper, from);
        // toward −∞, without the inexact flag
        self.bytes.push(9);
    }

    fn calls(&self) -> bool {
        self.pointers == KEPT
    }

    /// Takes the four pointers and the number of groups; where there are calls, saves what the caller owns.
    pub fn enter(&mut self) {
        if self.calls() {
            // push rbx, rbp, r12, r14, r15: aligns the stack
            self.bytes
                .extend([0x53, 0x55, 0x41, 0x54, 0x41, 0x56, 0x41, 0x57]);
            for (to, from) in KEPT.into_iter().zip(ARGUMENTS) {
                // mov
                self.bytes.extend([
                    0x48 | from >> 3 << 2 | to >> 3,
                    0x89,
                    0xc0 | (from & 7) << 3 | to & 7,
                ]);
            }
        }
        self.add(self.pointer(Base::Frame), self.ahead);
    }

    /// A number to a pointer.
    fn add(&mut self, pointer: u8, number: i32) {
        self.bytes
            .extend([0x48 | pointer >> 3, 0x81, 0xc0 | pointer & 7]);
        self.bytes.extend(number.to_le_bytes());
    }

    /// Goes back to `first` with the next inputs and outputs, so many bytes further, until every
    /// group is done.
    pub fn repeat(&mut self, first: usize, inputs: i32, outputs: i32) {
        self.add(self.pointer(Base::Inputs), inputs);
        self.add(self.pointer(Base::Outputs), outputs);
        // dec of the number of groups, jnz first
        self.bytes
            .extend([0x49, 0xff, 0xc8 | self.pointers[4] & 7, 0x0f, 0x85]);
        let next = self.bytes.len() + 4;
        self.bytes
            .extend((first as i32 - next as i32).to_le_bytes());
    }

    pub fn leave(&mut self) {
        self.clear();
        if self.calls() {
            // pop r15, r14, r12, rbp, rbx
            self.bytes
                .extend([0x41, 0x5f, 0x41, 0x5e, 0x41, 0x5c, 0x5d, 0x5b]);
        }
        self.bytes.push(0xc3);
    }

    /// Upper halves of registers that are in use slow down code without VEX.
    fn clear(&mut self) {
        if self.lanes > 1 {
            // vzeroupper
            self.bytes.extend([0xc5, 0xf8, 0x77]);
        }
    }

    /// Calls what stands at an absolute address.
    pub fn call(&mut self, target: usize) {
        self.bytes.extend([0x48, 0xb8]); // mov rax, target
        self.bytes.extend((target as u64).to_le_bytes());
        self.bytes.extend([0xff, 0xd0]); // call rax
    }

    /// Calls a function of an address and a number, which has nothing to do with vectors.
    pub fn call_plain(&mut self, target: usize, address: Address, number: u32) {
        self.clear();
        // lea rdi, mov esi
        let base = self.pointer(address.base);
        self.bytes
            .extend([0x48 | base >> 3, 0x8d, 0x80 | 7 << 3 | base & 7]);
        let offset = self.offset(address);
        self.bytes.extend(offset.to_le_bytes());
        self.bytes.push(0xbe);
        self.bytes.extend(number.to_le_bytes());
        self.call(target);
    }
}

/// A bit of a register's number, turned, at another place.
fn inverted(number: u8, from: u8, to: u8) -> u8 {
    (!number >> from & 1) << to
}
