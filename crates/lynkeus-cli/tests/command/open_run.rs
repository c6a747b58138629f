//! `lynkeus simulate --inputs`: the plant alone, driven by a log.

use serde_json::Value;

use crate::Folder;
use crate::fit::{fitted, folder as fit_folder, number};

const PLANT: &str = "model Tank
  input Real u(min = 0, max = 5);
  input Real leak(min = 0, max = 1);
  Real level(start = 2, min = 0, max = 10, unit = \"m\") \"Of the tank\";
  output Real y(unit = \"m\") = level;
  output Real twice = 2*level;
equation
  der(level) = u - leak - 0.2*level;
end Tank;
";

const STUDY: &str = "plant = \"plant.mo\"
[sensors]
measured = [\"y\"]
noise = { y = 0.1 }
";

/// What flows in, row by row, one a second.
const INPUT: [f64; 6] = [0.5, 1.5, 1.5, 0.1, 0.8, 0.8];

/// The level under inputs that are held, by its solution.
fn levels(input: impl Fn(usize) -> f64, start: f64) -> Vec<f64> {
    let keep = (-0.2_f64).exp();
    let mut level = start;
    let rows = 0..INPUT.len();
    rows.map(|row| {
        let here = level;
        level = keep * level + input(row) * (1.0 - keep) / 0.2;
        here
    })
    .collect()
}

/// Readings that are off by these.
const OFF: [f64; 6] = [0.1, -0.2, 0.3, 0.0, -0.1, 0.2];

fn folder(study: &str, readings: &[&str]) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    folder.write("study.toml", &format!("{STUDY}{study}"));
    let rows = readings.iter().zip(INPUT).enumerate();
    let rows = rows.map(|(t, (y, u))| format!("{t},{y},{u}\n"));
    folder.write("log.csv", &format!("t,y,u\n{}", rows.collect::<String>()));
    folder
}

/// No leak, and readings that are off.
fn known() -> (Folder, Vec<f64>) {
    let levels = levels(|row| INPUT[row], 2.0);
    let readings = levels.iter().zip(OFF);
    let mut readings: Vec<String> = readings.map(|(x, off)| (x + off).to_string()).collect();
    readings[3].clear();
    let readings: Vec<&str> = readings.iter().map(String::as_str).collect();
    (folder("disturbances = [\"leak\"]\n", &readings), levels)
}

fn open(folder: &Folder, more: &[&str]) -> Value {
    let command = ["simulate", "study.toml", "--inputs", "log.csv", "--json"];
    let ended = folder.run(&[&command[..], more].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    ended.json()
}

/// A column of a table, an empty cell no number.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let place = lines.next().unwrap().split(',').position(|h| h == name);
    let place = place.unwrap_or_else(|| panic!("{name} in {table}"));
    let cell = |line: &str| line.split(',').nth(place).unwrap().parse();
    lines.map(|line| cell(line).unwrap_or(f64::NAN)).collect()
}

fn assert_near(found: f64, expected: f64, by: f64) {
    let off = (found - expected).abs();
    assert!(off <= by, "expected {expected}, found {found}");
}

#[test]
fn the_plant_alone_follows_the_logs_inputs_and_its_errors_are_told() {
    let (folder, levels) = known();
    let found = open(&folder, &["-o", "out.csv", "--plot", "out.svg"]);
    let table = folder.read("out.csv");
    assert_eq!(table.lines().next(), Some("t,level,u,leak,y,twice,y_error"));
    for (row, level) in levels.iter().enumerate() {
        assert_near(column(&table, "level")[row], *level, 1e-8);
        assert_near(column(&table, "twice")[row], 2.0 * level, 2e-8);
        if row != 3 {
            assert_near(column(&table, "y_error")[row], OFF[row], 1e-8);
        }
    }
    assert!(column(&table, "y_error")[3].is_nan());
    let errors = &found["errors"]["y"];
    assert_eq!(
        (&errors["readings"], &errors["missing"]),
        (&5.into(), &1.into())
    );
    let rows = || (0..6).filter(|row| *row != 3);
    let squares: f64 = rows().map(|row| OFF[row].powi(2)).sum();
    let center = rows().map(|row| levels[row] + OFF[row]).sum::<f64>() / 5.0;
    let spread: f64 = rows()
        .map(|row| (levels[row] + OFF[row] - center).powi(2))
        .sum();
    assert_near(number(&errors["rms"]), (squares / 5.0).sqrt(), 1e-8);
    assert_near(
        number(&errors["mean"]),
        rows().map(|row| OFF[row]).sum::<f64>() / 5.0,
        1e-8,
    );
    let fit = 100.0 * (1.0 - (squares / spread).sqrt());
    assert_near(number(&errors["fit_percent"]), fit, 1e-6);
    assert_eq!(found["start"]["level"], 2.0);
    let svg = folder.read("out.svg");
    assert!(
        svg.contains("plant alone") && svg.contains("measured"),
        "{svg}"
    );
    let text = folder.run(&["simulate", "study.toml", "--inputs", "log.csv"]);
    assert_eq!(text.code, 0, "{}", text.err);
    assert!(
        text.out.contains("the plant alone on 6 rows of log.csv"),
        "{}",
        text.out
    );
    assert!(text.out.contains("fit in %"), "{}", text.out);
}

/// Inputs between rows are as `between_samples` has them.
#[test]
fn inputs_may_go_along_lines_between_rows() {
    let (folder, _) = known();
    let ends = |folder: &Folder| {
        open(folder, &["-o", "out.csv"]);
        column(&folder.read("out.csv"), "level")
    };
    let held = ends(&folder);
    folder.change("study.toml", "disturbances", "#");
    folder.change(
        "study.toml",
        "noise = { y = 0.1 }\n",
        "noise = { y = 0.1 }\ndisturbances = [\"leak\"]\n[estimate]\nbetween_samples = \"linear\"\n",
    );
    let lines = ends(&folder);
    // from 0.5 to 1.5 in a second: x' = 0.5 + t − 0.2x
    let keep = (-0.2_f64).exp();
    let exact = 2.0 * keep + 0.5 * (1.0 - keep) / 0.2 + 1.0 / 0.2 - (1.0 - keep) / 0.04;
    assert_near(lines[1], exact, 1e-8);
    assert!((held[1] - exact).abs() > 0.1);
}

#[test]
fn an_unknown_input_is_a_column_an_expression_or_refused() {
    let readings = ["2", "", "", "", "", ""];
    let lost = folder("unknown = [\"leak\"]\n", &readings);
    let ended = lost.run(&["simulate", "study.toml", "--inputs", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    for told in [
        "nothing says what the unknown input \"leak\" does",
        "inputs = { leak = \"…\" } under [simulate]",
    ] {
        assert!(ended.err.contains(told), "{}", ended.err);
    }
    let exact = levels(|row| INPUT[row] - 0.3, 2.0);
    let simulate = "unknown = [\"leak\"]\n[simulate]\nuntil = 3\ninputs = { leak = 0.3, u = 7 }\n";
    let said = folder(simulate, &readings);
    let found = open(&said, &["-o", "out.csv"]);
    let told = "leak is as `inputs` of [simulate] has it: the log has no column \\\"leak\\\"";
    assert!(found["notes"].to_string().contains(told), "{found}");
    let logged = folder("unknown = [\"leak\"]\n", &readings);
    let text = logged.read("log.csv").replace("t,y,u", "t,y,u,leak");
    let text: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(row, line)| format!("{line}{}\n", if row > 0 { ",0.3" } else { "" }))
        .collect();
    logged.write("log.csv", &text.concat());
    open(&logged, &["-o", "out.csv"]);
    for folder in [said, logged] {
        let found = column(&folder.read("out.csv"), "level");
        for (found, exact) in found.iter().zip(&exact) {
            assert_near(*found, *exact, 1e-8);
        }
    }
}

/// What `fit` says of the plant alone, `simulate --inputs` says as well: by the values that were found, from the start
/// that the study says, that was found, or that a first reading shows.
#[test]
fn errors_are_those_of_the_fits_free_run() {
    let simulation = "parameters = [\"k\", \"g\"]\nnoise = true\nobjective = \"simulation\"\n";
    let fixed = "[estimate]\nmethod = \"rk4\"\nstep = 0.05\n";
    for (fit, is_read, by) in [
        (format!("{simulation}{fixed}"), false, 1e-9),
        (format!("{simulation}{fixed}"), true, 1e-9),
        (
            format!("{simulation}initial = [\"x\"]\n{fixed}"),
            false,
            1e-9,
        ),
        (simulation.to_owned(), false, 1e-5),
        (format!("parameters = [\"k\", \"g\"]\n{fixed}"), false, 1e-9),
    ] {
        let folder = fit_folder(&fit);
        if is_read {
            folder.change("plant.mo", "x(start = 1, ", "x(");
            folder.change("study.toml", "initial = { x = 1 }\n", "");
        }
        let found = fitted(&folder, &[]);
        // all digits, of which --write gives a few
        let value = |name: &str| found["parameters"][name]["value"].to_string();
        let values = format!("k = {}, g = {}", value("k"), value("g"));
        folder.change("study.toml", "k = 0.5, g = 1.0", &values);
        if let Some(start) = found["initial"]["x"][0].get("value") {
            folder.change("study.toml", "{ x = 1 }", &format!("{{ x = {start} }}"));
        }
        let expected = number(&found["errors"]["y"]["fitted"]["free_run"]);
        let run = open(&folder, &[]);
        let errors = &run["errors"]["y"];
        assert_eq!(errors["readings"], 200, "{fit}");
        assert_near(number(&errors["rms"]) / expected, 1.0, by);
        let first = run["notes"]
            .to_string()
            .contains("x starts at its first reading");
        assert_eq!(first, is_read, "{run}");
    }
}

/// Of a reading at an end of its range nobody knows how far it is off; a cell that is none is left out.
#[test]
fn readings_that_say_nothing_do_not_count() {
    let readings = ["2", "9", "850", "2.5", "3", "2"];
    let folder = folder(
        "disturbances = [\"leak\"]\nlimits = { y = [0, 9] }\nplausible = { y = [0, 10] }\n",
        &readings,
    );
    let found = open(&folder, &[]);
    let errors = &found["errors"]["y"];
    assert_eq!(errors["readings"], 4, "{errors}");
    assert_eq!(errors["at_ends"], 1, "{errors}");
    assert_eq!(errors["missing"], 1, "{errors}");
    let text = folder.run(&["simulate", "study.toml", "--inputs", "log.csv"]);
    let told = "y: 1 reading at an end of the sensor's range, not counted";
    assert!(text.out.contains(told), "{}", text.out);
}

/// A log of inputs alone is enough, and one without an input is not.
#[test]
fn a_log_needs_the_inputs_and_no_readings() {
    let (folder, levels) = known();
    let log = folder.read("log.csv");
    let without = |place: usize| -> String {
        let kept = |line: &str| {
            let cells = line.split(',').enumerate();
            let cells: Vec<&str> = cells.filter(|(i, _)| *i != place).map(|(_, c)| c).collect();
            cells.join(",") + "\n"
        };
        log.lines().map(kept).collect()
    };
    folder.write("log.csv", &without(1));
    let found = open(&folder, &["-o", "out.csv", "--plot", "out.svg"]);
    assert_eq!(
        found["errors"].as_object().map(serde_json::Map::len),
        Some(0)
    );
    assert!(
        found["notes"].to_string().contains("y has no errors"),
        "{found}"
    );
    let last = *column(&folder.read("out.csv"), "y").last().unwrap();
    assert_near(last, levels[5], 1e-8);
    folder.write("log.csv", &without(2));
    let ended = folder.run(&["simulate", "study.toml", "--inputs", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("no column \"u\""), "{}", ended.err);
}

/// A start of the simulated plant is not that of a log.
#[test]
fn it_starts_where_estimates_start_on_a_log() {
    let (folder, _) = known();
    let study = folder.read("study.toml");
    folder.write(
        "study.toml",
        &format!("{study}[simulate]\nuntil = 5\ninitial = {{ level = 4 }}\n[observer]\ninitial = {{ level = 3 }}\n"),
    );
    let found = open(&folder, &[]);
    assert_eq!(found["start"]["level"], 3.0);
    let told = "level starts at 3, where `estimate` and `fit` start on a log, and not at the 4 of `initial` in [simulate]";
    assert!(found["notes"].to_string().contains(told), "{found}");
    folder.change(
        "study.toml",
        "initial = { level = 3 }",
        "initial = { height = 3 }",
    );
    let ended = folder.run(&["simulate", "study.toml", "--inputs", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("names of estimated quantities"),
        "{}",
        ended.err
    );
}

/// A plant that leaves every bound is an answer, with the rows before.
#[test]
fn a_plant_that_diverges_is_told_with_the_rows_before() {
    let (folder, _) = known();
    folder.change("plant.mo", "u - leak - 0.2*level", "u - leak + 40*level");
    let command = [
        "simulate",
        "study.toml",
        "--inputs",
        "log.csv",
        "-o",
        "out.csv",
    ];
    let ended = folder.run(&command);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the plant alone leaves every bound: 'level'"),
        "{}",
        ended.err
    );
    let rows = folder.read("out.csv").lines().count();
    assert!((2..7).contains(&rows), "{rows}");
}

#[test]
fn what_does_not_go_with_a_log_is_refused() {
    let (folder, _) = known();
    for more in [["--runs", "3"], ["--seed", "1"], ["--log", "other.csv"]] {
        let command = ["simulate", "study.toml", "--inputs", "log.csv"];
        let ended = folder.run(&[&command[..], &more].concat());
        assert_eq!(ended.code, 2, "{}", ended.err);
        assert!(ended.err.contains("cannot be used with"), "{}", ended.err);
    }
    let same = [
        "simulate",
        "study.toml",
        "--inputs",
        "log.csv",
        "-o",
        "log.csv",
    ];
    let ended = folder.run(&same);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("would replace the log"), "{}", ended.err);
}
