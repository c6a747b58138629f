//! What the flow makes of an estimate and of the noise on its way: x̂, Φ and W.

use super::Belief;
use super::factor::Factor;
use super::flow::Joint;
use super::spanned::Spanned;
use super::taylor::Moments;
use super::variation::Variation;
use crate::driven::Driven;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, Linearised, Method, Step};

/// Up to so many states x̂, Φ and W are integrated together, and wherever steps are given: these are
/// then the steps of all three.
const FEW: usize = 8;

/// Φ' = FΦ and W' = FW + WFᵀ + Q along the estimate, from Φ = I and W = 0 at a sample: the
/// transition, and W = ∫ Φ(T,s) Q Φ(T,s)ᵀ ds, what the process noise comes to at the next sample.
#[derive(Clone, Debug)]
pub(super) struct Along {
    way: Way,
    moments: Moments,
    /// of W
    factor: Factor,
    n: usize,
}

/// How Φ and W are found.
#[derive(Clone, Debug)]
enum Way {
    Joint(Box<Joint>),
    Variation(Box<Variation>),
}

impl Along {
    /// Of a flow with F, and the densities of the noise on its states.
    pub fn new(flow: &Linearised, process_noise: &[f64], method: Method) -> Result<Self, Error> {
        let n = flow.system().states().len();
        let is_given = matches!(method, Method::Rk4(Step::AtMost(_) | Step::Substeps(_)));
        let way = match n <= FEW || is_given {
            true => Way::Joint(Box::new(Joint::new(flow, process_noise, method)?)),
            false => Way::Variation(Box::new(Variation::new(flow, process_noise, method)?)),
        };
        Ok(Self {
            way,
            moments: Moments::start(n, process_noise.iter().any(|q| *q > 0.0)),
            factor: Factor::default(),
            n,
        })
    }

    /// Takes `x` to the next sample, from the belief's estimate.
    pub fn advance(
        &mut self,
        driven: &mut Driven,
        belief: &Belief,
        from: f64,
        to: f64,
        x: &mut Vec<f64>,
    ) -> Result<(), Error> {
        match &mut self.way {
            Way::Joint(joint) => joint.advance(driven, from, to, x, &mut self.moments)?,
            Way::Variation(variation) => {
                self.moments = variation.advance(driven, belief, from, to, x)?;
            }
        }
        Ok(())
    }

    /// Φ of the last way.
    pub fn transition(&self) -> &Spanned {
        &self.moments.transition
    }

    /// Adds the rows of Lᵀ, W = LLᵀ.
    pub fn push_root(&mut self, rows: &mut Vec<f64>) {
        let Some(noise) = &self.moments.noise else {
            return;
        };
        let n = self.n;
        let lower = self.factor.of(noise.entries(), n);
        let first = rows.len();
        rows.resize(first + n * n, 0.0);
        let rows = &mut rows[first..];
        for (i, row) in lower.chunks_exact(n).enumerate() {
            for (k, entry) in row[..=i].iter().enumerate() {
                rows[k * n + i] = *entry;
            }
        }
    }
}

impl Persist for Along {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        match &mut self.way {
            Way::Joint(joint) => joint.walk(walk),
            Way::Variation(variation) => variation.walk(walk),
        }
    }
}
