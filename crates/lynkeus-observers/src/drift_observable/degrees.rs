//! Which derivative of which output an input enters, and which of its derivatives the map reads.

use crate::statement::sufficient;
use crate::{Check, Germani};
use lynkeus_expr::Node;
use lynkeus_structure::output_map::{self, Degree, Rows};
use lynkeus_structure::{Dimension, Extended, Region};

use super::derivative_name;
use super::form::Map;
use crate::DesignError;

/// r_ij of output i with respect to input j, for indices μ.
pub(super) fn degrees(
    extended: &Extended<'_>,
    map: &Map<'_>,
    μ: &[usize],
    region: &Region,
) -> Result<Vec<Vec<Degree>>, DesignError> {
    let of = |gradients: &[Rows], region: &Region| -> Result<Vec<Vec<Degree>>, DesignError> {
        let mut all = vec![];
        for (rows, &μ) in gradients.iter().zip(μ) {
            let rows = &rows[..μ];
            let of_input = |j| output_map::relative_degree(extended, rows, &map.affine, j, region);
            let row: Result<Vec<Degree>, _> = (0..extended.inputs.len()).map(of_input).collect();
            all.push(row?);
        }
        Ok(all)
    };
    let found = of(&map.gradients, region)?;
    let early = found
        .iter()
        .zip(μ)
        .any(|(row, &μ)| row.iter().any(|d| d.r < μ));
    if extended.inputs.len() < 2 || !early {
        return Ok(found);
    }
    // an input that enters early may bring another one along
    let order = μ.iter().copied().max().unwrap_or(0);
    let orders = vec![order; extended.inputs.len()];
    let U = jets(extended, map, &orders);
    let y = output_map::output_derivatives(extended, &U, order.saturating_sub(1))?;
    let x = extended.symbols();
    let gradients: Vec<Rows> = y
        .iter()
        .map(|y| output_map::jacobian_rows(extended.graph(), y, &x))
        .collect();
    of(
        &gradients,
        &with_slopes(extended, &U, &extended.input_derivatives, region),
    )
}

/// u_j, u_j', …, as many as Φ̄ depends on: for one output n − r.
pub(super) fn input_symbols(
    extended: &Extended<'_>,
    map: &Map<'_>,
    indices: &[usize],
    degrees: &[Vec<Degree>],
) -> Vec<Vec<Node>> {
    let needed = |j: usize| {
        let pairs = indices.iter().zip(degrees);
        let orders = pairs.map(|(μ, d)| μ.saturating_sub(d[j].r));
        orders.max().unwrap_or(0)
    };
    let orders: Vec<usize> = (0..extended.inputs.len()).map(needed).collect();
    jets(extended, map, &orders)
}

/// The symbols of u_j, u_j', …, so many of each input.
fn jets(extended: &Extended<'_>, map: &Map<'_>, orders: &[usize]) -> Vec<Vec<Node>> {
    let whole = extended.inputs.iter().zip(&map.slopes);
    let whole = whole.map(|(input, slopes)| std::iter::once(input.node).chain(slopes.clone()));
    whole
        .zip(orders)
        .map(|(jet, &order)| jet.take(order).collect())
        .collect()
}

/// Symbols of u_j', u_j'', …, as many as there are states, for each known input.
pub(super) fn slopes(extended: &Extended<'_>) -> Vec<Vec<Node>> {
    let graph = extended.graph();
    let symbol = |name: &str, k: usize| graph.fresh(format!("derivative {k} of {name}")).node();
    let orders = 1..=extended.states.len();
    let one =
        |input: &lynkeus_model::Variable| orders.clone().map(|k| symbol(&input.name, k)).collect();
    extended.inputs.iter().map(one).collect()
}

/// The box with u', u'', … within their bounds, which are those of each input's own list, and free
/// beyond its end.
pub(super) fn with_slopes(
    extended: &Extended<'_>,
    U: &[Vec<Node>],
    bounds: &[Vec<f64>],
    region: &Region,
) -> Region {
    let mut region = region.clone();
    for ((input, jet), bounds) in extended.inputs.iter().zip(U).zip(bounds) {
        let further = jet.iter().enumerate().skip(1).map(|(k, &symbol)| {
            let bound = bounds.get(k - 1).copied().unwrap_or(f64::INFINITY);
            Dimension {
                name: derivative_name(&input.name, k),
                symbol,
                min: -bound,
                max: bound,
                integer: false,
            }
        });
        region.dimensions.extend(further);
    }
    region
}

/// Definition 2.2, with the zeros proved or not.
pub(super) fn known(extended: &Extended<'_>, indices: &[usize], degrees: &[Vec<Degree>]) -> Check {
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
    sufficient(Germani::Degree, proved, found.join("; "))
}
