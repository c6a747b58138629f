//! All runs at once, where their steps are fixed: row by row, so that no more than some rows of
//! them are in memory.

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use lynkeus_run::{Batch, Column, Ended, Member, Method, Role, Step};

use super::ends::{Clipped, Sensor};
use super::runs::{Again, Failure, Followed};
use super::statistics::{Found, Keep, Scatter};
use crate::course::rig::Rig;
use crate::crew::{self, Watch};
use crate::judge::Screen;
use crate::prepare::Prepared;
use crate::words::explain;
use crate::words::in_words;
use crate::{Error, Study};

/// Bytes of the rows that are in memory at a time.
const WINDOW: usize = 32 << 20;

/// Time after which the rows that were made are handed over.
const TOLD: Duration = Duration::from_millis(50);

/// The runs of many seeds.
pub(super) struct Together<'a> {
    pub prepared: &'a Prepared<'a>,
    pub rig: &'a Rig,
    pub followed: &'a [Followed],
    pub sensors: &'a [Sensor],
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
        let Some(first) = self.pass(seeds, &|runs, _| Scatter::new(runs), &mut *watch)? else {
            return Ok(None);
        };
        let failures = self.failures(seeds, &first.ended, watch)?;
        let failed: HashSet<u64> = failures.iter().map(|f| f.seed).collect();
        let mut seeds = seeds.to_vec();
        seeds.retain(|seed| !failed.contains(seed));
        // the rows of runs that ended are in these figures: once more without them
        let pass = match failures.is_empty() {
            true => first,
            false => match self.pass(&seeds, &|runs, _| Scatter::new(runs), &mut *watch)? {
                Some(pass) => pass,
                None => return Ok(None),
            },
        };
        let suspects = pass.suspects().map(|k| seeds[k]).collect();
        let at_ends = pass.at_ends.into_iter();
        let clipped = at_ends.map(|counts| Clipped::of(counts.into_iter()));
        let clipped = clipped.collect();
        let rows = pass.time.len();
        let scatters = pass.quantities.into_iter().map(|q| q.kept);
        let mut found: Vec<Found> = scatters.map(|s| s.found(rows)).collect();
        self.worst_courses(&seeds, &mut found)?;
        let figures = Figures {
            seeds,
            failures,
            doubtful: vec![],
            time: pass.time,
            found,
            clipped,
            again: pass.again,
        };
        Ok(Some(Screened { figures, suspects }))
    }

    fn batch(&self, seeds: &[u64]) -> Result<Option<Batch>, Error> {
        let simulation = &self.rig.simulation;
        let columns = self.followed.iter().flat_map(Followed::columns);
        let readings = self.sensors.iter().map(|sensor| sensor.readings);
        let columns: Vec<Column> = columns.chain(readings).collect();
        let members = seeds.iter().map(|&seed| Member {
            seed,
            start: self.rig.start(seed),
        });
        let members: Vec<Member> = members.collect();
        Batch::new(simulation, &members, &columns).map_err(|error| self.told(error))
    }

    /// All runs from start to end, with what is made of their rows; `kept` for so many runs and rows.
    ///
    /// # Errors
    /// As [`Together::figures`].
    pub fn pass<K: Keep>(
        &self,
        seeds: &[u64],
        kept: &dyn Fn(usize, usize) -> K,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Pass<K>>, Error> {
        let Some(mut batch) = self.batch(seeds)? else {
            return Ok(None);
        };
        let rows = batch.rows();
        let quantity = |followed: &Followed| {
            let estimate = &self.rig.design.observer.estimates[followed.estimate];
            Quantity {
                kept: kept(seeds.len(), rows),
                screens: vec![Screen::new(&estimate.variable, rows); seeds.len()],
            }
        };
        let mut pass = Pass {
            time: Vec::with_capacity(rows),
            quantities: self.followed.iter().map(quantity).collect(),
            at_ends: vec![vec![0; seeds.len()]; self.sensors.len()],
            ended: vec![],
            again: Again::of(&batch),
        };
        self.drive(&mut batch, &mut |batch| {
            pass.add(batch, self.sensors);
            watch(pass.time.len() as f64 / rows as f64)
        })?;
        pass.ended = batch.ended().cloned().collect();
        Ok(Some(pass))
    }

    /// Takes a batch to its end and hands it over every so many rows.
    fn drive(
        &self,
        batch: &mut Batch,
        take: &mut dyn FnMut(&Batch) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let study = self.prepared.study();
        let is_over = || study.budget.spent().is_some();
        let columns = 2 * self.followed.len() + self.sensors.len();
        let row = batch.len() * columns * size_of::<f64>();
        let most = WINDOW / row.max(1);
        let mut rows = 1;
        loop {
            let begun = Instant::now();
            let goes_on = batch.advance(rows, crew::threads(), &is_over);
            if !goes_on.map_err(|error| self.told(error))? {
                return Ok(());
            }
            if take(batch).is_break() {
                return Err(Error::input("the runs were stopped"));
            }
            if begun.elapsed() < TOLD {
                rows = (2 * rows).clamp(1, most.max(1));
            }
        }
    }

    /// An error of the batch as a whole.
    fn told(&self, error: lynkeus_run::Error) -> Error {
        let study = self.prepared.study();
        let told = match study.budget.marked() {
            Some(spent) => Error::ended(spent),
            None => explain(error),
        };
        told.at(&study.file)
    }

    /// The runs that did not reach their end.
    fn failures(
        &self,
        seeds: &[u64],
        ended: &[Ended],
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Failure>, Error> {
        let mut errors = self.errors(seeds, ended);
        if let Some((seed, error)) = errors.first_mut() {
            self.ask_alone(*seed, error, watch);
        }
        if errors.len() == seeds.len()
            && let Some((_, first)) = errors.drain(..).next()
        {
            return Err(first);
        }
        let failure = |(seed, error): (u64, Error)| Failure {
            seed,
            reason: error.to_string(),
        };
        Ok(errors.into_iter().map(failure).collect())
    }

    /// Why runs did not reach their end, by seed.
    pub fn errors(&self, seeds: &[u64], ended: &[Ended]) -> Vec<(u64, Error)> {
        let file = &self.prepared.study().file;
        let told = |ended: &Ended| {
            let error = Error::refused(in_words(&ended.error)).at(file);
            Some((*seeds.get(ended.run)?, error))
        };
        let mut errors: Vec<(u64, Error)> = ended.iter().filter_map(told).collect();
        errors.sort_by_key(|(seed, _)| *seed);
        errors
    }

    /// Why a run did not reach its end as it is told alone, which says more.
    pub fn ask_alone(&self, seed: u64, error: &mut Error, watch: &mut Watch<'_>) {
        let study = self.prepared.study();
        let alone = match self.rig.run(self.prepared, seed, watch) {
            Ok(ran) => ran
                .course
                .ended
                .map(|e| Error::refused(e.to_string()).at(&study.file)),
            Err(alone) => Some(alone),
        };
        // what a limit ended says nothing of the study
        if let (Some(alone), None) = (alone, study.budget.marked()) {
            *error = alone;
        }
    }

    /// The courses of the worst runs, which are done once more; without a value from where a limit
    /// ended that.
    fn worst_courses(&self, seeds: &[u64], found: &mut [Found]) -> Result<(), Error> {
        let mut worst: Vec<usize> = found.iter().map(|f| f.worst_run).collect();
        worst.sort_unstable();
        worst.dedup();
        let own: Vec<u64> = worst
            .iter()
            .filter_map(|k| seeds.get(*k).copied())
            .collect();
        let Some(mut batch) = self.batch(&own)? else {
            return Ok(());
        };
        let driven = self.drive(&mut batch, &mut |batch| {
            for (place, found) in found.iter_mut().enumerate() {
                let run = worst.iter().position(|k| *k == found.worst_run);
                for k in 0..batch.times().len() {
                    let value = |column| batch.values(k, column).nth(run.unwrap_or(0));
                    let pair = value(2 * place + 1).zip(value(2 * place));
                    found.worst_course.extend(pair.map(|(hat, x)| hat - x));
                }
            }
            ControlFlow::Continue(())
        });
        if self.prepared.study().budget.marked().is_none() {
            driven?;
        }
        for found in found {
            found.worst_course.resize(batch.rows(), f64::NAN);
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

/// What all runs together give.
pub(super) struct Figures {
    /// of the runs that reached their end
    pub seeds: Vec<u64>,
    pub failures: Vec<Failure>,
    /// in the figures, but not credible
    pub doubtful: Vec<Failure>,
    pub time: Vec<f64>,
    /// by quantity
    pub found: Vec<Found>,
    /// by sensor with limits
    pub clipped: Vec<Clipped>,
    pub again: Again,
}

/// Figures, and the seeds of runs whose estimates may not be credible.
pub(super) struct Screened {
    pub figures: Figures,
    pub suspects: Vec<u64>,
}

/// One quantity over all runs.
pub(super) struct Quantity<K> {
    pub kept: K,
    /// by run
    screens: Vec<Screen>,
}

/// What the rows of all runs gave.
pub(super) struct Pass<K> {
    pub time: Vec<f64>,
    pub quantities: Vec<Quantity<K>>,
    /// readings at an end, by sensor with limits and by run
    pub at_ends: Vec<Vec<usize>>,
    pub ended: Vec<Ended>,
    pub again: Again,
}

impl<K: Keep> Pass<K> {
    /// The rows at hand.
    fn add(&mut self, batch: &Batch, sensors: &[Sensor]) {
        let (first, rows) = (self.time.len(), batch.rows());
        self.time.extend(batch.times());
        crew::each(&mut self.quantities, crew::threads(), &|place, quantity| {
            for k in 0..batch.times().len() {
                let pairs = || {
                    let truth = batch.values(k, 2 * place);
                    truth.zip(batch.values(k, 2 * place + 1))
                };
                let row = first + k;
                quantity.kept.add(pairs(), row >= rows / 2);
                for (screen, (truth, estimate)) in quantity.screens.iter_mut().zip(pairs()) {
                    screen.add(row, truth, estimate);
                }
            }
        });
        let first = 2 * self.quantities.len();
        crew::each(&mut self.at_ends, crew::threads(), &|place, counts| {
            let limits = sensors[place].limits;
            for k in 0..batch.times().len() {
                let readings = batch.values(k, first + place);
                for (count, reading) in counts.iter_mut().zip(readings) {
                    *count += usize::from(limits.ends(reading));
                }
            }
        });
    }

    /// The runs whose estimates may not be credible, by their places.
    pub fn suspects(&self) -> impl Iterator<Item = usize> + '_ {
        let runs = self.quantities.first().map_or(0, |q| q.screens.len());
        let is_suspect = |k: &usize| self.quantities.iter().any(|q| q.screens[*k].is_suspect());
        (0..runs).filter(is_suspect)
    }
}

impl Again {
    fn of(batch: &Batch) -> Self {
        match batch.is_exact() {
            true => Self::Alone,
            false => Self::InABatch,
        }
    }
}

/// Bytes that the noise of one signal takes, at most.
const STREAM: usize = 512;

/// Refuses what would not fit into the memory that the study may take.
fn room(study: &Study, rig: &Rig, runs: usize, quantities: usize) -> Result<(), Error> {
    let run = &rig.simulation;
    let observer = run.observer.as_ref().map_or(0, |o| o.states().len());
    let values = run.plant.states().len() + observer + run.plant.outputs().len();
    let streams = run.noise.levels.len() + run.noise.process.len();
    // states before and after a step; starts, figures and screens; a row of what is followed; readings
    // at an end
    let screen = size_of::<Screen>() / size_of::<f64>();
    let numbers = 3 * values + (6 + screen) * quantities + run.noise.limits.len() + 16;
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
