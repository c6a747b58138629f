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

use std::fmt;

use rounding::sum;

pub use solve::solve;

mod algebra;
mod arithmetic;
mod elementary;
mod implicit;
mod rounding;
mod solve;

/// A closed set of real numbers `[lo, hi]`, or the empty set, with a mark that says whether it was computed by
/// operations that were defined everywhere on their arguments.
///
/// Two intervals are equal when their bounds and their marks are.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
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
    pub const fn lo(self) -> f64 {
        self.lo
    }

    /// The upper bound; −∞ for the empty interval.
    pub const fn hi(self) -> f64 {
        self.hi
    }

    /// Whether every operation that led here was defined at every point of its arguments.
    pub const fn is_defined(self) -> bool {
        self.defined
    }

    /// Whether no number is a member.
    pub const fn is_empty(self) -> bool {
        self.lo > self.hi
    }

    /// Whether exactly one number is a member.
    pub const fn is_point(self) -> bool {
        self.lo == self.hi
    }

    /// Whether zero is the only member.
    pub const fn is_zero(self) -> bool {
        self.lo == 0.0 && self.hi == 0.0
    }

    /// Whether it encloses an expression that has a value everywhere, between two finite numbers.
    pub const fn is_bounded(self) -> bool {
        self.defined && self.lo.is_finite() && self.hi.is_finite()
    }
}

/// The algebra of [`Interval`]s: a tape evaluated over a box gives enclosures of the outputs on that box.
///
/// ```
/// use lynkeus_expr::{Graph, Tape, interval::{Interval, Intervals}};
///
/// let graph = Graph::new();
/// let x = graph.symbol("x");
/// let tape = Tape::new(&graph, &[x.node()], &[(x * x + 1.0).ln().node()])?;
/// let range = tape.eval_in(&Intervals, &[Interval::new(0.0, 1.0).expect("in order")])[0];
/// assert!(range.is_defined() && range.contains(0.0) && range.hi() < 0.7);
/// # Ok::<(), lynkeus_expr::MissingInput>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Intervals;

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("∅");
        }
        write!(f, "[{:?}, {:?}]", self.lo, self.hi)
    }
}

impl Interval {
    /// Whether `value` is a member; infinities and NaN never are.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite() && self.lo <= value && value <= self.hi
    }

    /// Whether zero is a member.
    pub fn contains_zero(self) -> bool {
        self.contains(0.0)
    }

    /// Whether there are members and all are above zero.
    pub fn is_positive(self) -> bool {
        !self.is_empty() && self.lo > 0.0
    }

    /// Whether there are members and all are below zero.
    pub fn is_negative(self) -> bool {
        !self.is_empty() && self.hi < 0.0
    }

    /// Whether every member is a member of `other`; the empty interval is a subset of all.
    pub fn is_subset(self, other: Self) -> bool {
        self.is_empty() || (other.lo <= self.lo && self.hi <= other.hi)
    }

    /// The smallest interval that holds the members of both; defined when both are.
    ///
    /// The empty interval adds no member, but it is not defined, and neither is the hull then.
    pub fn hull(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            defined: self.defined && other.defined,
        }
    }

    /// The members of both; empty when there are none.
    pub fn intersection(self, other: Self) -> Self {
        let lo = self.lo.max(other.lo);
        let hi = self.hi.min(other.hi);
        if lo > hi {
            return Self::EMPTY;
        }
        Self::raw(lo, hi, self.defined && other.defined)
    }

    /// The distance of the bounds, rounded up; zero for the empty interval.
    pub fn width(self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        sum(self.hi, -self.lo).up()
    }

    /// A finite number in the middle: 0 for all real numbers (and for the empty interval), the largest finite number
    /// for an interval without an upper bound.
    pub fn midpoint(self) -> f64 {
        match (self.lo.is_finite(), self.hi.is_finite()) {
            (true, true) => (0.5 * self.lo + 0.5 * self.hi).clamp(self.lo, self.hi),
            (true, false) => f64::MAX,
            (false, true) => f64::MIN,
            (false, false) => 0.0,
        }
    }

    /// The largest absolute value of a member; zero for the empty interval.
    pub fn magnitude(self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        self.lo.abs().max(self.hi.abs())
    }

    /// The smallest absolute value of a member; zero for the empty interval.
    pub fn mignitude(self) -> f64 {
        if self.is_empty() || self.contains_zero() {
            return 0.0;
        }
        self.lo.abs().min(self.hi.abs())
    }

    /// The part up to the [midpoint](Self::midpoint) and the part from there on; they share that point.
    pub fn bisect(self) -> (Self, Self) {
        if self.is_empty() {
            return (self, self);
        }
        let middle = self.midpoint();
        (
            Self::raw(self.lo, middle, self.defined),
            Self::raw(middle, self.hi, self.defined),
        )
    }

    /// The interval wider by `distance` on either side.
    pub fn inflate(self, distance: f64) -> Self {
        let distance = distance.abs();
        if self.is_empty() || distance.is_nan() {
            return self;
        }
        Self::raw(
            sum(self.lo, -distance).down(),
            sum(self.hi, distance).up(),
            self.defined,
        )
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

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    #[test]
    fn membership_and_order() {
        let x = interval(-1.0, 2.0);
        assert!(x.contains(-1.0) && x.contains(2.0) && x.contains_zero());
        assert!(!x.contains(2.0_f64.next_up()) && !x.contains(f64::NAN));
        assert!(!Interval::ENTIRE.contains(f64::INFINITY));
        assert!(x.is_subset(Interval::ENTIRE) && !Interval::ENTIRE.is_subset(x));
        assert!(Interval::EMPTY.is_subset(x) && !x.is_subset(Interval::EMPTY));
        assert!(interval(1.0, 2.0).is_positive() && !interval(0.0, 2.0).is_positive());
        assert!(interval(-2.0, -1.0).is_negative() && !interval(-2.0, 0.0).is_negative());
        assert!(!Interval::EMPTY.is_positive() && !Interval::EMPTY.is_negative());
    }

    #[test]
    fn union_and_intersection() {
        let (x, y) = (interval(0.0, 1.0), interval(3.0, 4.0));
        assert_eq!(x.hull(y), interval(0.0, 4.0));
        assert!(x.intersection(y).is_empty());
        assert_eq!(
            interval(0.0, 3.0).intersection(y),
            interval(3.0, 3.0),
            "a shared bound is a member"
        );
        let with_empty = x.hull(Interval::EMPTY);
        assert_eq!((with_empty.lo(), with_empty.hi()), (0.0, 1.0));
        assert!(!with_empty.is_defined());
    }

    #[test]
    fn sizes_are_finite_where_they_must_be() {
        assert_eq!(Interval::ENTIRE.midpoint(), 0.0);
        assert_eq!(Interval::EMPTY.midpoint(), 0.0);
        assert_eq!(interval(f64::MIN, f64::MAX).midpoint(), 0.0);
        assert_eq!(interval(f64::MAX, f64::MAX).midpoint(), f64::MAX);
        assert_eq!(interval(1.0, f64::INFINITY).midpoint(), f64::MAX);
        let tiny = f64::from_bits(1);
        assert!(interval(tiny, tiny).contains(interval(tiny, tiny).midpoint()));
        assert_eq!(interval(f64::MIN, f64::MAX).width(), f64::INFINITY);
        assert_eq!(Interval::EMPTY.width(), 0.0);
        assert_eq!(interval(-3.0, 2.0).magnitude(), 3.0);
        assert_eq!(interval(-3.0, 2.0).mignitude(), 0.0);
        assert_eq!(interval(-3.0, -2.0).mignitude(), 2.0);
    }

    #[test]
    fn halves_cover_the_whole() {
        for x in [interval(0.0, 1.0), Interval::ENTIRE, interval(2.0, 2.0)] {
            let (left, right) = x.bisect();
            assert_eq!(left.hull(right), x);
            assert_eq!(left.hi(), right.lo());
        }
        assert!(Interval::EMPTY.bisect().0.is_empty());
    }

    #[test]
    fn inflation_covers_the_distance() {
        let x = interval(0.1, 0.2).inflate(0.1);
        assert!(x.lo() <= 0.0 && x.hi() >= 0.3);
        assert_eq!(interval(0.0, 1.0).inflate(-1.0), interval(-1.0, 2.0));
        assert!(Interval::EMPTY.inflate(1.0).is_empty());
    }
}
