//! Is an expression zero everywhere? Decided by expanding it into monomials.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

/// Larger polynomials are not multiplied out.
const MAX_TERMS: usize = 200;
/// Higher powers are not multiplied out.
const MAX_POWER: i32 = 8;

/// The coefficient, never zero, of each product of powers of symbols and of other
/// expressions that are taken whole.
type Polynomial = BTreeMap<Vec<(Node, u32)>, f64>;

/// Whether the expression is zero wherever it is defined. Exact: a sum or product
/// of coefficients that does not fit into a float is not carried out, so that
/// rounding never makes a zero. `false` may also mean "not known".
pub fn vanishes(graph: &Graph, node: Node) -> bool {
    if let Some(value) = graph.constant_value(node) {
        return value == 0.0;
    }
    if !matches!(
        graph.op(node),
        Op::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..) | Op::Unary(Unary::Neg, _)
    ) {
        return false;
    }
    let mut expanded: HashMap<Node, Polynomial> = HashMap::new();
    for node in graph.reachable(&[node]) {
        if graph.spent().is_some() {
            return false;
        }
        let polynomial = expand(graph, node, &expanded).unwrap_or_else(|| whole(node));
        expanded.insert(node, polynomial);
    }
    expanded.get(&node).is_some_and(BTreeMap::is_empty)
}

/// The node itself as the only term.
fn whole(node: Node) -> Polynomial {
    Polynomial::from([(vec![(node, 1)], 1.0)])
}

/// None where the node is no sum or product, or would grow too large.
fn expand(graph: &Graph, node: Node, known: &HashMap<Node, Polynomial>) -> Option<Polynomial> {
    match graph.op(node) {
        Op::Constant(0.0) => Some(Polynomial::new()),
        Op::Constant(value) => Some(Polynomial::from([(vec![], value)])),
        Op::Unary(Unary::Neg, a) => Some(scaled(known.get(&a)?, -1.0)),
        Op::Binary(Binary::Add, a, b) => sum(known.get(&a)?, known.get(&b)?),
        Op::Binary(Binary::Sub, a, b) => sum(known.get(&a)?, &scaled(known.get(&b)?, -1.0)),
        Op::Binary(Binary::Mul, a, b) => product(known.get(&a)?, known.get(&b)?),
        Op::Powi(a, n @ 1..=MAX_POWER) => {
            let base = known.get(&a)?;
            (1..n).try_fold(base.clone(), |power, _| product(&power, base))
        }
        _ => None,
    }
}

fn scaled(a: &Polynomial, factor: f64) -> Polynomial {
    a.iter().map(|(m, c)| (m.clone(), c * factor)).collect()
}

fn sum(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    let mut sum = a.clone();
    for (monomial, &coefficient) in b {
        add(&mut sum, monomial.clone(), coefficient)?;
    }
    (sum.len() <= MAX_TERMS).then_some(sum)
}

fn product(a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
    if a.len() * b.len() > MAX_TERMS {
        return None;
    }
    let mut product = Polynomial::new();
    for (m, &c) in a {
        for (n, &d) in b {
            let mut powers: BTreeMap<Node, u32> = m.iter().copied().collect();
            for &(node, power) in n {
                *powers.entry(node).or_default() += power;
            }
            add(
                &mut product,
                powers.into_iter().collect(),
                exact_product(c, d)?,
            )?;
        }
    }
    Some(product)
}

fn add(sum: &mut Polynomial, monomial: Vec<(Node, u32)>, coefficient: f64) -> Option<()> {
    let total = match sum.get(&monomial) {
        Some(&present) => exact_sum(present, coefficient)?,
        None => coefficient,
    };
    match total == 0.0 {
        true => sum.remove(&monomial),
        false => sum.insert(monomial, total),
    };
    Some(())
}

/// Knuth's two-sum: the residual says whether the sum is exact.
fn exact_sum(a: f64, b: f64) -> Option<f64> {
    let s = a + b;
    let b_part = s - a;
    let residual = (a - (s - b_part)) + (b - b_part);
    (residual == 0.0).then_some(s)
}

fn exact_product(a: f64, b: f64) -> Option<f64> {
    let p = a * b;
    (p.is_normal() && a.mul_add(b, -p) == 0.0).then_some(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identities_are_seen_and_near_misses_are_not() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let zero = |e: lynkeus_expr::Expr<'_>| vanishes(&g, e.node());
        assert!(zero((x + y) * (x - y) - (x.powi(2) - y * y)));
        assert!(zero(
            x.sin() * (y + 1.0) - y * x.sin() + -(3.0 * x.sin() - 2.0 * x.sin())
        ));
        assert!(!zero((x + y) * (x - y) - (x.powi(2) - y * y * 1.5)));
        // 0.1·3 is no float: 0.1·3·x − 0.30000000000000004·x is not known to be zero
        assert!(!zero((x * 0.1) * 3.0 - x * (0.1 * 3.0)));
    }
}
