//! What succeeds.

use std::f64::consts::{PI, TAU};

use crate::{Folder, csv, examples, run};

#[test]
fn a_log_becomes_estimates_and_a_picture() {
    let folder = Folder::new();
    let ended = folder.run(&[
        "estimate",
        "study.toml",
        "log.csv",
        "-o",
        "e.csv",
        "--plot",
        "e.svg",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("looks ahead one sample"));
    let (header, rows) = csv(&folder.read("e.csv"));
    assert_eq!(header, ["t", "upper_hat", "lower_hat", "pump_hat"]);
    assert_eq!(rows.len(), csv(&folder.read("log.csv")).1.len());
    let svg = folder.read("e.svg");
    for word in ["pump: Pump voltage (V)", "time (s)", "estimated", "true"] {
        assert!(svg.contains(word), "{word}");
    }
    assert_eq!(
        folder.files(),
        ["e.csv", "e.svg", "log.csv", "study.toml", "two_tanks.mo"]
    );
}

/// With constant input the estimates converge to the simulated truth.
#[test]
fn simulate_gives_truth_and_estimates_by_name() {
    let folder = Folder::new();
    folder.change("study.toml", "noise = { level = 0.02 }", "");
    let (start, end) = (folder.read("study.toml"), "inputs = { pump = 3 }");
    let line = start.lines().find(|l| l.starts_with("inputs")).unwrap();
    folder.change("study.toml", line, end);
    let ended = folder.run(&["simulate", "study.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&ended.out);
    assert_eq!(
        header,
        [
            "t",
            "upper",
            "lower",
            "pump",
            "upper_hat",
            "lower_hat",
            "pump_hat"
        ]
    );
    let last = rows.last().unwrap();
    for state in 1..=3 {
        assert!((last[state] - last[state + 3]).abs() < 1e-6, "{last:?}");
    }
}

#[test]
fn the_shipped_log_is_what_simulate_writes() {
    let folder = Folder::new();
    let shipped = folder.read("log.csv");
    let ended = folder.run(&[
        "simulate",
        "study.toml",
        "--log",
        "again.csv",
        "-o",
        "all.csv",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let ((header, shipped), (again_header, again)) =
        (csv(&shipped), csv(&folder.read("again.csv")));
    assert_eq!(header, again_header);
    for (row, same) in shipped.iter().zip(&again) {
        for (x, y) in row.iter().zip(same) {
            assert!((x - y).abs() <= 1e-9 * x.abs().max(1.0), "{x} against {y}");
        }
    }
}

#[test]
fn the_seed_decides_the_noise() {
    let folder = Folder::new();
    let noisy = |seed: &str| folder.run(&["simulate", "study.toml", "--seed", seed]).out;
    assert_eq!(noisy("7"), noisy("7"));
    assert_ne!(noisy("7"), noisy("8"));
}

#[test]
fn json_sums_up() {
    let folder = Folder::new();
    let json = folder.run(&["simulate", "study.toml", "--json"]).json();
    assert_eq!(json["family"], "triangular");
    assert_eq!(json["columns"][6], "pump_hat");
    assert!(json["final"]["pump"].is_number() && json["rms_error_last_half"]["upper"].is_number());
    let json = folder.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(json["recommended"], "triangular");
    assert_eq!(json["families"][0]["chains"][0][2], "pump");
    assert_eq!(json["visible"]["upper"], true);
}

/// r θ^{jδ} (S⁻¹Cᵀ)_j with the paper's S: the last gain of the first chain is
/// 3.5⁷·0.0009.
#[test]
fn design_gives_the_gains_of_the_column() {
    let folder = examples().join("column");
    let json = run(&folder, &["design", "study.toml", "--json"]).json();
    let gain = |state: &str, output: &str| json["gain"][state][output].as_f64().unwrap();
    assert!((gain("x[1]", "top") - 3.5 * 0.7610).abs() < 2e-4);
    assert!((gain("x[7]", "top") / 3.5f64.powi(7) - 0.0009).abs() < 5e-5);
    assert!((gain("Zf", "bottom") / 3.5f64.powf(6.0 * 14.0 / 11.0) - 0.0029).abs() < 5e-5);
}

/// A logger's own names, a semicolon and decimal commas.
#[test]
fn other_headers_are_mapped_by_the_study() {
    let folder = Folder::new();
    let log = folder
        .read("log.csv")
        .replace('.', "#")
        .replace(',', ";")
        .replace('#', ",");
    folder.write("log.csv", &log.replacen("t;level;pump", "zeit;AI-101;u", 1));
    let end = "[estimate]\ntime = \"zeit\"\ncolumns = { level = \"AI-101\", pump = \"u\" }";
    folder.change("study.toml", "[estimate]", end);
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "e.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
}

/// A pipe given as output is written to and stays one; a link stays a link.
#[cfg(unix)]
#[test]
fn what_is_no_ordinary_file_is_never_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = Folder::new();
    let pipe = folder.path.path().join("pipe.csv");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read_to_string(pipe).unwrap()
    });
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "pipe.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(reader.join().unwrap().starts_with("t,upper_hat"));
    assert!(
        std::fs::symlink_metadata(&pipe)
            .unwrap()
            .file_type()
            .is_fifo()
    );

    folder.write("real.csv", "");
    let link = folder.path.path().join("link.csv");
    std::os::unix::fs::symlink("real.csv", &link).unwrap();
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "link.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(link.is_symlink() && folder.read("real.csv").starts_with("t,upper_hat"));
}

/// Two rows far apart: the pulses between them are counted all the same.
#[test]
fn simulate_loses_no_pulse_of_an_input() {
    let sine = {
        let (rise, turns) = (0.9_f64.asin(), (7.0 * 3600.0 / TAU).floor());
        let width = PI - 2.0 * rise;
        let last = (7.0 * 3600.0 - turns * TAU).clamp(rise, PI - rise) - rise;
        (turns * width + last) / 7.0
    };
    let cases = [
        ("if mod(time, 10) < 1 then 1 else 0", 86_400.0, 8640.0),
        ("if sin(7*time) > 0.9 then 1 else 0", 3600.0, sine),
        (
            "if time > 1000 and time < 1000.001 then 1000 else 0",
            3000.0,
            1.0,
        ),
    ];
    let folder = Folder::empty();
    folder.write(
        "vessel.mo",
        "model Vessel\n  input Real u;\n  output Real y;\n  Real x(start = 0);\n\
         equation\n  der(x) = u;\n  y = x;\nend Vessel;\n",
    );
    for (input, until, expected) in cases {
        folder.write("study.toml", &vessel(input, until));
        let ended = folder.run(&["simulate", "study.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let (header, rows) = csv(&ended.out);
        assert_eq!((header[1].as_str(), rows.len()), ("x", 2));
        let error = (rows[1][1] / expected - 1.0).abs();
        assert!(error < 1e-6, "{input}: {} not {expected}", rows[1][1]);
    }
    folder.write("study.toml", &vessel("floor(1e15*time)", 10.0));
    let ended = folder.run(&["simulate", "study.toml"]);
    assert_ne!(ended.code, 0);
    assert!(ended.err.contains("`floor(time*1"), "{}", ended.err);
}

fn vessel(input: &str, until: f64) -> String {
    format!(
        "plant = \"vessel.mo\"\n\n[sensors]\nmeasured = [\"y\"]\n\n\
         [observer]\nfamily = \"triangular\"\ntheta = 1\nS = [{{ diag = [1], off = [] }}]\n\n\
         [simulate]\nuntil = {until}\noutput_step = {until}\ninputs = {{ u = \"{input}\" }}\n"
    )
}

/// What the errors are is told after a simulation, in words and for machines, and agrees with the
/// table.
#[test]
fn a_simulation_sums_its_errors_up() {
    let folder = Folder::new();
    let ended = folder.run(&["simulate", "study.toml", "-o", "run.csv", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&folder.read("run.csv"));
    let place = |name: &str| header.iter().position(|h| h == name).unwrap();
    let errors = |name: &str| -> Vec<f64> {
        let (x, hat) = (place(name), place(&format!("{name}_hat")));
        rows.iter().map(|row| (row[hat] - row[x]).abs()).collect()
    };
    for (name, width) in [("pump", 10.0), ("upper", 6.0)] {
        let told = &ended.json()["errors"][name];
        let errors = errors(name);
        let late = &errors[errors.len() / 2..];
        let rms = (late.iter().map(|e| e * e).sum::<f64>() / late.len() as f64).sqrt();
        assert!((told["rms_last_half"].as_f64().unwrap() / rms - 1.0).abs() < 1e-6);
        let peak = errors[1..].iter().copied().fold(0.0, f64::max);
        assert!((told["peak"].as_f64().unwrap() / peak - 1.0).abs() < 1e-6);
        let settled = told["settled_at"].as_f64().unwrap();
        let row = rows.iter().position(|row| row[0] == settled).unwrap();
        assert!(errors[row - 1] > 0.05 * width && errors[row..].iter().all(|e| *e <= 0.05 * width));
        assert!(
            ended.err.contains(&format!("note: error of {name}: RMS ")),
            "{}",
            ended.err
        );
    }
}

/// Bands where there are deviations, a line for what later rows say, and the output that is no
/// state against what the estimate says of it.
#[test]
fn the_picture_says_how_sure_and_what_later_rows_say() {
    let folder = Folder::new();
    folder.change("two_tanks.mo", "= lower \"", "= 2*lower \"");
    folder.change(
        "study.toml",
        "[estimate]",
        "[process_noise]\npump = 2e-4\n[estimate]",
    );
    let text = folder.read("study.toml");
    let observer = text.find("[observer]").unwrap();
    let simulate = text.find("[simulate]").unwrap();
    let ekf = format!(
        "{}[observer]\nfamily = \"ekf\"\n{}",
        &text[..observer],
        &text[simulate..]
    );
    folder.write(
        "s.toml",
        &ekf.replace(
            "show = [\"pump\", \"upper\", \"lower\"]",
            "show = [\"level\"]",
        ),
    );
    let picture = || {
        let ended = folder.run(&["simulate", "s.toml", "--plot", "p.svg", "-q"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        folder.read("p.svg")
    };
    let plain = picture();
    assert!(plain.contains("measured") && plain.contains("estimated"));
    assert!(!plain.contains("2 sd") && !plain.contains("smoothed"));
    folder.change("s.toml", "show = [\"level\"]", "show = [\"pump\"]");
    folder.change(
        "s.toml",
        "[estimate]",
        "[estimate]\nsd = true\nsmooth = true",
    );
    let sure = picture();
    assert!(sure.contains("± 2 sd") && sure.contains("smoothed") && sure.contains("<polygon"));
}

/// An assertion of the model is followed along the run, and its warnings are told.
#[test]
fn assertions_are_followed() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M Real x(start = 0, min = -9, max = 9, unit = \"m\"); input Real u(unit = \"s\"); output Real y = x;\n\
         equation der(x) = u; assert(x < 2.5, \"too far\"); assert(x > -1, \"never\"); end M;",
    );
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 2\n[simulate]\nuntil = 4\noutput_step = 0.5\ninputs = { u = 1 }\n",
    );
    let ended = folder.run(&["simulate", "s.toml", "-o", "o.csv"]);
    let told = "the plant breaks the assertion on line 2 of the model (\"too far\") at 4 of 9 rows, first at t = 2.5";
    assert!(ended.err.contains(told), "{}", ended.err);
    assert!(!ended.err.contains("never"), "{}", ended.err);
    assert!(ended.err.contains("m.mo:2:"), "{}", ended.err);
    let report = folder.run(&["check", "s.toml"]);
    assert!(report.out.contains("warning"), "{}", report.out);
    // parameters in the condition, while another one is calibrated
    folder.change(
        "m.mo",
        "model M",
        "model M parameter Real k = 1; parameter Real most = 2.5;",
    );
    folder.change("m.mo", "= u; assert(x < 2.5", "= k*u; assert(x < most");
    folder.change(
        "s.toml",
        "[observer]",
        "[sensors]\nunknown = [\"k\"]\nnoise = { y = 0.1 }\n[observer]",
    );
    folder.change("s.toml", "\"triangular\"\ntheta = 2", "\"ekf\"");
    let ended = folder.run(&["simulate", "s.toml", "-o", "o.csv"]);
    assert!(ended.err.contains(told), "{}", ended.err);
}

/// The runs of a portion are reckoned from the time that is left.
#[test]
fn a_limit_of_time_may_be_any() {
    let folder = Folder::new();
    let fixed = "seed = 1\nmethod = \"rk4\"\nstep = 4";
    folder.change("study.toml", "seed = 1", fixed);
    let many = ["simulate", "study.toml", "-q", "--json", "--runs", "20"];
    let ended = folder.run(&[&many[..], &["--time-limit", "1e18"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(ended.json()["completed"], 20);
}

/// The table, the words, the picture and the object of many runs; one of them alone is the same.
#[test]
fn many_runs_give_bands() {
    let folder = Folder::new();
    folder.change(
        "study.toml",
        "seed = 1",
        "seed = 1\nspread = { upper = 0.2, k1 = 0.001 }",
    );
    let ended = folder.run(&[
        "simulate",
        "study.toml",
        "--runs",
        "6",
        "-q",
        "-o",
        "b.csv",
        "--plot",
        "b.svg",
        "--json",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let found = ended.json();
    assert_eq!(
        (&found["runs"], &found["completed"]),
        (&6.into(), &6.into())
    );
    let (header, rows) = csv(&folder.read("b.csv"));
    assert_eq!(header.len(), 1 + 3 * 7);
    assert_eq!(header[1..4], ["upper_mean", "upper_q05", "upper_q95"]);
    assert_eq!(header[7], "upper_error_worst");
    assert_eq!(rows.len(), 1001);
    // the start that is spread; the observer's is not
    assert!(rows[0][3] - rows[0][2] > 0.1, "{:?}", rows[0]);
    let svg = folder.read("b.svg");
    for word in ["error of pump", "5–95 %", "worst run", "mean"] {
        assert!(svg.contains(word), "{word}");
    }
    let pump = &found["quantities"]["pump"]["rms_last_half"];
    let seed = pump["worst_seed"].to_string();
    let alone = folder.run(&["simulate", "study.toml", "--seed", &seed, "-q", "--json"]);
    assert_eq!(alone.json()["rms_error_last_half"]["pump"], pump["worst"]);
    let told = folder.run(&["simulate", "study.toml", "--runs", "2", "-q"]);
    assert!(
        told.out.contains("2 of 2 runs to the end") && told.out.contains("95 % below"),
        "{}",
        told.out
    );
    let tight = ["--runs", "1000000", "--memory-limit", "300"];
    let refused = folder.run(&[&["simulate", "study.toml", "-q"], &tight[..]].concat());
    assert_eq!(refused.code, 2);
    assert!(refused.err.contains("output_step"), "{}", refused.err);
    assert_eq!(
        folder.run(&["simulate", "study.toml", "--runs", "0"]).code,
        2
    );
}
