//! The bill of materials of the command: every crate that is linked, as CycloneDX.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;
use xtask::process::{begins, cargo, root, run};

use crate::audit::has_subcommand;

/// The crate of the command.
const COMMAND: &str = "lynkeus-cli";

/// Writes the bill beside its name, and compares it with what cargo links.
///
/// # Errors
/// What stands in one of the two only, or what cannot be run.
pub fn check(folder: &Path) -> Result<(), String> {
    if !has_subcommand("cyclonedx")? {
        return Ok(());
    }
    // cargo-cyclonedx writes beside the manifest
    let crate_folder = root().join("crates").join(COMMAND);
    let manifest = crate_folder.join("Cargo.toml");
    let mut bill = cargo(&["cyclonedx", "--format", "json", "--all", "--target", "all"]);
    bill.args(["--override-filename", "bill", "--manifest-path"]);
    run(bill.arg(manifest))?;
    let written = crate_folder.join("bill.json");
    let text = fs::read_to_string(&written)
        .map_err(|error| format!("cannot read {}: {error}", written.display()))?;
    let kept = folder.join("lynkeus.cdx.json");
    fs::rename(&written, &kept)
        .map_err(|error| format!("cannot write {}: {error}", kept.display()))?;
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
