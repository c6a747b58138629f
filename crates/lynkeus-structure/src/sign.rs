//! Does an expression keep its sign on the box?

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape};

use crate::jumps::without_removable_jumps;
use crate::region::{Cell, undeclared};
use crate::regularity::is_regular;
use crate::{
    Dimension, Finding, Point, Range, Reason, Region, Verdict, Witness, range, range_within,
    regularity,
};

/// Cells examined per end to see whether there is a bound.
const GLANCE: usize = 20;

/// The verdict on a sign, with the bounds that go with it.
#[derive(Clone, Debug)]
pub struct Sign {
    /// "never zero, one sign"
    pub finding: Finding,
    /// +1 or −1: the sign where it is proved, else that of the first sample
    pub sign: f64,
    /// rigorous bounds of the absolute value: (α₁, α₂); α₂ may be infinite
    pub bounds: (f64, f64),
}

/// Decides whether `node` has one sign, zero excluded, on the region.
///
/// Refuted with two points of opposite sign and, where one can move from one to
/// the other inside the region, the zero between them.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn keeps_sign(graph: &Graph, node: Node, region: &Region) -> Result<Sign, MissingInput> {
    let found = range(graph, node, region)?;
    let (low, high) = (found.enclosure.lo(), found.enclosure.hi());
    let expression = graph.render(node, 80);
    let lies = |open: bool, undeclared: Vec<String>| Reason::Lies {
        expression: expression.clone(),
        low,
        high,
        open,
        undeclared,
    };
    let finding = if low > 0.0 || high < 0.0 {
        Finding::proved(lies(false, vec![]))
    } else if let Some(witness) = witness(graph, node, region, &found)? {
        Finding::refuted(witness, Reason::Vanishes(expression))
    } else {
        let regular = regularity(graph, &[node], &[], region)?;
        match regular.is_proved() {
            false => regular,
            true => Finding {
                verdict: Verdict::Undecided(found.weakest.clone()),
                reason: lies(true, undeclared(&found.weakest)),
            },
        }
    };
    let sample = found.highest.as_ref().map_or(1.0, |p| p.value);
    let is_negative = high < 0.0 || (low <= 0.0 && sample < 0.0);
    Ok(Sign {
        finding,
        sign: if is_negative { -1.0 } else { 1.0 },
        bounds: (found.enclosure.mignitude(), found.enclosure.magnitude()),
    })
}

/// Whether the expression has a value everywhere on the region and a bound, by one interval
/// evaluation or a few.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn bounded(graph: &Graph, node: Node, region: &Region) -> Result<bool, MissingInput> {
    Ok(range_within(graph, node, region, GLANCE)?
        .enclosure
        .is_bounded())
}

/// Which of the expressions the whole box proves [bounded], without halving it: one
/// evaluation of what they share.
///
/// # Errors
/// [`MissingInput`] where one depends on a symbol outside the region.
pub fn bounded_at_once(
    graph: &Graph,
    nodes: &[Node],
    region: &Region,
) -> Result<Vec<bool>, MissingInput> {
    let tape = Tape::new(graph, &region.symbols(), nodes)?;
    let values = tape.eval_in(&Intervals, &region.cell());
    Ok(values.iter().map(|x| x.is_bounded()).collect())
}

fn witness(
    graph: &Graph,
    node: Node,
    region: &Region,
    found: &Range,
) -> Result<Option<Witness>, MissingInput> {
    let (Some(lowest), Some(highest)) = (&found.lowest, &found.highest) else {
        return Ok(None);
    };
    let region = region.restricted(&graph.symbols_of(&[node]));
    let tape = Tape::new(graph, &region.symbols(), &[node])?;
    // a·sign(a) does not jump
    let smooth = without_removable_jumps(graph, &[node])[0];
    let at = |point: &Point| -> Vec<f64> { point.coordinates.iter().map(|c| c.value).collect() };
    let (low, high) = (at(lowest), at(highest));
    for (point, at) in [(lowest, &low), (highest, &high)] {
        // where it jumps, the value between is no zero
        if enclosure(&tape, at).is_zero()
            && is_regular(graph, smooth, &region, &around(at, &region))?
        {
            return Ok(Some(point.clone().into()));
        }
    }
    if !(enclosure(&tape, &low).is_negative() && enclosure(&tape, &high).is_positive()) {
        return Ok(None);
    }
    let mut points = vec![
        legible(&tape, &region, &low),
        legible(&tape, &region, &high),
    ];
    let small = 1e-9 * (highest.value - lowest.value);
    if let Some((bracket, zero)) = zero_between(&tape, &region, low, high)
        && zero.value.abs() <= small
        && is_regular(graph, smooth, &region, &bracket)?
    {
        points.insert(0, zero);
    }
    Ok(Some(Witness { points }))
}

/// The value at a point, rounding errors included: an underflow or a cancellation
/// must not refute anything.
fn enclosure(tape: &Tape, at: &[f64]) -> Interval {
    let cell: Vec<Interval> = at.iter().map(|&x| Interval::point(x)).collect();
    tape.eval_in(&Intervals, &cell)[0]
}

/// −1 or 1 where the value certainly has that sign.
fn sign_at(tape: &Tape, at: &[f64]) -> i8 {
    let value = enclosure(tape, at);
    i8::from(value.is_positive()) - i8::from(value.is_negative())
}

/// Relative width of an enclosure whose middle may be told as the value.
const BLURRED: f64 = 1e-8;
/// On the way to a place where it may.
const HALVINGS: i32 = 50;

/// The point, or where rounding blurs the value there one of the same sign on a way into the
/// box where it does not: what is told has to be true in every digit. The value is that of
/// the enclosure: computed without one, a badly scaled linear system may have lost most digits.
fn legible(tape: &Tape, region: &Region, from: &[f64]) -> Point {
    let sign = sign_at(tape, from);
    let shows = |at: &Vec<f64>| {
        let value = enclosure(tape, at);
        sign_at(tape, at) == sign && value.hi() - value.lo() <= BLURRED * value.lo().abs()
    };
    let targets = region.samples(&region.cell());
    let ways = targets.iter().filter(|to| region.connected(from, to));
    let places = ways.flat_map(|to| (1..=HALVINGS).rev().map(|k| along(from, to, k)));
    let mut places = std::iter::once(from.to_vec()).chain(places);
    told(tape, region, &places.find(shows).unwrap_or(from.to_vec()))
}

/// So many halvings away from `from` toward `to`.
fn along(from: &[f64], to: &[f64], halvings: i32) -> Vec<f64> {
    let share = 0.5f64.powi(halvings);
    let pairs = from.iter().zip(to);
    pairs.map(|(a, b)| a + share * (b - a)).collect()
}

/// The place with the value there.
fn told(tape: &Tape, region: &Region, place: &[f64]) -> Point {
    let value = enclosure(tape, place);
    region.point(place, f64::midpoint(value.lo(), value.hi()))
}

/// A small cell of the region around a point.
fn around(point: &[f64], region: &Region) -> Cell {
    let side = |(&x, d): (&f64, &Dimension)| {
        let (low, high) = (x.next_down().max(d.min), x.next_up().min(d.max));
        Interval::new(low, high).unwrap_or(Interval::point(x))
    };
    point.iter().zip(&region.dimensions).map(side).collect()
}

/// Bisection along the straight line between two points of negative and of positive sign, rounding errors
/// included: a cell at whose ends the signs still differ, and the zero in it.
fn zero_between(
    tape: &Tape,
    region: &Region,
    mut p: Vec<f64>,
    mut q: Vec<f64>,
) -> Option<(Cell, Point)> {
    if !region.connected(&p, &q) {
        return None;
    }
    let middle_of = |p: &[f64], q: &[f64]| along(p, q, 1);
    let mut middle = middle_of(&p, &q);
    while middle != p && middle != q {
        match sign_at(tape, &middle) {
            -1 => p = middle,
            1 => q = middle,
            _ => break,
        }
        middle = middle_of(&p, &q);
    }
    // a zero within rounding errors: its neighbours with a sign, on both sides
    for (end, sign) in [(&mut p, -1), (&mut q, 1)] {
        let mut next = middle_of(end, &middle);
        while next != *end && next != middle && sign_at(tape, &next) == sign {
            *end = next;
            next = middle_of(end, &middle);
        }
    }
    let ends = p.iter().zip(&q);
    let bracket: Option<Cell> = ends
        .map(|(&p, &q)| Interval::new(p.min(q), p.max(q)).ok())
        .collect();
    Some((bracket?, told(tape, region, &middle)))
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::{Expr, jacobian};

    use super::*;

    fn side(x: Expr<'_>, min: f64, max: f64, integer: bool) -> Dimension {
        let name = x.graph().symbol_name(x.node()).unwrap();
        Dimension {
            name,
            symbol: x.node(),
            min,
            max,
            integer,
        }
    }

    fn decide(f: Expr<'_>, sides: Vec<Dimension>) -> Sign {
        keeps_sign(f.graph(), f.node(), &Region { dimensions: sides }).unwrap()
    }

    #[test]
    fn a_root_of_a_tank_keeps_its_sign() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = decide(-0.07 / (2.0 * x.sqrt()), vec![side(x, 0.05, 10.0, false)]);
        assert_eq!(sign.finding.verdict, Verdict::Proved);
        assert_eq!(sign.sign, -1.0);
        let (low, high) = (0.035 / 10f64.sqrt(), 0.035 / 0.05f64.sqrt());
        assert!(sign.bounds.0 <= low && sign.bounds.0 > low * 0.998);
        assert!(sign.bounds.1 >= high && sign.bounds.1 < high * 1.002);
    }

    #[test]
    fn a_zero_inside_is_the_witness() {
        let g = Graph::new();
        let x = g.symbol("x");
        for (min, max) in [(-1.0, 1.0), (-1.0, 2.0), (-0.3, 7.0)] {
            let sign = decide(2.0 * x, vec![side(x, min, max, false)]);
            let Verdict::Refuted(witness) = sign.finding.verdict else {
                panic!()
            };
            assert!(witness.points[0].coordinates[0].value.abs() < 1e-9);
        }
    }

    #[test]
    fn a_zero_on_the_edge_counts() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = decide(x, vec![side(x, 0.0, 1.0, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Refuted(_)));
    }

    /// u = 2s − 1 with a whole s in {0, 1}: never zero, yet of both signs.
    #[test]
    fn a_set_of_two_values_has_no_zero_between() {
        let g = Graph::new();
        let s = g.symbol("s");
        let sign = decide(2.0 * s - 1.0, vec![side(s, 0.0, 1.0, true)]);
        let Verdict::Refuted(witness) = sign.finding.verdict else {
            panic!()
        };
        let values: Vec<f64> = witness.points.iter().map(|p| p.value).collect();
        assert_eq!(values, [-1.0, 1.0]);
    }

    /// The slope of |x| is never zero, though sign(0) is; nor does 1/x pass zero.
    #[test]
    fn a_jump_is_no_zero() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = g.expr(g.unary(lynkeus_expr::Unary::Sign, x.node()));
        for f in [sign, 2.0 * sign + x / 10.0, 1.0 / x] {
            let sign = decide(f, vec![side(x, -1.0, 1.0, false)]);
            if let Verdict::Refuted(witness) = sign.finding.verdict {
                assert_eq!(witness.zero(), None);
            }
        }
        let sign = decide(sign * x - 0.5, vec![side(x, -1.0, 1.0, false)]);
        let Verdict::Refuted(witness) = sign.finding.verdict else {
            panic!()
        };
        let zero = witness.zero().unwrap().coordinates[0].value;
        assert!((zero.abs() - 0.5).abs() < 1e-9, "{zero}");
    }

    /// No witness at the end of the floating-point numbers.
    #[test]
    fn witnesses_are_within_reach() {
        let g = Graph::new();
        let x = g.symbol("x");
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        for f in [x, x * x * x - 7.0, x.exp() - 2.0, 1.0 - x * x] {
            let sign = decide(f, vec![side(x, all.0, all.1, false)]);
            let Verdict::Refuted(witness) = &sign.finding.verdict else {
                panic!("{sign:?}")
            };
            let far = |p: &Point| p.coordinates[0].value.abs() > 1e10;
            assert!(!witness.points.iter().any(far), "{witness:?}");
        }
        // of one sign as far as anyone looks
        let sign = decide(x + 1e30, vec![side(x, all.0, all.1, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Undecided(_)));
        let (
            Reason::Lies {
                low,
                high,
                undeclared,
                ..
            },
            Verdict::Undecided(place),
        ) = (&sign.finding.reason, &sign.finding.verdict)
        else {
            panic!("{sign:?}")
        };
        assert_eq!(undeclared[..], ["x"]);
        // no end of the floating-point numbers is told
        let told = place.iter().flat_map(|side| [side.min, side.max]);
        let mut told = told.chain([*low, *high]);
        assert!(told.all(|x| x.is_infinite() || x.abs() < 1e300), "{sign:?}");
    }

    #[test]
    fn an_undeclared_box_is_undecided_and_says_what_to_declare() {
        let g = Graph::new();
        let x = g.symbol("x");
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let sign = decide(x.exp(), vec![side(x, all.0, all.1, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Undecided(_)));
        let asks = |reason: &Reason| matches!(reason, Reason::Lies { undeclared, .. } if undeclared[..] == ["x"]);
        assert!(asks(&sign.finding.reason), "{sign:?}");
    }

    fn assert_legible(f: Expr<'_>, sides: &[(Expr<'_>, f64, f64)]) {
        let graph = f.graph();
        let side = |(x, min, max): &(Expr<'_>, f64, f64)| Dimension {
            name: graph.symbol_name(x.node()).unwrap(),
            symbol: x.node(),
            min: *min,
            max: *max,
            integer: false,
        };
        let region = Region {
            dimensions: sides.iter().map(side).collect(),
        };
        let sign = keeps_sign(graph, f.node(), &region).unwrap();
        let Verdict::Refuted(witness) = sign.finding.verdict else {
            panic!("{sign:?}")
        };
        let region = region.restricted(&graph.symbols_of(&[f.node()]));
        let tape = Tape::new(graph, &region.symbols(), &[f.node()]).unwrap();
        assert!(witness.points.len() >= 2, "{witness:?}");
        for point in &witness.points[witness.points.len() - 2..] {
            let at: Vec<f64> = point.coordinates.iter().map(|c| c.value).collect();
            let value = enclosure(&tape, &at);
            let width = value.hi() - value.lo();
            assert!(width <= 1e-7 * point.value.abs(), "{point:?} {value:?}");
            assert!(value.contains(point.value), "{point:?} {value:?}");
        }
    }

    /// Beside 0, the slope of sin(1/x) is of both signs and lost in the rounding of 1/x; and
    /// what a mass matrix hides beside the places where it is singular.
    #[test]
    fn the_value_told_is_right_in_every_digit() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let inverse = 1.0 / (x + 0.673);
        let slope = inverse.sin() - inverse * inverse.cos();
        assert_legible(slope, &[(x, -0.673 + 6e-16, 1.177)]);
        let a = (2.0 * x).node();
        let [zero, one] = [0.0, 1.0].map(|c| g.constant(c).node());
        let b = (-0.9 * (y - 0.4)).node();
        let f = g.solve(&[one, a, one, one], &[b, zero]).x[0];
        let slope = g.expr(jacobian::forward(&g, &[f], &[y.node()]).get(0, 0).unwrap());
        assert_legible(slope, &[(x, -2.672, 2.288), (y, -0.152, 1.076)]);
    }
}
