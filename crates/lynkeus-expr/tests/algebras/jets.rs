//! Taylor series of every operation against high-precision differences of the operation itself.

use crate::exact::{Exact, error, holds, to_f64};
use crate::operations::{Case, cases};
use astro_float_num::BigFloat;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Graph, Interval, Jets, Node, Nodes, Reals, Tape};
use proptest::prelude::*;

/// Highest order tested.
pub const ORDER: usize = 8;
/// Differences of order 8 with steps of 2⁻⁶⁴ lose 512 bits.
const SPACE: Exact = Exact(896);
const STEP: i32 = -64;

/// The polynomial arguments of a case: one series of `ORDER + 1` coefficients per symbol.
fn arguments(case: &Case, places: &[f64]) -> Vec<Vec<f64>> {
    arguments_between(&case.domain, places)
}

/// One series for each interval, with its first coefficient in there.
pub fn arguments_between(domain: &[(f64, f64)], places: &[f64]) -> Vec<Vec<f64>> {
    let value = |k: usize| places[k % places.len()];
    let series = |(i, &(lo, hi)): (usize, &(f64, f64))| {
        let start = lo + value(i) * (hi - lo);
        let rest = (1..=ORDER).map(|k| (value(7 * i + 3 * k) - 0.5) / k as f64);
        std::iter::once(start).chain(rest).collect()
    };
    domain.iter().enumerate().map(series).collect()
}

fn polynomial(series: &[f64], shift: &BigFloat) -> BigFloat {
    series.iter().rev().fold(SPACE.constant(0.0), |sum, &c| {
        SPACE.add(&SPACE.mul(&sum, shift), &SPACE.constant(c))
    })
}

/// Newton's forward differences: cₖ ≈ Δᵏf/(k! hᵏ), off by about h·cₖ₊₁.
pub fn reference(tape: &Tape, arguments: &[Vec<f64>]) -> Vec<BigFloat> {
    let step = SPACE.power_of_two(STEP);
    let mut row: Vec<BigFloat> = (0..=ORDER)
        .map(|j| {
            let shift = SPACE.mul(&step, &SPACE.constant(j as f64));
            let x: Vec<BigFloat> = arguments.iter().map(|s| polynomial(s, &shift)).collect();
            tape.eval_in(&SPACE, &x).remove(0)
        })
        .collect();
    let mut coefficients = vec![row[0].clone()];
    let mut scale = SPACE.constant(1.0);
    for k in 1..=ORDER {
        row = row
            .windows(2)
            .map(|pair| SPACE.sub(&pair[1], &pair[0]))
            .collect();
        scale = SPACE.mul(&scale, &SPACE.mul(&step, &SPACE.constant(k as f64)));
        coefficients.push(SPACE.div(&row[0], &scale));
    }
    coefficients
}

/// The coefficients of the first output, with zeros up to the order.
pub fn jets<A: Algebra>(
    inner: &A,
    tape: &Tape,
    x: &[Vec<A::Value>],
    order: usize,
) -> Vec<A::Value> {
    let mut jet = tape.eval_in(&Jets { inner, order }, x).remove(0);
    assert!(
        jet.len() <= order + 1,
        "{} coefficients for order {order}",
        jet.len()
    );
    jet.resize_with(order + 1, || inner.constant(0.0));
    jet
}

fn places() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.0..1.0, 23)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn coefficients_agree_with_differences(places in places()) {
        for case in cases() {
            let tape = case.tape();
            let x = arguments(&case, &places);
            let exact = reference(&tape, &x);
            let found = jets(&Reals, &tape, &x, ORDER);
            let size = exact.iter().map(|c| to_f64(c).abs()).fold(1e-3, f64::max);
            for (k, (&found, exact)) in found.iter().zip(&exact).enumerate() {
                let off = error(found, exact, size);
                prop_assert!(off < 1e-12, "{} at {x:?}, order {k}: {off:e}", case.name);
            }
        }
    }

    #[test]
    fn enclosures_hold_the_differences(places in places()) {
        for case in cases() {
            let tape = case.tape();
            let x = arguments(&case, &places);
            let points: Vec<Vec<Interval>> = x.iter()
                .map(|s| s.iter().map(|&c| Interval::point(c)).collect())
                .collect();
            let found = jets(&Intervals, &tape, &points, ORDER);
            for (k, (found, exact)) in found.iter().zip(&reference(&tape, &x)).enumerate() {
                // The differences are themselves off by one step.
                let held = holds(found.inflate(1e-15), exact);
                prop_assert!(held, "{} at {x:?}, order {k}: {found} lacks {exact}", case.name);
                prop_assert!(found.is_defined(), "{} at {x:?}, order {k}: {found}", case.name);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn truncation_does_not_change_lower_coefficients(places in places(), order in 0..ORDER) {
        for case in cases() {
            let tape = case.tape();
            let x = arguments(&case, &places);
            let short: Vec<Vec<f64>> = x.iter().map(|s| s[..=order].to_vec()).collect();
            let found = jets(&Reals, &tape, &short, order);
            let longer = jets(&Reals, &tape, &x, ORDER);
            prop_assert_eq!(&found[..], &longer[..=order], "{} at {:?}", case.name, x);
        }
    }

    /// Series over the nodes of a graph, evaluated, are the series over numbers.
    #[test]
    fn series_over_nodes_equal_series_over_numbers(places in places()) {
        for case in cases() {
            let tape = case.tape();
            let x = arguments(&case, &places);
            let graph = Graph::new();
            let symbol = |i: usize, k: usize| graph.symbol(&format!("x{i}.{k}")).node();
            let symbols: Vec<Vec<Node>> = (0..x.len())
                .map(|i| (0..=ORDER).map(|k| symbol(i, k)).collect())
                .collect();
            let outputs = jets(&Nodes(&graph), &tape, &symbols, ORDER);
            let compiled = Tape::new(&graph, &symbols.concat(), &outputs).expect("symbols are inputs");
            let mut found = vec![0.0; outputs.len()];
            compiled.evaluator().eval(&x.concat(), &mut found);
            let expected = jets(&Reals, &tape, &x, ORDER);
            prop_assert_eq!(found, expected, "{} at {:?}", case.name, x);
        }
    }
}

/// A constant stays a jet of one coefficient through every operation.
#[test]
fn constants_have_no_higher_coefficients() {
    for case in cases() {
        let x: Vec<Vec<f64>> = case
            .domain
            .iter()
            .map(|&(lo, hi)| vec![0.5 * (lo + hi)])
            .collect();
        let jets = Jets {
            inner: &Reals,
            order: ORDER,
        };
        let found = case.tape().eval_in(&jets, &x).remove(0);
        assert_eq!(found.len(), 1, "{}", case.name);
    }
}

/// Classical series, as a check of the differences too.
#[test]
fn textbook_series() {
    let graph = Graph::new();
    let x = graph.symbol("x");
    let series = |node: Node, at: f64| {
        let tape = Tape::new(&graph, &[x.node()], &[node]).expect("x is an input");
        jets(&Reals, &tape, &[vec![at, 1.0]], 5)
    };
    let close = |found: Vec<f64>, expected: [f64; 6]| {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15, "{found} for {expected}");
        }
    };
    close(
        series(x.exp().node(), 0.0),
        [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0],
    );
    close(series((1.0 / (1.0 - x)).node(), 0.0), [1.0; 6]);
    close(
        series(x.tan().node(), 0.0),
        [0.0, 1.0, 0.0, 1.0 / 3.0, 0.0, 2.0 / 15.0],
    );
    close(
        series(x.atan().node(), 0.0),
        [0.0, 1.0, 0.0, -1.0 / 3.0, 0.0, 0.2],
    );
    close(
        series(x.asin().node(), 0.0),
        [0.0, 1.0, 0.0, 1.0 / 6.0, 0.0, 3.0 / 40.0],
    );
    close(
        series(x.ln().node(), 1.0),
        [0.0, 1.0, -0.5, 1.0 / 3.0, -0.25, 0.2],
    );
    close(
        series(x.sqrt().node(), 1.0),
        [1.0, 0.5, -0.125, 0.0625, -5.0 / 128.0, 7.0 / 256.0],
    );
    close(
        series(x.powi(-2).node(), 1.0),
        [1.0, -2.0, 3.0, -4.0, 5.0, -6.0],
    );
}
