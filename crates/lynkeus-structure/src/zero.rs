//! Is an expression zero on the whole box? Decided by intervals.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape};

use crate::region::{inside, spread};
use crate::{Region, Verdict};

/// Points tried beside those on the edges of the box.
const POINTS: usize = 12;

/// Decides whether `node` is zero on the whole region. Refuted by a point where the value
/// cannot be a rounding error; undecided where it may be zero at every point tried.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn vanishes(graph: &Graph, node: Node, region: &Region) -> Result<Verdict, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let tape = Tape::new(graph, &region.symbols(), &[node])?;
    let mut bounds = tape.evaluator_in(Intervals);
    let whole = region.cell();
    if bounds.value(&whole).is_zero() {
        return Ok(Verdict::Proved);
    }
    let mut points: Vec<Vec<f64>> = (0..POINTS).map(|p| generic(&region, p)).collect();
    points.extend(region.samples(&whole));
    for point in points {
        if graph.spent().is_some() {
            break;
        }
        let cell: Vec<Interval> = point.iter().map(|&x| Interval::point(x)).collect();
        let enclosure = bounds.value(&cell);
        let sure = enclosure.is_positive() || enclosure.is_negative();
        if sure && enclosure.magnitude().is_finite() {
            let value = enclosure.lo() + (enclosure.hi() - enclosure.lo()) / 2.0;
            return Ok(Verdict::Refuted(region.point(&point, value).into()));
        }
    }
    Ok(Verdict::open())
}

/// A point inside the region on no particular surface.
fn generic(region: &Region, point: usize) -> Vec<f64> {
    let sides = region.dimensions.iter().enumerate();
    let coordinate = |(i, d): (usize, &crate::Dimension)| {
        let x = inside(d.min, d.max, spread(point, i));
        if d.integer { x.round() } else { x }
    };
    sides.map(coordinate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dimension;

    #[test]
    fn zero_everywhere_somewhere_and_perhaps() {
        let g = Graph::new();
        let x = g.symbol("x");
        let region = Region {
            dimensions: vec![Dimension {
                name: "x".into(),
                symbol: x.node(),
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
                integer: false,
            }],
        };
        let decide = |node| vanishes(&g, node, &region).unwrap();
        assert_eq!(decide((0.0 * x).node()), Verdict::Proved);
        // zero at the middle of the box, which is not enough
        assert!(matches!(decide((x * x).node()), Verdict::Refuted(_)));
        let one = x.sin().powi(2) + x.cos().powi(2) - 1.0;
        assert_eq!(decide(one.node()), Verdict::open());
    }
}
