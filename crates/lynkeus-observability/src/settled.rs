//! Choices that are the same on the whole declared box are made before anything else: what is left chooses on it.
//!
//! |x| with x ≥ 0 on the box is x there, and what the other branch would show, nobody sees. The sign of each guard is
//! proved by intervals; where they do not prove one, the choice stays.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Interval, Node, Op, Unary};
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_structure::{Dimension, Region, enclosure_within};

use crate::Question;
use crate::branches::{Folded, folded};

/// Cells of the box that are looked at for each end of a guard's range.
const CELLS: usize = 200;

/// Expressions in which no choice is open that the box decides.
pub(crate) struct Settled {
    /// in the order of the roots
    pub roots: Vec<Node>,
    /// the choices that are made, as written
    pub made: Vec<String>,
}

impl Settled {
    pub fn new(plant: &Plant, question: &Question, roots: &[Node]) -> Self {
        let graph = &plant.graph;
        let declared = Declared {
            graph,
            region: region(plant, question),
        };
        let mut images: HashMap<Node, Node> = HashMap::new();
        let mut made = vec![];
        for node in graph.reachable(roots) {
            let image = match declared.made(node, &images) {
                Some(image) => {
                    made.push(graph.render(node, 40));
                    Some(image)
                }
                None => graph.rebuilt(graph, node, |argument| images[&argument]),
            };
            if let Some(image) = image {
                images.insert(node, image);
            }
        }
        Self {
            roots: roots.iter().map(|root| images[root]).collect(),
            made,
        }
    }
}

/// Where everything is: known parameters at their values, all else in its range.
fn region(plant: &Plant, question: &Question) -> Region {
    let variables = plant.states.iter().chain(&plant.inputs);
    let mut dimensions: Vec<Dimension> = variables.map(|v| side(v, v.start)).collect();
    for parameter in &plant.parameters {
        let known = parameter.value.filter(|_| !question.parameters);
        dimensions.push(match known {
            Some(value) => Dimension::new("", parameter.variable.node, value, value),
            None => side(&parameter.variable, parameter.value),
        });
    }
    let (from, to) = (f64::NEG_INFINITY, f64::INFINITY);
    dimensions.push(Dimension::new("", plant.time, from, to));
    Region { dimensions }
}

/// The declared range, with the model's own value. An angle goes on beyond its turn.
fn side(variable: &Variable, own: Option<f64>) -> Dimension {
    let (min, max) = match variable.home {
        Home::Line => (variable.min, variable.max),
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    let own = own.filter(|own| own.is_finite());
    let (min, max) = own.map_or((min, max), |own| (min.min(own), max.max(own)));
    Dimension::new(&*variable.name, variable.node, min, max)
}

/// Whether an operation has branches.
fn may_choose(op: Op) -> bool {
    match op {
        Op::Unary(op, _) => matches!(
            op,
            Unary::Abs | Unary::Sign | Unary::Floor | Unary::Sqrt | Unary::Asin | Unary::Acos
        ),
        Op::Binary(op, ..) => matches!(
            op,
            Binary::Min | Binary::Max | Binary::Less | Binary::LessEq | Binary::Equal
        ),
        _ => false,
    }
}

/// The declared box.
struct Declared<'g> {
    graph: &'g Graph,
    region: Region,
}

impl Declared<'_> {
    /// All values of an expression on the box; none where it may lack one.
    fn range(&self, node: Node) -> Option<Interval> {
        let found = enclosure_within(self.graph, node, &self.region, CELLS).ok()?;
        found.is_defined().then_some(found)
    }

    fn difference(&self, a: Node, b: Node) -> Option<Interval> {
        self.range(self.graph.binary(Binary::Sub, a, b))
    }

    /// The whole number that an expression, rounded down, is on all of the box.
    fn whole(&self, range: Interval) -> Option<f64> {
        let floor = range.lo().floor();
        (floor.is_finite() && floor == range.hi().floor()).then_some(floor)
    }

    /// What stands for a node whose choice is the same on the whole box.
    fn made(&self, node: Node, images: &HashMap<Node, Node>) -> Option<Node> {
        let graph = self.graph;
        // most nodes choose nothing, and what a node reads takes a walk
        let chooses = may_choose(graph.op(node));
        if !chooses || graph.budget().spent().is_some() || graph.symbols_of(&[node]).is_empty() {
            return None;
        }
        let constant = |value: f64| graph.constant(value).node();
        let truth = |value: bool| constant(f64::from(u8::from(value)));
        match graph.op(node) {
            Op::Unary(Unary::Abs, a) => self.signed(a, a, images),
            Op::Unary(Unary::Sign, a) => {
                let range = self.range(a)?;
                let sign = range.is_positive() || range.is_negative();
                sign.then(|| constant(range.lo().signum()))
            }
            Op::Unary(Unary::Floor, a) => Some(constant(self.whole(self.range(a)?)?)),
            Op::Binary(op @ (Binary::Min | Binary::Max), a, b) => {
                let is_first_larger = side_of(self.difference(a, b)?)?;
                let takes_first = is_first_larger == (op == Binary::Max);
                Some(images[if takes_first { &a } else { &b }])
            }
            Op::Binary(Binary::Less, a, b) => {
                let range = self.difference(a, b)?;
                let is_decided = range.hi() < 0.0 || range.lo() >= 0.0;
                is_decided.then(|| truth(range.hi() < 0.0))
            }
            Op::Binary(Binary::LessEq, a, b) => {
                let range = self.difference(a, b)?;
                let is_decided = range.hi() <= 0.0 || range.lo() > 0.0;
                is_decided.then(|| truth(range.hi() <= 0.0))
            }
            Op::Binary(Binary::Equal, a, b) => {
                let range = self.difference(a, b)?;
                (!range.contains_zero()).then(|| truth(false))
            }
            Op::Unary(outer, _) => {
                let Folded { of, guard } = folded(graph, node)?;
                match outer {
                    Unary::Sqrt => self.signed(of, guard, images),
                    _ => self.unfolded(outer, of, images),
                }
            }
            _ => None,
        }
    }

    /// An expression where a guard is nowhere negative, or its negative where that is nowhere positive.
    fn signed(&self, of: Node, guard: Node, images: &HashMap<Node, Node>) -> Option<Node> {
        let image = images[&of];
        Some(match side_of(self.range(guard)?)? {
            true => image,
            false => (-self.graph.expr(image)).node(),
        })
    }

    /// asin(sin z) = (−1)ᵐ(z − mπ) with m = ⌊z/π + ½⌋, and acos(cos z) = |z − 2πk| by m = ⌊z/π⌋.
    fn unfolded(&self, outer: Unary, z: Node, images: &HashMap<Node, Node>) -> Option<Node> {
        use std::f64::consts::PI;
        let turns = self.range(z)? / Interval::PI;
        let image = self.graph.expr(images[&z]);
        let m = match outer {
            Unary::Asin => self.whole(turns + Interval::point(0.5))?,
            _ => self.whole(turns)?,
        };
        let is_even = m.rem_euclid(2.0) == 0.0;
        let unfolded = match (outer, is_even) {
            (_, true) => image - m * PI,
            (Unary::Asin, false) => m * PI - image,
            (_, false) => (m + 1.0) * PI - image,
        };
        Some(unfolded.node())
    }
}

/// Whether a range is nowhere negative, or nowhere positive.
fn side_of(range: Interval) -> Option<bool> {
    match (range.lo() >= 0.0, range.hi() <= 0.0) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Tape;
    use lynkeus_model::LoadOptions;

    use super::*;

    /// What is made of a function is that function on the box, whichever turn this lies in.
    #[test]
    fn what_is_made_on_a_box_has_the_same_values() {
        let functions = [
            ("asin(sin(z))", [1.6, 4.7]),
            ("asin(sin(z))", [-4.6, -1.6]),
            ("asin(sin(z))", [4.8, 7.8]),
            ("asin(sin(z))", [-1.5, 1.5]),
            ("acos(cos(z))", [0.1, 3.1]),
            ("acos(cos(z))", [3.2, 6.2]),
            ("acos(cos(z))", [-3.1, -0.1]),
            ("acos(cos(z))", [-6.2, -3.2]),
            ("sqrt(z*z)", [-3.0, 0.0]),
            ("abs(z - 1)", [-3.0, 1.0]),
            ("sign(z)*z", [-3.0, -0.1]),
            ("floor(z)*z", [-1.9, -1.1]),
            ("min(z, 2) + max(z, -1)", [-1.0, 2.0]),
            ("if z > 0 and not z < 1 then z else 0", [1.0, 3.0]),
            ("if z == 5 then 0 else z", [1.0, 3.0]),
        ];
        for (function, [low, high]) in functions {
            let text = format!(
                "model M\n Real z(min={low:?}, max={high:?}, start={high:?});\n output Real y = {function};\nequation\n der(z) = 0;\nend M;"
            );
            let plant = Plant::from_modelica(&text, "m.mo", &LoadOptions::default()).unwrap();
            let output = plant.outputs[0].node;
            let settled = Settled::new(&plant, &Question::default(), &[output]);
            assert!(!settled.made.is_empty(), "{function}");
            let roots = [output, settled.roots[0]];
            assert_ne!(roots[0], roots[1], "{function}");
            let tape = Tape::new(&plant.graph, &[plant.states[0].node], &roots).unwrap();
            for share in [0.1, 0.3, 0.5, 0.7, 0.9] {
                let mut values = [0.0; 2];
                tape.evaluator()
                    .eval(&[low + share * (high - low)], &mut values);
                let [own, made] = values;
                assert!((own - made).abs() < 1e-12, "{function}: {own} {made}");
            }
        }
    }
}
