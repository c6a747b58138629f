//! A plant beside its extended Kalman filter, as what flows and jumps.
//!
//! z = (x, e, P, ū): the plant with its unknown inputs, e = x̂ − x, the lower triangle of the covariance, and the known inputs
//! that vary, as the filter holds them. Between samples
//!
//! x' = f(x, u), e' = f(x + e, ū) − f(x, u), P' = F P + P Fᵀ + Q with F = ∂f/∂x at x + e and ū,
//!
//! and a sample takes the readings h(x) + ν one after the other,
//! K = P cᵀ/(c P cᵀ + R), e⁺ = e + K (h(x) + ν − h(x̂⁻) − c (e − e⁻)), P⁺ = P − K c P,
//! with the slopes c of h at x̂⁻, as the filter of `lynkeus-run` would in exact arithmetic.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Interval, Node, Tape, jacobian};
use lynkeus_model::{Home, Variable};
use lynkeus_observers::Observer;
use lynkeus_proof::tube::{Problem, Sampled};
use lynkeus_run::Level;
use lynkeus_run::filter::FilterKind;
use lynkeus_structure::AugmentedPlant;
use lynkeus_study::{BetweenSamples, Name, Noise};

use super::super::assumptions;
use super::super::tube::{bounded, first_of, refuse_others, side};
use crate::Error;
use lynkeus_experiment::course::filter::noise;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::Declared;
use lynkeus_experiment::prepare::systems::{input_expression, sampled_every};
use lynkeus_experiment::words::explain;

/// States beyond which a covariance is too large for a tube.
const STATES: usize = 6;

/// Samples beyond which nothing is followed.
const SAMPLES: f64 = 100_000.0;

/// What is followed, and what its numbers stand for.
pub(super) struct System {
    /// plant states, then unknown inputs
    pub states: Vec<Variable>,
    /// where the estimate starts
    pub estimate: Vec<f64>,
    /// names of the measured outputs
    pub outputs: Vec<String>,
    /// disturbances, and rates of change of unknown inputs
    pub inputs: Vec<Variable>,
    pub every: f64,
    pub sampled: Sampled,
    pub notes: Vec<String>,
}

impl System {
    /// Places of the errors in z.
    pub fn errors(&self) -> impl Iterator<Item = usize> {
        let n = self.states.len();
        n..2 * n
    }

    /// Places of the variances in z.
    pub fn variances(&self) -> impl Iterator<Item = usize> {
        let n = self.states.len();
        (0..n).map(move |i| 2 * n + place(i, i))
    }

    /// Of a study, or why nothing can be said of its filter.
    ///
    /// # Errors
    /// Inputs without value; names that the plant does not have.
    pub fn of(
        prepared: &Prepared<'_>,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        start: &[(Name, f64, f64)],
        (from, until): (f64, f64),
    ) -> Result<Result<Self, String>, Error> {
        if let Some(obstacle) = excluded(prepared, augmented, observer) {
            return Ok(Err(obstacle));
        }
        let study = prepared.study();
        let run = study.simulate.as_ref();
        let every = run.and_then(|run| sampled_every(study, run));
        let (Some(run), Some(every)) = (run, every) else {
            return Ok(Err(
                "when the sensors report is not known: `sample_step` of [simulate] says it"
                    .to_owned(),
            ));
        };
        let count = ((until - from) / every).floor();
        if count > SAMPLES {
            return Ok(Err(format!(
                "{count} samples are too many to be followed one by one: an earlier `until`"
            )));
        }
        let mut notes = vec![];
        let densities = noise::densities(prepared, run.until - run.start, &mut notes);
        notes.extend(remarks(prepared));
        let plant = prepared.plant();
        let graph = augmented.graph();
        let mut known = HashMap::new();
        for input in &augmented.inputs {
            known.insert(input.node, input_expression(study, plant, run, input)?);
        }
        let varies = |u: &&Variable| graph.constant_value(known[&u.node]).is_none();
        let varying = augmented.inputs.iter().filter(varies);
        let varying: Vec<Node> = varying.map(|u| u.node).collect();
        if !varying.is_empty() && study.estimate.between_samples == BetweenSamples::Linear {
            return Ok(Err("the tube of a filter follows known inputs that it holds between samples, not `between_samples = \"linear\"`".to_owned()));
        }
        let symbols = Symbols::of(graph, augmented, observer, varying);
        let (actual, inputs) = symbols.actual(prepared, augmented);
        let noises = variances(prepared.declared(), augmented);
        let model = Model {
            graph,
            symbols: &symbols,
            known,
            augmented,
            observer,
        };
        let (right, sample) = (model.flow(&actual, &densities), model.sample(&noises));
        let z = symbols.all();
        let with = |more: &[Node]| [&z[..], &[plant.time], more].concat();
        let nodes: Vec<Node> = inputs.iter().map(|v| v.node).collect();
        let variance = observer
            .filter
            .as_ref()
            .map_or(&[][..], |f| &f.initial_variance);
        let estimate: Vec<f64> = observer.states.iter().map(|(_, start)| *start).collect();
        let tape =
            |inputs: &[Node], outputs: &[Node]| Tape::new(graph, inputs, outputs).map_err(explain);
        let ranges = bounded(prepared, &inputs)?;
        let (shown, mut errors) = (model.shown(), assumptions::noises(prepared, augmented)?);
        // what disturbs an output is at the sample wherever the plant is then, in the box or not
        let read = graph.symbols_of(&shown);
        let disturbed = inputs.iter().zip(&ranges);
        let disturbed = disturbed.filter(|(v, _)| read.contains(&v.node));
        let (disturbed, sizes): (Vec<Node>, Vec<f64>) = disturbed
            .map(|(v, range)| (v.node, range.magnitude()))
            .unzip();
        errors.extend(sizes);
        let sampled = Sampled {
            flow: Problem {
                right: tape(&with(&nodes), &right)?,
                from,
                start: starts(prepared, augmented, start)?,
                constants: vec![],
                inputs: ranges,
            },
            first: tape(
                &symbols.x,
                &model.first(&estimate, variance, (plant.time, from)),
            )?,
            sample: tape(&with(&[&symbols.errors[..], &disturbed].concat()), &sample)?,
            errors,
            times: (0..=count as usize)
                .map(|k| from + k as f64 * every)
                .collect(),
        };
        let system = Self {
            states: augmented.states.clone(),
            estimate,
            outputs: augmented
                .outputs
                .iter()
                .map(|o| o.variable.name.clone())
                .collect(),
            inputs,
            every,
            sampled,
            notes,
        };
        Ok(system.unbounded().map_or(Ok(system), Err))
    }

    /// What has no bounds, which leaves nothing to be proved.
    fn unbounded(&self) -> Option<String> {
        let flow = &self.sampled.flow;
        let variables = self
            .states
            .iter()
            .zip(&flow.start)
            .chain(self.inputs.iter().zip(&flow.inputs));
        let open = variables
            .filter(|(_, range)| !range.is_bounded())
            .map(|(v, _)| &v.name);
        let readings = self.outputs.iter().zip(&self.sampled.errors);
        let open = open.chain(
            readings
                .filter(|(_, size)| !size.is_finite())
                .map(|(name, _)| name),
        );
        let name = open.into_iter().next()?;
        Some(format!(
            "{name} has no bounds: give its range, `min` and `max` in the model or {name} = [smallest, largest] in [box]"
        ))
    }
}

/// What no tube of a filter counts.
fn excluded(
    prepared: &Prepared<'_>,
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
) -> Option<String> {
    let tuning = observer.filter.as_ref()?;
    let Declared {
        ranges: _,
        noise,
        limits,
        samples: _,
        process_noise: _,
        disturbances: _,
        slew: _,
        input_derivatives: _,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = prepared.declared();
    let plant = prepared.plant();
    let unread = augmented.outputs.iter().find(|o| {
        let noise = noise.of(&o.variable.name);
        !matches!(noise, Some(Noise::Absolute(size) | Noise::Uniform(size)) if *size > 0.0)
    });
    if let Some(output) = unread {
        let name = &output.variable.name;
        let what = match noise.of(name) {
            Some(Noise::Relative(_)) => "a share of its value, which the tube does not follow",
            _ => "no number above 0",
        };
        return Some(format!(
            "the noise of {name} is {what}: noise = {{ {name} = … }} under [sensors], in its unit"
        ));
    }
    let curved = augmented.states.iter().any(|v| v.home != Home::Line);
    let found = [
        (
            tuning.kind != FilterKind::Extended,
            "another filter than the extended Kalman filter",
        ),
        (tuning.gate.is_some(), "a `gate`"),
        (tuning.projects, "`bounds`"),
        (tuning.iterations > 1, "`iterations`"),
        (
            !tuning.whens.is_empty() || !plant.whens.is_empty(),
            "events (`when`)",
        ),
        (!plant.delays.is_empty(), "delays"),
        (limits.is_declared(), "`limits` of sensors"),
        (screens.is_declared(), "screened readings"),
        (late.is_declared(), "late readings"),
        (manifold.is_declared() || curved, "angles and rotations"),
        (input_noise.acts(), "`input_noise`"),
        (correlation.acts(), "correlated noise"),
    ];
    if let Some((_, what)) = found.into_iter().find(|(is, _)| *is) {
        return Some(format!("the tube of a filter does not follow {what}"));
    }
    let n = augmented.states.len();
    (n > STATES).then(|| {
        format!("{n} states: the covariance of more than {STATES} is too large for a tube")
    })
}

/// What the reader should know.
fn remarks(prepared: &Prepared<'_>) -> Vec<String> {
    let declared = prepared.declared();
    let moves = declared.process_noise.acts();
    let is_gaussian = declared
        .noise
        .iter()
        .any(|(_, noise)| matches!(noise, Noise::Absolute(_)));
    [
        Some("of the filter in exact arithmetic, which holds known inputs from sample to sample: what its integrator leaves is not counted".to_owned()),
        moves.then(|| "the filter counts the process noise in P, but the plant is followed without it: Gaussian noise leaves every bound".to_owned()),
        is_gaussian.then(|| "Gaussian readings are taken to lie within 3 standard deviations, all of them, however they conspire".to_owned()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Where the plant and its unknown inputs start.
fn starts(
    prepared: &Prepared<'_>,
    augmented: &AugmentedPlant<'_>,
    given: &[(Name, f64, f64)],
) -> Result<Vec<Interval>, Error> {
    let (states, unknown) = augmented.states.split_at(augmented.plant_states());
    let given: Vec<(Name, Interval)> = given
        .iter()
        .filter_map(|(name, low, high)| Some((name.clone(), Interval::new(*low, *high).ok()?)))
        .collect();
    refuse_others(&given, &prepared.plant().name, augmented.states.iter())?;
    let own = |v: &Variable| Name::best(&given, &v.name).copied();
    let usual = first_of(prepared)?;
    let states = states.iter().zip(usual);
    let states = states.map(|(v, usual)| own(v).unwrap_or(Interval::point(usual)));
    Ok(states
        .chain(unknown.iter().map(|v| own(v).unwrap_or(side(v))))
        .collect())
}

/// R, one per measured output.
fn variances(declared: &Declared, augmented: &AugmentedPlant<'_>) -> Vec<f64> {
    let of = |name: &str| {
        declared
            .noise
            .of(name)
            .map_or(0.0, |noise| Level::from(*noise).variance(0.0))
    };
    augmented
        .outputs
        .iter()
        .map(|o| of(&o.variable.name))
        .collect()
}

/// The place of Pᵢⱼ in the lower triangle.
fn place(i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    i * (i + 1) / 2 + j
}

/// The symbols of z, of the estimate, of ν.
struct Symbols {
    x: Vec<Node>,
    hats: Vec<Node>,
    e: Vec<Node>,
    P: Vec<Node>,
    errors: Vec<Node>,
    /// known inputs that vary, and as the filter holds them
    varying: Vec<Node>,
    held: Vec<Node>,
}

impl Symbols {
    fn of(
        graph: &Graph,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        varying: Vec<Node>,
    ) -> Self {
        let n = augmented.states.len();
        let fresh = |name: &str, count: usize| -> Vec<Node> {
            (0..count).map(|_| graph.fresh(name).node()).collect()
        };
        Self {
            x: augmented.states.iter().map(|v| v.node).collect(),
            hats: observer
                .states
                .iter()
                .map(|(signal, _)| signal.symbol)
                .collect(),
            e: fresh("e", n),
            P: fresh("P", n * (n + 1) / 2),
            errors: fresh("ν", augmented.outputs.len()),
            held: fresh("held", varying.len()),
            varying,
        }
    }

    fn all(&self) -> Vec<Node> {
        [&self.x[..], &self.e, &self.P, &self.held].concat()
    }

    /// x' of the plant, and what drives it that nobody knows: disturbances, and v' of the unknown inputs
    /// with a `slew`.
    fn actual(
        &self,
        prepared: &Prepared<'_>,
        augmented: &AugmentedPlant<'_>,
    ) -> (Vec<Node>, Vec<Variable>) {
        let (plant, graph) = (prepared.plant(), augmented.graph());
        let declared = prepared.declared();
        let is_disturbance = |v: &&Variable| declared.disturbances.of(&v.name).is_some();
        let mut inputs: Vec<Variable> = plant
            .inputs
            .iter()
            .filter(is_disturbance)
            .cloned()
            .collect();
        let mut actual = plant.derivatives.clone();
        for v in &augmented.states[augmented.plant_states()..] {
            let rate = declared.slew.of(&v.name).copied();
            let symbol = rate.map(|rate| Variable {
                name: format!("der({})", v.name),
                node: graph.fresh("rate").node(),
                min: -rate,
                max: rate,
                ..v.clone()
            });
            actual.push(
                symbol
                    .as_ref()
                    .map_or(graph.constant(0.0).node(), |s| s.node),
            );
            inputs.extend(symbol);
        }
        (actual, inputs)
    }
}

/// What makes the expressions.
struct Model<'m, 'g> {
    graph: &'g Graph,
    symbols: &'m Symbols,
    /// known inputs as expressions of time
    known: HashMap<Node, Node>,
    augmented: &'m AugmentedPlant<'g>,
    observer: &'m Observer,
}

impl<'g> Model<'_, 'g> {
    fn expr(&self, node: Node) -> Expr<'g> {
        self.graph.expr(node)
    }

    fn exprs(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        nodes.iter().map(|&node| self.expr(node)).collect()
    }

    /// With the known inputs as they are, and the estimate as x + e.
    fn put(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        self.put_with(nodes, self.known.clone())
    }

    /// The same with the known inputs as the filter holds them.
    fn put_held(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        let (mut known, symbols) = (self.known.clone(), self.symbols);
        let held = symbols.varying.iter().copied();
        known.extend(held.zip(symbols.held.iter().copied()));
        self.put_with(nodes, known)
    }

    fn put_with(&self, nodes: &[Node], mut map: HashMap<Node, Node>) -> Vec<Expr<'g>> {
        let symbols = self.symbols;
        for ((&hat, &x), &e) in symbols.hats.iter().zip(&symbols.x).zip(&symbols.e) {
            map.insert(hat, (self.expr(x) + self.expr(e)).node());
        }
        self.exprs(&self.graph.substitute(nodes, &map))
    }

    /// Slopes of functions of the estimate by its states.
    fn slopes(
        &self,
        nodes: &[Node],
        put: impl Fn(&[Node]) -> Vec<Expr<'g>>,
    ) -> Vec<Vec<(usize, Expr<'g>)>> {
        let slopes = jacobian::forward(self.graph, nodes, &self.symbols.hats);
        let row = |i: usize| {
            let (places, slopes): (Vec<usize>, Vec<Node>) = slopes.row(i).unzip();
            let slopes = places.into_iter().zip(put(&slopes));
            slopes
                .filter(|(_, c)| self.graph.constant_value(c.node()) != Some(0.0))
                .collect()
        };
        (0..nodes.len()).map(row).collect()
    }

    /// The known inputs that vary, at a time.
    fn varying(&self) -> Vec<Node> {
        self.symbols.varying.iter().map(|u| self.known[u]).collect()
    }

    /// z₀
    fn first(&self, estimate: &[f64], variance: &[f64], (time, from): (Node, f64)) -> Vec<Node> {
        let at = HashMap::from([(time, self.graph.constant(from).node())]);
        let held = self.graph.substitute(&self.varying(), &at);
        let x = self.exprs(&self.symbols.x);
        let e = estimate.iter().zip(&x).map(|(&start, &x)| start - x);
        let P = (0..x.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let P = P.map(|(i, j)| if i == j { variance[i] } else { 0.0 });
        let all = x
            .iter()
            .copied()
            .chain(e)
            .chain(P.map(|p| self.graph.constant(p)));
        all.map(Expr::node).chain(held).collect()
    }

    /// z', for x' of the plant and the densities Q.
    fn flow(&self, actual: &[Node], densities: &[f64]) -> Vec<Node> {
        let n = self.symbols.x.len();
        let derivatives = &self.observer.derivatives[..n];
        let estimated = self.put_held(derivatives);
        let F = self.slopes(derivatives, |nodes| self.put_held(nodes));
        let actual = self.put(actual);
        let e = estimated.iter().zip(&actual).map(|(&hat, &x)| hat - x);
        let P = self.exprs(&self.symbols.P);
        let along = |i: usize, j: usize| {
            let terms = F[i].iter().map(|&(k, slope)| slope * P[place(k, j)]);
            terms.fold(self.graph.constant(0.0), |sum, term| sum + term)
        };
        let mut all: Vec<Node> = actual.iter().map(|x| x.node()).collect();
        all.extend(e.map(Expr::node));
        for (i, &density) in densities.iter().enumerate() {
            for j in 0..=i {
                let both = along(i, j) + along(j, i);
                all.push(if i == j { both + density } else { both }.node());
            }
        }
        let still = self.graph.constant(0.0).node();
        all.extend(self.symbols.held.iter().map(|_| still));
        all
    }

    /// h as the plant has it, disturbances included.
    fn shown(&self) -> Vec<Node> {
        let own = |output: &Variable| {
            let all = &self.augmented.plant.outputs;
            let found = all.iter().find(|o| o.name == output.name);
            found.map_or(output.node, |o| o.node)
        };
        let outputs = self.augmented.outputs.iter();
        outputs.map(|o| own(&o.variable)).collect()
    }

    /// z⁺, for the variances R.
    fn sample(&self, noises: &[f64]) -> Vec<Node> {
        let n = self.symbols.x.len();
        let outputs = self
            .observer
            .filter
            .as_ref()
            .map_or(&[][..], |f| &f.outputs);
        let predicted = self.put(outputs);
        let slopes = self.slopes(outputs, |nodes| self.put(nodes));
        let seen = self.put(&self.shown());
        let before = self.exprs(&self.symbols.e);
        let (mut e, mut P) = (before.clone(), self.exprs(&self.symbols.P));
        let zero = self.graph.constant(0.0);
        for (j, c) in slopes.iter().enumerate() {
            let spread = |i: usize| {
                let terms = c.iter().map(|&(k, slope)| slope * P[place(i, k)]);
                terms.fold(zero, |sum, term| sum + term)
            };
            let Pc: Vec<Expr<'g>> = (0..n).map(spread).collect();
            let S = c
                .iter()
                .fold(self.graph.constant(noises[j]), |sum, &(k, slope)| {
                    sum + slope * Pc[k]
                });
            let moved = c
                .iter()
                .fold(zero, |sum, &(k, slope)| sum + slope * (e[k] - before[k]));
            let rest = seen[j] + self.expr(self.symbols.errors[j]) - predicted[j] - moved;
            // of the only state that is shown P⁺ = P·R/S: the same number, and narrower where P is a range
            let alone = match c[..] {
                [(k, _)] => Some(k),
                _ => None,
            };
            let mut next = P.clone();
            for a in 0..n {
                for b in 0..=a {
                    let at = place(a, b);
                    next[at] = match alone.is_some_and(|k| a == k || b == k) {
                        true => noises[j] * P[at] / S,
                        false => P[at] - Pc[a] * Pc[b] / S,
                    };
                }
            }
            e = e.iter().zip(&Pc).map(|(&e, &K)| e + K * rest / S).collect();
            P = next;
        }
        let x = self.exprs(&self.symbols.x);
        let all = x.into_iter().chain(e).chain(P).map(Expr::node);
        all.chain(self.varying()).collect()
    }
}
