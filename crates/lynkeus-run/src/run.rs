//! A plant and its observer, simulated together.

use std::ops::ControlFlow;

use crate::closed_loop::Loop;
use crate::divergence::Bound;
use crate::grid::Grid;
use crate::{
    Error, Events, Integrator, Interrupted, Manifold, Result, Role, Simulation, System, Trajectory,
    process_draws,
};

impl Simulation {
    /// Runs to the end.
    ///
    /// The columns are the plant's states, its inputs, its outputs if recorded
    /// ([`Role::Output`], [`Role::Measured`], and, where readings of inputs have errors, [`Role::Read`]), and what the observer reports
    /// ([`System::estimates`](crate::System::estimates)), each in the order of its system.
    ///
    /// [`Role::Output`]: crate::Role::Output
    /// [`Role::Measured`]: crate::Role::Measured
    /// [`Role::Read`]: crate::Role::Read
    ///
    /// # Errors
    /// With the rows made before: any of [`Error`]'s settings, integration and
    /// divergence errors.
    pub fn run(&self) -> Result<Trajectory, Box<Interrupted>> {
        self.run_watched(&mut |_| ControlFlow::Continue(()))
    }

    /// As [`Simulation::run`]; `watch` is told the fraction done after every row
    /// and may stop the run.
    ///
    /// # Errors
    /// As [`Simulation::run`], and [`Error::Cancelled`].
    pub fn run_watched(
        &self,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Trajectory, Box<Interrupted>> {
        let mut partial = self.table();
        match self.run_into(&mut |time, row| partial.push(time, row), watch) {
            Ok(()) => Ok(partial),
            Err(error) => Err(Box::new(Interrupted { error, partial })),
        }
    }

    /// As [`Simulation::run_watched`], but every row, its time and its values, is handed on as
    /// soon as it is made: nothing is kept, however many there are.
    ///
    /// # Errors
    /// As [`Simulation::run_watched`].
    pub fn run_into(
        &self,
        take: &mut dyn FnMut(f64, &[f64]),
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<()> {
        Run::new(self)?.rows(take, watch)
    }

    /// The table of a run before its first row.
    pub fn table(&self) -> Trajectory {
        let Self { plant, .. } = self;
        let mut table = Trajectory::default()
            .with(Role::State, plant.states())
            .with(Role::Input, plant.signals());
        if self.record_outputs {
            table = table
                .with(Role::Output, plant.outputs())
                .with(Role::Measured, plant.outputs());
            if !self.noise.inputs.is_empty() {
                table = table.with(Role::Read, plant.signals());
            }
        }
        let observer = self.observer.as_ref();
        table.with(Role::Estimate, observer.map_or(&[], System::estimates))
    }
}

/// A simulation under way.
struct Run {
    itinerary: Itinerary,
    integrator: Integrator,
    system: Loop,
    x: Vec<f64>,
    row: Vec<f64>,
    bound: Bound,
    manifold: Manifold,
}

impl Run {
    fn new(simulation: &Simulation) -> Result<Self> {
        let itinerary = Itinerary::new(simulation)?;
        let system = Loop::new(simulation, itinerary.hold())?;
        let x = system.joined.system().start().to_vec();
        Ok(Self {
            itinerary: itinerary.exact(system.is_exact()),
            integrator: Integrator::new(simulation.method, x.len())?,
            row: vec![],
            bound: Bound::new(&x),
            manifold: simulation.manifold.clone(),
            system,
            x,
        })
    }

    fn rows(
        &mut self,
        take: &mut dyn FnMut(f64, &[f64]),
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<()> {
        let all = self.itinerary.intervals() as f64;
        let mut made = 0_usize;
        while let Some(stop) = self.itinerary.next() {
            match stop {
                Stop::Draw { is_sample } => self.system.draw(is_sample),
                Stop::Advance { from, to } => {
                    let (system, x) = (&mut self.system, &mut self.x);
                    let done = self.integrator.advance(system, from, to, x);
                    let scale = self.bound.scale;
                    done.map_err(|error| self.system.explained(error, &self.x, scale))?;
                    self.manifold.normalise(&mut self.x);
                }
                Stop::Row(time) => {
                    take(time, self.record(time)?);
                    if made > 0 && watch(made as f64 / all).is_break() {
                        return Err(Error::Cancelled { time });
                    }
                    made += 1;
                }
            }
        }
        Ok(())
    }

    fn record(&mut self, t: f64) -> Result<&[f64]> {
        self.row.clear();
        self.system.joined.enter(t);
        self.system.row(t, &self.x, &mut self.row)?;
        let (names, estimate) = self.system.estimate(&self.x);
        self.bound.see(&self.row[..self.system.known_columns()]);
        let (bound, hint) = (self.bound, || self.integrator.hint());
        let inside = bound.check(t, names, estimate, hint);
        let scale = bound.scale;
        inside.map_err(|error| self.system.explained(error, &self.x, scale))?;
        Ok(&self.row)
    }
}

/// Most cells of a trajectory (8 bytes each).
const MOST_CELLS: f64 = 4e8;

/// What a simulation does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    /// what moves the states is drawn anew, and at a sample all noise
    Draw { is_sample: bool },
    /// time goes on
    Advance { from: f64, to: f64 },
    /// a row is recorded
    Row(f64),
}

/// The rows and samples of a simulation, in order.
#[derive(Clone, Debug)]
pub(crate) struct Itinerary {
    grid: Grid,
    start: f64,
    until: f64,
    intervals: usize,
    sample_step: f64,
    /// draws of process noise from one sample to the next
    draws: usize,
    is_exact: bool,
    /// draws so far, those of samples and those in between
    drawn: usize,
    /// the next row
    row: usize,
    /// the time of the last stop
    reached: f64,
    /// what comes at that time
    planned: Option<Stop>,
}

impl Itinerary {
    /// Of a simulation; without noise nothing but the first sample is drawn.
    ///
    /// # Errors
    /// [`Error::Setting`] for times and steps that cannot be.
    pub fn new(simulation: &Simulation) -> Result<Self> {
        let intervals = intervals(simulation)?;
        let sample_step = sample_step(simulation)?;
        Ok(Self {
            grid: Grid::new(simulation.start, simulation.output_step),
            start: simulation.start,
            until: simulation.until,
            intervals,
            sample_step,
            draws: draws(simulation)?,
            is_exact: false,
            drawn: 0,
            row: 0,
            reached: simulation.start,
            planned: None,
        })
    }

    /// Without samples between the rows.
    pub fn exact(mut self, is_exact: bool) -> Self {
        self.is_exact = is_exact;
        self
    }

    /// The time for which process noise is held.
    pub fn hold(&self) -> f64 {
        self.sample_step / self.draws as f64
    }

    /// Number of intervals between rows.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Time of row k.
    pub fn time(&self, k: usize) -> f64 {
        match k == self.intervals {
            true => self.until,
            false => self.grid.time(k),
        }
    }

    /// How long after the start the next draw is.
    fn due(&self) -> f64 {
        let (samples, rest) = (self.drawn / self.draws, self.drawn % self.draws);
        (samples as f64 + rest as f64 / self.draws as f64) * self.sample_step
    }

    fn draw(&mut self) -> Stop {
        let is_sample = self.drawn.is_multiple_of(self.draws);
        self.drawn += 1;
        Stop::Draw { is_sample }
    }

    fn arrive(&mut self, t: f64) -> Stop {
        self.row += 1;
        Stop::Row(t)
    }
}

impl Iterator for Itinerary {
    type Item = Stop;

    /// A draw that is due at a row is made there.
    fn next(&mut self) -> Option<Stop> {
        if self.planned.is_some() || self.row > self.intervals {
            return self.planned.take();
        }
        let Some(before) = self.row.checked_sub(1) else {
            return Some(match self.drawn {
                0 => self.draw(),
                _ => self.arrive(self.start),
            });
        };
        let (from, to) = (self.time(before), self.time(self.row));
        // a draw and a row at the same time may differ by rounding
        let same = 1e-9 * (to - from).min(self.hold());
        let due = self.start + self.due();
        let (at, stop) = match self.is_exact || due > to + same {
            true => (to, self.arrive(to)),
            false => (if due > to - same { to } else { due }, self.draw()),
        };
        if at <= self.reached {
            return Some(stop);
        }
        self.planned = Some(stop);
        let from = std::mem::replace(&mut self.reached, at);
        Some(Stop::Advance { from, to: at })
    }
}

/// Number of intervals between rows.
fn intervals(simulation: &Simulation) -> Result<usize> {
    let (start, until) = (simulation.start, simulation.until);
    if !start.is_finite() {
        return Err(Error::setting("start", "a finite time", start));
    }
    if !(until.is_finite() && until > start) {
        let expected = format!("a finite time after the start {start}");
        return Err(Error::setting("until", expected, until));
    }
    let output_step = checked_step("output_step", simulation.output_step)?;
    let intervals = (until - start) / output_step * (1.0 - 1e-12);
    let intervals = intervals.ceil().max(1.0);
    let cells = intervals * (1 + simulation.plant.states().len()) as f64;
    if cells > MOST_CELLS {
        let expected = format!("a step that makes fewer than {MOST_CELLS:e} values");
        let found = format!("{output_step}, which makes {cells:e}");
        return Err(Error::setting("output_step", expected, found));
    }
    Ok(intervals as usize)
}

fn checked_step(name: &str, step: f64) -> Result<f64> {
    match step > 0.0 && step.is_finite() {
        true => Ok(step),
        false => Err(Error::setting(name, "a finite time above 0", step)),
    }
}

/// Draws of process noise from one sample to the next.
fn draws(simulation: &Simulation) -> Result<usize> {
    match simulation.noise.process_draws {
        Some(0) => Err(Error::setting("process_draws", "at least 1 per sample", 0)),
        Some(draws) => Ok(draws),
        None => Ok(process_draws(simulation).per_sample),
    }
}

fn sample_step(simulation: &Simulation) -> Result<f64> {
    let given = simulation.noise.sample_step;
    let sample_step = checked_step("sample_step", given.unwrap_or(simulation.output_step))?;
    let samples = (simulation.until - simulation.start) / sample_step;
    if samples > MOST_CELLS {
        let expected = format!("a step that makes fewer than {MOST_CELLS:e} samples");
        return Err(Error::setting("sample_step", expected, sample_step));
    }
    Ok(sample_step)
}
