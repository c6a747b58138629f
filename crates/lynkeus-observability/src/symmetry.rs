//! What hides the unobservable: groups of quantities that scale or shift together, and
//! what of them is known nevertheless, in the user's names.

use std::collections::BTreeSet;

use crate::Symmetry;
use crate::field::Modular;
use crate::hidden::{Direction, Hidden, columns, groups, kernel_among};
use crate::model::Model;
use crate::search::Search;

/// Weights of a scaling, and steps of a shift, are fractions with parts up to this.
const SMALL: i64 = 24;
/// Names in words before the rest becomes a count.
const LISTED: usize = 8;

/// n/d by column, relative to the own column of the direction.
type Weights = Vec<(usize, i64, i64)>;

/// A second start, which confirms what the first suggests.
pub(crate) struct Twin<'a> {
    pub search: &'a Search<'a>,
}

impl Twin<'_> {
    /// What is hidden there among the same quantities.
    fn hidden(&self, hidden: &Hidden) -> Vec<Direction> {
        match &hidden.among {
            None => self.search.unseen(),
            Some(among) => {
                let rows = self.search.restricted(among);
                kernel_among(&rows, among, self.search.columns().named)
            }
        }
    }
}

/// How a group acts on its quantities.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Scaling,
    Shift,
}

/// The groups of quantities that the hidden directions move, in words.
pub(crate) fn symmetries(
    model: &Model,
    hidden: &Hidden,
    point: &[Modular],
    twin: Option<&Twin<'_>>,
) -> Vec<Symmetry> {
    let names: Vec<&str> = model.named.iter().map(|(name, _)| name.as_str()).collect();
    let others = twin.map(|twin| twin.hidden(hidden));
    let described = |group: Vec<&Direction>| {
        let of = |kind: Kind| {
            let here = weights_of(&group, kind, point)?;
            let others = others.as_ref()?;
            let twins = group
                .iter()
                .map(|(own, _)| others.iter().find(|(o, _)| o == own));
            let twins: Vec<&Direction> = twins.collect::<Option<_>>()?;
            let there = weights_of(&twins, kind, twin?.search.point())?;
            (here == there).then_some(here)
        };
        let kinds = [Kind::Scaling, Kind::Shift];
        match kinds.into_iter().find_map(|kind| Some((kind, of(kind)?))) {
            Some((kind, weights)) => named(kind, &group, &weights, &names),
            None => unnamed(&group, &names),
        }
    };
    let groups = groups(&hidden.directions);
    groups.into_iter().map(described).collect()
}

fn weights_of(group: &[&Direction], kind: Kind, point: &[Modular]) -> Option<Vec<Weights>> {
    group
        .iter()
        .map(|direction| weights(direction, kind, point))
        .collect()
}

/// The direction as small fractions, relative to the values for a scaling; none where it
/// is not of that kind.
fn weights(direction: &Direction, kind: Kind, point: &[Modular]) -> Option<Weights> {
    let relative = |column: usize| match kind {
        Kind::Scaling => point[column]
            .inverse()
            .map(|inverse| direction.1[column] * inverse),
        Kind::Shift => Some(direction.1[column]),
    };
    let own = relative(direction.0)?.inverse()?;
    let fraction = |column: usize| {
        let (n, d) = (relative(column)? * own).as_fraction(SMALL)?;
        Some((column, n, d))
    };
    columns(direction).map(fraction).collect()
}

fn moved(group: &[&Direction], names: &[&str]) -> Vec<String> {
    let all: BTreeSet<usize> = group.iter().flat_map(|d| columns(d)).collect();
    all.into_iter()
        .map(|column| names[column].to_owned())
        .collect()
}

fn unnamed(group: &[&Direction], names: &[&str]) -> Symmetry {
    let moves = moved(group, names);
    let known = moves.len() - group.len().min(moves.len());
    Symmetry {
        words: format!(
            "{} can change together without a trace in the outputs: {known} combinations of these {} can be known",
            listed(&moves),
            moves.len()
        ),
        invariants: vec![],
        directions: group.len(),
        moves,
    }
}

/// A scaling x_i → s^{w_i}·x_i leaves products of powers with Σ m_i w_i = 0 alone, a shift
/// x_i → x_i + s·w_i sums. Own columns move in one direction each, so that every other
/// column c gives one: x_c with what its weights take back from the own columns.
fn named(kind: Kind, group: &[&Direction], weights: &[Weights], names: &[&str]) -> Symmetry {
    let moves = moved(group, names);
    let own: BTreeSet<usize> = group.iter().map(|d| d.0).collect();
    let all: BTreeSet<usize> = weights.iter().flatten().map(|w| w.0).collect();
    let invariants: Vec<String> = all
        .difference(&own)
        .map(|&column| {
            let of = |w: &Weights| w.iter().find(|w| w.0 == column).map(|w| (w.1, w.2));
            let taken: Vec<(usize, i64, i64)> = group
                .iter()
                .zip(weights)
                .filter_map(|(direction, w)| of(w).map(|(n, d)| (direction.0, n, d)))
                .collect();
            let common = taken.iter().fold(1, |l, (.., d)| l / gcd(l, *d) * d);
            let mut factors = vec![(names[column], common)];
            factors.extend(
                taken
                    .into_iter()
                    .map(|(own, n, d)| (names[own], -n * (common / d))),
            );
            written(kind, &factors)
        })
        .collect();
    let how = match kind {
        Kind::Scaling => "scaled",
        Kind::Shift => "shifted",
    };
    Symmetry {
        words: match (invariants.is_empty(), &moves[..]) {
            (true, [only]) => format!("{only} can have any value: the outputs do not feel it"),
            (true, _) => format!(
                "{} can have any values: the outputs do not feel them",
                listed(&moves)
            ),
            (false, _) => format!(
                "of {}, which can be {how} together, only {} can be known",
                listed(&moves),
                listed(&invariants)
            ),
        },
        invariants,
        directions: group.len(),
        moves,
    }
}

/// The first few, and how many there are.
fn listed(names: &[String]) -> String {
    match names.len() > LISTED {
        true => format!("{}, … ({} in all)", names[..LISTED].join(", "), names.len()),
        false => names.join(", "),
    }
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 {
        a.abs().max(1)
    } else {
        gcd(b, a % b)
    }
}

/// `a*b^2/c`, or `a + 2*b - c`.
fn written(kind: Kind, factors: &[(&str, i64)]) -> String {
    let one = |name: &str, size: i64| match (kind, size) {
        (_, 1) => name.to_owned(),
        (Kind::Scaling, _) => format!("{name}^{size}"),
        (Kind::Shift, _) => format!("{size}*{name}"),
    };
    let side = |positive: bool| -> Vec<String> {
        let of_sign = factors
            .iter()
            .filter(|(_, m)| (*m > 0) == positive && *m != 0);
        of_sign.map(|(name, m)| one(name, m.abs())).collect()
    };
    let (up, down) = (side(true), side(false));
    match kind {
        Kind::Scaling => match down.len() {
            0 => up.join("*"),
            1 => format!("{}/{}", up.join("*"), down[0]),
            _ => format!("{}/({})", up.join("*"), down.join("*")),
        },
        Kind::Shift => {
            let down: String = down.iter().map(|term| format!(" - {term}")).collect();
            up.join(" + ") + &down
        }
    }
}
