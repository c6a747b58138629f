//! The family `triangular`, after Hammouri, Targui and Armanet.

use crate::{declare, short};
use lynkeus_observers::Hammouri;
use lynkeus_observers::triangular::{Loose, Said};

use crate::Words;
use crate::chains::{chains, eigenvalues};

impl Words for Hammouri {
    fn words(&self) -> String {
        match self {
            Self::Observer => {
                "the observer is (9) with a constant gain from a tridiagonal S".to_owned()
            }
            Self::ConstantGain => "the gain is constant".to_owned(),
            Self::PartialsAreBounded => {
                "Lemma 1: every partial along the chains lies in some [α1, α2], α1 > 0".to_owned()
            }
            Self::Lemma1 { states, ρ } => format!(
                "Lemma 1 for ({}): A(a)ᵀS + SA(a) − ρCᵀC < 0 for every a in its bounds, ρ = 2r = {}",
                states.join(" → "),
                short(*ρ)
            ),
            Self::Window => "δ2/δ1 lies in the window of Theorem 2".to_owned(),
            Self::Theta { θ } => format!("θ = {} is at least θ0", short(*θ)),
            Self::Comparison => {
                "the comparison matrix is negative definite at the study's θ".to_owned()
            }
            Self::Damped => {
                "the error decays where it is small, in the middle of the box".to_owned()
            }
        }
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::CannotLead => "the chain that 'leading' names cannot lead: beside its last equation it reads another chain's hidden states".to_owned(),
            Self::Form { chains: all, choices, leads, leading, loose } => {
                let mut words = chains(all, " and ");
                if *choices > 1 {
                    words += &format!(", the most balanced of {choices} assignments that the equations allow; the key 'chains' decides otherwise");
                }
                if *leads > 1 {
                    let which = match *leads {
                        count if count < all.len() => format!("{count} of the chains"),
                        2 => "either chain".to_owned(),
                        _ => "any chain".to_owned(),
                    };
                    words += &format!("; {which} can lead in Theorem 2, that of {leading} does, the key 'leading' decides otherwise");
                }
                if !loose.is_empty() {
                    words += &format!("; {}", not_stabilised(loose));
                }
                words
            }
            Self::Loose { chains, too_many } => {
                let words = not_stabilised(chains);
                match too_many {
                    Some((count, most)) => format!("{words}; whether this plant's damping is enough is not looked into: it has {count} states, more than {most}"),
                    None => words,
                }
            }
            Self::OutsideWindow { low, high, ratio } => format!("delta: the ratio {ratio:.4} lies outside ({low:.4}, {high:.4}), the window of Theorem 2; its proof does not cover this observer"),
            Self::Ratio { ratio, low, high, inside } => {
                let words = format!("{} in ({}, {})", short(*ratio), short(*low), short(*high));
                match inside {
                    true => words,
                    false => format!("not {words}: no θ0 is known, the couplings between the chains grow faster than the decay"),
                }
            }
            Self::GainVaries => "partials = true divides it by the partials at the estimate, which vary on the box, and the theorem covers a constant gain only: missing is a bound of how fast they change and of how much they differ from the plant's".to_owned(),
            Self::NoBounds { partial, undeclared } => {
                let advice = declare(undeclared, "narrow min and max so that it keeps away from zero and infinity");
                format!("{partial} has no positive lower and finite upper bound on the box: {advice}")
            }
            Self::BoundsKnown { known, all } => format!("Known so far: {known} of {all} partials along the chains have bounds; without the others there is no S by Lemma 1 and no θ0."),
            Self::LemmaRefuted => "A refuted Lemma 1 ends this proof, whatever θ is. It does not say that the estimate diverges: a plant that is damped by itself may carry the observer. Lemma 1's own S (leave the key S out) satisfies it.".to_owned(),
            Self::NoKernel(error) => error.to_string(),
            Self::LemmaHolds { η, least } => format!("with η = {}; it holds for every ρ above {}", short(*η), short(*least)),
            Self::LemmaBarely => "it holds in floating point, but with less than the rounding errors to spare".to_owned(),
            Self::LemmaAbove { least } => format!("this S satisfies it for ρ > {} only; choose r > {}", short(*least), short(least / 2.0)),
            Self::LemmaBreaks { direction, eigenvalue, certain } => {
                let parts = direction.iter().filter(|(_, v)| v.abs() > 5e-4);
                let parts: Vec<String> = parts.map(|(name, v)| format!("{v:+.3}·{name}")).collect();
                let (direction, size) = (parts.join(" "), short(*eigenvalue));
                match certain {
                    true => format!("this S satisfies it for no ρ: in the direction {direction}, which the sensor does not see, AᵀS + SA is +{size} there (a_j: the partials along the chain), whatever ρ is"),
                    false => format!("in the direction {direction}, which the sensor does not see, AᵀS + SA is {size} whatever ρ is, too near to zero for rounding errors to tell its sign (a_j: the partials along the chain)"),
                }
            }
            Self::Threshold { θ0, holds } => match (θ0, holds) {
                (Some(θ0), true) => format!("θ0 = {}", short(*θ0)),
                (Some(θ0), false) => format!("θ0 = {}: the theorem proves the decay from there on and says nothing below; it is sufficient, not necessary", short(*θ0)),
                (None, true) => "no θ0 was found, but the inequality holds at this θ".to_owned(),
                (None, false) => "no θ0 was found up to 1e12 times the study's θ".to_owned(),
            },
            Self::AtTheseThetas { holds: true } => "one θ per chain has no common θ0: checked at these".to_owned(),
            Self::AtTheseThetas { holds: false } => "it is not; the theorem is sufficient, not necessary: try a larger θ, the same for all chains".to_owned(),
        }
    }
}

fn not_stabilised(chains: &[Loose]) -> String {
    let each: Vec<String> = chains.iter().map(Words::words).collect();
    format!(
        "with the S given A(a) − rS⁻¹CᵀC {}; only a plant that is damped by itself converges with such a gain, Lemma 1's own S (leave the key S out) is stable",
        each.join(" and ")
    )
}

impl Words for Loose {
    fn words(&self) -> String {
        let states = self.states.join(" → ");
        match (&self.eigenvalues, self.is_unstable) {
            (Some(found), _) => format!(
                "is not stable for ({states}), {} in the middle of the partials' bounds",
                eigenvalues(found)
            ),
            (None, true) => format!("is not stable for ({states})"),
            (None, false) => format!("is not proved to be stable for ({states})"),
        }
    }
}
