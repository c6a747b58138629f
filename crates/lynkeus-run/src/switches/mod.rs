//! Instants at which an expression jumps because of time alone.
//!
//! A relation, `floor` or `sign` whose argument depends on nothing but time is
//! constant between two switching instants. It is replaced by a *mode*: an extra
//! input, evaluated in the middle of a segment, so that both one-sided limits at
//! a switch are right and an integrator never steps across a jump. `abs`, `min`
//! and `max` of time have kinks, which are located too but need no mode.
//!
//! Switches are followed in the order in which they contain each other: between the
//! instants of those inside it, the argument of a switch is smooth. It is enclosed
//! by interval arithmetic, with its derivatives. A stretch of time on which the
//! enclosure stays on one side has no switch; one on which the function is proved
//! monotone, or falls into monotone parts because a higher derivative keeps its
//! sign, has its switches bisected to the last bit; any other is cut in two. So no
//! pulse is too short to be seen. What rounding errors hide, and what switches
//! too often, is refused by name.

mod effort;
mod extract;
mod indicator;
mod isolate;
mod timeline;

use lynkeus_expr::{Evaluator, Graph, MissingInput, Node, Tape};

use crate::Error;
use crate::snapshot::{Damaged, Persist, Walk};
use effort::Allowance;
use indicator::Indicator;
use timeline::Timeline;

/// Modes, kinks and how they are found.
#[derive(Clone, Debug)]
pub(crate) struct Switches {
    /// each after those that it reads
    indicators: Vec<Indicator>,
    /// the modes as functions of time alone
    values: Evaluator,
    /// what was found in the interval asked for last, as `indicators`
    timelines: Vec<Timeline>,
    /// what the intervals to come may cost
    allowance: Allowance,
}

/// Expressions with their modes taken out.
pub(crate) struct Extracted {
    pub roots: Vec<Node>,
    /// the symbol of each mode
    pub modes: Vec<Node>,
    pub switches: Switches,
}

impl Switches {
    /// Replaces what jumps with `time` in `roots` by modes.
    pub(crate) fn extract(
        graph: &Graph,
        time: Node,
        roots: &[Node],
    ) -> Result<Extracted, MissingInput> {
        extract::extract(graph, time, roots)
    }

    fn new(indicators: Vec<Indicator>, values: &Tape) -> Self {
        Self {
            timelines: vec![Timeline::default(); indicators.len()],
            indicators,
            values: values.evaluator(),
            allowance: Allowance::default(),
        }
    }

    /// Writes the modes' values at `t`.
    pub(crate) fn modes_at(&mut self, t: f64, modes: &mut [f64]) {
        if !modes.is_empty() {
            self.values.eval(&[t], modes);
        }
    }

    /// Whether there is nothing to find.
    pub(crate) fn is_empty(&self) -> bool {
        self.indicators.is_empty()
    }

    /// Appends the switching instants strictly inside (`from`, `to`).
    pub(crate) fn between(
        &mut self,
        from: f64,
        to: f64,
        times: &mut Vec<f64>,
    ) -> Result<(), Error> {
        if self.indicators.is_empty() {
            return Ok(());
        }
        let mut effort = self.allowance.effort(from, to);
        for (i, indicator) in self.indicators.iter_mut().enumerate() {
            let (before, rest) = self.timelines.split_at_mut(i);
            if let Some(timeline) = rest.first_mut() {
                indicator.follow(&mut effort, before, timeline)?;
                times.extend_from_slice(timeline.instants());
            }
        }
        self.allowance.pay(&effort);
        Ok(())
    }
}

impl Persist for Switches {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.allowance.walk(walk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Expr;

    fn instants(build: fn(Expr<'_>) -> Expr<'_>, from: f64, to: f64) -> Vec<f64> {
        let g = Graph::new();
        let time = g.symbol("time");
        let root = build(time).node();
        let mut extracted = Switches::extract(&g, time.node(), &[root]).unwrap();
        let mut times = vec![];
        extracted.switches.between(from, to, &mut times).unwrap();
        times.sort_unstable_by(f64::total_cmp);
        times
    }

    #[test]
    fn affine_relations_are_solved_to_the_last_bit() {
        fn relation(t: Expr<'_>) -> Expr<'_> {
            (20.0 - t * 2.0).less_eq(t * 3.0 + 10.0)
        }
        let found = instants(|t| relation(t) * 3.0, 0.0, 10.0);
        assert!(
            found.len() == 1 && (found[0] - 2.0).abs() <= f64::EPSILON,
            "{found:?}"
        );
        assert_eq!(instants(|t| relation(t) * 3.0, 2.0, 10.0), []);
        assert_eq!(instants(|t| (t * 0.5).floor(), 0.0, 6.0), [2.0, 4.0]);
        assert_eq!(instants(|t| (1.0 - t).sign(), 0.0, 6.0), [1.0]);
        assert_eq!(instants(|t| t.sin(), 0.0, 6.0), []);
    }

    #[test]
    fn kinks_are_stops_too() {
        assert_eq!(instants(|t| (t - 3.0).abs(), 0.0, 6.0), [3.0]);
        assert_eq!(
            instants(|t| (t / 5.0).min(t.graph().constant(0.5)), 0.0, 6.0),
            [2.5]
        );
    }

    #[test]
    fn other_relations_are_bisected_to_the_last_bit() {
        let found = instants(|t| t.sin().less(t.graph().constant(0.5)), 0.0, 7.0);
        let expected = [
            std::f64::consts::FRAC_PI_6,
            5.0 * std::f64::consts::FRAC_PI_6,
            13.0 * std::f64::consts::FRAC_PI_6,
        ];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 4e-15, "{found} {expected}");
        }
    }

    #[test]
    fn relations_of_states_are_left_alone() {
        let g = Graph::new();
        let [time, x] = ["time", "x"].map(|name| g.symbol(name));
        let root = (x.less(time) + x.floor()).node();
        let extracted = Switches::extract(&g, time.node(), &[root]).unwrap();
        assert_eq!((extracted.modes.len(), extracted.roots), (0, vec![root]));
    }

    #[test]
    fn modes_do_not_take_names_in_use() {
        let g = Graph::new();
        let time = g.symbol("time");
        let relation = time.less(g.constant(2.0));
        let taken = g.symbol("(time < 2)");
        let extracted = Switches::extract(&g, time.node(), &[(taken + relation).node()]).unwrap();
        assert_ne!(extracted.modes[0], taken.node());
        let expected = (taken + g.expr(extracted.modes[0])).node();
        assert_eq!(extracted.roots, [expected]);
    }
}
