//! Instants at which an expression jumps because of time alone.
//!
//! A relation, `floor` or `sign` whose argument depends on nothing but time is
//! constant between two switching instants. It is replaced by a *mode*: an extra
//! input, evaluated in the middle of a segment, so that both one-sided limits at
//! a switch are right and an integrator never steps across a jump. `abs`, `min`
//! and `max` of time have kinks, which are located too but need no mode.
//!
//! Relations affine in time (`time < 20`, `floor(time/5)`) switch at instants
//! that are solved for; others (`sin(3*time) > 0.5`) are sampled at 24 points of
//! each interval and bisected to the last bit, so a pulse shorter than a
//! twenty-fourth of the interval (the output step of a simulation) can be missed.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Evaluator, Graph, MissingInput, Node, Op, Tape, Unary};

use crate::Error;

/// Samples of an interval among which a mode may change.
const SAMPLES: usize = 24;

/// Switching instants allowed in one interval.
const LIMIT: usize = 10_000;

/// How the switching instants of one indicator are found.
#[derive(Clone, Copy, Debug)]
enum Detector {
    /// it is constant
    Never,
    /// the only zero of an affine function
    Zero(f64),
    /// slope·t + offset passes an integer
    Integers { slope: f64, offset: f64 },
    /// the indicator's value changes
    Sampled,
}

/// Modes, kinks and their detectors.
#[derive(Clone, Debug)]
pub(crate) struct Switches {
    detectors: Vec<Detector>,
    /// the first indicators are the modes
    modes: usize,
    indicators: Evaluator,
    before: Vec<f64>,
    after: Vec<f64>,
    middle: Vec<f64>,
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
        let of_time = functions_of_time(graph, time, roots);
        let (jumps, kinks) = jumps_and_kinks(graph, &of_time, roots);
        let affine = affine_in_time(graph, time, &of_time);
        let modes = mode_symbols(graph, roots, &jumps);
        let map: HashMap<Node, Node> = modes.iter().copied().collect();
        let both = jumps.iter().chain(&kinks);
        let detectors = both.clone().map(|&node| detector(graph, node, &affine));
        let detectors = detectors.collect();
        let changes: Vec<Node> = both.map(|&node| indicator(graph, node)).collect();
        let tape = Tape::new(graph, &[time], &changes)?;
        let count = changes.len();
        Ok(Extracted {
            roots: graph.substitute(roots, &map),
            modes: modes.iter().map(|&(_, symbol)| symbol).collect(),
            switches: Self {
                detectors,
                modes: modes.len(),
                indicators: tape.evaluator(),
                before: vec![0.0; count],
                after: vec![0.0; count],
                middle: vec![0.0; count],
            },
        })
    }

    /// Writes the modes' values at `t`.
    pub(crate) fn modes_at(&mut self, t: f64, modes: &mut [f64]) {
        if self.modes > 0 {
            self.indicators.eval(&[t], &mut self.middle);
            modes.copy_from_slice(&self.middle[..self.modes]);
        }
    }

    /// Appends the switching instants strictly inside (`from`, `to`).
    pub(crate) fn between(
        &mut self,
        from: f64,
        to: f64,
        times: &mut Vec<f64>,
    ) -> Result<(), Error> {
        if self.detectors.is_empty() {
            return Ok(());
        }
        let limit = times.len() + LIMIT;
        for detector in &self.detectors {
            solved(*detector, from, to, limit, times);
        }
        self.sampled(from, to, limit, times);
        if times.len() >= limit {
            let limit = LIMIT;
            return Err(Error::TooManySwitches { from, to, limit });
        }
        Ok(())
    }

    fn sampled(&mut self, from: f64, to: f64, limit: usize, times: &mut Vec<f64>) {
        let sampled = |d: &Detector| matches!(d, Detector::Sampled);
        if !self.detectors.iter().any(sampled) {
            return;
        }
        // strictly inside: at a switch itself the mode may be that of either side
        let mut left = from.next_up();
        self.indicators.eval(&[left], &mut self.before);
        for sample in 1..=SAMPLES {
            let end = from + (to - from) * sample as f64 / SAMPLES as f64;
            let right = end.min(to.next_down());
            if right <= left {
                continue;
            }
            self.indicators.eval(&[right], &mut self.after);
            while self.differ() && times.len() < limit {
                left = self.bisect(left, right);
                times.push(left);
                self.indicators.eval(&[left], &mut self.before);
            }
            left = right;
            std::mem::swap(&mut self.before, &mut self.after);
        }
    }

    fn differ(&self) -> bool {
        changed(&self.detectors, &self.before, &self.after)
    }

    /// The first float after a change somewhere in (`left`, `right`].
    fn bisect(&mut self, mut left: f64, mut right: f64) -> f64 {
        loop {
            let middle = left + 0.5 * (right - left);
            if middle <= left || middle >= right {
                return right;
            }
            self.indicators.eval(&[middle], &mut self.middle);
            if changed(&self.detectors, &self.before, &self.middle) {
                right = middle;
            } else {
                left = middle;
            }
        }
    }
}

/// Whether a sampled indicator differs; NaN equals NaN here.
fn changed(detectors: &[Detector], before: &[f64], after: &[f64]) -> bool {
    let pairs = before.iter().zip(after);
    detectors.iter().zip(pairs).any(|(detector, (a, b))| {
        matches!(detector, Detector::Sampled) && a != b && !(a.is_nan() && b.is_nan())
    })
}

/// Appends the instants of a detector that needs no sampling.
fn solved(detector: Detector, from: f64, to: f64, limit: usize, times: &mut Vec<f64>) {
    match detector {
        Detector::Zero(t) if from < t && t < to => times.push(t),
        Detector::Never | Detector::Zero(_) | Detector::Sampled => {}
        Detector::Integers { slope, offset } => {
            let (a, b) = (slope * from + offset, slope * to + offset);
            let mut level = a.min(b).floor();
            let last = a.max(b).ceil();
            while level <= last && times.len() < limit {
                let t = (level - offset) / slope;
                if from < t && t < to {
                    times.push(t);
                }
                level += 1.0;
            }
        }
    }
}

/// Nodes whose value is a function of time alone: true where time is used,
/// false for constants.
fn functions_of_time(graph: &Graph, time: Node, roots: &[Node]) -> HashMap<Node, bool> {
    let mut uses: HashMap<Node, bool> = HashMap::new();
    for node in graph.reachable(roots) {
        if node == time {
            uses.insert(node, true);
            continue;
        }
        if let Op::Symbol(_) = graph.op(node) {
            continue;
        }
        let arguments = graph.arguments(node);
        let known: Option<Vec<bool>> = arguments.iter().map(|a| uses.get(a).copied()).collect();
        if let Some(known) = known {
            uses.insert(node, known.contains(&true));
        }
    }
    uses
}

/// A fresh symbol for each jump, named as the jump reads, for messages.
fn mode_symbols(graph: &Graph, roots: &[Node], jumps: &[Node]) -> Vec<(Node, Node)> {
    let symbols = graph.symbols_of(roots);
    let mut taken: HashSet<String> = symbols
        .iter()
        .filter_map(|&symbol| graph.symbol_name(symbol))
        .collect();
    let mut fresh = |&jump: &Node| {
        let mut name = format!("({})", graph.render(jump, 80));
        while !taken.insert(name.clone()) {
            name.push('\'');
        }
        (jump, graph.symbol(&name).node())
    };
    jumps.iter().map(&mut fresh).collect()
}

/// Nodes that jump with time, and nodes that have kinks.
fn jumps_and_kinks(
    graph: &Graph,
    of_time: &HashMap<Node, bool>,
    roots: &[Node],
) -> (Vec<Node>, Vec<Node>) {
    let (mut jumps, mut kinks) = (vec![], vec![]);
    for node in graph.reachable(roots) {
        if of_time.get(&node) != Some(&true) {
            continue;
        }
        match graph.op(node) {
            Op::Unary(Unary::Floor | Unary::Sign, _)
            | Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, ..) => jumps.push(node),
            Op::Unary(Unary::Abs, _) | Op::Binary(Binary::Min | Binary::Max, ..) => {
                kinks.push(node);
            }
            _ => {}
        }
    }
    (jumps, kinks)
}

/// What changes at a switch: the node itself for a jump, the side for a kink.
fn indicator(graph: &Graph, node: Node) -> Node {
    match graph.op(node) {
        Op::Unary(Unary::Abs, a) => graph.unary(Unary::Sign, a),
        Op::Binary(Binary::Min | Binary::Max, a, b) => graph.binary(Binary::Less, a, b),
        _ => node,
    }
}

/// (slope, offset) of the nodes that are affine in time.
fn affine_in_time(
    graph: &Graph,
    time: Node,
    of_time: &HashMap<Node, bool>,
) -> HashMap<Node, (f64, f64)> {
    let mut nodes: Vec<Node> = of_time.keys().copied().collect();
    nodes.sort_unstable();
    let mut affine: HashMap<Node, (f64, f64)> = HashMap::new();
    for node in nodes {
        let of = |n: Node| affine.get(&n).copied();
        let found = match graph.op(node) {
            _ if node == time => Some((1.0, 0.0)),
            Op::Constant(value) => Some((0.0, value)),
            Op::Unary(Unary::Neg, a) => of(a).map(|(s, o)| (-s, -o)),
            Op::Binary(op, a, b) => of(a).zip(of(b)).and_then(|(a, b)| affine_binary(op, a, b)),
            _ => None,
        };
        if let Some(line) = found {
            affine.insert(node, line);
        }
    }
    affine
}

fn affine_binary(op: Binary, a: (f64, f64), b: (f64, f64)) -> Option<(f64, f64)> {
    match op {
        Binary::Add => Some((a.0 + b.0, a.1 + b.1)),
        Binary::Sub => Some((a.0 - b.0, a.1 - b.1)),
        Binary::Mul if a.0 == 0.0 => Some((a.1 * b.0, a.1 * b.1)),
        Binary::Mul if b.0 == 0.0 => Some((a.0 * b.1, a.1 * b.1)),
        Binary::Div if b.0 == 0.0 => Some((a.0 / b.1, a.1 / b.1)),
        _ => None,
    }
}

/// How to find the switches of a jump or kink.
fn detector(graph: &Graph, node: Node, affine: &HashMap<Node, (f64, f64)>) -> Detector {
    let line = match graph.op(node) {
        Op::Unary(_, a) => affine.get(&a).copied(),
        Op::Binary(_, a, b) => affine
            .get(&a)
            .zip(affine.get(&b))
            .map(|(a, b)| (a.0 - b.0, a.1 - b.1)),
        _ => None,
    };
    match line {
        Some((0.0, _)) => Detector::Never,
        Some((slope, offset)) if slope.is_finite() && offset.is_finite() => match graph.op(node) {
            Op::Unary(Unary::Floor, _) => Detector::Integers { slope, offset },
            _ => Detector::Zero(-offset / slope),
        },
        _ => Detector::Sampled,
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
    fn affine_relations_are_solved_exactly() {
        fn relation(t: Expr<'_>) -> Expr<'_> {
            (20.0 - t * 2.0).less_eq(t * 3.0 + 10.0)
        }
        assert_eq!(instants(|t| relation(t) * 3.0, 0.0, 10.0), [2.0]);
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
        let root = (g.symbol("(time < 2)") + relation).node();
        let extracted = Switches::extract(&g, time.node(), &[root]).unwrap();
        let name = g.symbol_name(extracted.modes[0]).unwrap();
        assert_eq!(name, "(time < 2)'");
    }
}
