//! `certify`, and `gain = "lmi"`: what is proved, and what a refusal says.

mod column;
mod declared;
mod errors;
mod excited;
mod filter;
mod moving;
mod noise;
mod observer;
mod printed;
mod tube;

use lynkeus::Study;
use serde_json::Value;

use crate::{Ended, Folder, examples};

/// A chain whose slope 3·b² grows from 0.0012 to 27: no gain has room for fast decay.
const STEEP: &str = "model Steep
  Real a(start = 0, min = -1, max = 1);
  Real b(start = 1, min = 0.02, max = 3);
  output Real y = a;
equation
  der(a) = b^3;
  der(b) = -b;
end Steep;
";

/// A study of the plant above with further lines.
fn steep(observer: &str, rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("steep.mo", STEEP);
    let study =
        format!("plant = \"steep.mo\"\n[observer]\nfamily = \"triangular\"\n{observer}\n{rest}");
    folder.write("steep.toml", &study);
    folder
}

/// A plant `m.mo` with its study.
fn folder(plant: &str, study: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", plant);
    folder.write("study.toml", study);
    folder
}

/// The column with the study of Figure 5.
fn column() -> Folder {
    let folder = Folder::empty();
    for file in ["column.mo", "study.toml"] {
        let text = std::fs::read_to_string(examples().join("column").join(file)).unwrap();
        folder.write(file, &text);
    }
    folder
}

#[track_caller]
fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in: {text}");
    }
}

/// Refused with that code and nothing on the output.
#[track_caller]
fn refused(ended: &Ended, code: i32, words: &[&str]) {
    assert_eq!(ended.code, code, "{ended:?}");
    assert!(ended.out.is_empty(), "{}", ended.out);
    says(&ended.err, words);
}

/// What every certificate for machines has.
#[track_caller]
fn well_formed(certificate: &Value, verdict: &str) {
    assert_eq!(certificate["verdict"], verdict, "{certificate}");
    let sides = certificate["box"].as_object().unwrap();
    assert!(sides.values().all(|s| s.as_array().unwrap().len() == 2));
    let checks = certificate["hypotheses"].as_array().unwrap();
    assert!(!checks.is_empty());
    for check in checks {
        assert!(!check["name"].as_str().unwrap().is_empty());
        let refuted = check["verdict"] == "refuted";
        assert_eq!(check.get("witness").is_some(), refuted, "{check}");
    }
    let proved = verdict == "proved";
    assert_eq!(certificate["rate"].is_number(), proved, "{certificate}");
    let bound = &certificate["ultimate_bound"];
    assert_eq!(bound.is_number(), proved, "{certificate}");
}

/// A proof of V' ≤ −2·rate·V at the rate asked for, by the inequality.
#[test]
fn a_certified_gain_comes_with_its_certificate_in_json() {
    let folder = steep("gain = \"lmi\"\nrate = 1", "");
    let design = folder.run(&["design", "steep.toml", "--json"]);
    let certify = folder.run(&["certify", "steep.toml", "--json"]);
    assert_eq!(
        (design.code, certify.code),
        (0, 0),
        "{design:?} {certify:?}"
    );
    let (design, certify) = (design.json(), certify.json());
    for report in [&design, &certify] {
        let certificate = &report["certificate"];
        well_formed(certificate, "proved");
        assert!(certificate["rate"].as_f64().unwrap() >= 1.0);
        assert_eq!(certificate["ultimate_bound"], 0.0);
        assert_eq!(certificate["box"]["b"], serde_json::json!([0.02, 3.0]));
        for state in ["a", "b"] {
            assert!(report["gain"][state]["y"].is_f64(), "{report}");
        }
    }
    assert_eq!(design["gain"], certify["gain"]);
}

/// Lemma 1 does not hold for the S printed in the paper.
#[test]
fn the_column_of_the_paper_fails_lemma_1_in_a_direction() {
    let folder = column();
    let study = Study::load(folder.path.path().join("study.toml")).unwrap();
    let report = lynkeus::certify(&study).unwrap();
    let text = report.to_string();
    let lemma = text.lines().find(|l| l.contains("refuted    Lemma 1"));
    says(
        lemma.unwrap(),
        &["in the direction", "·x[4]", "·x[6]", "whatever ρ is"],
    );
    let report = report.entries();
    // not the guarantee is refuted, but one hypothesis of the theorem
    let certificate = &report["certificate"];
    well_formed(certificate, "undecided");
    let checks = certificate["hypotheses"].as_array().unwrap();
    let failed = |c: &&Value| c["verdict"] == "refuted";
    let failed: Vec<&Value> = checks.iter().filter(failed).collect();
    assert_eq!(failed.len(), 2, "one per chain: {failed:?}");
    for check in failed {
        assert!(check["name"].as_str().unwrap().starts_with("Lemma 1 for"));
        let witness = check["witness"].as_array().unwrap();
        assert!(witness[0]["value"].as_f64().unwrap() > 1.0);
    }
}

/// A plant whose b grows where it is large: a nearly blind gain does not hold it. With
/// `fall` = b it can rest at b = ±√3.
fn grows(fall: &str) -> Folder {
    let folder = Folder::empty();
    folder.write(
        "grows.mo",
        &format!(
            "model Grows
  Real a(start = 0, min = -3, max = 3);
  Real b(start = 1, min = 0.5, max = 2);
  output Real y = a;
equation
  der(a) = b - a;
  der(b) = b^3/3 - {fall};
end Grows;
"
        ),
    );
    folder.write(
        "grows.toml",
        "plant = \"grows.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 0.1\n",
    );
    folder
}

/// A gain that makes the error grow, with the point that shows it.
#[test]
fn a_refuted_guarantee_has_a_witness_in_json() {
    let folder = grows("b");
    let ended = folder.run(&["certify", "grows.toml", "--json"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    let certificate = &ended.json()["certificate"];
    well_formed(certificate, "refuted");
    let checks = certificate["hypotheses"].as_array().unwrap();
    let check = checks.iter().find(|c| c["verdict"] == "refuted").unwrap();
    // λ of [−1−k1 1; −k2 b²−1] at b = √3: nearly 2
    let witness = &check["witness"][0];
    assert!(
        (1.9..2.0).contains(&witness["value"].as_f64().unwrap()),
        "{check}"
    );
    let b = witness["at"]["b"].as_f64().unwrap();
    assert!((b - 3f64.sqrt()).abs() < 1e-9, "{check}");
    let text = folder.run(&["certify", "grows.toml"]);
    says(&text.out, &["refuted", "b = 1.73205"]);
}

/// Without a rest the plant only passes the points where the Jacobian is not stable, and
/// leaves the box.
#[test]
fn an_unstable_jacobian_on_the_way_refutes_nothing() {
    let folder = grows("0");
    let ended = folder.run(&["certify", "grows.toml", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    well_formed(&ended.json()["certificate"], "undecided");
    let text = folder.run(&["certify", "grows.toml"]);
    says(
        &text.out,
        &[
            "there is none in these coordinates",
            "refutes no convergence",
        ],
    );
}

#[test]
fn a_missing_range_is_named() {
    let folder = steep("gain = \"lmi\"\nrate = 1", "");
    folder.change("steep.mo", "min = 0.02, max = 3", "min = 0.02");
    let ended = folder.run(&["design", "steep.toml"]);
    let words = ["b^3", "has no bound", "declare min and max of b"];
    refused(&ended, 1, &words);
    let other = "theta = 3\npartials = true";
    folder.change("steep.toml", "gain = \"lmi\"\nrate = 1", other);
    let ended = folder.run(&["certify", "steep.toml"]);
    says(&ended.out, &["undecided", "declare min and max of b"]);
}

#[test]
fn a_rate_out_of_reach_names_the_range_that_blocks_it() {
    let ended = steep("gain = \"lmi\"\nrate = 30", "").run(&["design", "steep.toml"]);
    refused(
        &ended,
        1,
        &[
            "steep.toml:5:8",
            "`rate`",
            "no gain is proved to reach 30",
            "the slope of b^3 in [0.0012, 27",
            "over the range of b",
            "alone blocks it",
        ],
    );
}

#[test]
fn too_small_a_gain_limit_says_the_smallest_gain_found() {
    let observer = "gain = \"lmi\"\nrate = 1\ngain_limit = 0.1";
    let ended = steep(observer, "").run(&["design", "steep.toml"]);
    let words = ["steep.toml:6:14", "`gain_limit`", "found is ", "raise"];
    refused(&ended, 1, &words);
    // with the number it says, there is a gain within the limit
    let (_, rest) = ended.err.split_once("found is ").unwrap();
    let found: f64 = rest.split(';').next().unwrap().parse().unwrap();
    let observer = format!("gain = \"lmi\"\nrate = 1\ngain_limit = {}", found * 1.01);
    let again = steep(&observer, "").run(&["design", "steep.toml", "--json"]);
    assert_eq!(again.code, 0, "{}", again.err);
    let gain = &again.json()["gain"];
    for state in ["a", "b"] {
        assert!(gain[state]["y"].as_f64().unwrap().abs() <= found * 1.01);
    }
}

#[test]
fn keys_of_the_certified_gain_need_it() {
    for (key, line) in [("rate", "rate = 1"), ("gain_limit", "gain_limit = 9")] {
        let ended = steep(&format!("theta = 3\n{line}"), "").run(&["design", "steep.toml"]);
        let quoted = format!("`{key}`");
        let words = ["steep.toml:5:", &quoted, "only with gain = \"lmi\""];
        refused(&ended, 2, &words);
    }
}

#[test]
fn the_box_knows_its_names_and_narrows_the_proof() {
    let lmi = "gain = \"lmi\"\nrate = 3";
    let ended = steep(lmi, "[box]\nbb = [1, 2]\n").run(&["certify", "steep.toml"]);
    let words = ["steep.toml:7:1", "no side 'bb'", "(a, b)"];
    refused(&ended, 2, &words);
    let ended = steep(lmi, "[box]\nb = [4, 5]\n").run(&["certify", "steep.toml"]);
    refused(&ended, 2, &["'b' is declared in [0.02, 3]"]);
    let ended = steep(lmi, "[box]\nb = [0.5, 3]\n").run(&["certify", "steep.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let certificate = &ended.json()["certificate"];
    well_formed(certificate, "proved");
    assert_eq!(certificate["box"]["b"], serde_json::json!([0.5, 3.0]));
}

/// The tube about the start value, cut to the declared range.
#[test]
fn a_tube_narrows_the_box_about_the_start() {
    let folder = steep("gain = \"lmi\"\nrate = 3", "[certify]\ntube = 0.5\n");
    let ended = folder.run(&["certify", "steep.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let certificate = &ended.json()["certificate"];
    well_formed(certificate, "proved");
    assert_eq!(certificate["box"]["b"], serde_json::json!([0.5, 1.5]));
    assert_eq!(certificate["box"]["a"], serde_json::json!([-0.5, 0.5]));
    folder.change("steep.mo", "b(start = 1, ", "b(");
    let ended = folder.run(&["certify", "steep.toml"]);
    refused(&ended, 2, &["`tube`", "'b' has no start value"]);
    let folder = steep("gain = \"lmi\"\nrate = 3", "[certify]\ntub = 0.5\n");
    let ended = folder.run(&["certify", "steep.toml"]);
    refused(&ended, 2, &["steep.toml:7:1", "\"tub\"", "\"tube\""]);
}
