//! A long log of two states, CSV to CSV, by the command and by C: the clock, processor time and peak memory of
//! whole processes.

use std::fs;

use super::log::{EKF, TRIANGULAR, in_c, ours, write_log};
use super::page::write;
use super::programs::Programs;
use super::whole;
use crate::options;

/// Measures all; writes the table.
///
/// # Errors
/// A run that fails.
pub fn bench(arguments: &[String]) -> Result<(), String> {
    let (mut rows, mut rounds) = (10_000_000, 3);
    options::read(arguments, |pair| match pair.key {
        "--rows" => pair.number().map(|number| rows = number),
        "--rounds" => pair.number().map(|number| rounds = number),
        _ => pair.refuse("--rows or --rounds"),
    })?;
    let programs = Programs::new()?;
    let log = write_log(&programs, rows)?;
    let result = |name: &str| programs.folder.join(format!("rows-{name}.csv"));
    let [first, second, third] = ["triangular", "ekf", "c"].map(result);
    let all = [
        (
            "`triangular`",
            ours(&programs, 2, TRIANGULAR, (&log, &first))?,
        ),
        ("`ekf`", ours(&programs, 2, EKF, (&log, &second))?),
        ("C, a filter with P itself", in_c(2, (&log, &third))?),
    ];
    let table = whole::table(&programs, &format!("{rows} rows"), all, rounds)?;
    for file in [log, first, second, third] {
        fs::remove_file(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    }
    write("bench-rows", &table)
}
