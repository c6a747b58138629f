//! Algebraic loops with known solutions: h(z) = h(φ(x)) has the root z = φ(x), whose values,
//! derivatives and ranges are computed without any loop, and with many bits.

use crate::exact::{Exact, error, holds};
use astro_float_num::BigFloat;
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
    for &(i, j, node) in &exact.entries {
        let exact = known.tape(&[node]).eval_in(&SPACE, &big(&x)).remove(0);
        let reverse = jacobian::gradient(&known.graph, known.roots[i], &known.x);
        let reverse = reverse.iter().find(|(input, _)| *input == known.x[j]);
        for found in [roots.get(i, j), reverse.map(|(_, slope)| *slope)] {
            let node = found.expect("it is well-formed");
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
