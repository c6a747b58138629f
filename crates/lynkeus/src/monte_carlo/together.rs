//! All runs at once, where their steps are fixed: row by row, so that no more than some rows of
//! them are in memory.

use lynkeus_run::{Batch, Column, Member, Method, Role, Step};

use super::statistics::{Found, Scatter};
use super::{Failure, Figures, Followed};
use crate::credible::Screen;
use crate::crew::{self, Watch};
use crate::prepare::Prepared;
use crate::simulate::Rig;
use crate::{Error, Study};

/// Bytes of the rows that are in memory at a time.
const WINDOW: usize = 32 << 20;

/// The runs of many seeds.
pub(super) struct Together<'a> {
    pub prepared: &'a Prepared<'a>,
    pub rig: &'a Rig,
    pub followed: &'a [Followed],
}

impl Together<'_> {
    /// Whether so many runs can go on together: not where each has steps or a program of its own.
    ///
    /// # Errors
    /// Runs that would not fit into the memory.
    pub fn can(&self, runs: usize) -> Result<bool, Error> {
        let has_steps = matches!(
            self.rig.simulation.method,
            Method::Rk4(Step::AtMost(_) | Step::Substeps(_))
        );
        let is_filter = self.rig.design.observer.filter.is_some();
        if !has_steps || is_filter || self.rig.has_own_programs() {
            return Ok(false);
        }
        room(self.prepared.study(), self.rig, runs, self.followed.len())?;
        Ok(true)
    }

    /// The figures of the runs of these seeds; none where a step is too large to be one function.
    ///
    /// # Errors
    /// A study that cannot be run, no run that reached its end, or a limit.
    pub fn figures(&self, seeds: &[u64], watch: &mut Watch<'_>) -> Result<Option<Screened>, Error> {
        let columns: Vec<Column> = self.followed.iter().flat_map(Followed::columns).collect();
        let Some(first) = self.pass(seeds, &columns, &mut *watch)? else {
            return Ok(None);
        };
        let failures = self.failures(seeds, &first, watch)?;
        let seeds: Vec<u64> = seeds
            .iter()
            .copied()
            .filter(|seed| failures.iter().all(|f| f.seed != *seed))
            .collect();
        // the rows of runs that ended are in these figures: once more without them
        let pass = match failures.is_empty() {
            true => first,
            false => match self.pass(&seeds, &columns, &mut *watch)? {
                Some(pass) => pass,
                None => return Ok(None),
            },
        };
        let rows = pass.time.len();
        let is_suspect = |k: usize| pass.quantities.iter().any(|q| q.screens[k].is_suspect());
        let suspects = (0..seeds.len()).filter(|k| is_suspect(*k));
        let suspects = suspects.map(|k| seeds[k]).collect();
        let scatters = pass.quantities.into_iter().map(|q| q.scatter);
        let mut found: Vec<Found> = scatters.map(|s| s.found(rows)).collect();
        self.worst_courses(&seeds, &columns, &mut found)?;
        let figures = Figures {
            seeds,
            failures,
            doubtful: vec![],
            time: pass.time,
            found,
        };
        Ok(Some(Screened { figures, suspects }))
    }

    fn batch(&self, seeds: &[u64], columns: &[Column]) -> Result<Option<Batch>, Error> {
        let simulation = &self.rig.simulation;
        let members = seeds.iter().map(|&seed| Member {
            seed,
            start: self.rig.start(seed),
        });
        let members: Vec<Member> = members.collect();
        Batch::new(simulation, &members, columns).map_err(Error::from_source)
    }

    /// All runs from start to end.
    fn pass(
        &self,
        seeds: &[u64],
        columns: &[Column],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Pass>, Error> {
        let study = self.prepared.study();
        let row = seeds.len() * columns.len() * size_of::<f64>();
        let Some(mut batch) = self.batch(seeds, columns)? else {
            return Ok(None);
        };
        let (rows, threads) = (batch.rows(), crew::threads());
        let mut pass = Pass {
            time: Vec::with_capacity(rows),
            quantities: self
                .followed
                .iter()
                .map(|f| self.quantity(f, seeds.len(), rows))
                .collect(),
            ended: vec![],
        };
        let window = (WINDOW / row.max(1)).max(1);
        while batch.advance(window, threads).map_err(Error::from_source)? {
            let first = pass.time.len();
            pass.time.extend(batch.times());
            crew::each(&mut pass.quantities, threads, &|place, quantity| {
                for k in 0..batch.times().len() {
                    let pairs = || {
                        let truth = batch.values(k, 2 * place);
                        truth.zip(batch.values(k, 2 * place + 1))
                    };
                    let row = first + k;
                    quantity.scatter.add(pairs(), row >= rows / 2);
                    for (screen, (truth, estimate)) in quantity.screens.iter_mut().zip(pairs()) {
                        screen.add(row, truth, estimate);
                    }
                }
            });
            if let Some(spent) = study.budget.spent() {
                return Err(Error::ended(spent));
            }
            if watch(pass.time.len() as f64 / rows as f64).is_break() {
                return Err(Error::input("the runs were stopped"));
            }
        }
        pass.ended = batch.ended().cloned().collect();
        Ok(Some(pass))
    }

    fn quantity(&self, followed: &Followed, runs: usize, rows: usize) -> Quantity {
        let estimate = &self.rig.design.observer.estimates[followed.estimate];
        Quantity {
            scatter: Scatter::new(runs),
            screens: vec![Screen::new(&estimate.variable, rows); runs],
        }
    }

    /// The runs that did not reach their end. The first one is done alone, which says more.
    fn failures(
        &self,
        seeds: &[u64],
        pass: &Pass,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Failure>, Error> {
        let file = &self.prepared.study().file;
        let mut failures: Vec<Failure> = pass
            .ended
            .iter()
            .filter_map(|ended| {
                let error = Error::refused(ended.error.to_string()).at(file);
                Some(Failure {
                    seed: *seeds.get(ended.run)?,
                    reason: error.to_string(),
                })
            })
            .collect();
        failures.sort_by_key(|f| f.seed);
        let Some(first) = failures.first_mut() else {
            return Ok(failures);
        };
        let alone = self.rig.run(self.prepared, first.seed, watch);
        let error = match alone {
            Ok(ran) => ran
                .course
                .ended
                .map(|e| Error::refused(e.to_string()).at(file)),
            Err(error) => Some(error),
        };
        if let Some(error) = &error {
            first.reason = error.to_string();
        }
        if failures.len() < seeds.len() {
            return Ok(failures);
        }
        let told = || Error::refused(failures[0].reason.clone()).at(file);
        Err(error.unwrap_or_else(told))
    }

    /// The courses of the worst runs, which are done once more.
    fn worst_courses(
        &self,
        seeds: &[u64],
        columns: &[Column],
        found: &mut [Found],
    ) -> Result<(), Error> {
        let mut worst: Vec<usize> = found.iter().map(|f| f.worst_run).collect();
        worst.sort_unstable();
        worst.dedup();
        let own: Vec<u64> = worst
            .iter()
            .filter_map(|k| seeds.get(*k).copied())
            .collect();
        let Some(mut batch) = self.batch(&own, columns)? else {
            return Ok(());
        };
        while batch.advance(batch.rows(), 1).map_err(Error::from_source)? {
            for (place, found) in found.iter_mut().enumerate() {
                let run = worst.iter().position(|k| *k == found.worst_run);
                for k in 0..batch.times().len() {
                    let value = |column| batch.values(k, column).nth(run.unwrap_or(0));
                    let pair = value(2 * place + 1).zip(value(2 * place));
                    found.worst_course.extend(pair.map(|(hat, x)| hat - x));
                }
            }
        }
        Ok(())
    }
}

impl Followed {
    /// True value and estimate.
    fn columns(&self) -> [Column; 2] {
        [self.truth, Role::Estimate.at(self.estimate)]
    }
}

/// Figures, and the seeds of runs whose estimates may not be credible.
pub(super) struct Screened {
    pub figures: Figures,
    pub suspects: Vec<u64>,
}

/// One quantity over all runs.
struct Quantity {
    scatter: Scatter,
    /// by run
    screens: Vec<Screen>,
}

/// What the rows of all runs gave.
struct Pass {
    time: Vec<f64>,
    quantities: Vec<Quantity>,
    ended: Vec<lynkeus_run::Ended>,
}

/// Bytes that the noise of one signal takes, at most.
const STREAM: usize = 512;

/// Refuses what would not fit into the memory that the study may take.
fn room(study: &Study, rig: &Rig, runs: usize, quantities: usize) -> Result<(), Error> {
    let run = &rig.simulation;
    let observer = run.observer.as_ref().map_or(0, |o| o.states().len());
    let values = run.plant.states().len() + observer + run.plant.outputs().len();
    let streams = run.noise.levels.len() + run.noise.process.len();
    // states before and after a step; starts, figures and screens; a row of what is followed
    let screen = size_of::<Screen>() / size_of::<f64>();
    let numbers = 3 * values + (6 + screen) * quantities + 16;
    let of_run = (numbers * size_of::<f64>() + streams * STREAM) as f64;
    let rows = ((run.until - run.start) / run.output_step).ceil() + 1.0;
    let figures = rows * (quantities * size_of::<[f64; 8]>()) as f64;
    let bytes = runs as f64 * of_run + figures + WINDOW as f64;
    let room = study.budget.room().unwrap_or(usize::MAX) as f64;
    if bytes <= room {
        return Ok(());
    }
    let mib = |bytes: f64| (bytes / f64::from(1 << 20)).ceil();
    let message = format!(
        "{runs} runs of {rows} rows take {} MiB, and {} MiB are left",
        mib(bytes),
        mib(room)
    );
    Err(Error::input(message)
        .at(&study.file)
        .hint("fewer runs, a longer `output_step` of [simulate], or a greater limit of memory"))
}
