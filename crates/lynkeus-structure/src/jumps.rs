//! Where expressions only seem to jump: in `sign(a)*a`, and in selections whose branches meet,
//! such as `if x < 0 then 0 else x^2`.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, Node, Op, Tape, Unary};

use crate::Region;

/// Products of more factors are left as they are.
const FACTORS: usize = 32;

/// The expressions with sign(a)·a written as |a|, the factors of a product in any order:
/// what the derivative of a·|a| has in it does not jump, though its factor sign(a) does.
pub(crate) fn without_removable_jumps(graph: &Graph, roots: &[Node]) -> Vec<Node> {
    let nodes = graph.reachable(roots);
    let has_sign = |&node: &Node| matches!(graph.op(node), Op::Unary(Unary::Sign, _));
    if !nodes.iter().any(has_sign) {
        return roots.to_vec();
    }
    let bent = nodes
        .iter()
        .filter_map(|&node| Some((node, bent(graph, node)?)));
    let bent: HashMap<Node, Node> = bent.collect();
    // what is rebuilt may hold products that are to be rebuilt in their turn
    let changed = graph.substitute(roots, &bent);
    match changed == roots {
        true => changed,
        false => without_removable_jumps(graph, &changed),
    }
}

/// A product with a sign and its argument among the factors, without that sign.
fn bent(graph: &Graph, node: Node) -> Option<Node> {
    if !matches!(graph.op(node), Op::Binary(Binary::Mul | Binary::Div, ..)) {
        return None;
    }
    let (factors, mut negative) = factors(graph, node)?;
    let (sign, partner, opposite) = factors.iter().enumerate().find_map(|(i, factor)| {
        let argument = match graph.op(factor.0) {
            Op::Unary(Unary::Sign, argument) if !factor.1 => argument,
            _ => return None,
        };
        let mut others = factors.iter().enumerate();
        others.find_map(|(j, other)| {
            let opposite = compared(graph, argument, other.0)?;
            (i != j && !other.1).then_some((i, j, opposite))
        })
    })?;
    let size = graph.unary(Unary::Abs, factors[partner].0);
    negative ^= opposite;
    let mut product = match negative {
        true => graph.unary(Unary::Neg, size),
        false => size,
    };
    let rest = factors.iter().enumerate();
    for (_, &(factor, below)) in rest.filter(|(i, _)| *i != sign && *i != partner) {
        let op = if below { Binary::Div } else { Binary::Mul };
        product = graph.binary(op, product, factor);
    }
    Some(product)
}

/// The factors of a product, each with whether it divides, and whether the product
/// changes their sign; none of a product with too many of them.
fn factors(graph: &Graph, product: Node) -> Option<(Vec<(Node, bool)>, bool)> {
    let (mut found, mut negative) = (vec![], false);
    let mut open = vec![(product, false)];
    while let Some((node, below)) = open.pop() {
        match graph.op(node) {
            Op::Binary(Binary::Mul, a, b) => open.extend([(b, below), (a, below)]),
            Op::Binary(Binary::Div, a, b) => open.extend([(b, !below), (a, below)]),
            Op::Unary(Unary::Neg, a) => {
                negative = !negative;
                open.push((a, below));
            }
            _ => found.push((node, below)),
        }
        if found.len() > FACTORS {
            return None;
        }
    }
    Some((found, negative))
}

/// Whether b is −a (true) or a (false); none where it is neither.
fn compared(graph: &Graph, a: Node, b: Node) -> Option<bool> {
    if a == b {
        return Some(false);
    }
    match (graph.op(a), graph.op(b)) {
        (Op::Unary(Unary::Neg, inner), _) if inner == b => Some(true),
        (_, Op::Unary(Unary::Neg, inner)) if inner == a => Some(true),
        (Op::Binary(Binary::Sub, p, q), Op::Binary(Binary::Sub, r, s)) if (p, q) == (s, r) => {
            Some(true)
        }
        _ => None,
    }
}

/// Whether both branches of a selection by an inequality p < q or p ≤ q have one value
/// where p = q. There p may be written as q, wherever the node p stands: the branches
/// then have to become one expression, one number on the whole region, or one sum: for the
/// last the branches must have values, which is asked of them anyway.
pub(crate) fn meets(graph: &Graph, node: Node, region: &Region) -> bool {
    let Op::Select(condition, a, b) = graph.op(node) else {
        return false;
    };
    let Some((p, q)) = equated(graph, condition) else {
        return false;
    };
    let images = [(p, q), (q, p)].into_iter().chain(differences(graph, p, q));
    images
        .filter(|(from, _)| !matches!(graph.op(*from), Op::Constant(_)))
        .any(|image| {
            let there = graph.substitute(&[a, b], &HashMap::from([image]));
            there[0] == there[1]
                || same_number(graph, &there, region)
                || are_one(graph, there[0], there[1])
        })
}

/// p and q of a condition that changes only where p = q.
fn equated(graph: &Graph, condition: Node) -> Option<(Node, Node)> {
    match graph.op(condition) {
        Op::Binary(Binary::Less | Binary::LessEq, p, q) => Some((p, q)),
        Op::Unary(Unary::Not, inner) => equated(graph, inner),
        _ => None,
    }
}

/// Where p = q, p − q and q − p are zero; and where r − s is zero, r is s.
fn differences(graph: &Graph, p: Node, q: Node) -> Vec<(Node, Node)> {
    let zero = graph.constant(0.0).node();
    let mut images = vec![
        (graph.binary(Binary::Sub, p, q), zero),
        (graph.binary(Binary::Sub, q, p), zero),
    ];
    for (difference, other) in [(p, q), (q, p)] {
        if let (Op::Binary(Binary::Sub, r, s), Some(0.0)) =
            (graph.op(difference), graph.constant_value(other))
        {
            images.extend([(r, s), (s, r), (graph.binary(Binary::Sub, s, r), zero)]);
        }
    }
    images
}

fn same_number(graph: &Graph, nodes: &[Node], region: &Region) -> bool {
    let used = region.restricted(&graph.symbols_of(nodes));
    let Ok(tape) = Tape::new(graph, &used.symbols(), nodes) else {
        return false;
    };
    let values = tape.eval_in(&Intervals, &used.cell());
    let number = |x: &Interval| x.is_point() && x.is_defined();
    number(&values[0]) && number(&values[1]) && values[0].lo() == values[1].lo()
}

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
pub(crate) fn are_one(graph: &Graph, a: Node, b: Node) -> bool {
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
