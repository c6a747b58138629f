//! Enclosures that are not wider than the rounding explains.

use crate::sample::number;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Binary, Interval, Reals, Unary};
use proptest::prelude::*;

/// How many steps of `next_up` lead from the lower to the upper bound.
fn steps(x: Interval) -> u64 {
    let place = |value: f64| {
        let bits = value.to_bits() as i64;
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    place(x.hi()).abs_diff(place(x.lo()))
}

/// Steps allowed for the image of a point: none for exact operations, one for correctly rounded ones.
fn allowed(op: Unary) -> u64 {
    use Unary::{Abs, Floor, Neg, Not, Sign, Sqrt};
    match op {
        Neg | Abs | Sign | Floor | Not => 0,
        // Two where the residual underflows.
        Sqrt => 2,
        _ => 8,
    }
}

fn allowed_binary(op: Binary) -> u64 {
    use Binary::{Add, Atan2, Div, Mul, Pow, Sub};
    match op {
        Add | Sub => 1,
        // Two where the residual underflows.
        Mul | Div => 2,
        Pow | Atan2 => 10,
        _ => 0,
    }
}

fn ordinary(value: f64) -> bool {
    value == 0.0 || (1e-100..1e100).contains(&value.abs())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn images_of_points(x in number(), op in prop::sample::select(&Unary::ALL[..])) {
        let result = Intervals.unary(op, &Interval::point(x));
        let value = Reals.unary(op, &x);
        prop_assume!(value.is_finite() && x.abs() < 1e6);
        // Next to a zero or a peak of a wave the reduction by π decides, not the last digit.
        let periodic = matches!(op, Unary::Sin | Unary::Cos | Unary::Tan);
        prop_assume!(!periodic || (1e-3..0.999).contains(&value.abs()));
        prop_assert!(result.is_defined(), "{op:?} at {x:e}");
        prop_assert!(steps(result) <= allowed(op), "{op:?} at {x:e}: {} steps", steps(result));
    }

    #[test]
    fn images_of_two_points(
        x in number(),
        y in number(),
        op in prop::sample::select(&Binary::ALL[..]),
    ) {
        let result = Intervals.binary(op, &Interval::point(x), &Interval::point(y));
        let value = Reals.binary(op, &x, &y);
        prop_assume!(value.is_finite() && ordinary(value) && ordinary(x) && ordinary(y));
        // Integer powers are products, and the branch cut has two sides.
        prop_assume!(op != Binary::Pow || (x > 0.0 && y.fract() != 0.0));
        prop_assume!(op != Binary::Atan2 || x != 0.0);
        prop_assert!(result.is_defined(), "{op:?} at {x:e}, {y:e}");
        prop_assert!(
            steps(result) <= allowed_binary(op),
            "{op:?} at {x:e}, {y:e}: {} steps", steps(result)
        );
    }

    /// The range of a function on an interval, found by dense sampling, fills the enclosure.
    #[test]
    fn images_of_intervals(
        lo in -6.0_f64..6.0,
        width in 0.0_f64..8.0,
        op in prop::sample::select(&Unary::ALL[..]),
    ) {
        let x = Interval::new(lo, lo + width).expect("in order");
        let result = Intervals.unary(op, &x);
        prop_assume!(result.is_defined());
        const SAMPLES: u32 = 4000;
        let values = (0..=SAMPLES).map(|k| Reals.unary(op, &(lo + width * f64::from(k) / f64::from(SAMPLES))));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            least = least.min(value);
            most = most.max(value);
        }
        // A smooth peak between two samples is missed by the square of their distance; Not jumps at one point.
        let slack = (width / f64::from(SAMPLES)).powi(2) + 1e-13 * most.abs().max(least.abs());
        let isolated = matches!(op, Unary::Not);
        let zero = matches!(op, Unary::Abs) && x.contains_zero();
        prop_assume!(!isolated && !zero);
        prop_assert!(result.lo() >= least - slack && result.hi() <= most + slack,
            "{op:?} of {x}: {result}, sampled [{least}, {most}]");
    }
}

#[test]
fn powers_of_points() {
    for n in [2, 3, 5, 8, -3] {
        let result = Interval::point(1.1).powi(n);
        assert!(steps(result) <= 12, "1.1^{n}: {}", steps(result));
    }
}
