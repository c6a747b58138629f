//! Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa, *High gain observer design for a
//! class of MIMO non uniformly observable uncertain systems*.
//!
//! x' = F(u, x) x + φ(u, x) + Bε, y = C(u) x (1)–(2) with rectangular blocks
//! F_k(u, x¹, …, x^k) above the diagonal that need not have full rank at any
//! instant; ε acts on the last block. Observer (7) with the Lyapunov ODE (8):
//!
//! x̂' = F(u, x̂) x̂ + φ(u, x̂) − θ Δ_θ⁻¹ S⁻¹ Cᵀ(u) (C(u) x̂ − y),
//! S' = −θ (S + Fᵀ(u, x̂) S + S F(u, x̂) − Cᵀ(u) C(u)).
//!
//! S is integrated in factors, its smallest eigenvalue watched (`observer`).
//!
//! Corrections to the print: B has the sign of (29), + in the last block; the
//! inputs of Theorem 1's remark satisfy A4, not A3; the error decays like
//! e^{−θμ_θt} with μ_θ → ½, as (24) and (26) have it, not e^{−μ_θt} with μ_θ → 1.
//! Beyond the print: C(u) need not be square, and y = C(u)x + d(u) is understood.

mod observer;
mod said;
mod settings;
mod theorem;

use lynkeus_structure::{AugmentedPlant, Region, Standing, Superdiagonal, superdiagonal};

use crate::conditions::{lipschitz, names};
use crate::design::{Found, Searched};
use crate::family::Stages;
use crate::statement::standing;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Statement, Tuning,
    TuningError,
};
use observer::{NAME, assemble};
pub use said::{Ltaief, Said};
use settings::Settings;
use theorem::BASIS;

/// The family `state-affine`.
#[derive(Clone, Copy, Debug)]
pub struct StateAffine;

impl Stages for StateAffine {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Superdiagonal;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Ltaief, Maatoug, Farza, Ménard, M'Saad, Koubaa, observer (7)–(8)";
    const BASIS: &'static str = BASIS;
    const KEYS: &'static [&'static [KeySpec]] = &[&settings::KEYS];

    fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(augmented, tuning)
    }

    fn late(settings: &Settings) -> Result<(), TuningError> {
        settings.late()
    }

    fn form(
        augmented: &AugmentedPlant<'_>,
        _: &Settings,
        region: &Region,
    ) -> Searched<Superdiagonal> {
        form(augmented, region)
    }

    fn design(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Superdiagonal>,
    ) -> Result<Design, DesignError> {
        assemble(augmented, settings, &found.form, found.examination)
    }

    fn theorem(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Superdiagonal>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(augmented, settings, found, assumptions)
    }
}

/// The blocks with what is known of A2 and A4.
fn form(augmented: &AugmentedPlant<'_>, region: &Region) -> Searched<Superdiagonal> {
    let form = match superdiagonal::find(augmented) {
        Ok(form) => form,
        Err(summary) => return Ok(Err(Examination::unfit(NAME, summary, vec![]))),
    };
    let mut checks = vec![];
    for (k, factor) in form.factors.iter().enumerate() {
        let mut declared = factor.columns.clone();
        declared.sort_unstable();
        let statement = Ltaief::BlockShows {
            factor: k,
            states: names(augmented, &declared),
        };
        let found = factor.column_rank(augmented, k, region)?;
        checks.push(Statement::from(statement).with(found));
    }
    let depends_on_inputs = standing(&checks) == Standing::Undecided;
    checks.push(lipschitz(augmented, region)?);
    let chains = form.declared().map(|block| names(augmented, &block));
    let chains: Vec<Vec<String>> = chains.collect();
    let blocks = chains.clone();
    let summary = Said::Form {
        blocks,
        depends_on_inputs,
    };
    let examination = Examination::new(augmented, region, NAME, summary, chains, checks)?;
    Ok(Ok(Found { form, examination }))
}
