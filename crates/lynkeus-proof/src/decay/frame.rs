//! Coordinates in which a Lyapunov function is easy to find.
//!
//! High gain makes the sizes of P's entries differ by powers of the gain: in the units of
//! the plant a solver runs out of digits where a proof exists. In the coordinates in which
//! the middle matrix is balanced and the Lyapunov function of that matrix is the unit
//! sphere, the P sought is near the identity. The choice decides what is found, not what
//! is accepted: the check sees the plant's own units.

use nalgebra::{DMatrix, DVector};

use super::{ErrorModel, Proof};
use crate::lyapunov::{self, symmetric};

/// Sweeps of the balancing.
const SWEEPS: usize = 20;
/// States up to which the axes are turned.
const STATES: usize = 10;

/// e = D T e′, time in units.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    /// D
    pub sizes: Vec<f64>,
    /// of time, in which the largest entry of the middle matrices is one
    pub unit: f64,
    /// T
    axes: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl Frame {
    /// The given sizes, and no more.
    pub fn plain(models: &[ErrorModel], sizes: &[f64]) -> Self {
        let n = sizes.len();
        let largest = |m: &ErrorModel| m.scaled(sizes, 1.0).nominal().amax();
        let largest = models.iter().map(largest).fold(0.0, f64::max);
        let is_number = largest > 0.0 && largest.is_finite();
        Self {
            sizes: sizes.to_vec(),
            unit: if is_number { 1.0 / largest } else { 1.0 },
            axes: DMatrix::identity(n, n),
            inverse: DMatrix::identity(n, n),
        }
    }

    /// Balanced, with the middle matrix's Lyapunov function as unit sphere; none where
    /// that matrix is not stable.
    pub fn natural(models: &[ErrorModel], sizes: &[f64]) -> Option<Self> {
        let sizes = balanced(&middle(models, sizes), sizes);
        let mut frame = Self::plain(models, &sizes);
        // other axes fill the matrices, which takes longer than it helps where they are large
        if sizes.len() <= STATES {
            let A = middle(models, &sizes) * frame.unit;
            let P = lyapunov::solve(&A, &DMatrix::identity(A.nrows(), A.nrows()))?;
            frame.inverse = P.cholesky()?.l().transpose();
            frame.axes = frame.inverse.clone().try_inverse()?;
        }
        Some(frame)
    }

    /// A, B and C of a scaled model e' = (A + B δ C) e in these axes.
    pub fn seen(&self, model: &ErrorModel) -> Seen {
        let A = &self.inverse * model.nominal() * &self.axes;
        Seen::of(
            A,
            &self.inverse * model.spread(),
            model.reads() * &self.axes,
        )
    }

    /// The same axes for (e, ε), where the entries of ε are in units of the states `shown`: W with (e, ε) = W (e′, ε′),
    /// and its inverse.
    pub fn widened(&self, shown: &[usize]) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.sizes.len();
        let sizes: Vec<f64> = shown.iter().map(|&s| self.sizes[s]).collect();
        let size = |i: usize| match i < n {
            true => self.sizes[i],
            false => sizes[i - n],
        };
        let of = |axes: &DMatrix<f64>, entry: &dyn Fn(usize, usize) -> f64| {
            DMatrix::from_fn(n + sizes.len(), n + sizes.len(), |i, j| {
                match i < n && j < n {
                    true => axes[(i, j)] * entry(i, j),
                    false if i == j => entry(i, j),
                    false => 0.0,
                }
            })
        };
        (
            of(&self.axes, &|i, _| size(i)),
            of(&self.inverse, &|_, j| 1.0 / size(j)),
        )
    }

    /// A proof found in this frame, in the user's units. With e = D e′ and time in
    /// `unit`s, P = D⁻¹P′D⁻¹ and t = t′/(unit·s²) for a sector in a state of size s.
    pub fn restored(&self, models: &[ErrorModel], mut proof: Proof) -> Proof {
        let s = &self.sizes;
        let P = symmetric(&(self.inverse.transpose() * &proof.P * &self.inverse));
        proof.P = DMatrix::from_fn(P.nrows(), P.ncols(), |i, j| P[(i, j)] / (s[i] * s[j]));
        proof.rate /= self.unit;
        for (t, model) in proof.multipliers.iter_mut().zip(models) {
            for (t, sector) in t.iter_mut().zip(&model.sectors) {
                *t /= self.unit * s[sector.column].powi(2);
            }
        }
        proof
    }
}

/// A model in the axes of a frame.
pub(super) struct Seen {
    pub A: DMatrix<f64>,
    pub B: DMatrix<f64>,
    pub C: DMatrix<f64>,
    /// a multiplier here is this times that of the model
    pub weights: DVector<f64>,
}

impl Seen {
    /// With the uncertain part B δ C of the same size on both sides: b δ cᵀ = (b w) δ (c/w)ᵀ.
    pub fn of(A: DMatrix<f64>, mut B: DMatrix<f64>, mut C: DMatrix<f64>) -> Self {
        let mut weights = DVector::repeat(C.nrows(), 1.0);
        for k in 0..C.nrows() {
            let w = (C.row(k).norm() / B.column(k).norm()).sqrt();
            if w.is_finite() && w > 0.0 {
                B.column_mut(k).scale_mut(w);
                C.row_mut(k).scale_mut(1.0 / w);
                weights[k] = w * w;
            }
        }
        Self { A, B, C, weights }
    }
}

/// The mean of the models' middle matrices, in units of the sizes.
fn middle(models: &[ErrorModel], sizes: &[f64]) -> DMatrix<f64> {
    let n = sizes.len();
    let sum = models.iter().fold(DMatrix::zeros(n, n), |sum, m| {
        sum + m.scaled(sizes, 1.0).nominal()
    });
    sum / models.len().max(1) as f64
}

/// Sizes for which rows and columns of the matrix have equal sums beside the diagonal
/// (Osborne 1960).
pub(super) fn balanced(A: &DMatrix<f64>, sizes: &[f64]) -> Vec<f64> {
    let n = sizes.len();
    let mut d = vec![1.0_f64; n];
    for _ in 0..SWEEPS {
        for i in 0..n {
            let others = (0..n).filter(|&j| j != i);
            let (row, column) = others.fold((0.0, 0.0), |(row, column), j| {
                (
                    row + A[(i, j)].abs() * d[j] / d[i],
                    column + A[(j, i)].abs() * d[i] / d[j],
                )
            });
            let factor = (row / column).sqrt();
            if factor.is_finite() && factor > 0.0 {
                d[i] *= factor;
            }
        }
    }
    let pairs = sizes.iter().zip(&d);
    pairs.map(|(size, d)| size * d).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balancing_undoes_the_powers_of_a_high_gain() {
        let θ: f64 = 1e3;
        let A = DMatrix::from_row_slice(
            3,
            3,
            &[
                -3.0 * θ,
                1.0,
                0.0,
                -3.0 * θ * θ,
                0.0,
                1.0,
                -θ.powi(3),
                0.0,
                0.0,
            ],
        );
        let d = balanced(&A, &[1.0; 3]);
        let step = |i: usize| d[i + 1] / d[i] / θ;
        assert!(
            (0.2..5.0).contains(&step(0)) && (0.2..5.0).contains(&step(1)),
            "{d:?}"
        );
    }

    /// A chain of four with gains up to θ⁴ = 10¹²: in the units of the plant no solver
    /// finds the Lyapunov function that exists.
    #[test]
    fn a_very_high_gain_is_proved() {
        use crate::decay::Sector;
        use lynkeus_expr::Interval;
        let θ: f64 = 1e3;
        let mut constant = vec![vec![Interval::ZERO; 4]; 4];
        for (i, k) in [4.0, 6.0, 4.0, 1.0].into_iter().enumerate() {
            constant[i][0] = Interval::point(-k * θ.powi(i as i32 + 1));
            if i < 3 {
                constant[i][i + 1] = Interval::ONE;
            }
        }
        let unit = |row: usize| {
            let mut direction = vec![Interval::ZERO; 4];
            direction[row] = Interval::ONE;
            direction
        };
        let sectors = (1..4).map(|row| Sector {
            column: row,
            direction: unit(row),
            range: Interval::new(-30.0, 30.0).unwrap_or(Interval::ENTIRE),
        });
        let model = ErrorModel {
            constant,
            sectors: sectors.collect(),
        };
        let proof =
            super::super::prove(&[model], &[1.0; 4], 100.0, &lynkeus_expr::Budget::default());
        assert!(proof.is_some());
    }
}
