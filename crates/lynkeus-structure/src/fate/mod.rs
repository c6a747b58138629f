//! What becomes of the error in quantities that the outputs do not determine.
//!
//! Two solutions with the same outputs agree in everything that the outputs determine. What is left
//! of their difference, δη for states and δv for unknown inputs, obeys
//!
//! δη' = A δη + B δv,    0 = C δη + E δv,
//!
//! the second line from the outputs and from the equations of what is determined. If the δη that this leaves
//! decays, so does the error of any estimator that finds the rest: the plant is detectable
//! there, for any unknown input (Hautus 1983, *Strong detectability and observers*).
//!
//! `on_the_box` eliminates δv and proves the decay by intervals, for every pair of solutions in the box;
//! `at_a_point` finds the modes of the linearisation, which hold near that point only.

mod at_a_point;
mod clock;
mod constraints;
mod coupled;
mod exact;
mod linearised;
mod modes;
mod on_the_box;
mod rest;
mod subspace;

use lynkeus_expr::MissingInput;

use crate::{Coordinate, Extended};

/// What is known of an extended state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// the outputs determine it
    Determined,
    /// they do not
    Hidden,
    /// not decided, or its start is given: nothing is taken for granted
    Open,
}

/// A question about hidden quantities.
#[derive(Clone, Debug)]
pub struct Hidden<'e, 'p> {
    /// the plant
    pub extended: &'e Extended<'p>,
    /// per extended state
    pub told: Vec<Told>,
    /// unknown inputs are any functions of time; else they do not move
    pub arbitrary: bool,
    /// in how many independent directions the hidden quantities can change
    pub directions: usize,
}

/// What the claim on an error rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// proved for every solution in the box
    Box,
    /// the linearisation at one point
    Point,
}

/// What becomes of the error of a hidden quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// it decays at least like e^(−rate·t)
    Decays {
        /// in 1/(unit of time)
        rate: f64,
        /// proved, or linearised
        ground: Ground,
    },
    /// in the end it is below this bound, in its unit; proved on the box, unknown inputs staying in
    /// their ranges
    Bounded {
        /// in the unit of the quantity
        bound: f64,
        /// linearised an unknown input keeps it alive; else it may decay
        is_kept: bool,
    },
    /// linearised it stays as it is, or hardly moves
    Stays,
    /// linearised it grows like e^(rate·t)
    Grows {
        /// in 1/(unit of time)
        rate: f64,
    },
    /// an unknown input moves it without a trace
    Moved,
    /// neither proved nor seen in the linearisation
    Undecided,
}

/// The fates of hidden quantities.
#[derive(Clone, Debug)]
pub struct Fates {
    /// per extended state; none where it is not hidden
    pub of: Vec<Option<Fate>>,
    /// where it was linearised; empty where it was not
    pub point: Vec<Coordinate>,
}

impl Hidden<'_, '_> {
    /// Places of what may differ between two solutions with the same outputs: states, then
    /// unknown inputs that are any functions.
    fn free(&self) -> (Vec<usize>, Vec<usize>) {
        let places = (0..self.told.len()).filter(|&i| self.told[i] != Told::Determined);
        places.partition(|&i| !self.is_signal(i))
    }

    /// Whether it is an unknown input without an equation.
    fn is_signal(&self, place: usize) -> bool {
        self.arbitrary && place >= self.extended.plant_states()
    }

    /// Decides what becomes of the errors.
    ///
    /// # Errors
    /// [`MissingInput`] where the plant has parameters without value.
    pub fn fates(&self) -> Result<Fates, MissingInput> {
        let proved = on_the_box::fates(self)?;
        let is_open = |i: usize| {
            let decays = matches!(proved[i], Some(Fate::Decays { .. }));
            self.told[i] == Told::Hidden && !decays
        };
        let local = match (0..self.told.len()).any(is_open) {
            true => at_a_point::fates(self)?,
            false => None,
        };
        let of = (0..self.told.len()).map(|i| {
            let there = local.as_ref().map(|local| local.of[i]);
            let fate = match (proved[i], there) {
                // a bound says little where the error vanishes near some point
                (Some(Fate::Bounded { .. }), Some(Fate::Decays { .. })) | (None, Some(_)) => there,
                (Some(Fate::Bounded { bound, .. }), there) => Some(Fate::Bounded {
                    bound,
                    is_kept: there == Some(Fate::Moved),
                }),
                (proved, _) => proved,
            };
            (self.told[i] == Told::Hidden).then(|| fate.unwrap_or(Fate::Undecided))
        });
        Ok(Fates {
            of: of.collect(),
            point: local.map_or(vec![], |local| local.point),
        })
    }
}

#[cfg(test)]
mod tests;
