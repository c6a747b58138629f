//! Condition H3 for the chains of a plant: the partials along them, and what an S of the
//! study does by itself and with the plant's own damping.

use lynkeus_expr::{MissingInput, Tape, jacobian};
use lynkeus_proof::hurwitz::Stability;
use lynkeus_proof::spectrum;
use lynkeus_structure::{Assignment, AugmentedPlant, Region, chains};
use nalgebra::DMatrix;

use super::form::{Form, Gains, Window};
use super::said::{Hammouri, Loose, Said};
use super::settings::Settings;
use crate::conditions::{GainedChain, along, lipschitz, names};
use crate::design::{Found, first_fit};
use crate::paper::Settings as _;
use crate::statement::undecided;
use crate::{DesignError, Examination, Reason};

/// The first assignment whose conditions are proved, else the first that no condition
/// refutes, else the first with its refusal; or the examination that says why there is none.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Result<Found<Form>, DesignError> {
    let refusal =
        |summary: Reason| Err(Examination::unfit(Settings::FAMILY, summary, vec![]).into());
    let mut assignments = match chains::find(augmented, &settings.request) {
        Ok(assignments) => assignments,
        Err(summary) => return refusal(summary.into()),
    };
    if let Some(leading) = settings.leading {
        assignments.retain(|a| a.leads.contains(&leading));
        assignments.iter_mut().for_each(|a| a.leading = leading);
        if assignments.is_empty() {
            return refusal(Said::CannotLead.into());
        }
    } else if let Some(δ) = &settings.δ {
        assignments
            .iter_mut()
            .for_each(|a| lead_within_window(a, δ));
    }
    let choices = assignments.len();
    first_fit(assignments, |assignment| {
        examined(augmented, settings, region, assignment, choices)
    })
}

/// Where several chains can lead, the first for which the given exponents lie in the window.
fn lead_within_window(assignment: &mut Assignment, δ: &[f64]) {
    let lengths = assignment.lengths();
    let holds = |lead: &usize| Window::all(&lengths, *lead, δ).iter().all(Window::holds);
    if !holds(&assignment.leading)
        && let Some(lead) = assignment.leads.iter().copied().find(holds)
    {
        assignment.leading = lead;
    }
}

/// Condition H3 for one assignment.
fn examined(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
    assignment: Assignment,
    choices: usize,
) -> Result<Found<Form>, DesignError> {
    let places = assignment.chains.iter().map(|c| &c[..]);
    let (partials, mut checks) = along(augmented, places.enumerate(), region)?;
    checks.push(lipschitz(augmented, region)?);
    let chains = assignment.chains.iter();
    let chains: Vec<Vec<String>> = chains.map(|c| names(augmented, c)).collect();
    let leads = assignment.leads.len();
    let leading = augmented.outputs[assignment.leading].variable.name.clone();
    let form = Form {
        assignment,
        partials,
    };
    // a plant that is damped by itself may carry a gain that does not stabilise its chain, as the paper's
    // column does; where it does not even in the middle of the box, the gain is not called fit
    let mut loose = form.loose(augmented, settings);
    let count = augmented.states.len();
    let is_large = count > LARGEST;
    if !loose.is_empty() && (is_large || !form.is_damped(augmented, settings, region)?) {
        let said = Said::Loose {
            chains: std::mem::take(&mut loose),
            too_many: is_large.then_some((count, LARGEST)),
        };
        checks.push(undecided(Hammouri::Damped, said));
    }
    let summary = Said::Form {
        chains: chains.clone(),
        choices,
        leads,
        leading,
        loose,
    };
    let examination =
        Examination::new(augmented, region, Settings::FAMILY, summary, chains, checks)?;
    Ok(Found { form, examination })
}

/// Most states whose eigenvalues are computed: their number cubed is the work, and those of a long
/// chain with a gain move as far as they are large by rounding alone.
const LARGEST: usize = 200;

/// A chain that the gain does not stabilise by itself; none where it does, or where the partials have
/// no middle.
fn loose_by(chain: &GainedChain<'_>, states: &[String]) -> Option<Loose> {
    let a = chain.middle()?;
    let frozen = chain.frozen();
    let is_unstable = frozen == Stability::Unstable;
    if let ([first, .., last], true) = (states, states.len() > LARGEST) {
        let states = vec![first.clone(), "…".to_owned(), last.clone()];
        return (frozen != Stability::Stable).then_some(Loose {
            states,
            is_unstable,
            eigenvalues: None,
        });
    }
    let eigenvalues = chain.eigenvalues(&a);
    let seen_stable = eigenvalues.first().map(|λ| λ.0 < 0.0);
    // what Routh's table proves no rounded eigenvalue takes back
    if frozen == Stability::Stable || (!is_unstable && seen_stable == Some(true)) {
        return None;
    }
    Some(Loose {
        states: states.to_vec(),
        is_unstable,
        eigenvalues: seen_stable.map(|_| eigenvalues),
    })
}

impl Form {
    /// The chains that the S given does not stabilise by itself.
    fn loose(&self, augmented: &AugmentedPlant<'_>, settings: &Settings) -> Vec<Loose> {
        let Some(S) = &settings.S else {
            return vec![];
        };
        let chains = &self.assignment.chains;
        let ones = vec![1.0; chains.len()];
        let r = settings.r.as_ref().unwrap_or(&ones);
        let divided = settings.divided;
        let mut loose = vec![];
        for (i, chain) in chains.iter().enumerate() {
            let K: Vec<f64> = S[i].gain().into_iter().map(|s| r[i] * s).collect();
            let bounds = self.partials[i].iter().map(|p| match divided {
                true => (1.0, 1.0),
                false => p.bounds,
            });
            let gained = GainedChain {
                K: &K,
                partials: &bounds.collect::<Vec<_>>(),
            };
            loose.extend(loose_by(&gained, &names(augmented, chain)));
        }
        loose
    }

    /// Whether the error's Jacobian at x̂ = x in the middle of the box is stable; false where
    /// the study has no θ yet.
    fn is_damped(
        &self,
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        region: &Region,
    ) -> Result<bool, MissingInput> {
        let Ok(gains) = Gains::new(self, settings) else {
            return Ok(false);
        };
        let n = augmented.states.len();
        let graph = augmented.graph();
        let jacobian = jacobian::forward(graph, &augmented.derivatives, &augmented.symbols());
        let nodes: Vec<_> = jacobian.entries.iter().map(|e| e.2).collect();
        let mut values = vec![0.0; nodes.len()];
        Tape::new(graph, &region.symbols(), &nodes)?
            .evaluator()
            .eval(&region.centre(), &mut values);
        let mut A = DMatrix::zeros(n, n);
        for (&(i, j, _), value) in jacobian.entries.iter().zip(values) {
            A[(i, j)] = value;
        }
        for (i, chain) in self.assignment.chains.iter().enumerate() {
            // the signs of Remark 2, or divided by the partials
            let along = chain.windows(2).map(|pair| A[(pair[0], pair[1])]);
            let factors: Vec<f64> = along
                .map(|a| if gains.divided { 1.0 / a } else { a.signum() })
                .collect();
            let mut product = 1.0;
            for (j, (&state, k)) in chain.iter().zip(gains.chain(i)).enumerate() {
                product *= if j == 0 { 1.0 } else { factors[j - 1] };
                A[(state, chain[0])] -= product * k;
            }
        }
        Ok(spectrum::abscissa(A).is_some_and(|largest| largest < 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(K: &[f64], partials: &[(f64, f64)]) -> Option<Loose> {
        let names: Vec<String> = (1..=K.len()).map(|i| format!("x{i}")).collect();
        loose_by(&GainedChain { K, partials }, &names)
    }

    /// s³ + s² + c s + (c less one unit in the last place), with zeros left of the axis by less
    /// than computed ones are wrong by: Routh's table proves them stable.
    #[test]
    fn rounded_eigenvalues_take_no_proof_back() {
        let ones = [(1.0, 1.0); 2];
        let mut beyond = 0;
        for k in 1..60 {
            let c = 0.37 * f64::from(k);
            let K = [1.0, c, c.next_down()];
            let chain = GainedChain {
                K: &K,
                partials: &ones,
            };
            assert_eq!(chain.frozen(), Stability::Stable);
            assert_eq!(said(&K, &ones), None, "{c}");
            beyond += usize::from(chain.eigenvalues(&[1.0; 2])[0].0 >= 0.0);
        }
        assert!(beyond > 0);
    }

    #[test]
    fn what_is_not_found_is_not_called_stable() {
        // s³ + s² + 1e400 s + 1e600
        let large = [(1e200, 1e200); 2];
        let found = said(&[1.0, 1e200, 1e200], &large).unwrap();
        assert!(!found.is_unstable && found.eigenvalues.is_none());
        let found = said(&[-1e200, 1e200], &[(1e200, 1e200)]).unwrap();
        assert!(found.is_unstable && found.eigenvalues.is_none());
        let found = said(&[-2.0, 5.0], &[(1.0, 1.0)]).unwrap();
        let [(re, im), _] = found.eigenvalues.unwrap()[..] else {
            panic!("not two")
        };
        assert!((re - 1.0).abs() < 1e-12 && (im.abs() - 2.0).abs() < 1e-12);
        // 3·3 > a₂ in the middle only
        assert_eq!(said(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (4.0, 16.0)]), None);
    }
}
