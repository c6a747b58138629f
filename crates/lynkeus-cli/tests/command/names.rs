//! Whatever a model's variables are called: no number changes, and no header is there twice.

use std::collections::HashSet;

use serde_json::Value;

use crate::{Ended, Folder, csv, examples};

/// A folder with the files of an example, one name in them replaced.
fn renamed(example: &str, files: &[&str], from: &str, to: &str) -> Folder {
    let folder = Folder::empty();
    for file in files {
        let text = std::fs::read_to_string(examples().join(example).join(file)).unwrap();
        folder.write(file, &whole_words(&text, from, to));
    }
    folder
}

fn whole_words(text: &str, from: &str, to: &str) -> String {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut result = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(from) {
        let (before, after) = (&rest[..at], &rest[at + from.len()..]);
        result.push_str(before);
        let inside = before.ends_with(is_part) || after.starts_with(is_part);
        result.push_str(if inside { from } else { to });
        rest = after;
    }
    result + rest
}

/// Header and rows; every header is there once.
fn table(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let (header, rows) = csv(text);
    let different: HashSet<&String> = header.iter().collect();
    assert_eq!(different.len(), header.len(), "{header:?}");
    (header, rows)
}

fn ran(folder: &Folder, arguments: &[&str]) -> Ended {
    let ended = folder.run(arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    ended
}

/// The numbers of a JSON object, in order, whatever its keys are.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Number(x) => vec![x.as_f64().unwrap()],
        Value::Array(all) => all.iter().flat_map(numbers).collect(),
        Value::Object(all) => all.values().flat_map(numbers).collect(),
        _ => vec![],
    }
}

const TANKS: [&str; 2] = ["two_tanks.mo", "study.toml"];

#[test]
fn a_renamed_state_of_the_tanks_changes_no_number() {
    let simulate = [
        "simulate",
        "study.toml",
        "-o",
        "o.csv",
        "--log",
        "l.csv",
        "--json",
    ];
    let usual = renamed("two-tanks", &TANKS, "upper", "upper");
    let usual_json = ran(&usual, &simulate).json();
    ran(&usual, &["estimate", "study.toml", "l.csv", "-o", "e.csv"]);
    for name in [
        "lower_hat",
        "pump_hat",
        "level_measured",
        "t",
        "time_hat",
        "lower_hat_2",
        "knee",
    ] {
        let folder = renamed("two-tanks", &TANKS, "upper", name);
        let json = ran(&folder, &simulate).json();
        for key in ["final", "rms_error_last_half"] {
            assert_eq!(numbers(&json[key]), numbers(&usual_json[key]), "{name}");
        }
        ran(&folder, &["estimate", "study.toml", "l.csv", "-o", "e.csv"]);
        for file in ["o.csv", "l.csv", "e.csv"] {
            let (header, rows) = table(&folder.read(file));
            let (_, usual) = table(&usual.read(file));
            assert_eq!(rows, usual, "{name} in {file}: {header:?}");
        }
        // what the estimate's column is called is told
        let column = json["estimates"]["lower"].as_str().unwrap();
        let columns: Vec<&str> = json["columns"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c.as_str().unwrap())
            .collect();
        assert_eq!(
            columns.iter().position(|c| *c == column),
            Some(5),
            "{columns:?}"
        );
    }
}

/// A parameter of a part, with the subscript of that part in its name, as compilers write it.
#[test]
fn a_parameter_of_a_part_takes_its_value_from_the_study() {
    let simulate = ["simulate", "study.toml", "-o", "o.csv"];
    let of_part = || renamed("two-tanks", &TANKS, "k4", "pumps[1].gain");
    let usual = of_part();
    ran(&usual, &simulate);
    let written = of_part();
    let model = written.read("two_tanks.mo");
    written.write("two_tanks.mo", &model.replace("0.03037", "0.03"));
    ran(&written, &simulate);
    let given = of_part();
    let study = given.read("study.toml") + "\n[parameters]\n\"pumps[1].gain\" = 0.03\n";
    given.write("study.toml", &study);
    ran(&given, &simulate);
    assert_eq!(given.read("o.csv"), written.read("o.csv"));
    assert_ne!(given.read("o.csv"), usual.read("o.csv"));
}

#[test]
fn tuning_judges_by_the_estimate_whatever_the_state_is_called() {
    let tune = ["tune", "study.toml", "--json", "-q"];
    let few = |folder: &Folder| {
        let study = folder.read("study.toml") + "\n[tune]\nkeys = { theta = [0.03, 0.08] }\n";
        folder.write("study.toml", &study);
    };
    let usual = renamed("two-tanks", &TANKS, "upper", "upper");
    few(&usual);
    let usual_json = ran(&usual, &tune).json();
    assert!(usual_json["knee"]["noise_gain"].as_f64().unwrap() > 1.0);
    for name in ["lower_hat", "level_measured"] {
        let folder = renamed("two-tanks", &TANKS, "upper", name);
        few(&folder);
        assert_eq!(
            ran(&folder, &tune).json()["rows"],
            usual_json["rows"],
            "{name}"
        );
    }
}

/// A state called as the monitor is: the alarm is the monitor's.
#[test]
fn alarms_are_the_monitors() {
    for (example, model, study, state, monitor, alarm) in [
        (
            "germani-manes",
            "germani_manes.mo",
            "practical.toml",
            "x3",
            "rcond",
            0.225,
        ),
        (
            "ltaief",
            "ltaief.mo",
            "study-frozen.toml",
            "x2",
            "excitation",
            6.1,
        ),
    ] {
        let folder = renamed(example, &[model, study], state, monitor);
        let ended = ran(
            &folder,
            &[
                "simulate", study, "-o", "o.csv", "--plot", "p.svg", "--json",
            ],
        );
        let found = &ended.json()["monitors"][monitor];
        assert!(
            (found["alarm_at"].as_f64().unwrap() - alarm).abs() < 1e-9,
            "{found}"
        );
        let other = format!("{monitor}_2");
        assert_eq!(found["column"], other);
        let (header, _) = table(&folder.read("o.csv"));
        assert_eq!(header.last(), Some(&other));
        assert!(
            ended.err.contains(&format!("{other} fell below")),
            "{}",
            ended.err
        );
        assert!(
            folder
                .read("p.svg")
                .contains(&format!("{other} (alarm below"))
        );
    }
}

/// An output called as another state: the sensor shows the output, noise included.
#[test]
fn a_state_called_like_a_measurement_is_none() {
    let folder = Folder::empty();
    let model = |name: &str| {
        format!(
            "model M\n  Real x(start = 1, min = -2, max = 2);\n  Real {name}(start = 2, min = -3, max = 3);\n  output Real y = x;\n\
             equation\n  der(x) = -x + {name};\n  der({name}) = -{name};\nend M;\n"
        )
    };
    folder.write(
        "study.toml",
        "plant = \"m.mo\"\n[sensors]\nnoise = { y = 0.1 }\n[observer]\ntheta = 3\n[simulate]\nuntil = 1\noutput_step = 0.25\nseed = 1\n",
    );
    let mut logs = vec![];
    for name in ["z", "y_measured", "y_hat", "t"] {
        folder.write("m.mo", &model(name));
        ran(
            &folder,
            &["simulate", "study.toml", "-o", "o.csv", "--log", "l.csv"],
        );
        logs.push(folder.read("l.csv"));
    }
    let (header, rows) = table(&logs[0]);
    assert_eq!(header, ["t", "y"]);
    assert!(
        (rows[0][1] - 1.0).abs() < 0.5 && rows[0][1] != 1.0,
        "{rows:?}"
    );
    assert!(logs.iter().all(|log| *log == logs[0]));
}

/// What `simulate --log` writes is what `estimate` reads, whatever is called t.
#[test]
fn a_log_is_read_back_whatever_is_called_t() {
    let logs = |from: &str, to: &str, more: &str| {
        let folder = renamed("two-tanks", &TANKS, from, to);
        folder.change(
            "study.toml",
            "[estimate]\n",
            &format!("[estimate]\n{more}\n"),
        );
        ran(
            &folder,
            &[
                "simulate",
                "study.toml",
                "-o",
                "o.csv",
                "--log",
                "l.csv",
                "-q",
            ],
        );
        ran(
            &folder,
            &["estimate", "study.toml", "l.csv", "-o", "e.csv", "-q"],
        );
        let header = |file: &str| table(&folder.read(file)).0[0].clone();
        let (log, estimates) = (header("l.csv"), header("e.csv"));
        (log, estimates, table(&folder.read("e.csv")).1)
    };
    let (log, estimates, usual) = logs("level", "level", "");
    assert_eq!((log.as_str(), estimates.as_str()), ("t", "t"));
    for (from, to, more, time) in [
        ("level", "t", "", "time"),
        ("pump", "t", "", "time"),
        ("level", "t", "time = \"zeit\"", "zeit"),
        ("level", "t", "columns = { t = \"AI-101\" }", "t"),
        (
            "level",
            "level",
            "time = \"zeit\"\ncolumns = { level = \"t\" }",
            "zeit",
        ),
    ] {
        let (log, _, rows) = logs(from, to, more);
        assert_eq!(log, time, "{from} as {to}, {more}");
        if from != "level" || to == "level" {
            assert_eq!(rows, usual);
        }
    }
}

#[test]
fn two_of_one_header_in_a_log_are_refused_by_name() {
    let folder = Folder::new();
    let with = |more: &str| {
        let folder = renamed("two-tanks", &TANKS, "level", "level");
        folder.change(
            "study.toml",
            "[estimate]\n",
            &format!("[estimate]\n{more}\n"),
        );
        folder
    };
    let ended =
        with("columns = { level = \"pump\" }").run(&["simulate", "study.toml", "--log", "l.csv"]);
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("two columns \"pump\""), "{}", ended.err);
    let shared = with("time = \"level\"");
    shared.write("log.csv", &folder.read("log.csv"));
    let ended = shared.run(&["estimate", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .err
            .contains("the column \"level\" cannot be both time and \"level\""),
        "{}",
        ended.err
    );
    // the default header where the log has none
    folder.write(
        "log.csv",
        &folder.read("log.csv").replacen("t,", "zeit,", 1),
    );
    let ended = folder.run(&["estimate", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("no time column \"t\""), "{}", ended.err);
}

/// The true value of a hidden state is taken from a log that happens to have it, and from
/// nothing else: not from time, and not from one of two columns.
#[test]
fn the_truth_in_a_log_is_a_column_of_its_own() {
    let judged = |name: &str, header: &str| {
        let folder = renamed("two-tanks", &TANKS, "upper", name);
        let shipped = Folder::new().read("log.csv");
        let mut lines = shipped.lines();
        lines.next();
        let rows = lines.map(|line| format!("{line},5,6\n"));
        folder.write(
            "log.csv",
            &format!("{header}\n{}", rows.collect::<String>()),
        );
        let json = ran(&folder, &["estimate", "study.toml", "log.csv", "--json"]).json();
        json["rms_error_last_half"][name].as_f64()
    };
    assert!(judged("upper", "t,level,pump,upper,other").is_some());
    assert_eq!(judged("upper", "t,level,pump,upper,upper"), None);
    assert_eq!(judged("t", "t,level,pump,upper,other"), None);
}

/// `check --how-well` has a column of its own, too.
#[test]
fn the_horizon_gives_way_to_a_state_of_that_name() {
    let folder = renamed("two-tanks", &TANKS, "upper", "horizon");
    let arguments = ["check", "study.toml", "--how-well", "-o", "h.csv", "--json"];
    let json = folder.run(&arguments).json();
    let (header, rows) = table(&folder.read("h.csv"));
    assert_eq!(header, ["horizon_2", "horizon", "lower", "pump"]);
    let over = &json["over_horizon"];
    assert_eq!(over["horizon_2"][1].as_f64(), Some(rows[1][0]));
    let last = rows.len() - 1;
    let error = over["horizon"][last].as_f64().unwrap();
    assert!((error / rows[last][1] - 1.0).abs() < 1e-9, "{error}");
}

/// A table spells out what a terminal would obey; a log that is so written is read back.
#[test]
fn a_log_of_names_with_control_characters_is_read_back() {
    let folder = Folder::empty();
    let plant = "model M
  input Real 'u\ttab'(start=0);
  Real p(start=1,min=-5,max=5);
  Real v(start=0,min=-5,max=5);
  output Real 'y\t\u{1b}[31m' = p;
equation
  der(p) = v;
  der(v) = -p - 0.5*v + 'u\ttab';
end M;
";
    folder.write("m.mo", plant);
    let study = "plant = \"m.mo\"\n[observer]\nfamily = \"ekf\"\n[simulate]\nuntil = 2\noutput_step = 0.1\n";
    folder.write("s.toml", study);
    for log in ["log.csv", "log.parquet"] {
        let ended = folder.run(&["simulate", "s.toml", "--log", log, "-o", "out.csv"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let ended = folder.run(&["estimate", "s.toml", log]);
        assert_eq!(ended.code, 0, "{log}: {}", ended.err);
        assert_eq!(ended.out.lines().count(), 22);
    }
    assert!(
        folder
            .read("log.csv")
            .starts_with("t,y\\t\\u{1b}[31m,u\\ttab\n")
    );
}
