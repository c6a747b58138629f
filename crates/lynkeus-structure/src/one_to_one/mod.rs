//! Is a map of the states one-to-one on the box?
//!
//! A Jacobian that is regular everywhere tells neighbouring points apart, no more: eᵃ(cos b, sin b) has
//! one, and takes every value twice once b runs through a full turn. Two arguments decide the rest, step by step.
//!
//! *One alone.* A function that reads one state beside those that are known, with a slope that
//! keeps its sign, gives that state: it is strictly monotone along the box, which is convex.
//!
//! *Several together.* Between two points x and x' the map differs by J̃(x − x'), where J̃ averages the Jacobian over the
//! segment between them and lies in its range over the hull of the boxes that hold x and x' (`pairs.rs`). Where all such
//! matrices have full column rank, no two points of these boxes are confused; nor are any where the values of the map are disjoint.
//! Pairs of boxes are cut until each is decided, or two points with equal values are found.

mod pairs;

use std::collections::HashSet;

use lynkeus_expr::{MissingInput, Node};

use crate::{Finding, Matrix, Reason, Verdict, Witness, range, regularity};
use pairs::Part;
pub use pairs::{Alike, Map};

/// States among which every set is looked at for one that its functions determine.
const SETS: usize = 10;
/// Sets of states whose pairs of boxes are cut.
const TRIED: usize = 3;

/// What was found of a map.
#[derive(Clone, Debug)]
pub struct OneToOne {
    /// per state: no two points of the box with equal values differ in it
    pub known: Vec<bool>,
    /// whether no two points of the box have equal values
    pub finding: Finding,
    /// two that have, where some were found
    pub alike: Option<Alike>,
}

impl Map<'_> {
    /// Decides whether no two points of the box have equal values, those of `known` states being
    /// equal. Sets of states together are looked at where `together` says so: that has a prospect only where the
    /// Jacobian has full rank everywhere.
    ///
    /// # Errors
    /// [`MissingInput`] where a function reads a symbol outside the region.
    pub fn one_to_one(&self, known: &[bool], together: bool) -> Result<OneToOne, MissingInput> {
        if known.iter().all(|known| *known) {
            return Ok(OneToOne {
                known: known.to_vec(),
                finding: Finding::proved(Reason::StateByState),
                alike: None,
            });
        }
        let functions = self.regular_functions()?;
        let map = Map {
            functions: &functions,
            ..*self
        };
        let jacobian = Matrix::jacobian(map.graph, map.functions, map.states);
        let mut steps = Steps {
            map,
            jacobian: &jacobian,
            known: known.to_vec(),
            tried: HashSet::new(),
        };
        let mut parts = 0;
        let mut left = TRIED;
        let mut twins = None;
        let mut open = None;
        loop {
            while steps.one_alone()? {}
            let next = steps.smallest().filter(|_| together && left > 0);
            let Some((states, rows)) = next else { break };
            left -= 1;
            let shown: Vec<Node> = states.iter().map(|&j| map.states[j]).collect();
            let part = Part::new(&map, &jacobian, &states, &rows, &shown)?;
            let unknown: Vec<usize> = (0..known.len()).filter(|&j| !steps.known[j]).collect();
            let all: Vec<usize> = (0..map.functions.len()).collect();
            let whole = Part::new(&map, &jacobian, &unknown, &all, map.states)?;
            let (decided, left_open) = part.decide(&mut |points| {
                twins = twins.take().or_else(|| whole.twins(points));
                twins.is_some()
            });
            parts += decided;
            match left_open {
                None => states.iter().for_each(|&j| steps.known[j] = true),
                Some(place) => open = open.or(Some(place)),
            }
            steps.tried.insert(states);
            if twins.is_some() {
                break;
            }
        }
        let known = steps.known;
        let finding = match (known.iter().all(|known| *known), &twins) {
            (true, _) if parts == 0 => Finding::proved(Reason::StateByState),
            (true, _) => Finding::proved(Reason::PairsApart(parts)),
            (false, Some(Alike { points, is_proved })) => {
                let points = points.to_vec();
                match is_proved {
                    true => Finding::refuted(Witness { points }, Reason::Alike(true)),
                    false => Finding::undecided(Reason::Alike(false)),
                }
            }
            (false, None) => Finding {
                verdict: Verdict::Undecided(open.unwrap_or_default()),
                reason: Reason::FarApart,
            },
        };
        Ok(OneToOne {
            known,
            finding,
            alike: twins,
        })
    }

    /// The functions with values on the whole box that do not jump as the states move.
    fn regular_functions(&self) -> Result<Vec<Node>, MissingInput> {
        let of = |functions: &[Node]| regularity(self.graph, functions, self.states, self.region);
        if of(self.functions)?.is_proved() {
            return Ok(self.functions.to_vec());
        }
        let mut kept = vec![];
        for &function in self.functions {
            if of(&[function])?.is_proved() {
                kept.push(function);
            }
        }
        Ok(kept)
    }
}

/// How far it has come.
struct Steps<'a> {
    /// of the functions without jumps
    map: Map<'a>,
    /// of the functions by the states
    jacobian: &'a Matrix<'a>,
    known: Vec<bool>,
    /// sets that were tried together
    tried: HashSet<Vec<usize>>,
}

impl Steps<'_> {
    /// The states beside those known that a function reads.
    fn reads(&self, row: usize) -> Vec<usize> {
        let states = 0..self.known.len();
        states
            .filter(|&j| !self.known[j] && self.jacobian.get(row, j).is_some())
            .collect()
    }

    /// Finds one more state that one function gives.
    fn one_alone(&mut self) -> Result<bool, MissingInput> {
        let Map { graph, region, .. } = self.map;
        for row in 0..self.map.functions.len() {
            let [state] = self.reads(row)[..] else {
                continue;
            };
            // a set of one, told by its function
            let name = vec![state, self.known.len() + row];
            if graph.spent().is_some() || !self.tried.insert(name) {
                continue;
            }
            let slope = self.jacobian.node(row, state);
            if range::excludes_zero(graph, slope, region)? {
                self.known[state] = true;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The smallest set of states that was not tried, read by as many functions that read nothing else unknown, with
    /// these.
    fn smallest(&self) -> Option<(Vec<usize>, Vec<usize>)> {
        let unknown: Vec<usize> = (0..self.known.len()).filter(|&j| !self.known[j]).collect();
        let reads: Vec<Vec<usize>> = (0..self.map.functions.len())
            .map(|row| self.reads(row))
            .collect();
        let count = unknown.len();
        let mut sets: Vec<Vec<usize>> = match count <= SETS {
            true => (1..1_usize << count)
                .map(|bits| {
                    (0..count)
                        .filter(|k| bits >> k & 1 == 1)
                        .map(|k| unknown[k])
                        .collect()
                })
                .collect(),
            false => vec![unknown],
        };
        sets.sort_by_key(Vec::len);
        sets.into_iter().find_map(|set| {
            let inside = |row: &usize| {
                !reads[*row].is_empty() && reads[*row].iter().all(|state| set.contains(state))
            };
            let rows: Vec<usize> = (0..reads.len()).filter(inside).collect();
            // of one function of one state the slope has decided
            let is_new = !self.tried.contains(&set) && rows.len() > usize::from(set.len() == 1);
            let is_read = set
                .iter()
                .all(|state| rows.iter().any(|&row| reads[row].contains(state)));
            (is_new && is_read && rows.len() >= set.len()).then_some((set, rows))
        })
    }
}

#[cfg(test)]
mod tests;
