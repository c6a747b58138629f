//! Expressions as sums of products: whether one is zero, or two are the same, wherever they have values.
//!
//! Exact: a sum or product of coefficients that does not fit into a float is not carried out, so that rounding never
//! makes a zero, and "yes" is a proof. "No" may also mean "not known".

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

/// Sums of more terms are not multiplied out, nor added in search of a zero.
const MAX_TERMS: usize = 200;
/// Higher powers are not multiplied out.
const MAX_POWER: i32 = 8;

/// What products are made of.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Factor {
    /// a node that is taken whole
    Node(Node),
    /// a sum whose multiple would have to be rounded, by its place
    Sum(usize),
    /// a sum divided by a node
    Quotient(usize, Node),
}

/// A product of powers.
type Product = Vec<(Factor, u32)>;

/// The number, never zero, that each product is multiplied by.
type Sum = BTreeMap<Product, f64>;

/// Whether the expression is zero wherever it is defined.
pub(crate) fn is_zero(graph: &Graph, node: Node) -> bool {
    if let Some(value) = graph.constant_value(node) {
        return value == 0.0;
    }
    if !matches!(
        graph.op(node),
        Op::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..) | Op::Unary(Unary::Neg, _)
    ) {
        return false;
    }
    let sums = Sums::of(graph, &[node], MAX_TERMS);
    sums.known.get(&node).is_some_and(BTreeMap::is_empty)
}

/// Whether two expressions are the same sum wherever both have values: 0·x is 0 there.
pub(crate) fn are_one(graph: &Graph, a: Node, b: Node) -> bool {
    let sums = Sums::of(graph, &[a, b], usize::MAX);
    let one = sums.known.get(&a);
    one.is_some() && one == sums.known.get(&b)
}

/// What nodes are as sums; none are known that come after the end of the graph's budget.
struct Sums {
    known: HashMap<Node, Sum>,
    /// places of sums that are factors, the first number positive
    places: HashMap<Vec<(Product, u64)>, usize>,
    /// terms that a sum may have
    most: usize,
}

impl Sums {
    fn of(graph: &Graph, roots: &[Node], most: usize) -> Self {
        let mut sums = Self {
            known: HashMap::new(),
            places: HashMap::new(),
            most,
        };
        for node in graph.reachable(roots) {
            if graph.spent().is_some() {
                break;
            }
            let spelled = sums.spelled(graph.op(node));
            let sum = spelled.unwrap_or_else(|| multiple(vec![(Factor::Node(node), 1)], 1.0));
            sums.known.insert(node, sum);
        }
        sums
    }

    /// The sum of an operation by those of its arguments; none where it is a factor of its own.
    fn spelled(&mut self, op: Op) -> Option<Sum> {
        let of = |node: Node| self.known.get(&node);
        match op {
            Op::Constant(value) => Some(multiple(vec![], value)),
            Op::Unary(Unary::Neg, a) => scaled(of(a)?, -1.0),
            Op::Binary(Binary::Add, a, b) => self.limited(added(of(a)?, of(b)?)?),
            Op::Binary(Binary::Sub, a, b) => self.limited(added(of(a)?, &scaled(of(b)?, -1.0)?)?),
            Op::Binary(Binary::Mul, a, b) => {
                let (a, b) = (of(a)?.clone(), of(b)?.clone());
                multiplied(&a, &b).or_else(|| match (number(&a), number(&b)) {
                    (Some(factor), _) => Some(self.times(&b, factor)),
                    (_, Some(factor)) => Some(self.times(&a, factor)),
                    _ => None,
                })
            }
            Op::Powi(a, n @ 1..=MAX_POWER) => {
                let base = of(a)?;
                (1..n).try_fold(base.clone(), |power, _| multiplied(&power, base))
            }
            Op::Binary(Binary::Div, a, b) => {
                let above = of(a)?.clone();
                let Some((place, sign)) = self.place(&above) else {
                    return Some(Sum::new());
                };
                Some(multiple(vec![(Factor::Quotient(place, b), 1)], sign))
            }
            _ => None,
        }
    }

    fn limited(&self, sum: Sum) -> Option<Sum> {
        (sum.len() <= self.most).then_some(sum)
    }

    /// The multiple of a sum as a whole, as its numbers would have to be rounded.
    fn times(&mut self, sum: &Sum, factor: f64) -> Sum {
        match self.place(sum) {
            Some((place, sign)) => multiple(vec![(Factor::Sum(place), 1)], sign * factor),
            None => Sum::new(),
        }
    }

    /// The place of a sum or of its opposite, with 1 or −1; none of zero.
    fn place(&mut self, sum: &Sum) -> Option<(usize, f64)> {
        let sign = sum.values().next()?.signum();
        let numbers = sum
            .iter()
            .map(|(term, x)| (term.clone(), (sign * x).to_bits()));
        let next = self.places.len();
        let place = *self.places.entry(numbers.collect()).or_insert(next);
        Some((place, sign))
    }
}

fn multiple(product: Product, number: f64) -> Sum {
    let one = (number != 0.0).then_some((product, number));
    one.into_iter().collect()
}

/// The sum, where it is a number.
fn number(sum: &Sum) -> Option<f64> {
    match sum.len() {
        0 => Some(0.0),
        1 => sum.get(&vec![]).copied(),
        _ => None,
    }
}

fn scaled(sum: &Sum, factor: f64) -> Option<Sum> {
    multiplied(sum, &multiple(vec![], factor))
}

fn added(a: &Sum, b: &Sum) -> Option<Sum> {
    let mut all = a.clone();
    for (product, &number) in b {
        add(&mut all, product.clone(), number)?;
    }
    Some(all)
}

fn add(to: &mut Sum, product: Product, number: f64) -> Option<()> {
    let sum = exact_sum(to.remove(&product).unwrap_or(0.0), number)?;
    to.extend(multiple(product, sum));
    Some(())
}

/// None where that would be too many terms, or rounded.
fn multiplied(a: &Sum, b: &Sum) -> Option<Sum> {
    if a.len().min(b.len()) > 1 && a.len() * b.len() > MAX_TERMS {
        return None;
    }
    let mut all = Sum::new();
    for (m, &c) in a {
        for (n, &d) in b {
            let mut powers: BTreeMap<Factor, u32> = m.iter().copied().collect();
            for &(factor, power) in n {
                *powers.entry(factor).or_default() += power;
            }
            add(&mut all, powers.into_iter().collect(), exact_product(c, d)?)?;
        }
    }
    Some(all)
}

/// a·b, where it has no rounding error.
fn exact_product(a: f64, b: f64) -> Option<f64> {
    let value = a * b;
    let exact = a == 0.0 || b == 0.0 || value.is_normal() && a.mul_add(b, -value) == 0.0;
    // the error of a product that is small enough underflows itself
    let seen = value == 0.0 || value.abs() > f64::MIN_POSITIVE / f64::EPSILON;
    (exact && seen).then_some(value)
}

/// a + b, where it has no rounding error (Knuth's error of a sum).
fn exact_sum(a: f64, b: f64) -> Option<f64> {
    let value = a + b;
    let part = value - a;
    let error = (a - (value - part)) + (b - part);
    (value.is_finite() && error == 0.0).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Expr;

    #[test]
    fn identities_are_seen_and_near_misses_are_not() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let zero = |e: Expr<'_>| is_zero(&g, e.node());
        assert!(zero((x + y) * (x - y) - (x.powi(2) - y * y)));
        assert!(zero(
            x.sin() * (y + 1.0) - y * x.sin() + -(3.0 * x.sin() - 2.0 * x.sin())
        ));
        assert!(!zero((x + y) * (x - y) - (x.powi(2) - y * y * 1.5)));
        // 0.1·3 is no float: 0.1·3·x − 0.30000000000000004·x is not known to be zero
        assert!(!zero((x * 0.1) * 3.0 - x * (0.1 * 3.0)));
    }

    #[test]
    fn what_cancels_without_rounding_is_one() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let one = |a: Expr<'_>, b: Expr<'_>| are_one(&g, a.node(), b.node());
        assert!(one(x / 0.3 + x / 0.3 - 2.0 * (x / 0.3), x * 0.0));
        assert!(one(0.7 * (x + 0.0 * y.sin()), 0.7 * x));
        assert!(one(-((-x) / 0.3), x / 0.3));
        // the sums in them cannot be multiplied out without rounding
        assert!(one(-(0.7 * (0.8 - x)), 0.7 * (x - 0.8)));
        assert!(one((x - y) / 0.3, -((y - x) / 0.3) + 0.0 * x));
        assert!(!one(0.7 * (x - 0.8), 0.7 * (x - 0.9)));
        assert!(one(x * y - (y * x) + 3.0, g.constant(3.0)));
        assert!(!one(x / 0.3 + x / 0.3, 3.0 * (x / 0.3)));
        assert!(!one(x, y));
        assert!(!one(x + 1.0, x));
        // true of real numbers, but 0.1 + 0.2 is rounded: not said
        assert!(!one(0.1 * x + 0.2 * x, (0.1 + 0.2) * x));
        assert!(!one(0.1 * (3.0 * x), (0.1 * 3.0) * x));
        assert!(!one(x / x, g.constant(1.0)));
    }
}
