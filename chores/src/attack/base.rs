//! What is mutated: the shipped examples with logs of their own, and random plants.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::falsify::case::{Kind, Role};
use crate::falsify::generate;
use crate::numbers::Numbers;
use xtask::process::root;

/// A study with what it needs.
#[derive(Clone, Debug)]
pub struct Base {
    /// the study comes first, then the model, then the log if there is one
    pub files: Vec<(String, Vec<u8>)>,
}

impl Base {
    pub fn study(&self) -> &str {
        &self.files[0].0
    }

    pub fn model(&self) -> &str {
        &self.files[1].0
    }

    pub fn log(&self) -> Option<&str> {
        self.files.get(2).map(|(name, _)| name.as_str())
    }
}

/// Runs are this much shorter than those that are shipped.
const SHORTER: f64 = 0.05;

/// Every study under `examples`.
pub fn shipped(binary: &Path, desk: &Path) -> Result<Vec<Base>, String> {
    let mut bases = vec![];
    for folder in sorted(&root().join("examples"))? {
        let is_study = |path: &Path| path.extension().is_some_and(|e| e == "toml");
        if !folder.is_dir() {
            continue;
        }
        for study in sorted(&folder)?.iter().filter(|path| is_study(path)) {
            bases.extend(base(study, binary, &desk.join("base"))?);
        }
    }
    match bases.is_empty() {
        true => Err("no study under examples".to_owned()),
        false => Ok(bases),
    }
}

fn sorted(folder: &Path) -> Result<Vec<std::path::PathBuf>, String> {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    Ok(paths)
}

/// A shipped study, shorter and with the log of its own simulation; none where it names no model.
fn base(study: &Path, binary: &Path, desk: &Path) -> Result<Option<Base>, String> {
    let failed = |e: std::io::Error| format!("{}: {e}", study.display());
    let text = std::fs::read_to_string(study).map_err(failed)?;
    let plant = text
        .lines()
        .find_map(|line| line.strip_prefix("plant = \""));
    let Some(plant) = plant.and_then(|rest| rest.split('"').next()) else {
        return Ok(None);
    };
    let model = std::fs::read(study.with_file_name(plant)).map_err(failed)?;
    let mut files = vec![
        ("study.toml".to_owned(), shorter(&text).into_bytes()),
        (plant.to_owned(), model),
    ];
    let _ = std::fs::remove_dir_all(desk);
    std::fs::create_dir_all(desk).map_err(failed)?;
    for (name, bytes) in &files {
        std::fs::write(desk.join(name), bytes).map_err(failed)?;
    }
    // a study that cannot be simulated has no log
    let simulated = Command::new(binary)
        .args([
            "simulate",
            "study.toml",
            "--log",
            "log.csv",
            "-o",
            "all.csv",
            "-q",
        ])
        .current_dir(desk)
        .stderr(Stdio::null())
        .status()
        .map_err(failed)?;
    if simulated.success() {
        let log = std::fs::read(desk.join("log.csv")).map_err(failed)?;
        files.push(("log.csv".to_owned(), log));
    }
    Ok(Some(Base { files }))
}

/// The study with a shorter run and, where it sets one θ, three values to sweep instead of 21.
fn shorter(study: &str) -> String {
    let number = |line: &str, key: &str| -> Option<f64> {
        let value = line.strip_prefix(key)?.split('#').next()?;
        value.trim().parse().ok()
    };
    let line = |line: &str| match number(line, "until = ") {
        Some(end) => format!("until = {:?}", SHORTER * end),
        None => line.to_owned(),
    };
    let lines: Vec<String> = study.lines().map(line).collect();
    let mut text = lines.join("\n") + "\n";
    let theta = study.lines().find_map(|line| number(line, "theta = "));
    if let (Some(theta), false) = (theta, study.contains("[tune]")) {
        let values = [0.7 * theta, theta, 1.5 * theta];
        _ = writeln!(text, "[tune]\nkeys = {{ theta = {values:?} }}");
    }
    text
}

/// A plant of the falsifier with a short simulation.
pub fn random(numbers: &mut Numbers) -> Base {
    let kind = *numbers.of(&Kind::ALL);
    let case = generate::case(numbers, kind);
    let inputs = case.inputs.iter().filter(|i| i.role != Role::Disturbance);
    let inputs: Vec<String> = inputs
        .map(|i| format!("{} = {:?}", i.side.name, i.side.middle()))
        .collect();
    let mut study = case.study();
    _ = write!(
        study,
        "\n[simulate]\nuntil = {:?}\nseed = 1\ninputs = {{ {} }}\n",
        numbers.size(0.01, 2.0),
        inputs.join(", ")
    );
    Base {
        files: vec![
            ("study.toml".to_owned(), study.into_bytes()),
            ("plant.mo".to_owned(), case.model().into_bytes()),
        ],
    }
}
