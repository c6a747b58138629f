use super::*;
use crate::Dimension;
use lynkeus_expr::{Expr, Implicit, ImplicitUnknown, Interval};

fn side(x: Expr<'_>, min: f64, max: f64) -> Dimension {
    Dimension {
        name: x.graph().symbol_name(x.node()).unwrap(),
        symbol: x.node(),
        min,
        max,
        integer: false,
    }
}

/// Examines f(x, y) for x in [−1, 2] and y in [0.5, 3], both moving.
fn examined(build: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>) -> Finding {
    let g = Graph::new();
    let (x, y) = (g.symbol("x"), g.symbol("y"));
    let region = Region {
        dimensions: vec![side(x, -1.0, 2.0), side(y, 0.5, 3.0)],
    };
    let node = build(x, y).node();
    regularity(&g, &[node], &[x.node(), y.node()], &region).unwrap()
}

fn jumps(found: &Finding) -> bool {
    matches!(found.reason, Reason::Jumps { .. })
}

fn undefined(found: &Finding) -> bool {
    matches!(found.reason, Reason::NoValue { .. })
}

#[test]
fn smooth_and_kinked_expressions_are_regular() {
    assert!(examined(|x, y| x.sin() * y.ln() + x.abs() / y).is_proved());
    assert!(examined(|x, y| x.min(y).max(x * y)).is_proved());
    assert!(examined(|x, _| (x - x.powi(2) / 4.0 + 1.25 + 1e-3).sqrt()).is_proved());
    assert!(examined(|x, _| x * x.sign()).is_proved(), "it is |x|");
}

#[test]
fn every_step_is_a_jump() {
    assert!(jumps(&examined(|x, _| x.sign())));
    assert!(jumps(&examined(|x, _| x.floor())));
    assert!(jumps(&examined(|x, y| y - 2.0 * (x / 2.0).floor())));
    assert!(jumps(&examined(|x, y| x.less(y))));
    assert!(jumps(&examined(|x, y| (x - y).less_eq(x * 0.0) * y)));
    // through the negative half of the x axis
    assert!(jumps(&examined(|x, y| x.atan2(-y))));
    assert!(examined(|x, y| x.atan2(y)).is_proved());
}

/// The last point of a side is one of it, and so is a jump there.
#[test]
fn a_jump_at_the_edge_counts() {
    assert!(jumps(&examined(|_, y| (y / 3.0).floor())));
    assert!(examined(|_, y| (y / 3.1).floor()).is_proved());
    assert!(jumps(&examined(|_, y| (y - 0.5).sign())));
}

#[test]
fn what_has_no_value_somewhere_is_named() {
    assert!(undefined(&examined(|x, _| x.ln())));
    assert!(undefined(&examined(|x, _| x.sqrt())));
    assert!(undefined(&examined(|x, _| 1.0 / (x - 1.0))));
    assert!(undefined(&examined(|x, _| x.pow(x.graph().constant(1.5)))));
    assert!(undefined(&examined(|x, _| x.acos())));
    assert!(undefined(&examined(|_, y| y.tan())));
    assert!(undefined(&examined(|x, _| (x - 1.5) / (x - 1.5))));
    let Reason::NoValue {
        operation, place, ..
    } = examined(|x, _| x.ln()).reason
    else {
        panic!()
    };
    assert!(["ln(x)", "log(x)"].contains(&&operation[..]), "{operation}");
    assert!(place.len() == 1 && place[0].name == "x" && place[0].min == -1.0);
}

#[test]
fn branches_that_meet_do_not_jump() {
    let zero = |x: Expr<'_>| x.graph().constant(0.0).node();
    let select = |c: Expr<'_>, a: Node, b: Node| c.graph().select(c.node(), a, b);
    let met = examined(|x, y| {
        let g = x.graph();
        g.expr(select(
            x.less(g.constant(0.0)),
            zero(x),
            (x.powi(2) * y).node(),
        ))
    });
    assert!(met.is_proved(), "{:?}", met.reason);
    // by a difference: if x − y < 0 then −(x − y)² else (x − y)²
    let met = examined(|x, y| {
        let g = x.graph();
        let d = x - y;
        g.expr(select(
            d.less(g.constant(0.0)),
            (-(d.powi(2))).node(),
            d.powi(2).node(),
        ))
    });
    assert!(met.is_proved(), "{:?}", met.reason);
    let apart = examined(|x, y| {
        let g = x.graph();
        g.expr(select(
            x.less(g.constant(0.0)),
            zero(x),
            (x.powi(2) + y * 1e-9).node(),
        ))
    });
    assert!(jumps(&apart));
}

/// What the other branch would do does not matter.
#[test]
fn a_branch_that_is_not_taken_counts_for_nothing() {
    let found = examined(|x, y| {
        let g = x.graph();
        let c = y.less(g.constant(0.0));
        g.expr(g.select(c.node(), x.ln().node(), x.node()))
    });
    assert!(found.is_proved(), "{:?}", found.reason);
}

/// Time and inputs may switch: the state does not.
#[test]
fn jumps_of_what_does_not_move_are_allowed() {
    let g = Graph::new();
    let (x, u) = (g.symbol("x"), g.symbol("u"));
    let region = Region {
        dimensions: vec![side(x, -1.0, 2.0), side(u, -1.0, 1.0)],
    };
    let node = (x * u.sign()).node();
    let of = |moving: &[Node]| regularity(&g, &[node], moving, &region).unwrap();
    assert!(of(&[x.node()]).is_proved());
    assert!(!of(&[x.node(), u.node()]).is_proved());
}

/// 0⁰ = 1, yet 0^y = 0 for y > 0.
#[test]
fn powers_jump_at_the_origin() {
    let g = Graph::new();
    let (x, y) = (g.symbol("x"), g.symbol("y"));
    let region = Region {
        dimensions: vec![side(x, 0.0, 1.0), side(y, 0.0, 1.0)],
    };
    let node = x.pow(y).node();
    let found = regularity(&g, &[node], &[x.node(), y.node()], &region).unwrap();
    assert!(jumps(&found));
}

#[test]
fn a_step_hides_from_derivatives_only() {
    let g = Graph::new();
    let (x, y) = (g.symbol("x"), g.symbol("y"));
    let node = (2.0 * x - x.sign() + y).node();
    assert!(steps(&g, node, &[x.node()]) && !steps(&g, node, &[y.node()]));
}

/// A jump on either side of a linear system is one of its solution; a singular matrix leaves
/// it without one.
#[test]
fn jumps_go_through_linear_systems() {
    let solved = |a: fn(Expr<'_>) -> Expr<'_>, b: fn(Expr<'_>) -> Expr<'_>| {
        let g = Graph::new();
        let x = g.symbol("x");
        let region = Region {
            dimensions: vec![side(x, -1.0, 2.0)],
        };
        let (one, half) = (g.constant(1.0).node(), g.constant(0.5).node());
        let matrix = [one, half, half, a(x).node()];
        let solution = g.solve(&matrix, &[b(x).node(), one]).x[0];
        regularity(&g, &[solution], &[x.node()], &region).unwrap()
    };
    assert!(solved(|x| x.powi(2) + 3.0, |x| x.sin()).is_proved());
    assert!(jumps(&solved(|x| x.powi(2) + 3.0, |x| x.sign())));
    assert!(jumps(&solved(|x| x.floor() + 5.0, |x| x.sin())));
    assert!(undefined(&solved(|x| x, |x| x.sin())));
}

/// A loop has a value where one root in its range is proved; what jumps around it or within
/// it is not overlooked.
#[test]
fn loops_are_regular_where_they_have_one_root() {
    let root = |(low, high): (f64, f64), g: fn(Expr<'_>, Expr<'_>) -> Node| {
        let graph = Graph::new();
        let (z, x) = (graph.symbol("z"), graph.symbol("x"));
        let region = Region {
            dimensions: vec![side(x, low, high)],
        };
        let unknown = ImplicitUnknown {
            symbol: z.node(),
            start: 1.0,
            range: Interval::new(0.0, 10.0).unwrap(),
        };
        let node = Implicit::solve(&graph, &[unknown], &[g(z, x)]).unwrap()[0];
        regularity(&graph, &[node], &[x.node()], &region).unwrap()
    };
    let square = |z: Expr<'_>, x: Expr<'_>| (z * z - x).node();
    assert!(root((0.5, 90.0), square).is_proved());
    assert!(undefined(&root((-1.0, 4.0), square)), "it ends at 0");
    assert!(
        undefined(&root((1.0, 200.0), square)),
        "it leaves its range"
    );
    let twice = |z: Expr<'_>, x: Expr<'_>| ((z - 2.0) * (z - 5.0) - x).node();
    assert!(undefined(&root((-1.0, 1.0), twice)));
    let outside = |z: Expr<'_>, x: Expr<'_>| (z + z.exp() - 20.0 - x.sign()).node();
    assert!(jumps(&root((-1.0, 1.0), outside)) && root((0.5, 1.0), outside).is_proved());
    let inside = |z: Expr<'_>, x: Expr<'_>| (z + (z - 3.0).sign() - x).node();
    assert!(undefined(&root((1.0, 5.0), inside)) && root((5.0, 8.0), inside).is_proved());
}

/// A part without a value spoils what is made of it, wherever it stands, and is searched once;
/// one that is regular on its own, or that is not needed there, spoils nothing.
#[test]
fn a_part_without_a_value_is_searched_once() {
    let g = Graph::new();
    let (x, y) = (g.symbol("x"), g.symbol("y"));
    let region = Region {
        dimensions: vec![side(x, -1.0, 2.0), side(y, 0.5, 3.0)],
    };
    let moving = [x.node(), y.node()];
    let of = |f: Expr<'_>| regularity(&g, &[f.node()], &moving, &region).unwrap();
    let pole = 1.0 / (x - 0.5);
    let place = |found: &Finding| found.clone();
    let alone = place(&of(pole));
    assert!(undefined(&of(pole)));
    for made in [pole * y.sin(), (pole * pole + y).exp(), pole - y * pole] {
        assert_eq!(place(&of(made)), alone);
    }
    // overestimated on the whole box, and regular on its parts
    let root = (x - x.powi(2) / 4.0 + 1.25 + 1e-3).sqrt();
    assert!(of(root).is_proved() && of(root * y + root.sin()).is_proved());
    assert!(undefined(&of(root * y + pole)));
    let near = x.less(g.constant(0.6));
    let chosen = near.select(y, pole);
    let found = regularity(&g, &[chosen.node()], &[], &region).unwrap();
    assert!(found.is_proved(), "{:?}", found.reason);
}

/// More overestimated parts than are searched alone: the others are decided with the whole, and
/// a pole behind all of them is found.
#[test]
fn of_many_parts_the_first_are_searched_alone() {
    let g = Graph::new();
    let (x, y) = (g.symbol("x"), g.symbol("y"));
    let region = Region {
        dimensions: vec![side(x, -1.0, 2.0), side(y, 0.5, 3.0)],
    };
    let moving = [x.node(), y.node()];
    let of = |f: Expr<'_>| regularity(&g, &[f.node()], &moving, &region).unwrap();
    let root = |i: u32| (x - x.powi(2) / 4.0 + 1.25 + 1e-3 * f64::from(i + 1)).sqrt();
    let many = (0..3 * PARTS as u32).fold(y, |sum, i| sum + root(i));
    assert!(of(many).is_proved());
    assert!(undefined(&of(many + 1.0 / (x - 0.5))));
}
