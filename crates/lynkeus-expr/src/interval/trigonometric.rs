//! Sine, cosine and tangent of intervals: the ends, and the peaks and poles that may lie between them.

use super::Interval;
use super::rounding::{library_down, library_up};

impl Interval {
    /// The sines.
    #[must_use]
    pub fn sin(self) -> Self {
        let quarter = Self::PI / Self::point(2.0);
        if self.is_zero() {
            return self;
        }
        self.wave(libm::sin, quarter, -quarter)
    }

    /// The cosines.
    #[must_use]
    pub fn cos(self) -> Self {
        self.wave(libm::cos, Self::ZERO, Self::PI)
    }

    /// The tangents; not defined when an odd multiple of π/2 is a member, or may be one as far as the reduction by the
    /// enclosure of π tells.
    #[must_use]
    pub fn tan(self) -> Self {
        if self.is_empty() || self.is_zero() {
            return self;
        }
        if self.meets(Self::PI / Self::point(2.0), Self::PI) {
            return Self::ENTIRE.and_defined(false);
        }
        Self::raw(
            library_down(libm::tan(self.lo)),
            library_up(libm::tan(self.hi)),
            self.defined,
        )
    }

    /// The image under `f`, of period 2π, which rises to 1 at `peak` and falls to −1 at `trough`.
    fn wave(self, f: impl Fn(f64) -> f64, peak: Self, trough: Self) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let period = Self::PI * Self::point(2.0);
        // An infinite bound meets both peak and trough, so `f` is only evaluated at numbers.
        let lo = if self.meets(trough, period) {
            -1.0
        } else {
            library_down(f(self.lo).min(f(self.hi))).max(-1.0)
        };
        let hi = if self.meets(peak, period) {
            1.0
        } else {
            library_up(f(self.lo).max(f(self.hi))).min(1.0)
        };
        Self::raw(lo, hi, self.defined)
    }

    /// Whether `offset` + k·`period` may be a member for some integer k; false only if that is certain.
    fn meets(self, offset: Self, period: Self) -> bool {
        let turns = (self - offset) / period;
        turns.lo.ceil() <= turns.hi.floor()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    #[test]
    fn peaks_between_the_ends_are_found() {
        assert_eq!(interval(1.0, 2.0).sin().hi(), 1.0);
        assert!(interval(1.0, 2.0).sin().lo() > 0.8);
        assert_eq!(interval(4.0, 5.0).sin().lo(), -1.0);
        assert_eq!(interval(-0.5, 0.5).cos().hi(), 1.0);
        assert_eq!(interval(3.0, 4.0).cos().lo(), -1.0);
        assert_eq!(interval(100.0, 107.0).sin(), interval(-1.0, 1.0));
        assert_eq!(Interval::ENTIRE.cos(), interval(-1.0, 1.0));
    }

    #[test]
    fn a_peak_beyond_the_end_is_not_taken() {
        assert!(interval(0.0, 1.5).sin().hi() < 1.0);
        assert!(interval(0.1, 3.1).cos().lo() > -1.0);
        assert_eq!(interval(FRAC_PI_2, FRAC_PI_2).sin().hi(), 1.0);
        assert_eq!(interval(3.0, PI).cos().lo(), -1.0);
    }

    #[test]
    fn poles_make_the_tangent_undefined() {
        assert!(!interval(1.5, 1.6).tan().is_defined());
        assert!(!interval(-10.0, 10.0).tan().is_defined());
        assert!(!interval(0.0, f64::INFINITY).tan().is_defined());
        let branch = interval(-1.5, 1.5).tan();
        assert!(branch.is_defined() && branch.magnitude() < 14.2);
        let next = interval(2.0, 4.0).tan();
        assert!(next.is_defined() && next.lo() < -2.18 && next.hi() > 1.15);
    }

    #[test]
    fn huge_arguments_lose_all_knowledge_but_not_containment() {
        for x in [1e17, -1e300, f64::MAX] {
            let point = Interval::point(x);
            assert!(point.sin().contains(x.sin()) && point.cos().contains(x.cos()));
            assert!(point.tan().contains(x.tan()));
        }
    }
}
