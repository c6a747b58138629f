//! The condition on K.
//!
//! Observer (7) divides by the partials, so that A − KC of a chain of integrators decides.
//! The classical observer (3) is the paper's for partials that are 1. With other partials
//! A(a) − KC decides, for every a that they may take: one negative partial makes the default
//! K unstable, and a K with the right signs stable.

use crate::statement::{proved, refuted, undecided};
use crate::{Check, Lee};
use lynkeus_expr::Interval;
use lynkeus_proof::chain::Chain;
use lynkeus_proof::hurwitz::Stability;
use lynkeus_proof::lyapunov;
use lynkeus_proof::matrix::points;
use lynkeus_structure::Extended;

use super::settings::{Correction, Settings};
use crate::conditions::{Partial, names};
use crate::proof::words::shown;
use crate::stability::{GainedChain, told};

/// Whether K stabilises a chain; none where that is known: K by its poles for a chain of
/// integrators, or the form whose gains are divided by the partials one at a time.
pub(super) fn stable(
    extended: &Extended<'_>,
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
    let states = names(extended, states);
    let name = match integrators {
        true => Lee::Stable { states },
        false => Lee::StableAlong { states },
    };
    let Some(a) = chain.middle() else {
        let detail = "a partial is not known to keep one sign between finite bounds";
        return Some(undecided(name, detail));
    };
    let eigenvalues = told(&chain.eigenvalues(&a));
    let constant = ranges.iter().all(|(low, high)| low == high);
    Some(match (chain.frozen(), constant) {
        (Stability::Unstable, _) => {
            let detail = format!("{eigenvalues}; {}", advice(settings.correction, K, &a));
            refuted(name, chain.witness(&a), detail)
        }
        (Stability::Stable, true) => proved(name, eigenvalues),
        _ => match decay(K, &a, &ranges) {
            Some(_) => proved(name, "one Lyapunov function for all of their bounds"),
            None => {
                let detail = format!(
                    "{eigenvalues} in the middle of the partials' bounds, and no Lyapunov function of the middle covers them all; correction = \"lee\" follows the partials"
                );
                undecided(name, detail)
            }
        },
    })
}

fn advice(correction: Correction, K: &[f64], a: &[f64]) -> String {
    let ones = vec![(1.0, 1.0); a.len()];
    let for_integrators = GainedChain { K, partials: &ones }.frozen() == Stability::Stable;
    match correction {
        _ if !for_integrators => "k_poles places them, and without k they are all −1".to_owned(),
        Correction::Lee => "k_poles places them, and without k they are all −1".to_owned(),
        Correction::Classical => {
            let mut product = 1.0;
            let divisors = std::iter::once(1.0).chain(a.iter().map(|a| {
                product *= a;
                product
            }));
            let divided: Vec<String> = K.iter().zip(divisors).map(|(k, d)| shown(k / d)).collect();
            format!(
                "observer (3) is made for partials that are 1: correction = \"lee\" divides by them; so does, in the middle of their bounds, k = [{}] for this chain, where the k here is one for partials that are 1",
                divided.join(", ")
            )
        }
    }
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
