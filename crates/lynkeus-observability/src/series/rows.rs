//! Coefficients with their sensitivities.

use crate::field::{Modular, Wide};

/// Coefficients of one slot with their sensitivities.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    pub values: Vec<Modular>,
    /// per order one row of sensitivities; empty for what no unknown moves
    pub tangents: Vec<Row>,
}

/// A row of sensitivities; most quantities of a large model feel few of its unknowns.
#[derive(Clone, Debug)]
pub(super) enum Row {
    Dense(Vec<Modular>),
    /// (column, what is not zero there)
    Sparse(Vec<(usize, Modular)>),
}

impl Row {
    pub fn new(row: Vec<Modular>) -> Self {
        let filled = row.iter().filter(|x| !x.is_zero()).count();
        if 3 * filled > row.len() {
            return Row::Dense(row);
        }
        let entries = row.into_iter().enumerate();
        // collected anew: a list filtered in place would keep the row's memory
        let mut sparse = Vec::with_capacity(filled);
        sparse.extend(entries.filter(|(_, x)| !x.is_zero()));
        Row::Sparse(sparse)
    }

    /// In numbers of the field.
    pub fn size(&self) -> usize {
        match self {
            Row::Dense(row) => row.len(),
            Row::Sparse(row) => 2 * row.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.size() == 0
    }

    /// sum += factor·row
    fn add_to(&self, sum: &mut [Wide], factor: Modular) {
        match self {
            Row::Dense(row) => {
                for (s, r) in sum.iter_mut().zip(row) {
                    s.add_product(factor, *r);
                }
            }
            Row::Sparse(row) => {
                for &(column, r) in row {
                    if let Some(s) = sum.get_mut(column) {
                        s.add_product(factor, r);
                    }
                }
            }
        }
    }
}

/// A combination of rows, reduced where it has to be.
#[derive(Debug, Default)]
pub(super) struct Sum {
    wide: Vec<Wide>,
    products: usize,
}

impl Sum {
    /// Adds factor·row, of that many columns.
    pub fn add(&mut self, factor: Modular, row: &Row, width: usize) {
        if row.is_empty() || factor.is_zero() {
            return;
        }
        if self.wide.is_empty() {
            self.wide.resize(width, Wide::default());
        }
        self.products += 1;
        if self.products >= Wide::PRODUCTS {
            self.wide.iter_mut().for_each(|x| *x = x.folded());
            // what was folded counts as one
            self.products = 2;
        }
        row.add_to(&mut self.wide, factor);
    }

    pub fn scale(&mut self, factor: Modular) {
        for x in &mut self.wide {
            *x = Wide::from(x.value() * factor);
        }
        self.products = 1;
    }

    pub fn into_row(self) -> Vec<Modular> {
        self.wide.into_iter().map(Wide::value).collect()
    }
}
