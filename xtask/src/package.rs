//! The Python package: tested as a folder beside the Rust programs, or built as a wheel, installed into an
//! environment of its own and tested there; and the documentation site, which shows it.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use xtask::process::{begins, cargo, root, run, target};
use xtask::python;

/// What its tests need, pinned.
const REQUIREMENTS: &str = include_str!("../../python/requirements.txt");

/// The tests compare with the command that this names.
const COMMAND: &str = "LYNKEUS_COMMAND";

/// Builds the wheel, installs it and tries it as users have it; `test_beside` runs all tests.
///
/// # Errors
/// What is missing, or what failed.
pub fn test(python: &Path) -> Result<(), String> {
    begins("the Python package, as a wheel");
    let wheel = wheel(python)?;
    let mut install = pip(python, "install");
    install
        .args(["--force-reinstall", "--no-deps", "--no-index"])
        .arg(wheel);
    run(&mut install)?;
    begins("the command, to compare with");
    run(&mut cargo(&["build", "--package", "lynkeus-cli"]))?;
    begins("what the installed package says");
    run(tests(python).args([
        "python/tests/test_package.py",
        "python/tests/test_same_as_the_command.py",
    ]))
}

/// Tests it while something else is done, from a folder with the library that the workspace has built, so
/// that nothing is compiled twice: the tests need one core, and what they print is shown behind that.
///
/// # Errors
/// What is missing, or what failed, of either.
pub fn test_beside(
    python: &Path,
    other: impl FnOnce() -> Result<(), String>,
) -> Result<(), String> {
    compile()?;
    let folder = folder()?;
    // a wheel that was installed by hand would be measured where the folder is not asked first
    run(pip(python, "uninstall").args(["--yes", "lynkeus"]))?;
    let log = target().join("package").join("tests.log");
    let cannot = |error: std::io::Error| format!("cannot write {}: {error}", log.display());
    let file = File::create(&log).map_err(cannot)?;
    let mut tests = tests(python);
    tests
        .env("PYTHONPATH", folder)
        .stdout(file.try_clone().map_err(cannot)?)
        .stderr(file);
    let running = tests.spawn();
    let mut running = running.map_err(|error| format!("cannot start the tests: {error}"))?;
    let done = other();
    begins("what the tests of the Python package say, which ran beside");
    let status = running.wait();
    eprint!("{}", fs::read_to_string(&log).unwrap_or_default());
    done?;
    match status {
        Ok(status) if status.success() => types(python),
        Ok(status) => Err(format!(
            "the tests of the Python package ended with {status}"
        )),
        Err(error) => Err(format!("the tests of the Python package: {error}")),
    }
}

fn pip(python: &Path, task: &str) -> Command {
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", task])
        .args(["--disable-pip-version-check", "--quiet"]);
    pip
}

/// Everything that is tested, in one go: the features of the dependencies are then those of the whole, for
/// the library of the Python package, too.
fn compile() -> Result<(), String> {
    begins("the tests, compiled");
    run(&mut cargo(&[
        "build",
        "--workspace",
        "--exclude",
        "chores",
        "--lib",
        "--bins",
        "--tests",
    ]))
}

/// The package as a folder to import it from: its Python files, and the library beside them.
fn folder() -> Result<PathBuf, String> {
    let folder = target().join("package").join("folder");
    let package = folder.join("lynkeus");
    let cannot = |error: std::io::Error| format!("cannot make {}: {error}", package.display());
    match fs::remove_dir_all(&folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(cannot(error)),
        _ => {}
    }
    fs::create_dir_all(&package).map_err(cannot)?;
    for entry in fs::read_dir(root().join("python/lynkeus")).map_err(cannot)? {
        let file = entry.map_err(cannot)?.path();
        if let (true, Some(name)) = (file.is_file(), file.file_name()) {
            fs::copy(&file, package.join(name)).map_err(cannot)?;
        }
    }
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let library = target()
        .join("debug")
        .join(format!("{prefix}_lynkeus{suffix}"));
    let module = match cfg!(windows) {
        true => "_lynkeus.pyd",
        false => "_lynkeus.abi3.so",
    };
    fs::copy(library, package.join(module)).map_err(cannot)?;
    Ok(folder)
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

fn types(python: &Path) -> Result<(), String> {
    begins("the types of the Python package");
    let mut types = Command::new(python);
    run(types.args(["-m", "mypy"]).current_dir(root()))
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

/// The only wheel in a folder that is made anew.
fn wheel(python: &Path) -> Result<PathBuf, String> {
    let folder = target().join("package");
    match fs::remove_dir_all(&folder) {
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
        .arg(&folder)
        .current_dir(root());
    run(&mut build)?;
    let entries = fs::read_dir(&folder).map_err(|e| format!("cannot read the wheels: {e}"))?;
    let mut wheels = entries.flatten().map(|entry| entry.path());
    let wheel = wheels.find(|path| path.extension().is_some_and(|kind| kind == "whl"));
    wheel.ok_or_else(|| format!("no wheel in {}", folder.display()))
}
