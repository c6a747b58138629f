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
