//! Many runs of one simulation at once.
//!
//! Four or eight trajectories, as the processor has it, stand side by side in vector registers, some such
//! groups in a block that stays in the cache, and threads take blocks. What all of them have in common, time and what
//! follows from it, is computed once for a block. Elementary functions are those of
//! [`lynkeus_expr::lanes`], in every trajectory, so that what a run gives depends on neither its
//! neighbours nor the number of threads; where none is used a run in a batch is that of
//! [`Simulation::run`] to the bit ([`Batch::is_exact`]).

mod block;
mod plan;

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, available_parallelism};

use crate::{Column, Error, Result, Simulation};
pub use block::Ended;
pub(crate) use plan::Divided;

use block::{Block, Desk, IsOver, Record, groups};
use plan::{Event, Plan, Program};

/// What one run of a batch has of its own.
#[derive(Clone, Debug)]
pub struct Member {
    /// seed of its noise
    pub seed: u64,
    /// start values of the plant's states
    pub start: Vec<f64>,
}

/// Many runs of one [`Simulation`] with [`Method::Rk4`](crate::Method::Rk4) and steps that do not
/// depend on the state. They go on together, some rows at a time.
pub struct Batch {
    plan: Plan,
    work: Box<dyn Work>,
    /// places of the recorded columns in a row
    columns: Vec<usize>,
    times: Vec<f64>,
    runs: usize,
    /// the time that all runs have reached
    reached: f64,
    is_cancelled: bool,
}

impl Batch {
    /// The runs of these members, of which `columns` are recorded; none where the steps of the
    /// simulation depend on the state, or it is too large. Its own seed and start do not count.
    ///
    /// # Errors
    /// A simulation that cannot be run, a start of the wrong size, a column that a run has not.
    pub fn new(
        simulation: &Simulation,
        members: &[Member],
        columns: &[Column],
    ) -> Result<Option<Self>> {
        // each run has its own events, and steps that end there
        if simulation.plant.has_clauses() {
            return Ok(None);
        }
        let made = match lynkeus_native::widest() {
            8 if members.len() > 4 => Blocks::<8>::work(simulation, members)?,
            _ => Blocks::<4>::work(simulation, members)?,
        };
        let Some((plan, work)) = made else {
            return Ok(None);
        };
        let table = simulation.table();
        let place = |column: &Column| {
            table.place(*column).ok_or_else(|| {
                let found = format!("{:?} {}", column.role, column.index);
                Error::setting("recorded column", "one of the run", found)
            })
        };
        let columns = columns.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        Ok(Some(Self {
            runs: members.len(),
            plan,
            work,
            columns,
            times: vec![],
            reached: simulation.start,
            is_cancelled: false,
        }))
    }

    /// Whether each run is that of [`Simulation::run`] to the bit: no function is used that lanes round
    /// in their own way, and no product and sum are fused, which a run alone does beyond what all runs share.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.work.is_exact()
    }

    /// Number of rows of every run.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.plan.rows()
    }

    /// Takes all runs through the next rows, at most so many, on so many threads. The rows before
    /// are forgotten. False where there are no more. Every thread asks now and then, also between two
    /// rows, whether the work is over.
    ///
    /// # Errors
    /// Times at which something jumps that cannot be found, or too many steps; [`Error::Cancelled`]
    /// where the work is over: such a batch does not go on.
    pub fn advance(
        &mut self,
        rows: usize,
        threads: usize,
        is_over: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool> {
        self.times.clear();
        while !self.is_cancelled {
            let events = self.plan.next(rows.max(1))?;
            let times = events.iter().filter_map(|event| match event {
                Event::Row { time, .. } => Some(*time),
                _ => None,
            });
            self.times.extend(times);
            if !self.work.run(&events, &self.columns, threads, is_over) {
                self.times.clear();
                self.is_cancelled = true;
            } else if let Some(time) = self.times.last() {
                self.reached = *time;
                return Ok(true);
            } else if events.is_empty() {
                return Ok(false);
            }
        }
        let time = self.reached;
        Err(Error::Cancelled { time })
    }

    /// Times of the rows at hand.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The values of a row at hand in all runs, in the order of the members, for a column by its
    /// place among those that are recorded. Those of runs that ended mean nothing.
    pub fn values(&self, row: usize, column: usize) -> impl Iterator<Item = f64> + '_ {
        let place = row * self.columns.len() + column;
        self.records().flat_map(move |record| {
            let runs = record.runs;
            record.values[place * runs..][..runs].iter().copied()
        })
    }

    /// The runs that did not go on, so far.
    pub fn ended(&self) -> impl Iterator<Item = &Ended> {
        self.records().flat_map(|record| &record.ended)
    }

    fn records(&self) -> impl Iterator<Item = &Record> {
        (0..).map_while(|block| self.work.record(block))
    }

    /// Number of runs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.runs
    }

    /// True of no runs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.runs == 0
    }
}

/// The blocks of a batch, of whatever number of lanes.
trait Work: Send + Sync {
    /// Whether no function is used that lanes round in their own way.
    fn is_exact(&self) -> bool;

    /// Takes all blocks through these events, of whose rows they record `columns`. False where the work was over
    /// before the last one.
    fn run(
        &mut self,
        events: &[Event],
        columns: &[usize],
        threads: usize,
        is_over: &IsOver<'_>,
    ) -> bool;

    /// What a block leaves behind; none after the last one.
    fn record(&self, block: usize) -> Option<&Record>;
}

/// With so many trajectories in a register.
struct Blocks<const L: usize> {
    program: Program<L>,
    blocks: Vec<Block<L>>,
}

impl<const L: usize> Blocks<L> {
    /// The plan of a simulation and the blocks of its runs.
    fn work(simulation: &Simulation, members: &[Member]) -> Result<Option<(Plan, Box<dyn Work>)>> {
        let Some((plan, program)) = Plan::new::<L>(simulation)? else {
            return Ok(None);
        };
        // what a run gives does not depend on the block that it is in
        let threads = available_parallelism().map_or(1, NonZero::get);
        let size = groups(&program, members.len(), threads) * L;
        let mut blocks = vec![];
        for (k, members) in members.chunks(size).enumerate() {
            let member = |m: &Member| {
                let plant = simulation.plant.clone().with_start(m.start.clone())?;
                let observer = simulation.observer.iter().flat_map(|o| o.start());
                let start = plant.start().iter().chain(observer).copied().collect();
                Ok((plan.sensors(simulation, m.seed)?, start))
            };
            let members = members.iter().map(member);
            let members = members.collect::<Result<Vec<_>>>()?;
            blocks.push(Block::new(&program, k * size, members));
        }
        Ok(Some((plan, Box::new(Self { program, blocks }))))
    }
}

impl<const L: usize> Work for Blocks<L> {
    fn is_exact(&self) -> bool {
        self.program.step.is_rounded_alike && self.program.row.is_rounded_alike
    }

    fn run(
        &mut self,
        events: &[Event],
        columns: &[usize],
        threads: usize,
        is_over: &IsOver<'_>,
    ) -> bool {
        let program = &self.program;
        let threads = threads.min(self.blocks.len());
        let is_cut = AtomicBool::new(false);
        let queue = Mutex::new(self.blocks.iter_mut());
        let next = || queue.lock().unwrap_or_else(|e| e.into_inner()).next();
        let work = || {
            let mut desk = Desk::new(program, is_over);
            while let Some(block) = next() {
                if block.run(&mut desk, events, columns).is_break() {
                    is_cut.store(true, Ordering::Relaxed);
                    return;
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                // where no thread can be had, the others do its work
                let _ = Builder::new().spawn_scoped(scope, work);
            }
            work();
        });
        !is_cut.into_inner()
    }

    fn record(&self, block: usize) -> Option<&Record> {
        self.blocks.get(block).map(|block| &block.record)
    }
}
