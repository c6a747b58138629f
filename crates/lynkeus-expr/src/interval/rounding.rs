//! Directed rounding by software: the nearest result, moved one step outwards when it is known not to be exact.
//!
//! The residual of an addition comes from Knuth's two-sum, those of products, quotients and roots from a fused
//! multiply-add; below [`TINY`] such a residual may underflow, and the step is then always taken.

/// Below this magnitude the residual of a product or quotient might not be representable.
const TINY: f64 = f64::MIN_POSITIVE * (1_u64 << 60) as f64 * (1_u64 << 60) as f64;

/// How far an elementary function of the crate `libm` may be off, doubled.
///
/// That crate computes the same bits on every platform, whatever the platform's own library does, and is tested
/// against multiple precision to 1 unit in the last place for exp, log, pow, sin, cos, tan, asin, acos, atan and atan2,
/// to 2 for sinh, cosh and tanh; `tests/algebras/library.rs` measures it again. The doubling leaves room for a value
/// computed at a neighbouring point, or by another library as accurate, to err in the opposite direction: the floating
/// point value of the function at any point of an interval then lies in the result as well as the exact one.
const LIBRARY_ULPS: u32 = 4;

/// A result to nearest, and what rounding took from it.
#[derive(Clone, Copy)]
pub struct Rounded {
    nearest: f64,
    /// the sign of the exact value less the nearest; not finite where it is not known
    rest: f64,
}

impl Rounded {
    fn exact(nearest: f64) -> Self {
        Self { nearest, rest: 0.0 }
    }

    fn unknown(nearest: f64) -> Self {
        let rest = f64::NAN;
        Self { nearest, rest }
    }

    /// A lower bound of the exact value.
    pub fn down(self) -> f64 {
        match self.rest < 0.0 || !self.rest.is_finite() {
            true => self.nearest.next_down(),
            false => self.nearest,
        }
    }

    /// An upper bound of the exact value.
    pub fn up(self) -> f64 {
        match self.rest > 0.0 || !self.rest.is_finite() {
            true => self.nearest.next_up(),
            false => self.nearest,
        }
    }
}

/// a + b
pub fn sum(a: f64, b: f64) -> Rounded {
    let nearest = a + b;
    if a.is_infinite() || b.is_infinite() {
        return Rounded::exact(nearest);
    }
    let b_part = nearest - a;
    let a_part = nearest - b_part;
    let rest = (a - a_part) + (b - b_part);
    Rounded { nearest, rest }
}

/// a·b; an infinite bound is a limit of numbers, so its product with zero is zero.
pub fn product(a: f64, b: f64) -> Rounded {
    if a == 0.0 || b == 0.0 {
        return Rounded::exact(0.0);
    }
    let nearest = a * b;
    if a.is_infinite() || b.is_infinite() {
        return Rounded::exact(nearest);
    }
    if nearest.is_infinite() || nearest.abs() < TINY {
        return Rounded::unknown(nearest);
    }
    let rest = a.mul_add(b, -nearest);
    Rounded { nearest, rest }
}

/// a/b for b ≠ 0, not both infinite.
pub fn quotient(a: f64, b: f64) -> Rounded {
    let nearest = a / b;
    if a == 0.0 || a.is_infinite() || b.is_infinite() {
        return Rounded::exact(nearest);
    }
    if nearest.is_infinite() || nearest.abs() < TINY || a.abs() < TINY {
        return Rounded::unknown(nearest);
    }
    let remainder = (-nearest).mul_add(b, a);
    let rest = remainder * b.signum();
    Rounded { nearest, rest }
}

/// √a
pub fn root(a: f64) -> Rounded {
    let nearest = a.sqrt();
    if a == 0.0 || a.is_infinite() {
        return Rounded::exact(nearest);
    }
    if a < TINY {
        return Rounded::unknown(nearest);
    }
    let rest = (-nearest).mul_add(nearest, a);
    Rounded { nearest, rest }
}

/// A lower bound of the exact value of which a library function returned `value`.
pub fn library_down(value: f64) -> f64 {
    (0..LIBRARY_ULPS).fold(value, |bound, _| bound.next_down())
}

/// An upper bound of the exact value of which a library function returned `value`.
pub fn library_up(value: f64) -> f64 {
    (0..LIBRARY_ULPS).fold(value, |bound, _| bound.next_up())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_results_are_not_moved() {
        assert_eq!((sum(0.5, 0.25).down(), sum(0.5, 0.25).up()), (0.75, 0.75));
        assert_eq!(
            (product(3.0, -7.0).down(), product(3.0, -7.0).up()),
            (-21.0, -21.0)
        );
        assert_eq!(
            (quotient(1.0, -8.0).down(), quotient(1.0, -8.0).up()),
            (-0.125, -0.125)
        );
        assert_eq!((root(2.25).down(), root(2.25).up()), (1.5, 1.5));
    }

    #[test]
    fn inexact_results_are_one_step_apart() {
        for (down, up) in [
            (sum(0.1, 0.2).down(), sum(0.1, 0.2).up()),
            (sum(1.0, 1e-300).down(), sum(1.0, 1e-300).up()),
            (product(0.1, 0.1).down(), product(0.1, 0.1).up()),
            (quotient(1.0, -3.0).down(), quotient(1.0, -3.0).up()),
            (root(2.0).down(), root(2.0).up()),
        ] {
            assert_eq!(down.next_up(), up);
        }
    }

    #[test]
    fn overflow_stays_finite_on_the_inner_side() {
        assert_eq!(sum(f64::MAX, f64::MAX).down(), f64::MAX);
        assert_eq!(sum(f64::MAX, f64::MAX).up(), f64::INFINITY);
        assert_eq!(product(-1e200, 1e200).up(), f64::MIN);
        assert_eq!(quotient(1e200, 1e-200).down(), f64::MAX);
    }

    #[test]
    fn underflow_is_outward() {
        let tiny = f64::from_bits(1);
        assert!(product(tiny, tiny).down() <= 0.0 && product(tiny, tiny).up() >= tiny);
        assert!(quotient(-tiny, 3.0).down() <= -tiny && quotient(-tiny, 3.0).up() >= 0.0);
        assert!(root(tiny).down() < root(tiny).up());
    }

    #[test]
    fn zero_times_infinity_is_zero() {
        assert_eq!(product(0.0, f64::INFINITY).up(), 0.0);
        assert_eq!(product(f64::NEG_INFINITY, 0.0).down(), 0.0);
    }
}
