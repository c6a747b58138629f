//! What hides the unobservable: directions of the kernel as scalings or shifts, in the
//! user's names.

use std::time::Instant;

use crate::field::Modular;
use crate::local::Model;
use crate::search::Search;
use crate::{Question, Symmetry};

/// Weights of a scaling, and steps of a shift, are fractions with parts up to this.
const SMALL: i64 = 24;
/// Seed of the second point, which confirms what the first suggests.
const SECOND: u64 = 4711;

/// One direction of the kernel: fractions by column.
type Weights = Vec<(usize, i64)>;

pub(crate) fn symmetries(
    model: &Model,
    question: &Question,
    search: &Search<'_>,
    deadline: Instant,
) -> Vec<Symmetry> {
    let (directions, point) = search.hidden();
    if directions.is_empty() {
        return vec![];
    }
    let mut second = Search::new(model, question, SECOND, deadline);
    let confirmed = second.run().is_ok();
    let (others, elsewhere) = second.hidden();
    let describe = |direction: &Vec<Modular>| {
        let other = others
            .iter()
            .find(|other| leading(other) == leading(direction));
        let name = |column: usize| model.named[column].0.clone();
        let moves: Vec<String> = (0..direction.len())
            .filter(|&c| !direction[c].is_zero())
            .map(name)
            .collect();
        let scaling = weights(direction, Some(point));
        let shift = weights(direction, None);
        let same = |found: &Option<Weights>, at: Option<&[Modular]>| {
            confirmed && found.is_some() && other.is_some_and(|o| weights(o, at) == *found)
        };
        let names: Vec<String> = (0..direction.len()).map(name).collect();
        match (scaling, shift) {
            (found, _) if same(&found, Some(elsewhere)) => {
                scaled(found.unwrap_or_default(), moves, &names)
            }
            (_, found) if same(&found, None) => shifted(found.unwrap_or_default(), moves, &names),
            _ => Symmetry {
                words: format!(
                    "{} can change together without a trace in the outputs",
                    moves.join(", ")
                ),
                invariants: vec![],
                moves,
            },
        }
    };
    directions.iter().map(describe).collect()
}

/// The last column that moves: what makes a basis vector that of its free column.
fn leading(direction: &[Modular]) -> Option<usize> {
    direction.iter().rposition(|x| !x.is_zero())
}

/// The direction as small whole numbers, relative to the values where these are given;
/// none where it is not of that kind.
fn weights(direction: &[Modular], point: Option<&[Modular]>) -> Option<Weights> {
    let relative = |column: usize| match point {
        Some(point) => point[column]
            .inverse()
            .map(|inverse| direction[column] * inverse),
        None => Some(direction[column]),
    };
    let columns: Vec<usize> = (0..direction.len())
        .filter(|&c| !direction[c].is_zero())
        .collect();
    let first = relative(*columns.first()?)?.inverse()?;
    let mut fractions = vec![];
    for column in columns {
        let (n, d) = (relative(column)? * first).as_fraction(SMALL)?;
        fractions.push((column, n, d));
    }
    let common = fractions.iter().fold(1, |l, (_, _, d)| l / gcd(l, *d) * d);
    Some(
        fractions
            .into_iter()
            .map(|(c, n, d)| (c, n * (common / d)))
            .collect(),
    )
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 {
        a.abs().max(1)
    } else {
        gcd(b, a % b)
    }
}

/// x_i → s^{w_i}·x_i: products of powers with Σ m_i w_i = 0 stay.
fn scaled(weights: Weights, moves: Vec<String>, names: &[String]) -> Symmetry {
    let power = |column: usize, exponent: i64| match exponent {
        1 => names[column].clone(),
        _ => format!("{}^{exponent}", names[column]),
    };
    let invariants = pairs(&weights).map(|((a, p), (b, q))| {
        let g = gcd(p, q);
        // a^(q/g)·b^(−p/g)
        let (m, k) = (q / g, -p / g);
        let (m, k) = if m < 0 { (-m, -k) } else { (m, k) };
        match k > 0 {
            true => format!("{}*{}", power(a, m), power(b, k)),
            false => format!("{}/{}", power(a, m), power(b, -k)),
        }
    });
    let invariants: Vec<String> = invariants.collect();
    Symmetry {
        words: match invariants.is_empty() {
            true => format!("any {} gives the same outputs", moves.join(", ")),
            false => format!(
                "only {} can be known: {} can be scaled together",
                invariants.join(", "),
                moves.join(", ")
            ),
        },
        invariants,
        moves,
    }
}

/// x_i → x_i + s·w_i: combinations with Σ m_i w_i = 0 stay.
fn shifted(weights: Weights, moves: Vec<String>, names: &[String]) -> Symmetry {
    let multiple = |column: usize, factor: i64| match factor {
        1 => names[column].clone(),
        _ => format!("{factor}*{}", names[column]),
    };
    let invariants = pairs(&weights).map(|((a, p), (b, q))| {
        let g = gcd(p, q);
        let (m, k) = (q / g, -p / g);
        let (m, k) = if m < 0 { (-m, -k) } else { (m, k) };
        match k > 0 {
            true => format!("{} + {}", multiple(a, m), multiple(b, k)),
            false => format!("{} - {}", multiple(a, m), multiple(b, -k)),
        }
    });
    let invariants: Vec<String> = invariants.collect();
    Symmetry {
        words: format!(
            "only {} can be known: {} can be shifted together",
            invariants.join(", "),
            moves.join(", ")
        ),
        invariants,
        moves,
    }
}

/// The first quantity with each of the others.
fn pairs(weights: &Weights) -> impl Iterator<Item = ((usize, i64), (usize, i64))> + '_ {
    let first = weights.first().copied();
    weights
        .iter()
        .skip(1)
        .filter_map(move |&other| Some((first?, other)))
}
