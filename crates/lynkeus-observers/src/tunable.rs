//! Numbers of an observer that may be changed while it runs: θ, and what stands for it.
//!
//! Every family's gain is a power of its θ, entry by entry: c θ^p with a c that θ has no part in.
//! With θ₀ the study's value, an entry is (c θ₀^p)(θ/θ₀)^p, of which the first factor is what
//! the observer has where nothing is to be changed. So at θ = θ₀ the two are the same to the bit.

use lynkeus_expr::{Expr, Graph, Node};

use crate::Observer;
use crate::estimate::Copy;

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

/// What may be changed while an observer runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tunables {
    /// the numbers; none where the [tuning](crate::Tuning::tunable) does not ask for them
    pub numbers: Vec<Tunable>,
    /// why there are none, where it does
    pub refused: Option<&'static str>,
}

/// A speed that gains are powers of.
#[derive(Clone, Debug)]
pub(crate) struct Speed {
    /// the study's value
    value: f64,
    /// its symbol, where it may be changed
    symbol: Option<Node>,
    name: String,
    meaning: String,
}

impl Speed {
    pub fn new(copy: &Copy<'_, '_>, name: impl Into<String>, value: f64, meaning: String) -> Self {
        let name = name.into();
        let graph = copy.extended.graph();
        Self {
            value,
            symbol: copy
                .common
                .tunable
                .then(|| graph.fresh(name.as_str()).node()),
            name,
            meaning,
        }
    }

    /// θ of each chain, in the order of the measured outputs.
    pub fn of_chains(copy: &Copy<'_, '_>, θ: &[f64]) -> Vec<Self> {
        let outputs = copy.extended.outputs.iter();
        let each = outputs.zip(θ).enumerate().map(|(i, (output, value))| {
            let output = &output.variable.name;
            match θ {
                [_] => Self::new(copy, "theta", *value, format!("θ of the gain of {output}")),
                _ => {
                    let meaning = format!("θ of the chain of {output}");
                    Self::new(copy, format!("theta[{}]", i + 1), *value, meaning)
                }
            }
        });
        each.collect()
    }

    /// The study's value.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// The speed.
    pub fn expr<'g>(&self, graph: &'g Graph) -> Expr<'g> {
        match self.symbol {
            Some(symbol) => graph.expr(symbol),
            None => graph.constant(self.value),
        }
    }

    /// A gain that is `gain` at the study's value and grows like a power of the speed.
    pub fn scaled<'g>(&self, graph: &'g Graph, gain: f64, exponent: f64) -> Expr<'g> {
        let gain = graph.constant(gain);
        match self.symbol {
            Some(symbol) => {
                let ratio = graph.expr(symbol) / graph.constant(self.value);
                gain * ratio.pow(graph.constant(exponent))
            }
            None => gain,
        }
    }
}

impl Observer {
    /// The same, of which these may be changed where the tuning asks for that.
    pub(crate) fn tuned_by<'s>(mut self, speeds: impl IntoIterator<Item = &'s Speed>) -> Self {
        let numbers = speeds.into_iter().filter_map(|speed| {
            Some(Tunable {
                name: speed.name.clone(),
                symbol: speed.symbol?,
                value: speed.value,
                meaning: speed.meaning.clone(),
            })
        });
        self.tunables.numbers.extend(numbers);
        self
    }
}
