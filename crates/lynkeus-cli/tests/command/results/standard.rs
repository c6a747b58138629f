//! "-" is standard input or output, a picture that cannot be drawn takes nothing with it, and no
//! text of a file commands a terminal.

use std::io::Write;
use std::process::{Command, Stdio};

use crate::{Ended, Folder};

/// The command with a text as its standard input.
fn fed(folder: &Folder, arguments: &[&str], text: &str) -> Ended {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .current_dir(&folder.path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    // a command that refuses does not read
    let _ = input.write_all(text.as_bytes());
    drop(input);
    Ended::new(&child.wait_with_output().unwrap())
}

#[test]
fn every_result_can_be_printed() {
    let folder = Folder::new();
    let files = folder.files();
    for (arguments, start) in [
        (
            vec!["simulate", "study.toml", "--log", "-"],
            "t,level,pump\n",
        ),
        (vec!["simulate", "study.toml", "-o", "-"], "t,"),
        (
            vec!["simulate", "study.toml", "--log", "-", "--plot", "p.svg"],
            "t,level,pump\n",
        ),
        (vec!["simulate", "study.toml", "--plot", "-"], "<svg"),
        (vec!["design", "study.toml", "-o", "-", "--json"], "{"),
        (
            vec!["check", "study.toml", "--how-well", "--plot", "-"],
            "<svg",
        ),
        (
            vec!["tune", "study.toml", "--plot", "-", "-o", "t.csv"],
            "<svg",
        ),
    ] {
        let ended = folder.run(&arguments);
        assert_eq!(ended.code, 0, "{arguments:?}: {}", ended.err);
        assert!(
            ended.out.starts_with(start),
            "{arguments:?}: {:.80}",
            ended.out
        );
        let tables = ended.out.lines().filter(|line| line.starts_with("t,"));
        assert!(tables.count() <= 1, "{arguments:?}");
    }
    let mut expected = [files, vec!["p.svg".to_owned(), "t.csv".to_owned()]].concat();
    expected.sort();
    assert_eq!(folder.files(), expected);
}

#[test]
fn two_results_do_not_mix() {
    let folder = Folder::new();
    for options in [
        ["--json", "-o", "-"].as_slice(),
        &["--plot", "-", "-o", "-"],
        &["--plot", "-", "--log", "-"],
    ] {
        let arguments = [&["simulate", "study.toml"], options].concat();
        super::refused(
            &folder,
            &arguments,
            &["only one result", "standard output", options[0]],
        );
    }
}

#[test]
fn a_log_and_a_study_can_be_piped() {
    let folder = Folder::new();
    let expected = folder.run(&["estimate", "study.toml", "log.csv"]);
    let piped = fed(
        &folder,
        &["estimate", "study.toml", "-"],
        &folder.read("log.csv"),
    );
    assert_eq!(
        (piped.code, &piped.out),
        (0, &expected.out),
        "{}",
        piped.err
    );
    let piped = fed(
        &folder,
        &["estimate", "-", "log.csv"],
        &folder.read("study.toml"),
    );
    assert_eq!(
        (piped.code, &piped.out),
        (0, &expected.out),
        "{}",
        piped.err
    );
    let both = fed(&folder, &["estimate", "-", "-"], "");
    assert_eq!(both.code, 2);
    assert!(both.err.contains("standard input"), "{}", both.err);
    let none = fed(&folder, &["tune", "-", "--write"], "");
    assert!(
        none.code == 2 && none.err.contains("--write"),
        "{}",
        none.err
    );
}

#[test]
fn a_picture_that_cannot_be_drawn_takes_no_table_with_it() {
    let folder = Folder::new();
    let log = folder.read("log.csv");
    let one_row: Vec<&str> = log.lines().take(2).collect();
    folder.write("one.csv", &one_row.join("\n"));
    let estimate = ["estimate", "study.toml", "one.csv", "--plot", "p.svg"];
    let expected = folder.run(&["estimate", "study.toml", "one.csv"]).out;
    assert_eq!(expected.lines().count(), 2);

    let ended = folder.run(&[&estimate[..], &["-o", "e.csv"]].concat());
    assert_eq!((ended.code, ended.out.as_str()), (1, ""));
    assert!(ended.err.contains("nothing to draw"), "{}", ended.err);
    assert_eq!(folder.read("e.csv"), expected);
    // nothing else was asked for: the table is printed, as without --plot
    let ended = folder.run(&estimate);
    assert_eq!((ended.code, ended.out), (1, expected));
    let ended = folder.run(&[&estimate[..], &["--json"]].concat());
    assert_eq!((ended.code, ended.json()["rows"].as_u64()), (1, Some(1)));
    assert!(!folder.path.path().join("p.svg").exists());
}

/// A picture of what nothing is called is a mistake in the study: nothing is computed.
#[test]
fn a_picture_of_nobody_is_refused_at_once() {
    let folder = Folder::new();
    folder.change("study.toml", "show = [", "show = [\"nobody\", ");
    let estimate = ["estimate", "study.toml", "log.csv", "-o", "w.csv"];
    let ended = folder.run(&estimate);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("nothing is called \"nobody\""),
        "{}",
        ended.err
    );
    assert!(!folder.path.path().join("w.csv").exists());
}

#[test]
fn no_text_of_a_file_commands_a_terminal() {
    let folder = Folder::new();
    let is_command = |c: char| c.is_control() && c != '\n';
    let harmless = |ended: &Ended| {
        assert!(!ended.err.contains(is_command), "{:?}", ended.err);
        assert!(!ended.out.contains(is_command), "{:?}", ended.out);
    };
    folder.write("key.toml", "[observer]\n\"\\u001b[31mtheta\" = 1\n");
    folder.write("cell.csv", "t,level,pump\n0,\u{1b}[2J,1\n");
    folder.write("header.csv", "t,\u{1b}[2Jlevel,pu\u{9b}31mmp\n0,1,1\n");
    folder.write(
        "names.mo",
        "model 'M\u{1b}[31m'\n Real 'x\u{7}\u{9b}1m'(start=1,min=-2,max=2,unit=\"\u{1b}[2J\") \"\u{8}\";\n output Real y='x\u{7}\u{9b}1m';\nequation\n der('x\u{7}\u{9b}1m')=-'x\u{7}\u{9b}1m';\nend 'M\u{1b}[31m';\n",
    );
    folder.write(
        "names.toml",
        "plant='names.mo'\nobserver={theta=1,initial={default=0}}\nsimulate.until=1\nplot={time_unit=\"<&\\u0007\"}\n",
    );
    for arguments in [
        ["check", "key.toml", "--json"],
        ["check", "names.toml", "--json"],
        ["design", "names.toml", "--json"],
        ["simulate", "names.toml", "--json"],
    ] {
        harmless(&folder.run(&arguments[..2]));
        let ended = folder.run(&arguments);
        harmless(&ended);
        assert!(arguments[1] == "key.toml" || ended.json().is_object());
    }
    harmless(&folder.run(&["estimate", "study.toml", "cell.csv"]));
    harmless(&folder.run(&["estimate", "study.toml", "header.csv"]));
    harmless(&folder.run(&["check", "no\u{1b}[31m.toml"]));

    let ended = folder.run(&["simulate", "names.toml", "--plot", "p.svg"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let svg = folder.read("p.svg");
    assert!(!svg.contains(is_command) && svg.contains("\\u{7}"), "{svg}");
}

#[test]
fn a_setting_is_the_studys_fault_not_the_logs() {
    let folder = Folder::new();
    let line = "method = \"rk4\"";
    folder.change("study.toml", line, "rtol = 1e300");
    let text = folder.read("study.toml");
    let line = text
        .lines()
        .position(|line| line.starts_with("rtol"))
        .unwrap()
        + 1;
    let ended = folder.run(&["estimate", "study.toml", "log.csv"]);
    let place = format!("error: study.toml:{line}:8: `rtol` of [estimate]");
    assert_eq!(ended.code, 2);
    assert!(ended.err.starts_with(&place), "{}", ended.err);
    assert!(
        ended.err.contains("[1e-13, 0.1], found 1e300"),
        "{}",
        ended.err
    );
}

/// However the threads go, the message is that of the first faulty value, and at its place.
#[test]
fn a_faulty_value_of_a_sweep_is_blamed_where_it_stands() {
    let folder = Folder::new();
    let text = folder.read("study.toml");
    let keys = "[tune]\nkeys = { theta = [0.03, 0.02, -1, -2] }\n";
    folder.write("study.toml", &format!("{text}\n{keys}"));
    let line = text.lines().count() + 3;
    for _ in 0..6 {
        let ended = folder.run(&["tune", "study.toml", "-q"]);
        assert_eq!(ended.code, 2);
        let place = format!("error: study.toml:{line}:10: `theta`");
        assert!(ended.err.starts_with(&place), "{}", ended.err);
        assert!(ended.err.contains("found -1"), "{}", ended.err);
    }
}
