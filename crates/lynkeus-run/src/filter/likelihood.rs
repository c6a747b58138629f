//! How likely a log is, and how that changes with what is not known: parameters of the plant, noises, starts.
//!
//! Along an extended filter every reading has an innovation ν = y − ŷ with a variance σ², and
//! −log L = ½ Σ (ν²/σ² + log 2πσ²) (F. C. Schweppe, *IEEE Transactions on Information Theory* 11 (1965) 61–70).
//! A sample is straight-line code over expressions ([`super::expressions`]), so that its derivatives are
//! expressions, too: ∂x̂/∂θ and ∂S/∂θ are carried beside x̂ and S, one parameter in each lane. The same tangents
//! give Fisher's information, Σ (∂ν ∂νᵀ/σ² + ½ ∂σ² ∂σ²ᵀ/σ⁴), with which a search takes its steps and whose
//! inverse is the covariance of what it finds (K. J. Åström, *Automatica* 16 (1980) 551–574).

use std::collections::BTreeSet;

use lynkeus_expr::{Expr, Graph, Node, Tape, jacobian};
use lynkeus_native::Function;

use super::expressions::{Corrected, Flow, corrected};
use crate::classical::Term;
use crate::integrator::{fixed_steps, instant};
use crate::lanes::Engine;
use crate::{Error, Result};

/// Parameters whose tangents are found together.
const LANES: usize = 4;

type Lane = [f64; LANES];

/// Groups of lanes of so many parameters; one also of none, for the values.
fn groups(parameters: usize) -> usize {
    parameters.div_ceil(LANES).max(1)
}

/// A plant with its sensors and noises as functions of parameters θ.
///
/// Everything is an expression of one graph: f and h of time, states, inputs and θ; noises and starts of θ alone.
#[derive(Clone, Debug)]
pub struct ParametricPlant<'g> {
    /// the graph of all expressions
    pub graph: &'g Graph,
    /// the symbol of time
    pub time: Node,
    /// symbols of the states
    pub states: Vec<Node>,
    /// f, one per state
    pub derivatives: Vec<Node>,
    /// symbols of the known inputs, held from one row to the next
    pub inputs: Vec<Node>,
    /// h(t, x, u) and the variance of its noise, one pair per sensor
    pub sensors: Vec<(Node, Node)>,
    /// spectral density of the white noise on each derivative
    pub process_noise: Vec<Node>,
    /// the first estimate of each state, and its standard deviation
    pub start: Vec<(Node, Node)>,
    /// symbols of θ
    pub parameters: Vec<Node>,
}

/// A row of a log.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// its time
    pub t: f64,
    /// one per sensor; not a number where it did not report
    pub readings: &'a [f64],
    /// one per known input
    pub inputs: &'a [f64],
}

/// −log L of a log at θ, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// −log L; infinite or no number where the plant has no value on the way
    pub value: f64,
    /// its derivative by each parameter
    pub gradient: Vec<f64>,
    /// Fisher's information, row by row
    pub information: Vec<f64>,
    /// how many readings there were
    pub readings: usize,
}

/// [`Score`]s of one plant: compiled once, for any log and any θ.
///
/// ```
/// use lynkeus_expr::Graph;
/// use lynkeus_run::filter::{Likelihood, ParametricPlant, Row};
///
/// // a level that nobody moves: its value is the mean of the readings
/// let g = Graph::new();
/// let [time, x, level] = ["time", "x", "level"].map(|name| g.symbol(name));
/// let number = |value: f64| g.constant(value).node();
/// let mut likelihood = Likelihood::new(&ParametricPlant {
///     graph: &g,
///     time: time.node(),
///     states: vec![x.node()],
///     derivatives: vec![number(0.0)],
///     inputs: vec![],
///     sensors: vec![(x.node(), number(1.0))],
///     process_noise: vec![number(0.0)],
///     start: vec![(level.node(), number(0.0))],
///     parameters: vec![level.node()],
/// })?;
/// let rows = [1.0, 2.0, 6.0].map(|y| [y]);
/// let log = |k: usize| Row { t: k as f64, readings: &rows[k], inputs: &[] };
/// let score = likelihood.score(&[3.0], (0..3).map(log), 1.0)?;
/// assert!(score.gradient[0].abs() < 1e-12);
/// assert!((score.information[0] - 3.0).abs() < 1e-12);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Likelihood {
    parameters: usize,
    /// of θ: x̂ and S at the start
    begin: Code,
    /// of t, h, x̂, S, u and θ: x̂ and S a step later
    predict: Code,
    /// of t, x̂ at the row, x̂, S, u, θ and a reading: x̂ and S after it, ν and σ²
    correct: Vec<Code>,
    /// how many numbers x̂ and S have
    states: usize,
    entries: usize,
    inputs: usize,
}

/// # Errors
/// [`Error::Setting`] for another number of something.
fn check(what: &str, expected: usize, found: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::setting(what, expected.to_string(), found)),
    }
}

impl Likelihood {
    /// Compiles a plant.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol, [`Error::Setting`] for wrong numbers of
    /// expressions.
    pub fn new(plant: &ParametricPlant<'_>) -> Result<Self> {
        let sample = Sample::new(plant)?;
        let n = plant.states.len();
        Ok(Self {
            parameters: plant.parameters.len(),
            begin: sample.begin()?,
            predict: sample.predict()?,
            correct: (0..plant.sensors.len())
                .map(|sensor| sample.correct(sensor))
                .collect::<Result<_>>()?,
            states: n,
            entries: sample.pattern.len(),
            inputs: plant.inputs.len(),
        })
    }

    /// −log L of a log at θ, its gradient and Fisher's information; from row to row by steps of Runge and Kutta of at
    /// most this length.
    ///
    /// # Errors
    /// [`Error::Setting`] for another number of parameters, readings or inputs, a step that is no length or too
    /// many of them; [`Error::NoNumber`] for a time that is none, [`Error::TimeBefore`] for rows that run back.
    pub fn score<'a>(
        &mut self,
        parameters: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        longest_step: f64,
    ) -> Result<Score> {
        let count = self.parameters;
        check("number of parameters", count, parameters.len())?;
        if longest_step.is_nan() || longest_step <= 0.0 {
            return Err(Error::setting(
                "longest step",
                "a number above 0",
                longest_step,
            ));
        }
        let mut score = Score {
            value: 0.0,
            gradient: vec![0.0; count],
            information: vec![0.0; count * count],
            readings: 0,
        };
        let mut belief = Bundle::new(self.states + self.entries, count);
        self.begin.run(&[], &[], parameters, &mut belief);
        let mut before: Option<f64> = None;
        let mut inputs: Vec<f64> = vec![];
        for row in rows {
            check("number of readings", self.correct.len(), row.readings.len())?;
            check("number of inputs", self.inputs, row.inputs.len())?;
            if !row.t.is_finite() {
                let (signal, value) = ("t".to_owned(), row.t);
                return Err(Error::NoNumber { signal, value });
            }
            if let Some(from) = before.filter(|from| *from != row.t) {
                if row.t < from {
                    return Err(Error::TimeBefore {
                        reached: from,
                        time: row.t,
                    });
                }
                let steps = fixed_steps(from, row.t, longest_step.min(row.t - from))?;
                for i in 0..steps {
                    let [t, next] = [i, i + 1].map(|i| instant(from, row.t, steps, i));
                    let known = [&[t, next - t][..], &inputs].concat();
                    let held = belief.clone();
                    self.predict.run(&known, &[&held], parameters, &mut belief);
                }
            }
            before = Some(row.t);
            inputs.clear();
            inputs.extend_from_slice(row.inputs);
            self.take(&row, parameters, &mut belief, &mut score);
        }
        Ok(score)
    }

    /// The readings of a row, one after the other; h and its slopes are those at the estimate before them.
    fn take(&mut self, row: &Row<'_>, parameters: &[f64], belief: &mut Bundle, score: &mut Score) {
        let at = belief.first(self.states);
        for (code, &reading) in self.correct.iter_mut().zip(row.readings) {
            if !reading.is_finite() {
                continue;
            }
            let known = [&[row.t, reading][..], row.inputs].concat();
            let mut found = Bundle::new(self.states + self.entries + 2, self.parameters);
            code.run(&known, &[&at, belief], parameters, &mut found);
            let [ν, variance] = [0, 1].map(|k| self.states + self.entries + k);
            score.count(&found, ν, variance);
            *belief = found.first(self.states + self.entries);
        }
    }
}

impl Score {
    fn count(&mut self, found: &Bundle, ν: usize, variance: usize) {
        let count = self.gradient.len();
        let (innovation, σ2) = (found.values[ν], found.values[variance]);
        let share = innovation / σ2;
        self.value += 0.5 * (innovation * share + (std::f64::consts::TAU * σ2).ln());
        self.readings += 1;
        for p in 0..count {
            let [dν, dσ2] = [ν, variance].map(|at| found.tangent(at, p));
            self.gradient[p] += dν * share + 0.5 * dσ2 * (1.0 / σ2 - share * share);
            for q in 0..count {
                let [other_ν, other_σ2] = [ν, variance].map(|at| found.tangent(at, q));
                self.information[p * count + q] +=
                    dν * other_ν / σ2 + 0.5 * dσ2 * other_σ2 / (σ2 * σ2);
            }
        }
    }
}

/// Numbers with their derivatives by each parameter.
#[derive(Clone, Debug)]
struct Bundle {
    values: Vec<f64>,
    /// one list for each group of lanes
    tangents: Vec<Vec<Lane>>,
}

impl Bundle {
    fn new(numbers: usize, parameters: usize) -> Self {
        Self {
            values: vec![0.0; numbers],
            tangents: vec![vec![[0.0; LANES]; numbers]; groups(parameters)],
        }
    }

    /// So many of the numbers.
    fn first(&self, numbers: usize) -> Self {
        let tangents = self.tangents.iter();
        Self {
            values: self.values[..numbers].to_vec(),
            tangents: tangents.map(|all| all[..numbers].to_vec()).collect(),
        }
    }

    fn tangent(&self, at: usize, parameter: usize) -> f64 {
        self.tangents[parameter / LANES][at][parameter % LANES]
    }
}

/// Expressions with their derivatives along one direction of what they read, in lanes.
#[derive(Clone, Debug)]
struct Code {
    engine: Engine<LANES>,
    inputs: Vec<Lane>,
    outputs: Vec<Lane>,
}

impl Code {
    /// Of what is `known`, which has no tangent, then what `moves`, which has one.
    fn new(graph: &Graph, known: &[Node], moves: &[Node], outputs: &[Node]) -> Result<Self> {
        let directions = moves.iter().map(|_| graph.fresh("d").node());
        let directions: Vec<Node> = directions.collect();
        let tangents = jacobian::along(graph, outputs, moves, &directions);
        let inputs = [known, moves, &directions].concat();
        let all = [outputs, &tangents].concat();
        let tape = Tape::new(graph, &inputs, &all)?;
        Ok(Self {
            engine: Engine::new(&tape, Function::compile),
            inputs: vec![[0.0; LANES]; inputs.len()],
            outputs: vec![[0.0; LANES]; all.len()],
        })
    }

    /// Writes values and tangents, from known numbers, bundles and θ.
    fn run(&mut self, known: &[f64], bundles: &[&Bundle], parameters: &[f64], to: &mut Bundle) {
        let values = bundles.iter().flat_map(|bundle| &bundle.values);
        let primal = known.iter().chain(values).chain(parameters);
        for (place, value) in self.inputs.iter_mut().zip(primal) {
            *place = [*value; LANES];
        }
        let numbers: usize = bundles.iter().map(|bundle| bundle.values.len()).sum();
        let first = known.len() + numbers + parameters.len();
        let count = to.values.len();
        for group in 0..groups(parameters.len()) {
            let own = bundles.iter().flat_map(|bundle| &bundle.tangents[group]);
            let seeds = (0..parameters.len()).map(|p| {
                std::array::from_fn(|lane| f64::from(u8::from(group * LANES + lane == p)))
            });
            let tangents = own.copied().chain(seeds);
            for (place, tangent) in self.inputs[first..].iter_mut().zip(tangents) {
                *place = tangent;
            }
            self.engine.eval(&self.inputs, &mut self.outputs);
            let values = to.values.iter_mut().zip(&self.outputs);
            values.for_each(|(to, value)| *to = value[0]);
            to.tangents[group].copy_from_slice(&self.outputs[count..]);
        }
    }
}

/// The expressions of a sample.
struct Sample<'p, 'g> {
    plant: &'p ParametricPlant<'g>,
    /// F and C: row, column and entry
    slopes: Vec<(usize, usize, Node)>,
    views: Vec<(usize, usize, Node)>,
    h: Expr<'g>,
    reading: Expr<'g>,
    /// symbols of the estimate at a row before its readings count
    at: Vec<Node>,
    /// entries of S that are not 0 whatever happens, and their symbols
    pattern: Vec<(usize, usize)>,
    root: Vec<Node>,
}

impl<'p, 'g> Sample<'p, 'g> {
    fn new(plant: &'p ParametricPlant<'g>) -> Result<Self> {
        let (g, n) = (plant.graph, plant.states.len());
        let counts = [
            plant.derivatives.len(),
            plant.process_noise.len(),
            plant.start.len(),
        ];
        if n == 0 || counts.iter().any(|count| *count != n) {
            let expected =
                "one derivative, density and start for each state, of which there are some";
            return Err(Error::setting("states", expected, n));
        }
        let outputs: Vec<Node> = plant.sensors.iter().map(|sensor| sensor.0).collect();
        let mut sample = Self {
            plant,
            slopes: jacobian::forward(g, &plant.derivatives, &plant.states).entries,
            views: jacobian::forward(g, &outputs, &plant.states).entries,
            h: g.fresh("h"),
            reading: g.fresh("y"),
            at: (0..n).map(|i| g.fresh(format!("x{i}")).node()).collect(),
            pattern: vec![],
            root: vec![],
        };
        sample.find_pattern();
        Ok(sample)
    }

    /// Every entry of S that a start, a step or a reading makes, or one of them after the others.
    fn find_pattern(&mut self) {
        let n = self.plant.states.len();
        let deviations = self.plant.start.iter().enumerate();
        let first = deviations.filter(|(_, start)| self.term(start.1).is_some());
        let mut pattern: BTreeSet<(usize, usize)> = first.map(|(i, _)| (i, i)).collect();
        loop {
            self.pattern = pattern.iter().copied().collect();
            let fresh = self
                .pattern
                .iter()
                .map(|_| self.plant.graph.fresh("S").node());
            self.root = fresh.collect();
            let (_, predicted) = self.predicted();
            let corrected = (0..self.plant.sensors.len()).map(|sensor| self.corrected(sensor).root);
            let roots: Vec<Vec<Term<'g>>> = corrected.chain([predicted]).collect();
            let places = (0..n * n).filter(|&at| roots.iter().any(|root| root[at].is_some()));
            let before = pattern.len();
            pattern.extend(places.map(|at| (at / n, at % n)));
            if pattern.len() == before {
                return;
            }
        }
    }

    fn term(&self, node: Node) -> Term<'g> {
        let is_nothing = self.plant.graph.constant_value(node) == Some(0.0);
        (!is_nothing).then(|| self.plant.graph.expr(node))
    }

    fn belief(&self) -> (Vec<Term<'g>>, Vec<Term<'g>>) {
        let (g, n) = (self.plant.graph, self.plant.states.len());
        let x = self.plant.states.iter().map(|&x| Some(g.expr(x))).collect();
        let mut root = vec![None; n * n];
        for (&(i, j), &entry) in self.pattern.iter().zip(&self.root) {
            root[i * n + j] = Some(g.expr(entry));
        }
        (x, root)
    }

    fn nodes(&self, (x, root): (&[Term<'g>], &[Term<'g>])) -> Vec<Node> {
        let n = self.plant.states.len();
        let entries = self.pattern.iter().map(|&(i, j)| root[i * n + j]);
        let all = x.iter().copied().chain(entries);
        let nothing = self.plant.graph.constant(0.0);
        all.map(|term| term.unwrap_or(nothing).node()).collect()
    }

    fn begin(&self) -> Result<Code> {
        let n = self.plant.states.len();
        let x = self.plant.start.iter().map(|start| self.term(start.0));
        let mut root = vec![None; n * n];
        for (i, start) in self.plant.start.iter().enumerate() {
            root[i * n + i] = self.term(start.1);
        }
        let outputs = self.nodes((&x.collect::<Vec<_>>(), &root));
        Code::new(self.plant.graph, &[], &self.plant.parameters, &outputs)
    }

    /// x̂ and S after a step.
    fn predicted(&self) -> (Vec<Term<'g>>, Vec<Term<'g>>) {
        let (plant, n) = (self.plant, self.plant.states.len());
        let rest = plant.inputs.iter().chain(&plant.parameters);
        let inputs = [plant.time].into_iter().chain(plant.states.iter().copied());
        let inputs: Vec<Node> = inputs.chain(rest.copied()).collect();
        let places: Vec<(usize, usize)> = self.slopes.iter().map(|s| (s.0, s.1)).collect();
        let slopes: Vec<Node> = self.slopes.iter().map(|s| s.2).collect();
        let flow = Flow {
            graph: plant.graph,
            inputs: &inputs,
            derivatives: &plant.derivatives,
            slopes: &slopes,
            places: &places,
            noise: plant.process_noise.iter().map(|&q| self.term(q)).collect(),
        };
        let next = flow.step(self.h, &flow.start());
        let mut root = flow.carried(&next, plant.graph.constant(1.0), &self.belief().1);
        root.truncate(n * n);
        (next[..n].to_vec(), root)
    }

    fn predict(&self) -> Result<Code> {
        let plant = self.plant;
        let (x, root) = self.predicted();
        let known = [&[plant.time, self.h.node()][..], &plant.inputs].concat();
        let moves = [&plant.states[..], &self.root, &plant.parameters].concat();
        Code::new(plant.graph, &known, &moves, &self.nodes((&x, &root)))
    }

    fn corrected(&self, sensor: usize) -> Corrected<'g> {
        let (g, n) = (self.plant.graph, self.plant.states.len());
        let (output, noise) = self.plant.sensors[sensor];
        let own = self.views.iter().filter(|view| view.0 == sensor);
        let views: Vec<(usize, Node)> = own.map(|view| (view.1, view.2)).collect();
        // as they are at the estimate before the row's readings
        let all: Vec<Node> = [output]
            .into_iter()
            .chain(views.iter().map(|v| v.1))
            .collect();
        let moved = self
            .plant
            .states
            .iter()
            .copied()
            .zip(self.at.iter().copied());
        let all = g.substitute(&all, &moved.collect());
        let mut slopes: Vec<Term<'g>> = vec![None; n];
        for ((column, _), &slope) in views.iter().zip(&all[1..]) {
            slopes[*column] = self.term(slope);
        }
        let (x, root) = self.belief();
        let off = slopes.iter().zip(&self.plant.states).zip(&self.at);
        let terms = off.filter_map(|((c, &x), &at)| c.map(|c| c * (g.expr(x) - g.expr(at))));
        let predicted = terms.fold(g.expr(all[0]), |sum, term| sum + term);
        corrected(
            (&x, &root),
            &slopes,
            self.reading - predicted,
            g.expr(noise),
        )
    }

    fn correct(&self, sensor: usize) -> Result<Code> {
        let plant = self.plant;
        let found = self.corrected(sensor);
        let known = [&[plant.time, self.reading.node()][..], &plant.inputs].concat();
        let moves = [&self.at[..], &plant.states, &self.root, &plant.parameters].concat();
        let belief = self.nodes((&found.x, &found.root));
        let outputs = [
            &belief[..],
            &[found.innovation.node(), found.variance.node()],
        ]
        .concat();
        Code::new(plant.graph, &known, &moves, &outputs)
    }
}
