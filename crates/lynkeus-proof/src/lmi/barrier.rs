//! Newton's method on t·cᵀx − Σ log det F_j(x) − log(R² − |x|²).

use lynkeus_expr::Budget;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::block::Block;

/// t grows by this factor between centrings.
const GROWTH: f64 = 12.0;
/// A point counts as central when Newton's decrement is below this.
const CENTRAL: f64 = 0.1;
/// Near enough to the central path to move on along it. Steps far from the centre
/// lower the merit by a constant each, and centring every time would take many.
const NEAR: f64 = 1.0;
/// Columns of a Cholesky factor that are found before the rest is told of them.
const PANEL: usize = 64;
/// Newton steps altogether.
const STEPS: usize = 400;

/// Where the search for a minimum ended, and why.
pub(super) struct Ended {
    /// a point inside
    pub x: DVector<f64>,
    /// it is central, and good; else the arithmetic, the budget or the steps gave out
    pub decided: bool,
}

/// A barrier problem.
pub(super) struct Barrier<'a> {
    pub blocks: &'a [Block],
    pub cost: DVector<f64>,
    pub radius: f64,
    pub budget: &'a Budget,
}

impl Barrier<'_> {
    /// From a point inside to near the minimum, until `good(x, gap)`: the gap bounds
    /// how far cᵀx is above its minimum. Where the arithmetic gives out, or the budget
    /// or the steps, the last point is returned: it is still inside, but nothing is decided.
    /// None where the start is not.
    pub(super) fn minimise(
        &self,
        mut x: DVector<f64>,
        good: impl Fn(&DVector<f64>, f64) -> bool,
    ) -> Option<Ended> {
        let order = 1.0 + self.blocks.iter().map(|b| b.size as f64).sum::<f64>();
        let mut t = self.first(&x, order)?;
        for _ in 0..STEPS {
            let factors = self.factors(&x)?;
            let (g, H) = self.derivatives(&x, &factors, t);
            let Some(step) = newton(H, &g, self.budget) else {
                break;
            };
            let decrement = -g.dot(&step);
            let done = good(&x, order / t);
            if decrement < if done { CENTRAL } else { NEAR } {
                if done {
                    return Some(Ended { x, decided: true });
                }
                t *= GROWTH;
                continue;
            }
            match self.advanced(&x, &step, &factors, t, decrement) {
                Some(next) => x = next,
                None => break,
            }
        }
        Some(Ended { x, decided: false })
    }

    /// The t for which the start is most nearly central, within reason:
    /// it minimises |tc + g| in the metric of the barrier's inverse Hessian.
    fn first(&self, x: &DVector<f64>, order: f64) -> Option<f64> {
        let usual = order / (1.0 + self.cost.dot(x).abs());
        let (g, H) = self.derivatives(x, &self.factors(x)?, 0.0);
        let towards = newton(H, &self.cost, self.budget)?;
        let nearest = -towards.dot(&g) / towards.dot(&self.cost);
        Some(nearest.clamp(30.0 * usual, 1e4 * usual))
    }

    pub(super) fn is_inside(&self, x: &DVector<f64>) -> bool {
        self.factors(x).is_some()
    }

    fn factors(&self, x: &DVector<f64>) -> Option<Vec<Cholesky<f64, Dyn>>> {
        if x.norm_squared() >= self.radius * self.radius {
            return None;
        }
        self.blocks
            .iter()
            .map(|block| block.value(x).cholesky())
            .collect()
    }

    fn derivatives(
        &self,
        x: &DVector<f64>,
        factors: &[Cholesky<f64, Dyn>],
        t: f64,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let slack = self.radius * self.radius - x.norm_squared();
        let mut g = &self.cost * t + x * (2.0 / slack);
        let m = x.len();
        let mut H = DMatrix::identity(m, m) * (2.0 / slack);
        H.ger(4.0 / (slack * slack), x, x, 1.0);
        for (block, factor) in self.blocks.iter().zip(factors) {
            block.derivatives(&factor.inverse(), &mut g, &mut H, self.budget);
        }
        (g, H)
    }

    fn merit(&self, x: &DVector<f64>, factors: &[Cholesky<f64, Dyn>], t: f64) -> f64 {
        let log_det = |factor: &Cholesky<f64, Dyn>| -> f64 {
            2.0 * factor
                .l_dirty()
                .diagonal()
                .iter()
                .map(|d| d.ln())
                .sum::<f64>()
        };
        let slack = self.radius * self.radius - x.norm_squared();
        t * self.cost.dot(x) - slack.ln() - factors.iter().map(log_det).sum::<f64>()
    }

    /// A step along Newton's direction that lowers the merit.
    fn advanced(
        &self,
        x: &DVector<f64>,
        step: &DVector<f64>,
        factors: &[Cholesky<f64, Dyn>],
        t: f64,
        decrement: f64,
    ) -> Option<DVector<f64>> {
        let merit = self.merit(x, factors, t);
        let mut length = 1.0;
        while length > 1e-12 {
            let next = x + step * length;
            if let Some(factors) = self.factors(&next)
                && self.merit(&next, &factors, t) <= merit - 1e-4 * length * decrement
            {
                return Some(next);
            }
            length *= 0.6;
        }
        None
    }
}

/// −H⁻¹g, with unknowns scaled so that H has a unit diagonal; none where the budget is spent.
/// Of H the lower triangle is read.
fn newton(mut H: DMatrix<f64>, g: &DVector<f64>, budget: &Budget) -> Option<DVector<f64>> {
    if budget.spent().is_some() {
        return None;
    }
    let scale = H.diagonal().map(|h| 1.0 / h.sqrt());
    for (j, mut column) in H.column_iter_mut().enumerate() {
        let below = column.as_mut_slice().iter_mut().zip(scale.as_slice());
        below
            .skip(j)
            .for_each(|(h, factor)| *h *= factor * scale[j]);
    }
    let right = -g.component_mul(&scale);
    let mut ridge = 1e-14;
    while ridge < 1e-4 {
        let mut regular = H.clone();
        regular.fill_diagonal(1.0 + ridge);
        if let Some(factor) = cholesky(regular, budget) {
            return Some(factor.solve(&right).component_mul(&scale));
        }
        ridge *= 100.0;
    }
    None
}

/// The factor of a matrix that may be large, panel by panel; none where it has none, or
/// the budget ends.
fn cholesky(mut L: DMatrix<f64>, budget: &Budget) -> Option<Cholesky<f64, Dyn>> {
    let n = L.ncols();
    for from in (0..n).step_by(PANEL) {
        if budget.spent().is_some() {
            return None;
        }
        let to = (from + PANEL).min(n);
        panel(&mut L, from, to)?;
        let below = L.view((to, from), (n - to, to - from)).into_owned();
        for first in (to..n).step_by(PANEL) {
            let width = PANEL.min(n - first);
            let mirrored = below.rows(first - to, width).transpose();
            let taken = below.rows_range(first - to..);
            let mut rest = L.view_mut((first, first), (n - first, width));
            rest.gemm(-1.0, &taken, &mirrored, 1.0);
        }
    }
    Some(Cholesky::pack_dirty(L))
}

/// Some columns of the factor, from which those before have been taken.
fn panel(L: &mut DMatrix<f64>, from: usize, to: usize) -> Option<()> {
    for j in from..to {
        for k in from..j {
            let factor = -L[(j, k)];
            let (mut column, before) = L.columns_range_pair_mut(j, k);
            let before = before.rows_range(j..);
            column.rows_range_mut(j..).axpy(factor, &before, 1.0);
        }
        let pivot = L[(j, j)];
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        let mut column = L.column_mut(j);
        let mut below = column.rows_range_mut(j..);
        below /= pivot.sqrt();
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lmi::Affine;

    /// Fewer rows than a panel, just as many, and several panels, against the matrix itself.
    #[test]
    fn factors_give_the_matrix_back() {
        for n in [1, PANEL - 1, PANEL, PANEL + 1, 3 * PANEL + 7] {
            let random = DMatrix::from_fn(n, n, |i, j| ((7 * i + 3 * j + i * j) as f64).sin());
            let matrix = &random * random.transpose() + DMatrix::identity(n, n);
            let factor = cholesky(matrix.clone(), &Budget::default()).unwrap();
            let off = factor.l() * factor.l().transpose() - &matrix;
            assert!(off.amax() < 1e-12 * matrix.amax() * n as f64);
            let mut indefinite = matrix;
            indefinite[(n - 1, n - 1)] = -1.0;
            assert!(cholesky(indefinite, &Budget::default()).is_none());
        }
    }

    /// x² < 1/4 and x > 0, where x is minimised: a minimum is decided once it is good; where
    /// nothing is good enough the arithmetic ends it at a point inside, and decides nothing.
    #[test]
    fn an_end_for_want_of_digits_decides_nothing() {
        let x = Affine::unknown(1, 1, |_, _| Some(0));
        let half = Affine::identity(1).scaled(0.5);
        let blocks = [
            Block::new(&Affine::symmetric_blocks(&half, &x, &half)),
            Block::new(&x),
        ];
        let budget = Budget::default();
        let barrier = Barrier {
            blocks: &blocks,
            cost: DVector::from_element(1, 1.0),
            radius: 1e3,
            budget: &budget,
        };
        let start = || DVector::from_element(1, 0.3);
        let found = barrier.minimise(start(), |_, gap| gap < 1e-6).unwrap();
        assert!(found.decided && found.x[0] > 0.0 && found.x[0] < 1e-6);
        let found = barrier.minimise(start(), |_, _| false).unwrap();
        assert!(!found.decided && barrier.is_inside(&found.x));
        let outside = DVector::from_element(1, 0.6);
        assert!(barrier.minimise(outside, |_, _| true).is_none());
    }
}
