//! Symbolic Jacobians of every operation against high-precision central differences.

use crate::exact::{Exact, error, to_f64};
use crate::operations::{Case, cases};
use astro_float_num::BigFloat;
use lynkeus_expr::{Algebra, Node, Tape, jacobian};
use proptest::prelude::*;

const SPACE: Exact = Exact(512);
const STEP: i32 = -100;

/// (f(x + h) − f(x − h))/2h for one symbol, off by about h².
fn difference(tape: &Tape, x: &[f64], column: usize) -> BigFloat {
    let step = SPACE.power_of_two(STEP);
    let at = |shift: &BigFloat| {
        let mut x: Vec<BigFloat> = x.iter().map(|&x| SPACE.constant(x)).collect();
        x[column] = SPACE.add(&x[column], shift);
        tape.eval_in(&SPACE, &x).remove(0)
    };
    let rise = SPACE.sub(&at(&step), &at(&step.neg()));
    SPACE.div(&rise, &SPACE.power_of_two(STEP + 1))
}

fn entries(case: &Case, slope: impl Fn(usize) -> Option<Node>, x: &[f64]) -> Vec<f64> {
    let column = |j| {
        let Some(node) = slope(j) else {
            return 0.0;
        };
        let tape = Tape::new(&case.graph, &case.symbols, &[node]).expect("symbols are inputs");
        let mut out = [0.0];
        tape.evaluator().eval(x, &mut out);
        out[0]
    };
    (0..case.symbols.len()).map(column).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn jacobians_agree_with_differences(places in prop::collection::vec(0.0..1.0, 12)) {
        for case in cases() {
            let x: Vec<f64> = case.domain.iter().zip(&places)
                .map(|(&(lo, hi), p)| lo + p * (hi - lo))
                .collect();
            let tape = case.tape();
            let forward = jacobian::forward(&case.graph, &[case.result], &case.symbols);
            let reverse = jacobian::gradient(&case.graph, case.result, &case.symbols);
            let reverse = |j: usize| reverse.iter().find(|of| of.0 == case.symbols[j]).map(|of| of.1);
            let pattern = jacobian::pattern(&case.graph, &[case.result], &case.symbols);
            let found = [entries(&case, |j| forward.get(0, j), &x), entries(&case, reverse, &x)];
            for column in 0..x.len() {
                let exact = difference(&tape, &x, column);
                for found in &found {
                    let off = error(found[column], &exact, 1e-2);
                    prop_assert!(off < 1e-13, "{} at {x:?}, column {column}: {} for {}",
                        case.name, found[column], to_f64(&exact));
                }
                let listed = pattern[0].contains(&column);
                prop_assert!(listed || forward.get(0, column).is_none(), "{}", case.name);
            }
        }
    }
}

/// Derivatives that vanish everywhere leave no entry behind.
#[test]
fn steps_have_no_derivative() {
    let graph = lynkeus_expr::Graph::new();
    let x = graph.symbol("x");
    for step in [x.sign(), x.floor(), x.less(x * x), !x, x.powi(0)] {
        let forward = jacobian::forward(&graph, &[step.node()], &[x.node()]).entries;
        let reverse = jacobian::gradient(&graph, step.node(), &[x.node()]);
        let is_empty = forward.is_empty() && reverse.is_empty();
        assert!(is_empty, "{:?}", graph.op(step.node()));
    }
}
