//! The map from the state to the derivatives of the outputs: Lie derivatives along
//! the drift, relative degrees, observability indices, and the map along the flow
//! with its inputs, after Germani and Manes (1999), section 2.
//!
//! x' = f(x) + Σ_j g_j(x) u_j, y_i = h_i(x). With u = 0 the derivatives of the
//! outputs are L_f^k h_i(x), and their Jacobian is Q(x). With inputs they are
//! functions of x and of u, u', …; input j appears first in the derivative of
//! order r_ij, the observation relative degree of Definition 2.2.

use std::collections::HashMap;

use lynkeus_expr::flow::{self, Flow, InputJet};
use lynkeus_expr::{Expr, Graph, MissingInput, Node, jacobian};

pub use crate::matrix::{Rows, jacobian_rows};
use crate::{Extended, Region, Verdict, vanishes};

/// f and g of x' = f(x) + g(x)u.
#[derive(Clone, Debug)]
pub struct AffineForm {
    /// f, one expression per extended state
    pub drift: Vec<Node>,
    /// g_j, one column per known input
    pub input_columns: Vec<Vec<Option<Node>>>,
}

/// Writes the plant as x' = f(x) + g(x)u, y = h(x).
///
/// # Errors
/// Inside: the first equation that breaks the form, in words.
pub fn affine_form(extended: &Extended<'_>) -> Result<Result<AffineForm, String>, MissingInput> {
    let graph = extended.graph();
    let region = extended.region();
    let u: Vec<Node> = extended.inputs.iter().map(|i| i.node).collect();
    let g = jacobian::forward(graph, &extended.derivatives, &u);
    let slopes: Vec<Node> = g.entries.iter().map(|e| e.2).collect();
    let second = jacobian::forward(graph, &slopes, &u);
    for (entry, j, node) in second.entries {
        if vanishes(graph, node, &region)? != Verdict::Proved {
            let (state, input) = (g.entries[entry].0, &extended.inputs[j].name);
            return Ok(Err(format!(
                "the equation of {} is not affine in the input {input}; the form is x' = f(x) + g(x)u",
                extended.states[state].name
            )));
        }
    }
    let of_u = |node: Node| {
        jacobian::pattern(graph, &[node], &u)[0]
            .first()
            .map(|&j| &extended.inputs[j].name)
    };
    for output in &extended.outputs {
        if let Some(input) = of_u(output.variable.node) {
            return Ok(Err(format!(
                "the output {} reads the input {input}; the form is y = h(x)",
                output.variable.name
            )));
        }
    }
    let zero = graph.constant(0.0).node();
    let silent: HashMap<Node, Node> = u.iter().map(|&u| (u, zero)).collect();
    let n = extended.states.len();
    Ok(Ok(AffineForm {
        drift: graph.substitute(&extended.derivatives, &silent),
        input_columns: (0..u.len())
            .map(|j| (0..n).map(|i| g.get(i, j)).collect())
            .collect(),
    }))
}

/// L_f^k h_i for every output i and k = 0 … order.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn lie_derivatives(
    extended: &Extended<'_>,
    form: &AffineForm,
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    along(extended, &form.drift, &[], order)
}

/// y_i^(k) as functions of x and U, where `U[j]` holds the symbols of input j
/// and of its derivatives; k = 0 … order.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn output_derivatives(
    extended: &Extended<'_>,
    U: &[Vec<Node>],
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    let jets = extended.inputs.iter().zip(U).map(|(input, jet)| InputJet {
        symbol: input.node,
        derivatives: match jet.is_empty() {
            true => vec![input.node],
            false => jet.clone(),
        },
    });
    let jets: Vec<InputJet> = jets.collect();
    along(extended, &extended.derivatives, &jets, order)
}

/// The gradients of [`lie_derivatives`] by the states, output by output.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn lie_gradients(
    extended: &Extended<'_>,
    form: &AffineForm,
    order: usize,
) -> Result<Vec<Rows>, MissingInput> {
    let outputs: Vec<Node> = extended.outputs.iter().map(|o| o.variable.node).collect();
    let flow = Flow {
        time: extended.plant.time,
        states: &extended.symbols(),
        derivatives: &form.drift,
        inputs: &[],
    };
    flow::gradients(extended.graph(), &flow, &outputs, order)
}

fn along(
    extended: &Extended<'_>,
    right: &[Node],
    inputs: &[InputJet],
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    let outputs: Vec<Node> = extended.outputs.iter().map(|o| o.variable.node).collect();
    let flow = Flow {
        time: extended.plant.time,
        states: &extended.symbols(),
        derivatives: right,
        inputs,
    };
    flow::derivatives(extended.graph(), &flow, &outputs, order)
}

/// L_g of a function with the gradient `row`.
fn along_column(graph: &Graph, row: &[Option<Node>], column: &[Option<Node>]) -> Option<Node> {
    let pairs = row.iter().zip(column);
    let terms = pairs.filter_map(|(&q, &g)| Some(graph.expr(q?) * graph.expr(g?)));
    terms.reduce(|a, b| a + b).map(Expr::node)
}

/// The observation relative degree of an output with respect to an input.
#[derive(Clone, Debug, PartialEq)]
pub struct Degree {
    /// r: the input appears first in the derivative of order r; `length` where it
    /// does not appear before
    pub r: usize,
    /// the L_g L_f^k h taken as zero are zero by proof
    pub proved: bool,
    /// what was found, in words
    pub detail: String,
}

/// The relative degree with respect to input j of an output whose derivatives have
/// the gradients `rows`, those of L_f^k h, or those of y^(k) as functions of x and U.
/// Where the map reads other inputs only the latter tell whether these bring this one along:
/// y' = u₁x, x' = u₂ has u₂ in y'' though L_g₂ L_f h = 0.
///
/// `region` has the box of x and of whatever else the gradients read.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn relative_degree(
    extended: &Extended<'_>,
    rows: &[Vec<Option<Node>>],
    form: &AffineForm,
    j: usize,
    region: &Region,
) -> Result<Degree, MissingInput> {
    let graph = extended.graph();
    let input = &extended.inputs[j].name;
    let mut proved = true;
    for (k, row) in rows.iter().enumerate() {
        let Some(node) = along_column(graph, row, &form.input_columns[j]) else {
            continue;
        };
        match vanishes(graph, node, region)? {
            Verdict::Proved => {}
            Verdict::Undecided(_) => proved = false,
            Verdict::Refuted(witness) => {
                let order = k + 1;
                let detail = format!(
                    "{input} appears in y^({order}): ∂y^({order})/∂{input} is {}",
                    witness.told()
                );
                return Ok(Degree {
                    r: k + 1,
                    proved,
                    detail,
                });
            }
        }
    }
    Ok(Degree {
        r: rows.len(),
        proved,
        detail: format!("{input} does not appear before y^({})", rows.len()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sensors;
    use lynkeus_model::{LoadOptions, Plant};

    #[test]
    fn the_first_equation_that_is_not_affine_is_named() {
        let text = "model P input Real u; Real a; Real b; output Real y = a;
          equation der(a) = b + u; der(b) = u*u; end P;";
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        let extended = Extended::new(&plant, &Sensors::default()).unwrap();
        let why = affine_form(&extended).unwrap().unwrap_err();
        assert!(
            why.contains("equation of b is not affine in the input u"),
            "{why}"
        );
    }
}
