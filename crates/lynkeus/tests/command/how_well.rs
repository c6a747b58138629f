//! `lynkeus check --how-well`.

use crate::{Folder, examples};

fn column() -> String {
    let study = examples().join("column").join("study.toml");
    study.to_string_lossy().into_owned()
}

#[test]
fn two_inner_trays_tell_more_of_the_column_than_its_ends() {
    let folder = Folder::empty();
    let study = column();
    let asked = [
        "check",
        &study,
        "--how-well",
        "--sensors",
        "all",
        "--horizon",
        "10",
        "--json",
        "--plot",
        "errors.svg",
        "-o",
        "errors.csv",
    ];
    let ended = folder.run(&asked);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["rank"]["of"], 13);
    let advice = &answer["advice"];
    assert_eq!(advice["same_size"].as_array().unwrap().len(), 66);
    let mean = |set: &serde_json::Value| set["mean_share"].as_f64().unwrap();
    assert!(mean(&advice["same_size"][0]) < 0.5 * mean(&advice["present"]));
    assert!(mean(&advice["additions"][0]) < mean(&advice["present"]));
    assert!(folder.read("errors.svg").contains("measuring top, bottom"));
    let table = folder.read("errors.csv");
    assert!(table.starts_with("horizon,x[1],"), "{table}");
    assert!(
        table.contains("inf"),
        "two samples cannot tell thirteen numbers"
    );
}

/// A run of hours: what is known at the horizons that were reached is the answer.
#[test]
fn a_limit_ends_the_run_within_twice_its_time() {
    let folder = Folder::new();
    folder.change("study.toml", "until = ", "until = 1e7 #");
    let steps = "sample_step = 0.1\noutput_step = 1e4 #";
    folder.change("study.toml", "output_step = ", steps);
    let begun = std::time::Instant::now();
    let ended = folder.run(&["check", "study.toml", "--how-well", "--time-limit", "2"]);
    assert!(begun.elapsed().as_secs_f64() < 4.5, "{:?}", begun.elapsed());
    let told = format!("{}{}", ended.out, ended.err);
    let partial = ended.out.contains("a limit ended the run after");
    assert!(
        partial || ended.err.contains("the limit of 2 s ended it"),
        "{told}"
    );
    assert!(!told.contains("not seen"), "{told}");
}

#[test]
fn what_is_not_seen_is_an_answer_of_no() {
    let study = column();
    let ended = Folder::empty().run(&["check", &study, "--horizon", "0.1"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(ended.out.contains("not seen"), "{}", ended.out);
}

#[test]
fn a_bare_model_has_no_run_to_judge() {
    let model = examples().join("column").join("column.mo");
    let ended = Folder::empty().run(&["check", &model.to_string_lossy(), "--how-well"]);
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("[simulate]"), "{}", ended.err);
}
