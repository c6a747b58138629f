//! What is committed is what the keys say. With `LYNKEUS_WRITE_DOCS` set the tests write it.

use std::fs;
use std::path::{Path, PathBuf};

use super::*;
use crate::keys::{
    CERTIFY, COMPARE, ESTIMATE, FIT, GENERATOR, INTEGRATOR, KEYS, LOG, MANIFOLD, MQTT, OPCUA, PLOT,
    SENSORS, SERVE, SIMULATE, TUNE,
};

const HEADER: &str = "| key | type | default | meaning |\n|---|---|---|---|\n";

fn document(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    root.join(name)
}

fn compare(path: &Path, expected: &str) {
    let found = fs::read_to_string(path).unwrap_or_default();
    if found != expected && std::env::var_os("LYNKEUS_WRITE_DOCS").is_some() {
        fs::write(path, expected).unwrap();
        return;
    }
    assert!(
        found == expected,
        "{} does not show the keys as they are declared; LYNKEUS_WRITE_DOCS=1 writes it",
        path.display()
    );
}

/// `page` with the table below `heading` made of the keys, and of rows of its own about
/// other keys.
fn with_table(page: &str, heading: &str, keys: &[&KeySpec]) -> String {
    let below = page.find(heading).unwrap() + heading.len();
    let start = below + page[below..].find(HEADER).unwrap() + HEADER.len();
    let rows: Vec<&str> = page[start..]
        .lines()
        .take_while(|l| l.starts_with('|'))
        .collect();
    let end = start + rows.iter().map(|row| row.len() + 1).sum::<usize>();
    let declared = |row: &&str| {
        keys.iter()
            .any(|k| row.starts_with(&format!("| `{}` ", k.name)))
    };
    let own = rows
        .into_iter()
        .filter(|row| !declared(row))
        .map(str::to_owned);
    let all: Vec<String> = keys.iter().map(|key| key.row()).chain(own).collect();
    format!("{}{}\n{}", &page[..start], all.join("\n"), &page[end..])
}

#[test]
fn the_schema_is_the_committed_one() {
    let path = document("study.schema.json");
    compare(&path, &format!("{:#}\n", schema()));
}

#[test]
fn the_page_of_studies_shows_the_keys() {
    let path = document("study.md");
    let mut page = fs::read_to_string(&path).unwrap();
    let tables: [(&str, &[KeySpec]); 17] = [
        ("\n## Top level\n", &KEYS),
        ("\n## `[sensors]`\n", &SENSORS),
        ("\n## `[manifold]`\n", &MANIFOLD),
        ("\n## `[observer]`\n", &OBSERVER),
        ("\n## `[certify]`\n", &CERTIFY),
        ("\n## `[simulate]`\n", &SIMULATE),
        ("\n## `[log]`\n", &LOG),
        ("\n## `[estimate]`\n", &ESTIMATE),
        ("\n### What makes an input\n", &GENERATOR),
        ("\n## The integrator\n", &INTEGRATOR),
        ("\n## `[tune]`\n", &TUNE),
        ("\n## `[fit]`\n", &FIT),
        ("\n## `[compare]`\n", &COMPARE),
        ("\n## `[serve]`\n", &SERVE),
        ("\n### A broker\n", &MQTT),
        ("\n### A server of OPC UA\n", &OPCUA),
        ("\n## `[plot]`\n", &PLOT),
    ];
    for (heading, keys) in tables {
        page = with_table(&page, heading, &keys.iter().collect::<Vec<_>>());
    }
    compare(&path, &page);
    for family in FAMILIES {
        let link = format!("| [{0}]({0}.md", family.name());
        let row = page.lines().find(|line| line.starts_with(&link)).unwrap();
        for key in family.keys() {
            assert!(
                row.contains(&format!("`{}`", key.name)),
                "{row}\nlacks {}",
                key.name
            );
        }
    }
}

#[test]
fn the_page_of_each_family_shows_its_keys() {
    for family in FAMILIES {
        let path = document(&format!("{}.md", family.name()));
        let page = fs::read_to_string(&path).unwrap();
        compare(&path, &with_table(&page, "", &family.keys()));
    }
}

/// What a schema of this kind accepts, for the kinds of `Shape`.
fn accepts(schema: &Value, value: &Value) -> bool {
    if let Some(any) = schema.get("anyOf").and_then(Value::as_array) {
        return any.iter().any(|schema| accepts(schema, value));
    }
    let number = value.as_f64();
    let bound = |word: &str| schema.get(word).and_then(Value::as_f64);
    match schema["type"].as_str().unwrap() {
        "number" => number.is_some_and(|x| {
            bound("minimum").is_none_or(|low| x >= low)
                && bound("exclusiveMinimum").is_none_or(|low| x > low)
                && bound("exclusiveMaximum").is_none_or(|high| x < high)
        }),
        "integer" => value.as_u64().is_some(),
        "boolean" => value.is_boolean(),
        "string" => {
            let word = |words: &Value| words.as_array().unwrap().contains(value);
            value.is_string() && schema.get("enum").is_none_or(word)
        }
        "array" => {
            let entries = value.as_array();
            entries.is_some_and(|all| all.iter().all(|x| accepts(&schema["items"], x)))
        }
        _ => value.as_object().is_some_and(|table| {
            let required = schema.get("required").and_then(Value::as_array);
            let there = |key: &Value| table.contains_key(key.as_str().unwrap());
            required.is_none_or(|keys| keys.iter().all(there))
                && table.iter().all(|(key, value)| {
                    let known = schema.get("properties").and_then(|known| known.get(key));
                    let rest = &schema["additionalProperties"];
                    let schema = known.or(rest.is_object().then_some(rest));
                    schema.is_some_and(|schema| accepts(schema, value))
                })
        }),
    }
}

/// Every shipped study is one of the schema; one with a slip is not.
#[test]
fn the_shipped_studies_follow_the_schema() {
    let schema = schema();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut count = 0;
    for folder in fs::read_dir(examples).unwrap().flatten() {
        let Ok(files) = fs::read_dir(folder.path()) else {
            continue;
        };
        for file in files.flatten().map(|file| file.path()) {
            if file.extension().is_none_or(|kind| kind != "toml") {
                continue;
            }
            let text = fs::read_to_string(&file).unwrap();
            let study: Value = json(toml::de::DeTable::parse(&text).unwrap().get_ref());
            assert!(accepts(&schema, &study), "{}", file.display());
            count += 1;
        }
    }
    assert!(count > 5);
    for slip in [
        json!({ "sensor": {} }),
        json!({ "observer": { "tehta": 3 } }),
        json!({ "observer": { "theta": -3 } }),
        json!({ "simulate": { "until": "late" } }),
        json!({ "simulate": { "seed": 1 } }),
    ] {
        assert!(!accepts(&schema, &slip), "{slip}");
    }
}

fn json(table: &toml::de::DeTable<'_>) -> Value {
    use toml::de::DeValue;
    fn value(found: &DeValue<'_>) -> Value {
        match found {
            DeValue::String(text) => json!(text),
            DeValue::Integer(number) => json!(number.to_string().parse::<i64>().unwrap()),
            DeValue::Float(number) => json!(number.to_string().parse::<f64>().unwrap()),
            DeValue::Boolean(flag) => json!(flag),
            DeValue::Datetime(date) => json!(date.to_string()),
            DeValue::Array(items) => items.iter().map(|x| value(x.get_ref())).collect(),
            DeValue::Table(table) => json(table),
        }
    }
    let pairs = table.iter();
    pairs
        .map(|(key, x)| (key.get_ref().to_string(), value(x.get_ref())))
        .collect()
}
