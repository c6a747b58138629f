//! What a tape needs of the things it computes with.

use crate::{Binary, Fused, Implicit, Unary};

/// A set of values closed under every operation of a graph. A tape evaluated
/// over an algebra gives bounds, Taylor coefficients or new nodes with the one
/// interpreter that also gives numbers.
pub trait Algebra {
    /// The values.
    type Value: Clone;
    /// A number as a value.
    fn constant(&self, value: f64) -> Self::Value;
    /// A function of one value.
    fn unary(&self, op: Unary, x: &Self::Value) -> Self::Value;
    /// An integer power.
    fn powi(&self, x: &Self::Value, n: i32) -> Self::Value;
    /// A function of two values.
    fn binary(&self, op: Binary, x: &Self::Value, y: &Self::Value) -> Self::Value;
    /// A product and a sum at once; where values are no rounded numbers, one after the other.
    fn fused(&self, op: Fused, x: &Self::Value, y: &Self::Value, z: &Self::Value) -> Self::Value {
        let product = self.binary(Binary::Mul, x, y);
        match op {
            Fused::Add => self.binary(Binary::Add, &product, z),
            Fused::Sub => self.binary(Binary::Sub, &product, z),
            Fused::From => self.binary(Binary::Sub, z, &product),
        }
    }
    /// `if condition then x else y`.
    fn select(&self, condition: &Self::Value, x: &Self::Value, y: &Self::Value) -> Self::Value;
    /// (x with A x = b, reciprocal condition estimate of A); `a` is n×n row by row.
    fn solve(&self, a: &[Self::Value], b: &[Self::Value]) -> (Vec<Self::Value>, Self::Value);
    /// [`Algebra::solve`] where `b` becomes x and `a` may be consumed; returns the reciprocal
    /// condition estimate.
    fn solve_in_place(&self, a: &mut [Self::Value], b: &mut [Self::Value]) -> Self::Value {
        let (x, rcond) = self.solve(a, b);
        b.clone_from_slice(&x);
        rcond
    }
    /// The root z of an implicit function at p.
    fn implicit(&self, function: &Implicit, p: &[Self::Value]) -> Vec<Self::Value>;
    /// Whether the budget behind the values is spent, so that what is computed from here on
    /// does not count.
    fn is_spent(&self) -> bool {
        false
    }
}
