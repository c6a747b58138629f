//! `cargo xtask falsify`: random and adversarial plants, whose certificates are attacked
//! and whose refutations are looked at again with many digits.

mod attack;
pub mod case;
mod chance;
mod claims;
mod error;
mod facts;
pub mod generate;
mod instant;
mod integrate;
mod judge;
mod pair;
mod precise;
mod refute;
mod report;
mod retune;
mod run;
mod shrink;
mod signals;
mod tally;
#[cfg(test)]
mod tests;
mod tube;

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::numbers::Numbers;
use case::Kind;
use judge::{Desk, Effort, Flaw, Judgement, Violation};
use report::Report;

pub use report::Options;

/// Runs until the numbers asked for are reached; fails where a claim is false.
pub fn run(arguments: &[String]) -> Result<(), String> {
    let options = Options::read(arguments)?;
    let report = search(&options)?;
    eprint!("{}", report.text());
    match report.found.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "{} cases with a false claim, under {}",
            report.found.len(),
            options.folder.display()
        )),
    }
}

/// Shares of the kinds: gains by matrix inequalities take long.
const ROUND: &[Kind] = &[
    Kind::Triangular,
    Kind::DriftObservable,
    Kind::BlockTriangular,
    Kind::StateAffine,
    Kind::UnknownInput,
    Kind::Triangular,
    Kind::DriftObservable,
    Kind::Designed,
    Kind::StateAffine,
    Kind::UnknownInput,
    Kind::Filter,
];

fn search(options: &Options) -> Result<Report, String> {
    let next = AtomicU64::new(0);
    let report = Mutex::new(Report::new());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let errors: Vec<String> = std::thread::scope(|scope| {
        let worker = |number: usize| {
            let (next, report) = (&next, &report);
            move || work(options, number, next, report)
        };
        let handles: Vec<_> = (0..workers).map(|i| scope.spawn(worker(i))).collect();
        let results = handles.into_iter().map(|h| h.join());
        results
            .filter_map(|r| r.unwrap_or_else(|_| Err("a worker panicked".into())).err())
            .collect()
    });
    match errors.into_iter().next() {
        Some(error) => Err(error),
        None => report.into_inner().map_err(|e| e.to_string()),
    }
}

fn work(
    options: &Options,
    worker: usize,
    next: &AtomicU64,
    report: &Mutex<Report>,
) -> Result<(), String> {
    let desk = desk(&options.folder, worker)?;
    loop {
        let proved = {
            let report = report.lock().map_err(|e| e.to_string())?;
            if report.is_enough(options) {
                return Ok(());
            }
            report.tally.total().proved
        };
        let index = next.fetch_add(1, Ordering::Relaxed);
        if options.plants.is_some_and(|plants| index >= plants) {
            return Ok(());
        }
        let kind = options.kind.unwrap_or(ROUND[index as usize % ROUND.len()]);
        let mut numbers = Numbers::new(options.seed, index);
        let case = generate::case(&mut numbers, kind);
        let effort = options.effort(index, proved);
        let judged = guarded(&case, &desk, &mut numbers, effort);
        let (counts, found) = match judged {
            Ok(judgement) => {
                let first = judgement.violations.into_iter().next();
                let found = first.map(|first| {
                    // what is printed is told by the observer at one point, however large
                    let common = first.flaw == Flaw::Gain
                        || report.lock().is_ok_and(|r| r.is_common(kind, &first.flaw));
                    match common {
                        true => (judgement.case, first),
                        false => shrink::smallest(&judgement.case, &desk, &first, effort),
                    }
                });
                (judgement.counts, found)
            }
            Err(violation) => (tally::Counts::default(), Some((case, violation))),
        };
        let mut report = report.lock().map_err(|e| e.to_string())?;
        report.add(options, kind, index, &counts, found)?;
    }
}

fn desk(folder: &Path, worker: usize) -> Result<Desk, String> {
    let place = folder.join(format!("desk-{worker}"));
    Desk::new(&place).map_err(|e| format!("{}: {e}", place.display()))
}

/// A panic of the library is a finding, too; so is a case that it cannot read.
fn guarded(
    case: &case::Case,
    desk: &Desk,
    numbers: &mut Numbers,
    effort: Effort,
) -> Result<Judgement, Violation> {
    let judged = std::panic::AssertUnwindSafe(|| judge::judge(case, desk, numbers, effort, true));
    let evidence = match std::panic::catch_unwind(judged) {
        Ok(Ok(judgement)) => return Ok(judgement),
        Ok(Err(message)) => message,
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned();
            text.unwrap_or_else(|| "a panic".into())
        }
    };
    Err(Violation {
        flaw: Flaw::Panic,
        evidence,
    })
}
