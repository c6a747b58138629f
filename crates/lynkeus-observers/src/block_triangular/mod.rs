//! Lee, Yee and Park, *Nonlinear observer design for multi-output systems in
//! block-triangular form* (2000).
//!
//! x_i' = A_i x_i + g_i(x_1, …, x_i; u; y_{i+1}, …, y_p), y_i = C_i x_i (2), or its
//! generalisation in Remark 3 with ∂f_ij/∂x_{i,j+1} ≠ 1. With F_i = ∂f_i/∂x_i,
//! the observer (7)
//!
//! x̂_i' = f_i(x̂_1, …, x̂_i; u; y_{i+1}, …, y_p) + M_i⁻¹ [L_i + Δ_θi⁻¹ K_i] (y_i − C_i x̂_i)
//!
//! or, with M = I and L = 0, the classical observer (3).
//!
//! The rule for θ. Lemma 2 bounds θ_k^m/θ_j^l for every block k before j with
//! 1 ≤ m ≤ n_k, 1 ≤ l ≤ n_j; its worst case is m = n_k, l = 1, so for chains of any
//! lengths it asks for 1 ≤ θ_i and θ_{i−1}^{n_{i−1}} ≤ θ_i. The rule between
//! neighbours suffices: θ_k^{n_k} ≤ θ_{k+1} ≤ θ_{k+1}^{n_{k+1}} ≤ θ_{k+2} ≤ ….

mod figures;
mod form;
mod gains;
mod lee;
mod low_power;
mod settings;
mod stable;
mod theorem;
mod transformed;

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_structure::{Blocks, Extended, Standing};

use crate::correction::{self, Start};
use crate::estimate::Copy;
use crate::peaking::{InnovationLimit, LowPower, Transient, transient};
use crate::prolongation::{self, Continued, prolong};
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, Family, Tuning, TuningError,
    guarantee,
};
use form::{Form, form};
use gains::{given, placed};
use lee::{lee, transformation};
use settings::{Correction, Settings};

const NAME: &str = "block-triangular";

/// The family `block-triangular`.
#[derive(Clone, Copy, Debug)]
pub struct BlockTriangular;

impl Family for BlockTriangular {
    fn name(&self) -> &'static str {
        NAME
    }

    fn paper(&self) -> &'static str {
        "Lee, Yee, Park 2000, observers (3) and (7)"
    }

    fn keys(&self) -> &'static [&'static str] {
        &[
            "theta",
            "k",
            "k_poles",
            "correction",
            "chains",
            "order",
            "prolong",
            "gain",
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
        let Settings {
            correction,
            low_power,
            ..
        } = Settings::read(tuning)?;
        if low_power && correction == Correction::Lee {
            let summary = low_power::ONLY_CLASSICAL.to_owned();
            return Ok(Examination::unfit(NAME, summary, vec![]));
        }
        Ok(match form(extended, tuning)? {
            Ok(Form { examination, .. }) | Err(examination) => examination,
        })
    }

    fn theorem(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(extended, tuning, assumptions)
    }

    fn design(&self, extended: &Extended<'_>, tuning: &Tuning) -> Result<Design, DesignError> {
        match form(extended, tuning)? {
            Ok(form) if form.examination.fit() != Standing::Refuted => {
                if guarantee::asked_for(tuning, &[])? {
                    prolongation::refuse(tuning, "gain = \"lmi\"")?;
                    return guarantee::design_lmi(extended, tuning, NAME, form.examination);
                }
                match Settings::read(tuning)?.low_power {
                    true => low_power::assemble(extended, tuning, form),
                    false => assemble(extended, tuning, form),
                }
            }
            Ok(Form { examination, .. }) | Err(examination) => {
                Err(DesignError::Refused(Box::new(examination)))
            }
        }
    }
}

/// Observer (7) or (3).
fn assemble(extended: &Extended<'_>, tuning: &Tuning, form: Form) -> Result<Design, DesignError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, tuning);
    let blocks = &form.blocks;
    let limit = InnovationLimit::read(tuning, extended.outputs.len())?;
    let transient = Transient::read(tuning, blocks.order.len())?;
    let θ = theta(tuning, blocks.order.len())?;
    let K = coefficients(tuning, blocks)?;
    let correction = Settings::read(tuning)?.correction;
    let start = Start::new(&copy, tuning)?;
    let text = |x: &[f64]| x.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let mut parameters = vec![("θ".to_owned(), text(&θ))];
    parameters.extend(transient.as_ref().map(Transient::parameter));
    let coefficients = K.iter().enumerate();
    parameters.extend(coefficients.map(|(i, k)| (format!("K{}", i + 1), text(k))));
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let mut gains = vec![];
    for (place, (output, chain)) in blocks.order.iter().enumerate() {
        let injected = injected(&copy, blocks, place);
        let Some(innovation) = limit.innovation(&copy, *output) else {
            continue;
        };
        let power = |(j, k): (usize, &f64)| (θ[*output].powi(j as i32 + 1) * k, (j + 1) as f64);
        let steady: Vec<(f64, f64)> = K[*output].iter().enumerate().map(power).collect();
        let timed = transient::gains(transient.as_ref(), &copy, *output, θ[*output], &steady);
        let gain = match correction {
            Correction::Classical => timed,
            Correction::Lee => lee(extended, chain, &timed),
        };
        let gain = copy.at_estimate(&graph.substitute(&gain, &injected));
        let f: Vec<Node> = chain
            .states
            .iter()
            .map(|&i| extended.derivatives[i])
            .collect();
        let f = copy.at_estimate(&graph.substitute(&f, &injected));
        for ((&state, f), gain) in chain.states.iter().zip(f).zip(&gain) {
            derivatives[state] =
                (graph.expr(f) - graph.expr(*gain) * graph.expr(innovation)).node();
        }
        let printed = correction::Correction {
            output: *output,
            states: &chain.states,
            factors: &gain,
            limited: limit.is_set(),
        };
        match printed.constant(extended) {
            Some(constant) => gains.push(constant),
            None => {
                if correction == Correction::Lee {
                    let found = transformation(extended, chain);
                    let L: Vec<_> = found.L.into_iter().map(|l| vec![l]).collect();
                    parameters.push((format!("M{}", output + 1), start.table(&found.M)));
                    parameters.push((format!("L{}", output + 1), start.table(&L)));
                }
                let constants: Vec<f64> = steady.iter().map(|gain| gain.0).collect();
                parameters.push((format!("Δ⁻¹K{}", output + 1), text(&constants)));
                parameters.extend(printed.expressions(&start));
            }
        }
    }
    prolong(&copy, tuning, continued(&form), &mut derivatives)?;
    Ok(Design {
        observer: copy.observer(NAME, tuning, derivatives)?,
        notes: chain_rule(blocks, &θ).into_iter().collect(),
        examination: form.examination,
        gains,
        parameters,
    })
}

/// The equations of the chains, for their prolongation.
fn continued(form: &Form) -> impl Iterator<Item = Continued> {
    let blocks = form.blocks.order.iter().zip(&form.partials);
    blocks.flat_map(|((_, chain), partials)| Continued::along(&chain.states, partials))
}

/// K, every eigenvalue of A − KC at −1 by default.
fn coefficients(tuning: &Tuning, blocks: &Blocks) -> Result<Vec<Vec<f64>>, TuningError> {
    Ok(given(tuning)?.unwrap_or_else(|| {
        let all_at_one = |n: usize| placed(&vec![-1.0; n]);
        blocks.lengths().into_iter().map(all_at_one).collect()
    }))
}

/// θ, which has no default.
fn theta(tuning: &Tuning, chains: usize) -> Result<Vec<f64>, TuningError> {
    let missing = || TuningError::new("theta", "a positive number per chain", "nothing");
    tuning
        .positive_per_chain("theta", chains)?
        .ok_or_else(missing)
}

/// y_{i+1}, …, y_p in place of the states they show.
fn injected(copy: &Copy<'_, '_>, blocks: &Blocks, place: usize) -> HashMap<Node, Node> {
    let later = blocks.order[place + 1..].iter();
    later
        .filter_map(|(output, _)| copy.measured_state(*output))
        .map(|(state, y)| (copy.extended.states[state].node, y))
        .collect()
}

/// Lemma 2's condition on θ.
fn chain_rule(blocks: &Blocks, θ: &[f64]) -> Option<String> {
    blocks.order.windows(2).find_map(|pair| {
        let ((before, chain), (after, _)) = (&pair[0], &pair[1]);
        let needed = θ[*before].powi(chain.states.len() as i32);
        (needed > θ[*after]).then(|| {
            format!(
                "theta: {} for the later chain is below {needed} = {}^{} of the chain before it; the proof of Theorem 1 needs at least that",
                θ[*after], θ[*before], chain.states.len()
            )
        })
    })
}
