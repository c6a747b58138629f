//! Factors of σI − J for a Jacobian J and numbers σ, dense or sparse.
//!
//! Sparse ones are made column by column (J. R. Gilbert and T. Peierls, Sparse partial pivoting in
//! time proportional to arithmetic operations, 1988), in an order of least degree.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use std::sync::Arc;

use nalgebra::{ComplexField, DVector, Dyn, LU};

use crate::{Place, Slopes};

/// Up to so many states, zeros cost less than going round them.
const SMALL: usize = 16;

/// Factors with more entries than this share of all are dense.
const FULL: f64 = 0.25;

/// How a Jacobian with entries at certain places is factorised.
#[derive(Clone, Debug)]
pub(super) struct Shifted {
    n: usize,
    places: Arc<[Place]>,
    /// in which columns are eliminated; none where it is dense
    order: Option<Vec<usize>>,
    /// column by column, the rows with the numbers of the entries
    entries: Columns<usize>,
}

/// Factors of one matrix.
#[derive(Clone, Debug)]
pub(super) enum Factors<T: ComplexField> {
    Dense(LU<T, Dyn, Dyn>),
    Sparse(Sparse<T>),
}

impl Shifted {
    pub fn new(n: usize) -> Self {
        Self {
            n,
            places: Arc::new([]),
            order: None,
            entries: Columns::default(),
        }
    }

    /// Knows the pattern from here on. It is dense where the factors are, or zeros too few to matter.
    pub fn fit(&mut self, slopes: &Slopes) {
        if Arc::ptr_eq(&self.places, slopes.places()) {
            return;
        }
        self.places = slopes.places().clone();
        let (n, places) = (self.n, &self.places);
        let most = (FULL * (n * n) as f64) as usize;
        let may_be_sparse = n > SMALL && places.len() <= most;
        let order = || least_degree(n, places, most / 2);
        self.order = may_be_sparse.then(order).flatten();
        self.entries = Columns::default();
        let mut numbered: Vec<(usize, Place)> = places.iter().copied().enumerate().collect();
        numbered.sort_by_key(|(_, at)| at.column);
        let mut rest = numbered.into_iter().peekable();
        for c in 0..n {
            while let Some((k, at)) = rest.next_if(|(_, at)| at.column == c) {
                self.entries.push(at.row, k);
            }
            self.entries.close();
        }
    }

    /// Factors of σI − J, whose pattern is known; none where it is singular.
    pub fn factors<T: ComplexField<RealField = f64> + Copy>(
        &self,
        σ: T,
        slopes: &Slopes,
    ) -> Option<Factors<T>> {
        let n = self.n;
        let Some(order) = &self.order else {
            let mut matrix = slopes.dense(n).map(|v| T::from_real(-v));
            for i in 0..n {
                matrix[(i, i)] += σ;
            }
            let factors = matrix.lu();
            return factors.is_invertible().then_some(Factors::Dense(factors));
        };
        let mut matrix = Columns::default();
        for c in 0..n {
            for &(row, k) in self.entries.column(c) {
                matrix.push(row, T::from_real(-slopes.values()[k]));
            }
            matrix.push(c, σ);
            matrix.close();
        }
        Some(Factors::Sparse(Sparse::new(&matrix, order)?))
    }
}

impl<T: ComplexField<RealField = f64> + Copy> Factors<T> {
    /// b becomes the solution; false where there is none.
    pub fn solve(&self, b: &mut DVector<T>) -> bool {
        match self {
            Self::Dense(factors) => factors.solve_mut(b),
            Self::Sparse(factors) => {
                factors.solve(b.as_mut_slice());
                true
            }
        }
    }
}

/// The order of least degree: what is eliminated next has the fewest neighbours among those that
/// are left, in the pattern of A + Aᵀ with all that elimination has filled so far. None where
/// more than `most` entries are filled on one side of the diagonal.
fn least_degree(n: usize, places: &[Place], most: usize) -> Option<Vec<usize>> {
    let mut neighbours = vec![BTreeSet::new(); n];
    for at in places.iter().filter(|at| at.row != at.column) {
        neighbours[at.row].insert(at.column);
        neighbours[at.column].insert(at.row);
    }
    let mut queue: BTreeSet<(usize, usize)> =
        neighbours.iter().map(BTreeSet::len).zip(0..n).collect();
    let mut order = Vec::with_capacity(n);
    let mut filled = 0;
    while let Some((degree, i)) = queue.pop_first() {
        filled += degree;
        if filled > most {
            return None;
        }
        order.push(i);
        let around = std::mem::take(&mut neighbours[i]);
        for &j in &around {
            let own = &mut neighbours[j];
            queue.remove(&(own.len(), j));
            own.extend(&around);
            own.remove(&i);
            own.remove(&j);
            queue.insert((own.len(), j));
        }
    }
    Some(order)
}

/// The diagonal is taken as pivot, which keeps what the order of the columns was chosen for,
/// unless it is smaller than this share of the largest entry.
const DIAGONAL: f64 = 0.1;

/// Entries of a matrix, column by column.
#[derive(Clone, Debug)]
struct Columns<T> {
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

impl<T: ComplexField<RealField = f64> + Copy> Column<T> {
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
        let free = self.free.iter().copied();
        let largest = free.max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        let is_free = self.met[c] == step + 1 && self.step_of[c].is_none();
        let row = match is_free && size(c) >= DIAGONAL * size(largest) {
            true => c,
            false => largest,
        };
        (size(largest) > 0.0 && size(largest).is_finite()).then_some(row)
    }
}

impl<T: ComplexField<RealField = f64> + Copy> Sparse<T> {
    /// Factors of the matrix with these columns, eliminated in this order; none where it is
    /// singular or not finite.
    fn new(matrix: &Columns<T>, order: &[usize]) -> Option<Self> {
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

#[cfg(test)]
mod tests {
    use nalgebra::{Complex, DMatrix};

    use super::*;

    /// Entries that need no order, for columns of the given neighbours.
    fn slopes(n: usize, neighbours: impl Fn(usize) -> Vec<usize>) -> Slopes {
        let places: Vec<Place> = (0..n)
            .flat_map(|row| {
                let columns = neighbours(row).into_iter();
                columns.map(move |column| Place { row, column })
            })
            .collect();
        let places: Arc<[Place]> = places.into();
        let mut slopes = Slopes::default();
        let values = slopes.at(&places);
        for (k, value) in values.iter_mut().enumerate() {
            *value = 10.0 * (1.7 * k as f64 + 0.3).sin();
        }
        slopes
    }

    /// What is left of A x = b for the factors' x.
    fn residual<T: ComplexField<RealField = f64> + Copy>(
        n: usize,
        slopes: &Slopes,
        σ: T,
        sparse: bool,
    ) -> f64 {
        let mut shifted = Shifted::new(n);
        shifted.fit(slopes);
        assert_eq!(shifted.order.is_some(), sparse);
        let factors = shifted.factors(σ, slopes).unwrap();
        let b = DVector::from_fn(n, |i, _| T::from_real((i as f64).cos()));
        let mut x = b.clone();
        assert!(factors.solve(&mut x));
        let mut matrix: DMatrix<T> = slopes.dense(n).map(|v| T::from_real(-v));
        for i in 0..n {
            matrix[(i, i)] += σ;
        }
        (matrix * &x - b).norm() / x.norm()
    }

    /// Bands, an arrow, a ring, a grid, one with few zeros, a small one: with shifts for which the diagonal is large,
    /// small, and not there at all, so that other rows have to be pivots.
    #[test]
    fn factors_solve_whatever_the_pattern() {
        let band = slopes(60, |i| (i.saturating_sub(2)..(i + 2).min(60)).collect());
        let arrow = slopes(60, |i| match i {
            0 => (0..60).collect(),
            _ => vec![0, i],
        });
        let ring = slopes(60, |i| vec![(i + 1) % 60]);
        let grid = slopes(100, |i| {
            let around = [i, i + 1, i + 10, i.wrapping_sub(1), i.wrapping_sub(10)];
            around.into_iter().filter(|&j| j < 100).collect()
        });
        let full = slopes(64, |i| (0..20).map(|k| (i + 3 * k) % 64).collect());
        let small = slopes(5, |i| vec![i, (i + 1) % 5]);
        let cases = [
            (60, band, true),
            (60, arrow, true),
            (60, ring, true),
            (100, grid, true),
            (64, full, false),
            (5, small, false),
        ];
        for (n, slopes, sparse) in cases {
            for σ in [1e3, 1.0, 0.0] {
                let real = residual(n, &slopes, σ, sparse);
                assert!(real < 1e-11, "{n}, {σ}: {real}");
                let complex = residual(n, &slopes, Complex::new(σ, 2.0), sparse);
                assert!(complex < 1e-11, "{n}, {σ}: {complex}");
            }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_factors() {
        let ring = slopes(60, |i| vec![(i + 1) % 60, (i + 2) % 60]);
        let mut shifted = Shifted::new(60);
        shifted.fit(&ring);
        assert!(shifted.factors(1.0, &ring).is_some());
        let mut lost = ring.clone();
        let places = lost.places().clone();
        lost.at(&places)[..2].fill(0.0);
        assert!(shifted.factors(0.0, &lost).is_none());
        lost.at(&places)[0] = f64::NAN;
        assert!(shifted.factors(0.0, &lost).is_none());
    }

    /// An arrow whose head comes first fills everything in the order as given, and nothing in
    /// that of least degree, which leaves the head to the end.
    #[test]
    fn the_head_of_an_arrow_comes_last() {
        let arrow = |n: usize| -> Vec<Place> {
            let place = |row, column| Place { row, column };
            (1..n)
                .flat_map(|i| [place(0, i), place(i, 0), place(i, i)])
                .collect()
        };
        let order = least_degree(50, &arrow(50), 49).unwrap();
        // the last but one and the head are equals
        assert!(order[48..].contains(&0), "{order:?}");
        assert_eq!(least_degree(50, &arrow(50), 48), None);
        let full: Vec<Place> = (0..100)
            .map(|k| Place {
                row: k / 10,
                column: k % 10,
            })
            .collect();
        assert_eq!(least_degree(10, &full, 44), None);
        assert_eq!(least_degree(10, &full, 45).unwrap().len(), 10);
    }
}
