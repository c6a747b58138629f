//! Starts at which a model has a series.

use std::collections::BTreeMap;

use lynkeus_expr::Budget;

use crate::expansion::{Columns, Expansion};
use crate::field::Random;
use crate::model::Model;
use crate::series::Stop;
use crate::start::Start;

/// Points tried before the model counts as singular everywhere.
const POINTS: u64 = 4096;

/// Failures in a row after which an operation counts as impossible at every point.
const STUBBORN: usize = 40;

/// A start at which the first coefficients exist, beginning with the one given. Where an
/// operation does not, one of the numbers that it depends on is drawn anew, if possible one
/// that no earlier root depends on: so a hundred roots cost some hundred draws.
pub(crate) fn find(model: &Model, mut start: Start, budget: &Budget) -> Result<Start, Stop> {
    let mut random = Random::new(start.seed ^ 0x5eed);
    let mut failures: BTreeMap<usize, usize> = BTreeMap::new();
    for _ in 0..POINTS {
        let columns = Columns::new(model, 0);
        let failed = match Expansion::new(model, &start, columns, budget).first() {
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
