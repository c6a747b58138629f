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
use lynkeus_structure::{Blocks, Extended, Region};

use crate::correction::{self, Start};
use crate::estimate::Copy;
use crate::peaking::{Remedies, Transient, transient};
use crate::prolongation::{Continued, prolong};
use crate::stages::{FormBox, Found, Searched, Stages};
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Tuning, TuningError,
    guarantee,
};
use form::Form;
use lee::{lee, transformation};
use settings::{Correction, Settings};

const NAME: &str = "block-triangular";
const BASIS: &str = "Theorem 1 of Lee, Yee and Park";

/// The family `block-triangular`.
#[derive(Clone, Copy, Debug)]
pub struct BlockTriangular;

impl Stages for BlockTriangular {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Form;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Lee, Yee, Park 2000, observers (3) and (7)";
    const BASIS: &'static str = BASIS;
    const FORM_BOX: FormBox = FormBox::Declared;
    const KEYS: &'static [&'static [KeySpec]] = settings::KEYS;

    fn read(extended: &Extended<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(extended, tuning)
    }

    fn late(settings: &Settings) -> Result<(), TuningError> {
        settings.late()
    }

    fn form(extended: &Extended<'_>, settings: &Settings, region: &Region) -> Searched<Form> {
        match settings.impossible() {
            true => {
                let summary = low_power::ONLY_CLASSICAL.to_owned();
                Ok(Err(Examination::unfit(NAME, summary, vec![])))
            }
            false => form::form(extended, settings, region),
        }
    }

    fn design(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Form>,
    ) -> Result<Design, DesignError> {
        match (settings.lmi.clone()?, settings.remedies.low_power) {
            (Some(lmi), _) => {
                let examination = found.examination;
                guarantee::design_lmi(extended, &settings.common, lmi, NAME, examination)
            }
            (None, true) => low_power::assemble(extended, settings, found),
            (None, false) => observer(extended, settings, found),
        }
    }

    fn theorem(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Form>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(extended, settings, &found.form.blocks, assumptions)
    }
}

/// Observer (7) or (3).
fn observer(
    extended: &Extended<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, &settings.common);
    let blocks = &form.blocks;
    let Remedies {
        limit, transient, ..
    } = &settings.remedies;
    let (θ, K) = (settings.θ()?, settings.K(&blocks.lengths()));
    let correction = settings.correction;
    let start = Start::new(&copy)?;
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
    prolong(&copy, continued(&form), &mut derivatives)?;
    Ok(Design {
        observer: copy.observer(NAME, derivatives)?,
        notes: chain_rule(blocks, &θ).into_iter().collect(),
        examination,
        gains,
        parameters,
    })
}

/// The equations of the chains, for their prolongation.
fn continued(form: &Form) -> impl Iterator<Item = Continued> {
    let blocks = form.blocks.order.iter().zip(&form.partials);
    blocks.flat_map(|((_, chain), partials)| Continued::along(&chain.states, partials))
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
