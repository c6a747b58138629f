//! What a batch does, worked out once for all trajectories, and the code that they share.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::lanes::{self, Lanes, Portable};
use lynkeus_expr::{Evaluator, Graph, MissingInput, Node, Op, Tape};
use lynkeus_native::Function;

use crate::closed_loop::Loop;
use crate::integrator::{check_interval, fixed_steps, pieces};
use crate::noise::Sensors;
use crate::routine::Backend;
use crate::run::{Itinerary, Stop};
use crate::{Column, Dynamics, Error, Events, Method, Simulation, Step};

/// What all trajectories do next.
#[derive(Debug)]
pub(crate) enum Event {
    /// each draws its next noise sample
    Draw,
    /// each draws what moves its states, between two samples
    Stir,
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
            events.push(Event::Leg(Leg {
                from: start,
                to: end,
                steps: fixed_steps(start, end, length)?,
                modes: self.clock.modes().to_vec(),
            }));
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
    let equations = clock.system().equations();
    let disturbances = equations.signals.len();
    let own = 1..1 + states + disturbances;
    let row = &equations.roots.outputs;
    let columns = row.len();
    let graph = equations.graph();
    let Some((inputs, next)) = clock.system().derivatives_at().step_in(&graph) else {
        return Ok(None);
    };
    let divided = |inputs: &[Node], outputs: &[Node]| {
        Divided::new(&graph, inputs, outputs, |input| !own.contains(&input))
    };
    let step = divided(&inputs, &next)?;
    let row = divided(&equations.inputs[..equations.smooth_inputs()], row)?;
    drop(graph);
    let start = vec![0.0; states];
    let (observer_names, estimates) = clock.estimate(&start);
    Ok(Some(Program {
        step: Code::new(step, states + disturbances),
        row: Code::new(row, columns),
        states,
        disturbances,
        columns,
        known: clock.known_columns(),
        plant_states: states - estimates.len(),
        observer_names: observer_names.to_vec(),
        names: clock.names(),
    }))
}

/// Trajectories in a register.
pub(crate) const LANES: usize = 4;

pub(crate) type Lane = [f64; LANES];

/// Largest tape that is compiled for a batch.
const LARGEST: usize = 200_000;

/// A divided tape with its machine code, shared by all threads. Interpreter and machine code give
/// the same values to the bit.
#[derive(Debug)]
pub(crate) struct Code {
    tapes: Divided,
    common: Option<Function<LANES>>,
    own: Option<Function<LANES>>,
    /// from the outputs of one group of lanes to those of the next
    spacing: usize,
}

impl Code {
    pub fn new(tapes: Divided, spacing: usize) -> Self {
        let is_wanted = |tape: &Tape| Backend::compiles_at_once() && tape.len() <= LARGEST;
        let compiled = is_wanted(&tapes.common).then(|| Function::compile(&tapes.common));
        let shared = tapes.common.outputs();
        let sweep = is_wanted(&tapes.own).then(|| Function::sweeping(&tapes.own, shared, spacing));
        Self {
            common: compiled.flatten(),
            own: sweep.flatten(),
            tapes,
            spacing,
        }
    }

    /// Number of values that all trajectories share.
    pub fn shared(&self) -> usize {
        self.tapes.common.outputs()
    }

    /// Whether there is a function that lanes round in their own way.
    pub fn has_functions(&self) -> bool {
        self.tapes.has_functions
    }

    pub fn runner(&self) -> Runner {
        let engine = |tape: &Tape, compiled: &Option<Function<LANES>>| match compiled {
            Some(function) => Engine::Native(function.clone()),
            None => Engine::Interpreted(Box::new(tape.evaluator_in(Lanes))),
        };
        Runner {
            spacing: self.spacing,
            own_inputs: self.tapes.own.inputs() - self.shared(),
            outputs: self.tapes.own.outputs(),
            scratch: vec![[0.0; LANES]; self.tapes.own.inputs()],
            common: engine(&self.tapes.common, &self.common),
            own: engine(&self.tapes.own, &self.own),
        }
    }
}

/// Runs one [`Code`] again and again, without allocating.
#[derive(Debug)]
pub(crate) struct Runner {
    common: Engine,
    own: Engine,
    spacing: usize,
    own_inputs: usize,
    outputs: usize,
    scratch: Vec<Lane>,
}

/// Machine code, or a tape.
#[derive(Debug)]
enum Engine {
    Native(Function<LANES>),
    Interpreted(Box<Evaluator<Lanes<LANES>>>),
}

impl Runner {
    /// What all trajectories share at four instants: the lanes of `inputs`. Each instant has its
    /// place in `table`, of [`Code::shared`] values that have one number in all lanes.
    pub fn share(&mut self, inputs: &[Lane], table: &mut [Lane]) {
        let count = table.len() / LANES;
        let values = &mut self.scratch[..count];
        match &mut self.common {
            Engine::Native(native) => native.eval(inputs, values),
            Engine::Interpreted(tape) => tape.eval(inputs, values),
        }
        for (instant, places) in table.chunks_exact_mut(count.max(1)).enumerate() {
            for (place, value) in places.iter_mut().zip(values.iter()) {
                *place = [value[instant]; LANES];
            }
        }
    }

    /// The outputs of every group of lanes, from what is shared and what is its own.
    pub fn sweep(&mut self, groups: usize, shared: &[Lane], inputs: &[Lane], outputs: &mut [Lane]) {
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

/// A tape in two: what follows from the shared inputs alone, and the rest.
#[derive(Debug)]
pub(crate) struct Divided {
    /// shared inputs → the values that the rest reads
    pub common: Tape,
    /// these values, then all other inputs → the outputs
    pub own: Tape,
    /// whether there is a function that lanes round in their own way
    pub has_functions: bool,
}

impl Divided {
    /// Divides `outputs`, functions of `inputs`; `is_shared` says of each input whether all
    /// trajectories have the same.
    ///
    /// # Errors
    /// None with outputs that read the inputs alone.
    pub fn new(
        g: &Graph,
        inputs: &[Node],
        outputs: &[Node],
        is_shared: impl Fn(usize) -> bool,
    ) -> Result<Self, MissingInput> {
        let (shared, own): (Vec<usize>, Vec<usize>) =
            (0..inputs.len()).partition(|&i| is_shared(i));
        let [shared, own] =
            [shared, own].map(|of| of.iter().map(|&i| inputs[i]).collect::<Vec<_>>());
        let values = frontier(g, &own, outputs);
        let symbols = values.iter().map(|_| g.fresh("shared").node());
        let symbols: Vec<Node> = symbols.collect();
        let read: HashMap<Node, Node> = (values.iter().copied())
            .zip(symbols.iter().copied())
            .collect();
        let rounds = |node: &Node| match g.op(*node) {
            Op::Unary(op, _) => lanes::unary::<Portable<1>>(op).is_some(),
            Op::Binary(op, ..) => lanes::binary::<Portable<1>>(op).is_some(),
            _ => false,
        };
        Ok(Self {
            common: Tape::new(g, &shared, &values)?,
            own: Tape::new(g, &[symbols, own].concat(), &g.substitute(outputs, &read))?,
            has_functions: g.reachable(outputs).iter().any(rounds),
        })
    }
}

/// The values that do not follow from `own`, the inputs in which trajectories differ, and are read
/// by what does.
fn frontier(g: &Graph, own: &[Node], outputs: &[Node]) -> Vec<Node> {
    let mut own: HashSet<Node> = own.iter().copied().collect();
    let mut read = vec![];
    for node in g.reachable(outputs) {
        let arguments = g.arguments(node);
        if arguments.iter().any(|argument| own.contains(argument)) {
            own.insert(node);
            read.extend(arguments);
        }
    }
    read.extend(outputs);
    let mut seen = HashSet::new();
    read.retain(|&value| {
        !own.contains(&value) && g.constant_value(value).is_none() && seen.insert(value)
    });
    read
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_depends_on_time_alone_is_computed_once() {
        let g = Graph::new();
        let [t, x, p] = ["t", "x", "p"].map(|name| g.symbol(name));
        let u = (t * 3.0).sin() * 2.0;
        let dx = x * u + u.exp() * p - x.sin();
        let (inputs, outputs) = ([t, x, p].map(|e| e.node()), [dx.node(), u.node()]);
        let tape = Tape::new(&g, &inputs, &outputs).unwrap();
        let divided = Divided::new(&g, &inputs, &outputs, |i| i == 0).unwrap();
        // u and eᵘ
        assert_eq!((divided.common.inputs(), divided.common.outputs()), (1, 2));
        assert_eq!((divided.own.inputs(), divided.own.len()), (4, 5));
        let common = divided.common.eval_in(&lynkeus_expr::Reals, &[0.7]);
        let inputs = [&common[..], &[0.3, -1.5]].concat();
        let mut expected = [0.0; 2];
        tape.evaluator().eval(&[0.7, 0.3, -1.5], &mut expected);
        assert_eq!(divided.own.eval_in(&lynkeus_expr::Reals, &inputs), expected);
    }
}
