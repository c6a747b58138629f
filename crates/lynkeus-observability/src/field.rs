//! The integers modulo the prime 2⁶¹ − 1: exact arithmetic in which a wrong rank is as
//! unlikely as hitting a root of a polynomial with a random number of 61 bits.

use std::ops::{Add, Mul, Neg, Sub};

const PRIME: u64 = (1 << 61) - 1;

/// An element of the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Modular(u64);

impl Modular {
    pub const ZERO: Self = Self(0);
    pub const ONE: Self = Self(1);

    pub fn new(value: u64) -> Self {
        Self(value % PRIME)
    }

    pub fn is_zero(self) -> bool {
        self.0 == 0
    }

    pub fn power(self, mut exponent: u64) -> Self {
        let (mut base, mut result) = (self, Self::ONE);
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        result
    }

    /// 1/x; none for zero.
    pub fn inverse(self) -> Option<Self> {
        (!self.is_zero()).then(|| self.power(PRIME - 2))
    }

    /// A square root, where there is one: the prime is 3 modulo 4.
    pub fn root(self) -> Option<Self> {
        let root = self.power((PRIME + 1) / 4);
        (root * root == self).then_some(root)
    }

    /// The decimal fraction that a person wrote: 0.1 is 1/10, not the nearest double.
    pub fn from_f64(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        let text = format!("{:e}", value.abs());
        let (mantissa, exponent) = text.split_once('e')?;
        let exponent: i64 = exponent.parse().ok()?;
        let fraction = mantissa
            .split_once('.')
            .map_or(0, |(_, digits)| digits.len() as i64);
        let digits: u64 = mantissa.replace('.', "").parse().ok()?;
        let shift = exponent - fraction;
        let scale = Self::new(10).power(shift.unsigned_abs());
        let scale = if shift < 0 { scale.inverse()? } else { scale };
        let magnitude = Self::new(digits) * scale;
        Some(if value < 0.0 { -magnitude } else { magnitude })
    }

    /// A stream of random numbers that belongs to this element.
    pub fn random(self, seed: u64) -> Random {
        Random::new(self.0.rotate_left(29) ^ seed)
    }

    /// The integer of at most that size that this element is, if it is one.
    pub fn as_integer(self, largest: u64) -> Option<i64> {
        match (self.0 <= largest, PRIME - self.0 <= largest) {
            (true, _) => Some(self.0 as i64),
            (_, true) => Some(-((PRIME - self.0) as i64)),
            _ => None,
        }
    }

    /// n/d with |n|, d ≤ `bound` that is this element, if there is one (Wang's rational
    /// reconstruction; it is unique as long as 2·bound² < 2⁶¹).
    pub fn as_fraction(self, bound: i64) -> Option<(i64, i64)> {
        let (mut r0, mut r1) = (PRIME as i64, self.0 as i64);
        let (mut s0, mut s1) = (0_i64, 1_i64);
        while r1 > bound {
            let q = r0 / r1;
            (r0, r1) = (r1, r0 - q * r1);
            (s0, s1) = (s1, s0 - q * s1);
        }
        let (n, d) = if s1 < 0 { (-r1, -s1) } else { (r1, s1) };
        (d != 0 && d <= bound).then_some((n, d))
    }
}

impl Add for Modular {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        Self(if sum >= PRIME { sum - PRIME } else { sum })
    }
}

impl Sub for Modular {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Modular {
    type Output = Self;
    fn neg(self) -> Self {
        Self(if self.0 == 0 { 0 } else { PRIME - self.0 })
    }
}

impl Mul for Modular {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let product = u128::from(self.0) * u128::from(other.0);
        // 2⁶¹ ≡ 1
        let folded = (product as u64 & PRIME) + (product >> 61) as u64;
        Self(if folded >= PRIME {
            folded - PRIME
        } else {
            folded
        })
    }
}

/// A reproducible stream of field elements (SplitMix64).
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// An element other than 0 and 1.
    pub fn element(&mut self) -> Modular {
        loop {
            let found = Modular::new(self.bits());
            if found != Modular::ZERO && found != Modular::ONE {
                return found;
            }
        }
    }

    /// A number below `count`; 0 for none.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count.max(1) as u64) as usize
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn decimals_are_what_was_written() {
        let tenth = Modular::from_f64(0.1).unwrap();
        assert_eq!(tenth * Modular::new(10), Modular::ONE);
        let sum = tenth + Modular::from_f64(0.2).unwrap();
        assert_eq!(sum, Modular::from_f64(0.3).unwrap());
        assert_eq!(
            Modular::from_f64(-2.5e3).unwrap() + Modular::new(2500),
            Modular::ZERO
        );
        assert_eq!(
            Modular::from_f64(1e-20).unwrap() * Modular::from_f64(1e20).unwrap(),
            Modular::ONE
        );
        assert_eq!(Modular::from_f64(f64::NAN), None);
    }

    proptest! {
        #[test]
        fn field_laws(a: u64, b: u64, c: u64) {
            let (a, b, c) = (Modular::new(a), Modular::new(b), Modular::new(c));
            prop_assert_eq!(a * (b + c), a * b + a * c);
            prop_assert_eq!(a - b + b, a);
            if let Some(inverse) = a.inverse() {
                prop_assert_eq!(a * inverse, Modular::ONE);
            }
            prop_assert_eq!((a * a).root().map(|r| r == a || r == -a), Some(true));
        }

        #[test]
        fn fractions_come_back(n in -1000_i64..1000, d in 1_i64..1000) {
            let gcd = |mut a: i64, mut b: i64| { while b != 0 { (a, b) = (b, a % b); } a.abs() };
            let g = gcd(n, d).max(1);
            let n_mod = if n < 0 { -Modular::new(n.unsigned_abs()) } else { Modular::new(n as u64) };
            let x = n_mod * Modular::new(d as u64).inverse().unwrap();
            prop_assert_eq!(x.as_fraction(1000), Some((n / g, d / g)));
        }
    }
}
