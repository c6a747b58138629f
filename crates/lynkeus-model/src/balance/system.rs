//! Equations, what they must determine, and which unknowns each of them contains.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Interval, Node, Op};

use crate::diagnostic::Span;

/// An equation between two expressions.
#[derive(Clone, Debug)]
pub(crate) struct FlatEquation {
    pub left: Node,
    pub right: Node,
    pub span: Span,
    /// which element of an array equation this is, as `[2]`
    pub element: Option<String>,
}

impl FlatEquation {
    /// "(element [2])", with a blank before it, of an array equation, else nothing.
    pub(super) fn which_element(&self) -> String {
        let element = self.element.as_deref();
        element.map_or_else(String::new, |element| format!(" (element {element})"))
    }
}

/// Something that the equations must determine.
#[derive(Clone, Debug)]
pub(crate) struct Unknown {
    pub symbol: Node,
    /// name of the variable; of the state, where the unknown is its derivative
    pub name: String,
    /// where the variable is declared
    pub span: Span,
    /// the state, where the unknown is its derivative
    pub state: Option<Node>,
    /// how much it is wanted as a state, where there is a choice
    pub rank: i32,
    /// where the search begins, if its equation has to be solved by one
    pub start: f64,
    /// where it may lie
    pub range: Interval,
}

impl Unknown {
    /// Whether something is known of where its value lies.
    pub(super) fn is_declared(&self) -> bool {
        self.start != 0.0 || self.range.lo().is_finite() || self.range.hi().is_finite()
    }

    /// `` `x` `` or `` `der(x)` ``
    pub(super) fn quoted(&self) -> String {
        match self.state {
            Some(_) => format!("`der({})`", self.name),
            None => format!("`{}`", self.name),
        }
    }
}

/// `` `a`, `b`, … ``
pub(super) fn listed<'a>(unknowns: impl Iterator<Item = &'a Unknown>) -> String {
    let mut names: Vec<String> = unknowns.take(9).map(Unknown::quoted).collect();
    let more = if names.len() > 8 { ", …" } else { "" };
    names.truncate(8);
    format!("{}{more}", names.join(", "))
}

/// The equations and what they must determine.
pub(crate) struct System<'a> {
    pub graph: &'a Graph,
    pub equations: &'a [FlatEquation],
    pub unknowns: &'a [Unknown],
    pub inputs: &'a [Node],
    pub time: Node,
}

/// "line 4" or "lines 4, 5 and 9".
pub(super) fn lines(source: &str, spans: impl Iterator<Item = Span>) -> String {
    let mut numbers: Vec<usize> = spans.take(8).map(|span| span.line(source)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let words: Vec<String> = numbers.iter().map(usize::to_string).collect();
    match words.split_last() {
        None => "no line".to_owned(),
        Some((only, [])) => format!("line {only}"),
        Some((last, before)) => format!("lines {} and {last}", before.join(", ")),
    }
}

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
        Op::Constant(_) | Op::Symbol(_) | Op::System(_) => [None; 3],
        Op::Unary(_, a) | Op::Powi(a, _) | Op::Entry(a, _) => [Some(a), None, None],
        Op::Binary(_, a, b) => [Some(a), Some(b), None],
        Op::Select(c, a, b) => [Some(c), Some(a), Some(b)],
    };
    arguments.into_iter().flatten()
}
