//! What a family makes of a plant: an examination of its conditions, and an observer with
//! everything that led to it, or why there is none.

use lynkeus_expr::{MissingInput, Spent};
use lynkeus_structure::{AugmentedPlant, Region, Standing};

use crate::statement::standing;
use crate::{Check, Observer, Statement, TuningError};

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
    /// name of the family
    pub family: &'static str,
    /// what was found, in one or two sentences: the chains, or what breaks the form
    pub summary: String,
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
    Form(Check),
    /// any plant will do
    Any,
    /// a limit ended the examination before its end
    Ended(Spent),
}

impl Examination {
    /// What a family finds in a plant that has its form. The fit is that of the
    /// conditions, of which the first is always that the plant is [regular](
    /// AugmentedPlant::regularity) on the box.
    pub(crate) fn new(
        augmented: &AugmentedPlant<'_>,
        region: &Region,
        family: &'static str,
        summary: String,
        chains: Vec<Vec<String>>,
        checks: Vec<Check>,
    ) -> Result<Self, MissingInput> {
        let regularity = Statement::PlantIsRegular.with(augmented.regularity(region)?);
        Ok(Self {
            family,
            summary,
            chains,
            checks,
            plant: PlantFit::Form(regularity),
        })
    }

    /// The plant does not have the form, or a condition ends the search for one.
    pub(crate) fn unfit(family: &'static str, summary: String, checks: Vec<Check>) -> Self {
        Self {
            family,
            summary,
            chains: vec![],
            checks,
            plant: PlantFit::Unfit,
        }
    }

    /// Of a family that asks nothing of a plant, and promises nothing.
    pub(crate) fn of_any_plant(family: &'static str, summary: String) -> Self {
        Self {
            family,
            summary,
            chains: vec![],
            checks: vec![],
            plant: PlantFit::Any,
        }
    }

    /// A limit ended the examination: whether the family fits is not known.
    pub(crate) fn ended(family: &'static str, spent: Spent) -> Self {
        Self {
            plant: PlantFit::Ended(spent),
            ..Self::unfit(family, format!("undecided: {spent}"), vec![])
        }
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
            PlantFit::Form(regularity) => Some(regularity),
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
    /// numbers that the tool chose or was given, for the reader: (name, value)
    pub parameters: Vec<(String, String)>,
    /// what the user should know
    pub notes: Vec<String>,
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
    #[error("{reason}")]
    NoGain {
        /// the key that asks for too much
        key: &'static str,
        /// what blocks it and what to do
        reason: String,
    },
    /// the plant has parameters without value
    #[error(transparent)]
    MissingInput(#[from] MissingInput),
    /// a limit ended the work
    #[error("undecided: {0}")]
    Spent(#[from] Spent),
}

/// A form with what is known of its conditions.
pub struct Found<F> {
    pub form: F,
    pub examination: Examination,
}

/// A form, or the examination that says why there is none.
pub type Searched<F> = Result<Result<Found<F>, Examination>, DesignError>;
