//! Positions in a source text, problems found at them, and the refusals that users read.

use std::fmt;
use std::panic::Location;
use std::path::PathBuf;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

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
    pub origin: &'static Location<'static>,
}

pub(crate) type Result<T> = std::result::Result<T, Problem>;

impl Problem {
    #[track_caller]
    pub(crate) fn new(span: Span, message: impl Into<String>) -> Self {
        Self(Box::new(Details {
            span,
            message: message.into(),
            label: None,
            hint: None,
            origin: Location::caller(),
        }))
    }

    /// Text beside the caret.
    pub(crate) fn label(mut self, label: impl Into<String>) -> Self {
        self.0.label = Some(label.into());
        self
    }

    /// What to do about it.
    pub(crate) fn hint(self, hint: impl Into<String>) -> Self {
        self.maybe_hint(Some(hint))
    }

    /// A hint where there is one.
    pub(crate) fn maybe_hint(mut self, hint: Option<impl Into<String>>) -> Self {
        self.0.hint = hint.map(Into::into);
        self
    }

    /// A hint where there is none yet.
    pub(crate) fn or_hint(mut self, hint: impl Into<String>) -> Self {
        self.0.hint.get_or_insert_with(|| hint.into());
        self
    }

    pub(crate) fn into_details(self) -> Details {
        *self.0
    }
}

/// Longest stretch of a line that is shown on each side of the caret, in bytes.
const WINDOW: usize = 90;

/// Why a text was refused, and where.
///
/// `Display` renders it as a compiler does, with the source line and a caret;
/// [`Diagnostic::one_line`] is the short form.
///
/// ```
/// use lynkeus_model::{LoadOptions, Plant};
///
/// let text = "model M\n  Real level;\nequation\n  der(level) = -levle;\nend M;\n";
/// let refused = Plant::from_modelica(text, "m.mo", &LoadOptions::default()).unwrap_err();
/// assert_eq!((refused.line, refused.column), (4, 17));
/// assert_eq!(refused.one_line(), "m.mo:4:17: unknown name `levle` (did you mean `level`?)");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// the file, as given by the caller
    pub file: String,
    /// line, from 1
    pub line: u32,
    /// column in characters, from 1
    pub column: u32,
    /// bytes of the source text
    pub span: Span,
    /// what was expected and what was found
    pub message: String,
    /// text beside the caret
    pub label: Option<String>,
    /// what to do
    pub hint: Option<String>,
    excerpt: Box<Excerpt>,
}

/// The part of the source line that is shown.
#[derive(Clone, Debug, PartialEq)]
struct Excerpt {
    text: String,
    /// bytes of `text` under the caret
    marked: std::ops::Range<usize>,
    /// true where the line is longer than `text`
    cut: bool,
    /// told as a warning
    is_warning: bool,
    /// where the sources have the message
    origin: &'static Location<'static>,
}

impl Diagnostic {
    pub(crate) fn new(problem: Problem, file: &str, source: &str) -> Self {
        let problem = problem.into_details();
        let start = source.floor_char_boundary(problem.span.start as usize);
        let end = source.floor_char_boundary(problem.span.end as usize);
        let line_start = source[..start].rfind('\n').map_or(0, |i| i + 1);
        let rest = source[start..].find('\n');
        let line_end = rest.map_or(source.len(), |length| start + length);
        let line = problem.span.line(source);
        let column = 1 + source[line_start..start].chars().count();
        Self {
            file: file.to_owned(),
            line: u32::try_from(line).unwrap_or(u32::MAX),
            column: u32::try_from(column).unwrap_or(u32::MAX),
            span: problem.span,
            message: problem.message,
            label: problem.label,
            hint: problem.hint,
            excerpt: Box::new(Excerpt::new(
                source,
                line_start..line_end,
                start..end.max(start),
                problem.origin,
            )),
        }
    }

    /// What looks wrong but is taken.
    pub(crate) fn warning(problem: Problem, file: &str, source: &str) -> Self {
        let mut warning = Self::new(problem, file, source);
        warning.excerpt.is_warning = true;
        warning
    }

    /// Where the sources have the message.
    pub fn origin(&self) -> &'static Location<'static> {
        self.excerpt.origin
    }

    /// `file:line:column: message (hint)` on one line.
    pub fn one_line(&self) -> String {
        let hint = self.hint.as_deref().map(|hint| format!(" ({hint})"));
        let Self {
            file,
            line,
            column,
            message,
            ..
        } = self;
        let hint = hint.unwrap_or_default();
        let text = format!("{file}:{line}:{column}: {message}{hint}");
        text.replace('\n', " ")
    }

    fn render(&self) -> String {
        let marked = AnnotationKind::Primary
            .span(self.excerpt.marked.clone())
            .label(self.label.as_deref());
        let snippet = Snippet::source(self.excerpt.text.as_str())
            .line_start(self.line as usize)
            .annotation(marked);
        let level = match self.excerpt.is_warning {
            true => Level::WARNING,
            false => Level::ERROR,
        };
        let title = level.primary_title(self.message.as_str());
        let group = if self.excerpt.cut {
            let origin = Origin::path(self.file.as_str())
                .line(self.line as usize)
                .char_column(self.column as usize);
            title.element(origin).element(snippet)
        } else {
            title.element(snippet.path(self.file.as_str()))
        };
        let hint = self.hint.as_deref();
        let hint = hint.map(|hint| Group::with_title(Level::HELP.secondary_title(hint)));
        let report: Vec<Group<'_>> = std::iter::once(group).chain(hint).collect();
        Renderer::plain().render(&report)
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render())
    }
}

impl std::error::Error for Diagnostic {}

impl Excerpt {
    /// The line, or a window of it around the marked bytes where it is long.
    fn new(
        source: &str,
        line: std::ops::Range<usize>,
        marked: std::ops::Range<usize>,
        origin: &'static Location<'static>,
    ) -> Self {
        let marked_end = marked.end.min(line.end).min(marked.start + WINDOW);
        let from = source.floor_char_boundary(marked.start.saturating_sub(WINDOW).max(line.start));
        let to = source.floor_char_boundary((marked_end + WINDOW).min(line.end));
        let marked_end = source.floor_char_boundary(marked_end).max(marked.start);
        Self {
            // A carriage return would move the caret; it takes one byte, as a space does.
            text: source[from..to].replace('\r', " "),
            marked: marked.start - from..marked_end - from,
            cut: from > line.start || to < line.end,
            is_warning: false,
            origin,
        }
    }
}

/// Why a model file could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// the file
        path: PathBuf,
        /// the system's reason
        source: std::io::Error,
    },
    /// The file is too large to be a model.
    #[error("{} has {bytes} bytes; a model file may have at most {limit}", path.display())]
    TooLarge {
        /// the file
        path: PathBuf,
        /// its size
        bytes: u64,
        /// the largest size taken
        limit: u64,
    },
    /// The file is not UTF-8 text.
    #[error("{}:{line}: byte {offset} is not UTF-8 text; save the file as UTF-8", path.display())]
    NotUtf8 {
        /// the file
        path: PathBuf,
        /// line of the first wrong byte, from 1
        line: usize,
        /// its position in the file, from 0
        offset: usize,
    },
    /// The text is not a model this tool can take.
    #[error(transparent)]
    Refused(#[from] Diagnostic),
}
