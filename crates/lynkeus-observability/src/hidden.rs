//! Which of the directions that no derivative so far has seen no derivative will ever see; and the groups of
//! quantities that these move, which scale or shift together, in the user's names.

use std::collections::BTreeSet;

use crate::expansion::{Affine, Columns, Start};
use crate::hull;
use crate::model::Model;
use crate::search::Search;
use crate::series::Stop;
use crate::{Kind, Symmetry};
use lynkeus_expr::modular::{Echelon, Modular, dot};

/// A direction of the named quantities, with the column that moves in no other one.
pub(crate) type Direction = (usize, Vec<Modular>);

/// Directions that are proved to leave no trace in the outputs.
#[derive(Clone, Debug)]
pub(crate) struct Hidden {
    /// the quantities among which they are all there are; none for all quantities
    pub among: Option<Vec<usize>>,
    pub directions: Vec<Direction>,
}

impl Hidden {
    /// All directions that the rows leave: no later row can bring anything.
    pub fn all(search: &Search<'_>) -> Self {
        Self {
            among: None,
            directions: search.unseen(),
        }
    }

    /// These, among the quantities that they move.
    fn among(directions: &[&Direction]) -> Self {
        Self {
            among: Some(moved(directions).into_iter().collect()),
            directions: directions.iter().map(|d| (*d).clone()).collect(),
        }
    }

    /// Whether a combination of the unknowns changes along one of the directions.
    pub fn moves(&self, row: &[Modular]) -> bool {
        let mut directions = self.directions.iter();
        directions.any(|(_, direction)| !dot(row, direction).is_zero())
    }
}

/// The columns that a direction moves.
fn columns(direction: &Direction) -> impl Iterator<Item = usize> + '_ {
    let moving = |&c: &usize| !direction.1[c].is_zero();
    (0..direction.1.len()).filter(moving)
}

/// The columns that some directions move.
fn moved(directions: &[&Direction]) -> BTreeSet<usize> {
    directions.iter().flat_map(|d| columns(d)).collect()
}

/// Directions that share quantities, directly or by others.
fn groups(directions: &[Direction]) -> Vec<Vec<&Direction>> {
    let mut groups: Vec<(BTreeSet<usize>, Vec<&Direction>)> = vec![];
    for direction in directions {
        let mut joined: (BTreeSet<usize>, Vec<&Direction>) = (columns(direction).collect(), vec![]);
        let (touching, apart): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|(columns, _)| !columns.is_disjoint(&joined.0));
        groups = apart;
        for (columns, members) in touching {
            joined.0.extend(columns);
            joined.1.extend(members);
        }
        joined.1.push(direction);
        groups.push(joined);
    }
    groups.into_iter().map(|(_, members)| members).collect()
}

/// What is proved hidden at a special start, from the rank at a generic point of an invariant
/// set around it: of some quantities, that rank bounds the one at the start, all derivatives
/// counted. Where the rows so far reach it, what they leave of these quantities stays.
pub(crate) fn beside(special: &Search<'_>, generic: &Search<'_>) -> Vec<Hidden> {
    let unseen = special.unseen();
    let hidden = |directions: &[&Direction]| {
        let among: Vec<usize> = moved(directions).into_iter().collect();
        let rank = |search: &Search<'_>| search.restricted(&among).rank();
        (rank(special) >= rank(generic)).then(|| Hidden::among(directions))
    };
    let one_by_one = |group: Vec<&Direction>| -> Vec<Hidden> {
        match hidden(&group) {
            Some(found) => vec![found],
            None => group.iter().filter_map(|d| hidden(&[d])).collect(),
        }
    };
    groups(&unseen).into_iter().flat_map(one_by_one).collect()
}

/// The directions of `found` beside those that `proved` spans already; all of them at once
/// where these leave nothing else unseen.
pub(crate) fn joined(
    search: &Search<'_>,
    mut proved: Vec<Hidden>,
    found: &[Vec<Modular>],
) -> Vec<Hidden> {
    let named = search.columns().named;
    let known = proved.iter().flat_map(|hidden| &hidden.directions);
    let mut span = Echelon::of(named, known.map(|(_, direction)| direction));
    let fresh = found.iter().filter(|direction| span.add(direction));
    let fresh = Echelon::of(named, fresh).reduced_rows();
    let all = Hidden::all(search);
    if span.rank() == all.directions.len() {
        return vec![all];
    }
    proved.extend(groups(&fresh).iter().map(|group| Hidden::among(group)));
    proved
}

/// Ranks after some order, by what the unknown inputs do to them.
#[derive(Debug, PartialEq)]
struct Ranks {
    /// for each k: rows whose highest derivative of an unknown input is the k-th
    by_derivative: Vec<usize>,
    /// rows without any
    settled: usize,
}

impl Ranks {
    fn of(search: &Search<'_>, order: usize) -> Self {
        let columns = search.columns();
        let inputs: Vec<usize> = (0..=order)
            .rev()
            .flat_map(|k| columns.of_inputs(k))
            .collect();
        let (m, reduced) = (columns.of_inputs(0).len(), search.restricted(&inputs));
        let mut by_derivative = vec![0; order + 1];
        // pivots stand in the first column that is not zero: the highest derivative's
        for pivot in reduced.pivots() {
            by_derivative[order - pivot / m] += 1;
        }
        Self {
            settled: search.rank() - reduced.rank(),
            by_derivative,
        }
    }

    fn of_inputs(&self) -> usize {
        self.by_derivative.iter().sum()
    }
}

/// Whether from some order on the rows at a special start bring nothing new about states,
/// parameters and present unknown inputs, with unknown inputs. False may also mean: not known.
///
/// At a generic point of the invariant set `settled` decides. Let the ranks at the start agree
/// with those there after order k, sorted by the highest derivative of an unknown input
/// in a row; and let order k + 1 add there as many rows as have only the inputs themselves in
/// them. Then each row's derivative has the derivative of the same leading term, at the start as well, so
/// that the ranks agree for all higher orders too: the settled part, which never shrinks, cannot grow.
pub(crate) fn is_steady(
    model: &Model,
    (special, generic): (&Start, &Start),
    set: &Affine,
    last: usize,
) -> Result<bool, Stop> {
    let columns = Columns::new(model, last).moving(set);
    let begin = |start| Search::new(model, start, columns.clone());
    let (mut here, mut there) = (begin(special), begin(generic));
    let mut before: Option<(Ranks, Ranks)> = None;
    for k in 0..=last {
        here.advance()?;
        there.advance()?;
        let now = (Ranks::of(&here, k), Ranks::of(&there, k));
        if let Some((here, there)) = before {
            let added = now.1.of_inputs() - there.of_inputs();
            if here == there && now.1.settled == there.settled && added == there.by_derivative[0] {
                return Ok(true);
            }
        }
        before = Some(now);
    }
    Ok(false)
}

/// Seed of the point at which branches are compared.
const COMPARED: u64 = 1;
/// Rounds in which a point is looked for that suits all branches.
const ROUNDS: usize = 8;

/// Whether branches of a model, without known starts, leave the same directions of states and parameters unseen:
/// then one branch carries on what another one hides. False may also mean: not known.
pub(crate) fn hide_alike(mut models: Vec<Model>) -> bool {
    let Some((first, others)) = models.split_first_mut() else {
        return true;
    };
    for symbols in others.iter_mut().map(|model| &mut model.symbols) {
        let pairs = symbols.iter_mut().zip(&first.symbols);
        pairs.for_each(|(symbol, of_first)| symbol.negative = of_first.negative);
    }
    if first.known_starts().next().is_some() {
        return false;
    }
    let Some(starts) = common(&models) else {
        return false;
    };
    let spaces = models.iter().zip(&starts).map(|(model, start)| {
        let mut search = Search::new(model, start, Columns::new(model, model.depth));
        search.run_out().ok()?;
        let lasting = model.named.len() - model.unknown_inputs;
        let unseen = search.unseen();
        let parts = unseen.iter().map(|(_, direction)| &direction[..lasting]);
        Some(Echelon::of(lasting, parts))
    });
    let Some(spaces) = spaces.collect::<Option<Vec<Echelon>>>() else {
        return false;
    };
    let is_same = |space: &Echelon| {
        space.rank() == spaces[0].rank() && space.rows().all(|row| spaces[0].contains(row))
    };
    spaces.iter().all(is_same)
}

/// One point for all models, each with its own signs of roots.
fn common(models: &[Model]) -> Option<Vec<Start>> {
    let mut point = Start::new(models.first()?, COMPARED);
    for _ in 0..ROUNDS {
        let before = point.clone();
        let mut starts = vec![];
        for model in models {
            point = hull::find(model, point.elsewhere()).ok()?;
            starts.push(point.clone());
        }
        if starts.iter().all(|start| start.is_at(&before)) {
            return Some(starts);
        }
    }
    None
}

/// Weights of a scaling, and steps of a shift, are fractions with parts up to this.
const SMALL: i64 = 24;

/// n/d by column, relative to the own column of the direction.
type Weights = Vec<(usize, i64, i64)>;

/// What is hidden at another start among the same quantities.
fn hidden_at(search: &Search<'_>, hidden: &Hidden) -> Vec<Direction> {
    let Some(among) = &hidden.among else {
        return search.unseen();
    };
    let named = search.columns().named;
    let whole = |direction: Vec<Modular>| {
        let mut whole = vec![Modular::ZERO; named];
        for (&column, x) in among.iter().zip(direction) {
            whole[column] = x;
        }
        whole
    };
    let unseen = search.restricted(among).kernel();
    Echelon::of(named, unseen.into_iter().map(whole)).reduced_rows()
}

/// The groups of quantities that the hidden directions move; `twin` is a second start, which confirms what
/// the first suggests.
pub(crate) fn symmetries(
    model: &Model,
    hidden: &Hidden,
    point: &[Modular],
    twin: Option<&Search<'_>>,
) -> Vec<Symmetry> {
    let names: Vec<&str> = model.named.iter().map(|(name, _)| name.as_str()).collect();
    let name = |column: usize| names[column].to_owned();
    let others = twin.map(|twin| hidden_at(twin, hidden));
    let described = |group: Vec<&Direction>| {
        let of = |kind: Kind| {
            let here = weights_of(&group, kind, point)?;
            let others = others.as_ref()?;
            let twins = group
                .iter()
                .map(|(own, _)| others.iter().find(|(o, _)| o == own));
            let twins: Vec<&Direction> = twins.collect::<Option<_>>()?;
            let there = weights_of(&twins, kind, twin?.point())?;
            (here == there).then_some(here)
        };
        let kinds = [Kind::Scaling, Kind::Shift];
        match kinds.into_iter().find_map(|kind| Some((kind, of(kind)?))) {
            Some((kind, weights)) => named(kind, &group, &weights, &names),
            None => Symmetry {
                moves: moved(&group).into_iter().map(name).collect(),
                directions: group.len(),
                kind: None,
                invariants: vec![],
            },
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

/// A scaling x_i → s^{w_i}·x_i leaves products of powers with Σ m_i w_i = 0 alone, a shift
/// x_i → x_i + s·w_i sums. Own columns move in one direction each, so that every other
/// column c gives one: x_c with what its weights take back from the own columns.
fn named(kind: Kind, group: &[&Direction], weights: &[Weights], names: &[&str]) -> Symmetry {
    let name = |column: usize| names[column].to_owned();
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
    Symmetry {
        moves: moved(group).into_iter().map(name).collect(),
        directions: group.len(),
        kind: Some(kind),
        invariants,
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
