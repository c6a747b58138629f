//! Many runs of the 12-tray column with its observer and noise, by the command and by JAX: the
//! clock, processor time and peak memory of whole processes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::{REQUIREMENTS, text, write};
use crate::options;
use xtask::process::{root, run};
use xtask::python;

const STUDY: &str = include_str!("../../peers/column.toml");
const NOISE: &str = "noise = { top = \"5%\", bottom = \"5%\" }";

/// Largest difference of a state or an estimate between the two in a run without noise.
const EQUAL: f64 = 1e-9;

/// Where the studies and tables lie, and who runs them.
struct Desk {
    folder: PathBuf,
    lynkeus: PathBuf,
    python: PathBuf,
    script: PathBuf,
}

/// Compares a run without noise, then measures both; writes the table.
///
/// # Errors
/// A run that fails, or runs without noise that differ.
pub fn bench(arguments: &[String]) -> Result<(), String> {
    let (mut runs, mut rounds) = (10_000, 3);
    options::read(arguments, |pair| match pair.key {
        "--runs" => pair.number().map(|number| runs = number),
        "--rounds" => pair.number().map(|number| rounds = number),
        _ => pair.refuse("--runs or --rounds"),
    })?;
    let desk = Desk::new()?;
    let difference = desk.difference()?;
    eprintln!("without noise the largest difference is {difference:.1e}");
    if difference.is_nan() || difference > EQUAL {
        return Err(format!("expected at most {EQUAL:e}: not the same plant"));
    }
    let ours = desk.ours("noise.toml", "runs.csv", &["--runs", &runs.to_string()]);
    let theirs = |what: &str| desk.script(&["run", &runs.to_string(), what]);
    let all = [
        ("Lynkeus", ours),
        ("JAX", theirs("all")),
        ("JAX, without quantiles", theirs("plain")),
    ];
    let mut table =
        format!("| {runs} runs | clock, s | processor, s | peak, MB |\n|---|---|---|---|\n");
    for (name, command) in all {
        table += &desk.least(name, &command, rounds)?;
    }
    write("bench-runs", &table)
}

impl Desk {
    fn new() -> Result<Self, String> {
        let this = std::env::current_exe().map_err(|error| error.to_string())?;
        let name = format!("lynkeus{}", std::env::consts::EXE_SUFFIX);
        let desk = Self {
            folder: root().join("target").join("peers"),
            lynkeus: this.with_file_name(name),
            python: python::environment(".venv-peers", REQUIREMENTS)?,
            script: root().join("chores").join("peers").join("column.py"),
        };
        if !desk.lynkeus.exists() {
            return Err(format!(
                "{}: expected the command beside this program; `cargo build --release` makes it",
                desk.lynkeus.display()
            ));
        }
        let plant = root().join("examples").join("column").join("column.mo");
        let plant = text(&plant).replace('\\', "/");
        fs::create_dir_all(&desk.folder).map_err(|e| told(&desk.folder, e))?;
        for (name, noise) in [("noise.toml", NOISE), ("exact.toml", "")] {
            let study = STUDY.replace("{plant}", &plant).replace("{noise}", noise);
            let path = desk.folder.join(name);
            fs::write(&path, study).map_err(|e| told(&path, e))?;
        }
        Ok(desk)
    }

    fn ours(&self, study: &str, table: &str, more: &[&str]) -> Vec<String> {
        let [study, table] = [study, table].map(|name| text(&self.folder.join(name)));
        let command = [&text(&self.lynkeus), "simulate", &study, "-q", "-o", &table];
        let all = command.into_iter().chain(more.iter().copied());
        all.map(str::to_owned).collect()
    }

    fn script(&self, arguments: &[&str]) -> Vec<String> {
        let files = [&self.python, &self.script].map(|path| text(path));
        let arguments = arguments.iter().map(|&a| a.to_owned());
        files.into_iter().chain(arguments).collect()
    }

    /// Between the states and estimates of both in a run without noise.
    fn difference(&self) -> Result<f64, String> {
        let ours = self.ours("exact.toml", "exact.csv", &[]);
        run(Command::new(&ours[0]).args(&ours[1..]))?;
        let table = text(&self.folder.join("exact.csv"));
        let found = printed(&self.script(&["check", &table]))?;
        figure(&found, "difference")
    }

    /// A row of the table: of each figure the least over the rounds.
    fn least(&self, name: &str, command: &[String], rounds: u64) -> Result<String, String> {
        let mut least = [f64::INFINITY; 3];
        for round in 1..=rounds {
            eprintln!("round {round} of {rounds}: {name}");
            let command: Vec<&str> = command.iter().map(String::as_str).collect();
            let found = printed(&self.script(&[&["measure"], &command[..]].concat()))?;
            if figure(&found, "status")? != 0.0 {
                return Err(format!("{name} failed"));
            }
            for (least, key) in least.iter_mut().zip(["clock", "processor", "peak"]) {
                *least = least.min(figure(&found, key)?);
            }
        }
        let [clock, processor, peak] = least;
        Ok(format!(
            "| {name} | {clock:.1} | {processor:.1} | {peak:.0} |\n"
        ))
    }
}

fn told(path: &Path, error: std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

/// The JSON that a command prints.
fn printed(command: &[String]) -> Result<Value, String> {
    let output = Command::new(&command[0])
        .args(&command[1..])
        .output()
        .map_err(|error| format!("{}: {error}", command[0]))?;
    serde_json::from_slice(&output.stdout).map_err(|error| {
        let told = String::from_utf8_lossy(&output.stderr);
        format!("{}: {error}\n{told}", command.join(" "))
    })
}

fn figure(found: &Value, key: &str) -> Result<f64, String> {
    found[key]
        .as_f64()
        .ok_or_else(|| format!("no {key} in {found}"))
}
