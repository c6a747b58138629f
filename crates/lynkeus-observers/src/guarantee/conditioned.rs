//! Estimates of condition (rcond) as numbers of their own.
//!
//! An observer that solves a linear system withdraws its correction where the matrix is close to singular, by a factor that
//! reads the estimate of condition. Intervals know of that one only that it is in [0, 1], and it jumps where the
//! factorisation changes its pivots. Where an observer is right it corrects nothing, so that such a factor counts as any
//! other number that multiplies an innovation: by its range. So it is made a symbol with the range that is proved.
//!
//! The factorisation is QR with column pivots, and the estimate |r_nn|/|r_11|. |r_nn| ≥ σ_n, as r_nn⁻¹ is an entry of R⁻¹;
//! |r_11| is the length of a column, at most ‖A‖_F; and with |det A| = σ_1⋯σ_n the other singular values have a product of at most
//! (‖A‖_F²/(n − 1))^((n−1)/2), so that
//!
//! rcond ≥ |det A| (n − 1)^((n−1)/2) / ‖A‖_Fⁿ.

use std::collections::HashMap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Call, Graph, Interval, MissingInput, Node, Op, Tape, jacobian};
use lynkeus_structure::{Dimension, Matrix, Region, range_within};

/// Unknowns up to which a determinant is expanded.
const UNKNOWNS: usize = 6;
/// Cells examined per end of the ranges of the determinant and of ‖A‖_F².
const CELLS: usize = 1500;
/// What rounding leaves of the factorisation, relatively.
const ROUNDED: f64 = 1.0 - 1e-6;
/// Below this, rounding counts too much.
const LEAST: f64 = 1e-9;

/// The derivatives of an observer with symbols for the estimates of condition in them, and their sides; unchanged where they
/// count where the innovations vanish, too.
pub(super) fn conditioned(
    graph: &Graph,
    derivatives: Vec<Node>,
    innovations: &[Node],
    region: &Region,
) -> Result<(Vec<Node>, Vec<Dimension>), MissingInput> {
    let (mut images, mut sides) = (HashMap::new(), vec![]);
    for node in graph.reachable(&derivatives) {
        let Some(matrix) = matrix_of(graph, node) else {
            continue;
        };
        if let Some(least) = least(graph, &matrix, region)? {
            let name = "rcond";
            let symbol = graph.fresh(name).node();
            images.insert(node, symbol);
            sides.push(Dimension::new(name, symbol, least, 1.0));
        }
    }
    if images.is_empty() {
        return Ok((derivatives, vec![]));
    }
    let changed = graph.substitute(&derivatives, &images);
    let mut wider = region.clone();
    wider.dimensions.extend(sides.iter().cloned());
    let symbols: Vec<Node> = images.into_values().collect();
    match is_idle(graph, &changed, &symbols, innovations, &wider)? {
        true => Ok((changed, sides)),
        false => Ok((derivatives, vec![])),
    }
}

/// The matrix of the system whose estimate of condition the node is.
fn matrix_of<'g>(graph: &'g Graph, node: Node) -> Option<Matrix<'g>> {
    let Op::Entry(system, place) = graph.op(node) else {
        return None;
    };
    let call = graph.system(system)?;
    let (A, b) = Call::linear(&call)?;
    let n = b.len();
    let is_estimate = place as usize == n && (1..=UNKNOWNS).contains(&n);
    is_estimate.then(|| Matrix::from_fn(graph, (n, n), |i, j| Some(A[n * i + j])))
}

/// A bound of the estimate from below; none where it may be next to nothing.
fn least(graph: &Graph, matrix: &Matrix<'_>, region: &Region) -> Result<Option<f64>, MissingInput> {
    let n = matrix.rows as i32;
    let Some(determinant) = matrix.determinant() else {
        return Ok(None);
    };
    let squares = matrix.dense().into_iter().map(|a| graph.expr(a).powi(2));
    let Some(length) = squares.reduce(|a, b| a + b) else {
        return Ok(None);
    };
    let on = |node: Node| Ok(range_within(graph, node, region, CELLS)?.enclosure);
    let (determinant, length) = (on(determinant)?, on(length.node())?);
    let others = Interval::point(f64::from(n - 1)).powi(n - 1).sqrt();
    let least = determinant.abs() * others / length.sqrt().powi(n);
    let least = least.lo() * ROUNDED;
    let is_defined = determinant.is_defined() && length.is_defined();
    Ok((is_defined && least > LEAST).then_some(least.min(ROUNDED)))
}

/// Whether these symbols count for nothing where the innovations vanish.
fn is_idle(
    graph: &Graph,
    derivatives: &[Node],
    symbols: &[Node],
    innovations: &[Node],
    region: &Region,
) -> Result<bool, MissingInput> {
    let zero = graph.constant(0.0).node();
    let vanishing: HashMap<Node, Node> = innovations.iter().map(|&ε| (ε, zero)).collect();
    let right = graph.substitute(derivatives, &vanishing);
    let slopes = jacobian::forward(graph, &right, symbols).entries;
    let slopes: Vec<Node> = slopes.iter().map(|entry| entry.2).collect();
    let used = region.restricted(&graph.symbols_of(&slopes));
    let tape = Tape::new(graph, &used.symbols(), &slopes)?;
    let side = |d: &Dimension| Interval::new(d.min, d.max).unwrap_or(Interval::ENTIRE);
    let cell: Vec<Interval> = used.dimensions.iter().map(side).collect();
    let values = tape.eval_in(&Intervals, &cell);
    Ok(values.iter().all(|value| *value == Interval::ZERO))
}
