//! `lynkeus report`: one file that asks for nothing, says what the other commands say, and whose
//! observer gives what `estimate` gives.

pub(crate) mod browser;
pub(crate) mod markup;
mod tradeoff;

use std::process::Command;

use serde_json::Value;

use crate::export::{Run, difference, has, without};
use crate::{Folder, csv, examples, skipped};

/// What a page is made of, as Node sees it: the observer of the study, or of a position of the slider,
/// over the samples of the page.
const RUN: &str = r#"
import { readFileSync } from "node:fs";
import vm from "node:vm";
const page = readFileSync("r.html", "utf8");
const text = (id) => page.match(new RegExp(`<script[^>]*id="${id}"[^>]*>([^]*?)</script>`))[1];
const data = JSON.parse(text("data"));
const observers = vm.runInThisContext(`${text("observers")};observers`);
const position = Number(process.argv[2] ?? data.knob.own);
const observer = observers[position]();
const columns = observer.signals.map((name) => data.signals.find((signal) => signal.name === name).values);
const state = observer.init();
const found = new Float64Array(observer.estimates.length);
console.log(["t", ...observer.estimates].join(","));
data.time.forEach((t, row) => {
    if (observer.push(state, t, columns.map((values) => values[row] ?? NaN), found) !== 0) {
        process.exit(1);
    }
    console.log([t, ...found].join(","));
});
"#;

fn page(folder: &Folder, arguments: &[&str]) -> String {
    let arguments = [&["report"], arguments, &["-o", "r.html", "-q"]].concat();
    let ended = folder.run(&arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder.read("r.html")
}

fn data(page: &str) -> Value {
    let from = page.split("id=\"data\">").nth(1).unwrap();
    serde_json::from_str(from.split("</script>").next().unwrap()).unwrap()
}

fn node(folder: &Folder, position: Option<usize>) -> Run {
    folder.write("run.mjs", RUN);
    let mut node = Command::new("node");
    node.arg("run.mjs").args(position.map(|p| p.to_string()));
    let ended = node.current_dir(folder.path.path()).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(told.is_empty(), "{told}");
    let (header, rows) = csv(&String::from_utf8(ended.stdout).unwrap());
    (header, rows, ended.status.success())
}

/// `estimate` of a study on the log, all digits.
fn estimated(folder: &Folder, study: &str) -> Run {
    folder.write("s.toml", study);
    crate::export::estimated(folder.path.path()).unwrap()
}

/// Whether a curve of a page is a column of a run, but for how this test reads numbers of JSON.
fn is(curve: &Value, run: &Run, place: usize) -> bool {
    let curve = curve.as_array().unwrap();
    let pairs = curve.iter().zip(&run.1);
    let near = |(x, row): (&Value, &Vec<f64>)| {
        let x = x.as_f64().unwrap();
        (x - row[place]).abs() <= 2.0 * f64::EPSILON * x.abs()
    };
    curve.len() == run.1.len() && pairs.into_iter().all(near)
}

/// An example with a log of its own simulation.
fn example(name: &str, file: &str) -> Folder {
    let folder = Folder::empty();
    folder.copy_models(name);
    let study = std::fs::read_to_string(examples().join(name).join(file)).unwrap();
    folder.write("study.toml", &without(&study, "[box]"));
    let made = folder.run(&["simulate", "study.toml", "--log", "log.csv", "-q"]);
    assert!(made.code < 2, "{}", made.err);
    folder
}

/// The two tanks without their box: nothing is proved of them, and a page is made in a tenth of the time.
fn unproved() -> Folder {
    let folder = Folder::new();
    let study = without(&folder.read("study.toml"), "[box]");
    folder.write("study.toml", &study);
    folder
}

/// The study with the steps that the page tells, its section `[estimate]` replaced.
fn stepped(study: &str, steps: &str, more: &str) -> String {
    let mut is_inside = false;
    let kept = study.lines().filter(|line| {
        if line.starts_with('[') {
            is_inside = line.starts_with("[estimate]");
        }
        !is_inside
    });
    let kept: Vec<&str> = kept.collect();
    let step = match steps.strip_prefix("steps of ") {
        Some(most) => format!("step = {}", most.strip_suffix(" at most").unwrap()),
        None => format!("substeps = {}", steps.split(' ').next().unwrap()),
    };
    format!(
        "{}\n[estimate]\nmethod = \"rk4\"\n{step}\n{more}\n",
        kept.join("\n")
    )
}

#[test]
fn the_observer_of_a_page_gives_what_estimate_gives() {
    if !has("node") {
        return skipped("node is not there");
    }
    for (name, file, more) in [
        ("two-tanks", "study.toml", ""),
        ("two-tanks", "smoothed.toml", "sd = true"),
        ("lee", "study.toml", ""),
        ("quadrotor", "study.toml", ""),
    ] {
        let folder = example(name, file);
        let data = data(&page(&folder, &["study.toml", "log.csv"]));
        let knob = &data["knob"];
        let own = knob["own"].as_u64().unwrap() as usize;
        let steps = knob["positions"][own]["steps"].as_str().unwrap();
        let study = stepped(&folder.read("study.toml"), steps, more);
        let expected = estimated(&folder, &study);
        let off = difference(&expected, &node(&folder, None), name);
        assert!(off <= 1e-12, "{name}: {off:e}");
        for quantity in data["quantities"].as_array().unwrap() {
            let header = quantity["header"].as_str().unwrap();
            let place = expected.0.iter().position(|h| h == header).unwrap();
            assert!(
                expected.1.len() > 50 && is(&quantity["estimate"], &expected, place),
                "{name}: {header}"
            );
        }
    }
}

/// Another position of the slider is what the study with another value gives.
#[test]
fn the_slider_is_a_change_of_the_study() {
    if !has("node") {
        return skipped("node is not there");
    }
    let folder = example("two-tanks", "study.toml");
    let page_data = data(&page(&folder, &["study.toml", "log.csv"]));
    let positions = page_data["knob"]["positions"].as_array().unwrap();
    assert_eq!(positions.len(), 11);
    assert_eq!(positions[5]["value"], 0.09);
    let (value, steps) = (&positions[8]["value"], positions[8]["steps"].as_str());
    assert!(value.as_f64().unwrap() > 0.15, "{value}");
    let study = stepped(&folder.read("study.toml"), steps.unwrap(), "");
    let faster = study.replace("theta = 0.09 ", &format!("theta = {value} "));
    assert_ne!(study, faster);
    let off = difference(&estimated(&folder, &faster), &node(&folder, Some(8)), "θ");
    assert!(off <= 1e-12, "{off:e}");

    let folder = example("two-tanks", "smoothed.toml");
    let page_data = data(&page(&folder, &["study.toml", "log.csv"]));
    let knob = &page_data["knob"];
    assert_eq!(knob["label"], "process noise");
    let factor = knob["positions"][2]["factor"].as_f64().unwrap();
    let steps = knob["positions"][2]["steps"].as_str().unwrap();
    let study = stepped(&folder.read("study.toml"), steps, "sd = true");
    let calmer = scaled_noise(&study, factor);
    let off = difference(
        &estimated(&folder, &calmer),
        &node(&folder, Some(2)),
        "noise",
    );
    assert!(off <= 1e-12, "{off:e}");
}

fn scaled_noise(study: &str, factor: f64) -> String {
    let mut is_inside = false;
    let mut count = 0;
    let lines = study.lines().map(|line| {
        if line.starts_with('[') {
            is_inside = line.starts_with("[process_noise]");
        }
        let value = line.split('#').next().unwrap().split_once('=');
        match value.filter(|_| is_inside) {
            Some((name, q)) => {
                count += 1;
                let q: f64 = q.trim().parse().unwrap();
                format!("{name} = {:?}\n", q * factor)
            }
            None => format!("{line}\n"),
        }
    });
    let text = lines.collect();
    assert!(count > 0);
    text
}

/// What cannot run in a page is told there, with pictures of the command's own estimates.
#[test]
fn a_page_that_cannot_move_says_why() {
    let folder = example("two-tanks", "smoothed.toml");
    folder.change(
        "study.toml",
        "family = \"ekf\"",
        "family = \"mhe\"\nhorizon = 4",
    );
    let text = folder.read("study.toml").replace("smooth = true", "");
    folder.write("study.toml", &text);
    let log: String = folder
        .read("log.csv")
        .lines()
        .take(40)
        .map(|l| format!("{l}\n"))
        .collect();
    folder.write("log.csv", &log);
    let page = page(&folder, &["study.toml", "log.csv"]);
    assert!(page.contains("The observer cannot run in this page: a moving horizon"));
    let data = data(&page);
    assert!(data["knob"].is_null());
    let expected = estimated(&folder, &text);
    let place = expected.0.iter().position(|h| h == "pump_hat").unwrap();
    assert!(is(&data["quantities"][0]["estimate"], &expected, place));
}

#[test]
fn an_estimate_that_is_not_credible_is_told_at_the_top() {
    let folder = unproved();
    let (header, rows) = csv(&folder.read("log.csv"));
    let scaled = rows.iter().map(|r| format!("{},{}\n", r[0], r[1] * 6.25));
    folder.write(
        "log.csv",
        &(header[..2].join(",") + "\n" + &scaled.collect::<String>()),
    );
    let ended = folder.run(&["report", "study.toml", "log.csv", "-o", "r.html"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    let page = folder.read("r.html");
    let head = page.split("</header>").next().unwrap();
    assert!(
        head.contains("role=\"alert\">Do not trust these estimates: "),
        "{head}"
    );

    folder.write("bare.toml", "plant = \"two_tanks.mo\"\n[sensors]\nmeasured = [\"level\"]\nunknown = [\"pump\"]\n[observer]\ntheta = 0.03\n");
    let ended = folder.run(&["report", "bare.toml", "-o", "b.html"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.err.contains("give a log after the study"),
        "{}",
        ended.err
    );
    let ended = folder.run(&["report", "study.toml", "log.csv", "-o", "log.csv"]);
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("would replace"), "{}", ended.err);
}

/// Steps that are long enough at the start are too long later on, and the rows of a picture are too far apart
/// to be samples: the page finds both out.
#[test]
fn steps_and_samples_are_short_enough_for_the_whole_run() {
    are_short_enough(&[("column", "study-peaking.toml"), ("farza", "study.toml")]);
}

#[test]
#[ignore = "takes a while: its covariance is stiff"]
fn steps_and_samples_are_short_enough_for_a_motor() {
    are_short_enough(&[("induction-motor", "study.toml")]);
}

fn are_short_enough(examples: &[(&str, &str)]) {
    for &(name, file) in examples {
        let folder = example(name, file);
        let data = data(&page(&folder, &["study.toml"]));
        assert!(data["knob"].is_object(), "{name}");
        for quantity in data["quantities"].as_array().unwrap() {
            let curve = |key: &str| -> Vec<f64> {
                let curve = quantity[key].as_array().unwrap();
                curve.iter().map(|x| x.as_f64().unwrap()).collect()
            };
            let (truth, estimate) = (curve("truth"), curve("estimate"));
            let size = truth.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let half = truth.len() / 2;
            let errors = truth
                .iter()
                .zip(&estimate)
                .skip(half)
                .map(|(x, y)| (x - y).powi(2));
            let rms = (errors.sum::<f64>() / half as f64).sqrt();
            assert!(
                rms < 0.2 * size,
                "{name}, {}: {rms} of {size}",
                quantity["name"]
            );
        }
    }
}

/// A mode that grows as fast as it likes: no fixed step of the page is short enough.
#[test]
fn a_page_whose_steps_do_not_do_says_so() {
    let folder = example("ltaief", "study-frozen.toml");
    let ended = folder.run(&["report", "study.toml", "-o", "r.html", "-q"]);
    assert!(ended.code < 2, "{}", ended.err);
    let page = folder.read("r.html");
    assert!(
        page.contains("The observer cannot run in this page: it needs fixed steps, and steps of")
    );
    assert!(data(&page)["knob"].is_null());
    if let Some(seen) = browser::browsed(&folder) {
        browser::sound(&seen);
    }
}

/// The page's observer has the steps that are asked for.
#[test]
fn another_step_is_taken_as_by_export() {
    let folder = example("two-tanks", "study.toml");
    let data = data(&page(&folder, &["study.toml", "log.csv", "--step", "0.5"]));
    let own = data["knob"]["own"].as_u64().unwrap() as usize;
    assert_eq!(
        data["knob"]["positions"][own]["steps"],
        "steps of 0.5 at most"
    );
    let study = stepped(&folder.read("study.toml"), "steps of 0.5 at most", "");
    let expected = estimated(&folder, &study);
    for quantity in data["quantities"].as_array().unwrap() {
        let header = quantity["header"].as_str().unwrap();
        let place = expected.0.iter().position(|h| h == header).unwrap();
        assert!(is(&quantity["estimate"], &expected, place), "{header}");
    }
    for command in [
        &["report", "study.toml", "-o", "r.html", "--step", "0"][..],
        &[
            "export",
            "study.toml",
            "--to",
            "html",
            "-o",
            "page",
            "--step=-1",
        ],
    ] {
        let ended = folder.run(command);
        assert_eq!(ended.code, 2, "{}", ended.err);
        let told = "--step: expected a finite number above 0";
        assert!(ended.err.contains(told), "{}", ended.err);
    }
}
