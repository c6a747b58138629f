//! Documents as text.

use super::{Block, Cell, Condition, Document, Part, Table};
use crate::visible;

/// What belongs to a line or a heading stands so far in.
const INDENT: &str = "  ";

/// Conditions listed one by one: more proved ones than this become a count.
const LISTED: usize = 12;

/// Characters of a formula.
const FORMULA: usize = 90;

impl Document {
    /// As a terminal shows it: names in it are [safe](visible).
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = Text::default();
        if let Some(title) = &self.title {
            text.line("", &title.to_string());
        }
        for (place, part) in self.parts.iter().enumerate().filter(|(_, p)| !p.is_empty()) {
            if place > 0 && !text.0.is_empty() {
                text.line("", "");
            }
            text.part(part);
        }
        visible::lines(&text.0).into_owned()
    }
}

#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, indent: &str, words: &str) {
        let line = [indent, words].concat();
        self.0.push_str(line.trim_end());
        self.0.push('\n');
    }

    fn part(&mut self, part: &Part) {
        if let Some(heading) = &part.heading {
            self.line("", &heading.to_string());
        }
        let indent = if part.heading.is_some() { INDENT } else { "" };
        for block in &part.blocks {
            match block {
                Block::Line(line) => self.line("", &line.to_string()),
                Block::Items(items) => {
                    items
                        .iter()
                        .for_each(|item| self.line(INDENT, &item.to_string()));
                }
                Block::Notes(notes) => {
                    notes
                        .iter()
                        .for_each(|note| self.line(indent, &format!("note: {note}")));
                }
                Block::Conditions(conditions, what) => self.conditions(conditions, what),
                Block::Table(table) => self.table(table, indent),
                Block::Code(text) => text.lines().for_each(|line| self.line("", line)),
            }
        }
    }

    /// One condition a line, the proved ones counted where they are many.
    fn conditions(&mut self, conditions: &[Condition], what: &str) {
        let is_proved = |condition: &&Condition| condition.verdict == "proved";
        let count = conditions.iter().filter(is_proved).count();
        let is_brief = count > LISTED;
        if is_brief {
            self.line(INDENT, &format!("{:<10} {count} {what}", "proved"));
        }
        for condition in conditions.iter().filter(|c| !(is_brief && is_proved(c))) {
            let Condition {
                verdict,
                statement,
                detail,
                witness,
            } = condition;
            self.line(INDENT, &format!("{verdict:<10} {statement}: {detail}"));
            if let Some(witness) = witness {
                self.line(INDENT, &format!("{:<10} {witness}", ""));
            }
        }
    }

    fn table(&mut self, table: &Table, indent: &str) {
        let (most, others) = table.most.unwrap_or((usize::MAX, ""));
        let titles = table.titles.iter().map(|title| Cell::from(title.as_str()));
        let titles = (!table.is_plain).then(|| titles.collect::<Vec<Cell>>());
        let shown = table.rows.iter().take(most);
        let lines: Vec<&Vec<Cell>> = titles.iter().chain(shown).collect();
        let columns = table.titles.len();
        let width = |place: usize| {
            let is_own = |row: &&&Vec<Cell>| row.len() == columns || place + 1 < row.len();
            let cells = lines.iter().filter(is_own).filter_map(|row| row.get(place));
            cells.map(|cell| shown_as(cell).chars().count()).max()
        };
        let widths: Vec<usize> = (0..columns).map(|j| width(j).unwrap_or(0)).collect();
        for row in &lines {
            let cells = row
                .iter()
                .zip(&widths)
                .enumerate()
                .map(|(place, (cell, width))| {
                    let words = shown_as(cell);
                    let spans = place + 1 == row.len() && row.len() < columns;
                    match table.is_numeric(place) && !spans {
                        true => format!("{words:>width$}"),
                        false => format!("{words:<width$}"),
                    }
                });
            self.line(indent, &cells.collect::<Vec<_>>().join("  "));
        }
        let more = table.rows.len().saturating_sub(most);
        if more > 0 {
            self.line(indent, &format!("and {more} {others}"));
        }
    }
}

fn shown_as(cell: &Cell) -> String {
    match cell {
        Cell::Formula(text) if text.chars().count() > FORMULA => {
            let begin: String = text.chars().take(FORMULA).collect();
            format!("= {begin}…")
        }
        Cell::Formula(text) => format!("= {text}"),
        cell => cell.words().to_owned(),
    }
}
