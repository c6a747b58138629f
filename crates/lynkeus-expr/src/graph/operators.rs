//! Operators and functions of expressions, so that equations in Rust read like equations.

use std::ops::{Add, Div, Mul, Neg, Not, Sub};

use super::Expr;
use crate::{Binary, Unary};

impl<'g> Expr<'g> {
    fn unary(self, op: Unary) -> Self {
        Self::new(self.graph, self.graph.unary(op, self.node))
    }

    fn binary(self, op: Binary, other: Self) -> Self {
        assert!(
            std::ptr::eq(self.graph, other.graph),
            "expressions of two different graphs cannot be combined"
        );
        Self::new(self.graph, self.graph.binary(op, self.node, other.node))
    }

    /// Integer power, for any base.
    pub fn powi(self, n: i32) -> Self {
        Self::new(self.graph, self.graph.powi(self.node, n))
    }

    /// Power with a real exponent; a constant whole exponent becomes [`Expr::powi`].
    pub fn pow(self, exponent: Self) -> Self {
        self.binary(Binary::Pow, exponent)
    }

    /// Decimal logarithm.
    pub fn log10(self) -> Self {
        self.ln() / std::f64::consts::LN_10
    }

    /// Truth value of self > other.
    pub fn greater(self, other: Self) -> Self {
        other.binary(Binary::Less, self)
    }

    /// Truth value of self ≥ other.
    pub fn greater_eq(self, other: Self) -> Self {
        other.binary(Binary::LessEq, self)
    }

    /// With self as the truth value: `if self then a else b`.
    pub fn select(self, a: Self, b: Self) -> Self {
        let node = self.graph.select(self.node, a.node, b.node);
        Self::new(self.graph, node)
    }
}

macro_rules! unary_methods {
    ($($name:ident $op:ident $doc:literal),* $(,)?) => {
        impl<'g> Expr<'g> {$(
            #[doc = $doc]
            pub fn $name(self) -> Self {
                self.unary(Unary::$op)
            }
        )*}
    };
}

unary_methods! {
    abs Abs "|x|.",
    sign Sign "−1, 0 or 1.",
    floor Floor "The largest integer not above x.",
    sqrt Sqrt "√x.",
    exp Exp "eˣ.",
    ln Ln "Natural logarithm.",
    sin Sin "Sine.",
    cos Cos "Cosine.",
    tan Tan "Tangent.",
    asin Asin "Inverse sine.",
    acos Acos "Inverse cosine.",
    atan Atan "Inverse tangent.",
    sinh Sinh "Hyperbolic sine.",
    cosh Cosh "Hyperbolic cosine.",
    tanh Tanh "Hyperbolic tangent.",
}

macro_rules! binary_methods {
    ($($name:ident $op:ident $doc:literal),* $(,)?) => {
        impl<'g> Expr<'g> {$(
            #[doc = $doc]
            pub fn $name(self, other: Self) -> Self {
                self.binary(Binary::$op, other)
            }
        )*}
    };
}

binary_methods! {
    atan2 Atan2 "Angle of the point (other, self).",
    min Min "The smaller one; NaN if either is.",
    max Max "The larger one; NaN if either is.",
    less Less "Truth value of self < other.",
    less_eq LessEq "Truth value of self ≤ other.",
    equal Equal "Truth value of self = other.",
    and And "Both truth values.",
    or Or "Either truth value.",
}

macro_rules! operators {
    ($($trait:ident $method:ident $op:ident),*) => {$(
        impl<'g> $trait for Expr<'g> {
            type Output = Expr<'g>;
            fn $method(self, other: Self) -> Self {
                self.binary(Binary::$op, other)
            }
        }
        impl<'g> $trait<f64> for Expr<'g> {
            type Output = Expr<'g>;
            fn $method(self, other: f64) -> Self {
                self.binary(Binary::$op, self.graph.constant(other))
            }
        }
        impl<'g> $trait<Expr<'g>> for f64 {
            type Output = Expr<'g>;
            fn $method(self, other: Expr<'g>) -> Expr<'g> {
                other.graph.constant(self).binary(Binary::$op, other)
            }
        }
    )*};
}

operators!(Add add Add, Sub sub Sub, Mul mul Mul, Div div Div);

impl Neg for Expr<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(Unary::Neg)
    }
}

/// Logical not of a truth value.
impl Not for Expr<'_> {
    type Output = Self;
    fn not(self) -> Self {
        self.unary(Unary::Not)
    }
}
