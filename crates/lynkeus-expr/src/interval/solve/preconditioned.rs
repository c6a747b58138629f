//! Krawczyk's iteration on the system multiplied by an approximate inverse.

use super::Interval;
use crate::interval::rounding::{add_up, div_up, mul_up};

/// The iteration converges linearly; more steps would only polish the last digits of badly conditioned systems.
const ITERATIONS: usize = 12;

/// Encloses the solutions, or finds no proof that all matrices are regular.
pub fn solve(a: &[Interval], b: &[Interval]) -> Option<Vec<Interval>> {
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
            .fold(0.0, |sum, (&e, &u)| add_up(sum, mul_up(e, u)));
        contraction = contraction.max(div_up(image, u[i]));
        reach = reach.max(div_up(z[i].magnitude(), u[i]));
    }
    let slack = -add_up(contraction, -1.0);
    if !(slack > 0.0 && reach.is_finite()) {
        return None;
    }
    let radius = div_up(reach, slack);
    let bounds = u.iter().map(|&u| {
        let bound = mul_up(radius, u);
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
pub(in crate::interval) fn invert(m: &[f64], n: usize) -> Option<Vec<f64>> {
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
