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
/// Cells examined per end of the range of det² A/‖A‖_F²ⁿ.
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
    let square = graph.expr(determinant).powi(2) / length.powi(n);
    let square = range_within(graph, square.node(), region, CELLS)?.enclosure;
    let others = Interval::point(f64::from(n - 1)).powi(n - 1);
    let least = (square * others).sqrt();
    let bound = least.lo() * ROUNDED;
    Ok((least.is_defined() && bound > LEAST).then_some(bound.min(ROUNDED)))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 3×3 matrices that bend over a box, at 200 points of it each: no estimate is below the bound, and where the matrices are
    /// well conditioned the bound is within a factor 30.
    #[test]
    fn no_estimate_is_below_its_bound() {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005);
            seed = seed.wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut bounded, mut near) = (0, 0);
        for _ in 0..20 {
            let graph = Graph::new();
            let symbols = [graph.symbol("x"), graph.symbol("y")];
            let diagonal = |place: usize| if place.is_multiple_of(4) { 2.0 } else { 0.0 };
            let entry = |place: usize| {
                let [a, b, c] = [0, 1, 2].map(|_| random());
                let [x, y] = symbols;
                (diagonal(place) + a + 0.4 * (b * x + c * (x * y).sin())).node()
            };
            let A: Vec<Node> = (0..9).map(entry).collect();
            let b = [1.0, 2.0, 3.0].map(|x| graph.constant(x).node());
            let rcond = graph.solve(&A, &b).rcond;
            let symbols = symbols.map(|symbol| symbol.node());
            let side = |&symbol: &Node| Dimension::new("x", symbol, -1.0, 1.0);
            let dimensions = symbols.iter().map(side).collect();
            let region = Region { dimensions };
            let matrix = matrix_of(&graph, rcond).unwrap();
            let Some(least) = least(&graph, &matrix, &region).unwrap() else {
                continue;
            };
            bounded += 1;
            let mut evaluator = Tape::new(&graph, &symbols, &[rcond]).unwrap().evaluator();
            let found = (0..200).map(|_| evaluator.value(&[random(), random()]));
            let smallest = found.fold(f64::INFINITY, f64::min);
            assert!(smallest >= least, "{smallest} {least}");
            near += usize::from(smallest < 30.0 * least);
        }
        assert!(bounded >= 8 && near >= 4, "{bounded} {near}");
    }

    /// The estimate is replaced where it multiplies an innovation, and left where it counts without one.
    #[test]
    fn what_counts_without_an_innovation_stays() {
        let graph = Graph::new();
        let [x, ε] = ["x", "e"].map(|name| graph.symbol(name));
        let A = [(2.0 + x).node()];
        let solution = graph.solve(&A, &[ε.node()]);
        let share = 1.0 - (-graph.expr(solution.rcond)).exp();
        let dimensions = vec![
            Dimension::new("x", x.node(), -1.0, 1.0),
            Dimension::new("e", ε.node(), -2.0, 2.0),
        ];
        let region = Region { dimensions };
        let changed = |f: Node| conditioned(&graph, vec![f], &[ε.node()], &region).unwrap();
        let corrected = (graph.expr(solution.x[0]) * share - x).node();
        let (found, sides) = changed(corrected);
        assert!(found[0] != corrected && sides.len() == 1);
        assert!(sides[0].min > 0.9 && sides[0].max == 1.0, "{sides:?}");
        let driven = (share - x).node();
        assert_eq!(changed(driven).0, [driven]);
    }
}
