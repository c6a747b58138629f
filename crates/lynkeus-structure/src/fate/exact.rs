//! The dimensions behind a linearisation, exactly: which rounding and thresholds have to agree with before its modes count.
//!
//! The numbers of the Jacobian are rational, every one of them. Their images modulo the prime 2⁶¹ − 1 have the same
//! ranks, but for accidents of a probability near 2⁻⁵⁰.

use nalgebra::DMatrix;

/// 2⁶¹ − 1
const P: u64 = (1 << 61) - 1;

/// What an extended state shows of what can move without a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shows {
    /// nothing
    Nothing,
    /// what an unknown input moves
    Moved,
    /// so many modes
    Modes(usize),
}

/// A matrix row by row.
type Rows = Vec<Vec<u64>>;

/// What each state and each signal shows, from ∂(f, h)/∂(x, v) with `n` states; none where a number has no image.
pub(super) fn shows(J: &DMatrix<f64>, n: usize) -> Option<Vec<Shows>> {
    let wide = J.ncols();
    let rows: Rows = J
        .row_iter()
        .map(|row| row.iter().map(|x| image(*x)).collect())
        .collect::<Option<_>>()?;
    let (flow, outputs) = (&rows[..n], &rows[wide..]);
    // pairs (x, v), one per row
    let mut space: Rows = (0..n).map(|i| unit(i, n)).collect();
    let pairs = loop {
        // what has no part across the space
        let across = null_space(&space, n);
        let mut conditions: Rows = across.iter().map(|w| times(w, flow)).collect();
        conditions.extend(outputs.iter().cloned());
        let pairs = null_space(&conditions, wide);
        let next = echelon(pairs.iter().map(|pair| pair[..n].to_vec()).collect(), n).0;
        if next.len() >= space.len() {
            break echelon(pairs, n).0;
        }
        space = next;
    };
    // the first have different x, of the rest x is zero
    let (moving, free): (Vec<_>, Vec<_>) = pairs
        .into_iter()
        .partition(|pair| pair[..n].iter().any(|x| *x != 0));
    let basis: Rows = moving.iter().map(|pair| pair[..n].to_vec()).collect();
    let d = basis.len();
    let step = |pair: &Vec<u64>| -> Option<Vec<u64>> {
        let moved: Vec<u64> = flow.iter().map(|row| dot(row, pair)).collect();
        coordinates(&basis, &moved)
    };
    // x = Σ aₖ basisₖ: row k has the coordinates of what basisₖ becomes
    let A: Rows = moving.iter().map(step).collect::<Option<_>>()?;
    let mut reached: Rows = free.iter().map(step).collect::<Option<_>>()?;
    loop {
        let count = reached.len();
        let mut all = reached.clone();
        all.extend(reached.iter().map(|a| times(a, &A)));
        reached = echelon(all, d).0;
        if reached.len() <= count {
            break;
        }
    }
    let of = |place: usize| {
        let row: Vec<u64> = moving.iter().map(|pair| pair[place]).collect();
        let is_moved =
            free.iter().any(|pair| pair[place] != 0) || reached.iter().any(|a| dot(a, &row) != 0);
        if is_moved {
            return Shows::Moved;
        }
        // row, A row, A² row, …
        let mut seen: Rows = vec![];
        let mut next = row;
        loop {
            let count = seen.len();
            seen.push(next.clone());
            seen = echelon(seen, d).0;
            if seen.len() == count {
                break;
            }
            next = A.iter().map(|a| dot(a, &next)).collect();
        }
        match seen.len() {
            0 => Shows::Nothing,
            count => Shows::Modes(count),
        }
    };
    Some((0..wide).map(of).collect())
}

/// The image of a number, which is m·2ᵉ.
fn image(x: f64) -> Option<u64> {
    if !x.is_finite() {
        return None;
    }
    let bits = x.abs().to_bits();
    let exponent = (bits >> 52) as i64;
    let fraction = bits & ((1 << 52) - 1);
    let (mantissa, exponent) = match exponent {
        0 => (fraction, -1074),
        exponent => (fraction | 1 << 52, exponent - 1075),
    };
    // 2⁶¹ = 1
    let shifted = multiply(mantissa % P, 1 << exponent.rem_euclid(61));
    Some(if x < 0.0 {
        subtract(0, shifted)
    } else {
        shifted
    })
}

fn multiply(a: u64, b: u64) -> u64 {
    (u128::from(a) * u128::from(b) % u128::from(P)) as u64
}

fn add(a: u64, b: u64) -> u64 {
    (a + b) % P
}

fn subtract(a: u64, b: u64) -> u64 {
    (a + P - b) % P
}

/// a^(P − 2)
fn inverse(a: u64) -> u64 {
    let (mut base, mut left, mut result) = (a, P - 2, 1);
    while left > 0 {
        if left & 1 == 1 {
            result = multiply(result, base);
        }
        base = multiply(base, base);
        left >>= 1;
    }
    result
}

fn dot(a: &[u64], b: &[u64]) -> u64 {
    let terms = a.iter().zip(b).map(|(a, b)| multiply(*a, *b));
    terms.fold(0, add)
}

/// Σ aₖ rowₖ
fn times(a: &[u64], rows: &[Vec<u64>]) -> Vec<u64> {
    let wide = rows.first().map_or(0, Vec::len);
    (0..wide)
        .map(|j| {
            a.iter()
                .zip(rows)
                .fold(0, |sum, (a, row)| add(sum, multiply(*a, row[j])))
        })
        .collect()
}

fn unit(i: usize, n: usize) -> Vec<u64> {
    (0..n).map(|j| u64::from(i == j)).collect()
}

/// Rows reduced by their first `wide` entries, those of zeros left out unless further entries are not, and the places
/// of the pivots.
fn echelon(mut rows: Rows, wide: usize) -> (Rows, Vec<usize>) {
    let mut pivots = vec![];
    for j in 0..wide {
        let done = pivots.len();
        let Some(place) = (done..rows.len()).find(|&i| rows[i][j] != 0) else {
            continue;
        };
        rows.swap(done, place);
        let scale = inverse(rows[done][j]);
        rows[done].iter_mut().for_each(|x| *x = multiply(*x, scale));
        let pivot = rows[done].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != done) {
            let factor = row[j];
            if factor != 0 {
                let pairs = row.iter_mut().zip(&pivot);
                pairs.for_each(|(x, p)| *x = subtract(*x, multiply(factor, *p)));
            }
        }
        pivots.push(j);
    }
    rows.retain(|row| row.iter().any(|x| *x != 0));
    (rows, pivots)
}

/// A basis of the x of `wide` entries that all rows send to zero.
fn null_space(rows: &[Vec<u64>], wide: usize) -> Rows {
    let (rows, pivots) = echelon(rows.to_vec(), wide);
    let free = (0..wide).filter(|j| !pivots.contains(j));
    free.map(|j| {
        let mut x = unit(j, wide);
        for (row, &pivot) in rows.iter().zip(&pivots) {
            x[pivot] = subtract(0, row[j]);
        }
        x
    })
    .collect()
}

/// a with Σ aₖ basisₖ = x, for a basis in echelon form; none where there is none.
fn coordinates(basis: &[Vec<u64>], x: &[u64]) -> Option<Vec<u64>> {
    let pivot = |row: &Vec<u64>| row.iter().position(|x| *x != 0);
    let a: Vec<u64> = basis
        .iter()
        .map(|row| pivot(row).map(|j| x[j]))
        .collect::<Option<_>>()?;
    let same = match basis.is_empty() {
        true => x.iter().all(|x| *x == 0),
        false => times(&a, basis) == x,
    };
    same.then_some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_images() {
        let half = image(0.5).unwrap();
        assert_eq!(multiply(half, 2), 1);
        assert_eq!(add(image(-3.0).unwrap(), 3), 0);
        let small = image(1e-300).unwrap();
        assert_eq!(multiply(small, inverse(small)), 1);
    }

    /// x1' = w, y = x0, x0' = −x0 + 1e-12 x1: however small, it shows.
    #[test]
    fn small_couplings_count() {
        let J =
            |coupling: f64| DMatrix::from_row_slice(3, 2, &[-1.0, coupling, 0.0, -2.0, 1.0, 0.0]);
        assert_eq!(shows(&J(1e-12), 2).unwrap(), [Shows::Nothing; 2]);
        assert_eq!(
            shows(&J(0.0), 2).unwrap(),
            [Shows::Nothing, Shows::Modes(1)]
        );
    }

    /// x0' = x1 + w, x1' = −x1, y = x0: w follows x1; a second input moves with it.
    #[test]
    fn unknown_inputs_are_followed() {
        let J = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0]);
        let J = J.insert_row(2, 0.0);
        assert_eq!(
            shows(&J, 2).unwrap(),
            [Shows::Nothing, Shows::Modes(1), Shows::Modes(1)]
        );
        let two = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0, 1.0, 1.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            ],
        );
        let mut two = two.insert_row(4, 0.0);
        two[(4, 0)] = 1.0;
        assert_eq!(
            shows(&two, 2).unwrap(),
            [Shows::Nothing, Shows::Modes(1), Shows::Moved, Shows::Moved]
        );
    }
}
