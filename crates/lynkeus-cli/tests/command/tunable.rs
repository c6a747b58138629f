//! `export --tunable`: an estimator whose θ is changed while it runs gives what `estimate` gives of a study
//! with that θ.

use std::path::Path;
use std::process::Command;

use crate::export::{Run, compiled, densities, difference, estimated, has, replayed, without};
use crate::{Folder, examples, skipped};

/// Text of a study in place of another, that has to be there.
type Change = (&'static str, &'static str);

struct Case {
    example: &'static str,
    study: &'static str,
    /// before anything is done with the study
    setting: &'static [Change],
    /// what makes the other study
    change: Change,
    /// what makes the other estimator
    arguments: &'static [&'static str],
}

const CASES: [Case; 11] = [
    // divided by the partials, one chain
    Case {
        example: "two-tanks",
        study: "study.toml",
        setting: &[],
        change: ("theta = 0.09", "theta = 0.05"),
        arguments: &["theta=0.05"],
    },
    // two chains, exponents that are no whole numbers, remedies against peaking
    Case {
        example: "column",
        study: "study-noise.toml",
        setting: &[(
            "\ntheta = 3.5",
            "\ninnovation_limit = 0.01\ntransient = { theta = 5, until = 0.1, fall = 0.2 }\ntheta = 3.5",
        )],
        change: ("\ntheta = 3.5", "\ntheta = [4.5, 4]"),
        arguments: &["theta[1]=4.5", "theta[2]=4"],
    },
    Case {
        example: "flexible-joint",
        study: "study-low-power.toml",
        setting: &[],
        change: ("theta = 90", "theta = 60"),
        arguments: &["theta=60"],
    },
    Case {
        example: "lee",
        study: "study.toml",
        setting: &[],
        change: ("theta = [3, 9] ", "theta = [4, 20] "),
        arguments: &["theta[1]=4", "theta[2]=20"],
    },
    Case {
        example: "lee",
        study: "classical.toml",
        setting: &[("k = [[2, 1], [2, 1]]", "form = \"low-power\"")],
        change: ("theta = [3, 9] ", "theta = [2, 5] "),
        arguments: &["theta[2]=5", "theta[1]=2"],
    },
    // θ in an equation for S, too
    Case {
        example: "ltaief",
        study: "study.toml",
        setting: &[],
        change: ("theta = 10", "theta = 7"),
        arguments: &["theta=7"],
    },
    Case {
        example: "bioreactor",
        study: "study.toml",
        setting: &[],
        change: ("[1.5, 0.7]", "[2.5, 0.5]"),
        arguments: &["theta[1]=2.5", "theta[2]=0.5"],
    },
    // an input filter with poles of its own, and one that follows
    Case {
        example: "germani-manes",
        study: "practical.toml",
        setting: &[("[5, 0]", "[5, 12.5]")],
        change: ("[-4, -4.8, -5.76]", "[-5, -6, -7.2]"),
        arguments: &["pole_scale=1.25"],
    },
    Case {
        example: "germani-manes",
        study: "practical.toml",
        setting: &[("[5, 0]", "[5, 12.5]"), ("filter_poles = [-40, -48]\n", "")],
        change: ("[-4, -4.8, -5.76]", "[-5, -6, -7.2]"),
        arguments: &["pole_scale=1.25"],
    },
    Case {
        example: "farza",
        study: "study-noise.toml",
        setting: &[],
        change: ("[60, 15]", "[40, 20]"),
        arguments: &["theta[1]=40", "theta[2]=20"],
    },
    Case {
        example: "van-der-pol-pair",
        study: "study.toml",
        setting: &[],
        change: ("theta = 4 ", "theta = 6 "),
        arguments: &["theta=6"],
    },
];

fn changed(text: &str, (from, to): Change) -> String {
    assert!(text.contains(from), "{from} in {text}");
    text.replace(from, to)
}

/// `s.toml` and `log.csv` of a case.
fn prepared(folder: &Folder, case: &Case) -> String {
    folder.copy_models(case.example);
    let file = examples().join(case.example).join(case.study);
    let study = without(&std::fs::read_to_string(file).unwrap(), "[estimate]");
    let setting = case.setting.iter();
    let study = setting.fold(study, |study, change| changed(&study, *change));
    simulated(folder, &study);
    let sd = study.contains("\nnoise");
    // without process noise, whose covariance over a step is singular but for rounding
    let wandering = densities(&study, 0.0);
    study + &wandering + &format!("\n[estimate]\nmethod = \"rk4\"\nsubsteps = 4\nsd = {sd}\n")
}

fn simulated(folder: &Folder, study: &str) {
    folder.write("s.toml", study);
    let made = folder.run(&["simulate", "s.toml", "--log", "w.csv", "-o", "r.csv", "-q"]);
    assert!(made.code < 2, "{}", made.err);
    let whole = folder.read("w.csv");
    let rows = whole.lines().take(130).map(|line| format!("{line}\n"));
    folder.write("log.csv", &rows.collect::<String>());
}

fn exported(folder: &Folder, more: &[&str]) -> String {
    let asked = ["export", "s.toml", "--to", "c", "-o", "c", "--force"];
    let made = folder.run(&[&asked[..], more].concat());
    assert_eq!(made.code, 0, "{}", made.err);
    made.err
}

/// The same for the study and the estimator as they are, and once both are changed.
fn compare(folder: &Folder, study: &str, other: &str, arguments: &[&str], name: &str) {
    let path = folder.path.path();
    folder.write("s.toml", study);
    exported(folder, &[]);
    compiled(path, &[]);
    let plain = replayed(path, &[]);
    let told = exported(folder, &["--tunable"]);
    for argument in arguments {
        let number = argument.split('=').next().unwrap();
        assert!(told.contains(number), "{name}: {told}");
    }
    compiled(path, &["-fsanitize=address,undefined"]);
    let own = replayed(path, &[]);
    let off = difference(&plain, &own, name);
    assert!(off <= 0.0, "{name}: not the same to the bit, {off:e}");
    let off = difference(&estimated(path).unwrap(), &own, name);
    assert!(off <= 1e-12, "{name}: {off:e}");
    folder.write("s.toml", other);
    let expected = estimated(path).unwrap();
    let off = difference(&expected, &replayed(path, arguments), name);
    assert!(off <= 1e-12, "{name}, changed: {off:e}");
    let moved = difference(&expected, &own, name);
    assert!(moved > 1e-4, "{name}: the change is seen, {moved:e}");
}

#[test]
fn a_change_gives_what_estimate_gives_of_the_changed_study() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    for case in &CASES {
        let folder = Folder::empty();
        let study = prepared(&folder, case);
        let other = changed(&study, case.change);
        let name = format!("{} {}", case.example, case.study);
        compare(&folder, &study, &other, case.arguments, &name);
    }
}

const FILTER: &str = r#"
plant = "two_tanks.mo"
[sensors]
measured = ["level"]
unknown = ["pump"]
noise = { level = 0.02 }
[process_noise]
upper = 1e-5
lower = 2e-5
pump = 1e-3
[observer]
family = "ekf"
[simulate]
until = 600
output_step = 4
inputs = { pump = "3 + sin(time/50)" }
"#;

const NOISIER: [Change; 3] = [("1e-5", "3e-5"), ("2e-5", "6e-5"), ("1e-3", "3e-3")];

#[test]
fn process_noise_can_be_scaled() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::new();
    simulated(&folder, FILTER);
    for family in ["ekf", "ukf"] {
        let estimate = "[estimate]\nmethod = \"rk4\"\nsubsteps = 4\nsd = true\n";
        let study = FILTER.replace("ekf", family) + estimate;
        let other = NOISIER.iter().fold(study.clone(), |s, c| changed(&s, *c));
        compare(&folder, &study, &other, &["process_noise_scale=3"], family);
    }
    // where there is none, there is nothing to scale
    let still = ["1e-5", "2e-5", "1e-3"];
    let still = still
        .iter()
        .fold(FILTER.to_owned(), |s, q| s.replace(q, "0"));
    folder.write("s.toml", &still);
    let told = exported(&folder, &["--tunable"]);
    assert!(told.contains("nothing may be changed"), "{told}");
    assert!(!folder.read("c/twotanks.h").contains("TUNABLES"));
}

#[test]
fn what_is_no_number_above_0_is_refused() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    let study = prepared(&folder, &CASES[0]);
    folder.write("s.toml", &study);
    exported(&folder, &["--tunable"]);
    compiled(folder.path.path(), &[]);
    let header = folder.read("c/twotanks.h");
    assert!(
        header.contains("0  theta θ of the gain of level; 0.09"),
        "{header}"
    );
    for wrong in ["theta=0", "theta=-1", "theta=nan", "theta=inf"] {
        let told = refused(folder.path.path(), wrong);
        assert!(told.contains("code 6"), "{wrong}: {told}");
    }
    let told = refused(folder.path.path(), "rho=1");
    assert!(told.contains("expected NAME=VALUE"), "{told}");
}

fn refused(folder: &Path, argument: &str) -> String {
    let log = std::fs::File::open(folder.join("log.csv")).unwrap();
    let mut replay = Command::new(folder.join("c/replay"));
    let ended = replay.arg(argument).stdin(log).output().unwrap();
    assert!(!ended.status.success(), "{argument}");
    String::from_utf8(ended.stderr).unwrap()
}

/// A gain with a proof is made as a whole.
#[test]
fn a_certified_gain_stays() {
    let folder = Folder::empty();
    folder.write("m.mo", "model M\n  Real x(start = 1, min = -2, max = 2);\n  Real v(min = -2, max = 2);\n  output Real y = x;\nequation\n  der(x) = v;\n  der(v) = -sin(x) - 0.5*v;\nend M;\n");
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\nobserver = { family = \"triangular\", gain = \"lmi\", rate = 0.2 }\n",
    );
    let told = exported(&folder, &["--tunable"]);
    assert!(
        told.contains("nothing may be changed while it runs: a gain by linear matrix"),
        "{told}"
    );
    let tunable = folder.read("c/m.c");
    exported(&folder, &[]);
    assert_eq!(tunable, folder.read("c/m.c"));
}

/// JavaScript is made of the same draft.
#[test]
fn javascript_has_it_too() {
    if !has("node") {
        return skipped("node is not there");
    }
    let folder = Folder::empty();
    let study = prepared(&folder, &CASES[1]);
    let other = changed(&study, CASES[1].change);
    folder.write("s.toml", &study);
    let made = folder.run(&["export", "s.toml", "--to", "js", "-o", "js", "--tunable"]);
    assert_eq!(made.code, 0, "{}", made.err);
    let expected_own = estimated(folder.path.path()).unwrap();
    let own = crate::export::javascript::replayed_by(&folder, "");
    assert!(difference(&expected_own, &own, "own") <= 1e-12);
    let by_name = "if (tunables.join() !== \"theta[1],theta[2]\") { process.exit(1); }
        state.tuning[tunables.indexOf(\"theta[1]\")] = 4.5;
        state.tuning[tunables.indexOf(\"theta[2]\")] = 4;";
    folder.write("s.toml", &other);
    let expected: Run = estimated(folder.path.path()).unwrap();
    let found = crate::export::javascript::replayed_by(&folder, by_name);
    let off = difference(&expected, &found, "changed");
    assert!(off <= 1e-12, "{off:e}");
}

/// What is not asked for is not there.
#[test]
fn a_page_has_a_slider_instead() {
    let folder = Folder::new();
    let made = folder.run(&[
        "export",
        "study.toml",
        "--to",
        "html",
        "-o",
        "p",
        "--tunable",
    ]);
    assert_eq!(made.code, 2);
    assert!(made.err.contains("slider"), "{}", made.err);
}
