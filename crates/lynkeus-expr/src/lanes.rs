//! Many trajectories at once.

use std::array::from_fn;

use crate::{Algebra, Binary, Reals, Unary};

/// `N` numbers side by side; every operation acts on each lane as [`Reals`]
/// does, bit for bit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lanes<const N: usize>;

impl<const N: usize> Algebra for Lanes<N> {
    type Value = [f64; N];

    fn constant(&self, value: f64) -> [f64; N] {
        [value; N]
    }

    #[inline(always)]
    fn unary(&self, op: Unary, x: &[f64; N]) -> [f64; N] {
        from_fn(|i| Reals.unary(op, &x[i]))
    }

    #[inline(always)]
    fn powi(&self, x: &[f64; N], n: i32) -> [f64; N] {
        from_fn(|i| Reals.powi(&x[i], n))
    }

    #[inline(always)]
    fn binary(&self, op: Binary, x: &[f64; N], y: &[f64; N]) -> [f64; N] {
        from_fn(|i| Reals.binary(op, &x[i], &y[i]))
    }

    #[inline(always)]
    fn select(&self, c: &[f64; N], x: &[f64; N], y: &[f64; N]) -> [f64; N] {
        from_fn(|i| Reals.select(&c[i], &x[i], &y[i]))
    }

    fn solve(&self, a: &[[f64; N]], b: &[[f64; N]]) -> (Vec<[f64; N]>, [f64; N]) {
        let mut x = vec![[0.0; N]; b.len()];
        let rcond = from_fn(|i| {
            let lane = |values: &[[f64; N]]| values.iter().map(|v| v[i]).collect::<Vec<_>>();
            let (solution, rcond) = Reals.solve(&lane(a), &lane(b));
            for (entry, value) in x.iter_mut().zip(solution) {
                entry[i] = value;
            }
            rcond
        });
        (x, rcond)
    }
}
