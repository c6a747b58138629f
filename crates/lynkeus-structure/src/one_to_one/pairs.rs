//! Pairs of boxes, cut until no two of their points have the same values.

use std::collections::VecDeque;

use lynkeus_expr::interval::{Intervals, solve};
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node, Tape};
use lynkeus_proof::matrix::{dot, sum};
use lynkeus_proof::spectrum;
use nalgebra::{DMatrix, DVector};

use crate::region::Cell;
use crate::{Coordinate, Matrix, Place, Point, Region};

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
type Pair = [Cell; 2];

/// A first guess: two points by names.
pub(super) type Guess = [Vec<Coordinate>; 2];

/// Functions of some states, and of what is the same at two points.
pub(super) struct Part<'a> {
    graph: &'a Graph,
    /// of all that the functions read
    region: Region,
    /// places of the states in the region
    places: Vec<usize>,
    /// places of what the slopes read
    bent: Vec<usize>,
    rows: usize,
    values: Tape,
    slopes: Tape,
}

impl<'a> Part<'a> {
    /// Some rows of a map by some of its states; its points tell of what is `shown` at least.
    pub fn new(
        map: &Map<'a>,
        jacobian: &Matrix<'_>,
        states: &[usize],
        rows: &[usize],
        shown: &[Node],
    ) -> Result<Self, MissingInput> {
        let graph = map.graph;
        let functions: Vec<_> = rows.iter().map(|&row| map.functions[row]).collect();
        let slopes: Vec<_> = rows
            .iter()
            .flat_map(|&row| states.iter().map(move |&j| jacobian.node(row, j)))
            .collect();
        let bends = graph.symbols_of(&slopes);
        let read = [&graph.symbols_of(&functions), &bends[..], shown].concat();
        let region = map.region.restricted(&read);
        let symbols = region.symbols();
        let place = |&j: &usize| symbols.iter().position(|s| *s == map.states[j]);
        Ok(Self {
            graph,
            bent: (0..symbols.len())
                .filter(|&i| bends.contains(&symbols[i]))
                .collect(),
            places: states.iter().filter_map(place).collect(),
            rows: rows.len(),
            values: Tape::new(graph, &symbols, &functions)?,
            slopes: Tape::new(graph, &symbols, &slopes)?,
            region,
        })
    }

    /// Cuts pairs until all are decided. `seek` has the middles of pairs that are not, and ends the search
    /// by true. The number of pairs that were decided, and a part of the box with one that is not.
    pub fn decide(&self, seek: &mut dyn FnMut(&[Guess]) -> bool) -> (usize, Option<Place>) {
        let mut values = self.values.evaluator_in(Intervals);
        let mut slopes = self.slopes.evaluator_in(Intervals);
        // no point of one box has the values of another point of the other
        let mut is_decided = |pair: &Pair| {
            self.is_apart_by_values(&mut values, pair) || self.is_apart_by_slopes(&mut slopes, pair)
        };
        let whole = self.region.cell();
        let mut near = vec![[whole.clone(), whole]];
        let mut far = VecDeque::new();
        let (mut parts, mut looked) = (0, 0);
        let ended = |parts: usize, pair: &Pair| (parts, Some(self.region.named(&hull(pair))));
        // neighbours first: where these are not told apart nothing is
        while let Some(pair) = near.pop() {
            looked += 1;
            if is_decided(&pair) {
                parts += 1;
                continue;
            }
            let lasts = looked <= NEAR && self.graph.spent().is_none();
            let Some(halves) = self.halves(&pair).filter(|_| lasts) else {
                return ended(parts, &pair);
            };
            let (same, other): (Vec<Pair>, _) = halves.into_iter().partition(|[l, r]| l == r);
            near.extend(same);
            far.extend(other);
        }
        looked = 0;
        while let Some(pair) = far.pop_front() {
            looked += 1;
            if is_decided(&pair) {
                parts += 1;
                continue;
            }
            let lasts = looked <= FAR && self.graph.spent().is_none();
            let Some(halves) = self.halves(&pair).filter(|_| lasts) else {
                let found = ended(parts, &pair);
                far.push_front(pair);
                seek(&self.guesses(&far));
                return found;
            };
            far.extend(halves);
            if looked == SEEK && seek(&self.guesses(&far)) {
                return ended(parts, &pair);
            }
        }
        (parts, None)
    }

    /// Middles of pairs, evenly among those that are open.
    fn guesses(&self, open: &VecDeque<Pair>) -> Vec<Guess> {
        let apart = |[left, right]: &&Pair| {
            let mut sides = self.places.iter().map(|&i| (left[i], right[i]));
            sides.any(|(l, r)| l.intersection(r).is_empty())
        };
        let open: Vec<&Pair> = open.iter().filter(apart).collect();
        let step = open.len().div_ceil(GUESSES).max(1);
        let named = |cell: &Cell| self.region.coordinates(&self.region.middle_point(cell));
        let chosen = open.iter().step_by(step);
        chosen.map(|pair| pair.each_ref().map(named)).collect()
    }

    fn is_apart_by_values(&self, values: &mut Evaluator<Intervals>, pair: &Pair) -> bool {
        if pair[0] == pair[1] {
            return false;
        }
        let [left, right] = pair.each_ref().map(|cell| {
            let mut out = vec![Interval::ENTIRE; self.rows];
            values.eval(cell, &mut out);
            out
        });
        let apart = |(l, r): (&Interval, &Interval)| {
            l.is_defined() && r.is_defined() && l.intersection(*r).is_empty()
        };
        left.iter().zip(&right).any(apart)
    }

    /// By the mean value: J̃(x − x') = 0 for no x ≠ x'.
    fn is_apart_by_slopes(&self, slopes: &mut Evaluator<Intervals>, pair: &Pair) -> bool {
        let n = self.places.len();
        let mut J = vec![Interval::ENTIRE; self.rows * n];
        slopes.eval(&hull(pair), &mut J);
        if !J.iter().all(|x| x.is_bounded()) {
            return false;
        }
        let zeros = vec![Interval::ZERO; n];
        if self.rows == n && solve(&J, &zeros).1 {
            return true;
        }
        let [left, right] = pair;
        let distance = self.places.iter().map(|&i| left[i] - right[i]);
        let distance: Vec<Interval> = distance.collect();
        let differs = |row: &[Interval]| !dot(row, &distance).contains_zero();
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
        let [left, right] = pair;
        let of = |cell: &Cell, i: usize| self.region.relative_width(i, &cell[i]);
        let width = |i: usize| of(left, i).max(of(right, i));
        let sides = match left == right {
            true => self.bent.clone(),
            false => (0..left.len()).collect(),
        };
        let widest = sides
            .into_iter()
            .max_by(|&i, &j| width(i).total_cmp(&width(j)))?;
        let cut = |cell: &Cell| self.region.halves(cell, widest);
        if !self.places.contains(&widest) {
            // the same at both points
            let ([a, b], [c, d]) = (cut(left)?, cut(right)?);
            return Some(vec![[a, c], [b, d]]);
        }
        if left == right {
            let [low, high] = cut(left)?;
            let apart = [low.clone(), high.clone()];
            return Some(vec![[low.clone(), low], apart, [high.clone(), high]]);
        }
        Some(match of(left, widest) >= of(right, widest) {
            true => cut(left)?.map(|left| [left, right.clone()]).into(),
            false => cut(right)?.map(|right| [left.clone(), right]).into(),
        })
    }
}

/// The smallest box around both.
fn hull(pair: &Pair) -> Cell {
    let sides = pair[0].iter().zip(&pair[1]);
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
        sum((0..rows).map(|k| Interval::point(C[(i, k)]) * J[k * n + j]))
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

impl Part<'_> {
    /// Two points with equal values, from the first of the guesses that leads to a proof, else to some.
    pub fn twins(&self, guesses: &[Guess]) -> Option<Alike> {
        let mut found = guesses.iter().filter_map(|guess| self.from(guess));
        let first = found.next()?;
        match first.is_proved {
            true => Some(first),
            false => found.find(|alike| alike.is_proved).or(Some(first)),
        }
    }

    fn from(&self, guess: &Guess) -> Option<Alike> {
        let [first, mut second] = guess.each_ref().map(|point| self.full(point));
        // what is the same at both points
        for i in (0..first.len()).filter(|i| !self.places.contains(i)) {
            second[i] = first[i];
        }
        let (first, second) = self.solved(first, second)?;
        let differs =
            |&i: &usize| (first[i] - second[i]).abs() > ONE * self.width(i).unwrap_or(1.0);
        if !self.places.iter().any(differs) || !self.agree(&first, &second) {
            return None;
        }
        let is_proved = self.is_proved(&first, &second).unwrap_or(false);
        let value = self.values(&first)[0];
        Some(Alike {
            points: [first, second].map(|at| self.region.point(&at, value)),
            is_proved,
        })
    }

    /// The width of a side, where it has one.
    fn width(&self, i: usize) -> Option<f64> {
        let side = &self.region.dimensions[i];
        Some(side.max - side.min).filter(|width| width.is_finite())
    }

    /// The guess, and the middle of the box for what it does not name.
    fn full(&self, guess: &[Coordinate]) -> Vec<f64> {
        let given = |name: &str| guess.iter().find(|c| c.name == name).map(|c| c.value);
        let sides = self.region.dimensions.iter().zip(self.region.centre());
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
        let room = self.width(i).map_or(0.0, |width| 2.0 * AROUND * width);
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
            around[i] = around[i].inflate(AROUND * self.width(i).unwrap_or(1.0));
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
