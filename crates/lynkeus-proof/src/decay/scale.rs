//! Units in which the numbers of an error system are near one.

use nalgebra::DMatrix;

use super::{ErrorModel, Proof};

/// Sizes of the states and a unit of time.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    pub states: Vec<f64>,
    pub unit: f64,
}

impl Scale {
    /// The unit of time in which the largest entry of the middle matrices is one.
    pub fn of(models: &[ErrorModel], states: &[f64]) -> Self {
        let largest = |m: &ErrorModel| m.scaled(states, 1.0).nominal().amax();
        let largest = models.iter().map(largest).fold(0.0, f64::max);
        let unit = if largest > 0.0 && largest.is_finite() {
            1.0 / largest
        } else {
            1.0
        };
        Self {
            states: states.to_vec(),
            unit,
        }
    }

    pub fn model(&self, model: &ErrorModel) -> ErrorModel {
        model.scaled(&self.states, self.unit)
    }

    /// A proof for scaled models in the user's units. With e = D e′ and time in
    /// `unit`s, P = D⁻¹P′D⁻¹ and t = t′/(unit·s²) for a sector in a state of size s.
    pub fn restored(&self, models: &[ErrorModel], proof: &Proof) -> Proof {
        let s = &self.states;
        let P = &proof.P;
        let multipliers = models.iter().zip(&proof.multipliers).map(|(model, t)| {
            let mut t = t.clone();
            for (t, sector) in t.iter_mut().zip(&model.sectors) {
                *t /= self.unit * s[sector.column].powi(2);
            }
            t
        });
        Proof {
            rate: proof.rate / self.unit,
            P: DMatrix::from_fn(P.nrows(), P.ncols(), |i, j| P[(i, j)] / (s[i] * s[j])),
            multipliers: multipliers.collect(),
        }
    }
}
