//! Some trajectories that go side by side, few enough to stay in the cache.

use std::ops::ControlFlow;

use lynkeus_native::Buffer;

use super::plan::{Divided, Event, Leg, Program};
use crate::divergence::Bound;
use crate::error::state_text;
use crate::integrator::instant;
use crate::noise::Sensors;
use crate::{Error, Result};

/// Bytes that the states of a block may take, twice: they should stay in the first cache.
const CACHE: usize = 16 * 1024;

/// Most groups of lanes in a block.
const GROUPS: usize = 64;

/// Steps for which what is shared is computed ahead.
const AHEAD: usize = 16;

/// Steps of a group after which a thread asks whether it is to go on: some ten microseconds of a
/// small system, a tenth of a second of the largest.
const PATIENCE: usize = 1024;

/// Whether somebody wants the work to end.
pub(crate) type IsOver<'a> = dyn Fn() -> bool + Sync + 'a;

/// Least groups of lanes that are worth what a block computes for all of them, where there are so many.
const FEW: usize = 4;

/// Most groups of lanes in a block.
fn most_groups<const L: usize>(program: &Program<L>) -> usize {
    let group = (program.states + program.disturbances) * size_of::<[f64; L]>();
    (CACHE / (2 * group).max(1)).clamp(1, GROUPS)
}

/// Groups of lanes in each block of so many runs: few enough that every thread has a block.
pub(crate) fn groups<const L: usize>(program: &Program<L>, runs: usize, threads: usize) -> usize {
    let most = most_groups(program);
    let own = runs.div_ceil(L).div_ceil(threads.max(1));
    own.clamp(FEW.min(most), most)
}

/// A run that did not go on.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// its place among the members
    pub run: usize,
    /// why: at the row where it was seen
    pub error: Error,
}

/// The working memory of a thread.
pub(crate) struct Desk<'p, const L: usize> {
    program: &'p Program<L>,
    step: Divided<L>,
    row: Divided<L>,
    /// arguments of what is shared, at one instant a lane
    arguments: Vec<[f64; L]>,
    shared: Buffer<L>,
    shared_row: Buffer<L>,
    rows: Buffer<L>,
    is_over: &'p IsOver<'p>,
    /// steps of a group since it was asked
    since_asked: usize,
}

impl<'p, const L: usize> Desk<'p, L> {
    pub fn new(program: &'p Program<L>, is_over: &'p IsOver<'p>) -> Self {
        Self {
            step: program.step.clone(),
            row: program.row.clone(),
            arguments: vec![],
            shared: Buffer::new(AHEAD * program.step.shared),
            shared_row: Buffer::new(L * program.row.shared),
            rows: Buffer::new(most_groups(program) * program.columns),
            program,
            is_over,
            // what was ended between two portions does not begin the next
            since_asked: PATIENCE,
        }
    }

    /// Whether the work goes on with so many more steps of a group.
    fn goes_on(&mut self, steps: usize) -> ControlFlow<()> {
        self.since_asked += steps;
        if self.since_asked < PATIENCE {
            return ControlFlow::Continue(());
        }
        self.since_asked = 0;
        match (self.is_over)() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// What the steps from `first` on share; how many steps.
    fn share(&mut self, leg: &Leg, first: usize) -> usize {
        let count = AHEAD.min(leg.steps - first);
        let size = self.program.step.shared;
        let tables = self.shared.values_mut();
        let tables = tables.chunks_exact_mut(L * size.max(1));
        for (k, table) in (0..count).step_by(L).zip(tables) {
            let times: [[f64; 2]; L] = std::array::from_fn(|lane| {
                // lanes without a step of their own do the last one again
                let step = (first + k + lane).min(leg.steps - 1);
                [step, step + 1].map(|i| instant(leg.from, leg.to, leg.steps, i))
            });
            self.arguments.clear();
            self.arguments.push(times.map(|[t, _]| t));
            let modes = leg.modes.iter().map(|&mode| [mode; L]);
            self.arguments.extend(modes);
            self.arguments.push(times.map(|[t, next]| next - t));
            self.step.share(&self.arguments, table);
        }
        count
    }

    /// The values of a row of every group.
    fn read(&mut self, time: f64, modes: &[f64], groups: usize, x: &[[f64; L]]) -> &[[f64; L]] {
        let size = self.program.row.shared;
        self.arguments.clear();
        self.arguments.push([time; L]);
        self.arguments.extend(modes.iter().map(|&m| [m; L]));
        let table = self.shared_row.values_mut();
        self.row.share(&self.arguments, table);
        let rows = self.rows.values_mut();
        self.row.sweep(groups, &table[..size], x, rows);
        &rows[..groups * self.program.columns]
    }
}

/// One trajectory.
#[derive(Debug)]
struct Run {
    sensors: Sensors,
    bound: Bound,
    is_over: bool,
}

/// Trajectories side by side. The last group is filled up with copies.
#[derive(Debug)]
pub(crate) struct Block<const L: usize> {
    /// place of the first one among all
    first: usize,
    runs: Vec<Run>,
    groups: usize,
    /// states, then what disturbs them, of each group of lanes
    now: Buffer<L>,
    next: Buffer<L>,
    pub record: Record,
}

/// What a block leaves behind.
#[derive(Debug, Default)]
pub(crate) struct Record {
    pub runs: usize,
    /// rows of the portion at hand: row by row, column by column, run by run
    pub values: Vec<f64>,
    pub ended: Vec<Ended>,
}

impl<const L: usize> Block<L> {
    /// With the sensors and the start of each.
    pub fn new(program: &Program<L>, first: usize, members: Vec<(Sensors, Vec<f64>)>) -> Self {
        let groups = members.len().div_ceil(L);
        let own = program.states + program.disturbances;
        let mut now = Buffer::new(groups * own);
        for place in 0..groups * L {
            let (_, start) = &members[place.min(members.len() - 1)];
            let group = &mut now.values_mut()[place / L * own..][..own];
            for (x, start) in group.iter_mut().zip(start) {
                x[place % L] = *start;
            }
        }
        let run = |(sensors, start): (Sensors, Vec<f64>)| Run {
            sensors,
            bound: Bound::new(&start),
            is_over: false,
        };
        Self {
            first,
            record: Record {
                runs: members.len(),
                ..Record::default()
            },
            runs: members.into_iter().map(run).collect(),
            groups,
            next: now.clone(),
            now,
        }
    }

    /// Goes through a portion of the plan, and records these columns of its rows; breaks where the
    /// work is over before its end.
    pub fn run(
        &mut self,
        desk: &mut Desk<'_, L>,
        events: &[Event],
        columns: &[usize],
    ) -> ControlFlow<()> {
        self.record.values.clear();
        for event in events {
            match event {
                Event::Draw { is_sample } => self.draw(desk.program, *is_sample),
                Event::Leg(leg) => self.advance(desk, leg)?,
                Event::Row { time, modes } => self.record(desk, *time, modes, columns),
            }
        }
        ControlFlow::Continue(())
    }

    fn draw(&mut self, program: &Program<L>, is_sample: bool) {
        let own = program.states + program.disturbances;
        for run in &mut self.runs {
            run.sensors.draw(is_sample);
        }
        for place in 0..self.groups * L {
            let run = &self.runs[place.min(self.runs.len() - 1)];
            let first = place / L * own + program.states;
            for (k, value) in run.sensors.disturbances().enumerate() {
                for buffer in [&mut self.now, &mut self.next] {
                    buffer.values_mut()[first + k][place % L] = value;
                }
            }
        }
    }

    fn advance(&mut self, desk: &mut Desk<'_, L>, leg: &Leg) -> ControlFlow<()> {
        let size = desk.program.step.shared;
        let mut done = 0;
        while done < leg.steps {
            let count = desk.share(leg, done);
            desk.goes_on(count * self.groups)?;
            for k in 0..count {
                let shared = &desk.shared.values()[k * size..][..size];
                let to = self.next.values_mut();
                desk.step.sweep(self.groups, shared, self.now.values(), to);
                std::mem::swap(&mut self.now, &mut self.next);
            }
            done += count;
        }
        ControlFlow::Continue(())
    }

    fn record(&mut self, desk: &mut Desk<'_, L>, time: f64, modes: &[f64], columns: &[usize]) {
        let program = desk.program;
        let rows = desk.read(time, modes, self.groups, self.now.values());
        let own = program.states + program.disturbances;
        for (k, runs) in self.runs.chunks_mut(L).enumerate() {
            let row = &rows[k * program.columns..][..program.columns];
            let x = &self.now.values()[k * own..][..program.states];
            let extent = Extent::new(program, row, x);
            for (lane, run) in runs.iter_mut().enumerate().filter(|(_, run)| !run.is_over) {
                let Err(error) = run.judge(program, time, &extent, x, lane) else {
                    continue;
                };
                run.is_over = true;
                let run = self.first + k * L + lane;
                self.record.ended.push(Ended { run, error });
            }
        }
        for &column in columns {
            let lanes = rows.iter().skip(column).step_by(program.columns);
            let values = lanes.flatten().take(self.runs.len());
            self.record.values.extend(values);
        }
    }
}

/// How large the values of a group of runs are at a row.
struct Extent<const L: usize> {
    /// zero where all are finite
    oddity: [f64; L],
    /// of what is no estimate
    known: [f64; L],
    /// of the observer's states
    estimates: [f64; L],
}

impl<const L: usize> Extent<L> {
    fn new(program: &Program<L>, row: &[[f64; L]], x: &[[f64; L]]) -> Self {
        let mut oddity = [0.0; L];
        for value in row.iter().chain(x) {
            for (odd, v) in oddity.iter_mut().zip(value) {
                *odd += v * 0.0;
            }
        }
        let largest = |values: &[[f64; L]]| {
            values.iter().fold([0.0; L], |largest: [f64; L], value| {
                std::array::from_fn(|lane| largest[lane].max(value[lane].abs()))
            })
        };
        Self {
            oddity,
            known: largest(&row[..program.known]),
            estimates: largest(&x[program.plant_states..]),
        }
    }
}

impl Run {
    /// Whether the run goes on, which is at a lane of its group with states `x`.
    fn judge<const L: usize>(
        &mut self,
        program: &Program<L>,
        time: f64,
        extent: &Extent<L>,
        x: &[[f64; L]],
        lane: usize,
    ) -> Result<()> {
        let x = || x.iter().map(|x| x[lane]).collect::<Vec<f64>>();
        self.bound.see(&[extent.known[lane]]);
        if extent.oddity[lane] != 0.0 {
            return Err(Error::NotFinite {
                time,
                operation: "a value is not finite".to_owned(),
                state: state_text(&program.names, &x()),
            });
        }
        let (bound, names) = (self.bound, &program.observer_names);
        let largest = [extent.estimates[lane]];
        match bound.check(time, &[], &largest, String::new) {
            Ok(()) => Ok(()),
            Err(_) => bound.check(time, names, &x()[program.plant_states..], String::new),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Method, Simulation, Step, System};
    use lynkeus_expr::Graph;

    /// Two states: 64 groups of 64 bytes, twice, are 8 KiB.
    #[test]
    fn every_thread_has_a_block_where_there_are_enough_runs() {
        let g = Graph::new();
        let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
        let states = [("x", x, 1.0), ("v", v, 0.0)];
        let states = states.map(|(name, e, start)| (name.to_owned(), e.node(), start));
        let dx = [v.node(), (-x).node()];
        let plant = System::new(&g, time.node(), &states, &[], &dx, &[]).unwrap();
        let inputs = System::new(&g, time.node(), &[], &[], &[], &[]).unwrap();
        let mut simulation = Simulation::new(plant, inputs, 1.0, 0.5);
        simulation.method = Method::Rk4(Step::AtMost(0.1));
        let (_, program) = super::super::plan::Plan::new::<4>(&simulation)
            .unwrap()
            .unwrap();
        for (runs, threads, expected) in [
            (0, 1, 4),
            (1, 8, 4),
            (100, 1, 25),
            (100, 2, 13),
            (1_000, 8, 32),
            (100_000, 8, 64),
            (1_000, 0, 64),
        ] {
            assert_eq!(
                groups::<4>(&program, runs, threads),
                expected,
                "{runs} {threads}"
            );
        }
    }
}
