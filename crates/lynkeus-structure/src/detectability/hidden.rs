//! What is asked of quantities that the outputs do not determine, and what may become of their errors.

use crate::{AugmentedPlant, Coordinate};

/// What is known of an augmented state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observability {
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
    pub augmented: &'e AugmentedPlant<'p>,
    /// per augmented state
    pub observability: Vec<Observability>,
    /// unknown inputs are any functions of time; else they do not move
    pub arbitrary: bool,
    /// in how many independent directions the hidden quantities can change
    pub directions: usize,
}

/// What becomes of the error of a hidden quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detectability {
    /// it decays at least like e^(−rate·t)
    Decays {
        /// in 1/(unit of time)
        rate: f64,
        /// proved for every solution in the box; else linearised at one point
        is_proved: bool,
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

/// What becomes of the errors in hidden quantities.
#[derive(Clone, Debug)]
pub struct HiddenErrors {
    /// per augmented state; none where it is not hidden
    pub of: Vec<Option<Detectability>>,
    /// where it was linearised; empty where it was not
    pub point: Vec<Coordinate>,
}

impl Hidden<'_, '_> {
    /// Places of what may differ between two solutions with the same outputs: states, then
    /// unknown inputs that are any functions.
    pub(super) fn free(&self) -> (Vec<usize>, Vec<usize>) {
        let places = (0..self.observability.len()).filter(|&i| self.is_free(i));
        places.partition(|&i| !self.is_signal(i))
    }

    /// Whether it is an augmented state that the outputs are not known to determine.
    pub(super) fn is_free(&self, place: usize) -> bool {
        let known = self.observability.get(place);
        known.is_some_and(|known| *known != Observability::Determined)
    }

    /// Whether it is an unknown input without an equation.
    pub(super) fn is_signal(&self, place: usize) -> bool {
        self.arbitrary && place >= self.augmented.plant_states()
    }
}
