//! Conditions of families and hypotheses of theorems, with what was found of them.

use lynkeus_observers::{Check, DesignError, Examination, ParameterValue, Reason, Statement};

use lynkeus_structure::short;

use crate::Words;

impl Words for Statement {
    fn words(&self) -> String {
        match self {
            Statement::Ltaief(part) => part.words(),
            Statement::Farza(part) => part.words(),
            Statement::Germani(part) => part.words(),
            other => other.to_string(),
        }
    }
}

impl Words for Reason {
    fn words(&self) -> String {
        match self {
            Reason::Text(text) => text.clone(),
            Reason::Structure(reason) => reason.words(),
            Reason::AtMost { found, limit } => {
                let sign = if found <= limit { "≤" } else { ">" };
                format!("{} {sign} {}", short(*found), short(*limit))
            }
            Reason::AtLeast { found, least } => {
                let sign = if found >= least { "≥" } else { "<" };
                format!("{} {sign} {}", short(*found), short(*least))
            }
            Reason::StateAffine(said) => said.words(),
            Reason::UnknownInput(said) => said.words(),
            Reason::DriftObservable(said) => said.words(),
        }
    }
}

impl Words for Check {
    fn words(&self) -> String {
        let (statement, reason) = (self.statement.words(), self.reason.words());
        format!("{statement}: {} ({reason})", self.verdict)
    }
}

impl Words for DesignError {
    fn words(&self) -> String {
        match self {
            DesignError::Refused(examination) => refusal(examination),
            DesignError::NoGain { reason, .. } => reason.words(),
            error => error.to_string(),
        }
    }
}

impl Words for ParameterValue {
    fn words(&self) -> String {
        match self {
            ParameterValue::Text(text) => text.clone(),
            ParameterValue::Numbers(numbers) => listed(numbers),
        }
    }
}

/// `1, 2.5`
pub(crate) fn listed(numbers: &[f64]) -> String {
    let number = |x: &f64| match x.is_finite() {
        true => x.to_string(),
        false => "beyond the range of numbers".to_owned(),
    };
    numbers.iter().map(number).collect::<Vec<_>>().join(", ")
}

fn refusal(examination: &Examination) -> String {
    let (family, summary) = (examination.family, examination.summary.words());
    let mut text = match examination.spent() {
        Some(_) => format!("whether the family '{family}' fits is {summary}"),
        None => format!("the family '{family}' does not fit: {summary}"),
    };
    if let Some(check) = examination.refuted() {
        text += &format!("\n  {}", check.words());
    }
    text
}
