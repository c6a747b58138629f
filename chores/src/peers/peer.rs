//! A peer: a command that prints one JSON object, of seconds (numbers) and of where it ended (lists).

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use xtask::process::{root, run};

/// Largest difference of two that do the same operations in another order, as a share.
const ROUNDING: f64 = 1e-9;

/// One of those that are measured in turn.
#[derive(Debug)]
pub(super) struct Peer {
    pub name: String,
    pub command: Vec<String>,
    /// what its keys end with, where it is one of several programs for one row
    pub suffix: String,
    /// what it writes, whose last row is where it ends, and the key of that
    table: Option<(String, PathBuf)>,
    /// least of each figure
    figures: BTreeMap<String, f64>,
    ends: BTreeMap<String, Vec<f64>>,
}

impl Peer {
    pub fn new(name: &str, command: Vec<String>) -> Self {
        Self {
            name: name.to_owned(),
            command,
            suffix: String::new(),
            table: None,
            figures: BTreeMap::new(),
            ends: BTreeMap::new(),
        }
    }

    /// The same, its keys ending with that.
    pub fn with_suffix(mut self, suffix: impl std::fmt::Display) -> Self {
        self.suffix = format!(" {suffix}");
        self
    }

    /// The same, which ends in the last row of a table that it writes.
    pub fn with_table(mut self, key: String, table: PathBuf) -> Self {
        self.table = Some((key, table));
        self
    }

    pub fn figure(&self, key: &str) -> Option<f64> {
        self.figures.get(key).copied()
    }

    /// One run, of which the better figures are kept.
    fn measure(&mut self) -> Result<(), String> {
        let output = Command::new(&self.command[0])
            .args(&self.command[1..])
            .env("OPENBLAS_NUM_THREADS", "1")
            .output()
            .map_err(|error| format!("{}: {error}", self.name))?;
        let told = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() {
            return Err(format!("{}: {}\n{told}", self.name, output.status));
        }
        let printed: BTreeMap<String, Value> =
            serde_json::from_slice(&output.stdout).map_err(|e| format!("{}: {e}", self.name))?;
        if printed.get("status").is_some_and(|status| *status != 0) {
            return Err(format!("{} failed\n{told}", self.name));
        }
        for (key, value) in printed {
            let key = format!("{key}{}", self.suffix);
            if let Some(value) = value.as_f64() {
                let least = self.figures.entry(key).or_insert(f64::INFINITY);
                *least = least.min(value);
            } else if let Some(end) = value.as_array() {
                let end = end.iter().map(|x| x.as_f64().unwrap_or(f64::NAN));
                self.ends.insert(key, end.collect());
            }
        }
        if let Some((key, table)) = &self.table {
            self.ends.insert(key.clone(), last_row(table)?);
        }
        Ok(())
    }
}

/// The last row of a table.
fn last_row(table: &Path) -> Result<Vec<f64>, String> {
    let told = |error: &dyn std::fmt::Display| format!("{}: {error}", table.display());
    let text = fs::read_to_string(table).map_err(|e| told(&e))?;
    let line = text.lines().next_back().unwrap_or_default();
    let cells = line.split(',').map(str::parse);
    cells.collect::<Result<_, _>>().map_err(|e| told(&e))
}

/// All once per round.
///
/// # Errors
/// A peer that cannot be started or fails.
pub(super) fn measure(peers: &mut [Peer], rounds: u64) -> Result<(), String> {
    for round in 1..=rounds {
        for peer in &mut *peers {
            eprintln!("round {round} of {rounds}: {}{}", peer.name, peer.suffix);
            peer.measure()?;
        }
    }
    Ok(())
}

/// # Errors
/// Two that end in different places under one key, beyond what rounding makes.
pub(super) fn agree(peers: &[Peer]) -> Result<(), String> {
    let mut first: BTreeMap<&str, (&str, &[f64])> = BTreeMap::new();
    for peer in peers {
        for (key, end) in &peer.ends {
            let (other, expected) = *first.entry(key).or_insert((&peer.name, end));
            near((other, expected), (&peer.name, end), ROUNDING)
                .map_err(|fault| format!("{key}: {fault}"))?;
        }
    }
    Ok(())
}

/// As [`agree`], between all keys that begin with one and those that begin with the other and go on alike: two ways
/// to the same, which differ by `share` at most.
pub(super) fn agree_about(peers: &[Peer], ways: [&str; 2], share: f64) -> Result<(), String> {
    let ends = |way| {
        let of = move |peer: &'_ Peer| -> Vec<(String, String, Vec<f64>)> {
            let keys = peer.ends.iter();
            keys.filter_map(|(key, end)| {
                let rest = key.strip_prefix(way)?;
                Some((rest.to_owned(), peer.name.clone(), end.clone()))
            })
            .collect()
        };
        peers.iter().flat_map(of)
    };
    for (rest, name, end) in ends(ways[0]) {
        for (_, other, found) in ends(ways[1]).filter(|(key, _, _)| *key == rest) {
            near((&name, &end), (&other, &found), share)
                .map_err(|fault| format!("{rest}: {fault}"))?;
        }
    }
    Ok(())
}

fn near(
    (first, expected): (&str, &[f64]),
    (other, found): (&str, &[f64]),
    share: f64,
) -> Result<(), String> {
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= share * a.abs();
    if expected.len() == found.len() && expected.iter().zip(found).all(is_near) {
        return Ok(());
    }
    Err(format!(
        "expected the same end of all, found {expected:?} of {first} and {found:?} of {other}"
    ))
}

/// The command of a program in C, compiled.
///
/// # Errors
/// A compiler that fails, or none.
pub(super) fn compiled(source: &str, name: &str, flags: &[&str]) -> Result<Vec<String>, String> {
    let folder = root().join("target").join("peers");
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let program = folder.join(name);
    let mut command = Command::new("gcc");
    command
        .arg(root().join("chores").join("peers").join(source))
        .args(flags)
        .arg("-lm")
        .arg("-o")
        .arg(&program);
    run(&mut command)?;
    Ok(vec![text(&program)])
}

pub(super) fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Three digits.
pub(super) fn short(x: f64) -> String {
    let digits = (2 - x.abs().log10().floor() as i32).clamp(0, 5) as usize;
    format!("{x:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ending(name: &str, key: &str, end: &[f64]) -> Peer {
        let mut peer = Peer::new(name, vec![]);
        peer.ends.insert(key.to_owned(), end.to_vec());
        peer
    }

    #[test]
    fn peers_that_do_other_work_are_found() {
        let beside = |end: &[f64]| {
            agree(&[
                ending("a", "end", &[1.0, -2.528]),
                ending("b", "end", end),
                ending("c", "another", &[7.0]),
            ])
        };
        assert_eq!(beside(&[1.0, -2.528 * (1.0 + 1e-12)]), Ok(()));
        for end in [-2.529, 2.528, f64::NAN] {
            let found = beside(&[1.0, end]);
            assert!(found.is_err_and(|text| text.contains("of b")), "{end}");
        }
        assert!(beside(&[1.0]).is_err());
    }

    #[test]
    fn two_ways_to_the_same_are_held_against_each_other() {
        let peers = [
            ending("a", "one way, 4", &[1.0]),
            ending("b", "another, 4", &[1.0 + 1e-6]),
            ending("c", "another, 8", &[5.0]),
        ];
        assert_eq!(agree_about(&peers, ["one way", "another"], 1e-5), Ok(()));
        assert!(agree_about(&peers, ["one way", "another"], 1e-7).is_err());
    }

    #[test]
    fn figures_have_three_digits() {
        assert_eq!(
            [0.1404, 8.981, 106.9, 1234.4].map(short),
            ["0.140", "8.98", "107", "1234"]
        );
    }
}
