//! What a family is: settings read once, the form found, the design and the theorem
//! from both. What the [`Family`] trait offers is made of these stages, the same for all.

use lynkeus_structure::{AugmentedPlant, Region, Standing};

use crate::design::Found;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Tuning, TuningError,
};

/// A published observer design, stage by stage.
pub(crate) trait Stages: Sync {
    /// the keys, read
    type Settings;
    /// the canonical form in a plant
    type Form<'e, 'p: 'e>;
    /// name in studies
    const NAME: &'static str;
    /// where it was published
    const PAPER: &'static str;
    /// the theorem, in words
    const BASIS: &'static str;
    /// Whether the theorem's form is sought on the box of the assumptions, where a refuted condition
    /// ends the proof. Else it is sought on the declared one, for its conditions choose the observer:
    /// the theorem decides its hypotheses on the box of its assumptions, whatever they said.
    const FORM_ON_ASSUMED_BOX: bool = false;
    /// its keys, in groups
    const KEYS: &'static [&'static [KeySpec]];
    /// how the entries of `theta` stand to one another where it has to be a list
    const SPEEDS: &'static [f64] = &[];

    /// The settings of a study.
    fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning)
    -> Result<Self::Settings, TuningError>;

    /// The keys whose wrong values `read` leaves to later stages.
    ///
    /// # Errors
    /// The first wrong value.
    fn deferred(_settings: &Self::Settings) -> Result<(), TuningError> {
        Ok(())
    }

    /// The form with its conditions on `region`.
    fn form<'e, 'p>(
        augmented: &'e AugmentedPlant<'p>,
        settings: &Self::Settings,
        region: &Region,
    ) -> Result<Found<Self::Form<'e, 'p>>, DesignError>;

    /// The observer; no condition of the form is refuted.
    fn design<'e, 'p>(
        augmented: &'e AugmentedPlant<'p>,
        settings: &Self::Settings,
        found: Found<Self::Form<'e, 'p>>,
    ) -> Result<Design, DesignError>;

    /// What the theorem guarantees.
    fn theorem<'e, 'p>(
        augmented: &'e AugmentedPlant<'p>,
        settings: &Self::Settings,
        found: Found<Self::Form<'e, 'p>>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError>;
}

/// Work whose result counts only where the budget lasted.
pub(crate) fn lasting<T>(
    augmented: &AugmentedPlant<'_>,
    work: impl FnOnce() -> Result<T, DesignError>,
) -> Result<T, DesignError> {
    let graph = augmented.graph();
    graph.budgeted(graph.budget().part(1.0), work)?
}

impl<S: Stages> Family for S {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn paper(&self) -> &'static str {
        S::PAPER
    }

    fn speeds(&self) -> &'static [f64] {
        S::SPEEDS
    }

    fn keys(&self) -> Vec<&'static KeySpec> {
        S::KEYS.iter().copied().flatten().collect()
    }

    fn verify(&self, augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<(), TuningError> {
        S::deferred(&S::read(augmented, tuning)?)
    }

    fn examine(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        let settings = S::read(augmented, tuning)?;
        match lasting(augmented, || {
            S::form(augmented, &settings, &augmented.region())
        }) {
            Ok(found) => Ok(found.examination),
            Err(DesignError::Refused(examination)) => Ok(*examination),
            Err(DesignError::Spent(spent)) => Ok(Examination::ended(S::NAME, spent)),
            Err(error) => Err(error),
        }
    }

    fn design(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Design, DesignError> {
        let settings = S::read(augmented, tuning)?;
        let form = || S::form(augmented, &settings, &augmented.region());
        let found = lasting(augmented, form)?;
        match found.examination.fit() {
            Standing::Refuted => Err(found.examination.into()),
            _ => lasting(augmented, || S::design(augmented, &settings, found)),
        }
    }

    fn theorem(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        match theorem::<S>(augmented, tuning, assumptions) {
            Err(DesignError::Spent(spent)) => Ok(Certificate::ended(S::BASIS, assumptions, spent)),
            found => found.map(|certificate| certificate.under(assumptions)),
        }
    }
}

fn theorem<S: Stages>(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let settings = S::read(augmented, tuning)?;
    let region = match S::FORM_ON_ASSUMED_BOX {
        true => assumptions.region.clone(),
        false => augmented.region(),
    };
    let examination = match lasting(augmented, || S::form(augmented, &settings, &region)) {
        Ok(found) if S::FORM_ON_ASSUMED_BOX && found.examination.fit() == Standing::Refuted => {
            found.examination
        }
        Ok(found) => {
            return lasting(augmented, || {
                S::theorem(augmented, &settings, found, assumptions)
            });
        }
        Err(DesignError::Refused(examination)) => *examination,
        Err(error) => return Err(error),
    };
    match examination.refuted() {
        Some(_) => Ok(Certificate::new(S::BASIS, assumptions, examination.checks)),
        None => Err(examination.into()),
    }
}

/// A published observer design.
pub trait Family: Sync {
    /// name in studies
    fn name(&self) -> &'static str;
    /// where it was published
    fn paper(&self) -> &'static str;
    /// the study keys it reads beside those of every family
    fn keys(&self) -> Vec<&'static KeySpec>;
    /// Whether a key is one of them.
    fn owns(&self, key: &str) -> bool {
        self.keys().iter().any(|spec| spec.name == key)
    }
    /// How the entries of `theta` stand to one another where it is a list of so many, the last one
    /// the rate at which the error decays; empty where it is one number.
    fn speeds(&self) -> &'static [f64] {
        &[]
    }
    /// Whether it is a filter: it takes any plant, and no theorem stands behind it.
    fn is_filter(&self) -> bool {
        false
    }
    /// Whether what it estimates over a log can be smoothed.
    fn smooths(&self) -> bool {
        false
    }
    /// Whether every key has a value that can be used; a required one may be absent.
    ///
    /// # Errors
    /// The first key that cannot be used.
    fn verify(&self, augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<(), TuningError>;
    /// Does the plant have the form, and do the conditions hold on the box?
    ///
    /// # Errors
    /// Tuning keys that cannot be used; parameters without value.
    fn examine(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError>;
    /// The observer.
    ///
    /// # Errors
    /// [`DesignError::Refused`] where the family does not fit; tuning keys that
    /// cannot be used.
    fn design(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Design, DesignError>;
    /// What the paper's theorem guarantees for this plant and tuning: its
    /// hypotheses with verdicts, its constants (θ0 among them), and where all hold
    /// the rate and the ultimate bound.
    ///
    /// # Errors
    /// As [`Family::design`].
    fn theorem(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError>;
}
