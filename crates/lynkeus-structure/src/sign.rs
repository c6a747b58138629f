//! Does an expression keep its sign on the box?

mod witness;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape};

use crate::words::short;
use crate::{Finding, Range, Region, Regularity, Side, Verdict, range, range_within};
use witness::witness;

/// Cells examined per end to see whether there is a bound.
const GLANCE: usize = 20;

/// The verdict on a sign, with the bounds that go with it.
#[derive(Clone, Debug)]
pub struct Sign {
    /// "never zero, one sign"
    pub finding: Finding,
    /// +1 or −1: the sign where it is proved, else that of the first sample
    pub sign: f64,
    /// rigorous bounds of the absolute value: (α₁, α₂); α₂ may be infinite
    pub bounds: (f64, f64),
}

/// Decides whether `node` has one sign, zero excluded, on the region.
///
/// Refuted with two points of opposite sign and, where one can move from one to
/// the other inside the region, the zero between them.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn keeps_sign(graph: &Graph, node: Node, region: &Region) -> Result<Sign, MissingInput> {
    let found = range(graph, node, region)?;
    let (low, high) = (found.enclosure.lo(), found.enclosure.hi());
    let expression = graph.render(node, 80);
    let (verdict, detail) = if low > 0.0 || high < 0.0 {
        let detail = format!("{expression} lies in [{}, {}]", short(low), short(high));
        (Verdict::Proved, detail)
    } else if let Some(witness) = witness(graph, node, region, &found)? {
        (
            Verdict::Refuted(witness),
            format!("{expression} can vanish or change its sign"),
        )
    } else if let Some(trouble) = Regularity::of(graph, &[node], &[], region)?.trouble() {
        let place = trouble.place().to_vec();
        (Verdict::Undecided(place), trouble.to_string())
    } else {
        let detail = format!(
            "{expression} lies in [{}, {}] as far as can be proved{}",
            short(low),
            short(high),
            undeclared(&found)
        );
        (Verdict::Undecided(found.weakest.clone()), detail)
    };
    let sample = found.highest.as_ref().map_or(1.0, |p| p.value);
    let sign = if high < 0.0 || (low <= 0.0 && sample < 0.0) {
        -1.0
    } else {
        1.0
    };
    let bounds = if low > 0.0 {
        (low, high)
    } else if high < 0.0 {
        (-high, -low)
    } else {
        (0.0, high.max(-low))
    };
    Ok(Sign {
        finding: Finding { verdict, detail },
        sign,
        bounds,
    })
}

/// Whether the expression has a value everywhere on the region and a bound, by one interval
/// evaluation or a few.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub fn bounded(graph: &Graph, node: Node, region: &Region) -> Result<bool, MissingInput> {
    let found = range_within(graph, node, region, GLANCE)?.enclosure;
    Ok(found.is_defined() && found.lo().is_finite() && found.hi().is_finite())
}

/// Which of the expressions the whole box proves [bounded], without halving it: one
/// evaluation of what they share.
///
/// # Errors
/// [`MissingInput`] where one depends on a symbol outside the region.
pub fn bounded_at_once(
    graph: &Graph,
    nodes: &[Node],
    region: &Region,
) -> Result<Vec<bool>, MissingInput> {
    let tape = Tape::new(graph, &region.symbols(), nodes)?;
    let values = tape.eval_in(&Intervals, &region.cell());
    let is_bounded = |x: &Interval| x.is_defined() && x.magnitude().is_finite();
    Ok(values.iter().map(is_bounded).collect())
}

/// A hint where the box has no declared end.
fn undeclared(found: &Range) -> String {
    let open = |side: &&Side| side.min.is_infinite() || side.max.is_infinite();
    let names: Vec<&str> = found
        .weakest
        .iter()
        .filter(open)
        .map(|side| side.name.as_str())
        .collect();
    match names.is_empty() {
        true => String::new(),
        false => format!("; declare min and max of {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dimension, Point};
    use lynkeus_expr::Expr;

    fn side(x: Expr<'_>, min: f64, max: f64, integer: bool) -> Dimension {
        let name = x.graph().symbol_name(x.node()).unwrap();
        Dimension {
            name,
            symbol: x.node(),
            min,
            max,
            integer,
        }
    }

    fn decide(f: Expr<'_>, sides: Vec<Dimension>) -> Sign {
        keeps_sign(f.graph(), f.node(), &Region { dimensions: sides }).unwrap()
    }

    #[test]
    fn a_root_of_a_tank_keeps_its_sign() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = decide(-0.07 / (2.0 * x.sqrt()), vec![side(x, 0.05, 10.0, false)]);
        assert_eq!(sign.finding.verdict, Verdict::Proved);
        assert_eq!(sign.sign, -1.0);
        let (low, high) = (0.035 / 10f64.sqrt(), 0.035 / 0.05f64.sqrt());
        assert!(sign.bounds.0 <= low && sign.bounds.0 > low * 0.998);
        assert!(sign.bounds.1 >= high && sign.bounds.1 < high * 1.002);
    }

    #[test]
    fn a_zero_inside_is_the_witness() {
        let g = Graph::new();
        let x = g.symbol("x");
        for (min, max) in [(-1.0, 1.0), (-1.0, 2.0), (-0.3, 7.0)] {
            let sign = decide(2.0 * x, vec![side(x, min, max, false)]);
            let Verdict::Refuted(witness) = sign.finding.verdict else {
                panic!()
            };
            assert!(witness.points[0].coordinates[0].value.abs() < 1e-9);
        }
    }

    #[test]
    fn a_zero_on_the_edge_counts() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = decide(x, vec![side(x, 0.0, 1.0, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Refuted(_)));
    }

    /// u = 2s − 1 with a whole s in {0, 1}: never zero, yet of both signs.
    #[test]
    fn a_set_of_two_values_has_no_zero_between() {
        let g = Graph::new();
        let s = g.symbol("s");
        let sign = decide(2.0 * s - 1.0, vec![side(s, 0.0, 1.0, true)]);
        let Verdict::Refuted(witness) = sign.finding.verdict else {
            panic!()
        };
        let values: Vec<f64> = witness.points.iter().map(|p| p.value).collect();
        assert_eq!(values, [-1.0, 1.0]);
    }

    /// The slope of |x| is never zero, though sign(0) is; nor does 1/x pass zero.
    #[test]
    fn a_jump_is_no_zero() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sign = g.expr(g.unary(lynkeus_expr::Unary::Sign, x.node()));
        for f in [sign, 2.0 * sign + x / 10.0, 1.0 / x] {
            let sign = decide(f, vec![side(x, -1.0, 1.0, false)]);
            if let Verdict::Refuted(witness) = sign.finding.verdict {
                assert_eq!(witness.zero(), None);
            }
        }
        let sign = decide(sign * x - 0.5, vec![side(x, -1.0, 1.0, false)]);
        let Verdict::Refuted(witness) = sign.finding.verdict else {
            panic!()
        };
        let zero = witness.zero().unwrap().coordinates[0].value;
        assert!((zero.abs() - 0.5).abs() < 1e-9, "{zero}");
    }

    /// No witness at the end of the floating-point numbers.
    #[test]
    fn witnesses_are_within_reach() {
        let g = Graph::new();
        let x = g.symbol("x");
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        for f in [x, x * x * x - 7.0, x.exp() - 2.0, 1.0 - x * x] {
            let sign = decide(f, vec![side(x, all.0, all.1, false)]);
            let Verdict::Refuted(witness) = &sign.finding.verdict else {
                panic!("{sign:?}")
            };
            let far = |p: &Point| p.coordinates[0].value.abs() > 1e10;
            assert!(!witness.points.iter().any(far), "{witness}");
        }
        // of one sign as far as anyone looks
        let sign = decide(x + 1e30, vec![side(x, all.0, all.1, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Undecided(_)));
        let text = format!("{} {}", sign.finding.verdict, sign.finding.detail);
        assert!(
            !text.contains("e30") || text.contains("declare min and max of x"),
            "{text}"
        );
        assert!(!text.contains("e307"), "{text}");
    }

    #[test]
    fn an_undeclared_box_is_undecided_and_says_what_to_declare() {
        let g = Graph::new();
        let x = g.symbol("x");
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let sign = decide(x.exp(), vec![side(x, all.0, all.1, false)]);
        assert!(matches!(sign.finding.verdict, Verdict::Undecided(_)));
        assert!(
            sign.finding.detail.contains("declare min and max of x"),
            "{}",
            sign.finding.detail
        );
    }
}
