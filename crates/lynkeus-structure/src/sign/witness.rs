//! Points that show a change of sign.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape};

use crate::region::Cell;
use crate::regularity::is_regular;
use crate::slopes::without_removable_jumps;
use crate::{Coordinate, Point, Range, Region, Witness};

pub(super) fn witness(
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
    let smooth = without_removable_jumps(graph, &[node])
        .first()
        .copied()
        .unwrap_or(node);
    for point in [lowest, highest] {
        let value = enclosure(&tape, point);
        // where it jumps, the value between is no zero
        if value.lo() == 0.0
            && value.hi() == 0.0
            && is_regular(graph, smooth, &region, &around(point, &region))?
        {
            return Ok(Some(Witness {
                points: vec![point.clone()],
            }));
        }
    }
    if !(enclosure(&tape, lowest).is_negative() && enclosure(&tape, highest).is_positive()) {
        return Ok(None);
    }
    let mut points = vec![
        legible(&tape, &region, lowest),
        legible(&tape, &region, highest),
    ];
    if let Some((bracket, zero)) = zero_between(&tape, &region, lowest, highest)
        && is_regular(graph, smooth, &region, &bracket)?
    {
        points.insert(0, zero);
    }
    Ok(Some(Witness { points }))
}

/// The value at a point, rounding errors included: an underflow or a cancellation
/// must not refute anything.
pub(super) fn enclosure(tape: &Tape, point: &Point) -> Interval {
    let cell: Vec<Interval> = point
        .coordinates
        .iter()
        .map(|c| Interval::point(c.value))
        .collect();
    tape.eval_in(&Intervals, &cell)[0]
}

/// Relative width of an enclosure whose middle may be told as the value.
const BLURRED: f64 = 1e-8;
/// On the way to a place where it may.
const HALVINGS: i32 = 50;

/// The point, or where rounding blurs the value there one of the same sign on a way into the
/// box where it does not: what is told has to be true in every digit. The value is that of
/// the enclosure: computed without one, a badly scaled linear system may have lost most digits.
fn legible(tape: &Tape, region: &Region, point: &Point) -> Point {
    let is_positive = enclosure(tape, point).is_positive();
    let shows = |point: &Point| {
        let value = enclosure(tape, point);
        let keeps = match is_positive {
            true => value.is_positive(),
            false => value.is_negative(),
        };
        keeps && value.hi() - value.lo() <= BLURRED * value.lo().abs()
    };
    let from: Vec<f64> = point.coordinates.iter().map(|c| c.value).collect();
    let here = told(tape, point, &from);
    if shows(&here) {
        return here;
    }
    let targets = region.samples(&region.cell());
    let ways = targets.iter().filter(|to| region.connected(&from, to));
    let mut places = ways.flat_map(|to| (1..=HALVINGS).rev().map(|k| along(&from, to, k)));
    let found = places.find_map(|place| {
        let next = told(tape, point, &place);
        shows(&next).then_some(next)
    });
    found.unwrap_or(here)
}

/// So many halvings away from `from` toward `to`.
fn along(from: &[f64], to: &[f64], halvings: i32) -> Vec<f64> {
    let share = 0.5f64.powi(halvings);
    let pairs = from.iter().zip(to);
    pairs.map(|(a, b)| a + share * (b - a)).collect()
}

/// The place with the value there, named like the point.
fn told(tape: &Tape, like: &Point, place: &[f64]) -> Point {
    let names = like.coordinates.iter().map(|c| c.name.clone());
    let mut point = Point {
        coordinates: names
            .zip(place.iter().copied())
            .map(Coordinate::from)
            .collect(),
        value: 0.0,
    };
    let value = enclosure(tape, &point);
    point.value = f64::midpoint(value.lo(), value.hi());
    point
}

/// A small cell of the region around a point.
fn around(point: &Point, region: &Region) -> Cell {
    let sides = point.coordinates.iter().zip(&region.dimensions);
    let side = |(Coordinate { value: x, .. }, d): (&Coordinate, &crate::Dimension)| {
        let (low, high) = (x.next_down().max(d.min), x.next_up().min(d.max));
        Interval::new(low, high).unwrap_or(Interval::point(*x))
    };
    sides.map(side).collect()
}

/// Bisection along the straight line between two points of opposite sign, rounding errors
/// included: a cell at whose ends the signs still differ, and the zero in it.
fn zero_between(
    tape: &Tape,
    region: &Region,
    negative: &Point,
    positive: &Point,
) -> Option<(Cell, Point)> {
    let values = |p: &Point| p.coordinates.iter().map(|c| c.value).collect::<Vec<f64>>();
    let (mut p, mut q) = (values(negative), values(positive));
    if !region.connected(&p, &q) {
        return None;
    }
    let middle_of = |p: &[f64], q: &[f64]| -> Vec<f64> {
        p.iter().zip(q).map(|(p, q)| p + (q - p) / 2.0).collect()
    };
    let sign_at = |x: &[f64]| {
        let cell: Vec<Interval> = x.iter().map(|&x| Interval::point(x)).collect();
        let value = tape.eval_in(&Intervals, &cell)[0];
        i8::from(value.is_positive()) - i8::from(value.is_negative())
    };
    let mut middle = middle_of(&p, &q);
    while middle != p && middle != q {
        match sign_at(&middle) {
            -1 => p = middle,
            1 => q = middle,
            _ => break,
        }
        middle = middle_of(&p, &q);
    }
    // a zero within rounding errors: its neighbours with a sign, on both sides
    for (end, sign) in [(&mut p, -1), (&mut q, 1)] {
        let mut next = middle_of(end, &middle);
        while next != *end && next != middle && sign_at(&next) == sign {
            *end = next;
            next = middle_of(end, &middle);
        }
    }
    let ends = p.iter().zip(&q);
    let bracket: Option<Cell> = ends
        .map(|(&p, &q)| Interval::new(p.min(q), p.max(q)).ok())
        .collect();
    let zero = told(tape, negative, &middle);
    let small = zero.value.abs() <= 1e-9 * (positive.value - negative.value);
    Some((bracket?, zero)).filter(|_| small)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sign::keeps_sign;
    use crate::{Dimension, Verdict};
    use lynkeus_expr::{Expr, jacobian};

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
        assert!(witness.points.len() >= 2, "{witness}");
        for point in &witness.points[witness.points.len() - 2..] {
            let value = enclosure(&tape, point);
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
