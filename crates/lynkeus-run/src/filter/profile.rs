//! Square matrices of which each row is known to vanish outside a span.

use std::ops::Range;

use super::root::dot;
use crate::Place;
use crate::snapshot::{Damaged, Walk};

/// An entry of a sparse matrix.
pub(crate) type Entry = (Place, f64);

/// n × n, row by row; what is outside the span of a row is 0 and never touched. The powers of a
/// banded matrix are of this kind, and grow with their exponent only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Profile {
    n: usize,
    entries: Vec<f64>,
    spans: Vec<Range<usize>>,
}

impl Profile {
    pub fn zero(n: usize) -> Self {
        Self {
            n,
            entries: vec![0.0; n * n],
            spans: vec![0..0; n],
        }
    }

    pub fn identity(n: usize) -> Self {
        let mut matrix = Self::zero(n);
        (0..n).for_each(|i| matrix.add_at(i, i, 1.0));
        matrix
    }

    /// Of all entries, row by row.
    pub fn dense(n: usize, entries: Vec<f64>) -> Self {
        Self {
            n,
            entries,
            spans: vec![0..n; n],
        }
    }

    /// All entries, to be changed.
    pub fn entries_mut(&mut self) -> &mut [f64] {
        self.spans.fill(0..self.n);
        &mut self.entries
    }

    /// Other entries, all of them, row by row.
    pub fn fill(&mut self, entries: impl Iterator<Item = f64>) {
        let n = self.n;
        self.spans.iter_mut().for_each(|span| *span = 0..n);
        let places = self.entries.iter_mut().zip(entries);
        places.for_each(|(place, entry)| *place = entry);
    }

    /// Its rows, and columns.
    pub fn size(&self) -> usize {
        self.n
    }

    /// Columns of row i that may differ from 0.
    pub fn span(&self, i: usize) -> Range<usize> {
        self.spans[i].clone()
    }

    /// The entries of row i in its span.
    pub fn row(&self, i: usize) -> &[f64] {
        let span = self.span(i);
        &self.entries[i * self.n + span.start..i * self.n + span.end]
    }

    /// Each row: its first column, and its entries from there.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[f64])> {
        (0..self.n).map(|i| (self.spans[i].start, self.row(i)))
    }

    /// All entries, row by row.
    pub fn entries(&self) -> &[f64] {
        &self.entries
    }

    /// Zero again.
    pub fn clear(&mut self) {
        for i in 0..self.n {
            let span = std::mem::take(&mut self.spans[i]);
            self.entries[i * self.n + span.start..i * self.n + span.end].fill(0.0);
        }
    }

    /// The last rows are zero.
    pub fn clear_last(&mut self, count: usize) {
        for i in self.n - count..self.n {
            let span = std::mem::take(&mut self.spans[i]);
            self.entries[i * self.n + span.start..i * self.n + span.end].fill(0.0);
        }
    }

    pub fn add_at(&mut self, i: usize, j: usize, value: f64) {
        self.reach(i, &(j..j + 1));
        self.entries[i * self.n + j] += value;
    }

    pub fn add(&mut self, other: &Self) {
        for i in 0..self.n {
            self.add_row(i, 1.0, other, i);
        }
    }

    /// Adds factor · A · other for a sparse A.
    pub fn add_product(&mut self, factor: f64, sparse: &[Entry], other: &Self) {
        for (at, value) in sparse {
            self.add_row(at.row, factor * value, other, at.column);
        }
    }

    /// The sum with the own transpose.
    pub fn add_transpose(&mut self) {
        for i in 0..self.n {
            for j in self.span(i) {
                self.reach(j, &(i..i + 1));
            }
        }
        for i in 0..self.n {
            for j in self.spans[i].start..self.spans[i].end.min(i) {
                let sum = self.entries[i * self.n + j] + self.entries[j * self.n + i];
                self.entries[i * self.n + j] = sum;
                self.entries[j * self.n + i] = sum;
            }
            self.entries[i * self.n + i] *= 2.0;
        }
    }

    /// Row i times rows[i], column j times columns[j].
    pub fn scale(&mut self, rows: impl Fn(usize) -> f64, columns: impl Fn(usize) -> f64) {
        for i in 0..self.n {
            let scale = rows(i);
            for j in self.span(i) {
                self.entries[i * self.n + j] *= scale * columns(j);
            }
        }
    }

    /// √(Σ entries²); not a number where an entry is none.
    pub fn norm(&self) -> f64 {
        let rows = (0..self.n).map(|i| self.row(i));
        rows.map(|row| dot(row, row)).sum::<f64>().sqrt()
    }

    fn add_row(&mut self, i: usize, factor: f64, other: &Self, j: usize) {
        let span = other.span(j);
        if span.start == span.end {
            return;
        }
        self.reach(i, &span);
        let into = &mut self.entries[i * self.n + span.start..i * self.n + span.end];
        for (into, from) in into.iter_mut().zip(other.row(j)) {
            *into += factor * from;
        }
    }

    fn reach(&mut self, i: usize, columns: &Range<usize>) {
        let span = &mut self.spans[i];
        *span = if span.start == span.end {
            columns.clone()
        } else {
            span.start.min(columns.start)..span.end.max(columns.end)
        };
    }

    /// What `earlier` and then this one do: their product.
    pub fn after(&self, earlier: &Self) -> Self {
        let mut product = Self::zero(self.n);
        for (i, (first, row)) in self.rows().enumerate() {
            for (j, entry) in (first..).zip(row) {
                product.add_row(i, *entry, earlier, j);
            }
        }
        product
    }

    /// Mᵀv.
    pub fn transposed_times(&self, v: &[f64]) -> Vec<f64> {
        let mut result = vec![0.0; v.len()];
        for (factor, (first, row)) in v.iter().zip(self.rows()) {
            for (into, entry) in result[first..].iter_mut().zip(row) {
                *into += factor * entry;
            }
        }
        result
    }

    /// Of n rows and columns.
    pub fn walk(&mut self, walk: &mut Walk<'_>, n: usize) -> Result<(), Damaged> {
        if let Walk::Load(_) = walk {
            *self = Self::zero(n);
        }
        let rows = self.entries.chunks_exact_mut(n.max(1));
        for (span, row) in self.spans.iter_mut().zip(rows) {
            walk.below(&mut span.start, n + 1)?;
            walk.below(&mut span.end, n + 1)?;
            walk.numbers(row.get_mut(span.clone()).ok_or(Damaged)?)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(row: usize, column: usize, value: f64) -> Entry {
        (Place { row, column }, value)
    }

    #[test]
    fn spans_grow_with_products_and_hold_what_dense_ones_do() {
        let sparse = [entry(0, 1, 2.0), entry(1, 1, -1.0), entry(2, 0, 3.0)];
        let mut once = Profile::zero(3);
        once.add_product(1.0, &sparse, &Profile::identity(3));
        assert_eq!(once.span(0), 1..2);
        let mut twice = Profile::zero(3);
        twice.add_product(0.5, &sparse, &once);
        // ½A² for A = [[0, 2, 0], [0, −1, 0], [3, 0, 0]]
        assert_eq!(
            twice.entries(),
            [0.0, -1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 3.0, 0.0]
        );
        twice.add_transpose();
        assert_eq!(
            twice.entries(),
            [0.0, -1.0, 0.0, -1.0, 1.0, 3.0, 0.0, 3.0, 0.0]
        );
        assert!((twice.norm() - 21.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(twice.transposed_times(&[1.0, 2.0, 3.0]), [-2.0, 10.0, 6.0]);
        twice.clear();
        assert_eq!(twice.norm(), 0.0);
    }

    /// [[0, 2, 0], [0, −1, 0], [3, 0, 0]] after [[1, 0, 0], [4, 0, 5], [0, 0, 6]].
    #[test]
    fn one_after_the_other_is_the_product() {
        let rows = |entries: &[Entry]| {
            let mut matrix = Profile::zero(3);
            entries
                .iter()
                .for_each(|(at, value)| matrix.add_at(at.row, at.column, *value));
            matrix
        };
        let later = rows(&[entry(0, 1, 2.0), entry(1, 1, -1.0), entry(2, 0, 3.0)]);
        let earlier = rows(&[
            entry(0, 0, 1.0),
            entry(1, 0, 4.0),
            entry(1, 2, 5.0),
            entry(2, 2, 6.0),
        ]);
        let product = later.after(&earlier);
        let column = |i: usize| {
            let mut unit = [0.0; 3];
            unit[i] = 1.0;
            product.transposed_times(&unit)
        };
        assert_eq!(column(0), [8.0, 0.0, 10.0]);
        assert_eq!(column(1), [-4.0, 0.0, -5.0]);
        assert_eq!(column(2), [3.0, 0.0, 0.0]);
        let identity = Profile::identity(3);
        assert!(identity.after(&identity).rows().eq(identity.rows()));
    }
}
