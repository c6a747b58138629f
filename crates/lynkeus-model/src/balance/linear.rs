//! The parts of an expression that is linear in one unknown.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::incidence::{Incidence, arguments};
use crate::limits::Budget;
use crate::syntax::{Result, Span};

/// coefficient · unknown + rest; `None` is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Form {
    pub coefficient: Option<Node>,
    pub rest: Option<Node>,
}

/// Takes expressions apart.
pub(super) struct Linear<'a> {
    pub graph: &'a Graph,
    pub incidence: &'a Incidence,
    pub budget: &'a Budget,
}

impl Linear<'_> {
    /// The form of an expression; `None` where it is not linear in the unknown.
    pub(super) fn form(&self, root: Node, unknown: Node, span: Span) -> Result<Option<Form>> {
        let mut forms: HashMap<Node, Option<Form>> = HashMap::new();
        for node in self.below(root, span)? {
            let form = match node == unknown {
                true => {
                    let one = self.graph.constant(1.0).node();
                    Some(Form {
                        coefficient: Some(one),
                        rest: None,
                    })
                }
                false => {
                    let op = self.graph.op(node);
                    if !arguments(op).any(|argument| forms.contains_key(&argument)) {
                        continue;
                    }
                    self.combined(op, &forms)
                }
            };
            forms.insert(node, form);
        }
        let constant = Form {
            coefficient: None,
            rest: self.nonzero(root),
        };
        Ok(forms.remove(&root).unwrap_or(Some(constant)))
    }

    /// Nodes of the expression that contain unknowns, arguments first.
    pub(super) fn below(&self, root: Node, span: Span) -> Result<Vec<Node>> {
        let mut found: HashSet<Node> = HashSet::new();
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            if self.incidence.contains(node) && found.insert(node) {
                self.budget.charge(1, span)?;
                stack.extend(arguments(self.graph.op(node)));
            }
        }
        let mut nodes: Vec<Node> = found.into_iter().collect();
        nodes.sort_unstable();
        Ok(nodes)
    }

    fn nonzero(&self, node: Node) -> Option<Node> {
        (self.graph.constant_value(node) != Some(0.0)).then_some(node)
    }

    /// The form of an operation, some argument of which has one.
    fn combined(&self, op: Op, forms: &HashMap<Node, Option<Form>>) -> Option<Form> {
        let is_free = |node: Node| !forms.contains_key(&node);
        let form = |node: Node| match forms.get(&node) {
            Some(form) => *form,
            None => Some(Form {
                coefficient: None,
                rest: self.nonzero(node),
            }),
        };
        match op {
            Op::Unary(Unary::Neg, a) => Some(form(a)?.map(|part| self.negated(part))),
            Op::Binary(Binary::Add, a, b) => Some(self.sum(form(a)?, form(b)?)),
            Op::Binary(Binary::Sub, a, b) => Some(self.difference(form(a)?, form(b)?)),
            Op::Binary(Binary::Mul, a, b) if is_free(b) => {
                Some(form(a)?.map(|part| self.times(part, b)))
            }
            Op::Binary(Binary::Mul, a, b) if is_free(a) => {
                Some(form(b)?.map(|part| self.times(part, a)))
            }
            Op::Binary(Binary::Div, a, b) if is_free(b) => {
                Some(form(a)?.map(|part| self.graph.binary(Binary::Div, part, b)))
            }
            Op::Select(c, a, b) if is_free(c) => {
                let (a, b) = (form(a)?, form(b)?);
                let zero = self.graph.constant(0.0).node();
                let choose = |a: Option<Node>, b: Option<Node>| {
                    let either = a.or(b).is_some();
                    either.then(|| self.graph.select(c, a.unwrap_or(zero), b.unwrap_or(zero)))
                };
                Some(Form {
                    coefficient: choose(a.coefficient, b.coefficient),
                    rest: choose(a.rest, b.rest),
                })
            }
            _ => None,
        }
    }

    fn negated(&self, node: Node) -> Node {
        self.graph.unary(Unary::Neg, node)
    }

    fn times(&self, a: Node, b: Node) -> Node {
        self.graph.binary(Binary::Mul, a, b)
    }

    fn sum(&self, a: Form, b: Form) -> Form {
        let add = |a: Option<Node>, b: Option<Node>| match (a, b) {
            (Some(a), Some(b)) => self.nonzero(self.graph.binary(Binary::Add, a, b)),
            (one, other) => one.or(other),
        };
        Form {
            coefficient: add(a.coefficient, b.coefficient),
            rest: add(a.rest, b.rest),
        }
    }

    /// a − b
    pub(super) fn difference(&self, a: Form, b: Form) -> Form {
        Form {
            coefficient: self.minus(a.coefficient, b.coefficient),
            rest: self.minus(a.rest, b.rest),
        }
    }

    fn minus(&self, a: Option<Node>, b: Option<Node>) -> Option<Node> {
        match (a, b) {
            (Some(a), Some(b)) => self.nonzero(self.graph.binary(Binary::Sub, a, b)),
            (None, Some(b)) => Some(self.negated(b)),
            (a, None) => a,
        }
    }

    /// The unknown from left = right; `None` where its coefficient is zero.
    pub(super) fn solution(&self, left: Form, right: Form) -> Option<Node> {
        let coefficient = self.minus(left.coefficient, right.coefficient)?;
        let zero = || self.graph.constant(0.0).node();
        let value = self.minus(right.rest, left.rest).unwrap_or_else(zero);
        Some(match self.graph.constant_value(coefficient) {
            Some(0.0) => return None,
            Some(1.0) => value,
            Some(-1.0) => self.negated(value),
            _ => self.graph.binary(Binary::Div, value, coefficient),
        })
    }
}

impl Form {
    fn map(self, part: impl Fn(Node) -> Node) -> Self {
        Self {
            coefficient: self.coefficient.map(&part),
            rest: self.rest.map(&part),
        }
    }
}
