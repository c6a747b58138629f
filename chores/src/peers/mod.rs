//! Ours beside C by hand and the libraries of Python, in turn on one machine: tables of `BENCHMARKS.md`.
//!
//! All peers of a table are run once per round, and of each figure the least over the rounds is taken, so that
//! what else the machine does counts for nobody.

mod chain;
mod clock;
mod elementary;
mod filters;
mod functions;
mod lanes;
mod log;
mod machine;
pub mod ours;
mod page;
mod peer;
mod programs;
pub mod rows;
pub mod runs;
mod steps;
mod whole;

use crate::options;
use page::write;
use peer::{agree, agree_about, measure};
use programs::Programs;

/// Runs all peers and writes the tables.
///
/// # Errors
/// A peer that cannot be built or fails, or that does other work than the rest.
pub fn bench(arguments: &[String]) -> Result<(), String> {
    let (mut rounds, mut tables) = (5, vec!["steps", "filters", "functions"]);
    options::read(arguments, |pair| match pair.key {
        "--rounds" => pair.number().map(|number| rounds = number),
        "--table" => {
            tables.retain(|table| *table == pair.value);
            match tables.len() {
                1 => Ok(()),
                _ => Err("--table: expected steps, filters or functions".to_owned()),
            }
        }
        _ => pair.refuse("--rounds or --table"),
    })?;
    let programs = Programs::new()?;
    let head = machine::described(&programs.python);
    for name in tables {
        let mut peers = match name {
            "steps" => steps::peers(&programs)?,
            "filters" => filters::peers(&programs)?,
            _ => functions::peers(&programs)?,
        };
        measure(&mut peers, rounds)?;
        agree(&peers)?;
        agree_about(&peers, filters::WAYS, filters::BETWEEN_WAYS)?;
        let table = match name {
            "steps" => steps::table(&peers),
            "filters" => filters::table(&peers),
            _ => functions::table(&peers),
        };
        write(
            &format!("bench-peers --table {name}"),
            &format!("{head}\n{table}"),
        )?;
    }
    Ok(())
}
