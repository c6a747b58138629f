//! The random point at which the series starts, and how a good one is found.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

use crate::Limits;
use crate::field::{Modular, Random};
use crate::local::{Model, Role, Symbol};
use crate::search::Search;
use crate::series::Stop;

/// Points tried before the model counts as singular everywhere.
const POINTS: u64 = 4096;

/// Failures in a row after which an operation counts as impossible at every point.
const STUBBORN: usize = 40;

/// Where the series starts: one random number per symbol.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    pub seed: u64,
    /// how often each symbol was drawn anew
    draws: Vec<u64>,
    /// roots of numbers that have none in this field
    pub turned: BTreeSet<usize>,
    /// known starts are random numbers as well instead of the given ones
    pub anywhere: bool,
}

impl Start {
    pub fn new(model: &Model, seed: u64) -> Self {
        let draws = vec![0; model.symbols.len()];
        let anywhere = false;
        Self {
            seed,
            draws,
            turned: BTreeSet::new(),
            anywhere,
        }
    }

    pub fn is_generic(&self, model: &Model) -> bool {
        model.generic
    }

    /// Orders after which nothing more is looked for. At a generic point the number of
    /// states and parameters, and one more for the unknown inputs, is enough; at a known start
    /// a trace may come later than at any other point.
    pub fn highest(&self, model: &Model) -> usize {
        match (model.generic || self.anywhere, model.unknown_inputs) {
            (true, _) => model.depth,
            (false, 0) => 3 * model.depth + 24,
            (false, _) => 2 * model.depth + 6,
        }
    }

    /// The first coefficient of a state or a constant.
    pub fn value(&self, place: usize, symbol: &Symbol) -> Modular {
        let given = match symbol.role {
            Role::State(_) if self.anywhere => None,
            _ => symbol.start,
        };
        given.unwrap_or_else(|| {
            let drawn = self.draws.get(place).copied().unwrap_or_default();
            let stream = self.seed.wrapping_mul(0x1000_0000_01b3) ^ (place as u64) << 32;
            Random::new(stream.wrapping_add(drawn)).element()
        })
    }
}

/// A start at which the first coefficients exist, starting the search at `seed`. Where an
/// operation does not, one of the symbols that it depends on is drawn anew, if possible one
/// that no earlier root depends on: so a hundred roots cost some hundred draws.
pub(crate) fn find(
    model: &Model,
    limits: Limits,
    mut start: Start,
    deadline: Instant,
) -> Result<Start, Stop> {
    let mut random = Random::new(start.seed ^ 0x5eed);
    let mut failures: BTreeMap<usize, usize> = BTreeMap::new();
    for _ in 0..POINTS {
        let mut search = Search::new(model, limits, &start, deadline);
        let failed = match search.first() {
            Ok(()) => return Ok(start),
            Err(Stop::Point(slot)) => slot,
            Err(stop) => return Err(stop),
        };
        // those before it had a value
        failures.retain(|slot, _| *slot >= failed);
        let count = failures.entry(failed).or_insert(0);
        *count += 1;
        match start.fresh(model, failed, &mut random) {
            Some(place) if *count <= STUBBORN => start.draws[place] += 1,
            // √x and √(3x), where 3 has no root: one of the two is taken of −3x
            _ => {
                let root = model.program.partial().any(|slot| slot == failed);
                if !root || !start.turned.insert(failed) {
                    return Err(Stop::Point(failed));
                }
                failures.remove(&failed);
            }
        }
    }
    Err(Stop::Point(0))
}

impl Start {
    /// A symbol to draw anew for a slot: one that no earlier root depends on, if possible.
    fn fresh(&self, model: &Model, failed: usize, random: &mut Random) -> Option<usize> {
        let free = |slot: usize| -> BTreeSet<usize> {
            let support = model.program.support(slot);
            let drawn = |&place: &usize| self.is_drawn(&model.symbols[place]);
            support.into_iter().filter(drawn).collect()
        };
        let of = free(failed);
        let earlier: BTreeSet<usize> = model
            .program
            .partial()
            .filter(|slot| *slot < failed)
            .flat_map(free)
            .collect();
        let fresh: Vec<usize> = of.difference(&earlier).copied().collect();
        let among: Vec<usize> = match fresh.is_empty() {
            true => of.into_iter().collect(),
            false => fresh,
        };
        among.get(random.below(among.len())).copied()
    }
}

impl Start {
    fn is_drawn(&self, symbol: &Symbol) -> bool {
        match symbol.role {
            Role::State(_) => self.anywhere || symbol.start.is_none(),
            Role::Constant => symbol.start.is_none(),
            Role::Known | Role::Unknown | Role::Time => true,
            Role::Zero => false,
        }
    }
}
