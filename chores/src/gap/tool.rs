//! The built command, run on temporary studies.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;

use xtask::process::target;

/// The answer of `lynkeus certify --json`.
pub struct Certificate(Value);

impl Certificate {
    fn entries(&self, of: &str) -> &[Value] {
        let list = self.0["certificate"][of].as_array();
        list.map(Vec::as_slice).unwrap_or_default()
    }

    /// The fastest rate proved by an inequality for one Lyapunov function, of the states or of the outputs' derivatives.
    pub fn rate_by_inequality(&self) -> Option<f64> {
        let is_proof = |h: &&Value| {
            let name = h["name"].as_str().unwrap_or_default();
            name.starts_with("one Lyapunov function") && h["verdict"] == "proved"
        };
        // the theorem may promise more, but this is about the inequality
        let rate = |proof: &Value| {
            let (_, rest) = proof["detail"].as_str()?.split_once("2·")?;
            rest.split_once('·')?.0.parse().ok()
        };
        let proofs = self.entries("hypotheses").iter().filter(is_proof);
        proofs.filter_map(rate).max_by(f64::total_cmp)
    }

    /// A constant of the theorem.
    pub fn constant(&self, name: &str) -> Option<f64> {
        let theorem = self.0["certificate"]["theorem"]["constants"].as_array()?;
        let found = theorem.iter().find(|c| c["name"] == name)?;
        found["value"].as_f64()
    }

    /// The range of a quantity on the box.
    pub fn range(&self, name: &str) -> Option<(f64, f64)> {
        let side = &self.0["certificate"]["box"][name];
        Some((side[0].as_f64()?, side[1].as_f64()?))
    }
}

/// Exit codes of an answer: yes, and no.
const ANSWERS: [i32; 2] = [0, 1];

/// The largest entry of the gain of a study given as text; of a gain that moves, of the
/// constant matrix that it is made of.
pub fn largest_gain(study: &str) -> Result<f64, String> {
    let output = lynkeus("design", study, &["--json"])?;
    let text = String::from_utf8_lossy(&output.stdout);
    let answer: Value = serde_json::from_str(&text)
        .map_err(|_| String::from_utf8_lossy(&output.stderr).into_owned())?;
    let rows = answer["gain"].as_object();
    let rows = rows.into_iter().flat_map(|rows| rows.values());
    let entries = rows
        .filter_map(Value::as_object)
        .flat_map(|row| row.values());
    let constant = entries.filter_map(Value::as_f64);
    let corrections = answer["injection"].as_object().into_iter().flatten();
    let corrections = corrections.filter_map(|(_, row)| row.as_object()).flatten();
    let numbers = corrections.filter_map(|(_, entry)| entry["expression"].as_str()?.parse().ok());
    let parameters = answer["parameters"].as_object();
    let made_of = |name: &str| name.starts_with("rΔS⁻¹Cᵀ") || name.starts_with("Δ⁻¹K");
    let lists = parameters
        .into_iter()
        .flatten()
        .filter(|(name, _)| made_of(name))
        .filter_map(|(_, list)| list.as_str());
    let moving = lists
        .flat_map(|list| list.split(", "))
        .filter_map(|x| x.parse().ok());
    Ok(constant
        .chain(numbers)
        .chain(moving)
        .map(f64::abs)
        .fold(0.0, f64::max))
}

/// Certifies a study given as text.
pub fn certify(study: &str) -> Result<Certificate, String> {
    let output = lynkeus("certify", study, &["--json"])?;
    let text = String::from_utf8_lossy(&output.stdout);
    match (output.status.code(), serde_json::from_str(&text)) {
        (Some(code), Ok(answer)) if ANSWERS.contains(&code) => Ok(Certificate(answer)),
        _ => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}

/// The columns of a simulation by name; none where it failed.
pub fn simulate(study: &str) -> Option<Vec<(String, Vec<f64>)>> {
    let output = lynkeus("simulate", study, &["-o", "-", "--quiet"]).ok()?;
    if !output.status.success() {
        return None;
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let mut lines = text.lines();
    let names = lines.next()?.split(',').map(str::to_owned);
    let mut columns: Vec<(String, Vec<f64>)> = names.map(|name| (name, vec![])).collect();
    for line in lines {
        for ((_, column), cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(cell.parse().ok()?);
        }
    }
    Some(columns)
}

fn lynkeus(command: &str, study: &str, arguments: &[&str]) -> Result<Output, String> {
    let path = std::env::temp_dir().join(format!("lynkeus-gap-{}.toml", std::process::id()));
    fs::write(&path, study).map_err(|e| format!("{}: {e}", path.display()))?;
    let output = Command::new(program())
        .arg(command)
        .arg(&path)
        .args(arguments)
        .output();
    output.map_err(|e| format!("{}: {e}", program().display()))
}

fn program() -> PathBuf {
    let name = format!("lynkeus{}", std::env::consts::EXE_SUFFIX);
    target().join("release").join(name)
}
