//! Two points of the box with equal values: Newton's method on Φ(x') = Φ(x) from pairs of boxes that were not told
//! apart, and Krawczyk's test that there is such an x' (Neumaier 1990, section 5.1).

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Interval, MissingInput, Tape};
use lynkeus_proof::spectrum;
use nalgebra::{DMatrix, DVector};

use super::{Alike, Steps};
use crate::region::Cell;
use crate::{Coordinate, Point, Region};

/// Newton's steps.
const STEPS: usize = 40;
/// Points nearer than this share of a side are one.
const ONE: f64 = 1e-3;
/// Values that agree to this share of their terms are equal.
const EQUAL: f64 = 1e-12;
/// The half width, as a share of the side, of the box in which the second point is proved to be.
const AROUND: f64 = 1e-7;
/// Singular values below this share of the largest are not divided by.
const SMALL: f64 = 1e-9;

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
    pub fn new(steps: &Steps<'_>) -> Result<Self, MissingInput> {
        let map = steps.map;
        let states: Vec<usize> = (0..steps.known.len())
            .filter(|&j| !steps.known[j])
            .collect();
        let slopes: Vec<_> = (0..steps.functions.len())
            .flat_map(|row| states.iter().map(move |&j| steps.jacobian.node(row, j)))
            .collect();
        let mut read = map.graph.symbols_of(steps.functions);
        read.extend(map.graph.symbols_of(&slopes));
        read.extend(map.states);
        let region = map.region.restricted(&read);
        let symbols = region.symbols();
        let place = |&j: &usize| symbols.iter().position(|s| *s == map.states[j]);
        Ok(Self {
            places: states.iter().filter_map(place).collect(),
            rows: steps.functions.len(),
            values: Tape::new(map.graph, &symbols, steps.functions)?,
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
            coordinates: self.named(&at),
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

    fn named(&self, point: &[f64]) -> Vec<Coordinate> {
        let names = self.region.dimensions.iter().map(|d| d.name.clone());
        names
            .zip(point.iter().copied())
            .map(Coordinate::from)
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
