//! Attacks that need no simulation: at every pair of plant and estimate V = eᵀPe has to
//! fall as fast as proved, and the observer's equations have to be those that are printed.

use nalgebra::{DMatrix, DVector};
use serde_json::Value;

use super::attack::Attack;
use super::signals::Signal;
use crate::numbers::Numbers;

/// Pairs tried per claim, the second half near the worst of the first.
const PAIRS: usize = 160;
/// Rounding of sums of a few dozen numbers, relative to their size.
const ROUNDING: f64 = 1e-10;

/// Plant and estimate at an instant, with everything that acts.
#[derive(Clone, Debug)]
struct Moment {
    t: f64,
    plant: Vec<f64>,
    estimate: Vec<f64>,
    inputs: Vec<f64>,
}

impl Attack<'_> {
    /// A pair at which V' > −2·rate·V without disturbance and noise.
    pub fn secant(&mut self, numbers: &mut Numbers) -> Option<String> {
        let plain =
            self.pair.held.iter().all(Option::is_some) && self.pair.start.len() == self.sides.len();
        let claims = self.claims;
        for claim in claims.iter().filter(|_| plain) {
            let Some(P) = &claim.lyapunov else { continue };
            let mut worst: Option<(f64, Moment)> = None;
            for round in 0..PAIRS {
                let moment = match &worst {
                    Some((_, moment)) if round > PAIRS / 2 => self.near(numbers, moment),
                    _ => self.moment(numbers),
                };
                let excess = self.excess(&moment, P, claim.rate);
                if excess.is_finite() && worst.as_ref().is_none_or(|w| excess > w.0) {
                    worst = Some((excess, moment));
                }
            }
            if let Some((excess, moment)) = worst
                && excess > ROUNDING
            {
                return Some(format!(
                    "{}: (V'/2 + rate·V)/size = {excess:e} at {moment:?}",
                    claim.basis
                ));
            }
        }
        None
    }

    fn moment(&self, numbers: &mut Numbers) -> Moment {
        let ends = numbers.chance(0.2);
        let mut place = |side: &[f64; 2]| {
            let [low, high] = super::facts::finite(side[0], side[1]);
            match (ends, numbers.unit()) {
                (true, x) if x < 0.5 => low,
                (true, _) => high,
                (false, x) => low + x * (high - low),
            }
        };
        let plant: Vec<f64> = self.sides.iter().map(&mut place).collect();
        let other: Vec<f64> = self.sides.iter().map(&mut place).collect();
        let inputs = self.case.inputs.iter();
        let inputs = inputs.map(|i| place(&[i.side.low, i.side.high])).collect();
        let share = match numbers.chance(0.5) {
            true => 1.0,
            false => numbers.size(1e-4, 1.0),
        };
        let between = plant.iter().zip(&other).map(|(x, o)| x + share * (o - x));
        Moment {
            t: numbers.between(-10.0, 10.0),
            estimate: between.collect(),
            plant,
            inputs,
        }
    }

    fn near(&self, numbers: &mut Numbers, moment: &Moment) -> Moment {
        let mut next = moment.clone();
        let pace = numbers.size(1e-4, 0.3);
        let moved = if numbers.chance(0.5) {
            &mut next.plant
        } else {
            &mut next.estimate
        };
        for (x, side) in moved.iter_mut().zip(&self.sides) {
            let [low, high] = super::facts::finite(side[0], side[1]);
            *x = (*x + pace * (high - low) * numbers.normal()).clamp(low, high);
        }
        next
    }

    /// What acts, with unknown inputs at their places and disturbances at rest.
    fn acting(&self, moment: &Moment) -> Vec<f64> {
        let n = self.pair.states;
        let mut unknown = moment.plant[n..].iter();
        let of = |(input, value): (&super::case::Input, &f64)| match input.role {
            super::case::Role::Known => *value,
            super::case::Role::Unknown(_) => unknown.next().copied().unwrap_or(0.0),
            super::case::Role::Disturbance => 0.0,
        };
        self.case
            .inputs
            .iter()
            .zip(&moment.inputs)
            .map(of)
            .collect()
    }

    /// (V'/2 + rate·V) over the size of its terms.
    fn excess(&mut self, moment: &Moment, P: &DMatrix<f64>, rate: f64) -> f64 {
        let n = self.pair.states;
        let state = [&moment.plant[..n], &moment.estimate].concat();
        let u = self.acting(moment);
        let signals: Vec<Signal> = u.iter().map(|u| Signal::Constant(*u)).collect();
        let mut slope = vec![0.0; state.len()];
        let noise = vec![0.0; self.pair.measured];
        self.pair
            .slope(moment.t, &state, &u, &signals, &noise, &mut slope);
        let e = |i: usize| moment.estimate[i] - moment.plant[i];
        let e = DVector::from_fn(self.sides.len(), |i, _| e(i));
        // an unknown input rests
        let moves = |i: usize| slope[n + i] - if i < n { slope[i] } else { 0.0 };
        let moves = DVector::from_fn(e.len(), |i, _| moves(i));
        let Pe = P * &e;
        let half = Pe.dot(&moves) + rate * Pe.dot(&e);
        let parts = DVector::from_column_slice(&slope).norm() + 1e-3;
        half / (P.norm() * e.norm() * parts).max(f64::MIN_POSITIVE)
    }

    /// Where x̂' is not f(x̂, u) − K (ŷ − y) with the K that is printed, by output names.
    pub fn misprint(
        &mut self,
        numbers: &mut Numbers,
        gain: &Value,
        names: &[String],
    ) -> Option<String> {
        let rows = gain.as_object().filter(|rows| !rows.is_empty())?;
        let (n, m) = (self.pair.states, self.pair.measured);
        if self.pair.start.len() != self.sides.len() || self.pair.held.iter().any(Option::is_none) {
            return Some("the observer has states beside the estimate".into());
        }
        for _ in 0..8 {
            let moment = self.moment(numbers);
            let u = self.acting(&moment);
            let estimated = Moment {
                plant: moment.estimate.clone(),
                ..moment.clone()
            };
            let u_hat = self.acting(&estimated);
            let hat = self
                .pair
                .plant(moment.t, &moment.estimate[..n], &u_hat)
                .to_vec();
            let y = self.pair.plant(moment.t, &moment.plant[..n], &u)[n..].to_vec();
            let signals: Vec<Signal> = u.iter().map(|u| Signal::Constant(*u)).collect();
            let state = [&moment.plant[..n], &moment.estimate].concat();
            let mut slope = vec![0.0; state.len()];
            self.pair
                .slope(moment.t, &state, &u, &signals, &vec![0.0; m], &mut slope);
            for (i, name) in names.iter().enumerate() {
                let k = |j: usize| {
                    rows.get(name)
                        .and_then(|row| row[format!("y{}", j + 1)].as_f64())
                };
                let corrections: f64 = (0..m)
                    .map(|j| k(j).unwrap_or(0.0) * (hat[n + j] - y[j]))
                    .sum();
                let said = if i < n { hat[i] } else { 0.0 } - corrections;
                let found = slope[n + i];
                if found.is_finite()
                    && (found - said).abs() > 1e-6 * (found.abs() + corrections.abs() + 1.0)
                {
                    return Some(format!(
                        "{name}' is {found}, with the printed gain {said}, at {moment:?}"
                    ));
                }
            }
        }
        None
    }
}
