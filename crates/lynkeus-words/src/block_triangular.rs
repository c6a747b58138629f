//! The family `block-triangular`, after Lee, Yee and Park.

use crate::short;
use lynkeus_observers::Lee;
use lynkeus_observers::block_triangular::{Correction, Said};

use crate::Words;
use crate::chains::{chains, eigenvalues};

impl Words for Lee {
    fn words(&self) -> String {
        match self {
            Self::Observer => "the observer is (7) or (3) with a constant θ".to_owned(),
            Self::Stable { states } => format!("A − KC is stable for ({})", states.join(" → ")),
            Self::StableAlong { states } => format!(
                "A(a) − KC is stable for every partial a along ({})",
                states.join(" → ")
            ),
            Self::Assumption1 => {
                "M R M⁻¹ and Ṁ M⁻¹ have bounds on the box (Assumption 1)".to_owned()
            }
            Self::Lyapunov { states } => {
                format!("(A − KC)ᵀP + P(A − KC) < 0 for ({})", states.join(" → "))
            }
            Self::Theta { θ } => {
                let θ: Vec<String> = θ.iter().map(|&θ| short(θ)).collect();
                format!("θ = ({}) is large enough", θ.join(", "))
            }
        }
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::OnlyClassical => "correction = \"classical\" with form = \"low-power\": observer (7) has no such form".to_owned(),
            Self::Form { chains: all, correction, ones, numbers, orders } => {
                let mut words = chains(all, ", then ");
                words += match (correction, ones, numbers) {
                    (_, true, _) => "",
                    (Correction::Lee, false, true) => "; every ∂f/∂x along the chains is a number: the paper's form (2) in other units",
                    (Correction::Lee, false, false) => "; not every ∂f/∂x along the chains is a number, so convergence is local (Remark 3)",
                    (Correction::Classical, false, _) => "; not every ∂f/∂x along the chains is 1, as in the paper's form (2)",
                };
                if *orders > 1 {
                    words += &format!("; one of {orders} orders of these chains, the key 'order' decides otherwise");
                }
                words
            }
            Self::SignUnknown => "a partial is not known to keep one sign between finite bounds".to_owned(),
            Self::Eigenvalues(found) => eigenvalues(found),
            Self::Unstable { eigenvalues: found, divided } => {
                let advice = match divided {
                    None => "k_poles places them, and without k they are all −1".to_owned(),
                    Some(K) => {
                        let K: Vec<String> = K.iter().map(|&k| short(k)).collect();
                        format!("observer (3) is made for partials that are 1: correction = \"lee\" divides by them; so does, in the middle of their bounds, k = [{}] for this chain, where the k here is one for partials that are 1", K.join(", "))
                    }
                };
                format!("{}; {advice}", eigenvalues(found))
            }
            Self::OneLyapunovFunction => "one Lyapunov function for all of their bounds".to_owned(),
            Self::NoLyapunovFunction { eigenvalues: found } => format!("{} in the middle of the partials' bounds, and no Lyapunov function of the middle covers them all; correction = \"lee\" follows the partials", eigenvalues(found)),
            Self::BreaksRule { later, before, count, needed } => format!("theta: {later} for the later chain is below {needed} = {before}^{count} of the chain before it; the proof of Theorem 1 needs at least that"),
            Self::NoBounds => "they have none: declare min and max of the states that M depends on and of the chains' heads; where M depends on an input, bound its derivative under `input_derivatives` in [certify]; correction = \"classical\" needs none of this".to_owned(),
            Self::Decays(μ) => format!("≤ −{}·diag(P), for every ∂f/∂x along the chain", short(*μ)),
            Self::NoDecay => "not with the P of the middle of the partials' bounds: K does not stabilise the chain, or (classical observer) the partials vary too much".to_owned(),
            Self::NegativeDefinite => "the comparison matrix is negative definite".to_owned(),
            Self::Threshold(Some(θ0)) => format!("proved from θ1 = θ0 = {} on (the others in proportion of their logarithms); the theorem is sufficient, not necessary", short(*θ0)),
            Self::Threshold(None) => "no θ0 was found: in this box the bound of Ṁ or of the couplings grows as fast as the decay. The theorem is sufficient, not necessary".to_owned(),
            Self::MovingM => "Observer (7): M(x̂) moves with the correction, so its derivative grows with θ and with the error (the paper's Lemma 2 ii takes it as bounded independently of θ). The bound used here is that of the declared box, |y − x̂_1| at most the width of the range of x_1: a proof for that box, not a global one. Narrow ranges make it sharper; correction = \"classical\" does without.".to_owned(),
        }
    }
}
