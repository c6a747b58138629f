//! Linear matrix inequalities: minimise a linear function of unknowns over
//! symmetric matrices that are affine in them and have to be positive definite.
//!
//! Problems here are small and dense (tens of states, hundreds of unknowns), and a
//! point well inside the inequalities is worth more than the last digit of the
//! objective, because the answer is checked afterwards by interval arithmetic
//! ([`crate::definite`]). So it is a primal barrier method: Newton's method on
//! t·cᵀx − Σ log det F_j(x) for growing t (Boyd, El Ghaoui, Feron and Balakrishnan,
//! *Linear matrix inequalities in system and control theory*, SIAM 1994, section 2.4),
//! after a first phase that finds a point inside.

mod affine;
mod barrier;

pub use affine::Affine;

use barrier::{Barrier, Block, Ended};

use lynkeus_expr::{Budget, Spent};
use nalgebra::{DMatrix, DVector};

/// A point is inside if every inequality holds with this margin.
const MARGIN: f64 = 1e-8;
/// A point inside is sought until its margin is this close to the largest, relatively.
const INSIDE: f64 = 0.3;
/// Gap at which the objective is as good as its minimum, relative to its size.
const GAP: f64 = 1e-4;

/// No point is likely to follow where s is so many gaps above the margin after more than so many steps at
/// one t. With 12 steps proofs were lost that 25 find.
const HOPELESS: f64 = 0.5;
const PATIENCE: usize = 30;

/// A minimisation under linear matrix inequalities. Its points are the values of the unknowns in the
/// order of their introduction.
#[derive(Clone, Debug)]
pub struct Problem {
    unknowns: usize,
    inequalities: Vec<Affine>,
    /// coefficients of the objective, by unknown
    objective: Vec<(usize, f64)>,
    budget: Budget,
}

/// Why there is no solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// no point satisfies every inequality
    Infeasible,
    /// the arithmetic gave out before a decision
    Numerical,
    /// a limit ended the search
    Spent(Spent),
}

impl Problem {
    /// No unknowns, no inequalities; the budget may end the search.
    pub fn new(budget: &Budget) -> Self {
        Self {
            unknowns: 0,
            inequalities: vec![],
            objective: vec![],
            budget: budget.clone(),
        }
    }

    /// Whether its budget has ended.
    pub fn is_spent(&self) -> bool {
        self.budget.spent().is_some()
    }

    /// Newton's matrix, and its factor, for one unknown more than there are.
    fn affords(&self) -> Result<(), Failure> {
        let m = self.unknowns + 1;
        let bytes = m.saturating_mul(m).saturating_mul(3 * size_of::<f64>());
        self.budget.affords(bytes);
        self.budget
            .spent()
            .map_or(Ok(()), |spent| Err(Failure::Spent(spent)))
    }

    fn barrier(&self, blocks: Vec<Block>, cost: DVector<f64>) -> Barrier<'_> {
        let budget = &self.budget;
        Barrier {
            blocks,
            cost,
            budget,
        }
    }

    /// Why the barrier gave no point.
    fn failure(&self) -> Failure {
        self.budget
            .marked()
            .map_or(Failure::Numerical, Failure::Spent)
    }

    /// The first of so many more unknowns.
    fn fresh(&mut self, count: usize) -> usize {
        let first = self.unknowns;
        self.unknowns += count;
        first
    }

    /// An unknown symmetric n×n matrix.
    pub fn symmetric(&mut self, n: usize) -> Affine {
        self.symmetric_where(n, |_, _| true)
    }

    /// An unknown symmetric n×n matrix with zeros where `kept` says no; it is asked for rows
    /// i ≤ j only.
    pub fn symmetric_where(&mut self, n: usize, kept: impl Fn(usize, usize) -> bool) -> Affine {
        let mut column = |j: usize| {
            let place = |i: usize| kept(i, j).then(|| self.fresh(1));
            (0..=j).map(place).collect::<Vec<_>>()
        };
        let places: Vec<Vec<Option<usize>>> = (0..n).map(&mut column).collect();
        Affine::unknown(n, n, |i, j| places[i.max(j)][i.min(j)])
    }

    /// An unknown matrix.
    pub fn matrix(&mut self, rows: usize, columns: usize) -> Affine {
        let first = self.fresh(rows * columns);
        Affine::unknown(rows, columns, |i, j| Some(first + i * columns + j))
    }

    /// An unknown diagonal n×n matrix.
    pub fn diagonal(&mut self, n: usize) -> Affine {
        let first = self.fresh(n);
        Affine::unknown(n, n, |i, j| (i == j).then_some(first + i))
    }

    /// Demands F(x) > 0.
    pub fn positive(&mut self, inequality: Affine) {
        debug_assert_eq!(inequality.rows(), inequality.columns());
        self.inequalities.push(inequality);
    }

    /// The objective, a 1×1 matrix.
    pub fn minimise(&mut self, objective: &Affine) {
        self.objective = objective.terms(0, 0).collect();
    }

    /// A point inside, near the minimum of the objective where there is one.
    ///
    /// # Errors
    /// [`Failure`].
    pub fn solve(&self) -> Result<DVector<f64>, Failure> {
        self.solve_from(&self.inside()?)
    }

    /// The point at which unknown matrices of this problem have these values.
    pub fn point(&self, parts: &[(&Affine, DMatrix<f64>)]) -> DVector<f64> {
        let mut values = DVector::zeros(self.unknowns);
        for (matrix, value) in parts {
            for j in 0..matrix.columns() {
                for i in 0..matrix.rows() {
                    for (unknown, _) in matrix.terms(i, j) {
                        values[unknown] = value[(i, j)];
                    }
                }
            }
        }
        values
    }

    /// The same from a known point inside.
    ///
    /// # Errors
    /// [`Failure::Infeasible`] where the point is not inside.
    pub fn solve_from(&self, start: &DVector<f64>) -> Result<DVector<f64>, Failure> {
        self.affords()?;
        let mut cost = DVector::zeros(self.unknowns);
        for &(unknown, coefficient) in &self.objective {
            cost[unknown] = coefficient;
        }
        let blocks = self.inequalities.iter().map(Block::new).collect();
        let barrier = self.barrier(blocks, cost);
        if !barrier.is_inside(start) {
            return Err(Failure::Infeasible);
        }
        let good = |x: &DVector<f64>, gap: f64| gap < GAP * (1e-3 + barrier.cost.dot(x).abs());
        // a point short of the minimum is a solution all the same
        let found = barrier.minimise(start.clone(), good, |_, _, _| false);
        Ok(found.ok_or_else(|| self.failure())?.x)
    }

    /// A point inside every inequality, by about the largest margin that there is.
    /// Inequalities that hold where every unknown is zero are kept from the start; of
    /// the others, all are relaxed by the same s, which is then minimised.
    ///
    /// # Errors
    /// [`Failure`].
    pub fn inside(&self) -> Result<DVector<f64>, Failure> {
        self.relaxed(is_well_inside, |_, _, _| false)
    }

    /// A point inside, taken as soon as one is met with some margin, and given up where none is likely to
    /// follow: for the many problems of a search by halving, near whose end the central path is slow.
    ///
    /// # Errors
    /// [`Failure`]; [`Failure::Infeasible`] where the search gave up, too.
    pub fn inside_soon(&self) -> Result<DVector<f64>, Failure> {
        self.relaxed(is_well_inside, |s, gap, steps| {
            let is_there = s < -MARGIN.max(gap);
            let is_hopeless = s > HOPELESS * gap && steps > PATIENCE;
            is_there || is_hopeless
        })
    }

    /// Whether there is a point inside at all: cheaper than one that is well inside.
    ///
    /// # Errors
    /// [`Failure`], [`Failure::Infeasible`] where there is none.
    pub fn has_inside(&self) -> Result<(), Failure> {
        let enough = |s, gap| s < -MARGIN || gap < 1e-2 * MARGIN;
        let found = self.relaxed(enough, |_, _, _| false);
        found.map(|_| ())
    }

    /// Minimises the s by which inequalities are relaxed until it is known to stay above the
    /// margin, or is `enough` for its value and the gap to its minimum. `ends` is that of [`Barrier::minimise`].
    fn relaxed(
        &self,
        enough: impl Fn(f64, f64) -> bool,
        ends: impl Fn(f64, f64, usize) -> bool,
    ) -> Result<DVector<f64>, Failure> {
        self.affords()?;
        let s = self.unknowns;
        let relaxed = |f: &Affine| {
            let slack = Affine::unknown(f.rows(), f.rows(), |i, j| (i == j).then_some(s));
            match f.constants().cholesky().is_some() {
                true => Block::new(f),
                false => Block::new(&f.plus(&slack)),
            }
        };
        let mut blocks: Vec<Block> = self.inequalities.iter().map(relaxed).collect();
        // s > −1: an inequality without bound has no need to hold by more
        let floor = Affine::unknown(1, 1, |_, _| Some(s)).plus(&Affine::identity(1));
        blocks.push(Block::new(&floor));
        // a bound of the eigenvalues of the constant part
        let norm = |f: &Affine| {
            let constants = f.constants();
            let rows = constants
                .row_iter()
                .map(|row| row.iter().map(|c| c.abs()).sum());
            rows.fold(0.0, f64::max)
        };
        let norms = self.inequalities.iter().map(norm);
        let mut start = DVector::zeros(s + 1);
        start[s] = 1.0 + norms.fold(0.0, f64::max);
        let mut cost = DVector::zeros(s + 1);
        cost[s] = 1.0;
        let barrier = self.barrier(blocks, cost);
        let decided = |x: &DVector<f64>, gap: f64| x[s] - gap > -MARGIN || enough(x[s], gap);
        let ends = |x: &DVector<f64>, gap: f64, steps: usize| ends(x[s], gap, steps);
        let ended = barrier.minimise(start, decided, ends);
        let Ended { x, decided } = ended.ok_or_else(|| self.failure())?;
        match x[s] < -MARGIN {
            true => Ok(x.rows(0, s).into_owned()),
            false if decided => Err(Failure::Infeasible),
            false => Err(self.failure()),
        }
    }
}

/// Whether no point can be much further inside than one that holds every inequality relaxed by s.
fn is_well_inside(s: f64, gap: f64) -> bool {
    gap < INSIDE * s.abs() || gap < 1e-2 * MARGIN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_lyapunov_matrix_is_found() {
        // P ≥ I with AᵀP + PA ≤ −I
        let A = DMatrix::from_row_slice(2, 2, &[-1.0, 4.0, 0.0, -2.0]);
        let mut problem = Problem::new(&Budget::default());
        let P = problem.symmetric(2);
        let identity = Affine::identity(2);
        problem.positive(P.minus(&identity));
        problem.positive(P.times(&A).he().scaled(-1.0).minus(&identity));
        problem.minimise(&P.trace());
        let P = P.at(&problem.solve().unwrap());
        assert!((A.transpose() * &P + &P * A).symmetric_eigenvalues().max() < -0.99);
    }
}
