//! Equations that never determine their unknowns: their Jacobian is singular wherever it is
//! looked at, as it is where a constraint between states is hidden among them; or wherever it is
//! looked at on their side of a threshold, as that of `max(x - 10, 0)` is.

use lynkeus_expr::{Graph, Node, Tape, jacobian};

use super::diagnose::lines;
use super::loops::Torn;
use super::{Unknown, listed};
use crate::syntax::{Problem, Result, Span};

/// Points looked at.
const POINTS: usize = 4;
/// Points farther away that are looked at where slopes jump.
const FAR: usize = 96;
/// Powers of ten up to which they are away.
const POWERS: usize = 8;
/// A pivot this small against its row is none.
const TINY: f64 = 1e-11;

/// Names the equations of a block of which one follows from the others.
pub(super) fn check(graph: &Graph, torn: &Torn<'_>, source: &str) -> Result<()> {
    let unknowns: Vec<Node> = torn.unknowns.iter().map(|unknown| unknown.symbol).collect();
    let slopes = jacobian::forward(graph, &torn.residuals, &unknowns);
    let entries: Vec<Node> = slopes.entries.iter().map(|entry| entry.2).collect();
    let symbols = graph.symbols_of(&entries);
    let Ok(tape) = Tape::new(graph, &symbols, &entries) else {
        return Ok(());
    };
    // none where a slope has no value
    let look = |turn: usize| {
        let values = tape.eval_in(&lynkeus_expr::Reals, &point(torn, &symbols, turn));
        let places = slopes.entries.iter().map(|&(i, j, _)| (i, j));
        let are_finite = values.iter().all(|value| value.is_finite());
        are_finite.then(|| rank(unknowns.len(), places.zip(values)))
    };
    let mut dependent = None;
    for rank in (1..=POINTS).filter_map(look) {
        match rank {
            Rank::Full => return Ok(()),
            Rank::Dependent(rows) => dependent = Some(rows),
        }
    }
    let Some(rows) = dependent else {
        return Ok(());
    };
    let nodes = graph.reachable(&entries).into_iter();
    let may_jump = nodes.into_iter().any(|node| graph.jumps(node));
    let mut far = (POINTS + 1..=POINTS + FAR).filter_map(look);
    let reach = match may_jump && far.any(|rank| rank == Rank::Full) {
        true => Reach::NearTheStart,
        false => Reach::Everywhere,
    };
    Err(undetermined(torn, &rows, reach, source))
}

/// Where equations are singular.
#[derive(Clone, Copy)]
enum Reach {
    /// as far as they were looked at
    Everywhere,
    /// on this side of a threshold
    NearTheStart,
}

/// Of a square matrix.
#[derive(Debug, PartialEq)]
enum Rank {
    Full,
    /// the rows of which a combination vanishes
    Dependent(Vec<usize>),
}

fn rank(n: usize, entries: impl Iterator<Item = ((usize, usize), f64)>) -> Rank {
    let mut matrix = vec![vec![0.0; n]; n];
    for ((i, j), value) in entries {
        matrix[i][j] = value;
    }
    dependent_rows(matrix).map_or(Rank::Full, Rank::Dependent)
}

/// Numbers in which no relation hides: multiples of √2, √3, … modulo 1, off zero; of the unknowns
/// within their ranges, or beyond their starts. From the turn after [`POINTS`] on ever farther, on
/// either side.
fn point(torn: &Torn<'_>, symbols: &[Node], turn: usize) -> Vec<f64> {
    let part = |i: usize| (turn as f64 * ((i + 2) as f64 + 0.1 * turn as f64).sqrt()).fract();
    let is_far = turn > POINTS;
    let away = |i: usize| match is_far {
        true => (0.3 + part(i)) * 10.0_f64.powi((turn % POWERS) as i32),
        false => 0.3 + part(i),
    };
    let side = |i: usize| {
        if is_far && part(i + symbols.len()) < 0.5 {
            -1.0
        } else {
            1.0
        }
    };
    let within = |unknown: &Unknown, i: usize| {
        let (low, high) = (unknown.range.lo(), unknown.range.hi());
        match (low.is_finite(), high.is_finite()) {
            (true, true) => low + part(i) * (high - low),
            (false, true) => unknown.start - away(i),
            (true, false) => unknown.start + away(i),
            (false, false) => unknown.start + side(i) * away(i),
        }
    };
    let places = symbols.iter().enumerate();
    places
        .map(|(i, symbol)| {
            let mut unknowns = torn.unknowns.iter();
            match unknowns.find(|unknown| unknown.symbol == *symbol) {
                Some(unknown) => within(unknown, i),
                None => side(i) * away(i),
            }
        })
        .collect()
}

/// The rows of which a combination vanishes; none where the matrix is regular.
fn dependent_rows(mut rows: Vec<Vec<f64>>) -> Option<Vec<usize>> {
    let n = rows.len();
    // each row with what it is made of
    for (i, row) in rows.iter_mut().enumerate() {
        let size = row.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        if size == 0.0 {
            return Some(vec![i]);
        }
        row.iter_mut().for_each(|x| *x /= size);
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for k in 0..n {
        let largest = |row: &Vec<f64>| row[k..n].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if let Some(row) = rows[k..].iter().find(|row| largest(row) < TINY) {
            return Some((0..n).filter(|&j| row[n + j].abs() > TINY).collect());
        }
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let size = |&(i, j): &(usize, usize)| rows[i][j].abs();
        let pivot = places.max_by(|a, b| size(a).total_cmp(&size(b)))?;
        rows.swap(k, pivot.0);
        rows.iter_mut().for_each(|row| row.swap(k, pivot.1));
        let top = rows[k].clone();
        for row in &mut rows[k + 1..] {
            let factor = row[k] / top[k];
            row.iter_mut()
                .zip(&top)
                .for_each(|(x, top)| *x -= factor * top);
        }
    }
    None
}

fn undetermined(torn: &Torn<'_>, rows: &[usize], reach: Reach, source: &str) -> Problem {
    let dependent = rows.iter().map(|&i| torn.equations[i].span);
    let span = dependent
        .clone()
        .max_by_key(|span| span.start)
        .unwrap_or_default();
    let mut spans: Vec<Span> = dependent.chain(torn.used.iter().map(|e| e.span)).collect();
    spans.sort_by_key(|span| span.start);
    let names = listed(torn.all.iter().copied());
    let (place, hint) = match reach {
        Reach::Everywhere => (
            "everywhere",
            "one equation repeats others, or is a constraint between states or inputs (index \
             above 1): leave it out, or replace it by its derivative with respect to time",
        ),
        Reach::NearTheStart => (
            "where these start, and determine them elsewhere only",
            "give a start, or min and max, on the side of the threshold on which they are",
        ),
    };
    let message = format!("these equations do not determine {names}: they are singular {place}");
    let lines = lines(source, spans.into_iter());
    Problem::new(span, message)
        .label(format!(
            "it says nothing new of them beside the others on {lines}"
        ))
        .hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_that_depend_on_each_other_are_found() {
        let regular = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        assert_eq!(dependent_rows(regular), None);
        let repeated = vec![
            vec![1.0, 2.0, 0.0],
            vec![0.0, 1.0, 1.0],
            vec![2.0, 4.0, 0.0],
        ];
        assert_eq!(dependent_rows(repeated), Some(vec![0, 2]));
        let scaled = vec![vec![1e-9, 0.0], vec![0.0, 1e9]];
        assert_eq!(dependent_rows(scaled), None);
        assert_eq!(dependent_rows(vec![vec![0.0]]), Some(vec![0]));
    }
}
