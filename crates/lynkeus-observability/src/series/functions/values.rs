//! Values at arguments that are multiples, sums or differences of one another.

use crate::field::{Modular, Random};

/// Largest multiple of an angle looked for.
const LARGEST: u64 = 24;
/// Largest parts of a fraction of an exponent.
const FRACTION: i64 = 1000;
/// Beyond this many arguments, sums are no longer looked for.
pub(super) const MANY: usize = 64;

/// A law by which values are combined when arguments are added.
pub(super) trait Law: Copy {
    fn neutral() -> Self;
    fn with(self, other: Self) -> Self;
    /// the value at the negative argument
    fn reversed(self) -> Option<Self>;
    fn drawn(random: &mut Random) -> Self;
    /// the value at that many times the argument, where it is known
    fn scaled(self, ratio: Modular) -> Option<Self>;

    /// Every multiple of a drawn argument by n/FINE has its value.
    const FINE: u64;

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
    /// a square: e^a is one of e^(a/2), and has its roots
    fn drawn(random: &mut Random) -> Self {
        let root = random.element();
        root * root
    }
    fn scaled(self, ratio: Modular) -> Option<Self> {
        let (n, d) = ratio.as_fraction(FRACTION)?;
        self.rational_power(n, d)
    }

    const FINE: u64 = 1;
}

/// (sin x, cos x)
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle(pub Modular, pub Modular);

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
    fn scaled(self, ratio: Modular) -> Option<Self> {
        self.times(ratio.as_integer(Self::FINE * LARGEST)?)
    }

    const FINE: u64 = 25_200;
}

/// Arguments with their values.
#[derive(Clone, Debug)]
pub(super) struct Values<L> {
    /// (argument, its inverse, value)
    known: Vec<(Modular, Modular, L)>,
}

impl<L: Law> Values<L> {
    pub fn new() -> Self {
        Self { known: vec![] }
    }

    pub fn learn(&mut self, argument: Modular, value: L) {
        if let Some(inverse) = argument.inverse() {
            self.known.push((argument, inverse, value));
        }
    }

    /// A multiple of a known argument.
    fn multiple(&self, argument: Modular) -> Option<L> {
        let mut known = self.known.iter();
        known.find_map(|&(_, inverse, value)| value.scaled(argument * inverse))
    }

    /// A known argument more or less than a multiple of another one.
    fn sum(&self, argument: Modular) -> Option<L> {
        if self.known.len() > MANY {
            return None;
        }
        self.known.iter().find_map(|&(known, _, value)| {
            let fine = Modular::new(L::FINE);
            let steps = [(known, value)].into_iter();
            // the argument that was met, not the fine step, is what sums are made of
            let whole = value
                .times(L::FINE as i64)
                .map(|whole| (known * fine, whole));
            steps
                .chain(whole)
                .find_map(|(known, value)| match self.multiple(argument - known) {
                    Some(rest) => Some(rest.with(value)),
                    None => Some(self.multiple(argument + known)?.with(value.reversed()?)),
                })
        })
    }

    pub fn at(&mut self, argument: Modular, mut random: Random) -> L {
        if argument.is_zero() {
            return L::neutral();
        }
        let known = self.multiple(argument).or_else(|| self.sum(argument));
        known.unwrap_or_else(|| {
            let step = argument * Modular::new(L::FINE).inverse().unwrap_or_default();
            let value = L::drawn(&mut random);
            self.learn(step, value);
            value.times(L::FINE as i64).unwrap_or(value)
        })
    }
}
