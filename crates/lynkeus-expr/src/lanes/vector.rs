//! What the elementary functions need of numbers side by side.

use std::ops::{Add, Div, Mul, Sub};

/// Numbers side by side that know the operations of IEEE 754, the fused one among them, and a few on
/// their bits. Every implementation gives the same bits, lane by lane.
///
/// A mask is a value whose lanes have all bits set or none.
pub trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The same number in every lane.
    fn splat(x: f64) -> Self;
    /// self·factor + term, rounded once.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// self·factor − term, rounded once.
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// Bits that both have.
    fn and(self, other: Self) -> Self;
    /// Bits that either has.
    fn or(self, other: Self) -> Self;
    /// Bits that one of them has.
    fn xor(self, other: Self) -> Self;
    /// The mask of self < other.
    fn below(self, other: Self) -> Self;
    /// The mask of self ≤ other.
    fn at_most(self, other: Self) -> Self;
    /// `yes` where the sign of the mask is set, else `no`.
    fn choose(mask: Self, yes: Self, no: Self) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// The sum of the bits as whole numbers of 64 bits.
    fn plus_bits(self, other: Self) -> Self;
    /// The bits moved up by `N`.
    fn up<const N: i32>(self) -> Self;
    /// The bits moved down by `N`, zeros above.
    fn down<const N: i32>(self) -> Self;
    /// Whether the sign of the mask is set in every lane.
    fn all(self) -> bool;
    /// self where the sign of the mask `inside` is set, else `f` of the arguments' lanes.
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self;

    /// The lanes without their signs.
    #[inline(always)]
    fn abs(self) -> Self {
        self.and(Self::splat(f64::from_bits(!(1 << 63))))
    }

    /// The signs alone.
    #[inline(always)]
    fn signs(self) -> Self {
        self.and(Self::splat(-0.0))
    }

    /// `if self < other then self else other`: the other where either is NaN.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self::choose(self.below(other), self, other)
    }
}

/// c₀ + c₁ x + … by Horner's rule.
#[inline(always)]
pub(super) fn horner<V: Vector, const N: usize>(x: V, c: [f64; N]) -> V {
    let mut sum = V::splat(c[N - 1]);
    let mut i = N - 1;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(x, V::splat(c[i]));
    }
    sum
}

/// The polynomial with these even and odd coefficients: two chains that run side by side.
#[inline(always)]
pub(super) fn polynomial<V: Vector, const E: usize, const O: usize>(
    x: V,
    even: [f64; E],
    odd: [f64; O],
) -> V {
    let square = x * x;
    horner(square, odd).mul_add(x, horner(square, even))
}
