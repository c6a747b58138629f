//! Jacobians as sparse matrices.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::method::are_finite;

/// A place in a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// counted from 0
    pub row: usize,
    /// counted from 0
    pub column: usize,
}

/// ∂f/∂x at a point: zero but for the entries at known places, the same ones at every point.
#[derive(Clone, Debug, Default)]
pub struct Slopes {
    places: Arc<[Place]>,
    values: Vec<f64>,
}

impl Slopes {
    /// The values at these places, to be written; places that are shared mean the same matrix.
    pub fn at(&mut self, places: &Arc<[Place]>) -> &mut [f64] {
        if !Arc::ptr_eq(&self.places, places) {
            self.places = places.clone();
        }
        self.values.resize(places.len(), 0.0);
        &mut self.values
    }

    /// Where entries can be.
    pub fn places(&self) -> &Arc<[Place]> {
        &self.places
    }

    /// The entries, in the order of the places.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Each entry with its place.
    pub fn entries(&self) -> impl Iterator<Item = (Place, f64)> {
        self.places.iter().copied().zip(self.values.iter().copied())
    }

    /// Whether every entry is a finite number.
    pub(crate) fn are_finite(&self) -> bool {
        are_finite(&self.values)
    }

    /// The whole matrix of n rows and columns.
    pub(crate) fn dense(&self, n: usize) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(n, n);
        for (at, value) in self.entries() {
            matrix[(at.row, at.column)] += value;
        }
        matrix
    }

    /// The product with v.
    pub(crate) fn times(&self, v: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        for (at, value) in self.entries() {
            product[at.row] += value * v[at.column];
        }
    }
}
