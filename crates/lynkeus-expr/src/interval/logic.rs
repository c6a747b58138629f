//! Relations, truth values and selection. A truth value is [1, 1], [0, 0], or [0, 1] when both can occur; any number
//! other than zero counts as true.

use super::Interval;

impl Interval {
    const UNDECIDED: Self = Self::raw(0.0, 1.0, true);

    /// Whether members of `self` are below members of `other`.
    #[must_use]
    pub fn less(self, other: Self) -> Self {
        self.relation(other, self.hi < other.lo, self.lo >= other.hi)
    }

    /// Whether members of `self` are at most members of `other`.
    #[must_use]
    pub fn less_eq(self, other: Self) -> Self {
        self.relation(other, self.hi <= other.lo, self.lo > other.hi)
    }

    /// Whether members are equal: certain only for two points.
    #[must_use]
    pub fn equal(self, other: Self) -> Self {
        let same = self.is_point() && other.is_point() && self.lo == other.lo;
        self.relation(other, same, self.hi < other.lo || other.hi < self.lo)
    }

    /// Whether both are true.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        let always = self.is_true() && other.is_true();
        self.relation(other, always, self.is_zero() || other.is_zero())
    }

    /// Whether one is true.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let never = self.is_zero() && other.is_zero();
        self.relation(other, self.is_true() || other.is_true(), never)
    }

    /// The opposite truth values.
    #[must_use]
    #[expect(
        clippy::should_implement_trait,
        reason = "`!x` would read as a negation of the set"
    )]
    pub fn not(self) -> Self {
        self.relation(self, self.is_zero(), self.is_true())
    }

    /// `chosen` where `self` is true, `other` where it is false, the hull of both when it may be either.
    ///
    /// A branch that cannot be taken has no influence, be it defined or not.
    #[must_use]
    pub fn select(self, chosen: Self, other: Self) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let result = match (self.is_true(), self.is_zero()) {
            (true, _) => chosen,
            (_, true) => other,
            _ => chosen.hull(other),
        };
        result.and_defined(self.defined)
    }

    fn relation(self, other: Self, always: bool, never: bool) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        let truth = match (always, never) {
            (true, _) => Self::ONE,
            (_, true) => Self::ZERO,
            _ => Self::UNDECIDED,
        };
        truth.and_defined(self.defined && other.defined)
    }

    /// Whether every member counts as true.
    fn is_true(self) -> bool {
        !self.contains_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const YES: Interval = Interval::ONE;
    const NO: Interval = Interval::ZERO;
    const MAYBE: Interval = Interval::UNDECIDED;

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    #[test]
    fn order_is_decided_where_it_can_be() {
        let (x, y) = (interval(0.0, 1.0), interval(1.0, 2.0));
        assert_eq!(x.less(y), MAYBE);
        assert_eq!(x.less_eq(y), YES);
        assert_eq!(y.less(x), NO);
        assert_eq!(y.less_eq(x), MAYBE);
        assert_eq!(x.less(interval(1.5, 2.0)), YES);
        assert_eq!(x.equal(interval(1.5, 2.0)), NO);
        assert_eq!(x.equal(x), MAYBE);
        assert_eq!(YES.equal(YES), YES);
        assert!(x.less(Interval::EMPTY).is_empty());
        assert_eq!(Interval::ENTIRE.less(Interval::ENTIRE), MAYBE);
    }

    #[test]
    fn truth_tables_of_three_values() {
        assert_eq!(YES.and(MAYBE), MAYBE);
        assert_eq!(NO.and(MAYBE), NO);
        assert_eq!(YES.and(interval(-3.0, -2.0)), YES);
        assert_eq!(YES.or(MAYBE), YES);
        assert_eq!(NO.or(MAYBE), MAYBE);
        assert_eq!(NO.or(NO), NO);
        assert_eq!((YES.not(), NO.not(), MAYBE.not()), (NO, YES, MAYBE));
        assert!(Interval::EMPTY.not().is_empty());
    }

    #[test]
    fn a_branch_that_is_not_taken_has_no_influence() {
        let broken = interval(-2.0, -1.0).sqrt();
        assert_eq!(YES.select(YES, broken), YES);
        assert_eq!(NO.select(broken, NO), NO);
        let either = MAYBE.select(interval(1.0, 2.0), interval(5.0, 6.0));
        assert_eq!(either, interval(1.0, 6.0));
        assert!(!MAYBE.select(YES, broken).is_defined());
        assert!(!YES.and_defined(false).select(YES, NO).is_defined());
        assert!(Interval::EMPTY.select(YES, NO).is_empty());
    }
}
