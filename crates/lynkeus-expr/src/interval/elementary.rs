//! The elementary functions: powers, exponentials, logarithms, and the functions of angles with their inverses.
//!
//! Most are monotone on their domains or their halves, so the bounds are the values of the library at the ends, moved
//! outwards by its error and kept in the range; of the periodic ones the peaks and poles that may lie between the ends
//! count, too.

use std::f64::consts::FRAC_PI_2;

use super::Interval;
use super::arithmetic::{largest, smallest};
use super::rounding::{Rounded, library_down, library_up, product};

impl Interval {
    /// The exponentials.
    pub fn exp(self) -> Self {
        self.image(|x| (exp_down(x.lo), exp_up(x.hi)))
    }

    /// The natural logarithms of the members above zero.
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
    pub fn asin(self) -> Self {
        self.within_one().odd(libm::asin, FRAC_PI_2.next_up())
    }

    /// The angles in [0, π] whose cosine is a member.
    pub fn acos(self) -> Self {
        let down = |x: f64| library_down(libm::acos(x)).max(0.0);
        let up = |x: f64| {
            if x == 1.0 {
                0.0
            } else {
                library_up(libm::acos(x)).min(Self::PI.hi)
            }
        };
        self.within_one().image(|x| (down(x.hi), up(x.lo)))
    }

    /// The angles in [−π/2, π/2] whose tangent is a member.
    pub fn atan(self) -> Self {
        self.odd(libm::atan, FRAC_PI_2.next_up())
    }

    /// The hyperbolic sines.
    pub fn sinh(self) -> Self {
        self.odd(libm::sinh, f64::INFINITY)
    }

    /// The hyperbolic cosines.
    pub fn cosh(self) -> Self {
        let up = |x: f64| {
            if x == 0.0 {
                1.0
            } else {
                library_up(libm::cosh(x))
            }
        };
        self.image(|x| {
            (
                library_down(libm::cosh(x.mignitude())).max(1.0),
                up(x.magnitude()),
            )
        })
    }

    /// The hyperbolic tangents.
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
        self.image(|x| (-up(-x.lo), up(x.hi)))
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

impl Interval {
    /// The `n`-th powers, of members of any sign; x⁰ is 1 for every x.
    ///
    /// The bounds come from at most 2·log₂|n| rounded multiplications.
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
        let lo = match base.lo >= 0.0 {
            true => repeated(base.lo, n, Rounded::down),
            false => -repeated(-base.lo, n, Rounded::up),
        };
        let hi = match base.hi >= 0.0 {
            true => repeated(base.hi, n, Rounded::up),
            false => -repeated(-base.hi, n, Rounded::down),
        };
        Self::raw(lo, hi, self.defined)
    }

    /// The powers with real exponents, as `f64::powf` defines them: for bases that are not negative (0⁰ = 1, and zero
    /// has no negative powers), and for negative bases with exponents that are integers.
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

/// x^n by squaring for x ≥ 0 and n ≥ 1, all products rounded the same way.
fn repeated(x: f64, n: u32, rounded: impl Fn(Rounded) -> f64) -> f64 {
    let mul = |x: f64, y: f64| rounded(product(x, y));
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

impl Interval {
    /// The sines.
    pub fn sin(self) -> Self {
        let quarter = Self::PI / Self::point(2.0);
        if self.is_zero() {
            return self;
        }
        self.wave(libm::sin, quarter, -quarter)
    }

    /// The cosines.
    pub fn cos(self) -> Self {
        self.wave(libm::cos, Self::ZERO, Self::PI)
    }

    /// The tangents; not defined when an odd multiple of π/2 is a member, or may be one as far as the reduction by the
    /// enclosure of π tells.
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

impl Interval {
    /// The angles in [−π, π] of the points (x, y) with y in `self` and x in `x`; not defined when the origin is one of
    /// them.
    ///
    /// Boxes that touch the negative x axis from either side give [−π, π]: floating-point arithmetic has two zeros, and
    /// −0 lies on the other side of the cut.
    pub fn atan2(self, x: Self) -> Self {
        let y = self;
        if y.is_empty() || x.is_empty() {
            return Self::EMPTY;
        }
        let has_origin = y.contains_zero() && x.contains_zero();
        let defined = y.defined && x.defined && !has_origin;
        if y.contains_zero() && x.lo < 0.0 {
            return Self::raw(-Self::PI.hi, Self::PI.hi, defined);
        }
        if has_origin {
            return y.angles_at_origin(x);
        }
        let corners = [(y.lo, x.lo), (y.lo, x.hi), (y.hi, x.lo), (y.hi, x.hi)];
        let lo = smallest(corners.map(|(y, x)| angle_down(y, x)));
        let hi = largest(corners.map(|(y, x)| angle_up(y, x)));
        Self::raw(lo, hi, defined)
    }

    /// Angles of a box in the half plane x ≥ 0 that has the origin as a point.
    fn angles_at_origin(self, x: Self) -> Self {
        let quarter = FRAC_PI_2.next_up();
        let (down, up) = (self.lo < 0.0, self.hi > 0.0);
        if !down && !up && x.hi == 0.0 {
            return Self::EMPTY;
        }
        // Straight up and down alone on the y axis, everything from the x axis otherwise.
        let on_axis = x.hi == 0.0;
        let lo = match (down, on_axis) {
            (true, _) => -quarter,
            (false, true) => FRAC_PI_2,
            (false, false) => 0.0,
        };
        let hi = match (up, on_axis) {
            (true, _) => quarter,
            (false, true) => -FRAC_PI_2,
            (false, false) => 0.0,
        };
        Self::raw(lo, hi, false)
    }
}

fn angle_down(y: f64, x: f64) -> f64 {
    -angle_up(-y, x)
}

/// The angle is monotone along the edges of a box off the branch cut and the origin, so corners bound it.
fn angle_up(y: f64, x: f64) -> f64 {
    let angle = libm::atan2(y, x);
    if y == 0.0 && x > 0.0 {
        return 0.0;
    }
    let limit = if y < 0.0 {
        0.0
    } else if x >= 0.0 {
        FRAC_PI_2.next_up()
    } else {
        Interval::PI.hi
    };
    library_up(angle).min(limit)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

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

    fn near(x: Interval, lo: f64, hi: f64) -> bool {
        (x.lo() - lo).abs() < 1e-14 && (x.hi() - hi).abs() < 1e-14
    }

    #[test]
    fn quadrants() {
        let one = Interval::ONE;
        assert!(near(one.atan2(one), FRAC_PI_4, FRAC_PI_4));
        assert!(near(
            one.atan2(interval(-1.0, 1.0)),
            FRAC_PI_4,
            3.0 * FRAC_PI_4
        ));
        assert!(near(
            (-one).atan2(interval(-1.0, 1.0)),
            -3.0 * FRAC_PI_4,
            -FRAC_PI_4
        ));
        assert!(near(interval(-1.0, 1.0).atan2(one), -FRAC_PI_4, FRAC_PI_4));
        assert_eq!(Interval::ZERO.atan2(one), Interval::ZERO);
    }

    #[test]
    fn the_branch_cut_gives_every_angle() {
        for y in [interval(-1.0, 1.0), interval(0.0, 1.0), interval(-1.0, 0.0)] {
            let angle = y.atan2(interval(-2.0, -1.0));
            assert!(angle.is_defined() && near(angle, -PI, PI));
            assert!(angle.contains(PI) && angle.contains(-PI));
        }
        let above = interval(0.1, 1.0).atan2(interval(-2.0, -1.0));
        assert!(above.is_defined() && above.lo() > 2.0);
    }

    #[test]
    fn the_origin_has_no_angle() {
        let unit = interval(-1.0, 1.0);
        assert!(!unit.atan2(unit).is_defined());
        assert!(Interval::ZERO.atan2(Interval::ZERO).is_empty());
        let right = unit.atan2(interval(0.0, 1.0));
        assert!(!right.is_defined() && near(right, -FRAC_PI_2, FRAC_PI_2));
        assert!(near(
            interval(0.0, 1.0).atan2(Interval::ZERO),
            FRAC_PI_2,
            FRAC_PI_2
        ));
        assert!(near(
            interval(-1.0, 0.0).atan2(Interval::ZERO),
            -FRAC_PI_2,
            -FRAC_PI_2
        ));
        let first = interval(0.0, 1.0).atan2(interval(0.0, 1.0));
        assert!(near(first, 0.0, FRAC_PI_2) && first.contains(0.0));
    }

    #[test]
    fn unbounded_boxes() {
        let up = interval(1.0, f64::INFINITY);
        assert!(near(up.atan2(up), 0.0, FRAC_PI_2));
        assert!(near(up.atan2(Interval::ENTIRE), 0.0, PI));
        assert!(near(Interval::ENTIRE.atan2(Interval::ENTIRE), -PI, PI));
    }
}
