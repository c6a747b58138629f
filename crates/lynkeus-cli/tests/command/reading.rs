//! Logs that do not come, and columns that are not what they are read as.

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::{Ended, Folder};

const TANK: &str = "model Tank
  input Real pump(start=1, min=0, max=10);
  output Real level(start=4, min=0.1, max=10);
equation
  der(level) = -0.3*level + pump;
end Tank;
";

const STUDY: &str = "plant = \"m.mo\"
[sensors]
measured = [\"level\"]
noise = { level = 0.05 }
[observer]
family = \"ekf\"
";

fn tank(study: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", TANK);
    folder.write("s.toml", study);
    folder
}

/// What a command says of what comes through its standard input, which is never closed.
fn waiting(folder: &Folder, arguments: &[&str], begins: &str) -> Ended {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .args(["--time-limit", "0.5"])
        .current_dir(folder.path.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(begins.as_bytes()).unwrap();
    let since = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(since.elapsed() < Duration::from_secs(20), "{arguments:?}");
    drop(input);
    Ended::new(&output)
}

#[test]
fn a_log_that_does_not_come_is_waited_for_as_long_as_allowed() {
    let folder = tank(STUDY);
    for (arguments, begins) in [
        (&["estimate", "s.toml", "-", "-o", "o.csv"][..], ""),
        (
            &["estimate", "s.toml", "-", "-o", "o.csv"],
            "t,level,pump\n0,4,1\n1,4,1\n",
        ),
        (&["compare", "s.toml", "-"], "t,level,pump\n"),
        (&["tune", "s.toml", "--log", "-"], ""),
        (&["report", "s.toml", "-", "-o", "o.html"], ""),
        (&["check", "-"], "plant = "),
    ] {
        let ended = waiting(&folder, arguments, begins);
        assert_eq!(ended.code, 3, "{arguments:?}: {}", ended.err);
        assert!(
            ended.err.contains("the limit of 0.5 s ended it"),
            "{}",
            ended.err
        );
    }
    assert_eq!(folder.files(), ["m.mo", "s.toml"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_that_nobody_writes_to_is_not_opened_for_ever() {
    let folder = tank(STUDY);
    let made = Command::new("mkfifo")
        .arg(folder.path.path().join("log.csv"))
        .status();
    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: no mkfifo");
        return;
    }
    let ended = waiting(
        &folder,
        &["estimate", "s.toml", "log.csv", "-o", "o.csv"],
        "",
    );
    assert_eq!(ended.code, 3, "{}", ended.err);
}

#[test]
fn a_log_without_end_is_read_as_long_as_allowed() {
    let folder = tank(STUDY);
    let rows: String = (0..50_000).map(|k| format!("{k},4,1\n")).collect();
    folder.write("log.csv", &format!("t,level,pump\n{rows}"));
    let ended = folder.run(&[
        "estimate",
        "s.toml",
        "log.csv",
        "-o",
        "o.csv",
        "--time-limit",
        "0",
    ]);
    assert_eq!(ended.code, 3, "{}", ended.err);
}

#[test]
fn readings_and_inputs_are_no_dates() {
    for (level, pump) in [(true, false), (false, true)] {
        let folder = tank(STUDY);
        let cell = |is_date: bool, k: usize| match is_date {
            true => format!("2026-01-01T00:00:0{k}"),
            false => "3.5".to_owned(),
        };
        let rows: String = (0..9)
            .map(|k| format!("{k},{},{}\n", cell(level, k), cell(pump, k)))
            .collect();
        folder.write("log.csv", &format!("t,level,pump\n{rows}"));
        for arguments in [
            &["estimate", "s.toml", "log.csv"][..],
            &["compare", "s.toml", "log.csv"],
        ] {
            let ended = folder.run(arguments);
            assert_ne!(ended.code, 0, "{arguments:?}");
            assert!(
                ended.err.contains("only times may be dates"),
                "{}",
                ended.err
            );
        }
    }
}

/// Three tanks in one log.
#[test]
fn rows_that_contradict_each_other_are_told_with_their_place() {
    let folder = tank(STUDY);
    let rows: String = (0..20)
        .flat_map(|k| [(k, 4.0, ""), (k, 4.5, "1"), (k, 4.0, "1")])
        .map(|(t, level, pump)| format!("{t},{level},{pump}\n"))
        .collect();
    folder.write("log.csv", &format!("t,level,pump\n{rows}"));
    let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.csv", "--json"]);
    let told = "warning: column \"level\" says different things at 20 times, first 4.5 in line 3 and 4 in line 4 at \"t\" = 0; the last one counts";
    assert!(ended.err.contains(told), "{}", ended.err);
    let warnings = ended.json()["warnings"].clone();
    assert_eq!(warnings.as_array().unwrap().len(), 1, "{warnings}");
    let compared = folder.run(&["compare", "s.toml", "log.csv"]);
    assert!(compared.err.contains(told), "{}", compared.err);
    // a row for each sensor says nothing twice
    let apart: String = (0..20).map(|k| format!("{k},4,\n{k},,1\n")).collect();
    folder.write("log.csv", &format!("t,level,pump\n{apart}"));
    let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.csv"]);
    assert!(!ended.err.contains("warning"), "{}", ended.err);
    folder.write("log.csv", &format!("t,level,pump\n{apart},5,1\n"));
    let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.csv"]);
    let told = "column \"level\": values in rows without a time, which count nowhere: 1";
    assert!(ended.err.contains(told), "{}", ended.err);
}

#[test]
fn a_log_in_no_order_is_refused() {
    let folder = tank(STUDY);
    let rows: String = (0..100)
        .map(|k| format!("{},4,1\n", k * 37 % 100))
        .collect();
    folder.write("log.csv", &format!("t,level,pump\n{rows}"));
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("the clock jumps back"), "{}", ended.err);
}

/// What a sensor reads is no truth to judge estimates by, whatever it is called.
#[test]
fn a_column_that_is_read_is_no_truth() {
    let folder = tank(STUDY);
    let rows: String = (0..50).map(|k| format!("{k},{},1\n", 3 + k % 2)).collect();
    folder.write("log.csv", &format!("t,level,pump\n{rows}"));
    let errors = |folder: &Folder| {
        let arguments = ["estimate", "s.toml", "log.csv", "-o", "o.csv", "--json"];
        folder.run(&arguments).json()["errors"].clone()
    };
    assert_eq!(errors(&folder), serde_json::json!({}));
    // nor where the sensor is called otherwise and reads that column
    let other = tank(&(STUDY.replace("level", "y") + "[estimate]\ncolumns = { y = \"level\" }\n"));
    let model = TANK.replace("output Real level", "Real level");
    other.write(
        "m.mo",
        &model.replace("equation", "  output Real y = level;\nequation"),
    );
    other.write("log.csv", &folder.read("log.csv"));
    assert_eq!(errors(&other), serde_json::json!({}));
    other.change("s.toml", "y = \"level\"", "y = \"sensor\"");
    let header = other.read("log.csv").replacen("level", "sensor,level", 1);
    let doubled = header.replace(",3,", ",3,3,").replace(",4,", ",4,4,");
    other.write("log.csv", &doubled);
    assert!(errors(&other)["level"].is_object());
}

/// A state may be called as the time of a log is, and as an output is.
#[test]
fn truth_of_a_simulation_stands_beside_its_log() {
    for (name, output) in [
        ("t", "  output Real y = t;\n"),
        ("time_2", "  output Real y = time_2;\n"),
        ("level", ""),
    ] {
        let folder = Folder::empty();
        let own = if output.is_empty() {
            "output Real"
        } else {
            "Real"
        };
        let model = TANK.replace("output Real", own).replace("level", name);
        folder.write(
            "m.mo",
            &model.replace("equation", &format!("{output}equation")),
        );
        let sensor = if output.is_empty() { name } else { "y" };
        let study = format!(
            "plant = \"m.mo\"\n[sensors]\nmeasured = [\"{sensor}\"]\nunknown = [\"pump\"]\nnoise = {{ {sensor} = 0.01 }}\n[observer]\nfamily = \"triangular\"\ntheta = 2\n[simulate]\nuntil = 5\noutput_step = 0.05\ninputs = {{ pump = 1 }}\n"
        );
        folder.write("s.toml", &study);
        let compared = folder.run(&["compare", "s.toml", "--json"]);
        assert_eq!(compared.code, 0, "{name}: {}", compared.err);
        let first = compared.json()["families"][0]["rms"].clone();
        assert!(
            first[name].is_number() && first["pump"].is_number(),
            "{first}"
        );
        for arguments in [
            &["report", "s.toml", "-o", "r.html", "-q"][..],
            &["export", "s.toml", "--to", "html", "-o", "page"],
        ] {
            let ended = folder.run(arguments);
            assert_eq!(ended.code, 0, "{name} {arguments:?}: {}", ended.err);
        }
    }
}

/// What a limit ended is no whole answer, for people and for programs.
#[test]
fn a_run_that_a_limit_ended_is_not_credible() {
    let folder = tank(STUDY);
    let own = folder.read("s.toml");
    for (simulate, more) in [
        ("until = 1e7\noutput_step = 0.1", &[][..]),
        ("until = 100\noutput_step = 1", &["--runs", "200000"]),
    ] {
        let simulate = format!("[simulate]\ninputs = {{ pump = 1 }}\n{simulate}\n");
        folder.write("s.toml", &(own.clone() + &simulate));
        let arguments = [
            "simulate",
            "s.toml",
            "-o",
            "o.csv",
            "--json",
            "--time-limit",
            "1",
        ];
        let ended = folder.run(&[&arguments[..], more].concat());
        if ended.out.is_empty() {
            // not one of many runs was done
            assert_eq!(ended.code, 3, "{}", ended.err);
            continue;
        }
        let json = ended.json();
        assert_eq!(
            (ended.code, json["credible"].as_bool()),
            (3, Some(false)),
            "{}",
            ended.err
        );
        assert_eq!(json["ended"]["by_limit"].as_bool(), Some(true), "{json}");
    }
}

/// What `estimate` refuses of a study `check` refuses, too.
#[test]
fn columns_of_derivatives_of_no_input_are_refused_by_check() {
    let study = format!("{STUDY}[estimate]\ninput_derivatives = {{ pmp = \"dp\" }}\n");
    let folder = tank(&study);
    folder.write("log.csv", "t,pump,level\n0,1,4\n1,1,4\n");
    for arguments in [&["check", "s.toml"][..], &["estimate", "s.toml", "log.csv"]] {
        let ended = folder.run(arguments);
        assert_eq!(ended.code, 2, "{arguments:?}: {}", ended.err);
        assert!(
            ended
                .err
                .contains("no known input is called \"pmp\"; did you mean \"pump\"?"),
            "{}",
            ended.err
        );
    }
}

/// One column is one signal.
#[test]
fn two_signals_of_one_column_are_refused() {
    let folder = tank(&format!(
        "{STUDY}[estimate]\ncolumns = {{ level = \"pump\" }}\n"
    ));
    folder.write("log.csv", "t,pump,level\n0,1,4\n1,1,4\n");
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    let said = "level and pump both read the column \"pump\"";
    assert!(ended.err.contains(said), "{}", ended.err);
}
