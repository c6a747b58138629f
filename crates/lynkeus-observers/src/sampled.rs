//! Any observer on sampled measurements.

use lynkeus_expr::flow::{self, Flow};
use lynkeus_expr::{Graph, MissingInput, Node};
use lynkeus_structure::Extended;
use std::collections::HashMap;

use crate::{Observer, Signal};

/// An observer whose measurements w are states, to be set to each reading: see
/// [`lynkeus_run::SampledObserver`].
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
        let place = self.observer.states.len() - self.outputs.len();
        let lag = Signal::fresh(graph, "lag of", "what is held");
        self.observer.states.insert(place, (lag, 0.0));
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
    pub fn sampled(&self, extended: &Extended<'_>) -> Result<Sampled, MissingInput> {
        let graph = extended.graph();
        let symbols = extended.symbols();
        let along = Flow {
            time: self.time,
            states: &symbols,
            derivatives: &extended.derivatives,
            inputs: &[],
        };
        let h: Vec<Node> = extended.outputs.iter().map(|o| o.variable.node).collect();
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
