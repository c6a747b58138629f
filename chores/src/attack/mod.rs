//! `cargo xtask attack`: mutated models, studies, logs and command lines, and what the command must
//! never do with them.

mod base;
mod commands;
mod free;
mod mutate;
mod options;
mod oracle;
mod report;
mod run;
mod shape;
#[cfg(test)]
mod tests;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::numbers::Numbers;
use base::Base;
use oracle::Finding;
use report::Report;
use run::Desk;

pub use options::Options;

/// Runs as many cases as are asked for; fails where one is a finding.
pub fn run(arguments: &[String]) -> Result<(), String> {
    let options = Options::read(arguments)?;
    let report = search(&options)?;
    eprint!("{}", report.text());
    match report.is_empty() {
        true => Ok(()),
        false => Err(format!("findings, kept under {}", options.folder.display())),
    }
}

fn search(options: &Options) -> Result<Report, String> {
    let binary = options.binary()?;
    let since = Instant::now();
    let bases = base::shipped(&binary, &options.folder)?;
    let (next, report) = (AtomicU64::new(0), Mutex::new(Report::default()));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let work = |number: usize| -> Result<(), String> {
        let desk = Desk::new(&options.folder, number, &binary, options.limit)?;
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let is_over = options
                .seconds
                .is_some_and(|s| since.elapsed().as_secs() >= s);
            if index >= options.count || is_over {
                return Ok(());
            }
            let case = Case::new(&bases, &mut Numbers::new(options.seed, index));
            let (runs, finding) = desk.attack(&case)?;
            let mut report = report.lock().map_err(|e| e.to_string())?;
            report.add(options, index, &case, runs, finding)?;
        }
    };
    let results: Vec<Result<(), String>> = std::thread::scope(|scope| {
        let work = &work;
        let spawn = |number| scope.spawn(move || work(number));
        let handles: Vec<_> = (0..workers).map(spawn).collect();
        let joined = handles.into_iter().map(|handle| handle.join());
        joined
            .map(|r| r.unwrap_or_else(|_| Err("a worker panicked".to_owned())))
            .collect()
    });
    results.into_iter().collect::<Result<(), String>>()?;
    report.into_inner().map_err(|e| e.to_string())
}

/// Files, and the commands that are run on them one after another.
#[derive(Clone, Debug)]
struct Case {
    files: Vec<(String, Vec<u8>)>,
    commands: Vec<commands::Command>,
}

impl Case {
    /// A shipped or a random plant with a few mutations, and some commands.
    fn new(bases: &[Base], numbers: &mut Numbers) -> Self {
        let base = match numbers.chance(0.6) {
            true => numbers.of(bases).clone(),
            false if numbers.chance(0.5) => base::random(numbers),
            false => free::free(numbers),
        };
        let commands = commands::choose(numbers, &base);
        let mut files = base.files;
        // most tests of a message need one fault, and a well-formed case tells as well
        while numbers.chance(0.7) {
            let index = numbers.below(files.len());
            let donor = numbers.of(bases);
            let donor = donor.files[numbers.below(donor.files.len())].1.clone();
            let bytes = &mut files[index].1;
            *bytes = mutate::mutated(numbers, bytes, &donor);
        }
        Self { files, commands }
    }
}
