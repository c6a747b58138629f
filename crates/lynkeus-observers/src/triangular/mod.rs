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
use lynkeus_structure::{Extended, Standing};

use crate::conditions::Partial;
use crate::correction::{Correction, Start};
use crate::estimate::Copy;
use crate::peaking::{self, InnovationLimit, LowPower};
use crate::prolongation::{self, Continued, prolong};
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, Family, Tuning, TuningError,
    guarantee,
};
use form::{Form, form};
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
            "leading",
            "prolong",
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
        LowPower::refuse_unstable(tuning)?;
        Ok(match form(extended, tuning)? {
            Ok(form) => form.examination,
            Err(examination) => examination,
        })
    }

    fn design(&self, extended: &Extended<'_>, tuning: &Tuning) -> Result<Design, DesignError> {
        let form = match form(extended, tuning)? {
            Ok(form) if form.examination.fit() != Standing::Refuted => form,
            Ok(Form { examination, .. }) | Err(examination) => {
                return Err(DesignError::Refused(Box::new(examination)));
            }
        };
        if guarantee::asked_for(tuning, &["lemma1"])? {
            prolongation::refuse(tuning, "gain = \"lmi\"")?;
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
    let start = Start::new(&copy, tuning)?;
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let (mut table, mut parameters) = (vec![], gains.parameters());
    for (i, chain) in form.assignment.chains.iter().enumerate() {
        let Some(innovation) = limit.innovation(&copy, i) else {
            continue;
        };
        let timed = gains.timed(&copy, i);
        let scaled = scaled(graph, &copy, &form.partials[i], &timed, gains.divided);
        for (&state, gain) in chain.states.iter().zip(&scaled) {
            let correction = graph.expr(*gain) * graph.expr(innovation);
            derivatives[state] = (graph.expr(derivatives[state]) - correction).node();
        }
        let printed = Correction {
            output: i,
            states: &chain.states,
            factors: &scaled,
            limited: limit.is_set(),
        };
        match printed.constant(extended) {
            Some(constant) => table.push(constant),
            None => {
                let constants: Vec<String> = gains.chain(i).iter().map(f64::to_string).collect();
                parameters.push((format!("rΔS⁻¹Cᵀ{}", i + 1), constants.join(", ")));
                parameters.extend(printed.expressions(&start));
            }
        }
    }
    prolong(&copy, tuning, continued(&form), &mut derivatives)?;
    Ok(Design {
        observer: copy.observer(NAME, tuning, derivatives)?,
        parameters,
        notes: gains.notes.clone(),
        gains: table,
        examination: form.examination,
    })
}

/// The equations of the chains, for their prolongation.
fn continued(form: &Form) -> impl Iterator<Item = Continued> {
    let chains = form.assignment.chains.iter().zip(&form.partials);
    chains.flat_map(|(chain, partials)| Continued::along(&chain.states, partials))
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
