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

/// The sweep of a study on a log, as JSON.
fn swept(folder: &Folder, study: &str, log: &str) -> serde_json::Value {
    let ended = folder.run(&["tune", study, "--log", log, "--json"]);
    assert_eq!(ended.code, 0, "{log}: {}", ended.err);
    ended.json()
}

/// A log with those cells of a column empty, by data row.
fn emptied(text: &str, header: &str, is_empty: impl Fn(usize) -> bool) -> String {
    let mut lines = text.lines();
    let head = lines.next().unwrap();
    let place = head.split(',').position(|h| h == header).unwrap();
    let row = |(row, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if is_empty(row) {
            cells[place] = "";
        }
        cells.join(",") + "\n"
    };
    format!("{head}\n") + &lines.enumerate().map(row).collect::<String>()
}

/// About three of ten, without a pattern.
fn is_unlucky(row: usize) -> bool {
    (row as u64 + 1).wrapping_mul(6_364_136_223_846_793_005) >> 33 & 0xffff < 0x4ccd
}

/// Two sensors, one of which loses three of ten readings or reports ten times more seldom.
#[test]
fn gaps_and_a_slow_sensor_leave_the_knee_where_it_is() {
    let folder = column("study-noise.toml", "keys = { theta = [2, 3, 3.5, 4.2] }");
    let recorded = folder.run(&["simulate", "study.toml", "--log", "full.csv", "-o", "o.csv"]);
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let full = folder.read("full.csv");
    let rows = full.lines().count() - 1;
    let lost = (0..rows).filter(|row| is_unlucky(*row)).count() as f64 / rows as f64;
    assert!((0.25..0.35).contains(&lost), "{lost}");
    folder.write("missing.csv", &emptied(&full, "bottom", is_unlucky));
    let is_between = |row: usize| !row.is_multiple_of(10);
    folder.write("slow.csv", &emptied(&full, "bottom", is_between));
    let study = folder.read("study.toml");
    for between in ["hold", "predict", "linear"] {
        let estimate = format!("{study}[estimate]\nbetween_samples = \"{between}\"\n");
        folder.write("study.toml", &estimate);
        for log in ["full.csv", "missing.csv", "slow.csv"] {
            let answer = swept(&folder, "study.toml", log);
            let good = answer["nearly_as_good"].as_array().unwrap();
            let ends = [0, 1].map(|i| good[i].as_f64().unwrap());
            assert!(
                (ends[0]..=ends[1]).contains(&3.5),
                "{between} {log}: {answer:#}"
            );
            let innovation = |row: usize| answer["rows"][row]["innovation"].as_f64().unwrap();
            assert!(innovation(0) > 1.2 * innovation(2), "{between} {log}");
        }
    }
}

/// Rows without readings change nothing but how the way is cut into steps.
#[test]
fn a_slow_sensor_is_judged_as_the_log_of_its_readings() {
    let folder = Folder::new();
    folder.change("study.toml", "\"linear\"", "\"predict\"");
    let keys = "[tune]\nkeys = { theta = [0.02, 0.03, 0.04, 0.05] }\n";
    folder.write("study.toml", &(folder.read("study.toml") + keys));
    let log = folder.read("log.csv");
    folder.write(
        "slow.csv",
        &emptied(&log, "level", |row| !row.is_multiple_of(10)),
    );
    let is_reading = |(line, _): &(usize, &str)| *line == 0 || (line - 1).is_multiple_of(10);
    let lines = log.lines().enumerate().filter(is_reading);
    let kept: String = lines.map(|(_, line)| line.to_owned() + "\n").collect();
    folder.write("kept.csv", &kept);
    let slow = swept(&folder, "study.toml", "slow.csv");
    let kept = swept(&folder, "study.toml", "kept.csv");
    for row in 0..4 {
        for figure in ["held_out_error", "innovation", "ljung_box", "outside_band"] {
            let [a, b] = [&slow, &kept].map(|sweep| sweep["rows"][row][figure].as_f64().unwrap());
            assert!((a - b).abs() <= 1e-4 * b, "{figure}: {a} is not {b}");
        }
    }
}

#[test]
fn late_repeated_and_timeless_rows_change_no_figure() {
    let folder = Folder::new();
    let keys = "[tune]\nkeys = { theta = [0.03, 0.08] }\n";
    folder.write("study.toml", &(folder.read("study.toml") + keys));
    let log = folder.read("log.csv");
    let mut lines: Vec<&str> = log.lines().collect();
    for row in (20..900).step_by(37) {
        lines.swap(row, row + 3);
    }
    lines.insert(500, ",5.0,3");
    lines.insert(100, lines[100]);
    folder.write("late.csv", &(lines.join("\n") + "\n"));
    let (whole, late) = (
        swept(&folder, "study.toml", "log.csv"),
        swept(&folder, "study.toml", "late.csv"),
    );
    assert_eq!(whole["rows"], late["rows"]);
    let notes = late["notes"].to_string();
    for told in ["came late", "repeat a time", "have no time"] {
        assert!(notes.contains(told), "{notes}");
    }
    // a study that is strict takes none of it
    let strict = folder
        .read("study.toml")
        .replace("[estimate]", "[estimate]\nstrict = true");
    folder.write("study.toml", &strict);
    let ended = folder.run(&["tune", "study.toml", "--log", "late.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("must hold a finite number"),
        "{}",
        ended.err
    );
}

/// A laboratory's two values, both in the first block, judge nothing, and are told of.
#[test]
fn a_sensor_that_is_not_scored_is_told_of() {
    let folder = column("study-noise.toml", "keys = { theta = [3, 3.5] }");
    let recorded = folder.run(&["simulate", "study.toml", "--log", "full.csv", "-o", "o.csv"]);
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let few = emptied(&folder.read("full.csv"), "bottom", |row| row > 1);
    folder.write("few.csv", &few);
    let answer = swept(&folder, "study.toml", "few.csv");
    let notes = answer["notes"].to_string();
    assert!(
        notes.contains("no reading of bottom is held out after the first block"),
        "{notes}"
    );
    assert!(answer["rows"][0]["held_out_error"].as_f64().unwrap() > 0.0);
    let none_left = emptied(&folder.read("full.csv"), "bottom", |row| row != 59);
    folder.write("none.csv", &none_left);
    let ended = folder.run(&["tune", "study.toml", "--log", "none.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.out);
    assert!(
        ended.err.contains("every reading of bottom is held out"),
        "{}",
        ended.err
    );
}

/// Whatever else the study lacks: what to sweep, or the filter's name.
#[test]
fn a_filter_is_refused() {
    let folder = Folder::empty();
    let study = "plant = \"m.mo\"\nprocess_noise = { x = 0.1 }\nsensors = { noise = { y = 0.1 } }\nsimulate = { until = 9, output_step = 0.1 }\n";
    let model = |y: &str| {
        format!(
            "model M Real x(start = 1, min = -9, max = 9); output Real y = {y}; equation der(x) = -x; end M;"
        )
    };
    let named = "observer = { family = \"ekf\" }\n";
    for (y, rest) in [
        (
            "x",
            format!("{named}tune = {{ keys = {{ gate = [3, 5] }} }}\n"),
        ),
        ("x", named.to_owned()),
        // nothing but a filter fits
        ("x^2", String::new()),
        ("x^2", "tune = { keys = { gate = [3, 5] } }\n".to_owned()),
    ] {
        folder.write("m.mo", &model(y));
        folder.write("s.toml", &format!("{study}{rest}"));
        let ended = folder.run(&["tune", "s.toml"]);
        assert_eq!(ended.code, 2, "{}", ended.out);
        assert!(ended.err.contains("the filter \"ekf\""), "{}", ended.err);
    }
}

/// The study has no θ: the picture must not say that it has.
#[test]
fn a_value_that_is_proposed_is_not_the_studys() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M input Real u(min = 0, max = 2, start = 1); Real x(start = 1, min = -9, max = 9); Real z(start = 1, min = -9, max = 9); output Real y = x; equation der(x) = z - x; der(z) = u - z; end M;",
    );
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nsimulate = { until = 9, output_step = 0.1 }\n",
    );
    let ended = folder.run(&["tune", "s.toml", "--json", "--plot", "t.svg"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.json()["present"]["theta"].is_null(), "{}", ended.out);
    assert!(!folder.read("t.svg").contains("study"));
    let proposed = ended.json()["notes"][0].as_str().unwrap().to_owned();
    assert!(proposed.starts_with("theta = "), "{proposed}");
    let value = proposed.split_whitespace().nth(2).unwrap();
    folder.change(
        "s.toml",
        "sensors",
        &format!("observer = {{ theta = {value} }}\nsensors"),
    );
    let ended = folder.run(&["tune", "s.toml", "--json", "--plot", "t.svg"]);
    assert_eq!(ended.json()["present"]["theta"].to_string(), value);
    assert!(folder.read("t.svg").contains("study"));
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
