//! Observer (9), and its chains in the low-power form: dimension 2n − 2, gains of at most ℓ²
//! with ℓ = θ^δ.
//!
//! The errors of the low-power form have the sizes of the standard form's, x_j like ℓ^{j−1}, so
//! that the exponents of Theorem 2 serve two chains there as well.

use lynkeus_expr::{Graph, Node};
use lynkeus_structure::AugmentedPlant;

use super::form::{Form, Gains, NAME, Window, exponents};
use super::settings::Settings;
use crate::conditions::Partial;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed, prolong};
use crate::peaking::{self, Part, Run, Transient, factor_rows, variation};
use crate::printed::{AtStart, ChainCorrection};
use crate::{Design, Examination, TuningError, estimate};

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
        for (&state, gain) in chain.states.iter().zip(&scaled) {
            let correction = graph.expr(*gain) * graph.expr(innovation);
            derivatives[state] = (graph.expr(derivatives[state]) - correction).node();
        }
        let printed = ChainCorrection {
            output: i,
            states: &chain.states,
            factors: &scaled,
            limited: remedies.limit.is_some(),
        };
        match printed.constant(augmented) {
            Some(constant) => table.push(constant),
            None => {
                let constants: Vec<String> = gains.chain(i).iter().map(f64::to_string).collect();
                parameters.push((format!("rΔS⁻¹Cᵀ{}", i + 1), constants.join(", ")));
                parameters.extend(printed.expressions(&start));
            }
        }
    }
    for (chain, partials) in form.assignment.chains.iter().zip(&form.partials) {
        prolong(&copy, &chain.states, partials, &mut derivatives)?;
    }
    Ok(Design {
        observer: copy.observer(NAME, derivatives)?.tuned_by(&speeds),
        parameters: parameters.into_iter().map(|(n, v)| (n, v.into())).collect(),
        notes: gains.notes.clone(),
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

pub(super) fn assemble(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, TuningError> {
    let Settings {
        common, remedies, ..
    } = settings;
    estimate::refuse(common, "form = \"low-power\"")?;
    let chains = &form.assignment.chains;
    let (θ, δ) = (settings.θ()?, exponents(&form, settings));
    let transient = remedies.transient.as_ref();
    let coefficients = remedies.coefficients(&form.assignment.lengths())?;
    let divided = settings.divided;
    let copy = PlantCopy::new(augmented, common);
    let mut run = Run::new(&copy, transient)?;
    let speeds = Speed::of_chains(&copy, &θ);
    let (mut factors, mut notes) = (vec![], vec![]);
    for (i, chain) in chains.iter().enumerate() {
        let Some(innovation) = remedies.innovation(&copy, i) else {
            continue;
        };
        let derivative = |&state: &usize| augmented.derivatives[state];
        let f: Vec<Node> = chain.states.iter().map(derivative).collect();
        let output = &augmented.outputs[i].variable.name;
        if !divided {
            let bounds: Vec<(f64, f64)> = form.partials[i].iter().map(|p| p.bounds).collect();
            notes.extend(variation(output, &bounds, &coefficients[i]));
        }
        let added = run.add(&Part {
            states: &chain.states,
            f: &f,
            divisors: &divisors(augmented, &form.partials[i], divided)?,
            innovation,
            K: &coefficients[i],
            θ: &speeds[i],
            δ: δ[i],
            number: i,
        });
        factors.extend(factor_rows(output, added));
    }
    notes.extend(
        Window::of(&form.assignment, &δ)
            .iter()
            .filter_map(Window::note),
    );
    let list = |values: &[f64]| {
        values
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let mut parameters = vec![("θ".to_owned(), list(&θ)), ("δ".to_owned(), list(&δ))];
    parameters.extend(transient.map(Transient::parameter));
    parameters.extend(peaking::parameters(&coefficients));
    parameters.extend(factors);
    Ok(Design {
        observer: run.finish(NAME)?.tuned_by(&speeds),
        examination,
        gains: vec![],
        parameters: parameters.into_iter().map(|(n, v)| (n, v.into())).collect(),
        notes,
    })
}

/// a_i itself, or the constant that stands for it.
fn divisors(
    augmented: &AugmentedPlant<'_>,
    partials: &[Partial],
    divided: bool,
) -> Result<Vec<Node>, TuningError> {
    let divisor = |partial: &Partial| match (divided, partial.nominal()) {
        (true, _) => Ok(partial.node),
        (false, Some(middle)) => Ok(augmented.graph().constant(middle).node()),
        (false, None) => {
            let expected = "partial derivatives with known positive bounds for form = \"low-power\"; declare min and max in the model, or set partials = true";
            let found = format!("bounds {} and {}", partial.bounds.0, partial.bounds.1);
            Err(TuningError::new("form", expected, found))
        }
    };
    partials.iter().map(divisor).collect()
}
