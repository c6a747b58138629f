//! The pictures of the documentation, drawn by the tool from the studies that the repository ships.
//!
//! `examples/<plant>/study.toml` becomes `docs/pictures/<plant>.svg`; `study-<what>.toml` and
//! `<what>.toml` become `<plant>-<what>.svg`. Where a `log.csv` lies beside a study the
//! picture shows the estimates from that log, else a simulation.

use std::fs;
use std::path::{Path, PathBuf};

use xtask::process::{cargo, root, run};

/// What the tool says of a study whose answer is no: such studies have no picture.
const REFUSED: i32 = 1;

/// Draws every picture again.
pub fn draw() -> Result<(), String> {
    let pictures = root().join("docs").join("pictures");
    fs::create_dir_all(&pictures).map_err(|error| at(&pictures, &error))?;
    run(&mut cargo(&["build", "--release", "-p", "lynkeus-cli"]))?;
    for folder in sorted(&root().join("examples"))? {
        let plant = name_of(&folder);
        for study in sorted(&folder)? {
            if study
                .extension()
                .is_some_and(|extension| extension == "toml")
            {
                let picture = pictures.join(format!("{}.svg", title(&plant, &study)));
                draw_study(&study, &picture)?;
            }
        }
    }
    Ok(())
}

/// `two-tanks` for `study.toml`, `two-tanks-noise` for `study-noise.toml` and `noise.toml`.
fn title(plant: &str, study: &Path) -> String {
    let file = name_of(study);
    let stem = file.strip_suffix(".toml").unwrap_or(&file);
    match stem
        .strip_prefix("study")
        .unwrap_or(stem)
        .trim_start_matches('-')
    {
        "" => plant.to_owned(),
        what => format!("{plant}-{what}"),
    }
}

fn draw_study(study: &Path, picture: &Path) -> Result<(), String> {
    let mut tool = cargo(&["run", "--release", "--quiet", "-p", "lynkeus-cli", "--"]);
    let log = study.with_file_name("log.csv");
    if log.exists() {
        tool.arg("estimate").arg(study).arg(log);
    } else {
        tool.arg("simulate").arg(study);
    }
    tool.arg("--quiet").arg("--plot").arg(picture);
    let status = tool.status().map_err(|error| format!("cargo: {error}"))?;
    match status.code() {
        Some(0) => eprintln!("drew {}", picture.display()),
        Some(REFUSED) => eprintln!("no picture of {}: its answer is no", study.display()),
        _ => return Err(format!("{}: the tool ended with {status}", study.display())),
    }
    Ok(())
}

/// The entries of a folder by name; of anything else, none.
fn sorted(folder: &Path) -> Result<Vec<PathBuf>, String> {
    if !folder.is_dir() {
        return Ok(vec![]);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_named_after_plant_and_study() {
        let named = |study| title("column", Path::new(study));
        assert_eq!(named("study.toml"), "column");
        assert_eq!(named("study-noise.toml"), "column-noise");
        assert_eq!(named("examples/column/theta-4.2.toml"), "column-theta-4.2");
    }
}
