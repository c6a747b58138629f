//! Powers with integer and with real exponents.

use super::Interval;
use super::arithmetic::{largest, smallest};
use super::rounding::{library_down, library_up, mul_down, mul_up};

impl Interval {
    /// The `n`-th powers, of members of any sign; x⁰ is 1 for every x.
    ///
    /// The bounds come from at most 2·log₂|n| rounded multiplications.
    #[must_use]
    pub fn powi(self, n: i32) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        if n == 0 {
            return Self::ONE.and_defined(self.defined);
        }
        let power = self.positive_power(n.unsigned_abs());
        if n > 0 {
            return power;
        }
        // A power that underflows encloses zero, but is not zero.
        let has_power = self.defined && !self.contains_zero();
        Self {
            defined: has_power,
            ..Self::ONE / power
        }
    }

    fn positive_power(self, n: u32) -> Self {
        let base = if n.is_multiple_of(2) {
            self.abs()
        } else {
            self
        };
        // Odd powers keep the sign, so both bounds follow from powers of absolute values.
        let lo = if base.lo >= 0.0 {
            repeated(base.lo, n, mul_down)
        } else {
            -repeated(-base.lo, n, mul_up)
        };
        let hi = if base.hi >= 0.0 {
            repeated(base.hi, n, mul_up)
        } else {
            -repeated(-base.hi, n, mul_down)
        };
        Self::raw(lo, hi, self.defined)
    }

    /// The powers with real exponents, as `f64::powf` defines them: for bases that are not negative (0⁰ = 1, and zero
    /// has no negative powers), and for negative bases with exponents that are integers.
    #[must_use]
    pub fn pow(self, exponent: Self) -> Self {
        if self.is_empty() || exponent.is_empty() {
            return Self::EMPTY;
        }
        if let Some(n) = exponent.as_i32() {
            return self.powi(n).and_defined(exponent.defined);
        }
        if self.lo >= 0.0 {
            return self.pow_of_non_negative(exponent);
        }
        let mut result = Self::EMPTY;
        if self.hi >= 0.0 {
            let base = Self { lo: 0.0, ..self };
            result = result.hull(base.pow_of_non_negative(exponent));
        }
        if exponent.lo.ceil() <= exponent.hi.floor() {
            let base = Self::raw((-self.hi).max(0.0), -self.lo, true);
            let powers = base.pow_of_non_negative(exponent);
            result = result.hull(powers).hull(-powers);
        }
        result.and_defined(false)
    }

    fn pow_of_non_negative(self, exponent: Self) -> Self {
        let no_value = self.hi == 0.0 && exponent.hi < 0.0;
        if no_value {
            return Self::EMPTY;
        }
        // x^y is monotone in x for every y and in y for every x: the extremes are at corners.
        let corners = [
            (self.lo, exponent.lo),
            (self.lo, exponent.hi),
            (self.hi, exponent.lo),
            (self.hi, exponent.hi),
        ];
        let lo = smallest(corners.map(|(x, y)| pow_down(x, y)));
        let hi = largest(corners.map(|(x, y)| pow_up(x, y)));
        let inside = self.lo > 0.0 || exponent.lo >= 0.0;
        Self::raw(lo, hi, self.defined && exponent.defined && inside)
    }

    fn as_i32(self) -> Option<i32> {
        let n = self.lo as i32;
        (self.is_point() && f64::from(n) == self.lo).then_some(n)
    }
}

/// x^n by squaring for x ≥ 0 and n ≥ 1, all products rounded by `mul`.
fn repeated(x: f64, n: u32, mul: impl Fn(f64, f64) -> f64) -> f64 {
    let mut result = x;
    for bit in (0..n.ilog2()).rev() {
        result = mul(result, result).max(0.0);
        if n & (1 << bit) != 0 {
            result = mul(result, x).max(0.0);
        }
    }
    result
}

/// Powers of the library that are exact whatever its error.
fn is_exact(x: f64, y: f64) -> bool {
    x == 0.0 || x == 1.0 || y == 0.0 || x.is_infinite() || y.is_infinite()
}

fn pow_down(x: f64, y: f64) -> f64 {
    let value = libm::pow(x, y);
    if is_exact(x, y) {
        value
    } else {
        library_down(value).max(0.0)
    }
}

fn pow_up(x: f64, y: f64) -> f64 {
    let value = libm::pow(x, y);
    if is_exact(x, y) {
        value
    } else {
        library_up(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f64 = f64::INFINITY;

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    fn undefined(lo: f64, hi: f64) -> Interval {
        interval(lo, hi).and_defined(false)
    }

    #[test]
    fn integer_powers_are_tight() {
        let x = interval(-2.0, 3.0);
        assert_eq!(x.powi(0), Interval::ONE);
        assert_eq!(x.powi(1), x);
        assert_eq!(x.powi(2), interval(0.0, 9.0));
        assert_eq!(x.powi(3), interval(-8.0, 27.0));
        assert_eq!(interval(-3.0, -2.0).powi(2), interval(4.0, 9.0));
        assert_eq!(interval(-4.0, -2.0).powi(-1), interval(-0.5, -0.25));
        assert_eq!(interval(2.0, 4.0).powi(-2), interval(0.0625, 0.25));
        assert_eq!(interval(-INF, 2.0).powi(3), interval(-INF, 8.0));
    }

    #[test]
    fn negative_powers_of_zero_are_not_defined() {
        assert_eq!(interval(-2.0, 4.0).powi(-1), undefined(-INF, INF));
        assert_eq!(interval(-2.0, 4.0).powi(-2), undefined(0.0625, INF));
        assert_eq!(interval(0.0, 4.0).powi(-1), undefined(0.25, INF));
        assert!(Interval::ZERO.powi(-3).is_empty());
    }

    #[test]
    fn extreme_exponents_end() {
        let x = interval(0.5, 2.0);
        assert_eq!(x.powi(i32::MAX).hi(), INF);
        assert!(x.powi(i32::MIN).contains(0.0) && x.powi(i32::MIN).hi() == INF);
        assert_eq!(Interval::ONE.powi(i32::MIN), Interval::ONE);
    }

    #[test]
    fn real_powers_at_the_edge_of_the_domain() {
        let half = Interval::point(0.5);
        assert!(interval(0.0, 4.0).pow(half).is_defined());
        assert!(!interval(-1.0, 4.0).pow(half).is_defined());
        assert!(interval(-2.0, -1.0).pow(half).is_empty());
        assert!(Interval::ZERO.pow(-half).is_empty());
        let pole = interval(0.0, 4.0).pow(-half);
        assert!(!pole.is_defined() && pole.hi() == INF && pole.contains(0.5));
        assert_eq!(
            interval(0.0, 0.5).pow(interval(0.0, 0.5)),
            interval(0.0, 1.0)
        );
        assert_eq!(
            interval(0.5, INF).pow(interval(0.0, INF)),
            interval(0.0, INF)
        );
        assert_eq!(
            interval(0.0, INF).pow(Interval::ENTIRE),
            undefined(0.0, INF)
        );
    }

    #[test]
    fn negative_bases_have_integer_powers() {
        assert_eq!(
            interval(-3.0, -2.0).pow(Interval::point(2.0)),
            interval(4.0, 9.0)
        );
        let mixed = interval(-3.0, -2.0).pow(interval(0.5, 2.5));
        assert!(!mixed.is_defined() && mixed.contains(-3.0) && mixed.contains(9.0));
        let huge = Interval::point(-1.0).pow(Interval::point(1e300));
        assert!(huge.contains(1.0));
    }
}
