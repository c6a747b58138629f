//! How far the elementary functions behind the enclosures are off: `interval/rounding.rs` allows 2 units in the last
//! place, measured here against multiple precision.

use crate::exact::{Exact, to_f64};
use lynkeus_expr::{Algebra, Binary, Unary};

/// Numbers tried per function.
const COUNT: usize = 2000;

/// |found − exact| in units in the last place of the exact value.
pub fn units(found: f64, exact: &astro_float_num::BigFloat) -> f64 {
    let nearest = to_f64(exact).abs().max(f64::MIN_POSITIVE);
    let unit = nearest.next_up() - nearest;
    let space = Exact(256);
    to_f64(&space.sub(&space.constant(found), exact)).abs() / unit
}

/// Numbers between two powers of ten of either sign, by a fixed sequence.
fn sample(i: usize, low: f64, high: f64) -> f64 {
    let share = |k: f64| (i as f64 * k).fract();
    let size = 10_f64.powf(low + (high - low) * share(0.618_033_988_749_894_9));
    match share(std::f64::consts::FRAC_1_SQRT_2) < 0.5 {
        true => size,
        false => -size,
    }
}

#[test]
fn elementary_functions_are_as_good_as_stated() {
    type Function = fn(f64) -> f64;
    let functions: [(Unary, Function, [f64; 2]); 11] = [
        (Unary::Exp, libm::exp, [-8.0, 2.8]),
        (Unary::Ln, |x| libm::log(x.abs()), [-300.0, 300.0]),
        (Unary::Sin, libm::sin, [-8.0, 6.0]),
        (Unary::Cos, libm::cos, [-8.0, 6.0]),
        (Unary::Tan, libm::tan, [-8.0, 6.0]),
        (Unary::Asin, libm::asin, [-8.0, 0.0]),
        (Unary::Acos, libm::acos, [-8.0, 0.0]),
        (Unary::Atan, libm::atan, [-8.0, 8.0]),
        (Unary::Sinh, libm::sinh, [-8.0, 2.8]),
        (Unary::Cosh, libm::cosh, [-8.0, 2.8]),
        (Unary::Tanh, libm::tanh, [-8.0, 1.5]),
    ];
    let space = Exact(256);
    for (op, function, [low, high]) in functions {
        let off = (0..COUNT).map(|i| {
            let x = sample(i, low, high);
            let argument = if op == Unary::Ln { x.abs() } else { x };
            units(function(x), &space.unary(op, &space.constant(argument)))
        });
        let worst = off.fold(0.0, f64::max);
        assert!(worst <= 2.0, "{op:?}: {worst} units in the last place");
    }
}

#[test]
fn powers_and_angles_are_as_good_as_stated() {
    let space = Exact(256);
    for i in 0..COUNT {
        let (x, y) = (sample(i, -5.0, 5.0), sample(3 * i + 1, -2.0, 1.5));
        let (base, exponent) = (space.constant(x.abs()), space.constant(y));
        let power = units(
            libm::pow(x.abs(), y),
            &space.binary(Binary::Pow, &base, &exponent),
        );
        let angle = space.binary(Binary::Atan2, &exponent, &space.constant(x));
        let angle = units(libm::atan2(y, x), &angle);
        assert!(power <= 2.0, "{x}^{y}: {power}");
        assert!(angle <= 2.0, "atan2({y}, {x}): {angle}");
    }
}
