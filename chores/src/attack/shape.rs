//! Whether a result is what it says: a table, a picture, an object.

use super::commands::Form;
use super::oracle::{Class, Finding};

/// What is wrong with a result.
pub fn judge(form: Form, bytes: &[u8]) -> Option<Finding> {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Some(Finding::new(
            Class::Shape,
            format!("{form:?} that is not UTF-8"),
        ));
    };
    match form {
        Form::Csv => table(text, false),
        Form::CsvOrInfinite => table(text, true),
        Form::Svg => picture(text),
        Form::Json => match serde_json::from_str::<serde_json::Value>(text) {
            Ok(serde_json::Value::Object(_)) => None,
            Ok(_) => Some(Finding::new(Class::Shape, "JSON that is no object")),
            Err(e) => Some(Finding::new(Class::Shape, format!("not JSON: {e}"))),
        },
        // that an operation "is NaN" is what an error says of it
        Form::Text => text
            .replace("is NaN", "")
            .split(|c: char| !c.is_alphanumeric())
            .any(|word| word == "NaN")
            .then(|| Finding::new(Class::NotANumber, "NaN in a report")),
    }
}

fn table(text: &str, infinite: bool) -> Option<Finding> {
    let rows = rows(text);
    let Some((header, rows)) = rows.split_first() else {
        return Some(Finding::new(Class::Shape, "a table without header"));
    };
    for (i, name) in header.iter().enumerate() {
        if header[..i].contains(name) {
            let what = format!("two columns are called {name:?}");
            return Some(Finding::new(Class::HeaderTwice, what));
        }
    }
    for row in rows {
        if row.len() != header.len() {
            let what = format!("{} cells under {} headers", row.len(), header.len());
            return Some(Finding::new(Class::Shape, what));
        }
        for (cell, name) in row.iter().zip(header) {
            // other cells are empty, where a figure does not exist, or say why a run failed
            let Ok(x) = cell.parse::<f64>() else { continue };
            if x.is_nan() || (x.is_infinite() && !infinite) {
                let what = format!("{cell} under {name:?}");
                return Some(Finding::new(Class::NotANumber, what));
            }
        }
    }
    None
}

/// The cells of every row, quoted or not.
fn rows(text: &str) -> Vec<Vec<String>> {
    let mut rows = vec![vec![]];
    let (mut cell, mut quoted) = (String::new(), false);
    let mut push = |cell: &mut String, ends_row: bool| {
        let cell = std::mem::take(cell);
        if let Some(row) = rows.last_mut() {
            row.push(cell);
        }
        if ends_row {
            rows.push(vec![]);
        }
    };
    for c in text.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' | '\n' if !quoted => push(&mut cell, c == '\n'),
            _ => cell.push(c),
        }
    }
    rows.retain(|row| !row.is_empty());
    rows
}

/// Well-formed as far as it matters: characters that XML has, and every element closed in order.
fn picture(text: &str) -> Option<Finding> {
    let wrong = |what: String| Some(Finding::new(Class::Shape, what));
    let is_foreign = |c: char| {
        (c.is_control() && !matches!(c, '\n' | '\t' | '\r')) || matches!(c, '\u{fffe}' | '\u{ffff}')
    };
    if let Some(c) = text.chars().find(|c| is_foreign(*c)) {
        return wrong(format!("{c:?} in a picture"));
    }
    let mut open: Vec<&str> = vec![];
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('<') {
        if let Some(what) = entity(before) {
            return wrong(what);
        }
        let Some((tag, after)) = after.split_once('>') else {
            return wrong("an element without end".to_owned());
        };
        rest = after;
        let name = tag.split_whitespace().next().unwrap_or_default();
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name.trim()) {
                return wrong(format!("</{name}> closes nothing"));
            }
        } else if !tag.ends_with('/') {
            open.push(name);
        }
        if let Some(what) = entity(tag) {
            return wrong(what);
        }
        if tag.contains("NaN") || tag.contains("inf") {
            return Some(Finding::new(Class::NotANumber, format!("<{tag:.60}>")));
        }
    }
    match open.first() {
        Some(name) => wrong(format!("<{name}> is not closed")),
        None if !text.starts_with("<svg") => wrong("a picture that does not begin so".to_owned()),
        None => None,
    }
}

/// An ampersand that begins no entity.
fn entity(text: &str) -> Option<String> {
    let known = ["amp;", "lt;", "gt;", "quot;", "apos;", "#"];
    let mut parts = text.split('&').skip(1);
    let lone = parts.find(|rest| !known.iter().any(|word| rest.starts_with(word)))?;
    Some(format!("&{lone:.20} in a picture"))
}
