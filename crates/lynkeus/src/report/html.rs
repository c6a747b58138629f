//! HTML, piece by piece; every text is escaped.

use crate::{Error, visible};

/// A text of HTML.
#[derive(Debug, Default)]
pub(super) struct Html(String);

/// A cell of a table.
#[derive(Clone, Debug)]
pub(super) enum Cell {
    Text(String),
    Number(String),
    /// `proved`, `refuted`, …
    Verdict(&'static str),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// Text as HTML shows it, in contents and in attributes.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in visible::lines(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

impl Html {
    pub fn text(self) -> String {
        self.0
    }

    /// What the program itself writes.
    pub fn raw(&mut self, html: &str) {
        self.0.push_str(html);
        self.0.push('\n');
    }

    /// An element with a text; `tag` with its attributes.
    pub fn element(&mut self, tag: &str, text: &str) {
        let name = tag.split(' ').next().unwrap_or(tag);
        self.raw(&format!("<{tag}>{}</{name}>", escaped(text)));
    }

    /// An element around others.
    pub fn within(&mut self, tag: &str, inside: impl FnOnce(&mut Self)) {
        let name = tag.split(' ').next().unwrap_or(tag);
        self.raw(&format!("<{tag}>"));
        inside(self);
        self.raw(&format!("</{name}>"));
    }

    /// What is shown on request.
    pub fn folded(&mut self, summary: &str, inside: impl FnOnce(&mut Self)) {
        self.within("details", |html| {
            html.element("summary", summary);
            inside(html);
        });
    }

    pub fn list<T: AsRef<str>>(&mut self, items: impl IntoIterator<Item = T>) {
        self.within("ul", |html| {
            items
                .into_iter()
                .for_each(|item| html.element("li", item.as_ref()));
        });
    }

    /// A table; nothing where it has no rows.
    pub fn table(&mut self, head: &[&str], rows: Vec<Vec<Cell>>) {
        if rows.is_empty() {
            return;
        }
        self.within("div class=\"wide\"", |html| {
            html.within("table", |html| {
                html.within("thead", |html| {
                    let cells = head
                        .iter()
                        .map(|h| format!("<th scope=\"col\">{}</th>", escaped(h)));
                    html.raw(&format!("<tr>{}</tr>", cells.collect::<String>()));
                });
                html.within("tbody", |html| {
                    for row in &rows {
                        let cells: String = row.iter().map(cell).collect();
                        html.raw(&format!("<tr>{cells}</tr>"));
                    }
                });
            });
        });
    }
}

fn cell(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => format!("<td>{}</td>", escaped(text)),
        Cell::Number(text) => format!("<td class=\"number\">{}</td>", escaped(text)),
        Cell::Verdict(word) => format!("<td>{}</td>", badge(word)),
    }
}

/// A verdict with its colour.
pub(super) fn badge(word: &str) -> String {
    let class = match word {
        "proved" | "fits" | "proved inside the box" => "yes",
        "refuted" | "does not fit" => "no",
        _ => "open",
    };
    format!("<span class=\"verdict {class}\">{}</span>", escaped(word))
}

/// What happened and what to do, without where: a page goes to others, and no folder of this machine with it.
pub(super) fn words(error: &Error) -> String {
    let remedy = error.remedy().map(|remedy| format!("; {remedy}"));
    format!("{}{}", error.message(), remedy.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_becomes_markup() {
        let mut html = Html::default();
        html.element(
            "p title=\"x\"",
            "</p><script>alert(\"1\" & '2')</script>\u{202e}",
        );
        assert_eq!(
            html.text(),
            "<p title=\"x\">&lt;/p&gt;&lt;script&gt;alert(&quot;1&quot; &amp; &#39;2&#39;)&lt;/script&gt;\\u{202e}</p>\n"
        );
    }
}
