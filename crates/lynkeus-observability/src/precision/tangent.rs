//! The plant with its sensitivities, integrated once for all sensors.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use lynkeus_expr::{Budget, Node, jacobian};
use lynkeus_model::Whens;
use lynkeus_run::{
    Cause, Clauses, Dynamics, Error, Evaluation, Events, Integrator, Jacobians, JumpSlopes,
    Linearised, Memory, Method, Parts, Seen,
};
use nalgebra::DMatrix;

use super::deviations::Information;
use super::forward::{Forward, WIDE};
use super::{Checkpoint, Experiment, Precision, Quantity, share, side_by_side};

/// Samples gathered before they are worked into the information.
const CHUNK: usize = 256;

/// States and sensitivities of one batch: implicit steps cost the cube of this.
const BATCH: usize = 64;

/// Sensitivities are trusted to this multiple of the integrator's tolerance.
const TRUST: f64 = 30.0;

/// The compiled plant: x' with ∂f/∂z, and the sensors with ∂h/∂z.
#[derive(Debug)]
struct Tangent {
    /// number of states
    states: usize,
    /// x' = f with ∂f/∂z
    flow: Linearised,
    /// the sensors with ∂h/∂z
    sight: Linearised,
    /// of states and unknown inputs
    scales: Vec<f64>,
    /// of the states: what they are integrated in, so that the absolute tolerance is small beside small ones
    units: Vec<f64>,
    /// sensitivities below this many units are rounding
    floor: f64,
    /// of the integration; the rest of the time is for what follows from it
    budget: Budget,
}

/// What is known at the start has an error of one range over this.
const CERTAIN: f64 = 1e9;

/// The share of the time for the integration.
const INTEGRATION: f64 = 0.7;

impl Tangent {
    fn new(experiment: &Experiment<'_>) -> Result<Self, Error> {
        let symbols: Vec<Node> = experiment.quantities().map(|q| q.node).collect();
        let seen: Vec<Node> = experiment.sensors.iter().map(|s| s.node).collect();
        let graph = experiment.graph;
        let flow = Jacobians {
            state: jacobian::forward(graph, &experiment.derivatives, &symbols).entries,
            ..Jacobians::default()
        };
        let sight = Jacobians {
            output: jacobian::forward(graph, &seen, &symbols).entries,
            ..Jacobians::default()
        };
        let (relative, absolute) = tolerances(experiment.method);
        // surfaces are watched in the states' own units
        let unit = |quantity: &Quantity| match experiment.whens.is_empty() {
            true => quantity.scale.min(1.0),
            false => 1.0,
        };
        Ok(Self {
            states: experiment.states.len(),
            flow: linearised(experiment, &[], flow, &experiment.whens)?,
            sight: linearised(experiment, &seen, sight, &Whens::default())?,
            scales: experiment.quantities().map(|q| q.scale).collect(),
            units: experiment.states.iter().map(unit).collect(),
            floor: absolute / relative,
            budget: graph.budget().part(INTEGRATION),
        })
    }

    /// States that are given in units, as they are.
    fn in_own_units(&self, states: &[f64], own: &mut [f64]) {
        let pairs = states.iter().zip(&self.units);
        own.iter_mut()
            .zip(pairs)
            .for_each(|(own, (x, unit))| *own = x * unit);
    }

    /// Batches of sensitivities, by the quantities that they belong to.
    fn batches(&self, experiment: &Experiment<'_>) -> Result<Vec<Batch<'_>>, Error> {
        let wide = (BATCH / self.states.max(1)).saturating_sub(1).max(1);
        let all: Vec<usize> = (0..self.scales.len()).collect();
        all.chunks(wide)
            .map(|columns| Batch::new(self, columns.to_vec(), experiment))
            .collect()
    }
}

/// The plant under its inputs, with these outputs and Jacobians.
fn linearised(
    experiment: &Experiment<'_>,
    outputs: &[Node],
    mut jacobians: Jacobians<Vec<(usize, usize, Node)>>,
    whens: &Whens,
) -> Result<Linearised, Error> {
    let courses: HashMap<Node, Node> = experiment.inputs.iter().copied().collect();
    let graph = experiment.graph;
    for entries in [&mut jacobians.state, &mut jacobians.output] {
        let nodes: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
        let nodes = graph.substitute(&nodes, &courses);
        entries
            .iter_mut()
            .zip(nodes)
            .for_each(|(entry, node)| entry.2 = node);
    }
    let outputs = graph.substitute(outputs, &courses).into_iter();
    let outputs: Vec<(String, Node)> = outputs
        .enumerate()
        .map(|(i, node)| (format!("o{}", i + 1), node))
        .collect();
    let states: Vec<(String, Node, f64)> = experiment
        .states
        .iter()
        .map(|q| (q.name.clone(), q.node, q.start))
        .collect();
    let derivatives = graph.substitute(&experiment.derivatives, &courses);
    let whens = whens.substituted(graph, &courses);
    let parts = Parts {
        graph,
        time: experiment.time,
        states: &states,
        signals: &[],
        derivatives: &derivatives,
        outputs: &outputs,
        whens: Some(&whens),
    };
    Linearised::of(&parts, &jacobians)
}

/// (relative, absolute) errors per step. Fixed steps differentiate to the exact
/// sensitivities of the stepping rule, so only rounding counts.
fn tolerances(method: Method) -> (f64, f64) {
    match method {
        Method::Adaptive(t) | Method::Explicit(t) | Method::Stiff(t) => {
            (t.relative.max(1e-14), t.absolute)
        }
        Method::Rk4(_) => (1e-14, 0.0),
    }
}

impl Experiment<'_> {
    /// Integrates plant and sensitivities once, in parallel, and gathers what every sensor tells.
    ///
    /// # Errors
    /// [`Error::Setting`] for numbers that are impossible; whatever ends the integration. Where
    /// the graph's budget ends it, the horizons reached by then are the answer, and there is
    /// [`Error::Cancelled`] where none was.
    pub fn run(&self) -> Result<Precision, Error> {
        self.check()?;
        let tangent = Tangent::new(self)?;
        let mut batches = tangent.batches(self)?;
        let window = &self.window;
        let wide = tangent.scales.len();
        let mut known = Information::new(wide);
        for (place, _) in self.quantities().enumerate().filter(|(_, q)| q.is_known) {
            let row = (0..wide).map(|i| if i == place { CERTAIN } else { 0.0 });
            known.push(row.clone(), row);
        }
        let mut gathered = vec![known; self.sensors.len()];
        let mut checkpoints = vec![];
        let mut next = 0;
        for &horizon in &window.horizons {
            let reached = reach(self, &mut batches, &mut gathered, next..horizon + 1);
            match reached {
                // what is known by then is an answer
                Err(Error::Cancelled { .. }) if !checkpoints.is_empty() => break,
                reached => reached?,
            }
            next = horizon + 1;
            gathered.iter_mut().for_each(Information::settle);
            checkpoints.push(Checkpoint {
                transition: transition(&tangent, &batches),
                information: gathered.clone(),
                forward: None,
            });
        }
        let (relative, _) = tolerances(self.method);
        let length = |k: &usize| *k as f64 * window.step;
        let mut found = Precision {
            names: self.quantities().map(|q| q.name.clone()).collect(),
            scales: tangent.scales.clone(),
            known: self.quantities().map(|q| q.is_known).collect(),
            sensors: self.sensors.iter().map(|s| s.name.clone()).collect(),
            horizons: window
                .horizons
                .iter()
                .map(length)
                .take(checkpoints.len())
                .collect(),
            accuracy: TRUST * relative,
            budget: self.graph.budget(),
            checkpoints,
        };
        if wide <= WIDE && found.is_in_doubt() {
            forward(self, &tangent, &mut found)?;
        }
        Ok(found)
    }
}

/// Once more, with the information in the coordinates of the present.
fn forward(
    experiment: &Experiment<'_>,
    tangent: &Tangent,
    found: &mut Precision,
) -> Result<(), Error> {
    let mut batches = tangent.batches(experiment)?;
    let (window, sensors) = (&experiment.window, experiment.sensors.len());
    let wide = tangent.scales.len();
    let mut carried = Forward::new(sensors, wide, found.accuracy);
    let mut next = 0;
    for (checkpoint, &horizon) in found.checkpoints.iter_mut().zip(&window.horizons) {
        for k in next..horizon + 1 {
            let pieces = match advance(&mut batches, &[window.instant(k)]) {
                Err(Error::Cancelled { .. }) => return Ok(()),
                pieces => pieces?,
            };
            let rows: Vec<DMatrix<f64>> = (0..sensors)
                .map(|c| {
                    let value = pieces.first().map_or(0.0, |piece| piece.values[c]);
                    let weight = experiment.sensors[c].noise.at(value).recip();
                    let entries = pieces.iter().flat_map(|p| p.row(&p.slopes, c));
                    let entries: Vec<f64> = entries.map(|x| weight * x).collect();
                    DMatrix::from_row_slice(1, wide, &entries)
                })
                .collect();
            let mut transition = transition(tangent, &batches);
            for (i, scale) in tangent.scales.iter().enumerate() {
                transition.row_mut(i).unscale_mut(*scale);
            }
            if carried.advance(&rows, &transition).is_none() {
                return Ok(());
            }
            batches.iter_mut().for_each(Batch::restart);
        }
        next = horizon + 1;
        checkpoint.forward = Some(carried.clone());
    }
    Ok(())
}

/// Gathers what these samples tell.
fn reach(
    experiment: &Experiment<'_>,
    batches: &mut [Batch<'_>],
    gathered: &mut [Information],
    samples: Range<usize>,
) -> Result<(), Error> {
    let window = &experiment.window;
    let mut next = samples.start;
    while next < samples.end {
        let until = (next + CHUNK).min(samples.end);
        let instants: Vec<f64> = (next..until).map(|k| window.instant(k)).collect();
        let pieces = advance(batches, &instants)?;
        gather(experiment, &pieces, instants.len(), gathered);
        next = until;
    }
    Ok(())
}

/// Takes all batches over the instants, side by side.
fn advance(batches: &mut [Batch<'_>], instants: &[f64]) -> Result<Vec<Piece>, Error> {
    let work = |some: &mut [Batch<'_>]| -> Vec<Result<Piece, Error>> {
        some.iter_mut().map(|batch| batch.run(instants)).collect()
    };
    let share = share(batches.len());
    let pieces = side_by_side(batches.chunks_mut(share), work);
    pieces.into_iter().flatten().collect()
}

/// Puts the columns of the batches together, sample by sample and sensor by sensor.
fn gather(
    experiment: &Experiment<'_>,
    pieces: &[Piece],
    samples: usize,
    gathered: &mut [Information],
) {
    let sensors = experiment.sensors.len();
    for k in 0..samples {
        for (c, sensor) in experiment.sensors.iter().enumerate() {
            let row = k * sensors + c;
            let value = pieces.first().map_or(0.0, |piece| piece.values[row]);
            let weight = sensor.weight(value);
            let entries = pieces.iter().flat_map(|p| p.row(&p.slopes, row));
            let gross = pieces.iter().flat_map(|p| p.row(&p.gross, row));
            gathered[c].push(entries.map(|x| weight * x), gross.map(|x| weight * x));
        }
    }
}

/// ∂z/∂z(0)·diag(scales) where the batches stand; unknown inputs stay what they are.
fn transition(tangent: &Tangent, batches: &[Batch<'_>]) -> DMatrix<f64> {
    let wide = tangent.scales.len();
    let mut matrix = DMatrix::zeros(wide, wide);
    for batch in batches {
        for (place, &j) in batch.dynamics.columns.iter().enumerate() {
            for (i, value) in batch.column(place).enumerate() {
                matrix[(i, j)] = value;
            }
        }
    }
    for j in tangent.states..wide {
        matrix[(j, j)] = tangent.scales[j];
    }
    matrix
}

/// Some columns of S·diag(scales) on their way.
struct Batch<'t> {
    dynamics: Variation<'t>,
    sight: Evaluation,
    integrator: Integrator,
    /// states, then one column after the other, in units
    x: Vec<f64>,
    t: f64,
}

/// What a batch saw: per sample and sensor, the value, and ∂y/∂z(0)·diag(scales) for its columns.
struct Piece {
    pub values: Vec<f64>,
    pub slopes: Vec<f64>,
    /// slopes had none of their terms cancelled
    pub gross: Vec<f64>,
    width: usize,
}

impl Piece {
    /// Row of `slopes` or `gross`.
    pub fn row<'a>(&self, of: &'a [f64], row: usize) -> impl Iterator<Item = f64> + use<'a> {
        let from = row * self.width;
        of[from..from + self.width].iter().copied()
    }
}

impl<'t> Batch<'t> {
    pub fn new(
        tangent: &'t Tangent,
        columns: Vec<usize>,
        experiment: &Experiment<'_>,
    ) -> Result<Self, Error> {
        let n = tangent.states;
        let start = tangent.flow.system().start().iter().zip(&tangent.units);
        let mut x: Vec<f64> = start.map(|(start, unit)| start / unit).collect();
        x.resize(n * (1 + columns.len()), 0.0);
        let mut batch = Self {
            dynamics: Variation {
                tangent,
                columns,
                flow: tangent.flow.system().evaluation(),
                slopes: vec![0.0; tangent.flow.jacobians().state.places().len()],
                states: vec![0.0; n],
                jump: JumpSlopes::default(),
                budget: tangent.budget.clone(),
            },
            sight: tangent.sight.system().evaluation(),
            integrator: Integrator::new(experiment.method, x.len())?,
            x,
            t: experiment.window.start,
        };
        batch.restart();
        // no error of these begins
        let known: Vec<bool> = experiment.quantities().map(|q| q.is_known).collect();
        let own = batch.dynamics.columns.iter().enumerate();
        for (place, _) in own.filter(|(_, j)| known[**j]) {
            batch.x[n * (1 + place)..n * (2 + place)].fill(0.0);
        }
        Ok(batch)
    }

    /// Makes the present the start that sensitivities are about.
    pub fn restart(&mut self) {
        let tangent = self.dynamics.tangent;
        let n = tangent.states;
        self.x[n..].fill(0.0);
        for (place, &j) in self.dynamics.columns.iter().enumerate() {
            if j < n {
                self.x[n + place * n + j] = tangent.scales[j] / tangent.units[j];
            }
        }
    }

    /// A column of the sensitivity of the states.
    pub fn column(&self, place: usize) -> impl Iterator<Item = f64> + '_ {
        let tangent = self.dynamics.tangent;
        let n = tangent.states;
        let column = &self.x[n + place * n..n + (place + 1) * n];
        column.iter().zip(&tangent.units).map(|(x, unit)| x * unit)
    }

    /// Integrates from instant to instant and looks at each.
    pub fn run(&mut self, instants: &[f64]) -> Result<Piece, Error> {
        let mut piece = Piece {
            values: vec![],
            slopes: vec![],
            gross: vec![],
            width: self.dynamics.columns.len(),
        };
        for &to in instants {
            if to > self.t {
                self.integrator
                    .advance(&mut self.dynamics, self.t, to, &mut self.x)?;
                self.t = to;
            }
            self.look(&mut piece)?;
        }
        Ok(piece)
    }

    fn look(&mut self, piece: &mut Piece) -> Result<(), Error> {
        let (tangent, own) = (self.dynamics.tangent, &self.dynamics.columns);
        let (states, columns) = self.x.split_at(tangent.states);
        tangent.in_own_units(states, &mut self.dynamics.states);
        let states = &self.dynamics.states;
        let mut seen = vec![0.0; self.sight.system().outputs().len()];
        self.sight.enter(self.t);
        self.sight.outputs(self.t, states, &mut seen);
        if seen.iter().any(|v| !v.is_finite()) {
            return Err(self.sight.not_finite(self.t, states));
        }
        let jacobian = &tangent.sight.jacobians().output;
        let sensors = jacobian.outputs().start;
        let (values, views) = seen.split_at(sensors);
        let (first, width) = (piece.slopes.len(), own.len());
        piece.values.extend(values);
        for all in [&mut piece.slopes, &mut piece.gross] {
            all.resize(first + sensors * width, 0.0);
        }
        for (&(c, i), &slope) in jacobian.places().iter().zip(views) {
            for (place, &j) in own.iter().enumerate() {
                let (sensitivity, floor) = match i < tangent.states {
                    true => {
                        let unit = tangent.units[i];
                        (
                            columns[place * tangent.states + i] * unit,
                            tangent.floor * unit,
                        )
                    }
                    false if i == j => (tangent.scales[j], 0.0),
                    false => continue,
                };
                let at = first + c * width + place;
                piece.slopes[at] += slope * sensitivity;
                piece.gross[at] += slope.abs() * (sensitivity.abs() + floor);
            }
        }
        Ok(())
    }
}

/// States and sensitivities as one system.
struct Variation<'t> {
    tangent: &'t Tangent,
    /// the quantities whose columns these are
    columns: Vec<usize>,
    flow: Evaluation,
    /// entries of ∂f/∂z
    slopes: Vec<f64>,
    /// states as they are
    states: Vec<f64>,
    /// of the last event
    jump: JumpSlopes,
    budget: Budget,
}

impl Dynamics for Variation<'_> {
    fn dimension(&self) -> usize {
        self.tangent.states * (1 + self.columns.len())
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        let n = self.tangent.states;
        let (states, columns) = x.split_at(n);
        let (d_states, d_columns) = dx.split_at_mut(n);
        let tangent = self.tangent;
        tangent.in_own_units(states, &mut self.states);
        self.flow.derivatives(t, &self.states, d_states);
        self.flow.outputs(t, &self.states, &mut self.slopes);
        let units = d_states.iter_mut().zip(&tangent.units);
        units.for_each(|(x, unit)| *x /= unit);
        d_columns.fill(0.0);
        let places = tangent.flow.jacobians().state.places();
        for (&(i, j), &slope) in places.iter().zip(&self.slopes) {
            let unit = tangent.units[i];
            for (place, &own) in self.columns.iter().enumerate() {
                let sensitivity = match j < n {
                    true => columns[place * n + j] * (tangent.units[j] / unit),
                    false if j == own => tangent.scales[j] / unit,
                    false => continue,
                };
                d_columns[place * n + i] += slope * sensitivity;
            }
        }
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        match self.flow.clauses() {
            Some(_) => self.flow.events(),
            None => Some(self),
        }
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.flow.clauses()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        self.flow.watch(t, x, seen);
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        self.flow.rates(t, x, dx)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>, Error> {
        self.flow.truths(t, x)
    }

    fn happen(
        &mut self,
        t: f64,
        x: &mut [f64],
        memory: &mut Memory,
    ) -> Result<Option<usize>, Error> {
        self.flow.jump(t, x, memory, Some(&mut self.jump))
    }

    /// Each sensitivity is one of Ξ times what it was.
    fn settle(
        &mut self,
        (t, x): (f64, &[f64]),
        jumped: &mut [f64],
        [before, after]: [&[f64]; 2],
        cause: Option<Cause>,
        line: usize,
    ) -> Result<(), Error> {
        let n = self.tangent.states;
        let (jump, rates) = (&self.jump, [&before[..n], &after[..n]]);
        let (matrix, moved) = self.flow.saltation((t, x), jump, rates, cause, line)?;
        let (states, columns) = jumped.split_at_mut(n);
        for (x, moved) in states.iter_mut().zip(moved) {
            *x += moved;
        }
        for column in columns.chunks_exact_mut(n.max(1)) {
            let old = column.to_vec();
            for (into, row) in column.iter_mut().zip(matrix.chunks_exact(n.max(1))) {
                *into = row.iter().zip(&old).map(|(xi, s)| xi * s).sum();
            }
        }
        Ok(())
    }

    fn is_over(&mut self) -> bool {
        self.budget.spent().is_some()
    }

    fn names(&self) -> Vec<String> {
        let states = self.flow.names();
        let column = |j: &usize| {
            let with = |state: &String| format!("∂{state}/∂z[{}]", j + 1);
            states.iter().map(with).collect::<Vec<_>>()
        };
        let columns: Vec<String> = self.columns.iter().flat_map(column).collect();
        states.into_iter().chain(columns).collect()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        let tangent = self.tangent;
        tangent.in_own_units(&x[..tangent.states], &mut self.states);
        self.flow.not_finite(t, &self.states)
    }
}

/// Those of time: what jumps with the state is as the state says.
impl Events for Variation<'_> {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.flow.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.flow.enter(t);
    }
}
