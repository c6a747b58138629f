//! What can be known, for machines.

use lynkeus_structure::detectability::Detectability;
#[cfg(test)]
use schemars::JsonSchema;
use serde::Serialize;

use super::{Assumption, Knowledge, Known, Reserve};
use crate::entries::{Named, coordinates};

/// What can be known under an assumption on the unknown inputs.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(JsonSchema), schemars(rename = "Knowledge"))]
pub(super) struct KnowledgeEntry<'a> {
    /// the assumption
    unknown_inputs: Assumed,
    /// the same in words
    words: String,
    /// what can be known of each quantity
    quantities: Named<KnownEntry<'a>>,
    /// the point at which it was linearised, where it was
    linearised_at: Option<Named<Option<f64>>>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
enum Assumed {
    None,
    Arbitrary,
    Wandering,
}

impl<'a> From<&'a Knowledge> for KnowledgeEntry<'a> {
    fn from(knowledge: &'a Knowledge) -> Self {
        let quantities = knowledge.quantities.iter();
        let is_linearised = !knowledge.point.is_empty();
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
            linearised_at: is_linearised.then(|| coordinates(&knowledge.point)),
        }
    }
}

/// What can be known of a quantity.
#[derive(Debug, Default, Serialize)]
#[cfg_attr(test, derive(JsonSchema), schemars(rename = "Known"))]
struct KnownEntry<'a> {
    /// where it can be known; `decays`: it cannot, but an error in it decays
    known: Where,
    /// the input at which it is not seen, of one that is known while excited
    #[serde(skip_serializing_if = "Option::is_none")]
    hidden_by: Option<HiddenBy<'a>>,
    /// share of the box in which it is not seen
    #[serde(skip_serializing_if = "Option::is_none")]
    hidden_share: Option<f64>,
    /// a point at which it is not seen
    #[serde(skip_serializing_if = "Option::is_none")]
    hidden_at: Option<Named<f64>>,
    /// what is known within the limits of sensors, or were there no disturbances
    #[serde(skip_serializing_if = "Option::is_none")]
    otherwise: Option<Box<KnownEntry<'a>>>,
    /// sensors within whose limits it is known
    #[serde(skip_serializing_if = "Option::is_none")]
    sensors: Option<&'a [String]>,
    /// disturbances up to which it is known
    #[serde(skip_serializing_if = "Option::is_none")]
    disturbances: Option<&'a [String]>,
    /// how far it may be off in the end, in its unit
    #[serde(skip_serializing_if = "Option::is_none")]
    bound: Option<Option<f64>>,
    /// rate at which an error in it decays, in 1/(unit of time)
    #[serde(skip_serializing_if = "Option::is_none")]
    rate: Option<f64>,
    /// whether that is proved on the box; else it is that of a linearisation
    #[serde(skip_serializing_if = "Option::is_none")]
    proved: Option<bool>,
    /// what becomes of an error in it
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<ErrorCourse>,
}

/// A value of an input at which a quantity is not seen.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
struct HiddenBy<'a> {
    /// the input
    input: &'a str,
    /// its value
    value: f64,
}

#[derive(Debug, Default, Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
enum Where {
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
    InPart,
    #[serde(rename = "while excited")]
    WhileExcited,
    #[serde(rename = "within limits")]
    WithinLimits,
    #[serde(rename = "up to disturbances")]
    UpToDisturbances,
    #[serde(rename = "decays")]
    Decays,
    #[serde(rename = "no")]
    No,
    #[default]
    #[serde(rename = "undecided")]
    Undecided,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
enum ErrorCourse {
    #[serde(rename = "stays")]
    Stays,
    #[serde(rename = "grows")]
    Grows,
    #[serde(rename = "moved by an unknown input")]
    Moved,
    #[serde(rename = "undecided")]
    Undecided,
}

impl Known {
    fn place(&self) -> Where {
        match self {
            Known::Everywhere => Where::Everywhere,
            Known::WhileConstant => Where::WhileConstant,
            Known::Locally { constant: false } => Where::Locally,
            Known::Locally { constant: true } => Where::LocallyWhileConstant,
            Known::AlmostEverywhere => Where::AlmostEverywhere,
            Known::InPart { .. } => Where::InPart,
            Known::WhileExcited { .. } => Where::WhileExcited,
            Known::Reserved {
                reserve: Reserve::Limits(_),
                ..
            } => Where::WithinLimits,
            Known::Reserved {
                reserve: Reserve::Disturbances { .. },
                ..
            } => Where::UpToDisturbances,
            Known::Hidden(Detectability::Decays { .. }) => Where::Decays,
            Known::Hidden(_) => Where::No,
            Known::Undecided => Where::Undecided,
        }
    }
}

impl<'a> From<&'a Known> for KnownEntry<'a> {
    fn from(known: &'a Known) -> Self {
        let mut entry = Self {
            known: known.place(),
            ..Self::default()
        };
        match known {
            Known::WhileExcited { input, value } => {
                let value = *value;
                entry.hidden_by = Some(HiddenBy { input, value });
            }
            Known::InPart { share, at } => {
                entry.hidden_share = Some(*share);
                entry.hidden_at = Some(at.iter().cloned().collect());
            }
            Known::Reserved { known, reserve } => {
                entry.otherwise = Some(Box::new((&**known).into()));
                match reserve {
                    Reserve::Limits(sensors) => entry.sensors = Some(sensors),
                    Reserve::Disturbances { names, bound } => {
                        entry.disturbances = Some(names);
                        entry.bound = Some(*bound);
                    }
                }
            }
            Known::Hidden(detectability) => entry.hide(*detectability),
            _ => {}
        }
        entry
    }
}

impl KnownEntry<'_> {
    fn hide(&mut self, detectability: Detectability) {
        self.error = match detectability {
            Detectability::Decays { rate, is_proved } => {
                (self.rate, self.proved) = (Some(rate), Some(is_proved));
                None
            }
            Detectability::Bounded { bound, is_kept } => {
                self.bound = Some(Some(bound));
                (!is_kept).then_some(ErrorCourse::Undecided)
            }
            Detectability::Stays => Some(ErrorCourse::Stays),
            Detectability::Grows { .. } => Some(ErrorCourse::Grows),
            Detectability::Moved => Some(ErrorCourse::Moved),
            Detectability::Undecided => Some(ErrorCourse::Undecided),
        };
    }
}
