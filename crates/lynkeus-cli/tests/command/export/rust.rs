//! Crates of `export --to rust`.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use super::names::{HOSTILE, HOSTILE_STUDY, hostile_log};
use super::{Looked, Other, Run, difference, estimated, example, filter};
use crate::normal::Normal;
use crate::{Folder, skipped};

/// A log through an estimator, as a file beside it.
const REPLAY: &str = r#"
macro_rules! replay {
    ($module:ident, $folder:expr) => {{
        let folder = std::path::Path::new($folder);
        let log = std::fs::read_to_string(folder.join("log.csv")).unwrap();
        let mut rows = log.lines().map(|row| row.split(',').collect::<Vec<_>>());
        let header = rows.next().unwrap();
        let column = |name: &str| header.iter().position(|cell| *cell == name).unwrap();
        let (time, places) = (column("t"), $module::SIGNAL_NAMES.map(column));
        let number = |row: &[&str], place: usize| -> f64 {
            row.get(place).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN)
        };
        let mut state = $module::State::new();
        let mut estimates = [0.0; $module::ESTIMATES];
        let mut table = format!("t,{}\n", $module::ESTIMATE_NAMES.join(","));
        let mut end = "whole";
        for row in rows {
            let (t, signals) = (number(&row, time), places.map(|place| number(&row, place)));
            let (before, told) = (state.clone(), estimates);
            if state.push(t, &signals, &mut estimates).is_err() {
                // debug texts, since NaN is not itself; what is counted may be one more
                let now = format!("{state:?}{estimates:?}").replace("refused: 1,", "refused: 0,");
                assert_eq!(format!("{before:?}{told:?}"), now);
                end = "refused";
                break;
            }
            table += &format!("{t},{}\n", estimates.map(|e| e.to_string()).join(","));
        }
        std::fs::write(folder.join("rust.csv"), table).unwrap();
        std::fs::write(folder.join("rust.end"), end).unwrap();
    }};
}
"#;

fn cargo(folder: &Path, target: &Path, arguments: &[&str]) -> Output {
    let mut cargo = Command::new(env!("CARGO"));
    // what stands in the environment of the tests is not for others' crates
    for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET"] {
        cargo.env_remove(name);
    }
    cargo.env("CARGO_TARGET_DIR", target);
    cargo.args(arguments).current_dir(folder).output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Whether functions are called that are computed elsewhere than in the C library.
fn calls_functions(text: &str) -> bool {
    let exact = ["sqrt", "floor", "ceil", "frexp", "ldexp"];
    text.split("libm::").skip(1).any(|call| {
        !exact
            .iter()
            .any(|name| call.starts_with(&format!("{name}(")))
    })
}

fn exported(folder: &Folder, to: &str, more: &[&str]) {
    let arguments = [&["export", "s.toml", "--to", "rust", "-o", to, "-q"], more].concat();
    let made = folder.run(&arguments);
    assert_eq!(made.code, 0, "{}", made.err);
}

/// The studies whose turn it is as modules of one program, against what `estimate` gives.
pub(super) fn check(looked: &[Looked]) {
    let in_turn = looked
        .iter()
        .filter(|looked| Other::Rust.takes(looked.seed));
    let looked: Vec<&Looked> = in_turn.collect();
    if looked.is_empty() {
        return;
    }
    let whole = Folder::empty();
    let mut main = REPLAY.to_owned();
    let mut calls = String::new();
    std::fs::create_dir(whole.path.path().join("src")).unwrap();
    for Looked { seed, folder, .. } in &looked {
        exported(folder, "rust", &[]);
        // a module is no crate
        let text = folder.read("rust/src/lib.rs").replace("#![no_std]\n", "");
        whole.write(&format!("src/s{seed}.rs"), &text);
        writeln!(main, "#[allow(dead_code)]\nmod s{seed};").unwrap();
        writeln!(calls, "    replay!(s{seed}, {:?});", folder.path.path()).unwrap();
    }
    whole.write("src/main.rs", &format!("{main}\nfn main() {{\n{calls}}}\n"));
    whole.write(
        "Cargo.toml",
        "[package]\nname = \"all\"\nedition = \"2024\"\n[lints.rust]\nwarnings = \"deny\"\n\
         [dependencies]\nlibm = \"0.2.16\"\n[profile.dev]\ndebug = false\nincremental = false\n[workspace]\n",
    );
    let path = whole.path.path();
    let ran = cargo(path, &path.join("target"), &["run", "--offline", "--quiet"]);
    assert!(ran.status.success(), "{}", told(&ran));
    for looked in looked {
        let (header, rows) = crate::csv(&looked.folder.read("rust.csv"));
        let is_whole = looked.folder.read("rust.end") == "whole";
        let calls = calls_functions(&looked.folder.read("rust/src/lib.rs"));
        looked.compare((header, rows, is_whole), "Rust", calls);
    }
}

/// The log through the example of a crate.
fn bench(folder: &Folder, target: &Path) -> Run {
    let path = folder.path.path();
    let mut bench = Command::new(env!("CARGO"));
    bench.args(["run", "--offline", "--quiet", "--example", "replay"]);
    bench
        .env("CARGO_TARGET_DIR", target)
        .current_dir(path.join("rust"));
    let log = std::fs::File::open(path.join("log.csv")).unwrap();
    let ran = bench.stdin(log).output().unwrap();
    assert!(ran.status.success(), "{}", told(&ran));
    let (header, rows) = crate::csv(&String::from_utf8(ran.stdout).unwrap());
    (header, rows, true)
}

/// A crate as it is written: no warning of the compiler or of clippy, and the bench runs.
#[test]
fn a_crate_is_clean_as_it_is_written() {
    let hostile = Folder::empty();
    hostile.write("m.mo", HOSTILE);
    hostile.write("s.toml", HOSTILE_STUDY);
    hostile.write("log.csv", &hostile_log());
    exported(&hostile, "rust", &[]);
    let whole = hostile.path.path().join("rust");
    let clippy = [
        "clippy",
        "--offline",
        "--quiet",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ];
    let target = whole.join("target");
    let has_clippy = cargo(&whole, &target, &["clippy", "--version"])
        .status
        .success();
    let checked = |folder: &Path| {
        let checked = cargo(folder, &target, &clippy);
        assert!(checked.status.success(), "{}", told(&checked));
    };
    match has_clippy {
        true => checked(&whole),
        false => skipped("cargo clippy is not there"),
    }
    let off = difference(
        &estimated(hostile.path.path()).unwrap(),
        &bench(&hostile, &target),
        "",
    );
    assert!(off <= 1e-9, "{off:e}");
    // an observer without inputs and monitors has loops that are empty
    let tanks = Folder::empty();
    example(&mut Normal(1), &tanks, 0);
    exported(&tanks, "rust", &["--precision", "f32"]);
    let off = difference(
        &estimated(tanks.path.path()).unwrap(),
        &bench(&tanks, &target),
        "",
    );
    assert!(1e-9 < off && off <= 1e-5, "{off:e}");
    if has_clippy {
        // the first unscented filter among the random ones, in `f32`
        let single = (0..100).map(|seed| {
            let folder = Folder::empty();
            filter(&mut Normal(seed), &folder);
            folder
        });
        let is_wanted = |folder: &Folder| {
            let study = folder.read("s.toml");
            study.contains("\"ukf\"") && study.contains("sd = true") && study.contains("gate")
        };
        let mut folders = single.filter(is_wanted);
        let folder = folders.next().unwrap();
        exported(&folder, "rust", &["--precision", "f32"]);
        checked(&folder.path.path().join("rust"));
        checked(&tanks.path.path().join("rust"));
    }
}
