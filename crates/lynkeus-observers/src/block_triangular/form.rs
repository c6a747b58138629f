//! The block-triangular form: the order of the chains and its conditions.

use lynkeus_structure::{Blocks, Extended, blocks};

use super::NAME;
use super::gains::given;
use crate::conditions::{chain_request, lipschitz, output_slope, partial};
use crate::family::Form;
use crate::{DesignError, Examination, Fit, Tuning, TuningError};

/// The first arrangement into blocks that no condition refutes.
pub(super) fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<(Blocks, Examination), Examination>, DesignError> {
    let lengths = given(tuning)?.map(|k| k.iter().map(Vec::len).collect());
    let request = chain_request(extended, tuning, "k", lengths)?;
    let mut refused = None;
    let arrangements = match blocks::find(extended, &request) {
        Ok(arrangements) => arrangements,
        Err(summary) => {
            return Ok(Err(Examination::unfit(NAME, summary, vec![])));
        }
    };
    for blocks in arrangements {
        let examination = examined(extended, &blocks)?;
        if examination.fit != Fit::DoesNotFit {
            return Ok(Ok((blocks, examination)));
        }
        refused.get_or_insert(examination);
    }
    refused
        .map(Err)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
}

fn examined(extended: &Extended<'_>, blocks: &Blocks) -> Result<Examination, DesignError> {
    let region = extended.region();
    let graph = extended.graph();
    let (mut checks, mut integrators) = (vec![], true);
    for (output, chain) in &blocks.order {
        checks.extend(output_slope(extended, *output, &region)?);
        for pair in chain.states.windows(2) {
            let (node, found) = partial(extended, pair[0], pair[1], &region)?;
            integrators &= graph.constant_value(node) == Some(1.0);
            checks.push(found.check);
        }
    }
    checks.push(lipschitz(extended, &region)?);
    let mut summary = blocks.describe(extended);
    if !integrators {
        summary += "; not every ∂f/∂x along the chains is 1, so convergence is local (Remark 3)";
    }
    let chains = blocks.names(extended);
    let form = Form { summary, chains };
    Ok(Examination::new(extended, &region, NAME, form, checks)?)
}
