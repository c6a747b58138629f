//! The information about the present, carried from sample to sample.
//!
//! Along what grows, like e^(5t), the sensitivities to the start are all alike after a while, and what little they say of
//! everything else is lost in their rounding. In the coordinates of the present it is not: from one sample to the next
//! the factor R of the information becomes RΦ⁻¹, with the transition Φ over that interval only, and each
//! sample adds its rows. Along what decays this amplifies errors of the integrator, as Φ⁻¹ grows; a second factor
//! N carries them in the same way, and a direction counts as seen where R says more than N.

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

use super::deviations::{balance, singular, stacked};

/// What is seen must stand out from errors by this factor.
const MARGIN: f64 = 10.0;
/// Parts of an unseen direction below this share are rounding.
const BLUR: f64 = 1e-6;
/// Quantities beyond which it is not carried: it costs the cube of them at every sample.
pub(super) const WIDE: usize = 12;

/// The factors in the coordinates of the present, multiples of the scales.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    /// one triangle per sensor
    of: Vec<DMatrix<f64>>,
    errors: DMatrix<f64>,
    /// ∂z(0)/∂z of the present
    back: DMatrix<f64>,
    /// relative accuracy of rows and transitions
    accuracy: f64,
}

impl Forward {
    pub fn new(sensors: usize, wide: usize, accuracy: f64) -> Self {
        Self {
            of: vec![DMatrix::zeros(0, wide); sensors],
            errors: DMatrix::zeros(0, wide),
            back: DMatrix::identity(wide, wide),
            accuracy,
        }
    }

    /// Adds the rows of each sensor, in the coordinates of the sample before, and moves on along the
    /// transition Φ from there; none where this is not to be inverted.
    pub fn advance(&mut self, rows: &[DMatrix<f64>], transition: &DMatrix<f64>) -> Option<()> {
        let wide = transition.ncols();
        let back = transition.clone().try_inverse()?;
        if !back.iter().all(|x| x.is_finite()) {
            return None;
        }
        let moved = |triangle: &DMatrix<f64>| -> DMatrix<f64> { (triangle * &back).qr().r() };
        let mut most: f64 = 0.0;
        for (triangle, rows) in self.of.iter_mut().zip(rows) {
            *triangle = moved(&stacked(triangle, rows));
            most = most.max(triangle.amax());
        }
        self.back *= &back;
        let own = DMatrix::identity(wide, wide) * (self.accuracy * most);
        self.errors = stacked(&moved(&self.errors), &own).qr().r();
        let is_finite = |matrix: &DMatrix<f64>| matrix.iter().all(|x| x.is_finite());
        let mut all = self.of.iter().chain([&self.errors, &self.back]);
        all.all(is_finite).then_some(())
    }

    /// Standard errors of the start and of the present from the samples of these sensors, as multiples of the scales;
    /// infinite where they are not told. None where the budget is spent.
    pub fn deviations(&self, set: &[usize], budget: &Budget) -> Option<[Vec<f64>; 2]> {
        let wide = self.errors.ncols();
        let parts = set.iter().filter_map(|&s| self.of.get(s));
        let empty = DMatrix::zeros(0, wide);
        let mut factor = parts.fold(empty, |all, part| stacked(&all, part));
        let (lengths, _) = balance(&mut factor, &vec![0.0; wide], 0.0);
        let (values, directions) = singular(factor, budget)?;
        let present = DMatrix::from_fn(wide, wide, |i, j| directions[(i, j)] / lengths[i]);
        let doubt = &self.errors * &present;
        let doubt: Vec<f64> = doubt.column_iter().map(|c| c.norm()).collect();
        let start = &self.back * &present;
        let of = |parts: &DMatrix<f64>| -> Vec<f64> {
            let sizes: Vec<f64> = parts.column_iter().map(|c| c.amax()).collect();
            let error = |i: usize| {
                let mut variance = 0.0;
                for (j, &value) in values.iter().enumerate() {
                    let part = parts[(i, j)].abs();
                    if value > MARGIN * doubt[j] && value > 0.0 {
                        variance += (part / value).powi(2);
                    } else if part > BLUR * sizes[j] {
                        return f64::INFINITY;
                    }
                }
                variance.sqrt()
            };
            (0..wide).map(error).collect()
        };
        Some([of(&start), of(&present)])
    }
}
