//! The JSON Schema of a study, for editors that complete and check TOML by one.

use lynkeus_observers::{FAMILIES, KeySpec, REQUIRED, Shape};
use serde_json::{Map, Value, json};

use super::keys::{self, OBSERVER};

/// The JSON Schema (draft 7, what TOML editors read) of a study file.
///
/// A key of `[observer]` that several families own may have any of their shapes.
#[must_use]
pub fn schema() -> Value {
    let mut study = section(&[&keys::KEYS, &keys::SECTIONS]);
    study["properties"]["observer"] = observer();
    let mut schema = json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A study of lynkeus",
    });
    if let (Value::Object(schema), Value::Object(study)) = (&mut schema, study) {
        schema.extend(study);
    }
    schema
}

/// `[observer]` with the keys of every family.
fn observer() -> Value {
    let mut owners: Vec<(KeySpec, Vec<&str>)> = vec![];
    for family in FAMILIES {
        for &spec in family.keys() {
            match owners.iter_mut().find(|(known, _)| *known == spec) {
                Some((_, families)) => families.push(family.name()),
                None => owners.push((spec, vec![family.name()])),
            }
        }
    }
    let mut properties = properties(&[&OBSERVER]);
    for (spec, families) in &owners {
        let mut one = key(spec);
        one["description"] = format!("{}: {}", families.join(", "), described(spec)).into();
        match properties.get_mut(spec.name) {
            None => {
                properties.insert(spec.name.to_owned(), one);
            }
            Some(known) => match known.get_mut("anyOf").and_then(Value::as_array_mut) {
                Some(all) => all.push(one),
                None => *known = json!({ "anyOf": [known.take(), one] }),
            },
        }
    }
    json!({
        "type": "object",
        "description": "the observer family and its tuning",
        "properties": properties,
        "additionalProperties": false,
    })
}

fn properties(keys: &[&[KeySpec]]) -> Map<String, Value> {
    let pairs = keys
        .iter()
        .copied()
        .flatten()
        .map(|spec| (spec.name.to_owned(), key(spec)));
    pairs.collect()
}

/// A table whose keys are all known words.
fn section(keys: &[&[KeySpec]]) -> Value {
    let all = keys.iter().copied().flatten();
    let required = all.filter(|spec| spec.default == REQUIRED);
    let required: Vec<&str> = required.map(|spec| spec.name).collect();
    let mut section = json!({
        "type": "object",
        "properties": properties(keys),
        "additionalProperties": false,
    });
    if !required.is_empty() {
        section["required"] = json!(required);
    }
    section
}

fn key(spec: &KeySpec) -> Value {
    let mut value = shape(&spec.shape);
    value["description"] = described(spec).into();
    value
}

/// The meaning, type and default of a key without the marks of the documentation's tables.
fn described(spec: &KeySpec) -> String {
    let kind = spec.kind();
    let KeySpec {
        default, meaning, ..
    } = spec;
    plain(&format!("{meaning} ({kind}; default: {default})"))
}

/// `[text](address)` as text, and the bar that a table needs in disguise.
fn plain(text: &str) -> String {
    let mut found = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("](") {
        let (words, (lead, link)) = match (before.rsplit_once('['), after.split_once(')')) {
            (Some(words), Some((_, after))) => (after, words),
            _ => break,
        };
        found += lead;
        found += link;
        rest = words;
    }
    found += rest;
    found.replace("&#124;", "|")
}

fn shape(shape: &Shape) -> Value {
    match shape {
        Shape::Number => json!({ "type": "number" }),
        Shape::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Shape::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Shape::Share => {
            json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 })
        }
        Shape::Between { least, most } => {
            json!({ "type": "number", "minimum": least, "maximum": most })
        }
        Shape::OneOf(numbers) => json!({ "type": "integer", "enum": numbers }),
        Shape::Whole(least) => json!({ "type": "integer", "minimum": least }),
        Shape::Flag => json!({ "type": "boolean" }),
        Shape::Text => json!({ "type": "string" }),
        Shape::Word(words) => json!({ "type": "string", "enum": words }),
        Shape::List(entry) => json!({ "type": "array", "items": self::shape(entry) }),
        Shape::Table(value) => {
            json!({ "type": "object", "additionalProperties": self::shape(value) })
        }
        Shape::Section(keys) => section(keys),
        Shape::As(_, shape) => self::shape(shape),
        Shape::Either(shapes) => {
            let shapes: Vec<Value> = shapes.iter().map(self::shape).collect();
            json!({ "anyOf": shapes })
        }
    }
}

#[cfg(test)]
mod tests;
