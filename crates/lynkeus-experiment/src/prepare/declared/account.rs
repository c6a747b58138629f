//! Which of the study's declarations a claim counts.

use std::fmt;

use serde::Serialize;

use super::Kind;
use crate::entries;

/// What a claim counts of what the study declares, and what it leaves aside, with the reason. What is not
/// declared is in neither.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Declared")
)]
pub struct Account {
    /// kinds of declarations that it counts, `ranges` for example
    pub counted: Vec<&'static str>,
    /// kinds that it leaves aside, with the reason
    #[serde(serialize_with = "entries::pairs")]
    #[cfg_attr(feature = "schema", schemars(with = "entries::Named<String>"))]
    pub left_aside: Vec<(&'static str, &'static str)>,
}

impl Account {
    /// With a kind that counts.
    pub fn counts<T>(mut self, kind: &Kind<T>) -> Self {
        self.counted.extend(kind.acts.then_some(kind.name));
        self
    }

    /// With a kind that is left aside.
    pub fn leaves<T>(mut self, kind: &Kind<T>, why: &'static str) -> Self {
        self.left_aside
            .extend(kind.acts.then_some((kind.name, why)));
        self
    }

    /// With a kind that counts where it says so, else is left aside.
    pub fn counts_if<T>(self, counts: bool, kind: &Kind<T>, why: &'static str) -> Self {
        match counts {
            true => self.counts(kind),
            false => self.leaves(kind, why),
        }
    }

    /// The sentence; none where nothing is left aside.
    pub fn told(&self) -> Option<String> {
        (!self.left_aside.is_empty()).then(|| self.to_string())
    }
}

impl fmt::Display for Account {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted = match self.counted.is_empty() {
            true => "nothing".to_owned(),
            false => self.counted.join(", "),
        };
        write!(f, "counted: {counted}")?;
        let left = self
            .left_aside
            .iter()
            .map(|(kind, why)| format!("{kind} ({why})"));
        let left: Vec<String> = left.collect();
        match left.is_empty() {
            true => Ok(()),
            false => write!(f, "; left aside: {}", left.join("; ")),
        }
    }
}
