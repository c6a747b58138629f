use super::*;
use crate::Tape;

/// A chain has one derivative for each operation and each of the few inputs below it; a sum
/// of all of them has all.
#[test]
fn the_size_counts_what_each_operation_depends_on() {
    let g = Graph::new();
    let x: Vec<_> = (0..5).map(|i| g.symbol(&format!("x{i}"))).collect();
    let inputs: Vec<Node> = x.iter().map(|x| x.node()).collect();
    let chain: Vec<Node> = x.windows(2).map(|w| (w[0] * w[1]).sin().node()).collect();
    // four products and four sines of two inputs each
    assert_eq!(size(&g, &chain, &inputs, 100), Some(16));
    assert_eq!(size(&g, &chain, &inputs, 15), None);
    let sum = x.iter().copied().reduce(|a, b| a + b).unwrap();
    assert_eq!(size(&g, &[sum.node()], &inputs, 100), Some(2 + 3 + 4 + 5));
    let parameter = g.symbol("p").exp().node();
    assert_eq!(size(&g, &[parameter, inputs[0]], &inputs, 0), Some(0));
}

/// Products of both with the same direction, at a point where each choice is off its edge.
#[test]
fn a_derivative_along_a_direction_is_the_jacobian_times_it() {
    let g = Graph::new();
    let symbols = |stem: char| [0, 1, 2].map(|i| g.symbol(&format!("{stem}{i}")));
    let ([a, b, c], direction) = (symbols('x'), symbols('v'));
    let system = [a + 3.0, b, c, a * b].map(|e| e.node());
    let solution = g.solve(&system, &[(a * c).node(), b.node()]);
    let chosen = g.select(a.less(b).node(), (a * b).node(), c.sin().node());
    let outputs = [
        solution.x[1],
        chosen,
        (a / b + c.powi(3)).node(),
        g.constant(2.0).node(),
        b.node(),
    ];
    let inputs = [a, b, c].map(|e| e.node());
    let direction = direction.map(|e| e.node());
    let all = [inputs, direction].concat();
    let at = [0.3, 0.8, -0.5, 0.7, -0.2, 1.1];
    let value = |outputs: &[Node]| {
        let tape = Tape::new(&g, &all, outputs).unwrap();
        let mut found = vec![0.0; outputs.len()];
        tape.evaluator().eval(&at, &mut found);
        found
    };
    let jacobian = forward(&g, &outputs, &inputs);
    let entries: Vec<Node> = jacobian.entries.iter().map(|(.., node)| *node).collect();
    let mut expected = [0.0; 5];
    for ((row, column, _), slope) in jacobian.entries.iter().zip(value(&entries)) {
        expected[*row] += slope * at[3 + column];
    }
    let found = value(&along(&g, &outputs, &inputs, &direction));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
    assert_eq!((found[3], found[4]), (0.0, -0.2));
}

/// Slopes that are infinite at 0, along directions that leave 0 alone, or leave the branch alone that
/// is taken; and what has no derivative there is given none.
#[test]
fn what_a_direction_leaves_alone_has_no_say() {
    let g = Graph::new();
    let [a, b, c, u, v, w] = ["a", "b", "c", "u", "v", "w"].map(|name| g.symbol(name));
    let inputs = [a, b, c].map(|e| e.node());
    let direction = [u, v, w].map(|e| e.node());
    let all = [inputs, direction].concat();
    let at = |output: Node, at: [f64; 3], along_: [f64; 3]| {
        let tape = Tape::new(&g, &all, &along(&g, &[output], &inputs, &direction)).unwrap();
        let mut found = [0.0];
        tape.evaluator().eval(&[at, along_].concat(), &mut found);
        found[0]
    };
    let (first, second) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let (zero, sure) = ([0.0, 3.0, 0.0], [0.0, 3.0, 4.0]);
    let drained = b * b - a.sqrt() + c;
    assert_eq!(at(drained.node(), zero, second), 6.0);
    assert_eq!(at(drained.node(), zero, first), f64::NEG_INFINITY);
    assert_eq!(at(drained.node(), zero, [0.0, 0.5, 2.0]), 5.0);
    // of two tanks on a level both have a say
    let between = (a - c).sqrt() * b;
    assert_eq!(at(between.node(), [0.0; 3], second), 0.0);
    assert!(!at(between.node(), zero, first).is_finite());
    assert!(!at(between.node(), zero, [0.0, 0.0, 1.0]).is_finite());
    // the branch that is not taken has none
    let limited = a.max(g.constant(0.0)).sqrt() + b;
    assert_eq!(at(limited.node(), [-1.0, 3.0, 4.0], [1.0, 1.0, 0.0]), 1.0);
    let chosen = g
        .expr(g.select(b.less(c).node(), c.node(), a.node()))
        .sqrt();
    assert_eq!(at(chosen.node(), sure, first), 0.0);
    assert_eq!(at(chosen.node(), sure, [1.0, 1.0, 1.0]), 0.25);
    // neighbours of the root
    for steep in [
        a.ln().exp(),
        (1.0 - a).asin(),
        (1.0 - a).acos(),
        a.pow(g.constant(0.3)),
        a.powi(-2).atan(),
        (c / a).atan(),
        a.atan2(c - 4.0),
    ] {
        assert_eq!(at((steep + b).node(), sure, second), 1.0);
        assert!(!at(steep.node(), sure, first).is_finite());
    }
    // and through a linear system
    let solution = g.solve(
        &[b, a.sqrt(), c, b].map(|e| e.node()),
        &[inputs[1], inputs[2]],
    );
    assert_eq!(at(solution.x[0], [0.0, 3.0, 0.0], second), 0.0);
    // x² is still at 0 to the first order only: its root has a corner
    assert!(at(a.powi(2).sqrt().node(), zero, first).is_nan());
    assert_eq!(at(a.powi(2).sqrt().node(), zero, second), 0.0);
}

/// Where a root is divided by what moves with it, one question is asked for both.
#[test]
fn guards_on_the_same_condition_are_one() {
    let g = Graph::new();
    let [a, b, u, v] = ["a", "b", "u", "v"].map(|name| g.symbol(name));
    let sum = a + b;
    let output = (sum.sqrt() / (1.0 + sum.powi(2))).ln().node();
    let [slope] = along(
        &g,
        &[output],
        &[a, b].map(|e| e.node()),
        &[u, v].map(|e| e.node()),
    )[..] else {
        panic!("one output, one slope");
    };
    let choices = g.reachable(&[slope]);
    let choices = choices
        .iter()
        .filter(|&&node| matches!(g.op(node), Op::Select(..)));
    assert_eq!(choices.count(), 1);
    let tape = Tape::new(&g, &[a, b, u, v].map(|e| e.node()), &[slope]).unwrap();
    let at = |point: [f64; 4]| {
        let mut found = [0.0];
        tape.evaluator().eval(&point, &mut found);
        found[0]
    };
    // ln √s - ln(1 + s²): 1/(2s) - 2s/(1 + s²)
    let s = 0.7;
    let expected = 1.5 * (0.5 / s - 2.0 * s / (1.0 + s * s));
    assert!((at([0.3, 0.4, 1.0, 0.5]) - expected).abs() < 1e-14);
    assert_eq!(at([0.0; 4]), 0.0);
    assert!(!at([0.0, 0.0, 1.0, 0.0]).is_finite());
}
