//! The memory of an evaluator: constants, spilled values, linear systems.

use crate::assemble::{Address, Base};

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
