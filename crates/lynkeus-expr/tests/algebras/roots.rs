//! Roots of single equations: where there is one, none, two; and from which starts it is found.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Expr, Graph, Implicit, ImplicitUnknown, Interval, Node, Reals, Tape};

use proptest::prelude::*;

/// g of one unknown z and one symbol x.
fn single(
    start: f64,
    range: (f64, f64),
    g: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>,
) -> Tape {
    let graph = Graph::new();
    let (z, x) = (graph.symbol("z"), graph.symbol("x"));
    let range = Interval::new(range.0, range.1).expect("it is well-formed");
    let unknown = ImplicitUnknown {
        symbol: z.node(),
        start,
        range,
    };
    let root = Implicit::solve(&graph, &[unknown], &[g(z, x).node()]).expect("it is well-formed");
    Tape::new(&graph, &[x.node()], &root).expect("it is well-formed")
}

fn bounds(tape: &Tape, lo: f64, hi: f64) -> Interval {
    tape.eval_in(
        &Intervals,
        &[Interval::new(lo, hi).expect("it is well-formed")],
    )[0]
}

const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

#[test]
fn where_there_is_no_root_nothing_is_proved() {
    let root = single(1.0, (0.0, 10.0), |z, x| z * z - x);
    assert!(bounds(&root, -2.0, -1.0).is_empty());
    assert!(!bounds(&root, -1.0, 1.0).is_defined());
    assert!(
        !bounds(&root, 50.0, 150.0).is_defined(),
        "beyond the declared range"
    );
    assert!(
        root.eval_in(&Reals, &[-1.0])[0].is_nan() && root.eval_in(&Reals, &[150.0])[0].is_nan()
    );
    let found = bounds(&root, 1.0, 4.0);
    assert!(
        found.is_defined() && found.contains(1.0) && found.contains(2.0),
        "{found}"
    );
    assert!(found.width() < 1.2, "{found}");
    let logarithm = single(0.0, ALL, |z, x| z.exp() - x);
    assert!(!bounds(&logarithm, -1.0, 1.0).is_defined());
    assert!(
        bounds(&logarithm, -2.0, -1.0).is_empty() || !bounds(&logarithm, -2.0, -1.0).is_defined()
    );
    assert!(logarithm.eval_in(&Reals, &[-1.0])[0].is_nan());
    let sine = single(0.0, (-1.5, 1.5), |z, x| z.sin() - x);
    assert!(bounds(&sine, 1.5, 2.0).is_empty() && !bounds(&sine, 0.5, 1.5).is_defined());
}

#[test]
fn two_roots_are_no_value() {
    let root = single(1.0, (-10.0, 10.0), |z, x| z * z - x);
    let found = bounds(&root, 1.0, 4.0);
    assert!(!found.is_defined() && found.contains(1.0) && found.contains(-1.0));
}

#[test]
fn a_jump_in_the_loop_is_not_overlooked() {
    let jumps = single(0.0, (-10.0, 10.0), |z, x| z + z.sign() - x);
    // z + sign(z) = x has no root for 0 < |x| < 1
    assert!(!bounds(&jumps, -0.5, 0.5).is_defined());
    assert!(bounds(&jumps, 2.0, 3.0).is_defined());
    let kink = single(0.0, (-10.0, 10.0), |z, x| z + 0.5 * z.abs() - x);
    let found = bounds(&kink, -1.0, 1.0);
    assert!(
        found.is_defined() && found.contains(-2.0) && found.contains(2.0 / 3.0),
        "{found}"
    );
}

/// Where g jumps over zero there is no root, wherever the jump is.
#[test]
fn a_jump_over_zero_is_no_root() {
    for place in [0.0, 1.5, -7.25e3] {
        let jump = single(0.3, (-1e4, 1e4), |z, x| {
            let step = (z - place).greater(z.graph().constant(0.0));
            z - place + step.select(x, -x)
        });
        let root = |x: f64| jump.eval_in(&Reals, &[x])[0];
        assert!(((root(-2.0) - place).abs() - 2.0).abs() < 1e-9, "{place}");
        assert_eq!(root(0.0), place);
        assert!(root(3.0).is_nan(), "{place}: {}", root(3.0));
        let floor = single(place + 0.3, (-1e4, 1e4), |z, x| (z - place).floor() - x);
        assert!(floor.eval_in(&Reals, &[0.5])[0].is_nan(), "{place}");
        assert_eq!((floor.eval_in(&Reals, &[0.0])[0] - place).floor(), 0.0);
    }
}

#[test]
fn an_unbounded_range_is_no_obstacle_where_the_slope_has_one_sign() {
    let root = single(0.0, ALL, |z, x| z + z.exp() - x);
    let found = bounds(&root, -5.0, 5.0);
    assert!(found.is_defined(), "{found}");
    for x in [-5.0, -1.0, 3.0, 5.0] {
        assert!(found.contains(root.eval_in(&Reals, &[x])[0]));
    }
    assert!(found.width() < 7.0, "{found}");
}

/// Starts from which Newton's method alone diverges.
#[test]
fn far_and_flat_starts() {
    let arctangent = single(8.0, ALL, |z, x| z.atan() - x);
    assert!((arctangent.eval_in(&Reals, &[0.5])[0] - 0.5_f64.tan()).abs() < 1e-15);
    let root = single(30.0, ALL, |z, x| (-z).exp() - x);
    assert!((root.eval_in(&Reals, &[2.0])[0] + 2f64.ln()).abs() < 1e-15);
    let flat = single(0.0, ALL, |z, x| z.powi(3) - x);
    assert!((flat.eval_in(&Reals, &[8.0])[0] - 2.0).abs() < 1e-15);
    assert_eq!(flat.eval_in(&Reals, &[0.0])[0], 0.0);
    let tiny = single(0.0, ALL, |z, x| 1e-20 * z - 1e-30 * x);
    assert!((tiny.eval_in(&Reals, &[3.0])[0] / 3e-10 - 1.0).abs() < 1e-15);
}

proptest! {
    /// z³ − a z = x: proved only where three real roots are none, and then the root is held.
    #[test]
    fn cubics_are_proved_where_they_have_one_root(
        a in -3.0..3.0_f64, x in -4.0..4.0_f64, radius in 0.0..1.0_f64, range in 0.5..4.0_f64, place in -1.0..1.0,
    ) {
        let root = single(0.3, (-range, range), move |z, x| z.powi(3) - a * z - x);
        let found = bounds(&root, x - radius, x + radius);
        prop_assume!(found.is_defined());
        let x: f64 = x + place * radius;
        let g = |z: f64| z.powi(3) - a * z - x;
        let count = (0..4000)
            .map(|k| -range + f64::from(k) * range / 2000.0)
            .filter(|&z| g(z) * g(z + range / 2000.0) <= 0.0)
            .count();
        prop_assert_eq!(count, 1);
        let z = root.eval_in(&Reals, &[x])[0];
        prop_assert!(found.contains(z), "{} lacks {}", found, z);
    }
}

#[test]
fn a_failure_says_where_the_search_ended() {
    let graph = Graph::new();
    let (z, x) = (graph.symbol("z"), graph.symbol("x"));
    let unknown = ImplicitUnknown {
        symbol: z.node(),
        start: 1.0,
        range: Interval::ENTIRE,
    };
    let root = Implicit::solve(&graph, &[unknown], &[(z * z + 1.0 - x).node()])
        .expect("it is well-formed")[0];
    assert_eq!(graph.render(root, 80), "root(z: z*z + 1 - x = 0)");
    let tape = Tape::new(&graph, &[x.node()], &[(2.0 * graph.expr(root)).node()])
        .expect("it is well-formed");
    let told = tape
        .first_nonfinite(&graph, &[0.0])
        .expect("it is well-formed");
    assert!(
        told.starts_with("root(z: z*z + 1 - x = 0) is NaN: Newton's method from z = 1"),
        "{told}"
    );
    assert_eq!(tape.first_nonfinite(&graph, &[5.0]), None);
}

/// Copies, substitutions and loops within loops.
#[test]
fn loops_are_rebuilt_over_other_arguments() {
    let graph = Graph::new();
    let [x, u, v] = ["x", "u", "v"].map(|name| graph.symbol(name));
    let unknown = |symbol: Expr<'_>| ImplicitUnknown {
        symbol: symbol.node(),
        start: 0.0,
        range: Interval::ENTIRE,
    };
    let inner = Implicit::solve(&graph, &[unknown(u)], &[(u + u.exp() - v * x).node()])
        .expect("it is well-formed")[0];
    let outer = Implicit::solve(
        &graph,
        &[unknown(v)],
        &[(v + 0.1 * graph.expr(inner) - x).node()],
    )
    .expect("it is well-formed")[0];
    let twice = graph.substitute(&[outer], &[(x.node(), (x * 2.0).node())].into())[0];
    let value = |graph: &Graph, x: Node, node: Node, at: f64| {
        Tape::new(graph, &[x], &[node])
            .expect("it is well-formed")
            .eval_in(&Reals, &[at])[0]
    };
    let (found, expected) = (
        value(&graph, x.node(), twice, 0.7),
        value(&graph, x.node(), outer, 1.4),
    );
    assert_eq!(found, expected);
    // the loop within is seen as well where another one was made after it
    let alone = graph.with_residuals(&[outer]);
    let late = Implicit::solve(&graph, &[unknown(u)], &[(u + u.exp() - x).node()])
        .expect("it is well-formed")[0];
    let both = graph.with_residuals(&[outer, late]);
    assert!(alone.len() == 3 && both.len() == 5);
    assert!(alone.iter().all(|node| both.contains(node)));
    let copy = Graph::new();
    let image = copy.copied(&graph, &[outer, x.node()]);
    assert_eq!(value(&copy, image[&x.node()], image[&outer], 1.4), expected);
    // v + 0.1 u = 1.4 with u + exp(u) = 1.4 v
    let v = expected;
    let u = (1.4 - v) / 0.1;
    assert!((u + u.exp() - 1.4 * v).abs() < 1e-12);
    let bound = Tape::new(&graph, &[x.node()], &[outer]).expect("it is well-formed");
    let bound = bounds(&bound, 1.3, 1.5);
    assert!(bound.contains(expected), "{bound}");
}
