//! Hammouri, Targui and Armanet, *High gain observer based on a triangular
//! structure*, Int. J. Robust Nonlinear Control 12 (2002) 497–518.
//!
//! x' = f(x, u) in one chain (4) or two (8), y_i = x^i_1, observer (9):
//!
//! x̂^i' = f^i(x̂, u) − r_i Δ_{θ^δi} S_i⁻¹ Cᵀ (x̂^i_1 − y_i),  Δ_{θ^δ} = diag(θ^δ, …, θ^{nδ}).
//!
//! Corrections to the print: the correction has the minus sign of (9) with
//! r = ρ/2 > 0 throughout; the signs of Remark 2 multiply along the chain,
//! ε_{j+1} = ε_j·sign(∂f_j/∂x_{j+1}), with ε_1 = 1 because y is measured.

mod facts;
mod form;
mod gains;
mod lemma;
mod low_power;
mod theorem;

use lynkeus_expr::{Graph, Node};
use lynkeus_structure::Extended;

use crate::conditions::on_output;
use crate::estimate::Copy;
use crate::guarantee;
use crate::peaking::{self, InnovationLimit};
use crate::{
    Assumptions, Certificate, ChainGain, Design, DesignError, Examination, Family, Fit, Tuning,
    TuningError,
};
use form::{Form, Partial, form};
use gains::Gains;

const NAME: &str = "triangular";

/// The family `triangular`.
#[derive(Clone, Copy, Debug)]
pub struct Triangular;

impl Family for Triangular {
    fn name(&self) -> &'static str {
        NAME
    }

    fn paper(&self) -> &'static str {
        "Hammouri, Targui, Armanet 2002, doi:10.1002/rnc.638"
    }

    fn keys(&self) -> &'static [&'static str] {
        &[
            "theta",
            "delta",
            "r",
            "gain",
            "S",
            "partials",
            "chains",
            "rate",
            "gain_limit",
            "minimise",
            "innovation_limit",
            "transient",
            "form",
            "low_power_poles",
            "low_power_k",
        ]
    }

    fn examine(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        Ok(match form(extended, tuning)? {
            Ok(form) => form.examination,
            Err(examination) => examination,
        })
    }

    fn design(&self, extended: &Extended<'_>, tuning: &Tuning) -> Result<Design, DesignError> {
        let form = match form(extended, tuning)? {
            Ok(form) if form.examination.fit != Fit::DoesNotFit => form,
            Ok(Form { examination, .. }) | Err(examination) => {
                return Err(DesignError::Refused(Box::new(examination)));
            }
        };
        if guarantee::asked_for(tuning, &["lemma1"])? {
            return guarantee::design_lmi(extended, tuning, NAME, form.examination);
        }
        if peaking::asked_for(tuning, &["S", "r", "gain"])? {
            return Ok(low_power::assemble(extended, tuning, form)?);
        }
        let gains = Gains::new(&form, tuning)?;
        Ok(assemble(extended, tuning, form, &gains)?)
    }

    fn theorem(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(extended, tuning, assumptions)
    }
}

/// Observer (9).
fn assemble(
    extended: &Extended<'_>,
    tuning: &Tuning,
    form: Form,
    gains: &Gains,
) -> Result<Design, TuningError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, tuning);
    let limit = InnovationLimit::read(tuning, extended.outputs.len())?;
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let mut table = vec![];
    for (i, chain) in form.assignment.chains.iter().enumerate() {
        let Some(innovation) = limit.innovation(&copy, i) else {
            continue;
        };
        let constants = gains.chain(i);
        let timed = gains.timed(&copy, i);
        let scaled = scaled(graph, &copy, &form.partials[i], &timed, gains.divided);
        for (&state, gain) in chain.states.iter().zip(scaled) {
            let correction = graph.expr(gain) * graph.expr(innovation);
            derivatives[state] = (graph.expr(derivatives[state]) - correction).node();
        }
        table.push(ChainGain {
            output: extended.outputs[i].variable.name.clone(),
            entries: on_output(
                extended,
                i,
                &chain.states,
                &signed(&form.partials[i], constants),
            ),
        });
    }
    Ok(Design {
        observer: copy.observer(NAME, tuning, derivatives)?,
        parameters: gains.parameters(),
        notes: gains.notes.clone(),
        gains: table,
        examination: form.examination,
    })
}

/// The gains with the signs of Remark 2.
fn signed(partials: &[Partial], gains: Vec<f64>) -> Vec<f64> {
    let mut ε = 1.0;
    let signed = gains.into_iter().enumerate().map(|(j, gain)| {
        if j > 0 {
            ε *= partials[j - 1].sign;
        }
        ε * gain
    });
    signed.collect()
}

/// The gains in the coordinates of the plant: with the signs of Remark 2, or
/// divided by ∂f_1/∂x_2 ⋯ ∂f_{j−1}/∂x_j at the estimate, so that every chain
/// converges like one of integrators.
fn scaled(
    graph: &Graph,
    copy: &Copy<'_, '_>,
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
