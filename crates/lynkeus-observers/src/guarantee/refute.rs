//! The search for a point of the box at which the error's Jacobian is not stable, and for
//! what such a point shows.
//!
//! No quadratic form eᵀPe decays for the whole box where a Jacobian A in it is not stable.
//! That alone makes no error grow: along a trajectory A changes, and neither do stable
//! instants make a stable whole, nor unstable ones an unstable one. The error grows for
//! certain where A is the same whatever the plant does, and where the plant can rest.
//!
//! Where the plant rests at x* under constant inputs, a small error obeys
//! e' = A e + o(|e|) with a constant A: an eigenvalue with a positive real part takes
//! errors that start as small as one likes to a distance that does not depend on their
//! start. That x* exists is proved: by values of f that are exactly 0, or by Krawczyk's test
//! (Krawczyk 1969), in which as many coordinates as there are equations move and the
//! others, inputs among them, are numbers.

use std::cmp::Ordering;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::decay::is_unstable;
use lynkeus_proof::spectrum;
use lynkeus_structure::{AugmentedPlant, Dimension, Point};
use nalgebra::{DMatrix, DVector};

use super::error_system::{ErrorSystem, edges};
use super::said::{Inequality, Said};
use crate::statement::refuted;
use crate::{Check, Observer};

/// Points tried before the search climbs from the best of them.
const POINTS: usize = 400;

/// Halvings of the step while climbing.
const HALVINGS: usize = 12;

/// Distance from the ends, relative to a side, where slopes may have kinks there.
const INSET: f64 = 1e-4;

const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// What the search found.
pub(super) struct Sample {
    /// the slowest decay over the points examined, in floating point; none where that of a
    /// point is not found
    pub slowest: Option<f64>,
    /// no rate above this can be proved by one quadratic form
    pub limit: f64,
    /// where the decay is slowest, of the points where it is found, and the largest real part
    /// of an eigenvalue there: −∞ where it is found nowhere
    pub worst: Point,
    /// an eigenvalue there is proved to have a positive real part
    pub unstable: bool,
}

/// The worst point that a deterministic search finds.
pub(super) fn worst(graph: &Graph, system: &ErrorSystem) -> Sample {
    let sides = system.sides.dimensions.iter().map(finite);
    let sides: Vec<Dimension> = match system.is_rough(graph) {
        true => sides.enumerate().map(inner).collect(),
        false => sides.collect(),
    };
    let mut evaluator = system.right.evaluator();
    let mut skipped = false;
    let mut abscissa = |point: &[f64]| {
        let found = spectrum::abscissa(system.at(&mut evaluator, point));
        skipped |= found.is_none();
        found
    };
    let (mut best, mut highest) = (spread(&sides, 0), f64::NEG_INFINITY);
    for index in 0..POINTS {
        let point = spread(&sides, index);
        if let Some(abscissa) = abscissa(&point)
            && abscissa > highest
        {
            (best, highest) = (point, abscissa);
        }
    }
    if highest.is_finite() {
        let moves = |side: &Dimension| !side.integer && side.min != side.max;
        (highest, best) = climbed(&sides, HALVINGS, moves, (highest, best), |point| {
            Some((abscissa(&point)?, point))
        });
    }
    let cell: Vec<Interval> = best.iter().map(|&x| Interval::point(x)).collect();
    // the mean of all real parts is no higher than the highest, and no matter of rounding
    let mean = system.at(&mut evaluator, &best).trace() / system.scale.len() as f64;
    Sample {
        slowest: (!skipped).then_some(-highest),
        limit: match highest < 0.0 && highest.is_finite() {
            true => -highest,
            false => -mean,
        },
        unstable: highest > 0.0 && is_unstable(&system.enclosed_at(&cell)),
        worst: Point {
            coordinates: system.sides.coordinates(&best),
            value: highest,
        },
    }
}

/// What shows that the error does not decay, if anything does.
pub(super) fn growing(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    system: &ErrorSystem,
    sample: &Sample,
) -> Result<Option<Check>, MissingInput> {
    if sample.worst.value < 0.0 {
        return Ok(None);
    }
    if sample.unstable && is_constant(augmented, observer, system) {
        let point = sample.worst.clone();
        let check = refuted(Inequality::SmallErrorsDecay, point, Said::GrowsEverywhere);
        return Ok(Some(check));
    }
    let found = repelling(augmented, observer, system)?;
    Ok(found.map(|point| refuted(Inequality::SmallErrorsDecay, point, Said::Repelling)))
}

/// Whether e' = A e with an A that reads nothing. One that a known input moves refutes nothing by
/// its worst value: the plant need not stay in the box while the input keeps that value.
fn is_constant(augmented: &AugmentedPlant<'_>, observer: &Observer, system: &ErrorSystem) -> bool {
    let graph = augmented.graph();
    let read = graph.symbols_of(&system.entries);
    let hats: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    read.is_empty() && edges(graph, &observer.derivatives, &hats).is_empty()
}

/// A side of the box with infinite ends replaced by large ones.
pub(super) fn finite(side: &Dimension) -> Dimension {
    let min = match side.min.is_finite() {
        true => side.min,
        false => side.max.min(1.0) - 2.0,
    };
    let max = match side.max.is_finite() {
        true => side.max,
        false => min.max(-1.0) + 2.0,
    };
    let max = max.max(min);
    Dimension {
        min,
        max,
        ..side.clone()
    }
}

/// The side without its ends and with another middle: a kink there, as of |x| at 0, has
/// no slope, and that of one side need not be met in the box.
fn inner((i, side): (usize, Dimension)) -> Dimension {
    if side.integer {
        return side;
    }
    let cut = INSET * (1.0 + (i as f64 * GOLDEN).fract()) * (side.max - side.min);
    Dimension {
        min: side.min + cut,
        max: side.max - 0.5 * cut,
        ..side
    }
}

/// The middle, corners and points between, spread by irrational steps.
pub(super) fn spread(sides: &[Dimension], index: usize) -> Vec<f64> {
    let place = |i: usize| match index {
        0 => 0.5,
        _ if index % 2 == 1 => ((index * (i + 1)) as f64 * GOLDEN + i as f64 * 0.37)
            .fract()
            .round(),
        _ => {
            let step = ((i + 2) as f64).sqrt().fract();
            (index as f64 * step + 0.5 * i as f64).fract()
        }
    };
    let sides = sides.iter().enumerate();
    sides
        .map(|(i, side)| {
            // low + (high − low) may be above high by rounding
            let x = (side.min + place(i) * (side.max - side.min)).min(side.max);
            if side.integer { x.round() } else { x }
        })
        .collect()
}

/// Coordinate by coordinate to a worse point, with ever smaller steps: of those that move, to what is
/// found near the next place.
fn climbed(
    sides: &[Dimension],
    halvings: usize,
    moves: impl Fn(&Dimension) -> bool,
    mut best: (f64, Vec<f64>),
    mut found: impl FnMut(Vec<f64>) -> Option<(f64, Vec<f64>)>,
) -> (f64, Vec<f64>) {
    let mut step = 0.5;
    for _ in 0..halvings {
        for (i, side) in sides.iter().enumerate().filter(|(_, side)| moves(side)) {
            for step in [-step, step] {
                let mut next = best.1.clone();
                next[i] = (next[i] + step * (side.max - side.min)).clamp(side.min, side.max);
                if side.integer {
                    next[i] = next[i].round();
                }
                if let Some(next) = found(next)
                    && next.0 > best.0
                {
                    best = next;
                }
            }
        }
        step *= 0.5;
    }
    best
}

/// Points from which an equilibrium is sought.
const STARTS: usize = 120;

/// Equilibria whose existence is examined.
const EXAMINED: usize = 6;

/// Steps of Newton's method.
const STEPS: usize = 40;

/// A step below this, relative to the sides, ends it.
const STILL: f64 = 1e-10;

/// Halvings of the step along the equilibria.
const EQUILIBRIUM_HALVINGS: usize = 6;

/// Distance of an equilibrium from the ends of the box, relative to a side.
const EQUILIBRIUM_INSET: f64 = 1e-3;

/// Radii of Krawczyk's test, relative to the sides.
const RADII: [f64; 4] = [1e-11, 1e-9, 1e-7, 1e-5];

/// Singular values below this share of the largest count as none.
const RANK: f64 = 1e-11;

/// An equilibrium inside the box that is proved to exist and to repel the estimate; the
/// value is the largest real part of an eigenvalue of A there, in floating point.
pub(super) fn repelling(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    system: &ErrorSystem,
) -> Result<Option<Point>, MissingInput> {
    let Some(mut search) = EquilibriumSearch::new(augmented, observer, system)? else {
        return Ok(None);
    };
    let starts = (0..STARTS).map(|index| spread(&search.sides, index));
    let starts: Vec<Vec<f64>> = starts.collect();
    let mut found: Vec<(f64, Vec<f64>)> = vec![];
    for start in starts {
        found.extend(search.settled(start));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    if let Some(best) = found.first().cloned()
        && best.0 <= 0.0
    {
        // along the equilibria to one that repels more
        let sides = search.sides.clone();
        let settled = |z| search.settled(z);
        let all = |_: &Dimension| true;
        found.insert(0, climbed(&sides, EQUILIBRIUM_HALVINGS, all, best, settled));
    }
    let growing = found.iter().filter(|(value, _)| *value > 0.0);
    let confirmed = growing
        .take(EXAMINED)
        .find_map(|(_, z)| search.confirmed(z));
    Ok(confirmed)
}

struct EquilibriumSearch<'a> {
    system: &'a ErrorSystem,
    right: Evaluator,
    /// f, without the equations that are 0 everywhere, over states and inputs
    plant: Tape,
    /// its Jacobian, row by row
    slopes: Tape,
    /// what must not vanish, then what must be defined, over the sides of the system
    smooth: Tape,
    edges: usize,
    sides: Vec<Dimension>,
    states: usize,
}

/// A box around an equilibrium.
struct Around {
    /// f has no other zero in it
    tested: Vec<Interval>,
    /// holds the equilibrium
    cell: Vec<Interval>,
}

impl<'a> EquilibriumSearch<'a> {
    /// None where something moves with time, or a state cannot move at all.
    fn new(
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        system: &'a ErrorSystem,
    ) -> Result<Option<Self>, MissingInput> {
        let graph = augmented.graph();
        let states = augmented.states.len();
        let mut symbols = augmented.symbols();
        symbols.extend(augmented.inputs.iter().map(|u| u.node));
        let mut equations = augmented.derivatives.clone();
        equations.sort();
        equations.dedup();
        equations.retain(|f| graph.constant_value(*f) != Some(0.0));
        let moved = graph.symbols_of(&[&equations[..], &system.corrected[..]].concat());
        let still = !moved.contains(&augmented.plant.time) && !moved.contains(&observer.time);
        let sides = sides(system, symbols.len());
        let wide = sides
            .iter()
            .take(states)
            .all(|s| s.max > s.min && !s.integer);
        if !still || !wide || sides.len() != symbols.len() {
            return Ok(None);
        }
        let jacobian = jacobian::forward(graph, &equations, &symbols);
        let zero = graph.constant(0.0).node();
        let entry = |k: usize| {
            let place = (k / symbols.len(), k % symbols.len());
            jacobian.get(place.0, place.1).unwrap_or(zero)
        };
        let entries: Vec<Node> = (0..equations.len() * symbols.len()).map(entry).collect();
        let hats: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
        let pairs = augmented.symbols().into_iter().zip(hats.iter().copied());
        let mut values = graph.substitute(&equations, &pairs.collect());
        values.extend(&system.corrected);
        let mut smooth = edges(graph, &values, &hats);
        let edges = smooth.len();
        smooth.extend(values);
        Ok(Some(Self {
            system,
            right: system.right.evaluator(),
            plant: Tape::new(graph, &symbols, &equations)?,
            slopes: Tape::new(graph, &symbols, &entries)?,
            smooth: Tape::new(graph, &system.sides.symbols(), &smooth)?,
            edges,
            sides,
            states,
        }))
    }

    fn width(&self, i: usize) -> f64 {
        self.sides[i].max - self.sides[i].min
    }

    /// A point of the sides of the system: derivatives of the inputs are 0.
    fn full<T: Copy>(&self, z: &[T], zero: T) -> Vec<T> {
        let mut full = z.to_vec();
        full.resize(self.system.sides.dimensions.len(), zero);
        full
    }

    /// The largest real part of an eigenvalue at an equilibrium near `z` inside the box,
    /// found by Newton's method, and the equilibrium.
    fn settled(&mut self, mut z: Vec<f64>) -> Option<(f64, Vec<f64>)> {
        let (rows, columns) = (self.plant.outputs(), z.len());
        let (mut plant, mut slopes) = (self.plant.evaluator(), self.slopes.evaluator());
        let (mut f, mut J) = (vec![0.0; rows], vec![0.0; rows * columns]);
        let mut step = 0.0;
        for _ in 0..if rows == 0 { 0 } else { STEPS } {
            plant.eval(&z, &mut f);
            slopes.eval(&z, &mut J);
            if !f.iter().chain(&J).all(|x| x.is_finite()) {
                return None;
            }
            let widths = |j: usize| match self.sides[j].integer {
                true => 0.0,
                false => self.width(j),
            };
            let scaled = DMatrix::from_fn(rows, columns, |i, j| J[i * columns + j] * widths(j));
            let norms: Vec<f64> = (0..rows)
                .map(|i| scaled.row(i).norm().max(f64::MIN_POSITIVE))
                .collect();
            let scaled = DMatrix::from_fn(rows, columns, |i, j| scaled[(i, j)] / norms[i]);
            let right = DVector::from_fn(rows, |i, _| f[i] / norms[i]);
            // beside a pole values may overflow
            if !right.iter().all(|x| x.is_finite()) {
                return None;
            }
            let svd = spectrum::singular(scaled, true, true)?;
            let least = RANK * svd.singular_values.max();
            let found = svd.solve(&right, least).ok()?;
            step = found.amax();
            for j in 0..columns {
                let next = z[j] - widths(j) * found[j];
                z[j] = next.clamp(self.sides[j].min, self.sides[j].max);
            }
            if step < STILL * 1e-4 {
                break;
            }
        }
        let value = self.abscissa(&z)?;
        (step < STILL).then_some((value, z))
    }

    fn abscissa(&mut self, z: &[f64]) -> Option<f64> {
        let full = self.full(z, 0.0);
        spectrum::abscissa(self.system.at(&mut self.right, &full))
    }

    /// The equilibrium near z, if it is proved to exist, inside the box, with a smooth
    /// right-hand side around it and an eigenvalue to the right of the axis.
    fn confirmed(&mut self, z: &[f64]) -> Option<Point> {
        let Around { tested, cell } = self.exact(z).or_else(|| self.enclosed(z))?;
        let inside = |i: usize| {
            let side = &self.system.sides.dimensions[i];
            let strict = i < self.states;
            let (low, high) = (tested[i].lo(), tested[i].hi());
            match strict {
                true => side.min < low && high < side.max,
                false => side.min <= low && high <= side.max,
            }
        };
        let A = self.system.enclosed_at(&self.full(&cell, Interval::ZERO));
        let sure = (0..cell.len()).all(inside) && self.is_smooth(&tested) && is_unstable(&A);
        if !sure {
            return None;
        }
        let middle: Vec<f64> = cell.iter().map(|x| x.midpoint()).collect();
        let value = self.abscissa(&middle)?;
        let full = self.full(&middle, 0.0);
        Some(Point {
            coordinates: self.system.sides.coordinates(&full),
            value,
        })
    }

    fn is_smooth(&self, cell: &[Interval]) -> bool {
        let cell = self.full(cell, Interval::ZERO);
        let values = self.smooth.eval_in(&Intervals, &cell);
        let (edges, _) = values.split_at(self.edges);
        values.iter().all(|x| x.is_bounded()) && !edges.iter().any(|x| x.contains_zero())
    }

    /// A point of few digits where f is exactly 0.
    fn exact(&self, z: &[f64]) -> Option<Around> {
        let rounded = |i: usize| {
            let width = self.width(i);
            let digits = 10f64.powf(6.0 - width.log10().floor());
            let x = (z[i] * digits).round() / digits;
            match x.is_finite() && !self.sides[i].integer {
                true => x.clamp(self.sides[i].min, self.sides[i].max),
                false => z[i],
            }
        };
        let point: Vec<f64> = (0..z.len()).map(rounded).collect();
        let cell: Vec<Interval> = point.iter().map(|&x| Interval::point(x)).collect();
        let f = self.plant.eval_in(&Intervals, &cell);
        let zero = |f: &Interval| f.is_defined() && f.lo() == 0.0 && f.hi() == 0.0;
        let around = |i: usize| match i < self.states {
            true => cell[i].inflate(RADII[0] * self.width(i)),
            false => cell[i],
        };
        let tested = (0..z.len()).map(around).collect();
        f.iter().all(zero).then_some(Around { tested, cell })
    }

    /// Krawczyk's test around z.
    fn enclosed(&self, z: &[f64]) -> Option<Around> {
        let (rows, columns) = (self.plant.outputs(), z.len());
        let mut J = vec![0.0; rows * columns];
        self.slopes.evaluator().eval(z, &mut J);
        let J = DMatrix::from_row_slice(rows, columns, &J);
        let movable = |j: usize| match self.sides[j].integer {
            true => 0.0,
            false => self.width(j),
        };
        let places = pivots(DMatrix::from_fn(rows, columns, |i, j| {
            J[(i, j)] * movable(j)
        }))?;
        let R = J.select_columns(&places).try_inverse()?;
        let point: Vec<Interval> = z.iter().map(|&x| Interval::point(x)).collect();
        let f = self.plant.eval_in(&Intervals, &point);
        RADII.iter().find_map(|radius| {
            let mut tested = point.clone();
            for &j in &places {
                tested[j] = point[j].inflate(radius * self.width(j));
            }
            let slopes = self.slopes.eval_in(&Intervals, &tested);
            let slope = |i: usize, b: usize| slopes[i * columns + places[b]];
            let mut cell = point.clone();
            for (a, &j) in places.iter().enumerate() {
                let weight = |b: usize| Interval::point(R[(a, b)]);
                let mut image = (0..rows).fold(point[j], |sum, b| sum - weight(b) * f[b]);
                for (b, &k) in places.iter().enumerate() {
                    let unit = if a == b {
                        Interval::ONE
                    } else {
                        Interval::ZERO
                    };
                    let rest = (0..rows).fold(unit, |sum, i| sum - weight(i) * slope(i, b));
                    image = image + rest * (tested[k] - point[k]);
                }
                let inside = tested[j].lo() < image.lo() && image.hi() < tested[j].hi();
                if !inside || !image.is_defined() {
                    return None;
                }
                cell[j] = image;
            }
            Some(Around { tested, cell })
        })
    }
}

/// States, a little inside of the box, and inputs.
fn sides(system: &ErrorSystem, count: usize) -> Vec<Dimension> {
    let dimensions = system.sides.dimensions.iter().take(count);
    let states = system.scale.len();
    let sides = dimensions.map(finite).enumerate();
    sides
        .map(|(i, side)| {
            let cut = match i < states {
                true => EQUILIBRIUM_INSET * (side.max - side.min),
                false => 0.0,
            };
            Dimension {
                min: side.min + cut,
                max: side.max - cut,
                ..side
            }
        })
        .collect()
}

/// As many columns as there are rows, those of a well conditioned square matrix, by
/// elimination with complete pivoting; none where the rows depend on one another.
fn pivots(mut J: DMatrix<f64>) -> Option<Vec<usize>> {
    let mut places = vec![];
    let mut rows: Vec<usize> = (0..J.nrows()).collect();
    let size = J.amax();
    while !rows.is_empty() {
        let entries = rows.iter().enumerate();
        let entries = entries.flat_map(|(k, &i)| (0..J.ncols()).map(move |j| (k, i, j)));
        let (k, row, column) = entries.max_by(|a, b| {
            let size = |place: &(usize, usize, usize)| J[(place.1, place.2)].abs();
            size(a).total_cmp(&size(b))
        })?;
        let lead = J[(row, column)];
        if lead.abs().partial_cmp(&(RANK * size)) != Some(Ordering::Greater) {
            return None;
        }
        rows.swap_remove(k);
        places.push(column);
        let top = J.row(row).into_owned();
        for &i in &rows {
            let factor = J[(i, column)] / lead;
            let next = J.row(i) - &top * factor;
            J.set_row(i, &next);
            J[(i, column)] = 0.0;
        }
    }
    Some(places)
}
