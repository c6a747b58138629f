//! Sums of slopes times derivatives.

use std::collections::{BTreeMap, HashMap};

use super::still::Still;
use super::{Builder, Tangent};
use crate::partials::is_steep;
use crate::{Graph, Node, Op};

/// A derivative that is 0 where a condition holds.
struct Guarded {
    condition: Node,
    moving: Node,
}

impl Guarded {
    fn of(graph: &Graph, derivative: Node) -> Option<Self> {
        match graph.op(derivative) {
            Op::Select(condition, zero, moving) if graph.constant_value(zero) == Some(0.0) => {
                Some(Self { condition, moving })
            }
            _ => None,
        }
    }
}

/// Σ slope·d(argument) of an operation. Where it is known what is still, steep slopes stand behind that
/// guard, and the same guard within is dropped: each question is asked once for all terms.
pub(super) fn tangent(
    build: &Builder<'_>,
    op: Op,
    terms: &[(Node, Node)],
    tangents: &HashMap<Node, Tangent>,
    still: Option<&Still<'_>>,
) -> Tangent {
    let graph = build.graph;
    let mut sums: BTreeMap<(usize, Option<Node>), Node> = BTreeMap::new();
    for &(argument, slope) in terms {
        let is_steep = is_steep(op) && graph.constant_value(slope).is_none();
        let guard = still.filter(|_| is_steep);
        let guard = guard.and_then(|still| still.condition(argument));
        for (&column, &d) in tangents.get(&argument).into_iter().flatten() {
            let inner = Guarded::of(graph, d).filter(|inner| guard == Some(inner.condition));
            let d = inner.map_or(d, |inner| inner.moving);
            build.add_to(&mut sums, (column, guard), build.times(slope, d));
        }
    }
    let mut sum = Tangent::new();
    for ((column, guard), term) in sums {
        let term = guard.map_or(term, |is_still| graph.select(is_still, build.zero(), term));
        build.add_to(&mut sum, column, term);
    }
    sum
}
