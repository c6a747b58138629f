//! What the commands print of shipped studies, and the page of one.

use crate::said::{said, same};
use crate::{Folder, examples};

/// Model and studies of an example, and its log.
fn example(name: &str) -> Folder {
    let folder = Folder::empty();
    for entry in std::fs::read_dir(examples().join(name)).unwrap() {
        let path = entry.unwrap().path();
        let file = path.file_name().unwrap().to_str().unwrap();
        if !file.ends_with(".md") {
            folder.write(file, &std::fs::read_to_string(&path).unwrap());
        }
    }
    folder
}

/// A command on a study, with what else it is told.
fn told(command: &str, studies: &[(&str, &str)], more: &[&str]) {
    for (name, study) in studies {
        let file = format!("{command}-{name}-{study}");
        let study = format!("{study}.toml");
        let arguments = [&[command, study.as_str()], more].concat();
        said(&example(name), &file, &arguments);
    }
}

#[test]
fn of_check() {
    let studies = [
        ("two-tanks", "study"),
        ("column", "study"),
        ("farza", "study"),
        ("germani-manes", "practical"),
        ("ltaief", "study"),
        ("quadrotor", "study"),
    ];
    told("check", &studies, &[]);
}

#[test]
fn of_design() {
    let studies = [
        ("two-tanks", "study"),
        ("column", "study"),
        ("lee", "study"),
        ("farza", "study"),
        ("germani-manes", "practical"),
        ("ltaief", "study"),
    ];
    told("design", &studies, &[]);
}

#[test]
fn of_certify() {
    let studies = [
        ("two-tanks", "study"),
        ("lee", "study"),
        ("ltaief", "study"),
        ("bioreactor", "study"),
        ("predator-prey", "study"),
    ];
    told("certify", &studies, &[]);
}

#[test]
fn of_simulate() {
    let studies = [
        ("two-tanks", "study"),
        ("lee", "study"),
        ("predator-prey", "study"),
        ("van-der-pol-pair", "study"),
    ];
    told("simulate", &studies, &["-o", "run.csv"]);
}

#[test]
fn of_many_runs() {
    let folder = example("two-tanks");
    folder.change("study.toml", "until = 4000", "until = 400");
    let runs = ["simulate", "study.toml", "--runs", "5", "-o", "runs.csv"];
    said(&folder, "runs-two-tanks", &runs);
}

#[test]
fn of_estimate() {
    let studies = [("two-tanks", "study"), ("two-tanks", "smoothed")];
    told("estimate", &studies, &["log.csv", "-o", "estimates.csv"]);
}

#[test]
fn of_tune() {
    let folder = example("two-tanks");
    folder.change("study.toml", "until = 4000", "until = 400");
    said(&folder, "tune-two-tanks", &["tune", "study.toml"]);
}

#[test]
fn of_compare() {
    let folder = example("two-tanks");
    folder.change("study.toml", "until = 4000", "until = 200");
    said(&folder, "compare-two-tanks", &["compare", "study.toml"]);
}

#[test]
fn of_how_well() {
    let folder = example("two-tanks");
    folder.change("study.toml", "until = 4000", "until = 400");
    let asked = ["check", "study.toml", "--how-well"];
    said(&folder, "how-well-two-tanks", &asked);
}

/// Scripts and styles left out.
#[test]
fn of_a_page() {
    let folder = example("two-tanks");
    let log = folder.read("log.csv");
    let rows = log.lines().take(102).map(|line| format!("{line}\n"));
    folder.write("log.csv", &rows.collect::<String>());
    let arguments = ["report", "study.toml", "log.csv", "-o", "r.html", "-q"];
    let ended = folder.run(&arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    same(
        "page.html",
        &crate::report::markup::markup(&folder.read("r.html")),
    );
}
