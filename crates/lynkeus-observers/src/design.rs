//! What a family is, and what it makes of a plant: an examination of its conditions, and an observer
//! with everything that led to it, or why there is none.

use std::fmt;

use derive_more::From;
use lynkeus_expr::{MissingInput, Spent};
use lynkeus_structure::{AugmentedPlant, Region, Standing};

use crate::statement::standing;
use crate::{
    Assumptions, Certificate, Check, KeySpec, Observer, Reason, Statement, Tuning, TuningError,
};

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
    /// Whether it draws random numbers: it takes some time, and is run where it is named.
    fn is_sampled(&self) -> bool {
        false
    }
    /// Whether what it estimates over a log can be smoothed.
    fn smooths(&self) -> bool {
        false
    }
    /// Whether it goes along where the plant's state jumps at events.
    fn follows_jumps(&self) -> bool {
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
        &'static self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError>;
    /// The observer.
    ///
    /// # Errors
    /// [`DesignError::Refused`] where the family does not fit; tuning keys that
    /// cannot be used.
    fn design(
        &'static self,
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

impl PartialEq for dyn Family {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Debug for dyn Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Its name.
impl fmt::Display for dyn Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Whether a family fits, in the words of reports: it does where every condition is proved, and
/// does not where the form is another or a condition is refuted.
pub fn fit_word(fit: Standing) -> &'static str {
    match fit {
        Standing::Proved => "fits",
        Standing::Undecided => "undecided",
        Standing::Refuted => "does not fit",
    }
}

/// What a family finds in a plant.
#[derive(Clone, Debug)]
pub struct Examination {
    /// the family
    pub family: &'static dyn Family,
    /// what was found: the chains, or what breaks the form
    pub summary: Reason,
    /// names of the states of each chain, where the form was found
    pub chains: Vec<Vec<String>>,
    /// every condition of the family with its verdict
    pub checks: Vec<Check>,
    plant: PlantFit,
}

/// What a family makes of the plant before its own conditions.
#[derive(Clone, Debug)]
enum PlantFit {
    /// the form is another
    Unfit,
    /// it has the form; f and h have values and do not jump, or not
    Form(Box<Check>),
    /// any plant will do
    Any,
    /// a limit ended the examination before its end
    Ended(Spent),
}

impl Examination {
    fn made(
        family: &'static dyn Family,
        summary: Reason,
        checks: Vec<Check>,
        plant: PlantFit,
    ) -> Self {
        Self {
            family,
            summary,
            chains: vec![],
            checks,
            plant,
        }
    }

    /// What a family finds in a plant that has its form. The fit is that of the
    /// conditions, of which the first is always that the plant is [regular](
    /// AugmentedPlant::regularity) on the box.
    pub(crate) fn new(
        augmented: &AugmentedPlant<'_>,
        region: &Region,
        family: &'static dyn Family,
        summary: impl Into<Reason>,
        chains: Vec<Vec<String>>,
        checks: Vec<Check>,
    ) -> Result<Self, MissingInput> {
        let regularity = Statement::PlantIsRegular.with(augmented.regularity(region)?);
        let plant = PlantFit::Form(Box::new(regularity));
        Ok(Self {
            chains,
            ..Self::made(family, summary.into(), checks, plant)
        })
    }

    /// The plant does not have the form, or a condition ends the search for one.
    pub(crate) fn unfit(
        family: &'static dyn Family,
        summary: impl Into<Reason>,
        checks: Vec<Check>,
    ) -> Self {
        Self::made(family, summary.into(), checks, PlantFit::Unfit)
    }

    /// Of a filter, which asks nothing of a plant, and promises nothing.
    pub(crate) fn of_any_plant(family: &'static dyn Family, called: &'static str) -> Self {
        Self::made(family, Reason::AnyPlant(called), vec![], PlantFit::Any)
    }

    /// A limit ended the examination: whether the family fits is not known.
    pub(crate) fn ended(family: &'static dyn Family, spent: Spent) -> Self {
        Self::made(family, Reason::Ended(spent), vec![], PlantFit::Ended(spent))
    }

    /// Whether a theorem stands behind the family, whose conditions are told here.
    pub fn has_theorem(&self) -> bool {
        !matches!(self.plant, PlantFit::Any)
    }

    /// What ended the examination before anything was decided.
    pub fn spent(&self) -> Option<Spent> {
        match self.plant {
            PlantFit::Ended(spent) => Some(spent),
            _ => None,
        }
    }

    /// Whether the family fits: proved where every condition is, refuted where the form is
    /// another or a required condition is refuted.
    pub fn fit(&self) -> Standing {
        match self.plant {
            PlantFit::Unfit => Standing::Refuted,
            PlantFit::Ended(_) => Standing::Undecided,
            PlantFit::Form(_) | PlantFit::Any => standing(self.conditions()),
        }
    }

    /// Every condition: that the plant is regular on the box, then those of the family.
    pub fn conditions(&self) -> impl Iterator<Item = &Check> {
        let regularity = match &self.plant {
            PlantFit::Form(regularity) => Some(&**regularity),
            PlantFit::Unfit | PlantFit::Any | PlantFit::Ended(_) => None,
        };
        regularity.into_iter().chain(&self.checks)
    }

    /// The first condition whose refutation refutes the whole.
    pub fn refuted(&self) -> Option<&Check> {
        self.conditions()
            .find(|check| check.standing() == Standing::Refuted)
    }
}

/// The constant gain on the error ŷ − y of one output: x̂' = f(x̂, u) − K (ŷ − y).
#[derive(Clone, Debug, PartialEq)]
pub struct ChainGain {
    /// name of the measured output
    pub output: String,
    /// (state, gain; before the division by partials where that is asked for)
    pub entries: Vec<(String, f64)>,
}

/// An observer with everything that led to it.
#[derive(Clone, Debug)]
pub struct Design {
    /// the observer
    pub observer: Observer,
    /// what was found in the plant
    pub examination: Examination,
    /// gains, one per chain
    pub gains: Vec<ChainGain>,
    /// what the tool chose or was given: (name, value)
    pub parameters: Vec<(String, ParameterValue)>,
    /// what the user should know
    pub notes: Vec<Reason>,
}

/// The value of a parameter of a design.
#[derive(Clone, Debug, PartialEq, From)]
pub enum ParameterValue {
    /// names or expressions
    #[from]
    Names(Vec<String>),
    /// names in blocks, one after the other
    Blocks(Vec<Vec<String>>),
    /// the least excitation that raises no alarm
    Alarm(f64),
    /// numbers
    #[from]
    Numbers(Vec<f64>),
    /// pairs of them
    Pairs(Vec<[f64; 2]>),
    /// a number that is computed
    Computed(f64),
    /// numbers row by row, NaN where there is none
    Matrix(Vec<Vec<f64>>),
    /// expressions row by row
    Expressions(Vec<Vec<String>>),
    /// the same, each with its value at the start where all it reads has one
    AtStart(Vec<Vec<Shown>>),
    /// a gain on ŷ − y
    Gain {
        /// the gain
        gain: Shown,
        /// whether ŷ − y is limited before
        limited: bool,
    },
    /// θ in the transient
    Transient {
        /// by chain
        θ: Vec<f64>,
        /// up to this time
        until: f64,
        /// the time constant of the change
        fall: Option<f64>,
    },
    /// of a first estimate
    Variance {
        /// the variance
        variance: f64,
        /// it follows from the declared range
        from_range: bool,
    },
}

/// A number, or an expression with its value at the start where all that it reads has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// the number or the expression
    pub text: String,
    /// the value of an expression
    pub at_start: Option<f64>,
}

impl From<f64> for ParameterValue {
    fn from(number: f64) -> Self {
        Self::Numbers(vec![number])
    }
}

/// Why there is no observer.
#[derive(Clone, Debug, thiserror::Error)]
pub enum DesignError {
    /// the family does not fit
    #[error("the family '{}' does not fit", .0.family)]
    Refused(Box<Examination>),
    /// a key of the study
    #[error(transparent)]
    Tuning(#[from] TuningError),
    /// no gain of the kind asked for exists, or none is proved
    #[error("no gain as the key '{key}' asks for")]
    NoGain {
        /// the key that asks for too much
        key: &'static str,
        /// what blocks it
        reason: Box<Reason>,
    },
    /// the plant has parameters without value
    #[error(transparent)]
    MissingInput(#[from] MissingInput),
    /// a limit ended the work
    #[error("undecided: {0}")]
    Spent(#[from] Spent),
}

impl From<Examination> for DesignError {
    fn from(refusal: Examination) -> Self {
        Self::Refused(Box::new(refusal))
    }
}

/// A form with what is known of its conditions.
pub struct Found<F> {
    pub form: F,
    pub examination: Examination,
}

/// Of the candidates the first whose conditions are proved, else the first that no condition refutes, else
/// the first; there is one.
pub fn first_fit<C, F>(
    candidates: impl IntoIterator<Item = C>,
    examined: impl Fn(C) -> Result<Found<F>, DesignError>,
) -> Result<Found<F>, DesignError> {
    let mut best: Option<Found<F>> = None;
    for candidate in candidates {
        let found = examined(candidate)?;
        let fit = found.examination.fit();
        if best
            .as_ref()
            .is_none_or(|best| fit < best.examination.fit())
        {
            best = Some(found);
        }
        if fit == Standing::Proved {
            break;
        }
    }
    let none = || TuningError::new("chains", "a chain", "none");
    best.ok_or_else(|| none().into())
}
