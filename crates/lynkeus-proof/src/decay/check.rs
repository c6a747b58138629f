//! The independent check: the inequality of [`super`] in interval arithmetic, from the
//! numbers of a [`Proof`] alone. No result of a solver enters but those numbers.

use lynkeus_expr::Interval;
use nalgebra::{DMatrix, DVector};

use super::{ErrorModel, Proof, SampledProof, between_errors};
use crate::definite::is_positive_definite;
use crate::matrix::{IntervalMatrix, dot, points, product, square};

/// Whether the proof holds for every model: P > 0, every multiplier positive, and
/// He(P A(θ)) + 2·rate·P < 0 for every θ in the ranges.
pub fn holds(models: &[ErrorModel], proof: &Proof) -> bool {
    let P = points(&proof.P);
    let still = square(P.len(), |_, _| Interval::ZERO);
    is_form(&proof.P)
        && is_positive_definite(&P)
        && falls(models, (&P, &still), proof.rate, &proof.multipliers)
}

/// Whether the proof holds between samples and at them, for errors (e, σ) of which the last entries,
/// one per sensor, are the innovations that the observer reads, in units of the states `shown`: a
/// sample sets them to these states' errors. See [`SampledProof`].
pub fn holds_between_samples(models: &[ErrorModel], shown: &[usize], proof: &SampledProof) -> bool {
    let size = proof.P.first().map_or(0, DMatrix::nrows);
    let is_shown = |&state: &usize| state + shown.len() < size;
    falls_at_samples(proof, shown.len())
        && proof.multipliers.len() + 1 == proof.P.len()
        && shown.iter().all(is_shown)
        && pieces_fall(models, shown, proof)
}

/// Whether a sample, which sets the errors ε of so many predictions to 0, raises no zᵀP(τ)z, whenever it comes: P(0) > 0
/// has no entries between e and ε, and every other P is larger than what P(0) has of e.
pub(super) fn falls_at_samples(proof: &SampledProof, sensors: usize) -> bool {
    let [first, later @ ..] = &proof.P[..] else {
        return false;
    };
    let Some(n) = first.nrows().checked_sub(sensors) else {
        return false;
    };
    let size = first.nrows();
    let is_fit = !later.is_empty()
        && proof.P.iter().all(|P| is_form(P) && P.nrows() == size)
        && proof.interval > 0.0
        && proof.interval.is_finite();
    if !is_fit {
        return false;
    }
    let is_together = |i: usize, j: usize| (i < n) == (j < n);
    let is_split = (0..size).all(|i| (0..size).all(|j| is_together(i, j) || first[(i, j)] == 0.0));
    // what a sample leaves of V: eᵀP(0)e
    let kept = |P: &DMatrix<f64>| {
        square(P.nrows(), |i, j| {
            let entry = Interval::point(P[(i, j)]);
            match i < n && j < n {
                true => entry - Interval::point(first[(i, j)]),
                false => entry,
            }
        })
    };
    is_split
        && is_positive_definite(&points(first))
        && later.iter().all(|P| is_positive_definite(&kept(P)))
}

/// V' ≤ −2·rate·V at both ends of every piece: P' is the same on all of it, so that it holds between.
fn pieces_fall(models: &[ErrorModel], shown: &[usize], proof: &SampledProof) -> bool {
    let pieces = Interval::point(proof.multipliers.len() as f64);
    let length = Interval::point(proof.interval) / pieces;
    let forms: Vec<IntervalMatrix> = proof.P.iter().map(|P| over_innovations(P, shown)).collect();
    let ends = forms.windows(2).zip(&proof.multipliers);
    ends.into_iter().all(|(ends, multipliers)| {
        let change = square(ends[0].len(), |i, j| {
            (ends[1][i][j] - ends[0][i][j]) / length
        });
        let mut both = ends.iter().zip(multipliers);
        both.all(|(P, t)| falls(models, (P, &change), proof.rate, t))
    })
}

/// SᵀPS, the form in (e, σ) of one in (e, ε): ε_j = e_s − σ_j for the state s that sensor j shows.
fn over_innovations(P: &DMatrix<f64>, shown: &[usize]) -> IntervalMatrix {
    let S = points(&between_errors(P.nrows(), shown));
    let transposed = square(S.len(), |i, j| S[j][i]);
    product(&transposed, &product(&points(P), &S))
}

/// Whether it is a symmetric matrix of numbers.
pub(super) fn is_form(P: &DMatrix<f64>) -> bool {
    P.is_square() && *P == P.transpose() && P.iter().all(|x| x.is_finite())
}

/// Whether eᵀPe, P > 0 changing at the given speed, falls at 2·rate for every model.
fn falls(
    models: &[ErrorModel],
    form: (&IntervalMatrix, &IntervalMatrix),
    rate: f64,
    multipliers: &[DVector<f64>],
) -> bool {
    let n = form.0.len();
    let sizes = models.iter().all(|m| m.size() == n && m.is_bounded());
    let mut each = models.iter().zip(multipliers);
    sizes
        && rate.is_finite()
        && models.len() == multipliers.len()
        && each.all(|(model, t)| model_falls(model, form, rate, t))
}

/// One inequality: the negative of the block matrix is positive definite.
fn model_falls(
    model: &ErrorModel,
    (P, change): (&IntervalMatrix, &IntervalMatrix),
    rate: f64,
    t: &DVector<f64>,
) -> bool {
    let (n, q) = (model.size(), model.sectors.len());
    if t.len() != q || !t.iter().all(|t| *t > 0.0 && t.is_finite()) {
        return false;
    }
    let twice_rate = Interval::point(2.0) * Interval::point(rate);
    let PA = product(P, &model.fixed(&model.middles()).constant);
    let mut matrix: IntervalMatrix = vec![];
    for i in 0..n {
        let entry = |j: usize| -(PA[i][j] + PA[j][i] + twice_rate * P[i][j] + change[i][j]);
        matrix.push((0..=i).map(entry).collect());
    }
    for (sector, &t) in model.sectors.iter().zip(t) {
        let corner = &mut matrix[sector.column][sector.column];
        *corner = *corner - Interval::point(t);
    }
    for (k, sector) in model.sectors.iter().enumerate() {
        let h = Interval::point(sector.half());
        let spread: Vec<Interval> = sector.direction.iter().map(|b| h * *b).collect();
        let mut row: Vec<Interval> = P.iter().map(|row| -dot(row, &spread)).collect();
        row.extend(vec![Interval::ZERO; k]);
        row.push(Interval::point(t[k]));
        matrix.push(row);
    }
    is_positive_definite(&matrix)
}
