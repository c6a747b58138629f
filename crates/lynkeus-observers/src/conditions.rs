//! Conditions that several families share.

use crate::Check;
use crate::statement::{Statement, proved};
use lynkeus_expr::Node;
use lynkeus_structure::sign::{self, Sign};
use lynkeus_structure::{ChainRequest, Extended, Region, Regularity, has_value_at};
use lynkeus_structure::{Finding, Verdict};

use crate::{DesignError, KeySpec, Shape, Tuning, TuningError};

/// ∂f_row/∂x_column with the verdict on its sign.
fn partial(
    extended: &Extended<'_>,
    row: usize,
    column: usize,
    region: &Region,
) -> Result<(Node, Sign), DesignError> {
    let graph = extended.graph();
    // where the pattern has the dependency, a missing derivative is a step function's
    let node = extended
        .partial(row, column)
        .unwrap_or_else(|| graph.constant(0.0).node());
    let mut found = sign::keeps_sign(graph, node, region)?;
    // log(x) has a derivative at x < 0, where it has no value: no witness lies there
    if let Verdict::Refuted(witness) = &found.finding.verdict
        && !has_value_at(graph, extended.derivatives[row], witness, region)?
    {
        let f = &extended.states[row].name;
        found.finding.detail = format!("{}, but where f({f}) has no value", found.finding.detail);
        let place = region.restricted(&graph.symbols_of(&[node])).place();
        found.finding.verdict = Verdict::Undecided(place);
    }
    Ok((node, found))
}

/// ∂f_j/∂x_{j+1} along a chain.
#[derive(Clone, Debug)]
pub(crate) struct Partial {
    pub node: Node,
    pub sign: f64,
    /// (α₁, α₂) of its size; α₁ = 0 where no sign is proved
    pub bounds: (f64, f64),
}

impl Partial {
    /// The range, sign included.
    pub fn range(&self) -> (f64, f64) {
        let (low, high) = self.bounds;
        match (low > 0.0, self.sign < 0.0) {
            (true, false) => (low, high),
            (true, true) => (-high, -low),
            (false, _) => (-high, high),
        }
    }
}

/// The partials along a chain with the verdicts on their signs.
pub(crate) fn partials(
    extended: &Extended<'_>,
    states: &[usize],
    region: &Region,
) -> Result<(Vec<Partial>, Vec<Check>), DesignError> {
    let (mut found, mut checks) = (vec![], vec![]);
    for pair in states.windows(2) {
        lasts(extended)?;
        let (node, verdict) = partial(extended, pair[0], pair[1], region)?;
        found.push(Partial {
            node,
            sign: verdict.sign,
            bounds: verdict.bounds,
        });
        let name = |i: usize| extended.states[i].name.clone();
        let statement = Statement::PartialKeepsSign {
            of: name(pair[0]),
            by: name(pair[1]),
        };
        checks.push(statement.with(verdict.finding));
    }
    Ok((found, checks))
}

/// The slope of an output in its state must not vanish; nothing to check where
/// it is a number.
pub(crate) fn output_slope(
    extended: &Extended<'_>,
    i: usize,
    region: &Region,
) -> Result<Option<Check>, DesignError> {
    let graph = extended.graph();
    let output = &extended.outputs[i];
    let Some((state, slope, _)) = output.state else {
        return Ok(None);
    };
    if graph.constant_value(slope).is_some_and(|c| c != 0.0) {
        return Ok(None);
    }
    let statement = Statement::OutputKeepsSign {
        output: output.variable.name.clone(),
        state: extended.states[state].name.clone(),
    };
    let found = sign::keeps_sign(graph, slope, region)?.finding;
    Ok(Some(statement.with(found)))
}

pub(crate) fn names(extended: &Extended<'_>, states: &[usize]) -> Vec<String> {
    states
        .iter()
        .map(|&i| extended.states[i].name.clone())
        .collect()
}

/// Gains on the error of the state that output `i` shows as gains on ŷ − y: divided by
/// the output's slope in that state, where it is a number.
pub(crate) fn on_output(
    extended: &Extended<'_>,
    i: usize,
    states: &[usize],
    gains: &[f64],
) -> Vec<(String, f64)> {
    let shown = extended.outputs[i].state;
    let slope = shown.and_then(|(_, slope, _)| extended.graph().constant_value(slope));
    let gains = gains.iter().map(|k| k / slope.unwrap_or(1.0));
    names(extended, states).into_iter().zip(gains).collect()
}

/// Ends a form or a design whose budget is spent: it would not count.
pub(crate) fn lasts(extended: &Extended<'_>) -> Result<(), DesignError> {
    match extended.graph().spent() {
        None => Ok(()),
        Some(spent) => Err(DesignError::Spent(spent)),
    }
}

/// H3 i): the right-hand side is Lipschitz on the box. Never a refusal: outside
/// of a bounded set nothing nonlinear is, and `clamp` prolongs f as the paper does.
pub(crate) fn lipschitz(extended: &Extended<'_>, region: &Region) -> Result<Check, DesignError> {
    let graph = extended.graph();
    let symbols = extended.symbols();
    let jacobian = lynkeus_expr::jacobian::forward(graph, &extended.derivatives, &symbols);
    let regularity = Regularity::of(graph, &extended.derivatives, &symbols, region)?;
    if !regularity.holds() {
        return Ok(Statement::Lipschitz.with(regularity.finding()));
    }
    let entries: Vec<_> = jacobian.entries.iter().map(|entry| entry.2).collect();
    let at_once = sign::bounded_at_once(graph, &entries, region)?;
    for (&(row, column, node), at_once) in jacobian.entries.iter().zip(at_once) {
        lasts(extended)?;
        if at_once || sign::bounded(graph, node, region)? {
            continue;
        }
        let detail = format!(
            "∂f({})/∂{} = {} is not known to be bounded; declare min and max, and mind divisions and roots at the edges of the box",
            extended.states[row].name,
            extended.states[column].name,
            graph.render(node, 60)
        );
        let used = region.restricted(&graph.symbols_of(&[node]));
        let verdict = Verdict::Undecided(used.place());
        return Ok(Statement::Lipschitz.with(Finding { verdict, detail }));
    }
    let detail = format!("{} entries enclosed", jacobian.entries.len());
    Ok(proved(Statement::Lipschitz, detail))
}

/// The states of each chain, for the families that have chains.
pub(crate) const CHAINS: KeySpec = KeySpec {
    name: "chains",
    kind: "list of lists of names",
    shape: Shape::List(&Shape::NAMES),
    default: "found",
    meaning: "the states of each chain, from the sensor outward",
};

/// What the study says about the chains: their names, or the lengths of the
/// lists under `key`.
pub(crate) fn chain_request(
    extended: &Extended<'_>,
    tuning: &Tuning,
    key: &str,
    lengths: Option<Vec<usize>>,
) -> Result<ChainRequest, TuningError> {
    let names = tuning.name_lists(CHAINS.name)?;
    let mut mentioned = names.iter().flatten().flatten();
    if let Some(name) = mentioned.find(|n| extended.state_index(n).is_none()) {
        let states: Vec<&str> = extended.states.iter().map(|s| s.name.as_str()).collect();
        let expected = format!("names of states and unknown inputs ({})", states.join(", "));
        return Err(TuningError::new(
            CHAINS.name,
            expected,
            format!("\"{name}\""),
        ));
    }
    let count = extended.outputs.len();
    if let Some(lengths) = &lengths
        && lengths.len() != count
    {
        let expected = format!("one entry per measured output ({count})");
        return Err(TuningError::new(
            key,
            expected,
            format!("{} entries", lengths.len()),
        ));
    }
    Ok(ChainRequest { lengths, names })
}
