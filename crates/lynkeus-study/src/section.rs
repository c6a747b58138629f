//! Tables of a study file, read key by key: every refusal names the place, the key, what was
//! expected and what was found.

use std::ops::{Range, RangeInclusive};

use lynkeus_observers::KeySpec;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::source::{Name, Source};
use lynkeus_answer::Error;
use lynkeus_answer::near::suggest;
use lynkeus_answer::visible;

/// One table (`[observer]`, or the top of the file) whose keys are all known words.
pub(crate) struct Section<'a> {
    source: &'a Source<'a>,
    name: String,
    table: DeTable<'a>,
}

impl<'a> Section<'a> {
    /// Takes a table and refuses the first key that is not in `known`.
    pub fn new(
        source: &'a Source<'a>,
        name: &str,
        table: DeTable<'a>,
        known: &[KeySpec],
    ) -> Result<Self, Error> {
        let section = Self {
            source,
            name: name.to_owned(),
            table,
        };
        let stranger = section
            .table
            .keys()
            .filter(|key| known.iter().all(|spec| spec.name != key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        match stranger {
            None => Ok(section),
            Some(key) => {
                let word = key.get_ref().as_ref();
                let shown = visible::line(word);
                Err(
                    Error::input(format!("unknown key \"{shown}\" in {}", section.name))
                        .at(source.place(&key.span()))
                        .hint(suggest(word, known.iter().map(|spec| spec.name))),
                )
            }
        }
    }

    /// Takes the value of `key` out of the table.
    pub fn take(&mut self, key: &str) -> Option<Entry<'a>> {
        let (key, value) = self.table.remove_entry(key)?;
        Some(Entry {
            source: self.source,
            key: format!("`{}` of {}", key.get_ref(), self.name),
            key_span: key.span(),
            value,
        })
    }

    /// The refusal of the table as a whole.
    #[track_caller]
    pub fn refuse(&self, why: &str) -> Error {
        Error::input(format!("{}: {why}", self.name)).at(&self.source.file)
    }

    /// Reads `key` with `read`, or gives `None` where it is absent.
    pub fn optional<T>(
        &mut self,
        key: &str,
        read: impl FnOnce(Entry<'a>) -> Result<T, Error>,
    ) -> Result<Option<T>, Error> {
        self.take(key).map(read).transpose()
    }
}

/// One value with its key.
pub(crate) struct Entry<'a> {
    source: &'a Source<'a>,
    key: String,
    key_span: Range<usize>,
    value: Spanned<DeValue<'a>>,
}

impl<'a> Entry<'a> {
    /// The refusal of this value: `expected` completes "must be …".
    #[track_caller]
    pub fn wrong(&self, expected: &str) -> Error {
        Error::input(format!(
            "{} must be {expected}, found {}",
            self.key,
            found(self.value.get_ref())
        ))
        .at(self.source.place(&self.value.span()))
    }

    /// The refusal of this key as such.
    #[track_caller]
    pub fn refuse_key(&self, why: &str) -> Error {
        Error::input(format!("{} {why}", self.key)).at(self.source.place(&self.key_span))
    }

    /// A finite number.
    pub fn number(self) -> Result<f64, Error> {
        let number = match self.value.get_ref() {
            DeValue::Integer(i) if i.radix() == 10 => i.as_str().parse().ok(),
            DeValue::Float(x) => x.as_str().parse().ok(),
            _ => None,
        };
        number
            .filter(|x: &f64| x.is_finite())
            .ok_or_else(|| self.wrong("a finite number"))
    }

    /// A number greater than zero.
    pub fn positive(self) -> Result<f64, Error> {
        let refusal = self.wrong("a number > 0");
        self.number().ok().filter(|x| *x > 0.0).ok_or(refusal)
    }

    /// A number in a range.
    pub fn within(self, range: &RangeInclusive<f64>) -> Result<f64, Error> {
        let expected = format!("a number in [{:e}, {}]", range.start(), range.end());
        let refusal = self.wrong(&expected);
        self.number()
            .ok()
            .filter(|x| range.contains(x))
            .ok_or(refusal)
    }

    /// A whole number from `least` up.
    pub fn whole(self, least: u64) -> Result<u64, Error> {
        let whole = match self.value.get_ref() {
            DeValue::Integer(i) => u64::from_str_radix(i.as_str(), i.radix()).ok(),
            _ => None,
        };
        whole
            .filter(|n| *n >= least)
            .ok_or_else(|| self.wrong(&format!("a whole number of at least {least}")))
    }

    /// `true` or `false`.
    pub fn boolean(self) -> Result<bool, Error> {
        self.as_boolean().ok_or_else(|| self.wrong("true or false"))
    }

    /// A text, as a name with its place.
    pub fn name(self) -> Result<Name, Error> {
        match self.value.get_ref() {
            DeValue::String(text) if !text.trim().is_empty() => Ok(Name {
                text: text.trim().to_owned(),
                place: Some(self.source.place(&self.value.span())),
            }),
            DeValue::String(_) => Err(self.wrong("a text that is not empty")),
            _ => Err(self.wrong("a text in quotes")),
        }
    }

    /// One of a few words.
    pub fn choice<T: Copy>(self, words: &[(&str, T)]) -> Result<T, Error> {
        let expected = words
            .iter()
            .map(|(word, _)| format!("\"{word}\""))
            .collect::<Vec<_>>()
            .join(", ");
        let DeValue::String(text) = self.value.get_ref() else {
            return Err(self.wrong(&format!("one of {expected}")));
        };
        words
            .iter()
            .find(|(word, _)| *word == text.as_ref())
            .map(|(_, choice)| *choice)
            .ok_or_else(|| self.wrong(&format!("one of {expected}")))
    }

    /// The entries of a list.
    pub fn list(self) -> Result<Vec<Entry<'a>>, Error> {
        if !matches!(self.value.get_ref(), DeValue::Array(_)) {
            return Err(self.wrong("a list in [ ]"));
        }
        let (source, key, key_span) = (self.source, self.key, self.key_span);
        let DeValue::Array(items) = self.value.into_inner() else {
            return Ok(Vec::new());
        };
        Ok(items
            .into_iter()
            .enumerate()
            .map(|(i, value)| Entry {
                source,
                key: format!("entry {} of {key}", i + 1),
                key_span: key_span.clone(),
                value,
            })
            .collect())
    }

    /// A list, each entry read by `read`.
    pub fn list_of<T>(self, read: impl Fn(Entry<'a>) -> Result<T, Error>) -> Result<Vec<T>, Error> {
        self.list()?.into_iter().map(read).collect()
    }

    /// A table with known keys, called `name` in messages.
    pub fn section(self, name: &str, known: &[KeySpec]) -> Result<Section<'a>, Error> {
        let source = self.source;
        Section::new(source, name, self.table()?, known)
    }

    /// A table whose keys are the plant's names, in the order of the file.
    pub fn pairs(self) -> Result<Vec<(Name, Entry<'a>)>, Error> {
        let (source, outer) = (self.source, self.key.clone());
        let mut pairs: Vec<_> = self.table()?.into_iter().collect();
        pairs.sort_by_key(|(key, _)| key.span().start);
        Ok(pairs
            .into_iter()
            .map(|(key, value)| {
                let name = Name {
                    text: key.get_ref().to_string(),
                    place: Some(source.place(&key.span())),
                };
                let entry = Entry {
                    source,
                    key: format!("\"{}\" in {outer}", visible::line(&name.text)),
                    key_span: key.span(),
                    value,
                };
                (name, entry)
            })
            .collect())
    }

    fn table(self) -> Result<DeTable<'a>, Error> {
        let refusal = self.wrong("a table of keys and values");
        match self.value.into_inner() {
            DeValue::Table(table) => Ok(table),
            _ => Err(refusal),
        }
    }

    /// Whether it is a table that holds tables or lists.
    pub fn has_inner(&self) -> bool {
        let is_inner = |value: &DeValue<'_>| matches!(value, DeValue::Table(_) | DeValue::Array(_));
        match self.value.get_ref() {
            DeValue::Table(table) => table.values().any(|value| is_inner(value.get_ref())),
            _ => false,
        }
    }

    /// The text of a string value, `None` for any other type.
    pub fn as_text(&self) -> Option<&str> {
        match self.value.get_ref() {
            DeValue::String(text) => Some(text),
            _ => None,
        }
    }

    /// The truth value, `None` for any other type.
    pub fn as_boolean(&self) -> Option<bool> {
        match self.value.get_ref() {
            DeValue::Boolean(flag) => Some(*flag),
            _ => None,
        }
    }

    /// Whether the value is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.value.get_ref(), DeValue::Array(_))
    }

    /// Whether the value is a table.
    pub fn is_table(&self) -> bool {
        matches!(self.value.get_ref(), DeValue::Table(_))
    }

    /// The place of the value.
    pub fn place(&self) -> super::Place {
        self.source.place(&self.value.span())
    }
}

/// Entries of a list that are told one by one.
const FEW: usize = 4;

/// A value as a message shows it.
fn found(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{}\"", visible::line(text)),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(b) => b.to_string(),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(items) if items.len() <= FEW => {
            let items = items.iter().map(|item| found(item.get_ref()));
            format!("[{}]", items.collect::<Vec<_>>().join(", "))
        }
        DeValue::Array(items) => format!("a list of {}", items.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
