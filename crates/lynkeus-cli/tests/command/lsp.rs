//! `check --lsp`: diagnostics as editors take them.

use serde_json::{Value, json};

use crate::Folder;

const PLANT: &str = "model Tank
  input Real inflow(start = 1, min = 0, max = 4);
  Real level(start = 1.5, min = 0.1, max = 10);
  output Real gauge = level;
equation
  2*der(level) = inflow - 0.8*sqrt(level);
end Tank;
";

/// What is published of a study with that plant: the exit code, then each file's name and diagnostics.
fn published(plant: &str, study: &str) -> (i32, Vec<(String, Value)>) {
    let folder = Folder::empty();
    folder.write("a tank.mo", plant);
    folder.write("s.toml", study);
    let ended = folder.run(&["check", "s.toml", "--lsp"]);
    let found: Value = serde_json::from_str(&ended.out).expect("an object of JSON");
    let files = found.as_array().expect("a list").iter();
    let files = files.map(|file| {
        let uri = file["uri"].as_str().expect("an address");
        assert!(uri.starts_with("file:///"), "{uri}");
        let name = uri.rsplit('/').next().unwrap_or_default();
        (name.to_owned(), file["diagnostics"].clone())
    });
    (ended.code, files.collect())
}

fn range(line: u32, from: u32, to: u32) -> Value {
    json!({ "start": { "line": line, "character": from }, "end": { "line": line, "character": to } })
}

#[test]
fn a_study_without_fault_clears_both_files() {
    let study = "plant = \"a tank.mo\"\nsensors = { unknown = [\"inflow\"] }\n";
    let (code, files) = published(PLANT, study);
    let empty = |name: &str| (name.to_owned(), json!([]));
    assert_eq!(
        (code, files),
        (0, vec![empty("s.toml"), empty("a%20tank.mo")])
    );
}

#[test]
fn columns_count_in_units_of_utf_16() {
    // the first sign of the comment is two units, and one character
    let study = "plant = \"a tank.mo\"\n[sensors]\nnoise = { \"😀\" = 1, gauge = \"x\" }\n";
    let (code, files) = published(PLANT, study);
    let found = &files[0].1[0];
    assert_eq!(code, 2);
    assert_eq!(found["range"], range(2, 28, 31), "{found}");
    assert_eq!(
        (&found["severity"], &found["source"]),
        (&json!(1), &json!("lynkeus"))
    );
    let code = found["code"].as_str().expect("a code");
    assert!(code.starts_with("study/"), "{code}");
}

#[test]
fn a_fault_of_the_model_stands_in_the_model_and_names_the_study() {
    let plant = PLANT.replace("sqrt(level)", "sqrt(levle)");
    let (code, files) = published(&plant, "plant = \"a tank.mo\"\n");
    assert_eq!((code, &files[0].1), (2, &json!([])));
    let found = &files[1].1[0];
    assert_eq!(found["range"], range(5, 35, 40), "{found}");
    let message = found["message"].as_str().expect("a message");
    assert!(message.contains("unknown name `levle`"), "{message}");
    let related = &found["relatedInformation"][0];
    assert_eq!(related["location"]["range"], range(0, 8, 19), "{related}");
    let code = found["code"].as_str().expect("a code");
    assert!(code.starts_with("model/"), "{code}");
}

#[test]
fn an_unknown_that_leaves_no_trace_is_marked_where_it_is_named() {
    let plant = PLANT.replace("equation\n", "  input Real leak(min = 0, max = 1);\n  Real sump(start = 0, min = 0, max = 9);\nequation\n  der(sump) = leak;\n");
    let study = "plant = \"a tank.mo\"\n[sensors]\nunknown = [\"inflow\", \"leak\"]\n";
    let (_, files) = published(&plant, study);
    let marked = files[0].1.as_array().expect("a list");
    let found = marked
        .iter()
        .find(|found| found["range"] == range(2, 21, 27));
    let found = found.unwrap_or_else(|| panic!("{marked:?}"));
    assert_eq!(found["severity"], 2);
    let message = found["message"].as_str().expect("a message");
    assert!(message.contains("leak leaves no trace"), "{message}");
}

#[test]
fn every_answer_says_which_version_gives_it() {
    let folder = Folder::empty();
    folder.write("a tank.mo", PLANT);
    let ended = folder.run(&["check", "a tank.mo", "--json"]);
    let version = format!("{{\n  \"lynkeus\": \"{}\",", env!("CARGO_PKG_VERSION"));
    assert!(ended.out.starts_with(&version), "{}", ended.out);
}
