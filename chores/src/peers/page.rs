//! `BENCHMARKS.md`, where the tables stand.

use std::fs;

use xtask::process::root;

const END: &str = "<!-- end of table -->";

/// Writes the table of a task.
pub(super) fn write(task: &str, table: &str) -> Result<(), String> {
    eprint!("{table}");
    let begin = format!("<!-- table: cargo xtask {task} -->\n");
    let page = root().join("BENCHMARKS.md");
    let text = fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
    let marks = text
        .split_once(&begin)
        .and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
    let (before, after) = marks.ok_or_else(|| format!("BENCHMARKS.md has no mark {begin}"))?;
    let text = format!("{before}{begin}{table}{END}{after}");
    fs::write(&page, text).map_err(|e| format!("{}: {e}", page.display()))
}
