//! Which family is taken, and why: one decision for reports and for runs.

use std::fmt;

use lynkeus_answer::Document;
use lynkeus_expr::Spent;
use lynkeus_expr::real::rounded;
use lynkeus_observers::{Design, Family, Tuning, Value};
use serde::{Serialize, Serializer};

use crate::entries::finite;

/// The family to use.
#[derive(Clone, Debug)]
pub struct Choice {
    /// it itself
    pub family: &'static dyn Family,
    /// the study names it
    pub is_asked_for: bool,
    /// what stands behind it
    pub grounds: Grounds,
    /// a value for a key that the study leaves out
    pub proposal: Option<Proposal>,
    /// families that may fit and are not taken, with the reason
    pub passed: Vec<String>,
    /// the limit that ended the examination or the trial of one of those: without it another may be taken
    pub ended: Option<Spent>,
    /// made with the study's own keys
    pub(crate) design: Option<Design>,
}

/// What stands behind a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grounds {
    /// every condition of its theorem is proved; of several such families it is the first
    Proved {
        /// there are others
        first_of_several: bool,
    },
    /// nothing refutes its conditions
    Undecided,
    /// no theorem
    Filter,
}

/// The key that says how fast an observer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Speed {
    /// `theta`
    Theta,
    /// `poles`: a number is the slowest pole of every output
    Poles,
}

impl Speed {
    pub(crate) const ALL: [Self; 2] = [Self::Theta, Self::Poles];

    /// Its name.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Theta => "theta",
            Self::Poles => "poles",
        }
    }

    /// The value for an error that decays like e^(−rate t): what this family takes under the key.
    pub(crate) fn value(self, family: &dyn Family, rate: f64) -> Value {
        match self {
            Self::Poles => Value::Number(-rounded(rate, 2)),
            Self::Theta => {
                let parts = family.speeds();
                let part = |factor: &f64| Value::Number(rounded(factor * rate, 2));
                match parts {
                    [] => Value::Number(rounded(rate, 2)),
                    _ => Value::List(parts.iter().map(part).collect()),
                }
            }
        }
    }
}

/// A value for a key that the study leaves out.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Proposal {
    /// the key of `[observer]`
    #[serde(rename = "key")]
    pub speed: Speed,
    /// a number or a list of them, in 1/(unit of time)
    #[serde(serialize_with = "plain")]
    #[cfg_attr(feature = "schema", schemars(with = "Plain"))]
    pub value: Value,
    /// where it comes from
    pub why: String,
    /// the best of values that were tried in simulation
    #[serde(skip)]
    pub is_tried: bool,
}

/// Numbers for machines.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
enum Plain {
    One(Option<f64>),
    Several(Vec<Option<f64>>),
}

fn plain<S: Serializer>(value: &Value, to: S) -> Result<S::Ok, S::Error> {
    let number = |value: &Value| match value {
        Value::Number(x) => finite(*x),
        _ => None,
    };
    let plain = match value {
        Value::List(values) => Plain::Several(values.iter().map(number).collect()),
        one => Plain::One(number(one)),
    };
    plain.serialize(to)
}

/// Which family is taken, as `family = "auto"` does.
#[derive(Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Choice")
)]
pub struct Chosen<'a> {
    /// its name
    family: &'static str,
    /// whether the study names it
    asked_for: bool,
    /// what speaks for it
    grounds: Standing,
    /// a value for a key that the study leaves out
    proposed: Option<&'a Proposal>,
    /// families that may fit and are not taken, with the reason
    passed_over: &'a [String],
    /// what ended the search, where a limit did
    ended: Option<String>,
}

/// What stands behind a family, in a word.
#[derive(Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Grounds")
)]
#[serde(rename_all = "snake_case")]
enum Standing {
    Proved,
    Undecided,
    Filter,
}

impl<'a> From<&'a Choice> for Chosen<'a> {
    fn from(choice: &'a Choice) -> Self {
        Self {
            family: choice.family.name(),
            asked_for: choice.is_asked_for,
            grounds: match choice.grounds {
                Grounds::Proved { .. } => Standing::Proved,
                Grounds::Undecided => Standing::Undecided,
                Grounds::Filter => Standing::Filter,
            },
            proposed: choice.proposal.as_ref(),
            passed_over: &choice.passed,
            ended: choice.ended.map(|spent| spent.to_string()),
        }
    }
}

impl fmt::Display for Proposal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (key, value) = (self.speed.key(), &self.value);
        write!(
            f,
            "{key} = {value} is proposed: {}; write it, or another, into [observer]",
            self.why
        )
    }
}

impl Choice {
    /// A tuning with what is proposed where it says nothing.
    pub(crate) fn completed(&self, tuning: &Tuning) -> Tuning {
        let mut tuned = tuning.clone();
        if let Some(Proposal { speed, value, .. }) = &self.proposal {
            let slot = tuned.values.entry(speed.key().to_owned());
            slot.or_insert_with(|| value.clone());
        }
        tuned
    }

    /// What a run says of the decision.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.proposal.iter().map(Proposal::to_string).collect();
        if !self.is_asked_for && self.grounds == Grounds::Filter {
            notes.push(format!("{} ({})", self.loss(), self.passed_over()));
        } else if self.ended.is_some() {
            notes.extend(self.passed.iter().cloned());
        }
        notes.extend(self.hanging());
        notes
    }

    /// That a limit has a say in it.
    fn hanging(&self) -> Option<String> {
        let (family, spent) = (self.family, self.ended?);
        Some(match self.is_asked_for {
            true => format!("no speed of {family} is proposed by a sweep: {spent}"),
            false => format!(
                "which family is taken depends on a limit of time or memory, which ended work on one that comes before {family}: without it, it may be another. Raise the limit, or name the family with `family` in [observer]"
            ),
        })
    }

    fn passed_over(&self) -> String {
        match self.passed.is_empty() {
            true => "`lynkeus check` says why".to_owned(),
            false => self.passed.join("; "),
        }
    }

    /// What a filter has not.
    fn loss(&self) -> String {
        let family = self.family;
        let none = match self.passed.is_empty() {
            true => "no family with a theorem fits this plant and these sensors",
            false => "no family with a theorem is taken",
        };
        format!(
            "{none}: {family} gives an estimate with its standard deviation, but nothing is proved of its error: no rate, no bound, and from a start far off it may diverge"
        )
    }
}

impl Choice {
    /// The decision, with what stands behind it.
    pub fn tell(&self, document: &mut Document) {
        let family = self.family;
        document.line(match self.grounds {
            Grounds::Proved {
                first_of_several: true,
            } => format!("{family} comes first: of the families that fit, it has the simplest gain"),
            Grounds::Proved { .. } => {
                format!("{family} is the one whose every condition is proved")
            }
            Grounds::Undecided => format!(
                "{family} is not proved to fit, but nothing refutes it: what is undecided above says what would settle it"
            ),
            Grounds::Filter if self.is_asked_for => format!(
                "{family} is the study's choice: it runs on any plant, and nothing is proved of its error"
            ),
            Grounds::Filter => self.loss(),
        });
        document.items(&self.passed);
        for line in self
            .hanging()
            .into_iter()
            .chain(self.proposal.as_ref().map(Proposal::to_string))
        {
            document.line(line);
        }
    }
}
