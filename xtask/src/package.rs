//! The Python package, built as a wheel, installed into an environment of its own and tested there; and the
//! documentation site, which shows it.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use xtask::process::{begins, behind, joined, root, run, target};
use xtask::python;

/// What its tests need, pinned.
const REQUIREMENTS: &str = include_str!("../../python/requirements.txt");

/// The tests compare with the command that this names.
const COMMAND: &str = "LYNKEUS_COMMAND";

/// Builds, installs and tests it; the command is compiled.
///
/// # Errors
/// What is missing, or what failed.
pub fn test(python: &Path) -> Result<(), String> {
    steps(python, None)
}

/// Builds, installs and tests it while the tests in Rust run, which are compiled, and so is the command. Its own tests,
/// one after another, take longer than those on several threads, and go before them. What is printed of it is shown
/// behind theirs.
///
/// # Errors
/// What is missing, or what failed, of either.
pub fn test_beside(python: &Path, rust: &Command) -> Result<(), String> {
    begins("the tests in Rust, beside the Python package: a wheel, its tests, its types");
    let path = target().join("package.log");
    let cannot = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
    let log = File::create(&path).map_err(cannot)?;
    let (package, rust) = std::thread::scope(|scope| {
        let package = scope.spawn(|| steps(python, Some(&log)));
        let rust = run(&mut behind(rust));
        begins("what the tests of the Python package say, which ran beside");
        (joined(package), rust)
    });
    eprint!("{}", fs::read_to_string(&path).unwrap_or_default());
    rust.and(package)
}

/// The wheel, installed, its tests and its types; what they print goes to the log.
fn steps(python: &Path, log: Option<&File>) -> Result<(), String> {
    let run = |what: &str, command: &mut Command| {
        match log {
            Some(log) => {
                let copy = || {
                    log.try_clone()
                        .map_err(|e| format!("the log of {what}: {e}"))
                };
                command.stdout(copy()?).stderr(copy()?);
            }
            None => begins(what),
        }
        run(command)
    };
    let folder = target().join("package");
    run(
        "the Python package, as a wheel",
        &mut build(python, &folder)?,
    )?;
    run(
        "the wheel, installed",
        &mut install(python, &wheel(&folder)?),
    )?;
    run("the tests of the Python package", &mut tests(python))?;
    run("the types of the Python package", &mut types(python))
}

fn tests(python: &Path) -> Command {
    let command = target().join("debug").join("lynkeus");
    let command = command.with_extension(std::env::consts::EXE_EXTENSION);
    let mut tests = Command::new(python);
    tests
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .env(COMMAND, command)
        .current_dir(root());
    tests
}

fn types(python: &Path) -> Command {
    let mut types = Command::new(python);
    types.args(["-m", "mypy"]).current_dir(root());
    types
}

/// The interpreter of its environment.
///
/// # Errors
/// What is missing and how to supply it.
pub fn interpreter() -> Result<PathBuf, String> {
    python::environment(".venv-package", REQUIREMENTS)
}

/// Builds the documentation site; a link that leads nowhere is an error.
///
/// # Errors
/// What is missing, or what the page is whose link is broken.
pub fn site() -> Result<(), String> {
    let python = python::environment(".venv-docs", include_str!("../../docs/requirements.txt"))?;
    let mut build = Command::new(python);
    build
        .args(["-m", "mkdocs", "build", "--quiet", "--strict"])
        .env("NO_MKDOCS_2_WARNING", "1")
        .current_dir(root());
    run(&mut build)
}

/// What builds a wheel into a folder, which is made anew.
fn build(python: &Path, folder: &Path) -> Result<Command, String> {
    match fs::remove_dir_all(folder) {
        // there is none at first
        Err(error) if error.kind() != ErrorKind::NotFound => {
            let folder = folder.display();
            return Err(format!("cannot remove the old wheels in {folder}: {error}"));
        }
        _ => {}
    }
    let mut build = Command::new(python);
    build
        .args(["-m", "maturin", "build", "--profile", "dev"])
        .args(["--auditwheel", "skip", "--out"])
        .arg(folder)
        .current_dir(root());
    Ok(build)
}

fn install(python: &Path, wheel: &Path) -> Command {
    let mut install = Command::new(python);
    install
        .args(["-m", "pip", "install", "--disable-pip-version-check"])
        .args(["--quiet", "--force-reinstall", "--no-deps", "--no-index"])
        .arg(wheel);
    install
}

/// The only wheel in a folder.
fn wheel(folder: &Path) -> Result<PathBuf, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("cannot read the wheels: {e}"))?;
    let mut wheels = entries.flatten().map(|entry| entry.path());
    let wheel = wheels.find(|path| path.extension().is_some_and(|kind| kind == "whl"));
    wheel.ok_or_else(|| format!("no wheel in {}", folder.display()))
}
