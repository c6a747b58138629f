//! Matrices whose entries are affine functions of the unknowns.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

/// c + Σ a_k x_k: coefficients by unknown, c under none.
type Form = BTreeMap<Option<usize>, f64>;

fn add(sum: &mut Form, form: &Form, factor: f64) {
    if factor != 0.0 {
        for (&unknown, coefficient) in form {
            *sum.entry(unknown).or_default() += factor * coefficient;
        }
    }
}

/// A matrix that is affine in the unknowns of a [`Problem`](super::Problem). Operations panic where
/// shapes do not fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Affine(DMatrix<Form>);

impl Affine {
    pub(super) fn unknown(
        rows: usize,
        columns: usize,
        place: impl Fn(usize, usize) -> Option<usize>,
    ) -> Self {
        let entry = |i, j| place(i, j).map(|k| (Some(k), 1.0)).into_iter().collect();
        Self(DMatrix::from_fn(rows, columns, entry))
    }

    /// A matrix of numbers.
    pub fn constant(matrix: &DMatrix<f64>) -> Self {
        Self(matrix.map(|c| Form::from([(None, c)])))
    }

    /// I
    pub fn identity(n: usize) -> Self {
        Self::constant(&DMatrix::identity(n, n))
    }

    /// f·I for a 1×1 matrix f.
    pub fn multiple_of_identity(f: &Affine, n: usize) -> Self {
        Self(DMatrix::from_fn(n, n, |i, j| match i == j {
            true => f.0[(0, 0)].clone(),
            false => Form::new(),
        }))
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.0.nrows()
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.0.ncols()
    }

    pub(crate) fn terms(&self, i: usize, j: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let form = self.0[(i, j)].iter();
        form.filter_map(|(unknown, &coefficient)| Some(((*unknown)?, coefficient)))
    }

    /// The constant part.
    pub(super) fn constants(&self) -> DMatrix<f64> {
        self.0.map(|form| form.get(&None).copied().unwrap_or(0.0))
    }

    /// self + factor·other
    fn combined(&self, other: &Affine, factor: f64) -> Self {
        Self(self.0.zip_map(&other.0, |mut mine, theirs| {
            add(&mut mine, &theirs, factor);
            mine
        }))
    }

    /// self + other
    pub fn plus(&self, other: &Affine) -> Self {
        self.combined(other, 1.0)
    }

    /// self − other
    pub fn minus(&self, other: &Affine) -> Self {
        self.combined(other, -1.0)
    }

    /// factor·self
    pub fn scaled(&self, factor: f64) -> Self {
        let zero = Self(self.0.map(|_| Form::new()));
        zero.combined(self, factor)
    }

    /// selfᵀ
    pub fn transposed(&self) -> Self {
        Self(self.0.transpose())
    }

    /// self + selfᵀ
    pub fn he(&self) -> Self {
        self.plus(&self.transposed())
    }

    /// self·M
    pub fn times(&self, M: &DMatrix<f64>) -> Self {
        assert_eq!(self.columns(), M.nrows(), "inner sizes agree");
        Self(DMatrix::from_fn(self.rows(), M.ncols(), |i, j| {
            let mut sum = Form::new();
            for k in 0..self.columns() {
                add(&mut sum, &self.0[(i, k)], M[(k, j)]);
            }
            sum
        }))
    }

    /// M·self
    pub fn after(&self, M: &DMatrix<f64>) -> Self {
        self.transposed().times(&M.transpose()).transposed()
    }

    /// The sum of the diagonal, 1×1.
    pub fn trace(&self) -> Self {
        let mut sum = Form::new();
        for form in self.0.diagonal().iter() {
            add(&mut sum, form, 1.0);
        }
        Self(DMatrix::from_element(1, 1, sum))
    }

    /// One entry, 1×1.
    pub fn at_entry(&self, i: usize, j: usize) -> Self {
        Self(DMatrix::from_element(1, 1, self.0[(i, j)].clone()))
    }

    /// [[a, b], [bᵀ, d]]
    pub fn symmetric_blocks(a: &Affine, b: &Affine, d: &Affine) -> Self {
        let shapes = (a.rows(), d.rows());
        assert_eq!(shapes, (b.rows(), b.columns()), "b fits between a and d");
        let n = a.rows();
        let size = n + d.rows();
        Self(DMatrix::from_fn(size, size, |i, j| match (i < n, j < n) {
            (true, true) => a.0[(i, j)].clone(),
            (true, false) => b.0[(i, j - n)].clone(),
            (false, true) => b.0[(j, i - n)].clone(),
            (false, false) => d.0[(i - n, j - n)].clone(),
        }))
    }

    /// The numbers for given unknowns.
    pub fn at(&self, values: &DVector<f64>) -> DMatrix<f64> {
        let constants = self.constants();
        DMatrix::from_fn(self.rows(), self.columns(), |i, j| {
            let terms = self.terms(i, j).map(|(k, a)| a * values[k]);
            constants[(i, j)] + terms.sum::<f64>()
        })
    }
}
