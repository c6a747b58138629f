//! The search for a point of the box at which the error's Jacobian is not stable, and for
//! what such a point shows.
//!
//! No quadratic form eᵀPe decays for the whole box where a Jacobian A in it is not stable.
//! That alone makes no error grow: along a trajectory A changes, and neither do stable
//! instants make a stable whole, nor unstable ones an unstable one. The error grows for
//! certain where A is the same whatever the plant does, and where the plant can rest.

use super::edges::edges;
use super::equilibrium;
use super::error_system::ErrorSystem;
use crate::Observer;
use crate::statement::refuted;
use crate::{Check, Inequality};
use lynkeus_expr::{Evaluator, Graph, Interval, MissingInput, Node};
use lynkeus_proof::decay::is_unstable;
use lynkeus_proof::spectrum;
use lynkeus_structure::{Coordinate, Dimension, Extended, Point};

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
    let sides = system.sides.dimensions.iter().map(Side::finite);
    let mut search = Search {
        system,
        evaluator: system.evaluator(),
        sides: match system.is_rough(graph) {
            true => sides.enumerate().map(inner).collect(),
            false => sides.collect(),
        },
        skipped: false,
    };
    let (mut best, mut highest) = (spread(&search.sides, 0), f64::NEG_INFINITY);
    for index in 0..POINTS {
        let point = spread(&search.sides, index);
        if let Some(abscissa) = search.abscissa(&point)
            && abscissa > highest
        {
            (best, highest) = (point, abscissa);
        }
    }
    if highest.is_finite() {
        (best, highest) = search.climbed(best, highest);
    }
    let coordinates = system.sides.dimensions.iter().zip(&best);
    let named = coordinates.map(|(d, x)| (d.name.clone(), *x));
    let cell: Vec<Interval> = best.iter().map(|&x| Interval::point(x)).collect();
    // the mean of all real parts is no higher than the highest, and no matter of rounding
    let mean = system.at(&mut search.evaluator, &best).trace() / system.scale.len() as f64;
    Sample {
        slowest: (!search.skipped).then_some(-highest),
        limit: match highest < 0.0 && highest.is_finite() {
            true => -highest,
            false => -mean,
        },
        unstable: highest > 0.0 && is_unstable(&system.enclosed_at(&cell)),
        worst: Point {
            coordinates: named.map(Coordinate::from).collect(),
            value: highest,
        },
    }
}

/// What shows that the error does not decay, if anything does.
pub(super) fn growing(
    extended: &Extended<'_>,
    observer: &Observer,
    system: &ErrorSystem,
    sample: &Sample,
) -> Result<Option<Check>, MissingInput> {
    if sample.worst.value < 0.0 {
        return Ok(None);
    }
    if sample.unstable && is_constant(extended, observer, system) {
        let detail = "whatever the plant does, the error obeys e' = A e with the same A everywhere, which has an eigenvalue with a positive real part, by interval arithmetic";
        return Ok(Some(refuted(
            Inequality::SmallErrorsDecay,
            sample.worst.clone(),
            detail,
        )));
    }
    let found = equilibrium::repelling(extended, observer, system)?;
    Ok(found.map(|point| {
        let detail = "the plant can rest at this point, with these inputs, and there the error's Jacobian has an eigenvalue with a positive real part, both by interval arithmetic: the estimate leaves the plant, however close it starts";
        refuted(Inequality::SmallErrorsDecay, point, detail)
    }))
}

/// Whether e' = A e with an A that reads nothing. One that a known input moves refutes nothing by
/// its worst value: the plant need not stay in the box while the input keeps that value.
fn is_constant(extended: &Extended<'_>, observer: &Observer, system: &ErrorSystem) -> bool {
    let graph = extended.graph();
    let read = graph.symbols_of(system.entries());
    let hats: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    read.is_empty() && edges(graph, &observer.derivatives, &hats).is_empty()
}

struct Search<'a> {
    system: &'a ErrorSystem,
    evaluator: Evaluator,
    sides: Vec<Side>,
    /// the eigenvalues at a point were not found
    skipped: bool,
}

/// A side of the box within which points are tried.
#[derive(Clone, Debug)]
pub(super) struct Side {
    pub low: f64,
    pub high: f64,
    /// only whole numbers count
    pub whole: bool,
}

impl Side {
    /// With infinite ends replaced by large ones.
    pub fn finite(side: &Dimension) -> Self {
        let low = if side.min.is_finite() {
            side.min
        } else {
            side.max.min(1.0) - 2.0
        };
        let high = if side.max.is_finite() {
            side.max
        } else {
            low.max(-1.0) + 2.0
        };
        Self {
            low,
            high: high.max(low),
            whole: side.integer,
        }
    }
}

/// The side without its ends and with another middle: a kink there, as of |x| at 0, has
/// no slope, and that of one side need not be met in the box.
fn inner((i, side): (usize, Side)) -> Side {
    if side.whole {
        return side;
    }
    let cut = INSET * (1.0 + (i as f64 * GOLDEN).fract()) * (side.high - side.low);
    Side {
        low: side.low + cut,
        high: side.high - 0.5 * cut,
        whole: false,
    }
}

/// The middle, corners and points between, spread by irrational steps.
pub(super) fn spread(sides: &[Side], index: usize) -> Vec<f64> {
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
            let x = (side.low + place(i) * (side.high - side.low)).min(side.high);
            if side.whole { x.round() } else { x }
        })
        .collect()
}

impl Search<'_> {
    /// The largest real part of an eigenvalue of A there.
    fn abscissa(&mut self, point: &[f64]) -> Option<f64> {
        let found = spectrum::abscissa(self.system.at(&mut self.evaluator, point));
        self.skipped |= found.is_none();
        found
    }

    /// Coordinate by coordinate to a worse point, with ever smaller steps.
    fn climbed(&mut self, mut point: Vec<f64>, mut highest: f64) -> (Vec<f64>, f64) {
        let mut step = 0.5;
        for _ in 0..HALVINGS {
            for i in 0..point.len() {
                let Side { low, high, whole } = self.sides[i].clone();
                if whole || low == high {
                    continue;
                }
                for direction in [-1.0, 1.0] {
                    let mut next = point.clone();
                    next[i] = (point[i] + direction * step * (high - low)).clamp(low, high);
                    if let Some(abscissa) = self.abscissa(&next)
                        && abscissa > highest
                    {
                        (point, highest) = (next, abscissa);
                    }
                }
            }
            step *= 0.5;
        }
        (point, highest)
    }
}
