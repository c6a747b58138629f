//! An observer as a system of expressions.

use lynkeus_expr::{Graph, Node};
use lynkeus_model::Variable;

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
}

/// z' = F(t, z, u, y), x̂ = z or a function of it, over the graph of the plant.
#[derive(Clone, Debug)]
pub struct Observer {
    /// name of the family
    pub family: &'static str,
    /// the symbol of time
    pub time: Node,
    /// states z and where they start; the estimate first, then what the gain needs
    pub states: Vec<(Signal, f64)>,
    /// z', in the order of `states`
    pub derivatives: Vec<Node>,
    /// known inputs u
    pub inputs: Vec<Signal>,
    /// measured outputs y
    pub measured: Vec<Signal>,
    /// what is estimated, plant states first
    pub estimates: Vec<Estimate>,
    /// how far it can be trusted; empty for most families
    pub monitors: Vec<Monitor>,
}

impl Observer {
    /// The symbol of an estimated quantity. The name cannot be a Modelica one, so
    /// that it never meets a variable of the plant.
    pub(crate) fn hat(graph: &Graph, name: &str) -> Signal {
        let symbol = graph.symbol(&format!("estimate of {name}")).node();
        Signal {
            name: name.to_owned(),
            symbol,
        }
    }

    /// The symbol of a measured output.
    pub(crate) fn measurement(graph: &Graph, name: &str) -> Signal {
        let symbol = graph.symbol(&format!("measured {name}")).node();
        Signal {
            name: name.to_owned(),
            symbol,
        }
    }
}
