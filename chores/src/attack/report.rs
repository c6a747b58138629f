//! What was found, by its sort.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use super::oracle::{Class, Finding};
use super::{Case, Options};

/// Cases kept of each sort.
const KEPT: usize = 3;

/// Counts, and the first cases of each sort of finding.
#[derive(Default)]
pub struct Report {
    cases: u64,
    runs: usize,
    found: BTreeMap<(Class, String), Vec<u64>>,
}

impl Report {
    pub fn add(
        &mut self,
        options: &Options,
        index: u64,
        case: &Case,
        runs: usize,
        finding: Option<Finding>,
    ) -> Result<(), String> {
        self.cases += 1;
        self.runs += runs;
        let Some(finding) = finding else {
            return Ok(());
        };
        let word = case.commands[runs - 1].arguments[0].clone();
        let sort = match finding.class {
            Class::Hang | Class::Memory | Class::Signal => word,
            _ => signature(&finding.evidence),
        };
        let cases = self.found.entry((finding.class, sort)).or_default();
        cases.push(index);
        if cases.len() > KEPT {
            return Ok(());
        }
        let name = format!("{:?}-{}-{index}", finding.class, options.seed);
        let folder = options.folder.join(name);
        keep(&folder, case, &finding).map_err(|e| format!("{}: {e}", folder.display()))
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    #[cfg(test)]
    pub fn runs(&self) -> usize {
        self.runs
    }

    pub fn text(&self) -> String {
        let mut text = format!("{} cases, {} commands\n", self.cases, self.runs);
        for ((class, sort), cases) in &self.found {
            let first: Vec<String> = cases.iter().take(KEPT).map(u64::to_string).collect();
            let count = cases.len();
            _ = writeln!(
                text,
                "{class:?} × {count}: {sort} (cases {})",
                first.join(", ")
            );
        }
        text
    }
}

/// Findings that differ in their numbers only are of one sort.
fn signature(evidence: &str) -> String {
    let mut sort = String::new();
    for c in evidence.chars().take(100) {
        let c = if c.is_ascii_digit() { '0' } else { c };
        if c != '0' || !sort.ends_with('0') {
            sort.push(c);
        }
    }
    sort
}

fn keep(folder: &Path, case: &Case, finding: &Finding) -> std::io::Result<()> {
    let _ = std::fs::remove_dir_all(folder);
    std::fs::create_dir_all(folder)?;
    for (name, bytes) in &case.files {
        std::fs::write(folder.join(name), bytes)?;
    }
    let mut text = format!("{:?}: {}\n", finding.class, finding.evidence);
    for command in &case.commands {
        let words: Vec<String> = command.arguments.iter().map(|w| format!("{w:?}")).collect();
        _ = writeln!(text, "lynkeus {}", words.join(" "));
    }
    std::fs::write(folder.join("CMD.txt"), text)
}
