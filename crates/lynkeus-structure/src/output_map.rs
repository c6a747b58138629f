//! The map from the state to the derivatives of the outputs: Lie derivatives along
//! the drift, relative degrees, observability indices, and the map along the flow
//! with its inputs, after Germani and Manes (1999), section 2.
//!
//! x' = f(x) + Σ_j g_j(x) u_j, y_i = h_i(x). With u = 0 the derivatives of the
//! outputs are L_f^k h_i(x), and their Jacobian is Q(x). With inputs they are
//! functions of x and of u, u', …; input j appears first in the derivative of
//! order r_ij, the observation relative degree of Definition 2.2.
//!
//! Observability indices: of which output how many derivatives make up a map of the
//! state that is regular, at generic points.
//!
//! The rows dL_f^k h_i span the observability codistribution. Index i says that the
//! first μ_i of them are taken of output i; with Σμ_i = n they form a square matrix. There
//! may be many such vectors, and which of them is regular on a whole box is another
//! question than which is regular almost everywhere.

use std::collections::{HashMap, HashSet, VecDeque};

use lynkeus_expr::flow::{self, Flow, InputJet};
use lynkeus_expr::{Evaluator, Expr, Graph, MissingInput, Node, Tape, jacobian};
use nalgebra::{DMatrix, DVector};

pub use crate::matrix::Rows;
pub use crate::matrix::jacobian_rows;
use crate::region::{inside, spread};
use crate::{AugmentedPlant, Misfit, Region, Verdict, Witness, vanishes};

/// f and g of x' = f(x) + g(x)u.
#[derive(Clone, Debug)]
pub struct AffineForm {
    /// f, one expression per augmented state
    pub drift: Vec<Node>,
    /// g_j, one column per known input
    pub input_columns: Vec<Vec<Option<Node>>>,
}

/// Writes the plant as x' = f(x) + g(x)u, y = h(x).
///
/// # Errors
/// Inside: the first equation that breaks the form.
pub fn affine_form(
    augmented: &AugmentedPlant<'_>,
) -> Result<Result<AffineForm, Misfit>, MissingInput> {
    let graph = augmented.graph();
    let region = augmented.region();
    let u: Vec<Node> = augmented.inputs.iter().map(|i| i.node).collect();
    let g = jacobian::forward(graph, &augmented.derivatives, &u);
    let slopes: Vec<Node> = g.entries.iter().map(|e| e.2).collect();
    let second = jacobian::forward(graph, &slopes, &u);
    for (entry, j, node) in second.entries {
        if vanishes(graph, node, &region)? != Verdict::Proved {
            return Ok(Err(Misfit::InputNotAffine {
                of: augmented.states[g.entries[entry].0].name.clone(),
                input: augmented.inputs[j].name.clone(),
            }));
        }
    }
    for output in &augmented.outputs {
        if let Some(&j) = jacobian::pattern(graph, &[output.variable.node], &u)[0].first() {
            return Ok(Err(Misfit::OutputReadsInput {
                output: output.variable.name.clone(),
                input: augmented.inputs[j].name.clone(),
            }));
        }
    }
    let zero = graph.constant(0.0).node();
    let silent: HashMap<Node, Node> = u.iter().map(|&u| (u, zero)).collect();
    let n = augmented.states.len();
    Ok(Ok(AffineForm {
        drift: graph.substitute(&augmented.derivatives, &silent),
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
    augmented: &AugmentedPlant<'_>,
    form: &AffineForm,
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    along(augmented, &form.drift, &[], order)
}

/// y_i^(k) as functions of x and U, where `U[j]` holds the symbols of input j
/// and of its derivatives; k = 0 … order.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn output_derivatives(
    augmented: &AugmentedPlant<'_>,
    U: &[Vec<Node>],
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    let jets = augmented.inputs.iter().zip(U).map(|(input, jet)| InputJet {
        symbol: input.node,
        derivatives: match jet.is_empty() {
            true => vec![input.node],
            false => jet.clone(),
        },
    });
    let jets: Vec<InputJet> = jets.collect();
    along(augmented, &augmented.derivatives, &jets, order)
}

/// The gradients of [`lie_derivatives`] by the states, output by output.
///
/// # Errors
/// [`MissingInput`] where the plant has parameters without value.
pub fn lie_gradients(
    augmented: &AugmentedPlant<'_>,
    form: &AffineForm,
    order: usize,
) -> Result<Vec<Rows>, MissingInput> {
    let outputs = augmented.output_nodes();
    let flow = Flow {
        time: augmented.plant.time,
        states: &augmented.symbols(),
        derivatives: &form.drift,
        inputs: &[],
    };
    flow::gradients(augmented.graph(), &flow, &outputs, order)
}

fn along(
    augmented: &AugmentedPlant<'_>,
    right: &[Node],
    inputs: &[InputJet],
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    let outputs = augmented.output_nodes();
    let flow = Flow {
        time: augmented.plant.time,
        states: &augmented.symbols(),
        derivatives: right,
        inputs,
    };
    flow::derivatives(augmented.graph(), &flow, &outputs, order)
}

/// L_g of a function with the gradient `row`; none where it is zero by its pattern.
pub fn along_column(graph: &Graph, row: &[Option<Node>], column: &[Option<Node>]) -> Option<Node> {
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
    /// name of the input
    pub input: String,
    /// where ∂y^(r)/∂u is not zero; none where the input does not appear before
    pub witness: Option<Witness>,
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
    augmented: &AugmentedPlant<'_>,
    rows: &[Vec<Option<Node>>],
    form: &AffineForm,
    j: usize,
    region: &Region,
) -> Result<Degree, MissingInput> {
    let graph = augmented.graph();
    let mut degree = Degree {
        r: rows.len(),
        proved: true,
        input: augmented.inputs[j].name.clone(),
        witness: None,
    };
    for (k, row) in rows.iter().enumerate() {
        let Some(node) = along_column(graph, row, &form.input_columns[j]) else {
            continue;
        };
        match vanishes(graph, node, region)? {
            Verdict::Proved => {}
            Verdict::Undecided(_) => degree.proved = false,
            Verdict::Refuted(witness) => {
                (degree.r, degree.witness) = (k + 1, Some(witness));
                break;
            }
        }
    }
    Ok(degree)
}

/// Points at which the rank of the rows is tried.
const POINTS: usize = 5;
/// Points at which the sign of a determinant is tried.
const SIGNS: usize = 40;
/// Index vectors whose rank is tried.
const VISITED: usize = 300;
/// A row of unit length that keeps less than this beside the rows before it
/// depends on them. Long chains lose about a digit per row without being
/// singular, rounding leaves 1e-15.
const RANK_TOLERANCE: f64 = 1e-12;

/// The rows dL_f^k h_i, output by output, order by order, at points of the box.
#[derive(Debug)]
pub struct Codistribution {
    evaluator: Evaluator,
    /// ranges of what the rows read, time last
    sides: Vec<(f64, f64)>,
    /// rows of each output
    lengths: Vec<usize>,
    /// number of states
    n: usize,
}

impl Codistribution {
    /// For `rows[i]`, the gradients of the derivatives 0, 1, … of output i.
    ///
    /// # Errors
    /// [`MissingInput`] where the plant has parameters without value.
    pub fn new(augmented: &AugmentedPlant<'_>, rows: &[Rows]) -> Result<Self, MissingInput> {
        let zero = augmented.graph().constant(0.0).node();
        let entries = rows.iter().flatten().flatten();
        let entries: Vec<Node> = entries.map(|e| e.unwrap_or(zero)).collect();
        let region = augmented.region();
        let tape = Tape::new(augmented.graph(), &region.symbols(), &entries)?;
        let sides = region.dimensions.iter().map(|d| (d.min, d.max));
        Ok(Self {
            evaluator: tape.evaluator(),
            sides: sides.collect(),
            lengths: rows.iter().map(Vec::len).collect(),
            n: augmented.states.len(),
        })
    }

    /// The indices of A. J. Krener and W. Respondek (SIAM J. Control Optim. 23 (1985)
    /// 197–216, after Brunovsky): rows are taken in the order k = 0, 1, …, within k in the
    /// order of the outputs, and kept while they are independent of those before; an
    /// output that fails once is left out from there on. Fewer than n in sum where
    /// no point shows more.
    pub fn krener_respondek(&mut self) -> Vec<usize> {
        let mut best = vec![0; self.lengths.len()];
        let points: Vec<Vec<f64>> = (0..POINTS).filter_map(|p| self.at(p)).collect();
        for values in &points {
            let indices = self.indices_at(values);
            if indices.iter().sum::<usize>() > best.iter().sum() {
                best = indices;
            }
        }
        best
    }

    /// Further index vectors with n independent rows at some point: those near
    /// `first` are looked at, and those with the fewest derivatives come first.
    pub fn alternatives(&mut self, first: &[usize]) -> Vec<Vec<usize>> {
        let points: Vec<Vec<f64>> = (0..POINTS).filter_map(|p| self.at(p)).collect();
        let mut seen = HashSet::from([first.to_vec()]);
        let mut open = VecDeque::from([first.to_vec()]);
        let mut found = vec![];
        while let Some(indices) = open.pop_front() {
            for next in self.neighbours(&indices) {
                if seen.len() >= VISITED || !seen.insert(next.clone()) {
                    continue;
                }
                if points
                    .iter()
                    .any(|values| self.is_independent(values, &next))
                {
                    found.push(next.clone());
                }
                open.push_back(next);
            }
        }
        found.sort_by_key(|indices| indices.iter().copied().max());
        found
    }

    /// Whether the determinant of the chosen rows is seen with both signs: such indices
    /// are singular somewhere, unless the box falls apart.
    pub fn changes_sign(&mut self, indices: &[usize]) -> bool {
        let (rows, n) = (self.chosen(indices), self.n);
        if rows.len() != n {
            return false;
        }
        let (mut positive, mut negative) = (false, false);
        for values in (0..SIGNS).filter_map(|point| self.at(point)) {
            let matrix = DMatrix::from_fn(n, n, |i, j| values[rows[i] * n + j]);
            let det = matrix.determinant();
            positive |= det > 0.0;
            negative |= det < 0.0;
        }
        positive && negative
    }

    /// One derivative less of one output, one more of another.
    fn neighbours(&self, indices: &[usize]) -> Vec<Vec<usize>> {
        let mut all = vec![];
        for from in (0..indices.len()).filter(|&i| indices[i] > 0) {
            for to in (0..indices.len()).filter(|&i| indices[i] < self.lengths[i]) {
                if from != to {
                    let mut next = indices.to_vec();
                    next[from] -= 1;
                    next[to] += 1;
                    all.push(next);
                }
            }
        }
        all
    }

    /// Places of the chosen rows.
    fn chosen(&self, indices: &[usize]) -> Vec<usize> {
        let mut start = 0;
        let mut rows = vec![];
        for (&count, &length) in indices.iter().zip(&self.lengths) {
            rows.extend(start..start + count.min(length));
            start += length;
        }
        rows
    }

    /// The entries at a generic point; none outside the domain of the equations.
    fn at(&mut self, point: usize) -> Option<Vec<f64>> {
        let sides = self.sides.iter().enumerate();
        let at: Vec<f64> = sides
            .map(|(i, &(min, max))| inside(min, max, spread(point, i)))
            .collect();
        let mut values = vec![0.0; self.lengths.iter().sum::<usize>() * self.n];
        self.evaluator.eval(&at, &mut values);
        values.iter().all(|v| v.is_finite()).then_some(values)
    }

    fn is_independent(&self, values: &[f64], indices: &[usize]) -> bool {
        let mut kept = vec![];
        let rows = self.chosen(indices);
        rows.len() == self.n
            && rows
                .iter()
                .all(|&row| adds(&mut kept, self.row(values, row)))
    }

    fn row<'v>(&self, values: &'v [f64], row: usize) -> &'v [f64] {
        &values[row * self.n..(row + 1) * self.n]
    }

    fn indices_at(&self, values: &[f64]) -> Vec<usize> {
        let mut kept = vec![];
        let mut indices = vec![0; self.lengths.len()];
        let orders = self.lengths.iter().copied().max().unwrap_or(0);
        for k in 0..orders {
            let mut start = 0;
            for (index, &length) in indices.iter_mut().zip(&self.lengths) {
                let place = start + k;
                start += length;
                if *index < k || k >= length || kept.len() == self.n {
                    continue;
                }
                if adds(&mut kept, self.row(values, place)) {
                    *index = k + 1;
                }
            }
        }
        indices
    }
}

/// Adds a row, orthonormal, if it is independent of those before.
fn adds(kept: &mut Vec<DVector<f64>>, row: &[f64]) -> bool {
    let mut row = DVector::from_column_slice(row);
    let norm = row.norm();
    if norm == 0.0 {
        return false;
    }
    row /= norm;
    // twice is enough for orthogonality to rounding
    for _ in 0..2 {
        for q in &*kept {
            let share = q.dot(&row);
            row.axpy(-share, q, 1.0);
        }
    }
    let left = row.norm();
    let independent = left > RANK_TOLERANCE;
    if independent {
        kept.push(row / left);
    }
    independent
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;
    use crate::Sensors;

    #[test]
    fn the_first_equation_that_is_not_affine_is_named() {
        let text = "model P input Real u; Real a; Real b; output Real y = a;
      equation der(a) = b + u; der(b) = u*u; end P;";
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
        let why = affine_form(&augmented).unwrap().unwrap_err();
        let (of, input) = ("b".to_owned(), "u".to_owned());
        assert_eq!(why, Misfit::InputNotAffine { of, input });
    }

    fn codistribution(text: &str) -> Codistribution {
        let plant = Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap();
        let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
        let form = affine_form(&augmented).unwrap().unwrap();
        let n = augmented.states.len();
        let h = lie_derivatives(&augmented, &form, n - 1).unwrap();
        let rows: Vec<Rows> = h
            .iter()
            .map(|h| jacobian_rows(&plant.graph, h, &augmented.symbols()))
            .collect();
        Codistribution::new(&augmented, &rows).unwrap()
    }

    /// Two sensors on chains of 3 and 1, and a third that adds nothing.
    #[test]
    fn rows_are_taken_while_they_are_independent() {
        let text = "model P Real a; Real b; Real c; Real d;
      output Real y = a; output Real z = a + d; output Real w = 2*a;
      equation der(a) = b; der(b) = c + d*a; der(c) = -sin(a); der(d) = -d; end P;";
        assert_eq!(codistribution(text).krener_respondek(), [3, 1, 0]);
    }

    #[test]
    fn what_no_output_feels_leaves_the_sum_short() {
        let text = "model P Real a; Real b; output Real y = a;
      equation der(a) = -a; der(b) = a; end P;";
        assert_eq!(codistribution(text).krener_respondek(), [1]);
    }

    /// z' = −z + b c sees c wherever b is not zero, y'' sees it everywhere. y alone shows
    /// nothing of d, z alone all four but not everywhere.
    #[test]
    fn other_indices_are_found_and_those_that_change_sign_are_told() {
        let text = "model P Real a(min = -2, max = 2); Real b(min = -2, max = 2);
      Real c(min = -2, max = 2); Real d(min = -2, max = 2); output Real y = a; output Real z = d;
      equation der(a) = b; der(b) = c; der(c) = -a - 3*b - 3*c; der(d) = -d + b*c; end P;";
        let mut rows = codistribution(text);
        assert_eq!(rows.krener_respondek(), [2, 2]);
        assert_eq!(rows.alternatives(&[2, 2]), [[1, 3], [3, 1], [0, 4]]);
        assert!(rows.changes_sign(&[2, 2]));
        assert!(!rows.changes_sign(&[3, 1]));
    }

    /// Twenty outputs of twenty states: the number of tries is bounded.
    #[test]
    fn many_outputs_are_not_searched_for_ever() {
        let declared: String = (0..20)
            .map(|i| format!("Real x{i}; output Real y{i} = x{i};"))
            .collect();
        let equations: String = (0..20)
            .map(|i| format!("der(x{i}) = x{};", (i + 1) % 20))
            .collect();
        let mut rows = codistribution(&format!("model P {declared} equation {equations} end P;"));
        assert_eq!(rows.krener_respondek(), [1; 20]);
        assert!(rows.alternatives(&[1; 20]).len() < VISITED);
    }
}
