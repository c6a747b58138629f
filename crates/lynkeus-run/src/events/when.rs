//! Events at which the state jumps: `when` clauses.
//!
//! A clause takes effect when one of its conditions comes to hold that did not hold before. What a
//! condition is made of are relations, whose quantities are watched along a step, so that an
//! integrator stops a little beyond where one of them passes zero; what holds is then read off the
//! values themselves, and not off the sides that velocities tell. An event is gone through in rounds, as the language has
//! it: in each the equations of discrete variables hold, and all clauses that are due take effect
//! in order of the text, by the values that were before the round; the next round sees what has
//! changed, until nothing is due any more.
//!
//! An event that the state causes by itself comes earlier or later as the state differs: with the
//! jump x⁺ = g(x), the rates f⁻ and f⁺ on both sides and the quantity γ that passes zero, a
//! deviation goes on as δ⁺ = Ξδ with the saltation matrix
//! Ξ = ∂g/∂x + (f⁺ − ∂g/∂x f⁻ − ∂g/∂t) ∇γᵀ/γ̇ (N. J. Kong, J. J. Payne, J. Zhu and A. M. Johnson, "Saltation
//! matrices: the essential tool for linearizing hybrid dynamical systems", *Proceedings of the IEEE* 112
//! (2024) 585–608).

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Op, Reals, Tape, jacobian};
use lynkeus_model::{Timer, Whens};

use super::guards::Surface;
use crate::grid::Grid;
use crate::{Error, Result};

/// Most instants of one timer in an interval.
const INSTANTS: usize = 1_000_000;

/// Two instants so near to each other, in units of rounding, are one.
pub(super) const SAME: f64 = 8.0 * f64::EPSILON;

/// What clauses are, beside their expressions.
#[derive(Debug)]
pub(crate) struct Shape {
    pub clauses: Vec<ClauseShape>,
    pub timers: Vec<Timer>,
    /// of each condition, the relations that it is made of
    pub needs: Vec<Vec<usize>>,
    /// states that clauses alone change, to values that depend on no other states and not on time: where they
    /// start without a deviation they never have one
    pub discrete: Vec<usize>,
}

/// What a clause is beside its expressions.
#[derive(Debug)]
pub struct ClauseShape {
    /// of clauses with one number the first that is due takes effect
    pub group: usize,
    /// of the text, from 1
    pub line: usize,
    /// how many conditions it has; none of what holds at every event
    pub conditions: usize,
    /// places of the states that it changes
    pub changes: Vec<usize>,
}

/// The expressions of clauses, in the graph of their system.
#[derive(Clone, Debug)]
pub(crate) struct WhenRoots {
    shape: Arc<Shape>,
    /// symbols: the states before the event, then the timers
    pub aside: Vec<Node>,
    /// conditions, new values, relations with their quantities
    pub nodes: Vec<Node>,
}

impl WhenRoots {
    /// The expressions that are copied into the graph of a system.
    pub fn read(whens: &Whens) -> Vec<Node> {
        let clauses = whens.clauses.iter();
        let parts = clauses.flat_map(|clause| {
            let values = clause.changes.iter().map(|change| change.1);
            clause.conditions.iter().copied().chain(values)
        });
        let symbols = whens.before.iter().map(|pair| pair.1);
        let symbols = symbols.chain(whens.timers.iter().map(|timer| timer.symbol));
        parts.chain(symbols).collect()
    }

    /// How many of these are conditions and values.
    pub fn count(whens: &Whens) -> usize {
        let clauses = whens.clauses.iter();
        clauses.map(|c| c.conditions.len() + c.changes.len()).sum()
    }

    /// Of clauses whose expressions are `images` by now, over these states as the plant has them and
    /// as the graph has them, time and what else moves. States at rest are told by their rates.
    pub fn new(
        graph: &Graph,
        whens: &Whens,
        states: &[Node],
        moving: &[Node],
        rates: &[Node],
        images: &[Node],
        symbols: &HashMap<Node, Node>,
    ) -> Self {
        let own = &moving[1..=states.len()];
        let before = |state: &Node| {
            let mut pairs = whens.before.iter();
            let known = pairs.find(|pair| pair.0 == *state);
            known.map_or_else(|| graph.fresh("pre").node(), |pair| symbols[&pair.1])
        };
        let before: Vec<Node> = states.iter().map(before).collect();
        let timers = whens.timers.iter().map(|timer| symbols[&timer.symbol]);
        let aside: Vec<Node> = before.iter().copied().chain(timers).collect();
        let mut images = images.iter().copied();
        let (mut conditions, mut values, mut clauses) = (vec![], vec![], vec![]);
        let mut always: HashMap<Node, Node> = HashMap::new();
        for clause in &whens.clauses {
            conditions.extend(images.by_ref().take(clause.conditions.len()));
            let mut changes = vec![];
            for (state, _) in &clause.changes {
                let (Some(value), Some(place)) =
                    (images.next(), states.iter().position(|s| s == state))
                else {
                    continue;
                };
                changes.push(place);
                values.push(value);
                if clause.conditions.is_empty() {
                    always.insert(own[place], value);
                }
            }
            clauses.push(ClauseShape {
                group: clause.group,
                line: clause.line,
                conditions: clause.conditions.len(),
                changes,
            });
        }
        let at_rest = |(state, rate): (&Node, &Node)| {
            (graph.constant_value(*rate) == Some(0.0)).then_some(*state)
        };
        let at_rest: HashSet<Node> = own.iter().zip(rates).filter_map(at_rest).collect();
        let flows: HashSet<Node> = moving
            .iter()
            .copied()
            .filter(|s| !at_rest.contains(s))
            .collect();
        let relations = relations(graph, &conditions, &always, (&flows, moving[0]));
        let (relations, needs) = relations;
        let nothing = graph.constant(0.0).node();
        let now = before.iter().copied().zip(own.iter().copied());
        let timers = aside[states.len()..].iter().map(|&timer| (timer, nothing));
        let now: HashMap<Node, Node> = now.chain(timers).collect();
        let relations = graph.substitute(&relations, &now);
        let quantity = |relation: &Node| match graph.op(*relation) {
            Op::Binary(_, a, b) => graph.binary(Binary::Sub, b, a),
            _ => *relation,
        };
        let quantities: Vec<Node> = relations.iter().map(quantity).collect();
        let rests = (0..states.len()).filter(|&i| at_rest.contains(&own[i]));
        let by = [own, &before, &moving[..1]].concat();
        let slopes = jacobian::forward(graph, &values, &by).entries;
        let changed: Vec<usize> = clauses.iter().flat_map(|c| c.changes.clone()).collect();
        let slopes = slopes.iter().map(|slope| (changed[slope.0], slope.1));
        let shape = Shape {
            discrete: discrete(rests.collect(), &slopes.collect::<Vec<_>>(), states.len()),
            clauses,
            timers: whens.timers.clone(),
            needs,
        };
        Self {
            shape: Arc::new(shape),
            aside,
            nodes: [conditions, values, relations, quantities].concat(),
        }
    }

    /// The surfaces on which relations change.
    pub fn surfaces(&self, graph: &Graph) -> impl Iterator<Item = Surface> {
        let parts = self.parts();
        let surface = |&node: &Node| Surface {
            node,
            name: format!("{} = 0", graph.render(node, 60)),
            counts: false,
            is_watched: true,
        };
        parts[3].iter().map(surface).collect::<Vec<_>>().into_iter()
    }

    /// What they are beside their expressions.
    pub(super) fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Conditions, values, relations and quantities.
    pub(super) fn parts(&self) -> [&[Node]; 4] {
        let shape = &self.shape;
        let values = shape.clauses.iter().map(|c| c.changes.len()).sum();
        let (conditions, rest) = self.nodes.split_at(shape.needs.len());
        let (values, rest) = rest.split_at(values);
        let (relations, quantities) = rest.split_at(rest.len() / 2);
        [conditions, values, relations, quantities]
    }
}

/// Of states at rest, of so many, those that no clause makes depend on others: slopes are by states, states
/// before, and time.
fn discrete(mut rests: Vec<usize>, slopes: &[(usize, usize)], states: usize) -> Vec<usize> {
    loop {
        let is_free =
            |(_, by): &(usize, usize)| *by == 2 * states || !rests.contains(&(by % states));
        let freed: Vec<usize> = slopes.iter().filter(|s| is_free(s)).map(|s| s.0).collect();
        let count = rests.len();
        rests.retain(|state| !freed.contains(state));
        if rests.len() == count {
            return rests;
        }
    }
}

/// The relations of conditions that a flow can change, and which of them each condition is made of: those
/// of an equation that gives a variable that it reads are its own. What the clock alone decides is told by timers.
fn relations(
    graph: &Graph,
    conditions: &[Node],
    always: &HashMap<Node, Node>,
    (flows, time): (&HashSet<Node>, Node),
) -> (Vec<Node>, Vec<Vec<usize>>) {
    let mut found: Vec<Node> = vec![];
    let mut relations_of = |roots: &[Node]| {
        let mut own = vec![];
        for node in graph.reachable(roots) {
            let is_relation = matches!(
                graph.op(node),
                Op::Binary(Binary::Less | Binary::LessEq, ..)
            );
            let symbols = graph.symbols_of(&[node]);
            let is_watched =
                symbols != [time] && symbols.iter().any(|symbol| flows.contains(symbol));
            if is_relation && is_watched {
                let place = found.iter().position(|known| *known == node);
                own.push(place.unwrap_or(found.len()));
                if place.is_none() {
                    found.push(node);
                }
            }
        }
        own
    };
    let needs = conditions.iter().map(|&condition| {
        let mut roots = vec![condition];
        loop {
            let read = graph.symbols_of(&roots).into_iter();
            let more = read.filter_map(|symbol| always.get(&symbol).copied());
            let more: Vec<Node> = more.filter(|node| !roots.contains(node)).collect();
            if more.is_empty() {
                break relations_of(&roots);
            }
            roots.extend(more);
        }
    });
    let needs: Vec<Vec<usize>> = needs.collect();
    relations_of(&always.values().copied().collect::<Vec<_>>());
    (found, needs)
}

/// `when` clauses as code.
#[derive(Debug)]
pub struct Clauses {
    pub(super) shape: Arc<Shape>,
    pub(super) states: usize,
    pub(super) conditions: Tape,
    /// how many relations there are
    pub(super) relations: usize,
    /// they, then their quantities, over the inputs of the system alone
    seen: Tape,
    /// entries of the slopes of the quantities by all that these inputs are
    gradient: (Tape, Vec<(usize, usize)>),
    /// of each clause its new values, with their slopes by states, states before, and time
    pub(super) values: Vec<Tape>,
    pub(super) slopes: Vec<(Tape, Vec<(usize, usize)>)>,
}

impl Clauses {
    /// Of a system with these inputs: time and so many states first.
    pub(crate) fn new(
        graph: &Graph,
        inputs: &[Node],
        states: usize,
        roots: &WhenRoots,
    ) -> Result<Self, MissingInput> {
        let [conditions, values, relations, quantities] = roots.parts();
        let all = [inputs, &roots.aside].concat();
        let own = &inputs[1..=states];
        let slopes = |of: &[Node], by: &[Node], over: &[Node]| {
            let entries = jacobian::forward(graph, of, by).entries;
            let nodes: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
            let places = entries.iter().map(|entry| (entry.0, entry.1)).collect();
            Ok((Tape::new(graph, over, &nodes)?, places))
        };
        let by = [own, &roots.aside[..states], &inputs[..1]].concat();
        let mut left = values;
        let parts = roots.shape.clauses.iter().map(|clause| {
            let own;
            (own, left) = left.split_at(clause.changes.len());
            own
        });
        let parts: Vec<&[Node]> = parts.collect();
        let values = parts.iter().map(|values| Tape::new(graph, &all, values));
        Ok(Self {
            shape: roots.shape.clone(),
            states,
            conditions: Tape::new(graph, &all, conditions)?,
            relations: relations.len(),
            seen: Tape::new(graph, inputs, &[relations, quantities].concat())?,
            gradient: slopes(quantities, inputs, inputs)?,
            values: values.collect::<Result<_, _>>()?,
            slopes: parts
                .iter()
                .map(|of| slopes(of, &by, &all))
                .collect::<Result<_, _>>()?,
        })
    }

    /// What relations and quantities are for these inputs.
    pub(crate) fn see(&self, inputs: &[f64], seen: &mut Vec<Seen>) {
        let values = self.seen.eval_in(&Reals, inputs);
        let (holds, quantities) = values.split_at(values.len() / 2);
        seen.clear();
        let pairs = holds.iter().zip(quantities);
        seen.extend(pairs.map(|(holds, value)| Seen {
            holds: *holds != 0.0,
            value: *value,
        }));
    }

    /// The slopes of a quantity by the states.
    pub(crate) fn gradient(&self, inputs: &[f64], relation: usize) -> Vec<f64> {
        let values = self.gradient.0.eval_in(&Reals, inputs);
        let mut row = vec![0.0; self.states];
        for (value, (i, j)) in values.iter().zip(&self.gradient.1) {
            if *i == relation && (1..=self.states).contains(j) {
                row[*j - 1] = *value;
            }
        }
        row
    }

    /// How fast the quantities change where the inputs change so fast, time among them.
    pub(crate) fn rates(&self, inputs: &[f64], speeds: &[f64]) -> Vec<f64> {
        let values = self.gradient.0.eval_in(&Reals, inputs);
        let mut rates = vec![0.0; self.relations];
        for (value, (i, j)) in values.iter().zip(&self.gradient.1) {
            rates[*i] += value * speeds[*j];
        }
        rates
    }

    /// The instants of timers strictly inside an interval.
    pub(crate) fn instants(&self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<()> {
        for timer in self.shape.timers.iter().filter(|timer| !timer.is_initial) {
            let grid = Grid::new(timer.start, timer.interval);
            let mut next = first_after(timer, from);
            let mut count = 0;
            while grid.time(next) < to {
                if grid.time(next) > from {
                    times.push(grid.time(next));
                }
                (next, count) = (next + 1, count + 1);
                if count > INSTANTS {
                    return Err(Error::TooManySwitches {
                        expression: format!("sample({}, {})", timer.start, timer.interval),
                        from,
                        to,
                        limit: INSTANTS,
                    });
                }
            }
        }
        Ok(())
    }
}

/// The first instant that is not before a time.
pub(super) fn first_after(timer: &Timer, t: f64) -> usize {
    let about = ((t - timer.start) / timer.interval).floor().max(1.0) as usize - 1;
    let grid = Grid::new(timer.start, timer.interval);
    let is_before = |k: &usize| grid.time(*k) < t - SAME * t.abs();
    (about..).find(|k| !is_before(k)).unwrap_or(about)
}

/// A relation where a state is: whether it holds, and the quantity that is positive where it does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    pub(crate) holds: bool,
    pub(crate) value: f64,
}

/// Why an event came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cause {
    /// the relation that changed
    pub(crate) relation: usize,
    /// γ̇, how fast its quantity changed
    pub(crate) rate: f64,
    /// how long ago that was
    pub(crate) late: f64,
}

impl Clauses {
    /// The clause of a condition.
    pub(super) fn clause_of(&self, condition: usize) -> usize {
        let mut end = 0;
        let mut clauses = self.shape.clauses.iter();
        let place = clauses.position(|clause| {
            end += clause.conditions;
            condition < end
        });
        place.unwrap_or(0)
    }

    /// States that have no deviation unless they start with one.
    pub(crate) fn discrete(&self) -> &[usize] {
        &self.shape.discrete
    }

    /// The line of the first clause.
    pub(crate) fn first_line(&self) -> usize {
        self.shape.clauses.first().map_or(0, |clause| clause.line)
    }

    /// The line of a clause that has this condition.
    pub(super) fn line_of(&self, condition: usize) -> usize {
        self.shape.clauses[self.clause_of(condition)].line
    }
}
