//! V = eᵀP⁻¹e as Germani and Manes (1999) write their Lyapunov functions, with bounds of what proofs need of P.

use lynkeus_expr::Interval;
use nalgebra::{DMatrix, DVector};

use crate::definite::{is_below, is_positive_definite};
use crate::magnitude::{length, size};
use crate::matrix::square;
use crate::spectrum;

/// P > 0 with V' ≤ −2αV for V = eᵀP⁻¹e.
#[derive(Clone, Debug)]
pub struct Ellipsoid {
    /// P
    pub P: DMatrix<f64>,
    /// α
    pub α: f64,
    /// an upper bound of ‖P‖
    pub largest: f64,
    /// a lower bound of the smallest eigenvalue of P
    pub smallest: f64,
}

impl Ellipsoid {
    /// With proved bounds of the eigenvalues; that V falls is for the caller to prove.
    pub(crate) fn of(P: DMatrix<f64>, α: f64) -> Option<Self> {
        let inverse = P.clone().cholesky()?.inverse();
        let top = |P: &DMatrix<f64>| Some(spectrum::symmetric(P.clone())?.eigenvalues.max());
        let unit = DMatrix::identity(P.nrows(), P.nrows());
        let (largest, smallest) = (top(&P)? * (1.0 + 1e-6), (1.0 - 1e-3) / top(&inverse)?);
        let bounded = is_below(&P, 1.0, &(&unit * largest)) && is_below(&unit, smallest, &P);
        (bounded && smallest > 0.0).then_some(Self {
            α,
            largest,
            smallest,
            P,
        })
    }

    /// An upper bound of √cond(P): what |e| may grow by before it decays.
    pub fn peak(&self) -> f64 {
        let square = Interval::point(self.largest) / Interval::point(self.smallest);
        square.sqrt().hi()
    }

    /// An upper bound of √(fᵀP⁻¹f) for every f up to this length.
    pub fn weight_of_length(&self, length: f64) -> f64 {
        (size(length) / Interval::point(self.smallest).sqrt()).hi()
    }

    /// An upper bound of √(fᵀP⁻¹f): P − ffᵀ/t > 0 says fᵀP⁻¹f < t.
    pub fn weight(&self, f: &[f64]) -> f64 {
        let coarse = self.weight_of_length(length(f));
        let Some(inverse) = self.P.clone().cholesky().map(|c| c.inverse()) else {
            return coarse;
        };
        let column = DVector::from_column_slice(f);
        let guess = (column.transpose() * inverse * &column)[(0, 0)];
        let t = Interval::point(guess * (1.0 + 1e-6) + f64::MIN_POSITIVE);
        let rest = |i: usize, j: usize| {
            let product = Interval::point(f[i]) * Interval::point(f[j]);
            Interval::point(self.P[(i, j)]) - product / t
        };
        match is_positive_definite(&square(f.len(), rest)) {
            true => t.sqrt().hi(),
            false => coarse,
        }
    }
}
