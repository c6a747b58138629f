//! An observer as a system of expressions, on measurements that are held or predicted between
//! samples.

use std::collections::HashMap;

use lynkeus_expr::flow::Flow;
use lynkeus_expr::{Graph, MissingInput, Node, flow};
use lynkeus_model::{Variable, Whens};
use lynkeus_run::filter::{Drawn, FilterKind};
use lynkeus_structure::AugmentedPlant;

/// A named symbol.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// name as the plant has it
    pub name: String,
    /// the symbol
    pub symbol: Node,
}

/// One estimated quantity: a state of the plant or an unknown input.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// the quantity's declaration in the plant
    pub variable: Variable,
    /// the estimate as an expression of the observer's states
    pub node: Node,
    /// an input that nobody measures, estimated along with the state
    pub unknown_input: bool,
}

/// A quantity that tells how far the estimate can be trusted, reported as a
/// column beside the estimates.
#[derive(Clone, Debug, PartialEq)]
pub struct Monitor {
    /// name of the column
    pub name: String,
    /// the quantity as an expression of time, the observer's states and signals
    pub node: Node,
    /// the flag is raised where the quantity is below this
    pub alarm_below: f64,
    /// what the flag means, for people
    pub meaning: String,
    /// the matrix whose reciprocal condition number it is, where it is one
    pub matrix: Option<&'static str>,
}

/// A derivative of a known input that the observer's equations read. Whoever runs
/// the observer supplies it like an input: exact, from the study's expressions
/// ([`Observer::input_derivative_expressions`]), from columns of a log, or from the
/// generator of the input ([`Observer::generate`]). Differences of samples would not do: where
/// there is nothing else, an observer that estimates the derivatives itself is needed
/// (`variant = "practical"` of the family `drift-observable`).
#[derive(Clone, Debug, PartialEq)]
pub struct InputDerivative {
    /// name of the input
    pub input: String,
    /// 1 for u', 2 for u'', …
    pub order: usize,
    /// the symbol, named like `u'`
    pub signal: Signal,
}

/// z' = F(t, z, u, y), x̂ = z or a function of it, over the graph of the plant.
#[derive(Clone, Debug)]
pub struct Observer {
    /// the symbol of time
    pub time: Node,
    /// states z and where they start; the estimate first, then what the gain needs
    pub states: Vec<(Signal, f64)>,
    /// z', in the order of `states`
    pub derivatives: Vec<Node>,
    /// known inputs u
    pub inputs: Vec<Signal>,
    /// derivatives of the known inputs; empty for most families
    pub input_derivatives: Vec<InputDerivative>,
    /// known inputs and their derivatives that are expressions of time, with these: they are no signals
    /// any more ([`Observer::generate`])
    pub generated: Vec<(Node, Node)>,
    /// measured outputs y
    pub measured: Vec<Signal>,
    /// what is estimated, plant states first
    pub estimates: Vec<Estimate>,
    /// how far it can be trusted; empty for most families
    pub monitors: Vec<Monitor>,
    /// the filter that corrects the estimate when sensors report; none where the correction
    /// is part of the derivatives
    pub filter: Option<FilterTuning>,
    /// numbers of the derivatives that may be changed while it runs; none where the
    /// [tuning](crate::Tuning::tunable) does not ask for them
    pub tunables: Vec<Tunable>,
    /// the gain is made, and proved, as a whole: there are none, whatever the tuning asks for
    pub is_whole: bool,
}

/// A Kalman filter over the observer's flow. The noises are the study's, not the family's.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterTuning {
    /// which filter
    pub kind: FilterKind,
    /// a reading further from what is expected, in standard deviations, is rejected
    pub gate: Option<f64>,
    /// rejections in a row after which the next reading is believed
    pub patience: usize,
    /// the estimate is kept in the declared ranges
    pub projects: bool,
    /// how often the readings of a sample are linearised, at most
    pub iterations: usize,
    /// h(t, x̂, u), one per measured output
    pub outputs: Vec<Node>,
    /// variance of the first estimate, one per state
    pub initial_variance: Vec<f64>,
    /// the derivatives with the estimate limited to its declared range, for where the model has
    /// no value outside of it
    pub confined: Vec<Node>,
    /// by which the estimate jumps
    pub whens: Whens,
}

impl Observer {
    /// (name, expression of time) of each of `input_derivatives`, given those of
    /// the inputs; inputs that are not among `inputs` are left out.
    ///
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol of another graph.
    pub fn input_derivative_expressions(
        &self,
        graph: &Graph,
        inputs: &[(String, Node)],
    ) -> Result<Vec<(String, Node)>, MissingInput> {
        let flow = Flow {
            time: self.time,
            states: &[],
            derivatives: &[],
            inputs: &[],
        };
        let mut found = vec![];
        for needed in &self.input_derivatives {
            let input = inputs.iter().find(|(name, _)| *name == needed.input);
            let Some((_, u)) = input else { continue };
            let jets = flow::derivatives(graph, &flow, &[*u], needed.order)?;
            if let Some(&last) = jets.iter().flatten().last() {
                found.push((needed.signal.name.clone(), last));
            }
        }
        Ok(found)
    }

    /// Whether its states are the estimate itself, of so many quantities.
    pub(crate) fn is_the_estimate(&self, count: usize) -> bool {
        let pairs = self.states.iter().zip(&self.estimates);
        let same = pairs.filter(|((s, _), e)| s.symbol == e.node).count();
        same == self.states.len() && same == count
    }
}

impl Signal {
    /// A signal called as the plant has it, with a symbol of its own: `label` of `name`.
    pub(crate) fn fresh(graph: &Graph, label: &str, name: &str) -> Self {
        Self {
            name: name.to_owned(),
            symbol: graph.fresh(format!("{label} {name}")).node(),
        }
    }
}

/// An observer whose measurements w are states, to be set to each reading: see
/// [`lynkeus_run::Updates::Jumps`].
#[derive(Clone, Debug)]
pub struct Sampled {
    /// states z, then w; known inputs, then one switch s per sensor; nothing measured
    pub observer: Observer,
    /// h(t, x̂, u), one per sensor
    pub outputs: Vec<Node>,
    /// L_f h(t, x̂, u), one per sensor
    pub rates: Vec<Node>,
}

impl Sampled {
    /// Puts a state before the measurements that stays as it is: for
    /// [what measurements that are held fall behind by](lynkeus_run::Lag). Returns its place.
    pub fn push_lag(&mut self, graph: &Graph) -> usize {
        self.push_still(graph, Signal::fresh(graph, "lag of", "what is held"))
    }

    /// Puts what every row draws anew before the measurements: known inputs are read with errors.
    pub fn push_drawn(&mut self, graph: &Graph, drawn: &Drawn<'_>) {
        for (name, symbol) in drawn.states() {
            let name = name.clone();
            self.push_still(graph, Signal { name, symbol });
        }
        let observer = &mut self.observer;
        for nodes in [
            &mut observer.derivatives,
            &mut self.outputs,
            &mut self.rates,
        ] {
            *nodes = drawn.truly(nodes);
        }
        for estimate in &mut observer.estimates {
            estimate.node = drawn.truly(&[estimate.node])[0];
        }
    }

    fn push_still(&mut self, graph: &Graph, state: Signal) -> usize {
        let place = self.observer.states.len() - self.outputs.len();
        self.observer.states.insert(place, (state, 0.0));
        let still = graph.constant(0.0).node();
        self.observer.derivatives.insert(place, still);
        place
    }
}

impl Observer {
    /// The same observer with w' = s·L_f h(x̂) for each measured output: s = 1 between samples
    /// is the inter-sample predictor, s = 0 holds.
    ///
    /// # Errors
    /// [`MissingInput`] only for an observer of another plant.
    pub fn sampled(&self, augmented: &AugmentedPlant<'_>) -> Result<Sampled, MissingInput> {
        let graph = augmented.graph();
        let symbols = augmented.symbols();
        let along = Flow {
            time: self.time,
            states: &symbols,
            derivatives: &augmented.derivatives,
            inputs: &[],
        };
        let h: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
        let series = flow::derivatives(graph, &along, &h, 1)?;
        let rates: Vec<Node> = series.iter().filter_map(|y| y.get(1).copied()).collect();
        // x ↦ x̂
        let images: HashMap<Node, Node> = symbols
            .iter()
            .copied()
            .zip(self.estimates.iter().map(|e| e.node))
            .chain(self.generated.iter().copied())
            .collect();
        let rates = graph.substitute(&rates, &images);
        let outputs = graph.substitute(&h, &images);
        let mut observer = self.clone();
        observer.measured.clear();
        for (signal, &rate) in self.measured.iter().zip(&rates) {
            let switch = Signal::fresh(graph, "predict", &signal.name);
            // where the measurement is held the model need not have a value
            let rate = graph
                .expr(switch.symbol)
                .select(graph.expr(rate), graph.constant(0.0));
            observer.states.push((signal.clone(), 0.0));
            observer.derivatives.push(rate.node());
            observer.inputs.push(switch);
        }
        Ok(Sampled {
            observer,
            outputs,
            rates,
        })
    }
}

/// A number that may be changed while the observer runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Tunable {
    /// what it is called: the study's key where that is what it stands for
    pub name: String,
    /// its symbol in the observer's expressions
    pub symbol: Node,
    /// the study's value, above 0, as every other must be
    pub value: f64,
    /// what it does, for people
    pub meaning: String,
}
