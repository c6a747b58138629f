//! What the searches draw from [`Numbers`] beside what all draw.

use crate::numbers::Numbers;

impl Numbers {
    /// Streams of different seeds and indices have nothing to do with each other.
    pub fn new(seed: u64, index: u64) -> Self {
        let mut mixer = Self(seed ^ index.wrapping_mul(0xD6E8_FEB8_6659_FD93));
        let state = mixer.bits() ^ index;
        Self(state)
    }

    /// About normally distributed.
    pub fn normal(&mut self) -> f64 {
        (0..6).map(|_| self.between(-1.0, 1.0)).sum::<f64>() / 2f64.sqrt()
    }

    pub fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}
