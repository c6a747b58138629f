//! What is used, audited: licences, sources and known holes, of Rust's crates and of Python's packages.

use std::path::Path;
use std::process::{Command, Stdio};

use xtask::process::{begins, cargo, root, run};

use crate::{is_ci, licences, skipped};

/// Compares licences with `deny.toml` and asks `pip-audit` and `cargo deny`.
///
/// # Errors
/// What is not allowed, has a hole, or is missing where everything has to be there.
pub fn check(python: &Path, folder: &Path) -> Result<(), String> {
    let list = folder.join("licences.txt");
    licences::check(&list)?;
    begins(&format!(
        "release: licences are allowed: {}",
        list.display()
    ));
    for list in ["python", "docs", "xtask"] {
        audited(python, &format!("{list}/requirements.txt"))?;
    }
    if !has_subcommand("deny")? {
        return Ok(());
    }
    let kinds = ["bans", "licenses", "sources"];
    run(cargo(&DENY).args(kinds))?;
    advisories()
}

const DENY: [&str; 4] = ["deny", "--all-features", "check", "--hide-inclusion-graph"];

/// Asks for known holes of crates, which needs the list of them from the net.
fn advisories() -> Result<(), String> {
    let found = cargo(&DENY).arg("advisories").output();
    let found = found.map_err(|error| format!("cannot start cargo deny: {error}"))?;
    let said = String::from_utf8_lossy(&found.stderr).into_owned();
    let has_no_list = said.contains("advisory database");
    match found.status.success() {
        true => Ok(()),
        false if has_no_list => skipped(format!("cargo deny has no list of advisories: {said}")),
        false => Err(format!("cargo deny: {said}")),
    }
}

/// Asks the package index for known holes of what a list pins. A package about which it says nothing is a failure where
/// everything has to be there.
fn audited(python: &Path, list: &str) -> Result<(), String> {
    let mut asked = Command::new(python);
    asked
        .args(["-m", "pip_audit", "--strict", "--progress-spinner", "off"])
        .args(["--no-deps", "--disable-pip", "--requirement", list]);
    let found = asked.current_dir(root()).output();
    let found = found.map_err(|error| format!("cannot start pip-audit: {error}"))?;
    let said = [found.stdout, found.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    let has_holes = said.contains("known vulnerabilit") && !said.contains("No known");
    match found.status.success() {
        true => Ok(()),
        false if has_holes || is_ci() => Err(format!("pip-audit of {list}: {said}")),
        false => {
            let last = said.lines().last().unwrap_or_default();
            skipped(format!("pip-audit of {list}: {last}"))
        }
    }
}

/// Whether cargo has that command; a release needs it.
///
/// # Errors
/// It is missing where everything has to be there.
pub fn has_subcommand(name: &str) -> Result<bool, String> {
    let mut asked = cargo(&[name, "--version"]);
    let status = asked.stdout(Stdio::null()).stderr(Stdio::null()).status();
    let is_there = status.is_ok_and(|status| status.success());
    if !is_there {
        skipped(format!(
            "cargo has no {name}: `cargo install cargo-{name} --locked`"
        ))?;
    }
    Ok(is_there)
}
