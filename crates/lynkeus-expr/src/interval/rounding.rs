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

/// What the rounding to nearest did to a result.
enum Residual {
    Exact,
    /// The exact value is below the rounded one.
    Below,
    /// The exact value is above the rounded one.
    Above,
    Unknown,
}

impl Residual {
    fn from_sign(exact_minus_rounded: f64) -> Self {
        if exact_minus_rounded == 0.0 {
            Self::Exact
        } else if !exact_minus_rounded.is_finite() {
            Self::Unknown
        } else if exact_minus_rounded < 0.0 {
            Self::Below
        } else {
            Self::Above
        }
    }

    fn down(&self, rounded: f64) -> f64 {
        match self {
            Self::Below | Self::Unknown => rounded.next_down(),
            Self::Exact | Self::Above => rounded,
        }
    }

    fn up(&self, rounded: f64) -> f64 {
        match self {
            Self::Above | Self::Unknown => rounded.next_up(),
            Self::Exact | Self::Below => rounded,
        }
    }
}

fn sum(a: f64, b: f64) -> (f64, Residual) {
    let s = a + b;
    if a.is_infinite() || b.is_infinite() {
        return (s, Residual::Exact);
    }
    let b_part = s - a;
    let a_part = s - b_part;
    (s, Residual::from_sign((a - a_part) + (b - b_part)))
}

fn product(a: f64, b: f64) -> (f64, Residual) {
    if a == 0.0 || b == 0.0 {
        // An infinite bound is a limit of numbers, so its product with zero is zero.
        return (0.0, Residual::Exact);
    }
    let p = a * b;
    if a.is_infinite() || b.is_infinite() {
        return (p, Residual::Exact);
    }
    if p.is_infinite() || p.abs() < TINY {
        return (p, Residual::Unknown);
    }
    (p, Residual::from_sign(a.mul_add(b, -p)))
}

fn quotient(a: f64, b: f64) -> (f64, Residual) {
    let q = a / b;
    if a == 0.0 || a.is_infinite() || b.is_infinite() {
        return (q, Residual::Exact);
    }
    if q.is_infinite() || q.abs() < TINY || a.abs() < TINY {
        return (q, Residual::Unknown);
    }
    let remainder = (-q).mul_add(b, a);
    (q, Residual::from_sign(remainder * b.signum()))
}

fn root(a: f64) -> (f64, Residual) {
    let r = a.sqrt();
    if a == 0.0 || a.is_infinite() {
        return (r, Residual::Exact);
    }
    if a < TINY {
        return (r, Residual::Unknown);
    }
    (r, Residual::from_sign((-r).mul_add(r, a)))
}

pub fn add_down(a: f64, b: f64) -> f64 {
    let (s, residual) = sum(a, b);
    residual.down(s)
}

pub fn add_up(a: f64, b: f64) -> f64 {
    let (s, residual) = sum(a, b);
    residual.up(s)
}

pub fn mul_down(a: f64, b: f64) -> f64 {
    let (p, residual) = product(a, b);
    residual.down(p)
}

pub fn mul_up(a: f64, b: f64) -> f64 {
    let (p, residual) = product(a, b);
    residual.up(p)
}

/// Lower and upper bound of a product.
pub fn mul_outward(a: f64, b: f64) -> (f64, f64) {
    let (p, residual) = product(a, b);
    (residual.down(p), residual.up(p))
}

/// `a / b` for `b ≠ 0`, not both infinite.
pub fn div_down(a: f64, b: f64) -> f64 {
    let (q, residual) = quotient(a, b);
    residual.down(q)
}

/// `a / b` for `b ≠ 0`, not both infinite.
pub fn div_up(a: f64, b: f64) -> f64 {
    let (q, residual) = quotient(a, b);
    residual.up(q)
}

pub fn sqrt_down(a: f64) -> f64 {
    let (r, residual) = root(a);
    residual.down(r)
}

pub fn sqrt_up(a: f64) -> f64 {
    let (r, residual) = root(a);
    residual.up(r)
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
        assert_eq!((add_down(0.5, 0.25), add_up(0.5, 0.25)), (0.75, 0.75));
        assert_eq!((mul_down(3.0, -7.0), mul_up(3.0, -7.0)), (-21.0, -21.0));
        assert_eq!((div_down(1.0, -8.0), div_up(1.0, -8.0)), (-0.125, -0.125));
        assert_eq!((sqrt_down(2.25), sqrt_up(2.25)), (1.5, 1.5));
    }

    #[test]
    fn inexact_results_are_one_step_apart() {
        for (down, up) in [
            (add_down(0.1, 0.2), add_up(0.1, 0.2)),
            (add_down(1.0, 1e-300), add_up(1.0, 1e-300)),
            (mul_down(0.1, 0.1), mul_up(0.1, 0.1)),
            (div_down(1.0, -3.0), div_up(1.0, -3.0)),
            (sqrt_down(2.0), sqrt_up(2.0)),
        ] {
            assert_eq!(down.next_up(), up);
        }
    }

    #[test]
    fn overflow_stays_finite_on_the_inner_side() {
        assert_eq!(add_down(f64::MAX, f64::MAX), f64::MAX);
        assert_eq!(add_up(f64::MAX, f64::MAX), f64::INFINITY);
        assert_eq!(mul_up(-1e200, 1e200), f64::MIN);
        assert_eq!(div_down(1e200, 1e-200), f64::MAX);
    }

    #[test]
    fn underflow_is_outward() {
        let tiny = f64::from_bits(1);
        assert!(mul_down(tiny, tiny) <= 0.0 && mul_up(tiny, tiny) >= tiny);
        assert!(div_down(-tiny, 3.0) <= -tiny && div_up(-tiny, 3.0) >= 0.0);
        assert!(sqrt_down(tiny) < sqrt_up(tiny));
    }

    #[test]
    fn zero_times_infinity_is_zero() {
        assert_eq!(mul_up(0.0, f64::INFINITY), 0.0);
        assert_eq!(mul_down(f64::NEG_INFINITY, 0.0), 0.0);
    }
}
