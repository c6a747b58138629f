//! First values of functions that are not rational.
//!
//! There is no exponential in a prime field: its value at a random point is drawn. But values
//! that belong together have to fit: e^(2x) is (e^x)², sin(−x) is −sin x, and ln e^x is x.
//! Arguments that are small multiples, sums or differences of earlier ones, or of 1, are
//! recognised by their values, however they are written.

use std::collections::BTreeSet;

use crate::field::{Modular, Random};

/// Every multiple of an argument by n/FINE has its value.
const FINE: u64 = 25_200;
/// Largest multiple looked for.
const LARGEST: u64 = 24;
/// Powers looked for under a logarithm.
const POWERS: u64 = 6;
/// Beyond this many arguments, sums are no longer looked for.
const MANY: usize = 64;

/// A law by which values are combined when arguments are added.
trait Law: Copy {
    fn neutral() -> Self;
    fn with(self, other: Self) -> Self;
    /// the value at the negative argument
    fn reversed(self) -> Option<Self>;
    fn drawn(random: &mut Random) -> Self;

    fn times(self, n: i64) -> Option<Self> {
        let mut base = if n < 0 { self.reversed()? } else { self };
        let (mut left, mut result) = (n.unsigned_abs(), Self::neutral());
        while left > 0 {
            if left & 1 == 1 {
                result = result.with(base);
            }
            base = base.with(base);
            left >>= 1;
        }
        Some(result)
    }
}

/// eˣ
impl Law for Modular {
    fn neutral() -> Self {
        Self::ONE
    }
    fn with(self, other: Self) -> Self {
        self * other
    }
    fn reversed(self) -> Option<Self> {
        self.inverse()
    }
    fn drawn(random: &mut Random) -> Self {
        random.element()
    }
}

/// (sin x, cos x)
#[derive(Clone, Copy, Debug)]
struct Angle(Modular, Modular);

impl Law for Angle {
    fn neutral() -> Self {
        Self(Modular::ZERO, Modular::ONE)
    }
    fn with(self, other: Self) -> Self {
        Self(
            self.0 * other.1 + self.1 * other.0,
            self.1 * other.1 - self.0 * other.0,
        )
    }
    fn reversed(self) -> Option<Self> {
        Some(Self(-self.0, self.1))
    }
    /// t ↦ (2t, 1 − t²)/(1 + t²); −1 is no square here, so that 1 + t² is not zero
    fn drawn(random: &mut Random) -> Self {
        let t = random.element();
        let square = t * t;
        let scale = (Modular::ONE + square).inverse().unwrap_or_default();
        Self((t + t) * scale, (Modular::ONE - square) * scale)
    }
}

/// Arguments with their values.
#[derive(Clone, Debug)]
struct Values<L> {
    /// (argument, its inverse, value)
    known: Vec<(Modular, Modular, L)>,
}

impl<L: Law> Values<L> {
    fn new() -> Self {
        Self { known: vec![] }
    }

    fn learn(&mut self, argument: Modular, value: L) {
        if let Some(inverse) = argument.inverse() {
            self.known.push((argument, inverse, value));
        }
    }

    /// A multiple of a known argument.
    fn multiple(&self, argument: Modular) -> Option<L> {
        let ratio = |inverse: Modular| (argument * inverse).as_integer(FINE * LARGEST);
        let mut known = self.known.iter();
        known.find_map(|&(_, inverse, value)| value.times(ratio(inverse)?))
    }

    /// A known argument more or less than a multiple of another one.
    fn sum(&self, argument: Modular) -> Option<L> {
        if self.known.len() > MANY {
            return None;
        }
        self.known.iter().find_map(|&(known, _, value)| {
            let fine = Modular::new(FINE);
            let steps = [(known, value)].into_iter();
            // the argument that was met, not the fine step, is what sums are made of
            let whole = value.times(FINE as i64).map(|whole| (known * fine, whole));
            steps
                .chain(whole)
                .find_map(|(known, value)| match self.multiple(argument - known) {
                    Some(rest) => Some(rest.with(value)),
                    None => Some(self.multiple(argument + known)?.with(value.reversed()?)),
                })
        })
    }

    fn at(&mut self, argument: Modular, mut random: Random) -> L {
        if argument.is_zero() {
            return L::neutral();
        }
        let known = self.multiple(argument).or_else(|| self.sum(argument));
        known.unwrap_or_else(|| {
            let step = argument * Modular::new(FINE).inverse().unwrap_or_default();
            let value = L::drawn(&mut random);
            self.learn(step, value);
            value.times(FINE as i64).unwrap_or(value)
        })
    }
}

/// Inverse functions that are odd.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Odd {
    ArcSine,
    ArcTangent,
}

/// The values met so far.
#[derive(Clone, Debug)]
pub(crate) struct Functions {
    seed: u64,
    exponentials: Values<Modular>,
    angles: Values<Angle>,
    /// (argument, logarithm)
    logarithms: Vec<(Modular, Modular)>,
    odd: Vec<(Odd, Modular, Modular)>,
    /// slots of roots of numbers that have none in this field: taken of −a instead
    turned: BTreeSet<usize>,
}

impl Functions {
    pub fn new(seed: u64, turned: &BTreeSet<usize>) -> Self {
        let mut functions = Self {
            seed: seed.wrapping_add(0x9e37),
            exponentials: Values::new(),
            angles: Values::new(),
            logarithms: vec![],
            odd: vec![],
            turned: turned.clone(),
        };
        functions.exponential(Modular::ONE);
        functions
    }

    /// Numbers that depend on the argument: another point, another value.
    fn random(&self, a: Modular) -> Random {
        a.random(self.seed)
    }

    pub(super) fn is_turned(&self, slot: usize) -> bool {
        self.turned.contains(&slot)
    }

    pub(super) fn exponential(&mut self, a: Modular) -> Modular {
        let value = self.exponentials.at(a, self.random(a));
        if !a.is_zero() && self.logarithms.iter().all(|known| known.0 != value) {
            self.logarithms.push((value, a));
        }
        value
    }

    /// (sin a, cos a)
    pub(super) fn angle(&mut self, a: Modular) -> (Modular, Modular) {
        let Angle(sine, cosine) = self.angles.at(a, self.random(a));
        (sine, cosine)
    }

    pub(super) fn logarithm(&mut self, a: Modular) -> Modular {
        if a == Modular::ONE {
            return Modular::ZERO;
        }
        if let Some(known) = self.known_logarithm(a) {
            return known;
        }
        if let Some(value) = self.logarithm_of_root(a) {
            return self.learn_logarithm(a, value);
        }
        // a number times an earlier argument
        let of_number = self.logarithms.iter().find_map(|&(known, value)| {
            let ratio = a * known.inverse()?;
            ratio.as_fraction(LARGEST as i64)?;
            Some((ratio, value))
        });
        if let Some((ratio, value)) = of_number
            && self.known_logarithm(ratio).is_none()
        {
            self.draw_logarithm(ratio);
            return value + self.logarithms.last().map_or(Modular::ZERO, |l| l.1);
        }
        self.draw_logarithm(a)
    }

    fn draw_logarithm(&mut self, a: Modular) -> Modular {
        self.learn_logarithm(a, self.random(a).element())
    }

    fn learn_logarithm(&mut self, a: Modular, value: Modular) -> Modular {
        self.logarithms.push((a, value));
        self.exponentials.learn(value, a);
        value
    }

    /// Of what an earlier argument, or its inverse, is a power.
    fn logarithm_of_root(&self, a: Modular) -> Option<Modular> {
        (2..=POWERS).find_map(|n| {
            let (power, part) = (a.power(n), Modular::new(n).inverse()?);
            self.logarithms.iter().find_map(|&(known, value)| match () {
                () if power == known => Some(value * part),
                () if power * known == Modular::ONE => Some(-value * part),
                () => None,
            })
        })
    }

    /// Powers, products and quotients of earlier arguments.
    fn known_logarithm(&self, a: Modular) -> Option<Modular> {
        let one = |a: Modular| {
            self.logarithms.iter().find_map(|&(known, value)| {
                let (mut power, mut sum) = (known, value);
                for _ in 0..POWERS {
                    if power == a {
                        return Some(sum);
                    }
                    if power * a == Modular::ONE {
                        return Some(-sum);
                    }
                    power = power * known;
                    sum = sum + value;
                }
                None
            })
        };
        if let Some(found) = one(a) {
            return Some(found);
        }
        if self.logarithms.len() > MANY {
            return None;
        }
        self.logarithms.iter().find_map(|&(known, value)| {
            let quotient = a * known.inverse()?;
            match one(quotient) {
                Some(rest) => Some(rest + value),
                None => Some(one(a * known)? - value),
            }
        })
    }

    pub(super) fn odd(&mut self, of: Odd, a: Modular) -> Modular {
        if a.is_zero() {
            return a;
        }
        let mut known = self.odd.iter().filter(|known| known.0 == of);
        let found = known.find_map(|&(_, argument, value)| match () {
            () if argument == a => Some(value),
            () if argument == -a => Some(-value),
            () => None,
        });
        found.unwrap_or_else(|| {
            let value = self.random(a).element();
            self.odd.push((of, a, value));
            value
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_fit_together() {
        let mut f = Functions::new(3, &BTreeSet::new());
        let mut random = Random::new(5);
        let (x, y) = (random.element(), random.element());
        let half = Modular::new(2).inverse().unwrap();
        let (ex, ey) = (f.exponential(x), f.exponential(y));
        assert_eq!(f.exponential(x + x), ex * ex);
        assert_eq!(f.exponential(-x) * ex, Modular::ONE);
        assert_eq!(f.exponential(x + y), ex * ey);
        assert_eq!(f.exponential(x - y) * ey, ex);
        let root = f.exponential(x * half);
        assert_eq!(root * root, ex);
        let shifted = f.exponential(x + Modular::ONE);
        assert_eq!(shifted, ex * f.exponential(Modular::ONE));
        assert_eq!(f.logarithm(ex), x);
        assert_eq!(f.logarithm(ex * ey), x + y);
        let (z, w) = (random.element(), random.element());
        let (lz, lw) = (f.logarithm(z), f.logarithm(w));
        assert_eq!(f.exponential(lz), z);
        assert_eq!(f.logarithm(z * w), lz + lw);
        assert_eq!(f.logarithm(z * z * z), lz + lz + lz);
        assert_eq!(
            f.logarithm(w * Modular::new(3)) - lw,
            f.logarithm(Modular::new(3))
        );
        let (s, c) = f.angle(x);
        assert_eq!(s * s + c * c, Modular::ONE);
        assert_eq!(f.angle(x + x), (s * c + s * c, c * c - s * s));
        assert_eq!(f.angle(-x), (-s, c));
        assert_eq!(f.odd(Odd::ArcTangent, -x), -f.odd(Odd::ArcTangent, x));
        assert_eq!(f.angle(Modular::ZERO), (Modular::ZERO, Modular::ONE));
    }
}
