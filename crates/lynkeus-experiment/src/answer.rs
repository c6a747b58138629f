//! What every command answers: told once, for people, for programs and as a picture.

use lynkeus_answer::Document;
use lynkeus_answer::document::Line;
#[cfg(feature = "plot")]
use lynkeus_plot::Figure;
use lynkeus_table::Instant;
use serde_json::{Map, Value};

use crate::course::corrections::Corrections;
use crate::{Error, Series};

/// What stands for zero where times are dates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// the first of them
    pub instant: Instant,
    /// seconds of the unit in which the others count from it
    pub unit: f64,
}

/// An answer of a command.
pub trait Answer: Send {
    /// What is told, as the command prints it.
    fn document(&self) -> Document;

    /// What it holds, by the names of its report.
    fn entries(&self) -> Value;

    /// For programs, as the command's `--json`: the version that answers, then the entries.
    fn to_json(&self) -> Value {
        let mut object = Map::from_iter([("lynkeus".to_owned(), env!("CARGO_PKG_VERSION").into())]);
        match self.entries() {
            Value::Object(entries) => object.extend(entries),
            other => return other,
        }
        object.into()
    }

    /// Its columns under their headers.
    fn columns(&self) -> Vec<(String, Series)> {
        vec![]
    }

    /// Its picture, where it has one.
    ///
    /// # Errors
    /// There is nothing to be drawn.
    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        Ok(None)
    }

    /// The panels of its picture, where that is one over time.
    ///
    /// # Errors
    /// There is nothing to be drawn.
    #[cfg(feature = "plot")]
    fn panels(&self) -> Result<Option<Figure>, Error> {
        Ok(None)
    }

    /// What a filter's corrections are made of, where it was kept.
    fn corrections(&self) -> Option<&Corrections> {
        None
    }

    /// What stands for zero where its times are dates.
    fn origin(&self) -> Option<Origin> {
        None
    }

    /// What speaks against it although it is there.
    fn refusal(&self) -> Option<Error> {
        None
    }

    /// Whether it is yes: nothing speaks against it, or what was asked holds.
    fn is_positive(&self) -> bool {
        self.refusal().is_none()
    }

    /// What of a log contradicts itself, or counts nowhere.
    fn warnings(&self) -> &[String] {
        &[]
    }

    /// What the user should know, where its text does not say it.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// What a logger would have seen, in its columns.
    ///
    /// # Errors
    /// The study gives two of them the same header.
    fn log(&self) -> Result<Vec<(String, Series)>, Error> {
        Ok(vec![])
    }

    /// In words.
    fn text(&self) -> String {
        self.document().to_text()
    }

    /// As a part of a page, with what speaks against it and what the user should know.
    fn html(&self) -> String {
        let mut document = self.document();
        document
            .part()
            .notes(self.warnings().iter().chain(self.notes()));
        let said = |refusal: &Error| document.to_text().contains(&refusal.to_string());
        let refusal = self.refusal().filter(|refusal| !said(refusal));
        let refusal = refusal.map_or(String::new(), |refusal| {
            let line = Line::verdict("not credible").and(format!(": {refusal}"));
            format!("<p>{}</p>\n", line.to_html())
        });
        refusal + &document.to_html()
    }
}

/// The words of an answer are its text.
#[macro_export]
macro_rules! displayed {
    ($answer:ty) => {
        impl std::fmt::Display for $answer {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(&$crate::Answer::text(self))
            }
        }
    };
}
