//! Messages as JSON, one object in a line.

use std::fmt::Write;

use lynkeus::stream::Stream;
use lynkeus::table::exact;
use lynkeus::visible;
use serde_json::{Map, Value};

use crate::asset::Line;
use crate::row::{Field, Reader, Stamp};

/// The name under which a message says whose row it is.
pub const ASSET: &str = "asset";
/// The name under which an object for one quantity has it.
const VALUE: &str = "value";

/// A message that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// whose row it is, where it says so
    pub asset: Option<String>,
    /// when it was sampled
    pub stamp: Stamp,
    /// by channel, NaN where there is none
    pub values: Vec<f64>,
    /// names in it that nobody reads
    pub strangers: Vec<String>,
}

/// Reads a message.
///
/// # Errors
/// What is wrong with it.
pub fn read(text: &str, reader: &mut Reader) -> Result<Message, String> {
    read_at(text, None, reader)
}

/// Reads a message, which has this time where it says none.
///
/// # Errors
/// What is wrong with it.
pub fn read_at(text: &str, came: Option<Stamp>, reader: &mut Reader) -> Result<Message, String> {
    let message = object(text)?;
    let get = |key: &str| field(&message, key);
    let stamp = match (get(&reader.stream().time), came) {
        (Field::Nothing, Some(came)) => came,
        (time, _) => reader.stamp(time)?,
    };
    let values = reader.values(&get)?;
    let asset = match message.get(ASSET) {
        Some(Value::String(name)) => Some(name.clone()),
        Some(Value::Number(number)) => Some(number.to_string()),
        Some(Value::Null) | None => None,
        Some(_) => return Err(format!("\"{ASSET}\": expected a text")),
    };
    let is_strange = |key: &&String| key.as_str() != ASSET && !reader.knows(key);
    Ok(Message {
        asset,
        stamp,
        values,
        strangers: message.keys().filter(is_strange).cloned().collect(),
    })
}

/// The `value` of an object, and its time.
///
/// # Errors
/// It is none.
pub fn value(text: &str, time: &str) -> Result<(Field, Field), String> {
    let wrong = || format!("expected a number, or an object with \"{VALUE}\"");
    let message = object(text).map_err(|_| wrong())?;
    match message.contains_key(VALUE) {
        true => Ok((field(&message, VALUE), field(&message, time))),
        false => Err(wrong()),
    }
}

fn object(text: &str) -> Result<Map<String, Value>, String> {
    match serde_json::from_str(text).map_err(|e| format!("no JSON: {e}"))? {
        Value::Object(object) => Ok(object),
        _ => Err("expected a JSON object".to_owned()),
    }
}

fn field(message: &Map<String, Value>, key: &str) -> Field {
    match message.get(key) {
        None | Some(Value::Null) => Field::Nothing,
        Some(Value::Number(number)) => match number.as_f64() {
            Some(x) => Field::Number(x),
            None => Field::Other("a number that is too large"),
        },
        Some(Value::String(text)) => Field::Text(text.clone()),
        Some(Value::Bool(_)) => Field::Other("a truth value"),
        Some(Value::Array(_)) => Field::Other("a list"),
        Some(Value::Object(_)) => Field::Other("an object"),
    }
}

/// Appends what is told of a row, with the end of its line.
pub fn write(line: &Line, asset: &str, stream: &Stream, to: &mut String) {
    to.push('{');
    time(line, stream, to);
    if !asset.is_empty() {
        to.push(',');
        key(ASSET, to);
        text(asset, to);
    }
    let told = stream.estimates.iter().zip(&line.estimate).enumerate();
    for (place, (told, estimate)) in told {
        to.push(',');
        key(&told.header, to);
        to.push_str(&exact(*estimate));
        if let (Some(header), Some(sd)) = (&told.deviation, line.deviations.get(place)) {
            to.push(',');
            key(header, to);
            to.push_str(&exact(*sd));
        }
    }
    let monitors = line.estimate.iter().skip(stream.estimates.len());
    for (monitor, value) in stream.monitors.iter().zip(monitors) {
        to.push(',');
        key(&monitor.header, to);
        to.push_str(&exact(*value));
    }
    // a string takes what is written
    let _ = write!(
        to,
        ",\"credible\":{},\"revision\":{}",
        line.is_credible, line.revision
    );
    if !line.notes.is_empty() {
        to.push_str(",\"notes\":[");
        for (place, note) in line.notes.iter().enumerate() {
            to.push_str(if place > 0 { "," } else { "" });
            text(note, to);
        }
        to.push(']');
    }
    to.push_str("}\n");
}

/// The innovations of a line under the names of the sensors, with its time: each with its deviation. None where there
/// is none.
#[must_use]
pub fn innovations(line: &Line, stream: &Stream) -> Option<String> {
    line.innovations.iter().find(|found| found.is_some())?;
    let mut to = String::from("{");
    time(line, stream, &mut to);
    to.push_str(",\"innovations\":{");
    let sensors = stream.channels.iter().filter(|channel| channel.is_sensor);
    let mut is_first = true;
    for (channel, found) in sensors.zip(&line.innovations) {
        let Some((value, deviation)) = found else {
            continue;
        };
        if !value.is_finite() || !deviation.is_finite() {
            continue;
        }
        to.push_str(if is_first { "" } else { "," });
        is_first = false;
        key(&channel.name, &mut to);
        // a string takes what is written
        let _ = write!(to, "[{},{}]", exact(*value), exact(*deviation));
    }
    to.push_str("}}");
    Some(to)
}

fn time(line: &Line, stream: &Stream, to: &mut String) {
    key(&stream.told_time, to);
    match line.stamp {
        Stamp::Number(t) => to.push_str(&exact(t)),
        date @ Stamp::Date(_) => text(&date.to_string(), to),
    }
}

/// Appends why line `number` was not used.
pub fn refuse(why: &str, number: u64, to: &mut String) {
    to.push_str("{\"error\":");
    text(&visible::line(why), to);
    // a string takes what is written
    let _ = writeln!(to, ",\"line\":{number}}}");
}

fn key(name: &str, to: &mut String) {
    text(name, to);
    to.push(':');
}

fn text(text: &str, to: &mut String) {
    to.push_str(&Value::from(text).to_string());
}
