//! The range of an expression over a box, by interval branch and bound.

mod search;

use lynkeus_expr::{Graph, Interval, MissingInput, Node};

use crate::{Dimension, Place, Point, Region, Regularity};
use search::{End, Search};

/// Cells examined per end of the range.
const BUDGET: usize = 4000;

/// What is known of the values of an expression on a box.
#[derive(Clone, Debug)]
pub struct Range {
    /// rigorous: the expression has a value everywhere on the box, and all lie inside; the
    /// whole line, not [defined](Interval::is_defined), where it may lack one (√ of a
    /// negative, 1/0)
    pub enclosure: Interval,
    /// the smallest value found at a point
    pub lowest: Option<Point>,
    /// the largest value found at a point
    pub highest: Option<Point>,
    /// the cell that keeps the enclosure from being tighter at its lower end
    pub weakest: Place,
}

/// Encloses the values of `node` for variables in `region`.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn range(graph: &Graph, node: Node, region: &Region) -> Result<Range, MissingInput> {
    range_within(graph, node, region, BUDGET)
}

/// [`range`] with at most `budget` cells examined per end: quicker and looser.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn range_within(
    graph: &Graph,
    node: Node,
    region: &Region,
    budget: usize,
) -> Result<Range, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let question = Question::new(node, &region, budget);
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let mut search = Search::new(graph, node, &region, budget)?;
    let valued = has_values(graph, node, &region, &search)?;
    let found = both_ends(&mut search, valued);
    graph.note(question, found.clone());
    Ok(found)
}

/// The [enclosure](Range::enclosure) of [`range_within`] without the points: nothing is searched
/// where the expression may lack a value.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn enclosure_within(
    graph: &Graph,
    node: Node,
    region: &Region,
    budget: usize,
) -> Result<Interval, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let question = Question::new(node, &region, budget);
    if let Some(known) = graph.noted::<_, Range>(&question) {
        return Ok(known.enclosure);
    }
    let Some(mut search) = valued(graph, node, &region, budget)? else {
        return Ok(Interval::UNKNOWN);
    };
    let found = both_ends(&mut search, true);
    graph.note(question, found.clone());
    Ok(found.enclosure)
}

/// The magnitude of the [`enclosure_within`], at up to half its cost: the end of the range that
/// is nearer to zero is not sought. Infinite where the expression may lack a value.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn magnitude_within(
    graph: &Graph,
    node: Node,
    region: &Region,
    budget: usize,
) -> Result<f64, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let question = Question::new(node, &region, budget);
    if let Some(known) = graph.noted::<_, Range>(&question) {
        return Ok(known.enclosure.magnitude());
    }
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let Some(mut search) = valued(graph, node, &region, budget)? else {
        return Ok(f64::INFINITY);
    };
    let size = search.magnitude();
    graph.note(question, size);
    Ok(size)
}

/// Whether an expression has a value everywhere on the region, and none is zero. What
/// [`range`] would find takes longer: its ends do not matter here.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn excludes_zero(graph: &Graph, node: Node, region: &Region) -> Result<bool, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let question = Question::new(node, &region, BUDGET);
    if let Some(known) = graph.noted::<_, Range>(&question) {
        return Ok(!known.enclosure.contains_zero() && known.enclosure.is_defined());
    }
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let found = match valued(graph, node, &region, BUDGET)? {
        Some(mut search) => search.excludes_zero(),
        None => false,
    };
    graph.note(question, found);
    Ok(found)
}

/// The search of an expression that has a value everywhere on the region; none of another.
fn valued<'a>(
    graph: &'a Graph,
    node: Node,
    region: &'a Region,
    budget: usize,
) -> Result<Option<Search<'a>>, MissingInput> {
    if graph.noted(&Glance(Question::new(node, region, 0))) == Some(false) {
        return Ok(None);
    }
    let search = Search::new(graph, node, region, budget)?;
    let valued = has_values(graph, node, region, &search)?;
    Ok(valued.then_some(search))
}

/// Whether an expression is seen to have a value everywhere on the region.
fn has_values(
    graph: &Graph,
    node: Node,
    region: &Region,
    search: &Search<'_>,
) -> Result<bool, MissingInput> {
    if search.is_defined() {
        return Ok(true);
    }
    let question = Glance(Question::new(node, region, 0));
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let regular = Regularity::of(graph, &[node], &[], region)?.holds();
    graph.note(question, regular);
    Ok(regular)
}

/// Whether an expression has values on the whole box.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Glance(Question);

/// What a search on a region depends on; the graph keeps the answers.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(crate) struct Question {
    node: Node,
    sides: Vec<Side>,
    budget: usize,
}

#[derive(Clone, PartialEq, Eq, Hash)]
struct Side {
    name: String,
    symbol: Node,
    /// bits of min and max
    ends: [u64; 2],
    integer: bool,
}

impl Question {
    pub fn new(node: Node, region: &Region, budget: usize) -> Self {
        let side = |side: &Dimension| Side {
            name: side.name.clone(),
            symbol: side.symbol,
            ends: [side.min, side.max].map(f64::to_bits),
            integer: side.integer,
        };
        Self {
            node,
            sides: region.dimensions.iter().map(side).collect(),
            budget,
        }
    }
}

fn both_ends(search: &mut Search<'_>, valued: bool) -> Range {
    let lower = search.end(End::Lower);
    let upper = search.end(End::Upper);
    let values = Interval::new(lower.bound, -upper.bound).ok();
    Range {
        enclosure: values.filter(|_| valued).unwrap_or(Interval::UNKNOWN),
        lowest: search.point(End::Lower),
        highest: search.point(End::Upper),
        weakest: lower.weakest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where it has values everywhere it is that of the search; beside a pole there is none, and
    /// a root that interval arithmetic loses only on the whole box is there all the same.
    #[test]
    fn an_enclosure_is_that_of_the_range() {
        let g = Graph::new();
        let x = g.symbol("x");
        let region = Region {
            dimensions: vec![Dimension {
                name: "x".into(),
                symbol: x.node(),
                min: 0.0,
                max: 1.0,
                integer: false,
            }],
        };
        let both = |node: Node| {
            let quick = enclosure_within(&g, node, &region, 600).unwrap();
            (
                quick,
                range_within(&g, node, &region, 600).unwrap().enclosure,
            )
        };
        let size = |node: Node| magnitude_within(&g, node, &region, 600).unwrap();
        let root = (x * (x - 1.0) + 0.3).sqrt();
        for node in [
            x * (1.0 - x),
            x * (x - 1.0),
            (x - 0.4).sin() * x - 0.1,
            root,
        ] {
            let size = size(node.node());
            let (quick, searched) = both(node.node());
            assert!(quick == searched && quick.is_defined());
            assert!(quick.magnitude() < 0.6);
            // found before the range was, and the same
            assert_eq!(size, quick.magnitude());
        }
        assert_eq!(size((1.0 / (x - 0.5)).node()), f64::INFINITY);
        let (quick, searched) = both((1.0 / (x - 0.5)).node());
        assert!(!quick.is_defined() && !searched.is_defined());
        assert_eq!(quick.magnitude(), f64::INFINITY);
    }
}
