//! Keys of a study: how a key is declared (name, type, default and meaning in one place, from
//! which messages, the tables of the documentation and the schema for editors come), and the
//! values that a family reads.

use std::collections::BTreeMap;

/// A value of a study key.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// a number
    Number(f64),
    /// true or false
    Flag(bool),
    /// a word
    Text(String),
    /// a list
    List(Vec<Value>),
    /// named values
    Table(BTreeMap<String, Value>),
}

impl Value {
    /// A number.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(x) => Some(*x),
            _ => None,
        }
    }

    /// A text.
    pub(crate) fn text(&self) -> Option<String> {
        match self {
            Self::Text(text) => Some(text.clone()),
            _ => None,
        }
    }

    /// The entries of a list.
    pub(crate) fn list(&self) -> Option<&[Self]> {
        match self {
            Self::List(entries) => Some(entries),
            _ => None,
        }
    }

    /// What the entries of a list are, where each of them is that.
    pub(crate) fn all<T>(&self, entry: impl Fn(&Self) -> Option<T>) -> Option<Vec<T>> {
        self.list()?.iter().map(entry).collect()
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Number(x) => write!(f, "{x}"),
            Value::Flag(b) => write!(f, "{b}"),
            Value::Text(text) => write!(f, "\"{text}\""),
            Value::List(values) => {
                let values: Vec<String> = values.iter().map(Value::to_string).collect();
                write!(f, "[{}]", values.join(", "))
            }
            Value::Table(values) => {
                let values: Vec<String> =
                    values.iter().map(|(k, v)| format!("{k} = {v}")).collect();
                write!(f, "{{ {} }}", values.join(", "))
            }
        }
    }
}

/// A key of the study whose value cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: expected {expected}, found {found}")]
pub struct TuningError {
    /// the key
    pub key: String,
    /// what would be right
    pub expected: String,
    /// what stands there
    pub found: String,
    /// nothing stands there: the key is required
    pub absent: bool,
}

impl TuningError {
    /// The error for `key`.
    pub fn new(key: &str, expected: impl Into<String>, found: impl ToString) -> Self {
        Self {
            key: key.to_owned(),
            expected: expected.into(),
            found: found.to_string(),
            absent: false,
        }
    }

    /// The error that a required `key` is not there.
    pub fn absent(key: &str, expected: impl Into<String>) -> Self {
        Self {
            absent: true,
            ..Self::new(key, expected, "nothing")
        }
    }
}

/// Where the estimate starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Initial {
    /// for every state and unknown input not named
    pub default: Option<f64>,
    /// by name
    pub values: BTreeMap<String, f64>,
}

impl Initial {
    /// What is given for a state by its name, else by its array's; not the default.
    #[must_use]
    pub fn of(&self, state: &str) -> Option<f64> {
        let array = state.split('[').next().unwrap_or_default();
        let own = self.values.get(state);
        own.or_else(|| self.values.get(array)).copied()
    }
}

/// The tuning of an observer: keys that belong to every family, and those of one. A family
/// reads it once into settings of its own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tuning {
    /// start of the estimate
    pub initial: Initial,
    /// the model's functions see the estimate limited to [min, max]
    pub clamp: bool,
    /// θ is a symbol of the observer's expressions, to be changed while it runs, where the family
    /// allows it ([`Tunable`](crate::Tunable)); no key of a study
    pub tunable: bool,
    /// the family's own keys
    pub values: BTreeMap<String, Value>,
    /// standard deviations of the measurement errors that are declared, by output: what gains weigh
    /// that are chosen by the noise they let through
    pub noise: BTreeMap<String, f64>,
}

impl Tuning {
    /// A tuning with numbers for some keys; a shorthand for plants written in Rust.
    ///
    /// ```
    /// use lynkeus_observers::{Tuning, Value};
    ///
    /// let tuning = Tuning::from([("theta", 0.5)]);
    /// assert_eq!(tuning.values["theta"], Value::Number(0.5));
    /// ```
    pub fn from<const N: usize>(numbers: [(&str, f64); N]) -> Self {
        let values = numbers
            .into_iter()
            .map(|(key, x)| (key.to_owned(), Value::Number(x)));
        Self {
            values: values.collect(),
            ..Self::default()
        }
    }

    /// What stands under a key, where it is as expected.
    pub(crate) fn read<T>(
        &self,
        key: &str,
        expected: &str,
        meant: impl Fn(&Value) -> Option<T>,
    ) -> Result<Option<T>, TuningError> {
        let read = |value| meant(value).ok_or_else(|| TuningError::new(key, expected, value));
        self.values.get(key).map(read).transpose()
    }

    /// A number, or a list of them.
    ///
    /// # Errors
    /// Anything else.
    pub fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>, TuningError> {
        self.values
            .get(key)
            .map(|value| numbers(key, value))
            .transpose()
    }

    /// A positive number for all of `count` chains, or a list of one per chain.
    ///
    /// # Errors
    /// Numbers that are not positive and finite, lists of another length.
    pub fn positive_per_chain(
        &self,
        key: &str,
        count: usize,
    ) -> Result<Option<Vec<f64>>, TuningError> {
        let Some(found) = self.numbers(key)? else {
            return Ok(None);
        };
        if let Some(wrong) = found.iter().find(|x| !(**x > 0.0 && x.is_finite())) {
            return Err(TuningError::new(key, "positive numbers", wrong));
        }
        match found[..] {
            [one] => Ok(Some(vec![one; count])),
            _ if found.len() == count => Ok(Some(found)),
            _ => Err(TuningError::new(
                key,
                format!("one number, or one per measured output ({count})"),
                format!("{} numbers", found.len()),
            )),
        }
    }

    /// A positive number.
    ///
    /// # Errors
    /// Anything else.
    pub fn positive(&self, key: &str) -> Result<Option<f64>, TuningError> {
        self.read(key, "a positive number", |value| {
            value.number().filter(|x| *x > 0.0 && x.is_finite())
        })
    }

    /// true or false; false if the key is absent.
    ///
    /// # Errors
    /// Anything else.
    pub fn flag(&self, key: &str) -> Result<bool, TuningError> {
        let found = self.read(key, "true or false", |value| match value {
            Value::Flag(flag) => Some(*flag),
            _ => None,
        });
        Ok(found?.unwrap_or(false))
    }

    /// One of some words.
    ///
    /// # Errors
    /// Anything else.
    pub fn choice(&self, key: &str, words: &[&str]) -> Result<Option<String>, TuningError> {
        let expected: Vec<String> = words.iter().map(|w| format!("\"{w}\"")).collect();
        self.read(key, &expected.join(" or "), |value| {
            value.text().filter(|text| words.contains(&text.as_str()))
        })
    }

    /// What the word under a key stands for; `meanings` are those of its allowed words, in their order.
    pub(crate) fn meant<T, const N: usize>(
        &self,
        key: &KeySpec,
        meanings: [T; N],
    ) -> Result<Option<T>, TuningError> {
        let Shape::Word(words) = key.shape.plain() else {
            return Ok(None);
        };
        let found = self.choice(key.name, words)?;
        let place = found.and_then(|found| words.iter().position(|word| *word == found));
        Ok(place.and_then(|place| meanings.into_iter().nth(place)))
    }

    /// Lists of names.
    ///
    /// # Errors
    /// Anything else.
    pub fn name_lists(&self, key: &str) -> Result<Option<Vec<Vec<String>>>, TuningError> {
        self.read(key, "a list of lists of state names", |value| {
            value.all(|names| names.all(Value::text))
        })
    }

    /// A list of names.
    ///
    /// # Errors
    /// Anything else.
    pub fn names(&self, key: &str) -> Result<Option<Vec<String>>, TuningError> {
        self.read(key, "a list of names", |value| value.all(Value::text))
    }
}

/// A number, or a list of them.
pub(crate) fn numbers(key: &str, value: &Value) -> Result<Vec<f64>, TuningError> {
    let number = |value: &Value| match value {
        Value::Number(x) => Ok(*x),
        other => Err(TuningError::new(key, "a number", other)),
    };
    match value {
        Value::List(values) => values.iter().map(number).collect(),
        one => Ok(vec![number(one)?]),
    }
}

/// A key: everything that messages, documentation and editors say of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeySpec {
    /// the key
    pub name: &'static str,
    /// what may stand there
    pub shape: Shape,
    /// what holds where it is absent
    pub default: &'static str,
    /// what it does
    pub meaning: &'static str,
}

/// What may stand under a key, as far as it does not depend on the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// any finite number
    Number,
    /// a number > 0
    Positive,
    /// a number ≥ 0
    NotNegative,
    /// a number in (0, 1)
    Share,
    /// a number in [least, most]
    Between {
        /// the least
        least: f64,
        /// the most
        most: f64,
    },
    /// one of these whole numbers
    OneOf(&'static [u32]),
    /// a whole number of at least this
    Whole(u32),
    /// true or false
    Flag,
    /// any text
    Text,
    /// one of these texts
    Word(&'static [&'static str]),
    /// a list
    List(&'static Shape),
    /// values of one shape under names of the plant
    Table(&'static Shape),
    /// values under keys of their own, in groups; those that are [`REQUIRED`] have to be there
    Section(&'static [&'static [KeySpec]]),
    /// one of several shapes
    Either(&'static [Shape]),
    /// a shape that documentation and messages call by these words
    As(&'static str, &'static Shape),
}

impl Shape {
    /// A number > 0, or one per chain or output.
    pub const POSITIVES: Self = Self::As(
        "number > 0, or one per chain",
        &Self::Either(&[Self::Positive, Self::List(&Self::Positive)]),
    );
    /// A list of names.
    pub const NAMES: Self = Self::As("list of names", &Self::List(&Self::Text));
    /// A list of lists of numbers.
    pub const ROWS: Self = Self::List(&Self::List(&Self::Number));

    /// The words of a key of this shape.
    fn words(&self) -> String {
        match self {
            Self::Number => "number".to_owned(),
            Self::Positive => "number > 0".to_owned(),
            Self::NotNegative => "number ≥ 0".to_owned(),
            Self::Share => "number between 0 and 1".to_owned(),
            Self::Between { least, most } => format!("number in [{least:?}, {most:?}]"),
            Self::OneOf(numbers) => {
                let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
                numbers.join(", ")
            }
            Self::Whole(least) => format!("whole number ≥ {least}"),
            Self::Flag => "true, false".to_owned(),
            Self::Text => "text".to_owned(),
            Self::Word(words) => {
                let words: Vec<String> = words.iter().map(|w| format!("`\"{w}\"`")).collect();
                words.join(", ")
            }
            Self::List(entry) => format!("list: {}", entry.words()),
            Self::Table(value) => format!("table: name = {}", value.words()),
            Self::Section(_) => "table".to_owned(),
            Self::Either(shapes) => {
                let shapes: Vec<String> = shapes.iter().map(Self::words).collect();
                shapes.join(", or ")
            }
            Self::As(words, _) => (*words).to_owned(),
        }
    }

    /// The shape without the words for it.
    pub(crate) fn plain(&self) -> &Self {
        match self {
            Self::As(_, shape) => shape.plain(),
            plain => plain,
        }
    }
}

/// The default of a key that has none.
pub const REQUIRED: &str = "required";

impl KeySpec {
    /// What may stand there, in words.
    #[must_use]
    pub fn kind(&self) -> String {
        self.shape.words()
    }

    /// The error that `found` stands under this key.
    pub fn wrong(&self, found: impl ToString) -> TuningError {
        TuningError::new(self.name, self.kind(), found)
    }

    /// The key as a row of a table of keys.
    #[must_use]
    pub fn row(&self) -> String {
        let Self {
            name,
            default,
            meaning,
            ..
        } = self;
        let kind = self.kind();
        format!("| `{name}` | {kind} | {default} | {meaning} |")
    }
}

/// Whether a name is that of a variable, or of the array it is an element of.
pub(crate) fn is_or_has(name: &str, variable: &str) -> bool {
    let element = variable.strip_prefix(name);
    element.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
}
