//! The form and its conditions: relative degrees, indices, Q and Q̄.

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_structure::output_map::{self, Degree, Rows};
use lynkeus_structure::{Check, Condition, Dimension, Extended, Region, short, sign, visibility};

use super::keys::{self, Variant};
use super::{NAME, derivative_name};
use crate::conditions::{lipschitz, names};
use crate::family;
use crate::{DesignError, Examination, Fit, Tuning};

/// Determinants are expanded for at most so many states.
const DETERMINANT_SIZE: usize = 5;

/// The map of a plant with the facts about it.
pub(super) struct Form {
    pub variant: Variant,
    /// (output, order of the derivative) of each row, chain by chain
    pub rows: Vec<(usize, usize)>,
    /// μ_i: how many derivatives of each output count, from order 0
    pub indices: Vec<usize>,
    /// symbols of u_j, u_j', … on which Φ̄ depends: n − r of them for one output
    pub U: Vec<Vec<Node>>,
    /// Q or, for (4.1) and (4.22), Q̄
    pub Q: Rows,
    /// Q̄_a, columns in the order of `U`; empty for (3.1)
    pub Q_a: Rows,
    pub examination: Examination,
}

pub(super) fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
    region: &Region,
) -> Result<Result<Form, Examination>, DesignError> {
    let graph = extended.graph();
    let n = extended.states.len();
    let asked = keys::variant(tuning)?;
    let affine = match output_map::affine_form(extended)? {
        Ok(affine) => affine,
        Err(why) => return Ok(Err(unfit(why))),
    };
    let lie = output_map::lie_derivatives(extended, &affine, n.saturating_sub(1))?;
    let x = extended.symbols();
    let gradients: Vec<Rows> = lie
        .iter()
        .map(|h| output_map::jacobian_rows(graph, h, &x))
        .collect();
    let indices = match keys::indices(extended, tuning)? {
        Some(indices) => indices,
        None => output_map::observability_indices(extended, &gradients)?,
    };
    if indices.iter().sum::<usize>() < n {
        return Ok(Err(unfit(blind(extended, &indices)?)));
    }
    let mut degrees: Vec<Vec<Degree>> = vec![];
    for (rows, &μ) in gradients.iter().zip(&indices) {
        let inputs = 0..extended.inputs.len();
        let of_input = |j| output_map::relative_degree(extended, &rows[..μ], &affine, j);
        degrees.push(inputs.map(of_input).collect::<Result<_, _>>()?);
    }
    let rows: Vec<(usize, usize)> = indices
        .iter()
        .enumerate()
        .flat_map(|(i, &μ)| (0..μ).map(move |k| (i, k)))
        .collect();
    let Q: Rows = rows.iter().map(|&(i, k)| gradients[i][k].clone()).collect();
    let U = input_symbols(extended, &indices, &degrees);
    let variant = asked.unwrap_or_else(|| Variant::suited(&U));
    let checks = vec![
        degree_check(extended, &indices, &degrees),
        regular(
            extended,
            "Q(x) is regular on the box (drift-observable)",
            &Q,
            region,
        )?,
        lipschitz(extended, region)?,
    ];
    let (Q, Q_a) = match variant {
        Variant::Bounded => (Q, vec![]),
        _ => with_inputs(extended, &rows, &U)?,
    };
    let found = family::Form {
        summary: summary(extended, variant, &rows, &U),
        chains: vec![names(extended, &(0..n).collect::<Vec<_>>())],
    };
    let mut examination = Examination::new(extended, region, NAME, found, checks)?;
    if U.iter().any(|jet| !jet.is_empty()) {
        let check = input_check(extended, variant, &U, &Q, region)?;
        // Theorem 2.4: Q̄ is regular for small enough inputs whatever the box says,
        // and the observer watches it
        if examination.fit == Fit::Fits && check.verdict != Condition::Proved {
            examination.fit = Fit::Undecided;
        }
        examination.checks.push(check);
    }
    Ok(Ok(Form {
        variant,
        rows,
        indices,
        U,
        Q,
        Q_a,
        examination,
    }))
}

fn unfit(summary: String) -> Examination {
    Examination::unfit(NAME, summary, vec![])
}

/// Why the derivatives of the outputs do not determine the state.
fn blind(extended: &Extended<'_>, indices: &[usize]) -> Result<String, DesignError> {
    let n = extended.states.len();
    let seen = visibility::visible(extended)?;
    let hidden: Vec<usize> = (0..n).filter(|&i| !seen[i]).collect();
    let found: usize = indices.iter().sum();
    let advice = match hidden.is_empty() {
        true => "the rest shows only where the inputs are not zero; write the model around an operating point, u = u0 + du with the input du".to_owned(),
        false => format!(
            "no measured output feels {}; measure more",
            names(extended, &hidden).join(", ")
        ),
    };
    Ok(format!(
        "with u = 0 the outputs and their derivatives determine {found} of {n} combinations of states: {advice}"
    ))
}

/// u_j, u_j', …, as many as Φ̄ depends on: for one output n − r.
fn input_symbols(
    extended: &Extended<'_>,
    indices: &[usize],
    degrees: &[Vec<Degree>],
) -> Vec<Vec<Node>> {
    let graph = extended.graph();
    let jet = |(j, input): (usize, &lynkeus_model::Variable)| {
        let needed = indices
            .iter()
            .zip(degrees)
            .map(|(μ, d)| μ.saturating_sub(d[j].r));
        let symbol = |k: usize| match k {
            0 => input.node,
            _ => graph.symbol(&slope_symbol(&input.name, k)).node(),
        };
        (0..needed.max().unwrap_or(0)).map(symbol).collect()
    };
    extended.inputs.iter().enumerate().map(jet).collect()
}

/// The symbol of the k-th derivative of an input.
pub(super) fn slope_symbol(input: &str, k: usize) -> String {
    format!("derivative {k} of {input}")
}

/// Q̄ and Q̄_a of (4.20).
fn with_inputs(
    extended: &Extended<'_>,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> Result<(Rows, Rows), DesignError> {
    let graph = extended.graph();
    let order = rows.iter().map(|r| r.1).max().unwrap_or(0);
    let y = output_map::output_derivatives(extended, U, order)?;
    let Φ̄: Vec<Node> = rows.iter().map(|&(i, k)| y[i][k]).collect();
    let Q̄ = output_map::jacobian_rows(graph, &Φ̄, &extended.symbols());
    Ok((Q̄, output_map::jacobian_rows(graph, &Φ̄, &U.concat())))
}

/// Definition 2.2, with the zeros proved or not.
fn degree_check(extended: &Extended<'_>, indices: &[usize], degrees: &[Vec<Degree>]) -> Check {
    let mut found = vec![];
    let mut proved = true;
    for (i, row) in degrees.iter().enumerate().filter(|(i, _)| indices[*i] > 0) {
        let y = &extended.outputs[i].variable.name;
        for degree in row {
            proved &= degree.proved;
            found.push(format!("{y}: r = {}, {}", degree.r, degree.detail));
        }
    }
    if found.is_empty() {
        found.push("no known input".to_owned());
    }
    if !proved {
        found.push("zeros before r are found at points, not proved".to_owned());
    }
    Check {
        name: "the observation relative degree r is known (Definition 2.2)".into(),
        verdict: match proved {
            true => Condition::Proved,
            false => Condition::Undecided(vec![]),
        },
        detail: found.join("; "),
    }
}

/// det Q keeps its sign, for as many states as it is expanded.
pub(super) fn regular(
    extended: &Extended<'_>,
    name: &str,
    Q: &Rows,
    region: &Region,
) -> Result<Check, DesignError> {
    let graph = extended.graph();
    let name = name.to_owned();
    if Q.len() > DETERMINANT_SIZE {
        let detail = format!(
            "not expanded for more than {DETERMINANT_SIZE} states; the column rcond shows it along the estimate"
        );
        return Ok(Check {
            name,
            verdict: Condition::Undecided(vec![]),
            detail,
        });
    }
    let det = output_map::determinant(graph, Q).unwrap_or_else(|| graph.constant(0.0).node());
    let found = sign::keeps_sign(graph, name, det, region)?;
    let (low, high) = (short(found.bounds.0), short(found.bounds.1));
    let detail = match found.check.verdict {
        Condition::Proved => format!("|det| lies in [{low}, {high}]"),
        Condition::Refuted(_) => "det vanishes or changes its sign".to_owned(),
        Condition::Undecided(_) => {
            format!("|det| lies in [{low}, {high}] as far as can be proved")
        }
    };
    Ok(Check {
        detail,
        ..found.check
    })
}

/// What the observer needs of the input where r < n.
fn input_check(
    extended: &Extended<'_>,
    variant: Variant,
    U: &[Vec<Node>],
    Q̄: &Rows,
    region: &Region,
) -> Result<Check, DesignError> {
    if variant == Variant::Bounded {
        return Ok(Check {
            name: "r = n, or the input is small (Theorem 3.3)".into(),
            verdict: Condition::Undecided(vec![]),
            detail: "the input appears before the n-th derivative of the output and (3.1) takes no account of it: it converges for u_M ≤ β λ_min(P) only; variant = \"theoretical\" or \"practical\" does not need that".into(),
        });
    }
    let name = "Q̄(x, U) is regular on the box for every U (uniformly observable)";
    // a singular point for a constant input is the better witness
    let graph = extended.graph();
    let zero = graph.constant(0.0).node();
    let slopes = U.iter().flat_map(|jet| jet.iter().skip(1));
    let still: HashMap<Node, Node> = slopes.map(|&symbol| (symbol, zero)).collect();
    let constant = |row: &Vec<Option<Node>>| {
        let entry = |e: &Option<Node>| Some(graph.substitute(&[(*e)?], &still)[0]);
        row.iter().map(entry).collect()
    };
    let at_rest: Rows = Q̄.iter().map(constant).collect();
    let mut check = regular(extended, name, &at_rest, region)?;
    if !matches!(check.verdict, Condition::Refuted(_)) && !still.is_empty() {
        check = regular(extended, name, Q̄, &with_slopes(extended, U, region))?;
    }
    if check.verdict != Condition::Proved {
        check.detail += "; small and slow inputs keep it regular (Theorem 2.4), the column rcond and its flag tell";
    }
    Ok(check)
}

/// The box with u', u'', … free.
fn with_slopes(extended: &Extended<'_>, U: &[Vec<Node>], region: &Region) -> Region {
    let mut region = region.clone();
    for (input, jet) in extended.inputs.iter().zip(U) {
        let further = jet
            .iter()
            .enumerate()
            .skip(1)
            .map(|(k, &symbol)| Dimension {
                name: derivative_name(&input.name, k),
                symbol,
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
                integer: false,
            });
        region.dimensions.extend(further);
    }
    region
}

fn summary(
    extended: &Extended<'_>,
    variant: Variant,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> String {
    let y = |&(i, k): &(usize, usize)| derivative_name(&extended.outputs[i].variable.name, k);
    let map: Vec<String> = rows.iter().map(y).collect();
    let u = extended
        .inputs
        .iter()
        .zip(U)
        .flat_map(|(input, jet)| (0..jet.len()).map(|k| derivative_name(&input.name, k)));
    let u: Vec<String> = u.collect();
    let inputs = match u.is_empty() {
        true => "free of the inputs (r = n)".to_owned(),
        false => format!("which read {}", u.join(", ")),
    };
    format!(
        "the state from {}, {inputs}; variant {}",
        map.join(", "),
        variant.word()
    )
}
