//! Row echelon form over the field, row by row.

use crate::field::{Modular, Wide};

/// The row space of the rows added so far.
#[derive(Clone, Debug)]
pub(crate) struct Echelon {
    width: usize,
    /// (pivot column, row scaled to 1 there), in order of arrival
    rows: Vec<(usize, Vec<Modular>)>,
}

impl Echelon {
    pub fn new(width: usize) -> Self {
        let rows = vec![];
        Self { width, rows }
    }

    pub fn rank(&self) -> usize {
        self.rows.len()
    }

    /// The rows, each scaled to 1 at its pivot.
    pub fn rows(&self) -> impl Iterator<Item = &[Modular]> {
        self.rows.iter().map(|(_, row)| row.as_slice())
    }

    /// The pivot columns: the first that is not zero of each row of the echelon form.
    pub fn pivots(&self) -> impl Iterator<Item = usize> + '_ {
        self.rows.iter().map(|(pivot, _)| *pivot)
    }

    /// What is left of a row after the known rows are taken out.
    fn reduced(&self, row: &[Modular]) -> Vec<Modular> {
        let mut wide: Vec<Wide> = row.iter().map(|&x| Wide::from(x)).collect();
        wide.resize(self.width, Wide::default());
        let mut products = 1;
        for (pivot, known) in &self.rows {
            let factor = -wide[*pivot].value();
            if factor.is_zero() {
                continue;
            }
            products += 1;
            if products >= Wide::PRODUCTS {
                wide.iter_mut().for_each(|x| *x = x.folded());
                products = 2;
            }
            // a row is zero before its pivot, and so is what is left there
            for (x, y) in wide[*pivot..].iter_mut().zip(&known[*pivot..]) {
                x.add_product(factor, *y);
            }
        }
        wide.into_iter().map(Wide::value).collect()
    }

    /// Adds a row; true if it was independent of the others.
    pub fn add(&mut self, row: &[Modular]) -> bool {
        let mut row = self.reduced(row);
        let Some(pivot) = row.iter().position(|x| !x.is_zero()) else {
            return false;
        };
        let Some(inverse) = row[pivot].inverse() else {
            return false;
        };
        row.iter_mut().for_each(|x| *x = *x * inverse);
        self.rows.push((pivot, row));
        true
    }

    /// Whether a row lies in the row space.
    pub fn contains(&self, row: &[Modular]) -> bool {
        self.reduced(row).iter().all(|x| x.is_zero())
    }

    /// The rows in reduced form: each pivot column is zero in all rows but its own.
    pub fn reduced_rows(&self) -> Vec<(usize, Vec<Modular>)> {
        let mut rows = self.rows.clone();
        for k in (0..rows.len()).rev() {
            let (pivot, row) = rows[k].clone();
            for (_, above) in &mut rows[..k] {
                eliminate(above, pivot, &row);
            }
        }
        rows
    }

    /// A basis of the directions that no row sees: one vector per column without pivot.
    pub fn kernel(&self) -> Vec<Vec<Modular>> {
        let rows = self.reduced_rows();
        let free = (0..self.width).filter(|j| rows.iter().all(|(pivot, _)| pivot != j));
        let direction = |j: usize| {
            let mut direction = vec![Modular::ZERO; self.width];
            direction[j] = Modular::ONE;
            for (pivot, row) in &rows {
                direction[*pivot] = -row[j];
            }
            direction
        };
        free.map(direction).collect()
    }
}

/// row −= row[pivot]·known
fn eliminate(row: &mut [Modular], pivot: usize, known: &[Modular]) {
    let factor = -row[pivot];
    if factor.is_zero() {
        return;
    }
    for (x, y) in row.iter_mut().zip(known) {
        *x = *x + factor * *y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[i64]) -> Vec<Modular> {
        let number = |&x: &i64| {
            let magnitude = Modular::new(x.unsigned_abs());
            if x < 0 { -magnitude } else { magnitude }
        };
        values.iter().map(number).collect()
    }

    #[test]
    fn kernel_and_rows_are_orthogonal() {
        let rows = [row(&[1, 2, 3, 4]), row(&[2, 4, 6, 9]), row(&[1, 2, 3, 5])];
        let mut echelon = Echelon::new(4);
        let new: Vec<bool> = rows.iter().map(|r| echelon.add(r)).collect();
        assert_eq!(new, [true, true, false]);
        let kernel = echelon.kernel();
        assert_eq!(kernel.len(), 2);
        for (r, v) in rows.iter().flat_map(|r| kernel.iter().map(move |v| (r, v))) {
            let product = r.iter().zip(v).fold(Modular::ZERO, |s, (a, b)| s + *a * *b);
            assert!(product.is_zero());
        }
        assert!(echelon.contains(&row(&[0, 0, 0, 7])) && !echelon.contains(&row(&[1, 0, 0, 0])));
    }
}
