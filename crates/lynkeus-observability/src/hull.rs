//! The smallest affine set that holds the known starts and is invariant under the flow.
//!
//! A series from a known start can be poorer than from any other: x = p·t⁴¹ shows p in
//! the 41st derivative. What is hidden in the first hundred may show in the next. But the rank of
//! the outputs' sensitivities, all derivatives counted, is a lower semicontinuous function of the start, so
//! that it is at most the rank at a generic point of any irreducible set which holds the
//! start and which no solution leaves; and there a finite number of derivatives is enough. The
//! tighter the set, the sharper the bound: an equilibrium stays in a point, s' = −s from s = 0
//! in a plane.

use std::collections::BTreeMap;

use crate::expansion::{Affine, Columns, Expansion, Start};
use crate::model::{Model, Role};
use crate::series::Stop;
use lynkeus_expr::modular::{Echelon, Modular, Random, unit};

/// Seed of the points at which the flow is looked at.
const FIRST: u64 = 9001;
/// Points that have to bring nothing new before the set counts as invariant.
const CONFIRMED: usize = 2;

/// The set, grown from the known starts by the flow at random points of it.
pub(crate) fn invariant(model: &Model, at_zero: bool) -> Result<Affine, Stop> {
    let mut moving: Vec<usize> = model.known_starts().collect();
    moving.extend(model.time().filter(|_| at_zero));
    let mut set: Affine = vec![];
    let mut span = Echelon::new(model.symbols.len());
    let (mut confirmed, mut seed) = (0, FIRST);
    while confirmed < CONFIRMED {
        seed += 1;
        let start = Start::new(model, seed).at_zero(at_zero);
        let start = start.within(model, &set);
        let velocity = match velocity(model, start, &moving) {
            Ok(velocity) => velocity,
            Err(Stop::Point(_)) => return Ok(everywhere(model, &moving)),
            Err(stop) => return Err(stop),
        };
        if span.add(&velocity) {
            set.push(velocity);
            confirmed = 0;
        } else {
            confirmed += 1;
        }
    }
    Ok(set)
}

/// The derivatives of these symbols at a start.
fn velocity(model: &Model, start: Start, moving: &[usize]) -> Result<Vec<Modular>, Stop> {
    let start = find(model, start)?;
    let columns = Columns::new(model, 0);
    let mut expansion = Expansion::new(model, &start, columns);
    expansion.first()?;
    let mut velocity = vec![Modular::ZERO; model.symbols.len()];
    for &place in moving {
        velocity[place] = match model.symbols[place].role {
            Role::State(i) => expansion.root(i).0,
            _ => Modular::ONE,
        };
    }
    Ok(velocity)
}

/// Every known start free: invariant, whatever the flow.
pub(crate) fn everywhere(model: &Model, moving: &[usize]) -> Affine {
    let count = model.symbols.len();
    moving.iter().map(|&place| unit(count, place)).collect()
}

/// Points tried before the model counts as singular everywhere.
const POINTS: u64 = 4096;

/// Failures in a row after which an operation counts as impossible at every point.
const STUBBORN: usize = 40;

/// A start at which the first coefficients exist, beginning with the one given. Where an
/// operation does not, one of the numbers that it depends on is drawn anew, if possible one
/// that no earlier root depends on: so a hundred roots cost some hundred draws.
pub(crate) fn find(model: &Model, mut start: Start) -> Result<Start, Stop> {
    let mut random = Random::new(start.seed ^ 0x5eed);
    let mut failures: BTreeMap<usize, usize> = BTreeMap::new();
    for _ in 0..POINTS {
        let columns = Columns::new(model, 0);
        let failed = match Expansion::new(model, &start, columns).first() {
            Ok(()) => return Ok(start),
            Err(Stop::Point(slot)) => slot,
            Err(stop) => return Err(stop),
        };
        // those before it had a value
        failures.retain(|slot, _| *slot >= failed);
        let count = failures.entry(failed).or_insert(0);
        *count += 1;
        if *count <= STUBBORN && start.redraw(model, failed, &mut random) {
            continue;
        }
        // √x and √(−x): one of the two is taken of the other's argument
        let partial = model.program.partial().any(|slot| slot == failed);
        if !partial || !start.turned.insert(failed) {
            return Err(Stop::Point(failed));
        }
        failures.remove(&failed);
    }
    Err(Stop::Point(0))
}
