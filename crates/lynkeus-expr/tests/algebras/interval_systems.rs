//! Enclosures of linear systems hold the exact solutions of every system inside.

use crate::exact::{Exact, holds};
use crate::sample::{interval_and_member, member, moderate};
use astro_float_num::BigFloat;
use lynkeus_expr::Algebra;
use lynkeus_expr::interval::{Interval, solve};
use proptest::prelude::*;

const SPACE: Exact = Exact(256);

fn system() -> impl Strategy<Value = (Vec<Interval>, Vec<Interval>, Vec<f64>)> {
    (1_usize..=5).prop_flat_map(|n| {
        let places = prop::collection::vec(0.0..=1.0, n * n + n);
        (
            prop::collection::vec(moderate(), n * n),
            prop::collection::vec(moderate(), n),
            places,
        )
    })
}

fn exact_solution(a: &[f64], b: &[f64]) -> Vec<BigFloat> {
    let big = |values: &[f64]| -> Vec<BigFloat> {
        values.iter().map(|&value| SPACE.constant(value)).collect()
    };
    SPACE.solve(&big(a), &big(b)).0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn solutions_of_members_are_held((a, b, places) in system(), shift in 0.0..8.0) {
        // Adding to the diagonal goes from matrices that are rarely provably regular to ones that always are.
        let n = b.len();
        let a: Vec<Interval> = a.iter().enumerate().map(|(k, &entry)| {
            if k / n == k % n { entry + Interval::point(shift) } else { entry }
        }).collect();
        let (x, regular) = solve(&a, &b);
        let inside: Vec<f64> = a.iter().chain(&b).zip(&places).map(|(&x, &p)| member(x, p)).collect();
        for (x, exact) in x.iter().zip(exact_solution(&inside[..n * n], &inside[n * n..])) {
            prop_assert_eq!(x.is_defined(), regular);
            prop_assert!(!regular || holds(*x, &exact), "{} lacks {}", x, exact);
        }
    }

    /// A box around a singular matrix is never called regular.
    #[test]
    fn singular_members_are_not_overlooked((a, b, places) in system(), row in 0_usize..5) {
        let n = b.len();
        prop_assume!(n > 1);
        let mut inside: Vec<f64> = a.iter().zip(&places).map(|(&x, &p)| member(x, p)).collect();
        let (row, other) = (row % n, (row + 1) % n);
        for k in 0..n {
            inside[row * n + k] = 2.0 * inside[other * n + k];
        }
        let a: Vec<Interval> = a.iter().zip(inside).map(|(x, p)| x.hull(Interval::point(p))).collect();
        let (x, regular) = solve(&a, &b);
        prop_assert!(!regular && x.iter().all(|x| !x.is_defined() && *x == Interval::ENTIRE.hull(*x)));
    }

    /// Whatever the coefficients, there is an answer, and no bound is NaN.
    #[test]
    fn any_system_is_answered(entries in prop::collection::vec(interval_and_member(), 0..20), n in 0_usize..5) {
        let entries: Vec<Interval> = entries.into_iter().map(|(x, _)| x).collect();
        let (b, a) = entries.split_at(n.min(entries.len()));
        let (x, regular) = solve(&a[..(n * n).min(a.len())], b);
        prop_assert_eq!(x.len(), b.len());
        prop_assert!(x.iter().all(|x| x.lo() <= x.hi() && (regular || !x.is_defined())));
    }

    /// Without uncertainty in the data the enclosure is about as wide as the condition of the matrix explains.
    #[test]
    fn point_systems_are_tight((a, b, places) in system()) {
        let n = b.len();
        let point = |values: &[Interval], at: usize| -> Vec<Interval> {
            values.iter().zip(&places[at..]).map(|(&x, &p)| Interval::point(member(x, p))).collect()
        };
        let (mut a, b) = (point(&a, 0), point(&b, n * n));
        for k in 0..n {
            a[k * n + k] = a[k * n + k] + Interval::point(30.0);
        }
        let (x, regular) = solve(&a, &b);
        prop_assert!(regular);
        for x in x {
            prop_assert!(x.width() < 1e-14, "{x} is {} wide", x.width());
        }
    }
}
