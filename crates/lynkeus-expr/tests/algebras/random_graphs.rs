//! Properties that hold for every graph.

use crate::exact::{Exact, holds, to_f64};
use crate::jets::{ORDER, arguments_between, jets, reference};
use crate::recipe::{INPUTS, Style, compute, follow, recipe, symbols, without_systems};
use crate::sample::member;
use astro_float_num::BigFloat;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Graph, Interval, Node, Nodes, Op, Reals, Tape, jacobian};
use proptest::prelude::*;
use std::collections::HashMap;

const STEPS: usize = 30;
const SPACE: Exact = Exact(384);

/// Every node below the roots, evaluated in the order of construction and kept: what a tape must agree with.
fn naive<A: Algebra>(
    algebra: &A,
    graph: &Graph,
    roots: &[Node],
    inputs: &[A::Value],
) -> HashMap<Node, A::Value> {
    let mut values: HashMap<Node, A::Value> = symbols(graph)
        .into_iter()
        .zip(inputs.iter().cloned())
        .collect();
    let mut solutions: HashMap<Node, Vec<A::Value>> = HashMap::new();
    for node in graph.reachable(roots) {
        let at = |node: Node| &values[&node];
        let value = match graph.op(node) {
            Op::Symbol(_) => continue,
            Op::Constant(value) => algebra.constant(value),
            Op::Unary(op, a) => algebra.unary(op, at(a)),
            Op::Powi(a, n) => algebra.powi(at(a), n),
            Op::Binary(op, a, b) => algebra.binary(op, at(a), at(b)),
            Op::Select(c, a, b) => algebra.select(at(c), at(a), at(b)),
            Op::Entry(solve, entry) => solutions[&solve][entry as usize].clone(),
            Op::System(_) => {
                let call = graph.system(node).expect("it is one");
                let values: Vec<A::Value> = call.arguments.iter().map(|&a| at(a).clone()).collect();
                if let Some(function) = call.function() {
                    solutions.insert(node, algebra.implicit(function, &values));
                    continue;
                }
                // Systems of a recipe are 2×2.
                let (mut x, rcond) = algebra.solve(&values[..4], &values[4..]);
                x.push(rcond);
                solutions.insert(node, x);
                continue;
            }
        };
        values.insert(node, value);
    }
    values
}

fn evaluate(graph: &Graph, outputs: &[Node], inputs: &[f64]) -> Vec<f64> {
    let tape = Tape::new(graph, &symbols(graph), outputs).expect("symbols are inputs");
    let mut found = vec![0.0; outputs.len()];
    tape.evaluator().eval(inputs, &mut found);
    found
}

fn same(x: f64, y: f64) -> bool {
    x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan())
}

fn inputs() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![9 => -3.0..3.0, 1 => Just(0.0)], INPUTS)
}

/// Inputs that are not zero, where many random graphs jump.
fn off_the_kinks() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![-3.01..-0.07, 0.07..3.01], INPUTS)
}

fn big(values: &[f64]) -> Vec<BigFloat> {
    values.iter().map(|&value| SPACE.constant(value)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn built_twice_is_one_graph(recipe in recipe(STEPS), wild in any::<bool>()) {
        let style = if wild { Style::Wild } else { Style::Tame };
        let graph = Graph::new();
        let first = follow(&recipe, &graph, style);
        let nodes = graph.len();
        prop_assert_eq!(follow(&recipe, &graph, style), first);
        prop_assert_eq!(graph.len(), nodes);
    }

    #[test]
    fn tapes_equal_naive_evaluation(recipe in recipe(STEPS), x in inputs()) {
        let graph = Graph::new();
        let nodes = follow(&recipe, &graph, Style::Wild);
        let values = naive(&Reals, &graph, &nodes, &x);
        // All at once, where no register can be given up, and one by one, where nearly all are.
        for (node, found) in nodes.iter().zip(evaluate(&graph, &nodes, &x)) {
            prop_assert!(same(found, values[node]), "{found} for {}", values[node]);
        }
        for &node in &nodes[STEPS - 6..] {
            let found = evaluate(&graph, &[node], &x)[0];
            prop_assert!(same(found, values[&node]), "{found} for {} alone", values[&node]);
        }
    }

    /// Folding, identities and sharing change no bit of a value.
    #[test]
    fn graphs_equal_plain_arithmetic(recipe in recipe(STEPS), x in inputs()) {
        let graph = Graph::new();
        let nodes = follow(&recipe, &graph, Style::Wild);
        let plain = compute(&recipe, &Reals, &x);
        for ((node, found), plain) in nodes.iter().zip(evaluate(&graph, &nodes, &x)).zip(plain) {
            prop_assert!(same(found, plain), "{found} for {plain}: {}", graph.render(*node, 400));
        }
    }

    #[test]
    fn an_evaluator_keeps_nothing_of_earlier_points(recipe in recipe(STEPS), x in prop::array::uniform3(inputs())) {
        let graph = Graph::new();
        let nodes = follow(&recipe, &graph, Style::Wild);
        let tape = Tape::new(&graph, &symbols(&graph), &nodes).expect("symbols are inputs");
        let (mut reused, mut bounds) = (tape.evaluator(), tape.evaluator_in(Intervals));
        let (mut found, mut enclosures) = (vec![0.0; nodes.len()], vec![Interval::ZERO; nodes.len()]);
        for x in &x {
            reused.eval(x, &mut found);
            let fresh = tape.eval_in(&Reals, x);
            prop_assert!(found.iter().zip(&fresh).all(|(a, b)| same(*a, *b)), "{found:?} for {fresh:?}");
            let boxed: Vec<Interval> = x.iter().map(|&x| Interval::point(x)).collect();
            bounds.eval(&boxed, &mut enclosures);
            prop_assert_eq!(&enclosures, &tape.eval_in(&Intervals, &boxed));
        }
    }

    #[test]
    fn tapes_are_no_longer_than_needed(recipe in recipe(STEPS)) {
        let graph = Graph::new();
        let root = follow(&recipe, &graph, Style::Wild)[STEPS - 1];
        let needed = graph.reachable(&[root]);
        let count = |wanted: fn(&Op) -> bool| {
            needed.iter().filter(|&&node| wanted(&graph.op(node))).count()
        };
        let leaves = count(|op| matches!(op, Op::Constant(_) | Op::Symbol(_)));
        let entries = count(|op| matches!(op, Op::Entry(..)));
        let tape = Tape::new(&graph, &symbols(&graph), &[root]).expect("symbols are inputs");
        prop_assert_eq!(tape.len(), needed.len() - leaves - entries);
        prop_assert!(tape.registers() <= INPUTS + needed.len());
    }

    #[test]
    fn the_first_nonfinite_operation_is_found(recipe in recipe(STEPS), x in inputs()) {
        let graph = Graph::new();
        let root = follow(&recipe, &graph, Style::Wild)[STEPS - 1];
        let values = naive(&Reals, &graph, &[root], &x);
        let computed = |node: &Node| !matches!(graph.op(*node), Op::Constant(_) | Op::Symbol(_));
        let any = values.iter().any(|(node, value)| computed(node) && !value.is_finite());
        let tape = Tape::new(&graph, &symbols(&graph), &[root]).expect("symbols are inputs");
        prop_assert_eq!(tape.first_nonfinite(&graph, &x).is_some(), any);
    }

    #[test]
    fn substitution_is_composition(outer in recipe(12), inner in recipe(12), x in inputs()) {
        let graph = Graph::new();
        let roots = follow(&outer, &graph, Style::Tame);
        let images = follow(&inner, &graph, Style::Tame)[12 - INPUTS..].to_vec();
        let map = symbols(&graph).into_iter().zip(images.iter().copied()).collect();
        let composed = evaluate(&graph, &graph.substitute(&roots, &map), &x);
        let expected = evaluate(&graph, &roots, &evaluate(&graph, &images, &x));
        for (found, expected) in composed.iter().zip(&expected) {
            prop_assert!(found == expected || same(*found, *expected), "{found} for {expected}");
        }
    }

    #[test]
    fn constants_put_in_fold_to_the_value(recipe in recipe(STEPS), x in inputs()) {
        let graph = Graph::new();
        let roots = without_systems(&recipe);
        let roots = follow(&roots, &graph, Style::Tame);
        let constants = x.iter().map(|&value| graph.constant(value).node());
        let map = symbols(&graph).into_iter().zip(constants).collect();
        for (root, expected) in graph.substitute(&roots, &map).iter().zip(evaluate(&graph, &roots, &x)) {
            let found = graph.constant_value(*root);
            prop_assert_eq!(found, Some(expected));
        }
    }

    #[test]
    fn intervals_hold_the_numbers(recipe in recipe(STEPS), x in inputs(), width in 0.0..0.5) {
        let graph = Graph::new();
        let nodes = follow(&without_systems(&recipe), &graph, Style::Wild);
        let values = naive(&Reals, &graph, &nodes, &x);
        // Infinity, unlike the exact value, times zero is NaN, and NaN is below nothing.
        prop_assume!(values.values().all(|value| !value.is_infinite()));
        let boxed: Vec<Interval> = x.iter().map(|&x| Interval::point(x).inflate(width)).collect();
        let tape = Tape::new(&graph, &symbols(&graph), &nodes).expect("symbols are inputs");
        for (node, found) in nodes.iter().zip(tape.eval_in(&Intervals, &boxed)) {
            let held = !found.is_defined() || found.contains(values[node]);
            prop_assert!(held, "{found} lacks {} of {}", values[node], graph.render(*node, 200));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn intervals_hold_the_exact_values(
        recipe in recipe(STEPS),
        x in inputs(),
        width in 0.0..0.3,
        place in 0.0..=1.0,
    ) {
        let graph = Graph::new();
        let nodes = follow(&recipe, &graph, Style::Tame);
        let boxed: Vec<Interval> = x.iter().map(|&x| Interval::point(x).inflate(width)).collect();
        let inside: Vec<f64> = boxed.iter().map(|&x| member(x, place)).collect();
        let values = naive(&SPACE, &graph, &nodes, &big(&inside));
        let tape = Tape::new(&graph, &symbols(&graph), &nodes).expect("symbols are inputs");
        for (node, found) in nodes.iter().zip(tape.eval_in(&Intervals, &boxed)) {
            let held = !found.is_defined() || holds(found, &values[node]);
            prop_assert!(held, "{found} lacks {} of {}", values[node], graph.render(*node, 200));
        }
    }

    /// Forward, reverse and central differences with hundreds of bits.
    #[test]
    fn jacobians_agree(recipe in recipe(STEPS), x in off_the_kinks()) {
        let graph = Graph::new();
        let nodes = follow(&recipe, &graph, Style::Tame);
        let (inputs, outputs) = (symbols(&graph), &nodes[STEPS - 4..]);
        let tape = Tape::new(&graph, &inputs, outputs).expect("symbols are inputs");
        let pattern = jacobian::pattern(&graph, outputs, &inputs);
        let mut reverse = vec![];
        for (row, &output) in outputs.iter().enumerate() {
            let column = |input: Node| inputs.iter().position(|i| *i == input).expect("an input");
            let slopes = jacobian::gradient(&graph, output, &inputs).into_iter();
            reverse.extend(slopes.map(|(input, slope)| (row, column(input), slope)));
        }
        for found in [jacobian::forward(&graph, outputs, &inputs).entries, reverse] {
            let entries: Vec<Node> = found.iter().map(|&(.., node)| node).collect();
            let values = Tape::new(&graph, &inputs, &entries).expect("symbols are inputs")
                .eval_in(&SPACE, &big(&x));
            let mut dense = vec![vec![0.0; INPUTS]; outputs.len()];
            for (&(row, column, _), value) in found.iter().zip(&values) {
                prop_assert!(pattern[row].contains(&column));
                dense[row][column] = to_f64(value);
            }
            prop_assume!((0..INPUTS).all(|column| is_continuous(&tape, &x, column)));
            let exact: Vec<Vec<f64>> =
                (0..INPUTS).map(|column| differences(&tape, &x, column)).collect();
            for (row, dense) in dense.iter().enumerate() {
                for (found, exact) in dense.iter().zip(&exact) {
                    let off = (found - exact[row]).abs() / exact[row].abs().max(1.0);
                    prop_assert!(off < 1e-10, "{found} for {}: {}",
                        exact[row], graph.render(outputs[row], 400));
                }
            }
        }
    }
}

/// The values a step of 2⁻¹⁰⁰ further along one input, or back.
fn beside(tape: &Tape, x: &[f64], column: usize, is_back: bool) -> Vec<BigFloat> {
    let step = SPACE.power_of_two(-100);
    let step = if is_back { step.neg() } else { step };
    let mut x = big(x);
    x[column] = SPACE.add(&x[column], &step);
    tape.eval_in(&SPACE, &x)
}

/// Whether the values do not jump between a point and both sides of it: sides of a comparison may be equal by algebra,
/// `a + b - a < b`, so that rounding decides anew at each point.
fn is_continuous(tape: &Tape, x: &[f64], column: usize) -> bool {
    let here = tape.eval_in(&SPACE, &big(x));
    [false, true].into_iter().all(|is_back| {
        let there = beside(tape, x, column, is_back);
        let mut both = here.iter().zip(&there);
        both.all(|(here, there)| to_f64(&SPACE.sub(here, there)).abs() <= 1e-15)
    })
}

fn differences(tape: &Tape, x: &[f64], column: usize) -> Vec<f64> {
    let double = SPACE.power_of_two(-99);
    let [up, down] = [false, true].map(|is_back| beside(tape, x, column, is_back));
    let pairs = up.into_iter().zip(down);
    pairs
        .map(|(up, down)| to_f64(&SPACE.div(&SPACE.sub(&up, &down), &double)))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Series along random graphs: over numbers against differences, over nodes against numbers.
    #[test]
    fn series_agree(recipe in recipe(12), places in prop::collection::vec(0.01..1.0, 23)) {
        let graph = Graph::new();
        let root = follow(&recipe, &graph, Style::Tame)[11];
        let tape = Tape::new(&graph, &symbols(&graph), &[root]).expect("symbols are inputs");
        let x = arguments_between(&[(-1.0, 1.0); INPUTS], &places);
        let found = jets(&Reals, &tape, &x, ORDER);
        let exact: Vec<f64> = reference(&tape, &x).iter().map(to_f64).collect();
        let size = exact.iter().map(|c| c.abs()).fold(1.0, f64::max);
        for (k, (found, exact)) in found.iter().zip(&exact).enumerate() {
            prop_assert!((found - exact).abs() < 1e-9 * size,
                "order {k}: {found} for {exact}: {}", graph.render(root, 400));
        }
        let names = Graph::new();
        let coefficients: Vec<Vec<Node>> = (0..INPUTS)
            .map(|i| (0..=ORDER).map(|k| names.symbol(&format!("x{i}.{k}")).node()).collect())
            .collect();
        let series = jets(&Nodes(&names), &tape, &coefficients, ORDER);
        let compiled = Tape::new(&names, &coefficients.concat(), &series).expect("symbols are inputs");
        let mut over_nodes = vec![0.0; series.len()];
        compiled.evaluator().eval(&x.concat(), &mut over_nodes);
        prop_assert_eq!(over_nodes, found);
    }
}
