//! The chosen values into the study file, of which everything else stays as it is.

use std::ops::Range;

use lynkeus_study::Swept;
use toml_edit::{Document, InlineTable, Item, Key, Table, TableLike, Value};

use super::axis::shown;
use super::{Axis, Sweep};
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

impl Sweep {
    /// The study's text with the values of the knee at the swept keys, and what changed. Only
    /// those numbers are touched: every other byte stays, line ends and a byte order mark among them.
    ///
    /// # Errors
    /// There is no knee, or `text` is not the study that was swept.
    pub fn rewritten(&self, text: &str) -> Result<(String, Vec<Change>), Error> {
        let knee = self.chosen().ok_or_else(|| self.refusal())?;
        let (mark, mut text) = match text.strip_prefix(MARK) {
            Some(rest) => (MARK, rest.to_owned()),
            None => ("", text.to_owned()),
        };
        let mut changes = vec![];
        for (axis, value) in self.axes.iter().zip(&knee.values) {
            // one key after the other, as the sweep set them
            let change;
            (text, change) = put(&text, axis, *value)?;
            changes.push(change);
        }
        parsed(&text)?;
        Ok((format!("{mark}{text}"), changes))
    }
}

fn parsed(text: &str) -> Result<Document<&str>, Error> {
    Document::parse(text).map_err(|e| Error::input(format!("not a TOML file: {e}")))
}

/// A piece of the text and what replaces it.
struct Edit {
    range: Range<usize>,
    by: String,
}

/// Where in a study the numbers of an axis stand.
struct Slot<'a> {
    /// names of tables, the outermost first
    tables: &'static [&'static str],
    /// the key in the last of them, and where within its value; without one it is all values of the table
    key: Option<(&'a str, &'a [usize])>,
}

impl<'a> Slot<'a> {
    fn of(swept: &'a Swept) -> Self {
        let name = |name: &'a Option<String>| name.as_deref().map(|name| (name, &[][..]));
        match swept {
            Swept::Tuning(base, path) => Self {
                tables: &["observer"],
                key: Some((base, path)),
            },
            Swept::Density(of) => Self {
                tables: &["process_noise"],
                key: name(of),
            },
            Swept::Noise(of) => Self {
                tables: &["sensors", "noise"],
                key: name(of),
            },
        }
    }
}

fn put(text: &str, axis: &Axis, value: f64) -> Result<(String, Change), Error> {
    let document = parsed(text)?;
    let slot = Slot::of(axis.swept());
    let (found, missing) = innermost(document.as_item(), slot.tables)?;
    let table = found.last().filter(|_| missing.is_empty());
    let table = table.and_then(|(_, item)| item.as_table_like());
    let gone = || {
        let section = slot.tables.join(".");
        Error::input(format!("[{section}] no longer has `{}`", axis.key))
    };
    let Some((key, path)) = slot.key else {
        return scaled(text, table.ok_or_else(gone)?, axis, value);
    };
    let Some(present) = table.and_then(|table| table.get(key)) else {
        let (text, to) = added(text, &found, missing, key, value)?;
        let change = Change {
            key: axis.key.clone(),
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
    scale(slot, axis, value, &mut edits)?;
    let change = Change {
        key: axis.key.clone(),
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
    value: f64,
) -> Result<(String, String), Error> {
    let (end, to, own) = (line_end(text), shown(value), Key::new(key));
    let own = own.display_repr();
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
    axis: &Axis,
    value: f64,
) -> Result<(String, Change), Error> {
    let (mut edits, mut from, mut to) = (vec![], vec![], vec![]);
    let mut values: Vec<(&str, &Value)> = table
        .iter()
        .filter_map(|(name, item)| Some((name, item.as_value()?)))
        .collect();
    values.sort_by_key(|(_, value)| value.span().map_or(0, |span| span.start));
    for (name, slot) in values {
        let mut own = vec![];
        scale(slot, axis, value, &mut own)?;
        let place = slot.span().unwrap_or_default();
        let before = text.get(place.clone()).unwrap_or_default();
        from.push(format!("{name} = {before}"));
        to.push(format!("{name} = {}", edited(text, place, &own)));
        edits.extend(own);
    }
    let change = Change {
        key: axis.key.clone(),
        from: Some(from.join(", ")),
        to: to.join(", "),
    };
    Ok((edited(text, 0..text.len(), &edits), change))
}

/// Replaces a number, or every number of a list.
fn scale(slot: &Value, axis: &Axis, value: f64, edits: &mut Vec<Edit>) -> Result<(), Error> {
    if let Some(entries) = slot.as_array() {
        return entries
            .iter()
            .try_for_each(|e| scale(e, axis, value, edits));
    }
    if let Some(parts) = slot.as_inline_table() {
        // a conjugate pair of poles
        return parts
            .iter()
            .try_for_each(|(_, e)| scale(e, axis, value, edits));
    }
    if let (Some(share), Some(range)) = (slot.as_str().and_then(share), slot.span()) {
        let by = format!("\"{}%\"", shown(axis.chosen(share, value)));
        edits.push(Edit { range, by });
        return Ok(());
    }
    let whole = slot.as_integer().map(|i| i as f64);
    let (Some(present), Some(range)) = (slot.as_float().or(whole), slot.span()) else {
        return Err(Error::input(format!(
            "`{}` is no longer a number",
            axis.key
        )));
    };
    let chosen = axis.chosen(present, value);
    if chosen != present {
        // else as it was written
        let by = shown(chosen);
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

#[cfg(test)]
mod tests {
    use super::super::{Row, axis, measures};
    use super::*;
    use crate::Study;

    fn sweep(text: &str, values: &[f64]) -> Sweep {
        let axes = axis::axes(&Study::parse(text, "s.toml").unwrap()).unwrap();
        let mut row = Row::empty(values, measures::simulated(false).len());
        row.set(measures::TOTAL_ERROR, Some(1.0));
        Sweep {
            plant: "P".to_owned(),
            log: None,
            axes,
            measures: measures::simulated(false),
            rows: vec![row],
            objective: measures::OBJECTIVE,
            knee: Some(0),
            time_unit: None,
            declared: crate::Account::default(),
            notes: vec![],
        }
    }

    #[test]
    fn only_the_number_changes() {
        let text =
            "# head\nplant = 'p.mo'\n\n[observer]   # how\n  theta=4.0      # 1/min\nr = 1\n";
        let (new, changes) = sweep(text, &[3.5]).rewritten(text).unwrap();
        assert_eq!(new, text.replace("4.0", "3.5"));
        assert_eq!(changes[0].to_string(), "theta: 4.0 becomes 3.5");
        let (same, changes) = sweep(text, &[4.0]).rewritten(text).unwrap();
        assert_eq!(same, text);
        assert_eq!(changes[0].to_string(), "theta stays 4.0");
    }

    #[test]
    fn entries_lists_and_new_keys() {
        let text = "observer = { theta = [ 1.5,  # for mu\n  0.7 ] }\ntune.keys = { \"theta[2]\" = [1, 2], delta = [1, 2] }\n";
        let (new, changes) = sweep(text, &[2.0, 1.0]).rewritten(text).unwrap();
        assert!(
            new.starts_with("observer = { theta = [ 1.5,  # for mu\n  2 ]"),
            "{new}"
        );
        assert!(new.contains("delta = 1 }"), "{new}");
        assert_eq!(changes[1].to_string(), "delta = 1 is new");

        let text = "[observer]\npoles = [-2, -3.1] # 1/y\n";
        let (new, changes) = sweep(text, &[1.1]).rewritten(text).unwrap();
        assert_eq!(new, "[observer]\npoles = [-2.2, -3.41] # 1/y\n");
        assert_eq!(
            changes[0].to_string(),
            "poles: [-2, -3.1] becomes [-2.2, -3.41]"
        );
    }

    #[test]
    fn line_ends_and_marks_stay() {
        for text in [
            "\u{feff}plant = 'p.mo'\r\n[observer]\r\ntheta = 4.0  # \u{3b8}\r\n[plot]\r\n",
            "[observer]\rtheta = 4.0\n".replace('\r', "\r\n").as_str(),
            "[observer]\r\ntheta = 4.0 \nname = 1\r\n",
            "observer . theta = 4.0",
        ] {
            let plain = text.trim_start_matches('\u{feff}');
            let swept = plain.replace("name = 1\r\n", "");
            let (new, _) = sweep(&swept, &[3.5]).rewritten(text).unwrap();
            assert_eq!(new, text.replace("4.0", "3.5"));
        }
    }

    #[test]
    fn a_new_key_goes_below_the_others() {
        let keys = "tune.keys = { delta = [1, 2] }";
        for (text, new) in [
            (
                "[observer]\r\ntheta = 1 # a\r\n\r\n[plot]\r\n",
                "[observer]\r\ntheta = 1 # a\r\ndelta = 2\r\n\r\n[plot]\r\n",
            ),
            ("[observer]\n[plot]\n", "[observer]\ndelta = 2\n[plot]\n"),
            (
                "[observer]\r\ntheta = 1",
                "[observer]\r\ntheta = 1\r\ndelta = 2",
            ),
            (
                "observer.theta = 1\nx = 2\n",
                "observer.theta = 1\nobserver.delta = 2\nx = 2\n",
            ),
            (
                "observer = { theta = 1 }\n",
                "observer = { theta = 1, delta = 2 }\n",
            ),
            ("observer = {}\n", "observer = { delta = 2 }\n"),
            (
                "[observer.initial]\nx = 1\n",
                "[observer]\ndelta = 2\n\n[observer.initial]\nx = 1\n",
            ),
            (
                "[observer]\ntheta = 1\ninitial.x = [\n1]\n",
                "[observer]\ntheta = 1\ninitial.x = [\n1]\ndelta = 2\n",
            ),
        ] {
            let swept = format!("{keys}\nobserver.theta = 1");
            let (found, changes) = sweep(&swept, &[2.0]).rewritten(text).unwrap();
            assert_eq!(found, new);
            assert_eq!(changes[0].to_string(), "delta = 2 is new");
        }
    }

    #[test]
    fn a_pair_of_poles_is_scaled() {
        let text = "[observer]\r\npoles = [{ re = -2, im = 1 }, -3]\r\n";
        let (new, _) = sweep(text, &[2.0]).rewritten(text).unwrap();
        assert_eq!(new, "[observer]\r\npoles = [{ re = -4, im = 2 }, -6]\r\n");
    }

    /// The θ that is swept may be one that the study leaves out.
    #[test]
    fn a_study_without_a_section_gets_one() {
        let sweep = sweep("observer = { theta = 1 }", &[2.0]);
        for (text, end) in [("plant = 'p'", "\n"), ("plant = 'p'\r\n", "\r\n")] {
            let (new, changes) = sweep.rewritten(text).unwrap();
            assert_eq!(new, format!("{text}{end}[observer]{end}theta = 2{end}"));
            assert_eq!(changes[0].to_string(), "theta = 2 is new");
        }
    }

    #[test]
    fn noises_are_written_where_they_stand() {
        let filter = "observer = { family = \"ekf\" }\n";
        for (keys, values, text, new) in [
            (
                "process_noise.x = [1], noise.y = [1]",
                &[0.5, 2.0][..],
                "[process_noise]\nx = 0.1 # slow\n[sensors]\nnoise = { y = 1 }\n",
                "[process_noise]\nx = 0.5 # slow\n[sensors]\nnoise = { y = 2 }\n",
            ),
            (
                "process_noise.w = [1]",
                &[0.5],
                "process_noise.x = 1\n[sensors]\nmeasured = [\"y\"]\n",
                "process_noise.x = 1\nprocess_noise.w = 0.5\n[sensors]\nmeasured = [\"y\"]\n",
            ),
            (
                "process_noise.\"x[1]\" = [1], noise.y = [1]",
                &[0.5, 2.0],
                "[process_noise]\r\nx = 1\r\n[sensors]\r\nmeasured = [\"y\"]\r\n",
                "[process_noise]\r\nx = 1\r\n\"x[1]\" = 0.5\r\n[sensors]\r\nmeasured = [\"y\"]\r\nnoise = { y = 2 }\r\n",
            ),
            (
                "process_noise.w = [1], noise.y = [1]",
                &[0.5, 2.0],
                "plant = 'p'\n",
                "plant = 'p'\n\n[process_noise]\nw = 0.5\n\n[sensors.noise]\ny = 2\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "sensors = { noise.z = 1 }\n",
                "sensors = { noise.z = 1, noise.y = 2 }\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "sensors.noise.z = 1\n[plot]\n",
                "sensors.noise.z = 1\nsensors.noise.y = 2\n[plot]\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "[sensors]\nnoise.z = 1\n[sensors.limits]\ny = [0, 1]\n",
                "[sensors]\nnoise.z = 1\nnoise.y = 2\n[sensors.limits]\ny = [0, 1]\n",
            ),
            (
                "noise.y = [1]",
                &[2.0],
                "[sensors.limits]\ny = [0, 1]\n",
                "[sensors]\nnoise = { y = 2 }\n\n[sensors.limits]\ny = [0, 1]\n",
            ),
        ] {
            let sweep = sweep(&format!("{filter}tune.keys = {{ {keys} }}"), values);
            let (found, _) = sweep.rewritten(text).unwrap();
            assert_eq!(found, new);
            // it is the study that was meant
            Study::parse(&found, "s.toml").unwrap();
        }
    }

    #[test]
    fn all_noises_are_multiplied() {
        let sections = "process_noise = { x = 0.1, v = 3 }\nsensors.noise = { y = \"5%\", z = { uniform = 1 } }\n";
        let keys =
            "observer = { family = \"ekf\" }\ntune.keys = { process_noise = [2], noise = [2] }\n";
        let (found, changes) = sweep(&format!("{keys}{sections}"), &[2.0, 3.0])
            .rewritten(sections)
            .unwrap();
        let new = "process_noise = { x = 0.2, v = 6 }\nsensors.noise = { y = \"15%\", z = { uniform = 3 } }\n";
        assert_eq!(found, new);
        assert_eq!(
            changes[0].to_string(),
            "process_noise: x = 0.1, v = 3 becomes x = 0.2, v = 6"
        );
    }

    #[test]
    fn another_study_is_refused() {
        let sweep = sweep("observer = { theta = 1 }", &[2.0]);
        let refusal = |text: &str| sweep.rewritten(text).unwrap_err().to_string();
        assert!(refusal("observer = 3").contains("no table"));
        assert!(refusal("observer.theta = 'x'").contains("no longer a number"));
        assert!(refusal("observer.theta = ").contains("not a TOML file"));
    }
}
