//! Factors of σI − J for a Jacobian J and numbers σ.

use std::sync::Arc;

use nalgebra::{DVector, Dyn, LU};

use super::ordering::least_degree;
use super::sparse::{Columns, Number, Sparse};
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
    /// none where it is dense
    pattern: Option<Pattern>,
}

#[derive(Clone, Debug)]
struct Pattern {
    order: Vec<usize>,
    /// column by column, the rows with the numbers of the entries
    entries: Columns<usize>,
}

/// Factors of one matrix.
#[derive(Clone, Debug)]
pub(super) enum Factors<T: Number> {
    Dense(LU<T, Dyn, Dyn>),
    Sparse(Sparse<T>),
}

impl Shifted {
    pub fn new(n: usize) -> Self {
        Self {
            n,
            places: Arc::new([]),
            pattern: None,
        }
    }

    /// Knows the pattern from here on.
    pub fn fit(&mut self, slopes: &Slopes) {
        if !Arc::ptr_eq(&self.places, slopes.places()) {
            self.places = slopes.places().clone();
            self.pattern = Pattern::of(self.n, &self.places);
        }
    }

    /// Factors of σI − J, whose pattern is known; none where it is singular.
    pub fn factors<T: Number>(&self, σ: T, slopes: &Slopes) -> Option<Factors<T>> {
        let n = self.n;
        let Some(pattern) = &self.pattern else {
            let mut matrix = slopes.dense(n).map(|v| T::from_real(-v));
            for i in 0..n {
                matrix[(i, i)] += σ;
            }
            let factors = matrix.lu();
            return factors.is_invertible().then_some(Factors::Dense(factors));
        };
        let mut matrix = Columns::default();
        for c in 0..n {
            for &(row, k) in pattern.entries.column(c) {
                matrix.push(row, T::from_real(-slopes.values()[k]));
            }
            matrix.push(c, σ);
            matrix.close();
        }
        Some(Factors::Sparse(Sparse::new(&matrix, &pattern.order)?))
    }
}

impl Pattern {
    /// None where the factors are dense, or zeros too few to matter.
    fn of(n: usize, places: &[Place]) -> Option<Self> {
        let most = (FULL * (n * n) as f64) as usize;
        if n <= SMALL || places.len() > most {
            return None;
        }
        let order = least_degree(n, places, most / 2)?;
        let mut numbered: Vec<(usize, Place)> = places.iter().copied().enumerate().collect();
        numbered.sort_by_key(|(_, at)| at.column);
        let mut entries = Columns::default();
        let mut rest = numbered.into_iter().peekable();
        for c in 0..n {
            while let Some((k, at)) = rest.next_if(|(_, at)| at.column == c) {
                entries.push(at.row, k);
            }
            entries.close();
        }
        Some(Self { order, entries })
    }
}

impl<T: Number> Factors<T> {
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
    fn residual<T: Number>(n: usize, slopes: &Slopes, σ: T, sparse: bool) -> f64 {
        let mut shifted = Shifted::new(n);
        shifted.fit(slopes);
        assert_eq!(shifted.pattern.is_some(), sparse);
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
}
