//! What the theorems of several families share: how steep the equations are on the box, bounds
//! of expressions and of matrices of them (outward rounded), and the conclusion.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};

use lynkeus_expr::{Binary, Call, Graph, Interval, MissingInput, Node, Op, Unary, jacobian};
use lynkeus_proof::chain::{Slope, Ultimate};
use lynkeus_proof::inverse::Inverse;
use lynkeus_proof::magnitude::{norm, plus, product, size, times};
use lynkeus_proof::matrix::IntervalMatrix;
use lynkeus_structure::{
    AugmentedPlant, Dimension, Matrix, Region, Standing, Verdict, enclosure_within,
    magnitude_within, range,
};

use crate::statement::proved;
use crate::{Assumptions, Bounds, Certificate, Check, Constant, DesignError, Reason, Statement};

/// Upper bounds of the entries of ∂f/∂x that can differ from zero, with the
/// hypothesis that all are finite; `skip` leaves out entries that are not needed.
pub(crate) fn slopes(
    augmented: &AugmentedPlant<'_>,
    region: &Region,
    skip: impl Fn(usize, usize) -> bool,
) -> Result<(Vec<Slope>, Check), DesignError> {
    let graph = augmented.graph();
    let symbols = augmented.symbols();
    let jacobian = jacobian::forward(graph, &augmented.derivatives, &symbols);
    let name = |i: usize| augmented.states[i].name.clone();
    let shown = |node: Option<Node>| node.map_or_else(String::new, |n| graph.render(n, 60));
    // the first entry without a bound, and what all of these read
    let (mut first, mut open, mut found) = (None, vec![], vec![]);
    for row in 0..symbols.len() {
        let jump = jump(graph, augmented.derivatives[row], &symbols);
        // a jump spoils the whole equation, its skipped entries too
        if jump.is_some() {
            first.get_or_insert_with(|| Reason::Switches {
                of: name(row),
                with: shown(jump),
            });
            open.extend(jump);
        }
        for &column in augmented.pattern[row].iter().filter(|&&b| !skip(row, b)) {
            let node = jacobian.get(row, column);
            let size = match (jump, node) {
                (Some(_), _) => f64::INFINITY,
                (None, Some(node)) => magnitude(graph, node, region)?,
                (None, None) => 0.0,
            };
            if size.is_infinite() && jump.is_none() {
                first.get_or_insert_with(|| Reason::Unbounded {
                    of: name(row),
                    by: name(column),
                    slope: shown(node),
                    undeclared: Some(vec![]),
                });
                open.extend(node);
            }
            found.push(Slope { row, column, size });
        }
    }
    let statement = Statement::SlopesOfTheProof;
    let Some(mut reason) = first else {
        let enclosed = Reason::Enclosed(found.len());
        return Ok((found, proved(statement, enclosed)));
    };
    if let Reason::Unbounded { undeclared, .. } = &mut reason {
        *undeclared = Some(self::undeclared(augmented, &open, region));
    }
    let place = region.restricted(&graph.symbols_of(&open)).dimensions;
    Ok((found, statement.found(Verdict::Undecided(place), reason)))
}

/// Upper bound of |node| on the region; infinite where there is none, or where
/// the expression is not defined everywhere.
pub(crate) fn magnitude(graph: &Graph, node: Node, region: &Region) -> Result<f64, DesignError> {
    let found = range(graph, node, region)?;
    let size = found.enclosure.hi().max(-found.enclosure.lo());
    Ok(match found.enclosure.is_defined() && size.is_finite() {
        true => size,
        false => f64::INFINITY,
    })
}

/// Variables of the expressions that have no declared end.
pub(crate) fn undeclared(
    augmented: &AugmentedPlant<'_>,
    nodes: &[Node],
    region: &Region,
) -> Vec<String> {
    open_sides(augmented.graph(), nodes, augmented.plant.time, region)
}

fn open_sides(graph: &Graph, nodes: &[Node], time: Node, region: &Region) -> Vec<String> {
    let sides = region.restricted(&graph.symbols_of(nodes)).dimensions;
    let is_open = |d: &Dimension| !(d.min.is_finite() && d.max.is_finite());
    let open = sides.into_iter().filter(|d| d.symbol != time && is_open(d));
    open.map(|d| d.name).collect()
}

/// An operation that jumps where a state passes through a value.
fn jump(graph: &Graph, f: Node, states: &[Node]) -> Option<Node> {
    let depends = |node: Node| !jacobian::pattern(graph, &[node], states)[0].is_empty();
    let mut nodes = graph.reachable(&[f]).into_iter();
    nodes.find(|&node| graph.jumps(node) && depends(node))
}

/// Bounds of the error of the states that the outputs show: that of the output
/// divided by the least slope.
pub(crate) fn state_noise(
    augmented: &AugmentedPlant<'_>,
    region: &Region,
    noise: &[f64],
) -> Result<Vec<f64>, DesignError> {
    let mut found = vec![];
    for (i, output) in augmented.outputs.iter().enumerate() {
        let bound = noise.get(i).copied().unwrap_or(f64::INFINITY);
        let Some((_, slope, _)) = output.state else {
            found.push(f64::INFINITY);
            continue;
        };
        let least = range(augmented.graph(), slope, region)?
            .enclosure
            .mignitude();
        found.push(match bound == 0.0 {
            true => 0.0,
            false => (Interval::point(bound) / Interval::point(least)).hi(),
        });
    }
    Ok(found)
}

/// How much the gain may differ from the computed one, relatively: rounding of
/// the powers of θ in the observer.
const GAIN_ERROR: f64 = 1e-12;

/// Gains as far as the observer's may differ from them.
pub(crate) fn as_computed(gains: impl IntoIterator<Item = f64>) -> Vec<Interval> {
    let error = Interval::new(1.0 - GAIN_ERROR, 1.0 + GAIN_ERROR).unwrap_or(Interval::ONE);
    let gains = gains.into_iter();
    gains.map(|gain| Interval::point(gain) * error).collect()
}

/// Whether the partial ∂f_row/∂x_column is one along the chain.
pub(crate) fn is_along(chain: &[usize], row: usize, column: usize) -> bool {
    chain.windows(2).any(|pair| pair == [row, column])
}

/// Fills in what the rate σ guarantees, where every hypothesis holds; `of` has the bounds that it leaves
/// for the densities of process noise, by augmented state.
pub(crate) fn conclude(
    certificate: &mut Certificate,
    augmented: &AugmentedPlant<'_>,
    σ: f64,
    assumptions: &Assumptions,
    of: impl Fn(&[f64]) -> Result<Option<Ultimate>, DesignError>,
) -> Result<(), DesignError> {
    if certificate.verdict() != Standing::Proved {
        return Ok(());
    }
    let ultimate = of(&vec![0.0; augmented.states.len()])?;
    if assumptions.is_moved() {
        certificate.mean_square =
            of(&assumptions.process_noise)?.and_then(|u| bounds(augmented, u));
    }
    let mut constant = |name: &str, value: f64, meaning: &str| {
        certificate
            .constants
            .push(Constant::new(name, value, meaning));
    };
    constant(
        "σ",
        σ,
        "decay rate of the error at the study's θ, 1/time unit",
    );
    if let Some(found) = &ultimate {
        constant(
            "λ1",
            found.overshoot,
            "overshoot: |e(t)| ≤ λ1 e^(−σt) |e(0)| + ultimate bound",
        );
        let gain = (Interval::point(found.overshoot) / Interval::point(σ)).hi();
        constant(
            "λ2",
            gain,
            "λ1/σ: error as t → ∞ per unit of drift, in Euclidean norms",
        );
    }
    certificate.rate = Some(σ);
    certificate.overshoot = ultimate.as_ref().map(|found| found.overshoot);
    match ultimate.and_then(|found| bounds(augmented, found)) {
        Some(bounds) => {
            certificate.ultimate_bound = Some(bounds.norm);
            certificate.ultimate = bounds.states;
        }
        None => certificate.notes.push(Reason::NoUltimateBound),
    }
    Ok(())
}

/// In the order of the states, whatever that of the chains is; none that are infinite.
fn bounds(augmented: &AugmentedPlant<'_>, found: Ultimate) -> Option<Bounds> {
    let mut states = found.states;
    states.sort_unstable_by_key(|(i, _)| *i);
    let name = |(i, bound): (usize, f64)| (augmented.states[i].name.clone(), bound).into();
    let states = states.into_iter().map(name).collect();
    let norm = found.norm;
    norm.is_finite().then_some(Bounds { norm, states })
}

/// Cells examined per end of the range of an entry.
const CELLS: usize = 600;

/// How many times as large as a value that was met a bound may be before the expression's parts are bounded, too.
const LOOSE: f64 = 2.0;

/// A box with what was found to be unbounded on it.
pub(crate) struct Enclosure<'g> {
    graph: &'g Graph,
    time: Node,
    region: Region,
    open: RefCell<BTreeSet<String>>,
    /// largest absolute values, found once for every part that expressions share
    sizes: RefCell<HashMap<Node, f64>>,
}

impl<'g> Enclosure<'g> {
    pub fn new(augmented: &AugmentedPlant<'g>, region: &Region) -> Self {
        Self {
            graph: augmented.graph(),
            time: augmented.plant.time,
            region: region.clone(),
            open: RefCell::default(),
            sizes: RefCell::default(),
        }
    }

    /// The box with everything added.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// A further variable, bounded by `size` in absolute value.
    pub fn within(&mut self, name: impl Into<String>, size: f64) -> Node {
        let name = name.into();
        let symbol = self.graph.fresh(&name).node();
        self.add(name, symbol, -size, size);
        symbol
    }

    /// A further variable of the box.
    pub fn add(&mut self, name: String, symbol: Node, min: f64, max: f64) {
        self.sizes.get_mut().clear();
        let side = Dimension::new(name, symbol, min, max);
        self.region.dimensions.push(side);
    }

    /// The side of a variable; the whole line where the box has none.
    pub fn side(&self, symbol: Node) -> (f64, f64) {
        let mut sides = self.region.dimensions.iter();
        sides
            .find(|d| d.symbol == symbol)
            .map_or((f64::NEG_INFINITY, f64::INFINITY), |d| (d.min, d.max))
    }

    /// Variables without bounds that kept something from being bounded, or the
    /// expression itself where every variable has bounds.
    pub fn open(&self) -> Vec<String> {
        self.open.borrow().iter().cloned().collect()
    }

    /// Smallest and largest value.
    pub fn range(&self, node: Node) -> Result<(f64, f64), MissingInput> {
        let found = enclosure_within(self.graph, node, &self.region, CELLS)?;
        let bounds = (found.lo(), found.hi());
        if bounds.0.is_finite() && bounds.1.is_finite() {
            return Ok(bounds);
        }
        let size = self.of_parts(node)?;
        if !size.is_finite() {
            self.note(node);
        }
        Ok((-size, size))
    }

    /// Largest absolute value.
    pub fn magnitude(&self, node: Node) -> Result<f64, MissingInput> {
        let whole = magnitude_within(self.graph, node, &self.region, CELLS)?;
        let size = match whole.bound <= LOOSE * whole.attained {
            true => whole.bound,
            false => whole.bound.min(self.of_parts(node)?),
        };
        if !size.is_finite() {
            self.note(node);
        }
        Ok(size)
    }

    /// Where the whole is too hard, its factors and terms one by one.
    fn of_parts(&self, node: Node) -> Result<f64, MissingInput> {
        let part = |node: Node| self.magnitude_of(node);
        Ok(match self.graph.op(node) {
            Op::Unary(Unary::Neg, a) => part(a)?,
            Op::Binary(Binary::Add | Binary::Sub, a, b) => plus(part(a)?, part(b)?),
            Op::Binary(Binary::Mul, a, b) => times(part(a)?, part(b)?),
            Op::Powi(a, n) if n > 0 => size(part(a)?).powi(n).hi(),
            Op::Entry(system, i) => self.of_solution(node, system, i as usize)?,
            _ => f64::INFINITY,
        })
    }

    /// |x_i| ≤ Σ_j |(A⁻¹)_ij| |b_j| for an entry of the solution of A x = b.
    fn of_solution(&self, node: Node, system: Node, i: usize) -> Result<f64, MissingInput> {
        let call = self.graph.system(system);
        let Some((A, b)) = call.as_ref().and_then(Call::linear) else {
            return Ok(f64::INFINITY);
        };
        let n = b.len();
        let number = |one: bool| self.graph.constant(f64::from(u8::from(one))).node();
        let mut sum = 0.0;
        for (j, &b) in b.iter().enumerate() {
            let unit: Vec<Node> = (0..n).map(|k| number(k == j)).collect();
            let entry = self.graph.solve(A, &unit).x.get(i).copied();
            let size = match entry {
                // it is such an entry itself
                Some(entry) if entry != node => {
                    let inverse = magnitude_within(self.graph, entry, &self.region, CELLS)?;
                    times(inverse.bound, self.magnitude_of(b)?)
                }
                _ => f64::INFINITY,
            };
            sum = plus(sum, size);
        }
        Ok(if n == 0 { f64::INFINITY } else { sum })
    }

    /// The largest absolute value, of which nothing is noted where there is none.
    fn magnitude_of(&self, node: Node) -> Result<f64, MissingInput> {
        if let Some(known) = self.sizes.borrow().get(&node) {
            return Ok(*known);
        }
        let whole = magnitude_within(self.graph, node, &self.region, CELLS)?;
        let size = match whole.bound.is_finite() {
            true => whole.bound,
            false => self.of_parts(node)?,
        };
        self.sizes.borrow_mut().insert(node, size);
        Ok(size)
    }

    fn note(&self, node: Node) {
        let names = open_sides(self.graph, &[node], self.time, &self.region);
        let mut noted = self.open.borrow_mut();
        match names.is_empty() {
            true => {
                noted.insert(self.graph.render(node, 60));
            }
            false => noted.extend(names),
        }
    }

    /// Bounds of the absolute values of the entries.
    pub fn magnitudes(&self, A: &Matrix<'_>) -> Result<Vec<Vec<f64>>, MissingInput> {
        let entry = |i, j| A.get(i, j).map_or(Ok(0.0), |node| self.magnitude(node));
        let row = |i| (0..A.columns).map(|j| entry(i, j)).collect();
        (0..A.rows).map(row).collect()
    }

    /// A bound of the spectral norm.
    pub fn norm(&self, A: &Matrix<'_>) -> Result<f64, MissingInput> {
        Ok(norm(&self.magnitudes(A)?))
    }

    /// What is known of Ã⁻¹ for every Ã whose entries lie in the ranges of those of
    /// the square matrix A, such as a mean of A along a line; none where none could
    /// be found.
    pub fn inverse(&self, A: &Matrix<'_>) -> Result<Option<Inverse>, MissingInput> {
        if A.rows != A.columns {
            return Ok(None);
        }
        let entry = |i, j| match A.get(i, j) {
            Some(node) => {
                let (low, high) = self.range(node)?;
                Ok(Interval::new(low, high).unwrap_or(Interval::ENTIRE))
            }
            None => Ok(Interval::ZERO),
        };
        let row = |i: usize| (0..A.columns).map(|j| entry(i, j)).collect();
        let ranges: Result<IntervalMatrix, MissingInput> = (0..A.rows).map(row).collect();
        Ok(Inverse::of(&ranges?))
    }

    /// Bounds of the entries of B̃ Ã⁻¹ for means of B and A along the same line.
    pub fn divided(&self, B: &Matrix<'_>, A: &Inverse) -> Result<Vec<Vec<f64>>, MissingInput> {
        let n = A.R.nrows();
        let R = Matrix::from_fn(self.graph, (n, n), |i, j| {
            Some(self.graph.constant(A.R[(i, j)]).node())
        });
        Ok(product(&self.magnitudes(&B.times(&R))?, &A.N))
    }

    /// A bound of ‖Ã⁻¹‖, infinite where none could be found.
    pub fn inverse_norm(&self, A: &Matrix<'_>) -> Result<f64, MissingInput> {
        let found = self.inverse(A)?;
        Ok(found.map_or(f64::INFINITY, |inverse| norm(&inverse.bounds())))
    }
}
