//! What is committed is what the answers are. With `LYNKEUS_WRITE_DOCS` set the test writes it.

use std::fs;
use std::path::Path;

use lynkeus_experiment::{
    ComparisonReport, MonteCarloReport, OpenRunReport, RunReport, SweepReport,
};
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use crate::certify::CertificateReport;
use crate::check::CheckReport;
use crate::design::Report as DesignReport;
use crate::fit::FitReport;
use crate::precision::HowWellReport;

#[test]
fn the_schema_of_answers_is_the_committed_one() {
    let mut generator = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator();
    let answers = [
        generator.subschema_for::<CheckReport<'static>>(),
        generator.subschema_for::<HowWellReport<'static>>(),
        generator.subschema_for::<DesignReport<'static>>(),
        generator.subschema_for::<CertificateReport<'static>>(),
        generator.subschema_for::<RunReport<'static>>(),
        generator.subschema_for::<MonteCarloReport<'static>>(),
        generator.subschema_for::<OpenRunReport<'static>>(),
        generator.subschema_for::<SweepReport<'static>>(),
        generator.subschema_for::<FitReport<'static>>(),
        generator.subschema_for::<ComparisonReport<'static>>(),
    ];
    let mut definitions = generator.definitions().clone();
    for answer in &answers {
        let name = answer.get("$ref").and_then(Value::as_str).unwrap();
        let name = name.rsplit('/').next().unwrap_or_default();
        versioned(definitions[name].as_object_mut().unwrap());
    }
    let schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "What Lynkeus prints with --json",
        "anyOf": answers,
        "$defs": definitions,
    });
    let expected = format!("{schema:#}\n");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/answers.schema.json");
    let found = fs::read_to_string(&path).unwrap_or_default();
    if found != expected && std::env::var_os("LYNKEUS_WRITE_DOCS").is_some() {
        fs::write(path, expected).unwrap();
        return;
    }
    assert!(
        found == expected,
        "{} does not show the answers as they are; LYNKEUS_WRITE_DOCS=1 writes it",
        path.display()
    );
}

/// Adds what `Answer::to_json` says before an answer's own entries.
fn versioned(answer: &mut Map<String, Value>) {
    let entry = json!({ "type": "string", "description": "The version of Lynkeus that answers." });
    let first = Map::from_iter([("lynkeus".to_owned(), entry)]);
    let own = answer["properties"].take();
    answer["properties"] = first
        .into_iter()
        .chain(own.as_object().cloned().unwrap())
        .collect();
    let required = answer["required"].as_array_mut().unwrap();
    required.insert(0, "lynkeus".into());
}
