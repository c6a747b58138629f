//! The dimensions behind a linearisation, exactly: which rounding and thresholds have to agree with before its modes count.
//!
//! The numbers of the Jacobian are rational, every one of them. Their images modulo a prime of 61 bits have the same
//! ranks, but for accidents of a probability near 2⁻⁵⁰.

use lynkeus_expr::modular::{Echelon, Modular, dot, unit};
use nalgebra::DMatrix;

/// What an augmented state shows of what can move without a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shows {
    /// nothing
    Nothing,
    /// what an unknown input moves
    Moved,
    /// so many modes
    Modes(usize),
}

/// What each state and each signal shows, from ∂(f, h)/∂(x, v) with `n` states; none where a number has no image.
pub(super) fn shows(J: &DMatrix<f64>, n: usize) -> Option<Vec<Shows>> {
    let wide = J.ncols();
    let rows: Vec<Vec<Modular>> = J
        .row_iter()
        .map(|row| row.iter().map(|x| Modular::of_double(*x)).collect())
        .collect::<Option<_>>()?;
    let (flow, outputs) = (&rows[..n], &rows[wide..]);
    // the first have different x, of the rest x is zero
    let (moving, free): (Vec<_>, Vec<_>) = traceless(flow, outputs, wide)
        .into_iter()
        .partition(|(pivot, _)| *pivot < n);
    let d = moving.len();
    let step = |(_, pair): &(usize, Vec<Modular>)| -> Option<Vec<Modular>> {
        let moved: Vec<Modular> = flow.iter().map(|row| dot(row, pair)).collect();
        coordinates(&moving, &moved)
    };
    // x = Σ aₖ basisₖ: row k has the coordinates of what basisₖ becomes
    let A: Vec<Vec<Modular>> = moving.iter().map(step).collect::<Option<_>>()?;
    let first: Vec<Vec<Modular>> = free.iter().map(step).collect::<Option<_>>()?;
    let reached = reached(&A, first);
    let of = |place: usize| {
        let row: Vec<Modular> = moving.iter().map(|(_, pair)| pair[place]).collect();
        let is_free = free.iter().any(|(_, pair)| !pair[place].is_zero());
        if is_free || reached.rows().any(|a| !dot(a, &row).is_zero()) {
            return Shows::Moved;
        }
        // row, A row, A² row, …
        let mut seen = Echelon::new(d);
        let mut next = row;
        while seen.add(&next) {
            next = A.iter().map(|a| dot(a, &next)).collect();
        }
        match seen.rank() {
            0 => Shows::Nothing,
            count => Shows::Modes(count),
        }
    };
    Some((0..wide).map(of).collect())
}

/// The pairs (x, v) that can move without a trace, reduced, each with its pivot.
fn traceless(
    flow: &[Vec<Modular>],
    outputs: &[Vec<Modular>],
    wide: usize,
) -> Vec<(usize, Vec<Modular>)> {
    let n = flow.len();
    let mut space = Echelon::of(n, (0..n).map(|i| unit(n, i)));
    loop {
        // what has no part across the space
        let across = space.kernel();
        let conditions = across.iter().map(|w| times(w, flow));
        let pairs = Echelon::of(wide, conditions.chain(outputs.iter().cloned())).kernel();
        let next = Echelon::of(n, pairs.iter().map(|pair| &pair[..n]));
        if next.rank() >= space.rank() {
            return Echelon::of(wide, pairs).reduced_rows();
        }
        space = next;
    }
}

/// The smallest space with these rows that A maps into itself.
fn reached(A: &[Vec<Modular>], first: Vec<Vec<Modular>>) -> Echelon {
    let mut space = Echelon::of(A.len(), first);
    let mut open: Vec<Vec<Modular>> = space.rows().map(<[Modular]>::to_vec).collect();
    while let Some(a) = open.pop() {
        let next = times(&a, A);
        if space.add(&next) {
            open.push(next);
        }
    }
    space
}

/// Σ aₖ rowₖ
fn times(a: &[Modular], rows: &[Vec<Modular>]) -> Vec<Modular> {
    let wide = rows.first().map_or(0, Vec::len);
    let column = |j: usize| -> Vec<Modular> { rows.iter().map(|row| row[j]).collect() };
    (0..wide).map(|j| dot(a, &column(j))).collect()
}

/// a with x = Σ aₖ basisₖ in the leading entries, for a reduced basis with its pivots; none where there is none.
fn coordinates(basis: &[(usize, Vec<Modular>)], x: &[Modular]) -> Option<Vec<Modular>> {
    let a: Vec<Modular> = basis.iter().map(|(pivot, _)| x[*pivot]).collect();
    let is_same = x.iter().enumerate().all(|(j, x)| {
        let column: Vec<Modular> = basis.iter().map(|(_, row)| row[j]).collect();
        dot(&a, &column) == *x
    });
    is_same.then_some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

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
