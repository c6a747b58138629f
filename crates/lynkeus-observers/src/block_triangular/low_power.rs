//! The classical observer (3) in the low-power form: chains of dimension 2n − 2 with gains of
//! at most θ².

use lynkeus_expr::Node;
use lynkeus_structure::{Blocks, Extended};

use super::{NAME, chain_rule, injected, theta};
use crate::conditions::partial;
use crate::estimate::Copy;
use crate::peaking::{InnovationLimit, LowPower, Part, Run, Transient, nominal};
use crate::{ChainGain, Design, DesignError, Examination, Tuning, TuningError};

pub(super) fn assemble(
    extended: &Extended<'_>,
    tuning: &Tuning,
    blocks: &Blocks,
    examination: Examination,
) -> Result<Design, DesignError> {
    if tuning
        .choice("correction", &["lee", "classical"])?
        .as_deref()
        != Some("classical")
    {
        let expected =
            "correction = \"classical\" with form = \"low-power\": observer (7) has no such form";
        return Err(TuningError::new("correction", expected, "lee").into());
    }
    let graph = extended.graph();
    let copy = Copy::new(extended, tuning);
    let count = blocks.order.len();
    let θ = theta(tuning, count)?;
    let limit = InnovationLimit::read(tuning, extended.outputs.len())?;
    let transient = Transient::read(tuning, count)?;
    let coefficients = LowPower::read(tuning, &blocks.lengths())?;
    let mut run = Run::new(&copy, tuning, transient.as_ref())?;
    let mut gains = vec![];
    for (place, (output, chain)) in blocks.order.iter().enumerate() {
        let Some(innovation) = limit.innovation(&copy, *output) else {
            continue;
        };
        let derivative = |&state: &usize| extended.derivatives[state];
        let f: Vec<Node> = chain.states.iter().map(derivative).collect();
        let entries = run.add(&Part {
            states: &chain.states,
            f: &graph.substitute(&f, &injected(&copy, blocks, place)),
            divisors: &divisors(extended, &chain.states)?,
            innovation,
            K: &coefficients.K[*output],
            θ: θ[*output],
            δ: 1.0,
            number: *output,
        });
        let output = extended.outputs[*output].variable.name.clone();
        gains.push(ChainGain { output, entries });
    }
    let text: Vec<String> = θ.iter().map(f64::to_string).collect();
    let mut parameters = vec![("θ".to_owned(), text.join(", "))];
    parameters.extend(transient.as_ref().map(Transient::parameter));
    parameters.extend(coefficients.parameters());
    Ok(Design {
        observer: run.finish(NAME, tuning)?,
        notes: chain_rule(blocks, &θ).into_iter().collect(),
        examination,
        gains,
        parameters,
    })
}

/// The constant that stands for each partial along a chain; 1 in the paper's form (2).
fn divisors(extended: &Extended<'_>, states: &[usize]) -> Result<Vec<Node>, DesignError> {
    let region = extended.region();
    let mut found = vec![];
    for pair in states.windows(2) {
        let (_, sign) = partial(extended, pair[0], pair[1], &region)?;
        let Some(middle) = nominal(sign.sign, sign.bounds) else {
            let expected = "partial derivatives with known positive bounds for form = \"low-power\"; declare min and max in the model";
            let bounds = format!("bounds {} and {}", sign.bounds.0, sign.bounds.1);
            return Err(TuningError::new("form", expected, bounds).into());
        };
        found.push(extended.graph().constant(middle).node());
    }
    Ok(found)
}
