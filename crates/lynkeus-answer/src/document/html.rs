//! Documents as HTML, every text escaped.

use super::{Block, Cell, Condition, Document, Line, Part, Span, Table, Tone};
use crate::visible;

/// Text as HTML shows it, in contents and in attributes.
#[must_use]
pub fn escaped(text: &str) -> String {
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

impl Document {
    /// As a part of a page: it needs neither style sheet nor script. A page that has a style sheet gives
    /// verdicts their colours by `--yes`, `--no` and `--open`.
    #[must_use]
    pub fn to_html(&self) -> String {
        let title = self.title.iter();
        let title = title.map(|title| format!("<p><b>{}</b></p>\n", title.to_html()));
        let parts = self.parts.iter().filter(|part| !part.is_empty());
        title.chain(parts.map(Part::to_html)).collect()
    }
}

impl Line {
    /// As contents of an element.
    #[must_use]
    pub fn to_html(&self) -> String {
        let spans = self.0.iter().map(|span| match span {
            Span::Text(text) => escaped(text),
            Span::Verdict(word) => verdict(word),
        });
        spans.collect()
    }
}

impl Part {
    fn to_html(&self) -> String {
        let blocks: String = self.blocks.iter().map(Block::to_html).collect();
        match &self.heading {
            None => blocks,
            Some(heading) if self.is_folded => format!(
                "<details><summary>{}</summary>\n{blocks}</details>\n",
                heading.to_html()
            ),
            Some(heading) => format!("<h3>{}</h3>\n{blocks}", heading.to_html()),
        }
    }
}

impl Block {
    fn to_html(&self) -> String {
        match self {
            Self::Line(line) => format!("<p>{}</p>\n", line.to_html()),
            Self::Items(items) => list(items.iter().map(Line::to_html)),
            Self::Notes(notes) => list(notes.iter().map(|note| escaped(note))),
            Self::Conditions(conditions, _) => {
                let titles = ["verdict", "condition", "what was found"];
                table(&Table::new(titles).with(conditions.iter().map(condition)))
            }
            Self::Table(own) => table(own),
            Self::Code(text) => format!("<pre>{}</pre>\n", escaped(text)),
        }
    }
}

fn list(items: impl Iterator<Item = String>) -> String {
    let items: String = items.map(|item| format!("<li>{item}</li>\n")).collect();
    format!("<ul>\n{items}</ul>\n")
}

fn condition(condition: &Condition) -> Vec<Cell> {
    let witness = condition.witness.iter().map(String::as_str);
    let found = std::iter::once(condition.detail.as_str()).chain(witness);
    vec![
        Cell::Verdict(condition.verdict.to_owned()),
        Cell::from(condition.statement.as_str()),
        Cell::from(found.collect::<Vec<_>>().join("; ")),
    ]
}

/// Where notebooks would align cells to the right.
const LEFT: &str = "style=\"text-align:left;vertical-align:top\"";
const RIGHT: &str = "class=\"number\" style=\"text-align:right;vertical-align:top\"";

fn table(table: &Table) -> String {
    let side = |place: usize| if table.is_numeric(place) { RIGHT } else { LEFT };
    let titles = table.titles.iter().enumerate();
    let titles: String = titles
        .map(|(place, title)| format!("<th scope=\"col\" {}>{}</th>", side(place), escaped(title)))
        .collect();
    let columns = table.titles.len();
    let row = |row: &Vec<Cell>| -> String {
        let cells = row.iter().enumerate().map(|(place, cell)| {
            let spanned = columns.saturating_sub(place);
            match place + 1 == row.len() && spanned > 1 {
                true => format!("<td colspan=\"{spanned}\" {LEFT}>{}</td>", contents(cell)),
                false => format!("<td {}>{}</td>", side(place), contents(cell)),
            }
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let rows: String = table.rows.iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{titles}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n"
    )
}

fn contents(cell: &Cell) -> String {
    match cell {
        Cell::Verdict(word) => verdict(word),
        Cell::Formula(text) => format!("<code>{}</code>", escaped(text)),
        cell => escaped(cell.words()),
    }
}

/// A verdict in its colour.
fn verdict(word: &str) -> String {
    let (class, colour) = match Tone::of(word) {
        Tone::Yes => ("yes", "#15803d"),
        Tone::No => ("no", "#b91c1c"),
        Tone::Open => ("open", "#a16207"),
    };
    format!(
        "<span class=\"verdict\" style=\"color:var(--{class},{colour});font-weight:600\">{}</span>",
        escaped(word)
    )
}
