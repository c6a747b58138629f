//! What the model asserts, followed along a run.

use lynkeus_expr::{Node, Tape};
use lynkeus_model::{Assertion, Diagnostic, Plant, Variable};
use lynkeus_words::short;

use crate::judge::outside::{ESTIMATE, Of, PLANT};
use crate::{Quantity, Series};
use lynkeus_table::series::Iter;

/// The model's warnings, and its assertions that do not hold at every row, in words.
pub(crate) fn told(plant: &Plant, time: &Series, quantities: &[Quantity]) -> Vec<String> {
    let mut told: Vec<String> = plant.warnings.iter().map(Diagnostic::one_line).collect();
    let found = [PLANT, ESTIMATE].map(|of| broken(plant, time, quantities, of));
    for (who, broken) in ["the plant", "the estimate"].into_iter().zip(found) {
        told.extend(broken.iter().map(|broken| broken.words(who, time.len())));
    }
    told
}

/// An assertion that does not hold somewhere.
struct Broken<'p> {
    assertion: &'p Assertion,
    rows: usize,
    first: f64,
}

impl Broken<'_> {
    fn words(&self, who: &str, of: usize) -> String {
        let Assertion { message, line, .. } = self.assertion;
        let message = match message.is_empty() {
            true => String::new(),
            false => format!(" (\"{message}\")"),
        };
        format!(
            "{who} breaks the assertion on line {line} of the model{message} at {} of {of} rows, first at t = {}",
            self.rows,
            short(self.first)
        )
    }
}

/// The assertions that do not hold at every row of the values that `of` gives, of the inputs that
/// it does not give as they are known; none where a value is missing.
fn broken<'p>(plant: &'p Plant, time: &Series, quantities: &[Quantity], of: Of) -> Vec<Broken<'p>> {
    if plant.assertions.is_empty() {
        return vec![];
    }
    let variables: Vec<&Variable> = plant.states.iter().chain(&plant.inputs).collect();
    let column = |(i, variable): (usize, &&Variable)| {
        let own = quantities.iter().find(|q| q.name == variable.name)?;
        let known = || PLANT(own).filter(|_| i >= plant.states.len());
        of(own).or_else(known).map(Series::iter)
    };
    let columns: Option<Vec<Iter<'_>>> = variables.iter().enumerate().map(column).collect();
    let symbols = std::iter::once(plant.time).chain(variables.iter().map(|v| v.node));
    let symbols: Vec<Node> = symbols.collect();
    let conditions: Vec<Node> = plant.assertions.iter().map(|a| a.condition).collect();
    let (Some(mut columns), Ok(tape)) = (columns, Tape::new(&plant.graph, &symbols, &conditions))
    else {
        return vec![];
    };
    let mut evaluator = tape.evaluator();
    let mut holds = vec![0.0; conditions.len()];
    let mut counts: Vec<(usize, Option<f64>)> = vec![(0, None); conditions.len()];
    let mut values = vec![];
    for t in time {
        values.clear();
        values.push(t);
        let columns = columns.iter_mut();
        values.extend(columns.map(|c| c.next().unwrap_or(f64::NAN)));
        evaluator.eval(&values, &mut holds);
        for ((count, first), holds) in counts.iter_mut().zip(&holds) {
            if *holds == 0.0 {
                *count += 1;
                first.get_or_insert(t);
            }
        }
    }
    let pairs = plant.assertions.iter().zip(counts);
    pairs
        .filter_map(|(assertion, (rows, first))| {
            Some(Broken {
                assertion,
                rows,
                first: first?,
            })
        })
        .collect()
}
