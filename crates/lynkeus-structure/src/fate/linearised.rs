//! ∂(f, h)/∂(η, v) as expressions.

use lynkeus_expr::{Interval, MissingInput, Node, jacobian};

use super::{Hidden, Told};
use crate::fate::constraints::{Row, System};
use crate::{Region, range_within};

/// Cells examined per end of the range of an entry.
const CELLS: usize = 400;

/// Encloses the differences of any two solutions in the box: slopes averaged along the line
/// between two points lie in the range of the slopes.
pub(super) fn enclosed(hidden: &Hidden<'_, '_>) -> Result<System, MissingInput> {
    let extended = hidden.extended;
    let region = extended.region();
    let (states, inputs) = hidden.free();
    let equation = |&i: &usize| extended.derivatives[i];
    let told = (0..hidden.told.len())
        .filter(|&i| hidden.told[i] == Told::Determined && !hidden.is_signal(i));
    let told: Vec<usize> = told.collect();
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let functions: Vec<Node> = states
        .iter()
        .map(equation)
        .chain(told.iter().map(equation))
        .chain(outputs)
        .collect();
    let symbol = |&i: &usize| extended.states[i].node;
    let symbols: Vec<Node> = states.iter().chain(&inputs).map(symbol).collect();
    let slopes = jacobian::forward(extended.graph(), &functions, &symbols);
    let mut rows = vec![];
    for i in 0..functions.len() {
        let mut all = vec![Interval::ZERO; symbols.len()];
        for (j, slope) in slopes.row(i) {
            all[j] = enclosure(hidden, slope, &region)?;
        }
        let b = all.split_off(states.len());
        rows.push(Row { a: all, b });
    }
    let constraints = rows.split_off(states.len());
    let is_said = |row: &Row| !row.a.iter().chain(&row.b).all(super::constraints::is_zero);
    Ok(System {
        flow: rows.into_iter().map(Some).collect(),
        constraints: constraints.into_iter().filter(is_said).collect(),
        followers: vec![],
        inputs: vec![None; inputs.len()],
    })
}

fn enclosure(
    hidden: &Hidden<'_, '_>,
    node: Node,
    region: &Region,
) -> Result<Interval, MissingInput> {
    Ok(range_within(hidden.extended.graph(), node, region, CELLS)?.enclosure)
}
