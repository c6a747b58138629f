//! The family `state-affine`, after Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa.

use crate::{declare, short};
use lynkeus_observers::state_affine::{Ltaief, Said};

use crate::{Words, arrows};

impl Words for Ltaief {
    fn words(&self) -> String {
        match self {
            Self::BlockShows { factor, states } => format!(
                "F_{factor} ξ ≠ 0 for every direction ξ of ({})",
                states.join(", ")
            ),
            Self::A1 => "C(u) and F(u, x) are bounded on the box (A1)".into(),
            Self::A3 => "what acts on the plant unknown to the observer is bounded (A3)".into(),
            Self::A4 => "persistent excitation (A4): S(t) ≥ λ_m I".into(),
            Self::Theta { θ } => format!("θ = {} is large enough: μ_θ > 0", short(*θ)),
        }
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::Form {
                blocks,
                depends_on_inputs,
            } => {
                let more = "; which inputs suffice depends on their excitation (A4), which the monitor 'excitation' watches";
                arrows(blocks) + if *depends_on_inputs { more } else { "" }
            }
            Self::OutsideLast { states, last } => format!(
                "an uncertainty acts on {}, outside of the last block ({}); Theorem 1 covers the last one only, and the error of the blocks behind need not shrink as theta grows",
                states.join(", "),
                last.join(", ")
            ),
            Self::Enclosed => "every entry enclosed".into(),
            Self::NoBound { entry, undeclared } => {
                let advice = declare(
                    undeclared,
                    "mind divisions and roots at the edges of the box",
                );
                format!("{entry} has no bound: {advice}")
            }
            Self::Drift { constant } => match constant.is_empty() {
                true => "by the assumed drift".to_owned(),
                false => format!(
                    "by the assumed drift, which takes {} as constant",
                    constant.join(", ")
                ),
            },
            Self::NoDrift(state) => format!("no bound is assumed for the drift of {state}"),
            Self::Excited { λ, from } => {
                format!("C and F are numbers: λ_m = {} for t ≥ {from}/θ", short(*λ))
            }
            Self::Watched {
                alarm,
                always_shown,
            } => {
                let text = format!(
                    "it depends on the inputs and the estimate, which no box decides. While the monitor 'excitation' is above its alarm {}, λ_m is at least that, δ_0/α(θ) = e·λ_m, and the constants hold; the key 'alarm' sets it. What is missing for a proof is a lower bound of the excitation for all time",
                    short(*alarm)
                );
                let hidden = ". (12), α(θ)/θ² → 0, holds for no inputs without jumps where a block hides a direction at some instant: λ_min(S) falls like θ^−2 there";
                text + if *always_shown { "" } else { hidden }
            }
            Self::Rate {
                μ,
                θ0,
                is_lasting,
                is_proved,
            } => {
                let from = match θ0 {
                    Some(θ0) => format!("θ0 = {}", short(*θ0)),
                    None if *is_lasting => "no θ0 was found".to_owned(),
                    None => "no θ0 follows from a λ_m that falls as θ grows".to_owned(),
                };
                let more = if *is_proved {
                    ""
                } else {
                    "; sufficient, not necessary"
                };
                format!("μ_θ = {}, {from}{more}", short(*μ))
            }
        }
    }
}
