//! Runs that go on together under a limit of time: some of them after the others, so that those that
//! are done when it strikes count.

use std::collections::{BTreeMap, HashSet};
use std::ops::ControlFlow;
use std::time::Instant;

use lynkeus_model::Plant;

use super::Again;
use super::apart::{Job, Single};
use super::runs::{Track, Whole};
use super::together::{Pass, Quantity, Together};
use crate::Error;
use crate::crew::Watch;

/// Runs of the first portion, from which the time of the others is known.
const FIRST: usize = 8;

/// Portions for which the time would be enough.
const PORTIONS: f64 = 10.0;

/// What was done in time.
pub(super) struct Portions {
    pub singles: Vec<Single>,
    pub again: Again,
}

impl Together<'_> {
    /// The runs of these seeds that are done before the time is over; none where a step is too large
    /// to be one function.
    ///
    /// # Errors
    /// A study that cannot be run.
    pub fn portions(
        &self,
        job: &Job<'_>,
        plant: &Plant,
        seeds: &[u64],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Portions>, Error> {
        let budget = &self.prepared.study().budget;
        let time = budget.left().unwrap_or_default().as_secs_f64() / PORTIONS;
        let mut done = Portions {
            singles: vec![],
            again: Again::Alone,
        };
        let mut size = FIRST;
        while done.singles.len() < seeds.len() && budget.spent().is_none() {
            let (begun, before) = (Instant::now(), done.singles.len());
            let own = &seeds[before..seeds.len().min(before.saturating_add(size))];
            let told = |part: f64| (before as f64 + part * own.len() as f64) / seeds.len() as f64;
            let pass = self.pass(own, &whole, &mut |part| watch(told(part)));
            let pass = match pass {
                // a portion that was ended says nothing of the study
                Err(_) if budget.marked().is_some() => break,
                pass => pass?,
            };
            let Some(pass) = pass else {
                return Ok(None);
            };
            done.again = pass.again;
            done.singles.extend(self.judged(job, plant, own, pass)?);
            let runs = own.len() as f64 * time / begun.elapsed().as_secs_f64();
            size = (runs as usize).max(FIRST);
        }
        let mut results = done.singles.iter_mut().map(|s| (s.seed, &mut s.result));
        if let Some((seed, Err(error))) = results.find(|(_, result)| result.is_err()) {
            self.ask_alone(seed, error, &mut |_| ControlFlow::Continue(()));
        }
        Ok(Some(done))
    }

    /// The runs of a portion, judged as alone.
    fn judged(
        &self,
        job: &Job<'_>,
        plant: &Plant,
        seeds: &[u64],
        mut pass: Pass<Vec<Track>>,
    ) -> Result<Vec<Single>, Error> {
        let quiet = &mut |_| ControlFlow::Continue(());
        let ended: HashSet<usize> = pass.ended.iter().map(|ended| ended.run).collect();
        let suspects = pass.suspects().filter(|run| !ended.contains(run));
        let suspects: Vec<u64> = suspects.map(|run| seeds[run]).collect();
        let mut results: BTreeMap<u64, Result<Option<Whole>, Error>> = BTreeMap::new();
        for (run, &seed) in seeds.iter().enumerate() {
            let of_run = |q: &mut Quantity<Vec<Track>>| std::mem::take(&mut q.kept[run]);
            let tracks = pass.quantities.iter_mut().map(of_run).collect();
            let whole = Whole {
                tracks,
                at_ends: pass.at_ends.iter().map(|counts| counts[run]).collect(),
                doubt: None,
            };
            results.insert(seed, Ok(Some(whole)));
        }
        for alone in job.singles(plant, self.rig, &suspects, quiet)? {
            match (results.get_mut(&alone.seed), alone.result) {
                (Some(Ok(Some(own))), Ok(Some(alone))) => own.doubt = alone.doubt,
                // a limit ended it: nobody knows whether the run is credible
                (Some(own), Ok(None)) => *own = Ok(None),
                _ => {}
            }
        }
        let errors = self.errors(seeds, &pass.ended).into_iter();
        results.extend(errors.map(|(seed, error)| (seed, Err(error))));
        job.time.get_or_init(|| pass.time);
        let results = results.into_iter();
        Ok(results
            .map(|(seed, result)| Single { seed, result })
            .collect())
    }
}

/// Every row of so many runs.
fn whole(runs: usize, rows: usize) -> Vec<Track> {
    let tracks = || Track {
        truth: Vec::with_capacity(rows),
        estimate: Vec::with_capacity(rows),
        coverage: None,
    };
    (0..runs).map(|_| tracks()).collect()
}
