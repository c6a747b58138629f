//! The square-root factor of the information, row by row.

use nalgebra::DMatrix;

/// Rows wait until there are this many times the columns, then they are worked in together.
const BLOCK: usize = 2;

/// A triangle R with RᵀR = Σ rowᵀ·row, gathered by orthogonal transformations.
#[derive(Clone, Debug)]
pub(super) struct Information {
    columns: usize,
    triangle: DMatrix<f64>,
    /// rows not yet worked in, one after the other
    pending: Vec<f64>,
    /// per column Σ over the rows of the square of what its terms would be without cancelling
    gross: Vec<f64>,
}

impl Information {
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            triangle: DMatrix::zeros(0, columns),
            pending: vec![],
            gross: vec![0.0; columns],
        }
    }

    /// The information of several independent sources.
    pub fn joined<'a>(columns: usize, parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut joined = Self::new(columns);
        for part in parts {
            for row in part.triangle.row_iter() {
                joined.pending.extend(row.iter());
            }
            joined.pending.extend(&part.pending);
            for (sum, term) in joined.gross.iter_mut().zip(&part.gross) {
                *sum += term;
            }
        }
        joined.settle();
        joined
    }

    /// Adds a row; `gross` are its entries with every term taken as positive.
    pub fn push(&mut self, row: impl Iterator<Item = f64>, gross: impl Iterator<Item = f64>) {
        self.pending.extend(row);
        for (sum, entry) in self.gross.iter_mut().zip(gross) {
            *sum += entry * entry;
        }
        if self.pending.len() >= BLOCK * self.columns * self.columns.max(1) {
            self.settle();
        }
    }

    /// Works all rows into the triangle.
    pub fn settle(&mut self) {
        if self.pending.is_empty() || self.columns == 0 {
            return;
        }
        let old = self.triangle.nrows();
        let rows = old + self.pending.len() / self.columns;
        let stacked = DMatrix::from_fn(rows, self.columns, |i, j| match i.checked_sub(old) {
            None => self.triangle[(i, j)],
            Some(i) => self.pending[i * self.columns + j],
        });
        self.triangle = stacked.qr().r();
        self.pending.clear();
    }

    /// R, once everything is [settled](Self::settle).
    pub fn triangle(&self) -> &DMatrix<f64> {
        &self.triangle
    }

    /// Norms of the columns, had nothing cancelled within a row.
    pub fn gross(&self) -> impl Iterator<Item = f64> + '_ {
        self.gross.iter().map(|sum| sum.sqrt())
    }
}
