//! The integers modulo a prime of 61 bits: exact arithmetic in which a wrong rank is as
//! unlikely as hitting a root of a polynomial with a random number of 61 bits.
//!
//! The prime is safe: half of it, rounded down, is a prime q too. So the squares are a group of
//! prime order, in which every element has one n-th root for every n: they behave as positive numbers do, with
//! −1 no square. Of such primes it is the largest for which 2, 3, 5, 7 and 11 are
//! squares.

use std::ops::{Add, Mul, Neg, Sub};

/// 2⁶¹ − GAP
const PRIME: u64 = (1 << 61) - GAP;
const GAP: u64 = 3153;
const LOW: u64 = (1 << 61) - 1;
/// Number of squares but 0, a prime.
const SQUARES: u64 = (PRIME - 1) / 2;
/// Decimals of at least that many digits may be rounded fractions.
const LONG: usize = 15;
/// Largest denominator of such.
const DENOMINATOR: u32 = 1000;

/// An element of the field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modular(u64);

impl Modular {
    /// 0
    pub const ZERO: Self = Self(0);
    /// 1
    pub const ONE: Self = Self(1);

    /// The residue of a number.
    #[inline]
    pub fn new(value: u64) -> Self {
        Self(value % PRIME)
    }

    /// Whether it is 0.
    #[inline]
    pub fn is_zero(self) -> bool {
        self.0 == 0
    }

    /// self^exponent
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

    /// 1/2
    pub fn half() -> Self {
        Self(PRIME.div_ceil(2))
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

    /// Whether it is a square other than 0, as positive numbers are.
    pub fn is_positive(self) -> bool {
        self.power(SQUARES) == Self::ONE
    }

    /// self^(n/d), d > 0, a square as self has to be; none where that is not.
    pub fn rational_power(self, n: i64, d: i64) -> Option<Self> {
        if d == 1 {
            let power = self.power(n.unsigned_abs());
            return if n < 0 { power.inverse() } else { Some(power) };
        }
        // the inverse modulo a prime, by Fermat's theorem
        let times = |a: u64, b: u64| (u128::from(a) * u128::from(b) % u128::from(SQUARES)) as u64;
        let bits = (0..u64::BITS).rev().map(|k| (SQUARES - 2) >> k & 1);
        let inverse = bits.fold(1, |power, bit| match bit {
            1 => times(times(power, power), d.unsigned_abs()),
            _ => times(power, power),
        });
        let exponent = times(inverse, n.unsigned_abs() % SQUARES);
        let power = self.is_positive().then(|| self.power(exponent))?;
        if n < 0 { power.inverse() } else { Some(power) }
    }

    /// The number that a person meant: 0.1 is 1/10, not the nearest double, and
    /// 0.3333333333333333 is 1/3.
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
        let digits = mantissa.replace('.', "");
        if digits.len() >= LONG
            && let Some(fraction) = Self::rounded_fraction(value)
        {
            return Some(fraction);
        }
        let digits: u64 = digits.parse().ok()?;
        let shift = exponent - fraction;
        let magnitude = Self::new(digits) * Self::new(10).rational_power(shift, 1)?;
        Some(magnitude.signed(value))
    }

    /// The double itself, which is m·2ᵉ.
    pub fn of_double(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        let bits = value.abs().to_bits();
        let fraction = bits & ((1 << 52) - 1);
        let (mantissa, exponent) = match (bits >> 52) as i64 {
            0 => (fraction, -1074),
            exponent => (fraction | 1 << 52, exponent - 1075),
        };
        let magnitude = Self::new(mantissa) * Self::new(2).rational_power(exponent, 1)?;
        Some(magnitude.signed(value))
    }

    /// With the sign of a number.
    fn signed(self, of: f64) -> Self {
        if of < 0.0 { -self } else { self }
    }

    /// n/d, where that is the nearest double for a small d.
    fn rounded_fraction(value: f64) -> Option<Self> {
        let denominators = (3..=DENOMINATOR).map(f64::from);
        let numerator = |d: f64| (value.abs() * d).round();
        let exact = |&d: &f64| numerator(d) < 1e9 && numerator(d) / d == value.abs();
        let d = denominators.into_iter().find(exact)?;
        let magnitude = Self::new(numerator(d) as u64) * Self::new(d as u64).inverse()?;
        Some(magnitude.signed(value))
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
    /// reconstruction; it is unique as long as 2·bound² < PRIME).
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
    #[inline]
    fn add(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        Self(if sum >= PRIME { sum - PRIME } else { sum })
    }
}

impl Sub for Modular {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Modular {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(if self.0 == 0 { 0 } else { PRIME - self.0 })
    }
}

impl Mul for Modular {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::reduced(u128::from(self.0) * u128::from(other.0))
    }
}

/// A sum of products that is reduced at the end: [`Wide::PRODUCTS`] of them fit.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wide(u128);

impl Wide {
    /// Products that may be added between two calls of [`Wide::folded`].
    pub const PRODUCTS: usize = 60;

    /// Adds a·b.
    #[inline]
    pub fn add_product(&mut self, a: Modular, b: Modular) {
        self.0 += u128::from(a.0) * u128::from(b.0);
    }

    /// The same residue below 2⁸⁰, less than one product.
    #[inline]
    pub fn folded(self) -> Self {
        Self(u128::from(self.0 as u64 & LOW) + (self.0 >> 61) * u128::from(GAP))
    }

    /// The residue.
    #[inline]
    pub fn value(self) -> Modular {
        Modular::reduced(self.folded().0)
    }
}

impl From<Modular> for Wide {
    #[inline]
    fn from(value: Modular) -> Self {
        Self(u128::from(value.0))
    }
}

impl Modular {
    /// The residue of a number below 2¹²⁴.
    #[inline]
    fn reduced(number: u128) -> Self {
        // 2⁶¹ ≡ GAP, twice
        let high = (number >> 61) as u64;
        let folded = u128::from(high) * u128::from(GAP) + u128::from(number as u64 & LOW);
        let folded = (folded as u64 & LOW) + (folded >> 61) as u64 * GAP;
        Self(if folded >= PRIME {
            folded - PRIME
        } else {
            folded
        })
    }
}

/// A reproducible stream of field elements (SplitMix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The stream of a seed.
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

/// The vector with 1 in one place and 0 in the others.
pub fn unit(width: usize, place: usize) -> Vec<Modular> {
    let mut unit = vec![Modular::ZERO; width];
    unit[place] = Modular::ONE;
    unit
}

/// Σ a_k b_k, over as many as both have.
pub fn dot(a: &[Modular], b: &[Modular]) -> Modular {
    let terms = a.iter().zip(b).map(|(a, b)| *a * *b);
    terms.fold(Modular::ZERO, |sum, term| sum + term)
}

/// Row echelon form, row by row: the row space of the rows added so far.
#[derive(Clone, Debug)]
pub struct Echelon {
    width: usize,
    /// (pivot column, row scaled to 1 there), in order of arrival
    rows: Vec<(usize, Vec<Modular>)>,
}

impl Echelon {
    /// No rows of that many columns.
    pub fn new(width: usize) -> Self {
        let rows = vec![];
        Self { width, rows }
    }

    /// The space that rows of that many columns span.
    pub fn of<R: AsRef<[Modular]>>(width: usize, rows: impl IntoIterator<Item = R>) -> Self {
        let mut space = Self::new(width);
        for row in rows {
            space.add(row.as_ref());
        }
        space
    }

    /// Number of independent rows.
    pub fn rank(&self) -> usize {
        self.rows.len()
    }

    /// The rows, each scaled to 1 at its pivot.
    pub fn rows(&self) -> impl Iterator<Item = &[Modular]> {
        self.rows.iter().map(|(_, row)| row.as_slice())
    }

    /// The pivot columns: the first that is not zero of each row of the echelon form.
    pub fn pivots(&self) -> impl Iterator<Item = usize> + '_ {
        self.rows.iter().map(|(pivot, _)| *pivot)
    }

    /// What is left of a row after the known rows are taken out.
    fn reduced(&self, row: &[Modular]) -> Vec<Modular> {
        let mut wide: Vec<Wide> = row.iter().map(|&x| Wide::from(x)).collect();
        wide.resize(self.width, Wide::default());
        let mut products = 1;
        for (pivot, known) in &self.rows {
            let factor = -wide[*pivot].value();
            if factor.is_zero() {
                continue;
            }
            products += 1;
            if products >= Wide::PRODUCTS {
                wide.iter_mut().for_each(|x| *x = x.folded());
                products = 2;
            }
            // a row is zero before its pivot, and so is what is left there
            for (x, y) in wide[*pivot..].iter_mut().zip(&known[*pivot..]) {
                x.add_product(factor, *y);
            }
        }
        wide.into_iter().map(Wide::value).collect()
    }

    /// Adds a row; true if it was independent of the others.
    pub fn add(&mut self, row: &[Modular]) -> bool {
        let mut row = self.reduced(row);
        let Some(pivot) = row.iter().position(|x| !x.is_zero()) else {
            return false;
        };
        let Some(inverse) = row[pivot].inverse() else {
            return false;
        };
        row.iter_mut().for_each(|x| *x = *x * inverse);
        self.rows.push((pivot, row));
        true
    }

    /// Whether a row lies in the row space.
    pub fn contains(&self, row: &[Modular]) -> bool {
        self.reduced(row).iter().all(|x| x.is_zero())
    }

    /// The rows in reduced form: each pivot column is zero in all rows but its own.
    pub fn reduced_rows(&self) -> Vec<(usize, Vec<Modular>)> {
        let mut rows = self.rows.clone();
        for k in (0..rows.len()).rev() {
            let (pivot, row) = rows[k].clone();
            for (_, above) in &mut rows[..k] {
                eliminate(above, pivot, &row);
            }
        }
        rows
    }

    /// A basis of the directions that no row sees: one vector per column without pivot.
    pub fn kernel(&self) -> Vec<Vec<Modular>> {
        let rows = self.reduced_rows();
        let free = (0..self.width).filter(|j| rows.iter().all(|(pivot, _)| pivot != j));
        let direction = |j: usize| {
            let mut direction = unit(self.width, j);
            for (pivot, row) in &rows {
                direction[*pivot] = -row[j];
            }
            direction
        };
        free.map(direction).collect()
    }
}

/// row −= row[pivot]·known
fn eliminate(row: &mut [Modular], pivot: usize, known: &[Modular]) {
    let factor = -row[pivot];
    if factor.is_zero() {
        return;
    }
    for (x, y) in row.iter_mut().zip(known) {
        *x = *x + factor * *y;
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
        let third = Modular::from_f64(-1.0 / 3.0).unwrap();
        assert_eq!(third * Modular::new(3), -Modular::ONE);
    }

    #[test]
    fn doubles_are_taken_as_they_are() {
        let half = Modular::of_double(0.5).unwrap();
        assert_eq!(half * Modular::new(2), Modular::ONE);
        let minus = Modular::of_double(-3.0).unwrap();
        assert_eq!(minus + Modular::new(3), Modular::ZERO);
        let small = Modular::of_double(1e-300).unwrap();
        assert_eq!(small * small.inverse().unwrap(), Modular::ONE);
        assert_ne!(Modular::of_double(0.1), Modular::from_f64(0.1));
    }

    /// Against arithmetic in 128 bits, where the folding could go wrong.
    #[test]
    fn products_are_reduced() {
        for a in [
            1,
            2,
            GAP,
            LOW - 1,
            PRIME - 1,
            PRIME - GAP,
            PRIME / 2,
            1 << 60,
        ] {
            for b in [1, GAP, PRIME - 1, PRIME - 2, PRIME / 3] {
                let product = (u128::from(a) * u128::from(b) % u128::from(PRIME)) as u64;
                assert_eq!(Modular::new(a) * Modular::new(b), Modular::new(product));
            }
        }
        let largest = Modular::new(PRIME - 1);
        let mut sum = Wide::from(largest);
        (0..Wide::PRODUCTS).for_each(|_| sum.add_product(largest, largest));
        let expected = Modular::new(Wide::PRODUCTS as u64) - Modular::ONE;
        assert_eq!(sum.value(), expected);
        assert_eq!(sum.folded().value(), expected);
        for small in [2, 3, 5, 7, 11] {
            assert!(Modular::new(small).is_positive());
        }
    }

    fn row(values: &[i64]) -> Vec<Modular> {
        let number = |&x: &i64| {
            let magnitude = Modular::new(x.unsigned_abs());
            if x < 0 { -magnitude } else { magnitude }
        };
        values.iter().map(number).collect()
    }

    #[test]
    fn kernel_and_rows_are_orthogonal() {
        let rows = [row(&[1, 2, 3, 4]), row(&[2, 4, 6, 9]), row(&[1, 2, 3, 5])];
        let mut echelon = Echelon::new(4);
        let new: Vec<bool> = rows.iter().map(|r| echelon.add(r)).collect();
        assert_eq!(new, [true, true, false]);
        let kernel = echelon.kernel();
        assert_eq!(kernel.len(), 2);
        for (r, v) in rows.iter().flat_map(|r| kernel.iter().map(move |v| (r, v))) {
            let product = r.iter().zip(v).fold(Modular::ZERO, |s, (a, b)| s + *a * *b);
            assert!(product.is_zero());
        }
        assert!(echelon.contains(&row(&[0, 0, 0, 7])) && !echelon.contains(&row(&[1, 0, 0, 0])));
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
            let square = a * a;
            if !a.is_zero() {
                prop_assert!(square.is_positive() && !(-square).is_positive());
                prop_assert_eq!(square.rational_power(1, 2), square.root());
                let part = square.rational_power(-3, 7).unwrap();
                prop_assert_eq!(part.power(7) * square.power(3), Modular::ONE);
            }
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
