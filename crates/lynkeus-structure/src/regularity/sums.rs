//! Expressions as exact sums of multiples of other ones, to see that two are one function.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

/// What a sum has multiples of.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Term {
    /// 1
    One,
    /// a node that is no sum
    Node(Node),
    /// a sum whose multiple would have to be rounded, by its place
    Sum(usize),
    /// a sum divided by a node
    Quotient(usize, Node),
}

/// Σ number·term, without zeros.
type Sum = BTreeMap<Term, f64>;

/// Whether two expressions are the same sum wherever both have values: 0·x is 0 there. Numbers are
/// added and multiplied without rounding or not at all, so that yes is a proof; no is none.
pub(super) fn are_one(graph: &Graph, a: Node, b: Node) -> bool {
    let mut sums = Sums::default();
    for node in graph.reachable(&[a, b]) {
        let spelled = sums.spelled(graph.op(node));
        let sum = spelled.unwrap_or_else(|| multiple(Term::Node(node), 1.0));
        sums.known.insert(node, sum);
    }
    sums.known.get(&a) == sums.known.get(&b)
}

#[derive(Default)]
struct Sums {
    known: HashMap<Node, Sum>,
    /// places of sums that are terms, the first number positive
    places: HashMap<Vec<(Term, u64)>, usize>,
}

impl Sums {
    /// The sum of an operation by those of its arguments; none where it is a term of its own.
    fn spelled(&mut self, op: Op) -> Option<Sum> {
        let of = |node: Node| self.known.get(&node);
        match op {
            Op::Constant(value) => Some(multiple(Term::One, value)),
            Op::Unary(Unary::Neg, a) => scaled(of(a)?, -1.0),
            Op::Binary(Binary::Add, a, b) => added(of(a)?, of(b)?),
            Op::Binary(Binary::Sub, a, b) => added(of(a)?, &scaled(of(b)?, -1.0)?),
            Op::Binary(Binary::Mul, a, b) => {
                let (a, b) = (of(a)?.clone(), of(b)?.clone());
                match (number(&a), number(&b)) {
                    (Some(factor), _) => Some(self.times(&b, factor)),
                    (_, Some(factor)) => Some(self.times(&a, factor)),
                    _ => None,
                }
            }
            Op::Binary(Binary::Div, a, b) => {
                let above = of(a)?.clone();
                let Some((place, sign)) = self.place(&above) else {
                    return Some(Sum::new());
                };
                Some(multiple(Term::Quotient(place, b), sign))
            }
            _ => None,
        }
    }

    /// The multiple of a sum, or of the sum as a whole where numbers would have to be rounded.
    fn times(&mut self, sum: &Sum, factor: f64) -> Sum {
        let exact = scaled(sum, factor);
        exact.unwrap_or_else(|| match self.place(sum) {
            Some((place, sign)) => multiple(Term::Sum(place), sign * factor),
            None => Sum::new(),
        })
    }

    /// The place of a sum or of its opposite, with 1 or −1; none of zero.
    fn place(&mut self, sum: &Sum) -> Option<(usize, f64)> {
        let sign = sum.values().next()?.signum();
        let numbers = sum.iter().map(|(&term, x)| (term, (sign * x).to_bits()));
        let next = self.places.len();
        let place = *self.places.entry(numbers.collect()).or_insert(next);
        Some((place, sign))
    }
}

fn multiple(term: Term, factor: f64) -> Sum {
    let one = (factor != 0.0).then_some((term, factor));
    one.into_iter().collect()
}

/// The sum, where it is a number.
fn number(sum: &Sum) -> Option<f64> {
    match sum.len() {
        0 => Some(0.0),
        1 => sum.get(&Term::One).copied(),
        _ => None,
    }
}

fn scaled(sum: &Sum, factor: f64) -> Option<Sum> {
    let mut all = Sum::new();
    for (&term, &one) in sum {
        all.extend(multiple(term, product(one, factor)?));
    }
    Some(all)
}

fn added(a: &Sum, b: &Sum) -> Option<Sum> {
    let mut all = a.clone();
    for (&term, &more) in b {
        let sum = total(all.remove(&term).unwrap_or(0.0), more)?;
        all.extend(multiple(term, sum));
    }
    Some(all)
}

/// a·b, where it has no rounding error.
fn product(a: f64, b: f64) -> Option<f64> {
    let value = a * b;
    let exact = a == 0.0 || b == 0.0 || value.is_normal() && a.mul_add(b, -value) == 0.0;
    // the error of a product that is small enough underflows itself
    let seen = value == 0.0 || value.abs() > f64::MIN_POSITIVE / f64::EPSILON;
    (exact && seen).then_some(value)
}

/// a + b, where it has no rounding error (Knuth's error of a sum).
fn total(a: f64, b: f64) -> Option<f64> {
    let value = a + b;
    let part = value - a;
    let error = (a - (value - part)) + (b - part);
    (value.is_finite() && error == 0.0).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cancels_without_rounding_is_one() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let one =
            |a: lynkeus_expr::Expr<'_>, b: lynkeus_expr::Expr<'_>| are_one(&g, a.node(), b.node());
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
