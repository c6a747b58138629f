//! The independent check: the inequality of [`super`] in interval arithmetic, from the
//! numbers of a [`Proof`] alone. No result of a solver enters but those numbers.

use lynkeus_expr::Interval;
use nalgebra::{DMatrix, DVector};

use super::{ErrorModel, Proof};
use crate::definite::is_positive_definite;
use crate::matrix::{IntervalMatrix, dot, points, product};

/// Whether the proof holds for every model: P > 0, every multiplier positive, and
/// He(P A(θ)) + 2·rate·P < 0 for every θ in the ranges.
pub fn holds(models: &[ErrorModel], proof: &Proof) -> bool {
    let n = proof.P.nrows();
    let sizes = models.iter().all(|m| m.size() == n && m.is_bounded());
    let numbers = proof.P.iter().all(|x| x.is_finite()) && proof.rate.is_finite();
    sizes
        && numbers
        && models.len() == proof.multipliers.len()
        && is_symmetric(&proof.P)
        && is_positive_definite(&points(&proof.P))
        && models
            .iter()
            .zip(&proof.multipliers)
            .all(|(model, t)| model_holds(model, proof, t))
}

fn is_symmetric(P: &DMatrix<f64>) -> bool {
    P.is_square() && *P == P.transpose()
}

/// One inequality: the negative of the block matrix is positive definite.
fn model_holds(model: &ErrorModel, proof: &Proof, t: &DVector<f64>) -> bool {
    let (n, q) = (model.size(), model.sectors.len());
    if t.len() != q || !t.iter().all(|t| *t > 0.0 && t.is_finite()) {
        return false;
    }
    let P = points(&proof.P);
    let twice_rate = Interval::point(2.0) * Interval::point(proof.rate);
    let PA = product(&P, &model.fixed(&model.middles()).constant);
    let mut matrix: IntervalMatrix = vec![];
    for i in 0..n {
        let entry = |j: usize| -(PA[i][j] + PA[j][i] + twice_rate * P[i][j]);
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
