//! Intervals as sets of numbers: membership, union, size and halves.

use super::Interval;
use super::rounding::{add_down, add_up};

impl Interval {
    /// Whether `value` is a member; infinities and NaN never are.
    #[must_use]
    pub fn contains(self, value: f64) -> bool {
        value.is_finite() && self.lo <= value && value <= self.hi
    }

    /// Whether zero is a member.
    #[must_use]
    pub fn contains_zero(self) -> bool {
        self.contains(0.0)
    }

    /// Whether there are members and all are above zero.
    #[must_use]
    pub fn is_positive(self) -> bool {
        !self.is_empty() && self.lo > 0.0
    }

    /// Whether there are members and all are below zero.
    #[must_use]
    pub fn is_negative(self) -> bool {
        !self.is_empty() && self.hi < 0.0
    }

    /// Whether every member is a member of `other`; the empty interval is a subset of all.
    #[must_use]
    pub fn is_subset(self, other: Self) -> bool {
        self.is_empty() || (other.lo <= self.lo && self.hi <= other.hi)
    }

    /// The smallest interval that holds the members of both; defined when both are.
    ///
    /// The empty interval adds no member, but it is not defined, and neither is the hull then.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            defined: self.defined && other.defined,
        }
    }

    /// The members of both; empty when there are none.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        let lo = self.lo.max(other.lo);
        let hi = self.hi.min(other.hi);
        if lo > hi {
            return Self::EMPTY;
        }
        Self::raw(lo, hi, self.defined && other.defined)
    }

    /// The distance of the bounds, rounded up; zero for the empty interval.
    #[must_use]
    pub fn width(self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        add_up(self.hi, -self.lo)
    }

    /// A finite number in the middle: 0 for all real numbers (and for the empty interval), the largest finite number
    /// for an interval without an upper bound.
    #[must_use]
    pub fn midpoint(self) -> f64 {
        match (self.lo.is_finite(), self.hi.is_finite()) {
            (true, true) => (0.5 * self.lo + 0.5 * self.hi).clamp(self.lo, self.hi),
            (true, false) => f64::MAX,
            (false, true) => f64::MIN,
            (false, false) => 0.0,
        }
    }

    /// The largest absolute value of a member; zero for the empty interval.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        self.lo.abs().max(self.hi.abs())
    }

    /// The smallest absolute value of a member; zero for the empty interval.
    #[must_use]
    pub fn mignitude(self) -> f64 {
        if self.is_empty() || self.contains_zero() {
            return 0.0;
        }
        self.lo.abs().min(self.hi.abs())
    }

    /// The part up to the [midpoint](Self::midpoint) and the part from there on; they share that point.
    #[must_use]
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
    #[must_use]
    pub fn inflate(self, distance: f64) -> Self {
        let distance = distance.abs();
        if self.is_empty() || distance.is_nan() {
            return self;
        }
        Self::raw(
            add_down(self.lo, -distance),
            add_up(self.hi, distance),
            self.defined,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
