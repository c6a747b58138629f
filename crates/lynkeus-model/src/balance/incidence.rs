//! Which unknowns each equation contains.

use std::collections::HashMap;

use lynkeus_expr::{Node, Op};

use super::System;

/// The pattern of a system.
pub(super) struct Incidence {
    /// unknowns of each equation, in order
    pub of_equation: Vec<Vec<usize>>,
    /// place of each unknown by its symbol
    pub place: HashMap<Node, usize>,
    /// by index of the node: false for those of the equations that contain no unknown
    contains: Vec<bool>,
}

impl Incidence {
    pub(super) fn new(system: &System<'_>) -> Self {
        let symbols = system.unknowns.iter().enumerate();
        let place = symbols
            .map(|(place, unknown)| (unknown.symbol, place))
            .collect();
        // what stands elsewhere, as in an assertion, may be met again in a solution
        let contains = vec![true; system.graph.len()];
        let mut incidence = Self {
            of_equation: vec![],
            place,
            contains,
        };
        incidence.mark(system);
        incidence.collect(system);
        incidence
    }

    /// True where a node may contain an unknown.
    pub(super) fn contains(&self, node: Node) -> bool {
        self.contains.get(node.index()).copied().unwrap_or(true)
    }

    fn mark(&mut self, system: &System<'_>) {
        let sides = system
            .equations
            .iter()
            .flat_map(|equation| [equation.left, equation.right]);
        let mut nodes = system.graph.reachable(&sides.collect::<Vec<_>>());
        nodes.sort_unstable();
        for node in nodes {
            let below = arguments(system.graph.op(node)).any(|argument| self.contains(argument));
            let found = below || self.place.contains_key(&node);
            if let Some(flag) = self.contains.get_mut(node.index()) {
                *flag = found;
            }
        }
    }

    fn collect(&mut self, system: &System<'_>) {
        let mut seen = vec![usize::MAX; system.graph.len()];
        for (number, equation) in system.equations.iter().enumerate() {
            let mut found = vec![];
            let mut stack = vec![equation.right, equation.left];
            while let Some(node) = stack.pop() {
                let fresh = seen
                    .get_mut(node.index())
                    .is_some_and(|last| std::mem::replace(last, number) != number);
                if !fresh || !self.contains(node) {
                    continue;
                }
                found.extend(self.place.get(&node));
                stack.extend(arguments(system.graph.op(node)));
            }
            found.sort_unstable();
            self.of_equation.push(found);
        }
    }
}

/// Arguments of an operation; systems are only built after this stage.
pub(super) fn arguments(op: Op) -> impl Iterator<Item = Node> {
    let arguments = match op {
        Op::Constant(_) | Op::Symbol(_) | Op::Solve(_) | Op::Implicit(_) => [None; 3],
        Op::Unary(_, a) | Op::Powi(a, _) | Op::Entry(a, _) => [Some(a), None, None],
        Op::Binary(_, a, b) => [Some(a), Some(b), None],
        Op::Select(c, a, b) => [Some(c), Some(a), Some(b)],
    };
    arguments.into_iter().flatten()
}
