//! The range of an expression over a box, by interval branch and bound.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node, Tape};

use crate::region::{Cell, Question, highest_corner, lowest_corner};
use crate::regularity::decisive;
use crate::{Place, Point, Region, regularity};

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
    let question = asked(graph, node, region, budget);
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let mut search = Search::new(graph, &question)?;
    let valued = search.has_values()?;
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
    let question = asked(graph, node, region, budget);
    let found = answered(graph, question, Range::clone, |s| both_ends(s, true))?;
    Ok(found.map_or(Interval::UNKNOWN, |range| range.enclosure))
}

/// What is known of the largest absolute value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnitude {
    /// none is larger; infinite where the expression may lack a value
    pub bound: f64,
    /// one is at least this
    pub attained: f64,
}

/// The magnitude of the [`enclosure_within`], at up to half its cost: the end of the range that
/// is nearer to zero is not sought.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn magnitude_within(
    graph: &Graph,
    node: Node,
    region: &Region,
    budget: usize,
) -> Result<Magnitude, MissingInput> {
    let question = asked(graph, node, region, budget);
    let told = |range: &Range| Magnitude {
        bound: range.enclosure.magnitude(),
        attained: furthest(&range.lowest).max(furthest(&range.highest)),
    };
    let found = answered(graph, question, told, |search| {
        let bound = search.magnitude();
        let attained = furthest(&search.lowest).max(furthest(&search.highest));
        Magnitude { bound, attained }
    })?;
    Ok(found.unwrap_or(Magnitude {
        bound: f64::INFINITY,
        attained: 0.0,
    }))
}

/// The absolute value at a point, 0 at none.
fn furthest(point: &Option<Point>) -> f64 {
    point.as_ref().map_or(0.0, |point| point.value.abs())
}

/// Whether an expression has a value everywhere on the region, and none is zero. What
/// [`range`] would find takes longer: its ends do not matter here.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn excludes_zero(graph: &Graph, node: Node, region: &Region) -> Result<bool, MissingInput> {
    let question = asked(graph, node, region, BUDGET);
    let told = |range: &Range| !range.enclosure.contains_zero() && range.enclosure.is_defined();
    let found = answered(graph, question, told, |s| s.excludes_zero())?;
    Ok(found.unwrap_or(false))
}

/// The question, in what the node reads.
fn asked(graph: &Graph, node: Node, region: &Region, budget: usize) -> Question {
    let region = region.restricted(&graph.symbols_of(&[node]));
    Question {
        node,
        region,
        budget,
    }
}

/// The answer to a question, `told` by the range where that is known; none where the expression
/// may lack a value.
fn answered<T: Clone + Send + Sync + 'static>(
    graph: &Graph,
    question: Question,
    told: impl Fn(&Range) -> T,
    find: impl Fn(&mut Search<'_>) -> T,
) -> Result<Option<T>, MissingInput> {
    let range = graph.noted::<_, Range>(&question);
    if let Some(known) = range.as_ref().map(told).or_else(|| graph.noted(&question)) {
        return Ok(Some(known));
    }
    if graph.noted(&question.whether_valued()) == Some(false) {
        return Ok(None);
    }
    let mut search = Search::new(graph, &question)?;
    if !search.has_values()? {
        return Ok(None);
    }
    let found = find(&mut search);
    graph.note(question, found.clone());
    Ok(Some(found))
}

fn both_ends(search: &mut Search<'_>, valued: bool) -> Range {
    let lower = search.end(End::Lower);
    let upper = search.end(End::Upper);
    let values = Interval::new(lower.bound, -upper.bound).ok();
    Range {
        enclosure: values.filter(|_| valued).unwrap_or(Interval::UNKNOWN),
        lowest: search.lowest.take(),
        highest: search.highest.take(),
        weakest: search.asked.region.named(&search.tree[lower.place].cell),
    }
}

/// Sides up to which every face of every cell is looked at.
const FACES: usize = 3;
/// Refinement stops when the outer bound is this close to a value attained.
const TOLERANCE: f64 = 1e-3;
/// A side that is narrower than this share of the region's is not halved for want of bounds alone.
const FINEST: f64 = 1e-4;
/// Cells between two looks at the clock.
const OFTEN: usize = 16;

/// Which end of the range is sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Lower,
    Upper,
}

impl End {
    /// A value seen from this end: less is further out.
    fn sees(self, value: f64) -> f64 {
        match self {
            End::Lower => value,
            End::Upper => -value,
        }
    }

    /// A bound of what this end sees of some values.
    fn bound(self, values: Interval) -> f64 {
        match self {
            _ if values.is_empty() => f64::INFINITY,
            End::Lower => values.lo(),
            End::Upper => -values.hi(),
        }
    }
}

/// A cell that was bounded.
struct Branch {
    cell: Cell,
    values: Interval,
    /// the first of its two halves, the second behind it
    halves: Option<usize>,
    sampled: bool,
    /// what it is a half of; none for the whole
    half: Option<Half>,
}

/// Of a cell that is half of another.
#[derive(Clone, Copy)]
struct Half {
    /// the other
    of: usize,
    /// its end at which this half is: they share that extreme corner
    end: End,
    /// the side that was halved
    side: usize,
}

/// A cell by its place in the tree, the one with the lowest bound first.
struct Open {
    /// every value on the cell is this or further in
    bound: f64,
    place: usize,
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

struct Search<'a> {
    graph: &'a Graph,
    bounds: Evaluator<Intervals>,
    evaluator: Evaluator,
    /// made once a cell has no bounds
    parts: Option<Parts>,
    asked: &'a Question,
    tree: Vec<Branch>,
    /// the smallest and the largest value attained
    lowest: Option<Point>,
    highest: Option<Point>,
    /// only a bound is asked for: while a cell has none, points decide nothing
    bound_only: bool,
}

impl<'a> Search<'a> {
    /// # Errors
    /// [`MissingInput`] where the node depends on a symbol outside the region.
    fn new(graph: &'a Graph, asked: &'a Question) -> Result<Self, MissingInput> {
        let tape = Tape::new(graph, &asked.region.symbols(), &[asked.node])?;
        let mut search = Self {
            graph,
            evaluator: tape.evaluator(),
            bounds: tape.evaluator_in(Intervals),
            parts: None,
            asked,
            tree: vec![],
            lowest: None,
            highest: None,
            bound_only: false,
        };
        search.add(asked.region.cell(), None);
        Ok(search)
    }

    /// Whether the node is seen to have a value everywhere: the whole region taken at once may show it.
    fn has_values(&self) -> Result<bool, MissingInput> {
        if self.tree[0].values.is_defined() {
            return Ok(true);
        }
        let question = self.asked.whether_valued();
        if let Some(known) = self.graph.noted(&question) {
            return Ok(known);
        }
        let (node, region) = (self.asked.node, &self.asked.region);
        let regular = regularity(self.graph, &[node], &[], region)?.is_proved();
        self.graph.note(question, regular);
        Ok(regular)
    }

    /// The end of the range, as well as the budget allows.
    fn end(&mut self, end: End) -> Open {
        self.end_beyond(end, f64::NEG_INFINITY, f64::INFINITY)
    }

    /// A bound of the absolute values, as well as the budget allows. The end that values were
    /// seen further out at is sought first; the other only as far as it is not nearer to zero.
    fn magnitude(&mut self) -> f64 {
        self.bound_only = true;
        self.sample(0, true);
        let size = |end: End| self.attained(end).map_or(0.0, f64::abs);
        let (first, second) = match size(End::Lower) > size(End::Upper) {
            true => (End::Lower, End::Upper),
            false => (End::Upper, End::Lower),
        };
        let size = -self.end(first).bound;
        if size == f64::INFINITY {
            return size;
        }
        size.max(-self.end_beyond(second, f64::NEG_INFINITY, -size).bound)
    }

    /// Whether no value is zero, as well as the budget allows: not once values of both signs were seen.
    fn excludes_zero(&mut self) -> bool {
        self.sample(0, true);
        let keeps = |end: &End| self.attained(*end).is_some_and(|value| value > 0.0);
        let Some(end) = [End::Lower, End::Upper].into_iter().find(keeps) else {
            return false;
        };
        self.end_beyond(end, 0.0, f64::MIN_POSITIVE).bound > 0.0
    }

    /// The same where a bound of `enough` is as good as a better one, and none matters once a value of at
    /// most `hopeless` was seen.
    fn end_beyond(&mut self, end: End, hopeless: f64, enough: f64) -> Open {
        self.sample(0, true);
        let mut open = BinaryHeap::from([Open {
            bound: end.bound(self.tree[0].values),
            place: 0,
        }]);
        // halves at which no point was looked at yet
        let mut unseen = vec![];
        for step in 0..self.asked.budget {
            let Some(weakest) = open.peek() else { break };
            if !(self.bound_only && weakest.bound == f64::NEG_INFINITY) {
                self.sample_all(&mut unseen, end);
            }
            let looks = step % OFTEN == 0;
            let is_hopeless = self.attained(end).is_some_and(|best| best <= hopeless);
            let done = is_hopeless || weakest.bound >= enough || self.is_close(weakest.bound, end);
            if done || looks && self.graph.spent().is_some() {
                break;
            }
            let Some(first) = self.halved(weakest.place) else {
                break;
            };
            open.pop();
            for place in [first, first + 1] {
                let bound = end.bound(self.tree[place].values);
                unseen.push(place);
                open.push(Open { bound, place });
            }
        }
        if !(self.bound_only
            && open
                .peek()
                .is_some_and(|open| open.bound == f64::NEG_INFINITY))
        {
            self.sample_all(&mut unseen, end);
        }
        // one cell stands there from the start, and two take the place of one
        open.pop().unwrap_or(Open {
            bound: f64::INFINITY,
            place: 0,
        })
    }

    /// Looks at points of some cells, one after the other: where no value can be further out than
    /// one attained, none is tried.
    fn sample_all(&mut self, places: &mut Vec<usize>, end: End) {
        let faces = self.asked.region.dimensions.len() <= FACES;
        for place in places.drain(..) {
            let bound = end.bound(self.tree[place].values);
            if self.attained(end).is_none_or(|best| bound < best) {
                self.sample(place, faces);
            }
        }
    }

    fn add(&mut self, cell: Cell, half: Option<Half>) {
        self.tree.push(Branch {
            values: self.bounds.value(&cell),
            cell,
            halves: None,
            sampled: false,
            half,
        });
    }

    /// The place of the first half of a cell; none where it has no halves.
    fn halved(&mut self, place: usize) -> Option<usize> {
        if let Some(first) = self.tree[place].halves {
            return Some(first);
        }
        let guilty = self.guilty(place);
        let whole = &self.tree[place].cell;
        let among = |sides: &[Node]| self.asked.region.split_among(whole, sides, FINEST);
        let found = among(&guilty).or_else(|| self.asked.region.split(whole));
        let [one, other] = found?;
        let side = (0..whole.len()).find(|&i| one[i] != whole[i])?;
        let half = |end| {
            let of = place;
            Some(Half { of, end, side })
        };
        let first = self.tree.len();
        self.add(one, half(End::Lower));
        self.add(other, half(End::Upper));
        self.tree[place].halves = Some(first);
        Some(first)
    }

    /// The symbols to which it lies that a cell has no bounds: halving the others finds none.
    fn guilty(&mut self, place: usize) -> Vec<Node> {
        let branch = &self.tree[place];
        if branch.values.is_bounded() {
            return vec![];
        }
        if self.parts.is_none() {
            self.parts = Parts::new(self.graph, self.asked).ok();
        }
        let parts = self.parts.as_mut();
        parts.map_or_else(Vec::new, |parts| parts.guilty(&branch.cell))
    }

    fn is_close(&self, bound: f64, end: End) -> bool {
        self.attained(end).is_some_and(|best| {
            // equal infinities are as close as can be
            best == bound || best - bound <= TOLERANCE * best.abs()
        })
    }

    /// The value furthest out, as the end sees it.
    fn attained(&self, end: End) -> Option<f64> {
        let best = match end {
            End::Lower => self.lowest.as_ref(),
            End::Upper => self.highest.as_ref(),
        };
        best.map(|best| end.sees(best.value))
    }

    /// Looks at the middle of a cell and its two extreme corners, and at the middles of its
    /// faces where `faces` asks for them: these cost more than the cell's bound. Whoever halves
    /// a cell has looked at its corners.
    fn sample(&mut self, place: usize, faces: bool) {
        if std::mem::replace(&mut self.tree[place].sampled, true) {
            return;
        }
        let half = self.tree[place].half;
        let shared = half.map(|half| half.end);
        // the middles of the faces beside the cut are points of the whole
        let seen = half
            .filter(|half| self.has_seen_faces(half))
            .map(|half| half.side);
        let cell = std::mem::take(&mut self.tree[place].cell);
        let mut point = self.asked.region.middle_point(&cell);
        self.look(&point);
        if shared != Some(End::Lower) {
            self.look(&lowest_corner(&cell));
        }
        if shared != Some(End::Upper) {
            self.look(&highest_corner(&cell));
        }
        let sides = cell
            .iter()
            .enumerate()
            .filter(|(i, _)| faces && Some(*i) != seen);
        for (i, side) in sides {
            let middle = point[i];
            for end in [side.lo(), side.hi()] {
                point[i] = end;
                self.look(&point);
            }
            point[i] = middle;
        }
        self.tree[place].cell = cell;
    }

    /// Whether the points of a half's faces on both sides of the cut were looked at when the whole was.
    fn has_seen_faces(&self, half: &Half) -> bool {
        // the halves of whole numbers have a gap between them
        let is_cut = !self.asked.region.dimensions[half.side].integer;
        is_cut && self.tree[half.of].sampled
    }

    fn look(&mut self, at: &[f64]) {
        if !(at.iter().all(|x| x.is_finite()) && self.asked.region.reaches(at)) {
            return;
        }
        let value = self.evaluator.value(at);
        if value.is_nan() {
            return;
        }
        let attained = || self.asked.region.point(at, value);
        if self.lowest.as_ref().is_none_or(|best| value < best.value) {
            self.lowest = Some(attained());
        }
        if self.highest.as_ref().is_none_or(|best| value > best.value) {
            self.highest = Some(attained());
        }
    }
}

/// Everything that an expression is made of, to be bounded on a cell.
struct Parts {
    values: Evaluator<Intervals>,
    /// in the order of evaluation; of an operation its arguments' places and the symbols it reads
    steps: Vec<Part>,
}

struct Part {
    arguments: Vec<usize>,
    /// those to which it lies where it has no bounds and its arguments have
    symbols: Vec<Node>,
    /// none of its own: a system of equations, of which entries have values
    is_valued: bool,
}

impl Parts {
    fn new(graph: &Graph, asked: &Question) -> Result<Self, MissingInput> {
        let nodes = graph.reachable(&[asked.node]);
        let place: HashMap<Node, usize> = nodes.iter().enumerate().map(|(i, &n)| (n, i)).collect();
        let part = |&node: &Node| Part {
            arguments: graph.arguments(node).iter().map(|a| place[a]).collect(),
            symbols: graph.symbols_of(&decisive(graph, node)),
            is_valued: !graph.op(node).is_system(),
        };
        let steps: Vec<Part> = nodes.iter().map(part).collect();
        let valued = nodes.iter().zip(&steps).filter(|(_, step)| step.is_valued);
        let valued: Vec<Node> = valued.map(|(&node, _)| node).collect();
        let tape = Tape::new(graph, &asked.region.symbols(), &valued)?;
        Ok(Self {
            values: tape.evaluator_in(Intervals),
            steps,
        })
    }

    /// The symbols of the first operation that has no bounds where its arguments have; none where a side
    /// has no end.
    fn guilty(&mut self, cell: &[Interval]) -> Vec<Node> {
        let mut values = vec![Interval::ENTIRE; self.values.tape().outputs()];
        self.values.eval(cell, &mut values);
        let mut values = values.into_iter();
        let mut bounded: Vec<bool> = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            let given = step.arguments.iter().all(|&a| bounded[a]);
            let own = match step.is_valued {
                true => values.next().is_some_and(|values| values.is_bounded()),
                false => given,
            };
            if given && !own && !step.arguments.is_empty() {
                return step.symbols.clone();
            }
            bounded.push(own);
        }
        vec![]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dimension;

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
        let size = |node: Node| magnitude_within(&g, node, &region, 600).unwrap().bound;
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

    /// Of eight sides only that of y decides whether there are bounds: others are not halved to find them.
    #[test]
    fn a_quotient_among_many_sides_has_bounds() {
        let g = Graph::new();
        let names = ["y", "a", "b", "c", "d", "e", "f", "h"];
        let x = names.map(|name| g.symbol(name));
        let dimensions = names.iter().zip(&x);
        let region = Region {
            dimensions: dimensions
                .map(|(name, x)| Dimension::new(*name, x.node(), -3.0, 3.0))
                .collect(),
        };
        // at least 1/2, but not to intervals on the whole of the side
        let below = x[0].powi(2) + (1.0 - x[0]).powi(2);
        let others = x[1..].iter().fold(g.constant(1.0), |sum, x| sum + x.sin());
        let node = (others / (below - 0.1)).node();
        let found = magnitude_within(&g, node, &region, 60).unwrap();
        assert!(found.bound.is_finite() && found.bound > 2.0);
        assert!(found.attained <= found.bound);
    }

    /// The second end costs fewer cells than it does alone, and is the same.
    #[test]
    fn the_ends_share_their_cells() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let f = (x * y - x * x + (x - y).sin() * y).node();
        let side = |name: &str, symbol: Node| Dimension {
            name: name.into(),
            symbol,
            min: -1.0,
            max: 2.0,
            integer: false,
        };
        let region = Region {
            dimensions: vec![side("x", x.node()), side("y", y.node())],
        };
        let of = |ends: &[End]| {
            let asked = asked(&g, f, &region, 400);
            let mut search = Search::new(&g, &asked).unwrap();
            let found: Vec<f64> = ends.iter().map(|&end| search.end(end).bound).collect();
            (found, search.tree.len())
        };
        let (both, cells) = of(&[End::Lower, End::Upper]);
        let ((lower, first), (upper, second)) = (of(&[End::Lower]), of(&[End::Upper]));
        assert!(cells < first + second - 1, "{cells} {first} {second}");
        assert_eq!(both[0], lower[0]);
        assert!((both[1] - upper[0]).abs() <= 2.0 * TOLERANCE * upper[0].abs());
        for i in 0..=60 {
            for j in 0..=60 {
                let (x, y) = (-1.0 + 0.05 * f64::from(i), -1.0 + 0.05 * f64::from(j));
                let value = x * y - x * x + (x - y).sin() * y;
                assert!(both[0] <= value && value <= -both[1]);
            }
        }
    }
}
