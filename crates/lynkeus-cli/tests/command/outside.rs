//! A study that is not in its box, and estimates that nobody should believe.

use crate::{Folder, csv, examples};

/// An oscillator in a box of [−2, 2]², started at `start`; θ proves decay there.
fn oscillator(start: f64, simulate: &str) -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        &format!(
            "model M\n  Real x(start = {start}, min = -2, max = 2);\n  Real z(start = 0, min = -2, max = 2);\n  output Real y = x;\n\
             equation\n  der(x) = z;\n  der(z) = -x;\nend M;\n"
        ),
    );
    folder.write(
        "study.toml",
        &format!(
            "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 3\ninitial = {{ x = 1.1 }}\n{simulate}"
        ),
    );
    folder
}

const RUN: &str = "[simulate]\nuntil = 5\n";

#[test]
fn proved_is_never_said_alone_of_a_study_that_leaves_the_box() {
    for simulate in [RUN, ""] {
        let folder = oscillator(100.0, simulate);
        let ended = folder.run(&["certify", "study.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let first = ended.out.lines().next().unwrap();
        assert!(
            first.contains("but only inside the box, and the"),
            "{first}"
        );
        let said = match simulate {
            RUN => "simulated plant is outside of it at",
            _ => "plant starts outside of it, x = 100, box [-2, 2]",
        };
        assert!(first.contains(said), "{first}");
        assert!(!ended.out.contains(": proved\n"), "{}", ended.out);
        let json = folder.run(&["certify", "study.toml", "--json"]).json();
        let x = &json["certificate"]["outside_box"]["plant"]["quantities"]["x"];
        assert_eq!(
            (x["first"].as_f64(), x["value"].as_f64()),
            (Some(0.0), Some(100.0))
        );
        let notes = json["certificate"]["notes"].to_string();
        assert!(notes.contains("is for the box only, and the"), "{notes}");
        let text = folder.run(&["design", "study.toml"]).out;
        assert!(text.contains("but only inside the box"), "{text}");
    }
}

#[test]
fn a_study_that_stays_is_proved_without_a_word() {
    for simulate in [RUN, ""] {
        let folder = oscillator(1.0, simulate);
        let ended = folder.run(&["certify", "study.toml"]);
        assert!(
            ended.out.contains("proved") && !ended.out.contains("only inside"),
            "{}",
            ended.out
        );
        let json = folder.run(&["certify", "study.toml", "--json"]).json();
        let outside = &json["certificate"]["outside_box"];
        assert!(
            outside["plant"].is_null() && outside["estimate"].is_null(),
            "{outside}"
        );
    }
    // |x| ≤ 1 along the run, so the smaller box is the one that is left
    let folder = oscillator(1.0, &format!("{RUN}[box]\nz = [-0.5, 0.5]\n"));
    let json = folder.run(&["certify", "study.toml", "--json"]).json();
    let plant = &json["certificate"]["outside_box"]["plant"];
    // z = −sin t is below −0.5 from π/6 on
    let first = plant["quantities"]["z"]["first"].as_f64().unwrap();
    assert!(
        (first - std::f64::consts::FRAC_PI_6).abs() <= 0.01 + 1e-9,
        "{plant}"
    );
    assert!(plant["quantities"]["x"].is_null());
}

/// The plant really is where the estimate is: the box is too small, the estimate is right.
#[test]
fn an_estimate_of_a_plant_outside_is_told_and_not_refused() {
    let folder = oscillator(100.0, RUN);
    let ended = folder.run(&["simulate", "study.toml", "--json", "-o", "o.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the plant is outside of the declared box at"),
        "{}",
        ended.err
    );
    let json = ended.json();
    assert_eq!(json["credible"], true);
    // |100·cos t| ≤ 2 for 2·asin(0.02) around each of π/2 and 3π/2
    let inside = 4.0 * 0.02_f64.asin() / 5.0;
    let rows = json["outside_box"]["plant"]["quantities"]["x"]["rows"].as_f64();
    assert!((rows.unwrap() - (1.0 - inside)).abs() < 5e-3, "{rows:?}");
}

/// z' = 5z in a plant that is declared in [−1, 1]: with θ = 1 the error grows like e^(3t).
fn runaway(theta: f64, until: f64) -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M\n  Real x(start = 0, min = -1, max = 1);\n  Real z(start = 0, min = -1, max = 1);\n  output Real y = x;\n\
         equation\n  der(x) = z;\n  der(z) = 5*z;\nend M;\n",
    );
    folder.write(
        "study.toml",
        &format!(
            "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = {theta}\nS = [{{ diag = [1, 2], off = [-1] }}]\ninitial = {{ z = 0.1 }}\n\
             [simulate]\nuntil = {until}\noutput_step = 0.1\n"
        ),
    );
    folder
}

#[test]
fn an_estimate_that_runs_away_is_an_answer_no_with_its_table() {
    let folder = runaway(1.0, 5.5);
    let arguments = [
        "simulate",
        "study.toml",
        "-o",
        "o.csv",
        "--log",
        "l.csv",
        "--plot",
        "p.svg",
        "--json",
    ];
    let ended = folder.run(&arguments);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended.err.contains("the estimate is not credible: "),
        "{}",
        ended.err
    );
    assert!(
        ended.err.contains("try another (`lynkeus tune`)"),
        "{}",
        ended.err
    );
    let json = ended.json();
    assert_eq!(json["credible"], false);
    assert!(json["final"]["z"].as_f64().unwrap().abs() > 1e6, "{json}");
    let doubt = &json["doubts"][0];
    assert_eq!(
        (&doubt["kind"], &doubt["name"]),
        (&"range".into(), &"z".into())
    );
    assert_eq!(doubt["level"], "refusal");
    assert_eq!(csv(&folder.read("o.csv")).1.len(), 56);
    assert!(folder.files().contains(&"p.svg".to_owned()));

    let ended = folder.run(&["estimate", "study.toml", "l.csv", "--json", "-o", "e.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended.err.contains("the estimate is not credible: "),
        "{}",
        ended.err
    );
    assert_eq!(csv(&folder.read("e.csv")).1.len(), 56);
    let outside = &ended.json()["outside_box"]["estimate"]["quantities"]["z"];
    assert!(outside["rows"].as_f64().unwrap() > 0.7, "{outside}");

    // fast enough, the same is fine
    let folder = runaway(20.0, 5.5);
    let ended = folder.run(&arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let ended = folder.run(&["estimate", "study.toml", "l.csv", "-o", "e.csv", "--json"]);
    assert_eq!(
        (ended.code, &ended.json()["credible"]),
        (0, &true.into()),
        "{}",
        ended.err
    );
}

/// A replay whose log shows another plant: the hidden state leaves its range for good.
#[test]
fn a_log_of_another_plant_takes_the_estimate_out_of_the_box_for_good() {
    let folder = Folder::new();
    let log = folder.read("log.csv");
    let (header, rows) = csv(&log);
    assert_eq!(header, ["t", "level", "pump"]);
    let scaled = |factor: f64| {
        let rows = rows
            .iter()
            .map(|r| format!("{},{},{}\n", r[0], r[1] * factor, r[2]));
        header.join(",") + "\n" + &rows.collect::<String>()
    };
    // in centimetres instead of volts
    folder.write("log.csv", &scaled(6.25));
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "e.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(ended.err.contains("not credible"), "{}", ended.err);
    assert!(
        ended.err.contains("declare a wider min and max"),
        "{}",
        ended.err
    );
    folder.write("log.csv", &log);
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "e.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
}

/// A peak that comes back is told with its share of the rows, and allowed.
#[test]
fn peaking_is_told_and_allowed() {
    let path = examples().join("column");
    let out = tempfile::tempdir().unwrap();
    let table = out.path().join("o.csv").display().to_string();
    let arguments = ["simulate", "study-peaking.toml", "-o", &table, "--json"];
    let ended = crate::run(&path, &arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the estimate is outside of the declared box at"),
        "{}",
        ended.err
    );
    let (header, rows) = csv(&std::fs::read_to_string(&table).unwrap());
    let place = header.iter().position(|h| h == "Zf_hat").unwrap();
    let outside = rows
        .iter()
        .filter(|r| !(-1e-6..=1.0 + 1e-6).contains(&r[place]))
        .count();
    let share = ended.json()["outside_box"]["estimate"]["quantities"]["Zf"]["rows"].as_f64();
    assert_eq!(
        share.unwrap_or_default(),
        outside as f64 / rows.len() as f64
    );
    assert!(outside > 0);
}

/// With `prolong` the theorem covers every estimate; an undecided study that leaves is told of it.
#[test]
fn what_the_theorem_does_not_ask_for_is_not_held_against_it() {
    let study = |keys: &str| {
        let folder = oscillator(1.0, RUN);
        folder.change("study.toml", "initial = { x = 1.1 }", keys);
        folder.run(&["certify", "study.toml"]).out
    };
    let far = "initial = { z = 30 }";
    assert!(
        study(far).contains("simulated estimate is outside of it"),
        "{}",
        study(far)
    );
    // the faster rate is the inequality's, which has no prolonged functions
    let prolonged = study(&format!("{far}\nprolong = true"));
    let theorem = prolonged
        .lines()
        .find(|l| l.starts_with("Theorem 2"))
        .unwrap();
    assert!(theorem.ends_with(": proved"), "{theorem}");
    let inequality = prolonged
        .lines()
        .find(|l| l.starts_with("linear matrix"))
        .unwrap();
    assert!(
        inequality.ends_with(": proved inside the box"),
        "{inequality}"
    );
}

#[test]
fn an_undecided_study_that_leaves_is_told_of_it() {
    let folder = runaway(1.0, 5.0);
    let ended = folder.run(&["certify", "study.toml"]);
    assert!(
        !ended.out.lines().next().unwrap().contains("proved"),
        "{}",
        ended.out
    );
    assert!(
        ended
            .out
            .contains("note: the study leaves the box: the simulated estimate is outside of it at"),
        "{}",
        ended.out
    );
}

/// No figure for a value whose estimate runs away; where all do, the answer is no.
#[test]
fn tuning_takes_no_value_whose_estimate_runs_away() {
    let folder = runaway(20.0, 5.5);
    let log = [
        "simulate",
        "study.toml",
        "--log",
        "l.csv",
        "-o",
        "o.csv",
        "-q",
    ];
    assert_eq!(folder.run(&log).code, 0);
    let study = folder.read("study.toml");
    for (on, blocks) in [(vec![], ""), (vec!["--log", "l.csv"], "blocks = 4\n")] {
        let tune = |values: &str| {
            let keys = format!("[tune]\n{blocks}keys = {{ theta = {values} }}\n");
            folder.write("study.toml", &format!("{study}{keys}"));
            let arguments = [&["tune", "study.toml", "--json", "-q"], &on[..]].concat();
            folder.run(&arguments)
        };
        let ended = tune("[1, 20]");
        assert_eq!(ended.code, 0, "{}", ended.err);
        let json = ended.json();
        assert_eq!(json["knee"]["keys"]["theta"], 20.0);
        let reason = json["rows"][0]["failure"].as_str().unwrap();
        assert!(reason.contains("runs away"), "{reason}");
        assert!(json["rows"][1]["failure"].is_null());
        let ended = tune("[1, 1.1]");
        assert_eq!(ended.code, 1, "{}", ended.out);
        assert!(ended.err.contains("runs away"), "{}", ended.err);
    }
}
