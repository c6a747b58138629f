//! The one error type of this crate: what was expected, what was found, where, and what to do.

use std::fmt;
use std::panic::Location;
use std::sync::Arc;

use crate::visible;

/// What kind of answer an [`Error`] is; the command's exit code follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The input is at fault: a file, a key, a column, an option.
    Input,
    /// The input is fine and the answer is no: a condition is refuted, an estimate diverges.
    Refused,
    /// A limit of time or memory ended the work before there was an answer.
    Ended,
}

/// Why there is no result.
///
/// Its text is one line (several when it quotes a Modelica source line under its message):
/// the place, what is wrong, what was expected, and what to do. Control characters of names in it
/// are [spelled out](visible).
#[derive(Clone, Debug)]
pub struct Error {
    kind: ErrorKind,
    place: Option<String>,
    message: String,
    hint: Option<String>,
    source: Option<Arc<dyn std::error::Error + Send + Sync>>,
    origin: &'static Location<'static>,
}

impl Error {
    /// An error in what the user gave.
    #[track_caller]
    pub fn input(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Input, message.into())
    }

    /// A well-posed question whose answer is no.
    #[track_caller]
    pub fn refused(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Refused, message.into())
    }

    /// What ended the work before there was an answer: a limit, or else a refusal.
    #[track_caller]
    pub fn ended(spent: lynkeus_expr::Spent) -> Self {
        let kind = match spent.is_limit() {
            true => ErrorKind::Ended,
            false => ErrorKind::Refused,
        };
        Self::new(kind, format!("undecided: {spent}")).caused_by(spent)
    }

    /// An error in what the user gave, in the words of the error that tells it; that error
    /// is the [source](std::error::Error::source).
    #[track_caller]
    pub fn from_source(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::input(source.to_string()).caused_by(source)
    }

    #[track_caller]
    fn new(kind: ErrorKind, message: String) -> Self {
        Self {
            kind,
            place: None,
            message,
            hint: None,
            source: None,
            origin: Location::caller(),
        }
    }

    /// The same as an answer of no, where the rest of the work was done.
    #[must_use]
    pub fn as_refusal(mut self) -> Self {
        self.kind = ErrorKind::Refused;
        self
    }

    /// The same where a limit ended the work, and what was done before is there.
    #[must_use]
    pub fn as_ended(mut self) -> Self {
        self.kind = ErrorKind::Ended;
        self
    }

    /// Keeps the error that it comes from.
    #[must_use]
    pub fn caused_by(mut self, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        self.source = Some(Arc::new(source));
        self
    }

    /// Adds where it happened: a file, or `file:line:column`.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.place = Some(place.to_string());
        self
    }

    /// Adds what the user can do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Whether the input is at fault or the answer is no.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The place, when one is known.
    pub fn place(&self) -> Option<&str> {
        self.place.as_deref()
    }

    /// What is wrong, without place and hint.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// What the message is about, as the reference of messages has it: see [`code`].
    pub fn code(&self) -> String {
        code(self.origin)
    }

    /// What to do about it, when something is known.
    pub fn remedy(&self) -> Option<&str> {
        self.hint.as_deref()
    }
}

/// The code of a message that the sources have there: `study/sensors` for `lynkeus-study/src/sensors.rs`. A file is one
/// subject, so its messages are about one.
pub fn code(origin: &Location<'_>) -> String {
    let path = origin.file().replace('\\', "/");
    let (before, file) = path.rsplit_once("/src/").unwrap_or(("", &path));
    let before = before.rsplit('/').next().unwrap_or_default();
    // a package has its version behind its name
    let name = match before.rsplit_once('-') {
        Some((name, version)) if version.starts_with(|c: char| c.is_ascii_digit()) => name,
        _ => before,
    };
    let name = name.strip_prefix("lynkeus-").unwrap_or(name);
    let file = file.strip_suffix(".rs").unwrap_or(file);
    let file = file.strip_suffix("/mod").unwrap_or(file);
    format!("{name}/{file}")
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{}: ", visible::line(place))?;
        }
        f.write_str(&visible::lines(&self.message))?;
        match &self.hint {
            Some(hint) => write!(f, "; {}", visible::lines(hint)),
            None => Ok(()),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        let source = self.source.as_deref()?;
        Some(source)
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error as _;

    use lynkeus_expr::MissingInput;

    use super::*;

    #[test]
    fn a_code_names_the_subject() {
        assert_eq!(Error::input("no").hint("yes").code(), "answer/error");
        let made = |text: &str| Error::input(text);
        assert_eq!(made("no").code(), "answer/error");
    }

    #[test]
    fn the_source_is_kept_through_place_and_hint() {
        let name = "pump".to_owned();
        let error = Error::from_source(MissingInput { name })
            .at("s.toml:3")
            .hint("name it");
        let text = error.to_string();
        assert!(
            text.starts_with("s.toml:3: the expression depends on 'pump'"),
            "{text}"
        );
        let source = error
            .source()
            .and_then(|s| s.downcast_ref::<MissingInput>());
        assert_eq!(source.map(|s| s.name.as_str()), Some("pump"));
        assert!(Error::input("no").source().is_none());
    }
}
