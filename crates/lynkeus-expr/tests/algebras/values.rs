//! Every operation of the table, as a tape over numbers, intervals and with hundreds of bits.

use crate::exact::{Exact, error, holds};
use crate::operations::{Case, cases};
use crate::sample::member;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Interval};
use proptest::prelude::*;

const SPACE: Exact = Exact(192);

fn places() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.0..=1.0, 12)
}

fn point(case: &Case, places: &[f64]) -> Vec<f64> {
    let inside = |(&(lo, hi), &p): (&(f64, f64), &f64)| lo + p * (hi - lo);
    case.domain.iter().zip(places).map(inside).collect()
}

/// How far `f64` may be off, and beside which size at least: library functions by some units of their value, x¹² by half
/// a unit for each of its eleven products. A solution's entry is as exact as the largest, however small it is by
/// cancellation: that one is |b|/|A| at least, and the matrices are dominated by their diagonals, with conditions
/// below ten.
fn tolerance(case: &Case, x: &[f64]) -> (f64, f64) {
    let n = match case.name.split(", ").next() {
        Some("solve 2×2") => 2,
        Some("solve 3×3") => 3,
        Some("powi 12") => return (11.0 * 0.5 * f64::EPSILON, 1e-3),
        _ => return (1e-15, 1e-3),
    };
    let (a, b) = x.split_at(n * n);
    let rows = a
        .chunks(n)
        .map(|row| row.iter().map(|a| a.abs()).sum::<f64>());
    let size = b.iter().map(|b| b.abs()).fold(0.0, f64::max) / rows.fold(0.0, f64::max);
    (2e-14, size.max(1e-3))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn numbers_agree_with_the_reference(places in places()) {
        for case in cases() {
            let x = point(&case, &places);
            let mut found = vec![0.0];
            case.tape().evaluator().eval(&x, &mut found);
            let big: Vec<_> = x.iter().map(|&x| SPACE.constant(x)).collect();
            let exact = case.tape().eval_in(&SPACE, &big);
            let (tolerance, size) = tolerance(&case, &x);
            let off = error(found[0], &exact[0], size);
            prop_assert!(off <= tolerance, "{} at {x:?}: {off:e}", case.name);
        }
    }

    #[test]
    fn intervals_hold_the_reference(places in places(), width in 0.0_f64..1.0) {
        for case in cases() {
            let x = point(&case, &places);
            let boxed: Vec<Interval> = x.iter().zip(&case.domain).map(|(&x, &(lo, hi))| {
                let (lo, hi) = (x + (lo - x) * width, x + (hi - x) * width);
                Interval::new(lo.min(x), hi.max(x)).expect("in order")
            }).collect();
            let found = case.tape().eval_in(&Intervals, &boxed)[0];
            for place in [0.0, 0.3, 0.5, 0.8, 1.0] {
                let inside: Vec<_> = boxed.iter().map(|&x| SPACE.constant(member(x, place))).collect();
                let exact = &case.tape().eval_in(&SPACE, &inside)[0];
                let held = holds(found, exact);
                prop_assert!(held, "{} on {boxed:?}: {found} lacks {exact}", case.name);
            }
            let regular = !case.name.starts_with("solve");
            prop_assert!(found.is_defined() || !regular, "{} on {boxed:?}", case.name);
        }
    }
}

/// The condition estimate has no exact value: it must tell a singular matrix from a good one.
#[test]
fn the_condition_estimate_separates_singular_from_regular() {
    use lynkeus_expr::Reals;
    let (_, good) = Reals.solve(&[2.0, 0.0, 0.0, 1.0], &[1.0, 1.0]);
    let (_, poor) = Reals.solve(&[1.0, 1.0, 1.0, 1.0 + 1e-10], &[1.0, 1.0]);
    let (x, none) = Reals.solve(&[1.0, 2.0, 2.0, 4.0], &[1.0, 2.0]);
    assert!(good > 0.4 && good <= 1.0, "{good}");
    assert!(poor > 1e-12 && poor < 1e-9, "{poor}");
    assert!(none < 1e-15, "{none}");
    assert!(x.iter().all(|x| x.is_finite() && x.abs() < 10.0), "{x:?}");
}
