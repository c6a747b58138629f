//! The inequalities of a gain's design, and points inside them.

use crate::lmi::{Affine, Failure, Problem, Solution};
use crate::lyapunov::symmetric;
use crate::spectrum;

/// Bound of Y in the first phase, where P ≤ I.
const WIDE: f64 = 30.0;
/// The bound that is tried where that one leaves no gain.
pub(super) const WIDEST: f64 = 3e3;

/// A problem in P and Y = PK.
pub(super) struct Inequalities {
    pub problem: Problem,
    pub P: Affine,
    pub Y: Affine,
    /// multipliers, per model
    pub T: Vec<Affine>,
}

impl Inequalities {
    /// With P ≤ I and |Y| ≤ `large`.
    pub fn bounded(&self, large: f64) -> Problem {
        let mut bounded = self.problem.clone();
        bounded.positive(Affine::identity(self.P.rows()).minus(&self.P));
        let wide = |n: usize| Affine::identity(n).scaled(large);
        let (rows, columns) = (wide(self.Y.rows()), wide(self.Y.columns()));
        bounded.positive(Affine::symmetric_blocks(&rows, &self.Y, &columns));
        bounded
    }

    /// Fails where it is decided that no point is inside, or a limit ended the search; what the
    /// arithmetic did not decide may be decided with other bounds.
    pub fn may_have_inside(&self) -> Result<(), Failure> {
        match self.bounded(WIDEST).has_inside() {
            Err(Failure::Numerical) => Ok(()),
            told => told,
        }
    }

    /// A point inside, from the same problem with P and Y bounded above, scaled so that
    /// P > I: the inequalities are homogeneous.
    pub fn normalised(&self) -> Result<Solution, Failure> {
        let inside = |large: f64| self.bounded(large).inside();
        let inside = inside(WIDE).or_else(|_| inside(WIDEST))?;
        let eigen = spectrum::symmetric(symmetric(&inside.value(&self.P)));
        let smallest = eigen.ok_or(Failure::Numerical)?.eigenvalues.min();
        if smallest <= 0.0 {
            return Err(Failure::Numerical);
        }
        Ok(inside.scaled(1.1 / smallest))
    }

    /// The point of the same problem with fewer unknowns.
    pub fn like(&self, other: &Inequalities, point: &Solution) -> Solution {
        let mut pairs = vec![(&self.P, &other.P), (&self.Y, &other.Y)];
        pairs.extend(self.T.iter().zip(&other.T));
        let parts = pairs.into_iter().map(|(own, its)| (own, point.value(its)));
        self.problem.point(&parts.collect::<Vec<_>>())
    }
}

/// Values for Z and β with room to spare, and |P|.
pub(super) fn roomy(first: &Solution, P: &Affine, Y: &Affine) -> Result<(Solution, f64), Failure> {
    let (P, Y) = (symmetric(&first.value(P)), first.value(Y));
    let eigen = spectrum::symmetric(P.clone()).ok_or(Failure::Numerical)?;
    let largest = eigen.eigenvalues.max();
    let factor = P.cholesky().ok_or(Failure::Numerical)?;
    let Z = symmetric(&(Y.transpose() * factor.solve(&Y))) * 2.0;
    let room = 1.0 + Z.trace() * 1e-3;
    let mut newer = vec![];
    for j in 0..Z.ncols() {
        for i in 0..=j {
            newer.push(Z[(i, j)] + if i == j { room } else { 0.0 });
        }
    }
    newer.push(2.0 * largest);
    Ok((first.with(&newer), largest))
}
