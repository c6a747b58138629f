//! The project's own chores, run as `cargo xtask <task>`.

mod attack;
mod draw;
mod exercise;
mod falsify;
mod figures;
mod gallery;
mod gap;
mod numbers;
mod options;
mod package;
mod peers;
mod process;
mod python;

use std::path::PathBuf;
use std::process::ExitCode;

use process::{cargo, run};

const USAGE: &str = "\
usage: cargo xtask <task>

  test      every test of the workspace and of the Python package, with the Python cross-checks
  package   build the Python package, install it into .venv-package and run its tests
  ci        format check, lints, documentation, then `test`
  site      build the documentation site into target/site, every link checked
  gallery   draw the pictures of docs/pictures again from the shipped studies
  figures   draw the figures of the five papers again into target/figures, with trajectories that were
            computed apart where they are at hand
  gap       compute the table of docs/gap.md again from the shipped studies;
            `gap NAME` only the rows of that example
  falsify   try to break the certificates of random and adversarial plants
            [--seed N] [--count N] [--refutations N] [--family F]; build with --release
  attack    run the command on mutated models, studies, logs and options, and see that it neither
            fails nor harms; [--seed N] [--count N] [--seconds N] [--limit SECONDS]
            [--binary FILE]; build with --release
  exercise  random operations on estimators of every kind: no panic, always finite or an error, a
            restored snapshot equal to the bit; [--seed N] [--count N] [--seconds N]; build with
            --release
  bench-peers  ours beside C by hand, numba, JAX, diffrax, CasADi and SciPy: the table of
            BENCHMARKS.md; [--rounds N]; needs gcc; build with --release
  bench-runs   10,000 runs of the column with noise beside JAX: clock, processor time and memory;
            [--runs N] [--rounds N]; needs `cargo build --release`; build with --release";

/// Tasks with options of their own.
const WITH_OPTIONS: [&str; 6] = [
    "falsify",
    "attack",
    "exercise",
    "bench-peers",
    "bench-runs",
    "bench-ours",
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (task, name) = match arguments.as_slice() {
        [task, ..] if WITH_OPTIONS.contains(&task.as_str()) => (task.as_str(), None),
        [task] => (task.as_str(), None),
        [task, name] if task == "gap" => ("gap", Some(name.as_str())),
        _ => ("", None),
    };
    let outcome = match task {
        "test" => test(),
        "ci" => ci(),
        "package" => package::interpreter().and_then(|python| package::test(&python)),
        "site" => package::site(),
        "gallery" => gallery::draw(),
        "figures" => figures::draw(),
        "gap" => gap::tabulate(name),
        "attack" => attack::run(&arguments[1..]),
        "exercise" => exercise::run(&arguments[1..]),
        "falsify" => falsify::run(&arguments[1..]),
        "bench-peers" => peers::bench(&arguments[1..]),
        "bench-runs" => peers::runs::bench(&arguments[1..]),
        // one of the peers, as a process of its own
        "bench-ours" => peers::ours::print(arguments.get(1).map_or("", String::as_str)),
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

/// Runs every test. `cargo test` comes last, so its summary closes the output.
fn test() -> Result<(), String> {
    let mut tests = cargo(&["test", "--workspace"]);
    match found(python::interpreter(), "the Python cross-checks")? {
        Some(path) => tests.env(python::VARIABLE, path),
        None => tests.env_remove(python::VARIABLE),
    };
    if let Some(python) = found(package::interpreter(), "the tests of the Python package")? {
        package::test(&python)?;
    }
    run(&mut tests)
}

/// An interpreter for something; none where that is skipped, with a word.
fn found(interpreter: Result<PathBuf, String>, what: &str) -> Result<Option<PathBuf>, String> {
    match interpreter {
        Ok(path) => Ok(Some(path)),
        Err(reason) if is_ci() => Err(format!("{what} cannot run: {reason}")),
        Err(reason) => {
            eprintln!("skipped: {what}: {reason}");
            Ok(None)
        }
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
    test()
}

/// True on machines that promise to have everything: there, a skip is a failure.
fn is_ci() -> bool {
    std::env::var("CI").is_ok_and(|value| value == "true" || value == "1")
}
