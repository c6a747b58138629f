//! First values of functions that are not rational.
//!
//! There is no exponential in a prime field: its value at a random point is drawn. But values
//! that belong together have to fit: e^(2x) is (e^x)², sin(−x) is −sin x, and ln e^x is x.
//! Arguments that are small multiples, sums or differences of earlier ones, or of 1, are
//! recognised by their values, however they are written. The values of inverse functions
//! are arguments of their functions.

use std::collections::BTreeSet;

use lynkeus_expr::modular::{Modular, Random};

/// Largest number looked for beside an earlier argument of a logarithm, and largest multiple of an angle.
const LARGEST: u64 = 24;
/// Powers looked for under a logarithm.
const POWERS: u64 = 6;

/// Functions by their derivatives, with any value at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    /// its own derivative
    Exponential,
    Logarithm,
    /// the inverse of the sine
    Arcsine,
    /// of the tangent
    Arctangent,
}

/// A value of an inverse function, with its sine and cosine.
#[derive(Clone, Copy, Debug)]
struct Known {
    of: Function,
    argument: Modular,
    value: Modular,
    angle: Option<Angle>,
}

/// The values met so far.
#[derive(Clone, Debug)]
pub(crate) struct Functions {
    seed: u64,
    exponentials: Values<Modular>,
    angles: Values<Angle>,
    /// (argument, logarithm)
    logarithms: Vec<(Modular, Modular)>,
    arcs: Vec<Known>,
    /// slots of roots and logarithms of numbers that are no squares in this field: roots are
    /// taken of −a instead, logarithms are any numbers
    turned: BTreeSet<usize>,
}

impl Functions {
    pub fn new(seed: u64, turned: &BTreeSet<usize>) -> Self {
        let mut functions = Self {
            seed: seed.wrapping_add(0x9e37),
            exponentials: Values::new(),
            angles: Values::new(),
            logarithms: vec![],
            arcs: vec![],
            turned: turned.clone(),
        };
        functions.exponential(&[Modular::ONE]);
        let right = Modular::from_f64(std::f64::consts::PI).unwrap_or_default() * Modular::half();
        let angle = Angle(Modular::ONE, Modular::ZERO);
        functions.angles.learn(right, angle);
        functions
    }

    /// Numbers that depend on the argument: another point, another value.
    fn random(&self, a: Modular) -> Random {
        a.random(self.seed)
    }

    pub(super) fn is_turned(&self, slot: usize) -> bool {
        self.turned.contains(&slot)
    }

    /// e to the sum of these
    pub(super) fn exponential(&mut self, terms: &[Modular]) -> Modular {
        let mut value = Modular::ONE;
        for &term in terms {
            let factor = self.exponentials.at(term, self.random(term));
            self.has_logarithm(factor, term);
            value = value * factor;
        }
        let sum = terms.iter().fold(Modular::ZERO, |sum, &term| sum + term);
        self.has_logarithm(value, sum);
        value
    }

    /// What e^a was has the logarithm a.
    fn has_logarithm(&mut self, value: Modular, a: Modular) {
        if !a.is_zero() && self.logarithms.iter().all(|known| known.0 != value) {
            self.logarithms.push((value, a));
        }
    }

    /// (sin a, cos a) of the sum a of these
    pub(super) fn angle(&mut self, terms: &[Modular]) -> (Modular, Modular) {
        let none = Angle(Modular::ZERO, Modular::ONE);
        let Angle(sine, cosine) = terms.iter().fold(none, |sum, &term| {
            let random = self.random(term);
            sum.with(self.angles.at(term, random))
        });
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

    /// The inverse sine or tangent of a, `cosine` being that of the value where it is known.
    pub(super) fn arc(&mut self, of: Function, a: Modular, cosine: Option<Modular>) -> Modular {
        if a.is_zero() {
            return a;
        }
        let angle = cosine.map(|cosine| match of {
            Function::Arctangent => Angle(a * cosine, cosine),
            _ => Angle(a, cosine),
        });
        if let Some(value) = self.known_arc(of, a, angle) {
            return value;
        }
        let value = self.random(a).element();
        if let Some(angle) = angle {
            self.angles.learn(value, angle);
        }
        self.arcs.push(Known {
            of,
            argument: a,
            value,
            angle,
        });
        value
    }

    /// An arc met before, be it of the other function, its negative or its complement.
    fn known_arc(&self, of: Function, a: Modular, angle: Option<Angle>) -> Option<Modular> {
        let right = Modular::from_f64(std::f64::consts::PI).unwrap_or_default() * Modular::half();
        self.arcs.iter().find_map(|known| {
            let same = |x: Modular| known.of == of && known.argument == x;
            let alike = |sine: Modular, cosine: Modular| {
                known.angle.zip(angle).is_some_and(|(one, other)| {
                    (one.0, one.1) == (sine * other.0, cosine * other.1)
                })
            };
            let one = Modular::ONE;
            // atan(1/a) is the complement of atan a on the same side of zero
            let inverse = of == Function::Arctangent && known.of == of && known.argument * a == one;
            match () {
                () if same(a) || alike(one, one) => Some(known.value),
                () if same(-a) || alike(-one, one) => Some(-known.value),
                () if inverse && a.is_positive() => Some(right - known.value),
                () if inverse => Some(-right - known.value),
                () => None,
            }
        })
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_fit_together() {
        let mut f = Functions::new(3, &BTreeSet::new());
        let mut random = Random::new(5);
        let (x, y) = (random.element(), random.element());
        let half = Modular::new(2).inverse().unwrap();
        let (ex, ey) = (f.exponential(&[x]), f.exponential(&[y]));
        assert_eq!(f.exponential(&[x + x]), ex * ex);
        assert_eq!(f.exponential(&[-x]) * ex, Modular::ONE);
        assert_eq!(f.exponential(&[x + y]), ex * ey);
        assert_eq!(f.exponential(&[x - y]) * ey, ex);
        let root = f.exponential(&[x * half]);
        assert_eq!(root * root, ex);
        let shifted = f.exponential(&[x + Modular::ONE]);
        assert_eq!(shifted, ex * f.exponential(&[Modular::ONE]));
        assert_eq!(f.logarithm(ex), x);
        assert_eq!(f.logarithm(ex * ey), x + y);
        let (z, w) = (random.element(), random.element());
        let (lz, lw) = (f.logarithm(z), f.logarithm(w));
        assert_eq!(f.exponential(&[lz]), z);
        assert_eq!(f.logarithm(z * w), lz + lw);
        assert_eq!(f.logarithm(z * z * z), lz + lz + lz);
        assert_eq!(
            f.logarithm(w * Modular::new(3)) - lw,
            f.logarithm(Modular::new(3))
        );
        let (s, c) = f.angle(&[x]);
        assert_eq!(s * s + c * c, Modular::ONE);
        assert_eq!(f.angle(&[x + x]), (s * c + s * c, c * c - s * s));
        assert_eq!(f.angle(&[-x]), (-s, c));
        let arc = f.arc(Function::Arctangent, x, None);
        assert_eq!(f.arc(Function::Arctangent, -x, None), -arc);
        let third = f.exponential(&[x * Modular::new(3).inverse().unwrap()]);
        assert_eq!(third * third * third, ex);
        let cosine = Modular::ONE - s * s;
        let (_, back) = (
            f.arc(Function::Arcsine, s, cosine.root()),
            cosine.root().unwrap(),
        );
        let value = f.arc(Function::Arcsine, s, Some(back));
        assert_eq!(f.angle(&[value]), (s, back));
        assert_eq!(f.angle(&[Modular::ZERO]), (Modular::ZERO, Modular::ONE));
    }
}
