//! Gaussian elimination in interval arithmetic.

use super::Interval;

/// Encloses the solutions, or finds no pivot that excludes zero.
pub fn solve(a: &[Interval], b: &[Interval]) -> Option<Vec<Interval>> {
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
