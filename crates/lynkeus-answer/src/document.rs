//! What an answer tells, written once: as a text for a terminal, and as HTML for pages and notebooks.

mod html;
mod table;
mod text;

use std::fmt;

pub use html::escaped;
pub use table::{Cell, Table};

/// A title, and what follows it, part by part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    title: Option<Line>,
    parts: Vec<Part>,
}

/// What stands together, under a heading if it has one.
#[derive(Clone, Debug, Default, PartialEq)]
struct Part {
    heading: Option<Line>,
    /// HTML shows it on request
    is_folded: bool,
    blocks: Vec<Block>,
}

#[derive(Clone, Debug, PartialEq)]
enum Block {
    Line(Line),
    Items(Vec<Line>),
    Notes(Vec<String>),
    Conditions(Vec<Condition>, String),
    Table(Table),
    Code(String),
}

/// Words, some of which are a verdict.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line(Vec<Span>);

#[derive(Clone, Debug, PartialEq)]
enum Span {
    Text(String),
    Verdict(String),
}

/// Something that was decided.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// `proved`, `refuted` or `undecided`
    pub verdict: &'static str,
    /// what was asked
    pub statement: String,
    /// what decides it
    pub detail: String,
    /// where it fails
    pub witness: Option<String>,
}

impl Line {
    /// A verdict.
    pub fn verdict(word: impl Into<String>) -> Self {
        Self::default().decided(word)
    }

    /// With more words.
    #[must_use]
    pub fn and(mut self, text: impl Into<String>) -> Self {
        self.0.push(Span::Text(text.into()));
        self
    }

    /// With a verdict.
    #[must_use]
    pub fn decided(mut self, word: impl Into<String>) -> Self {
        self.0.push(Span::Verdict(word.into()));
        self
    }

    /// With what another line says.
    #[must_use]
    pub fn then(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }
}

impl<T: Into<String>> From<T> for Line {
    fn from(text: T) -> Self {
        Self::default().and(text)
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut spans = self.0.iter();
        spans.try_for_each(|span| match span {
            Span::Text(text) | Span::Verdict(text) => f.write_str(text),
        })
    }
}

impl Document {
    /// With a first line.
    pub fn new(title: impl Into<Line>) -> Self {
        Self {
            title: Some(title.into()),
            parts: vec![],
        }
    }

    /// Begins a part.
    pub fn part(&mut self) -> &mut Self {
        // the first one follows the title, and begins with it
        if self.parts.is_empty() {
            self.parts.push(Part::default());
        }
        self.parts.push(Part::default());
        self
    }

    /// Begins a part with a heading.
    pub fn heading(&mut self, heading: impl Into<Line>) -> &mut Self {
        self.part();
        self.last().heading = Some(heading.into());
        self
    }

    /// Begins a part with a heading, which HTML shows on request.
    pub fn folded(&mut self, heading: impl Into<Line>) -> &mut Self {
        self.heading(heading);
        self.last().is_folded = true;
        self
    }

    /// A line of its own.
    pub fn line(&mut self, line: impl Into<Line>) -> &mut Self {
        self.last().blocks.push(Block::Line(line.into()));
        self
    }

    /// Something that belongs to the line above it.
    pub fn item(&mut self, line: impl Into<Line>) -> &mut Self {
        let line = line.into();
        match self.last().blocks.last_mut() {
            Some(Block::Items(items)) => items.push(line),
            _ => self.last().blocks.push(Block::Items(vec![line])),
        }
        self
    }

    /// Several of these.
    pub fn items<T: Into<Line>>(&mut self, lines: impl IntoIterator<Item = T>) -> &mut Self {
        for line in lines {
            self.item(line);
        }
        self
    }

    /// What the reader should know.
    pub fn notes<T: Into<String>>(&mut self, notes: impl IntoIterator<Item = T>) -> &mut Self {
        let mut notes: Vec<String> = notes.into_iter().map(Into::into).collect();
        match self.last().blocks.last_mut() {
            Some(Block::Notes(known)) => known.append(&mut notes),
            _ if notes.is_empty() => {}
            _ => self.last().blocks.push(Block::Notes(notes)),
        }
        self
    }

    /// Conditions one by one; a text counts the proved ones as `what` where they are many.
    pub fn conditions(
        &mut self,
        conditions: impl IntoIterator<Item = Condition>,
        what: &str,
    ) -> &mut Self {
        let conditions: Vec<Condition> = conditions.into_iter().collect();
        if !conditions.is_empty() {
            let block = Block::Conditions(conditions, what.to_owned());
            self.last().blocks.push(block);
        }
        self
    }

    /// A table; nothing where it has no rows.
    pub fn table(&mut self, table: Table) -> &mut Self {
        if !table.is_empty() {
            self.last().blocks.push(Block::Table(table));
        }
        self
    }

    /// Lines as they are, to be copied.
    pub fn code(&mut self, text: impl Into<String>) -> &mut Self {
        self.last().blocks.push(Block::Code(text.into()));
        self
    }

    /// Adds the parts of another one.
    pub fn append(&mut self, other: Self) -> &mut Self {
        if let Some(title) = other.title {
            self.heading(title);
        }
        let parts = other.parts.into_iter().filter(|part| !part.is_empty());
        self.parts.extend(parts);
        self
    }

    fn last(&mut self) -> &mut Part {
        if self.parts.is_empty() {
            self.parts.push(Part::default());
        }
        let last = self.parts.len() - 1;
        &mut self.parts[last]
    }
}

impl Part {
    fn is_empty(&self) -> bool {
        self.heading.is_none() && self.blocks.is_empty()
    }
}

/// What a verdict's colour says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tone {
    Yes,
    No,
    Open,
}

impl Tone {
    fn of(verdict: &str) -> Self {
        match verdict {
            "proved" | "proved inside the box" | "fits" | "credible" => Self::Yes,
            "refuted" | "does not fit" | "not credible" => Self::No,
            _ => Self::Open,
        }
    }
}

#[cfg(test)]
mod tests;
