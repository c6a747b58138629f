//! How steep the equations are: upper bounds of |∂f_a/∂x_b| on a box.

use crate::Check;
use crate::statement::{Statement, proved};
use lynkeus_expr::{Graph, Node, jacobian};
use lynkeus_proof::chain::Slope;
use lynkeus_structure::{Extended, Region, range};
use lynkeus_structure::{Finding, Verdict};

use crate::DesignError;

/// Upper bounds of the entries of ∂f/∂x that can differ from zero, with the
/// hypothesis that all are finite; `skip` leaves out entries that are not needed.
pub(crate) fn slopes(
    extended: &Extended<'_>,
    region: &Region,
    skip: impl Fn(usize, usize) -> bool,
) -> Result<(Vec<Slope>, Check), DesignError> {
    let graph = extended.graph();
    let symbols = extended.symbols();
    let jacobian = jacobian::forward(graph, &extended.derivatives, &symbols);
    let (mut found, mut open) = (vec![], vec![]);
    for row in 0..symbols.len() {
        let jump = jump(graph, extended.derivatives[row], &symbols);
        // a jump spoils the whole equation, its skipped entries too
        open.extend(jump.map(|node| Open {
            row,
            column: row,
            node: Some(node),
            jumps: true,
        }));
        for &column in extended.pattern[row].iter().filter(|&&b| !skip(row, b)) {
            let node = jacobian.get(row, column);
            let size = match (jump, node) {
                (Some(_), _) => f64::INFINITY,
                (None, Some(node)) => magnitude(graph, node, region)?,
                (None, None) => 0.0,
            };
            if size.is_infinite() && jump.is_none() {
                open.push(Open {
                    row,
                    column,
                    node,
                    jumps: false,
                });
            }
            found.push(Slope { row, column, size });
        }
    }
    let check = check(extended, region, &found, &open);
    Ok((found, check))
}

/// Upper bound of |node| on the region; infinite where there is none, or where
/// the expression is not defined everywhere.
pub(crate) fn magnitude(graph: &Graph, node: Node, region: &Region) -> Result<f64, DesignError> {
    let found = range(graph, node, region)?;
    let size = found.enclosure.hi().max(-found.enclosure.lo());
    Ok(match found.enclosure.is_defined() && size.is_finite() {
        true => size,
        false => f64::INFINITY,
    })
}

/// Variables of the expressions that have no declared end.
pub(crate) fn undeclared(graph: &Graph, nodes: &[Node], region: &Region) -> Vec<String> {
    let used = region.restricted(&graph.symbols_of(nodes));
    let open = used
        .dimensions
        .into_iter()
        .filter(|d| d.name != "time" && !(d.min.is_finite() && d.max.is_finite()));
    open.map(|d| d.name).collect()
}

/// An operation that jumps where a state passes through a value.
fn jump(graph: &Graph, f: Node, states: &[Node]) -> Option<Node> {
    let depends = |node: Node| !jacobian::pattern(graph, &[node], states)[0].is_empty();
    let mut nodes = graph.reachable(&[f]).into_iter();
    nodes.find(|&node| graph.jumps(node) && depends(node))
}

/// An entry without a bound.
struct Open {
    row: usize,
    column: usize,
    node: Option<Node>,
    jumps: bool,
}

fn check(extended: &Extended<'_>, region: &Region, found: &[Slope], open: &[Open]) -> Check {
    let Some(first) = open.first() else {
        let detail = format!("{} entries enclosed", found.len());
        return proved(Statement::SlopesOfTheProof, detail);
    };
    let graph = extended.graph();
    let nodes: Vec<Node> = open.iter().filter_map(|o| o.node).collect();
    let (f, x) = (
        &extended.states[first.row].name,
        &extended.states[first.column].name,
    );
    let shown = first.node.map_or_else(String::new, |n| graph.render(n, 60));
    let missing = undeclared(graph, &nodes, region);
    let detail = match (first.jumps, missing.is_empty()) {
        (true, _) => {
            format!("f({f}) switches with {shown}, so no Lipschitz constant is known for it")
        }
        (false, false) => format!(
            "∂f({f})/∂{x} = {shown} has no bound: declare min and max of {}",
            missing.join(", ")
        ),
        (false, true) => format!(
            "∂f({f})/∂{x} = {shown} has no bound on the box: mind divisions and roots at its edges"
        ),
    };
    let used = region.restricted(&graph.symbols_of(&nodes));
    Statement::SlopesOfTheProof.with(Finding {
        verdict: Verdict::Undecided(used.place()),
        detail,
    })
}
