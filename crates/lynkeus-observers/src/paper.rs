//! A published observer design as a row of its stages: settings read once, the form found, the design and
//! the theorem from both. What the [`Family`] trait offers is made of them, the same for all.

use lynkeus_structure::{AugmentedPlant, Region, Standing};

use crate::design::Found;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, Family, KeySpec, Tuning,
    TuningError,
};

/// What belongs to the settings of a family: the keys, read.
pub trait Settings: Sized + 'static {
    /// the canonical form in a plant
    type Form<'e>;
    /// the family itself
    const FAMILY: &'static dyn Family;
}

/// A published observer design: what is said of it, and its stages.
pub struct Paper<S: Settings> {
    /// name in studies
    pub name: &'static str,
    /// where it was published
    pub paper: &'static str,
    /// the theorem, in words
    pub basis: &'static str,
    /// Whether the theorem's form is sought on the box of the assumptions, where a refuted condition
    /// ends the proof. Else it is sought on the declared one, for its conditions choose the observer:
    /// the theorem decides its hypotheses on the box of its assumptions, whatever they said.
    pub form_on_assumed_box: bool,
    /// its keys, in groups
    pub keys: &'static [&'static [KeySpec]],
    /// how the entries of `theta` stand to one another where it has to be a list
    pub speeds: &'static [f64],
    /// the settings of a study
    pub read: fn(&AugmentedPlant<'_>, &Tuning) -> Result<S, TuningError>,
    /// the first wrong value of the keys that `read` leaves to later stages
    pub deferred: fn(&S) -> Result<(), TuningError>,
    /// the form with its conditions on a box
    pub form: FormStage<S>,
    /// the observer; no condition of the form is refuted
    pub design: DesignStage<S>,
    /// what the theorem guarantees
    pub theorem: TheoremStage<S>,
}

type FormStage<S> = for<'e> fn(
    &'e AugmentedPlant<'e>,
    &S,
    &Region,
) -> Result<Found<<S as Settings>::Form<'e>>, DesignError>;

type DesignStage<S> = for<'e> fn(
    &'e AugmentedPlant<'e>,
    &S,
    Found<<S as Settings>::Form<'e>>,
) -> Result<Design, DesignError>;

type TheoremStage<S> = for<'e> fn(
    &'e AugmentedPlant<'e>,
    &S,
    Found<<S as Settings>::Form<'e>>,
    &Assumptions,
) -> Result<Certificate, DesignError>;

/// Work whose result counts only where the budget lasted.
pub(crate) fn lasting<T>(
    augmented: &AugmentedPlant<'_>,
    work: impl FnOnce() -> Result<T, DesignError>,
) -> Result<T, DesignError> {
    let graph = augmented.graph();
    graph.budgeted(graph.budget().part(1.0), work)?
}

/// Whether a key that a later stage reads has a value that can be used, or none.
pub(crate) fn usable<T>(value: Result<T, TuningError>) -> Result<(), TuningError> {
    match value {
        Err(error) if !error.absent => Err(error),
        _ => Ok(()),
    }
}

impl<S: Settings> Family for Paper<S> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn paper(&self) -> &'static str {
        self.paper
    }

    fn speeds(&self) -> &'static [f64] {
        self.speeds
    }

    fn keys(&self) -> Vec<&'static KeySpec> {
        self.keys.iter().copied().flatten().collect()
    }

    fn verify(&self, augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<(), TuningError> {
        (self.deferred)(&(self.read)(augmented, tuning)?)
    }

    fn examine(
        &'static self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        let settings = (self.read)(augmented, tuning)?;
        let form = || (self.form)(augmented, &settings, &augmented.region());
        match lasting(augmented, form) {
            Ok(found) => Ok(found.examination),
            Err(DesignError::Refused(examination)) => Ok(*examination),
            Err(DesignError::Spent(spent)) => Ok(Examination::ended(self, spent)),
            Err(error) => Err(error),
        }
    }

    fn design(
        &'static self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Design, DesignError> {
        let settings = (self.read)(augmented, tuning)?;
        let form = || (self.form)(augmented, &settings, &augmented.region());
        let found = lasting(augmented, form)?;
        match found.examination.fit() {
            Standing::Refuted => Err(found.examination.into()),
            _ => lasting(augmented, || (self.design)(augmented, &settings, found)),
        }
    }

    fn theorem(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        match self.certified(augmented, tuning, assumptions) {
            Err(DesignError::Spent(spent)) => {
                Ok(Certificate::ended(self.basis, assumptions, spent))
            }
            found => found.map(|certificate| certificate.under(assumptions)),
        }
    }
}

impl<S: Settings> Paper<S> {
    fn certified(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        let settings = (self.read)(augmented, tuning)?;
        let region = match self.form_on_assumed_box {
            true => assumptions.region.clone(),
            false => augmented.region(),
        };
        let ends =
            |found: &Examination| self.form_on_assumed_box && found.fit() == Standing::Refuted;
        let examination = match lasting(augmented, || (self.form)(augmented, &settings, &region)) {
            Ok(found) if ends(&found.examination) => found.examination,
            Ok(found) => {
                return lasting(augmented, || {
                    (self.theorem)(augmented, &settings, found, assumptions)
                });
            }
            Err(DesignError::Refused(examination)) => *examination,
            Err(error) => return Err(error),
        };
        match examination.refuted() {
            Some(_) => Ok(Certificate::new(
                self.basis,
                assumptions,
                examination.checks,
            )),
            None => Err(examination.into()),
        }
    }
}
