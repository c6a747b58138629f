//! A plant and its observer, simulated together.

use std::ops::ControlFlow;

use crate::closed_loop::Loop;
use crate::divergence::Bound;
use crate::grid::Grid;
use crate::noise::Sensors;
use crate::{Dynamics, Error, Integrator, Interrupted, Method, Noise, System, Trajectory};

/// Most cells of a trajectory (8 bytes each).
const MOST_CELLS: f64 = 4e8;

/// A plant under known inputs and, if wished, an observer of its measured
/// outputs.
///
/// The plant and the observer are integrated as one system. The observer's
/// signals are found by name among the outputs of the plant (as measured, noise
/// included) and the inputs. The integration stops at every output point, at every
/// noise sample, and at every instant where an expression of time jumps.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// what is simulated; its signals are inputs
    pub plant: System,
    /// the inputs: a system without states or signals whose outputs are functions
    /// of time, named as the plant's signals
    pub inputs: System,
    /// what estimates the plant's state, if anything does
    pub observer: Option<System>,
    /// first time
    pub start: f64,
    /// last time
    pub until: f64,
    /// time between two rows; the last row is at `until` in any case
    pub output_step: f64,
    /// how it is integrated
    pub method: Method,
    /// noise on the plant's outputs and states
    pub noise: Noise,
    /// also record the plant's outputs, exact and as measured
    pub record_outputs: bool,
}

impl Simulation {
    /// From t = 0 to `until`, exact measurements, default method, no observer.
    pub fn new(plant: System, inputs: System, until: f64, output_step: f64) -> Self {
        Self {
            plant,
            inputs,
            observer: None,
            start: 0.0,
            until,
            output_step,
            method: Method::default(),
            noise: Noise::default(),
            record_outputs: false,
        }
    }

    /// Runs to the end.
    ///
    /// The columns are the plant's states, its inputs, its outputs if recorded
    /// ([`Role::Output`], [`Role::Measured`]), and what the observer reports
    /// ([`System::estimates`]), each in the order of its system.
    ///
    /// [`Role::Output`]: crate::Role::Output
    /// [`Role::Measured`]: crate::Role::Measured
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
        let mut run = Run::new(self)?;
        match run.rows(watch) {
            Ok(()) => Ok(run.table),
            Err(error) => Err(Box::new(Interrupted {
                error,
                partial: run.table,
            })),
        }
    }

    /// Number of intervals between rows.
    fn intervals(&self) -> Result<usize, Error> {
        let Self {
            start,
            until,
            output_step,
            ..
        } = self;
        if !start.is_finite() {
            return Err(Error::setting("start", "a finite time", start));
        }
        if !(until.is_finite() && until > start) {
            let expected = format!("a finite time after the start {start}");
            return Err(Error::setting("until", expected, until));
        }
        if !(*output_step > 0.0 && output_step.is_finite()) {
            return Err(Error::setting(
                "output_step",
                "a finite time above 0",
                output_step,
            ));
        }
        let intervals = ((until - start) / output_step * (1.0 - 1e-12))
            .ceil()
            .max(1.0);
        let cells = intervals * (1 + self.plant.states().len()) as f64;
        if cells > MOST_CELLS {
            let expected = format!("a step that makes fewer than {MOST_CELLS:e} values");
            let found = format!("{output_step}, which makes {cells:e}");
            return Err(Error::setting("output_step", expected, found));
        }
        Ok(intervals as usize)
    }
}

/// A simulation under way.
struct Run<'a> {
    simulation: &'a Simulation,
    intervals: usize,
    grid: Grid,
    integrator: Integrator,
    system: Loop,
    x: Vec<f64>,
    table: Trajectory,
    row: Vec<f64>,
    bound: Bound,
    sample_step: f64,
    /// samples drawn so far
    samples: usize,
}

impl<'a> Run<'a> {
    fn new(simulation: &'a Simulation) -> Result<Self, Error> {
        let intervals = simulation.intervals()?;
        let sample_step = simulation
            .noise
            .sample_step
            .unwrap_or(simulation.output_step);
        if !(sample_step > 0.0 && sample_step.is_finite()) {
            let expected = "a finite time above 0";
            return Err(Error::setting("sample_step", expected, sample_step));
        }
        let samples = (simulation.until - simulation.start) / sample_step;
        if samples > MOST_CELLS {
            let expected = format!("a step that makes fewer than {MOST_CELLS:e} samples");
            return Err(Error::setting("sample_step", expected, sample_step));
        }
        let plant = &simulation.plant;
        let sensors = Sensors::new(
            &simulation.noise,
            plant.outputs(),
            plant.states(),
            sample_step,
        )?;
        let system = Loop::new(simulation, sensors)?;
        let x = system.start();
        Ok(Self {
            intervals,
            grid: Grid::new(simulation.start, simulation.output_step),
            integrator: Integrator::new(simulation.method, x.len())?,
            table: system.table(),
            row: vec![],
            bound: Bound::new(&x),
            sample_step,
            samples: 0,
            simulation,
            system,
            x,
        })
    }

    fn rows(&mut self, watch: &mut dyn FnMut(f64) -> ControlFlow<()>) -> Result<(), Error> {
        self.sample();
        self.record(self.simulation.start)?;
        for k in 1..=self.intervals {
            let (from, to) = (self.time(k - 1), self.time(k));
            self.advance(from, to)?;
            self.record(to)?;
            if watch(k as f64 / self.intervals as f64).is_break() {
                return Err(Error::Cancelled { time: to });
            }
        }
        Ok(())
    }

    /// Time of row k.
    fn time(&self, k: usize) -> f64 {
        if k == self.intervals {
            self.simulation.until
        } else {
            self.grid.time(k)
        }
    }

    /// From one row to the next, over the noise samples between; a sample due at
    /// the next row is drawn there.
    fn advance(&mut self, from: f64, to: f64) -> Result<(), Error> {
        // a sample and a row at the same time may differ by rounding
        let same = 1e-9 * (to - from).min(self.sample_step);
        let mut t = from;
        while !self.system.is_exact() {
            let due = self.simulation.start + self.samples as f64 * self.sample_step;
            if due > to + same {
                break;
            }
            let stop = if due > to - same { to } else { due };
            self.integrate(t, stop)?;
            t = stop;
            self.sample();
        }
        self.integrate(t, to)
    }

    fn integrate(&mut self, from: f64, to: f64) -> Result<(), Error> {
        if to <= from {
            return Ok(());
        }
        self.integrator
            .advance(&mut self.system, from, to, &mut self.x)
    }

    fn sample(&mut self) {
        self.system.draw();
        self.samples += 1;
    }

    fn record(&mut self, t: f64) -> Result<(), Error> {
        self.row.clear();
        self.system.enter(t);
        self.system.row(t, &self.x, &mut self.row)?;
        let (names, estimate) = self.system.estimate(&self.x);
        self.bound.see(&self.row[..self.system.known_columns()]);
        self.bound
            .check(t, names, estimate, || self.integrator.hint())?;
        self.table.push(t, &self.row);
        Ok(())
    }
}
