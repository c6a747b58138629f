//! What a tape needs of the things it computes with.

use crate::{Binary, Graph, Implicit, Node, Unary, linear, real};

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

/// The numbers: `f64`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reals;

impl Algebra for Reals {
    type Value = f64;

    fn constant(&self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn unary(&self, op: Unary, x: &f64) -> f64 {
        real::unary(op, *x)
    }

    #[inline(always)]
    fn powi(&self, x: &f64, n: i32) -> f64 {
        // the square is the power that models are made of
        if n == 2 { x * x } else { x.powi(n) }
    }

    #[inline(always)]
    fn binary(&self, op: Binary, x: &f64, y: &f64) -> f64 {
        real::binary(op, *x, *y)
    }

    #[inline(always)]
    fn select(&self, condition: &f64, x: &f64, y: &f64) -> f64 {
        real::select(*condition, *x, *y)
    }

    fn solve(&self, a: &[f64], b: &[f64]) -> (Vec<f64>, f64) {
        let mut x = b.to_vec();
        let rcond = linear::solve(&mut a.to_vec(), &mut x);
        (x, rcond)
    }

    fn solve_in_place(&self, a: &mut [f64], b: &mut [f64]) -> f64 {
        linear::solve(a, b)
    }

    /// NaN where no root is found.
    fn implicit(&self, function: &Implicit, p: &[f64]) -> Vec<f64> {
        match function.root(p) {
            Ok(z) => z,
            Err(_) => vec![f64::NAN; function.size()],
        }
    }
}

/// The nodes of a graph: evaluation builds expressions.
#[derive(Clone, Copy, Debug)]
pub struct Nodes<'g>(pub &'g Graph);

impl Algebra for Nodes<'_> {
    type Value = Node;

    fn constant(&self, value: f64) -> Node {
        self.0.constant(value).node()
    }

    fn unary(&self, op: Unary, x: &Node) -> Node {
        self.0.unary(op, *x)
    }

    fn powi(&self, x: &Node, n: i32) -> Node {
        self.0.powi(*x, n)
    }

    fn binary(&self, op: Binary, x: &Node, y: &Node) -> Node {
        self.0.binary(op, *x, *y)
    }

    fn select(&self, condition: &Node, x: &Node, y: &Node) -> Node {
        self.0.select(*condition, *x, *y)
    }

    fn solve(&self, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
        let solution = self.0.solve(a, b);
        (solution.x, solution.rcond)
    }

    fn implicit(&self, function: &Implicit, p: &[Node]) -> Vec<Node> {
        self.0.implicit(function, p)
    }

    fn is_spent(&self) -> bool {
        self.0.is_spent()
    }
}
