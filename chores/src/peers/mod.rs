//! Ours beside C by hand and the libraries of Python, in turn on one machine: the table of
//! `BENCHMARKS.md`.
//!
//! A peer is a command that prints one JSON object of seconds; all are run once per round, and of
//! each figure the least over the rounds is taken, so that what else the machine does counts for
//! nobody.

mod clock;
mod lanes;
pub mod ours;
pub mod runs;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::options;
use xtask::process::{root, run};
use xtask::python;

const END: &str = "<!-- end of table -->";
const REQUIREMENTS: &str = include_str!("../../peers/requirements.txt");

/// Columns of the table: the key of the JSON, what it says, and how many of its unit a second has.
const FIGURES: [(&str, &str, f64); 4] = [
    ("step", "one step, ns", 1e9),
    ("batch", "one step in a batch, ns", 1e9),
    ("own", "… with sin and exp of its own, ns", 1e9),
    ("adaptive", "[0, 20] at 1e-8, ms", 1e3),
];

/// The last column: the largest error of a state at the end of the adaptive run.
const ERROR: &str = "error";

/// Where the steps of some peers end: they do the same work.
const END_OF_STEPS: &str = "end";

struct Peer {
    name: &'static str,
    command: Vec<String>,
    /// least of each figure
    found: BTreeMap<String, f64>,
}

/// Runs all peers and writes the table.
///
/// # Errors
/// A peer that cannot be built or fails.
pub fn bench(arguments: &[String]) -> Result<(), String> {
    let mut rounds = 5;
    options::read(arguments, |pair| match pair.key {
        "--rounds" => pair.number().map(|number| rounds = number),
        _ => pair.refuse("--rounds"),
    })?;
    let mut peers = peers()?;
    for round in 1..=rounds {
        for peer in &mut peers {
            eprintln!("round {round} of {rounds}: {}", peer.name);
            peer.measure()?;
        }
    }
    agree(peers.iter().filter_map(Peer::end))?;
    write("bench-peers", &table(&peers))
}

/// # Errors
/// Two peers that end in different places, beyond what rounding makes.
fn agree<'p>(mut ends: impl Iterator<Item = (&'p str, f64)>) -> Result<(), String> {
    let Some((first, expected)) = ends.next() else {
        return Ok(());
    };
    let is_near = |end: f64| (end - expected).abs() <= 1e-9 * expected.abs();
    match ends.find(|(_, end)| !is_near(*end)) {
        None => Ok(()),
        Some((other, end)) => Err(format!(
            "expected the same end of all steps, found {expected} of {first} and {end} of {other}"
        )),
    }
}

fn peers() -> Result<Vec<Peer>, String> {
    let python = python::environment(".venv-peers", REQUIREMENTS)?;
    let script = root().join("chores").join("peers").join("peers.py");
    let library = |name: &str| vec![text(&python), text(&script), name.to_owned()];
    let this = std::env::current_exe().map_err(|error| error.to_string())?;
    let ours = |backend: &str| vec![text(&this), "bench-ours".to_owned(), backend.to_owned()];
    let lee = "chores/peers/lee.c";
    let in_lanes = "chores/peers/lanes.c";
    let plain = ["-O2", "-ffp-contract=off"];
    let fused = ["-O3", "-march=native"];
    let avx = ["-O3", "-mavx2", "-ffp-contract=off"];
    let libmvec = ["-O3", "-mavx2", "-ffast-math", "-DOWN", "-lmvec"];
    let all = [
        ("Lynkeus, machine code", ours("native")),
        ("Lynkeus, interpreter", ours("interpreter")),
        ("Lynkeus, lanes", ours("lanes")),
        ("C by hand", compiled(lee, "lee", &plain)?),
        ("C by hand, fused", compiled(lee, "lee-fused", &fused)?),
        ("C in lanes", compiled(in_lanes, "lanes", &avx)?),
        (
            "C in lanes, libmvec",
            compiled(in_lanes, "lanes-own", &libmvec)?,
        ),
        ("numba", library("numba")),
        ("JAX", library("jax")),
        ("CasADi (CVODES)", library("casadi")),
        ("diffrax (Dopri8)", library("diffrax")),
        ("SciPy (DOP853)", library("scipy")),
    ];
    let peer = |(name, command)| Peer {
        name,
        command,
        found: BTreeMap::new(),
    };
    Ok(all.into_iter().map(peer).collect())
}

/// The command of a program in C, compiled.
fn compiled(source: &str, name: &str, flags: &[&str]) -> Result<Vec<String>, String> {
    let folder = root().join("target").join("peers");
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let program = folder.join(name);
    let mut command = Command::new("gcc");
    command
        .arg(root().join(source))
        .args(flags)
        .arg("-lm")
        .arg("-o")
        .arg(&program);
    run(&mut command)?;
    Ok(vec![text(&program)])
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

impl Peer {
    /// One run, of which the better figures are kept.
    fn measure(&mut self) -> Result<(), String> {
        let output = Command::new(&self.command[0])
            .args(&self.command[1..])
            .env("OPENBLAS_NUM_THREADS", "1")
            .output()
            .map_err(|error| format!("{}: {error}", self.name))?;
        if !output.status.success() {
            let told = String::from_utf8_lossy(&output.stderr);
            return Err(format!("{}: {}\n{told}", self.name, output.status));
        }
        let printed: BTreeMap<String, serde_json::Value> =
            serde_json::from_slice(&output.stdout).map_err(|e| format!("{}: {e}", self.name))?;
        for (key, value) in printed {
            let Some(value) = value.as_f64() else {
                continue;
            };
            let least = self.found.entry(key).or_insert(f64::INFINITY);
            *least = least.min(value);
        }
        Ok(())
    }

    fn end(&self) -> Option<(&'static str, f64)> {
        Some((self.name, *self.found.get(END_OF_STEPS)?))
    }

    fn line(&self) -> String {
        let mut line = format!("| {} |", self.name);
        for (key, _, per_second) in FIGURES {
            let cell = self
                .found
                .get(key)
                .map(|seconds| short(seconds * per_second));
            let _ = write!(line, " {} |", cell.unwrap_or_default());
        }
        let error = self.found.get(ERROR).map(|error| format!("{error:.0e}"));
        line + &format!(" {} |\n", error.unwrap_or_default())
    }
}

/// Three digits.
fn short(x: f64) -> String {
    let digits = (2 - x.abs().log10().floor() as i32).clamp(0, 5) as usize;
    format!("{x:.digits$}")
}

fn table(peers: &[Peer]) -> String {
    let mut head = "| |".to_owned();
    let mut rule = "|---|".to_owned();
    for title in FIGURES
        .map(|(_, title, _)| title)
        .iter()
        .chain(&["its error"])
    {
        let _ = write!(head, " {title} |");
        rule += "---|";
    }
    let lines: String = peers.iter().map(Peer::line).collect();
    let versions: Vec<&str> = REQUIREMENTS
        .lines()
        .filter(|line| line.contains("=="))
        .collect();
    let versions = versions.join(", ").replace("==", " ");
    format!("{head}\n{rule}\n{lines}\n{}; {versions}.\n", machine())
}

/// The processor and the compiler.
fn machine() -> String {
    let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus
        .lines()
        .find_map(|line| line.strip_prefix("model name"));
    let model = model.map_or("unknown processor", |line| {
        line.trim_start_matches(['\t', ' ', ':'])
    });
    let output = Command::new("gcc").arg("--version").output();
    let compiler = output.map(|found| String::from_utf8_lossy(&found.stdout).into_owned());
    let compiler = compiler.unwrap_or_default();
    format!("{model}; {}", compiler.lines().next().unwrap_or("gcc"))
}

/// Writes the table of a task.
fn write(task: &str, table: &str) -> Result<(), String> {
    eprint!("{table}");
    let begin = format!("<!-- table: cargo xtask {task} -->\n");
    let page = root().join("BENCHMARKS.md");
    let text = fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
    let marks = text
        .split_once(&begin)
        .and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
    let (before, after) = marks.ok_or_else(|| format!("BENCHMARKS.md has no mark {begin}"))?;
    let text = format!("{before}{begin}{table}{END}{after}");
    fs::write(&page, text).map_err(|e| format!("{}: {e}", page.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peers_that_do_other_work_are_found() {
        let near = [("a", -2.528), ("b", -2.528 * (1.0 + 1e-12))];
        assert_eq!(agree(near.into_iter()), Ok(()));
        for end in [-2.529, 2.528, f64::NAN] {
            let found = agree([("a", -2.528), ("b", end)].into_iter());
            assert!(found.is_err_and(|text| text.contains("of b")), "{end}");
        }
    }

    #[test]
    fn figures_have_three_digits() {
        assert_eq!(
            [0.1404, 8.981, 106.9, 1234.4].map(short),
            ["0.140", "8.98", "107", "1234"]
        );
    }
}
