//! The triangular form: chains, the partials along them, condition H3.

use lynkeus_expr::Node;
use lynkeus_gain::Tridiagonal;
use lynkeus_structure::{Assignment, Extended, chains};

use super::NAME;
use super::gains::explicit;
use crate::conditions::{chain_request, lipschitz, names, output_slope, partial};
use crate::family;
use crate::{DesignError, Examination, Fit, Tuning, TuningError};

/// The triangular form of a plant with the facts about its partials.
pub(super) struct Form {
    pub assignment: Assignment,
    /// per chain, j = 1 … n−1
    pub partials: Vec<Vec<Partial>>,
    pub examination: Examination,
}

/// ∂f_j/∂x_{j+1}
#[derive(Clone, Debug)]
pub(super) struct Partial {
    pub node: Node,
    pub sign: f64,
    /// (α₁, α₂); α₁ = 0 where no sign is proved
    pub bounds: (f64, f64),
}

/// The best form, or the examination that says why there is none.
pub(super) fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<Form, Examination>, DesignError> {
    let given = explicit(tuning)?;
    let sizes = given.map(|given| given.iter().map(Tridiagonal::size).collect());
    let request = chain_request(extended, tuning, "S", sizes)?;
    let assignments = match chains::find(extended, &request) {
        Ok(assignments) => assignments,
        Err(summary) => {
            return Ok(Err(Examination::unfit(NAME, summary, vec![])));
        }
    };
    let choices = assignments.len();
    let mut first: Option<Form> = None;
    for assignment in assignments {
        let form = examined(extended, assignment, choices)?;
        if form.examination.fit != Fit::DoesNotFit {
            return Ok(Ok(form));
        }
        first.get_or_insert(form);
    }
    // chains::find never returns an empty list
    first
        .map(Ok)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
}

/// Condition H3 for one assignment.
fn examined(
    extended: &Extended<'_>,
    assignment: Assignment,
    choices: usize,
) -> Result<Form, DesignError> {
    let region = extended.region();
    let (mut checks, mut partials) = (vec![], vec![]);
    for (i, chain) in assignment.chains.iter().enumerate() {
        checks.extend(output_slope(extended, i, &region)?);
        let mut row = vec![];
        for pair in chain.states.windows(2) {
            let (node, found) = partial(extended, pair[0], pair[1], &region)?;
            checks.push(found.check);
            row.push(Partial {
                node,
                sign: found.sign,
                bounds: found.bounds,
            });
        }
        partials.push(row);
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
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, &region, NAME, found, checks)?;
    Ok(Form {
        assignment,
        partials,
        examination,
    })
}
