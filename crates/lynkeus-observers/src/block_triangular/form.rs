//! The block-triangular form: chains, their order, and the conditions.

use lynkeus_structure::{Blocks, Extended, Standing, blocks};

use super::gains::given;
use super::settings::{Correction, Settings};
use super::stable::stable;
use super::{NAME, chain_rule, coefficients};
use crate::conditions::{Partial, chain_request, lipschitz, output_slope, partials};
use crate::family;
use crate::{Check, DesignError, Examination, Tuning, TuningError};

/// Different chains that are examined before the first without a refuted condition is taken.
const EXAMINED: usize = 16;

/// The block-triangular form of a plant with the facts about its partials.
pub(super) struct Form {
    pub blocks: Blocks,
    /// per block
    pub partials: Vec<Vec<Partial>>,
    pub examination: Examination,
}

/// The first arrangement into blocks whose conditions are proved, else the first that no
/// condition refutes, else the first with its refusal.
pub(super) fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<Form, Examination>, DesignError> {
    let settings = Settings::read(tuning)?;
    let lengths = given(tuning)?.map(|k| k.iter().map(Vec::len).collect());
    let request = chain_request(extended, tuning, "k", lengths)?;
    let refusal = |summary: String| Examination::unfit(NAME, summary, vec![]);
    let order = order(extended, tuning)?;
    let arrangements = match blocks::find(extended, &request, order.as_deref()) {
        Ok(arrangements) => arrangements,
        Err(summary) => return Ok(Err(refusal(summary))),
    };
    let mut best: Option<Form> = None;
    for choice in distinct(extended, tuning, &arrangements)?
        .into_iter()
        .take(EXAMINED)
    {
        let form = examined(extended, tuning, &settings, choice)?;
        let better = |best: &Form| form.examination.fit() < best.examination.fit();
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

/// The outputs in the order that the study asks for, by place.
fn order(extended: &Extended<'_>, tuning: &Tuning) -> Result<Option<Vec<usize>>, TuningError> {
    let Some(names) = tuning.names("order")? else {
        return Ok(None);
    };
    let outputs: Vec<&str> = extended
        .outputs
        .iter()
        .map(|o| o.variable.name.as_str())
        .collect();
    let place = |name: &String| outputs.iter().position(|o| o == name);
    let places: Option<Vec<usize>> = names.iter().map(place).collect();
    let all = places.filter(|places| {
        places.len() == outputs.len() && (0..outputs.len()).all(|i| places.contains(&i))
    });
    all.map(Some).ok_or_else(|| {
        let expected = format!("every measured output once ({})", outputs.join(", "));
        TuningError::new("order", expected, &tuning.values["order"])
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
    extended: &Extended<'_>,
    tuning: &Tuning,
    arrangements: &[Blocks],
) -> Result<Vec<Choice>, TuningError> {
    let θ = tuning.positive_per_chain("theta", extended.outputs.len())?;
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
    tuning: &Tuning,
    settings: &Settings,
    Choice { blocks, orders }: Choice,
) -> Result<Form, DesignError> {
    let region = extended.region();
    let graph = extended.graph();
    let K = coefficients(tuning, &blocks)?;
    let (mut checks, mut all): (Vec<Check>, Vec<Vec<Partial>>) = (vec![], vec![]);
    for (output, chain) in &blocks.order {
        checks.extend(output_slope(extended, *output, &region)?);
        let (found, signs) = partials(extended, &chain.states, &region)?;
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
    checks.push(lipschitz(extended, &region)?);
    let integrators = all
        .iter()
        .flatten()
        .all(|partial| graph.constant_value(partial.node) == Some(1.0));
    let mut summary = blocks.describe(extended);
    if !integrators {
        summary += match settings.correction {
            Correction::Lee => {
                "; not every ∂f/∂x along the chains is 1, so convergence is local (Remark 3)"
            }
            Correction::Classical => {
                "; not every ∂f/∂x along the chains is 1, as in the paper's form (2)"
            }
        };
    }
    if orders > 1 {
        summary +=
            &format!("; one of {orders} orders of these chains, the key 'order' decides otherwise");
    }
    let chains = blocks.names(extended);
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, &region, NAME, found, checks)?;
    Ok(Form {
        blocks,
        partials: all,
        examination,
    })
}
