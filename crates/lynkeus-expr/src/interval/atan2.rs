//! The angle of a point of the plane, with its branch cut on the negative x axis.

use super::Interval;
use super::arithmetic::{largest, smallest};
use super::rounding::library_up;
use std::f64::consts::FRAC_PI_2;

impl Interval {
    /// The angles in [−π, π] of the points (x, y) with y in `self` and x in `x`; not defined when the origin is one of
    /// them.
    ///
    /// Boxes that touch the negative x axis from either side give [−π, π]: floating-point arithmetic has two zeros, and
    /// −0 lies on the other side of the cut.
    #[must_use]
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
    use super::*;
    use std::f64::consts::{FRAC_PI_4, PI};

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
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
