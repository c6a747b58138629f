//! The command as a user types it.
#![allow(clippy::unwrap_used)]

mod backends;
mod bias;
mod certify;
mod compare;
mod credible;
mod delays;
mod events;
mod export;
mod families;
mod faulty;
mod filters;
mod filters_noise;
mod fit;
mod fit_noise;
mod fit_search;
mod fit_shown;
mod fmu;
mod fmu_calls;
mod fmu_equations;
mod fmu_names;
mod fmu_parameters;
mod fmu_slopes;
mod fmu_states;
mod generated;
mod hostile;
mod how_well;
mod known;
mod late;
mod limits;
mod live;
mod log_columns;
mod logs;
mod long;
mod lsp;
mod manifold;
mod mentioned;
mod messages;
mod misread;
mod names;
mod next_experiment;
#[path = "../../../lynkeus/tests/normal/mod.rs"]
mod normal;
mod observability;
mod open_run;
mod outside;
mod parquet_logs;
mod particles;
mod random;
mod reading;
mod references;
mod refused;
mod report;
mod results;
mod runs;
mod said;
mod samples;
mod scatter;
mod screens;
#[cfg(feature = "serve")]
mod serve;
mod shell;
mod story;
mod tables;
mod texts;
mod tunable;
mod tune;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with the two tanks in it.
struct Folder {
    path: tempfile::TempDir,
}

impl Folder {
    fn empty() -> Self {
        Self {
            path: tempfile::tempdir().unwrap(),
        }
    }

    fn new() -> Self {
        let folder = Self::empty();
        for file in ["two_tanks.mo", "study.toml", "log.csv"] {
            let text = std::fs::read_to_string(examples().join("two-tanks").join(file)).unwrap();
            folder.write(file, &text);
        }
        folder
    }

    /// The models of an example.
    fn copy_models(&self, example: &str) {
        for entry in std::fs::read_dir(examples().join(example)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "mo") {
                std::fs::copy(&path, self.path.path().join(path.file_name().unwrap())).unwrap();
            }
        }
    }

    fn write(&self, file: &str, text: &str) {
        std::fs::write(self.path.path().join(file), text).unwrap();
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.path.path().join(file)).unwrap()
    }

    /// A file with every occurrence of `from` replaced; there has to be one.
    fn change(&self, file: &str, from: &str, to: &str) {
        let text = self.read(file);
        assert!(text.contains(from), "{file} has no {from:?}");
        self.write(file, &text.replace(from, to));
    }

    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.path.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn run(&self, arguments: &[&str]) -> Ended {
        run(self.path.path(), arguments)
    }
}

fn run(folder: &Path, arguments: &[&str]) -> Ended {
    let output = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    Ended::new(&output)
}

/// What a run left behind.
#[derive(Debug)]
struct Ended {
    code: i32,
    out: String,
    err: String,
}

impl Ended {
    fn new(output: &Output) -> Self {
        Self {
            code: output.status.code().unwrap(),
            out: String::from_utf8(output.stdout.clone()).unwrap(),
            err: String::from_utf8(output.stderr.clone()).unwrap(),
        }
    }

    fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap()
    }
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// A file of the folder `shared` beside the repository, if it is there.
fn shared(file: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared")
        .join(file);
    if path.is_file() {
        return Some(path);
    }
    skipped(&format!("../shared/{file} is not there"));
    None
}

/// Says so past the capture of passing tests.
fn skipped(why: &str) {
    let _ = std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("skipped: {why}\n"));
}

/// Header and rows of a CSV text.
fn csv(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let rows = lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect());
    (header, rows.collect())
}
