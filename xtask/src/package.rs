//! The Python package, built as a wheel, installed into an environment of its own and tested there; and the
//! documentation site, which shows it.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use xtask::process::{begins, behind, cargo, joined, root, run, target};
use xtask::python;

/// What its tests need, pinned.
const REQUIREMENTS: &str = include_str!("../../python/requirements.txt");

/// The tests compare with the command that this names.
const COMMAND: &str = "LYNKEUS_COMMAND";

/// Where it is set, what several tests do alike is no sample.
pub const ALL: &str = "LYNKEUS_ALL_TESTS";

/// Builds the wheel, installs it, and tries it as users have it; all tests run beside those in Rust.
///
/// # Errors
/// What is missing, or what failed.
pub fn wheel(python: &Path) -> Result<(), String> {
    begins("the Python package, as a wheel");
    let folder = target().join("package");
    run(&mut build(python, &folder)?)?;
    run(&mut install(python, &built(&folder)?))?;
    begins("the command, to compare with");
    run(&mut cargo(&["build", "--package", "lynkeus-cli"]))?;
    begins("what the installed package says");
    run(tests(python).args([
        "python/tests/test_package.py",
        "python/tests/test_same_as_the_command.py",
    ]))
}

/// Tests it while the tests in Rust run, which are compiled, and so are its library and the command. Its own tests,
/// one after another, take longer than those on several threads, and go before them. What is printed of it is shown
/// behind theirs.
///
/// # Errors
/// What is missing, or what failed, of either.
pub fn test_beside(python: &Path, rust: &Command, is_all: bool) -> Result<(), String> {
    begins("the tests in Rust, beside the tests of the Python package and its types");
    let path = target().join("package.log");
    let cannot = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
    let log = File::create(&path).map_err(cannot)?;
    let (package, rust) = std::thread::scope(|scope| {
        let package = scope.spawn(|| steps(python, &log, is_all));
        let rust = run(&mut behind(rust));
        begins("what the tests of the Python package say, which ran beside");
        (joined(package), rust)
    });
    eprint!("{}", fs::read_to_string(&path).unwrap_or_default());
    rust.and(package)
}

/// Its tests, from a folder with the library that the workspace has built, and its types; what they print
/// goes to the log.
fn steps(python: &Path, log: &File, is_all: bool) -> Result<(), String> {
    let told = |command: &mut Command| {
        let copy = || log.try_clone().map_err(|e| format!("the log: {e}"));
        run(command.stdout(copy()?).stderr(copy()?))
    };
    let mut tests = tests(python);
    if is_all {
        tests.env(ALL, "1");
    }
    told(tests.env("PYTHONPATH", folder()?))?;
    told(&mut types(python))
}

/// Where the package is as a folder, once it was tested.
fn made() -> PathBuf {
    target().join("package").join("folder")
}

/// The package as a folder to import it from: its Python files, and the library beside them.
fn folder() -> Result<PathBuf, String> {
    let folder = made();
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

/// Builds the documentation site; a link that leads nowhere is an error. Where the tests have made a folder of the package,
/// the notebooks run and are shown with their results.
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
    let package = made();
    if package.is_dir() {
        build.env("PYTHONPATH", package);
    }
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
///
/// # Errors
/// There is none.
pub fn built(folder: &Path) -> Result<PathBuf, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("cannot read the wheels: {e}"))?;
    let mut wheels = entries.flatten().map(|entry| entry.path());
    let wheel = wheels.find(|path| path.extension().is_some_and(|kind| kind == "whl"));
    wheel.ok_or_else(|| format!("no wheel in {}", folder.display()))
}
