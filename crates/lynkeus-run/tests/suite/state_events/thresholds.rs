//! What rests on a surface, surfaces that move with others, and what looking for them costs.

use lynkeus_expr::{Binary, Expr, Graph};
use lynkeus_run::{Dynamics, Evaluation, Events, Integrator, Method, System};

use super::{close, methods, run};

/// What rests exactly on a surface has the values of equality, interval after interval: `u >= 0`
/// holds at u = 0, `u > 0` does not and sign(0) is 0.
#[test]
fn at_a_threshold_relations_are_what_they_say() {
    for method in methods() {
        let start = [("u", 0.0), ("a", 0.0), ("b", 0.0), ("c", 0.0)];
        let rows = run(method, &start, &[1.0, 2.0, 3.0], |_, x| {
            let (u, one) = (x[0], x[0].graph().constant(1.0));
            let zero = u.graph().constant(0.0);
            let at_least = zero.less_eq(u).select(one, -one);
            let above = zero.less(u).select(one, -one);
            vec![zero, at_least, above, u.sign() + u.abs()]
        });
        for (row, t) in rows.iter().zip([1.0, 2.0, 3.0]) {
            for (found, expected) in row[1..].iter().zip([t, -t, 0.0]) {
                close(*found, expected);
            }
        }
    }
}

/// From rest on a surface: u = t²/2 leaves it at once, u = max(t − 1, 0) at t = 1, and
/// u' = y⁴ with y' = max(t − 1, 0) then too; z' = sign(u).
#[test]
fn what_rests_on_a_surface_leaves_it_in_time() {
    for method in methods() {
        let rows = run(
            method,
            &[("v", 0.0), ("u", 0.0), ("z", 0.0)],
            &[2.0],
            |_, x| vec![x[0].graph().constant(1.0), x[0], x[1].sign()],
        );
        close(rows[0][2], 2.0);
        let late = |t: Expr<'_>| {
            let g = t.graph();
            g.expr(g.binary(Binary::Max, (t - 1.0).node(), g.constant(0.0).node()))
                .node()
        };
        let rows = run(method, &[("u", 0.0), ("z", 0.0)], &[3.0], |t, x| {
            vec![t.graph().expr(late(t)), x[0].sign()]
        });
        close(rows[0][0], 2.0);
        close(rows[0][1], 2.0);
    }
}

/// z' = sign(x − r) where r is 5 or 1 by the sign of y: from the start on the right side, and on the
/// other one as soon as y has changed.
#[test]
fn a_threshold_that_jumps_with_another_one() {
    fn threshold<'g>(x: Expr<'g>, y: Expr<'g>) -> Expr<'g> {
        let [five, one, zero] = [5.0, 1.0, 0.0].map(|c| x.graph().constant(c));
        (x - zero.less(y).select(five, one)).sign()
    }
    for method in methods() {
        let start = [("x", 4.0), ("y", -3.0), ("z", 0.0)];
        let rows = run(method, &start, &[4.0], |_, x| {
            let one = x[0].graph().constant(1.0);
            vec![-one, 0.0 * one, threshold(x[0], x[1])]
        });
        close(rows[0][2], 3.0 - 1.0);
        let start = [("x", 2.0), ("y", 1.5), ("z", 0.0)];
        let rows = run(method, &start, &[3.0], |_, x| {
            let one = x[0].graph().constant(1.0);
            vec![-0.1 * one, -one, threshold(x[0], x[1])]
        });
        close(rows[0][2], 0.0);
        // along x = 5 until y changes, then down to 1
        let start = [("x", 4.0), ("y", 1.5)];
        let rows = run(method, &start, &[1.4, 2.5, 9.0], |_, x| {
            let one = x[0].graph().constant(1.0);
            vec![-2.0 * threshold(x[0], x[1]), -one]
        });
        for (row, expected) in rows.iter().zip([5.0, 3.0, 1.0]) {
            close(row[0], expected);
        }
    }
}

/// z' = sign(x/2 + 0.3 − r) where r jumps by 0.6 at x = 0, and x' = −1.5(x + z'): from ½ down to 0, and along it,
/// where only the threshold of what pushes back jumps.
#[test]
fn sliding_where_a_threshold_jumps() {
    for method in methods() {
        let rows = run(method, &[("x", 0.5), ("z", 0.0)], &[1.0, 3.0], |_, x| {
            let [zero, jump] = [0.0, 0.6].map(|c| x[0].graph().constant(c));
            let r = zero.less_eq(x[0]).select(zero, jump);
            let push = (x[0] * 0.5 + 0.3 - r).sign();
            vec![(x[0] + push) * -1.5, push]
        });
        for row in &rows {
            close(row[0], 0.0);
            close(row[1], 1.5_f64.ln() / 1.5);
        }
    }
}

/// Both sides of x = 0 let the state go; at 0 the equations say x' = ±0.7.
#[test]
fn where_both_sides_let_go_the_equations_decide() {
    for method in methods() {
        for push in [0.7, -0.7] {
            let rows = run(method, &[("x", 0.0)], &[0.5, 1.0], |_, x| {
                vec![push + x[0].sign()]
            });
            close(rows[1][0], push + push.signum());
        }
    }
}

/// x' = −½ − sign(2x)·0.7 slides along x = 0 with a seventh of the time above: what another relation
/// of a multiple of x says is taken by the same share.
#[test]
fn multiples_vanish_on_one_surface() {
    for method in methods() {
        let rows = run(method, &[("x", 0.0), ("z", 0.0)], &[0.5, 1.0], |_, x| {
            let [seven, zero] = [7.0, 0.0].map(|c| x[0].graph().constant(c));
            let above = zero.less(x[0] * 0.5).select(seven, zero);
            vec![-0.5 - (x[0] * 2.0).sign() * 0.7, above]
        });
        close(rows[1][0], 0.0);
        close(rows[1][1], 1.0);
    }
}

/// A system that counts how often it is evaluated.
struct Counted(Evaluation, usize);

impl Dynamics for Counted {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.1 += 1;
        self.0.derivatives(t, x, dx);
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.0.events()
    }
}

/// An oscillation that comes close to a surface again and again: the looks whether it is crossed
/// cost some evaluations, and no accuracy.
#[test]
fn what_is_not_crossed_costs_little() {
    let count = |method: Method, level: f64| {
        let g = Graph::new();
        let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
        let dx = [v.node(), (-x * (x + level).sign()).node()];
        let states = [
            ("x".to_string(), x.node(), 1.0),
            ("v".to_string(), v.node(), 0.0),
        ];
        let system =
            System::new(&g, time.node(), &states, &[], &dx, &[]).expect("it is well-formed");
        let mut counted = Counted(system.evaluation(), 0);
        let mut state = system.start().to_vec();
        let mut integrator = Integrator::new(method, 2).expect("it is well-formed");
        integrator
            .advance(&mut counted, 0.0, 40.0, &mut state)
            .expect("it is well-formed");
        close(state[0], 40.0_f64.cos());
        counted.1
    };
    for method in methods() {
        let (near, far) = (count(method, 1.000_000_1), count(method, 5.0));
        // six approaches
        assert!(near < far + 6 * 25, "{near} against {far}");
    }
}
