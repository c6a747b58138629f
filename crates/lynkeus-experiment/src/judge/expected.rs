//! What estimates say of the measured outputs.

use lynkeus_expr::{Node, Tape};
use lynkeus_structure::AugmentedPlant;

use crate::{Quantity, Series};
use lynkeus_table::series::Iter;

/// Evaluates each measured output that is a quantity of its own at the estimates and the known
/// inputs. Where one of them is not there, nothing is said.
pub(crate) fn give(augmented: &AugmentedPlant<'_>, time: &Series, quantities: &mut [Quantity]) {
    let mut symbols = vec![augmented.plant.time];
    symbols.extend(augmented.symbols());
    symbols.extend(augmented.inputs.iter().map(|input| input.node));
    let is_own = |q: &Quantity, name: &str| q.name == name && q.estimate.is_none();
    for output in &augmented.outputs {
        let name = &output.variable.name;
        let Some(place) = quantities.iter().position(|q| is_own(q, name)) else {
            continue;
        };
        let Some(columns) = columns(augmented, time, quantities) else {
            return;
        };
        quantities[place].expected = evaluated(augmented, &symbols, output.variable.node, &columns);
    }
}

/// Time, estimates and known inputs.
fn columns<'q>(
    augmented: &AugmentedPlant<'_>,
    time: &'q Series,
    quantities: &'q [Quantity],
) -> Option<Vec<&'q Series>> {
    let named = |name: &str| quantities.iter().find(|q| q.name == name);
    let estimates = augmented.states.iter();
    let estimates = estimates.map(|s| named(&s.name)?.estimate.as_ref());
    let inputs = augmented.inputs.iter();
    let inputs = inputs.map(|u| named(&u.name)?.truth.as_ref());
    let all = std::iter::once(Some(time));
    let all: Option<Vec<&Series>> = all.chain(estimates).chain(inputs).collect();
    all.filter(|columns| columns.iter().all(|c| c.len() == time.len()))
}

fn evaluated(
    augmented: &AugmentedPlant<'_>,
    symbols: &[Node],
    node: Node,
    columns: &[&Series],
) -> Option<Series> {
    let tape = Tape::new(augmented.graph(), symbols, &[node]).ok()?;
    let mut evaluator = tape.evaluator();
    let mut values = vec![0.0; columns.len()];
    let time = columns.first()?;
    let mut rows: Vec<Iter<'_>> = columns.iter().map(|c| c.iter()).collect();
    let at = |_| {
        for (value, column) in values.iter_mut().zip(&mut rows) {
            *value = column.next().unwrap_or(f64::NAN);
        }
        evaluator.value(&values)
    };
    Some(Series::gathered(time.store(), (0..time.len()).map(at)))
}
