//! The kernel of a matrix of numbers, for certain: by elimination in interval arithmetic.

use lynkeus_expr::Interval;
use lynkeus_proof::matrix::{IntervalMatrix, points, sum};
use nalgebra::DMatrix;

/// Components of a direction are rounded to multiples of its inverse.
const GRID: f64 = 1_048_576.0;
/// Components below this share of the largest are not taken for the unit of a direction.
const SIGNIFICANT: f64 = 1e-6;

/// What F ξ = 0 leaves of ξ.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kernel {
    /// nothing but zero
    Zero,
    /// this direction, exactly; or near to this one where F is wider than tall
    Direction(Vec<f64>),
    /// rounding errors hide it
    Unknown,
}

/// A column in which nothing but a one is left.
struct Pivot {
    row: usize,
    column: usize,
}

/// The kernel of F.
pub(super) fn kernel(F: &DMatrix<f64>) -> Kernel {
    let mut rows = points(F);
    let mut pivots: Vec<Pivot> = vec![];
    let mut free = vec![];
    for column in 0..F.ncols() {
        let unused = (0..F.nrows()).filter(|row| pivots.iter().all(|p| p.row != *row));
        let size = |row: usize| rows[row][column].mignitude();
        let largest = unused.max_by(|&i, &j| size(i).total_cmp(&size(j)));
        match largest.filter(|&row| size(row) > 0.0) {
            Some(row) => {
                eliminate(&mut rows, row, column);
                pivots.push(Pivot { row, column });
            }
            None => free.push(column),
        }
    }
    if free.is_empty() {
        return Kernel::Zero;
    }
    let directions = free.iter().map(|&column| {
        let mut ξ = vec![0.0; F.ncols()];
        ξ[column] = 1.0;
        for pivot in &pivots {
            ξ[pivot.column] = -rows[pivot.row][column].midpoint();
        }
        ξ
    });
    let directions: Vec<Vec<f64>> = directions.collect();
    let exact = directions.iter().find_map(|ξ| exact(F, ξ));
    // more unknowns than equations always leave a direction
    let near = directions
        .into_iter()
        .next()
        .filter(|ξ| F.ncols() > F.nrows() && ξ.iter().all(|x| x.is_finite()));
    exact.or(near).map_or(Kernel::Unknown, Kernel::Direction)
}

/// Divides a row by its pivot and takes it from all others.
fn eliminate(rows: &mut IntervalMatrix, row: usize, column: usize) {
    let lead = rows[row][column];
    let mut top: Vec<Interval> = rows[row].iter().map(|x| *x / lead).collect();
    top[column] = Interval::ONE;
    for (i, other) in rows.iter_mut().enumerate() {
        let factor = other[column];
        if i == row || factor.magnitude() == 0.0 {
            continue;
        }
        for (x, above) in other.iter_mut().zip(&top) {
            *x = *x - factor * *above;
        }
        other[column] = Interval::ZERO;
    }
    rows[row] = top;
}

/// A direction of few digits near to this one that F maps to zero without any rounding.
fn exact(F: &DMatrix<f64>, ξ: &[f64]) -> Option<Vec<f64>> {
    let largest = ξ.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let units = ξ.iter().filter(|x| x.abs() > SIGNIFICANT * largest);
    let rounded = units.map(|unit| ξ.iter().map(move |x| (x / unit * GRID).round() / GRID));
    rounded
        .map(Iterator::collect)
        .find(|ξ: &Vec<f64>| is_mapped_to_zero(F, ξ))
}

fn is_mapped_to_zero(F: &DMatrix<f64>, ξ: &[f64]) -> bool {
    F.row_iter().all(|row| {
        let terms = row.iter().zip(ξ);
        let image = sum(terms.map(|(&f, &ξ)| Interval::point(f) * Interval::point(ξ)));
        image.is_defined() && image.magnitude() == 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: usize, columns: usize, entries: &[f64]) -> Kernel {
        kernel(&DMatrix::from_row_slice(rows, columns, entries))
    }

    #[test]
    fn small_numbers_are_no_zeros() {
        assert_eq!(of(2, 2, &[1.0, 0.0, 0.0, 1e-14]), Kernel::Zero);
        assert_eq!(of(2, 2, &[1.0, 0.0, 1e10, 1e-300]), Kernel::Zero);
        assert_eq!(of(3, 1, &[0.0, 0.0, 5e-324]), Kernel::Zero);
    }

    #[test]
    fn directions_are_exact() {
        assert_eq!(
            of(2, 2, &[3.0, 1.0, 6.0, 2.0]),
            Kernel::Direction(vec![1.0, -3.0])
        );
        assert_eq!(of(2, 1, &[0.0, 0.0]), Kernel::Direction(vec![1.0]));
        // a kernel of two directions
        assert_eq!(of(3, 3, &[1.0; 9]), Kernel::Direction(vec![1.0, -1.0, 0.0]));
        // 0.3 is not three times 0.1, and no number of few digits
        assert_eq!(of(2, 2, &[0.1, 0.3, 0.2, 0.6]), Kernel::Unknown);
    }

    #[test]
    fn what_is_wider_than_tall_has_a_direction() {
        let Kernel::Direction(ξ) = of(1, 2, &[0.1, 0.3]) else {
            panic!()
        };
        assert!((0.1 * ξ[0] + 0.3 * ξ[1]).abs() < 1e-15 && ξ[1] == 1.0);
    }
}
