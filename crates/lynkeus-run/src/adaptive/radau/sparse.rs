//! Factors of a sparse matrix, column by column (J. R. Gilbert and T. Peierls, Sparse partial
//! pivoting in time proportional to arithmetic operations, 1988).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::ComplexField;

/// The diagonal is taken as pivot, which keeps what the order of the columns was chosen for,
/// unless it is smaller than this share of the largest entry.
const DIAGONAL: f64 = 0.1;

/// Real or complex numbers.
pub(super) trait Number: ComplexField<RealField = f64> + Copy {}

impl<T: ComplexField<RealField = f64> + Copy> Number for T {}

/// Entries of a matrix, column by column.
#[derive(Clone, Debug)]
pub(super) struct Columns<T> {
    starts: Vec<usize>,
    entries: Vec<(usize, T)>,
}

impl<T> Default for Columns<T> {
    fn default() -> Self {
        Self {
            starts: vec![0],
            entries: vec![],
        }
    }
}

impl<T> Columns<T> {
    /// One entry more in the column that is under way: its row and its value.
    pub fn push(&mut self, row: usize, value: T) {
        self.entries.push((row, value));
    }

    /// The column under way is complete.
    pub fn close(&mut self) {
        self.starts.push(self.entries.len());
    }

    pub fn column(&self, k: usize) -> &[(usize, T)] {
        &self.entries[self.starts[k]..self.starts[k + 1]]
    }
}

/// P A Q = L U, where L has a unit diagonal.
#[derive(Clone, Debug)]
pub(super) struct Sparse<T> {
    /// the row that is the pivot of each step
    pivots: Vec<usize>,
    /// the column that is eliminated in each step
    order: Vec<usize>,
    /// below the diagonal, by rows of A
    lower: Columns<T>,
    /// above the diagonal, by steps
    upper: Columns<T>,
    diagonal: Vec<T>,
}

/// A column that is being eliminated.
struct Column<T> {
    values: Vec<T>,
    /// the step that last met each row, counted from 1
    met: Vec<usize>,
    /// the step in which each row was the pivot
    step_of: Vec<Option<usize>>,
    /// steps whose multiples are to be taken off, the first on top
    queue: BinaryHeap<Reverse<usize>>,
    /// rows that were no pivots yet
    free: Vec<usize>,
}

impl<T: Number> Column<T> {
    fn add(&mut self, step: usize, row: usize, value: T) {
        if self.met[row] != step + 1 {
            self.met[row] = step + 1;
            match self.step_of[row] {
                Some(earlier) => self.queue.push(Reverse(earlier)),
                None => self.free.push(row),
            }
        }
        self.values[row] += value;
    }

    fn take(&mut self, row: usize) -> T {
        std::mem::replace(&mut self.values[row], T::zero())
    }

    /// The row to be the pivot of column c; none where the column is zero or not finite.
    fn pivot(&self, step: usize, c: usize) -> Option<usize> {
        let size = |row: usize| self.values[row].norm1();
        let largest = self
            .free
            .iter()
            .copied()
            .max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        let is_free = self.met[c] == step + 1 && self.step_of[c].is_none();
        let row = match is_free && size(c) >= DIAGONAL * size(largest) {
            true => c,
            false => largest,
        };
        (size(largest) > 0.0 && size(largest).is_finite()).then_some(row)
    }
}

impl<T: Number> Sparse<T> {
    /// Factors of the matrix with these columns, eliminated in this order; none where it is
    /// singular or not finite.
    pub fn new(matrix: &Columns<T>, order: &[usize]) -> Option<Self> {
        let n = order.len();
        let mut factors = Self {
            pivots: Vec::with_capacity(n),
            order: order.to_vec(),
            lower: Columns::default(),
            upper: Columns::default(),
            diagonal: Vec::with_capacity(n),
        };
        let mut column = Column {
            values: vec![T::zero(); n],
            met: vec![0; n],
            step_of: vec![None; n],
            queue: BinaryHeap::new(),
            free: vec![],
        };
        for (step, &c) in order.iter().enumerate() {
            for &(row, value) in matrix.column(c) {
                column.add(step, row, value);
            }
            factors.eliminate(&mut column, step, c)?;
        }
        Some(factors)
    }

    fn eliminate(&mut self, column: &mut Column<T>, step: usize, c: usize) -> Option<()> {
        while let Some(Reverse(earlier)) = column.queue.pop() {
            let factor = column.take(self.pivots[earlier]);
            self.upper.push(earlier, factor);
            for &(row, value) in self.lower.column(earlier) {
                column.add(step, row, -(value * factor));
            }
        }
        let pivot = column.pivot(step, c)?;
        let diagonal = column.take(pivot);
        column.step_of[pivot] = Some(step);
        while let Some(row) = column.free.pop() {
            if row != pivot {
                let value = column.take(row);
                self.lower.push(row, value / diagonal);
            }
        }
        self.pivots.push(pivot);
        self.diagonal.push(diagonal);
        self.lower.close();
        self.upper.close();
        Some(())
    }

    /// b becomes the solution of A x = b.
    pub fn solve(&self, b: &mut [T]) {
        let mut x = Vec::with_capacity(b.len());
        for (step, &pivot) in self.pivots.iter().enumerate() {
            let value = b[pivot];
            for &(row, factor) in self.lower.column(step) {
                b[row] -= factor * value;
            }
            x.push(value);
        }
        for step in (0..x.len()).rev() {
            x[step] /= self.diagonal[step];
            let value = x[step];
            for &(earlier, factor) in self.upper.column(step) {
                x[earlier] -= factor * value;
            }
        }
        for (&c, value) in self.order.iter().zip(x) {
            b[c] = value;
        }
    }
}
