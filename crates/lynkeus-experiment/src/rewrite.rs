//! The chosen values into the study file, of which everything else stays as it is.

use std::ops::Range;

use toml_edit::{Document, InlineTable, Item, Key, Table, TableLike, Value};

use crate::Error;

/// What editors of some systems put before a text.
const MARK: &str = "\u{feff}";

/// What was changed at a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The key as the sweep has it: `theta`, `theta[1]`.
    pub key: String,
    /// What stood there; none where the key is new.
    pub from: Option<String>,
    /// What stands there now.
    pub to: String,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.from {
            Some(from) if *from == self.to => write!(f, "{} stays {}", self.key, self.to),
            Some(from) => write!(f, "{}: {from} becomes {}", self.key, self.to),
            None => write!(f, "{} = {} is new", self.key, self.to),
        }
    }
}

/// A number of a study, and what becomes of it.
pub struct Assignment<'a> {
    /// what people call it
    pub key: String,
    /// names of the tables that it stands in, the outermost first
    pub tables: &'static [&'static str],
    /// its name in the last of them, and where within its value; without one it is all values of the table
    pub place: Option<(&'a str, &'a [usize])>,
    /// what is written for a number that stands there; none where it is new
    pub written: &'a dyn Fn(Option<f64>) -> String,
}

/// The study's text with other numbers, one after the other, and what changed. Only those numbers are touched: every
/// other byte stays, line ends and a byte order mark among them.
///
/// # Errors
/// `text` is not the study that is meant.
pub fn rewritten<'a>(
    text: &str,
    assignments: impl IntoIterator<Item = Assignment<'a>>,
) -> Result<(String, Vec<Change>), Error> {
    let (mark, mut text) = match text.strip_prefix(MARK) {
        Some(rest) => (MARK, rest.to_owned()),
        None => ("", text.to_owned()),
    };
    let mut changes = vec![];
    for assignment in assignments {
        let change;
        (text, change) = put(&text, &assignment)?;
        changes.push(change);
    }
    parsed(&text)?;
    Ok((format!("{mark}{text}"), changes))
}

fn parsed(text: &str) -> Result<Document<&str>, Error> {
    Document::parse(text).map_err(|e| Error::input(format!("not a TOML file: {e}")))
}

/// A piece of the text and what replaces it.
struct Edit {
    range: Range<usize>,
    by: String,
}

fn put(text: &str, own: &Assignment<'_>) -> Result<(String, Change), Error> {
    let document = parsed(text)?;
    let (found, missing) = innermost(document.as_item(), own.tables)?;
    let table = found.last().filter(|_| missing.is_empty());
    let table = table.and_then(|(_, item)| item.as_table_like());
    let gone = || {
        let section = own.tables.join(".");
        Error::input(format!("[{section}] no longer has `{}`", own.key))
    };
    let Some((key, path)) = own.place else {
        return scaled(text, table.ok_or_else(gone)?, own);
    };
    let Some(present) = table.and_then(|table| table.get(key)) else {
        let (text, to) = added(text, &found, missing, key, (own.written)(None))?;
        let change = Change {
            key: own.key.clone(),
            from: None,
            to,
        };
        return Ok((text, change));
    };
    let mut slot = present.as_value().ok_or_else(gone)?;
    for &index in path {
        let entries = slot.as_array().ok_or_else(gone)?;
        slot = entries.get(index).ok_or_else(gone)?;
    }
    let place = slot.span().ok_or_else(gone)?;
    let mut edits = vec![];
    scale(slot, own, &mut edits)?;
    let change = Change {
        key: own.key.clone(),
        from: text.get(place.clone()).map(str::to_owned),
        to: edited(text, place, &edits),
    };
    Ok((edited(text, 0..text.len(), &edits), change))
}

/// Tables with their names, the outermost first.
type Tables<'d> = Vec<(&'static str, &'d Item)>;

/// The tables of a document as far as they are there, and the names of the others.
fn innermost<'d>(
    document: &'d Item,
    names: &'static [&'static str],
) -> Result<(Tables<'d>, &'static [&'static str]), Error> {
    let mut found: Tables<'d> = vec![];
    for (depth, name) in names.iter().enumerate() {
        let within = found.last().map_or(document, |(_, item)| item);
        let table = within.as_table_like();
        let Some(item) = table.and_then(|table| table.get(name)) else {
            return Ok((found, names.get(depth..).unwrap_or_default()));
        };
        if item.as_table_like().is_none() {
            let whole = names.get(..=depth).unwrap_or_default().join(".");
            return Err(Error::input(format!("[{whole}] of the study is no table")));
        }
        found.push((name, item));
    }
    Ok((found, &[]))
}

/// The text with a new key in a table that may be new, and the value as it is written.
fn added(
    text: &str,
    found: &Tables<'_>,
    missing: &[&str],
    key: &str,
    to: String,
) -> Result<(String, String), Error> {
    let (end, key_of) = (line_end(text), Key::new(key));
    let own = key_of.display_repr();
    let Some((_, table)) = found.last() else {
        let section = missing.join(".");
        let text = format!("{text}{end}[{section}]{end}{own} = {to}{end}");
        return Ok((text, to));
    };
    let assignment = match missing {
        [] => format!("{own} = {to}"),
        missing => format!("{} = {{ {own} = {to} }}", missing.join(".")),
    };
    // names before a dot, up to the table with a header of its own
    let is_dotted = |(_, item): &&(&str, &Item)| match item {
        Item::Value(value) => value.as_inline_table().is_some_and(InlineTable::is_dotted),
        item => item.as_table().is_some_and(Table::is_dotted),
    };
    let dotted: Vec<&str> = found
        .iter()
        .rev()
        .take_while(is_dotted)
        .map(|t| t.0)
        .collect();
    let prefix: String = dotted.iter().rev().map(|name| format!("{name}.")).collect();
    let header: Vec<&str> = found.iter().map(|(name, _)| *name).collect();
    let edit = addition(text, table, &header.join("."), &prefix, &assignment)
        .ok_or_else(|| Error::input(format!("cannot see where `{key}` belongs")))?;
    Ok((edited(text, 0..text.len(), &[edit]), to))
}

/// Multiplies every number of a table.
fn scaled(
    text: &str,
    table: &dyn TableLike,
    own: &Assignment<'_>,
) -> Result<(String, Change), Error> {
    let (mut edits, mut from, mut to) = (vec![], vec![], vec![]);
    let mut values: Vec<(&str, &Value)> = table
        .iter()
        .filter_map(|(name, item)| Some((name, item.as_value()?)))
        .collect();
    values.sort_by_key(|(_, value)| value.span().map_or(0, |span| span.start));
    for (name, slot) in values {
        let mut parts = vec![];
        scale(slot, own, &mut parts)?;
        let place = slot.span().unwrap_or_default();
        let before = text.get(place.clone()).unwrap_or_default();
        from.push(format!("{name} = {before}"));
        to.push(format!("{name} = {}", edited(text, place, &parts)));
        edits.extend(parts);
    }
    let change = Change {
        key: own.key.clone(),
        from: Some(from.join(", ")),
        to: to.join(", "),
    };
    Ok((edited(text, 0..text.len(), &edits), change))
}

/// Replaces a number, or every number of a list.
fn scale(slot: &Value, own: &Assignment<'_>, edits: &mut Vec<Edit>) -> Result<(), Error> {
    if let Some(entries) = slot.as_array() {
        return entries.iter().try_for_each(|e| scale(e, own, edits));
    }
    if let Some(parts) = slot.as_inline_table() {
        // a conjugate pair of poles
        return parts.iter().try_for_each(|(_, e)| scale(e, own, edits));
    }
    if let (Some(share), Some(range)) = (slot.as_str().and_then(share), slot.span()) {
        let by = format!("\"{}%\"", (own.written)(Some(share)));
        edits.push(Edit { range, by });
        return Ok(());
    }
    let whole = slot.as_integer().map(|i| i as f64);
    let (Some(present), Some(range)) = (slot.as_float().or(whole), slot.span()) else {
        return Err(Error::input(format!("`{}` is no longer a number", own.key)));
    };
    let by = (own.written)(Some(present));
    // else as it was written
    if by.parse() != Ok(present) {
        edits.push(Edit { range, by });
    }
    Ok(())
}

/// The number of a noise such as `"5%"`.
fn share(text: &str) -> Option<f64> {
    text.trim().strip_suffix('%')?.trim().parse().ok()
}

/// A piece of `text` with the edits in it, which come in its order.
fn edited(text: &str, piece: Range<usize>, edits: &[Edit]) -> String {
    let mut out = String::new();
    let mut at = piece.start;
    for edit in edits {
        out.push_str(text.get(at..edit.range.start).unwrap_or_default());
        out.push_str(&edit.by);
        at = edit.range.end;
    }
    out.push_str(text.get(at..piece.end).unwrap_or_default());
    out
}

/// How a table, however it is written, gets a key: after its last one. `header` is its whole name.
fn addition(
    text: &str,
    table: &Item,
    header: &str,
    prefix: &str,
    assignment: &str,
) -> Option<Edit> {
    let insert = |at: usize, by: String| Some(Edit { range: at..at, by });
    match table {
        Item::Value(Value::InlineTable(table)) => {
            let ends = table.iter().filter_map(|(_, value)| value.span());
            match ends.map(|span| span.end).max() {
                Some(end) => insert(end, format!(", {prefix}{assignment}")),
                None => insert(table.span()?.start + 1, format!(" {assignment} ")),
            }
        }
        Item::Table(table) => {
            let own = table.span().filter(|_| !table.is_implicit());
            if let Some(end) = last_end(table).or(own.map(|span| span.end)) {
                return Some(new_line(text, end, &format!("{prefix}{assignment}")));
            }
            // only tables in it, such as [observer.initial]: its own comes before them
            let inner = table.iter().filter_map(|(_, item)| item.span());
            let first = inner.map(|span| span.start).min()?;
            let end = line_end(text);
            let start = text.get(..first)?.rfind('\n').map_or(0, |i| i + 1);
            insert(start, format!("[{header}]{end}{assignment}{end}{end}"))
        }
        _ => None,
    }
}

/// Where the last value ends that stands in a table itself.
fn last_end(table: &Table) -> Option<usize> {
    let end = |item: &Item| match item {
        Item::Value(value) => value.span().map(|span| span.end),
        Item::Table(inner) if inner.is_dotted() => last_end(inner),
        _ => None,
    };
    table.iter().filter_map(|(_, item)| end(item)).max()
}

/// A line below the one in which `end` is.
fn new_line(text: &str, end: usize, line: &str) -> Edit {
    let (at, by) = match text.get(end..).and_then(|rest| rest.find('\n')) {
        Some(more) => {
            let at = end + more + 1;
            let above = text.get(..at).unwrap_or_default();
            (
                at,
                format!("{line}{}", line_end(above.get(end..).unwrap_or_default())),
            )
        }
        None => (text.len(), format!("{}{line}", line_end(text))),
    };
    Edit { range: at..at, by }
}

/// The line end that a text uses.
fn line_end(text: &str) -> &'static str {
    match text.contains("\r\n") {
        true => "\r\n",
        false => "\n",
    }
}
