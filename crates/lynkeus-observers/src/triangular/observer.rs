//! Observer (9), and its chains in the low-power form: dimension 2n − 2, gains of at most ℓ²
//! with ℓ = θ^δ.
//!
//! The errors of the low-power form have the sizes of the standard form's, x_j like ℓ^{j−1}, so
//! that the exponents of Theorem 2 serve two chains there as well.

use lynkeus_expr::{Graph, Node};
use lynkeus_structure::AugmentedPlant;

use super::form::{Form, Gains, Window, exponents};
use super::settings::Settings;
use crate::conditions::Partial;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed, prolong};
use crate::peaking::Part;
use crate::printed::{AtStart, ChainCorrection};
use crate::{Design, DesignError, Examination, TuningError, estimate, guarantee, peaking};

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    found: Found<Form>,
) -> Result<Design, DesignError> {
    if settings.lmi {
        return guarantee::design_lmi(augmented, &settings.common, found.examination);
    }
    if settings.remedies.low_power {
        return Ok(low_power(augmented, settings, found)?);
    }
    let Found { form, examination } = found;
    let gains = Gains::new(&form, settings)?;
    Ok(observer(augmented, settings, &form, &gains, examination)?)
}

/// Observer (9).
pub(super) fn observer(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    form: &Form,
    gains: &Gains<'_>,
    examination: Examination,
) -> Result<Design, TuningError> {
    let graph = augmented.graph();
    let copy = PlantCopy::new(augmented, &settings.common);
    let remedies = &settings.remedies;
    let start = AtStart::new(&copy)?;
    let mut derivatives = copy.at_estimate(&augmented.derivatives);
    let (mut table, mut parameters) = (vec![], gains.parameters());
    let speeds = Speed::of_chains(&copy, &gains.θ);
    for (i, (chain, θ)) in form.assignment.chains.iter().zip(&speeds).enumerate() {
        let Some(innovation) = remedies.innovation(&copy, i) else {
            continue;
        };
        let timed = gains.timed(&copy, i, θ);
        let scaled = scaled(graph, &copy, &form.partials[i], &timed, gains.divided);
        for (&state, gain) in chain.iter().zip(&scaled) {
            let correction = graph.expr(*gain) * graph.expr(innovation);
            derivatives[state] = (graph.expr(derivatives[state]) - correction).node();
        }
        let printed = ChainCorrection {
            output: i,
            states: chain,
            factors: &scaled,
            limited: remedies.limit.is_some(),
        };
        match printed.constant(augmented) {
            Some(constant) => table.push(constant),
            None => {
                parameters.push((format!("rΔS⁻¹Cᵀ{}", i + 1), gains.chain(i).into()));
                parameters.extend(printed.expressions(&start));
            }
        }
    }
    for (chain, partials) in form.assignment.chains.iter().zip(&form.partials) {
        prolong(&copy, chain, partials, &mut derivatives)?;
    }
    Ok(Design {
        observer: copy.observer(derivatives)?.tuned_by(&speeds),
        parameters,
        notes: Window::notes(&form.assignment, &gains.δ),
        gains: table,
        examination,
    })
}

/// The gains in the coordinates of the plant: with the signs of Remark 2, or
/// divided by ∂f_1/∂x_2 ⋯ ∂f_{j−1}/∂x_j at the estimate, so that every chain
/// converges like one of integrators.
fn scaled(
    graph: &Graph,
    copy: &PlantCopy<'_, '_>,
    partials: &[Partial],
    gains: &[Node],
    divided: bool,
) -> Vec<Node> {
    let nodes: Vec<Node> = partials.iter().map(|p| p.node).collect();
    let at_estimate = copy.at_estimate(&nodes);
    let mut ε = 1.0;
    let mut product = graph.constant(1.0);
    let mut scaled = vec![];
    for (j, &gain) in gains.iter().enumerate() {
        if j > 0 {
            ε *= partials[j - 1].sign;
            product = product * graph.expr(at_estimate[j - 1]);
        }
        scaled.push(match divided {
            true => (graph.expr(gain) / product).node(),
            false => (graph.constant(ε) * graph.expr(gain)).node(),
        });
    }
    scaled
}

/// The observer whose chains have the low-power form.
fn low_power(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, TuningError> {
    estimate::refuse(&settings.common, "form = \"low-power\"")?;
    let (θ, δ) = (settings.θ()?, exponents(&form, settings));
    let copy = PlantCopy::new(augmented, &settings.common);
    let part = |i: usize| Part {
        output: i,
        states: &form.assignment.chains[i],
        partials: &form.partials[i],
        δ: δ[i],
    };
    let parts: Vec<Part<'_>> = (0..δ.len()).map(part).collect();
    let derivative = |&state: &usize| augmented.derivatives[state];
    let f = |i: usize| parts[i].states.iter().map(derivative).collect();
    let advice = "declare min and max in the model, or set partials = true";
    let advice = (!settings.divided).then_some(advice);
    let remedies = &settings.remedies;
    let mut design = peaking::low_power(&copy, remedies, &θ, &parts, f, advice, examination)?;
    design.notes.extend(Window::notes(&form.assignment, &δ));
    design.parameters.insert(1, ("δ".to_owned(), δ.into()));
    Ok(design)
}
