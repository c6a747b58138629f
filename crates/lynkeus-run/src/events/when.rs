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
use crate::method::are_finite;
use crate::run::Grid;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Result};

/// Most rounds of one event.
const ROUNDS: usize = 100;

/// Most instants of one timer in an interval.
const INSTANTS: usize = 1_000_000;

/// Events in a row that come sooner and sooner, down to so small a share of the time since the first of them.
const HURRIED: usize = 5;
const SOON: f64 = 1e-4;

/// Events in a row between which time hardly goes on, against the time that it is.
const AT_ONCE: usize = 200;
const HARDLY: f64 = 1e-12;

/// A quantity that goes so far beyond where it was at the last of them, against its largest value, is
/// not held back any more.
const BEYOND: f64 = 1e-6;

/// γ̇ is nothing against what it is made of.
const GRAZING: f64 = 1e-9;

/// Two instants so near to each other, in units of rounding, are one.
const SAME: f64 = 8.0 * f64::EPSILON;

/// What clauses are, beside their expressions.
#[derive(Debug)]
pub(crate) struct Shape {
    clauses: Vec<ClauseShape>,
    timers: Vec<Timer>,
    /// of each condition, the relations that it is made of
    needs: Vec<Vec<usize>>,
}

#[derive(Debug)]
struct ClauseShape {
    group: usize,
    line: usize,
    /// how many conditions it has; none of what holds at every event
    conditions: usize,
    /// places of the states that it changes
    changes: Vec<usize>,
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
        let relations = relations(graph, &conditions, &always, &flows);
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
        let shape = Shape {
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

    /// Conditions, values, relations and quantities.
    fn parts(&self) -> [&[Node]; 4] {
        let shape = &self.shape;
        let values = shape.clauses.iter().map(|c| c.changes.len()).sum();
        let (conditions, rest) = self.nodes.split_at(shape.needs.len());
        let (values, rest) = rest.split_at(values);
        let (relations, quantities) = rest.split_at(rest.len() / 2);
        [conditions, values, relations, quantities]
    }
}

/// The relations of conditions that a flow can change, and which of them each condition is made of: those
/// of an equation that gives a variable that it reads are its own.
fn relations(
    graph: &Graph,
    conditions: &[Node],
    always: &HashMap<Node, Node>,
    flows: &HashSet<Node>,
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
            if is_relation && symbols.iter().any(|symbol| flows.contains(symbol)) {
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
    shape: Arc<Shape>,
    states: usize,
    conditions: Tape,
    /// how many relations there are
    relations: usize,
    /// they, then their quantities, over the inputs of the system alone
    seen: Tape,
    /// entries of the slopes of the quantities by the states
    gradient: (Tape, Vec<(usize, usize)>),
    /// of each clause its new values, with their slopes by states, states before, and time
    values: Vec<Tape>,
    slopes: Vec<(Tape, Vec<(usize, usize)>)>,
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
            gradient: slopes(quantities, own, inputs)?,
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
            if *i == relation {
                row[*j] = *value;
            }
        }
        row
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
fn first_after(timer: &Timer, t: f64) -> usize {
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

/// What is remembered of clauses from one event to the next.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    is_started: bool,
    /// whether each condition holds
    truths: Vec<bool>,
    /// the next instant of each timer
    timers: Vec<usize>,
    /// the state at the end of the last interval
    last: Vec<f64>,
    /// of each clause
    hurry: Vec<Hurry>,
    /// when any clause took effect last, and events in a row between which time hardly went on
    newest: f64,
    at_once: usize,
    /// a clause that takes effect ever sooner, and its relation
    suspect: Option<(usize, usize)>,
}

/// When a clause took effect.
#[derive(Clone, Copy, Debug)]
struct Hurry {
    /// last
    at: f64,
    /// so long after the time before
    apart: f64,
    /// how often in a row sooner than before, and since when
    streak: usize,
    since: f64,
}

impl Default for Hurry {
    fn default() -> Self {
        Self {
            at: f64::NEG_INFINITY,
            apart: f64::INFINITY,
            streak: 0,
            since: 0.0,
        }
    }
}

impl Persist for Memory {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        // none of a system without clauses: nothing is kept of it
        let mut count = walk.length(self.truths.len())?;
        self.truths.resize(count, false);
        self.truths.iter_mut().try_for_each(|t| walk.flag(t))?;
        self.is_started = count > 0;
        count = walk.length(self.timers.len())?;
        self.timers.resize(count, 0);
        self.timers.iter_mut().try_for_each(|t| walk.count(t))?;
        count = walk.length(self.last.len())?;
        self.last.resize(count, 0.0);
        walk.numbers(&mut self.last)?;
        count = walk.length(self.hurry.len())?;
        self.hurry.resize(count, Hurry::default());
        for hurry in &mut self.hurry {
            walk.number(&mut hurry.at)?;
            walk.number(&mut hurry.apart)?;
            walk.count(&mut hurry.streak)?;
            walk.number(&mut hurry.since)?;
        }
        walk.number(&mut self.newest)?;
        walk.count(&mut self.at_once)?;
        walk.optional(&mut self.suspect, |walk, suspect| {
            walk.count(&mut suspect.0)?;
            walk.count(&mut suspect.1)
        })
    }
}

/// The slopes of a jump.
#[derive(Clone, Debug, Default)]
pub(crate) struct JumpSlopes {
    /// ∂g/∂x, row by row
    pub by_state: Vec<f64>,
    /// ∂g/∂t
    pub by_time: Vec<f64>,
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

/// One event under way.
struct Rounds<'a> {
    clauses: &'a Clauses,
    /// what the system's code reads but for time and states; then those before, and timers
    inputs: Vec<f64>,
    x: &'a mut [f64],
    slopes: Option<&'a mut JumpSlopes>,
}

impl Clauses {
    /// Goes through the event at these inputs, of which the states are `x`: the condition that came to
    /// hold first, where the state may have jumped.
    pub(crate) fn happen(
        &self,
        inputs: &[f64],
        x: &mut [f64],
        memory: &mut Memory,
        slopes: Option<&mut JumpSlopes>,
    ) -> Result<Option<usize>> {
        let (t, n) = (inputs[0], self.states);
        let mut inputs = inputs.to_vec();
        inputs.extend_from_slice(x);
        inputs.resize(inputs.len() + self.shape.timers.len(), 0.0);
        let mut rounds = Rounds {
            clauses: self,
            inputs,
            x,
            slopes,
        };
        rounds.begin();
        let is_first = !memory.is_started;
        if is_first {
            memory.begin(self, t);
            memory.truths = rounds.truths();
        }
        let mut first = None;
        let mut line = 0;
        for round in 0..ROUNDS {
            let before = rounds.x.to_vec();
            let is_due = round == 0 && rounds.set_timers(memory, t, is_first);
            rounds.remember(n);
            let kept = rounds.kept();
            rounds.always(t, &kept)?;
            let truths = rounds.truths();
            let rises = |c: usize| truths[c] && !memory.truths[c];
            let rising: Vec<bool> = (0..truths.len()).map(rises).collect();
            memory.truths.clone_from(&truths);
            let mut place = 0;
            let mut done: Vec<usize> = vec![];
            for (k, clause) in self.shape.clauses.iter().enumerate() {
                let own = place..place + clause.conditions;
                place = own.end;
                let risen = own.clone().find(|&c| rising[c]);
                let Some(risen) = risen.filter(|_| !done.contains(&clause.group)) else {
                    continue;
                };
                done.push(clause.group);
                rounds.apply(k, t, &kept)?;
                line = clause.line;
                first.get_or_insert(risen);
            }
            if done.is_empty() && !is_due && before == *rounds.x {
                return Ok(first);
            }
            if before != *rounds.x && done.is_empty() {
                first.get_or_insert(usize::MAX);
            }
            rounds.clear_timers();
        }
        Err(Error::EndlessEvents {
            time: t,
            line,
            how: format!("its event leads to the next one, {ROUNDS} times at one instant"),
        })
    }

    /// The clause of a condition.
    fn clause_of(&self, condition: usize) -> usize {
        let mut end = 0;
        let mut clauses = self.shape.clauses.iter();
        let place = clauses.position(|clause| {
            end += clause.conditions;
            condition < end
        });
        place.unwrap_or(0)
    }

    /// The line of a clause that has this condition.
    fn line_of(&self, condition: usize) -> usize {
        self.shape.clauses[self.clause_of(condition)].line
    }
}

impl Rounds<'_> {
    fn begin(&mut self) {
        let n = self.x.len();
        if let Some(slopes) = &mut self.slopes {
            slopes.by_state = vec![0.0; n * n];
            (0..n).for_each(|i| slopes.by_state[i * n + i] = 1.0);
            slopes.by_time = vec![0.0; n];
        }
    }

    /// The first place of what is aside.
    fn aside(&self) -> usize {
        self.inputs.len() - self.x.len() - self.clauses.shape.timers.len()
    }

    /// The states as they are now are those before.
    fn remember(&mut self, n: usize) {
        let aside = self.aside();
        self.inputs[aside..aside + n].copy_from_slice(self.x);
    }

    fn set_timers(&mut self, memory: &mut Memory, t: f64, is_first: bool) -> bool {
        let first = self.inputs.len() - self.clauses.shape.timers.len();
        let mut is_due = false;
        for (k, timer) in self.clauses.shape.timers.iter().enumerate() {
            let is_now = match timer.is_initial {
                true => is_first,
                false => {
                    let grid = Grid::new(timer.start, timer.interval);
                    let due = grid.time(memory.timers[k]) <= t + SAME * t.abs();
                    if due {
                        memory.timers[k] = first_after(timer, t) + 1;
                    }
                    due
                }
            };
            self.inputs[first + k] = f64::from(u8::from(is_now));
            is_due |= is_now;
        }
        is_due
    }

    fn clear_timers(&mut self) {
        let first = self.inputs.len() - self.clauses.shape.timers.len();
        self.inputs[first..].fill(0.0);
    }

    fn now(&mut self) -> &[f64] {
        self.inputs[1..=self.x.len()].copy_from_slice(self.x);
        &self.inputs
    }

    fn truths(&mut self) -> Vec<bool> {
        let clauses = self.clauses;
        let values = clauses.conditions.eval_in(&Reals, self.now());
        values.iter().map(|value| *value != 0.0).collect()
    }

    /// The slopes of the states before the round.
    fn kept(&self) -> JumpSlopes {
        self.slopes.as_deref().cloned().unwrap_or_default()
    }

    /// The equations of discrete variables.
    fn always(&mut self, t: f64, kept: &JumpSlopes) -> Result<()> {
        let clauses = self.clauses;
        let all = clauses.shape.clauses.iter().enumerate();
        for (k, _) in all.filter(|(_, clause)| clause.conditions == 0) {
            self.apply(k, t, kept)?;
        }
        Ok(())
    }

    /// A clause takes effect.
    fn apply(&mut self, k: usize, t: f64, kept: &JumpSlopes) -> Result<()> {
        let clauses = self.clauses;
        let clause = &clauses.shape.clauses[k];
        let values = clauses.values[k].eval_in(&Reals, self.now());
        if !are_finite(&values) {
            return Err(Error::NotFinite {
                time: t,
                operation: format!("what the `when` of line {} gives", clause.line),
                state: crate::error::state_text(&names(self.x.len()), self.x),
            });
        }
        if self.slopes.is_some() {
            self.carry(k, kept);
        }
        for (&place, value) in clause.changes.iter().zip(values) {
            self.x[place] = value;
        }
        Ok(())
    }

    fn carry(&mut self, k: usize, kept: &JumpSlopes) {
        let n = self.x.len();
        let clauses = self.clauses;
        let (tape, places) = &clauses.slopes[k];
        let entries = tape.eval_in(&Reals, self.now());
        let changes = &clauses.shape.clauses[k].changes;
        let Some(slopes) = &mut self.slopes else {
            return;
        };
        let mut rows = vec![vec![0.0; n]; changes.len()];
        let mut times = vec![0.0; changes.len()];
        for (entry, &(row, column)) in entries.iter().zip(places) {
            let from = match column {
                _ if column < n => Some((&**slopes, column)),
                _ if column < 2 * n => Some((kept, column - n)),
                _ => None,
            };
            let Some((from, j)) = from else {
                times[row] += entry;
                continue;
            };
            for (sum, part) in rows[row].iter_mut().zip(&from.by_state[j * n..(j + 1) * n]) {
                *sum += entry * part;
            }
            times[row] += entry * from.by_time[j];
        }
        for ((&place, row), time) in changes.iter().zip(rows).zip(times) {
            slopes.by_state[place * n..(place + 1) * n].copy_from_slice(&row);
            slopes.by_time[place] = time;
        }
    }
}

fn names(count: usize) -> Vec<String> {
    (1..=count).map(|i| format!("x[{i}]")).collect()
}

impl Memory {
    fn begin(&mut self, clauses: &Clauses, t: f64) {
        self.is_started = true;
        let first = |timer: &Timer| match timer.is_initial {
            true => 0,
            false => first_after(timer, t),
        };
        self.timers = clauses.shape.timers.iter().map(first).collect();
        self.hurry = vec![Hurry::default(); clauses.shape.clauses.len()];
    }

    /// An interval is over.
    pub(crate) fn leave(&mut self, x: &[f64]) {
        self.last.clear();
        self.last.extend_from_slice(x);
    }

    /// A condition came to hold at `t`: whether clauses come ever sooner.
    fn hurried(
        &mut self,
        clauses: &Clauses,
        t: f64,
        condition: usize,
        relation: Option<usize>,
    ) -> Result<()> {
        if condition == usize::MAX {
            return Ok(());
        }
        let k = clauses.clause_of(condition);
        let hurry = &mut self.hurry[k];
        let now = t - hurry.at;
        let hardly = now <= HARDLY * t.abs();
        // rounding decides which of such times is the shorter one
        let is_sooner = now < hurry.apart || hardly;
        (hurry.streak, hurry.since) = match is_sooner && hurry.at.is_finite() {
            true => (hurry.streak + 1, hurry.since),
            false => (0, t),
        };
        (hurry.at, hurry.apart) = (t, now);
        let is_suspect = hurry.streak >= HURRIED && now <= SOON * (t - hurry.since);
        self.suspect = relation
            .filter(|_| is_suspect)
            .map(|relation| (k, relation));
        let apart = t - std::mem::replace(&mut self.newest, t);
        self.at_once = match apart <= HARDLY * t.abs() {
            true => self.at_once + 1,
            false => 0,
        };
        match self.at_once > AT_ONCE {
            true => Err(Error::EndlessEvents {
                time: t,
                line: clauses.line_of(condition),
                how: "its events follow each other without time going on (a threshold without hysteresis, or a Zeno point)".to_owned(),
            }),
            false => Ok(()),
        }
    }

    /// Whether something is suspected.
    pub(crate) fn suspects(&self) -> bool {
        self.suspect.is_some()
    }

    /// That what took effect ever sooner still holds the state back: quantities as they are at `t`, and
    /// how large they were.
    pub(crate) fn check(
        &mut self,
        clauses: &Clauses,
        t: f64,
        seen: &[Seen],
        largest: impl Fn(usize) -> f64,
    ) -> Result<()> {
        let Some((k, relation)) = self.suspect else {
            return Ok(());
        };
        let Seen { holds, value } = seen[relation];
        if holds && value > BEYOND * largest(relation) {
            return Err(Error::EndlessEvents {
                time: t,
                line: clauses.shape.clauses[k].line,
                how: "its events come sooner and sooner, and end at this time (Zeno's paradox)"
                    .to_owned(),
            });
        }
        Ok(())
    }

    /// What a correction of the state has changed is no event, but where the flow goes on into it: of
    /// the conditions that hold since then, those that are to take effect keep it to be found.
    fn rebase(&mut self, truths: &[bool], needs: &[Vec<usize>], away: &[bool], flipped: &[bool]) {
        for (c, truth) in truths.iter().enumerate() {
            let own: Vec<usize> = needs[c].iter().copied().filter(|&r| flipped[r]).collect();
            let leaves = !own.is_empty() && own.iter().all(|&r| away[r]);
            if !truth || leaves {
                self.truths[c] = *truth;
            }
        }
    }
}

/// The event at `t`, in an interval of some length: `before` is the derivative that led to it, and `flipped` are
/// the relations that changed. `restart` tells the system that its state has jumped. Whether it has.
pub(crate) fn occur<D: Dynamics>(
    f: &mut D,
    memory: &mut Memory,
    (t, length): (f64, f64),
    x: &mut [f64],
    flipped: &[usize],
    restart: impl FnOnce(&mut D, &[f64]),
) -> Result<bool> {
    let Some(clauses) = f.clauses() else {
        return Ok(false);
    };
    let old = x.to_vec();
    let mut before = vec![0.0; x.len()];
    f.derivatives(t, x, &mut before);
    let mut causes = flipped.to_vec();
    let mut late = vec![0.0; clauses.relations];
    // what somebody else has changed since the end of the last interval
    let n = clauses.states;
    if memory.is_started && memory.last.len() == n && memory.last != x[..n] {
        let rates = rates(f, (t, length), x, &before);
        let (mut was, mut now) = (vec![], vec![]);
        let mut there = x.to_vec();
        there[..n].copy_from_slice(&memory.last);
        f.watch(t, &there, &mut was);
        f.watch(t, x, &mut now);
        let pairs = was.iter().zip(&now);
        let flips: Vec<bool> = pairs.map(|(a, b)| a.holds != b.holds).collect();
        let outward = now.iter().zip(&rates).map(|(seen, rate)| match seen.holds {
            true => *rate < 0.0,
            false => *rate > 0.0,
        });
        let outward: Vec<bool> = outward.collect();
        for (r, rate) in rates
            .iter()
            .enumerate()
            .filter(|(r, _)| flips[*r] && !outward[*r])
        {
            late[r] = (now[r].value / rate).clamp(0.0, length);
            causes.push(r);
        }
        let truths = f.truths(t, x)?;
        memory.rebase(&truths, &clauses.shape.needs, &outward, &flips);
        memory.last.clear();
    }
    let Some(condition) = f.happen(t, x, memory)? else {
        return Ok(false);
    };
    let needs = clauses.shape.needs.get(condition);
    let mut own = causes
        .iter()
        .filter(|r| needs.is_none_or(|needs| needs.contains(r)));
    let relation = own.next().copied();
    memory.hurried(&clauses, t, condition, relation)?;
    let cause = relation.map(|relation| Cause {
        relation,
        rate: rates(f, (t, length), &old, &before)[relation],
        late: late[relation],
    });
    restart(f, x);
    let mut after = vec![0.0; x.len()];
    f.derivatives(t, x, &mut after);
    let line = match condition {
        usize::MAX => clauses
            .shape
            .clauses
            .first()
            .map_or(0, |clause| clause.line),
        condition => clauses.line_of(condition),
    };
    f.settle((t, &old), x, [&before, &after], cause, line)?;
    Ok(true)
}

impl Clauses {
    /// How many states there are, before what a wrapper adds.
    pub(crate) fn states(&self) -> usize {
        self.states
    }

    /// Conditions for these inputs, where no timer is due and nothing was before.
    pub(crate) fn truths(&self, inputs: &[f64]) -> Result<Vec<bool>> {
        let mut x = inputs[1..=self.states].to_vec();
        let mut inputs = inputs.to_vec();
        inputs.extend_from_slice(&x);
        inputs.resize(inputs.len() + self.shape.timers.len(), 0.0);
        let t = inputs[0];
        let mut rounds = Rounds {
            clauses: self,
            inputs,
            x: &mut x,
            slopes: None,
        };
        rounds.always(t, &JumpSlopes::default())?;
        rounds.remember(self.states);
        Ok(rounds.truths())
    }
}

/// How fast the quantities change as the state moves with dx: central differences.
pub(crate) fn rates<D: Dynamics>(
    f: &mut D,
    (t, length): (f64, f64),
    x: &[f64],
    dx: &[f64],
) -> Vec<f64> {
    let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let stays = (1e-5 * size(x).max(1e-3)) / size(dx).max(f64::MIN_POSITIVE);
    let step = (1e-5 * length).min(stays);
    let mut at = |step: f64| {
        let moved: Vec<f64> = x.iter().zip(dx).map(|(x, dx)| x + step * dx).collect();
        let mut seen = vec![];
        f.watch(t + step, &moved, &mut seen);
        seen
    };
    let (after, before) = (at(step), at(-step));
    let rate = |(after, before): (&Seen, &Seen)| (after.value - before.value) / (2.0 * step);
    after.iter().zip(&before).map(rate).collect()
}

/// What an event does to deviations: the saltation matrix, row by row, and how far the state has to be moved
/// for an event that is late. The rates before and after the event are those of the states.
///
/// # Errors
/// [`Error::Grazing`] where the time of the event is not told by the state.
pub(crate) fn saltation(
    slopes: &JumpSlopes,
    gradient: &[f64],
    [before, after]: [&[f64]; 2],
    cause: Option<Cause>,
    (t, line): (f64, usize),
) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = slopes.by_time.len();
    let mut matrix = slopes.by_state.clone();
    let mut moved = vec![0.0; n];
    let Some(cause) = cause else {
        return Ok((matrix, moved));
    };
    let off = |i: usize| {
        let row = &slopes.by_state[i * n..(i + 1) * n];
        let carried: f64 = row.iter().zip(before).map(|(g, f)| g * f).sum();
        after[i] - carried - slopes.by_time[i]
    };
    let off: Vec<f64> = (0..n).map(off).collect();
    if off.iter().all(|off| *off == 0.0) {
        return Ok((matrix, moved));
    }
    let made: f64 = gradient
        .iter()
        .zip(before)
        .map(|(c, f)| (c * f).abs())
        .sum();
    if cause.rate.abs() <= GRAZING * made || cause.rate == 0.0 {
        let touches = gradient.iter().any(|c| *c != 0.0);
        if touches {
            return Err(Error::Grazing { time: t, line });
        }
        return Ok((matrix, moved));
    }
    for i in 0..n {
        for (entry, c) in matrix[i * n..(i + 1) * n].iter_mut().zip(gradient) {
            *entry += off[i] * c / cause.rate;
        }
        moved[i] = off[i] * cause.late;
    }
    Ok((matrix, moved))
}
