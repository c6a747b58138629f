//! Evaluation of tapes over intervals.

use super::implicit::enclose;
use super::solve::solve;
use super::{Interval, Intervals};
use crate::{Algebra, Binary, Implicit, Unary};

impl Algebra for Intervals {
    type Value = Interval;

    fn constant(&self, value: f64) -> Interval {
        Interval::point(value)
    }

    fn unary(&self, op: Unary, x: &Interval) -> Interval {
        match op {
            Unary::Neg => -*x,
            Unary::Abs => x.abs(),
            Unary::Sign => x.sign(),
            Unary::Floor => x.floor(),
            Unary::Sqrt => x.sqrt(),
            Unary::Exp => x.exp(),
            Unary::Ln => x.ln(),
            Unary::Sin => x.sin(),
            Unary::Cos => x.cos(),
            Unary::Tan => x.tan(),
            Unary::Asin => x.asin(),
            Unary::Acos => x.acos(),
            Unary::Atan => x.atan(),
            Unary::Sinh => x.sinh(),
            Unary::Cosh => x.cosh(),
            Unary::Tanh => x.tanh(),
            Unary::Not => x.relation(*x, x.is_zero(), x.is_true()),
        }
    }

    fn powi(&self, x: &Interval, n: i32) -> Interval {
        x.powi(n)
    }

    fn binary(&self, op: Binary, x: &Interval, y: &Interval) -> Interval {
        match op {
            Binary::Add => *x + *y,
            Binary::Sub => *x - *y,
            Binary::Mul => *x * *y,
            Binary::Div => *x / *y,
            Binary::Pow => x.pow(*y),
            Binary::Atan2 => x.atan2(*y),
            Binary::Min => x.min(*y),
            Binary::Max => x.max(*y),
            Binary::Less => x.relation(*y, x.hi < y.lo, x.lo >= y.hi),
            Binary::LessEq => x.relation(*y, x.hi <= y.lo, x.lo > y.hi),
            // certain only for two points
            Binary::Equal => {
                let same = x.is_point() && y.is_point() && x.lo == y.lo;
                x.relation(*y, same, x.hi < y.lo || y.hi < x.lo)
            }
            Binary::And => {
                let never = x.is_zero() || y.is_zero();
                x.relation(*y, x.is_true() && y.is_true(), never)
            }
            Binary::Or => {
                let never = x.is_zero() && y.is_zero();
                x.relation(*y, x.is_true() || y.is_true(), never)
            }
        }
    }

    fn select(&self, condition: &Interval, x: &Interval, y: &Interval) -> Interval {
        condition.select(*x, *y)
    }

    /// The condition estimate is only known to lie in [0, 1].
    fn solve(&self, a: &[Interval], b: &[Interval]) -> (Vec<Interval>, Interval) {
        let (x, regular) = solve(a, b);
        let rcond = Interval::ZERO.hull(Interval::ONE).and_defined(regular);
        (x, rcond)
    }

    fn implicit(&self, function: &Implicit, p: &[Interval]) -> Vec<Interval> {
        enclose(function, p)
    }
}
