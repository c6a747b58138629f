//! The pieces of a page around its documents.

pub(super) use lynkeus_answer::document::escaped;

use crate::Error;

/// An element with a text; `tag` with its attributes.
pub(super) fn element(tag: &str, text: &str) -> String {
    let name = tag.split(' ').next().unwrap_or(tag);
    format!("<{tag}>{}</{name}>\n", escaped(text))
}

/// A section under a heading.
pub(super) fn section(id: &str, heading: &str, inside: &str) -> String {
    let heading = element("h2", heading);
    format!("<section id=\"{id}\">\n{heading}{inside}</section>\n")
}

/// What happened and what to do, without where: a page goes to others, and no folder of this machine with it.
pub(super) fn words(error: &Error) -> String {
    let remedy = error.remedy().map(|remedy| format!("; {remedy}"));
    format!("{}{}", error.message(), remedy.unwrap_or_default())
}
