//! The chains in the low-power form: dimension 2n − 2, gains of at most ℓ² with ℓ = θ^δ.
//!
//! Its errors have the sizes of the standard form's, x_j like ℓ^{j−1}, so that the
//! exponents of Theorem 2 serve two chains here as well.

use lynkeus_expr::Node;
use lynkeus_structure::Extended;

use super::NAME;
use super::form::Form;
use super::gains::{Window, exponents};
use super::settings::Settings;
use crate::conditions::Partial;
use crate::estimate::Copy;
use crate::peaking::{Part, Run, Transient, factor_rows, nominal, variation};
use crate::stages::Found;
use crate::tunable::Speed;
use crate::{Design, TuningError, prolongation};

pub(super) fn assemble(
    extended: &Extended<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, TuningError> {
    let Settings {
        common, remedies, ..
    } = settings;
    prolongation::refuse(common, "form = \"low-power\"")?;
    let chains = &form.assignment.chains;
    let (θ, δ) = (settings.θ()?, exponents(&form, settings));
    let transient = remedies.transient.as_ref();
    let coefficients = remedies.coefficients(&form.assignment.lengths())?;
    let divided = settings.divided;
    let copy = Copy::new(extended, common);
    let mut run = Run::new(&copy, transient)?;
    let speeds = Speed::of_chains(&copy, &θ);
    let (mut factors, mut notes) = (vec![], vec![]);
    for (i, chain) in chains.iter().enumerate() {
        let Some(innovation) = remedies.limit.innovation(&copy, i) else {
            continue;
        };
        let derivative = |&state: &usize| extended.derivatives[state];
        let f: Vec<Node> = chain.states.iter().map(derivative).collect();
        let output = &extended.outputs[i].variable.name;
        if !divided {
            let bounds: Vec<(f64, f64)> = form.partials[i].iter().map(|p| p.bounds).collect();
            notes.extend(variation(output, &bounds, &coefficients.K[i]));
        }
        let added = run.add(&Part {
            states: &chain.states,
            f: &f,
            divisors: &divisors(extended, &form.partials[i], divided)?,
            innovation,
            K: &coefficients.K[i],
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
    parameters.extend(coefficients.parameters());
    parameters.extend(factors);
    Ok(Design {
        observer: run.finish(NAME)?.tuned_by(&speeds),
        examination,
        gains: vec![],
        parameters,
        notes,
    })
}

/// a_i itself, or the constant that stands for it.
fn divisors(
    extended: &Extended<'_>,
    partials: &[Partial],
    divided: bool,
) -> Result<Vec<Node>, TuningError> {
    let divisor = |partial: &Partial| match (divided, nominal(partial.sign, partial.bounds)) {
        (true, _) => Ok(partial.node),
        (false, Some(middle)) => Ok(extended.graph().constant(middle).node()),
        (false, None) => {
            let expected = "partial derivatives with known positive bounds for form = \"low-power\"; declare min and max in the model, or set partials = true";
            let found = format!("bounds {} and {}", partial.bounds.0, partial.bounds.1);
            Err(TuningError::new("form", expected, found))
        }
    };
    partials.iter().map(divisor).collect()
}
