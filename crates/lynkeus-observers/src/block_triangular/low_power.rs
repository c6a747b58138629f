//! The classical observer (3) in the low-power form: chains of dimension 2n − 2 with gains of
//! at most θ².

use lynkeus_expr::Node;
use lynkeus_structure::Extended;

use super::form::Form;
use super::settings::Settings;
use super::{NAME, chain_rule, injected};
use crate::conditions::Partial;
use crate::estimate::Copy;
use crate::peaking::{Part, Run, Transient, factor_rows, nominal, variation};
use crate::stages::Found;
use crate::tunable::Speed;
use crate::{Design, DesignError, TuningError, prolongation};

/// Why there is no such form of the default observer.
pub(super) const ONLY_CLASSICAL: &str =
    "correction = \"classical\" with form = \"low-power\": observer (7) has no such form";

pub(super) fn assemble(
    extended: &Extended<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    let Settings {
        common, remedies, ..
    } = settings;
    prolongation::refuse(common, "form = \"low-power\"")?;
    let blocks = &form.blocks;
    let graph = extended.graph();
    let copy = Copy::new(extended, common);
    let θ = settings.θ()?;
    let transient = remedies.transient.as_ref();
    let coefficients = remedies.coefficients(&blocks.lengths())?;
    let mut run = Run::new(&copy, transient)?;
    let speeds = Speed::of_chains(&copy, &θ);
    let (mut notes, mut factors) = (vec![], vec![]);
    for (place, (output, chain)) in blocks.order.iter().enumerate() {
        let Some(innovation) = remedies.limit.innovation(&copy, *output) else {
            continue;
        };
        let derivative = |&state: &usize| extended.derivatives[state];
        let f: Vec<Node> = chain.states.iter().map(derivative).collect();
        let output_name = &extended.outputs[*output].variable.name;
        let found = &form.partials[place];
        notes.extend(variation(
            output_name,
            &bounds(found),
            &coefficients.K[*output],
        ));
        let added = run.add(&Part {
            states: &chain.states,
            f: &graph.substitute(&f, &injected(&copy, blocks, place)),
            divisors: &divisors(extended, found)?,
            innovation,
            K: &coefficients.K[*output],
            θ: &speeds[*output],
            δ: 1.0,
            number: *output,
        });
        factors.extend(factor_rows(output_name, added));
    }
    let text: Vec<String> = θ.iter().map(f64::to_string).collect();
    let mut parameters = vec![("θ".to_owned(), text.join(", "))];
    parameters.extend(transient.map(Transient::parameter));
    parameters.extend(coefficients.parameters());
    parameters.extend(factors);
    notes.extend(chain_rule(blocks, &θ));
    Ok(Design {
        observer: run.finish(NAME)?.tuned_by(&speeds),
        notes,
        examination,
        gains: vec![],
        parameters,
    })
}

/// The constant that stands for each partial along a chain; 1 in the paper's form (2).
fn divisors(extended: &Extended<'_>, partials: &[Partial]) -> Result<Vec<Node>, DesignError> {
    let mut found = vec![];
    for partial in partials {
        let Some(middle) = nominal(partial.sign, partial.bounds) else {
            let expected = "partial derivatives with known positive bounds for form = \"low-power\"; declare min and max in the model";
            let bounds = format!("bounds {} and {}", partial.bounds.0, partial.bounds.1);
            return Err(TuningError::new("form", expected, bounds).into());
        };
        found.push(extended.graph().constant(middle).node());
    }
    Ok(found)
}

fn bounds(partials: &[Partial]) -> Vec<(f64, f64)> {
    partials.iter().map(|partial| partial.bounds).collect()
}
