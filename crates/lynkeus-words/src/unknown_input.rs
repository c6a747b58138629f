//! The family `unknown-input`, after Farza, M'Saad, Liu and Targui.

use crate::{counted, short};
use lynkeus_observers::unknown_input::{Farza, Said, Shape};
use lynkeus_structure::Standing;

use crate::{Words, arrows};

impl Words for Farza {
    fn words(&self) -> String {
        match self {
            Self::H1 { layer, rank } => format!(
                "(H1) rank ∂f{}/∂x{} = {rank}",
                superscript(*layer),
                superscript(layer + 1)
            ),
            Self::H2 { layer } => format!(
                "(H2) x{} ↦ f{} is one to one",
                superscript(layer + 1),
                superscript(*layer)
            ),
            Self::H4i { rank } => format!("(H4) (i) rank G₁¹ = {rank}"),
            Self::H4ii { rank } => format!("(H4) (ii) rank (∂f̃¹/∂x² G¹) = {rank}"),
            Self::Eleven { rank } => format!("(11) rank ∂f̄₁²/∂x² = {rank}"),
            Self::ShortenedChain { layer, gains } => format!(
                "the chain that ends in layer {layer} is stable with the first {layer} of the gains of {gains}: Routh's numbers are positive"
            ),
            Self::LeftInverse => "Λ₂Λ₂⁺ = I, or it leaves whole chains: the step to (24)".into(),
            Self::Regular => {
                "Λ₂ is regular for estimates that differ from the measured signals".into()
            }
            Self::Continuous => {
                "what the proof differentiates has values on the box and does not jump".into()
            }
            Self::Constants => "c1, c2, c4 and c5 are finite on the box".into(),
            Self::H5 => "(H5) v' is bounded".into(),
            Self::ThetaGiven => "θ1 ≥ θ1*".into(),
            Self::Theta1 => "θ1 ≥ θ1* = c1 + (c2 + c5)²θ2²/(4(θ2 − c4))".into(),
            Self::Theta2 => "θ2 ≥ θ2* = max(1, c4)".into(),
            Self::Rate => "λ > 0".into(),
        }
    }
}

impl Words for Said {
    fn words(&self) -> String {
        match self {
            Self::Form {
                layers,
                unknown,
                first,
                second,
            } => format!(
                "layers {}; the unknown {} read from x₁¹ = ({}), the rest from x₂¹ = ({})",
                arrows(layers),
                unknown.join(", "),
                first.join(", "),
                second.join(", ")
            ),
            Self::NoPartition {
                layers,
                tried,
                closest,
            } => format!(
                "layers {}; {}",
                arrows(layers),
                no_partition(*tried, closest.as_ref())
            ),
            Self::FollowsFromIAndEleven => "follows from (i) and (11)".into(),
            Self::Shortened(Standing::Proved) => "they are stable".into(),
            Self::Shortened(Standing::Refuted) => {
                "poles to the right of the imaginary axis: the error grows for every large θ2".into()
            }
            Self::Shortened(Standing::Undecided) => "hidden by rounding".into(),
            Self::Blocks {
                shape,
                sizes,
                bends,
                partition,
            } => blocks((*shape, *bends), sizes, partition.as_deref()),
            Self::FullColumnRank => "each block has full column rank on the box".into(),
            Self::Block(k, found) => {
                format!("block {k}: {} ({})", found.reason.words(), found.verdict.words())
            }
            Self::Constants => "bounds of f, G and their derivatives on the box".into(),
            Self::NoConstants { open, left } => no_constants(open, *left),
            Self::Slow { ε, are_constant } => match (*ε == 0.0, are_constant) {
                (true, true) => "assumed constant".into(),
                (true, false) => "assumed constant but for its process noise".into(),
                (false, _) => format!("assumed: |v'| ≤ {}", short(*ε)),
            },
            Self::NoTheta(Some([θ1, θ2])) => format!(
                "no theta is given; the proof asks for one like [{}, {}]",
                short(*θ1),
                short(*θ2)
            ),
            Self::NoTheta(None) => "no theta is given, and the proof gives none on this box".into(),
            Self::NoC4 => "c4 has no bound".into(),
            Self::Rate(λ) => short(*λ),
            Self::Tilde => "in the box beside plant and estimate: X̃² = X̂² − D (x̂₁¹ − y₁), at which Λ₂ is taken; with the key 'clamp' the observer sees to Λ₂'s argument, not to X̃² itself".into(),
            Self::NoiseInSignals => "no ultimate bound: G or Λ₂ reads measured signals, and the proof does not cover noise in them".into(),
            Self::NoUltimateBound => "no ultimate bound: a disturbance or a measurement error has none; declare min and max of the disturbances".into(),
            Self::Thetas([θ1, θ2], [c1, c2, c4, c5]) => format!(
                "theta: [{θ1:.4e}, {θ2:.4e}] from the inequality at the end of the proof of Theorem 1 with c1 = {c1:.3e}, c2 = {c2:.3e}, c4 = {c4:.3e}, c5 = {c5:.3e}, bounds on the declared box of the error linearised along the trajectory; sufficient, by far not necessary: give theta to amplify noise less"
            ),
        }
    }
}

fn no_partition(tried: usize, closest: Option<&(Vec<String>, Farza)>) -> String {
    let Some((first, failed)) = closest else {
        return "there are too many measured outputs to try every partition, give the key 'partition'".into();
    };
    let which = match tried {
        1 => "the partition".to_owned(),
        _ => format!("none of {tried} partitions of the measured outputs meets (H4); the closest,"),
    };
    format!(
        "{which} x₁¹ = ({}) fails {}",
        first.join(", "),
        failed.words()
    )
}

fn blocks(kind: (Shape, bool), sizes: &[usize], partition: Option<&[String]>) -> String {
    let reason = match kind {
        (Shape::Square, _) => {
            return format!(
                "the blocks of Λ₂ are square: {} in each block of X²",
                counted(sizes[0], "state")
            );
        }
        (Shape::Tall, false) => {
            return format!(
                "blocks of {sizes:?} states, and Λ₂ does not read X²: what Λ₂⁺ leaves out of x₂¹ decays with the pole −qθ₂"
            );
        }
        (Shape::Tall, true) => "Λ₂ changes with X², and so does the range of its left inverse",
        (Shape::Narrowing, _) => {
            "the chains that end early get the first gains of longer ones, for which the paper's S₂ is no Lyapunov function"
        }
    };
    let advice = partition.map_or(String::new(), |outputs| {
        let outputs: Vec<String> = outputs.iter().map(|y| format!("\"{y}\"")).collect();
        format!(
            "; the blocks are square with partition = [{}]",
            outputs.join(", ")
        )
    });
    format!("blocks of {sizes:?} states: Λ₂Λ₂⁺ is a projection, and {reason}{advice}")
}

fn no_constants(open: &[String], left: bool) -> String {
    match (open.is_empty(), left) {
        (false, _) => {
            let shown: Vec<&str> = open.iter().map(String::as_str).take(4).collect();
            let further = if open.len() > shown.len() { ", and so on" } else { "" };
            format!("no bound of {}: declare min and max{further}", shown.join(", "))
        }
        (true, true) => "Λ₂ has no inverse but a left one".into(),
        (true, false) => "Λ₂ has no bounded inverse as far as interval arithmetic can tell on a box this large: declare a smaller one".into(),
    }
}

/// ¹, ², …
fn superscript(k: usize) -> String {
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map(|d| digits[d as usize]);
    k.to_string().chars().filter_map(digit).collect()
}
