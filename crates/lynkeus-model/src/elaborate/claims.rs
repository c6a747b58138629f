//! Assertions over the states and inputs, and those that fail at the start.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Node, Tape};

use super::execute::Claim;
use super::symbols::{Context, Symbols};
use crate::syntax::Problem;
use crate::{Assertion, Variable};

/// What is to hold along a run; what holds whatever happens is left out.
pub(super) fn assertions(
    context: &Context<'_>,
    claims: &[Claim],
    solution: &HashMap<Node, Node>,
) -> Vec<(Assertion, Claim)> {
    let conditions: Vec<Node> = claims.iter().map(|claim| claim.condition).collect();
    let conditions = context.graph.substitute(&conditions, solution);
    let pairs = claims.iter().zip(conditions);
    let open = pairs.filter(|(_, condition)| {
        !matches!(context.graph.constant_value(*condition), Some(value) if value != 0.0)
    });
    open.map(|(claim, condition)| {
        let assertion = Assertion {
            condition,
            message: claim.message.clone(),
            line: claim.span.line(context.source),
            is_warning: claim.is_warning,
        };
        (assertion, claim.clone())
    })
    .collect()
}

/// A warning for each assertion that fails at the declared starts.
pub(super) fn failing_at_start(
    graph: &Graph,
    symbols: &Symbols<'_>,
    assertions: &[(Assertion, Claim)],
    variables: &[&Variable],
) -> Vec<Problem> {
    let mut known: HashMap<Node, f64> = HashMap::from([(symbols.time, 0.0)]);
    let values = symbols.parameter_values().into_iter();
    known.extend(values.filter_map(|(node, value)| Some((node, value?))));
    known.extend(variables.iter().filter_map(|v| Some((v.node, v.start?))));
    let fails = |assertion: &Assertion| {
        let read = graph.symbols_of(&[assertion.condition]);
        let values: Option<Vec<f64>> = read.iter().map(|node| known.get(node).copied()).collect();
        let tape = Tape::new(graph, &read, &[assertion.condition]).ok();
        let (Some(values), Some(tape)) = (values, tape) else {
            return false;
        };
        let mut out = [1.0];
        tape.evaluator().eval(&values, &mut out);
        out[0] == 0.0
    };
    let failing = assertions.iter().filter(|(assertion, _)| fails(assertion));
    failing
        .map(|(assertion, claim)| {
            let message = format!("this assertion fails at the start: {}", assertion.message);
            Problem::new(claim.span, message)
                .hint("change the start values, or the parameters that it is about")
        })
        .collect()
}
