//! Interval operations hold the exact value at every member, and the value `f64` arithmetic finds there.

use crate::exact::{Exact, holds};
use crate::sample::{POWERS, interval_and_member};
use astro_float_num::BigFloat;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Binary, Interval, Reals, Unary};
use proptest::prelude::*;

/// Enough for an exact sum of any two `f64`.
const BITS: usize = 2304;
const SPACE: Exact = Exact(BITS);
/// For functions that no precision makes exact.
const FUNCTIONS: Exact = Exact(192);

fn check(result: Interval, exact: &BigFloat, float: f64) -> Result<(), String> {
    if result.lo().is_nan() || result.hi().is_nan() {
        return Err("a bound is NaN".into());
    }
    if exact.is_nan() {
        return match result.is_defined() {
            true => Err("undefined at a member, yet marked as defined".into()),
            false => Ok(()),
        };
    }
    let pole = exact.is_inf() && !result.is_defined();
    if !holds(result, exact) && !pole {
        return Err(format!("{result} lacks the exact {exact}"));
    }
    if float.is_finite() && !result.contains(float) {
        return Err(format!("{result} lacks the computed {float:e}"));
    }
    Ok(())
}

fn is_algebraic(op: Unary) -> bool {
    use Unary::{Abs, Floor, Neg, Not, Sign, Sqrt};
    matches!(op, Neg | Abs | Sign | Floor | Sqrt | Not)
}

/// Argument reduction by a library of fixed precision ends somewhere, and so does its exponent range.
fn in_reach(op: Unary, x: f64) -> bool {
    is_algebraic(op) || x == 0.0 || (1e-40..1e15).contains(&x.abs())
}

/// For tiny arguments f(x) = x(1 + O(x²)), for large ones monotone limits: only `f64` is compared there.
fn exact_unary(op: Unary, x: f64) -> Option<BigFloat> {
    let space = if is_algebraic(op) { SPACE } else { FUNCTIONS };
    in_reach(op, x).then(|| space.unary(op, &space.constant(x)))
}

fn exact_binary(op: Binary, x: f64, y: f64) -> BigFloat {
    let space = match op {
        Binary::Div | Binary::Pow | Binary::Atan2 => FUNCTIONS,
        _ => SPACE,
    };
    space.binary(op, &space.constant(x), &space.constant(y))
}

/// The origin has no angle: intervals say that it is undefined, numbers give 0.
fn is_without_angle(op: Binary, y: f64, x: f64) -> bool {
    op == Binary::Atan2 && y == 0.0 && x == 0.0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn unary((x, member) in interval_and_member(), op in prop::sample::select(&Unary::ALL[..])) {
        let result = Intervals.unary(op, &x);
        let float = Reals.unary(op, &member);
        let exact = exact_unary(op, member).unwrap_or_else(|| FUNCTIONS.constant(float));
        let verdict = check(result, &exact, float);
        prop_assert!(verdict.is_ok(), "{op:?} of {x} at {member:e}: {verdict:?}");
    }

    #[test]
    fn binary(
        (x, a) in interval_and_member(),
        (y, b) in interval_and_member(),
        op in prop::sample::select(&Binary::ALL[..]),
    ) {
        prop_assume!(!is_without_angle(op, a, b));
        let result = Intervals.binary(op, &x, &y);
        let float = Reals.binary(op, &a, &b);
        let verdict = check(result, &exact_binary(op, a, b), float);
        prop_assert!(verdict.is_ok(), "{op:?} of {x} and {y} at {a:e}, {b:e}: {verdict:?}");
    }

    /// The arguments that relations, exact quotients and branch cuts hinge on.
    #[test]
    fn binary_at_bounds(
        ends in prop::array::uniform4(-2_i8..=2),
        place in prop::array::uniform2(prop::bool::ANY),
        op in prop::sample::select(&Binary::ALL[..]),
    ) {
        let [p, q, r, s] = ends.map(f64::from);
        let x = Interval::new(p.min(q), p.max(q)).expect("in order");
        let y = Interval::new(r.min(s), r.max(s)).expect("in order");
        let a = if place[0] { x.lo() } else { x.hi() };
        let b = if place[1] { y.lo() } else { y.hi() };
        prop_assume!(!is_without_angle(op, a, b));
        let result = Intervals.binary(op, &x, &y);
        let verdict = check(result, &exact_binary(op, a, b), Reals.binary(op, &a, &b));
        prop_assert!(verdict.is_ok(), "{op:?} of {x} and {y} at {a}, {b}: {verdict:?}");
    }

    #[test]
    fn powi((x, member) in interval_and_member(), n in prop::sample::select(&POWERS[..])) {
        let result = Intervals.powi(&x, n);
        let exact = FUNCTIONS.powi(&FUNCTIONS.constant(member), n);
        // The library multiplies in an order of its own, so its errors may exceed the rounding of ours.
        let verdict = check(result, &exact, f64::NAN);
        prop_assert!(verdict.is_ok(), "{x}^{n} at {member:e}: {verdict:?}");
    }

    #[test]
    fn select(
        (c, at) in interval_and_member(),
        (x, a) in interval_and_member(),
        (y, b) in interval_and_member(),
    ) {
        let result = Intervals.select(&c, &x, &y);
        let float = Reals.select(&at, &a, &b);
        let verdict = check(result, &SPACE.constant(float), float);
        prop_assert!(verdict.is_ok(), "if {c} then {x} else {y} at {at:e}: {verdict:?}");
    }

    /// Monotone in inclusion, but for the errors of library functions: a smaller argument gives a result inside.
    #[test]
    fn halves_stay_inside_the_whole(
        (x, _) in interval_and_member(),
        op in prop::sample::select(&Unary::ALL[..]),
    ) {
        let whole = Intervals.unary(op, &x);
        let (left, right) = x.bisect();
        for half in [left, right] {
            let part = Intervals.unary(op, &half);
            let rounding = 1e-14 * whole.magnitude() + f64::MIN_POSITIVE;
            prop_assert!(part.is_subset(whole.inflate(rounding)), "{op:?}: {part} of {half} not in {whole} of {x}");
            prop_assert!(part.is_defined() || !whole.is_defined());
        }
    }

    #[test]
    fn sets((x, a) in interval_and_member(), (y, b) in interval_and_member()) {
        let hull = x.hull(y);
        prop_assert!(hull.contains(a) && hull.contains(b) && x.is_subset(hull));
        let both = x.intersection(y);
        prop_assert_eq!(both.contains(a), y.contains(a));
        prop_assert!(x.contains(x.midpoint()) && x.midpoint().is_finite());
        prop_assert!(x.mignitude() <= a.abs() && a.abs() <= x.magnitude());
        let width = SPACE.sub(&SPACE.constant(a), &SPACE.constant(x.lo()));
        prop_assert!(width <= SPACE.constant(x.width()));
    }
}

#[test]
fn the_empty_set_stays_empty() {
    let x = Interval::new(1.0, 2.0).expect("in order");
    for op in Unary::ALL {
        let result = Intervals.unary(op, &Interval::EMPTY);
        assert!(result.is_empty() && !result.is_defined(), "{op:?}");
    }
    for op in Binary::ALL {
        for (a, b) in [(x, Interval::EMPTY), (Interval::EMPTY, x)] {
            let result = Intervals.binary(op, &a, &b);
            assert!(result.is_empty() && !result.is_defined(), "{op:?}");
        }
    }
    for n in POWERS {
        assert!(Intervals.powi(&Interval::EMPTY, n).is_empty());
    }
}

#[test]
fn a_constant_nan_has_no_value() {
    assert!(Intervals.constant(f64::NAN).is_empty());
    assert!(!Intervals.constant(f64::INFINITY).is_defined());
}
