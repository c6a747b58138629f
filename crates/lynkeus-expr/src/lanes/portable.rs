//! Numbers side by side without instructions of their own.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

use super::Vector;

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
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        Self(from_fn(|i| self.0[i].mul_add(factor.0[i], -term.0[i])))
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
        Self(self.0.map(|x| f64::from_bits(x.to_bits() << BITS)))
    }

    #[inline(always)]
    fn down<const BITS: i32>(self) -> Self {
        Self(self.0.map(|x| f64::from_bits(x.to_bits() >> BITS)))
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.0.iter().all(|x| x.is_sign_negative())
    }

    #[inline(always)]
    fn rescued(self, inside: Self, arguments: [Self; 2], f: fn(f64, f64) -> f64) -> Self {
        let [x, y] = arguments;
        Self(from_fn(|i| match inside.0[i].is_sign_negative() {
            true => self.0[i],
            false => f(x.0[i], y.0[i]),
        }))
    }
}
