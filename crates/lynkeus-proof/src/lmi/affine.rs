//! Matrices whose entries are affine functions of the unknowns.

use nalgebra::{DMatrix, DVector};

/// c + Σ a_k x_k
#[derive(Clone, Debug, Default, PartialEq)]
struct Form {
    constant: f64,
    /// by unknown, in ascending order
    terms: Vec<(usize, f64)>,
}

impl Form {
    fn add(&mut self, other: &Form, factor: f64) {
        if factor == 0.0 {
            return;
        }
        self.constant += factor * other.constant;
        for &(unknown, coefficient) in &other.terms {
            match self.terms.binary_search_by_key(&unknown, |t| t.0) {
                Ok(at) => self.terms[at].1 += factor * coefficient,
                Err(at) => self.terms.insert(at, (unknown, factor * coefficient)),
            }
        }
    }
}

/// A matrix that is affine in the unknowns of a [`Problem`](super::Problem).
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    rows: usize,
    columns: usize,
    /// row by row
    entries: Vec<Form>,
}

impl Affine {
    fn filled(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> Form) -> Self {
        let entries = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        let entries = entries.map(|(i, j)| entry(i, j)).collect();
        Self {
            rows,
            columns,
            entries,
        }
    }

    pub(super) fn unknown(
        rows: usize,
        columns: usize,
        place: impl Fn(usize, usize) -> Option<usize>,
    ) -> Self {
        Self::filled(rows, columns, |i, j| Form {
            constant: 0.0,
            terms: place(i, j).map(|k| (k, 1.0)).into_iter().collect(),
        })
    }

    /// A matrix of numbers.
    pub fn constant(matrix: &DMatrix<f64>) -> Self {
        Self::filled(matrix.nrows(), matrix.ncols(), |i, j| Form {
            constant: matrix[(i, j)],
            terms: vec![],
        })
    }

    /// I
    pub fn identity(n: usize) -> Self {
        Self::constant(&DMatrix::identity(n, n))
    }

    /// f·I for a 1×1 matrix f.
    pub fn multiple_of_identity(f: &Affine, n: usize) -> Self {
        Self::filled(n, n, |i, j| match i == j {
            true => f.entry(0, 0).clone(),
            false => Form::default(),
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    fn entry(&self, i: usize, j: usize) -> &Form {
        &self.entries[i * self.columns + j]
    }

    pub(super) fn terms(&self, i: usize, j: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.entry(i, j).terms.iter().copied()
    }

    pub(super) fn constant_at(&self, i: usize, j: usize) -> f64 {
        self.entry(i, j).constant
    }

    /// A bound of the eigenvalues of the constant part.
    pub(super) fn constant_norm(&self) -> f64 {
        let row = |i: usize| -> f64 {
            (0..self.columns)
                .map(|j| self.constant_at(i, j).abs())
                .sum()
        };
        (0..self.rows).map(row).fold(0.0, f64::max)
    }

    /// Whether the constant part is positive definite.
    pub(super) fn holds_at_zero(&self) -> bool {
        let constant = |i: usize, j: usize| self.constant_at(i, j);
        let matrix = DMatrix::from_fn(self.rows, self.columns, constant);
        matrix.cholesky().is_some()
    }

    fn combined(&self, other: &Affine, factor: f64) -> Self {
        assert_eq!(
            (self.rows, self.columns),
            (other.rows, other.columns),
            "equal shapes"
        );
        let mut sum = self.clone();
        for (mine, theirs) in sum.entries.iter_mut().zip(&other.entries) {
            mine.add(theirs, factor);
        }
        sum
    }

    /// self + other
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn plus(&self, other: &Affine) -> Self {
        self.combined(other, 1.0)
    }

    /// self − other
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn minus(&self, other: &Affine) -> Self {
        self.combined(other, -1.0)
    }

    /// factor·self
    pub fn scaled(&self, factor: f64) -> Self {
        let zero = Self::filled(self.rows, self.columns, |_, _| Form::default());
        zero.combined(self, factor)
    }

    /// selfᵀ
    pub fn transposed(&self) -> Self {
        Self::filled(self.columns, self.rows, |i, j| self.entry(j, i).clone())
    }

    /// self + selfᵀ
    pub fn he(&self) -> Self {
        self.plus(&self.transposed())
    }

    /// self·M
    ///
    /// # Panics
    /// If the shapes do not fit.
    pub fn times(&self, M: &DMatrix<f64>) -> Self {
        assert_eq!(self.columns, M.nrows(), "inner sizes agree");
        Self::filled(self.rows, M.ncols(), |i, j| {
            let mut sum = Form::default();
            for k in 0..self.columns {
                sum.add(self.entry(i, k), M[(k, j)]);
            }
            sum
        })
    }

    /// M·self
    ///
    /// # Panics
    /// If the shapes do not fit.
    pub fn after(&self, M: &DMatrix<f64>) -> Self {
        self.transposed().times(&M.transpose()).transposed()
    }

    /// The sum of the diagonal, 1×1.
    pub fn trace(&self) -> Self {
        let mut sum = Form::default();
        for i in 0..self.rows.min(self.columns) {
            sum.add(self.entry(i, i), 1.0);
        }
        Self::filled(1, 1, |_, _| sum.clone())
    }

    /// One entry, 1×1.
    pub fn at_entry(&self, i: usize, j: usize) -> Self {
        Self::filled(1, 1, |_, _| self.entry(i, j).clone())
    }

    /// [[a, b], [bᵀ, d]]
    ///
    /// # Panics
    /// If the shapes do not fit.
    pub fn symmetric_blocks(a: &Affine, b: &Affine, d: &Affine) -> Self {
        assert_eq!(
            (a.rows, d.rows),
            (b.rows, b.columns),
            "b fits between a and d"
        );
        let n = a.rows;
        Self::filled(n + d.rows, n + d.rows, |i, j| match (i < n, j < n) {
            (true, true) => a.entry(i, j).clone(),
            (true, false) => b.entry(i, j - n).clone(),
            (false, true) => b.entry(j, i - n).clone(),
            (false, false) => d.entry(i - n, j - n).clone(),
        })
    }

    /// The numbers for given unknowns.
    pub(super) fn at(&self, values: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.columns, |i, j| {
            let form = self.entry(i, j);
            let terms = form.terms.iter().map(|&(k, a)| a * values[k]);
            form.constant + terms.sum::<f64>()
        })
    }
}
