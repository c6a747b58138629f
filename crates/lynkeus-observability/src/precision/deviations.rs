//! From information to standard errors, right down to what is not seen at all.

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

use super::information::Information;
use super::orthogonal::{Singular, singular};

/// An error as large as a range counts as forgotten once less than this share of a range is left.
const FORGOTTEN: f64 = 1e-6;

/// What is unseen must show in a quantity by this multiple of the accuracy to spoil it.
const MARGIN: f64 = 10.0;

/// Standard errors of states and unknown inputs, in their units; infinite where the samples do not
/// tell them.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviations {
    /// of their values at the start of the window, all samples used
    pub start: Vec<f64>,
    /// of their values at its end: what an estimator knows at present
    pub present: Vec<f64>,
    /// how many directions are seen
    pub rank: Rank,
}

/// The decision which directions of the state space are seen.
///
/// Singular values of the information's factor with its columns scaled to length one;
/// those up to `threshold` cannot be told from zero by the accuracy of the integration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rank {
    /// directions seen
    pub seen: usize,
    /// directions there are
    pub of: usize,
    /// the weakest direction that counts as seen
    pub weakest_seen: f64,
    /// the strongest that does not; 0 where all are seen
    pub strongest_unseen: f64,
    /// the border between them
    pub threshold: f64,
}

impl Deviations {
    /// Which present values are seen.
    pub(super) fn pattern(&self) -> Vec<bool> {
        self.present.iter().map(|σ| σ.is_finite()).collect()
    }

    /// No samples at all, or nothing computed of them.
    pub(super) fn blind(count: usize) -> Self {
        Self {
            start: vec![f64::INFINITY; count],
            present: vec![f64::INFINITY; count],
            rank: Rank {
                of: count,
                ..Rank::default()
            },
        }
    }
}

/// The factor with columns of length one, and what made them so.
struct Balanced {
    factor: DMatrix<f64>,
    /// lengths of the columns; 1 for a column that is only rounding
    lengths: Vec<f64>,
    /// accuracy of the balanced columns
    accuracy: f64,
}

/// Standard errors, and which of them rest on parts of unseen directions that were taken as rounding.
pub(super) struct Judged {
    pub deviations: Deviations,
    /// of the start
    pub start: Vec<bool>,
    /// of the present
    pub present: Vec<bool>,
}

/// Standard errors from settled information, the transition over the window (columns
/// multiplied by the scales) and the relative accuracy of both. None where the budget is spent.
pub(super) fn of(
    information: &Information,
    transition: &DMatrix<f64>,
    scales: &[f64],
    accuracy: f64,
    budget: &Budget,
) -> Option<Judged> {
    let count = scales.len();
    let balanced = balance(information, accuracy);
    let Singular { values, directions } = singular(balanced.factor, budget)?;
    let rank = decide(&values, balanced.accuracy);
    // errors in units of the scales, one column per direction
    let start = DMatrix::from_fn(count, count, |i, j| {
        directions[(i, j)] / balanced.lengths[i]
    });
    let present = transition * &start;
    let blur = (MARGIN * rank.threshold / rank.weakest_seen).clamp(1e-9, 1e-2);
    let split = Split {
        values: &values,
        threshold: rank.threshold,
        reach: start.column_iter().map(|c| c.amax()).collect(),
    };
    let at_start = |i: usize| {
        let noise = blur / balanced.lengths[i];
        let (σ, is_doubted) = split.error(&|j| start[(i, j)], noise, 1.0);
        (scales[i] * σ, is_doubted)
    };
    let at_present = |i: usize| {
        let row = transition.row(i);
        let terms = row.iter().zip(&balanced.lengths);
        let noise = blur * terms.map(|(phi, e)| (phi / e).abs()).fold(0.0, f64::max);
        split.error(&|j| present[(i, j)], noise, scales[i])
    };
    let (at_start, start) = (0..count).map(at_start).unzip();
    let (at_present, present) = (0..count).map(at_present).unzip();
    Some(Judged {
        deviations: Deviations {
            start: at_start,
            present: at_present,
            rank,
        },
        start,
        present,
    })
}

/// Seen and unseen directions.
struct Split<'a> {
    values: &'a [f64],
    threshold: f64,
    /// per direction its greatest component in units of the scales
    reach: Vec<f64>,
}

impl Split<'_> {
    /// The standard error of a quantity with these `parts` of the directions, itself of this `scale`;
    /// parts below `noise` are rounding. And whether such a part would be an error of its own, were it none.
    fn error(&self, part: &dyn Fn(usize) -> f64, noise: f64, scale: f64) -> (f64, bool) {
        let mut variance = 0.0;
        let mut is_doubted = false;
        for (j, &value) in self.values.iter().enumerate() {
            let part = part(j);
            if value > self.threshold {
                variance += (part / value).powi(2);
                continue;
            }
            // the error that is left of one range at the start
            let left = part.abs() / self.reach[j];
            if part.abs() <= noise {
                // rounding, which says nothing of an error
                is_doubted |= left > FORGOTTEN * scale;
                continue;
            }
            if left > FORGOTTEN * scale {
                return (f64::INFINITY, true);
            }
            variance += left * left;
        }
        (variance.sqrt(), is_doubted)
    }
}

/// Scales the columns; one whose terms cancel down to their rounding becomes zero.
fn balance(information: &Information, accuracy: f64) -> Balanced {
    let mut factor = information.triangle().clone();
    let mut lengths = vec![1.0; factor.ncols()];
    let mut worst: f64 = 1.0;
    for (j, gross) in information.gross().enumerate() {
        let length = factor.column(j).norm();
        if length > accuracy * gross {
            lengths[j] = length;
            worst = worst.max(gross / length);
            factor.column_mut(j).unscale_mut(length);
        } else {
            factor.column_mut(j).fill(0.0);
        }
    }
    Balanced {
        factor,
        lengths,
        accuracy: accuracy * worst,
    }
}

fn decide(values: &[f64], accuracy: f64) -> Rank {
    let strongest = values.iter().copied().fold(0.0, f64::max);
    let threshold = accuracy * strongest;
    let seen = || values.iter().copied().filter(|s| *s > threshold);
    let unseen = values.iter().copied().filter(|s| *s <= threshold);
    Rank {
        seen: seen().count(),
        of: values.len(),
        weakest_seen: seen().fold(f64::INFINITY, f64::min),
        strongest_unseen: unseen.fold(0.0, f64::max),
        threshold,
    }
}
