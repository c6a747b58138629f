//! Germani and Manes, *State observers for nonlinear systems with smooth/bounded
//! input*, Kybernetika 35 (1999) 393–413.
//!
//! x' = f(x) + g(x)u, y = h(x) without any canonical form: it is enough that the
//! output and its derivatives determine the state. With Φ = (h, L_f h, …), Q = ∂Φ/∂x
//! and, along the flow with its input, Φ̄(x, U), Q̄ = ∂Φ̄/∂x, Q̄_a = ∂Φ̄/∂U:
//!
//! bounded       x̂' = f + gu + Q⁻¹(x̂) K (y − h(x̂))                               (3.1)
//! theoretical   x̂' = f + gu + Q̄⁻¹(x̂, U) K (y − h(x̂)),  U = (u, u', …) exact      (4.1)
//! practical     x̂' = f + g x̂_a1 + Q̄⁻¹(x̂, x̂_a)(K₁(y − h(x̂)) − Q̄_a K₂(u − x̂_a1)),
//!               x̂_a' = A x̂_a + K₂(u − x̂_a1)                                      (4.22)
//!
//! Corrections to the print: Remark 4.2 must read r ≥ n − 1 (then no derivative of
//! the input is needed); (3.20) needs ‖V⁻¹‖²; Theorem 3.3's bound is u_M ≤ β λ_min(P); (4.22) holds
//! no n̄(ẑ, x̂_a)w, so the error of the practical observer is driven by n̄(z, x_a)w.
//! Beyond the print: several inputs, each with a filter of its own order, and
//! several outputs with the indices of Krener and Respondek.

mod assembly;
mod choice;
mod conditions;
mod degrees;
mod form;
mod gains;
mod guarantee;
mod keys;
mod lipschitz;
mod poles;
mod proof;
mod report;
mod theorem;
mod variant;

use lynkeus_structure::{Extended, Standing};

use crate::{Assumptions, Certificate, Design, DesignError, Examination, Family, Tuning};

const NAME: &str = "drift-observable";

/// The family `drift-observable`.
#[derive(Clone, Copy, Debug)]
pub struct DriftObservable;

impl Family for DriftObservable {
    fn name(&self) -> &'static str {
        NAME
    }

    fn paper(&self) -> &'static str {
        "Germani, Manes 1999, http://dml.cz/dmlcz/135297"
    }

    fn keys(&self) -> &'static [&'static str] {
        &[
            "variant",
            "poles",
            "alpha",
            "beta",
            "gamma",
            "filter_poles",
            "filter_initial",
            "indices",
            "input_derivatives",
        ]
    }

    fn examine(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        Ok(match choice::form(extended, tuning, &extended.region())? {
            Ok(form) => form.examination,
            Err(examination) => examination,
        })
    }

    fn design(&self, extended: &Extended<'_>, tuning: &Tuning) -> Result<Design, DesignError> {
        match choice::form(extended, tuning, &extended.region())? {
            Ok(form) if form.examination.fit() != Standing::Refuted => {
                let gains = gains::Gains::new(extended, tuning, &form)?;
                assembly::design(extended, tuning, form, gains)
            }
            Ok(form::Form { examination, .. }) | Err(examination) => {
                Err(DesignError::Refused(Box::new(examination)))
            }
        }
    }
    fn theorem(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        match choice::form(extended, tuning, &assumptions.region)? {
            Ok(form) if form.examination.fit() != Standing::Refuted => {
                theorem::certificate(extended, tuning, form, assumptions)
            }
            Ok(form::Form { examination, .. }) | Err(examination)
                if examination.refuted().is_some() =>
            {
                let (basis, checks) = (self.paper(), examination.checks);
                Ok(Certificate::new(basis, assumptions, checks))
            }
            Ok(form::Form { examination, .. }) | Err(examination) => {
                Err(DesignError::Refused(Box::new(examination)))
            }
        }
    }
}

/// y, y', y'', y^(3), …
fn derivative_name(name: &str, order: usize) -> String {
    match order {
        0..=2 => format!("{name}{}", "'".repeat(order)),
        _ => format!("{name}^({order})"),
    }
}
