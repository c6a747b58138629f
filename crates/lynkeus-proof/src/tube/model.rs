//! A Taylor model: a polynomial in symbols and in the share τ of a step, and a bound of what it
//! leaves out.
//!
//! Symbols lie in [−1, 1] and τ in [0, 1], so that no monomial is larger than one and a polynomial
//! no larger than the sum ‖p‖ of its coefficients' sizes. What is dropped, what rounding takes and
//! what the factors leave out is therefore bounded by products of such norms:
//! |xy − pq| ≤ ‖p‖ r_y + ‖q‖ r_x + r_x r_y for |x − p| ≤ r_x, |y − q| ≤ r_y.

use lynkeus_expr::Interval;

use super::ring::Ring;

/// All x(symbols, τ) with |x − Σ c τᵏ·monomial| ≤ `rest`.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// one row per power of τ, each with one coefficient per monomial; at least one row
    pub coefficients: Vec<f64>,
    /// infinite where nothing is known
    pub rest: f64,
}

/// An upper bound of a sum that was computed in floating point from at most so many terms that are
/// not negative, each the product of a few numbers. Zero stays zero: what may have become zero in a
/// product, callers add. What is no number bounds nothing.
pub(super) fn raised(sum: f64, terms: usize) -> f64 {
    let bound = sum * (1.0 + (terms as f64 + 8.0) * f64::EPSILON) + f64::MIN_POSITIVE;
    match bound.is_nan() {
        true => f64::INFINITY,
        false if sum == 0.0 => 0.0,
        false => bound,
    }
}

impl Model {
    /// What nothing is known of.
    pub fn unknown(ring: &Ring) -> Self {
        Self {
            rest: f64::INFINITY,
            ..Self::constant(ring, 0.0)
        }
    }

    /// A number.
    pub fn constant(ring: &Ring, value: f64) -> Self {
        let mut coefficients = vec![0.0; ring.len()];
        coefficients[0] = if value.is_finite() { value } else { 0.0 };
        let rest = if value.is_finite() {
            0.0
        } else {
            f64::INFINITY
        };
        Self { coefficients, rest }
    }

    /// Any function with values in an interval.
    pub fn within(ring: &Ring, range: Interval) -> Self {
        if !range.is_bounded() {
            return Self::unknown(ring);
        }
        let (middle, radius) = halves(range);
        Self {
            rest: radius,
            ..Self::constant(ring, middle)
        }
    }

    /// The numbers of an interval as middle + radius · symbol.
    pub fn along(ring: &Ring, range: Interval, symbol: usize) -> Self {
        let Some(place) = ring.symbol(symbol).filter(|_| range.is_bounded()) else {
            return Self::within(ring, range);
        };
        let (middle, radius) = halves(range);
        let mut model = Self::constant(ring, middle);
        model.coefficients[place] = radius;
        model
    }

    /// Powers of τ, with the zeroth.
    pub fn rows(&self, ring: &Ring) -> usize {
        self.coefficients.len() / ring.len()
    }

    /// ‖p‖, rounded up.
    pub fn norm(&self) -> f64 {
        norm(&self.coefficients)
    }

    /// Whether it is one number.
    pub fn is_number(&self) -> bool {
        self.rest == 0.0 && self.coefficients[1..].iter().all(|c| *c == 0.0)
    }

    pub fn negated(&self) -> Self {
        let coefficients = self.coefficients.iter().map(|c| -c).collect();
        Self {
            coefficients,
            rest: self.rest,
        }
    }

    pub fn plus(&self, other: &Self) -> Self {
        let (long, short) = match self.coefficients.len() < other.coefficients.len() {
            true => (other, self),
            false => (self, other),
        };
        let mut coefficients = long.coefficients.clone();
        let mut rounded = 0.0;
        for (sum, term) in coefficients.iter_mut().zip(&short.coefficients) {
            let exact = *sum == 0.0 || *term == 0.0;
            *sum += term;
            if !exact {
                rounded += sum.abs();
            }
        }
        let rest =
            raised(self.rest + other.rest, 2) + raised(f64::EPSILON * rounded, coefficients.len());
        Self {
            rest: raised(rest, 2),
            coefficients,
        }
    }

    pub fn minus(&self, other: &Self) -> Self {
        self.plus(&other.negated())
    }

    /// The product, without powers of τ beyond `degree`.
    pub fn times(&self, other: &Self, ring: &Ring, degree: usize) -> Self {
        let width = ring.len();
        let (rows, others) = (self.rows(ring), other.rows(ring));
        let kept = (rows + others - 1).min(degree + 1);
        let mut coefficients = vec![0.0; kept * width];
        // what is zero to the end of a row adds nothing
        let end = |row: &[f64]| {
            row.iter()
                .rposition(|c| *c != 0.0)
                .map_or(0, |last| last + 1)
        };
        let ends: Vec<usize> = other.coefficients.chunks(width).map(end).collect();
        for a in 0..rows.min(kept) {
            for i in 0..width {
                let factor = self.coefficients[a * width + i];
                if factor == 0.0 {
                    continue;
                }
                let places = ring.products(i);
                for b in 0..others.min(kept - a) {
                    let length = places.len().min(ends[b]);
                    let row = &other.coefficients[b * width..][..length];
                    let sums = &mut coefficients[(a + b) * width..][..width];
                    for (&place, &c) in places.iter().zip(row) {
                        sums[place as usize] += factor * c;
                    }
                }
            }
        }
        let (sizes, others) = (Sizes::of(self, ring), Sizes::of(other, ring));
        let (own, its) = (sizes.whole, others.whole);
        // infinite where a coefficient overflows
        let whole = own * its;
        // a coefficient gets at most one term from each coefficient of either factor
        let terms = sizes.entries.min(others.entries);
        // what is below rounding is left out
        let mut swept = 0.0;
        for c in &mut coefficients {
            if c.abs() < 0.25 * f64::EPSILON * whole {
                swept += c.abs();
                *c = 0.0;
            }
        }
        let rounding = raised((terms as f64 + 1.0) * f64::EPSILON * whole, 4)
            + sizes.entries as f64 * others.entries as f64 * f64::MIN_POSITIVE;
        let rounding = rounding + raised(swept, coefficients.len());
        let lost = sizes.dropped(&others, degree);
        let left_out = own * other.rest + its * self.rest + self.rest * other.rest;
        let is_zero = own == 0.0 && self.rest == 0.0 || its == 0.0 && other.rest == 0.0;
        let rest = match is_zero {
            // zero times what may have no value may have none
            true if self.rest.is_infinite() || other.rest.is_infinite() => f64::INFINITY,
            true => 0.0,
            false => raised(lost + rounding + left_out + f64::MIN_POSITIVE, 8),
        };
        Self { coefficients, rest }
    }

    /// ∫₀^τ, from τ⁰…τᵏ to τ⁰…τᵏ⁺¹.
    pub fn integral(&self, ring: &Ring) -> Self {
        let width = ring.len();
        let mut coefficients = vec![0.0; width];
        for (k, row) in self.coefficients.chunks(width).enumerate() {
            coefficients.extend(row.iter().map(|c| c / (k + 1) as f64));
        }
        let rounding =
            f64::EPSILON * norm(&coefficients) + coefficients.len() as f64 * f64::MIN_POSITIVE;
        let rest = raised(self.rest + rounding, 4);
        Self { coefficients, rest }
    }

    /// The polynomial alone, up to a power of τ.
    pub fn polynomial(&self, ring: &Ring, degree: usize) -> Self {
        let kept = self.coefficients.len().min((degree + 1) * ring.len());
        Self {
            coefficients: self.coefficients[..kept].to_vec(),
            rest: 0.0,
        }
    }

    /// Everything at τ = 1: one row.
    pub fn at_end(&self, ring: &Ring) -> Self {
        let width = ring.len();
        let mut coefficients = vec![0.0; width];
        for row in self.coefficients.chunks(width) {
            for (sum, c) in coefficients.iter_mut().zip(row) {
                *sum += c;
            }
        }
        let rounding = self.rows(ring) as f64 * f64::EPSILON * self.norm();
        Self {
            coefficients,
            rest: raised(self.rest + rounding, 4),
        }
    }

    /// All its values while τ is within a part of [0, 1].
    pub fn range_over(&self, ring: &Ring, part: Interval) -> Interval {
        let rows = self.rows(ring);
        let along = |i: usize| {
            let powers = (0..rows)
                .rev()
                .map(|k| self.coefficients[k * ring.len() + i]);
            powers.fold(Interval::ZERO, |sum, c| sum * part + Interval::point(c))
        };
        let symmetric = Interval::point(-1.0).hull(Interval::ONE);
        let size = |i: usize| match ring.is_even(i) {
            true => Interval::ZERO.hull(Interval::ONE),
            false => symmetric,
        };
        let used = |i: &usize| (0..rows).any(|k| self.coefficients[k * ring.len() + i] != 0.0);
        let others = (1..ring.len()).filter(used);
        let sum = others.fold(along(0), |sum, i| sum + along(i) * size(i));
        match self.rest.is_finite() && sum.is_bounded() {
            true => sum + Interval::point(self.rest) * symmetric,
            false => Interval::UNKNOWN,
        }
    }

    /// All its values where the first symbols of the start set have these values, for a model
    /// without τ.
    pub fn range_at(&self, ring: &Ring, symbols: &[f64]) -> Interval {
        let symbols = &symbols[..symbols.len().min(ring.start())];
        let value = |i: usize| {
            let powers = ring.exponents(i).iter().enumerate();
            let factor = |(j, &power): (usize, &u8)| match symbols.get(j) {
                Some(&s) => Interval::point(s).powi(i32::from(power)),
                None if power == 0 => Interval::ONE,
                None => Interval::point(-1.0).hull(Interval::ONE),
            };
            powers
                .map(factor)
                .fold(Interval::ONE, |product, f| product * f)
        };
        let terms = self.coefficients[..ring.len()].iter().enumerate();
        let used = terms.filter(|(_, c)| **c != 0.0);
        let sum = used.fold(Interval::ZERO, |sum, (i, c)| {
            sum + Interval::point(*c) * value(i)
        });
        sum.inflate(self.rest)
    }

    /// All its values.
    pub fn range(&self, ring: &Ring) -> Interval {
        let (mut low, mut high) = (0.0, 0.0);
        for (k, row) in self.coefficients.chunks(ring.len()).enumerate() {
            for (i, c) in row.iter().enumerate().skip(usize::from(k == 0)) {
                if c.is_nan() {
                    return Interval::UNKNOWN;
                }
                if *c != 0.0 {
                    let (least, most) = match ring.is_even(i) {
                        true => (c.min(0.0), c.max(0.0)),
                        false => (-c.abs(), c.abs()),
                    };
                    low += least;
                    high += most;
                }
            }
        }
        let around = raised(self.rest, 1);
        let terms = self.coefficients.len();
        let spread = Interval::new(
            -raised(raised(-low, terms) + around, 2),
            raised(raised(high, terms) + around, 2),
        );
        let range = Interval::point(self.coefficients[0]) + spread.unwrap_or(Interval::UNKNOWN);
        match range.is_bounded() {
            true => range,
            false => Interval::UNKNOWN,
        }
    }
}

/// How large the coefficients of a model are.
struct Sizes {
    /// of each power of τ, by weight: the norm of what has it, and of what has it or more
    powers: Vec<Vec<[f64; 2]>>,
    /// the norm
    whole: f64,
    /// how many are not zero
    entries: usize,
}

impl Sizes {
    fn of(x: &Model, ring: &Ring) -> Self {
        let mut entries = 0;
        let mut power = |row: &[f64]| {
            entries += row.iter().filter(|c| **c != 0.0).count();
            let mut sizes = vec![[0.0; 2]; ring.order() + 1];
            let mut tail = 0.0;
            for (size, places) in sizes.iter_mut().zip(ring.by_weight()).rev() {
                let own: f64 = row[places.clone()].iter().map(|c| c.abs()).sum();
                tail += own;
                *size = [own, tail].map(|sum| raised(sum, row.len() + ring.order()));
            }
            sizes
        };
        let powers: Vec<_> = x.coefficients.chunks(ring.len()).map(&mut power).collect();
        let whole = powers.iter().map(|sizes| sizes[0][1]).sum();
        Self {
            whole: raised(whole, powers.len()),
            powers,
            entries,
        }
    }

    /// What a product leaves out: monomials beyond the order of the ring, powers of τ beyond `degree`.
    fn dropped(&self, other: &Self, degree: usize) -> f64 {
        let mut lost = 0.0;
        for (a, sizes) in self.powers.iter().enumerate() {
            for (b, others) in other.powers.iter().enumerate() {
                lost += match a + b > degree {
                    true => sizes[0][1] * others[0][1],
                    // of weight w with what is too heavy beside it
                    false => sizes[1..]
                        .iter()
                        .zip(others.iter().rev())
                        .map(|([size, _], [_, heavy])| size * heavy)
                        .sum(),
                };
            }
        }
        let order = self.powers[0].len();
        raised(lost, self.powers.len() * other.powers.len() * order)
    }
}

/// The sum of sizes, rounded up.
fn norm(coefficients: &[f64]) -> f64 {
    raised(
        coefficients.iter().map(|c| c.abs()).sum(),
        coefficients.len(),
    )
}

/// A middle and a radius that reaches both ends.
fn halves(range: Interval) -> (f64, f64) {
    let middle = range.midpoint();
    (middle, (range - Interval::point(middle)).magnitude())
}
