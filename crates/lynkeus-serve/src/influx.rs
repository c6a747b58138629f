//! Messages in InfluxDB's line protocol: what Telegraf and its processors speak.
//!
//! A metric that comes is passed on with the estimates as further fields; a correction has its series and its time,
//! so that a database puts the new fields in the place of the old ones.

use std::fmt::Write;

use lynkeus::stream::Stream;
use lynkeus::table::{Instant, exact};

use crate::asset::Line;
use crate::json::{ASSET, Message};
use crate::row::{Field, Reader, Stamp};

/// A metric, and the row that it is; none where it has nothing that anybody reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Metric {
    /// measurement and tags, as they came
    pub series: String,
    /// its fields, as they came
    pub fields: String,
    /// the row
    pub row: Option<Message>,
}

/// Reads a metric.
///
/// # Errors
/// What is wrong with it.
pub fn read(text: &str, reader: &mut Reader) -> Result<Metric, String> {
    let (series, rest) = split(text, ' ', false).ok_or("expected fields after the measurement")?;
    let (fields, time) = match split(rest.trim_start(), ' ', true) {
        Some((fields, time)) => (fields, time.trim()),
        None => (rest.trim(), ""),
    };
    let mut tags = parts(series, ',', false).into_iter();
    if tags.next().is_none_or(str::is_empty) {
        return Err("expected a measurement".to_owned());
    }
    let mut asset = None;
    for tag in tags {
        let (key, value) = split(tag, '=', false).ok_or("expected tags as key=value")?;
        if unescaped(key) == ASSET {
            asset = Some(unescaped(value));
        }
    }
    let mut named = vec![];
    for pair in parts(fields, ',', true) {
        let (key, value) = split(pair, '=', false).ok_or("expected fields as key=value")?;
        named.push((unescaped(key), field(value)?));
    }
    let is_read = named.iter().any(|(key, _)| reader.knows(key));
    let row = match is_read {
        false => None,
        true => {
            let nanoseconds: i128 = time
                .parse()
                .map_err(|_| format!("expected a time in nanoseconds, found \"{time}\""))?;
            let get = |key: &str| {
                let mut own = named.iter().filter(|(name, _)| name == key);
                own.next_back().map_or(Field::Nothing, |(_, f)| f.clone())
            };
            Some(Message {
                asset,
                stamp: Stamp::Date(Instant::at(nanoseconds, true)),
                values: reader.values(&get)?,
                strangers: vec![],
            })
        }
    };
    Ok(Metric {
        series: series.to_owned(),
        fields: fields.to_owned(),
        row,
    })
}

/// A value: a float, `1i`, `1u`, `t`, `"text"`.
fn field(text: &str) -> Result<Field, String> {
    let wrong = || format!("expected a value of a field, found \"{text}\"");
    if let Some(quoted) = text.strip_prefix('"') {
        let inner = quoted.strip_suffix('"').ok_or_else(wrong)?;
        return Ok(Field::Text(inner.to_owned()));
    }
    if matches!(
        text,
        "t" | "T" | "true" | "True" | "TRUE" | "f" | "F" | "false" | "False" | "FALSE"
    ) {
        return Ok(Field::Other("a truth value"));
    }
    let digits = text.strip_suffix(['i', 'u']).unwrap_or(text);
    let is_numeric = digits
        .bytes()
        .all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
    let number = digits.parse().ok().filter(|_| is_numeric);
    number.map(Field::Number).ok_or_else(wrong)
}

/// Before and after the first such character that nothing escapes, and that is in no quotes where there may be some.
fn split(text: &str, at: char, quotes: bool) -> Option<(&str, &str)> {
    let (mut is_escaped, mut is_quoted) = (false, false);
    for (place, character) in text.char_indices() {
        match character {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' if quotes => is_quoted = !is_quoted,
            _ if character == at && !is_quoted => {
                return Some((&text[..place], &text[place + at.len_utf8()..]));
            }
            _ => {}
        }
    }
    None
}

fn parts(mut text: &str, at: char, quotes: bool) -> Vec<&str> {
    let mut all = vec![];
    while let Some((part, rest)) = split(text, at, quotes) {
        all.push(part);
        text = rest;
    }
    all.push(text);
    all
}

fn unescaped(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let is_mark = |next: &char| matches!(next, ',' | '=' | ' ' | '\\' | '"');
        match character {
            '\\' if characters.peek().is_some_and(is_mark) => found.extend(characters.next()),
            other => found.push(other),
        }
    }
    found
}

/// Appends a name, its marks escaped.
fn name(text: &str, to: &mut String) {
    for character in text.chars() {
        if matches!(character, ',' | '=' | ' ') {
            to.push('\\');
        }
        to.push(character);
    }
}

/// Appends what is told of a row under a series, after the fields with which it came, where these are passed on.
pub fn write(line: &Line, (series, fields): (&str, &str), stream: &Stream, to: &mut String) {
    to.push_str(series);
    to.push(' ');
    if !fields.is_empty() {
        to.push_str(fields);
        to.push(',');
    }
    for (place, (told, estimate)) in stream.estimates.iter().zip(&line.estimate).enumerate() {
        name(&told.header, to);
        to.push('=');
        to.push_str(&exact(*estimate));
        to.push(',');
        if let (Some(header), Some(sd)) = (&told.deviation, line.deviations.get(place)) {
            name(header, to);
            to.push('=');
            to.push_str(&exact(*sd));
            to.push(',');
        }
    }
    let monitors = line.estimate.iter().skip(stream.estimates.len());
    for (monitor, value) in stream.monitors.iter().zip(monitors) {
        name(&monitor.header, to);
        to.push('=');
        to.push_str(&exact(*value));
        to.push(',');
    }
    let nanoseconds = match line.stamp {
        Stamp::Date(instant) => instant.nanoseconds(),
        Stamp::Number(_) => 0,
    };
    // a string takes what is written
    let _ = write!(
        to,
        "credible={},revision={}i",
        line.is_credible, line.revision
    );
    if !line.notes.is_empty() {
        let notes = line
            .notes
            .join("; ")
            .replace('\\', "\\\\")
            .replace('"', "\\\"");
        let _ = write!(to, ",notes=\"{notes}\"");
    }
    let _ = writeln!(to, " {nanoseconds}");
}
