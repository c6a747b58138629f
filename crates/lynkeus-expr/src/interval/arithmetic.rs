//! The operations with bounds that are exact or correctly rounded: the four of arithmetic, roots and steps; relations,
//! truth values and selection. A truth value is [1, 1], [0, 0], or [0, 1] when both can occur; any number other than
//! zero counts as true.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Interval;
use super::rounding::{product, quotient, root, sum};
use crate::real;

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        self.image(|x| (-x.hi, -x.lo))
    }
}

impl Add for Interval {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        self.combine(other, |a, b| (sum(a.lo, b.lo).down(), sum(a.hi, b.hi).up()))
    }
}

impl Sub for Interval {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        self.combine(other, |a, b| {
            let down = |x, y| product(x, y).down();
            let up = |x, y| product(x, y).up();
            // the signs say which ends have the smallest and the largest product
            let [least, most] = match (a.lo >= 0.0, a.hi <= 0.0, b.lo >= 0.0, b.hi <= 0.0) {
                (true, _, true, _) => [(a.lo, b.lo), (a.hi, b.hi)],
                (true, _, _, true) => [(a.hi, b.lo), (a.lo, b.hi)],
                (_, true, true, _) => [(a.lo, b.hi), (a.hi, b.lo)],
                (_, true, _, true) => [(a.hi, b.hi), (a.lo, b.lo)],
                (true, _, _, _) => [(a.hi, b.lo), (a.hi, b.hi)],
                (_, true, _, _) => [(a.lo, b.hi), (a.lo, b.lo)],
                (_, _, true, _) => [(a.lo, b.hi), (a.hi, b.hi)],
                (_, _, _, true) => [(a.hi, b.lo), (a.lo, b.lo)],
                _ => {
                    let lo = down(a.lo, b.hi).min(down(a.hi, b.lo));
                    return (lo, up(a.lo, b.lo).max(up(a.hi, b.hi)));
                }
            };
            (down(least.0, least.1), up(most.0, most.1))
        })
    }
}

impl Div for Interval {
    type Output = Self;

    /// The quotients by the members other than zero; not defined when zero is a member of the divisor.
    fn div(self, other: Self) -> Self {
        if other.lo >= 0.0 {
            self.div_by_non_negative(other)
        } else if other.hi <= 0.0 {
            -self / -other
        } else if self.is_zero() || self.is_empty() {
            self.and_defined(false)
        } else {
            Self::ENTIRE.and_defined(false)
        }
    }
}

impl Interval {
    /// The bounds `f` gives for two intervals that are not empty.
    pub(super) fn combine(self, other: Self, f: impl FnOnce(Self, Self) -> (f64, f64)) -> Self {
        if self.is_empty() || other.is_empty() {
            return Self::EMPTY;
        }
        let (lo, hi) = f(self, other);
        Self::raw(lo, hi, self.defined && other.defined)
    }

    /// From the smallest to the largest of the bounds that `f` gives at the corners of the box of both.
    pub(super) fn corners(self, other: Self, f: impl Fn(f64, f64) -> (f64, f64)) -> (f64, f64) {
        let (a, b) = (self, other);
        let corners = [(a.lo, b.lo), (a.lo, b.hi), (a.hi, b.lo), (a.hi, b.hi)];
        let [(l1, h1), (l2, h2), (l3, h3), (l4, h4)] = corners.map(|(x, y)| f(x, y));
        (l1.min(l2).min(l3).min(l4), h1.max(h2).max(h3).max(h4))
    }

    fn div_by_non_negative(self, divisor: Self) -> Self {
        if divisor.hi == 0.0 {
            return Self::EMPTY;
        }
        let found = self.combine(divisor, |a, b| {
            let lo = match a.lo {
                lo if lo >= 0.0 => quotient(lo, b.hi).down(),
                _ if b.lo == 0.0 => f64::NEG_INFINITY,
                lo => quotient(lo, b.lo).down(),
            };
            let hi = match a.hi {
                hi if hi <= 0.0 => quotient(hi, b.hi).up(),
                _ if b.lo == 0.0 => f64::INFINITY,
                hi => quotient(hi, b.lo).up(),
            };
            (lo, hi)
        });
        found.and_defined(divisor.lo > 0.0)
    }

    /// The bounds that `f` gives for an interval that is not empty.
    pub(super) fn image(self, f: impl FnOnce(Self) -> (f64, f64)) -> Self {
        self.combine(self, |x, _| f(x))
    }

    /// The absolute values.
    pub fn abs(self) -> Self {
        self.image(|x| (x.mignitude(), x.magnitude()))
    }

    /// The signs: −1, 0 or 1.
    pub fn sign(self) -> Self {
        self.image(|x| (real::sign(x.lo), real::sign(x.hi)))
    }

    /// The largest integers not above the members.
    pub fn floor(self) -> Self {
        self.image(|x| (x.lo.floor(), x.hi.floor()))
    }

    /// The square roots of the members that are not negative.
    pub fn sqrt(self) -> Self {
        if self.is_empty() || self.hi < 0.0 {
            return Self::EMPTY;
        }
        let lo = root(self.lo.max(0.0)).down().max(0.0);
        Self::raw(lo, root(self.hi).up(), self.defined && self.lo >= 0.0)
    }

    /// The smaller ones of two members.
    pub fn min(self, other: Self) -> Self {
        self.combine(other, |a, b| (a.lo.min(b.lo), a.hi.min(b.hi)))
    }

    /// The larger ones of two members.
    pub fn max(self, other: Self) -> Self {
        self.combine(other, |a, b| (a.lo.max(b.lo), a.hi.max(b.hi)))
    }
}

impl Interval {
    const UNDECIDED: Self = Self::raw(0.0, 1.0, true);

    /// `chosen` where `self` is true, `other` where it is false, the hull of both when it may be either.
    ///
    /// A branch that cannot be taken has no influence, be it defined or not.
    pub(super) fn select(self, chosen: Self, other: Self) -> Self {
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

    /// A truth value of members of both.
    pub(super) fn relation(self, other: Self, always: bool, never: bool) -> Self {
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
    pub(super) fn is_true(self) -> bool {
        !self.contains_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interval::Intervals;
    use crate::{Algebra, Binary, Unary};

    const INF: f64 = f64::INFINITY;

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    fn undefined(lo: f64, hi: f64) -> Interval {
        interval(lo, hi).and_defined(false)
    }

    #[test]
    fn products_of_every_sign() {
        let (n, m, p) = (
            interval(-3.0, -2.0),
            interval(-1.0, 5.0),
            interval(4.0, 7.0),
        );
        assert_eq!(n * n, interval(4.0, 9.0));
        assert_eq!(n * m, interval(-15.0, 3.0));
        assert_eq!(n * p, interval(-21.0, -8.0));
        assert_eq!(m * m, interval(-5.0, 25.0));
        assert_eq!(m * p, interval(-7.0, 35.0));
        assert_eq!(p * p, interval(16.0, 49.0));
        for (a, b) in [(n, m), (n, p), (m, p)] {
            assert_eq!(a * b, b * a);
        }
        assert_eq!(Interval::ZERO * Interval::ENTIRE, Interval::ZERO);
        assert_eq!(
            interval(2.0, INF) * interval(-INF, -3.0),
            interval(-INF, -6.0)
        );
    }

    #[test]
    fn division_by_zero_is_extended() {
        let one = Interval::ONE;
        assert_eq!(one / interval(2.0, 4.0), interval(0.25, 0.5));
        assert_eq!(one / interval(0.0, 4.0), undefined(0.25, INF));
        assert_eq!(one / interval(-4.0, 0.0), undefined(-INF, -0.25));
        assert_eq!(one / interval(-4.0, 1.0), undefined(-INF, INF));
        assert_eq!(one / Interval::ZERO, Interval::EMPTY);
        assert_eq!(
            interval(-1.0, 2.0) / interval(0.0, 1.0),
            undefined(-INF, INF)
        );
        assert_eq!(Interval::ZERO / interval(-1.0, 1.0), undefined(0.0, 0.0));
        assert_eq!(Interval::ZERO / interval(0.0, 1.0), undefined(0.0, 0.0));
        assert_eq!(
            interval(-2.0, 0.0) / interval(0.0, 1.0),
            undefined(-INF, 0.0)
        );
        assert_eq!(interval(1.0, INF) / interval(1.0, INF), interval(0.0, INF));
        assert_eq!(interval(-1.0, 1.0) / Interval::ENTIRE, undefined(-INF, INF));
    }

    #[test]
    fn roots_keep_to_their_domain() {
        assert_eq!(interval(0.0, 4.0).sqrt(), interval(0.0, 2.0));
        assert_eq!(interval(-1.0, 4.0).sqrt(), undefined(0.0, 2.0));
        assert_eq!(interval(1.0, INF).sqrt(), interval(1.0, INF));
        assert!(interval(-2.0, -1.0).sqrt().is_empty());
    }

    #[test]
    fn steps_and_selections() {
        assert_eq!(interval(-2.5, 3.5).floor(), interval(-3.0, 3.0));
        assert_eq!(Interval::ENTIRE.floor(), Interval::ENTIRE);
        assert_eq!(interval(-2.5, 0.0).sign(), interval(-1.0, 0.0));
        assert_eq!(interval(-2.5, 1.0).abs(), interval(0.0, 2.5));
        let (x, y) = (interval(0.0, 3.0), interval(1.0, 2.0));
        assert_eq!(x.min(y), interval(0.0, 2.0));
        assert_eq!(x.max(y), interval(1.0, 3.0));
        assert!(x.max(Interval::EMPTY).is_empty());
    }

    #[test]
    fn the_mark_follows_the_operations() {
        let x = interval(-1.0, 1.0).sqrt();
        assert!(!x.is_defined());
        assert!(!(x + Interval::ONE).is_defined() && !(Interval::ONE * x).is_defined());
        assert!(!(-x).is_defined() && !x.abs().is_defined());
    }

    const YES: Interval = Interval::ONE;
    const NO: Interval = Interval::ZERO;
    const MAYBE: Interval = Interval::UNDECIDED;

    #[test]
    fn order_is_decided_where_it_can_be() {
        let (x, y) = (interval(0.0, 1.0), interval(1.0, 2.0));
        assert_eq!(Intervals.binary(Binary::Less, &x, &y), MAYBE);
        assert_eq!(Intervals.binary(Binary::LessEq, &x, &y), YES);
        assert_eq!(Intervals.binary(Binary::Less, &y, &x), NO);
        assert_eq!(Intervals.binary(Binary::LessEq, &y, &x), MAYBE);
        assert_eq!(Intervals.binary(Binary::Less, &x, &interval(1.5, 2.0)), YES);
        assert_eq!(Intervals.binary(Binary::Equal, &x, &interval(1.5, 2.0)), NO);
        assert_eq!(Intervals.binary(Binary::Equal, &x, &x), MAYBE);
        assert_eq!(Intervals.binary(Binary::Equal, &YES, &YES), YES);
        assert!(
            Intervals
                .binary(Binary::Less, &x, &Interval::EMPTY)
                .is_empty()
        );
        assert_eq!(
            Intervals.binary(Binary::Less, &Interval::ENTIRE, &Interval::ENTIRE),
            MAYBE
        );
    }

    #[test]
    fn truth_tables_of_three_values() {
        assert_eq!(Intervals.binary(Binary::And, &YES, &MAYBE), MAYBE);
        assert_eq!(Intervals.binary(Binary::And, &NO, &MAYBE), NO);
        assert_eq!(
            Intervals.binary(Binary::And, &YES, &interval(-3.0, -2.0)),
            YES
        );
        assert_eq!(Intervals.binary(Binary::Or, &YES, &MAYBE), YES);
        assert_eq!(Intervals.binary(Binary::Or, &NO, &MAYBE), MAYBE);
        assert_eq!(Intervals.binary(Binary::Or, &NO, &NO), NO);
        for (x, not) in [(YES, NO), (NO, YES), (MAYBE, MAYBE)] {
            assert_eq!(Intervals.unary(Unary::Not, &x), not);
        }
        assert!(Intervals.unary(Unary::Not, &Interval::EMPTY).is_empty());
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
