//! The block-triangular form: chains, their order, and the conditions.
//!
//! Observer (7) divides by the partials, so that A − KC of a chain of integrators decides.
//! The classical observer (3) is the paper's for partials that are 1. With other partials
//! A(a) − KC decides, for every a that they may take: one negative partial makes the default
//! K unstable, and a K with the right signs stable.

use lynkeus_expr::Interval;
use lynkeus_proof::chain::Chain;
use lynkeus_proof::hurwitz::Stability;
use lynkeus_proof::lyapunov;
use lynkeus_proof::matrix::points;
use lynkeus_structure::{AugmentedPlant, Blocks, Region, blocks};

use super::said::{Correction, Lee, Said};
use super::settings::Settings;
use crate::conditions::{GainedChain, Partial, lipschitz, names, output_slope, partials};
use crate::design::{Found, first_fit};
use crate::paper::Settings as _;
use crate::statement::{proved, refuted, undecided};
use crate::{Check, DesignError, Examination, Reason, TuningError};

/// Different chains that are examined before the first without a refuted condition is taken.
const EXAMINED: usize = 16;

/// The block-triangular form of a plant with the facts about its partials.
pub struct Form {
    pub blocks: Blocks,
    /// per block
    pub(crate) partials: Vec<Vec<Partial>>,
}

/// The first arrangement into blocks whose conditions are proved, else the first that no
/// condition refutes, else the first with its refusal.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Result<Found<Form>, DesignError> {
    let refusal =
        |summary: Reason| Err(Examination::unfit(Settings::FAMILY, summary, vec![]).into());
    if settings.impossible() {
        return refusal(Said::OnlyClassical.into());
    }
    let arrangements = match blocks::find(augmented, &settings.request, settings.order.as_deref()) {
        Ok(arrangements) => arrangements,
        Err(summary) => return refusal(summary.into()),
    };
    let choices = distinct(augmented, settings, &arrangements)?;
    first_fit(choices.into_iter().take(EXAMINED), |choice| {
        examined(augmented, settings, region, choice)
    })
}

/// One arrangement of those with the same chains.
struct Choice {
    blocks: Blocks,
    /// orders that the equations allow for these chains
    orders: usize,
}

/// Per set of chains the first order for which θ satisfies the theorem's rule, else the first.
fn distinct(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    arrangements: &[Blocks],
) -> Result<Vec<Choice>, TuningError> {
    let θ = settings.given_θ()?;
    let breaks = |blocks: &Blocks| θ.as_ref().is_some_and(|θ| chain_rule(blocks, θ).is_some());
    let mut found: Vec<(Vec<Vec<String>>, Choice)> = vec![];
    for blocks in arrangements {
        let chains = blocks.names(augmented);
        match found.iter_mut().find(|(known, _)| *known == chains) {
            Some((_, choice)) => {
                choice.orders += 1;
                if breaks(&choice.blocks) && !breaks(blocks) {
                    choice.blocks = blocks.clone();
                }
            }
            None => {
                let (blocks, orders) = (blocks.clone(), 1);
                found.push((chains, Choice { blocks, orders }));
            }
        }
    }
    Ok(found.into_iter().map(|(_, choice)| choice).collect())
}

fn examined(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
    Choice { blocks, orders }: Choice,
) -> Result<Found<Form>, DesignError> {
    let graph = augmented.graph();
    let K = settings.K(&blocks.lengths());
    let (mut checks, mut all): (Vec<Check>, Vec<Vec<Partial>>) = (vec![], vec![]);
    for (output, chain) in &blocks.order {
        checks.extend(output_slope(augmented, *output, region)?);
        let (found, signs) = partials(augmented, chain, region)?;
        checks.extend(signs);
        checks.extend(stable(augmented, settings, chain, &K[*output], &found));
        all.push(found);
    }
    checks.push(lipschitz(augmented, region)?);
    let numbers = all
        .iter()
        .flatten()
        .map(|partial| graph.constant_value(partial.node));
    let ordered = blocks.order.iter();
    let summary = Said::Form {
        chains: ordered.map(|(_, c)| names(augmented, c)).collect(),
        correction: settings.correction,
        ones: numbers.clone().all(|a| a == Some(1.0)),
        // which are 1 in other units
        numbers: numbers.clone().all(|a| a.is_some()),
        orders,
    };
    let chains = blocks.names(augmented);
    let examination =
        Examination::new(augmented, region, Settings::FAMILY, summary, chains, checks)?;
    let form = Form {
        blocks,
        partials: all,
    };
    Ok(Found { form, examination })
}

/// Whether K stabilises a chain; none where that is known: K by its poles for a chain of
/// integrators, or the form whose gains are divided by the partials one at a time.
pub(super) fn stable(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    states: &[usize],
    K: &[f64],
    partials: &[Partial],
) -> Option<Check> {
    let ranges: Vec<(f64, f64)> = match settings.correction {
        Correction::Lee => vec![(1.0, 1.0); partials.len()],
        Correction::Classical => partials.iter().map(Partial::range).collect(),
    };
    let integrators = ranges.iter().all(|&a| a == (1.0, 1.0));
    if settings.remedies.low_power || (integrators && !settings.given) {
        return None;
    }
    let chain = GainedChain {
        K,
        partials: &ranges,
    };
    let states = names(augmented, states);
    let name = match integrators {
        true => Lee::Stable { states },
        false => Lee::StableAlong { states },
    };
    let Some(a) = chain.middle() else {
        return Some(undecided(name, Said::SignUnknown));
    };
    let eigenvalues = chain.eigenvalues(&a);
    let constant = ranges.iter().all(|(low, high)| low == high);
    Some(match (chain.frozen(), constant) {
        (Stability::Unstable, _) => {
            let divided = divided(settings.correction, K, &a);
            let said = Said::Unstable {
                eigenvalues,
                divided,
            };
            refuted(name, chain.witness(&a), said)
        }
        (Stability::Stable, true) => proved(name, Said::Eigenvalues(eigenvalues)),
        _ => match decay(K, &a, &ranges) {
            Some(_) => proved(name, Said::OneLyapunovFunction),
            None => undecided(name, Said::NoLyapunovFunction { eigenvalues }),
        },
    })
}

/// The K for partials `a` where the one given is one for partials that are 1.
fn divided(correction: Correction, K: &[f64], a: &[f64]) -> Option<Vec<f64>> {
    let ones = vec![(1.0, 1.0); a.len()];
    let for_integrators = GainedChain { K, partials: &ones }.frozen() == Stability::Stable;
    if !for_integrators || correction == Correction::Lee {
        return None;
    }
    let mut product = 1.0;
    let divisors = std::iter::once(1.0).chain(a.iter().map(|a| {
        product *= a;
        product
    }));
    Some(K.iter().zip(divisors).map(|(k, d)| k / d).collect())
}

/// μ of the first inequality with the P of the partials `a`.
fn decay(K: &[f64], a: &[f64], ranges: &[(f64, f64)]) -> Option<f64> {
    let P = lyapunov::of_chain(K, a)?;
    let chain = Chain {
        states: (0..K.len()).collect(),
        speed: Interval::ONE,
        scales: vec![Interval::ONE; K.len()],
        S: points(&P),
        g: K.iter().map(|&k| Interval::point(k)).collect(),
        partials: ranges.iter().map(|&range| range.into()).collect(),
    };
    chain.decay()
}

/// Lemma 2's condition on θ.
pub(super) fn chain_rule(blocks: &Blocks, θ: &[f64]) -> Option<Reason> {
    blocks.order.windows(2).find_map(|pair| {
        let ((before, chain), (after, _)) = (&pair[0], &pair[1]);
        let count = chain.len();
        let (before, later) = (θ[*before], θ[*after]);
        let needed = before.powi(count as i32);
        let said = Said::BreaksRule {
            later,
            before,
            count,
            needed,
        };
        (needed > later).then(|| said.into())
    })
}
