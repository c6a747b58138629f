//! Linear equations: the form of an expression in one unknown, a block of equations as sparse rows,
//! and the core of a block, which is left when what follows with constant factors is taken out.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::system::{Incidence, arguments};
use crate::diagnostic::{Result, Span};
use crate::limits::Budget;

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

/// Σ coefficient · unknown + rest = 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// by place of the unknown in the block
    pub coefficients: BTreeMap<usize, Node>,
    pub rest: Option<Node>,
}

impl Row {
    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.coefficients.len()
    }
}

impl Linear<'_> {
    /// The row of a residual, in one walk from the root to the unknowns: every node passes its
    /// factor on. None where it is not linear.
    ///
    /// `place`: places of the unknowns of the block.
    pub(super) fn row(
        &self,
        residual: Node,
        place: &HashMap<Node, usize>,
        span: Span,
    ) -> Result<Option<Row>> {
        let graph = self.graph;
        let below = self.below(residual, span)?;
        let mut holds: HashSet<Node> = HashSet::new();
        for &node in &below {
            let below = arguments(graph.op(node)).any(|argument| holds.contains(&argument));
            if below || place.contains_key(&node) {
                holds.insert(node);
            }
        }
        let mut walk = Walk {
            graph,
            holds,
            passed: HashMap::new(),
            row: Row::default(),
        };
        walk.pass(residual, Passed::whole(graph));
        for &node in below.iter().rev() {
            let Some(passed) = walk.passed.remove(&node) else {
                continue;
            };
            match place.get(&node) {
                Some(&place) => {
                    let coefficient = passed.guarded(graph, passed.factor);
                    walk.row.coefficients.insert(place, coefficient);
                }
                None => {
                    if !walk.through(node, passed) {
                        return Ok(None);
                    }
                }
            }
        }
        let is_zero = |factor: &Node| graph.constant_value(*factor) == Some(0.0);
        walk.row.coefficients.retain(|_, factor| !is_zero(factor));
        Ok(Some(walk.row))
    }
}

/// What a node is multiplied with, and the condition under which it counts: what stands in a
/// branch may have no value where the branch is not taken.
#[derive(Clone, Copy)]
struct Passed {
    factor: Node,
    guard: Option<Node>,
}

impl Passed {
    fn whole(graph: &Graph) -> Self {
        Self {
            factor: graph.constant(1.0).node(),
            guard: None,
        }
    }

    fn with_factor(self, factor: Node) -> Self {
        Self { factor, ..self }
    }

    fn under(self, graph: &Graph, condition: Node) -> Self {
        let guard = match self.guard {
            Some(guard) => graph.binary(Binary::And, guard, condition),
            None => condition,
        };
        Self {
            guard: Some(guard),
            ..self
        }
    }

    /// The value where it counts, else 0.
    fn guarded(self, graph: &Graph, value: Node) -> Node {
        match self.guard {
            Some(guard) => graph.select(guard, value, graph.constant(0.0).node()),
            None => value,
        }
    }

    /// Both factors of one node, which counts where either does.
    fn plus(self, graph: &Graph, other: Self) -> Self {
        let (one, two) = match (self.guard, other.guard) {
            (Some(one), Some(two)) => (one, two),
            (None, None) => {
                return self.with_factor(graph.binary(Binary::Add, self.factor, other.factor));
            }
            _ => {
                let (one, two) = (
                    self.guarded(graph, self.factor),
                    other.guarded(graph, other.factor),
                );
                return Self {
                    factor: graph.binary(Binary::Add, one, two),
                    guard: None,
                };
            }
        };
        if graph.unary(Unary::Not, one) == two {
            return Self {
                factor: graph.select(one, self.factor, other.factor),
                guard: None,
            };
        }
        let (a, b) = (
            self.guarded(graph, self.factor),
            other.guarded(graph, other.factor),
        );
        Self {
            factor: graph.binary(Binary::Add, a, b),
            guard: Some(graph.binary(Binary::Or, one, two)),
        }
    }
}

struct Walk<'g> {
    graph: &'g Graph,
    /// nodes that contain an unknown of the block
    holds: HashSet<Node>,
    passed: HashMap<Node, Passed>,
    row: Row,
}

impl Walk<'_> {
    fn pass(&mut self, node: Node, passed: Passed) {
        if !self.holds.contains(&node) {
            return self.add_rest(node, passed);
        }
        let sum = match self.passed.get(&node) {
            Some(before) => before.plus(self.graph, passed),
            None => passed,
        };
        self.passed.insert(node, sum);
    }

    fn add_rest(&mut self, node: Node, passed: Passed) {
        let graph = self.graph;
        let factor = graph.constant_value(passed.factor);
        if graph.constant_value(node) == Some(0.0) || factor == Some(0.0) {
            return;
        }
        let negative = factor == Some(-1.0);
        let term = match factor {
            Some(1.0) | Some(-1.0) => node,
            _ => graph.binary(Binary::Mul, passed.factor, node),
        };
        let term = passed.guarded(graph, term);
        self.row.rest = Some(match (self.row.rest, negative) {
            (Some(rest), false) => graph.binary(Binary::Add, rest, term),
            (Some(rest), true) => graph.binary(Binary::Sub, rest, term),
            (None, false) => term,
            (None, true) => graph.unary(Unary::Neg, term),
        });
    }

    /// Passes the factor of an operation on to its arguments; false where it is not linear.
    fn through(&mut self, node: Node, passed: Passed) -> bool {
        let graph = self.graph;
        let free = |node: Node| !self.holds.contains(&node);
        let negative = || passed.with_factor(graph.unary(Unary::Neg, passed.factor));
        let times = |operation: Binary, by: Node| {
            passed.with_factor(graph.binary(operation, passed.factor, by))
        };
        match graph.op(node) {
            Op::Unary(Unary::Neg, a) => self.pass(a, negative()),
            Op::Binary(Binary::Add, a, b) => {
                self.pass(a, passed);
                self.pass(b, passed);
            }
            Op::Binary(Binary::Sub, a, b) => {
                self.pass(a, passed);
                self.pass(b, negative());
            }
            Op::Binary(Binary::Mul, a, b) if free(b) => self.pass(a, times(Binary::Mul, b)),
            Op::Binary(Binary::Mul, a, b) if free(a) => self.pass(b, times(Binary::Mul, a)),
            Op::Binary(Binary::Div, a, b) if free(b) => self.pass(a, times(Binary::Div, b)),
            Op::Select(c, a, b) if free(c) => {
                self.pass(a, passed.under(graph, c));
                self.pass(b, passed.under(graph, graph.unary(Unary::Not, c)));
            }
            _ => return false,
        }
        true
    }
}

/// A factor smaller than this part of the largest of its row is no pivot.
const THRESHOLD: f64 = 0.01;
/// What is left of a difference relative to its terms counts as zero below this.
const CANCELLED: f64 = 1e-13;

/// An unknown that a row gives, in the order of elimination.
pub(super) struct Given {
    pub column: usize,
    /// of the row, before it is divided by `factor`
    pub row: Row,
    pub factor: f64,
}

/// What is left of a block.
pub(super) struct Core {
    pub given: Vec<Given>,
    /// rows that are left, by their place in the block
    pub rows: Vec<(usize, Row)>,
    pub columns: Vec<usize>,
}

/// Takes out what can be taken out, short rows first.
pub(super) fn core(graph: &Graph, budget: &Budget, span: Span, rows: Vec<Row>) -> Result<Core> {
    let count = rows.len();
    let mut elimination = Elimination::new(graph, budget, span, rows);
    elimination.run()?;
    let mut left: BTreeSet<usize> = (0..count).collect();
    for given in &elimination.given {
        left.remove(&given.column);
    }
    let rows = elimination.rows.into_iter().enumerate();
    Ok(Core {
        given: elimination.given,
        rows: rows
            .filter_map(|(place, row)| Some((place, row?)))
            .collect(),
        columns: left.into_iter().collect(),
    })
}

struct Elimination<'a> {
    graph: &'a Graph,
    budget: &'a Budget,
    span: Span,
    /// `None` once a row gives its unknown
    rows: Vec<Option<Row>>,
    /// rows that hold each unknown
    holding: Vec<BTreeSet<usize>>,
    queue: BTreeSet<(usize, usize)>,
    given: Vec<Given>,
}

impl<'a> Elimination<'a> {
    fn new(graph: &'a Graph, budget: &'a Budget, span: Span, rows: Vec<Row>) -> Self {
        let mut holding = vec![BTreeSet::new(); rows.len()];
        let mut queue = BTreeSet::new();
        for (place, row) in rows.iter().enumerate() {
            queue.insert((row.len(), place));
            for &column in row.coefficients.keys() {
                holding[column].insert(place);
            }
        }
        Self {
            graph,
            budget,
            span,
            rows: rows.into_iter().map(Some).collect(),
            holding,
            queue,
            given: vec![],
        }
    }

    fn run(&mut self) -> Result<()> {
        while let Some((_, place)) = self.queue.pop_first() {
            let Some(row) = &self.rows[place] else {
                continue;
            };
            let Some((column, factor)) = self.pivot(row) else {
                continue;
            };
            if let Some(row) = self.rows[place].take() {
                self.take_out(place, column, factor, row)?;
            }
        }
        Ok(())
    }

    /// The unknown with a constant factor that stands in the fewest rows.
    fn pivot(&self, row: &Row) -> Option<(usize, f64)> {
        let factors = row.coefficients.iter().filter_map(|(&column, &node)| {
            let value = self.graph.constant_value(node)?;
            (value != 0.0).then_some((column, value))
        });
        let factors: Vec<(usize, f64)> = factors.collect();
        let largest = factors
            .iter()
            .map(|(_, value)| value.abs())
            .fold(0.0, f64::max);
        let sound = factors
            .into_iter()
            .filter(|(_, value)| value.abs() >= THRESHOLD * largest);
        sound.min_by_key(|(column, _)| self.holding[*column].len())
    }

    fn take_out(&mut self, place: usize, column: usize, factor: f64, row: Row) -> Result<()> {
        for &other in row.coefficients.keys() {
            self.holding[other].remove(&place);
        }
        let others: Vec<usize> = self.holding[column].iter().copied().collect();
        for other in others {
            self.budget.charge(row.len() as u64, self.span)?;
            let Some(mut changed) = self.rows[other].take() else {
                continue;
            };
            self.queue.remove(&(changed.len(), other));
            self.substitute(&mut changed, column, factor, &row);
            for &now in changed.coefficients.keys() {
                self.holding[now].insert(other);
            }
            for &before in row.coefficients.keys() {
                if !changed.coefficients.contains_key(&before) {
                    self.holding[before].remove(&other);
                }
            }
            self.holding[column].remove(&other);
            self.queue.insert((changed.len(), other));
            self.rows[other] = Some(changed);
        }
        self.given.push(Given {
            column,
            row,
            factor,
        });
        Ok(())
    }

    /// Puts what a row gives for an unknown into another row.
    fn substitute(&self, into: &mut Row, column: usize, factor: f64, row: &Row) {
        let Some(own) = into.coefficients.remove(&column) else {
            return;
        };
        let graph = self.graph;
        let ratio = graph.binary(Binary::Div, own, graph.constant(factor).node());
        for (&other, &coefficient) in &row.coefficients {
            if other == column {
                continue;
            }
            let term = graph.binary(Binary::Mul, ratio, coefficient);
            match self.difference(into.coefficients.get(&other).copied(), term) {
                Some(node) => into.coefficients.insert(other, node),
                None => into.coefficients.remove(&other),
            };
        }
        if let Some(rest) = row.rest {
            let term = graph.binary(Binary::Mul, ratio, rest);
            into.rest = self.difference(into.rest, term);
        }
    }

    /// a − b; `None` where nothing is left but rounding.
    fn difference(&self, a: Option<Node>, b: Node) -> Option<Node> {
        let graph = self.graph;
        let Some(a) = a else {
            return Some(graph.unary(Unary::Neg, b));
        };
        let node = graph.binary(Binary::Sub, a, b);
        let value = graph.constant_value(node);
        let (Some(value), Some(a), Some(b)) =
            (value, graph.constant_value(a), graph.constant_value(b))
        else {
            return (value != Some(0.0)).then_some(node);
        };
        (value.abs() > CANCELLED * (a.abs() + b.abs())).then_some(node)
    }
}
