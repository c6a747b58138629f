//! Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa, *High gain observer design for a
//! class of MIMO non uniformly observable uncertain systems*.
//!
//! x' = F(u, x) x + φ(u, x) + Bε, y = C(u) x (1)–(2) with rectangular blocks
//! F_k(u, x¹, …, x^k) above the diagonal that need not have full rank at any
//! instant; ε acts on the last block. Observer (7) with the Lyapunov ODE (8):
//!
//! x̂' = F(u, x̂) x̂ + φ(u, x̂) − θ Δ_θ⁻¹ S⁻¹ Cᵀ(u) (C(u) x̂ − y),
//! S' = −θ (S + Fᵀ(u, x̂) S + S F(u, x̂) − Cᵀ(u) C(u)).
//!
//! S is integrated in factors (`lyapunov`), its smallest eigenvalue watched
//! (`excitation`).
//!
//! Corrections to the print: B has the sign of (29), + in the last block; the
//! inputs of Theorem 1's remark satisfy A4, not A3; the error decays like
//! e^{−θμ_θt} with μ_θ → ½, as (24) and (26) have it, not e^{−μ_θt} with μ_θ → 1.
//! Beyond the print: C(u) need not be square, and y = C(u)x + d(u) is understood.

mod excitation;
mod gain;
mod gramian;
mod lyapunov;
mod settings;
mod theorem;

use crate::statement::{Statement, standing};
use crate::{Ltaief, Signal};
use lynkeus_expr::{Expr, Graph, Node, jacobian};
use lynkeus_structure::Standing;
use lynkeus_structure::{Extended, Region, Superdiagonal, range, superdiagonal};

use crate::conditions::{lipschitz, names};
use crate::estimate::Copy;
use crate::stages::{FormBox, Found, Searched, Stages};
use crate::tunable::Speed;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Monitor, Tuning,
    TuningError,
};
use excitation::least_eigenvalue;
use lyapunov::{Factor, Sparse};
use settings::Settings;

const NAME: &str = "state-affine";
const BASIS: &str = "Theorem 1 of Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa";

/// The alarm is raised at this fraction of the information that the best
/// excitation could leave in the least visible state.
const ALARM: f64 = 1e-6;

/// The family `state-affine`.
#[derive(Clone, Copy, Debug)]
pub struct StateAffine;

impl Stages for StateAffine {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Superdiagonal;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Ltaief, Maatoug, Farza, Ménard, M'Saad, Koubaa, observer (7)–(8)";
    const BASIS: &'static str = BASIS;
    const FORM_BOX: FormBox = FormBox::Declared;
    const KEYS: &'static [&'static [KeySpec]] = &[&settings::KEYS];

    fn read(extended: &Extended<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(extended, tuning)
    }

    fn late(settings: &Settings) -> Result<(), TuningError> {
        settings.late()
    }

    fn form(extended: &Extended<'_>, _: &Settings, region: &Region) -> Searched<Superdiagonal> {
        form(extended, region)
    }

    fn design(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Superdiagonal>,
    ) -> Result<Design, DesignError> {
        assemble(extended, settings, &found.form, found.examination)
    }

    fn theorem(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<Superdiagonal>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(extended, settings, found, assumptions)
    }
}

/// The blocks with what is known of A2 and A4.
fn form(extended: &Extended<'_>, region: &Region) -> Searched<Superdiagonal> {
    let form = match superdiagonal::find(extended) {
        Ok(form) => form,
        Err(summary) => {
            return Ok(Err(Examination::unfit(NAME, summary, vec![])));
        }
    };
    let mut checks = vec![];
    for (k, factor) in form.factors.iter().enumerate() {
        let mut declared = factor.columns.clone();
        declared.sort_unstable();
        let statement = Ltaief::BlockShows {
            factor: k,
            states: names(extended, &declared),
        };
        let found = factor.column_rank(extended, k, region)?;
        checks.push(Statement::from(statement).with(found));
    }
    let excited = standing(&checks) == Standing::Undecided;
    checks.push(lipschitz(extended, region)?);
    let mut summary = form.describe(extended);
    if excited {
        summary += "; which inputs suffice depends on their excitation (A4), which the monitor 'excitation' watches";
    }
    let chains = form.declared().map(|block| names(extended, &block));
    let found = crate::family::Form {
        summary,
        chains: chains.collect(),
    };
    let examination = Examination::new(extended, region, NAME, found, checks)?;
    Ok(Ok(Found { form, examination }))
}

/// Observer (7)–(8).
fn assemble(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Superdiagonal,
    examination: Examination,
) -> Result<Design, DesignError> {
    let graph = extended.graph();
    let order: Vec<usize> = form.blocks().flatten().copied().collect();
    let numbers = settings.numbers(&order)?;
    let copy = Copy::new(extended, &settings.common);
    let matrices = Matrices::new(&copy, form, &order);
    let names: Vec<&str> = order
        .iter()
        .map(|&i| extended.states[i].name.as_str())
        .collect();
    let factor = Factor::new(graph, &names, &numbers.S0);
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    prolong(&copy, &matrices.F, &order, &mut derivatives);
    let Matrices { C, F } = matrices;
    let v: Vec<Vec<Sparse<'_>>> = C.iter().map(|row| factor.forward(row)).collect();
    // θΔ_θ⁻¹ = diag(θI, θ²I, …) over the blocks
    let meaning = "the speed θ of the gain and of S".to_owned();
    let θ = Speed::new(&copy, "theta", numbers.θ, meaning);
    let exponents = form
        .blocks()
        .enumerate()
        .flat_map(|(k, block)| block.iter().map(move |_| k as i32 + 1));
    let correction = factor.gain(&v, &innovations(&copy));
    for ((&state, exponent), z) in order.iter().zip(exponents).zip(correction) {
        if let Some(z) = z {
            let power = θ.scaled(graph, numbers.θ.powi(exponent), f64::from(exponent));
            derivatives[state] = (graph.expr(derivatives[state]) - power * z).node();
        }
    }
    derivatives.extend(factor.derivatives(θ.expr(graph), &F, &v));
    let alarm = alarm(extended, form, settings)?;
    let mut observer = copy.observer(NAME, derivatives)?.tuned_by([&θ]);
    observer.monitors.extend(monitor(&factor, alarm));
    observer.states.extend(factor.states);
    let parameters = gain::parameters(&copy, form, &order, &numbers, alarm)?;
    Ok(Design {
        observer,
        notes: outside_last(extended, form).into_iter().collect(),
        examination,
        gains: vec![],
        parameters,
    })
}

/// The paper's prolongation (A2), if the study asks for it: F(u, σ(x̂))x̂ + φ(u, σ(x̂)), which is the
/// plant at σ(x̂) plus F(u, σ(x̂))(x̂ − σ(x̂)); `copy` evaluates everything at σ(x̂). Against a plant in the
/// box what is left is F(u, σ(x̂))e and a difference of f between points of the box, as φ and F read no
/// later block: so every bound of the proof holds wherever x̂ is.
fn prolong<'g>(
    copy: &Copy<'_, 'g>,
    F: &[Vec<Sparse<'g>>],
    order: &[usize],
    derivatives: &mut [Node],
) {
    if !copy.common.prolong {
        return;
    }
    let graph: &'g Graph = copy.extended.graph();
    for (row, &state) in order.iter().enumerate() {
        for (entry, &next) in F[row].iter().zip(order) {
            let Some(entry) = entry else { continue };
            let hat = copy.hats[next].symbol;
            let outside = graph.expr(hat) - graph.expr(copy.seen_as(next, hat));
            derivatives[state] = (graph.expr(derivatives[state]) + *entry * outside).node();
        }
    }
}

/// Below this excitation the flag is raised.
fn alarm(
    extended: &Extended<'_>,
    form: &Superdiagonal,
    settings: &Settings,
) -> Result<f64, DesignError> {
    match settings.alarm.clone()? {
        Some(alarm) => Ok(alarm),
        None => Ok(ALARM * least_reach(extended, form)?),
    }
}

/// λ_min(S) with the flag that excitation is lost.
fn monitor(factor: &Factor<'_>, alarm_below: f64) -> Option<Monitor> {
    let bound = least_eigenvalue(&factor.inverse_entries())?;
    Some(Monitor {
        name: "excitation".into(),
        node: bound.node(),
        alarm_below,
        meaning: "excitation is lost: the inputs and the estimate do not move enough to tell every state apart (A4), so some states are not corrected any more".into(),
        matrix: None,
    })
}

/// C(u) and F(u, x̂), dense, in the order of the blocks.
struct Matrices<'g> {
    C: Vec<Vec<Sparse<'g>>>,
    F: Vec<Vec<Sparse<'g>>>,
}

impl<'g> Matrices<'g> {
    fn new(copy: &Copy<'_, 'g>, form: &Superdiagonal, order: &[usize]) -> Self {
        let graph: &'g Graph = copy.extended.graph();
        let n = order.len();
        let place = |state: usize| order.iter().position(|&i| i == state);
        let mut matrices = Self {
            C: vec![vec![None; n]; copy.extended.outputs.len()],
            F: vec![vec![None; n]; n],
        };
        for (k, factor) in form.factors.iter().enumerate() {
            for &(i, j, node) in &factor.entries {
                let entry: Expr<'g> = graph.expr(copy.at_estimate(&[node])[0]);
                let Some(column) = place(factor.columns[j]) else {
                    continue;
                };
                match (k, place(factor.rows[i])) {
                    (0, _) => matrices.C[factor.rows[i]][column] = Some(entry),
                    (_, Some(row)) => matrices.F[row][column] = Some(entry),
                    (_, None) => {}
                }
            }
        }
        matrices
    }
}

/// C(u)x̂ − y, one per output.
fn innovations<'g>(copy: &Copy<'_, 'g>) -> Vec<Expr<'g>> {
    let extended = copy.extended;
    let graph: &'g Graph = extended.graph();
    let hats = extended.states.iter().zip(&copy.hats);
    let unlimited = hats.map(|(state, hat)| (state.node, hat.symbol)).collect();
    let innovation = |(o, y): (&lynkeus_structure::Measurement, &Signal)| {
        let h = graph.substitute(&[o.variable.node], &unlimited)[0];
        graph.expr(h) - graph.expr(y.symbol)
    };
    extended
        .outputs
        .iter()
        .zip(&copy.measured)
        .map(innovation)
        .collect()
}

/// How large the diagonal of S could be at best for the least visible state:
/// g = 1 for an output, g_j = Σ_i g_i max|F_ij|² for a state. It carries the units
/// of F, so that the alarm does not depend on them. Unbounded entries count as 1.
fn least_reach(extended: &Extended<'_>, form: &Superdiagonal) -> Result<f64, DesignError> {
    let (graph, region) = (extended.graph(), extended.region());
    let mut reach = vec![1.0; extended.outputs.len()];
    let mut least = f64::INFINITY;
    for factor in &form.factors {
        let mut next = vec![0.0; factor.columns.len()];
        for &(i, j, node) in &factor.entries {
            let found = range(graph, node, &region)?.enclosure;
            let size = found.hi().max(-found.lo());
            next[j] += reach[i] * if size.is_finite() { size * size } else { 1.0 };
        }
        let positive = next.iter().copied().filter(|g| *g > 0.0);
        least = positive.fold(least, f64::min);
        reach = next;
    }
    Ok(if least.is_finite() { least } else { 1.0 })
}

/// (1) has ε in the last block only. Elsewhere its trace in the blocks behind
/// does not shrink as θ grows: worth a note, no reason to refuse.
fn outside_last(extended: &Extended<'_>, form: &Superdiagonal) -> Option<String> {
    let plant = extended.plant;
    let last = form.declared().last()?;
    let known = |v: &lynkeus_model::Variable| {
        extended.inputs.iter().any(|i| i.node == v.node) || extended.state_index(&v.name).is_some()
    };
    let ε: Vec<Node> = plant
        .inputs
        .iter()
        .filter(|v| !known(v))
        .map(|v| v.node)
        .collect();
    let pattern = jacobian::pattern(extended.graph(), &plant.derivatives, &ε);
    let acts = |&i: &usize| {
        let unknown_input = i >= extended.plant_states();
        !last.contains(&i) && (unknown_input || !pattern[i].is_empty())
    };
    let states: Vec<usize> = (0..extended.states.len()).filter(acts).collect();
    (!states.is_empty()).then(|| {
        format!(
            "an uncertainty acts on {}, outside of the last block ({}); Theorem 1 covers the last one only, and the error of the blocks behind need not shrink as theta grows",
            names(extended, &states).join(", "),
            names(extended, &last).join(", ")
        )
    })
}
