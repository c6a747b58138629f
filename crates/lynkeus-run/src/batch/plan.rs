//! What a batch does, worked out once for all trajectories.

use super::code::Code;
use super::split::Divided;
use crate::closed_loop::Loop;
use crate::integrator::{check_interval, fixed_steps, pieces};
use crate::itinerary::{Itinerary, Stop};
use crate::noise::Sensors;
use crate::routine::{LARGEST_STEP, classical_step};
use crate::{Column, Dynamics, Error, Events, Method, Simulation, Step};

/// What all trajectories do next.
#[derive(Debug)]
pub(crate) enum Event {
    /// each draws its next noise sample
    Draw,
    /// each draws what moves its states, between two samples
    Stir,
    /// equal steps in which nothing jumps with time
    Leg {
        from: f64,
        to: f64,
        steps: usize,
        /// the values of what jumps with time
        modes: Vec<f64>,
    },
    /// a row is recorded
    Row { time: f64, modes: Vec<f64> },
}

/// Most events that are worked out ahead.
const AHEAD: usize = 4096;

/// The events of a simulation in order.
pub(crate) struct Plan {
    step: Step,
    itinerary: Itinerary,
    /// knows when something jumps with time, the same for all
    clock: Loop,
    instants: Vec<f64>,
}

/// The code that every trajectory of a batch runs.
#[derive(Debug)]
pub(crate) struct Program {
    pub step: Code,
    pub row: Code,
    pub states: usize,
    /// what disturbs sensors and states
    pub disturbances: usize,
    /// values of a row
    pub columns: usize,
    /// those of them that are no estimates
    pub known: usize,
    /// the states that belong to the plant
    pub plant_states: usize,
    pub names: Vec<String>,
    pub observer_names: Vec<String>,
}

impl Plan {
    /// The plan and the code of a simulation; none where its steps depend on the state, or it
    /// is too large for a step to be one function.
    ///
    /// # Errors
    /// A simulation that cannot be run.
    pub fn new(simulation: &Simulation) -> Result<Option<(Self, Program)>, Error> {
        simulation.method.check()?;
        let Method::Rk4(step @ (Step::AtMost(_) | Step::Substeps(_))) = simulation.method else {
            return Ok(None);
        };
        let itinerary = Itinerary::new(simulation)?;
        let clock = Loop::new(simulation, sensors(simulation, itinerary.hold(), 0)?)?;
        let Some(program) = program(&clock)? else {
            return Ok(None);
        };
        let plan = Self {
            step,
            itinerary: itinerary.exact(clock.is_exact()),
            clock,
            instants: vec![],
        };
        Ok(Some((plan, program)))
    }

    /// The sensors of the run of a seed.
    pub fn sensors(&self, simulation: &Simulation, seed: u64) -> Result<Sensors, Error> {
        sensors(simulation, self.itinerary.hold(), seed)
    }

    /// The place of a column among the values of a row.
    pub fn place(&self, column: Column) -> Option<usize> {
        self.clock.table().place(column)
    }

    /// Number of rows in all.
    pub fn rows(&self) -> usize {
        self.itinerary.intervals() + 1
    }

    /// The next events, with at most so many rows; none at the end.
    ///
    /// # Errors
    /// [`Error::Setting`] for intervals that are too short or have too many steps, and those of
    /// [`Events::instants`].
    pub fn next(&mut self, rows: usize) -> Result<Vec<Event>, Error> {
        let (mut events, mut recorded) = (vec![], 0);
        while recorded < rows && events.len() < AHEAD {
            match self.itinerary.next() {
                None => break,
                Some(Stop::Draw) => events.push(Event::Draw),
                Some(Stop::Stir) => events.push(Event::Stir),
                Some(Stop::Advance { from, to }) => self.legs(from, to, &mut events)?,
                Some(Stop::Row(time)) => {
                    self.clock.enter(time);
                    let modes = self.clock.modes().to_vec();
                    events.push(Event::Row { time, modes });
                    recorded += 1;
                }
            }
        }
        Ok(events)
    }

    fn legs(&mut self, from: f64, to: f64, events: &mut Vec<Event>) -> Result<(), Error> {
        check_interval(from, to)?;
        self.instants.clear();
        self.clock.instants(from, to, &mut self.instants)?;
        let length = self.step.length(to - from).unwrap_or(to - from);
        for (start, end) in pieces(from, to, &mut self.instants) {
            self.clock.enter(start + 0.5 * (end - start));
            events.push(Event::Leg {
                from: start,
                to: end,
                steps: fixed_steps(start, end, length)?,
                modes: self.clock.modes().to_vec(),
            });
        }
        Ok(())
    }
}

fn sensors(simulation: &Simulation, hold: f64, seed: u64) -> Result<Sensors, Error> {
    let plant = &simulation.plant;
    let noise = crate::Noise {
        seed,
        ..simulation.noise.clone()
    };
    Sensors::new(&noise, plant.outputs(), plant.states(), hold)
}

/// The tapes of a step and of a row, divided into what all trajectories share (time, the step,
/// what jumps with time) and what is their own.
fn program(clock: &Loop) -> Result<Option<Program>, Error> {
    let states = clock.dimension();
    let disturbances = clock.disturbances();
    if clock.tape().len() > LARGEST_STEP {
        return Ok(None);
    }
    let Some(step) = classical_step(clock.tape()) else {
        return Ok(None);
    };
    let own = 1..1 + states + disturbances;
    let row = clock.row_tape()?;
    let columns = row.outputs();
    let [step, row] = [&step, &row].map(|tape| Divided::new(tape, |input| !own.contains(&input)));
    let start = vec![0.0; states];
    let (observer_names, estimates) = clock.estimate(&start);
    Ok(Some(Program {
        step: Code::new(step?, states + disturbances),
        row: Code::new(row?, columns),
        states,
        disturbances,
        columns,
        known: clock.known_columns(),
        plant_states: states - estimates.len(),
        observer_names: observer_names.to_vec(),
        names: clock.names(),
    }))
}
