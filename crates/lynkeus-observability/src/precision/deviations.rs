//! From information to standard errors, right down to what is not seen at all.

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

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
    let mut factor = information.triangle.clone();
    let gross: Vec<f64> = information.gross.iter().map(|sum| sum.sqrt()).collect();
    let (lengths, accuracy) = balance(&mut factor, &gross, accuracy);
    let (values, directions) = singular(factor, budget)?;
    let rank = decide(&values, accuracy);
    // errors in units of the scales, one column per direction
    let start = DMatrix::from_fn(count, count, |i, j| directions[(i, j)] / lengths[i]);
    let present = transition * &start;
    let blur = (MARGIN * rank.threshold / rank.weakest_seen).clamp(1e-9, 1e-2);
    let split = Split {
        values: &values,
        threshold: rank.threshold,
        reach: start.column_iter().map(|c| c.amax()).collect(),
    };
    let at_start = |i: usize| {
        let noise = blur / lengths[i];
        let (σ, is_doubted) = split.error(&|j| start[(i, j)], noise, 1.0);
        (scales[i] * σ, is_doubted)
    };
    let at_present = |i: usize| {
        let row = transition.row(i);
        let terms = row.iter().zip(&lengths);
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

/// Makes columns one long: the lengths that they had, and their accuracy. A column whose terms, `gross` without
/// cancelling, cancel down to their rounding becomes zero, its length 1.
pub(super) fn balance(factor: &mut DMatrix<f64>, gross: &[f64], accuracy: f64) -> (Vec<f64>, f64) {
    let mut lengths = vec![1.0; gross.len()];
    let mut worst: f64 = 1.0;
    for (mut column, (own, gross)) in factor.column_iter_mut().zip(lengths.iter_mut().zip(gross)) {
        let length = column.norm();
        if length > accuracy * gross {
            *own = length;
            worst = worst.max(gross / length);
            column.unscale_mut(length);
        } else {
            column.fill(0.0);
        }
    }
    (lengths, accuracy * worst)
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

/// Rows wait until there are this many times the columns, then they are worked in together.
const BLOCK: usize = 2;

/// A triangle R with RᵀR = Σ rowᵀ·row, gathered by orthogonal transformations.
#[derive(Clone, Debug)]
pub(super) struct Information {
    triangle: DMatrix<f64>,
    /// rows not yet worked in, one after the other
    pending: Vec<f64>,
    /// per column Σ over the rows of the square of what its terms would be without cancelling
    gross: Vec<f64>,
}

impl Information {
    pub fn new(columns: usize) -> Self {
        Self {
            triangle: DMatrix::zeros(0, columns),
            pending: vec![],
            gross: vec![0.0; columns],
        }
    }

    /// The information of several independent sources.
    pub fn joined<'a>(columns: usize, parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut joined = Self::new(columns);
        for part in parts {
            for row in part.triangle.row_iter() {
                joined.pending.extend(row.iter());
            }
            joined.pending.extend(&part.pending);
            for (sum, term) in joined.gross.iter_mut().zip(&part.gross) {
                *sum += term;
            }
        }
        joined.settle();
        joined
    }

    /// Adds a row; `gross` are its entries with every term taken as positive.
    pub fn push(&mut self, row: impl Iterator<Item = f64>, gross: impl Iterator<Item = f64>) {
        self.pending.extend(row);
        for (sum, entry) in self.gross.iter_mut().zip(gross) {
            *sum += entry * entry;
        }
        let columns = self.gross.len();
        if self.pending.len() >= BLOCK * columns * columns.max(1) {
            self.settle();
        }
    }

    /// Works all rows into the triangle.
    pub fn settle(&mut self) {
        let columns = self.gross.len();
        if self.pending.is_empty() || columns == 0 {
            return;
        }
        let rows = self.pending.len() / columns;
        let pending = DMatrix::from_row_slice(rows, columns, &self.pending);
        self.triangle = stacked(&self.triangle, &pending).qr().r();
        self.pending.clear();
    }
}

pub(super) fn stacked(above: &DMatrix<f64>, below: &DMatrix<f64>) -> DMatrix<f64> {
    let first = above.nrows();
    DMatrix::from_fn(first + below.nrows(), below.ncols(), |i, j| {
        match i.checked_sub(first) {
            None => above[(i, j)],
            Some(i) => below[(i, j)],
        }
    })
}

/// Sweeps over all pairs of columns; a handful suffices.
const SWEEPS: usize = 60;

/// Columns count as orthogonal below this cosine.
const COSINE: f64 = 4.0 * f64::EPSILON;

/// The singular values of A, not sorted, and its right singular vectors, one per column of V: AV has orthogonal columns
/// of these norms. None where the budget is spent.
pub(super) fn singular(mut a: DMatrix<f64>, budget: &Budget) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let columns = a.ncols();
    let mut v = DMatrix::identity(columns, columns);
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for p in 0..columns {
            if budget.spent().is_some() {
                return None;
            }
            for q in p + 1..columns {
                if let Some((c, s)) = rotation(&a, p, q) {
                    is_done = false;
                    rotate(&mut a, p, q, c, s);
                    rotate(&mut v, p, q, c, s);
                }
            }
        }
        if is_done {
            break;
        }
    }
    Some((a.column_iter().map(|column| column.norm()).collect(), v))
}

/// Cosine and sine that make two columns orthogonal; none where they are.
fn rotation(a: &DMatrix<f64>, p: usize, q: usize) -> Option<(f64, f64)> {
    let (alpha, beta) = (a.column(p).norm_squared(), a.column(q).norm_squared());
    let gamma = a.column(p).dot(&a.column(q));
    if gamma.abs() <= COSINE * (alpha * beta).sqrt() {
        return None;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    (tangent != 0.0 && tangent.is_finite()).then_some((cosine, cosine * tangent))
}

fn rotate(a: &mut DMatrix<f64>, p: usize, q: usize, c: f64, s: f64) {
    for i in 0..a.nrows() {
        let (x, y) = (a[(i, p)], a[(i, q)]);
        a[(i, p)] = c * x - s * y;
        a[(i, q)] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_singular_values_keep_their_digits() {
        // columns nearly parallel: singular values √2 and ε/√2
        let epsilon = 1e-9;
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, epsilon]);
        let (mut found, _) = singular(a, &Budget::default()).unwrap();
        found.sort_by(f64::total_cmp);
        assert!(
            (found[0] / (epsilon / 2.0_f64.sqrt()) - 1.0).abs() < 1e-6,
            "{found:?}"
        );
        assert!((found[1] - 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn fewer_rows_than_columns_leave_zeros() {
        let a = DMatrix::from_row_slice(1, 3, &[3.0, 0.0, 4.0]);
        let found = singular(a.clone(), &Budget::default());
        let (values, directions) = found.unwrap();
        assert!((values.iter().copied().fold(0.0, f64::max) - 5.0).abs() < 1e-12);
        assert_eq!(values.iter().filter(|s| **s < 1e-12).count(), 2);
        assert!((&directions * directions.transpose() - DMatrix::identity(3, 3)).norm() < 1e-12);
    }
}
