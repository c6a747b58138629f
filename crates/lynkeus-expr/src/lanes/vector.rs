//! What the elementary functions need of numbers side by side.

use std::array::from_fn;
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

    /// self·factor − term, rounded once.
    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        self.mul_add(factor, term.xor(Self::splat(-0.0)))
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

/// Numbers side by side, an operation after the other.
#[derive(Clone, Copy, Debug)]
pub struct Portable<const N: usize>(pub [f64; N]);

impl<const N: usize> Portable<N> {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn bits(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        self.with(other, |x, y| f64::from_bits(f(x.to_bits(), y.to_bits())))
    }
}

macro_rules! arithmetic {
    ($($trait:ident $name:ident $op:tt),*) => {
        $(impl<const N: usize> $trait for Portable<N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.with(other, |x, y| x $op y)
            }
        })*
    };
}

arithmetic!(Add add +, Sub sub -, Mul mul *, Div div /);

fn mask(holds: bool) -> f64 {
    f64::from_bits(if holds { u64::MAX } else { 0 })
}

impl<const N: usize> Vector for Portable<N> {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; N])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(from_fn(|i| self.0[i].mul_add(factor.0[i], term.0[i])))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.bits(other, |x, y| x & y)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.bits(other, |x, y| x | y)
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        self.bits(other, |x, y| x ^ y)
    }

    #[inline(always)]
    fn below(self, other: Self) -> Self {
        self.with(other, |x, y| mask(x < y))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        self.with(other, |x, y| mask(x <= y))
    }

    #[inline(always)]
    fn choose(mask: Self, yes: Self, no: Self) -> Self {
        Self(from_fn(|i| {
            if mask.0[i].is_sign_negative() {
                yes.0[i]
            } else {
                no.0[i]
            }
        }))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    #[inline(always)]
    fn plus_bits(self, other: Self) -> Self {
        self.bits(other, u64::wrapping_add)
    }

    #[inline(always)]
    fn up<const BITS: i32>(self) -> Self {
        self.bits(self, |x, _| x << BITS)
    }

    #[inline(always)]
    fn down<const BITS: i32>(self) -> Self {
        self.bits(self, |x, _| x >> BITS)
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.0.iter().all(|x| x.is_sign_negative())
    }

    #[inline(always)]
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self {
        if inside.all() {
            return self;
        }
        let [x, y] = arguments;
        Self(from_fn(|i| match inside.0[i].is_sign_negative() {
            true => self.0[i],
            false => f(x.0[i], y.0[i]),
        }))
    }
}
