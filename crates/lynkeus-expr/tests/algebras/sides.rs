//! Loops with conditions: ladders of diodes beside all combinations of their sides, and equations
//! on which Newton's method goes round in a circle.

use lynkeus_expr::{
    Expr, Graph, Implicit, ImplicitUnknown, Interval, Node, Reals, Tape, jacobian, lanes,
};
use proptest::prelude::*;

/// z with `g` = 0 as a function of x, searched from `start`; and its slopes.
fn solved<const N: usize>(
    start: [f64; N],
    g: impl for<'g> Fn([Expr<'g>; N], Expr<'g>) -> [Expr<'g>; N],
) -> (Tape, Tape) {
    let graph = Graph::new();
    let x = graph.symbol("x");
    let z: [Expr<'_>; N] = std::array::from_fn(|i| graph.symbol(&format!("z{i}")));
    let unknowns: Vec<ImplicitUnknown> = z
        .iter()
        .zip(start)
        .map(|(z, start)| ImplicitUnknown {
            symbol: z.node(),
            start,
            range: Interval::ENTIRE,
        })
        .collect();
    let residuals = g(z, x).map(|e| e.node());
    let roots = Implicit::solve(&graph, &unknowns, &residuals).expect("it is well-formed");
    let slopes = jacobian::forward(&graph, &roots, &[x.node()]);
    let slopes: Vec<Node> = slopes.entries.iter().map(|entry| entry.2).collect();
    let tape = |nodes: &[Node]| Tape::new(&graph, &[x.node()], nodes).expect("it is well-formed");
    (tape(&roots), tape(&slopes))
}

/// A x = b by elimination.
fn eliminated(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()));
        let pivot = pivot.expect("it is well-formed");
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in (0..n).filter(|&i| i != k) {
            let factor = a[i][k] / a[k][k];
            let top = a[k].clone();
            a[i].iter_mut()
                .zip(&top)
                .for_each(|(a, t)| *a -= factor * t);
            b[i] -= factor * b[k];
        }
    }
    (0..n).map(|i| b[i] / a[i][i]).collect()
}

/// Nodes in a row, with one resistor from each to the next, a diode from each to the ground, and
/// a current into each.
const NODES: usize = 4;
const OPEN: f64 = 1e-5;
const SHUT: f64 = 1e5;

/// The voltages: of all sides those on which they agree with themselves.
fn ladder(resistors: &[f64], currents: &[f64], turned: &[bool]) -> Vec<f64> {
    for sides in 0..1_usize << NODES {
        let conducts = |i: usize| sides >> i & 1 == 1;
        let mut a = vec![vec![0.0; NODES]; NODES];
        for i in 0..NODES {
            a[i][i] += if conducts(i) { SHUT } else { OPEN };
            if i + 1 < NODES {
                let g = 1.0 / resistors[i];
                a[i][i] += g;
                a[i + 1][i + 1] += g;
                a[i][i + 1] -= g;
                a[i + 1][i] -= g;
            }
        }
        let v = eliminated(a, currents.to_vec());
        if (0..NODES).all(|i| conducts(i) == ((v[i] > 0.0) != turned[i])) {
            return v;
        }
    }
    panic!("a ladder has voltages");
}

proptest! {
    #[test]
    fn ladders_of_diodes(
        resistors in prop::collection::vec(0.01..100.0_f64, NODES),
        currents in prop::collection::vec(-1.0..1.0_f64, NODES),
        turned in prop::collection::vec(any::<bool>(), NODES),
    ) {
        let (root, slopes) = solved([0.0; NODES], |v, x| {
            std::array::from_fn(|i| {
                let conducts = match turned[i] {
                    true => v[i].less(v[i].graph().constant(0.0)),
                    false => v[i].greater(v[i].graph().constant(0.0)),
                };
                let g = x.graph();
                let diode = conducts.select(g.constant(SHUT), g.constant(OPEN)) * v[i];
                let to = |j: usize, r: f64| (v[i] - v[j]) / r;
                let mut sum = diode - currents[i] * x;
                if i > 0 {
                    sum = sum + to(i - 1, resistors[i - 1]);
                }
                if i + 1 < NODES {
                    sum = sum + to(i + 1, resistors[i]);
                }
                sum
            })
        });
        let expected = ladder(&resistors, &currents, &turned);
        let found = root.eval_in(&Reals, &[1.0]);
        let slopes = slopes.eval_in(&Reals, &[1.0]);
        for i in 0..NODES {
            let off = |value: f64| (value - expected[i]).abs() / expected[i].abs().max(1e-12);
            // of one side it is linear in x
            prop_assert!(off(found[i]) < 1e-9, "{} for {}", found[i], expected[i]);
            prop_assert!(off(slopes[i]) < 1e-9, "{} for {}", slopes[i], expected[i]);
        }
        let lanes = root.eval_in(&lanes::Lanes::<2>, &[[1.0, -1.0]]);
        prop_assert!(found.iter().zip(&lanes).all(|(z, lane)| *z == lane[0]));
    }
}

/// min(z, Mz + 1) = 0 has the root 0, and Newton's method for it goes round in a circle of three
/// (I. Ben Gharbia and J. Ch. Gilbert, Math. Program. 134, 2012); moved along with x.
#[test]
fn a_circle_of_sides_is_left() {
    let (root, _) = solved([-2.0, 0.0, -2.0], |y, x| {
        let z = [y[0] - x, y[1] - 2.0 * x, y[2] + x];
        std::array::from_fn(|i| {
            let w = z[i] + 1.5 * z[(i + 2) % 3] + 1.0;
            z[i].less(w).select(z[i], w)
        })
    });
    for x in [0.0, 0.01, -0.25] {
        let found = root.eval_in(&Reals, &[x]);
        let expected = [x, 2.0 * x, -x];
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-15),
            "{found:?} at {x}"
        );
    }
}

/// A switch with hysteresis has two roots: which is found follows from the start, not from what
/// was found before.
#[test]
fn of_two_roots_one_follows_from_the_start() {
    for (start, side) in [(-1.0, -1.0), (1.0, 1.0)] {
        let (root, _) = solved([start], |[z], x| {
            let g = x.graph();
            [z - x
                - z.less(g.constant(0.0))
                    .select(g.constant(-1.0), g.constant(1.0))]
        });
        let at = |x: f64| root.eval_in(&Reals, &[x])[0];
        for x in [0.5, -0.5, 0.25] {
            assert_eq!(at(x), x + side);
        }
        assert_eq!((at(2.0), at(-2.0)), (3.0, -3.0));
    }
}
