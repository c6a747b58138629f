//! Is an expression identically zero? Decided on the box by intervals, or wherever it is defined by expanding it into
//! monomials.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Tape, Unary};

use crate::region::{inside, spread};
use crate::{Point, Region, Verdict, Witness};

/// Points tried beside those on the edges of the box.
const POINTS: usize = 12;

/// Decides whether `node` is zero on the whole region. Refuted by a point where the value
/// cannot be a rounding error; undecided where it may be zero at every point tried.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn vanishes(graph: &Graph, node: Node, region: &Region) -> Result<Verdict, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let tape = Tape::new(graph, &region.symbols(), &[node])?;
    let mut bounds = tape.evaluator_in(Intervals);
    let mut value = |cell: &[Interval]| {
        let mut values = [Interval::ENTIRE];
        bounds.eval(cell, &mut values);
        values[0]
    };
    let whole = region.cell();
    let enclosure = value(&whole);
    if enclosure.lo() == 0.0 && enclosure.hi() == 0.0 {
        return Ok(Verdict::Proved);
    }
    let mut points: Vec<Vec<f64>> = (0..POINTS).map(|p| generic(&region, p)).collect();
    points.extend(region.samples(&whole));
    for point in points {
        if graph.spent().is_some() {
            break;
        }
        let cell: Vec<Interval> = point.iter().map(|&x| Interval::point(x)).collect();
        let enclosure = value(&cell);
        let sure = enclosure.is_positive() || enclosure.is_negative();
        if sure && enclosure.lo().is_finite() && enclosure.hi().is_finite() {
            return Ok(Verdict::Refuted(Witness::from(Point {
                coordinates: region.coordinates(&point),
                value: enclosure.lo() + (enclosure.hi() - enclosure.lo()) / 2.0,
            })));
        }
    }
    Ok(Verdict::open())
}

/// A point inside the region on no particular surface.
fn generic(region: &Region, point: usize) -> Vec<f64> {
    let sides = region.dimensions.iter().enumerate();
    let coordinate = |(i, d): (usize, &crate::Dimension)| {
        let x = inside(d.min, d.max, spread(point, i));
        if d.integer { x.round() } else { x }
    };
    sides.map(coordinate).collect()
}

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
pub fn is_zero(graph: &Graph, node: Node) -> bool {
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
    use crate::Dimension;

    #[test]
    fn zero_everywhere_somewhere_and_perhaps() {
        let g = Graph::new();
        let x = g.symbol("x");
        let region = Region {
            dimensions: vec![Dimension {
                name: "x".into(),
                symbol: x.node(),
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
                integer: false,
            }],
        };
        let decide = |node| vanishes(&g, node, &region).unwrap();
        assert_eq!(decide((0.0 * x).node()), Verdict::Proved);
        // zero at the middle of the box, which is not enough
        assert!(matches!(decide((x * x).node()), Verdict::Refuted(_)));
        let one = x.sin().powi(2) + x.cos().powi(2) - 1.0;
        assert_eq!(decide(one.node()), Verdict::open());
    }

    #[test]
    fn identities_are_seen_and_near_misses_are_not() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let zero = |e: lynkeus_expr::Expr<'_>| is_zero(&g, e.node());
        assert!(zero((x + y) * (x - y) - (x.powi(2) - y * y)));
        assert!(zero(
            x.sin() * (y + 1.0) - y * x.sin() + -(3.0 * x.sin() - 2.0 * x.sin())
        ));
        assert!(!zero((x + y) * (x - y) - (x.powi(2) - y * y * 1.5)));
        // 0.1·3 is no float: 0.1·3·x − 0.30000000000000004·x is not known to be zero
        assert!(!zero((x * 0.1) * 3.0 - x * (0.1 * 3.0)));
    }
}
