//! Conditions that several families share: partials along a chain that keep their signs, a
//! right-hand side that is Lipschitz, a gain that stabilises its chain.
//!
//! In the scaled error of a high-gain observer a large θ leaves A(a) − KC, with the partials
//! a_1, a_2, … of the chain above the diagonal of A, whose characteristic polynomial is
//! sⁿ + k₁sⁿ⁻¹ + a₁k₂sⁿ⁻² + a₁a₂k₃sⁿ⁻³ + …

use lynkeus_expr::{Interval, Node};
use lynkeus_proof::hurwitz;
use lynkeus_proof::hurwitz::Stability;
use lynkeus_structure::sign::Sign;
use lynkeus_structure::{
    AugmentedPlant, ChainRequest, Point, Region, Verdict, has_value_at, regularity, sign,
};

use crate::statement::proved;
use crate::{Check, DesignError, KeySpec, Reason, Shape, Statement, Tuning, TuningError};

/// ∂f_j/∂x_{j+1} along a chain.
#[derive(Clone, Debug)]
pub(crate) struct Partial {
    pub node: Node,
    pub sign: f64,
    /// (α₁, α₂) of its size; α₁ = 0 where no sign is proved
    pub bounds: (f64, f64),
}

impl Partial {
    /// The partial that a constant gain is made for: with the sign that is proved, between
    /// its bounds in the middle of ratios.
    pub fn nominal(&self) -> Option<f64> {
        let middle = (self.bounds.0 * self.bounds.1).sqrt();
        (middle > 0.0 && middle.is_finite()).then_some(self.sign * middle)
    }

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
    augmented: &AugmentedPlant<'_>,
    states: &[usize],
    region: &Region,
) -> Result<(Vec<Partial>, Vec<Check>), DesignError> {
    let graph = augmented.graph();
    let (mut partials, mut checks) = (vec![], vec![]);
    for pair in states.windows(2) {
        lasts(augmented)?;
        // where the pattern has the dependency, a missing derivative is a step function's
        let node = augmented.partial(pair[0], pair[1]);
        let node = node.unwrap_or_else(|| graph.constant(0.0).node());
        let Sign {
            finding,
            sign,
            bounds,
        } = sign::keeps_sign(graph, node, region)?;
        let [of, by] = [pair[0], pair[1]].map(|i| augmented.states[i].name.clone());
        // log(x) has a derivative at x < 0, where it has no value: no witness lies there
        let is_nowhere = match &finding.verdict {
            Verdict::Refuted(witness) => {
                !has_value_at(graph, augmented.derivatives[pair[0]], witness, region)?
            }
            _ => false,
        };
        let statement = Statement::PartialKeepsSign { of: of.clone(), by };
        checks.push(match is_nowhere {
            true => {
                let place = region.restricted(&graph.symbols_of(&[node])).dimensions;
                let found = finding.reason;
                statement.found(
                    Verdict::Undecided(place),
                    Reason::WhereNothingIs { found, of },
                )
            }
            false => statement.with(finding),
        });
        partials.push(Partial { node, sign, bounds });
    }
    Ok((partials, checks))
}

/// The partials along every chain, by the places of its output and of its states, with the verdicts on
/// them and on the outputs' slopes.
pub(crate) fn along<'c>(
    augmented: &AugmentedPlant<'_>,
    chains: impl IntoIterator<Item = (usize, &'c [usize])>,
    region: &Region,
) -> Result<(Vec<Vec<Partial>>, Vec<Check>), DesignError> {
    let (mut all, mut checks) = (vec![], vec![]);
    for (output, states) in chains {
        checks.extend(output_slope(augmented, output, region)?);
        let (found, signs) = partials(augmented, states, region)?;
        checks.extend(signs);
        all.push(found);
    }
    Ok((all, checks))
}

/// The slope of an output in its state must not vanish; nothing to check where
/// it is a number.
pub(crate) fn output_slope(
    augmented: &AugmentedPlant<'_>,
    i: usize,
    region: &Region,
) -> Result<Option<Check>, DesignError> {
    let graph = augmented.graph();
    let output = &augmented.outputs[i];
    let Some((state, slope, _)) = output.state else {
        return Ok(None);
    };
    if graph.constant_value(slope).is_some_and(|c| c != 0.0) {
        return Ok(None);
    }
    let statement = Statement::OutputKeepsSign {
        output: output.variable.name.clone(),
        state: augmented.states[state].name.clone(),
    };
    let found = sign::keeps_sign(graph, slope, region)?.finding;
    Ok(Some(statement.with(found)))
}

/// The measured outputs.
pub(crate) fn output_names<'a>(augmented: &'a AugmentedPlant<'_>) -> Vec<&'a str> {
    let outputs = augmented.outputs.iter();
    outputs.map(|o| o.variable.name.as_str()).collect()
}

pub(crate) fn names(augmented: &AugmentedPlant<'_>, states: &[usize]) -> Vec<String> {
    states
        .iter()
        .map(|&i| augmented.states[i].name.clone())
        .collect()
}

/// Ends a form or a design whose budget is spent: it would not count.
pub(crate) fn lasts(augmented: &AugmentedPlant<'_>) -> Result<(), DesignError> {
    match augmented.graph().spent() {
        None => Ok(()),
        Some(spent) => Err(DesignError::Spent(spent)),
    }
}

/// H3 i): the right-hand side is Lipschitz on the box. Never a refusal: outside
/// of a bounded set nothing nonlinear is, and `clamp` prolongs f as the paper does.
pub(crate) fn lipschitz(
    augmented: &AugmentedPlant<'_>,
    region: &Region,
) -> Result<Check, DesignError> {
    let graph = augmented.graph();
    let symbols = augmented.symbols();
    let jacobian = lynkeus_expr::jacobian::forward(graph, &augmented.derivatives, &symbols);
    let regular = regularity(graph, &augmented.derivatives, &symbols, region)?;
    if !regular.is_proved() {
        return Ok(Statement::Lipschitz.with(regular));
    }
    let entries: Vec<_> = jacobian.entries.iter().map(|entry| entry.2).collect();
    let at_once = sign::bounded_at_once(graph, &entries, region)?;
    for (&(row, column, node), at_once) in jacobian.entries.iter().zip(at_once) {
        lasts(augmented)?;
        if at_once || sign::bounded(graph, node, region)? {
            continue;
        }
        let used = region.restricted(&graph.symbols_of(&[node]));
        let name = |i: usize| augmented.states[i].name.clone();
        let reason = Reason::Unbounded {
            of: name(row),
            by: name(column),
            slope: graph.render(node, 60),
            undeclared: None,
        };
        return Ok(Statement::Lipschitz.found(Verdict::Undecided(used.dimensions), reason));
    }
    let reason = Reason::Enclosed(jacobian.entries.len());
    Ok(proved(Statement::Lipschitz, reason))
}

/// The states of each chain, for the families that have chains.
pub(crate) const CHAINS: KeySpec = KeySpec {
    name: "chains",
    shape: Shape::As("list of lists of names", &Shape::List(&Shape::NAMES)),
    default: "found",
    meaning: "the states of each chain, from the sensor outward",
};

/// What the study says about the chains: their names, or the lengths of the
/// lists under `key`.
pub(crate) fn chain_request(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
    key: &str,
    lengths: Option<Vec<usize>>,
) -> Result<ChainRequest, TuningError> {
    let names = tuning.name_lists(CHAINS.name)?;
    let mut mentioned = names.iter().flatten().flatten();
    if let Some(name) = mentioned.find(|n| augmented.state_index(n).is_none()) {
        let states: Vec<&str> = augmented.states.iter().map(|s| s.name.as_str()).collect();
        let expected = format!("names of states and unknown inputs ({})", states.join(", "));
        return Err(TuningError::new(
            CHAINS.name,
            expected,
            format!("\"{name}\""),
        ));
    }
    let count = augmented.outputs.len();
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

/// A chain with its gain.
pub(crate) struct GainedChain<'a> {
    /// K
    pub K: &'a [f64],
    /// bounds of a_1, a_2, …, signs included
    pub partials: &'a [(f64, f64)],
}

impl GainedChain<'_> {
    /// For every constant choice of the partials within their bounds.
    pub fn frozen(&self) -> Stability {
        let side = |&(low, high): &(f64, f64)| Interval::new(low, high).unwrap_or(Interval::ENTIRE);
        hurwitz::decide(&self.coefficients(self.partials.iter().map(side)))
    }

    /// k₁, a₁k₂, a₁a₂k₃, …
    fn coefficients(&self, partials: impl Iterator<Item = Interval>) -> Vec<Interval> {
        let mut product = Interval::ONE;
        let ahead = partials.chain([Interval::ONE]);
        let term = |(&k, a): (&f64, Interval)| {
            let coefficient = product * Interval::point(k);
            product = product * a;
            coefficient
        };
        self.K.iter().zip(ahead).map(term).collect()
    }

    /// Partials in the middle of their bounds; none where these do not keep one sign or
    /// are infinite.
    pub fn middle(&self) -> Option<Vec<f64>> {
        let middle = |&(low, high): &(f64, f64)| {
            let one_sign = low > 0.0 && high > 0.0 || low < 0.0 && high < 0.0;
            let product = low * high;
            // the product alone may leave the range of numbers
            let size = match product.is_normal() {
                true => product.sqrt(),
                false => low.abs().sqrt() * high.abs().sqrt(),
            };
            (one_sign && size.is_finite()).then(|| size.copysign(low))
        };
        self.partials.iter().map(middle).collect()
    }

    /// The eigenvalues of A − KC for these partials, the rightmost first; empty where they are
    /// not found.
    pub fn eigenvalues(&self, a: &[f64]) -> Vec<(f64, f64)> {
        let coefficients = self.coefficients(a.iter().map(|&a| Interval::point(a)));
        // of a product out of range the middle is no coefficient
        if !coefficients.iter().all(|c| c.magnitude().is_finite()) {
            return vec![];
        }
        let middles: Vec<f64> = coefficients.iter().map(|c| c.midpoint()).collect();
        hurwitz::zeros(&middles)
    }

    /// The partials `a` as a witness that the chain is not stable: its value is the largest real
    /// part there, or the zero that it is at least, where it is not found.
    pub fn witness(&self, a: &[f64]) -> Point {
        let rightmost = self.eigenvalues(a).first().map_or(0.0, |λ| λ.0.max(0.0));
        at_partials(a, rightmost)
    }
}

/// A value at the partials a_1, a_2, … along a chain.
pub(crate) fn at_partials(a: &[f64], value: f64) -> Point {
    let named = a.iter().enumerate();
    let coordinates = named.map(|(j, &a)| (format!("a{}", j + 1), a).into());
    Point {
        coordinates: coordinates.collect(),
        value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frozen(K: &[f64], partials: &[(f64, f64)]) -> Stability {
        GainedChain { K, partials }.frozen()
    }

    /// s² + 2s + a: stable for a > 0, and with the sign of a in K for a < 0.
    #[test]
    fn two_states_by_hand() {
        assert_eq!(frozen(&[2.0, 1.0], &[(0.1, 9.0)]), Stability::Stable);
        assert_eq!(frozen(&[2.0, 1.0], &[(-2.0, -2.0)]), Stability::Unstable);
        assert_eq!(frozen(&[2.0, -1.0], &[(-2.0, -2.0)]), Stability::Stable);
        assert_eq!(frozen(&[-2.0, 1.0], &[(1.0, 1.0)]), Stability::Unstable);
        assert_eq!(frozen(&[2.0, 1.0], &[(-1.0, 1.0)]), Stability::Unknown);
    }

    /// Positive partials are not enough for three states: (3, 3, 1) needs a₂ < 9.
    #[test]
    fn a_positive_partial_can_be_too_large() {
        assert_eq!(
            frozen(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (10.0, 10.0)]),
            Stability::Unstable
        );
        assert_eq!(
            frozen(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (8.0, 8.0)]),
            Stability::Stable
        );
    }

    #[test]
    fn the_middle_of_partials_of_one_sign() {
        let chain = GainedChain {
            K: &[-2.0, 5.0],
            partials: &[(1.0, 1.0)],
        };
        assert_eq!(chain.middle(), Some(vec![1.0]));
        let mixed = GainedChain {
            K: &[1.0, 1.0],
            partials: &[(-1.0, 1.0)],
        };
        assert_eq!(mixed.middle(), None);
    }

    /// √(1e-200 · 1e-140) = 1e-170, whose square is no number beside zero; and its inverse.
    #[test]
    fn the_middle_of_small_and_large_bounds() {
        let middle = |low: f64, high: f64| {
            let partials = &[(low, high)];
            GainedChain {
                K: &[1.0, 1.0],
                partials,
            }
            .middle()
        };
        for (low, high, exact) in [(1e-200, 1e-140, 1e-170), (1e140, 1e200, 1e170)] {
            let found = middle(low, high).unwrap()[0];
            assert!((found / exact - 1.0).abs() < 1e-14, "{found}");
            let found = middle(-high, -low).unwrap()[0];
            assert!((found / exact + 1.0).abs() < 1e-14, "{found}");
        }
        assert_eq!(middle(0.0, 1.0), None);
        assert_eq!(middle(1.0, f64::INFINITY), None);
        assert_eq!(middle(f64::NAN, 1.0), None);
    }

    #[test]
    fn eigenvalues_out_of_range_are_not_found() {
        let chain = GainedChain {
            K: &[1e200, 1e200],
            partials: &[(1e200, 1e200)],
        };
        assert_eq!(chain.eigenvalues(&[1e200]), []);
        assert_eq!(chain.witness(&[1e200]).value, 0.0);
    }
}
