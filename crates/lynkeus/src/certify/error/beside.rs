//! The plant, as it is, beside its observer: the symbols that both share, and what is put for them.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Interval, Node, jacobian};
use lynkeus_model::Variable;
use lynkeus_observers::{InputDerivative, Observer, ReadingError};
use lynkeus_structure::AugmentedPlant;
use lynkeus_study::{Noise, SimulateSettings};

use crate::Error;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::systems::input_expression;
use lynkeus_experiment::words::explain;

/// The plant, as it is, beside its observer.
pub(super) struct Beside<'m, 'g> {
    pub graph: &'g Graph,
    pub augmented: &'m AugmentedPlant<'g>,
    pub observer: &'m Observer,
    /// the time, and when it starts
    pub time: (Node, f64),
    /// known inputs as expressions of time, and their derivatives that the observer reads
    pub known: HashMap<Node, Node>,
    /// known inputs that vary, and as an observer holds them from sample to sample
    pub varying: Vec<Node>,
    pub held: Vec<Node>,
    /// plant states and unknown inputs
    pub x: Vec<Node>,
    /// the estimates of these
    pub hats: Vec<Node>,
    /// e
    pub e: Vec<Node>,
    /// x' of the plant, with what drives it that nobody knows
    pub actual: Vec<Node>,
    /// disturbances, and v' of the unknown inputs with a `slew`
    pub inputs: Vec<Variable>,
    /// symbols of the errors of readings
    pub errors: Vec<Node>,
    /// h as the plant has it, disturbances included
    pub shown: Vec<Node>,
    /// how far each reading may be off
    pub sensors: Vec<Reading>,
}

impl<'m, 'g> Beside<'m, 'g> {
    pub fn of(
        prepared: &Prepared<'_>,
        augmented: &'m AugmentedPlant<'g>,
        observer: &'m Observer,
        run: Option<&SimulateSettings>,
        from: f64,
    ) -> Result<Self, Error> {
        let (study, plant, graph) = (prepared.study(), prepared.plant(), augmented.graph());
        let n = augmented.states.len();
        let (mut known, mut named) = (HashMap::new(), vec![]);
        for (input, run) in augmented.inputs.iter().zip(run.into_iter().cycle()) {
            let value = input_expression(study, plant, run, input)?;
            known.insert(input.node, value);
            named.push((input.name.clone(), value));
        }
        let derivatives = observer.input_derivative_expressions(graph, &named);
        for (name, value) in derivatives.map_err(explain)? {
            let own = |d: &&InputDerivative| d.signal.name == name;
            let own = observer.input_derivatives.iter().find(own);
            known.extend(own.map(|d| (d.signal.symbol, value)));
        }
        let fresh = |name: &str, count: usize| -> Vec<Node> {
            (0..count).map(|_| graph.fresh(name).node()).collect()
        };
        let varies = |u: &Node| graph.constant_value(known[u]).is_none();
        let varying = augmented.inputs.iter().map(|u| u.node).filter(varies);
        let varying: Vec<Node> = varying.collect();
        let (actual, inputs) = actual(prepared, augmented);
        let outputs = augmented.outputs.iter().map(|o| &o.variable);
        let shown = |output: &Variable| {
            let own = plant.outputs.iter().find(|o| o.name == output.name);
            own.map_or(output.node, |own| own.node)
        };
        let reading = |output: &Variable| {
            let noise = prepared.declared().noise.of(&output.name).copied();
            let bound = match noise {
                None => 0.0,
                Some(Noise::Uniform(bound)) => bound,
                Some(Noise::Absolute(size) | Noise::Relative(size)) => {
                    (Interval::point(ReadingError::DEVIATIONS) * Interval::point(size)).hi()
                }
            };
            Reading {
                output: output.name.clone(),
                bound,
                is_relative: matches!(noise, Some(Noise::Relative(_))),
            }
        };
        Ok(Self {
            graph,
            augmented,
            observer,
            time: (plant.time, from),
            held: fresh("held", varying.len()),
            varying,
            known,
            x: augmented.states.iter().map(|v| v.node).collect(),
            hats: observer.states.iter().take(n).map(|s| s.0.symbol).collect(),
            e: fresh("e", n),
            actual,
            inputs,
            errors: fresh("ν", augmented.outputs.len()),
            shown: outputs.clone().map(shown).collect(),
            sensors: outputs.map(reading).collect(),
        })
    }

    pub fn expr(&self, node: Node) -> Expr<'g> {
        self.graph.expr(node)
    }

    pub fn exprs(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        nodes.iter().map(|&node| self.expr(node)).collect()
    }

    /// With the known inputs as they are, and the estimate as x + e.
    pub fn put(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        self.put_with(nodes, self.known.clone())
    }

    /// With the known inputs as an observer holds them, and the estimate as x + e.
    pub fn put_held(&self, nodes: &[Node]) -> Vec<Expr<'g>> {
        self.put_with(nodes, self.held())
    }

    /// What stands for the known inputs where they are held.
    pub fn held(&self) -> HashMap<Node, Node> {
        let mut known = self.known.clone();
        known.extend(self.varying.iter().copied().zip(self.held.iter().copied()));
        known
    }

    /// The known inputs that vary, at a time.
    pub fn varying(&self) -> Vec<Node> {
        self.varying.iter().map(|u| self.known[u]).collect()
    }

    /// The same where it starts.
    pub fn first_varying(&self) -> Vec<Node> {
        let (time, from) = self.time;
        let at = HashMap::from([(time, self.graph.constant(from).node())]);
        self.graph.substitute(&self.varying(), &at)
    }

    /// With what else stands for what, and the estimate as x + e.
    pub fn put_with(&self, nodes: &[Node], mut map: HashMap<Node, Node>) -> Vec<Expr<'g>> {
        for ((&hat, &x), &e) in self.hats.iter().zip(&self.x).zip(&self.e) {
            map.insert(hat, (self.expr(x) + self.expr(e)).node());
        }
        self.exprs(&self.graph.substitute(nodes, &map))
    }

    /// Slopes of functions of the estimate by its states.
    pub fn slopes(
        &self,
        nodes: &[Node],
        put: impl Fn(&[Node]) -> Vec<Expr<'g>>,
    ) -> Vec<Vec<(usize, Expr<'g>)>> {
        let slopes = jacobian::forward(self.graph, nodes, &self.hats);
        let row = |i: usize| {
            let (places, slopes): (Vec<usize>, Vec<Node>) = slopes.row(i).unzip();
            let slopes = places.into_iter().zip(put(&slopes));
            slopes
                .filter(|(_, c)| self.graph.constant_value(c.node()) != Some(0.0))
                .collect()
        };
        (0..nodes.len()).map(row).collect()
    }

    /// x, and x̂ − x for where the estimate starts.
    pub fn first(&self) -> Vec<Node> {
        let starts = self.observer.states.iter().zip(&self.x);
        let errors = starts.map(|((_, start), &x)| (*start - self.expr(x)).node());
        self.x.iter().copied().chain(errors).collect()
    }

    /// What the sensors say: what they show, and errors.
    pub fn readings(&self) -> Vec<Expr<'g>> {
        let shown = self.put(&self.shown).into_iter().zip(&self.errors);
        let said = |((shown, &error), reading): ((Expr<'g>, &Node), &Reading)| {
            let error = self.expr(error);
            match reading.is_relative {
                true => shown + error * shown,
                false => shown + error,
            }
        };
        shown.zip(&self.sensors).map(said).collect()
    }
}

/// How far the readings of an output may be off.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// name of the output
    pub output: String,
    /// the bound
    pub bound: f64,
    /// it is a share of what the sensor shows
    pub is_relative: bool,
}

/// z from its start on, in expressions.
pub(super) struct Equations {
    /// what z has after x and e
    pub others: Vec<Node>,
    /// z₀, in x
    pub first: Vec<Node>,
    /// z' after x'
    pub right: Vec<Node>,
    /// z⁺, in z and the errors of readings
    pub sample: Vec<Node>,
    /// places of the variances among the others
    pub variances: Vec<usize>,
    /// the observer's monitors
    pub monitors: Vec<Node>,
}

/// x' of the plant, and what drives it that nobody knows: disturbances, and v' of the unknown inputs with a `slew`.
fn actual(prepared: &Prepared<'_>, augmented: &AugmentedPlant<'_>) -> (Vec<Node>, Vec<Variable>) {
    let (plant, graph) = (prepared.plant(), augmented.graph());
    let declared = prepared.declared();
    let is_disturbance = |v: &&Variable| declared.disturbances.of(&v.name).is_some();
    let inputs = plant.inputs.iter();
    let mut inputs: Vec<Variable> = inputs.filter(is_disturbance).cloned().collect();
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
        let still = graph.constant(0.0).node();
        actual.push(symbol.as_ref().map_or(still, |s| s.node));
        inputs.extend(symbol);
    }
    (actual, inputs)
}
