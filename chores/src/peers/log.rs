//! A log of the chain of cells at rest, its reading with noise, and the study that reads it: text to text by whole
//! processes.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use super::peer::{compiled, text};
use super::programs::Programs;
use crate::numbers::Numbers;
use xtask::process::root;

const STUDY: &str = include_str!("../../peers/chain.toml");
/// What x comes to, where 2.5 x/(1 + 1.5 x) is the input.
const AT_REST: f64 = 0.7 / (2.5 - 1.5 * 0.7);

/// What a study says of the observer.
pub(super) const EKF: &str = "family = \"ekf\"
initial_variance = { default = 1e-4 }
[sensors.noise]
y = 0.02
[process_noise]
x = 1e-6";
pub(super) const TRIANGULAR: &str = "family = \"triangular\"\ntheta = 2";

/// Writes so many rows of t, u and y.
pub(super) fn write_log(programs: &Programs, rows: u64) -> Result<PathBuf, String> {
    let path = programs.folder.join("chain.csv");
    let written = || -> std::io::Result<()> {
        let mut out = BufWriter::new(File::create(&path)?);
        let mut numbers = Numbers(1);
        writeln!(out, "t,u,y")?;
        for k in 0..rows {
            // nearly normal
            let deviate: f64 = (0..12).map(|_| numbers.unit()).sum::<f64>() - 6.0;
            let t = 0.1 * k as f64;
            writeln!(out, "{t:.1},0.7,{:.6}", AT_REST + 0.02 * deviate)?;
        }
        out.flush()
    };
    written().map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(path)
}

/// The command that takes a log through an observer of n cells, to a table of that name.
pub(super) fn ours(
    programs: &Programs,
    cells: usize,
    observer: &str,
    (log, table): (&Path, &Path),
) -> Result<Vec<String>, String> {
    let plant = root().join("chores").join("peers").join("chain.mo");
    let text_of = STUDY
        .replace("{plant}", &text(&plant).replace('\\', "/"))
        .replace("{cells}", &cells.to_string())
        .replace("{observer}", observer);
    let study = table.with_extension("toml");
    fs::write(&study, text_of).map_err(|e| format!("{}: {e}", study.display()))?;
    let [lynkeus, study, log, table] = [&*programs.lynkeus, &*study, log, table].map(text);
    let command = [&lynkeus, "estimate", &study, &log, "-q", "-o", &table];
    Ok(command.map(str::to_owned).to_vec())
}

/// The same by the filter in C that holds P itself.
pub(super) fn in_c(cells: usize, (log, table): (&Path, &Path)) -> Result<Vec<String>, String> {
    let define = format!("-DN={cells}");
    let flags = ["-O3", "-march=native", "-ffp-contract=off", &define];
    let mut command = compiled("ekf.c", &format!("ekf-{cells}"), &flags)?;
    command.extend([log, table].map(text));
    Ok(command)
}
