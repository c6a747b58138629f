//! The estimate and how its error spreads, for flows with many states.
//!
//! x̂ is integrated by itself; along it F = ∂f/∂x is sparse and changes little over a piece of an
//! interval. There F is a polynomial of time through Lobatto's nodes, and Φ, W are series
//! of sparse products. Where F is too fast for a series, Φ and W over pieces with a
//! constant F are doubled up. Everything is in units of the states' own deviations (rounded to
//! powers of two), so that an error means the same for all of them.

mod stiff;

use super::Belief;
use super::nodes::{FINE, Lobatto, ODD, meets};
use super::spanned::Entry;
use super::taylor::{Moments, Series};
use crate::method::resolution;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::system::Driven;
use crate::{Dynamics, Error, Events, Integrator, Method};

/// Tolerance with fixed steps, whose error nobody states.
const FIXED: f64 = 1e-8;

/// A segment that needs more series than this is stiff,
const MOST_SERIES: f64 = 64.0;

/// and so is one over which the rates (row sums of F) come to more than this.
const MOST_RATES: f64 = 200.0;

/// How much longer the next piece may be.
const GROWTH: f64 = 1.25;

/// Sweeps that carry deviations to neighbouring states.
const SWEEPS: usize = 8;

#[derive(Clone, Debug)]
pub(super) struct Variation {
    integrator: Integrator,
    entries: Vec<(usize, usize)>,
    process_noise: Vec<f64>,
    tolerance: f64,
    lobatto: Lobatto,
    series: Series,
    /// the length of the last pieces
    step: f64,
    /// units of the states
    units: Vec<f64>,
    slopes: Vec<f64>,
    derivatives: Vec<f64>,
}

/// A piece of an interval.
#[derive(Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
}

impl Piece {
    fn length(self) -> f64 {
        self.to - self.from
    }

    fn at(self, share: f64) -> f64 {
        self.from + share * self.length()
    }
}

/// The estimate and its linearisation over a piece.
struct Course {
    /// x̂ at the end
    end: Vec<f64>,
    /// F·h as a polynomial in the share of the piece; none where it changes too much for one
    polynomial: Option<Vec<Vec<Entry>>>,
}

impl Variation {
    pub fn new(
        n: usize,
        outputs: usize,
        entries: &[(usize, usize)],
        process_noise: &[f64],
        method: Method,
    ) -> Result<Self, Error> {
        let tolerance = match method {
            Method::Adaptive(t) | Method::Explicit(t) | Method::Stiff(t) => t.relative,
            Method::Rk4(_) => FIXED,
        };
        let noisy = process_noise.iter().any(|q| *q > 0.0);
        Ok(Self {
            integrator: Integrator::new(method, n)?,
            entries: entries.to_vec(),
            process_noise: if noisy {
                process_noise.to_vec()
            } else {
                vec![]
            },
            tolerance,
            lobatto: Lobatto::new(),
            series: Series::default(),
            step: f64::INFINITY,
            units: vec![],
            slopes: vec![0.0; outputs],
            derivatives: vec![0.0; n],
        })
    }

    /// Takes `x` to the next sample and returns Φ and W.
    pub fn advance(
        &mut self,
        driven: &mut Driven,
        belief: &Belief,
        from: f64,
        to: f64,
        x: &mut Vec<f64>,
    ) -> Result<Moments, Error> {
        let n = x.len();
        let mut stops = vec![];
        driven.instants(from, to, &mut stops)?;
        stops.sort_unstable_by(f64::total_cmp);
        stops.push(to);
        let mut moments = Moments::start(n, !self.process_noise.is_empty());
        let mut start = from;
        for end in stops {
            // two detectors may find one switch, a rounding error apart
            if end - start <= 16.0 * resolution(end) && end < to {
                continue;
            }
            let segment = Piece {
                from: start,
                to: end,
            };
            driven.enter(segment.at(0.5));
            if start == from {
                self.choose_units(driven, belief, segment, x)?;
            }
            self.segment(driven, segment, x, &mut moments)?;
            start = end;
        }
        let units = &self.units;
        moments.transition.scale(|i| units[i], |j| 1.0 / units[j]);
        if let Some(noise) = &mut moments.noise {
            noise.scale(|i| units[i], |j| units[j]);
        }
        Ok(moments)
    }

    /// What each state's error is about, here and after the flow has carried it on.
    fn choose_units(
        &mut self,
        driven: &mut Driven,
        belief: &Belief,
        interval: Piece,
        x: &[f64],
    ) -> Result<(), Error> {
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
    fn look(&mut self, driven: &mut Driven, t: f64, x: &[f64]) -> Result<(), Error> {
        driven.derivatives(t, x, &mut self.derivatives);
        driven.evaluation.outputs(t, x, &mut self.slopes);
        match self.slopes.iter().all(|s| s.is_finite()) {
            true => Ok(()),
            false => Err(driven.not_finite(t, x)),
        }
    }

    /// F·h at (t, x) in the states' units.
    fn scaled(
        &mut self,
        driven: &mut Driven,
        t: f64,
        x: &[f64],
        h: f64,
    ) -> Result<Vec<f64>, Error> {
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
        let all = pairs.map(|(&(row, column), &value)| Entry { row, column, value });
        all.filter(|e| e.value != 0.0).collect()
    }

    fn segment(
        &mut self,
        driven: &mut Driven,
        segment: Piece,
        x: &mut Vec<f64>,
        moments: &mut Moments,
    ) -> Result<(), Error> {
        if self.rates(driven, segment, x)? > MOST_RATES {
            return self.stiff(driven, segment, x, moments);
        }
        let mut t = segment.from;
        while t < segment.to {
            let left = segment.to - t;
            let to = match self.step {
                step if step >= left => segment.to,
                step if step > 0.5 * left => t + 0.5 * left,
                step => t + step,
            };
            let piece = Piece { from: t, to };
            let Course { end, polynomial } = self.polynomial(driven, piece, x)?;
            let n = x.len();
            let drive = self.drive(piece.length());
            let shortest = piece.length() <= 256.0 * resolution(to);
            if let Some(polynomial) = &polynomial
                && self
                    .series
                    .advance(polynomial, &drive, moments, n, 0.1 * self.tolerance)
            {
                *x = end;
                t = to;
                self.step = self.step.max(piece.length()) * GROWTH;
                continue;
            }
            let stiff = polynomial.is_some() && piece.length() * MOST_SERIES < segment.length();
            if stiff || shortest {
                let rest = Piece {
                    from: t,
                    to: segment.to,
                };
                self.step = f64::INFINITY;
                return self.stiff(driven, rest, x, moments);
            }
            self.step = 0.5 * piece.length();
        }
        Ok(())
    }

    /// The largest row sum of F at the start of a segment, times its length.
    fn rates(&mut self, driven: &mut Driven, segment: Piece, x: &[f64]) -> Result<f64, Error> {
        let values = self.scaled(driven, segment.from, x, segment.length())?;
        let mut sums = vec![0.0; x.len()];
        for (&(i, _), value) in self.entries.iter().zip(values) {
            sums[i] += value.abs();
        }
        Ok(sums.into_iter().fold(0.0, f64::max))
    }

    /// x̂ at the end of a piece, and F·h as a polynomial in its share of the piece; none where
    /// F changes too much for one.
    fn polynomial(
        &mut self,
        driven: &mut Driven,
        piece: Piece,
        x: &[f64],
    ) -> Result<Course, Error> {
        let h = piece.length();
        let first = self.scaled(driven, piece.from, x, h)?;
        let (mut middle, mut end) = (x.to_vec(), vec![]);
        let half = piece.at(0.5);
        let mut values = vec![first];
        if h <= 256.0 * resolution(piece.to) {
            // too short for nodes inside
            self.integrator
                .advance(driven, piece.from, piece.to, &mut middle)?;
            let polynomial = Some(vec![self.sparse(&values[0])]);
            return Ok(Course {
                end: middle,
                polynomial,
            });
        }
        let node = piece.at(FINE[1]);
        self.integrator
            .advance(driven, piece.from, node, &mut middle)?;
        let inside = self.scaled(driven, node, &middle, h)?;
        self.integrator.advance(driven, node, half, &mut middle)?;
        values.push(self.scaled(driven, half, &middle, h)?);
        end.extend_from_slice(&middle);
        self.integrator.advance(driven, half, piece.to, &mut end)?;
        values.push(self.scaled(driven, piece.to, &end, h)?);
        let coarse = self.lobatto.coarse(&values, self.tolerance);
        let within = self.tolerance / ODD;
        let mut fit = coarse.filter(|fit| meets(fit, FINE[1], &inside, within));
        if fit.is_none() {
            values.insert(1, inside);
            let node = piece.at(FINE[3]);
            self.integrator.advance(driven, half, node, &mut middle)?;
            values.insert(3, self.scaled(driven, node, &middle, h)?);
            fit = self.lobatto.fine(&values, self.tolerance);
        }
        let polynomial = fit.map(|fit| fit.iter().map(|c| self.sparse(c)).collect());
        Ok(Course { end, polynomial })
    }
}

/// Units are chosen anew for every interval, and series keep room only.
impl Persist for Variation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.integrator.walk(walk)?;
        walk.number(&mut self.step)
    }
}

#[cfg(test)]
mod tests;
