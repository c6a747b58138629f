//! The shape of the blocks of Λ₂, and what of the proof it leaves.
//!
//! Where a block is square Λ₂Λ₂⁺ = I, and the gain is constant in the coordinates of the
//! proof. Else Π_k = Λ₂_kΛ₂_k⁺ is the projection on the range R_k of the block k, R_1 ⊃ R_2 ⊃ …
//! If Λ₂ does not read X², ζ_k = Λ₂_k η_k lies in R_k and obeys
//!
//! ζ_k' = ζ_{k+1} − θ₂^k C^k_q Π_k (ζ_1 + γ₁e₁) + terms bounded by the ranges of Jacobians:
//!
//! in the part of R_k that is not in R_{k+1} a chain of k integrators with the first k of
//! the gains of q. For k = 1 it has the pole −qθ₂ alone; for k = q it is the chain of the
//! proof. So with n₂ = … = n_q, where no other k occurs, V₂ with the S₂ of the paper decays
//! as in (24). Between 1 and q the S₂ of the paper need not decrease (it does not for k = 2 of
//! q = 3), and for k ≥ 5 the chain itself may be unstable.

use crate::statement::{Statement, proved, undecided};
use crate::{Check, Farza};
use lynkeus_expr::Interval;
use lynkeus_gain::integrators::shortened_stability;
use lynkeus_structure::{Finding, Point, Region, counted};

use super::form::Form;
use super::partition;
use crate::DesignError;

/// Sizes of the blocks: p − m₁, n₂, …, n_q.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// p − m₁ = n₂ = … = n_q
    Square,
    /// p − m₁ > n₂ = … = n_q
    Tall,
    /// further layers have fewer states
    Narrowing,
}

impl Form<'_, '_> {
    pub fn sizes(&self) -> Vec<usize> {
        (1..=self.q()).map(|k| self.block(k).len()).collect()
    }

    pub(super) fn shape(&self) -> Shape {
        let sizes = self.sizes();
        match sizes[1..].windows(2).all(|pair| pair[0] == pair[1]) {
            false => Shape::Narrowing,
            true if sizes.iter().all(|&size| size == sizes[0]) => Shape::Square,
            true => Shape::Tall,
        }
    }

    /// Whether Λ₂ changes with X².
    pub fn bends(&self) -> bool {
        let graph = self.extended.graph();
        let nodes: Vec<_> = self.Λ2().iter().flat_map(|P| P.nonzero()).collect();
        let used = graph.symbols_of(&nodes);
        let mut states = (1..=self.q()).flat_map(|k| self.block(k));
        states.any(|i| used.contains(&self.extended.states[i].node))
    }
}

/// The layers after which the next one has fewer states: their chains end there.
fn ends(sizes: &[usize]) -> Vec<usize> {
    let narrower = |&k: &usize| sizes[k - 1] > sizes[k];
    (1..sizes.len()).filter(narrower).collect()
}

/// The chains that end before the last layer are stable with the gains of q; nothing to
/// check where none ends.
pub(super) fn shortened(form: &Form<'_, '_>) -> Option<Check> {
    let q = form.q();
    let found = |k: usize| (k, shortened_stability(q, k));
    let weakest = ends(&form.sizes())
        .into_iter()
        .map(found)
        .min_by(|a, b| a.1.lo().total_cmp(&b.1.lo()))?;
    Some(shortened_check(q, weakest.0, weakest.1))
}

fn shortened_check(q: usize, k: usize, least: Interval) -> Check {
    let found = if least.is_positive() {
        Finding::proved("they are stable")
    } else if least.is_negative() {
        let point = Point {
            coordinates: vec![],
            value: least.midpoint(),
        };
        let detail = "poles to the right of the imaginary axis: the error grows for every large θ2";
        Finding::refuted(point, detail)
    } else {
        Finding::undecided("hidden by rounding")
    };
    Statement::from(Farza::ShortenedChain { layer: k, gains: q }).with(found)
}

/// Whether the proof covers the blocks; `form` with the signals apart from the states.
pub(super) fn covered(form: &Form<'_, '_>, region: &Region) -> Result<Check, DesignError> {
    let sizes = form.sizes();
    let proved = |detail: String| proved(Farza::LeftInverse, detail);
    let reason = match (form.shape(), form.bends()) {
        (Shape::Square, _) => {
            return Ok(proved(format!(
                "the blocks of Λ₂ are square: {} in each block of X²",
                counted(sizes[0], "state")
            )));
        }
        (Shape::Tall, false) => {
            return Ok(proved(format!(
                "blocks of {sizes:?} states, and Λ₂ does not read X²: what Λ₂⁺ leaves out of x₂¹ decays with the pole −qθ₂"
            )));
        }
        (Shape::Tall, true) => "Λ₂ changes with X², and so does the range of its left inverse",
        (Shape::Narrowing, _) => {
            "the chains that end early get the first gains of longer ones, for which the paper's S₂ is no Lyapunov function"
        }
    };
    let advice = match partition::square(form, region)? {
        Some(outputs) => format!("; the blocks are square with partition = [{outputs}]"),
        None => String::new(),
    };
    let detail = format!("blocks of {sizes:?} states: Λ₂Λ₂⁺ is a projection, and {reason}{advice}");
    Ok(undecided(Farza::LeftInverse, detail))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_end_where_layers_narrow() {
        assert_eq!(ends(&[3, 2, 2, 1]), [1, 3]);
        assert_eq!(ends(&[2, 2]), [0; 0]);
        assert_eq!(ends(&[1]), [0; 0]);
    }
}
