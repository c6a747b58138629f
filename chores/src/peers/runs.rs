//! Many runs of the 12-tray column with its observer and noise, by the command and by JAX: the
//! clock, processor time and peak memory of whole processes.

use std::fs;
use std::process::Command;

use serde_json::Value;

use super::page::write;
use super::peer::text;
use super::programs::Programs;
use super::whole;
use crate::options;
use xtask::process::{root, run};

const STUDY: &str = include_str!("../../peers/column.toml");
const NOISE: &str = "noise = { top = \"5%\", bottom = \"5%\" }";

/// Largest difference of a state or an estimate between the two in a run without noise.
const EQUAL: f64 = 1e-9;

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
    let programs = Programs::new()?;
    write_studies(&programs)?;
    let difference = difference(&programs)?;
    eprintln!("without noise the largest difference is {difference:.1e}");
    if difference.is_nan() || difference > EQUAL {
        return Err(format!("expected at most {EQUAL:e}: not the same plant"));
    }
    let number = runs.to_string();
    let simulated = ours(&programs, "noise.toml", "runs.csv", &["--runs", &number]);
    let theirs = |what: &str| programs.script("column.py", &["run", &number, what]);
    let all = [
        ("Lynkeus", simulated),
        ("JAX", theirs("all")),
        ("JAX, without quantiles", theirs("plain")),
    ];
    let table = whole::table(&programs, &format!("{runs} runs"), all, rounds)?;
    write("bench-runs", &table)
}

fn write_studies(programs: &Programs) -> Result<(), String> {
    let plant = root().join("examples").join("column").join("column.mo");
    let plant = text(&plant).replace('\\', "/");
    for (name, noise) in [("noise.toml", NOISE), ("exact.toml", "")] {
        let study = STUDY.replace("{plant}", &plant).replace("{noise}", noise);
        let path = programs.folder.join(name);
        fs::write(&path, study).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

fn ours(programs: &Programs, study: &str, table: &str, more: &[&str]) -> Vec<String> {
    let [study, table] = [study, table].map(|name| text(&programs.folder.join(name)));
    let lynkeus = text(&programs.lynkeus);
    let command = [&lynkeus, "simulate", &study, "-q", "-o", &table];
    let all = command.into_iter().chain(more.iter().copied());
    all.map(str::to_owned).collect()
}

/// Between the states and estimates of both in a run without noise.
fn difference(programs: &Programs) -> Result<f64, String> {
    let ours = ours(programs, "exact.toml", "exact.csv", &[]);
    run(Command::new(&ours[0]).args(&ours[1..]))?;
    let table = text(&programs.folder.join("exact.csv"));
    let found = printed(&programs.script("column.py", &["check", &table]))?;
    figure(&found, "difference")
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
