//! Random linear loops A(x) z = A(x) φ(x) with whole numbers throughout: the text has the products
//! multiplied out, the roots are the polynomials φ, and their Taylor coefficients are exact.

use std::fmt::Write;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Interval, Jets, Node, Op, Reals, Tape};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

use crate::support::{plant, slopes};

const ORDER: usize = 5;

/// Coefficients of a polynomial in x, the constant first.
type Polynomial = Vec<i64>;

struct Loop {
    /// A = A₀ + A₁x, row by row
    matrix: Vec<Vec<Polynomial>>,
    roots: Vec<Polynomial>,
}

impl Loop {
    /// Diagonals that outweigh their rows for |x| ≤ 2.
    fn new(n: usize, numbers: &[i64]) -> Self {
        let mut next = numbers.iter().copied().cycle();
        let mut take = || next.next().expect("there are numbers");
        let matrix = (0..n).map(|i| {
            let row = (0..n).map(|j| match i == j {
                true => vec![9 * n as i64 + 9, take()],
                false => vec![take(), take()],
            });
            row.collect()
        });
        let matrix = matrix.collect();
        let roots = (0..n).map(|_| (0..=ORDER).map(|_| take()).collect());
        Self {
            matrix,
            roots: roots.collect(),
        }
    }

    fn text(&self) -> String {
        let n = self.roots.len();
        let mut text = format!("model L Real x; Real z[{n}]; equation der(x) = z[1];\n");
        for row in &self.matrix {
            let mut right = [0; ORDER + 2];
            for (j, entry) in row.iter().enumerate() {
                write!(text, "+ ({} + ({})*x)*z[{}]", entry[0], entry[1], j + 1).unwrap();
                for (k, a) in entry.iter().enumerate() {
                    for (l, r) in self.roots[j].iter().enumerate() {
                        right[k + l] += a * r;
                    }
                }
            }
            text += " = 0";
            for (k, coefficient) in right.iter().enumerate() {
                write!(text, " + ({coefficient})*x^{k}").unwrap();
            }
            text += ";\n";
        }
        text + "end L;"
    }
}

/// Σ c_k (at + t)^k in powers of t. Exact for `at` in eighths: every product has less than 53 bits.
fn expanded(polynomial: &Polynomial, at: f64) -> Vec<f64> {
    let mut shifted = vec![0.0; ORDER + 1];
    for &c in polynomial.iter().rev() {
        for k in (0..=ORDER).rev() {
            let lower = if k == 0 { c as f64 } else { shifted[k - 1] };
            shifted[k] = shifted[k] * at + lower;
        }
    }
    shifted
}

#[test]
fn two_hundred_random_loops() {
    let config = Config {
        cases: 200,
        rng_seed: RngSeed::Fixed(12),
        failure_persistence: None,
        ..Config::default()
    };
    let case = (
        2..6_usize,
        prop::collection::vec(-3..=3_i64, 101),
        -16..=16_i32,
    );
    TestRunner::new(config)
        .run(&case, |(n, numbers, eighths)| {
            examine(&Loop::new(n, &numbers), f64::from(eighths) / 8.0);
            Ok(())
        })
        .unwrap();
}

fn examine(known: &Loop, at: f64) {
    let plant = plant(&known.text());
    let roots: Vec<Node> = plant.algebraics.iter().map(|z| z.node).collect();
    let is_system = |&node: &Node| matches!(plant.graph.op(node), Op::System(_));
    let nodes = plant.graph.reachable(&roots);
    assert!(nodes.iter().any(is_system), "no linear system");
    let tape = Tape::new(&plant.graph, &[plant.states[0].node], &roots).unwrap();
    let order = ORDER;
    let numbers = Jets {
        inner: &Reals,
        order,
    };
    let enclosures = Jets {
        inner: &Intervals,
        order,
    };
    let found = tape.eval_in(&numbers, &[vec![at, 1.0]]);
    let bounds = tape.eval_in(&enclosures, &[vec![Interval::point(at), Interval::ONE]]);
    for (i, root) in known.roots.iter().enumerate() {
        for (k, exact) in expanded(root, at).into_iter().enumerate() {
            // what the arguments of the loop are made of is as large as this
            let size = 1e3_f64.max(exact.abs());
            let (value, bound) = (found[i][k], bounds[i][k]);
            assert!(
                (value - exact).abs() < 1e-12 * size,
                "{k}: {value} for {exact}"
            );
            assert!(bound.is_defined() && bound.contains(exact), "{k}: {bound}");
            assert!(bound.width() < 1e-8 * size, "{k}: {bound}");
        }
    }
    ranges(known, &tape, at);
}

/// On a box the enclosure is defined and holds the exact roots of members.
fn ranges(known: &Loop, tape: &Tape, at: f64) {
    for radius in [1.0 / 1024.0, 1.0 / 64.0] {
        let cell = [Interval::point(at).inflate(radius)];
        let bounds = tape.eval_in(&Intervals, &cell);
        for member in [at - radius, at, at + radius] {
            for (root, bound) in known.roots.iter().zip(&bounds) {
                let exact = root
                    .iter()
                    .rev()
                    .fold(0.0, |sum, &c| sum * member + c as f64);
                let close = bound.inflate(1e-12 * exact.abs().max(1.0));
                assert!(
                    bound.is_defined() && close.contains(exact),
                    "{bound} lacks {exact}"
                );
                assert!(bound.width() < 1e4 * radius, "{bound} for {radius}");
            }
        }
    }
}

/// What stands in a branch counts where the branch is taken, and has a value only there.
#[test]
fn branches_that_are_not_taken_have_no_influence() {
    let text = |a: &str, b: &str| {
        format!(
            "model M Real x; Real v; Real i; equation der(x) = i; v + i = 6;
             v = if x > 0 then {a} elseif x > -4 then {b} else 2*i; end M;"
        )
    };
    // v = r i + e and v + i = 6: i = (6 - e)/(r + 1)
    let exact = |r: f64, e: f64| (6.0 - e) / (r + 1.0);
    for (a, b) in [
        ("2*i + sqrt(x)", "i + log(-x)"),
        ("i*2*sqrt(x)/sqrt(x) + sqrt(x)", "(i/log(-x) + 1)*log(-x)"),
        ("3*i - (i - sqrt(x))", "-(-i - log(-x))"),
        (
            "(if x > 1 then sqrt(x - 1) + i else i) + i + sqrt(x) - (if x > 1 then sqrt(x - 1) else 0)",
            "v + i - v + log(-x)",
        ),
    ] {
        let plant = plant(&text(a, b));
        for (x, expected) in [
            (4.0, exact(2.0, 2.0)),
            (0.25, exact(2.0, 0.5)),
            (-2.0, exact(1.0, 2f64.ln())),
            (-5.0, exact(2.0, 0.0)),
        ] {
            let found = slopes(&plant, &[("x", x)])[0];
            assert!(
                (found - expected).abs() < 1e-13,
                "{a}; {b} at {x}: {found}, {expected}"
            );
        }
    }
}
