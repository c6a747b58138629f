//! Condition H3 for the chains of a plant: the partials along them, and what an S of the
//! study does by itself and with the plant's own damping.

use lynkeus_expr::{MissingInput, Tape, jacobian};
use lynkeus_proof::hurwitz::Stability;
use lynkeus_proof::spectrum;
use lynkeus_structure::{Assignment, AugmentedPlant, Region, Standing, chains};
use nalgebra::DMatrix;

use super::form::{Form, Gains, NAME, Window};
use super::settings::Settings;
use crate::conditions::{GainedChain, lipschitz, names, output_slope, partials, told};
use crate::design::{Found, Searched};
use crate::statement::undecided;
use crate::{DesignError, Examination, Hammouri, TuningError};

/// The first assignment whose conditions are proved, else the first that no condition
/// refutes, else the first with its refusal; or the examination that says why there is none.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Searched<Form> {
    let refusal = |summary: String| Examination::unfit(NAME, summary, vec![]);
    let mut assignments = match chains::find(augmented, &settings.request) {
        Ok(assignments) => assignments,
        Err(summary) => return Ok(Err(refusal(summary))),
    };
    if let Some(leading) = settings.leading {
        assignments.retain(|a| a.leads.contains(&leading));
        assignments.iter_mut().for_each(|a| a.leading = leading);
        if assignments.is_empty() {
            let summary = "the chain that 'leading' names cannot lead: beside its last equation it reads another chain's hidden states";
            return Ok(Err(refusal(summary.into())));
        }
    } else if let Some(δ) = &settings.δ {
        assignments
            .iter_mut()
            .for_each(|a| lead_within_window(a, δ));
    }
    let choices = assignments.len();
    let mut best: Option<Found<Form>> = None;
    for assignment in assignments {
        let form = examined(augmented, settings, region, assignment, choices)?;
        match form.examination.fit() {
            Standing::Proved => return Ok(Ok(form)),
            Standing::Undecided
                if best
                    .as_ref()
                    .is_none_or(|b| b.examination.fit() == Standing::Refuted) =>
            {
                best = Some(form);
            }
            _ => {
                best.get_or_insert(form);
            }
        }
    }
    // chains::find never returns an empty list
    best.map(Ok)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
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
    let (mut checks, mut all) = (vec![], vec![]);
    for (i, chain) in assignment.chains.iter().enumerate() {
        checks.extend(output_slope(augmented, i, region)?);
        let (found, signs) = partials(augmented, &chain.states, region)?;
        checks.extend(signs);
        all.push(found);
    }
    checks.push(lipschitz(augmented, region)?);
    let chains = assignment
        .chains
        .iter()
        .map(|c| names(augmented, &c.states))
        .collect();
    let mut summary = chains::describe(augmented, &assignment);
    if choices > 1 {
        summary += &format!(
            ", the most balanced of {choices} assignments that the equations allow; the key 'chains' decides otherwise"
        );
    }
    if assignment.leads.len() > 1 {
        let leading = &augmented.outputs[assignment.leading].variable.name;
        let which = match assignment.leads.len() {
            count if count < assignment.chains.len() => format!("{count} of the chains"),
            2 => "either chain".to_owned(),
            _ => "any chain".to_owned(),
        };
        summary += &format!(
            "; {which} can lead in Theorem 2, that of {leading} does, the key 'leading' decides otherwise"
        );
    }
    let examination = Examination::new(augmented, region, NAME, summary, chains, checks)?;
    let form = Form {
        assignment,
        partials: all,
    };
    let mut found = Found { form, examination };
    settle(&mut found, augmented, settings, region)?;
    Ok(found)
}

/// Most states whose eigenvalues are computed: their number cubed is the work, and those of a long
/// chain with a gain move as far as they are large by rounding alone.
const LARGEST: usize = 200;

/// What is said of a chain that the gain does not stabilise by itself; none where it does, or
/// where the partials have no middle.
fn loose_by(chain: &GainedChain<'_>, states: &[String]) -> Option<String> {
    let a = chain.middle()?;
    let frozen = chain.frozen();
    if let ([first, .., last], true) = (states, states.len() > LARGEST) {
        let verdict = match frozen {
            Stability::Stable => return None,
            Stability::Unstable => "is not stable",
            Stability::Unknown => "is not proved to be stable",
        };
        return Some(format!("{verdict} for ({first} → … → {last})"));
    }
    let eigenvalues = chain.eigenvalues(&a);
    let states = states.join(" → ");
    let seen_stable = eigenvalues.first().map(|λ| λ.0 < 0.0);
    match (frozen, seen_stable) {
        // what Routh's table proves no rounded eigenvalue takes back
        (Stability::Stable, _) | (Stability::Unknown, Some(true)) => None,
        (Stability::Unknown, None) => Some(format!("is not proved to be stable for ({states})")),
        (Stability::Unstable, None) => Some(format!("is not stable for ({states})")),
        (_, Some(_)) => Some(format!(
            "is not stable for ({states}), {} in the middle of the partials' bounds",
            told(&eigenvalues)
        )),
    }
}

/// Says where A(a) − rS⁻¹CᵀC is not stable. A plant that is damped by itself may carry
/// such a gain, as the paper's column does; where it does not even in the middle of the
/// box, the gain is not called fit.
pub(super) fn settle(
    Found { form, examination }: &mut Found<Form>,
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Result<(), DesignError> {
    let loose = form.loose(augmented, settings);
    if loose.is_empty() {
        return Ok(());
    }
    let words = format!(
        "with the S given A(a) − rS⁻¹CᵀC {}; only a plant that is damped by itself converges with such a gain, Lemma 1's own S (leave the key S out) is stable",
        loose.join(" and ")
    );
    let n = augmented.states.len();
    let words = match n > LARGEST {
        true => format!(
            "{words}; whether this plant's damping is enough is not looked into: it has {n} states, more than {LARGEST}"
        ),
        false if form.is_damped(augmented, settings, region)? => {
            let summary = examination.summary.clone().text();
            examination.summary = format!("{summary}; {words}").into();
            return Ok(());
        }
        false => words,
    };
    examination.checks.push(undecided(Hammouri::Damped, words));
    Ok(())
}

impl Form {
    /// The chains that the gain does not stabilise by itself, with their eigenvalues.
    fn loose(&self, augmented: &AugmentedPlant<'_>, settings: &Settings) -> Vec<String> {
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
            loose.extend(loose_by(&gained, &names(augmented, &chain.states)));
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
            let along = chain.states.windows(2).map(|pair| A[(pair[0], pair[1])]);
            let factors: Vec<f64> = along
                .map(|a| if gains.divided { 1.0 / a } else { a.signum() })
                .collect();
            let mut product = 1.0;
            for (j, (&state, k)) in chain.states.iter().zip(gains.chain(i)).enumerate() {
                product *= if j == 0 { 1.0 } else { factors[j - 1] };
                A[(state, chain.states[0])] -= product * k;
            }
        }
        Ok(spectrum::abscissa(A).is_some_and(|largest| largest < 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(K: &[f64], partials: &[(f64, f64)]) -> Option<String> {
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
        let text = said(&[1.0, 1e200, 1e200], &large).unwrap();
        assert_eq!(text, "is not proved to be stable for (x1 → x2 → x3)");
        let text = said(&[-1e200, 1e200], &[(1e200, 1e200)]).unwrap();
        assert_eq!(text, "is not stable for (x1 → x2)");
        let text = said(&[-2.0, 5.0], &[(1.0, 1.0)]).unwrap();
        assert!(
            text.contains("(x1 → x2), eigenvalues 1 ± 2i in the middle"),
            "{text}"
        );
        // 3·3 > a₂ in the middle only
        assert_eq!(said(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (4.0, 16.0)]), None);
    }
}
