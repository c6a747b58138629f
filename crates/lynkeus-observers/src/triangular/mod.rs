//! Hammouri, Targui and Armanet, *High gain observer based on a triangular
//! structure*, Int. J. Robust Nonlinear Control 12 (2002) 497–518.
//!
//! x' = f(x, u) in one chain (4) or two (8), y_i = x^i_1, observer (9) (more chains: `docs/triangular.md`):
//!
//! x̂^i' = f^i(x̂, u) − r_i Δ_{θ^δi} S_i⁻¹ Cᵀ (x̂^i_1 − y_i),  Δ_{θ^δ} = diag(θ^δ, …, θ^{nδ}).
//!
//! Corrections to the print: the correction has the minus sign of (9) with
//! r = ρ/2 > 0 throughout; the signs of Remark 2 multiply along the chain,
//! ε_{j+1} = ε_j·sign(∂f_j/∂x_{j+1}), with ε_1 = 1 because y is measured.

mod damping;
mod facts;
mod form;
mod gains;
mod lemma;
mod low_power;
mod settings;
mod theorem;

use lynkeus_expr::{Graph, Node};
use lynkeus_structure::{Extended, Region};

use crate::conditions::Partial;
use crate::correction::{Correction, Start};
use crate::estimate::Copy;
use crate::prolongation::{Continued, prolong};
use crate::stages::{FormBox, Found, Searched, Stages};
use crate::tunable::Speed;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Tuning, TuningError,
    guarantee,
};
use form::Form;
use gains::Gains;
use settings::Settings;

const NAME: &str = "triangular";
const BASIS: &str = "Theorem 2 of Hammouri, Targui and Armanet (one chain: Theorem 1)";

/// The family `triangular`.
#[derive(Clone, Copy, Debug)]
pub struct Triangular;

impl Stages for Triangular {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Form;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Hammouri, Targui, Armanet 2002, doi:10.1002/rnc.638";
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
        form::form(extended, settings, region)
    }

    fn design(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Form>,
    ) -> Result<Design, DesignError> {
        if let Some(lmi) = settings.lmi.clone() {
            let examination = found.examination;
            return guarantee::design_lmi(extended, &settings.common, lmi, NAME, examination);
        }
        if settings.remedies.low_power {
            return Ok(low_power::assemble(extended, settings, found)?);
        }
        let Found { form, examination } = found;
        let gains = Gains::new(&form, settings)?;
        Ok(observer(extended, settings, &form, &gains, examination)?)
    }

    fn theorem(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Form>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(extended, settings, found, assumptions)
    }
}

/// Observer (9).
fn observer(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Form,
    gains: &Gains<'_>,
    examination: Examination,
) -> Result<Design, TuningError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, &settings.common);
    let limit = &settings.remedies.limit;
    let start = Start::new(&copy)?;
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let (mut table, mut parameters) = (vec![], gains.parameters());
    let speeds = Speed::of_chains(&copy, &gains.θ);
    for (i, (chain, θ)) in form.assignment.chains.iter().zip(&speeds).enumerate() {
        let Some(innovation) = limit.innovation(&copy, i) else {
            continue;
        };
        let timed = gains.timed(&copy, i, θ);
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
    prolong(&copy, continued(form), &mut derivatives)?;
    Ok(Design {
        observer: copy.observer(NAME, derivatives)?.tuned_by(&speeds),
        parameters,
        notes: gains.notes.clone(),
        gains: table,
        examination,
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
