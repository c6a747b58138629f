//! The triangular form: chains, the partials along them, condition H3.

use lynkeus_gain::Tridiagonal;
use lynkeus_gain::hurwitz::Stability;
use lynkeus_structure::{Assignment, Extended, Standing, chains};

use super::NAME;
use super::gains::{Window, explicit};
use crate::conditions::{Partial, chain_request, lipschitz, names, output_slope, partials};
use crate::family;
use crate::stability::{GainedChain, listed};
use crate::{DesignError, Examination, Tuning, TuningError};

/// The triangular form of a plant with the facts about its partials.
pub(super) struct Form {
    pub assignment: Assignment,
    /// per chain, j = 1 … n−1
    pub partials: Vec<Vec<Partial>>,
    pub examination: Examination,
}

/// The first assignment whose conditions are proved, else the first that no condition
/// refutes, else the first with its refusal; or the examination that says why there is none.
pub(super) fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<Form, Examination>, DesignError> {
    let given = explicit(tuning)?;
    let sizes = given.map(|given| given.iter().map(Tridiagonal::size).collect());
    let request = chain_request(extended, tuning, "S", sizes)?;
    let refusal = |summary: String| Examination::unfit(NAME, summary, vec![]);
    let mut assignments = match chains::find(extended, &request) {
        Ok(assignments) => assignments,
        Err(summary) => return Ok(Err(refusal(summary))),
    };
    if let Some(leading) = leading(extended, tuning)? {
        assignments.retain(|a| a.either || a.leading == leading);
        assignments.iter_mut().for_each(|a| a.leading = leading);
        if assignments.is_empty() {
            let summary = "the chain that 'leading' names cannot lead: beside its last equation it reads the other chain's hidden states";
            return Ok(Err(refusal(summary.into())));
        }
    } else {
        let count = extended.outputs.len();
        if let Some(δ) = tuning.positive_per_chain("delta", count)? {
            assignments
                .iter_mut()
                .for_each(|a| lead_within_window(a, &δ));
        }
    }
    let choices = assignments.len();
    let mut best: Option<Form> = None;
    for assignment in assignments {
        let form = examined(extended, tuning, assignment, choices)?;
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

/// The chain that the study lets lead, by the place of its output.
fn leading(extended: &Extended<'_>, tuning: &Tuning) -> Result<Option<usize>, TuningError> {
    let outputs: Vec<&str> = extended
        .outputs
        .iter()
        .map(|o| o.variable.name.as_str())
        .collect();
    let name = tuning.choice("leading", &outputs)?;
    Ok(name.and_then(|name| outputs.iter().position(|o| *o == name)))
}

/// Where either chain can lead, the one for which the given exponents lie in the window.
fn lead_within_window(assignment: &mut Assignment, δ: &[f64]) {
    let holds = |a: &Assignment| Window::of(a, δ).is_none_or(|w| w.holds());
    if assignment.either && !holds(assignment) {
        let mut swapped = assignment.clone();
        swapped.leading = 1 - assignment.leading;
        if holds(&swapped) {
            *assignment = swapped;
        }
    }
}

/// What an S of the study does to a chain by itself, in words. No condition of the form: a
/// plant that is damped by itself may carry it, as the paper's column does; what is
/// guaranteed of the gain is the theorem's to say.
fn carried(
    extended: &Extended<'_>,
    tuning: &Tuning,
    assignment: &Assignment,
    all: &[Vec<Partial>],
) -> Result<Vec<String>, TuningError> {
    let Some(S) = explicit(tuning)? else {
        return Ok(vec![]);
    };
    let count = assignment.chains.len();
    let r = tuning
        .positive_per_chain("r", count)?
        .unwrap_or(vec![1.0; count]);
    let divided = tuning.flag("partials")?;
    let mut words = vec![];
    for (i, chain) in assignment.chains.iter().enumerate() {
        let K: Vec<f64> = S[i].gain().into_iter().map(|s| r[i] * s).collect();
        let ranges: Vec<(f64, f64)> = all[i]
            .iter()
            .map(|p| if divided { (1.0, 1.0) } else { p.bounds })
            .collect();
        let gained = GainedChain {
            K: &K,
            partials: &ranges,
        };
        let Some(a) = gained.middle() else { continue };
        let eigenvalues = gained.eigenvalues(&a);
        let rightmost = eigenvalues.first().map_or(f64::NAN, |λ| λ.0);
        if gained.frozen() == Stability::Unstable || rightmost >= 0.0 {
            let states = names(extended, &chain.states).join(" → ");
            words.push(format!(
                "; with the S given A(a) − rS⁻¹CᵀC is not stable for ({states}), eigenvalues {} in the middle of the partials' bounds: only a plant that is damped by itself converges with such a gain, Lemma 1's own S (leave the key S out) is stable",
                listed(&eigenvalues)
            ));
        }
    }
    Ok(words)
}

/// Verdict H3 for one assignment.
fn examined(
    extended: &Extended<'_>,
    tuning: &Tuning,
    assignment: Assignment,
    choices: usize,
) -> Result<Form, DesignError> {
    let region = extended.region();
    let (mut checks, mut all) = (vec![], vec![]);
    for (i, chain) in assignment.chains.iter().enumerate() {
        checks.extend(output_slope(extended, i, &region)?);
        let (found, signs) = partials(extended, &chain.states, &region)?;
        checks.extend(signs);
        all.push(found);
    }
    checks.push(lipschitz(extended, &region)?);
    let chains = assignment
        .chains
        .iter()
        .map(|c| names(extended, &c.states))
        .collect();
    let mut summary = chains::describe(extended, &assignment);
    if choices > 1 {
        summary += &format!(
            ", the most balanced of {choices} assignments that the equations allow; the key 'chains' decides otherwise"
        );
    }
    summary += &carried(extended, tuning, &assignment, &all)?.concat();
    if assignment.either {
        let leading = &extended.outputs[assignment.leading].variable.name;
        summary += &format!(
            "; either chain can lead in Theorem 2, that of {leading} does, the key 'leading' decides otherwise"
        );
    }
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, &region, NAME, found, checks)?;
    Ok(Form {
        assignment,
        partials: all,
        examination,
    })
}
