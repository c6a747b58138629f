//! What the tests of plants share.

use std::time::{Duration, Instant};

use lynkeus_expr::{Node, Tape};
use lynkeus_model::{Diagnostic, LoadOptions, Plant};

/// What some work makes, for which the processor may be busy so long. Where the system does not tell, it
/// is the time that passes; of that a machine with other work may need many times as much.
pub fn within<T>(limit: Duration, work: impl FnOnce() -> T) -> T {
    let (begun, before) = (Instant::now(), processor_time());
    let made = work();
    let passed = begun.elapsed();
    let after = processor_time();
    let busy = after
        .zip(before)
        .map_or(passed, |(after, before)| after - before);
    assert!(
        busy < limit && passed < 20 * limit,
        "{busy:?} in {passed:?}"
    );
    made
}

/// The time for which this thread has had a processor.
fn processor_time() -> Option<Duration> {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = told.split_whitespace().next()?.parse().ok()?;
    // a system that does not count says 0
    Some(Duration::from_nanos(nanoseconds)).filter(|time| !time.is_zero())
}

/// The plant of a text that must be taken.
pub fn plant(text: &str) -> Plant {
    match Plant::from_modelica(text, "test.mo", &LoadOptions::default()) {
        Ok(plant) => plant,
        Err(refused) => panic!("{refused}"),
    }
}

/// The refusal of a text that must not be taken.
pub fn refused(text: &str) -> Diagnostic {
    match Plant::from_modelica(text, "test.mo", &LoadOptions::default()) {
        Ok(_) => panic!("taken: {text}"),
        Err(refused) => refused,
    }
}

/// Values of expressions; states, inputs and parameters by name, all others 0.
pub fn values(plant: &Plant, nodes: &[Node], given: &[(&str, f64)]) -> Vec<f64> {
    let variables = plant.states.iter().chain(&plant.inputs);
    let parameters = plant.parameters.iter().map(|parameter| &parameter.variable);
    let mut symbols: Vec<(&str, Node)> = variables
        .chain(parameters)
        .map(|variable| (variable.name.as_str(), variable.node))
        .collect();
    symbols.push(("time", plant.time));
    let inputs: Vec<Node> = symbols.iter().map(|(_, node)| *node).collect();
    let value = |name: &str| {
        given
            .iter()
            .find(|(known, _)| *known == name)
            .map_or(0.0, |g| g.1)
    };
    let numbers: Vec<f64> = symbols.iter().map(|(name, _)| value(name)).collect();
    let tape = Tape::new(&plant.graph, &inputs, nodes).unwrap();
    let mut out = vec![0.0; nodes.len()];
    tape.evaluator().eval(&numbers, &mut out);
    out
}

/// The derivatives of a plant.
pub fn slopes(plant: &Plant, given: &[(&str, f64)]) -> Vec<f64> {
    values(plant, &plant.derivatives, given)
}
