//! The block-triangular form: chains, their order, and the conditions.

use crate::Check;
use lynkeus_structure::Standing;
use lynkeus_structure::{Blocks, Extended, Region, blocks};

use super::settings::{Correction, Settings};
use super::stable::stable;
use super::{NAME, chain_rule};
use crate::conditions::{Partial, lipschitz, output_slope, partials};
use crate::family;
use crate::stages::{Found, Searched};
use crate::{DesignError, Examination, TuningError};

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
    extended: &Extended<'_>,
    settings: &Settings,
    region: &Region,
) -> Searched<Form> {
    let refusal = |summary: String| Examination::unfit(NAME, summary, vec![]);
    let arrangements = match blocks::find(extended, &settings.request, settings.order.as_deref()) {
        Ok(arrangements) => arrangements,
        Err(summary) => return Ok(Err(refusal(summary))),
    };
    let mut best: Option<Found<Form>> = None;
    for choice in distinct(extended, settings, &arrangements)?
        .into_iter()
        .take(EXAMINED)
    {
        let form = examined(extended, settings, region, choice)?;
        let better = |best: &Found<Form>| form.examination.fit() < best.examination.fit();
        if best.as_ref().is_none_or(better) {
            best = Some(form);
        }
        if best
            .as_ref()
            .is_some_and(|b| b.examination.fit() == Standing::Proved)
        {
            break;
        }
    }
    best.map(Ok)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
}

/// One arrangement of those with the same chains.
struct Choice {
    blocks: Blocks,
    /// orders that the equations allow for these chains
    orders: usize,
}

/// Per set of chains the first order for which θ satisfies the theorem's rule, else the first.
fn distinct(
    extended: &Extended<'_>,
    settings: &Settings,
    arrangements: &[Blocks],
) -> Result<Vec<Choice>, TuningError> {
    let θ = settings.θ.clone()?;
    let breaks = |blocks: &Blocks| θ.as_ref().is_some_and(|θ| chain_rule(blocks, θ).is_some());
    let mut found: Vec<(Vec<Vec<String>>, Choice)> = vec![];
    for blocks in arrangements {
        let chains = blocks.names(extended);
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
    extended: &Extended<'_>,
    settings: &Settings,
    region: &Region,
    Choice { blocks, orders }: Choice,
) -> Result<Found<Form>, DesignError> {
    let graph = extended.graph();
    let K = settings.K(&blocks.lengths());
    let (mut checks, mut all): (Vec<Check>, Vec<Vec<Partial>>) = (vec![], vec![]);
    for (output, chain) in &blocks.order {
        checks.extend(output_slope(extended, *output, region)?);
        let (found, signs) = partials(extended, &chain.states, region)?;
        checks.extend(signs);
        checks.extend(stable(
            extended,
            settings,
            &chain.states,
            &K[*output],
            &found,
        ));
        all.push(found);
    }
    checks.push(lipschitz(extended, region)?);
    let numbers = all
        .iter()
        .flatten()
        .map(|partial| graph.constant_value(partial.node));
    let mut summary = blocks.describe(extended);
    summary += match (settings.correction, numbers.clone().all(|a| a == Some(1.0))) {
        (_, true) => "",
        // numbers are 1 in other units
        (Correction::Lee, false) if numbers.clone().all(|a| a.is_some()) => {
            "; every ∂f/∂x along the chains is a number: the paper's form (2) in other units"
        }
        (Correction::Lee, false) => {
            "; not every ∂f/∂x along the chains is a number, so convergence is local (Remark 3)"
        }
        (Correction::Classical, false) => {
            "; not every ∂f/∂x along the chains is 1, as in the paper's form (2)"
        }
    };
    if orders > 1 {
        summary +=
            &format!("; one of {orders} orders of these chains, the key 'order' decides otherwise");
    }
    let chains = blocks.names(extended);
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, region, NAME, found, checks)?;
    let form = Form {
        blocks,
        partials: all,
    };
    Ok(Found { form, examination })
}
