//! Positions in a source text, and problems found at them.

/// A range of bytes of the source text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Span {
    /// first byte
    pub start: u32,
    /// one past the last byte
    pub end: u32,
}

impl Span {
    pub(crate) fn new(start: usize, end: usize) -> Self {
        Self {
            start: u32::try_from(start).unwrap_or(u32::MAX),
            end: u32::try_from(end).unwrap_or(u32::MAX),
        }
    }

    /// From the start of this span to the end of the other.
    pub(crate) fn to(self, other: Span) -> Self {
        Self {
            start: self.start,
            end: other.end.max(self.start),
        }
    }

    /// The text of the span; empty where it does not fit the text.
    pub(crate) fn text(self, source: &str) -> &str {
        source
            .get(self.start as usize..self.end as usize)
            .unwrap_or_default()
    }

    /// The line on which the span starts, from 1.
    pub(crate) fn line(self, source: &str) -> usize {
        let before = source.as_bytes().iter().take(self.start as usize);
        1 + before.filter(|&&byte| byte == b'\n').count()
    }
}

/// What is wrong and where, before it is tied to a file. Boxed, so that the results of the
/// recursive parts of the reader stay small.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Problem(Box<Details>);

/// The parts of a [`Problem`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Details {
    pub span: Span,
    pub message: String,
    pub label: Option<String>,
    pub hint: Option<String>,
}

pub(crate) type Result<T> = std::result::Result<T, Problem>;

impl Problem {
    pub(crate) fn new(span: Span, message: impl Into<String>) -> Self {
        let message = message.into();
        Self(Box::new(Details {
            span,
            message,
            label: None,
            hint: None,
        }))
    }

    /// Text beside the caret.
    pub(crate) fn label(mut self, label: impl Into<String>) -> Self {
        self.0.label = Some(label.into());
        self
    }

    /// What to do about it.
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.0.hint = Some(hint.into());
        self
    }

    /// A hint where there is one.
    pub(crate) fn maybe_hint(mut self, hint: Option<String>) -> Self {
        self.0.hint = hint;
        self
    }

    pub(crate) fn into_details(self) -> Details {
        *self.0
    }
}
