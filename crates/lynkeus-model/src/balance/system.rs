//! Equations, what they must determine, and which unknowns each of them contains.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Interval, Node};

use super::matching::Matching;
use crate::diagnostic::Span;
use crate::limits::{Budget, MAX_SOLVE_STEPS};

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
    /// whether it is a Boolean or an Integer
    pub is_discrete: bool,
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

/// The equations and what they must determine, with which unknowns stand in which equations and
/// the pairs of a maximum matching. Equations and unknowns are told by their places.
pub(crate) struct System<'a> {
    pub graph: &'a Graph,
    pub source: &'a str,
    pub equations: Vec<FlatEquation>,
    pub unknowns: Vec<Unknown>,
    pub inputs: &'a [Node],
    pub time: Node,
    /// for the steps of its solution
    pub(super) budget: Budget,
    /// unknowns of each equation, in order
    pub(super) pattern: Vec<Vec<usize>>,
    pub(super) matching: Matching,
    /// place of each unknown by its symbol
    place: HashMap<Node, usize>,
    /// by index of the node: false for those of the equations that contain no unknown
    contains: Vec<bool>,
}

impl<'a> System<'a> {
    pub(crate) fn new(
        graph: &'a Graph,
        source: &'a str,
        equations: Vec<FlatEquation>,
        unknowns: Vec<Unknown>,
        inputs: &'a [Node],
        time: Node,
    ) -> Self {
        let mut system = Self {
            graph,
            source,
            equations,
            unknowns,
            inputs,
            time,
            budget: Budget::new(MAX_SOLVE_STEPS, "steps to solve its equations"),
            pattern: vec![],
            matching: Matching::default(),
            place: HashMap::new(),
            contains: vec![],
        };
        system.arrange();
        system
    }

    /// Finds pattern and matching, also anew where equations or unknowns were added.
    pub(super) fn arrange(&mut self) {
        let symbols = self.unknowns.iter().enumerate();
        self.place = symbols
            .map(|(place, unknown)| (unknown.symbol, place))
            .collect();
        // what stands elsewhere, as in an assertion, may be met again in a solution
        self.contains = vec![true; self.graph.len()];
        self.mark();
        self.pattern = self.collected();
        self.matching = Matching::new(&self.pattern, self.unknowns.len(), self.wished());
    }

    /// True where a node may contain an unknown.
    pub(super) fn contains(&self, node: Node) -> bool {
        self.contains.get(node.index()).copied().unwrap_or(true)
    }

    fn mark(&mut self) {
        let sides = self.equations.iter().flat_map(|e| [e.left, e.right]);
        for node in self.graph.reachable(&sides.collect::<Vec<_>>()) {
            let below = self
                .graph
                .arguments(node)
                .into_iter()
                .any(|a| self.contains(a));
            self.contains[node.index()] = below || self.place.contains_key(&node);
        }
    }

    fn collected(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![usize::MAX; self.graph.len()];
        let unknowns = |(number, equation): (usize, &FlatEquation)| {
            let mut found = vec![];
            let mut stack = vec![equation.right, equation.left];
            while let Some(node) = stack.pop() {
                let before = std::mem::replace(&mut seen[node.index()], number);
                if before == number || !self.contains(node) {
                    continue;
                }
                found.extend(self.place.get(&node));
                stack.extend(self.graph.arguments(node));
            }
            found.sort_unstable();
            found
        };
        self.equations.iter().enumerate().map(unknowns).collect()
    }

    /// Pairs that the matching begins with. Equations that read `v = …` take `v` first, so that
    /// what is left over is what a reader of the model would name; then derivatives before other
    /// unknowns, for a missing equation is seldom one of a derivative.
    fn wished(&self) -> impl Iterator<Item = (usize, usize)> {
        let explicit = self.equations.iter().enumerate().filter_map(|(place, e)| {
            let mut sides = [e.left, e.right].into_iter();
            Some((place, *sides.find_map(|side| self.place.get(&side))?))
        });
        let edges = || {
            let equations = self.pattern.iter().enumerate();
            equations.flat_map(|(place, unknowns)| unknowns.iter().map(move |&u| (place, u)))
        };
        let is_derivative = |&(_, unknown): &(usize, usize)| self.unknowns[unknown].state.is_some();
        let derivatives = edges().filter(is_derivative);
        let others = edges().filter(move |edge| !is_derivative(edge));
        explicit.chain(derivatives).chain(others)
    }

    /// `` `a`, `b`, … ``
    pub(super) fn listed(&self, unknowns: impl Iterator<Item = usize>) -> String {
        let names = unknowns
            .take(9)
            .map(|unknown| self.unknowns[unknown].quoted());
        let mut names: Vec<String> = names.collect();
        let more = if names.len() > 8 { ", …" } else { "" };
        names.truncate(8);
        format!("{}{more}", names.join(", "))
    }

    /// "line 4" or "lines 4, 5 and 9", where equations stand.
    pub(super) fn lines(&self, equations: impl Iterator<Item = usize>) -> String {
        let spans = equations.map(|equation| self.equations[equation].span);
        let mut numbers: Vec<usize> = spans.take(8).map(|span| span.line(self.source)).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let words: Vec<String> = numbers.iter().map(usize::to_string).collect();
        match words.split_last() {
            None => "no line".to_owned(),
            Some((only, [])) => format!("line {only}"),
            Some((last, before)) => format!("lines {} and {last}", before.join(", ")),
        }
    }
}
