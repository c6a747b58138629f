//! Pairs of boxes, cut until no two of their points have the same values.

use super::alike::Guess;
use std::collections::VecDeque;

use lynkeus_expr::interval::{Intervals, solve};
use lynkeus_expr::{Evaluator, Interval, MissingInput, Tape};
use lynkeus_proof::spectrum;
use nalgebra::DMatrix;

use super::Steps;
use crate::region::Cell;
use crate::{Place, Region};

/// Pairs of a box with itself that are looked at.
const NEAR: usize = 400;
/// Other pairs.
const FAR: usize = 3000;
/// Pairs after which two points with equal values are looked for.
const SEEK: usize = 300;
/// Pairs whose middles are such points' first guesses.
const GUESSES: usize = 24;
/// Singular values below this share of the largest are not divided by.
const SMALL: f64 = 1e-9;

/// Two boxes, of which only the sides of the states in question may differ.
#[derive(Clone)]
struct Pair {
    left: Cell,
    right: Cell,
}

/// What cutting has shown.
pub(super) struct Found {
    /// pairs that were decided
    pub parts: usize,
    /// a part of the box with a pair that is not; none where all are
    pub open: Option<Place>,
}

/// Functions of some states, and of what is the same at both points.
pub(super) struct Pairs<'a> {
    map: &'a super::Map<'a>,
    /// of all that the functions read
    region: Region,
    /// places of the states in the region
    places: Vec<usize>,
    /// places of what the slopes read
    bent: Vec<usize>,
    rows: usize,
    values: Evaluator<Intervals>,
    slopes: Evaluator<Intervals>,
}

impl<'a> Pairs<'a> {
    pub fn new(steps: &Steps<'a>, states: &[usize], rows: &[usize]) -> Result<Self, MissingInput> {
        let map = steps.map;
        let functions: Vec<_> = rows.iter().map(|&row| steps.functions[row]).collect();
        let slopes: Vec<_> = rows
            .iter()
            .flat_map(|&row| states.iter().map(move |&j| steps.jacobian.node(row, j)))
            .collect();
        let mut read = map.graph.symbols_of(&functions);
        read.extend(map.graph.symbols_of(&slopes));
        read.extend(states.iter().map(|&j| map.states[j]));
        let region = map.region.restricted(&read);
        let symbols = region.symbols();
        let place = |&j: &usize| symbols.iter().position(|s| *s == map.states[j]);
        let reads = map.graph.symbols_of(&slopes);
        Ok(Self {
            map,
            bent: (0..symbols.len())
                .filter(|&i| reads.contains(&symbols[i]))
                .collect(),
            places: states.iter().filter_map(place).collect(),
            rows: rows.len(),
            values: Tape::new(map.graph, &symbols, &functions)?.evaluator_in(Intervals),
            slopes: Tape::new(map.graph, &symbols, &slopes)?.evaluator_in(Intervals),
            region,
        })
    }

    /// Cuts pairs until all are decided. `seek` has the middles of pairs that are not, and ends the search
    /// by true.
    pub fn decide(mut self, seek: &mut dyn FnMut(&[Guess]) -> bool) -> Found {
        let whole = self.region.cell();
        let first = Pair {
            left: whole.clone(),
            right: whole,
        };
        let mut near = vec![first];
        let mut far = VecDeque::new();
        let (mut parts, mut looked) = (0, 0);
        // neighbours first: where these are not told apart nothing is
        while let Some(pair) = near.pop() {
            looked += 1;
            if self.is_decided(&pair) {
                parts += 1;
                continue;
            }
            if looked > NEAR || self.map.graph.spent().is_some() {
                return self.ended(parts, &pair);
            }
            let Some(halves) = self.halves(&pair) else {
                return self.ended(parts, &pair);
            };
            for half in halves {
                match half.left == half.right {
                    true => near.push(half),
                    false => far.push_back(half),
                }
            }
        }
        looked = 0;
        while let Some(pair) = far.pop_front() {
            looked += 1;
            if self.is_decided(&pair) {
                parts += 1;
                continue;
            }
            let ends = looked > FAR || self.map.graph.spent().is_some();
            let Some(halves) = self.halves(&pair).filter(|_| !ends) else {
                let found = self.ended(parts, &pair);
                far.push_front(pair);
                seek(&self.guesses(&far));
                return found;
            };
            far.extend(halves);
            if looked == SEEK && seek(&self.guesses(&far)) {
                return self.ended(parts, &pair);
            }
        }
        Found { parts, open: None }
    }

    fn ended(&self, parts: usize, pair: &Pair) -> Found {
        let hull = hull(pair);
        Found {
            parts,
            open: Some(self.region.named(&hull)),
        }
    }

    /// Middles of pairs, evenly among those that are open.
    fn guesses(&self, open: &VecDeque<Pair>) -> Vec<Guess> {
        let named = |cell: &Cell| -> Vec<(String, f64)> {
            let middle = self.region.middle_point(cell);
            let names = self.region.dimensions.iter().map(|d| d.name.clone());
            names.zip(middle).collect()
        };
        let apart = |pair: &&Pair| {
            let mut sides = self.places.iter().map(|&i| (pair.left[i], pair.right[i]));
            sides.any(|(l, r)| l.intersection(r).is_empty())
        };
        let open: Vec<&Pair> = open.iter().filter(apart).collect();
        let step = open.len().div_ceil(GUESSES).max(1);
        let chosen = open.iter().step_by(step);
        chosen
            .map(|pair| [named(&pair.left), named(&pair.right)])
            .collect()
    }

    /// Whether no point of one box has the values of another point of the other.
    fn is_decided(&mut self, pair: &Pair) -> bool {
        self.is_apart_by_values(pair) || self.is_apart_by_slopes(pair)
    }

    fn is_apart_by_values(&mut self, pair: &Pair) -> bool {
        if pair.left == pair.right {
            return false;
        }
        let mut left = vec![Interval::ENTIRE; self.rows];
        let mut right = left.clone();
        self.values.eval(&pair.left, &mut left);
        self.values.eval(&pair.right, &mut right);
        left.iter()
            .zip(&right)
            .any(|(l, r)| l.is_defined() && r.is_defined() && l.intersection(*r).is_empty())
    }

    /// By the mean value: J̃(x − x') = 0 for no x ≠ x'.
    fn is_apart_by_slopes(&mut self, pair: &Pair) -> bool {
        let n = self.places.len();
        let mut J = vec![Interval::ENTIRE; self.rows * n];
        self.slopes.eval(&hull(pair), &mut J);
        let is_bounded =
            |x: &Interval| x.is_defined() && !x.is_empty() && x.magnitude().is_finite();
        if !J.iter().all(is_bounded) {
            return false;
        }
        let zeros = vec![Interval::ZERO; n];
        if self.rows == n && solve(&J, &zeros).1 {
            return true;
        }
        let distance: Vec<Interval> = self
            .places
            .iter()
            .map(|&i| pair.left[i] - pair.right[i])
            .collect();
        let differs = |row: &[Interval]| {
            let terms = row.iter().zip(&distance).map(|(a, d)| *a * *d);
            let sum = terms.fold(Interval::ZERO, |sum, term| sum + term);
            !sum.contains_zero()
        };
        if J.chunks(n).any(differs) {
            return true;
        }
        let Some(M) = preconditioned(&J, self.rows, n) else {
            return false;
        };
        solve(&M, &zeros).1 || M.chunks(n).any(differs)
    }

    /// The pair cut along its relatively widest side; of a box with itself, both halves at once, along a side that the
    /// slopes read: the others do not matter there.
    fn halves(&self, pair: &Pair) -> Option<Vec<Pair>> {
        let width = |i: usize| {
            let of = |cell: &Cell| self.region.relative_width(i, &cell[i]);
            of(&pair.left).max(of(&pair.right))
        };
        let sides = match pair.left == pair.right {
            true => self.bent.clone(),
            false => (0..pair.left.len()).collect(),
        };
        let widest = sides
            .into_iter()
            .max_by(|&i, &j| width(i).total_cmp(&width(j)))?;
        let cut = |cell: &Cell| self.region.halves(cell, widest);
        if !self.places.contains(&widest) {
            // the same at both points
            let (left, right) = (cut(&pair.left)?, cut(&pair.right)?);
            let pairs = [(left.0, right.0), (left.1, right.1)];
            return Some(pairs.map(|(left, right)| Pair { left, right }).into());
        }
        if pair.left == pair.right {
            let (low, high) = cut(&pair.left)?;
            let pairs = [
                (low.clone(), low.clone()),
                (low, high.clone()),
                (high.clone(), high),
            ];
            return Some(pairs.map(|(left, right)| Pair { left, right }).into());
        }
        let of = |cell: &Cell| self.region.relative_width(widest, &cell[widest]);
        Some(match of(&pair.left) >= of(&pair.right) {
            true => {
                let (low, high) = cut(&pair.left)?;
                [low, high]
                    .map(|left| Pair {
                        left,
                        right: pair.right.clone(),
                    })
                    .into()
            }
            false => {
                let (low, high) = cut(&pair.right)?;
                [low, high]
                    .map(|right| Pair {
                        left: pair.left.clone(),
                        right,
                    })
                    .into()
            }
        })
    }
}

/// The smallest box around both.
fn hull(pair: &Pair) -> Cell {
    let sides = pair.left.iter().zip(&pair.right);
    sides.map(|(l, r)| l.hull(*r)).collect()
}

/// C·J for a left inverse C of the middle of J.
fn preconditioned(J: &[Interval], rows: usize, n: usize) -> Option<Vec<Interval>> {
    let middle = DMatrix::from_fn(rows, n, |i, j| J[i * n + j].midpoint());
    let least = SMALL * middle.amax();
    let C = spectrum::singular(middle, true, true)?
        .pseudo_inverse(least)
        .ok()?;
    let entry = |place: usize| {
        let (i, j) = (place / n, place % n);
        let terms = (0..rows).map(|k| Interval::point(C[(i, k)]) * J[k * n + j]);
        terms.fold(Interval::ZERO, |sum, term| sum + term)
    };
    Some((0..n * n).map(entry).collect())
}
