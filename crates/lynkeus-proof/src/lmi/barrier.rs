//! Newton's method on t·cᵀx − Σ log det F_j(x) − log(R² − |x|²).

use std::collections::BTreeMap;

use lynkeus_expr::Budget;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::Affine;

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
/// Unknowns larger than this do not occur in a well scaled problem; the bound keeps
/// the feasible set compact.
const RADIUS: f64 = 1e12;

/// Where the search for a minimum ended, and why.
pub(super) struct Ended {
    /// a point inside
    pub x: DVector<f64>,
    /// it is central, and good; else the arithmetic, the budget or the steps gave out
    pub decided: bool,
}

/// A barrier problem.
pub(super) struct Barrier<'a> {
    pub blocks: Vec<Block>,
    pub cost: DVector<f64>,
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
        if x.norm_squared() >= RADIUS * RADIUS {
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
        let slack = RADIUS * RADIUS - x.norm_squared();
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
        let slack = RADIUS * RADIUS - x.norm_squared();
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

/// F(x), by its terms in ascending order of their unknowns.
pub(super) struct Block {
    pub size: usize,
    constant: DMatrix<f64>,
    terms: Vec<Term>,
}

/// F_k of one unknown that occurs.
struct Term {
    unknown: usize,
    /// entries of the upper triangle
    entries: Vec<Entry>,
    /// F_k = Σ e_i vᵀ + v e_iᵀ over few rows i
    rows: Vec<Row>,
}

/// An entry on or above the diagonal.
#[derive(Clone, Copy)]
struct Entry {
    i: usize,
    j: usize,
    value: f64,
    /// of the n×n matrix, column by column
    place: usize,
    /// the value, twice where it has a mirror image
    weight: f64,
}

impl Entry {
    fn new((i, j, value): (usize, usize, f64), n: usize) -> Self {
        Self {
            i,
            j,
            value,
            place: j * n + i,
            weight: if i == j { value } else { 2.0 * value },
        }
    }
}

/// A row of a symmetric matrix, and the column that mirrors it.
struct Row {
    place: usize,
    /// the entries of v that are not zero
    entries: Vec<(usize, f64)>,
}

impl Term {
    fn new(unknown: usize, entries: Vec<Entry>, n: usize) -> Self {
        let mut rows = vec![];
        let mut left = entries.clone();
        while !left.is_empty() {
            let mut counts = vec![0; n];
            for entry in &left {
                counts[entry.i] += 1;
                counts[entry.j] += 1;
            }
            let fullest = (0..n).max_by_key(|&i| counts[i]).unwrap_or(0);
            let mut row = vec![];
            left.retain(|&Entry { i, j, value, .. }| {
                match (i == fullest, j == fullest) {
                    (true, true) => row.push((i, 0.5 * value)),
                    (true, false) => row.push((j, value)),
                    (false, true) => row.push((i, value)),
                    (false, false) => return true,
                }
                false
            });
            rows.push(Row {
                place: fullest,
                entries: row,
            });
        }
        Self {
            unknown,
            entries,
            rows,
        }
    }

    /// tr(F G) for symmetric G, of which the upper triangle is read.
    fn inner(&self, G: &[f64]) -> f64 {
        let entries = self.entries.iter();
        entries.map(|entry| entry.weight * G[entry.place]).sum()
    }

    /// The upper triangle of W F W, into G; `b` has room for a column.
    fn sandwiched(&self, W: &DMatrix<f64>, b: &mut DVector<f64>, G: &mut DMatrix<f64>) {
        let n = W.ncols();
        for (place, row) in self.rows.iter().enumerate() {
            let a = W.column(row.place);
            b.fill(0.0);
            for &(j, value) in &row.entries {
                b.axpy(value, &W.column(j), 1.0);
            }
            let (a, b) = (a.as_slice(), b.as_slice());
            for (column, into) in G.as_mut_slice().chunks_mut(n).enumerate() {
                let (of_a, of_b) = (a[column], b[column]);
                let pairs = a[..=column].iter().zip(&b[..=column]);
                let pairs = into[..=column].iter_mut().zip(pairs);
                match place {
                    0 => pairs.for_each(|(g, (a, b))| *g = a * of_b + b * of_a),
                    _ => pairs.for_each(|(g, (a, b))| *g += a * of_b + b * of_a),
                }
            }
        }
    }
}

/// Terms between two looks at the budget, each of which asks the clock.
const LOOK: usize = 16;

impl Block {
    pub fn new(F: &Affine) -> Self {
        let n = F.rows();
        let mut terms: BTreeMap<usize, Vec<Entry>> = BTreeMap::new();
        for i in 0..n {
            for j in i..n {
                for (unknown, value) in F.terms(i, j).filter(|(_, value)| *value != 0.0) {
                    let entry = Entry::new((i, j, value), n);
                    terms.entry(unknown).or_default().push(entry);
                }
            }
        }
        let (terms, constants) = (terms.into_iter(), F.constants());
        Self {
            size: n,
            constant: DMatrix::from_fn(n, n, |i, j| constants[(i.min(j), i.max(j))]),
            terms: terms.map(|(k, entries)| Term::new(k, entries, n)).collect(),
        }
    }

    pub fn value(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let mut F = self.constant.clone();
        for term in &self.terms {
            for &Entry { i, j, value, .. } in &term.entries {
                F[(i, j)] += x[term.unknown] * value;
                if i != j {
                    F[(j, i)] += x[term.unknown] * value;
                }
            }
        }
        F
    }

    /// Adds −∇ log det and the lower triangle of its Hessian: with W = F⁻¹,
    /// g_k = −tr(W F_k) and H_kl = tr(W F_k W F_l). Where the budget ends they are not whole,
    /// and nobody reads them: who does asks for the budget first.
    pub fn derivatives(
        &self,
        W: &DMatrix<f64>,
        g: &mut DVector<f64>,
        H: &mut DMatrix<f64>,
        budget: &Budget,
    ) {
        let (n, m) = (self.size, H.nrows());
        let (mut b, mut G) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for (a, term) in self.terms.iter().enumerate() {
            if a % LOOK == 0 && budget.spent().is_some() {
                return;
            }
            let k = term.unknown;
            g[k] -= term.inner(W.as_slice());
            term.sandwiched(W, &mut b, &mut G);
            let column = &mut H.as_mut_slice()[k * m..(k + 1) * m];
            for other in &self.terms[a..] {
                column[other.unknown] += other.inner(G.as_slice());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let blocks = vec![
            Block::new(&Affine::symmetric_blocks(&half, &x, &half)),
            Block::new(&x),
        ];
        let budget = Budget::default();
        let barrier = Barrier {
            blocks,
            cost: DVector::from_element(1, 1.0),
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

    /// tr(F W) and W F W of a term with several rows against the whole matrices.
    #[test]
    fn a_term_is_what_its_entries_say() {
        let n = 5;
        let entries = vec![(0, 3, 2.0), (1, 1, -1.0), (1, 4, 0.5), (2, 3, 1.5)];
        let mut F = DMatrix::zeros(n, n);
        for &(i, j, value) in &entries {
            F[(i, j)] = value;
            F[(j, i)] = value;
        }
        let entries = entries.into_iter().map(|entry| Entry::new(entry, n));
        let term = Term::new(0, entries.collect(), n);
        let W = DMatrix::from_fn(n, n, |i, j| ((i * j) as f64).cos());
        let expected = &W * &F * &W;
        // what was in the room before does not count
        let mut found = DMatrix::from_element(n, n, 7.0);
        term.sandwiched(&W, &mut DVector::from_element(n, 3.0), &mut found);
        for j in 0..n {
            for i in 0..=j {
                assert!((found[(i, j)] - expected[(i, j)]).abs() < 1e-13);
            }
        }
        assert!((term.inner(W.as_slice()) - (&F * &W).trace()).abs() < 1e-13);
    }

    /// Gradient and Hessian of −log det F against differences.
    #[test]
    fn derivatives_are_those_of_the_barrier() {
        let unknown = |i: usize, j: usize| {
            Affine::unknown(3, 3, |r, c| {
                ((r, c) == (i, j) || (r, c) == (j, i)).then_some(i + j)
            })
        };
        let mut F = Affine::constant(&DMatrix::from_diagonal_element(3, 3, 4.0));
        for (i, j, factor) in [
            (0, 0, 1.0),
            (0, 1, 0.5),
            (1, 1, -0.3),
            (1, 2, 0.7),
            (0, 2, 0.2),
        ] {
            F = F.plus(&unknown(i, j).scaled(factor));
        }
        let block = Block::new(&F);
        let x = DVector::from_vec(vec![0.3, -0.4, 0.2, 0.5]);
        let barrier = |x: &DVector<f64>| -block.value(x).determinant().ln();
        let (mut g, mut H) = (DVector::zeros(4), DMatrix::zeros(4, 4));
        let W = block.value(&x).try_inverse().unwrap();
        block.derivatives(&W, &mut g, &mut H, &Budget::default());
        let h = 1e-4;
        let moved = |steps: &[(usize, f64)]| {
            let mut x = x.clone();
            steps.iter().for_each(|&(k, s)| x[k] += s * h);
            barrier(&x)
        };
        for k in 0..4 {
            let slope = (moved(&[(k, 1.0)]) - moved(&[(k, -1.0)])) / (2.0 * h);
            assert!((g[k] - slope).abs() < 1e-6, "{k}");
            for l in k..4 {
                let sides = moved(&[(k, 1.0), (l, 1.0)]) + moved(&[(k, -1.0), (l, -1.0)]);
                let across = moved(&[(k, 1.0), (l, -1.0)]) + moved(&[(k, -1.0), (l, 1.0)]);
                let bend = (sides - across) / (4.0 * h * h);
                assert!((H[(l, k)] - bend).abs() < 1e-5, "{k} {l}");
            }
        }
    }
}
