//! Pairs of boxes, cut until no two of their points have the same values.

use std::collections::VecDeque;

use lynkeus_expr::interval::{Intervals, solve};
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node, Tape};
use lynkeus_proof::spectrum;
use nalgebra::{DMatrix, DVector};

use crate::region::Cell;
use crate::{Matrix, Place, Point, Region};

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

/// A map of the states on a box. Whatever else it reads is the same at both points.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// holds the expressions
    pub graph: &'a Graph,
    /// its components
    pub functions: &'a [Node],
    /// symbols of the states
    pub states: &'a [Node],
    /// the box of everything that the functions read
    pub region: &'a Region,
}

/// Two points of the box at which a map has the same values.
#[derive(Clone, Debug, PartialEq)]
pub struct Alike {
    /// the points, by the names of everything that the map reads, with the value of its first component
    pub points: [Point; 2],
    /// a point with exactly these values is proved to exist beside the second; else they agree to twelve digits
    pub is_proved: bool,
}

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
    map: &'a Map<'a>,
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
    pub fn new(
        map: &'a Map<'a>,
        jacobian: &Matrix<'_>,
        states: &[usize],
        rows: &[usize],
    ) -> Result<Self, MissingInput> {
        let functions: Vec<_> = rows.iter().map(|&row| map.functions[row]).collect();
        let slopes: Vec<_> = rows
            .iter()
            .flat_map(|&row| states.iter().map(move |&j| jacobian.node(row, j)))
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

/// Newton's steps.
const STEPS: usize = 40;
/// Points nearer than this share of a side are one.
const ONE: f64 = 1e-3;
/// Values that agree to this share of their terms are equal.
const EQUAL: f64 = 1e-12;
/// The half width, as a share of the side, of the box in which the second point is proved to be.
const AROUND: f64 = 1e-7;

/// A first guess: two points by names.
pub(super) type Guess = [Vec<(String, f64)>; 2];

/// The whole map, by the states that are not known.
pub(super) struct Twins {
    region: Region,
    /// places of the states that are not known
    places: Vec<usize>,
    rows: usize,
    values: Tape,
    slopes: Tape,
}

impl Twins {
    pub fn new(map: &Map<'_>, jacobian: &Matrix<'_>, known: &[bool]) -> Result<Self, MissingInput> {
        let states: Vec<usize> = (0..known.len()).filter(|&j| !known[j]).collect();
        let slopes: Vec<_> = (0..map.functions.len())
            .flat_map(|row| states.iter().map(move |&j| jacobian.node(row, j)))
            .collect();
        let mut read = map.graph.symbols_of(map.functions);
        read.extend(map.graph.symbols_of(&slopes));
        read.extend(map.states);
        let region = map.region.restricted(&read);
        let symbols = region.symbols();
        let place = |&j: &usize| symbols.iter().position(|s| *s == map.states[j]);
        Ok(Self {
            places: states.iter().filter_map(place).collect(),
            rows: map.functions.len(),
            values: Tape::new(map.graph, &symbols, map.functions)?,
            slopes: Tape::new(map.graph, &symbols, &slopes)?,
            region,
        })
    }

    /// Two points with equal values, from the first of the guesses that leads to a proof, else to some.
    pub fn find(&self, guesses: &[Guess]) -> Option<Alike> {
        let mut found = guesses.iter().filter_map(|guess| self.from(guess));
        let first = found.next()?;
        match first.is_proved {
            true => Some(first),
            false => found.find(|alike| alike.is_proved).or(Some(first)),
        }
    }

    fn from(&self, guess: &Guess) -> Option<Alike> {
        let [first, second] = guess.each_ref().map(|point| self.full(point));
        // what is the same at both points
        let second: Vec<f64> = (0..first.len())
            .map(|i| {
                if self.places.contains(&i) {
                    second[i]
                } else {
                    first[i]
                }
            })
            .collect();
        let (first, second) = self.solved(first, second)?;
        let differs = |&i: &usize| {
            let side = &self.region.dimensions[i];
            let width = side.max - side.min;
            let width = if width.is_finite() { width } else { 1.0 };
            (first[i] - second[i]).abs() > ONE * width
        };
        if !self.places.iter().any(differs) || !self.agree(&first, &second) {
            return None;
        }
        let is_proved = self.is_proved(&first, &second).unwrap_or(false);
        let value = self.values(&first)[0];
        let point = |at: Vec<f64>| Point {
            coordinates: self.region.coordinates(&at),
            value,
        };
        Some(Alike {
            points: [first, second].map(point),
            is_proved,
        })
    }

    /// The guess, and the middle of the box for what it does not name.
    fn full(&self, guess: &[(String, f64)]) -> Vec<f64> {
        let sides = self.region.dimensions.iter().zip(self.region.centre());
        let given = |name: &str| {
            guess
                .iter()
                .find(|(n, _)| n.as_str() == name)
                .map(|(_, x)| *x)
        };
        sides
            .map(|(d, middle)| given(&d.name).unwrap_or(middle))
            .collect()
    }

    fn values(&self, at: &[f64]) -> DVector<f64> {
        let mut out = vec![0.0; self.rows];
        self.values.evaluator().eval(at, &mut out);
        DVector::from_vec(out)
    }

    fn slopes(&self, at: &[f64]) -> DMatrix<f64> {
        let n = self.places.len();
        let mut out = vec![0.0; self.rows * n];
        self.slopes.evaluator().eval(at, &mut out);
        DMatrix::from_row_slice(self.rows, n, &out)
    }

    /// Both points moved as little as it takes; none where the values stay apart.
    fn solved(&self, mut first: Vec<f64>, mut second: Vec<f64>) -> Option<(Vec<f64>, Vec<f64>)> {
        let n = self.places.len();
        for _ in 0..STEPS {
            let gap = self.values(&second) - self.values(&first);
            let (here, there) = (self.slopes(&first), self.slopes(&second));
            let J = DMatrix::from_fn(self.rows, 2 * n, |i, j| match j.checked_sub(n) {
                None => -here[(i, j)],
                Some(j) => there[(i, j)],
            });
            if !J.iter().chain(&gap).all(|x| x.is_finite()) {
                return None;
            }
            if gap.amax() == 0.0 {
                break;
            }
            let least = SMALL * J.amax();
            let step = spectrum::singular(J, true, true)?.solve(&gap, least).ok()?;
            for (k, &i) in self.places.iter().enumerate() {
                first[i] = self.inside(i, first[i] - step[k]);
                second[i] = self.inside(i, second[i] - step[n + k]);
            }
        }
        Some((first, second))
    }

    /// The nearest value in the range that leaves room for a proof.
    fn inside(&self, i: usize, value: f64) -> f64 {
        let side = &self.region.dimensions[i];
        let width = side.max - side.min;
        let room = if width.is_finite() {
            2.0 * AROUND * width
        } else {
            0.0
        };
        value.clamp(side.min + room, side.max - room)
    }

    /// Equal to the digits that their own enclosures have.
    fn agree(&self, first: &[f64], second: &[f64]) -> bool {
        let gap = self.values(second) - self.values(first);
        let slopes = self.slopes(second);
        (0..self.rows).all(|i| {
            let sizes = self.places.iter().enumerate();
            let moved = sizes.map(|(k, &p)| (slopes[(i, k)] * (second[p] - first[p])).abs());
            gap[i].abs() <= EQUAL * moved.fold(0.0, f64::max)
        })
    }

    /// Whether there is a point near the second with exactly the values of the first.
    fn is_proved(&self, first: &[f64], second: &[f64]) -> Option<bool> {
        let n = self.places.len();
        if self.rows != n {
            return None;
        }
        let points = |at: &[f64]| -> Cell { at.iter().map(|&x| Interval::point(x)).collect() };
        let mut around = points(second);
        for &i in &self.places {
            let side = &self.region.dimensions[i];
            let width = Some(side.max - side.min)
                .filter(|w| w.is_finite())
                .unwrap_or(1.0);
            around[i] = around[i].inflate(AROUND * width);
            let whole = Interval::new(side.min, side.max).ok()?;
            if !around[i].is_subset(whole) {
                return None;
            }
        }
        let C = self.slopes(second).try_inverse()?;
        let J = self.slopes.eval_in(&Intervals, &around);
        let values = |at: &[f64]| self.values.eval_in(&Intervals, &points(at));
        let gap: Vec<Interval> = values(second)
            .into_iter()
            .zip(values(first))
            .map(|(there, here)| there - here)
            .collect();
        let is_defined = |x: &Interval| x.is_defined() && !x.is_empty();
        if !J.iter().chain(&gap).all(is_defined) {
            return None;
        }
        // K = x' − C gap + (I − C J)(X' − x')
        let inside = (0..n).all(|i| {
            let mut image = Interval::ZERO;
            for k in 0..n {
                let mut slope = Interval::point(if i == k { 1.0 } else { 0.0 });
                for r in 0..n {
                    slope = slope - Interval::point(C[(i, r)]) * J[r * n + k];
                }
                let place = self.places[k];
                image = image + slope * (around[place] - Interval::point(second[place]))
                    - Interval::point(C[(i, k)]) * gap[k];
            }
            let place = self.places[i];
            let room = around[place] - Interval::point(second[place]);
            room.lo() < image.lo() && image.hi() < room.hi()
        });
        Some(inside)
    }
}
