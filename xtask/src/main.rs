//! The project's own chores, run as `cargo xtask <task>`.

mod audit;
mod bill;
mod licences;
mod package;
mod release;
mod tutorial;
mod workflow;

use std::path::PathBuf;
use std::process::ExitCode;

use xtask::process::{begins, cargo, joined, run};
use xtask::python;

const USAGE: &str = "\
usage: cargo xtask <task>

  test      every test of the workspace and of the Python package, with the Python cross-checks;
            [--all] then those that take minutes, too, of which these are a sample
  package   build the Python package as a wheel, install it into .venv-package and try it there
  ci        format check, lints, documentation, then `test`
  site      build the documentation site into target/site, every link checked
  release-check  make what is published and try it as users have it: packages, audit, bill, workflow,
            wheel, binary, shells, or only the parts that are named

and, built with --release first (`chores` runs their own tests, which `test` leaves out):

  gallery   draw the pictures of docs/pictures again from the shipped studies
  figures   draw the figures of the five papers again into target/figures, with trajectories that were
            computed apart where they are at hand
  gap       compute the table of docs/gap.md again from the shipped studies;
            `gap NAME` only the rows of that example
  falsify   try to break the certificates of random and adversarial plants
            [--seed N] [--count N] [--refutations N] [--family F]
  attack    run the command on mutated models, studies, logs and options, and see that it neither
            fails nor harms; [--seed N] [--count N] [--seconds N] [--limit SECONDS]
            [--binary FILE]
  exercise  random operations on estimators of every kind: no panic, always finite or an error, a
            restored snapshot equal to the bit; [--seed N] [--count N] [--seconds N]
  bench-peers  ours beside C by hand, numba, JAX, diffrax, CasADi, SciPy and FilterPy: the tables of
            BENCHMARKS.md; [--rounds N] [--table steps|filters|functions]; needs gcc and `cargo build --release`
  bench-runs   10,000 runs of the column with noise beside JAX: clock, processor time and memory;
            [--runs N] [--rounds N]; needs `cargo build --release`
  bench-rows   10,000,000 rows of a log, CSV to CSV, beside C: the same figures;
            [--rows N] [--rounds N]; needs gcc and `cargo build --release`";

/// What the package `chores` does.
const CHORES: [&str; 9] = [
    "gallery",
    "figures",
    "gap",
    "falsify",
    "attack",
    "exercise",
    "bench-peers",
    "bench-runs",
    "bench-rows",
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let task = arguments.first().map_or("", String::as_str);
    let outcome = match (task, arguments.len()) {
        ("test", 1) => test(false),
        ("test", 2) if arguments[1] == "--all" => test(true).and_then(|()| long_tests()),
        ("ci", 1) => ci(),
        // with the features of the whole, so that nothing is compiled twice
        ("chores", 1) => run(&mut cargo(&["test", "--workspace", "--bin", "chores"])),
        ("package", 1) => package::interpreter().and_then(|python| package::wheel(&python)),
        ("site", 1) => package::site(),
        ("release-check", _) => release::check(&arguments[1..]),
        _ if CHORES.contains(&task) => {
            let mut chore = cargo(&["run", "--release", "--package", "chores", "--"]);
            run(chore.args(&arguments))
        }
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("xtask: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Every test in Rust but those of the chores.
const TESTS: [&str; 4] = ["test", "--workspace", "--exclude", "chores"];

/// Compiles them, the library of the Python package, and the command, which its tests compare with: in one go,
/// so that the features of dependencies are those of the whole and nothing is compiled twice.
fn compiled() -> Result<(), String> {
    run(cargo(&["build", "--workspace", "--exclude", "chores"])
        .args(["--lib", "--bins", "--tests"]))
}

/// Runs every test, those of the Python package beside those in Rust; of what several do alike, all or a sample.
fn test(is_all: bool) -> Result<(), String> {
    begins("the tests, compiled, beside the Python environments");
    let ((checks, package), compiled) = std::thread::scope(|scope| {
        // packages are waited for while the processors compile
        let environments = scope.spawn(|| (python::interpreter(), package::interpreter()));
        let compiled = compiled();
        (joined(environments), compiled)
    });
    compiled?;
    let mut tests = cargo(&TESTS);
    match found(checks, "the Python cross-checks")? {
        Some(path) => tests.env(python::VARIABLE, path),
        None => tests.env_remove(python::VARIABLE),
    };
    if is_all {
        tests.env(package::ALL, "1");
    }
    // some tests wait, for limits and for signals
    if std::env::var_os("RUST_TEST_THREADS").is_none() {
        let processors = std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
        tests.env("RUST_TEST_THREADS", (processors + 1).to_string());
    }
    match found(package, "the tests of the Python package")? {
        Some(python) => package::test_beside(&python, &tests, is_all),
        None => run(&mut tests),
    }
}

/// Runs the tests in Rust that are left out for the time that they take.
fn long_tests() -> Result<(), String> {
    begins("the tests that take minutes");
    let mut tests = cargo(&TESTS);
    run(tests
        .args(["--release", "--", "--ignored"])
        .env(package::ALL, "1"))
}

/// An interpreter for something; none where that is skipped, with a word.
fn found(interpreter: Result<PathBuf, String>, what: &str) -> Result<Option<PathBuf>, String> {
    match interpreter {
        Ok(path) => Ok(Some(path)),
        Err(reason) => skipped(format!("{what}: {reason}")).map(|()| None),
    }
}

fn ci() -> Result<(), String> {
    run(&mut cargo(&["fmt", "--all", "--check"]))?;
    run(&mut cargo(&[
        "clippy",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ]))?;
    run(cargo(&["doc", "--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))?;
    test(false)
}

/// Leaves something out that is missing, with a word; where everything has to be there that is a failure.
fn skipped(missing: String) -> Result<(), String> {
    if is_ci() {
        return Err(missing);
    }
    eprintln!("skipped: {missing}");
    Ok(())
}

/// True on machines that promise to have everything: there, a skip is a failure.
fn is_ci() -> bool {
    std::env::var("CI").is_ok_and(|value| value == "true" || value == "1")
}
