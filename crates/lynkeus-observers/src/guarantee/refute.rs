//! The search for a point of the box at which the error's Jacobian is not stable: a
//! right estimate does not stay right there.

use lynkeus_expr::{Evaluator, Graph};
use lynkeus_structure::{Dimension, Point, Witness};

use super::error_system::ErrorSystem;
use crate::DesignError;

/// Points tried before the search climbs from the best of them.
const POINTS: usize = 400;
/// Halvings of the step while climbing.
const HALVINGS: usize = 12;
/// An eigenvalue this far from the imaginary axis, relative to the matrix, is not a
/// matter of rounding.
const CLEAR: f64 = 1e-9;
/// Distance from the ends, relative to a side, where slopes may have kinks there.
const INSET: f64 = 1e-4;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// What the search found.
pub(super) struct Sample {
    /// the slowest decay over the points examined
    pub slowest: f64,
    /// a point with an eigenvalue that does not decay
    pub witness: Option<Witness>,
}

/// The worst point that a deterministic search finds.
pub(super) fn worst(graph: &Graph, system: &ErrorSystem) -> Result<Sample, DesignError> {
    let sides = system.sides.dimensions.iter().map(finite);
    let mut search = Search {
        system,
        evaluator: system.evaluator(),
        sides: match system.is_rough(graph) {
            true => sides.enumerate().map(inner).collect(),
            false => sides.collect(),
        },
    };
    let (mut best, mut highest) = (search.point(0), f64::NEG_INFINITY);
    for index in 0..POINTS {
        let point = search.point(index);
        if let Some(abscissa) = search.abscissa(&point)
            && abscissa > highest
        {
            (best, highest) = (point, abscissa);
        }
    }
    if highest.is_finite() {
        (best, highest) = search.climbed(best, highest);
    }
    let A = system.at(&mut search.evaluator, &best);
    let refuted = highest > CLEAR * A.amax();
    let coordinates = system.sides.dimensions.iter().zip(&best);
    let named = coordinates.map(|(d, x)| (d.name.clone(), *x));
    let point = Point {
        coordinates: named.collect(),
        value: highest,
    };
    Ok(Sample {
        slowest: -highest,
        witness: refuted.then(|| Witness {
            points: vec![point],
        }),
    })
}

struct Search<'a> {
    system: &'a ErrorSystem,
    evaluator: Evaluator,
    sides: Vec<(f64, f64, bool)>,
}

/// The side with infinite ends replaced by large ones.
fn finite(side: &Dimension) -> (f64, f64, bool) {
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
    (low, high.max(low), side.integer)
}

/// The side without its ends and with another middle: a kink there, as of |x| at 0, has
/// no slope, and that of one side need not be met in the box.
fn inner((i, (low, high, whole)): (usize, (f64, f64, bool))) -> (f64, f64, bool) {
    if whole {
        return (low, high, whole);
    }
    let cut = INSET * (1.0 + (i as f64 * GOLDEN).fract()) * (high - low);
    (low + cut, high - 0.5 * cut, whole)
}

impl Search<'_> {
    /// The middle, corners and points between, spread by irrational steps.
    fn point(&self, index: usize) -> Vec<f64> {
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
        let sides = self.sides.iter().enumerate();
        sides
            .map(|(i, &(low, high, whole))| {
                // low + (high − low) may be above high by rounding
                let x = (low + place(i) * (high - low)).min(high);
                if whole { x.round() } else { x }
            })
            .collect()
    }

    /// The largest real part of an eigenvalue of A there.
    fn abscissa(&mut self, point: &[f64]) -> Option<f64> {
        let A = self.system.at(&mut self.evaluator, point);
        if !A.iter().all(|x| x.is_finite()) {
            return None;
        }
        // a bounded number of sweeps: a matrix that does not converge is skipped
        let schur = nalgebra::linalg::Schur::try_new(A, f64::EPSILON, 10_000)?;
        let eigenvalues = schur.complex_eigenvalues();
        let largest = eigenvalues
            .iter()
            .map(|λ| λ.re)
            .fold(f64::NEG_INFINITY, f64::max);
        largest.is_finite().then_some(largest)
    }

    /// Coordinate by coordinate to a worse point, with ever smaller steps.
    fn climbed(&mut self, mut point: Vec<f64>, mut highest: f64) -> (Vec<f64>, f64) {
        let mut step = 0.5;
        for _ in 0..HALVINGS {
            for i in 0..point.len() {
                let (low, high, whole) = self.sides[i];
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
