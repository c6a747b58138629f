//! Exponentials, logarithms, hyperbolic and inverse trigonometric functions: all monotone on their domains or their
//! halves, so the bounds are the library's values at the ends, moved outwards by its error and kept in the range.

use super::Interval;
use super::rounding::{library_down, library_up};
use std::f64::consts::FRAC_PI_2;

impl Interval {
    /// The exponentials.
    #[must_use]
    pub fn exp(self) -> Self {
        self.monotone(|x| (exp_down(x.lo), exp_up(x.hi)))
    }

    /// The natural logarithms of the members above zero.
    #[must_use]
    pub fn ln(self) -> Self {
        if self.is_empty() || self.hi <= 0.0 {
            return Self::EMPTY;
        }
        let lo = if self.lo > 0.0 {
            ln_down(self.lo)
        } else {
            f64::NEG_INFINITY
        };
        Self::raw(lo, ln_up(self.hi), self.defined && self.lo > 0.0)
    }

    /// The angles in [−π/2, π/2] whose sine is a member.
    #[must_use]
    pub fn asin(self) -> Self {
        self.within_one().odd(libm::asin, FRAC_PI_2.next_up())
    }

    /// The angles in [0, π] whose cosine is a member.
    #[must_use]
    pub fn acos(self) -> Self {
        let down = |x: f64| library_down(libm::acos(x)).max(0.0);
        let up = |x: f64| {
            if x == 1.0 {
                0.0
            } else {
                library_up(libm::acos(x)).min(Self::PI.hi)
            }
        };
        self.within_one().monotone(|x| (down(x.hi), up(x.lo)))
    }

    /// The angles in [−π/2, π/2] whose tangent is a member.
    #[must_use]
    pub fn atan(self) -> Self {
        self.odd(libm::atan, FRAC_PI_2.next_up())
    }

    /// The hyperbolic sines.
    #[must_use]
    pub fn sinh(self) -> Self {
        self.odd(libm::sinh, f64::INFINITY)
    }

    /// The hyperbolic cosines.
    #[must_use]
    pub fn cosh(self) -> Self {
        let up = |x: f64| {
            if x == 0.0 {
                1.0
            } else {
                library_up(libm::cosh(x))
            }
        };
        self.monotone(|x| {
            (
                library_down(libm::cosh(x.mignitude())).max(1.0),
                up(x.magnitude()),
            )
        })
    }

    /// The hyperbolic tangents.
    #[must_use]
    pub fn tanh(self) -> Self {
        self.odd(libm::tanh, 1.0)
    }

    /// The members in [−1, 1], defined if these are all.
    fn within_one(self) -> Self {
        let unit = Self::raw(-1.0, 1.0, true);
        self.intersection(unit).and_defined(self.is_subset(unit))
    }

    /// The image under an increasing odd function that does not exceed `limit`.
    fn odd(self, f: impl Fn(f64) -> f64, limit: f64) -> Self {
        let up = |x: f64| match x {
            0.0 => 0.0,
            x if x < 0.0 => library_up(f(x)).min(0.0),
            x => library_up(f(x)).min(limit),
        };
        self.monotone(|x| (-up(-x.lo), up(x.hi)))
    }

    /// The interval between the bounds `f` finds; the empty set stays empty.
    fn monotone(self, f: impl FnOnce(Self) -> (f64, f64)) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let (lo, hi) = f(self);
        Self::raw(lo, hi, self.defined)
    }
}

fn exp_down(x: f64) -> f64 {
    library_down(libm::exp(x)).max(if x >= 0.0 { 1.0 } else { 0.0 })
}

fn exp_up(x: f64) -> f64 {
    library_up(libm::exp(x)).min(if x <= 0.0 { 1.0 } else { f64::INFINITY })
}

fn ln_down(x: f64) -> f64 {
    library_down(libm::log(x)).max(if x >= 1.0 { 0.0 } else { f64::NEG_INFINITY })
}

fn ln_up(x: f64) -> f64 {
    library_up(libm::log(x)).min(if x <= 1.0 { 0.0 } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f64 = f64::INFINITY;

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    fn bounds(x: Interval) -> (f64, f64) {
        (x.lo(), x.hi())
    }

    #[test]
    fn values_known_exactly_are_not_widened() {
        for f in [
            Interval::asin,
            Interval::atan,
            Interval::sinh,
            Interval::tanh,
        ] {
            assert_eq!(f(Interval::ZERO), Interval::ZERO);
        }
        assert_eq!(Interval::ZERO.exp(), Interval::ONE);
        assert_eq!(Interval::ZERO.cosh(), Interval::ONE);
        assert_eq!(Interval::ONE.ln(), Interval::ZERO);
        assert_eq!(Interval::ONE.acos(), Interval::ZERO);
    }

    #[test]
    fn the_whole_line_has_the_range_as_image() {
        let all = Interval::ENTIRE;
        assert_eq!(bounds(all.exp()), (0.0, INF));
        assert_eq!(bounds(all.sinh()), (-INF, INF));
        assert_eq!(bounds(all.cosh()), (1.0, INF));
        assert_eq!(all.tanh(), interval(-1.0, 1.0));
        let half_pi = FRAC_PI_2.next_up();
        assert_eq!(bounds(all.atan()), (-half_pi, half_pi));
        assert_eq!(bounds(all.asin()), (-half_pi, half_pi));
        assert_eq!(bounds(all.acos()), (0.0, Interval::PI.hi()));
        assert_eq!(bounds(all.ln()), (-INF, INF));
    }

    #[test]
    fn points_outside_the_domain_clear_the_mark() {
        assert!(!interval(0.0, 1.0).ln().is_defined());
        assert!(interval(0.5, 1.0).ln().is_defined());
        assert!(interval(-1.0, 0.0).ln().is_empty());
        assert!(interval(-1.0, 1.0).asin().is_defined());
        assert!(!interval(-1.0, 1.0_f64.next_up()).asin().is_defined());
        assert!(!interval(-2.0, 0.5).acos().is_defined());
        assert!(interval(2.0, 3.0).acos().is_empty());
    }

    #[test]
    fn signs_are_kept_next_to_zero() {
        let tiny = f64::from_bits(1);
        let x = Interval::point(tiny);
        for f in [
            Interval::asin,
            Interval::atan,
            Interval::sinh,
            Interval::tanh,
        ] {
            assert!(f(x).lo() >= 0.0 && f(x).contains(tiny) && f(-x).hi() <= 0.0);
        }
    }

    #[test]
    fn overflow_and_underflow_are_enclosed() {
        assert_eq!(interval(800.0, 900.0).exp().hi(), INF);
        assert!(interval(800.0, 900.0).exp().lo().is_finite());
        let vanishing = interval(-900.0, -800.0).exp();
        assert!(vanishing.lo() == 0.0 && vanishing.hi() > 0.0);
        assert_eq!(interval(-INF, 0.0).exp(), interval(0.0, 1.0));
    }
}
