//! Virtual environments in the workspace root, holding exactly what a list pins: `.venv` of the
//! cross-checks, `xtask/requirements.txt`, and another of the benchmarks' peers.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::process::{root, run};

/// Tests that need Python read the interpreter's path from this variable and skip without it.
pub const VARIABLE: &str = "LYNKEUS_PYTHON";

const REQUIREMENTS: &str = include_str!("../requirements.txt");

/// The interpreter of the cross-checks.
///
/// # Errors
/// What is missing and how to supply it.
pub fn interpreter() -> Result<PathBuf, String> {
    environment(".venv", REQUIREMENTS)
}

/// The interpreter of the environment of that name, which is made or brought up to date first.
///
/// # Errors
/// What is missing and how to supply it.
pub fn environment(name: &str, requirements: &str) -> Result<PathBuf, String> {
    let folder = root().join(name);
    let python = interpreter_in(&folder);
    // Written last: an interrupted installation leaves no stamp and starts again.
    let stamp = folder.join("installed-requirements.txt");
    let installed = fs::read_to_string(&stamp).is_ok_and(|text| text == requirements);
    if !(installed && answers(&python)) {
        create(&folder)?;
        let list = folder.join("requirements.txt");
        write(&list, requirements)?;
        install(&python, &list)?;
        write(&stamp, requirements)?;
    }
    Ok(python)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

fn interpreter_in(environment: &Path) -> PathBuf {
    if cfg!(windows) {
        environment.join("Scripts").join("python.exe")
    } else {
        environment.join("bin").join("python")
    }
}

/// Makes an empty environment.
///
/// # Errors
/// What is missing and how to supply it.
pub fn create(folder: &Path) -> Result<(), String> {
    let system = ["python3", "python"]
        .into_iter()
        .find(|name| answers(Path::new(name)))
        .ok_or("no Python 3.11 or newer on the PATH; install one and run this again")?;
    let mut command = Command::new(system);
    command.args(["-m", "venv", "--clear"]).arg(folder);
    run(&mut command).map_err(|error| {
        format!("{error}; Python needs its venv module (on Debian: the package python3-venv)")
    })
}

fn install(python: &Path, list: &Path) -> Result<(), String> {
    let mut command = Command::new(python);
    command
        .args(["-m", "pip", "install", "--disable-pip-version-check"])
        .args(["--quiet", "--retries", "1", "--requirement"])
        .arg(list);
    run(&mut command)
        .map_err(|error| format!("{error}; the packages come from the Python package index"))
}

/// True when this interpreter starts and is new enough for the pinned packages.
fn answers(python: &Path) -> bool {
    Command::new(python)
        .args(["-c", "import sys; sys.exit(sys.version_info < (3, 11))"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}
