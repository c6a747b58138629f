//! Expressions as linear combinations of states and of nonlinear terms.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Tape, Unary};

use crate::Region;

/// c + Σ a_k term_k; a term is a state's symbol or a nonlinear node.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    constant: Interval,
    pub terms: BTreeMap<Node, Interval>,
}

impl Linear {
    fn number(constant: Interval) -> Self {
        Self {
            constant,
            terms: BTreeMap::new(),
        }
    }

    fn term(node: Node) -> Self {
        Self {
            constant: Interval::ZERO,
            terms: BTreeMap::from([(node, Interval::ONE)]),
        }
    }

    fn scaled(mut self, factor: Interval) -> Self {
        self.constant = self.constant * factor;
        for coefficient in self.terms.values_mut() {
            *coefficient = *coefficient * factor;
        }
        self
    }

    fn plus(mut self, other: &Linear) -> Self {
        self.constant = self.constant + other.constant;
        for (&node, &coefficient) in &other.terms {
            let mine = self.terms.entry(node).or_insert(Interval::ZERO);
            *mine = *mine + coefficient;
        }
        self
    }

    fn as_number(&self) -> Option<Interval> {
        self.terms.is_empty().then_some(self.constant)
    }

    /// The only term with its coefficient.
    fn single(&self) -> Option<(Node, Interval)> {
        match (self.terms.len(), self.constant == Interval::ZERO) {
            (1, true) => self.terms.iter().next().map(|(&n, &c)| (n, c)),
            _ => None,
        }
    }
}

/// Splits expressions on a box where some symbols have but one value.
pub(super) struct Splitter<'a> {
    graph: &'a Graph,
    region: &'a Region,
    known: HashMap<Node, Linear>,
}

impl<'a> Splitter<'a> {
    pub fn new(graph: &'a Graph, region: &'a Region) -> Self {
        Self {
            graph,
            region,
            known: HashMap::new(),
        }
    }

    /// The node as a linear combination. Arguments come before their users, so that
    /// deep expressions need no recursion.
    pub fn split(&mut self, root: Node) -> Result<Linear, MissingInput> {
        for node in self.graph.reachable(&[root]) {
            if !self.known.contains_key(&node) {
                let linear = self.one(node)?;
                self.known.insert(node, linear);
            }
        }
        Ok(self.known[&root].clone())
    }

    fn of(&self, node: Node) -> Linear {
        // nodes made here are not among those visited before
        let known = self.known.get(&node).cloned();
        known.unwrap_or_else(|| Linear::term(node))
    }

    fn one(&self, node: Node) -> Result<Linear, MissingInput> {
        let number = |node: Node| self.of(node).as_number();
        Ok(match self.graph.op(node) {
            Op::Constant(x) => Linear::number(Interval::point(x)),
            Op::Symbol(_) => self.symbol(node),
            Op::Unary(Unary::Neg, a) => self.of(a).scaled(-Interval::ONE),
            Op::Binary(Binary::Add, a, b) => self.of(a).plus(&self.of(b)),
            Op::Binary(Binary::Sub, a, b) => self.of(a).plus(&self.of(b).scaled(-Interval::ONE)),
            Op::Binary(Binary::Mul, a, b) => match (number(a), number(b)) {
                (Some(x), _) => self.of(b).scaled(x),
                (_, Some(x)) => self.of(a).scaled(x),
                _ => self.product(node, Binary::Mul, a, b),
            },
            Op::Binary(Binary::Div, a, b) => match number(b) {
                Some(x) => self.of(a).scaled(Interval::ONE / x),
                None => self.product(node, Binary::Div, a, b),
            },
            _ => self.other(node)?,
        })
    }

    fn symbol(&self, node: Node) -> Linear {
        let mut sides = self.region.dimensions.iter();
        match sides.find(|d| d.symbol == node) {
            Some(side) if side.min == side.max => Linear::number(Interval::point(side.min)),
            _ => Linear::term(node),
        }
    }

    /// A product or quotient with the numerical factors of its arguments taken out, so
    /// that a term with different coefficients in two equations is one term.
    fn product(&self, node: Node, op: Binary, a: Node, b: Node) -> Linear {
        let factored = |x: Node| self.of(x).single().filter(|&(term, _)| term != x);
        let (a, p) = factored(a).unwrap_or((a, Interval::ONE));
        let (b, q) = factored(b).unwrap_or((b, Interval::ONE));
        if (p, q) == (Interval::ONE, Interval::ONE) {
            return Linear::term(node);
        }
        let factor = if op == Binary::Div { p / q } else { p * q };
        Linear::term(self.graph.binary(op, a, b)).scaled(factor)
    }

    /// A nonlinear node: a number where nothing in it varies.
    fn other(&self, node: Node) -> Result<Linear, MissingInput> {
        let arguments = self.graph.arguments(node);
        let fixed = arguments.iter().all(|&a| self.of(a).as_number().is_some());
        if !fixed || self.graph.op(node).is_system() {
            return Ok(Linear::term(node));
        }
        let used = self.region.restricted(&self.graph.symbols_of(&[node]));
        let tape = Tape::new(self.graph, &used.symbols(), &[node])?;
        Ok(Linear::number(tape.eval_in(&Intervals, &used.cell())[0]))
    }
}
