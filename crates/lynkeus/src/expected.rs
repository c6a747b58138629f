//! What estimates say of the measured outputs.

use lynkeus_expr::{Node, Tape};
use lynkeus_structure::Extended;

use crate::Quantity;

/// Evaluates each measured output that is a quantity of its own at the estimates and the known
/// inputs. Where one of them is not there, nothing is said.
pub(crate) fn give(extended: &Extended<'_>, time: &[f64], quantities: &mut [Quantity]) {
    let mut symbols = vec![extended.plant.time];
    symbols.extend(extended.symbols());
    symbols.extend(extended.inputs.iter().map(|input| input.node));
    let columns = columns(extended, time, quantities);
    let Some(columns) = columns else {
        return;
    };
    for output in &extended.outputs {
        let name = &output.variable.name;
        let own = |q: &&mut Quantity| q.name == *name && q.estimate.is_none();
        let Some(quantity) = quantities.iter_mut().find(own) else {
            continue;
        };
        quantity.expected = evaluated(extended, &symbols, output.variable.node, &columns);
    }
}

/// Time, estimates and known inputs.
fn columns(
    extended: &Extended<'_>,
    time: &[f64],
    quantities: &[Quantity],
) -> Option<Vec<Vec<f64>>> {
    let named = |name: &str| quantities.iter().find(|q| q.name == name);
    let estimates = extended.states.iter();
    let estimates = estimates.map(|s| named(&s.name)?.estimate.clone());
    let inputs = extended.inputs.iter();
    let inputs = inputs.map(|u| named(&u.name)?.truth.clone());
    let all = std::iter::once(Some(time.to_vec()));
    let all: Option<Vec<Vec<f64>>> = all.chain(estimates).chain(inputs).collect();
    all.filter(|columns| columns.iter().all(|c| c.len() == time.len()))
}

fn evaluated(
    extended: &Extended<'_>,
    symbols: &[Node],
    node: Node,
    columns: &[Vec<f64>],
) -> Option<Vec<f64>> {
    let tape = Tape::new(extended.graph(), symbols, &[node]).ok()?;
    let mut evaluator = tape.evaluator();
    let mut values = vec![0.0; columns.len()];
    let mut value = [0.0];
    let rows = columns.first()?.len();
    let at = |row: usize| {
        for (value, column) in values.iter_mut().zip(columns) {
            *value = column[row];
        }
        evaluator.eval(&values, &mut value);
        value[0]
    };
    Some((0..rows).map(at).collect())
}
