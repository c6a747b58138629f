//! The plant with its choices made from outside, in any way and at any moments.
//!
//! What is hidden within each branch may show all the same: one branch tells p + q and another p − q. What nobody
//! could tell who sees every choice, can switch it as he likes and measures the guards as well is hidden for certain.
//! So each choice becomes a known signal c: `if` is c·a + (1 − c)·b, |a| is (1 − 2c)·a, a step is c itself, and so is the
//! shift of asin∘sin. The
//! outputs' series with generic signals see exactly the span of all d(L_f L_g … h) with branches f, g, … in any order (Wang
//! and Sontag, *Orders of input/output differential equations and state-space dimensions*, SIAM J. Control Optim. 33
//! (1995)): what that leaves is a set of directions that every branch carries on, those that were never looked at
//! included, and that moves neither an output nor a guard.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};
use lynkeus_model::{Home, Plant, Variable};

use crate::branches::{Choices, Folded, Reference, folded, value};

/// A plant whose choices are inputs, and what is measured of it.
pub(crate) struct Switched {
    pub plant: Plant,
    /// the outputs and the guards
    pub outputs: Vec<Node>,
    pub reference: Reference,
}

impl Switched {
    pub fn new(plant: &Plant, outputs: &[Node], choices: &Choices, own: &Reference) -> Self {
        let mut plant = plant.clone();
        let mut signals = Signals::default();
        let measured = [outputs, &choices.guards].concat();
        let roots = [&plant.derivatives[..], &measured].concat();
        let mut images = signals.opened(&plant.graph, &roots);
        let outputs = images.split_off(plant.derivatives.len());
        plant.derivatives = images;
        let mut reference = own.clone();
        for (choice, signal) in signals.known {
            let chosen = value(&plant.graph, choice, own).unwrap_or_default();
            reference.insert(signal, chosen);
            plant.inputs.push(input(&plant.graph, signal));
        }
        Self {
            plant,
            outputs,
            reference,
        }
    }
}

fn input(graph: &Graph, node: Node) -> Variable {
    Variable {
        // no name of the plant's has this form
        name: format!(" choice {}", graph.render(node, 20)),
        node,
        unit: None,
        description: None,
        start: None,
        start_node: None,
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        nominal: None,
        integer: false,
        discrete: false,
        fixed: false,
        home: Home::Line,
    }
}

/// The signals that stand for choices.
#[derive(Default)]
struct Signals {
    known: Vec<(Node, Node)>,
}

impl Signals {
    fn of(&mut self, graph: &Graph, choice: Node) -> Node {
        if let Some((_, signal)) = self.known.iter().find(|(known, _)| *known == choice) {
            return *signal;
        }
        if matches!(graph.op(choice), Op::Constant(_)) {
            return choice;
        }
        let signal = graph.fresh(format!("{}", self.known.len())).node();
        self.known.push((choice, signal));
        signal
    }

    /// 1 where a < b, else 0: one signal for both orders.
    fn below(&mut self, graph: &Graph, a: Node, b: Node) -> Node {
        match a <= b {
            true => self.of(graph, graph.binary(Binary::Less, a, b)),
            false => {
                let other = self.of(graph, graph.binary(Binary::Less, b, a));
                (1.0 - graph.expr(other)).node()
            }
        }
    }

    /// The roots with their choices open.
    fn opened(&mut self, graph: &Graph, roots: &[Node]) -> Vec<Node> {
        let mut images: HashMap<Node, Node> = HashMap::new();
        for node in graph.reachable(roots) {
            let image = match self.open(graph, node, &images) {
                Some(image) => Some(image),
                None => graph.rebuilt(graph, node, |argument| images[&argument]),
            };
            if let Some(image) = image {
                images.insert(node, image);
            }
        }
        roots.iter().map(|root| images[root]).collect()
    }

    /// What stands for a node that chooses.
    fn open(&mut self, graph: &Graph, node: Node, images: &HashMap<Node, Node>) -> Option<Node> {
        let image = |node: Node| graph.expr(images[&node]);
        let mixed = |c: Node, a: Node, b: Node| {
            let (a, b) = (image(a), image(b));
            (b + graph.expr(c) * (a - b)).node()
        };
        let mut sign = |a: Node| {
            let zero = graph.constant(0.0).node();
            1.0 - 2.0 * graph.expr(self.below(graph, a, zero))
        };
        Some(match graph.op(node) {
            Op::Unary(Unary::Sign, a) => sign(a).node(),
            Op::Unary(Unary::Abs, a) => (sign(a) * image(a)).node(),
            Op::Unary(Unary::Floor, _) => self.of(graph, node),
            Op::Unary(Unary::Not, a) => (1.0 - image(a)).node(),
            Op::Binary(Binary::And, a, b) => (image(a) * image(b)).node(),
            Op::Binary(Binary::Or, a, b) => (image(a) + image(b) - image(a) * image(b)).node(),
            Op::Binary(Binary::Min, a, b) => mixed(self.below(graph, a, b), a, b),
            Op::Binary(Binary::Max, a, b) => mixed(self.below(graph, a, b), b, a),
            Op::Binary(Binary::Less, a, b) => self.below(graph, a, b),
            // but for the border
            Op::Binary(Binary::LessEq, a, b) => {
                let above = self.below(graph, b, a);
                (1.0 - graph.expr(above)).node()
            }
            Op::Binary(Binary::Equal, ..) => self.of(graph, node),
            Op::Select(c, a, b) => mixed(self.condition(graph, c, images), a, b),
            _ => {
                let Folded { of, guard } = folded(graph, node)?;
                let sign = sign(guard);
                match graph.op(node) {
                    Op::Unary(Unary::Sqrt, _) => (sign * image(of)).node(),
                    _ => {
                        let side = graph.expr(graph.unary(Unary::Sign, guard));
                        let shift = (graph.expr(node) - side * graph.expr(of)).node();
                        (sign * image(of) + graph.expr(self.of(graph, shift))).node()
                    }
                }
            }
        })
    }

    /// What stands for a condition: a truth value that is no comparison is a choice of its own.
    fn condition(&mut self, graph: &Graph, c: Node, images: &HashMap<Node, Node>) -> Node {
        use Binary::{And, Equal, Less, LessEq, Or};
        match graph.op(c) {
            Op::Unary(Unary::Not, _)
            | Op::Binary(Less | LessEq | Equal | And | Or, ..)
            | Op::Constant(_) => images[&c],
            _ => self.of(graph, c),
        }
    }
}
