//! One inequality F(x) = F₀ + Σ x_k F_k > 0 with sparse symmetric F_k, and its barrier.

use lynkeus_expr::Budget;
use nalgebra::{DMatrix, DVector};

use super::Affine;

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
        let mut terms: std::collections::BTreeMap<usize, Vec<Entry>> =
            std::collections::BTreeMap::new();
        for i in 0..n {
            for j in i..n {
                for (unknown, value) in F.terms(i, j).filter(|(_, value)| *value != 0.0) {
                    let entry = Entry::new((i, j, value), n);
                    terms.entry(unknown).or_default().push(entry);
                }
            }
        }
        let terms = terms.into_iter();
        Self {
            size: n,
            constant: DMatrix::from_fn(n, n, |i, j| F.constant_at(i.min(j), i.max(j))),
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
