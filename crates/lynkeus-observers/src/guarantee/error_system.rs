//! The error system of an observer on a box: its slopes, the innovations x̂_s − x_s that
//! it reads (of outputs that each show one state s), and where it may have no derivative
//! (kinks, steps and singular ends).

use std::collections::HashMap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{
    Binary, Evaluator, Graph, Interval, MissingInput, Node, Op, Tape, Unary, jacobian,
};
use lynkeus_proof::decay;
use lynkeus_proof::decay::ErrorModel;
use lynkeus_proof::matrix::IntervalMatrix;
use lynkeus_structure::{
    AugmentedPlant, Dimension, Innovation, Region, Slopes, Verdict, range, range_within,
};
use nalgebra::DMatrix;

use super::conditioned::conditioned;
use super::said::{Inequality, Said};
use crate::statement::proved;
use crate::{Assumptions, Check, InputDerivative, Observer, Statement};

/// Cells examined per end of the range of an injection.
const CELLS: usize = 200;

/// e' = A(θ) e with everything that the proofs need.
pub(super) struct ErrorSystem {
    /// estimate, known inputs, measurements, time
    pub region: Region,
    pub slopes: Slopes,
    /// for the proofs: by vertices where these are few
    pub models: Vec<ErrorModel>,
    /// per state: the size that counts as one
    pub scale: Vec<f64>,
    /// bounds of |∂F_i/∂y_j|, one row per state
    pub injection: Vec<Vec<f64>>,
    /// A at x̂ = x, row by row, at a point of `sides`
    pub right: Tape,
    /// A as an expression of estimate, known inputs, measurements and time, row by row
    pub entries: Vec<Node>,
    /// what the observer does where it is right, F(x̂, u, h(x̂))
    pub corrected: Vec<Node>,
    /// estimate (here also the state), known inputs, and time if A depends on it
    pub sides: Region,
}

impl ErrorSystem {
    /// The error system of an observer, or why it has none.
    pub fn new(
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        assumptions: &Assumptions,
    ) -> Result<Result<Self, Said>, MissingInput> {
        if !observer.is_the_estimate(augmented.states.len()) {
            return Ok(Err(Said::OtherStates {
                states: observer.states.len(),
                estimated: augmented.states.len(),
            }));
        }
        let symbols: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
        let region = seen_by(augmented, observer, assumptions)?;
        let slopes = around_innovations(augmented, observer, &symbols, &region)?;
        let mut system = Self::of(augmented, &observer.derivatives, &symbols, region, slopes)?;
        system.injection = injection(augmented, observer, &system.region)?;
        right(augmented, observer, &mut system)?;
        Ok(Ok(system))
    }

    /// The error system of a copy of the plant without correction.
    pub fn open_loop(
        augmented: &AugmentedPlant<'_>,
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let (symbols, derivatives) = (augmented.symbols(), &augmented.derivatives);
        let slopes = Slopes::new(augmented.graph(), derivatives, &symbols, &[], region)?;
        Self::of(augmented, derivatives, &symbols, region.clone(), slopes)
    }

    fn of(
        augmented: &AugmentedPlant<'_>,
        derivatives: &[Node],
        symbols: &[Node],
        region: Region,
        slopes: Slopes,
    ) -> Result<Self, MissingInput> {
        let graph = augmented.graph();
        let jacobian = jacobian::forward(graph, derivatives, symbols);
        let zero = graph.constant(0.0).node();
        let n = symbols.len();
        let entry = |k: usize| jacobian.get(k / n, k % n).unwrap_or(zero);
        let entries: Vec<Node> = (0..n * n).map(entry).collect();
        Ok(Self {
            right: Tape::new(graph, &region.symbols(), &entries)?,
            entries,
            corrected: vec![],
            sides: region.clone(),
            models: expanded(&slopes.models),
            scale: augmented.states.iter().map(size).collect(),
            injection: vec![],
            slopes,
            region,
        })
    }

    pub fn is_bounded(&self) -> bool {
        self.models.iter().all(ErrorModel::is_bounded)
    }

    /// The hypothesis that every slope is bounded.
    pub fn bounded(&self) -> Check {
        let Some((slope, undeclared)) = self.slopes.unbounded(&self.region) else {
            let said = Said::SlopesEnclosed(self.slopes.slopes.len());
            return proved(Inequality::SlopesAreBounded, said);
        };
        let sides = self.region.dimensions.iter();
        let left = sides.filter(|d| slope.variables.contains(&d.name)).cloned();
        let verdict = Verdict::Undecided(left.collect());
        let term = slope.term.clone();
        let said = Said::Unbounded { term, undeclared };
        Statement::from(Inequality::SlopesAreBounded).found(verdict, said)
    }

    /// Whether an entry of A has kinks, jumps or singular ends: |x|, min, √, conditions.
    pub fn is_rough(&self, graph: &Graph) -> bool {
        !edges(graph, &self.entries, &self.region.symbols()).is_empty()
    }

    /// A at x̂ = x, at a point of `sides`, for states in units of `scale`: in other units
    /// rounding may leave no digit of the eigenvalues.
    pub fn at(&self, evaluator: &mut Evaluator, point: &[f64]) -> DMatrix<f64> {
        let n = self.scale.len();
        let mut entries = vec![0.0; n * n];
        evaluator.eval(point, &mut entries);
        let relative = |i: usize, j: usize| self.scale[j] / self.scale[i];
        DMatrix::from_fn(n, n, |i, j| entries[i * n + j] * relative(i, j))
    }

    /// Enclosures of A at x̂ = x for every point of a part of `sides`.
    pub fn enclosed_at(&self, cell: &[Interval]) -> IntervalMatrix {
        let entries = self.right.eval_in(&Intervals, cell);
        let rows = entries.chunks(self.scale.len());
        rows.map(<[Interval]>::to_vec).collect()
    }
}

/// What the system is where the estimate is right: what is measured is then h at the
/// estimate. Derivatives of the inputs are 0 there: the inputs are constant.
fn right(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    system: &mut ErrorSystem,
) -> Result<(), MissingInput> {
    let graph = augmented.graph();
    let measured = readings(augmented, observer);
    let entries = graph.substitute(&system.entries, &measured);
    let corrected = graph.substitute(&observer.derivatives, &measured);
    let mut sides = system.region.clone();
    let read = graph.symbols_of(&entries);
    // a witness tells the time only where time matters
    let counts = |d: &Dimension| read.contains(&d.symbol) || d.symbol != observer.time;
    sides
        .dimensions
        .retain(|d| !measured.contains_key(&d.symbol) && counts(d));
    for side in &mut sides.dimensions {
        let still = |d: &InputDerivative| d.signal.symbol == side.symbol;
        if observer.input_derivatives.iter().any(still) {
            (side.min, side.max) = (0.0, 0.0);
        }
    }
    system.right = Tape::new(graph, &sides.symbols(), &entries)?;
    (system.corrected, system.sides) = (corrected, sides);
    Ok(())
}

/// The box in the observer's symbols, with the ranges of what is measured.
pub(super) fn seen_by(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
) -> Result<Region, MissingInput> {
    let region = &assumptions.region;
    let hats = hats(augmented, observer);
    let mut seen = region.clone();
    for side in &mut seen.dimensions {
        side.symbol = *hats.get(&side.symbol).unwrap_or(&side.symbol);
    }
    let moving = observer.input_derivatives.iter().map(|d| {
        let input = augmented.inputs.iter().position(|u| u.name == d.input);
        let bound = input.map_or(f64::INFINITY, |j| assumptions.input_derivative(j, d.order));
        Dimension::new(&d.signal.name, d.signal.symbol, -bound, bound)
    });
    seen.dimensions.extend(moving);
    for (j, (signal, output)) in observer.measured.iter().zip(&augmented.outputs).enumerate() {
        let values = range(augmented.graph(), output.variable.node, region)?.enclosure;
        let values = values.inflate(assumptions.noise.get(j).copied().unwrap_or(0.0));
        let (low, high) = (values.lo(), values.hi());
        let side = Dimension::new(&signal.name, signal.symbol, low, high);
        seen.dimensions.push(side);
    }
    Ok(seen)
}

/// Bounds of |∂F_i/∂y_j|: how measurement errors reach the estimate.
fn injection(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    region: &Region,
) -> Result<Vec<Vec<f64>>, MissingInput> {
    let graph = augmented.graph();
    let measured: Vec<Node> = observer.measured.iter().map(|m| m.symbol).collect();
    let jacobian = jacobian::forward(graph, &observer.derivatives, &measured);
    let mut bounds = vec![vec![0.0; measured.len()]; observer.states.len()];
    for &(i, j, node) in &jacobian.entries {
        bounds[i][j] = range_within(graph, node, region, CELLS)?
            .enclosure
            .magnitude();
    }
    Ok(bounds)
}

/// The width of the declared range, else the nominal value, else the start's size.
pub(super) fn size(variable: &lynkeus_model::Variable) -> f64 {
    let width = variable.max - variable.min;
    if width.is_finite() && width > 0.0 {
        return width;
    }
    let usable = |x: &f64| x.is_finite() && *x != 0.0;
    let typical = variable
        .nominal
        .filter(usable)
        .or(variable.start.filter(usable));
    typical.map_or(1.0, f64::abs)
}

/// The slopes with the innovations apart: an observer is right where they vanish, whatever its gain is there.
fn around_innovations(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    symbols: &[Node],
    region: &Region,
) -> Result<Slopes, MissingInput> {
    let apart = Apart::new(augmented, observer, region)?;
    let innovations: Vec<Innovation> = apart.read.into_iter().map(|(_, own)| own).collect();
    let graph = augmented.graph();
    Slopes::new(
        graph,
        &apart.derivatives,
        symbols,
        &innovations,
        &apart.region,
    )
}

/// An observer's equations with the innovations h(x̂) − y and x̂_s − x_s(y), in either order, over symbols of their own.
pub(super) struct Apart {
    pub derivatives: Vec<Node>,
    /// of each sensor that shows one state s: its place, and what stands for x̂_s − x_s as it shows it
    pub read: Vec<(usize, Innovation)>,
    /// with a side for each of these symbols
    pub region: Region,
}

impl Apart {
    /// The symbols of the innovations.
    pub fn errors(&self) -> Vec<Node> {
        self.read.iter().map(|(_, own)| own.symbol).collect()
    }

    pub fn new(
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let graph = augmented.graph();
        let hats = hats(augmented, observer);
        let (mut read, mut images) = (vec![], HashMap::new());
        let mut sides = region.clone();
        let sensors = augmented.outputs.iter().zip(&observer.measured);
        for (sensor, (output, signal)) in sensors.enumerate() {
            let Some((state, slope, offset)) = output.state else {
                continue;
            };
            let name = format!("error of {}", augmented.states[state].name);
            let symbol = graph.fresh(&name);
            let [y, slope, offset] = [signal.symbol, slope, offset].map(|node| graph.expr(node));
            let hat = observer.states[state].0.symbol;
            let seen = graph.substitute(&[output.variable.node], &hats)[0];
            let shown = ((y - offset) / slope).node();
            let pairs = [
                (seen, signal.symbol, (slope * symbol).node()),
                (hat, shown, symbol.node()),
            ];
            for (estimate, measured, error) in pairs {
                let forth = graph.binary(Binary::Sub, estimate, measured);
                let back = graph.binary(Binary::Sub, measured, estimate);
                images.insert(forth, error);
                images.insert(back, graph.unary(Unary::Neg, error));
            }
            let symbol = symbol.node();
            read.push((sensor, Innovation { symbol, state }));
            let values = range(graph, hat, region)?.enclosure;
            let size = (Interval::point(values.hi()) - Interval::point(values.lo())).magnitude();
            let size = Some(size).filter(|size| size.is_finite());
            let size = size.unwrap_or(f64::INFINITY);
            let side = Dimension::new(name, symbol, -size, size);
            sides.dimensions.push(side);
        }
        let derivatives = graph.substitute(&observer.derivatives, &images);
        let symbols: Vec<Node> = read
            .iter()
            .map(|(_, own): &(_, Innovation)| own.symbol)
            .collect();
        let (derivatives, further) = conditioned(graph, derivatives, &symbols, &sides)?;
        sides.dimensions.extend(further);
        Ok(Self {
            derivatives,
            read,
            region: sides,
        })
    }
}

/// The plant's states as the observer estimates them.
pub(super) fn hats(augmented: &AugmentedPlant<'_>, observer: &Observer) -> HashMap<Node, Node> {
    let pairs = augmented.states.iter().zip(&observer.states);
    pairs
        .map(|(state, (hat, _))| (state.node, hat.symbol))
        .collect()
}

/// What is measured where the estimate is right: h at the estimate.
pub(super) fn readings(augmented: &AugmentedPlant<'_>, observer: &Observer) -> HashMap<Node, Node> {
    let outputs: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
    let seen = augmented
        .graph()
        .substitute(&outputs, &hats(augmented, observer));
    let signals = observer.measured.iter().map(|m| m.symbol);
    signals.zip(seen).collect()
}

/// Expressions over `moving` that vanish wherever one of the roots may have a kink, a step
/// or an infinite slope in it; where none does, the roots are as smooth as their poles
/// allow. None for roots without such operations.
pub(super) fn edges(graph: &Graph, roots: &[Node], moving: &[Node]) -> Vec<Node> {
    let found = graph.reachable(&graph.with_residuals(roots)).into_iter();
    let found = found.filter_map(|node| edge(graph, node));
    let mut found: Vec<Node> = found
        .filter(|edge| {
            let read = graph.symbols_of(&[*edge]);
            moving.iter().any(|symbol| read.contains(symbol))
        })
        .collect();
    found.sort();
    found.dedup();
    found
}

fn edge(graph: &Graph, node: Node) -> Option<Node> {
    let expr = |node: Node| graph.expr(node);
    match graph.op(node) {
        Op::Unary(Unary::Abs | Unary::Sign | Unary::Sqrt, a) => Some(a),
        Op::Unary(Unary::Floor, a) => Some((expr(a) - expr(node)).node()),
        Op::Binary(op, a, b) => match op {
            Binary::Min | Binary::Max | Binary::Less | Binary::LessEq | Binary::Equal => {
                Some((expr(a) - expr(b)).node())
            }
            Binary::Pow => match graph.constant_value(b) {
                Some(power) if power >= 0.0 && power.fract() == 0.0 => None,
                _ => Some(a),
            },
            // the cut: y = 0 with x ≤ 0
            Binary::Atan2 => {
                let (y, x) = (expr(a), expr(b));
                Some((x + (x * x + y * y).sqrt()).node())
            }
            _ => None,
        },
        // where the equations of a loop do not determine it
        Op::System(_) => {
            let call = graph.system(node)?;
            call.function()?;
            let matrix = call.matrix(graph, node);
            match matrix[..] {
                [slope] => Some(slope),
                _ => {
                    let zero = graph.constant(0.0).node();
                    let right = vec![zero; call.size()];
                    Some(graph.solve(&matrix, &right).rcond)
                }
            }
        }
        _ => None,
    }
}

/// Vertices up to which slopes are taken by their ends instead of by multipliers.
const VERTICES: usize = 32;

/// The models by their vertices where these are few.
pub(super) fn expanded(models: &[ErrorModel]) -> Vec<ErrorModel> {
    decay::expanded(models, VERTICES)
}
