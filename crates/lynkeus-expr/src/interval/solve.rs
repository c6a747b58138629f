//! Enclosures of the solutions of linear systems with interval coefficients.
//!
//! Two methods are tried and their results intersected, for each alone is a proof:
//! 1. Gaussian elimination on the system as given: good for triangular and diagonally dominant matrices, and for wide
//!    coefficients in them;
//! 2. preconditioning with an approximate inverse R of the midpoint matrix: RA = I − E with a small E, which is regular
//!    when |E|u < u for some positive vector u, and then Krawczyk's iteration x ← (Rb + Ex) ∩ x.

mod elimination;
mod preconditioned;

pub(super) use preconditioned::invert;

use super::Interval;

/// Encloses all solutions x of A x = b; `a` is n×n row by row, `b` has n entries.
///
/// Returns the n enclosures, and whether every matrix in A was proved regular. Where that fails the enclosures hold all
/// real numbers and are not [defined](Interval::is_defined); they are empty when an entry of A or b is. A number of
/// entries other than n² in `a` is answered like a matrix that cannot be proved regular.
#[must_use]
pub fn solve(a: &[Interval], b: &[Interval]) -> (Vec<Interval>, bool) {
    let n = b.len();
    if a.iter().chain(b).any(|entry| entry.is_empty()) {
        return (vec![Interval::EMPTY; n], false);
    }
    let enclosure = if n.checked_mul(n) == Some(a.len()) {
        enclose(a, b)
    } else {
        None
    };
    let regular = enclosure.is_some();
    let x = enclosure.unwrap_or_else(|| vec![Interval::ENTIRE; n]);
    let defined = regular && a.iter().chain(b).all(|entry| entry.is_defined());
    let x = x.into_iter().map(|entry| entry.and_defined(defined));
    (x.collect(), regular)
}

fn enclose(a: &[Interval], b: &[Interval]) -> Option<Vec<Interval>> {
    if let ([a], [b]) = (a, b) {
        // the quotients of all their numbers: no method has a smaller range
        return (!a.contains_zero()).then(|| vec![*b / *a]);
    }
    let eliminated = elimination::solve(a, b);
    let preconditioned = preconditioned::solve(a, b);
    match (eliminated, preconditioned) {
        (Some(x), Some(y)) => Some(x.iter().zip(&y).map(|(x, y)| x.intersection(*y)).collect()),
        (x, y) => x.or(y),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(lo: f64, hi: f64) -> Interval {
        Interval::new(lo, hi).unwrap()
    }

    fn points(values: &[f64]) -> Vec<Interval> {
        values.iter().map(|&v| Interval::point(v)).collect()
    }

    #[test]
    fn a_point_system_is_enclosed_tightly() {
        let a = points(&[4.0, -2.0, 1.0, -2.0, 4.0, -2.0, 1.0, -2.0, 4.0]);
        let (x, regular) = solve(&a, &points(&[11.0, -16.0, 17.0]));
        assert!(regular);
        for (x, exact) in x.iter().zip([1.0, -2.0, 3.0]) {
            assert!(x.contains(exact) && x.width() < 1e-14 && x.is_defined());
        }
    }

    #[test]
    fn rows_and_columns_of_very_different_scale() {
        let a = points(&[1e9, 2e-3, 3e6, -1e-6]);
        let (x, regular) = solve(&a, &points(&[1.2e9 + 2e-3 * 5e5, 3.6e6 - 0.5]));
        assert!(regular);
        assert!(x[0].contains(1.2) && (x[0].width() < 1e-12));
        assert!(x[1].hi() - 5e5 > -1e-2 && x[1].width() < 1.0);
    }

    #[test]
    fn wide_triangular_matrices_are_regular() {
        let wide = interval(0.1, 100.0);
        let a = [wide, Interval::ZERO, interval(-5.0, 5.0), wide];
        let (x, regular) = solve(&a, &points(&[1.0, 1.0]));
        assert!(regular && x[0].is_subset(interval(0.0099, 10.01)));
        assert!(x[1].magnitude() < 511.0);
    }

    #[test]
    fn a_matrix_that_may_be_singular_is_not_decided() {
        let a = [
            interval(0.9, 1.1),
            Interval::ONE,
            Interval::ONE,
            Interval::ONE,
        ];
        let (x, regular) = solve(&a, &points(&[1.0, 2.0]));
        assert!(!regular);
        for x in x {
            assert!(!x.is_defined() && Interval::ENTIRE.is_subset(x));
        }
        let (_, regular) = solve(&points(&[1.0, 2.0, 2.0, 4.0]), &points(&[1.0, 2.0]));
        assert!(!regular);
    }

    #[test]
    fn unusable_input_is_answered() {
        assert_eq!(solve(&[], &[]), (vec![], true));
        assert!(!solve(&points(&[1.0]), &points(&[1.0, 2.0])).1);
        let (x, regular) = solve(&[Interval::EMPTY], &[Interval::ONE]);
        assert!(x[0].is_empty() && !regular);
        assert!(!solve(&[Interval::ENTIRE], &[Interval::ONE]).1);
        let unbounded = interval(1.0, f64::INFINITY);
        let (x, regular) = solve(&[unbounded], &[Interval::ONE]);
        assert!(regular && x[0] == interval(0.0, 1.0));
    }

    #[test]
    fn one_equation_is_a_quotient() {
        let (x, regular) = solve(&[interval(-4.0, -2.0)], &[interval(1.0, 6.0)]);
        assert!(regular && x[0] == interval(-3.0, -0.25) && x[0].is_defined());
        assert!(!solve(&[interval(0.0, 1.0)], &points(&[1.0])).1);
    }

    #[test]
    fn an_undefined_coefficient_marks_the_solution() {
        let (x, regular) = solve(&points(&[2.0]), &[Interval::ONE.and_defined(false)]);
        assert!(regular && !x[0].is_defined());
    }
}
