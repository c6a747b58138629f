//! The search for a root: Newton's method from the declared start, then from others; of what
//! jumps, on one side after another. What is found follows from p alone, so that it needs no place
//! in a snapshot, and lanes and replays find the same.

use super::newton::Newton;
use crate::code::Sides;
use crate::{Evaluator, Implicit, Interval};

/// Starts tried besides the declared one.
const STARTS: usize = 16;
/// Sides followed from that of the start.
const ROUNDS: usize = 64;
/// Sides tried where those lead to none: all of up to eight conditions.
const COMBINATIONS: usize = 255;

impl Implicit {
    /// z with g(z, p) = 0 within rounding, in the declared range.
    ///
    /// # Errors
    /// Why no root was found.
    pub(crate) fn root(&self, p: &[f64]) -> Result<Vec<f64>, String> {
        let mut sides = self
            .0
            .sides
            .as_ref()
            .map(|sides| BySides::new(self, sides, p));
        if let Some(z) = sides.as_mut().and_then(BySides::root) {
            return Ok(z);
        }
        let mut search = Newton::new(self, p);
        let first = search.newton(self.start());
        if search.is_root(&first) {
            return Ok(first);
        }
        let bracketed = (self.size() == 1).then(|| search.bracketed()).flatten();
        if let Some(z) = bracketed.filter(|z| search.is_root(z)) {
            return Ok(z);
        }
        for turn in 1..=STARTS {
            let z = search.newton(&self.other_start(turn));
            if search.is_root(&z) {
                return Ok(z);
            }
        }
        Err(self.failure(&first, &search.residual(&first)))
    }

    /// Where Newton's method from the declared start ended, and with what residual.
    fn failure(&self, end: &[f64], residual: &[f64]) -> String {
        let named = |values: &[f64]| {
            let pairs = self.names().iter().zip(values).take(4);
            let pairs: Vec<String> = pairs.map(|(n, v)| format!("{n} = {v:.6}")).collect();
            pairs.join(", ")
        };
        let worst = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        // where g jumps over zero, what is left of it may be small
        let sides = match self.0.sides {
            Some(_) => ", and no root was found on a side where its own conditions hold",
            None => "",
        };
        format!(
            "Newton's method from {} ends at {} with a residual of {worst:.3e}{sides}; the equations may \
             have no solution in the declared range there, or need another `start`",
            named(self.start()),
            named(end),
        )
    }

    /// Points that fill ever larger boxes around the declared start evenly.
    fn other_start(&self, turn: usize) -> Vec<f64> {
        let reach = 4.0_f64.powi(turn as i32 / 4);
        let entries = self.start().iter().zip(self.range()).enumerate();
        let place = |(i, (&start, range)): (usize, (&f64, &Interval))| {
            let size = reach * start.abs().max(1.0);
            let near = Interval::point(start).inflate(size).intersection(*range);
            let near = if near.is_empty() { *range } else { near };
            let (lo, hi) = (near.lo().max(-1e300), near.hi().min(1e300));
            // multiples of √2, √5, … modulo 1
            let fraction = ((turn * (i + 1)) as f64 * ((i * i + 2 * i + 2) as f64).sqrt()).fract();
            lo + fraction * (hi - lo)
        };
        entries.map(place).collect()
    }
}

/// The search of a loop with conditions: Newton's method on equations in which each is held, so
/// that none of its steps meets a jump.
struct BySides<'a> {
    function: &'a Implicit,
    sides: &'a Sides,
    newton: Newton<'a>,
    values: Evaluator,
    /// (z, p)
    at: Vec<f64>,
}

impl<'a> BySides<'a> {
    fn new(function: &'a Implicit, sides: &'a Sides, p: &[f64]) -> Self {
        let unheld = vec![0.0; sides.are_relations.len()];
        let at = [function.start(), p].concat();
        Self {
            newton: Newton::on(function, &sides.held, &[p, &unheld].concat()),
            values: sides.values.evaluator(),
            function,
            sides,
            at,
        }
    }

    /// A root whose conditions are those that were held.
    fn root(&mut self) -> Option<Vec<f64>> {
        let start = self.function.start();
        let first = self.at(start);
        self.followed(start, &first)
            .or_else(|| self.combined(start, &first))
    }

    /// The conditions at z.
    fn at(&mut self, z: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.sides.are_relations.len()];
        self.at[..z.len()].copy_from_slice(z);
        self.values.eval(&self.at, &mut values);
        values
    }

    /// From the sides at the start on those where the root of the others lies, until they agree
    /// or come again.
    fn followed(&mut self, start: &[f64], first: &[f64]) -> Option<Vec<f64>> {
        let (mut z, mut tried) = (start.to_vec(), vec![first.to_vec()]);
        while let Some(held) = tried.last().filter(|_| tried.len() <= ROUNDS) {
            let (end, is_root, there) = self.ended(&z, held);
            if is_root {
                return Some(end);
            }
            if tried.contains(&there) || there.iter().any(|value| value.is_nan()) {
                // roundings may tell on which side a root on the border is
                let p = &self.at[end.len()..];
                let is_root = Newton::new(self.function, p).is_root(&end);
                return is_root.then_some(end);
            }
            tried.push(there);
            z = end;
        }
        None
    }

    /// From the start on sides that differ from the first in one relation, in two, and so on.
    fn combined(&mut self, start: &[f64], first: &[f64]) -> Option<Vec<f64>> {
        let relations = self.sides.are_relations.iter().enumerate();
        let relations: Vec<usize> = relations.filter(|r| *r.1).map(|r| r.0).collect();
        let counts = 1..=relations.len();
        let all = counts.flat_map(|count| Choices::new(relations.len(), count));
        for chosen in all.take(COMBINATIONS) {
            let mut held = first.to_vec();
            for &place in &chosen {
                held[relations[place]] = 1.0 - held[relations[place]];
            }
            let (end, is_root, _) = self.ended(start, &held);
            if is_root {
                return Some(end);
            }
        }
        None
    }

    /// Where Newton's method on these sides ends, whether it is a root there and the conditions
    /// hold, and the conditions there.
    fn ended(&mut self, from: &[f64], held: &[f64]) -> (Vec<f64>, bool, Vec<f64>) {
        self.newton.hold(held);
        let end = self.newton.newton(from);
        let there = self.at(&end);
        let is_root = there == held && self.newton.is_root(&end);
        (end, is_root, there)
    }
}

/// The choices of some of the numbers below `all`, in the order of a dictionary.
struct Choices {
    all: usize,
    next: Option<Vec<usize>>,
}

impl Choices {
    fn new(all: usize, count: usize) -> Self {
        let next = (count <= all).then(|| (0..count).collect());
        Self { all, next }
    }
}

impl Iterator for Choices {
    type Item = Vec<usize>;

    fn next(&mut self) -> Option<Vec<usize>> {
        let given = self.next.take()?;
        let last = |place: usize| self.all - given.len() + place;
        let moves = (0..given.len())
            .rev()
            .find(|&place| given[place] < last(place));
        self.next = moves.map(|place| {
            let mut next = given.clone();
            let ahead = given[place] + 1 - place;
            (place..next.len()).for_each(|i| next[i] = ahead + i);
            next
        });
        Some(given)
    }
}
