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

use lynkeus_expr::{Graph, Node};
use lynkeus_gain::{Bounds, Tridiagonal, lemma1};
use lynkeus_structure::{Assignment, Extended, chains};

use crate::conditions::{chain_request, fit, lipschitz, names, output_slope, partial};
use crate::estimate::Copy;
use crate::{ChainGain, Design, DesignError, Examination, Family, Fit, Tuning, TuningError};

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
        &["theta", "delta", "r", "gain", "S", "partials", "chains"]
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
        let gains = Gains::new(&form, tuning)?;
        Ok(assemble(extended, tuning, form, &gains)?)
    }
}

/// The triangular form of a plant with the facts about its partials.
struct Form {
    assignment: Assignment,
    /// per chain, j = 1 … n−1
    partials: Vec<Vec<Partial>>,
    examination: Examination,
}

/// ∂f_j/∂x_{j+1}
#[derive(Clone, Debug)]
struct Partial {
    node: Node,
    sign: f64,
    /// (α₁, α₂); α₁ = 0 where no sign is proved
    bounds: (f64, f64),
}

/// The best form, or the examination that says why there is none.
fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<Form, Examination>, DesignError> {
    let given = explicit(tuning)?;
    let sizes = given.map(|given| given.iter().map(Tridiagonal::size).collect());
    let request = chain_request(extended, tuning, "S", sizes)?;
    let assignments = match chains::find(extended, &request) {
        Ok(assignments) => assignments,
        Err(summary) => {
            let examination = Examination {
                family: NAME,
                fit: Fit::DoesNotFit,
                summary,
                chains: vec![],
                checks: vec![],
            };
            return Ok(Err(examination));
        }
    };
    let choices = assignments.len();
    let mut first: Option<Form> = None;
    for assignment in assignments {
        let form = examined(extended, assignment, choices)?;
        if form.examination.fit != Fit::DoesNotFit {
            return Ok(Ok(form));
        }
        first.get_or_insert(form);
    }
    // chains::find never returns an empty list
    first
        .map(Ok)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
}

fn explicit(tuning: &Tuning) -> Result<Option<Vec<Tridiagonal>>, TuningError> {
    let Some(tables) = tuning.number_tables("S", &["diag", "off"])? else {
        return Ok(None);
    };
    let matrix = |(i, mut table): (usize, Vec<Vec<f64>>)| {
        let (off, diagonal) = (
            table.pop().unwrap_or_default(),
            table.pop().unwrap_or_default(),
        );
        Tridiagonal::new(diagonal, off).map_err(|error| {
            TuningError::new(
                "S",
                format!("a positive definite tridiagonal matrix as entry {}", i + 1),
                error,
            )
        })
    };
    tables
        .into_iter()
        .enumerate()
        .map(matrix)
        .collect::<Result<_, _>>()
        .map(Some)
}

/// Condition H3 for one assignment.
fn examined(
    extended: &Extended<'_>,
    assignment: Assignment,
    choices: usize,
) -> Result<Form, DesignError> {
    let region = extended.region();
    let (mut checks, mut partials) = (vec![], vec![]);
    for (i, chain) in assignment.chains.iter().enumerate() {
        checks.extend(output_slope(extended, i, &region)?);
        let mut row = vec![];
        for pair in chain.states.windows(2) {
            let (node, found) = partial(extended, pair[0], pair[1], &region)?;
            checks.push(found.check);
            row.push(Partial {
                node,
                sign: found.sign,
                bounds: found.bounds,
            });
        }
        partials.push(row);
    }
    checks.push(lipschitz(extended, &region)?);
    let fit = fit(&checks);
    let chains = assignment
        .chains
        .iter()
        .map(|c| names(extended, &c.states))
        .collect();
    let mut summary = chains::describe(extended, &assignment);
    if choices > 1 {
        summary += &format!(
            ", the most balanced of {choices} assignments that the equations allow; the key 'chains' decides otherwise"
        );
    }
    let examination = Examination {
        family: NAME,
        fit,
        summary,
        chains,
        checks,
    };
    Ok(Form {
        assignment,
        partials,
        examination,
    })
}

/// The numbers of the gain.
struct Gains {
    θ: Vec<f64>,
    δ: Vec<f64>,
    r: Vec<f64>,
    S: Vec<Tridiagonal>,
    divided: bool,
    notes: Vec<String>,
}

impl Gains {
    fn new(form: &Form, tuning: &Tuning) -> Result<Self, TuningError> {
        let count = form.assignment.chains.len();
        let missing = || {
            TuningError::new(
                "theta",
                "a positive number (the gain grows like theta^n)",
                "nothing",
            )
        };
        let θ = tuning
            .positive_per_chain("theta", count)?
            .ok_or_else(missing)?;
        let divided = tuning.flag("partials")?;
        tuning.choice("gain", &["lemma1"])?;
        let (S, ρ) = match explicit(tuning)? {
            Some(S) => (S, None),
            None => lemma1_matrices(form, divided)?,
        };
        let r = match tuning.positive_per_chain("r", count)? {
            Some(r) => r,
            // (9) with r = ρ/2; an explicit S comes without its ρ: the example's r = 1
            None => vec![ρ.map_or(1.0, |ρ| ρ / 2.0); count],
        };
        let mut gains = Self {
            θ,
            δ: exponents(form, tuning)?,
            r,
            S,
            divided,
            notes: vec![],
        };
        gains.notes.extend(window(form, &gains.δ));
        Ok(gains)
    }

    /// r Δ_θ S⁻¹Cᵀ of chain i.
    fn chain(&self, i: usize) -> Vec<f64> {
        let power = |j: usize| self.θ[i].powf(self.δ[i] * (j + 1) as f64);
        let column = self.S[i].gain().into_iter().enumerate();
        column.map(|(j, s)| self.r[i] * power(j) * s).collect()
    }
}

fn lemma1_matrices(
    form: &Form,
    divided: bool,
) -> Result<(Vec<Tridiagonal>, Option<f64>), TuningError> {
    let mut ρ = None;
    let mut matrix = |chain: &Vec<Partial>| {
        let bounds = |p: &Partial| match divided {
            // dividing by the partials leaves a chain of integrators
            true => Bounds {
                lower: 1.0,
                upper: 1.0,
            },
            false => Bounds {
                lower: p.bounds.0,
                upper: p.bounds.1,
            },
        };
        let bounds: Vec<Bounds> = chain.iter().map(bounds).collect();
        let found = lemma1::construct(&bounds).map_err(|error| {
            let expected = "partial derivatives with known positive bounds for Lemma 1; declare min and max in the model, give S, or set partials = true";
            TuningError::new("gain", expected, error)
        })?;
        ρ = Some(found.ρ);
        Ok(found.S)
    };
    let S = form
        .partials
        .iter()
        .map(&mut matrix)
        .collect::<Result<_, _>>()?;
    Ok((S, ρ))
}

/// δ: given, or δ = 1 for the leading chain and 2n₁/(2n₂−1) for the other, the
/// middle of Theorem 2's window.
fn exponents(form: &Form, tuning: &Tuning) -> Result<Vec<f64>, TuningError> {
    let lengths = form.assignment.lengths();
    if let Some(δ) = tuning.positive_per_chain("delta", lengths.len())? {
        return Ok(δ);
    }
    let lead = form.assignment.leading;
    let exponent = |i: usize| match i == lead {
        true => 1.0,
        false => 2.0 * lengths[lead] as f64 / (2.0 * lengths[i] as f64 - 1.0),
    };
    Ok((0..lengths.len()).map(exponent).collect())
}

/// Theorem 2: (2n₁−1)/(2n₂−1) δ₁ < δ₂ < (2n₁+1)/(2n₂−1) δ₁.
fn window(form: &Form, δ: &[f64]) -> Option<String> {
    let lengths = form.assignment.lengths();
    let [_, _] = lengths[..] else { return None };
    let lead = form.assignment.leading;
    let (n1, n2) = (lengths[lead] as f64, lengths[1 - lead] as f64);
    let (low, high) = (
        (2.0 * n1 - 1.0) / (2.0 * n2 - 1.0),
        (2.0 * n1 + 1.0) / (2.0 * n2 - 1.0),
    );
    let ratio = δ[1 - lead] / δ[lead];
    let inside = low < ratio && ratio < high;
    (!inside).then(|| {
        format!("delta: the ratio {ratio:.4} lies outside ({low:.4}, {high:.4}), the window of Theorem 2; its proof does not cover this observer")
    })
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
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let mut table = vec![];
    for (i, chain) in form.assignment.chains.iter().enumerate() {
        let Some(innovation) = copy.innovation(i) else {
            continue;
        };
        let constants = gains.chain(i);
        let scaled = scaled(graph, &copy, &form.partials[i], &constants, gains.divided);
        for (&state, gain) in chain.states.iter().zip(scaled) {
            let correction = graph.expr(gain) * graph.expr(innovation);
            derivatives[state] = (graph.expr(derivatives[state]) - correction).node();
        }
        table.push(ChainGain {
            output: extended.outputs[i].variable.name.clone(),
            entries: names(extended, &chain.states)
                .into_iter()
                .zip(constants)
                .collect(),
        });
    }
    Ok(Design {
        observer: copy.observer(NAME, tuning, derivatives)?,
        parameters: parameters(gains),
        notes: gains.notes.clone(),
        gains: table,
        examination: form.examination,
    })
}

/// The gains in the coordinates of the plant: with the signs of Remark 2, or
/// divided by ∂f_1/∂x_2 ⋯ ∂f_{j−1}/∂x_j at the estimate, so that every chain
/// converges like one of integrators.
fn scaled(
    graph: &Graph,
    copy: &Copy<'_, '_>,
    partials: &[Partial],
    constants: &[f64],
    divided: bool,
) -> Vec<Node> {
    let nodes: Vec<Node> = partials.iter().map(|p| p.node).collect();
    let at_estimate = copy.at_estimate(&nodes);
    let mut ε = 1.0;
    let mut product = graph.constant(1.0);
    let mut scaled = vec![];
    for (j, &constant) in constants.iter().enumerate() {
        if j > 0 {
            ε *= partials[j - 1].sign;
            product = product * graph.expr(at_estimate[j - 1]);
        }
        scaled.push(match divided {
            true => (graph.constant(constant) / product).node(),
            false => graph.constant(ε * constant).node(),
        });
    }
    scaled
}

fn parameters(gains: &Gains) -> Vec<(String, String)> {
    let list = |values: &[f64]| {
        let values: Vec<String> = values.iter().map(|x| format!("{x}")).collect();
        values.join(", ")
    };
    let mut rows = vec![
        ("θ".to_owned(), list(&gains.θ)),
        ("δ".to_owned(), list(&gains.δ)),
        ("r".to_owned(), list(&gains.r)),
    ];
    for (i, s) in gains.S.iter().enumerate() {
        rows.push((format!("S{} diagonal", i + 1), list(s.diagonal())));
        rows.push((format!("S{} beside it", i + 1), list(s.off_diagonal())));
    }
    rows
}
