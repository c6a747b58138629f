//! What can be known, for machines.

use lynkeus_structure::detectability::Detectability;
use serde::Serialize;

use super::{Assumption, Knowledge, Known, Reserve};
use lynkeus_experiment::entries::Named;

/// What can be known under an assumption on the unknown inputs.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Knowledge"))]
pub(super) struct KnowledgeEntry<'a> {
    /// the assumption
    unknown_inputs: Assumed,
    /// the same in words
    words: String,
    /// what can be known of each quantity
    quantities: Named<KnownEntry<'a>>,
    /// the point at which it was linearised, where it was
    linearised_at: Option<Named<f64>>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
enum Assumed {
    None,
    Arbitrary,
    Wandering,
}

impl<'a> From<&'a Knowledge> for KnowledgeEntry<'a> {
    fn from(knowledge: &'a Knowledge) -> Self {
        let quantities = knowledge.quantities.iter();
        let point = knowledge.point.iter().map(|c| (c.name.clone(), c.value));
        let point: Named<f64> = point.collect();
        Self {
            unknown_inputs: match knowledge.assumption {
                Assumption::NoneUnknown => Assumed::None,
                Assumption::Arbitrary => Assumed::Arbitrary,
                Assumption::Wandering { .. } => Assumed::Wandering,
            },
            words: knowledge.words(),
            quantities: quantities
                .map(|(name, known)| (name.clone(), known.into()))
                .collect(),
            linearised_at: Some(point).filter(|point| !point.is_empty()),
        }
    }
}

/// What can be known of a quantity, and where; `decays`: it cannot be known, but an error in it decays.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Known"))]
#[serde(tag = "known")]
enum KnownEntry<'a> {
    #[serde(rename = "everywhere")]
    Everywhere,
    #[serde(rename = "everywhere while inputs are constant")]
    WhileConstant,
    #[serde(rename = "locally everywhere")]
    Locally,
    #[serde(rename = "locally everywhere while inputs are constant")]
    LocallyWhileConstant,
    #[serde(rename = "almost everywhere")]
    AlmostEverywhere,
    #[serde(rename = "in part of the box")]
    InPart {
        /// share of the box in which it is not seen
        hidden_share: f64,
        /// a point at which it is not seen
        hidden_at: Named<f64>,
    },
    #[serde(rename = "while excited")]
    WhileExcited {
        /// the input at which it is not seen
        hidden_by: HiddenBy<'a>,
    },
    #[serde(rename = "within limits")]
    WithinLimits {
        /// what is known within the limits of sensors, or were there no disturbances
        otherwise: Box<KnownEntry<'a>>,
        /// sensors within whose limits it is known
        sensors: &'a [String],
    },
    #[serde(rename = "up to disturbances")]
    UpToDisturbances {
        /// what is known were there none
        otherwise: Box<KnownEntry<'a>>,
        /// disturbances up to which it is known
        disturbances: &'a [String],
        /// how far it may be off in the end, in its unit
        bound: Option<f64>,
    },
    #[serde(rename = "decays")]
    Decays {
        /// rate at which an error in it decays, in 1/(unit of time)
        rate: f64,
        /// whether that is proved on the box; else it is that of a linearisation
        proved: bool,
    },
    #[serde(rename = "no")]
    No {
        /// how far it may be off in the end, in its unit
        #[serde(skip_serializing_if = "Option::is_none")]
        bound: Option<f64>,
        /// what becomes of an error in it
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<ErrorCourse>,
    },
    #[serde(rename = "undecided")]
    Undecided,
}

/// A value of an input at which a quantity is not seen.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct HiddenBy<'a> {
    /// the input
    input: &'a str,
    /// its value
    value: f64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
enum ErrorCourse {
    Stays,
    Grows,
    #[serde(rename = "moved by an unknown input")]
    Moved,
    Undecided,
}

impl<'a> From<&'a Known> for KnownEntry<'a> {
    fn from(known: &'a Known) -> Self {
        match known {
            Known::Everywhere => Self::Everywhere,
            Known::WhileConstant => Self::WhileConstant,
            Known::Locally { constant: false } => Self::Locally,
            Known::Locally { constant: true } => Self::LocallyWhileConstant,
            Known::AlmostEverywhere => Self::AlmostEverywhere,
            Known::InPart { share, at } => Self::InPart {
                hidden_share: *share,
                hidden_at: at.iter().cloned().collect(),
            },
            Known::WhileExcited { input, value } => {
                let value = *value;
                let hidden_by = HiddenBy { input, value };
                Self::WhileExcited { hidden_by }
            }
            Known::Reserved { known, reserve } => {
                let otherwise = Box::new(Self::from(&**known));
                match reserve {
                    Reserve::Limits(sensors) => Self::WithinLimits { otherwise, sensors },
                    Reserve::Disturbances { names, bound } => Self::UpToDisturbances {
                        otherwise,
                        disturbances: names,
                        bound: *bound,
                    },
                }
            }
            Known::Hidden(detectability) => hidden(*detectability),
            Known::Undecided => Self::Undecided,
        }
    }
}

fn hidden(detectability: Detectability) -> KnownEntry<'static> {
    let but = |bound, error| KnownEntry::No { bound, error };
    match detectability {
        Detectability::Decays { rate, is_proved } => KnownEntry::Decays {
            rate,
            proved: is_proved,
        },
        Detectability::Bounded { bound, is_kept } => {
            let error = (!is_kept).then_some(ErrorCourse::Undecided);
            but(Some(bound), error)
        }
        Detectability::Stays => but(None, Some(ErrorCourse::Stays)),
        Detectability::Grows { .. } => but(None, Some(ErrorCourse::Grows)),
        Detectability::Moved => but(None, Some(ErrorCourse::Moved)),
        Detectability::Undecided => but(None, Some(ErrorCourse::Undecided)),
    }
}
