//! Refutations, looked at again with seventy digits: does the witness show what it is
//! said to show? Slopes are differences of the equations' values, so the library's
//! derivatives are judged as well.

use astro_float_num::BigFloat;
use lynkeus::expr::{Node, Tape};
use lynkeus::observers::{Design, Observer, Statement};
use lynkeus::structure::{Extended, Point};

use super::claims::Refutation;
use super::precise::Precise;

/// The judgement on a refutation.
pub enum Answer {
    Confirmed,
    /// of a condition that is not known here
    Unread,
    /// with the evidence
    Wrong(String),
}

/// Judges a refutation.
pub fn check(refutation: &Refutation, extended: &Extended<'_>, design: Option<&Design>) -> Answer {
    let judged = match (
        refutation.of_error,
        slope_of(&refutation.condition, extended),
    ) {
        (false, Some(slope)) => sign(&slope, refutation, extended),
        (true, _) => match design {
            Some(design) => unstable(&design.observer, refutation, extended),
            None => Ok(Answer::Unread),
        },
        _ => Ok(Answer::Unread),
    };
    judged.unwrap_or_else(Answer::Wrong)
}

/// A slope: of `value` in the symbol `of`.
struct Slope {
    value: Node,
    of: Node,
}

/// The slope that a condition is about.
fn slope_of(condition: &Statement, extended: &Extended<'_>) -> Option<Slope> {
    let (value, by) = match condition {
        Statement::PartialKeepsSign { of, by } => {
            (extended.derivatives[extended.state_index(of)?], by)
        }
        Statement::OutputKeepsSign { output, state } => {
            let mut outputs = extended.outputs.iter();
            let found = outputs.find(|o| o.variable.name == *output)?;
            (found.variable.node, state)
        }
        _ => return None,
    };
    let of = extended.states[extended.state_index(by)?].node;
    Some(Slope { value, of })
}

/// Steps of differences, to be seen against 1e-77.
const STEP: f64 = 1e-36;
/// Slopes below it count as zero.
const ZERO: f64 = 1e-26;

fn sign(slope: &Slope, refutation: &Refutation, extended: &Extended<'_>) -> Result<Answer, String> {
    let values: Vec<f64> = refutation
        .points
        .iter()
        .map(|point| slope_at(slope, point, extended))
        .collect::<Result<_, _>>()?;
    let size = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (point, value) in refutation.points.iter().zip(&values) {
        if value.is_nan() || (value - point.value).abs() > 1e-6 * (1e-3 + size) {
            return Err(format!(
                "the slope is {value}, said to be {} at {:?}",
                point.value, point.coordinates
            ));
        }
    }
    let vanishes = values.iter().any(|v| v.abs() <= ZERO);
    let differs = values.iter().any(|v| *v < -ZERO) && values.iter().any(|v| *v > ZERO);
    match vanishes || differs {
        true => Ok(Answer::Confirmed),
        false => Err(format!(
            "the slopes {values:?} show no change of sign: {:?}",
            refutation.points
        )),
    }
}

/// The central difference at a point of the box.
fn slope_at(slope: &Slope, point: &Point, extended: &Extended<'_>) -> Result<f64, String> {
    let graph = extended.graph();
    let region = extended.region();
    let symbols = region.symbols();
    let mut place = vec![];
    // what the slope does not depend on is beside the middle of its range, where models
    // like to switch
    for (side, centre) in region.dimensions.iter().zip(&region.centre()) {
        let width = (side.max - side.min).min(1e6);
        let centre = centre + 0.1234 * width;
        let given = point
            .coordinates
            .iter()
            .find(|c| c.0 == side.name)
            .map(|c| c.1);
        if given.is_some_and(|x| !(side.min <= x && x <= side.max)) {
            return Err(format!("{} = {given:?} is outside of the box", side.name));
        }
        place.push(Precise::from(given.unwrap_or(centre)));
    }
    let moved = symbols
        .iter()
        .position(|s| *s == slope.of)
        .ok_or("no such symbol")?;
    let tape = Tape::new(graph, &symbols, &[slope.value]).map_err(|e| e.to_string())?;
    let precise = Precise::new()?;
    let at = |by: f64| {
        let mut place = place.clone();
        place[moved] = Precise::add(&place[moved], &Precise::from(by));
        tape.eval_in(&precise, &place).remove(0)
    };
    Ok(Precise::rounded(&difference(&at(STEP), &at(-STEP))))
}

fn difference(above: &BigFloat, below: &BigFloat) -> BigFloat {
    Precise::div(&Precise::sub(above, below), &Precise::from(2.0 * STEP))
}

/// An eigenvalue of the error's Jacobian is said not to decay, by more than 1e-9 of the
/// matrix's size.
fn unstable(
    observer: &Observer,
    refutation: &Refutation,
    extended: &Extended<'_>,
) -> Result<Answer, String> {
    let Some(point) = refutation.points.first() else {
        return Err("no point".into());
    };
    let Some(A) = jacobian(observer, point, extended)? else {
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
    let mut shifted = A;
    for (i, row) in shifted.iter_mut().enumerate() {
        row[i] = Precise::sub(&row[i], &Precise::from(1e-10 * size));
    }
    match is_hurwitz(&shifted) {
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
    extended: &Extended<'_>,
) -> Result<Option<Vec<Vec<BigFloat>>>, String> {
    let n = extended.states.len();
    if observer.states.len() != n || !observer.input_derivatives.is_empty() {
        return Ok(None);
    }
    let value = |name: &str| {
        let given = point.coordinates.iter().find(|c| c.0 == name);
        Precise::from(given.map_or(0.0, |c| c.1))
    };
    let graph = extended.graph();
    let precise = Precise::new()?;
    let names = extended.states.iter().chain(&extended.inputs);
    let mut symbols: Vec<Node> = names.clone().map(|v| v.node).collect();
    let mut place: Vec<BigFloat> = names.map(|v| value(&v.name)).collect();
    symbols.push(extended.plant.time);
    place.push(value("time"));
    let h: Vec<Node> = extended.outputs.iter().map(|o| o.variable.node).collect();
    let outputs = Tape::new(graph, &symbols, &h).map_err(|e| e.to_string())?;
    let y = outputs.eval_in(&precise, &place);
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
        let at = |by: f64| {
            let mut place = place.clone();
            place[moved] = Precise::add(&place[moved], &Precise::from(by));
            tape.eval_in(&precise, &place)
        };
        let (above, below) = (at(STEP), at(-STEP));
        let column: Vec<BigFloat> = above
            .iter()
            .zip(&below)
            .map(|(a, b)| difference(a, b))
            .collect();
        columns.push(column);
    }
    let row = |i: usize| columns.iter().map(|c| c[i].clone()).collect();
    Ok(Some((0..n).map(row).collect()))
}

/// Whether every eigenvalue has a negative real part: the coefficients by Faddeev and
/// LeVerrier, then Routh's scheme.
fn is_hurwitz(A: &[Vec<BigFloat>]) -> bool {
    let n = A.len();
    let zero = Precise::from(0.0);
    let mut coefficients = vec![Precise::from(1.0)];
    let mut M = vec![vec![zero.clone(); n]; n];
    for k in 1..=n {
        let last = coefficients[k - 1].clone();
        M = product(A, &M);
        for (i, row) in M.iter_mut().enumerate() {
            row[i] = Precise::add(&row[i], &last);
        }
        let AM = product(A, &M);
        let trace = (0..n).fold(zero.clone(), |sum, i| Precise::add(&sum, &AM[i][i]));
        coefficients.push(Precise::div(&trace, &Precise::from(-(k as f64))));
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
        let ratio = Precise::div(&above[0], &below[0]);
        let next: Vec<BigFloat> = (1..above.len())
            .map(|i| Precise::sub(&of(above, i), &Precise::mul(&ratio, &of(below, i))))
            .collect();
        if next.is_empty() {
            return true;
        }
        rows = [below.clone(), next];
    }
    true
}

fn product(A: &[Vec<BigFloat>], B: &[Vec<BigFloat>]) -> Vec<Vec<BigFloat>> {
    let n = A.len();
    let entry = |i: usize, j: usize| {
        (0..n).fold(Precise::from(0.0), |sum, k| {
            Precise::add(&sum, &Precise::mul(&A[i][k], &B[k][j]))
        })
    };
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(rows: &[&[f64]]) -> Vec<Vec<BigFloat>> {
        rows.iter()
            .map(|row| row.iter().map(|x| Precise::from(*x)).collect())
            .collect()
    }

    #[test]
    fn stable_matrices_are_told_from_unstable_ones() {
        assert!(is_hurwitz(&matrix(&[&[-1.0]])));
        assert!(!is_hurwitz(&matrix(&[&[1e-20]])));
        assert!(is_hurwitz(&matrix(&[&[0.0, 1.0], &[-2.0, -1e-9]])));
        assert!(!is_hurwitz(&matrix(&[&[0.0, 1.0], &[-2.0, 1e-9]])));
        assert!(!is_hurwitz(&matrix(&[&[0.0, 1.0], &[-1.0, 0.0]])));
        // s³ + s² + 2s + c is stable below c = 2
        let of = |c: f64| matrix(&[&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-c, -2.0, -1.0]]);
        assert!(is_hurwitz(&of(1.999)) && !is_hurwitz(&of(2.001)));
    }
}
