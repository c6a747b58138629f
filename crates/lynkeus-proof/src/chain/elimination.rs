//! The first inequality for chains whose partials have too many vertices to visit.

use lynkeus_expr::Interval;

use crate::elimination::{columns, positive};

use super::Chain;
use crate::matrix::sum;
use crate::search::largest;

impl Chain {
    /// μ, state by state; none for an S that is not tridiagonal.
    pub(super) fn eliminated_decay(&self) -> Option<f64> {
        let (n, S) = (self.size(), &self.S);
        let far = |i: usize, j: usize| i.abs_diff(j) > 1 && S[i][j].magnitude() != 0.0;
        if (0..n).any(|i| (0..n).any(|j| far(i, j))) {
            return None;
        }
        let D: Vec<Interval> = (0..n).map(|j| self.weight(j)).collect();
        let Sg = self.pushed();
        let first = Interval::point(2.0) * Sg[0] / S[0][0];
        // g = rS⁻¹Cᵀ up to rounding: the rest of Sg is small, its arrow has this norm
        let rest = (1..n).map(|i| (Sg[i] / (D[0] * D[i])).powi(2));
        let stray = sum(rest).sqrt().hi();
        let columns = columns(n, |i, j| S[i][j]);
        let proved = |μ: f64| {
            let shift = (Interval::point(μ) + Interval::point(stray)).hi();
            positive(first, &columns, &self.partials, shift)
        };
        largest(first.hi(), proved)
    }
}
