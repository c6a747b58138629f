//! The steps from one row to the next.

use super::code::{Bundle, Code};
use crate::integrator::instant;

/// From one row to the next by equal steps, or by steps that grow from one to the next.
pub(super) struct Interval<'i> {
    pub from: f64,
    pub to: f64,
    pub steps: usize,
    /// what is fast goes where it settles: from something below a 10⁻¹⁰ of the interval on
    pub is_graded: bool,
    pub inputs: &'i [f64],
}

/// So many times as many steps where they grow.
pub(super) const GRADED: usize = 16;

/// More steps than so many are as so many where they grow.
pub(super) const MOST_GRADED: f64 = 64.0;

/// The logarithm of the last of them over the first.
const GROWTH: f64 = 25.0;

impl Interval<'_> {
    /// Where a step begins, and its length.
    pub fn step(&self, i: usize) -> [f64; 2] {
        if self.is_graded {
            let grown = |i: usize| (GROWTH * i as f64 / self.steps as f64).exp_m1();
            let scale = (self.to - self.from) / GROWTH.exp_m1();
            let [begin, end] = [i, i + 1].map(|i| scale * grown(i));
            return [self.from + begin, end - begin];
        }
        let [t, next] = [i, i + 1].map(|i| instant(self.from, self.to, self.steps, i));
        [t, next - t]
    }

    pub fn run<const L: usize>(&self, code: &mut Code<L>, belief: &mut [Bundle<L>]) {
        for i in 0..self.steps {
            let [t, h] = self.step(i);
            for (pass, belief) in belief.iter_mut().enumerate() {
                let next = code.run(pass, [&[t, h], self.inputs], &[belief]);
                belief.copy_from_slice(next);
            }
        }
    }
}
