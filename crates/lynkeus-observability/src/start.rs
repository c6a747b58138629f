//! The first values of a series: given ones, and random ones for the rest.

use std::collections::BTreeSet;

use crate::field::{Modular, Random};
use crate::model::{First, Model, Role};

/// An affine set c + span(d₁, d₂, …) in the coordinates of the model's symbols, c being the known
/// starts; what is free is free in it as well.
#[derive(Clone, Debug, Default)]
pub(crate) struct Affine {
    /// per direction one number for each symbol
    pub directions: Vec<Vec<Modular>>,
}

/// Where a series starts: random numbers, redrawn one by one where they do not suit.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    pub seed: u64,
    /// how often each symbol, then each direction of the set, was drawn anew
    draws: Vec<u64>,
    /// roots and logarithms of numbers that have none in this field
    pub turned: BTreeSet<usize>,
    /// the known starts are those of a random point of this set
    set: Affine,
    /// time starts at zero, and not at any moment
    at_zero: bool,
}

impl Start {
    /// The known starts as given.
    pub fn new(model: &Model, seed: u64) -> Self {
        Self {
            seed,
            draws: vec![0; model.symbols.len()],
            turned: BTreeSet::new(),
            set: Affine::default(),
            at_zero: false,
        }
    }

    /// Time starts at zero.
    pub fn at_zero(self, at_zero: bool) -> Self {
        Self { at_zero, ..self }
    }

    /// The known starts anywhere in a set.
    pub fn within(self, model: &Model, set: &Affine) -> Self {
        Self {
            draws: vec![0; model.symbols.len() + set.directions.len()],
            set: set.clone(),
            ..self
        }
    }

    /// The number that belongs to a draw.
    fn drawn(&self, draw: usize) -> Modular {
        let again = self.draws.get(draw).copied().unwrap_or_default();
        let stream = self.seed.wrapping_mul(0x1000_0000_01b3) ^ (draw as u64) << 32;
        Random::new(stream.wrapping_add(again)).element()
    }

    /// A square for what is positive at the reference point, the negative of one for what is
    /// negative: with the signs of numbers, √(x²) is x where x is positive, and log x exists.
    fn free(&self, place: usize, negative: bool) -> Modular {
        let root = self.drawn(place);
        match negative {
            true => -(root * root),
            false => root * root,
        }
    }

    /// The first value of a symbol, `computed` being the values of starts that are
    /// expressions.
    pub fn value(&self, model: &Model, place: usize, computed: &[Modular]) -> Modular {
        let symbol = &model.symbols[place];
        let base = match (symbol.role, symbol.first) {
            (Role::Zero, _) => Modular::ZERO,
            (Role::Time, _) if self.at_zero => Modular::ZERO,
            (_, First::Given(value)) => value,
            (_, First::Computed(i)) => computed.get(i).copied().unwrap_or_default(),
            (_, First::Free) => self.free(place, symbol.negative),
        };
        base + self.moved_by(model, place)
    }

    /// How far the point of the set is from the known start.
    pub fn moved_by(&self, model: &Model, place: usize) -> Modular {
        let directions = self.set.directions.iter().enumerate();
        directions.fold(Modular::ZERO, |sum, (i, direction)| {
            match direction[place].is_zero() {
                true => sum,
                false => sum + direction[place] * self.drawn(model.symbols.len() + i),
            }
        })
    }

    /// The draws on which the first value of a symbol depends.
    fn draws_of(&self, model: &Model, place: usize) -> Vec<usize> {
        let symbol = &model.symbols[place];
        let free = match symbol.role {
            Role::Zero => false,
            Role::Time => !self.at_zero,
            _ => matches!(symbol.first, First::Free),
        };
        let directions = self.set.directions.iter().enumerate();
        let moving = directions.filter(|(_, direction)| !direction[place].is_zero());
        let moving = moving.map(|(i, _)| model.symbols.len() + i);
        free.then_some(place).into_iter().chain(moving).collect()
    }

    /// Draws a number anew that a slot depends on, if possible one that no earlier
    /// slot with a domain depends on; false if there is none.
    pub fn redraw(&mut self, model: &Model, failed: usize, random: &mut Random) -> bool {
        let free = |slot: usize| -> BTreeSet<usize> {
            let support = model.program.support(slot);
            let draws = support.into_iter();
            draws
                .flat_map(|place| self.draws_of(model, place))
                .collect()
        };
        let of = free(failed);
        let partial = model.program.partial();
        let earlier: BTreeSet<usize> = partial
            .filter(|slot| *slot < failed)
            .flat_map(free)
            .collect();
        let fresh: Vec<usize> = of.difference(&earlier).copied().collect();
        let among: Vec<usize> = match fresh.is_empty() {
            true => of.into_iter().collect(),
            false => fresh,
        };
        let Some(&draw) = among.get(random.below(among.len())) else {
            return false;
        };
        self.draws[draw] += 1;
        true
    }
}
