//! Linear equations: the form of an expression in one unknown, a block of equations as sparse rows,
//! and the core of a block, which is left when what follows with constant factors is taken out.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::system::{FlatEquation, System, arguments};
use crate::diagnostic::{Result, Span};

/// coefficient · unknown + rest; `None` is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Form {
    pub coefficient: Option<Node>,
    pub rest: Option<Node>,
}

/// Takes expressions apart.
impl System<'_> {
    /// The forms of both sides of an equation; `None` where it is not linear in the unknown.
    pub(super) fn sides(
        &self,
        equation: &FlatEquation,
        unknown: Node,
    ) -> Result<Option<[Form; 2]>> {
        let left = self.form(equation.left, unknown, equation.span)?;
        let right = self.form(equation.right, unknown, equation.span)?;
        Ok(left.zip(right).map(|(left, right)| [left, right]))
    }

    /// The form of an expression; `None` where it is not linear in the unknown.
    fn form(&self, root: Node, unknown: Node, span: Span) -> Result<Option<Form>> {
        let mut forms: HashMap<Node, Option<Form>> = HashMap::new();
        for node in self.below(root, span)? {
            let op = self.graph.op(node);
            if node == unknown {
                let one = self.graph.constant(1.0).node();
                let form = Form {
                    coefficient: Some(one),
                    rest: None,
                };
                forms.insert(node, Some(form));
            } else if arguments(op).any(|argument| forms.contains_key(&argument)) {
                forms.insert(node, self.combined(op, &forms));
            }
        }
        let constant = self.constant_form(root);
        Ok(forms.remove(&root).unwrap_or(Some(constant)))
    }

    /// The form of what is free of the unknown.
    fn constant_form(&self, node: Node) -> Form {
        Form {
            coefficient: None,
            rest: self.nonzero(node),
        }
    }

    /// Nodes of the expression that contain unknowns, arguments first.
    fn below(&self, root: Node, span: Span) -> Result<Vec<Node>> {
        let mut found: HashSet<Node> = HashSet::new();
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            if self.contains(node) && found.insert(node) {
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
            None => Some(self.constant_form(node)),
        };
        match op {
            Op::Unary(Unary::Neg, a) => Some(form(a)?.map(|part| self.negated(part))),
            Op::Binary(Binary::Add, a, b) => Some(form(a)?.with(form(b)?, |a, b| self.plus(a, b))),
            Op::Binary(Binary::Sub, a, b) => Some(form(a)?.with(form(b)?, |a, b| self.minus(a, b))),
            Op::Binary(Binary::Mul, a, b) | Op::Binary(Binary::Mul, b, a) if is_free(b) => {
                Some(form(a)?.map(|part| self.graph.binary(Binary::Mul, part, b)))
            }
            Op::Binary(Binary::Div, a, b) if is_free(b) => {
                Some(form(a)?.map(|part| self.graph.binary(Binary::Div, part, b)))
            }
            Op::Select(c, a, b) if is_free(c) => {
                let zero = self.graph.constant(0.0).node();
                let choose = |a: Option<Node>, b: Option<Node>| {
                    let either = a.or(b).is_some();
                    either.then(|| self.graph.select(c, a.unwrap_or(zero), b.unwrap_or(zero)))
                };
                Some(form(a)?.with(form(b)?, choose))
            }
            _ => None,
        }
    }

    fn negated(&self, node: Node) -> Node {
        self.graph.unary(Unary::Neg, node)
    }

    fn plus(&self, a: Option<Node>, b: Option<Node>) -> Option<Node> {
        match (a, b) {
            (Some(a), Some(b)) => self.nonzero(self.graph.binary(Binary::Add, a, b)),
            (one, other) => one.or(other),
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
    pub(super) fn solution(&self, [left, right]: [Form; 2]) -> Option<Node> {
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
        self.with(self, |a, _| a.map(&part))
    }

    /// Both parts joined with those of another form.
    fn with(self, other: Self, join: impl Fn(Option<Node>, Option<Node>) -> Option<Node>) -> Self {
        Self {
            coefficient: join(self.coefficient, other.coefficient),
            rest: join(self.rest, other.rest),
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

impl System<'_> {
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
        if let (Some(one), Some(two)) = (self.guard, other.guard)
            && graph.unary(Unary::Not, one) == two
        {
            return Self {
                factor: graph.select(one, self.factor, other.factor),
                guard: None,
            };
        }
        let guards = self.guard.zip(other.guard);
        let one = self.guarded(graph, self.factor);
        let two = other.guarded(graph, other.factor);
        Self {
            factor: graph.binary(Binary::Add, one, two),
            guard: guards.map(|(one, two)| graph.binary(Binary::Or, one, two)),
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
            Op::Binary(Binary::Mul, a, b) | Op::Binary(Binary::Mul, b, a) if free(b) => {
                self.pass(a, times(Binary::Mul, b));
            }
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

/// A block from which is taken out what can be, short rows first.
pub(super) struct Elimination<'a> {
    system: &'a System<'a>,
    span: Span,
    /// by their place in the block; `None` once a row gives its unknown
    rows: Vec<Option<Row>>,
    /// rows that hold each unknown
    holding: Vec<BTreeSet<usize>>,
    queue: BTreeSet<(usize, usize)>,
    pub given: Vec<Given>,
}

impl<'a> Elimination<'a> {
    pub(super) fn new(system: &'a System<'a>, span: Span, rows: Vec<Row>) -> Result<Self> {
        let mut holding = vec![BTreeSet::new(); rows.len()];
        let mut queue = BTreeSet::new();
        for (place, row) in rows.iter().enumerate() {
            queue.insert((row.coefficients.len(), place));
            for &column in row.coefficients.keys() {
                holding[column].insert(place);
            }
        }
        let mut elimination = Self {
            system,
            span,
            rows: rows.into_iter().map(Some).collect(),
            holding,
            queue,
            given: vec![],
        };
        elimination.run()?;
        Ok(elimination)
    }

    /// The rows that are left, by their place in the block.
    pub(super) fn left(&self) -> impl Iterator<Item = (usize, &Row)> {
        let rows = self.rows.iter().enumerate();
        rows.filter_map(|(place, row)| Some((place, row.as_ref()?)))
    }

    /// The unknowns that are left.
    pub(super) fn columns(&self) -> Vec<usize> {
        let mut left: BTreeSet<usize> = (0..self.rows.len()).collect();
        for given in &self.given {
            left.remove(&given.column);
        }
        left.into_iter().collect()
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
            let value = self.system.graph.constant_value(node)?;
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
            self.system
                .budget
                .charge(row.coefficients.len() as u64, self.span)?;
            let Some(mut changed) = self.rows[other].take() else {
                continue;
            };
            self.queue.remove(&(changed.coefficients.len(), other));
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
            self.queue.insert((changed.coefficients.len(), other));
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
        let graph = self.system.graph;
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
        let graph = self.system.graph;
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
