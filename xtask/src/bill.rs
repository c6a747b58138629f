//! The bill of materials of the command: every crate that is linked, as CycloneDX.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use xtask::process::{begins, cargo, run};

use crate::audit::has_subcommand;

/// The crate of the command.
const COMMAND: &str = "lynkeus-cli";

/// How the tool is asked to call what it writes, to which it adds the format.
const NAME: &str = "bill-of-materials";
const FILE: &str = "bill-of-materials.json";

/// Writes the bill into the folder, and compares it with what cargo links.
///
/// # Errors
/// What is linked and is not in the bill, or what cannot be run.
pub fn check(folder: &Path) -> Result<(), String> {
    if !has_subcommand("cyclonedx")? {
        return Ok(());
    }
    let mut bill = cargo(&["cyclonedx", "--format", "json", "--spec-version", "1.5"]);
    bill.args(["--all", "--target", "all", "--override-filename", NAME]);
    run(&mut bill)?;
    // it writes one beside the manifest of every member
    let members = members()?;
    let own = members.iter().find(|member| member.ends_with(COMMAND));
    let own = own.ok_or_else(|| format!("the workspace has no {COMMAND}"))?;
    let text = fs::read_to_string(own.join(FILE)).map_err(|error| format!("no bill: {error}"));
    for member in &members {
        // a member that has none is no fault
        let _ = fs::remove_file(member.join(FILE));
    }
    let text = text?;
    let kept = folder.join("lynkeus.cdx.json");
    fs::write(&kept, &text).map_err(|error| format!("cannot write {}: {error}", kept.display()))?;
    let listed = listed(&text)?;
    let linked = linked()?;
    if let Some(missing) = linked.difference(&listed).next() {
        return Err(format!("the bill of materials lacks {missing}"));
    }
    begins(&format!(
        "release: a bill of {} crates: {}",
        listed.len(),
        kept.display()
    ));
    Ok(())
}

/// The folders of the workspace's crates.
fn members() -> Result<Vec<PathBuf>, String> {
    let mut asked = cargo(&["metadata", "--format-version", "1", "--no-deps", "--locked"]);
    let found = asked.output();
    let found = found.map_err(|error| format!("cannot ask cargo for the members: {error}"))?;
    let found: Value = serde_json::from_slice(&found.stdout)
        .map_err(|error| format!("cannot read what cargo says of the members: {error}"))?;
    let packages = found["packages"].as_array().into_iter().flatten();
    let manifests = packages.filter_map(|package| package["manifest_path"].as_str());
    let folders = manifests.filter_map(|manifest| Path::new(manifest).parent());
    Ok(folders.map(Path::to_path_buf).collect())
}

/// Name and version of every component.
fn listed(bill: &str) -> Result<BTreeSet<String>, String> {
    let bill: Value = serde_json::from_str(bill)
        .map_err(|error| format!("the bill of materials is no JSON: {error}"))?;
    if bill["bomFormat"] != "CycloneDX" {
        return Err("the bill of materials is not in the format CycloneDX".to_owned());
    }
    let components = bill["components"].as_array().into_iter().flatten();
    let word =
        |component: &Value, key: &str| component[key].as_str().unwrap_or_default().to_owned();
    Ok(components
        .map(|component| format!("{} {}", word(component, "name"), word(component, "version")))
        .collect())
}

/// Name and version of every crate that the command is linked with, on any system.
fn linked() -> Result<BTreeSet<String>, String> {
    let mut tree = cargo(&[
        "tree",
        "--locked",
        "--package",
        COMMAND,
        "--edges",
        "normal",
    ]);
    let found = tree
        .args(["--target", "all", "--prefix", "none", "--format", "{p}"])
        .output()
        .map_err(|error| format!("cannot run cargo tree: {error}"))?;
    let text = String::from_utf8_lossy(&found.stdout).into_owned();
    let named = |line: &str| {
        let mut words = line.split_whitespace();
        let (name, version) = (words.next()?, words.next()?);
        Some(format!("{name} {}", version.trim_start_matches('v')))
    };
    // the command is what the bill is of
    let own = format!("{COMMAND} ");
    let linked = text.lines().filter_map(named);
    Ok(linked.filter(|crate_| !crate_.starts_with(&own)).collect())
}

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn components_are_read() {
        let bill =
            r#"{"bomFormat": "CycloneDX", "components": [{"name": "a", "version": "1.2.3"}]}"#;
        let found: Vec<_> = listed(bill).unwrap().into_iter().collect();
        assert_eq!(found, ["a 1.2.3"]);
        assert!(listed("{}").is_err());
    }
}
