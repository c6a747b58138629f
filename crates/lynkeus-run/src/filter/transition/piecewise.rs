//! The estimate and how its error spreads, for flows with many states.
//!
//! x̂ is integrated by itself; along it F = ∂f/∂x is sparse and changes little over a piece of an
//! interval. There F is a polynomial of time through Lobatto's nodes, and Φ, W are series
//! of sparse products. Where F is too fast for a series, Φ and W over pieces with a
//! constant F are doubled up. Everything is in units of the states' own deviations (rounded to
//! powers of two), so that an error means the same for all of them.

use nalgebra::DMatrix;

use super::series::{Series, Transition, largest_row};
use crate::Evaluation;
use crate::filter::belief::Belief;
use crate::filter::profile::{Entry, Profile};
use crate::filter::root::largest;
use crate::integrator::pieces;
use crate::method::{are_finite, resolution};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Events, Integrator, Linearised, Method, Place, Result};

/// Tolerance with fixed steps, whose error nobody states.
const FIXED: f64 = 1e-8;

/// A segment that needs more series than this is stiff,
const MOST_SERIES: f64 = 64.0;

/// and so is one over which the rates (row sums of F) come to more than this.
const MOST_RATES: f64 = 200.0;

/// A segment takes more than this share of the time: pieces of it have to be resolved, too.
const APART: f64 = 256.0 * f64::EPSILON;

/// How much longer the next piece may be.
const GROWTH: f64 = 1.25;

/// Sweeps that carry deviations to neighbouring states.
const SWEEPS: usize = 8;

#[derive(Clone, Debug)]
pub(crate) struct Piecewise {
    integrator: Integrator,
    entries: Vec<(usize, usize)>,
    process_noise: Vec<f64>,
    tolerance: f64,
    /// interpolation through Lobatto's three nodes, and through five
    coarse: Vectors,
    fine: Vectors,
    series: Series,
    /// the length of the last pieces
    step: f64,
    /// units of the states
    units: Vec<f64>,
    slopes: Vec<f64>,
}

/// A piece of an interval.
#[derive(Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
}

impl Piece {
    fn new(from: f64, to: f64) -> Self {
        Self { from, to }
    }

    fn length(self) -> f64 {
        self.to - self.from
    }

    fn at(self, share: f64) -> f64 {
        self.from + share * self.length()
    }
}

impl Piecewise {
    pub fn new(flow: &Linearised, process_noise: &[f64], method: Method) -> Result<Self> {
        let n = flow.system().states().len();
        let tolerance = match method {
            Method::Adaptive(t) | Method::Explicit(t) | Method::Stiff(t) => t.relative,
            Method::Rk4(_) => FIXED,
        };
        let noisy = process_noise.iter().any(|q| *q > 0.0);
        Ok(Self {
            integrator: Integrator::new(method, n)?,
            entries: flow.jacobians().state.places().to_vec(),
            process_noise: match noisy {
                true => process_noise.to_vec(),
                false => vec![],
            },
            tolerance,
            coarse: basis(&[FINE[0], FINE[2], FINE[4]]),
            fine: basis(&FINE),
            series: Series::default(),
            step: f64::INFINITY,
            units: vec![],
            slopes: vec![0.0; flow.system().outputs().len()],
        })
    }

    /// Takes `x` to the next sample and returns Φ and W.
    pub fn advance(
        &mut self,
        driven: &mut Evaluation,
        belief: &Belief,
        from: f64,
        to: f64,
        x: &mut Vec<f64>,
    ) -> Result<Transition<Profile>> {
        let n = x.len();
        let mut stops = vec![];
        driven.instants(from, to, &mut stops)?;
        let mut transition = Transition::start(n, !self.process_noise.is_empty());
        for (start, end) in pieces(from, to, &mut stops, APART) {
            let segment = Piece::new(start, end);
            driven.enter(segment.at(0.5));
            if start == from {
                self.choose_units(driven, belief, segment, x)?;
            }
            self.segment(driven, segment, x, &mut transition)?;
        }
        let units = &self.units;
        transition.matrix.scale(|i| units[i], |j| 1.0 / units[j]);
        if let Some(noise) = &mut transition.noise {
            noise.scale(|i| units[i], |j| units[j]);
        }
        Ok(transition)
    }

    /// What each state's error is about, here and after the flow has carried it on.
    fn choose_units(
        &mut self,
        driven: &mut Evaluation,
        belief: &Belief,
        interval: Piece,
        x: &[f64],
    ) -> Result<()> {
        let n = x.len();
        self.units.clear();
        self.units.extend((0..n).map(|i| belief.root.deviation(i)));
        for (unit, q) in self.units.iter_mut().zip(&self.process_noise) {
            *unit = unit.max((q * interval.length()).sqrt());
        }
        self.look(driven, interval.from, x)?;
        for _ in 0..SWEEPS {
            for (&(i, j), slope) in self.entries.iter().zip(&self.slopes) {
                let carried = (slope * interval.length()).abs().min(1.0) * self.units[j];
                self.units[i] = self.units[i].max(carried);
            }
        }
        for unit in &mut self.units {
            let whole = unit.log2().round();
            *unit = if whole.is_finite() { whole.exp2() } else { 1.0 };
        }
        Ok(())
    }

    /// F at (t, x), the values of its entries.
    fn look(&mut self, driven: &mut Evaluation, t: f64, x: &[f64]) -> Result<()> {
        driven.outputs(t, x, &mut self.slopes);
        match are_finite(&self.slopes) {
            true => Ok(()),
            false => Err(driven.not_finite(t, x)),
        }
    }

    /// F·h at (t, x) in the states' units.
    fn scaled(&mut self, driven: &mut Evaluation, t: f64, x: &[f64], h: f64) -> Result<Vec<f64>> {
        self.look(driven, t, x)?;
        let pairs = self.entries.iter().zip(&self.slopes);
        let scaled = pairs.map(|(&(i, j), s)| s * h * self.units[j] / self.units[i]);
        Ok(scaled.collect())
    }

    fn drive(&self, h: f64) -> Vec<f64> {
        let pairs = self.process_noise.iter().zip(&self.units);
        pairs.map(|(q, unit)| q * h / (unit * unit)).collect()
    }

    fn sparse(&self, values: &[f64]) -> Vec<Entry> {
        let pairs = self.entries.iter().zip(values);
        let all = pairs.map(|(&(row, column), &value)| (Place { row, column }, value));
        all.filter(|entry| entry.1 != 0.0).collect()
    }

    fn segment(
        &mut self,
        driven: &mut Evaluation,
        segment: Piece,
        x: &mut Vec<f64>,
        transition: &mut Transition<Profile>,
    ) -> Result<()> {
        if self.rates(driven, segment, x)? > MOST_RATES {
            return self.stiff(driven, segment, x, transition);
        }
        let mut t = segment.from;
        while t < segment.to {
            let left = segment.to - t;
            let to = match self.step {
                step if step >= left => segment.to,
                step if step > 0.5 * left => t + 0.5 * left,
                step => t + step,
            };
            let piece = Piece::new(t, to);
            let mut end = vec![];
            let polynomial = self.polynomial(driven, piece, x, &mut end)?;
            let (n, within) = (x.len(), 0.1 * self.tolerance);
            let drive = self.drive(piece.length());
            let shortest = piece.length() <= 256.0 * resolution(to);
            let mut advance = |p: &Vec<_>| self.series.advance(p, &drive, transition, n, within);
            if polynomial.as_ref().is_some_and(&mut advance) {
                *x = end;
                t = to;
                self.step = self.step.max(piece.length()) * GROWTH;
                continue;
            }
            let stiff = polynomial.is_some() && piece.length() * MOST_SERIES < segment.length();
            if stiff || shortest {
                self.step = f64::INFINITY;
                let rest = Piece::new(t, segment.to);
                return self.stiff(driven, rest, x, transition);
            }
            self.step = 0.5 * piece.length();
        }
        Ok(())
    }

    /// The largest row sum of F at the start of a segment, times its length.
    fn rates(&mut self, driven: &mut Evaluation, segment: Piece, x: &[f64]) -> Result<f64> {
        let values = self.scaled(driven, segment.from, x, segment.length())?;
        Ok(largest_row(x.len(), &self.sparse(&values)))
    }

    /// Writes x̂ at the end of a piece; F·h as a polynomial in the share of the piece, none where F
    /// changes too much for one.
    fn polynomial(
        &mut self,
        driven: &mut Evaluation,
        piece: Piece,
        x: &[f64],
        end: &mut Vec<f64>,
    ) -> Result<Option<Vec<Vec<Entry>>>, Error> {
        let h = piece.length();
        let first = self.scaled(driven, piece.from, x, h)?;
        let mut middle = x.to_vec();
        let half = piece.at(0.5);
        let mut values = vec![first];
        if h <= 256.0 * resolution(piece.to) {
            // too short for nodes inside
            self.integrator
                .advance(driven, piece.from, piece.to, &mut middle)?;
            *end = middle;
            return Ok(Some(vec![self.sparse(&values[0])]));
        }
        let node = piece.at(FINE[1]);
        self.integrator
            .advance(driven, piece.from, node, &mut middle)?;
        let inside = self.scaled(driven, node, &middle, h)?;
        self.integrator.advance(driven, node, half, &mut middle)?;
        values.push(self.scaled(driven, half, &middle, h)?);
        end.extend_from_slice(&middle);
        self.integrator.advance(driven, half, piece.to, end)?;
        values.push(self.scaled(driven, piece.to, end, h)?);
        let coarse = coarse(&self.coarse, &values, self.tolerance);
        let within = self.tolerance / ODD;
        let mut fit = coarse.filter(|fit| meets(fit, FINE[1], &inside, within));
        if fit.is_none() {
            values.insert(1, inside);
            let node = piece.at(FINE[3]);
            self.integrator.advance(driven, half, node, &mut middle)?;
            values.insert(3, self.scaled(driven, node, &middle, h)?);
            fit = fine(&self.fine, &values, self.tolerance);
        }
        Ok(fit.map(|fit| fit.iter().map(|c| self.sparse(c)).collect()))
    }
}

/// Units are chosen anew for every interval, and series keep room only.
impl Persist for Piecewise {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.integrator.walk(walk)?;
        walk.number(&mut self.step)
    }
}

/// What the covariance of a stiff flow may be wrong by at least.
const STIFF: f64 = 1e-5;

/// Most halvings of a piece of a stiff flow.
const MOST_HALVINGS: usize = 16;

/// A piece of a stiff interval with a constant F.
struct Leaf {
    result: Transition<DMatrix<f64>>,
    /// F changes on it
    varies: bool,
    end: Vec<f64>,
}

impl Piecewise {
    /// The rest of a stiff segment.
    fn stiff(
        &mut self,
        driven: &mut Evaluation,
        piece: Piece,
        x: &mut Vec<f64>,
        transition: &mut Transition<Profile>,
    ) -> Result<()> {
        let n = x.len();
        let whole = self.leaf(driven, piece, x)?;
        let result = self.refined(driven, piece, x, whole, MOST_HALVINGS)?;
        let before = Transition::dense(transition, n);
        *transition = before.then(&result.result).into_profiles(n);
        *x = result.end;
        Ok(())
    }

    /// A piece in halves until halving it changes nothing.
    fn refined(
        &mut self,
        driven: &mut Evaluation,
        piece: Piece,
        x: &[f64],
        coarse: Leaf,
        halvings: usize,
    ) -> Result<Leaf> {
        if !coarse.varies || halvings == 0 || piece.length() <= 512.0 * resolution(piece.to) {
            return Ok(coarse);
        }
        let half = piece.at(0.5);
        let (left, right) = (Piece::new(piece.from, half), Piece::new(half, piece.to));
        let first = self.leaf(driven, left, x)?;
        let second = self.leaf(driven, right, &first.end)?;
        let both = first.result.then(&second.result);
        // of a method of order 2, what is better is a quarter as wrong
        let error = both.distance(&coarse.result) / 3.0;
        if error <= self.tolerance.max(STIFF) {
            return Ok(Leaf {
                result: both,
                ..second
            });
        }
        let first = self.refined(driven, left, x, first, halvings - 1)?;
        let second = self.leaf(driven, right, &first.end)?;
        let second = self.refined(driven, right, &first.end, second, halvings - 1)?;
        Ok(Leaf {
            result: first.result.then(&second.result),
            varies: true,
            end: second.end,
        })
    }

    /// A piece with F as it is there on average (Simpson's rule).
    fn leaf(&mut self, driven: &mut Evaluation, piece: Piece, x: &[f64]) -> Result<Leaf> {
        let h = piece.length();
        let half = piece.at(0.5);
        let first = self.scaled(driven, piece.from, x, h)?;
        let mut middle = x.to_vec();
        self.integrator
            .advance(driven, piece.from, half, &mut middle)?;
        let between = self.scaled(driven, half, &middle, h)?;
        let mut end = middle.clone();
        self.integrator.advance(driven, half, piece.to, &mut end)?;
        let last = self.scaled(driven, piece.to, &end, h)?;
        let three = || first.iter().zip(&between).zip(&last);
        let mean = three().map(|((a, b), c)| (a + 4.0 * b + c) / 6.0);
        let mean = self.sparse(&mean.collect::<Vec<f64>>());
        let change = |a: f64, b: f64, c: f64| (a - b).abs().max((a - c).abs()) / a.abs().max(1.0);
        let varies = three().any(|((a, b), c)| change(*a, *b, *c) > STIFF);
        let drive = self.drive(h);
        let result = Transition::constant(x.len(), &mean, &drive, &mut self.series);
        let result = result.ok_or_else(|| driven.not_finite(piece.from, x))?;
        Ok(Leaf {
            result,
            varies,
            end,
        })
    }
}

/// Lobatto's five nodes on [0, 1]; the first, the third and the last are his three.
const FINE: [f64; 5] = [
    0.0,
    0.172_673_164_646_011_43,
    0.5,
    0.827_326_835_353_988_6,
    1.0,
];

/// How much of what is left out counts where it is odd about the middle: over the piece it comes
/// to nothing, and an estimate from every other coefficient is too large.
const ODD: f64 = 0.1;

/// What rounding makes of a value of a polynomial, as a share of it.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Vectors, one for each node or for each power.
type Vectors = Vec<Vec<f64>>;

/// Coefficients of 1, s, s² through three nodes, from their basis and the values there; none where more
/// nodes are needed for an error of `tolerance`. Legendre's coefficients tell, which of a smooth function
/// fall geometrically; of one that is odd about the middle there is none of s² to tell by, so that
/// what is found has to [meet](meets) the function elsewhere, too.
fn coarse(basis: &Vectors, values: &Vectors, tolerance: f64) -> Option<Vectors> {
    let fit = combined(basis, values);
    let last = largest(fit[2].iter().map(|c| c / 6.0));
    let before = largest(fit[1].iter().zip(&fit[2]).map(|(b, c)| 0.5 * (b + c)));
    accepted(fit, &[beyond(before, last)], tolerance)
}

/// … of 1 … s⁴ through five nodes. Of an odd function every other coefficient falls.
fn fine(basis: &Vectors, values: &Vectors, tolerance: f64) -> Option<Vectors> {
    let fit = combined(basis, values);
    let last = largest(fit[4].iter().map(|c| c / 70.0));
    let before = largest(fit[3].iter().zip(&fit[4]).map(|(b, c)| b / 20.0 + c / 10.0));
    let pairs = (fit[1].iter().zip(&fit[2])).zip(fit[3].iter().zip(&fit[4]));
    let first = largest(pairs.map(|((a, b), (c, d))| 0.5 * (a + b) + 0.45 * c + 0.4 * d));
    let next = [beyond(before, last), ODD * beyond(first, before)];
    accepted(fit, &next, tolerance)
}

/// Whether a polynomial of s is this close to the values at s.
fn meets(fit: &[Vec<f64>], s: f64, values: &[f64], tolerance: f64) -> bool {
    values.iter().enumerate().all(|(i, value)| {
        let found = fit.iter().rev().fold(0.0, |sum, c| sum * s + c[i]);
        (found - value).abs() <= tolerance.max(ROUNDING * value.abs())
    })
}

/// The next one of coefficients that fall geometrically.
fn beyond(before: f64, last: f64) -> f64 {
    match last < before {
        true => last * last / before,
        false => last,
    }
}

/// The polynomial, where what is left out of it is within the tolerance.
fn accepted(mut fit: Vectors, next: &[f64], tolerance: f64) -> Option<Vectors> {
    // false of what is not a number
    if !next.iter().all(|next| *next <= tolerance) {
        return None;
    }
    // what is far below the tolerance is rounding, and would make sparse products dense
    for coefficient in fit.iter_mut().skip(1).flatten() {
        if coefficient.abs() <= 1e-3 * tolerance {
            *coefficient = 0.0;
        }
    }
    while fit.len() > 1 && fit.last().is_some_and(|c| c.iter().all(|c| *c == 0.0)) {
        fit.pop();
    }
    Some(fit)
}

fn combined(basis: &Vectors, values: &Vectors) -> Vectors {
    let size = values.first().map_or(0, Vec::len);
    let mut fit = vec![vec![0.0; size]; basis.len()];
    for (polynomial, values) in basis.iter().zip(values) {
        for (into, factor) in fit.iter_mut().zip(polynomial) {
            for (into, value) in into.iter_mut().zip(values) {
                *into += factor * value;
            }
        }
    }
    fit
}

/// Π (s − c_j)/(c_i − c_j) over j ≠ i, for each node c_i: 1 there and 0 at the others.
fn basis(nodes: &[f64]) -> Vectors {
    let one = |i: usize| {
        let mut polynomial = vec![1.0];
        for (_, c) in nodes.iter().enumerate().filter(|(j, _)| *j != i) {
            let scale = 1.0 / (nodes[i] - c);
            polynomial.push(0.0);
            for k in (0..polynomial.len()).rev() {
                let lower = if k > 0 { polynomial[k - 1] } else { 0.0 };
                polynomial[k] = scale * (lower - c * polynomial[k]);
            }
        }
        polynomial
    };
    (0..nodes.len()).map(one).collect()
}

#[cfg(test)]
mod tests;
