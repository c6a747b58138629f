//! The study's keys.

use lynkeus_expr::Node;
use lynkeus_gain::vandermonde::{Lemma32, Pole};
use lynkeus_structure::Extended;

use super::keys::{self, Asked, Needed};
use super::variant::Variant;
use crate::estimate::Common;
use crate::{KeySpec, Shape, Tuning, TuningError, Value};

/// Numbers, or a single one.
const SPEEDS: Shape = Shape::Either(&[Shape::Number, Shape::List(&Shape::Number)]);
/// The same for one input, or for several by their names.
const PER_INPUT: Shape = Shape::Either(&[SPEEDS, Shape::Table(&SPEEDS)]);
const BESIDE_ALPHA: &str = "poles by Lemma 3.2 instead, with `alpha`, see below";

const VARIANT: KeySpec = KeySpec {
    name: "variant",
    kind: "`\"bounded\"`, `\"theoretical\"`, `\"practical\"`",
    shape: Shape::Word(&["bounded", "theoretical", "practical"]),
    default: "see above",
    meaning: "which observer",
};

pub(super) const POLES: KeySpec = KeySpec {
    name: "poles",
    kind: "n poles; for several outputs one list of μ_i each, or the slowest pole of each",
    shape: Shape::Either(&[SPEEDS, Shape::List(&SPEEDS), Shape::List(&Shape::ROWS)]),
    default: "required, or `alpha`",
    meaning: "the eigenvalues of A − KC, see below",
};

pub(super) const ALPHA: KeySpec = KeySpec {
    name: "alpha",
    kind: "number > 0",
    shape: Shape::Positive,
    default: "required, or `poles`",
    meaning: "the decay α: poles by Lemma 3.2 instead, see below",
};

const BETA: KeySpec = KeySpec {
    name: "beta",
    kind: "number > 0",
    shape: Shape::Positive,
    default: "1",
    meaning: BESIDE_ALPHA,
};

pub(super) const GAMMA: KeySpec = KeySpec {
    name: "gamma",
    kind: "number > 0",
    shape: Shape::Positive,
    default: "required with `alpha`",
    meaning: BESIDE_ALPHA,
};

pub(super) const FILTER_POLES: KeySpec = KeySpec {
    name: "filter_poles",
    kind: "n − r poles or the slowest; for several inputs a table `{ u = […], v = […] }`",
    shape: Shape::Either(&[
        SPEEDS,
        Shape::ROWS,
        Shape::Table(&Shape::Either(&[SPEEDS, Shape::ROWS])),
    ]),
    default: "10 times the slowest pole, each 1.2 times the one before",
    meaning: "the eigenvalues of the input filter",
};

pub(super) const FILTER_INITIAL: KeySpec = KeySpec {
    name: "filter_initial",
    kind: "as `filter_poles`",
    shape: PER_INPUT,
    default: "the input's start value, then zeros",
    meaning: "x̂ₐ(0)",
};

pub(super) const INDICES: KeySpec = KeySpec {
    name: "indices",
    kind: "a whole number per measured output",
    shape: Shape::Either(&[Shape::Whole(0), Shape::List(&Shape::Whole(0))]),
    default: "found",
    meaning: "how many derivatives of each output count",
};

pub(super) const SLOPES: KeySpec = KeySpec {
    name: "input_derivatives",
    kind: "n − r numbers; for several inputs a table",
    shape: PER_INPUT,
    default: "those of `[certify]`",
    meaning: "bounds of &#124;u'&#124;, …, &#124;u^(n−r)&#124;, read by guarantees only",
};

/// Every key of the family.
pub(super) const KEYS: [KeySpec; 9] = [
    VARIANT,
    POLES,
    ALPHA,
    BETA,
    GAMMA,
    FILTER_POLES,
    FILTER_INITIAL,
    INDICES,
    SLOPES,
];

/// The keys, read as far as they do not depend on the form. Those that do are kept as they
/// stand until the indices and the orders of the filters are known.
pub struct Settings {
    pub common: Common,
    pub variant: Option<Variant>,
    pub asked: Asked,
    poles: Option<Value>,
    pub α: Option<f64>,
    pub β: Option<f64>,
    pub γ: Option<f64>,
    filter_poles: Option<Value>,
    filter_initial: Option<Value>,
    slopes: Option<Value>,
}

impl Settings {
    pub fn read(extended: &Extended<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        let value = |key: KeySpec| tuning.values.get(key.name).cloned();
        let poles = value(POLES);
        Ok(Self {
            common: Common::read(tuning)?,
            variant: Variant::read(tuning, VARIANT.name)?,
            asked: keys::indices(extended, tuning, poles.as_ref())?,
            poles,
            α: tuning.positive(ALPHA.name)?,
            β: tuning.positive(BETA.name)?,
            γ: tuning.positive(GAMMA.name)?,
            filter_poles: value(FILTER_POLES),
            filter_initial: value(FILTER_INITIAL),
            slopes: value(SLOPES),
        })
    }

    /// Whether the study decides the poles.
    pub fn has_poles(&self) -> bool {
        self.poles.is_some() || self.α.is_some()
    }

    /// The poles of each output with its μ, if they are listed.
    pub fn poles(&self, μ: &[usize]) -> Result<Option<Vec<Vec<Pole>>>, TuningError> {
        let poles = self.poles.as_ref();
        poles.map(|value| keys::poles(value, μ)).transpose()
    }

    /// Lemma 3.2 for each output that is used.
    pub fn lemma(&self, μ: &[usize]) -> Result<Vec<Option<Lemma32>>, TuningError> {
        keys::lemma(self, μ)
    }

    /// The eigenvalues of the filter per input.
    pub fn filter_poles(&self, needed: &Needed<'_>) -> Result<Vec<Option<Vec<Pole>>>, TuningError> {
        keys::filter_poles(self.filter_poles.as_ref(), needed)
    }

    /// x̂ₐ(0) per input.
    pub fn filter_initial(
        &self,
        needed: &Needed<'_>,
    ) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
        let what = "numbers for the filter of";
        keys::numbers_per_input(self.filter_initial.as_ref(), FILTER_INITIAL, what, needed)
    }

    /// Bounds of |u'|, |u''|, … per input as far as any are declared: the family's key, else those of the plant. A
    /// list that has not the length that a guarantee needs is no help here.
    pub fn known_slopes(&self, extended: &Extended<'_>, U: &[Vec<Node>]) -> Vec<Vec<f64>> {
        let needed = Needed::new(extended, U.iter().map(Vec::len).collect());
        let own = self.slopes(&needed).unwrap_or_default().into_iter();
        let own = own.chain(std::iter::repeat(None));
        let general = extended.input_derivatives.iter();
        own.zip(general)
            .map(|(own, general)| own.unwrap_or_else(|| general.clone()))
            .collect()
    }

    /// Bounds of |u'|, |u''|, … per input.
    pub fn slopes(&self, needed: &Needed<'_>) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
        keys::slopes(self.slopes.as_ref(), needed)
    }
}
