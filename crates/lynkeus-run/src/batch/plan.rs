//! What a batch does, worked out once for all trajectories, and the code that they share.

use std::ops::Range;

use lynkeus_expr::{Graph, MissingInput, Node, Tape};
use lynkeus_native::Function;

use crate::closed_loop::Loop;
use crate::integrator::{APART, check_interval, fixed_steps, pieces};
use crate::lanes::{Engine, have_functions};
use crate::noise::Sensors;
use crate::run::{Itinerary, Stop};
use crate::steps::{is_fused, tape};
use crate::{Events, Method, Noise, Result, Simulation, Step};

/// What all trajectories do next.
#[derive(Debug)]
pub(crate) enum Event {
    /// each draws what moves its states, and at a sample all noise
    Draw { is_sample: bool },
    /// equal steps in which nothing jumps with time
    Leg(Leg),
    /// a row is recorded
    Row { time: f64, modes: Vec<f64> },
}

/// Equal steps.
#[derive(Debug)]
pub(crate) struct Leg {
    pub from: f64,
    pub to: f64,
    pub steps: usize,
    /// the values of what jumps with time
    pub modes: Vec<f64>,
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
pub(crate) struct Program<const L: usize> {
    pub step: Divided<L>,
    pub row: Divided<L>,
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
    pub fn new<const L: usize>(simulation: &Simulation) -> Result<Option<(Self, Program<L>)>> {
        simulation.method.check()?;
        let Method::Rk4(step @ (Step::AtMost(_) | Step::Substeps(_))) = simulation.method else {
            return Ok(None);
        };
        let itinerary = Itinerary::new(simulation)?;
        let mut clock = Loop::new(simulation, itinerary.hold())?;
        let Some(program) = program(&mut clock)? else {
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
    pub fn sensors(&self, simulation: &Simulation, seed: u64) -> Result<Sensors> {
        let noise = Noise {
            seed,
            ..simulation.noise.clone()
        };
        let (plant, inputs) = (&simulation.plant, simulation.inputs.outputs());
        let hold = self.itinerary.hold();
        Sensors::new(&noise, [plant.outputs(), plant.states(), inputs], hold)
    }

    /// Number of rows in all.
    pub fn rows(&self) -> usize {
        self.itinerary.intervals() + 1
    }

    /// The next events, with at most so many rows; none at the end.
    ///
    /// # Errors
    /// [`crate::Error::Setting`] for intervals that are too short or have too many steps, and those of
    /// [`Events::instants`].
    pub fn next(&mut self, rows: usize) -> Result<Vec<Event>> {
        let (mut events, mut recorded) = (vec![], 0);
        while recorded < rows && events.len() < AHEAD {
            match self.itinerary.next() {
                None => break,
                Some(Stop::Draw { is_sample }) => events.push(Event::Draw { is_sample }),
                Some(Stop::Advance { from, to }) => self.legs(from, to, &mut events)?,
                Some(Stop::Row(time)) => {
                    let modes = self.modes(time);
                    events.push(Event::Row { time, modes });
                    recorded += 1;
                }
            }
        }
        Ok(events)
    }

    fn legs(&mut self, from: f64, to: f64, events: &mut Vec<Event>) -> Result<()> {
        check_interval(from, to)?;
        self.instants.clear();
        let clock = &mut self.clock.joined;
        clock.instants(from, to, &mut self.instants)?;
        let length = self.step.length(to - from).unwrap_or(to - from);
        for (start, end) in pieces(from, to, &mut self.instants, APART) {
            clock.enter(start + 0.5 * (end - start));
            events.push(Event::Leg(Leg {
                from: start,
                to: end,
                steps: fixed_steps(start, end, length)?,
                modes: clock.modes().to_vec(),
            }));
        }
        Ok(())
    }

    /// The values of what jumps with time.
    fn modes(&mut self, t: f64) -> Vec<f64> {
        let clock = &mut self.clock.joined;
        clock.enter(t);
        clock.modes().to_vec()
    }
}

/// The code of a step and of a row.
fn program<const L: usize>(clock: &mut Loop) -> Result<Option<Program<L>>> {
    let system = clock.joined.system().clone();
    let equations = system.equations();
    let (states, disturbances) = (equations.states.len(), equations.signals.len());
    let own = 1..1 + states + disturbances;
    let inputs = &equations.inputs[..equations.smooth_inputs()];
    let row = &equations.roots.free.outputs;
    let columns = row.len();
    let graph = equations.graph();
    let Some((of_step, next)) = system.derivatives_at().step_in(&graph) else {
        return Ok(None);
    };
    let (observer_names, estimates) = clock.estimate(system.start());
    Ok(Some(Program {
        step: Divided::of_step(&graph, &of_step, &next, own.clone(), states + disturbances)?,
        row: Divided::new(&graph, inputs, row, own, columns)?,
        states,
        disturbances,
        columns,
        known: clock.known_columns(),
        plant_states: states - estimates.len(),
        observer_names: observer_names.to_vec(),
        names: equations.states.clone(),
    }))
}

/// Functions in two parts, what all trajectories share (time, the step, what jumps with time) and what
/// is their own; each thread has a copy. Interpreter and machine code give the same values to the bit.
#[derive(Clone, Debug)]
pub(crate) struct Divided<const L: usize> {
    /// shared inputs → the values that the rest reads
    common: Engine<L>,
    /// these values, then all other inputs → the outputs
    own: Engine<L>,
    /// number of values that all trajectories share
    pub shared: usize,
    /// whether a run alone has the same bits: nothing is fused with what all share, there is no function that lanes
    /// round in their own way
    pub is_rounded_alike: bool,
    own_inputs: usize,
    outputs: usize,
    /// from the outputs of one group of lanes to those of the next
    spacing: usize,
    scratch: Vec<[f64; L]>,
}

impl<const L: usize> Divided<L> {
    /// Of `outputs`, functions of `inputs`, of which some are a trajectory's own.
    ///
    /// # Errors
    /// None with outputs that read the inputs alone.
    pub fn new(
        g: &Graph,
        inputs: &[Node],
        outputs: &[Node],
        own: Range<usize>,
        spacing: usize,
    ) -> Result<Self, MissingInput> {
        Self::made(g, (inputs, outputs), own, spacing, false)
    }

    /// As [`Divided::new`], of a step that rounds a product and a sum once where [steps](crate::fuse_steps) do.
    ///
    /// # Errors
    /// As there.
    pub fn of_step(
        g: &Graph,
        inputs: &[Node],
        outputs: &[Node],
        own: Range<usize>,
        spacing: usize,
    ) -> Result<Self, MissingInput> {
        Self::made(g, (inputs, outputs), own, spacing, is_fused())
    }

    fn made(
        g: &Graph,
        (inputs, outputs): (&[Node], &[Node]),
        own: Range<usize>,
        spacing: usize,
        is_fused: bool,
    ) -> Result<Self, MissingInput> {
        let common = [&inputs[..own.start], &inputs[own.end..]].concat();
        let divided = g.hoisted(outputs, &common);
        let shared = divided.values.len();
        let common = tape(g, &common, &divided.values, is_fused)?;
        let own_inputs = own.len();
        let own = [&divided.symbols, &inputs[own]].concat();
        let own = tape(g, &own, &divided.roots, is_fused)?;
        let sweeping = |own: &Tape| Function::sweeping(own, shared, spacing);
        Ok(Self {
            common: Engine::new(&common, Function::compile),
            own: Engine::new(&own, sweeping),
            shared,
            is_rounded_alike: !is_fused && !have_functions(g, outputs),
            own_inputs,
            outputs: outputs.len(),
            spacing,
            scratch: vec![[0.0; L]; own.inputs()],
        })
    }

    /// What all trajectories share at so many instants: the lanes of `inputs`. Each instant has its
    /// place in `table`, of [`Divided::shared`] values that have one number in all lanes.
    pub fn share(&mut self, inputs: &[[f64; L]], table: &mut [[f64; L]]) {
        let count = table.len() / L;
        let values = &mut self.scratch[..count];
        self.common.eval(inputs, values);
        for (instant, places) in table.chunks_exact_mut(count.max(1)).enumerate() {
            for (place, value) in places.iter_mut().zip(values.iter()) {
                *place = [value[instant]; L];
            }
        }
    }

    /// The outputs of every group of lanes, from what is shared and what is its own.
    pub fn sweep(
        &mut self,
        groups: usize,
        shared: &[[f64; L]],
        inputs: &[[f64; L]],
        outputs: &mut [[f64; L]],
    ) {
        match &mut self.own {
            Engine::Native(native) => native.sweep(groups, shared, inputs, outputs),
            Engine::Interpreted(tape) => {
                let arguments = &mut self.scratch[..shared.len() + self.own_inputs];
                arguments[..shared.len()].copy_from_slice(shared);
                for group in 0..groups {
                    let own = &inputs[group * self.own_inputs..][..self.own_inputs];
                    arguments[shared.len()..].copy_from_slice(own);
                    let to = &mut outputs[group * self.spacing..][..self.outputs];
                    tape.eval(arguments, to);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_depends_on_time_alone_is_computed_once() {
        const LANES: usize = 4;
        let g = Graph::new();
        let [t, x, p] = ["t", "x", "p"].map(|name| g.symbol(name));
        let u = (t * 3.0).sin() * 2.0;
        let dx = x * u + u.exp() * p - x.sin();
        let (inputs, outputs) = ([t, x, p].map(|e| e.node()), [dx.node(), u.node()]);
        let tape = Tape::new(&g, &inputs, &outputs).unwrap();
        let mut code = Divided::<LANES>::new(&g, &inputs, &outputs, 1..3, 2).unwrap();
        // u and eᵘ
        assert!(code.shared == 2 && !code.is_rounded_alike);
        let mut table = [[0.0; LANES]; 2 * LANES];
        code.share(&[[0.7, 0.8, 0.9, 1.0]], &mut table);
        let own = [[0.3, 0.4, 0.5, 0.6], [-1.5; LANES]];
        let mut found = [[0.0; LANES]; 2];
        // of the second instant
        code.sweep(1, &table[2..4], &own, &mut found);
        for (lane, &x) in own[0].iter().enumerate() {
            let mut expected = [0.0; 2];
            tape.evaluator().eval(&[0.8, x, -1.5], &mut expected);
            for (found, expected) in found.iter().zip(expected) {
                assert!((found[lane] - expected).abs() < 1e-14);
            }
        }
    }
}
