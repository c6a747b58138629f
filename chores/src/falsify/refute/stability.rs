//! Whether the error's Jacobian has an eigenvalue that does not decay.

use astro_float_num::BigFloat;
use lynkeus::expr::{Node, Tape};
use lynkeus::observers::Observer;
use lynkeus::structure::{AugmentedPlant, Point};

use super::super::claims::Refutation;
use super::super::precise::Precise;
use super::{Answer, Lens};

/// An eigenvalue of the error's Jacobian is said not to decay, by more than 1e-9 of the
/// matrix's size.
pub(super) fn unstable(
    observer: &Observer,
    refutation: &Refutation,
    augmented: &AugmentedPlant<'_>,
    lens: &Lens,
) -> Result<Answer, String> {
    let Some(point) = refutation.points.first() else {
        return Err("no point".into());
    };
    let Some(A) = jacobian(observer, point, augmented, lens)? else {
        return Ok(Answer::Unread);
    };
    let n = A.len();
    let size = A
        .iter()
        .flatten()
        .fold(0.0_f64, |m, a| m.max(Precise::rounded(a).abs()));
    if !size.is_finite() {
        return Err(format!(
            "the Jacobian has no value at {:?}",
            point.coordinates
        ));
    }
    let precise = &lens.precise;
    let mut shifted = A;
    for (i, row) in shifted.iter_mut().enumerate() {
        row[i] = precise.sub(&row[i], &precise.number(1e-10 * size));
    }
    match is_hurwitz(precise, &shifted) {
        true => Err(format!(
            "all {n} eigenvalues decay at {:?}",
            point.coordinates
        )),
        false => Ok(Answer::Confirmed),
    }
}

/// ∂x̂'/∂x̂ where the estimate is right; none for observers with further states or signals.
fn jacobian(
    observer: &Observer,
    point: &Point,
    augmented: &AugmentedPlant<'_>,
    lens: &Lens,
) -> Result<Option<Vec<Vec<BigFloat>>>, String> {
    let n = augmented.states.len();
    if observer.states.len() != n || !observer.input_derivatives.is_empty() {
        return Ok(None);
    }
    let precise = &lens.precise;
    let value = |name: &str| {
        let given = point.coordinates.iter().find(|c| c.name == name);
        precise.number(given.map_or(0.0, |c| c.value))
    };
    let graph = augmented.graph();
    let names = augmented.states.iter().chain(&augmented.inputs);
    let mut symbols: Vec<Node> = names.clone().map(|v| v.node).collect();
    let mut place: Vec<BigFloat> = names.map(|v| value(&v.name)).collect();
    symbols.push(augmented.plant.time);
    place.push(value("time"));
    let h: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
    let outputs = Tape::new(graph, &symbols, &h).map_err(|e| e.to_string())?;
    let y = outputs.eval_in(precise, &place);
    for (signal, y) in observer.measured.iter().zip(y) {
        symbols.push(signal.symbol);
        place.push(y);
    }
    let mut own = vec![];
    for (k, (hat, _)) in observer.states.iter().enumerate() {
        own.push(symbols.len());
        symbols.push(hat.symbol);
        place.push(place[k].clone());
    }
    let tape = Tape::new(graph, &symbols, &observer.derivatives).map_err(|e| e.to_string())?;
    let mut columns = vec![];
    for moved in own {
        let at = |by: &BigFloat| {
            let mut place = place.clone();
            place[moved] = precise.add(&place[moved], by);
            tape.eval_in(precise, &place)
        };
        let (above, below) = (at(&lens.step), at(&lens.step.neg()));
        let column: Vec<BigFloat> = above
            .iter()
            .zip(&below)
            .map(|(a, b)| lens.slope(a, b, 2.0))
            .collect();
        columns.push(column);
    }
    let row = |i: usize| columns.iter().map(|c| c[i].clone()).collect();
    Ok(Some((0..n).map(row).collect()))
}

/// Whether every eigenvalue has a negative real part: the coefficients by Faddeev and
/// LeVerrier, then Routh's scheme.
fn is_hurwitz(precise: &Precise, A: &[Vec<BigFloat>]) -> bool {
    let n = A.len();
    let zero = precise.number(0.0);
    let mut coefficients = vec![precise.number(1.0)];
    let mut M = vec![vec![zero.clone(); n]; n];
    for k in 1..=n {
        let last = coefficients[k - 1].clone();
        M = product(precise, A, &M);
        for (i, row) in M.iter_mut().enumerate() {
            row[i] = precise.add(&row[i], &last);
        }
        let AM = product(precise, A, &M);
        let trace = (0..n).fold(zero.clone(), |sum, i| precise.add(&sum, &AM[i][i]));
        coefficients.push(precise.div(&trace, &precise.number(-(k as f64))));
    }
    let every = |start: usize| {
        coefficients
            .iter()
            .skip(start)
            .step_by(2)
            .cloned()
            .collect()
    };
    let mut rows: [Vec<BigFloat>; 2] = [every(0), every(1)];
    for _ in 0..n {
        let [above, below] = &rows;
        let positive = |x: Option<&BigFloat>| x.is_some_and(|x| x.is_positive() && !x.is_zero());
        if !positive(above.first()) || !positive(below.first()) {
            return false;
        }
        let of = |row: &[BigFloat], i: usize| row.get(i).cloned().unwrap_or(zero.clone());
        let ratio = precise.div(&above[0], &below[0]);
        let next: Vec<BigFloat> = (1..above.len())
            .map(|i| precise.sub(&of(above, i), &precise.mul(&ratio, &of(below, i))))
            .collect();
        if next.is_empty() {
            return true;
        }
        rows = [below.clone(), next];
    }
    true
}

fn product(precise: &Precise, A: &[Vec<BigFloat>], B: &[Vec<BigFloat>]) -> Vec<Vec<BigFloat>> {
    let n = A.len();
    let entry = |i: usize, j: usize| {
        (0..n).fold(precise.number(0.0), |sum, k| {
            precise.add(&sum, &precise.mul(&A[i][k], &B[k][j]))
        })
    };
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decays(rows: &[&[f64]]) -> bool {
        let precise = Precise::new(256).unwrap();
        let row = |row: &&[f64]| row.iter().map(|x| precise.number(*x)).collect();
        let A: Vec<Vec<BigFloat>> = rows.iter().map(row).collect();
        is_hurwitz(&precise, &A)
    }

    #[test]
    fn stable_matrices_are_told_from_unstable_ones() {
        assert!(decays(&[&[-1.0]]));
        assert!(!decays(&[&[1e-20]]));
        assert!(decays(&[&[0.0, 1.0], &[-2.0, -1e-9]]));
        assert!(!decays(&[&[0.0, 1.0], &[-2.0, 1e-9]]));
        assert!(!decays(&[&[0.0, 1.0], &[-1.0, 0.0]]));
        // s³ + s² + 2s + c is stable below c = 2
        let of = |c: f64| decays(&[&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-c, -2.0, -1.0]]);
        assert!(of(1.999) && !of(2.001));
    }
}
