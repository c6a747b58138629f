//! Has an expression a value everywhere on the box, and does it jump?
//!
//! A function that is continuous on each of finitely many closed cells is continuous on
//! their union, so the box is halved where a cell does not decide it. On a convex box a
//! continuous expression is, along any line, absolutely continuous wherever its
//! derivative is bounded: this is what the mean value theorem in every proof of this
//! project rests on, kinks included. A jump ends such a proof, however small the
//! derivative beside it is.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Evaluator, Graph, Interval, MissingInput, Node, Op, Tape};

use crate::jumps::{meets, without_removable_jumps};
use crate::region::{Cell, Question};
use crate::{Finding, Reason, Region, Verdict, Witness};

/// Cells looked at.
const BUDGET: usize = 3000;
/// Parts of one expression that are searched alone.
const PARTS: usize = 16;
/// A side halved so many times says where it is.
const FINEST: f64 = 1e-4;

/// Decides whether `nodes` have values everywhere on the region and jump nowhere: a jump counts
/// where one of the `moving` symbols causes it, what time or inputs switch does not.
///
/// Proved, or undecided with the place. Never refuted: a jump or a missing value in a
/// part of an expression need not be one of the whole, and the plant need not go there.
///
/// # Errors
/// [`MissingInput`] where an expression reads a symbol outside the region.
pub fn regularity(
    graph: &Graph,
    nodes: &[Node],
    moving: &[Node],
    region: &Region,
) -> Result<Finding, MissingInput> {
    // the whole box decides most plants: one walk through what the expressions share
    let mut walk = Walk::new(graph, nodes, moving, region)?;
    if walk.trouble(&region.cell()).is_none() {
        return Ok(Finding::proved(Reason::Regular));
    }
    for &node in nodes {
        let node = without_removable_jumps(graph, &[node])[0];
        if let Some(trouble) = search(graph, node, moving, region)? {
            return Ok(trouble);
        }
    }
    Ok(Finding::proved(Reason::Regular))
}

/// Whether an expression has a value where a witness of another one lies; what the witness
/// does not tell is in the middle of its range.
///
/// # Errors
/// [`MissingInput`] where the expression reads a symbol outside the region.
pub fn has_value_at(
    graph: &Graph,
    node: Node,
    witness: &Witness,
    region: &Region,
) -> Result<bool, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let mut walk = Walk::new(graph, &[node], &[], &region)?;
    let middle = region.middle_point(&region.cell());
    for point in &witness.points {
        let told = |name: &str| point.coordinates.iter().find(|c| c.name == name);
        let sides = region.dimensions.iter().zip(&middle);
        let cell: Cell = sides
            .map(|(d, &middle)| Interval::point(told(&d.name).map_or(middle, |c| c.value)))
            .collect();
        if walk.trouble(&cell).is_some() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether an expression has values everywhere on one cell and does not jump there,
/// whichever symbol moves: a change of its sign is then a zero.
pub(crate) fn is_regular(
    graph: &Graph,
    node: Node,
    region: &Region,
    cell: &Cell,
) -> Result<bool, MissingInput> {
    let mut walk = Walk::new(graph, &[node], &region.symbols(), region)?;
    Ok(walk.trouble(cell).is_none())
}

/// The first place where it is not decided, depth first: a true jump is found after a few
/// dozen cells, an overestimated range goes on until every cell is decided.
///
/// Where a part has no value the whole has none, if nothing in it is chosen: such a part is
/// searched alone, once for all that are made of it, as derivatives of one expression are.
/// A jump is not: what is constant all the same does not jump with its parts.
fn search(
    graph: &Graph,
    node: Node,
    moving: &[Node],
    region: &Region,
) -> Result<Option<Finding>, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let mut walk = Walk::new(graph, &[node], moving, &region)?;
    let mut asked = vec![node];
    let mut open: Vec<Cell> = vec![region.cell()];
    let mut seen = 0;
    while let Some(cell) = open.pop() {
        seen += 1;
        let Some((culprit, known)) = walk.trouble(&cell) else {
            continue;
        };
        let spoils = walk.needs_all() && !known.values.is_defined();
        if spoils && asked.len() <= PARTS && !asked.contains(&culprit) {
            let found = part(graph, culprit, moving, &region)?;
            if let Some(Reason::NoValue { .. }) = found.as_ref().map(|found| &found.reason) {
                return Ok(found);
            }
            asked.push(culprit);
        }
        let among = |nodes: &[Node]| {
            let used = graph.symbols_of(nodes);
            region.split_among(&cell, &used, FINEST)
        };
        let lasts = seen < BUDGET && graph.spent().is_none();
        let decidable = lasts && !known.values.is_empty();
        let halves = decidable
            .then(|| among(&decisive(graph, culprit)).or_else(|| among(&[culprit])))
            .flatten();
        match halves {
            Some([first, second]) => open.extend([second, first]),
            None => return Ok(Some(told(graph, &region, &cell, culprit, known.values))),
        }
    }
    Ok(None)
}

/// What decides whether an operation has a value and bounds where its arguments have: of a quotient the divisor, of
/// linear equations the matrix.
pub(crate) fn decisive(graph: &Graph, node: Node) -> Vec<Node> {
    let matrix = |system: Node| {
        let call = graph.system(system)?;
        call.linear().map(|(A, _)| A.to_vec())
    };
    let found = match graph.op(node) {
        Op::Binary(Binary::Div, _, divisor) => Some(vec![divisor]),
        Op::Entry(system, _) => matrix(system),
        _ => None,
    };
    found.unwrap_or_else(|| vec![node])
}

/// [`search`] of a part, which the graph remembers.
fn part(
    graph: &Graph,
    node: Node,
    moving: &[Node],
    region: &Region,
) -> Result<Option<Finding>, MissingInput> {
    let symbols = graph.symbols_of(&[node]);
    let moving = moving.iter().copied().filter(|m| symbols.contains(m));
    let moving: Vec<Node> = moving.collect();
    let asked = Question {
        node,
        region: region.restricted(&symbols),
        budget: BUDGET,
    };
    let question = (asked, moving);
    if let Some(known) = graph.noted(&question) {
        return Ok(known);
    }
    let found = search(graph, node, &question.1, &question.0.region)?;
    graph.note(question, found.clone());
    Ok(found)
}

fn told(graph: &Graph, region: &Region, cell: &Cell, culprit: Node, values: Interval) -> Finding {
    let used = graph.symbols_of(&[culprit]);
    let mut place = region.named(cell);
    place.retain(|side| used.contains(&side.symbol));
    let verdict = Verdict::Undecided(place.clone());
    let operation = graph.render(culprit, 60);
    let reason = match values.is_defined() {
        true => Reason::Jumps { operation, place },
        false => Reason::NoValue {
            operation,
            place,
            certain: values.is_empty(),
        },
    };
    Finding { verdict, reason }
}

/// Whether an operation that steps stands between a node and one of the symbols, wherever
/// in the box: what has no derivative in a symbol may still depend on it.
pub fn steps(graph: &Graph, node: Node, symbols: &[Node]) -> bool {
    let depends = |n: Node| graph.symbols_of(&[n]).iter().any(|s| symbols.contains(s));
    let is_step = |&n: &Node| match graph.op(n) {
        Op::Select(condition, ..) => depends(condition),
        _ => graph.jumps(n) && depends(n),
    };
    graph.reachable(&[node]).iter().any(is_step)
}

/// What is known of a node on a cell.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// encloses its values, and says whether it has one everywhere
    values: Interval,
    /// it does not jump as the moving symbols do
    continuous: bool,
}

/// One operation, its arguments by their places.
struct Step {
    node: Node,
    op: Op,
    arguments: Vec<usize>,
    /// depends on a symbol that moves
    moves: bool,
    /// a selection whose branches agree where it changes from one to the other
    glued: bool,
}

/// Expressions in the order of their evaluation.
struct Walk<'g> {
    graph: &'g Graph,
    steps: Vec<Step>,
    /// places of the roots
    roots: Vec<usize>,
    /// of every node but the systems, in that order
    values: Evaluator<Intervals>,
    known: Vec<Known>,
}

impl<'g> Walk<'g> {
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol outside the region.
    fn new(
        graph: &'g Graph,
        roots: &[Node],
        moving: &[Node],
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let nodes = graph.reachable(roots);
        let place: HashMap<Node, usize> = nodes.iter().enumerate().map(|(i, &n)| (n, i)).collect();
        let valued = nodes.iter().filter(|node| !graph.op(**node).is_system());
        let valued: Vec<Node> = valued.copied().collect();
        let values = Tape::new(graph, &region.symbols(), &valued)?;
        let moving: HashSet<Node> = moving.iter().copied().collect();
        let mut steps: Vec<Step> = vec![];
        for &node in &nodes {
            let arguments: Vec<usize> = graph.arguments(node).iter().map(|a| place[a]).collect();
            let moves = moving.contains(&node) || arguments.iter().any(|&a| steps[a].moves);
            steps.push(Step {
                node,
                op: graph.op(node),
                arguments,
                moves,
                glued: meets(graph, node, region),
            });
        }
        Ok(Self {
            graph,
            roots: roots.iter().map(|root| place[root]).collect(),
            values: values.evaluator_in(Intervals),
            known: Vec::with_capacity(steps.len()),
            steps,
        })
    }

    /// The first node that may lack a value or jump on the cell, with what is known of it;
    /// none where every root has a value everywhere and does not jump.
    fn trouble(&mut self, cell: &[Interval]) -> Option<(Node, Known)> {
        // one cell may take long where systems are large
        let mut steps = self.steps.iter();
        if let Some(entry) = steps.find(|step| matches!(step.op, Op::Entry(..)))
            && self.graph.spent().is_some()
        {
            let (values, continuous) = (Interval::UNKNOWN, false);
            return Some((entry.node, Known { values, continuous }));
        }
        let mut values = vec![Interval::ENTIRE; self.values.tape().outputs()];
        self.values.eval(cell, &mut values);
        let mut values = values.into_iter();
        self.known.clear();
        for step in &self.steps {
            let values = match step.op.is_system() {
                // it has no value of its own, and must not pass for a constant
                true => Interval::ENTIRE,
                false => values.next().unwrap_or(Interval::UNKNOWN),
            };
            // whatever it is made of: a constant does not jump
            let constant = values.is_defined() && values.is_point();
            let continuous = constant || !step.moves || self.continuous(step, values);
            self.known.push(Known { values, continuous });
        }
        let fails = |k: Known| !(k.continuous && k.values.is_defined());
        if !self.roots.iter().any(|&root| fails(self.known[root])) {
            return None;
        }
        let needed = self.needed();
        let first = (0..self.steps.len()).find(|&i| needed[i] && fails(self.known[i]))?;
        Some((self.steps[first].node, self.known[first]))
    }

    /// Whether every operation is needed wherever the roots are: none is chosen.
    fn needs_all(&self) -> bool {
        let mut steps = self.steps.iter();
        !steps.any(|step| matches!(step.op, Op::Select(..)))
    }

    /// The nodes behind the roots' troubles: a branch that is not taken is none.
    fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.steps.len()];
        for &root in &self.roots {
            needed[root] = true;
        }
        for (i, step) in self.steps.iter().enumerate().rev() {
            if !needed[i] {
                continue;
            }
            let untaken = match (step.op, &step.arguments[..]) {
                (Op::Select(..), &[c, a, b]) => {
                    decided(self.known[c].values).map(|taken| if taken { b } else { a })
                }
                _ => None,
            };
            for &argument in &step.arguments {
                needed[argument] |= Some(argument) != untaken;
            }
        }
        needed
    }

    fn continuous(&self, step: &Step, values: Interval) -> bool {
        let of = |argument: usize| self.known[step.arguments[argument]];
        let moves = |argument: usize| self.steps[step.arguments[argument]].moves;
        match step.op {
            Op::Constant(_) | Op::Symbol(_) => true,
            // they step where their values differ
            Op::Unary(..) | Op::Binary(..) if self.graph.jumps(step.node) => false,
            Op::Binary(Binary::Atan2, ..) => {
                let cut = of(0).values.contains_zero() && of(1).values.lo() < 0.0;
                of(0).continuous && of(1).continuous && !(cut && moves(0))
            }
            Op::Binary(Binary::Pow, ..) => {
                // 0^0 is 1, and every number from 0 to 1 is near it
                let corner = of(0).values.contains_zero()
                    && of(1).values.contains_zero()
                    && !of(1).values.is_point();
                of(0).continuous && of(1).continuous && !corner
            }
            Op::Select(..) => match decided(of(0).values) {
                Some(true) => of(1).continuous,
                Some(false) => of(2).continuous,
                None => (!moves(0) || step.glued) && of(1).continuous && of(2).continuous,
            },
            // the condition estimate steps with the pivots; a root that is the only one of
            // equations that do not jump moves with them
            Op::Entry(system, i) => {
                // an implicit function has none
                let call = self.graph.system(system);
                let last = call.is_some_and(|call| i as usize == call.size());
                of(0).continuous && values.is_defined() && !last
            }
            Op::Unary(..) | Op::Powi(..) | Op::Binary(..) | Op::System(_) => {
                let mut arguments = step.arguments.iter();
                arguments.all(|&a| self.known[a].continuous)
            }
        }
    }
}

/// The one truth value of a condition.
fn decided(condition: Interval) -> Option<bool> {
    match (condition.is_empty(), condition.contains_zero()) {
        (false, false) => Some(true),
        (false, true) if condition.is_point() => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
