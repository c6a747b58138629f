//! A row: when it was sampled, and what each channel reads.

use std::collections::BTreeSet;
use std::sync::Arc;

use lynkeus::expr::Evaluator;
use lynkeus::stream::{Given, Stream};
use lynkeus::table::{Instant, exact};

use crate::bytes::{Parser, Writer};

/// Names that nobody reads of which the user hears.
const STRANGERS: usize = 16;

/// When a row was sampled, as it says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stamp {
    /// in the plant's time
    Number(f64),
    /// by calendar and clock
    Date(Instant),
}

impl Stamp {
    /// Whether it is earlier; of a number and a date nobody knows.
    #[must_use]
    pub fn is_before(self, other: Self) -> bool {
        match (self, other) {
            (Self::Number(own), Self::Number(other)) => own < other,
            (Self::Date(own), Self::Date(other)) => own.nanoseconds() < other.nanoseconds(),
            _ => false,
        }
    }

    pub(crate) fn save(self, to: &mut Writer) {
        match self {
            Self::Number(t) => {
                to.word(0);
                to.number(t);
            }
            Self::Date(instant) => {
                let nanoseconds = instant.nanoseconds();
                to.word(if instant.is_zoned() { 2 } else { 1 });
                // i128 in two words
                to.word(nanoseconds as u64);
                to.word((nanoseconds >> 64) as u64);
            }
        }
    }

    pub(crate) fn load(from: &mut Parser<'_>) -> Option<Self> {
        let kind = from.word()?;
        if kind == 0 {
            return from.number().map(Self::Number);
        }
        let low = i128::from(from.word()?);
        let high = i128::from(from.word()? as i64);
        Some(Self::Date(Instant::at(high << 64 | low, kind == 2)))
    }
}

/// As a message has it.
impl std::fmt::Display for Stamp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(t) => f.write_str(&exact(*t)),
            Self::Date(instant) => instant.fmt(f),
        }
    }
}

/// What a message has under a name.
#[derive(Clone, Debug, PartialEq)]
pub enum Field {
    /// a number
    Number(f64),
    /// a text
    Text(String),
    /// nothing: the name is not there, or it says so
    Nothing,
    /// something else, in words
    Other(&'static str),
}

/// Reads rows of a study.
#[derive(Clone)]
pub struct Reader {
    stream: Arc<Stream>,
    /// by channel, where its value is computed
    evaluators: Vec<Option<Evaluator>>,
    /// every name that a message of this study may have
    known: Vec<String>,
    /// names that nobody reads, as far as they were told
    strangers: BTreeSet<String>,
}

impl Reader {
    /// Of messages for this study.
    #[must_use]
    pub fn new(stream: Arc<Stream>) -> Self {
        let given = stream.channels.iter().map(|channel| &channel.given);
        let evaluators = given.clone().map(|given| match given {
            Given::Key(_) => None,
            Given::Computed { tape, .. } => Some(tape.evaluator()),
        });
        let evaluators = evaluators.collect();
        let mut known = vec![stream.time.clone()];
        for given in given {
            known.push(given.text().to_owned());
            if let Given::Computed { keys, .. } = given {
                known.extend_from_slice(keys);
            }
        }
        Self {
            evaluators,
            known,
            strangers: BTreeSet::new(),
            stream,
        }
    }

    /// The study.
    #[must_use]
    pub fn stream(&self) -> &Arc<Stream> {
        &self.stream
    }

    /// Whether a message may have this name.
    #[must_use]
    pub fn knows(&self, name: &str) -> bool {
        self.known.iter().any(|known| known == name)
    }

    /// The names that a message of this study may have, but for its time.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.known.iter().skip(1).map(String::as_str)
    }

    /// Those of some names that nobody reads which the user has not heard of; not more than a few of all.
    pub fn strange(&mut self, names: Vec<String>) -> Vec<String> {
        let mut news = vec![];
        for name in names {
            if self.strangers.len() < STRANGERS && self.strangers.insert(name.clone()) {
                news.push(name);
            }
        }
        news
    }

    /// The values of the channels of a message: NaN where there is none.
    ///
    /// # Errors
    /// What is no number, in words.
    pub fn values(&mut self, get: &dyn Fn(&str) -> Field) -> Result<Vec<f64>, String> {
        let mut values = Vec::with_capacity(self.evaluators.len());
        for (channel, evaluator) in self.stream.channels.iter().zip(&mut self.evaluators) {
            let value = match (&channel.given, evaluator) {
                (Given::Computed { text, keys, .. }, Some(evaluator)) => match get(text) {
                    Field::Nothing => {
                        let read = keys.iter().map(|key| number(key, get(key)));
                        let read = read.collect::<Result<Vec<f64>, String>>()?;
                        evaluator.value(&read)
                    }
                    field => number(text, field)?,
                },
                (given, _) => number(given.text(), get(given.text()))?,
            };
            values.push(if value.is_finite() { value } else { f64::NAN });
        }
        Ok(values)
    }

    /// The time of a message.
    ///
    /// # Errors
    /// There is none, or it is neither a number nor a date.
    pub fn stamp(&self, field: Field) -> Result<Stamp, String> {
        let key = &self.stream.time;
        match field {
            Field::Number(t) if t.is_finite() => Ok(Stamp::Number(t)),
            Field::Text(text) => {
                let found = match &self.stream.pattern {
                    Some(pattern) => pattern.instant(text.trim()),
                    None => Instant::read(text.trim()),
                };
                let found = found.map(Stamp::Date);
                let expected = "a number or a date such as 2026-11-27T12:00:00Z";
                found.ok_or_else(|| format!("\"{key}\": expected {expected}, found \"{text}\""))
            }
            Field::Nothing => Err(format!("expected a time under \"{key}\", found none")),
            Field::Number(_) => Err(format!("\"{key}\": expected a finite number or a date")),
            Field::Other(found) => Err(format!(
                "\"{key}\": expected a number or a date, found {found}"
            )),
        }
    }
}

/// The number of a field, NaN for nothing.
fn number(key: &str, field: Field) -> Result<f64, String> {
    match field {
        Field::Number(x) if x.is_finite() => Ok(x),
        Field::Nothing => Ok(f64::NAN),
        Field::Number(_) => Err(format!("\"{key}\": expected a finite number or null")),
        Field::Text(_) => Err(format!(
            "\"{key}\": expected a number or null, found a text"
        )),
        Field::Other(found) => Err(format!(
            "\"{key}\": expected a number or null, found {found}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_kept_to_the_nanosecond() {
        for stamp in [
            Stamp::Number(-0.1),
            Stamp::Date(Instant::at(-5, true)),
            Stamp::Date(Instant::at(1_795_305_723_250_000_001, false)),
            Stamp::Date(Instant::at(i128::from(i64::MAX) * 3, true)),
        ] {
            let mut to = Writer::default();
            stamp.save(&mut to);
            assert_eq!(Stamp::load(&mut Parser(&to.0)), Some(stamp));
            assert_eq!(Stamp::load(&mut Parser(&to.0[1..])), None);
        }
    }
}
