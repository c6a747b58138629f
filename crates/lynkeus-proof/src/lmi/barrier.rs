//! Newton's method on t·cᵀx − Σ log det F_j(x) − log(R² − |x|²).

use std::collections::BTreeMap;
use std::ops::Range;

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

/// The factors of the blocks' values.
type Factors = Vec<Cholesky<f64, Dyn>>;

/// The barrier about a point, whatever t is.
struct Local {
    factors: Factors,
    /// what the blocks take from the gradient, (unknown, tr(W F_k)) in their order
    slopes: Vec<(usize, f64)>,
    /// none where the arithmetic gave out or the budget ended
    curvature: Option<Curvature>,
}

impl Barrier<'_> {
    /// From a point inside to near the minimum, until `good(x, gap)`: the gap bounds
    /// how far cᵀx is above its minimum. Where the arithmetic gives out, or the budget
    /// or the steps, the last point is returned: it is still inside, but nothing is decided.
    /// None where the start is not. `ends` may end it at any point, from its gap as if it were central and
    /// the steps since t has grown.
    pub(super) fn minimise(
        &self,
        mut x: DVector<f64>,
        good: impl Fn(&DVector<f64>, f64) -> bool,
        ends: impl Fn(&DVector<f64>, f64, usize) -> bool,
    ) -> Option<Ended> {
        let order = 1.0 + self.blocks.iter().map(|b| b.size as f64).sum::<f64>();
        let mut local = self.local(&x, self.factors(&x)?);
        let mut t = self.first(&x, &local, order)?;
        let mut grown = 0;
        for steps in 0..STEPS {
            if ends(&x, order / t, steps - grown) {
                return Some(Ended { x, decided: true });
            }
            let Some(curvature) = &local.curvature else {
                break;
            };
            let g = self.gradient(&x, &local, t);
            let step = curvature.newton(&g);
            let decrement = -g.dot(&step);
            let done = good(&x, order / t);
            if decrement < if done { CENTRAL } else { NEAR } {
                if done {
                    return Some(Ended { x, decided: true });
                }
                (t, grown) = (t * GROWTH, steps);
                continue;
            }
            match self.advanced(&x, &step, &local.factors, t, decrement) {
                Some((next, factors)) => {
                    local = self.local(&next, factors);
                    x = next;
                }
                None => break,
            }
        }
        Some(Ended { x, decided: false })
    }

    /// The t for which the start is most nearly central, within reason:
    /// it minimises |tc + g| in the metric of the barrier's inverse Hessian.
    fn first(&self, x: &DVector<f64>, local: &Local, order: f64) -> Option<f64> {
        let usual = order / (1.0 + self.cost.dot(x).abs());
        let g = self.gradient(x, local, 0.0);
        let towards = local.curvature.as_ref()?.newton(&self.cost);
        let nearest = -towards.dot(&g) / towards.dot(&self.cost);
        Some(nearest.clamp(30.0 * usual, 1e4 * usual))
    }

    pub(super) fn is_inside(&self, x: &DVector<f64>) -> bool {
        self.factors(x).is_some()
    }

    fn factors(&self, x: &DVector<f64>) -> Option<Factors> {
        if x.norm_squared() >= RADIUS * RADIUS {
            return None;
        }
        self.blocks
            .iter()
            .map(|block| block.value(x).cholesky())
            .collect()
    }

    /// RADIUS² − |x|²
    fn slack(x: &DVector<f64>) -> f64 {
        RADIUS * RADIUS - x.norm_squared()
    }

    /// Gradient and Hessian, as far as they do not depend on t.
    fn local(&self, x: &DVector<f64>, factors: Factors) -> Local {
        let slack = Self::slack(x);
        let m = x.len();
        let mut slopes = vec![];
        let mut H = DMatrix::identity(m, m) * (2.0 / slack);
        // elsewhere it changes no digit, and leaves zeros where no inequality has both unknowns
        if x.norm_squared() > f64::EPSILON * slack {
            H.ger(4.0 / (slack * slack), x, x, 1.0);
        }
        for (block, factor) in self.blocks.iter().zip(&factors) {
            block.derivatives(&factor.inverse(), &mut slopes, &mut H, self.budget);
        }
        Local {
            factors,
            slopes,
            curvature: Curvature::of(H, self.budget),
        }
    }

    fn gradient(&self, x: &DVector<f64>, local: &Local, t: f64) -> DVector<f64> {
        let mut g = &self.cost * t + x * (2.0 / Self::slack(x));
        for &(unknown, slope) in &local.slopes {
            g[unknown] -= slope;
        }
        g
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
        let logarithms = factors.iter().map(log_det).sum::<f64>();
        t * self.cost.dot(x) - Self::slack(x).ln() - logarithms
    }

    /// A point along Newton's direction with a lower merit, and the blocks' factors there.
    fn advanced(
        &self,
        x: &DVector<f64>,
        step: &DVector<f64>,
        factors: &[Cholesky<f64, Dyn>],
        t: f64,
        decrement: f64,
    ) -> Option<(DVector<f64>, Factors)> {
        let merit = self.merit(x, factors, t);
        let mut length = 1.0;
        while length > 1e-12 {
            let next = x + step * length;
            if let Some(factors) = self.factors(&next)
                && self.merit(&next, &factors, t) <= merit - 1e-4 * length * decrement
            {
                return Some((next, factors));
            }
            length *= 0.6;
        }
        None
    }
}

/// A Hessian, factored with its unknowns scaled so that it has a unit diagonal.
struct Curvature {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Curvature {
    /// None where the budget is spent. Of H the lower triangle is read.
    fn of(mut H: DMatrix<f64>, budget: &Budget) -> Option<Self> {
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
        let mut ridge = 1e-14;
        while ridge < 1e-4 {
            let mut regular = H.clone();
            regular.fill_diagonal(1.0 + ridge);
            if let Some(factor) = cholesky(regular, budget) {
                return Some(Self { scale, factor });
            }
            ridge *= 100.0;
        }
        None
    }

    /// −H⁻¹g
    fn newton(&self, g: &DVector<f64>) -> DVector<f64> {
        let right = -g.component_mul(&self.scale);
        self.factor.solve(&right).component_mul(&self.scale)
    }
}

/// The factor of a matrix that may be large, panel by panel; none where it has none, or
/// the budget ends. Panels of zeros stay: unknowns that come in the order in which inequalities couple them leave many.
fn cholesky(mut L: DMatrix<f64>, budget: &Budget) -> Option<Cholesky<f64, Dyn>> {
    let n = L.ncols();
    for from in (0..n).step_by(PANEL) {
        if budget.spent().is_some() {
            return None;
        }
        let to = (from + PANEL).min(n);
        panel(&mut L, from, to)?;
        let below = L.view((to, from), (n - to, to - from)).into_owned();
        let panels: Vec<usize> = (to..n).step_by(PANEL).collect();
        let height = |first: usize| PANEL.min(n - first);
        let taken = |first: usize| below.rows(first - to, height(first));
        let is_coupled = |first: &usize| taken(*first).iter().any(|x| *x != 0.0);
        let coupled: Vec<usize> = panels.into_iter().filter(is_coupled).collect();
        for (place, &right) in coupled.iter().enumerate() {
            let mirrored = taken(right).transpose();
            for &down in &coupled[place..] {
                let mut rest = L.view_mut((down, right), (height(down), height(right)));
                rest.gemm(-1.0, &taken(down), &mirrored, 1.0);
            }
        }
    }
    Some(Cholesky::pack_dirty(L))
}

/// Some columns of the factor, from which those before have been taken.
fn panel(L: &mut DMatrix<f64>, from: usize, to: usize) -> Option<()> {
    let n = L.nrows();
    for j in from..to {
        let (before, rest) = L.as_mut_slice().split_at_mut(j * n);
        let column = &mut rest[j..n];
        // four at a time: the column is read and written once for all
        let mut sides = before[from * n..].chunks_exact(4 * n);
        for sides in &mut sides {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| &sides[k * n + j..(k + 1) * n]);
            let (f, g, h, i) = (-a[0], -b[0], -c[0], -d[0]);
            let all = a.iter().zip(b).zip(c.iter().zip(d));
            for (sum, ((a, b), (c, d))) in column.iter_mut().zip(all) {
                *sum = (((*sum + f * a) + g * b) + h * c) + i * d;
            }
        }
        for side in sides.remainder().chunks_exact(n) {
            let factor = -side[j];
            let pairs = column.iter_mut().zip(&side[j..]);
            pairs.for_each(|(sum, entry)| *sum += factor * entry);
        }
        let pivot = column[0];
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        let root = pivot.sqrt();
        column.iter_mut().for_each(|entry| *entry /= root);
    }
    Some(())
}

/// F(x), by its terms in ascending order of their unknowns.
pub(super) struct Block {
    pub size: usize,
    constant: DMatrix<f64>,
    terms: Vec<Term>,
    /// the terms again, a few side by side
    groups: Vec<Group>,
    /// per column: the rows of the upper triangle that some term reads
    read: Vec<Range<usize>>,
}

/// Terms that stand side by side.
const SIDE: usize = 4;

/// Inner products with neighbouring terms: sums that wait for nothing of each other.
struct Group {
    /// one entry of each term: its place in the matrix, column by column, and its value, twice
    /// where it has a mirror image; zeros where a term has no more
    entries: Vec<([usize; SIDE], [f64; SIDE])>,
}

impl Group {
    fn new(terms: &[Term], n: usize) -> Self {
        let most = terms.iter().map(|term| term.entries.len()).max();
        let mut entries = vec![([0; SIDE], [0.0; SIDE]); most.unwrap_or(0)];
        for (side, term) in terms.iter().enumerate() {
            for ((places, weights), &(i, j, value)) in entries.iter_mut().zip(&term.entries) {
                places[side] = j * n + i;
                weights[side] = if i == j { value } else { 2.0 * value };
            }
        }
        Self { entries }
    }

    /// tr(F G) for symmetric G, of which the upper triangle is read.
    fn inner(&self, G: &[f64]) -> [f64; SIDE] {
        let mut sums = [0.0; SIDE];
        for (places, weights) in &self.entries {
            for (sum, (place, weight)) in sums.iter_mut().zip(places.iter().zip(weights)) {
                *sum += weight * G[*place];
            }
        }
        sums
    }
}

/// F_k of one unknown that occurs.
struct Term {
    unknown: usize,
    /// entries on or above the diagonal, (row, column, value)
    entries: Vec<(usize, usize, f64)>,
    /// F_k = Σ e_i vᵀ + v e_iᵀ over few rows i
    rows: Vec<Row>,
}

/// A row of a symmetric matrix, and the column that mirrors it.
struct Row {
    place: usize,
    /// the entries of v that are not zero
    entries: Vec<(usize, f64)>,
}

impl Term {
    fn new(unknown: usize, entries: Vec<(usize, usize, f64)>, n: usize) -> Self {
        let mut rows = vec![];
        let mut left = entries.clone();
        while !left.is_empty() {
            let mut counts = vec![0; n];
            for &(i, j, _) in &left {
                counts[i] += 1;
                counts[j] += 1;
            }
            let fullest = (0..n).max_by_key(|&i| counts[i]).unwrap_or(0);
            let mut row = vec![];
            left.retain(|&(i, j, value)| {
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

    /// The upper triangle of W F W, into G where that is `read`; `room` is for columns.
    fn sandwiched(
        &self,
        W: &DMatrix<f64>,
        read: &[Range<usize>],
        room: &mut [Vec<f64>; 2],
        G: &mut DMatrix<f64>,
    ) {
        let n = W.ncols();
        let column = |j: usize| &W.as_slice()[j * n..(j + 1) * n];
        for (place, rows) in self.rows.chunks(2).enumerate() {
            for (b, row) in room.iter_mut().zip(rows) {
                b.clear();
                b.resize(n, 0.0);
                for &(j, value) in &row.entries {
                    let pairs = b.iter_mut().zip(column(j));
                    pairs.for_each(|(b, w)| *b += value * w);
                }
            }
            let [b, d] = &*room;
            let a = column(rows[0].place);
            // two at once: G is read and written once for both
            let c = rows.get(1).map(|row| column(row.place));
            for (k, (into, rows)) in G.as_mut_slice().chunks_mut(n).zip(read).enumerate() {
                let into = &mut into[rows.clone()];
                match c {
                    Some(c) => put_two(into, place == 0, [a, b, c, d].map(|v| part(v, k, rows))),
                    None => put_one(into, place == 0, [a, b].map(|v| part(v, k, rows))),
                }
            }
        }
    }
}

/// A number of a column, and the part of the column that is asked for.
type Part<'a> = (f64, &'a [f64]);

fn part<'a>(column: &'a [f64], k: usize, rows: &Range<usize>) -> Part<'a> {
    (column[k], &column[rows.clone()])
}

/// The column of a bᵀ + b aᵀ, set or added.
fn put_one(into: &mut [f64], is_first: bool, [(of_a, a), (of_b, b)]: [Part<'_>; 2]) {
    let all = into.iter_mut().zip(a.iter().zip(b));
    match is_first {
        true => all.for_each(|(g, (a, b))| *g = a * of_b + b * of_a),
        false => all.for_each(|(g, (a, b))| *g += a * of_b + b * of_a),
    }
}

/// The same, and then that of c dᵀ + d cᵀ.
fn put_two(
    into: &mut [f64],
    is_first: bool,
    [(of_a, a), (of_b, b), (of_c, c), (of_d, d)]: [Part<'_>; 4],
) {
    let pairs = a.iter().zip(b).zip(c.iter().zip(d));
    let all = into.iter_mut().zip(pairs);
    match is_first {
        true => all.for_each(|(g, ((a, b), (c, d)))| {
            *g = (a * of_b + b * of_a) + (c * of_d + d * of_c);
        }),
        false => all.for_each(|(g, ((a, b), (c, d)))| {
            *g = (*g + (a * of_b + b * of_a)) + (c * of_d + d * of_c);
        }),
    }
}

/// Terms between two looks at the budget, each of which asks the clock.
const LOOK: usize = 16;

impl Block {
    pub fn new(F: &Affine) -> Self {
        let n = F.rows();
        let mut terms: BTreeMap<usize, Vec<(usize, usize, f64)>> = BTreeMap::new();
        for i in 0..n {
            for j in i..n {
                for (unknown, value) in F.terms(i, j).filter(|(_, value)| *value != 0.0) {
                    terms.entry(unknown).or_default().push((i, j, value));
                }
            }
        }
        let terms = terms.into_iter();
        let constants = F.constants();
        Self::of(
            DMatrix::from_fn(n, n, |i, j| constants[(i.min(j), i.max(j))]),
            terms.map(|(k, entries)| Term::new(k, entries, n)).collect(),
        )
    }

    fn of(constant: DMatrix<f64>, terms: Vec<Term>) -> Self {
        let n = constant.nrows();
        let mut read = vec![0..0; n];
        for &(i, j, _) in terms.iter().flat_map(|term| &term.entries) {
            read[j] = match read[j].is_empty() {
                true => i..i + 1,
                false => read[j].start.min(i)..read[j].end.max(i + 1),
            };
        }
        let groups = terms.chunks(SIDE).map(|terms| Group::new(terms, n));
        Self {
            size: n,
            constant,
            groups: groups.collect(),
            terms,
            read,
        }
    }

    pub fn value(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let mut F = self.constant.clone();
        for term in &self.terms {
            for &(i, j, value) in &term.entries {
                F[(i, j)] += x[term.unknown] * value;
                if i != j {
                    F[(j, i)] += x[term.unknown] * value;
                }
            }
        }
        F
    }

    /// Adds what −∇ log det takes from the gradient, and the lower triangle of the Hessian: with W = F⁻¹,
    /// g_k = −tr(W F_k) and H_kl = tr(W F_k W F_l). Where the budget ends they are not whole,
    /// and nobody reads them: who does asks for the budget first.
    pub fn derivatives(
        &self,
        W: &DMatrix<f64>,
        slopes: &mut Vec<(usize, f64)>,
        H: &mut DMatrix<f64>,
        budget: &Budget,
    ) {
        let (n, m) = (self.size, H.nrows());
        let (mut room, mut G) = ([vec![], vec![]], DMatrix::zeros(n, n));
        let of_W = self
            .groups
            .iter()
            .flat_map(|group| group.inner(W.as_slice()));
        slopes.extend(self.terms.iter().map(|term| term.unknown).zip(of_W));
        for (a, term) in self.terms.iter().enumerate() {
            if a % LOOK == 0 && budget.spent().is_some() {
                return;
            }
            let k = term.unknown;
            term.sandwiched(W, &self.read, &mut room, &mut G);
            let column = &mut H.as_mut_slice()[k * m..(k + 1) * m];
            // those beside it that stand before it are of the upper triangle
            let first = a / SIDE;
            let groups = self.terms.chunks(SIDE).zip(&self.groups).skip(first);
            for (terms, group) in groups {
                let inner = group.inner(G.as_slice());
                for (other, inner) in terms.iter().zip(inner) {
                    column[other.unknown] += inner;
                }
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
        let random = |i: usize, j: usize| ((7 * i + 3 * j + i * j) as f64).sin();
        for n in [1, PANEL - 1, PANEL, PANEL + 1, 3 * PANEL + 7, 6 * PANEL] {
            let full = DMatrix::from_fn(n, n, random);
            // neighbours alone, and the last few with all: panels of zeros between
            let arrow = DMatrix::from_fn(n, n, |i, j| match i + 5 > n || i.abs_diff(j) < 9 {
                true => random(i, j),
                false => 0.0,
            });
            for half in [full, arrow] {
                let matrix = &half * half.transpose() + DMatrix::identity(n, n);
                let factor = cholesky(matrix.clone(), &Budget::default()).unwrap();
                let off = factor.l() * factor.l().transpose() - &matrix;
                assert!(off.amax() < 1e-12 * matrix.amax() * n as f64);
                let mut indefinite = matrix;
                indefinite[(n - 1, n - 1)] = -1.0;
                assert!(cholesky(indefinite, &Budget::default()).is_none());
            }
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
        let found = barrier
            .minimise(start(), |_, gap| gap < 1e-6, |_, _, _| false)
            .unwrap();
        assert!(found.decided && found.x[0] > 0.0 && found.x[0] < 1e-6);
        let found = barrier
            .minimise(start(), |_, _| false, |_, _, _| false)
            .unwrap();
        assert!(!found.decided && barrier.is_inside(&found.x));
        let outside = DVector::from_element(1, 0.6);
        assert!(
            barrier
                .minimise(outside, |_, _| true, |_, _, _| false)
                .is_none()
        );
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
        let block = Block::of(DMatrix::zeros(n, n), vec![Term::new(0, entries, n)]);
        let term = &block.terms[0];
        let W = DMatrix::from_fn(n, n, |i, j| ((i * j) as f64).cos());
        let expected = &W * &F * &W;
        // what was in the room before does not count
        let mut found = DMatrix::from_element(n, n, 7.0);
        let mut room = [vec![3.0; n], vec![]];
        term.sandwiched(&W, &block.read, &mut room, &mut found);
        for (j, rows) in block.read.iter().enumerate() {
            for i in rows.clone() {
                assert!((found[(i, j)] - expected[(i, j)]).abs() < 1e-13);
            }
        }
        // what is read of it is what the term weighs
        let mut entries = term.entries.iter();
        assert!(entries.all(|(i, j, _)| block.read[*j].contains(i)));
        let found = block.groups[0].inner(W.as_slice())[0];
        assert!((found - (&F * &W).trace()).abs() < 1e-13);
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
        let (mut slopes, mut H) = (vec![], DMatrix::zeros(4, 4));
        let W = block.value(&x).try_inverse().unwrap();
        block.derivatives(&W, &mut slopes, &mut H, &Budget::default());
        let mut g: DVector<f64> = DVector::zeros(4);
        slopes
            .iter()
            .for_each(|(unknown, slope)| g[*unknown] -= slope);
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
