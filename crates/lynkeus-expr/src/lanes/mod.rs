//! Elementary functions of numbers side by side.
//!
//! A processor does four or eight operations on numbers at once, but the library's functions take
//! one number. These are written once, over a [`Vector`], without branches on what its lanes hold
//! but for extreme arguments. Each lane's result follows from its argument alone and is the same for every
//! implementation of [`Vector`]: it depends neither on its neighbours nor on the machine, except
//! where the library's function is taken.
//!
//! The results differ from the library's in the last bits. Bounds of the errors found at ten thousands
//! of points of each function, of grids, random and special (`cargo test --package lynkeus-expr --test
//! algebras lanes -- --ignored --nocapture`), beside 192 bits and in units in the last place, of which one half
//! would be perfect:
//!
//! | function | error | the library's instead |
//! |---|---|---|
//! | [`exp`] | 1.1 | never |
//! | [`ln`] | 0.8 | subnormal numbers |
//! | [`sin`], [`cos`] | 2.0 | beyond 10⁹ |
//! | [`tan`] | 1.8 | beyond 1.6·10⁶, and the numbers nearest to multiples of π/2 |
//! | [`asin`], [`acos`] | 1.8 | never |
//! | [`atan`] | 1.8 | never |
//! | [`atan2`] | 1.8 | extreme points and ratios |
//! | [`sinh`], [`cosh`] | 1.6 | never |
//! | [`tanh`] | 1.6 | never |
//! | [`pow`] | 1.2 | results that are no normal numbers, bases that are not above 0 or subnormal |

mod circular;
mod exponential;
mod vector;

use std::array::from_fn;

pub use circular::{acos, asin, atan, atan2, cos, sin, tan};
pub use exponential::{cosh, exp, ln, pow, sinh, tanh};
pub use vector::{Portable, Vector};

use crate::{Algebra, Binary, Fused, Implicit, Reals, Unary};

/// A function of one number, lane by lane; none where the library's operation is used as it is.
#[inline(always)]
pub fn unary<V: Vector>(op: Unary) -> Option<fn(V) -> V> {
    Some(match op {
        Unary::Exp => exp,
        Unary::Ln => ln,
        Unary::Sin => sin,
        Unary::Cos => cos,
        Unary::Tan => tan,
        Unary::Asin => asin,
        Unary::Acos => acos,
        Unary::Atan => atan,
        Unary::Sinh => sinh,
        Unary::Cosh => cosh,
        Unary::Tanh => tanh,
        Unary::Neg | Unary::Abs | Unary::Sign | Unary::Floor | Unary::Sqrt | Unary::Not => {
            return None;
        }
    })
}

/// A function of two numbers, lane by lane; none where the library's operation is used as it is.
#[inline(always)]
pub fn binary<V: Vector>(op: Binary) -> Option<fn(V, V) -> V> {
    match op {
        Binary::Pow => Some(pow),
        Binary::Atan2 => Some(atan2),
        _ => None,
    }
}

/// The algebra of `N` numbers side by side: that of [`Reals`] in every lane, but for the
/// elementary functions, which are those of this module. It is the meaning of code that
/// evaluates many trajectories at once.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lanes<const N: usize>;

impl<const N: usize> Algebra for Lanes<N> {
    type Value = [f64; N];

    fn constant(&self, value: f64) -> [f64; N] {
        [value; N]
    }

    fn unary(&self, op: Unary, x: &[f64; N]) -> [f64; N] {
        match unary(op) {
            Some(function) => function(Portable(*x)).0,
            None => x.map(|x| Reals.unary(op, &x)),
        }
    }

    fn powi(&self, x: &[f64; N], n: i32) -> [f64; N] {
        x.map(|x| Reals.powi(&x, n))
    }

    fn binary(&self, op: Binary, x: &[f64; N], y: &[f64; N]) -> [f64; N] {
        match binary(op) {
            Some(function) => function(Portable(*x), Portable(*y)).0,
            None => from_fn(|i| Reals.binary(op, &x[i], &y[i])),
        }
    }

    fn fused(&self, op: Fused, x: &[f64; N], y: &[f64; N], z: &[f64; N]) -> [f64; N] {
        from_fn(|i| Reals.fused(op, &x[i], &y[i], &z[i]))
    }

    fn select(&self, condition: &[f64; N], x: &[f64; N], y: &[f64; N]) -> [f64; N] {
        from_fn(|i| Reals.select(&condition[i], &x[i], &y[i]))
    }

    fn solve(&self, a: &[[f64; N]], b: &[[f64; N]]) -> (Vec<[f64; N]>, [f64; N]) {
        let mut x = by_lane(&[a, b].concat(), |lane: &[f64]| {
            let (a, b) = lane.split_at(a.len());
            let (mut x, rcond) = Reals.solve(a, b);
            x.push(rcond);
            x
        });
        let rcond = x.pop().unwrap_or([1.0; N]);
        (x, rcond)
    }

    fn implicit(&self, function: &Implicit, p: &[[f64; N]]) -> Vec<[f64; N]> {
        by_lane(p, |lane| Reals.implicit(function, lane))
    }
}

/// What a function of several numbers gives, lane by lane.
fn by_lane<const N: usize>(values: &[[f64; N]], f: impl Fn(&[f64]) -> Vec<f64>) -> Vec<[f64; N]> {
    let lanes: [Vec<f64>; N] = from_fn(|lane| {
        let own: Vec<f64> = values.iter().map(|value| value[lane]).collect();
        f(&own)
    });
    let count = lanes.iter().map(Vec::len).min().unwrap_or(0);
    (0..count).map(|k| from_fn(|lane| lanes[lane][k])).collect()
}
