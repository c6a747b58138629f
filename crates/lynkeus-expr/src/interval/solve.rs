//! Enclosures of the solutions of linear systems with interval coefficients.
//!
//! Two methods are tried and their results intersected, for each alone is a proof:
//! 1. Gaussian elimination on the system as given: good for triangular and diagonally dominant matrices, and for wide
//!    coefficients in them;
//! 2. preconditioning with an approximate inverse R of the midpoint matrix: RA = I − E with a small E, which is regular
//!    when |E|u < u for some positive vector u, and then Krawczyk's iteration x ← (Rb + Ex) ∩ x.

use super::Interval;
use super::rounding::{product, quotient, sum};

/// Encloses all solutions x of A x = b; `a` is n×n row by row, `b` has n entries.
///
/// Returns the n enclosures, and whether every matrix in A was proved regular. Where that fails the enclosures hold all
/// real numbers and are not [defined](Interval::is_defined); they are empty when an entry of A or b is. A number of
/// entries other than n² in `a` is answered like a matrix that cannot be proved regular.
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
    let eliminated = eliminated(a, b);
    let preconditioned = preconditioned(a, b);
    match (eliminated, preconditioned) {
        (Some(x), Some(y)) => Some(x.iter().zip(&y).map(|(x, y)| x.intersection(*y)).collect()),
        (x, y) => x.or(y),
    }
}

/// Encloses the solutions by Gaussian elimination, or finds no pivot that excludes zero.
fn eliminated(a: &[Interval], b: &[Interval]) -> Option<Vec<Interval>> {
    let n = b.len();
    let mut rows: Vec<Vec<Interval>> = (0..n)
        .map(|i| {
            let row = a.iter().skip(i * n).take(n);
            row.chain(b.get(i)).copied().collect()
        })
        .collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| {
            let size = |row: usize| rows[row][k].mignitude();
            size(i).total_cmp(&size(j))
        })?;
        rows.swap(k, pivot);
        if rows[k][k].contains_zero() {
            return None;
        }
        let (above, below) = rows.split_at_mut(k + 1);
        for row in below {
            eliminate(&above[k], row, k);
        }
    }
    Some(substitute_back(&rows))
}

/// Subtracts the multiple of `pivot` from `row` that makes entry `k` zero.
fn eliminate(pivot: &[Interval], row: &mut [Interval], k: usize) {
    let factor = row[k] / pivot[k];
    if factor == Interval::ZERO {
        return;
    }
    for (entry, &above) in row.iter_mut().zip(pivot).skip(k + 1) {
        *entry = *entry - factor * above;
    }
    row[k] = Interval::ZERO;
}

fn substitute_back(rows: &[Vec<Interval>]) -> Vec<Interval> {
    let n = rows.len();
    let mut x = vec![Interval::ZERO; n];
    for i in (0..n).rev() {
        let row = &rows[i];
        let known = (i + 1..n).fold(Interval::ZERO, |sum, j| sum + row[j] * x[j]);
        x[i] = (row[n] - known) / row[i];
    }
    x
}

/// The iteration converges linearly; more steps would only polish the last digits of badly conditioned systems.
const ITERATIONS: usize = 12;

/// Encloses the solutions by Krawczyk's iteration on the system multiplied by an approximate inverse, or finds no proof
/// that all matrices are regular.
fn preconditioned(a: &[Interval], b: &[Interval]) -> Option<Vec<Interval>> {
    let n = b.len();
    let middle: Vec<f64> = a.iter().map(|entry| entry.midpoint()).collect();
    let inverse = invert(&middle, n)?;
    let r: Vec<Interval> = inverse
        .iter()
        .map(|&entry| Interval::point(entry))
        .collect();
    let z = times(&r, b, n);
    let e = defect(&r, a, n);
    let mut x = first_enclosure(&e, &z, n)?;
    for _ in 0..ITERATIONS {
        let image = times(&e, &x, n);
        let next = z.iter().zip(image).map(|(&z, image)| z + image);
        let next: Vec<Interval> = next
            .zip(&x)
            .map(|(next, x)| next.intersection(*x))
            .collect();
        if next == x {
            break;
        }
        x = next;
    }
    Some(x)
}

/// M v for a matrix given row by row.
fn times(m: &[Interval], v: &[Interval], n: usize) -> Vec<Interval> {
    m.chunks(n.max(1))
        .map(|row| {
            let terms = row.iter().zip(v).map(|(&m, &v)| m * v);
            terms.fold(Interval::ZERO, |sum, term| sum + term)
        })
        .collect()
}

/// E = I − R A.
fn defect(r: &[Interval], a: &[Interval], n: usize) -> Vec<Interval> {
    let mut e = Vec::with_capacity(n * n);
    for i in 0..n {
        for j in 0..n {
            let unit = if i == j {
                Interval::ONE
            } else {
                Interval::ZERO
            };
            e.push((0..n).fold(unit, |rest, k| rest - r[i * n + k] * a[k * n + j]));
        }
    }
    e
}

/// |x| ≤ u·max|zᵢ|/uᵢ / (1 − max (|E|u)ᵢ/uᵢ) for a positive vector u with |E|u < u, which also proves that I − E, and
/// so A, is regular.
fn first_enclosure(e: &[Interval], z: &[Interval], n: usize) -> Option<Vec<Interval>> {
    let size: Vec<f64> = e.iter().map(|entry| entry.magnitude()).collect();
    let u = comparison_vector(&size, n)?;
    let mut contraction = 0.0_f64;
    let mut reach = 0.0_f64;
    for i in 0..n {
        let row = &size[i * n..(i + 1) * n];
        let image = row
            .iter()
            .zip(&u)
            .fold(0.0, |known, (&e, &u)| sum(known, product(e, u).up()).up());
        contraction = contraction.max(quotient(image, u[i]).up());
        reach = reach.max(quotient(z[i].magnitude(), u[i]).up());
    }
    let slack = -sum(contraction, -1.0).up();
    if !(slack > 0.0 && reach.is_finite()) {
        return None;
    }
    let radius = quotient(reach, slack).up();
    let bounds = u.iter().map(|&u| {
        let bound = product(radius, u).up();
        Interval::raw(-bound, bound, true)
    });
    Some(bounds.collect())
}

/// u = (I − |E|)⁻¹ (1, …, 1), positive if the spectral radius of |E| is below 1. It need not be exact: what is concluded
/// from it is verified.
fn comparison_vector(size: &[f64], n: usize) -> Option<Vec<f64>> {
    let mut m: Vec<f64> = size.iter().map(|entry| -entry).collect();
    for i in 0..n {
        m[i * n + i] += 1.0;
    }
    let inverse = invert(&m, n)?;
    let u: Vec<f64> = inverse
        .chunks(n.max(1))
        .map(|row| row.iter().sum())
        .collect();
    u.iter()
        .all(|u: &f64| u.is_finite() && *u > 0.0)
        .then_some(u)
}

/// Approximate inverse by Gauss–Jordan elimination with row pivoting; none when a pivot vanishes or overflows.
pub(super) fn invert(m: &[f64], n: usize) -> Option<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let unit = (0..n).map(|j| f64::from(u8::from(i == j)));
            m[i * n..(i + 1) * n].iter().copied().chain(unit).collect()
        })
        .collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| rows[i][k].abs().total_cmp(&rows[j][k].abs()))?;
        rows.swap(k, pivot);
        let mut top = std::mem::take(&mut rows[k]);
        let scale = top[k];
        if !scale.is_normal() {
            return None;
        }
        top.iter_mut().for_each(|entry| *entry /= scale);
        for row in rows.iter_mut().filter(|row| !row.is_empty()) {
            let factor = row[k];
            for (entry, above) in row.iter_mut().zip(&top) {
                *entry -= factor * above;
            }
        }
        rows[k] = top;
    }
    let inverse: Vec<f64> = rows.iter().flat_map(|row| row[n..].to_vec()).collect();
    inverse
        .iter()
        .all(|entry| entry.is_finite())
        .then_some(inverse)
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
