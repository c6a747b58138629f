//! `lynkeus tune`.

use crate::{Folder, examples};

/// The column with these lines added, its text as shipped otherwise.
fn column(study: &str, tune: &str) -> Folder {
    let folder = Folder::empty();
    for file in ["column.mo", study] {
        let text = std::fs::read_to_string(examples().join("column").join(file)).unwrap();
        folder.write(if file == study { "study.toml" } else { file }, &text);
    }
    let text = folder.read("study.toml");
    folder.write("study.toml", &format!("{text}\n[tune]\n{tune}\n"));
    folder
}

/// What the paper says of θ: 3.5 is good, 4.2 sensitive to noise, 4.8 peaks.
#[test]
fn the_column_is_judged_as_the_paper_does() {
    for study in ["study.toml", "study-noise.toml"] {
        let folder = column(study, "keys = { theta = [2.1, 2.8, 3.5, 4.2, 4.8] }");
        let ended = folder.run(&[
            "tune",
            "study.toml",
            "--json",
            "-o",
            "t.csv",
            "--plot",
            "t.svg",
        ]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let answer = ended.json();
        assert_eq!(answer["knee"]["keys"]["theta"], 3.5, "{study}");
        let figure = |row: usize, name: &str| answer["rows"][row][name].as_f64().unwrap();
        assert!(answer["rows"][0]["settling_time"].is_null(), "too slow");
        assert!(figure(3, "noise_gain") > 2.0 * figure(2, "noise_gain"));
        assert!(figure(4, "peak_error") > 15.0 && figure(2, "peak_error") < 3.0);
        let peak = &answer["rows"][4]["peak"];
        assert_eq!(peak["name"], "Zf");
        assert!(peak["estimate"].as_f64().unwrap() < -14.0, "{peak}");
        assert!(folder.read("t.svg").contains("knee, and the study: 3.5"));
        assert_eq!(folder.read("t.csv").lines().count(), 6);
    }
}

#[test]
fn the_chosen_value_is_written_and_nothing_else() {
    let folder = Folder::new();
    let text = folder.read("study.toml") + "[tune]  # coarse\nkeys = { theta = [0.03, 0.08] }\n";
    folder.write("study.toml", &text);
    let ended = folder.run(&["tune", "study.toml", "--write"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended.out.contains("study.toml: theta: 0.03 becomes 0.08"),
        "{}",
        ended.out
    );
    let expected = text.replace("theta = 0.03 ", "theta = 0.08 ");
    assert_eq!(folder.read("study.toml"), expected);
}

#[test]
fn a_log_is_judged_by_what_it_holds_out() {
    let folder = Folder::new();
    let text = folder.read("study.toml") + "[tune]\nkeys = { theta = [0.01, 0.08, 0.4] }\n";
    folder.write("study.toml", &text);
    let ended = folder.run(&["tune", "study.toml", "--log", "log.csv", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["knee"]["keys"]["theta"], 0.08, "{answer:#}");
    let white = |row: usize| answer["rows"][row]["ljung_box"].as_f64().unwrap();
    assert!(white(0) > 5.0 * white(1));
}

#[test]
fn what_diverges_is_a_row_and_all_of_it_the_answer_no() {
    let folder = column("study.toml", "keys = { theta = [3.5, 40] }");
    let ended = folder.run(&["tune", "study.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert!(answer["rows"][1]["failure"].is_string() && answer["rows"][1]["mean_error"].is_null());
    folder.change("study.toml", "[3.5, 40]", "[40]");
    let ended = folder.run(&["tune", "study.toml"]);
    assert_eq!(ended.code, 1);
    assert!(
        ended.err.contains("no value of theta gives an estimate"),
        "{}",
        ended.err
    );
}

#[test]
fn a_disturbance_raises_the_bound_and_wrong_keys_are_refused() {
    let folder = column(
        "study.toml",
        "keys = { theta = [3.5] }\ndisturbance = { Zf = \"0.1*sin(2*time)\" }",
    );
    let ended = folder.run(&["tune", "study.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let bound = ended.json()["knee"]["ultimate_bound"].as_f64().unwrap();
    assert!((0.01..0.5).contains(&bound), "{bound}");
    for (from, to, words) in [
        ("Zf = \"0.1*", "Zg = \"0.1*", "no input named \"Zg\""),
        (
            "theta = [3.5] }",
            "tehta = [3.5] }",
            "no family has a key \"tehta\"",
        ),
        (
            "tehta = [3.5] }",
            "theta = 3 }",
            "a list of values, or a range",
        ),
        ("keys = {", "kyes = {", "unknown key \"kyes\" in [tune]"),
    ] {
        folder.change("study.toml", from, to);
        let ended = folder.run(&["tune", "study.toml"]);
        assert_eq!(ended.code, 2, "{}", ended.err);
        if words.contains("Zg") {
            folder.change("study.toml", "Zg = \"0.1*", "Zf = \"0.1*");
        }
        assert!(ended.err.contains(words), "{}", ended.err);
        assert!(ended.err.contains("study.toml:"), "{}", ended.err);
    }
}

/// θ = 0.05 is too slow for the triangular family and for a run of 40, and not so four times of it: the
/// family that is taken for the study is that of every value.
#[test]
fn a_sweep_is_of_one_family() {
    let model = "model M input Real u(min = -1, max = 1); Real x(start = 0, min = -9, max = 9); Real v(start = 0, min = -9, max = 9);
      output Real y = x; equation der(x) = v; der(v) = u; end M;";
    let study = "plant = \"m.mo\"\nobserver = { theta = 0.05, initial = { x = 1 } }\nsensors = { noise = { y = 0.01 } }\nsimulate = { until = 40, output_step = 0.2, inputs = { u = \"sin(time)\" } }\n";
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("auto.toml", study);
    let ended = folder.run(&["tune", "auto.toml", "-o", "auto.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let taken = folder.run(&["check", "auto.toml", "--json"]).json();
    let taken = taken["recommended"].as_str().unwrap().to_owned();
    assert_ne!(taken, "triangular", "nothing is shown");
    assert!(
        ended
            .err
            .contains(&format!("every value is one of the family {taken}")),
        "{}",
        ended.err
    );
    let named = study.replace("theta =", &format!("family = \"{taken}\", theta ="));
    folder.write("named.toml", &named);
    let ended = folder.run(&["tune", "named.toml", "-o", "named.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.read("auto.csv"), folder.read("named.csv"));
}
