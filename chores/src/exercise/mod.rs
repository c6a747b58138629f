//! `cargo xtask exercise`: random operations on estimators of every kind, and what none of them may
//! do: panic, tell a number that is not finite, change where it refuses, or go another way than one
//! that was restored from its snapshot.

mod session;
mod subjects;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::numbers::Numbers;
use crate::options;
use session::{Session, Tally};
use subjects::Subject;

/// Operations of a session: then another estimator starts anew.
const SESSION: u64 = 250;

/// What to exercise, and for how long.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    pub seed: u64,
    /// operations
    pub count: u64,
    /// after which no session starts
    pub seconds: Option<u64>,
}

impl Options {
    fn read(arguments: &[String]) -> Result<Self, String> {
        let mut asked = Self {
            seed: 1,
            count: 10_000_000,
            seconds: None,
        };
        options::read(arguments, |pair| {
            match pair.key {
                "--seed" => asked.seed = pair.number()?,
                "--count" => asked.count = pair.number()?,
                "--seconds" => asked.seconds = Some(pair.number()?),
                _ => return pair.refuse("--seed, --count or --seconds"),
            }
            Ok(())
        })?;
        Ok(asked)
    }
}

/// What a search found.
#[derive(Debug, Default)]
pub struct Report {
    /// by estimator
    tallies: BTreeMap<String, Tally>,
    findings: Vec<String>,
}

/// Runs as many operations as are asked for; fails where one is a finding.
pub fn run(arguments: &[String]) -> Result<(), String> {
    let options = Options::read(arguments)?;
    let report = search(&options)?;
    for (name, tally) in &report.tallies {
        eprintln!("{name:<28} {tally}");
    }
    match report.findings.len() {
        0 => Ok(()),
        count => Err(format!("{count} findings:\n{}", report.findings.join("\n"))),
    }
}

fn search(options: &Options) -> Result<Report, String> {
    let since = Instant::now();
    let subjects = subjects::all()?;
    let (next, report) = (AtomicU64::new(0), Mutex::new(Report::default()));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || loop {
        let index = next.fetch_add(1, Ordering::Relaxed);
        let left = options.count.saturating_sub(index.saturating_mul(SESSION));
        let is_over = options
            .seconds
            .is_some_and(|s| since.elapsed().as_secs() >= s);
        if left == 0 || is_over {
            return Ok(());
        }
        let mut numbers = Numbers::new(options.seed, index);
        let place = index as usize % subjects.len();
        let found = session(&subjects, place, left.min(SESSION), &mut numbers);
        let mut report = report.lock().map_err(|e| e.to_string())?;
        let name = &subjects[place].name;
        match found {
            Ok(tally) => report.tallies.entry(name.clone()).or_default().add(&tally),
            Err(finding) => report.findings.push(format!(
                "{name}, seed {}, session {index}: {finding}",
                options.seed
            )),
        }
    };
    let results: Vec<Result<(), String>> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined = handles.into_iter().map(|handle| handle.join());
        joined
            .map(|r| r.unwrap_or_else(|_| Err("a worker panicked".to_owned())))
            .collect()
    });
    results.into_iter().collect::<Result<(), String>>()?;
    report.into_inner().map_err(|e| e.to_string())
}

/// One session; a panic is a finding, too.
fn session(
    subjects: &[Subject],
    place: usize,
    count: u64,
    numbers: &mut Numbers,
) -> Result<Tally, String> {
    let other = &subjects[(place + 1) % subjects.len()];
    let run = || Session::new(&subjects[place], other).run(count, numbers);
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| Err("a panic".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::{Options, search};

    /// `cargo xtask exercise` does a hundred times as many.
    #[test]
    fn a_hundred_thousand_random_operations() {
        let options = Options {
            seed: 20_261_122,
            count: 100_000,
            seconds: None,
        };
        let report = search(&options).unwrap();
        assert_eq!(report.findings, Vec::<String>::new());
        let total: u64 = report.tallies.values().map(|t| t.operations).sum();
        assert_eq!(total, options.count);
        for (name, tally) in &report.tallies {
            // each kind did estimate, was refused, and was compared with a restored twin
            assert!(tally.estimated > tally.operations / 4, "{name}: {tally}");
            assert!(
                tally.refused > 0 && tally.compared > tally.operations / 4,
                "{name}: {tally}"
            );
        }
    }
}
