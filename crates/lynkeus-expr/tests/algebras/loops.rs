//! Algebraic loops with known solutions: h(z) = h(φ(x)) has the root z = φ(x), whose values,
//! derivatives and ranges are computed without any loop, and with many bits.

use crate::exact::{Exact, error, holds};
use astro_float::BigFloat;
use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{
    Algebra, Expr, Graph, Implicit, ImplicitUnknown, Interval, Jets, Node, Nodes, Reals, Tape,
    jacobian,
};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

const SPACE: Exact = Exact(320);
/// Derivatives compared.
const ORDER: usize = 5;
/// Numbers that make one loop.
const NUMBERS: usize = 40;

/// A loop in n unknowns and two symbols x, with what its roots are.
struct Known {
    graph: Graph,
    x: [Node; 2],
    roots: Vec<Node>,
    exact: Vec<Node>,
}

impl Known {
    /// h_i(z) = d·z_i + Σ_j c_ij f_ij(z_j) with d large enough that there is one root.
    fn new(n: usize, linear: bool, numbers: &[f64]) -> Self {
        let graph = Graph::new();
        let x = ["x", "y"].map(|name| graph.symbol(name).node());
        let mut next = numbers.iter().copied().cycle();
        let exact: Vec<Node> = (0..n)
            .map(|_| {
                let [a, b, c] = [(); 3].map(|()| next.next().expect("it is well-formed"));
                let (x, y) = (graph.expr(x[0]), graph.expr(x[1]));
                (a + (b * x + y).sin() + c * x * y / (2.0 + x * x)).node()
            })
            .collect();
        let shapes: Vec<(f64, usize)> = (0..n * n)
            .map(|k| {
                let c = next.next().expect("it is well-formed");
                let shape = if linear {
                    0
                } else {
                    k + (7.0 * c.abs()) as usize
                };
                (c, shape % 6)
            })
            .collect();
        let symbols: Vec<Node> = (0..n)
            .map(|i| graph.fresh(format!("z{i}")).node())
            .collect();
        let h = |z: &[Node]| -> Vec<Node> {
            let z = |j: usize| graph.expr(z[j]);
            let row = |i: usize| {
                (0..n).fold(4.0 * n as f64 * z(i), |sum, j| {
                    let (c, shape) = shapes[i * n + j];
                    sum + c * bent(z(j), shape)
                })
            };
            (0..n).map(|i| row(i).node()).collect()
        };
        let minus = |(l, r): (&Node, &Node)| (graph.expr(*l) - graph.expr(*r)).node();
        let residuals: Vec<Node> = h(&symbols).iter().zip(&h(&exact)).map(minus).collect();
        let unknowns: Vec<ImplicitUnknown> = symbols
            .iter()
            .map(|&symbol| ImplicitUnknown {
                symbol,
                start: 0.0,
                range: Interval::new(-6.0, 6.0).expect("it is well-formed"),
            })
            .collect();
        let roots = Implicit::solve(&graph, &unknowns, &residuals).expect("it is well-formed");
        Self {
            graph,
            x,
            roots,
            exact,
        }
    }

    fn tape(&self, outputs: &[Node]) -> Tape {
        Tape::new(&self.graph, &self.x, outputs).expect("it is well-formed")
    }
}

fn bent(z: Expr<'_>, shape: usize) -> Expr<'_> {
    match shape {
        0 => z,
        1 => z.sin(),
        2 => z.tanh(),
        3 => (0.2 * z).exp(),
        4 => z.powi(3) * 0.03,
        _ => z.atan(),
    }
}

fn big(x: &[f64]) -> Vec<BigFloat> {
    x.iter().map(|&x| SPACE.constant(x)).collect()
}

fn values(known: &Known, x: [f64; 2]) {
    let exact = known.tape(&known.exact).eval_in(&SPACE, &big(&x));
    let roots = known.tape(&known.roots).eval_in(&Reals, &x);
    for (root, exact) in roots.iter().zip(&exact) {
        assert!(error(*root, exact, 0.1) < 1e-14, "{root} for {exact}");
    }
}

/// Coefficients along x(t) = x + t, y(t) = y − 2t + t²: over numbers, over nodes, enclosed.
fn series(known: &Known, x: [f64; 2]) {
    let path = [vec![x[0], 1.0], vec![x[1], -2.0, 1.0]];
    let of = |numbers: &[f64]| big(numbers);
    let exact_jets = Jets {
        inner: &SPACE,
        order: ORDER,
    };
    let exact = known
        .tape(&known.exact)
        .eval_in(&exact_jets, &[of(&path[0]), of(&path[1])]);
    let tape = known.tape(&known.roots);
    let real = tape.eval_in(
        &Jets {
            inner: &Reals,
            order: ORDER,
        },
        &path,
    );
    let enclosed = tape.eval_in(
        &Jets {
            inner: &Intervals,
            order: ORDER,
        },
        &path
            .each_ref()
            .map(|jet| jet.iter().map(|&x| Interval::point(x)).collect()),
    );
    let nodes = Nodes(&known.graph);
    let constant = |x: f64| nodes.constant(x);
    let symbolic = tape.eval_in(
        &Jets {
            inner: &nodes,
            order: ORDER,
        },
        &[
            vec![known.x[0], constant(1.0)],
            vec![known.x[1], constant(-2.0), constant(1.0)],
        ],
    );
    for (i, exact) in exact.iter().enumerate() {
        let spelled = known.tape(&symbolic[i]).eval_in(&Reals, &x);
        for (k, exact) in exact.iter().enumerate().take(ORDER + 1) {
            for found in [real[i][k], spelled[k]] {
                let off = error(found, exact, 1.0);
                assert!(off < 1e-12, "coefficient {k}: {found}, off by {off:e}");
            }
            let bound = enclosed[i][k];
            assert!(
                bound.is_defined() && holds(bound, exact),
                "{bound} lacks {exact}"
            );
            assert!(
                bound.width() < 1e-9,
                "coefficient {k} is {} wide",
                bound.width()
            );
        }
    }
}

fn jacobians(known: &Known, x: [f64; 2]) {
    let [roots, exact] =
        [&known.roots, &known.exact].map(|nodes| jacobian::forward(&known.graph, nodes, &known.x));
    let reverse = jacobian::reverse(&known.graph, &known.roots, &known.x);
    for &(i, j, node) in &exact.entries {
        let exact = known.tape(&[node]).eval_in(&SPACE, &big(&x)).remove(0);
        for found in [&roots, &reverse] {
            let node = found.get(i, j).expect("it is well-formed");
            let value = known.tape(&[node]).eval_in(&Reals, &x)[0];
            assert!(error(value, &exact, 0.1) < 1e-12, "{value} for {exact}");
        }
    }
}

/// On a box the enclosure is defined and holds the exact roots of members.
fn ranges(known: &Known, x: [f64; 2], places: &[f64]) {
    for radius in [1e-6, 1e-2, 0.3] {
        let cell = x.map(|x| Interval::point(x).inflate(radius));
        let found = known.tape(&known.roots).eval_in(&Intervals, &cell);
        let exact = known.tape(&known.exact);
        for pair in places.chunks_exact(2) {
            let member: Vec<f64> = cell
                .iter()
                .zip(pair)
                .map(|(x, p)| (x.lo() + p.abs() * x.width()).clamp(x.lo(), x.hi()))
                .collect();
            for (found, exact) in found.iter().zip(exact.eval_in(&SPACE, &big(&member))) {
                assert!(holds(*found, &exact), "{found} lacks {exact}");
            }
        }
        for found in found {
            assert!(
                found.is_defined(),
                "{found} is not proved for radius {radius}"
            );
            assert!(found.width() < 40.0 * radius, "{found} for radius {radius}");
        }
    }
}

#[test]
fn two_hundred_random_loops() {
    let config = Config {
        cases: 200,
        rng_seed: RngSeed::Fixed(12),
        failure_persistence: None,
        ..Config::default()
    };
    let numbers = prop::collection::vec(-1.0..1.0, NUMBERS);
    let case = (
        1_usize..=5,
        any::<bool>(),
        numbers,
        prop::array::uniform2(-1.5..1.5),
    );
    TestRunner::new(config)
        .run(&case, |(n, linear, numbers, x)| {
            let known = Known::new(n, linear, &numbers);
            values(&known, x);
            series(&known, x);
            jacobians(&known, x);
            ranges(&known, x, &numbers[..8]);
            Ok(())
        })
        .expect("it is well-formed");
}

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
