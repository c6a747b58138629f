//! Models from the literature with verdicts from elsewhere, where they lie beside the
//! project.

use std::io::Write;
use std::path::{Path, PathBuf};

use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observability::{Question, Verdict, analyse};
use serde_json::Value;

fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/observability");
    if folder.exists() {
        return Some(folder);
    }
    // past the capture, so that a run says what it left out
    let mut out = std::io::stderr().lock();
    let _ = writeln!(out, "skipped: {} is not there", folder.display());
    None
}

fn read(folder: &Path, file: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join(file)).unwrap()).unwrap()
}

fn plant(folder: &Path, model: &str) -> Plant {
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    Plant::load(&folder.join(format!("{model}.mo")), &options).unwrap()
}

fn expected(verdict: &Value) -> Verdict {
    match verdict.as_bool().unwrap() {
        true => Verdict::Observable,
        false => Verdict::Unobservable,
    }
}

#[test]
fn every_state_and_parameter_has_its_verdict() {
    let Some(folder) = folder() else { return };
    for (model, truth) in read(&folder, "truth.json").as_object().unwrap() {
        let plant = plant(&folder, model);
        let question = Question {
            parameters: true,
            ..Question::default()
        };
        let answer = analyse(&plant, &question).unwrap();
        for (name, verdict) in truth.as_object().unwrap() {
            assert_eq!(
                answer.verdict(name),
                Some(expected(verdict)),
                "{model}: {name}"
            );
        }
    }
}

#[test]
fn functions_of_them_have_theirs() {
    let Some(folder) = folder() else { return };
    for case in read(&folder, "expected.json").as_array().unwrap() {
        let model = case["model"].as_str().unwrap();
        let verdicts = case["verdicts"].as_object().unwrap();
        let question = Question {
            parameters: true,
            about: verdicts.keys().cloned().collect(),
            ..Question::default()
        };
        let answer = analyse(&plant(&folder, model), &question).unwrap();
        for asked in &answer.about {
            assert_eq!(
                asked.verdict,
                expected(&verdicts[&asked.name]),
                "{model}: {}",
                asked.name
            );
        }
    }
}

/// What the lines about symmetries say is known has to be, for all the groups there.
#[test]
fn the_combinations_told_are_observable() {
    let Some(folder) = folder() else { return };
    let mut told = 0;
    for (model, _) in read(&folder, "truth.json").as_object().unwrap() {
        let plant = plant(&folder, model);
        let question = Question {
            parameters: true,
            ..Question::default()
        };
        let answer = analyse(&plant, &question).unwrap();
        let symmetries = answer.symmetries.iter();
        let about: Vec<String> = symmetries.flat_map(|s| s.invariants.clone()).collect();
        told += about.len();
        let asking = Question { about, ..question };
        for asked in analyse(&plant, &asking).unwrap().about {
            assert_eq!(
                asked.verdict,
                Verdict::Observable,
                "{model}: {}",
                asked.name
            );
        }
    }
    assert!(told > 20, "{told}");
}
