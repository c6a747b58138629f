//! What the crate proves is attacked: every accepted statement is compared with ordinary
//! numerical linear algebra at random members of the set it speaks of. A single member that
//! contradicts a proof fails the test, and so does a run in which too little was proved to
//! attack.

mod chains;
mod decay;
mod implicit;
mod matrices;

use nalgebra::DMatrix;

/// Numbers that are the same in every run (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// An end more often than a number between.
    fn of_range(&mut self, low: f64, high: f64) -> f64 {
        match self.below(4) {
            0 => self.within(low, high),
            1 | 2 => low,
            _ => high,
        }
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn matrix(&mut self, n: usize, size: f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |_, _| self.within(-size, size))
    }
}

/// The largest eigenvalue of a symmetric matrix.
fn largest(matrix: &DMatrix<f64>) -> f64 {
    matrix.clone().symmetric_eigenvalues().max()
}
