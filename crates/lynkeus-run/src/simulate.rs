//! A plant and its observer, simulated together.

use std::ops::ControlFlow;

use crate::closed_loop::{Loop, table};
use crate::divergence::Bound;
use crate::itinerary::{Itinerary, Stop};
use crate::noise::Sensors;
use crate::{Error, Events, Integrator, Interrupted, Method, Noise, System, Trajectory};

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
    ) -> Result<(), Error> {
        Run::new(self)?.rows(take, watch)
    }

    /// The table of a run before its first row.
    pub fn table(&self) -> Trajectory {
        table(&self.plant, self.observer.as_ref(), self.record_outputs)
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
}

impl Run {
    fn new(simulation: &Simulation) -> Result<Self, Error> {
        let itinerary = Itinerary::new(simulation)?;
        let plant = &simulation.plant;
        let sensors = Sensors::new(
            &simulation.noise,
            plant.outputs(),
            plant.states(),
            itinerary.hold(),
        )?;
        let system = Loop::new(simulation, sensors)?;
        let x = system.start();
        Ok(Self {
            itinerary: itinerary.exact(system.is_exact()),
            integrator: Integrator::new(simulation.method, x.len())?,
            row: vec![],
            bound: Bound::new(&x),
            system,
            x,
        })
    }

    fn rows(
        &mut self,
        take: &mut dyn FnMut(f64, &[f64]),
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let all = self.itinerary.intervals() as f64;
        let mut made = 0_usize;
        while let Some(stop) = self.itinerary.next() {
            match stop {
                Stop::Draw => self.system.draw(),
                Stop::Stir => self.system.stir(),
                Stop::Advance { from, to } => {
                    let done = self
                        .integrator
                        .advance(&mut self.system, from, to, &mut self.x);
                    let scale = self.bound.scale();
                    done.map_err(|error| self.system.explained(error, &self.x, scale))?;
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

    fn record(&mut self, t: f64) -> Result<&[f64], Error> {
        self.row.clear();
        self.system.enter(t);
        self.system.row(t, &self.x, &mut self.row)?;
        let (names, estimate) = self.system.estimate(&self.x);
        self.bound.see(&self.row[..self.system.known_columns()]);
        let inside = self
            .bound
            .check(t, names, estimate, || self.integrator.hint());
        let scale = self.bound.scale();
        inside.map_err(|error| self.system.explained(error, &self.x, scale))?;
        Ok(&self.row)
    }
}
