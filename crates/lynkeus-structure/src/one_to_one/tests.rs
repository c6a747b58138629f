use super::*;
use crate::Dimension;
use crate::Region;
use lynkeus_expr::{Expr, Graph};

fn region(sides: &[(Expr<'_>, f64, f64)]) -> Region {
    let side = |&(x, min, max): &(Expr<'_>, f64, f64)| Dimension {
        name: x.graph().symbol_name(x.node()).unwrap(),
        symbol: x.node(),
        min,
        max,
        integer: false,
    };
    Region {
        dimensions: sides.iter().map(side).collect(),
    }
}

fn decide(functions: &[Expr<'_>], sides: &[(Expr<'_>, f64, f64)]) -> OneToOne {
    let nodes: Vec<Node> = functions.iter().map(|f| f.node()).collect();
    let states: Vec<Node> = sides.iter().map(|side| side.0.node()).collect();
    let map = Map {
        graph: functions[0].graph(),
        functions: &nodes,
        states: &states,
        region: &region(sides),
    };
    map.one_to_one(&vec![false; states.len()], true).unwrap()
}

#[test]
fn a_chain_is_told_apart_step_by_step() {
    let g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.symbol(name));
    let slope = 1.0 + 3.0 * a * a;
    let found = decide(
        &[a + a * a * a, slope * (2.0 * b + 0.3 * b.sin())],
        &[(a, -1.0, 1.0), (b, -1.0, 1.0)],
    );
    assert_eq!(found.finding.verdict, Verdict::Proved);
    assert_eq!(found.known, [true, true]);
}

/// e^a (cos b, sin b) is regular everywhere, and one-to-one as long as b stays below a full turn.
#[test]
fn a_full_turn_is_found() {
    let g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.symbol(name));
    let turn = [a.exp() * b.cos(), a.exp() * b.sin()];
    let found = decide(&turn, &[(a, -1.0, 1.0), (b, -3.0, 3.0)]);
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
    let found = decide(&turn, &[(a, -1.0, 1.0), (b, -4.0, 4.0)]);
    let Verdict::Refuted(witness) = &found.finding.verdict else {
        panic!("{found:?}")
    };
    let [one, other] = &witness.points[..] else {
        panic!()
    };
    let apart: Vec<f64> = one
        .coordinates
        .iter()
        .zip(&other.coordinates)
        .map(|(x, y)| (x.value - y.value).abs())
        .collect();
    assert!(apart[0] < 1e-9 && (apart[1] - std::f64::consts::TAU).abs() < 1e-9);
}

/// What one function confuses another one tells.
#[test]
fn two_functions_of_one_state() {
    let g = Graph::new();
    let b = g.symbol("b");
    let found = decide(&[b.cos(), b.sin()], &[(b, -3.0, 3.0)]);
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
    let found = decide(&[b.cos(), (2.0 * b).sin()], &[(b, 0.5, 3.0)]);
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
    let found = decide(&[(3.0 * b).cos(), (3.0 * b).sin()], &[(b, 0.0, 3.0)]);
    assert!(found.alike.is_some(), "{found:?}");
}

/// The sum and the product of two states do not tell which is which; on one side of the diagonal they do.
#[test]
fn interchangeable_states_are_found() {
    let g = Graph::new();
    let [x, y] = ["x", "y"].map(|name| g.symbol(name));
    let sides = [(x, 1.0, 2.0), (y, 3.0, 4.0)];
    let found = decide(&[x + y, x * y], &sides);
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
    // x + y, x² − y: regular for x > −½, where the cubic of x alone is monotone
    let found = decide(&[x + y, x * x - y], &[(x, -0.4, 2.0), (y, -1.0, 1.0)]);
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
}

/// Behind a state that is known the rest is told, and the step that fails leaves the others as they are.
#[test]
fn a_part_is_known_where_the_rest_is_not() {
    let g = Graph::new();
    let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
    let sides = [(a, -1.0, 1.0), (b, -4.0, 4.0), (c, -1.0, 1.0)];
    let found = decide(
        &[a, (c.exp() + 1.0) * b.cos(), (c.exp() + 1.0) * b.sin()],
        &sides,
    );
    assert_eq!(found.known, [true, false, false]);
    assert!(found.alike.is_some());
}

/// Nothing is refuted and nothing proved without ends.
#[test]
fn a_box_without_ends_is_undecided() {
    let g = Graph::new();
    let [a, b] = ["a", "b"].map(|name| g.symbol(name));
    let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
    let found = decide(
        &[a.sin() + 2.0 * b, b.sin() - 2.0 * a],
        &[(a, low, high), (b, low, high)],
    );
    // diagonally dominant after a change of rows: proved on the whole plane
    assert_eq!(found.finding.verdict, Verdict::Proved, "{found:?}");
    let found = decide(&[a * b + a, a - b * b], &[(a, low, high), (b, low, high)]);
    assert!(!found.finding.is_proved());
}
