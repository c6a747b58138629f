//! Where in the study file something stands.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use lynkeus_model::Variable;

/// A place in a study file: `file:line:column`, both counted from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: Arc<str>,
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// A name written in a study, with its place for messages about it.
///
/// Two names are equal when their texts are.
#[derive(Clone, Debug)]
pub struct Name {
    /// The name itself: `level`, `x[3]`.
    pub text: String,
    /// Where it was written; `None` for names made in Rust.
    pub place: Option<Place>,
}

impl Name {
    /// Whether it is the name of a variable, or of the array it is an element of.
    pub fn is_or_has(&self, variable: &str) -> bool {
        let element = variable.strip_prefix(self.text.as_str());
        element.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
    }

    /// What is said of a variable: by its own name, else by that of its array.
    pub fn best<'a, T>(said: &'a [(Name, T)], variable: &str) -> Option<&'a T> {
        let own = said.iter().find(|(name, _)| name.text == variable);
        let meant = own.or_else(|| said.iter().find(|(name, _)| name.is_or_has(variable)));
        meant.map(|(_, value)| value)
    }

    /// The variables that names mean, an array's name its elements; a name that means none stays, for the
    /// message about it.
    pub fn meant(names: &[Name], variables: &[Variable]) -> Vec<String> {
        let of = |name: &Name| {
            let meant = variables.iter().filter(|v| name.is_or_has(&v.name));
            let meant: Vec<String> = meant.map(|v| v.name.clone()).collect();
            if meant.is_empty() {
                vec![name.text.clone()]
            } else {
                meant
            }
        };
        names.iter().flat_map(of).collect()
    }

    /// Puts this name's place on an error about it.
    pub fn blame(&self, error: lynkeus_answer::Error) -> lynkeus_answer::Error {
        match &self.place {
            Some(place) => error.at(place),
            None => error,
        }
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self {
            text: text.to_owned(),
            place: None,
        }
    }
}

impl PartialEq for Name {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// The text of a study file.
pub(crate) struct Source<'a> {
    pub file: Arc<str>,
    pub text: &'a str,
}

impl Source<'_> {
    /// The place of the first character of `span`.
    pub fn place(&self, span: &Range<usize>) -> Place {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Place {
            file: Arc::clone(&self.file),
            line: before.matches('\n').count() + 1,
            column: before.get(line_start..).unwrap_or("").chars().count() + 1,
        }
    }
}
