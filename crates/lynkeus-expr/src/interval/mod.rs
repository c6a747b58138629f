//! Rigorous intervals: every result encloses the exact value of the operation at every point of its arguments.
//!
//! Bounds are rounded outwards, so an inequality that holds for an [`Interval`] is proved for the real numbers inside.
//! Each interval also remembers whether the operations that led to it were [defined](Interval::is_defined) on the whole
//! box, which is what separates "√x lies in \[0, 2\]" on `[0, 4]` from the same enclosure on `[-1, 4]`.
//!
//! ```
//! use lynkeus_expr::interval::Interval;
//!
//! let level = Interval::new(0.05, 10.0)?;
//! let outflow = level.sqrt() * Interval::point(0.04);
//! assert!(outflow.is_positive() && outflow.is_defined());
//! # Ok::<(), lynkeus_expr::interval::InvalidInterval>(())
//! ```
//!
//! Conventions, in the spirit of IEEE 1788 (set-based intervals with the decoration `def`):
//! - an interval is a closed set of real numbers; a bound may be infinite, infinity itself is never a member;
//! - points outside the domain of an operation contribute nothing to its result and clear `defined`;
//! - the empty interval (lo = +∞, hi = −∞) is never `defined`, and every operation on it gives it back;
//! - no operation panics and no bound is ever NaN.

mod algebra;
mod arithmetic;
mod atan2;
mod elementary;
mod implicit;
mod logic;
mod power;
mod rounding;
mod set;
mod solve;
mod trigonometric;

pub use algebra::Intervals;
pub use solve::solve;

use std::fmt;

/// A closed set of real numbers `[lo, hi]`, or the empty set, with a mark that says whether it was computed by
/// operations that were defined everywhere on their arguments.
///
/// Two intervals are equal when their bounds and their marks are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    lo: f64,
    hi: f64,
    defined: bool,
}

/// Bounds that are not an interval: reversed, NaN, or both at the same infinity.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "an interval needs a lower bound that is not above its upper bound, neither of them NaN, and at least one real \
     number between them; found [{lo:?}, {hi:?}]: exchange or correct the bounds"
)]
pub struct InvalidInterval {
    /// The lower bound that was given.
    pub lo: f64,
    /// The upper bound that was given.
    pub hi: f64,
}

impl Interval {
    /// The empty set.
    pub const EMPTY: Self = Self {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
        defined: false,
    };
    /// All real numbers.
    pub const ENTIRE: Self = Self::raw(f64::NEG_INFINITY, f64::INFINITY, true);
    /// What is known of an expression that may have no value: nothing.
    pub const UNKNOWN: Self = Self::raw(f64::NEG_INFINITY, f64::INFINITY, false);
    /// The number 0.
    pub const ZERO: Self = Self::raw(0.0, 0.0, true);
    /// The number 1.
    pub const ONE: Self = Self::raw(1.0, 1.0, true);
    /// The tightest enclosure of π.
    pub const PI: Self = Self::raw(std::f64::consts::PI, std::f64::consts::PI.next_up(), true);

    /// The interval `[lo, hi]`; either bound may be infinite.
    ///
    /// # Errors
    /// When a bound is NaN, `lo > hi`, or no real number lies between them (both bounds +∞, or both −∞).
    pub fn new(lo: f64, hi: f64) -> Result<Self, InvalidInterval> {
        if lo <= hi && lo < f64::INFINITY && hi > f64::NEG_INFINITY {
            Ok(Self::raw(lo, hi, true))
        } else {
            Err(InvalidInterval { lo, hi })
        }
    }

    /// The interval that holds `value` alone.
    ///
    /// Infinity is no real number: it becomes the numbers beyond the largest finite one, not defined. NaN becomes the
    /// empty interval.
    #[must_use]
    pub const fn point(value: f64) -> Self {
        if value.is_nan() {
            Self::EMPTY
        } else if value == f64::INFINITY {
            Self::raw(f64::MAX, value, false)
        } else if value == f64::NEG_INFINITY {
            Self::raw(value, f64::MIN, false)
        } else {
            Self::raw(value, value, true)
        }
    }

    /// Bounds that are known to be in order; a negative zero becomes zero.
    const fn raw(lo: f64, hi: f64, defined: bool) -> Self {
        Self {
            lo: lo + 0.0,
            hi: hi + 0.0,
            defined,
        }
    }

    /// The interval of the same bounds, defined only if `mark` holds too.
    const fn and_defined(self, mark: bool) -> Self {
        Self {
            defined: self.defined && mark,
            ..self
        }
    }

    /// The lower bound; +∞ for the empty interval.
    #[must_use]
    pub const fn lo(self) -> f64 {
        self.lo
    }

    /// The upper bound; −∞ for the empty interval.
    #[must_use]
    pub const fn hi(self) -> f64 {
        self.hi
    }

    /// Whether every operation that led here was defined at every point of its arguments.
    #[must_use]
    pub const fn is_defined(self) -> bool {
        self.defined
    }

    /// Whether no number is a member.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.lo > self.hi
    }

    /// Whether exactly one number is a member.
    #[must_use]
    pub const fn is_point(self) -> bool {
        self.lo == self.hi
    }

    /// Whether zero is the only member.
    const fn is_zero(self) -> bool {
        self.lo == 0.0 && self.hi == 0.0
    }
}

impl From<f64> for Interval {
    /// See [`Interval::point`].
    fn from(value: f64) -> Self {
        Self::point(value)
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("∅");
        }
        write!(f, "[{:?}, {:?}]", self.lo, self.hi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_checked() {
        for (lo, hi) in [
            (1.0, 0.0),
            (f64::NAN, 1.0),
            (0.0, f64::NAN),
            (f64::INFINITY, f64::INFINITY),
            (f64::NEG_INFINITY, f64::NEG_INFINITY),
        ] {
            let message = Interval::new(lo, hi).unwrap_err().to_string();
            assert!(message.contains(&format!("[{lo:?}, {hi:?}]")), "{message}");
        }
        assert!(Interval::new(0.0, 0.0).unwrap().is_point());
        assert_eq!(
            Interval::new(f64::NEG_INFINITY, f64::INFINITY),
            Ok(Interval::ENTIRE)
        );
    }

    #[test]
    fn a_point_at_infinity_is_not_a_real_number() {
        let point = Interval::point(f64::INFINITY);
        assert!(!point.is_defined() && !point.is_empty() && point.lo() == f64::MAX);
        assert!(Interval::point(f64::NAN).is_empty());
        assert!(Interval::point(-0.0).lo().is_sign_positive());
    }

    #[test]
    fn intervals_are_shown_by_their_bounds() {
        assert_eq!(Interval::new(-0.5, 2.0).unwrap().to_string(), "[-0.5, 2.0]");
        assert_eq!(Interval::EMPTY.to_string(), "∅");
    }
}
