//! What the theorem needs to know of the plant on the box of the assumptions.

use crate::statement::undecided;
use crate::{Check, Hammouri};
use lynkeus_expr::Graph;
use lynkeus_proof::chain::Slope;
use lynkeus_structure::{Extended, Region};

use super::form::Form;
use crate::DesignError;
use crate::conditions::{output_slope, partials};
use crate::proof::slopes::{slopes, undeclared};

/// What is known of the plant on the box of the assumptions.
pub(super) struct Facts {
    pub checks: Vec<Check>,
    /// per chain (α₁, α₂) of every partial
    pub bounds: Vec<Vec<(f64, f64)>>,
    pub slopes: Vec<Slope>,
}

impl Facts {
    pub fn new(extended: &Extended<'_>, form: &Form, region: &Region) -> Result<Self, DesignError> {
        let (mut checks, mut bounds) = (vec![], vec![]);
        let chains = &form.assignment.chains;
        for (i, chain) in chains.iter().enumerate() {
            checks.extend(output_slope(extended, i, region)?);
            let (found, signs) = partials(extended, &chain.states, region)?;
            checks.extend(signs);
            bounds.push(
                found
                    .iter()
                    .map(|partial| partial.bounds)
                    .collect::<Vec<_>>(),
            );
        }
        let along = |a: usize, b: usize| {
            chains
                .iter()
                .any(|c| c.states.windows(2).any(|p| p == [a, b]))
        };
        let (slopes, check) = slopes(extended, region, along)?;
        checks.push(check);
        Ok(Self {
            checks,
            bounds,
            slopes,
        })
    }
}

/// Partials without bounds: Lemma 1 has nothing to start from.
pub(super) fn without_bounds(
    extended: &Extended<'_>,
    form: &Form,
    facts: &Facts,
    region: &Region,
) -> Option<Check> {
    let partials = form
        .partials
        .iter()
        .flatten()
        .zip(facts.bounds.iter().flatten());
    let open = partials.filter(|(_, (low, high))| !(*low > 0.0 && high.is_finite()));
    let nodes: Vec<_> = open.map(|(partial, _)| partial.node).collect();
    let first = nodes.first()?;
    let graph: &Graph = extended.graph();
    let missing = undeclared(graph, &nodes, region);
    let advice = match missing.is_empty() {
        true => "narrow min and max so that it keeps away from zero and infinity".to_owned(),
        false => format!("declare min and max of {}", missing.join(", ")),
    };
    let detail = format!(
        "{} has no positive lower and finite upper bound on the box: {advice}",
        graph.render(*first, 60)
    );
    Some(undecided(Hammouri::PartialsAreBounded, detail))
}

pub(super) fn remainder(facts: &Facts) -> String {
    let all = facts.bounds.iter().flatten().count();
    let known = facts
        .bounds
        .iter()
        .flatten()
        .filter(|(l, h)| *l > 0.0 && h.is_finite())
        .count();
    format!(
        "Known so far: {known} of {all} partials along the chains have bounds; without the others there is no S by Lemma 1 and no θ0."
    )
}
