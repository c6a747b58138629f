//! The pictures of the documentation, drawn by the tool from the studies that the repository ships.
//!
//! `examples/<plant>/study.toml` becomes `docs/pictures/<plant>.svg` and `study-<what>.toml`
//! becomes `<plant>-<what>.svg`. Where a `log.csv` lies beside a `study.toml` the picture shows
//! the estimates from that log, else a simulation.

use std::fs;
use std::path::{Path, PathBuf};

use crate::process::{cargo, root, run};

/// Draws every picture again.
pub fn draw() -> Result<(), String> {
    let pictures = root().join("docs").join("pictures");
    fs::create_dir_all(&pictures).map_err(|error| at(&pictures, &error))?;
    for folder in sorted(&root().join("examples"))? {
        if folder.is_dir() {
            draw_folder(&folder, &pictures)?;
        }
    }
    Ok(())
}

fn draw_folder(folder: &Path, pictures: &Path) -> Result<(), String> {
    let plant = name_of(folder);
    for study in sorted(folder)? {
        let file = name_of(&study);
        let Some(variant) = file
            .strip_prefix("study")
            .and_then(|rest| rest.strip_suffix(".toml"))
        else {
            continue;
        };
        let picture = pictures.join(format!("{plant}{variant}.svg"));
        let log = folder.join("log.csv");
        let mut tool = cargo(&["run", "--release", "--quiet", "--package", "lynkeus", "--"]);
        if variant.is_empty() && log.exists() {
            tool.arg("estimate").arg(&study).arg(log);
        } else {
            tool.arg("simulate").arg(&study);
        }
        run(tool
            .arg("--output")
            .arg(scratch())
            .arg("--plot")
            .arg(&picture))?;
        eprintln!("drew {}", picture.display());
    }
    Ok(())
}

/// Where the estimates go that belong to a picture: nobody reads them.
fn scratch() -> PathBuf {
    std::env::temp_dir().join("lynkeus-gallery.csv")
}

fn sorted(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    Ok(paths)
}

fn name_of(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

fn at(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}
