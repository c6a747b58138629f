//! One simulation of plant and observer, judged at every step.

use nalgebra::{DMatrix, DVector};

use super::attack::{Plan, Worst};
use super::claims::Claim;
use super::integrate::Flow;
use super::pair::Pair;
use super::signals::Signal;

/// Where a certificate has no constant for the transient, it is allowed this much.
const UNSTATED: f64 = 1e8;
/// Noise in the comparison, relative to the box.
const SLACK: f64 = 1e-7;

pub struct Run<'a> {
    plan: &'a Plan,
    claims: &'a [Claim],
    sides: &'a [[f64; 2]],
    guards: &'a [(usize, [f64; 2])],
    size: f64,
    pair: &'a mut Pair,
    u: Vec<f64>,
    ν: Vec<f64>,
    truth: Vec<f64>,
    error: Vec<f64>,
    /// |e| and, per claim with one, √V at the start
    first: Option<(f64, Vec<Option<f64>>)>,
    pub worst: Worst,
}

impl<'a> Run<'a> {
    pub fn new(
        plan: &'a Plan,
        claims: &'a [Claim],
        sides: &'a [[f64; 2]],
        guards: &'a [(usize, [f64; 2])],
        pair: &'a mut Pair,
    ) -> Self {
        let widths = sides.iter().map(|s| s[1] - s[0]);
        Self {
            plan,
            claims,
            sides,
            guards,
            size: widths.filter(|w| w.is_finite()).fold(0.0, f64::max),
            pair,
            u: vec![0.0; plan.inputs.len()],
            ν: vec![0.0; plan.noise.len()],
            truth: vec![],
            error: vec![],
            first: None,
            worst: Worst::default(),
        }
    }

    /// From a sample to the next, as a share of the longest interval.
    pub fn gap(&self, sample: usize) -> f64 {
        let gaps = &self.plan.gaps;
        gaps.get(sample % gaps.len().max(1)).copied().unwrap_or(1.0)
    }

    /// Sets the last states, the measurements, to what the plant shows. Errors of measurement are no part of what is
    /// claimed of samples.
    pub fn read(&mut self, t: f64, state: &mut [f64]) {
        let mut slope = vec![0.0; state.len()];
        self.slope(t, state, &mut slope);
        let x = state[..self.pair.states].to_vec();
        let n = self.pair.states;
        let shown = self.pair.plant(t, &x, &self.u)[n..].to_vec();
        let first = state.len() - shown.len();
        state[first..].copy_from_slice(&shown);
    }

    fn note(&mut self, found: f64, allowed: f64, what: impl FnOnce() -> String) {
        let ratio = found / (allowed + SLACK * self.size);
        if ratio > self.worst.ratio {
            self.worst.ratio = ratio;
            if ratio > 1.0 {
                self.worst.what = what();
            }
        }
    }

    fn root(P: &DMatrix<f64>, e: &[f64]) -> f64 {
        let e = DVector::from_column_slice(e);
        e.dot(&(P * &e)).max(0.0).sqrt()
    }

    fn judge(&mut self, t: f64) {
        let error = std::mem::take(&mut self.error);
        let norm = error.iter().map(|e| e * e).sum::<f64>().sqrt();
        let root = |claim: &Claim| claim.lyapunov.as_ref().map(|P| Self::root(P, &error));
        let now: Vec<Option<f64>> = self.claims.iter().map(root).collect();
        let (start, roots) = self
            .first
            .get_or_insert_with(|| (norm, now.clone()))
            .clone();
        let claims = self.claims;
        for (i, claim) in claims.iter().enumerate() {
            let fading = (-claim.rate * t).exp();
            self.worst.long |= fading < 0.35;
            let fades = claim.overshoot.unwrap_or(UNSTATED) * fading * start;
            let named = |quantity: &str, found: f64, allowed: f64| {
                format!(
                    "{}: {quantity} = {found:e} at {t} after the start, allowed {allowed:e}",
                    claim.basis
                )
            };
            let last = match (claim.ultimate, self.plan.quiet) {
                (Some(last), _) => Some(last),
                (None, true) => Some(0.0),
                (None, false) => None,
            };
            if let Some(last) = last {
                let allowed = fades + last;
                self.note(norm, allowed, || named("|e|", norm, allowed));
            }
            for (bound, e) in claim.each.iter().zip(&error) {
                let (e, allowed) = (e.abs(), fades + bound.value);
                self.note(e, allowed, || {
                    named(&format!("error of {}", bound.name), e, allowed)
                });
            }
            // sqrt V in the unit of the error
            if let (true, Some(now), Some(first), Some(P)) =
                (self.plan.quiet, now[i], roots[i], &claim.lyapunov)
            {
                let unit = 1.0 / P.amax().sqrt();
                let (found, allowed) = (now * unit, first * unit * fading);
                self.note(found, allowed, || named("√V", found, allowed));
            }
        }
        self.error = error;
    }
}

impl Flow for Run<'_> {
    fn slope(&mut self, t: f64, state: &[f64], out: &mut [f64]) {
        let at = |signal: &Signal, error: &[f64]| signal.value(t, error);
        for (u, signal) in self.u.iter_mut().zip(&self.plan.inputs) {
            *u = at(signal, &self.error);
        }
        self.pair
            .truth(&state[..self.pair.states], &self.u, &mut self.truth);
        self.error.clear();
        for (i, truth) in self.truth.iter().enumerate() {
            // an estimate that is no state of its own is not fed back
            let hat = self.pair.held[i].map_or(*truth, |held| state[self.pair.states + held]);
            self.error.push(hat - truth);
        }
        for (u, signal) in self.u.iter_mut().zip(&self.plan.inputs) {
            if matches!(signal, Signal::Feedback { .. }) {
                *u = at(signal, &self.error);
            }
        }
        for (ν, signal) in self.ν.iter_mut().zip(&self.plan.noise) {
            *ν = at(signal, &self.error);
        }
        self.pair
            .slope(t, state, &self.u, &self.plan.inputs, &self.ν, out);
    }

    fn next_break(&self, t: f64) -> f64 {
        let signals = self.plan.inputs.iter().chain(&self.plan.noise);
        signals.fold(f64::INFINITY, |next, signal| next.min(signal.next_break(t)))
    }

    /// The last slope was taken at this very point.
    fn seen(&mut self, t: f64, state: &[f64]) -> bool {
        let x = &state[..self.pair.states];
        self.pair.truth(x, &self.u, &mut self.truth);
        let estimated = self.pair.estimated();
        let holds = |x: &f64, side: &[f64; 2]| side[0] <= *x && *x <= side[1];
        let inside = |values: &[f64]| {
            values
                .iter()
                .zip(self.sides)
                .all(|(x, side)| holds(x, side))
        };
        let z = &state[self.pair.states..];
        let guarded = self.guards.iter().all(|(i, side)| holds(&z[*i], side));
        if !inside(&self.truth) || !inside(estimated) || !guarded || self.pair.is_withdrawn() {
            return false;
        }
        self.error.clear();
        self.error
            .extend(estimated.iter().zip(&self.truth).map(|(a, b)| a - b));
        self.judge(t - self.plan.start);
        self.worst.ratio <= 3.0
    }
}
