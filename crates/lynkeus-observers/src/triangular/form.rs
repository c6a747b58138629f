//! The triangular form: chains, the partials along them, condition H3.

use lynkeus_structure::Standing;
use lynkeus_structure::{Assignment, Extended, Region, chains};

use super::gains::Window;
use super::settings::Settings;
use super::{NAME, damping};
use crate::conditions::{Partial, lipschitz, names, output_slope, partials};
use crate::family;
use crate::stages::{Found, Searched};
use crate::{DesignError, Examination, TuningError};

/// The triangular form of a plant with the facts about its partials.
pub struct Form {
    pub assignment: Assignment,
    /// per chain, j = 1 … n−1
    pub(crate) partials: Vec<Vec<Partial>>,
}

/// The first assignment whose conditions are proved, else the first that no condition
/// refutes, else the first with its refusal; or the examination that says why there is none.
pub(super) fn form(
    extended: &Extended<'_>,
    settings: &Settings,
    region: &Region,
) -> Searched<Form> {
    let refusal = |summary: String| Examination::unfit(NAME, summary, vec![]);
    let mut assignments = match chains::find(extended, &settings.request) {
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
        let form = examined(extended, settings, region, assignment, choices)?;
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
    extended: &Extended<'_>,
    settings: &Settings,
    region: &Region,
    assignment: Assignment,
    choices: usize,
) -> Result<Found<Form>, DesignError> {
    let (mut checks, mut all) = (vec![], vec![]);
    for (i, chain) in assignment.chains.iter().enumerate() {
        checks.extend(output_slope(extended, i, region)?);
        let (found, signs) = partials(extended, &chain.states, region)?;
        checks.extend(signs);
        all.push(found);
    }
    checks.push(lipschitz(extended, region)?);
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
    if assignment.leads.len() > 1 {
        let leading = &extended.outputs[assignment.leading].variable.name;
        let which = match assignment.leads.len() {
            count if count < assignment.chains.len() => format!("{count} of the chains"),
            2 => "either chain".to_owned(),
            _ => "any chain".to_owned(),
        };
        summary += &format!(
            "; {which} can lead in Theorem 2, that of {leading} does, the key 'leading' decides otherwise"
        );
    }
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, region, NAME, found, checks)?;
    let form = Form {
        assignment,
        partials: all,
    };
    let mut found = Found { form, examination };
    damping::settle(&mut found, extended, settings, region)?;
    Ok(found)
}
