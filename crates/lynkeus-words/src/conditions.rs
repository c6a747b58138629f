//! Conditions of families and hypotheses of theorems, with what was found of them.

use lynkeus_observers::{Check, DesignError, Examination, Reason, Statement};

use crate::Words;

impl Words for Statement {
    fn words(&self) -> String {
        self.to_string()
    }
}

impl Words for Reason {
    fn words(&self) -> String {
        match self {
            Reason::Text(text) => text.clone(),
            Reason::Structure(reason) => reason.words(),
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
            error => error.to_string(),
        }
    }
}

fn refusal(examination: &Examination) -> String {
    let (family, summary) = (examination.family, &examination.summary);
    let mut text = match examination.spent() {
        Some(_) => format!("whether the family '{family}' fits is {summary}"),
        None => format!("the family '{family}' does not fit: {summary}"),
    };
    if let Some(check) = examination.refuted() {
        text += &format!("\n  {}", check.words());
    }
    text
}
