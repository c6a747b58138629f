//! Noises that cannot be, damaged logs, a full disk: one clear line each, and no result.

use super::Folder;
use super::families::copied;

const PLANT: &str = "model M input Real u(min = -1, max = 1);
  Real x(start = 0.5, min = -5, max = 5); Real v(start = 0, min = -5, max = 5);
  output Real y = x; equation der(x) = v; der(v) = u - 0.5*v - x; end M;";

fn folder(sensors: &str, observer: &str, rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", PLANT);
    let study = format!(
        "plant = \"m.mo\"\nsensors = {{ {sensors} }}\nobserver = {{ family = \"ekf\"{observer} }}\nsimulate = {{ until = 20, output_step = 0.05, inputs = {{ u = \"0\" }} }}\n{rest}\n"
    );
    folder.write("study.toml", &study);
    folder
}

/// Exit code 2, the words in one line, and nothing written.
fn refuses(folder: &Folder, arguments: &[&str], words: &[&str]) {
    let ended = folder.run(&[arguments, &["-o", "result.csv"]].concat());
    assert_eq!(ended.code, 2, "{}", ended.err);
    let lines: Vec<&str> = ended.err.lines().collect();
    let [line] = lines[..] else {
        panic!("{}", ended.err)
    };
    assert!(line.starts_with("error: "), "{line}");
    words
        .iter()
        .for_each(|word| assert!(line.contains(word), "{word:?} in {line}"));
    assert!(!folder.path.path().join("result.csv").exists());
}

#[test]
fn noises_that_cannot_be() {
    for (sensors, observer, rest, words) in [
        ("noise = { y = -0.02 }", "", "", ["study.toml:2:", "-0.02"]),
        ("noise = { y = \"-5%\" }", "", "", ["study.toml:2:", "-5%"]),
        (
            "noise = { z = 0.02 }",
            "",
            "",
            ["study.toml:2:", "choose from: y"],
        ),
        (
            "limits = { z = [0, 1] }",
            "",
            "",
            ["study.toml:2:", "\"z\""],
        ),
        (
            "",
            ", initial_variance = { x = -1 }",
            "",
            ["study.toml:3:", "x = -1"],
        ),
        (
            "",
            ", initial_variance = { q = 1 }",
            "",
            ["study.toml:3:", "(x, v)"],
        ),
        ("", ", gate = -1", "", ["study.toml:3:", "found -1"]),
        (
            "",
            ", gate_patience = 0",
            "",
            ["study.toml:3:", "whole number"],
        ),
        (
            "",
            "",
            "process_noise = { x = -1 }",
            ["study.toml:5:", "found -1"],
        ),
        (
            "",
            "",
            "process_noise = { q = 1 }",
            ["study.toml:5:", "x, v"],
        ),
    ] {
        let folder = folder(sensors, observer, rest);
        refuses(&folder, &["simulate", "study.toml"], &words);
    }
}

/// A window has no row older than its horizon.
#[test]
fn a_lag_beyond_the_window() {
    let log = "t,y,u\n0,0,0\n0.1,0.1,0\n0.2,0.2,0\n";
    for (lag, horizon) in [(11, ""), (3, ", horizon = 2")] {
        let folder = folder(
            "noise = { y = 0.1 }",
            horizon,
            &format!("estimate = {{ lag = {lag} }}"),
        );
        folder.change("study.toml", "\"ekf\"", "\"mhe\"");
        folder.write("log.csv", log);
        let found = format!("found {lag}");
        refuses(
            &folder,
            &["estimate", "study.toml", "log.csv"],
            &["raise `horizon`", &found],
        );
    }
}

#[test]
fn a_parquet_file_that_is_cut_short() {
    let folder = folder("noise = { y = 0.1 }", "", "");
    let made = folder.run(&[
        "simulate",
        "study.toml",
        "--log",
        "log.parquet",
        "-o",
        "a.csv",
    ]);
    assert_eq!(made.code, 0, "{}", made.err);
    let whole = std::fs::read(folder.path.path().join("log.parquet")).unwrap();
    for length in [0, 3, 700, whole.len() - 1] {
        std::fs::write(folder.path.path().join("cut.parquet"), &whole[..length]).unwrap();
        let words = ["cut.parquet: ", "damaged or cut short"];
        refuses(&folder, &["estimate", "study.toml", "cut.parquet"], &words);
    }
}

/// Standard output and a result that have no room.
#[cfg(target_os = "linux")]
#[test]
fn a_device_that_is_full() {
    let folder = folder("noise = { y = 0.1 }", "", "");
    let script = format!(
        "exec '{}' simulate study.toml -o - > /dev/full",
        env!("CARGO_BIN_EXE_lynkeus")
    );
    let mut shell = std::process::Command::new("sh");
    let output = shell
        .args(["-c", &script])
        .current_dir(&folder.path)
        .output();
    let ended = super::Ended::new(&output.unwrap());
    let device = folder.run(&["simulate", "study.toml", "-o", "/dev/full"]);
    for (ended, words) in [
        (ended, "error: cannot write to standard output: "),
        (device, "error: cannot write /dev/full: "),
    ] {
        assert_eq!(ended.code, 2, "{}", ended.err);
        let errors: Vec<&str> = ended
            .err
            .lines()
            .filter(|l| l.starts_with("error"))
            .collect();
        assert_eq!(errors.len(), 1, "{}", ended.err);
        assert!(errors[0].starts_with(words), "{}", ended.err);
    }
}

/// What stands after `theta =` cannot be used: `check` says so of a family that is named, as `design` does.
#[test]
fn a_wrong_theta_of_a_named_family_is_refused_by_check() {
    for (study, given, wrong) in [
        ("two-tanks/study.toml", "theta = 0.09", "[0.09, 0.05]"),
        ("lee/study.toml", "theta = [3, 9]", "[3, 3, 3, 3, 3, 3, 3]"),
        ("ltaief/study.toml", "theta = 10", "[10]"),
        ("farza/study.toml", "theta = [60, 15]", "60"),
    ] {
        let (folder, file) = copied(study);
        let right = folder.read(&file);
        assert!(right.contains(given), "{study}: {right}");
        assert_eq!(folder.run(&["check", &file]).code, 0, "{study}");
        for found in ["true", "\"abc\"", "-1", "0", "{ a = 1 }", wrong] {
            folder.write(
                &file,
                &right.replacen(given, &format!("theta = {found}"), 1),
            );
            let [check, design] = ["check", "design"].map(|verb| folder.run(&[verb, &file]));
            assert_eq!(check.code, 2, "{study}, {found}: {}", check.out);
            assert!(
                check.err.contains("`theta` of [observer]: expected"),
                "{}",
                check.err
            );
            assert_eq!(check.err, design.err, "{study}, {found}");
        }
    }
    // S(0) and the alarm of another family are read as late
    let (folder, file) = copied("ltaief/study.toml");
    folder.change(&file, "S0 = 1", "S0 = [[1, 0], [0, 1]]\nalarm = -1");
    let check = folder.run(&["check", &file]);
    assert_eq!(check.code, 2, "{}", check.out);
    assert!(check.err.contains("`S0` of [observer]"), "{}", check.err);
}
