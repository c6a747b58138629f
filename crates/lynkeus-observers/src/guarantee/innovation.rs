//! What an observer reads of its own error: x̂_s − x_s, for outputs that each show one
//! state s.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Interval, MissingInput, Node, Unary};
use lynkeus_structure::{Dimension, Extended, Innovation, Region, range};

use crate::Observer;

/// The innovations of an observer.
pub(super) struct Innovations {
    pub innovations: Vec<Innovation>,
    /// the nodes that are innovations, over the symbols that stand for them
    pub images: HashMap<Node, Node>,
    /// with a side for each of the symbols
    pub region: Region,
}

/// Finds h(x̂) − y and x̂_s − x_s(y), in either order.
pub(super) fn of(
    extended: &Extended<'_>,
    observer: &Observer,
    region: &Region,
) -> Result<Innovations, MissingInput> {
    let graph = extended.graph();
    let hats = extended.states.iter().zip(&observer.states);
    let hats: HashMap<Node, Node> = hats
        .map(|(state, (hat, _))| (state.node, hat.symbol))
        .collect();
    let mut found = Innovations {
        innovations: vec![],
        images: HashMap::new(),
        region: region.clone(),
    };
    for (output, signal) in extended.outputs.iter().zip(&observer.measured) {
        let Some((state, slope, offset)) = output.state else {
            continue;
        };
        let name = format!("error of {}", extended.states[state].name);
        let symbol = graph.fresh(&name);
        let (y, slope, offset) = (
            graph.expr(signal.symbol),
            graph.expr(slope),
            graph.expr(offset),
        );
        let hat = observer.states[state].0.symbol;
        let seen = graph.substitute(&[output.variable.node], &hats)[0];
        let shown = ((y - offset) / slope).node();
        let pairs = [
            (seen, signal.symbol, (slope * symbol).node()),
            (hat, shown, symbol.node()),
        ];
        for (estimate, measured, error) in pairs {
            let forth = graph.binary(Binary::Sub, estimate, measured);
            let back = graph.binary(Binary::Sub, measured, estimate);
            found.images.insert(forth, error);
            found.images.insert(back, graph.unary(Unary::Neg, error));
        }
        // a second sensor of the same state reads the same error
        if found.innovations.iter().any(|i| i.state == state) {
            continue;
        }
        found.innovations.push(Innovation {
            symbol: symbol.node(),
            state,
        });
        let values = range(graph, hat, region)?.enclosure;
        let size = (Interval::point(values.hi()) - Interval::point(values.lo())).magnitude();
        let size = if size.is_finite() {
            size
        } else {
            f64::INFINITY
        };
        found.region.dimensions.push(Dimension {
            name,
            symbol: symbol.node(),
            min: -size,
            max: size,
            integer: false,
        });
    }
    Ok(found)
}
