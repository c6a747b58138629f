//! The range of an expression over a box, by interval branch and bound.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node, Tape};

use crate::region::{Cell, Region};
use crate::{Coordinate, Dimension, Place, Point, Regularity};

/// Cells examined per end of the range.
const BUDGET: usize = 4000;
/// Sides up to which every face of every cell is looked at.
const FACES: usize = 3;
/// Refinement stops when the outer bound is this close to a value attained.
const TOLERANCE: f64 = 1e-3;

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
    let found = search(graph, node, &region, budget)?;
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
    let own = region.restricted(&graph.symbols_of(&[node]));
    let question = Glance(Question::new(node, &own, 0));
    let regular = match graph.noted(&question) {
        Some(known) => known,
        None => {
            let mut whole = [Interval::ENTIRE];
            let tape = Tape::new(graph, &own.symbols(), &[node])?;
            tape.evaluator_in(Intervals).eval(&own.cell(), &mut whole);
            let regular =
                whole[0].is_defined() || Regularity::of(graph, &[node], &[], &own)?.holds();
            graph.note(question, regular);
            regular
        }
    };
    match regular {
        true => Ok(range_within(graph, node, region, budget)?.enclosure),
        false => Ok(Interval::UNKNOWN),
    }
}

/// Whether an expression has values on the whole box.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Glance(Question);

/// What a range depends on; the graph keeps the answers.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Question {
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
    fn new(node: Node, region: &Region, budget: usize) -> Self {
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

fn search(
    graph: &Graph,
    node: Node,
    region: &Region,
    budget: usize,
) -> Result<Range, MissingInput> {
    let tape = Tape::new(graph, &region.symbols(), &[node])?;
    let mut search = Search {
        graph,
        evaluator: tape.evaluator(),
        bounds: tape.evaluator_in(Intervals),
        region,
        budget,
    };
    let lower = search.minimum(1.0);
    let upper = search.minimum(-1.0);
    let defined =
        (lower.defined && upper.defined) || Regularity::of(graph, &[node], &[], region)?.holds();
    let values = Interval::new(lower.bound, -upper.bound).ok();
    Ok(Range {
        enclosure: values.filter(|_| defined).unwrap_or(Interval::UNKNOWN),
        lowest: lower.best,
        highest: upper.best.map(|p| Point {
            value: -p.value,
            ..p
        }),
        weakest: lower.weakest,
    })
}

/// Cells ordered so that the one with the lowest bound comes first.
struct Open {
    bound: f64,
    cell: Cell,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound.total_cmp(&self.bound)
    }
}

struct Minimum {
    bound: f64,
    best: Option<Point>,
    defined: bool,
    weakest: Place,
}

struct Search<'a> {
    graph: &'a Graph,
    bounds: Evaluator<Intervals>,
    evaluator: Evaluator,
    region: &'a Region,
    budget: usize,
}

impl Search<'_> {
    /// The minimum of sign·f over the region.
    fn minimum(&mut self, sign: f64) -> Minimum {
        let whole = self.region.cell();
        let (bound, defined) = self.bound(&whole, sign);
        let mut best = self.sample(&whole, sign, None, true);
        let mut open = BinaryHeap::from([Open { bound, cell: whole }]);
        for _ in 0..self.budget {
            let Some(weakest) = open.peek() else { break };
            if close(weakest.bound, best.as_ref()) || self.graph.spent().is_some() {
                break;
            }
            let Some((first, second)) = self.region.split(&weakest.cell) else {
                break;
            };
            open.pop();
            for cell in [first, second] {
                best = self.sample(&cell, sign, best, false);
                let bound = self.bound(&cell, sign).0;
                open.push(Open { bound, cell });
            }
        }
        let (bound, weakest) = match open.peek() {
            Some(top) => (top.bound, self.region.named(&top.cell)),
            None => (bound, vec![]),
        };
        Minimum {
            bound,
            best,
            defined,
            weakest,
        }
    }

    /// (lower bound of sign·f on the cell, f is defined on all of it)
    fn bound(&mut self, cell: &Cell, sign: f64) -> (f64, bool) {
        let mut values = [Interval::ENTIRE];
        self.bounds.eval(cell, &mut values);
        let [value] = values;
        if value.is_empty() {
            return (f64::INFINITY, false);
        }
        let bound = if sign > 0.0 { value.lo() } else { -value.hi() };
        (bound, value.is_defined())
    }

    /// The best point so far, with those of a cell. Its faces are looked at only where they
    /// are few, or `all` is asked for: they cost more than the cell's bound.
    fn sample(
        &mut self,
        cell: &Cell,
        sign: f64,
        mut best: Option<Point>,
        all: bool,
    ) -> Option<Point> {
        let points = match all || cell.len() <= FACES {
            true => self.region.samples(cell),
            false => self.region.corners(cell),
        };
        for point in points {
            if !self.region.reaches(&point) {
                continue;
            }
            let mut out = [0.0];
            self.evaluator.eval(&point, &mut out);
            let value = sign * out[0];
            if !value.is_nan() && best.as_ref().is_none_or(|b| value < b.value) {
                best = Some(Point {
                    coordinates: named(&self.region.dimensions, &point),
                    value,
                });
            }
        }
        best
    }
}

fn named(dimensions: &[Dimension], point: &[f64]) -> Vec<Coordinate> {
    let pairs = dimensions.iter().zip(point);
    pairs.map(|(d, &x)| (d.name.clone(), x).into()).collect()
}

fn close(bound: f64, best: Option<&Point>) -> bool {
    best.is_some_and(|best| {
        let gap = best.value - bound;
        // equal infinities are as close as can be
        best.value == bound || gap <= TOLERANCE * best.value.abs()
    })
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
        for node in [x * (1.0 - x), (x * (x - 1.0) + 0.3).sqrt()] {
            let (quick, searched) = both(node.node());
            assert!(quick == searched && quick.is_defined());
            assert!(quick.magnitude() < 0.6);
        }
        let (quick, searched) = both((1.0 / (x - 0.5)).node());
        assert!(!quick.is_defined() && !searched.is_defined());
        assert_eq!(quick.magnitude(), f64::INFINITY);
    }
}
