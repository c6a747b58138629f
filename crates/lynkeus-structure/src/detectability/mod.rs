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
mod exact;
mod hidden;
mod modes;
mod on_the_box;

use lynkeus_expr::MissingInput;

pub use hidden::{Detectability, Hidden, HiddenErrors, Observability};

impl Hidden<'_, '_> {
    /// Decides what becomes of the errors.
    ///
    /// # Errors
    /// [`MissingInput`] where the plant has parameters without value.
    pub fn hidden_errors(&self) -> Result<HiddenErrors, MissingInput> {
        let proved = on_the_box::hidden_errors(self)?;
        let is_open = |i: usize| {
            let decays = matches!(proved[i], Some(Detectability::Decays { .. }));
            self.observability[i] == Observability::Hidden && !decays
        };
        let local = match (0..self.observability.len()).any(is_open) {
            true => at_a_point::hidden_errors(self)?,
            false => None,
        };
        let of = (0..self.observability.len()).map(|i| {
            let there = local.as_ref().and_then(|local| local.of[i]);
            let detectability = match (proved[i], there) {
                // a bound says little where the error vanishes near some point
                (Some(Detectability::Bounded { .. }), Some(Detectability::Decays { .. }))
                | (None, Some(_)) => there,
                (Some(Detectability::Bounded { bound, .. }), there) => {
                    Some(Detectability::Bounded {
                        bound,
                        is_kept: there == Some(Detectability::Moved),
                    })
                }
                (proved, _) => proved,
            };
            (self.observability[i] == Observability::Hidden)
                .then(|| detectability.unwrap_or(Detectability::Undecided))
        });
        Ok(HiddenErrors {
            of: of.collect(),
            point: local.map_or(vec![], |local| local.point),
        })
    }
}

#[cfg(test)]
mod tests;
