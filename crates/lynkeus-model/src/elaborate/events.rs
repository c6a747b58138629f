//! Events of the text: `when` clauses, what they assign and reset, and what is said of the time
//! before them.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::clauses::{Change, FlatClause};
use super::evaluate::Evaluator;
use super::scope::{Frame, Local, Named};
use super::symbols::{Symbols, is_outer_input};
use super::value::{Scalar, Value, element_name};
use crate::balance::FlatEquation;
use crate::diagnostic::{Problem, Result, Span};
use crate::plant::{Clause, Timer, Whens};
use crate::syntax::ast::{Call, Declaration, Equation, ExprId, Statement, StatementKind, TypeName};

const HOW_PRE: &str =
    "`pre` takes Boolean, Integer and `discrete` variables; that of a state stands in a `when`";

impl Symbols<'_> {
    /// The symbol of the value before an event.
    fn before(&self, variable: Node, at: Span) -> Node {
        let mut events = self.events.borrow_mut();
        let known = events.before.entry(variable).or_insert_with(|| {
            let name = self.graph.symbol_name(variable).unwrap_or_default();
            (self.graph.fresh(format!("pre({name})")).node(), at)
        });
        known.0
    }

    /// The symbol that is 1 at the times start + k·interval.
    fn timer(&self, start: f64, interval: f64, is_initial: bool) -> Node {
        let mut events = self.events.borrow_mut();
        let mut timers = events.timers.iter();
        let same =
            |t: &&Timer| t.is_initial == is_initial && t.start == start && t.interval == interval;
        if let Some(known) = timers.find(same) {
            return known.symbol;
        }
        let name = match is_initial {
            true => "initial()".to_owned(),
            false => format!("sample({start}, {interval})"),
        };
        let symbol = self.graph.fresh(name).node();
        events.timers.push(Timer {
            symbol,
            start,
            interval,
            is_initial,
        });
        symbol
    }
}

impl Symbols<'_> {
    /// The variables by the symbols of their values before an event.
    pub(super) fn now(&self) -> HashMap<Node, Node> {
        let events = self.events.borrow();
        events
            .before
            .iter()
            .map(|(now, (before, _))| (*before, *now))
            .collect()
    }
}

impl<'a> Evaluator<'a> {
    /// `pre(x)`.
    pub(super) fn before(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let value = self.value(argument)?;
        self.at = self.span(argument);
        self.map(value, |scalar| match scalar {
            Scalar::Integer(_) => Ok(scalar),
            Scalar::Real(node) => Ok(Scalar::Real(self.node_before(node)?)),
            Scalar::Boolean(node) => Ok(Scalar::Boolean(self.node_before(node)?)),
        })
    }

    fn node_before(&self, node: Node) -> Result<Node> {
        if self.graph.constant_value(node).is_some() || self.symbols.parameters.contains(&node) {
            return Ok(node);
        }
        if self.graph.symbol_name(node).is_none() || node == self.symbols.time() {
            let message = "`pre` takes a variable, not an expression";
            return Err(self.problem(message).hint(HOW_PRE));
        }
        Ok(self.symbols.before(node, self.at))
    }

    /// `edge(b)`: b and not pre(b).
    pub(super) fn edge(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let value = self.value(argument)?;
        self.at = self.span(argument);
        self.map(value, |scalar| match scalar {
            Scalar::Boolean(node) => {
                let not_before = self.graph.unary(Unary::Not, self.node_before(node)?);
                let both = self.graph.binary(Binary::And, node, not_before);
                Ok(Scalar::Boolean(both))
            }
            _ => Err(self.problem("`edge` takes a Boolean variable")),
        })
    }

    /// `change(v)`: v <> pre(v).
    pub(super) fn change(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let value = self.value(argument)?;
        self.at = self.span(argument);
        self.map(value, |scalar| {
            let node = match scalar {
                Scalar::Boolean(node) => node,
                other => self.real(other)?,
            };
            let same = self
                .graph
                .binary(Binary::Equal, node, self.node_before(node)?);
            Ok(Scalar::Boolean(self.graph.unary(Unary::Not, same)))
        })
    }

    /// `sample(start, interval)`.
    pub(super) fn sample(&mut self, call: &'a Call) -> Result<Value> {
        let [start, interval] = self.arguments(call)?;
        let mut numbers = [0.0; 2];
        for (number, id) in numbers.iter_mut().zip([start, interval]) {
            let value = self.structural(id)?.as_scalar();
            let known = value.and_then(|value| value.number(self.graph));
            *number = known.filter(|n| n.is_finite()).ok_or_else(|| {
                Problem::new(self.span(id), "`sample` takes two numbers that are known")
            })?;
        }
        if numbers[1] <= 0.0 {
            let message = format!("`sample` every {}: expected a time above 0", numbers[1]);
            return Err(Problem::new(self.span(interval), message));
        }
        self.in_a_when(call)?;
        let symbol = self.symbols.timer(numbers[0], numbers[1], false);
        Ok(Scalar::Boolean(symbol).into())
    }

    /// `initial()`.
    pub(super) fn initial(&mut self, call: &'a Call) -> Result<Value> {
        let [] = self.arguments(call)?;
        self.in_a_when(call)?;
        let symbol = self.symbols.timer(0.0, f64::INFINITY, true);
        Ok(Scalar::Boolean(symbol).into())
    }

    fn in_a_when(&self, call: &Call) -> Result<()> {
        match self.is_in_when {
            true => Ok(()),
            false => {
                let message = format!("`{}` outside of a `when`", self.text(call.function));
                Err(Problem::new(call.function, message)
                    .hint("it is the condition of a `when`, or a part of one"))
            }
        }
    }

    /// A `when` equation with its `elsewhen`s.
    pub(super) fn when(&mut self, clauses: &'a [(ExprId, Vec<Equation>)]) -> Result<()> {
        self.refuse_inside()?;
        let (group, span) = (self.clauses.len(), self.at);
        for (condition, body) in clauses {
            self.is_in_when = true;
            let done = self
                .conditions_of(*condition)
                .and_then(|conditions| Ok((conditions, self.apart(body)?)));
            self.is_in_when = false;
            let (conditions, equations) = done?;
            let assigned = equations.into_iter().map(|e| (e.left, e.right, e.span));
            let clause = FlatClause {
                group,
                conditions,
                assigned: assigned.collect(),
                resets: std::mem::take(&mut self.resets),
                span: self.span(*condition).to(span),
            };
            self.clauses.push(clause);
        }
        Ok(())
    }

    fn refuse_inside(&self) -> Result<()> {
        let message = match self.is_in_when {
            true => "a `when` within a `when`",
            false if !self.conditions.is_empty() => "a `when` under a condition that varies",
            false => return Ok(()),
        };
        let hint = "write one condition: `when a and b then …`";
        Err(self.problem(message).hint(hint))
    }

    /// One condition, or one of several that comes to hold.
    fn conditions_of(&mut self, id: ExprId) -> Result<Vec<Node>> {
        let value = self.value(id)?;
        let condition = |scalar: &Scalar| self.boolean(&(*scalar).into(), self.span(id));
        value.elements.iter().map(condition).collect()
    }

    /// `reinit(x, e)`, under the conditions of the `if`s around.
    pub(super) fn reinit(&mut self, state: ExprId, value: ExprId) -> Result<()> {
        if !self.is_in_when {
            let hint = "it says what a state jumps to when something happens";
            return Err(self.problem("a `reinit` outside of a `when`").hint(hint));
        }
        let (at, state, value) = (self.at, self.value(state)?, self.value(value)?);
        self.at = at;
        if state.dims != value.dims {
            return Err(self.problem("the state and its new value differ in size"));
        }
        for (state, value) in state.elements.iter().zip(&value.elements) {
            let (state, mut value) = (self.real(*state)?, self.real(*value)?);
            let otherwise = self.symbols.before(state, at);
            for &(condition, holds) in &self.conditions {
                let [yes, no] = if holds {
                    [value, otherwise]
                } else {
                    [otherwise, value]
                };
                value = self.graph.select(condition, yes, no);
            }
            self.resets.push((state, value, at));
        }
        Ok(())
    }

    /// A section of `when` statements: variables have their values before the event until they are
    /// assigned.
    pub(super) fn when_statements(&mut self, statements: &'a [Statement]) -> Result<()> {
        for statement in statements {
            let StatementKind::When(clauses) = &statement.kind else {
                let message = "statements beside a `when` in one section `algorithm`";
                return Err(Problem::new(statement.span, message)
                    .hint("give them a section of their own, or write equations"));
            };
            let group = self.clauses.len();
            for (condition, body) in clauses {
                self.standing(statement.span, |e| {
                    e.when_statement(group, *condition, body)
                })?;
            }
        }
        Ok(())
    }

    fn when_statement(
        &mut self,
        group: usize,
        condition: ExprId,
        body: &'a [Statement],
    ) -> Result<()> {
        let span = self.at;
        self.is_in_when = true;
        let conditions = self.conditions_of(condition);
        let frame = conditions.is_ok().then(|| self.frame_before(body));
        let done = frame.transpose().and_then(|frame| {
            self.frame = frame.unwrap_or_default();
            self.execute(body)
        });
        self.is_in_when = false;
        let frame = std::mem::take(&mut self.frame);
        let conditions = conditions?;
        done?;
        let mut assigned = vec![];
        for (name, local) in &frame.locals {
            let Named::Array(dims, elements) = self.named(name) else {
                continue;
            };
            for (offset, (variable, value)) in elements.iter().zip(&local.elements).enumerate() {
                let value = value.ok_or_else(|| {
                    let full = element_name(name, dims, offset);
                    self.unassigned(&full, span)
                })?;
                let pair = variable.with(value, self.graph);
                let (variable, value) = pair.ok_or_else(|| {
                    self.problem("a Boolean and a number on the two sides of `:=`")
                })?;
                assigned.push((variable, value, span));
            }
        }
        self.clauses.push(FlatClause {
            group,
            conditions,
            assigned,
            resets: vec![],
            span: self.span(condition),
        });
        Ok(())
    }

    /// The variables that statements assign, with their values before the event.
    fn frame_before(&mut self, body: &'a [Statement]) -> Result<Frame> {
        let mut names = vec![];
        super::execute::targets(self.source, self.ast, body, &mut names);
        let mut frame = Frame::default();
        for name in names {
            if let Named::Array(dims, elements) = self.named(&name) {
                let is_integer = elements.iter().all(|e| matches!(e, Scalar::Integer(_)));
                let mut local = Local::without_value(dims.to_vec(), is_integer);
                for (value, scalar) in local.elements.iter_mut().zip(elements) {
                    *value = Some(match *scalar {
                        Scalar::Integer(_) => *scalar,
                        Scalar::Real(node) => Scalar::Real(self.node_before(node)?),
                        Scalar::Boolean(node) => Scalar::Boolean(self.node_before(node)?),
                    });
                }
                frame.locals.insert(name, local);
            }
        }
        Ok(frame)
    }
}

/// Makes states of the variables that change at events alone, and clauses of the equations that
/// read what was before them.
pub(super) fn discrete(
    symbols: &Symbols<'_>,
    equations: &mut Vec<FlatEquation>,
    clauses: &mut Vec<FlatClause>,
) -> Result<()> {
    let declared = declarations(symbols);
    let name = |node: Node| symbols.graph.symbol_name(node).unwrap_or_default();
    let mut owner: HashMap<Node, usize> = HashMap::new();
    for clause in &*clauses {
        for &(target, _, span) in &clause.assigned {
            check_target(symbols, &declared, target, span)?;
            if *owner.entry(target).or_insert(clause.group) != clause.group {
                let message = format!("`{}` is assigned in two `when`s", name(target));
                return Err(Problem::new(span, message)
                    .hint("join them with `elsewhen`: who comes first must be known"));
            }
        }
        for &(state, _, span) in &clause.resets {
            if symbols.derivative_of(state).is_none() {
                let message = format!("`reinit` of `{}`, which is no state", name(state));
                return Err(Problem::new(span, message)
                    .hint("only a variable under `der` is reset; any other is assigned: `x = …`"));
            }
        }
    }
    let found = always(symbols, &declared, equations, &owner)?;
    owner.extend(
        found
            .iter()
            .map(|clause| (clause.assigned[0].0, usize::MAX)),
    );
    clauses.splice(0..0, found);
    check_before(symbols, &declared, equations, &owner)?;
    for clause in clauses {
        for &(target, _, span) in &clause.assigned {
            hold(symbols, equations, target, span);
        }
    }
    Ok(())
}

type Declared<'a> = HashMap<Node, &'a Declaration>;

fn declarations<'a>(symbols: &Symbols<'a>) -> Declared<'a> {
    let varying = symbols.all().filter(|(.., component)| !component.is_known);
    let elements = varying.flat_map(|(_, declaration, component)| {
        let nodes = component.elements.iter();
        nodes.filter_map(move |scalar| match *scalar {
            Scalar::Real(node) | Scalar::Boolean(node) => Some((node, declaration)),
            Scalar::Integer(_) => None,
        })
    });
    elements.collect()
}

fn check_target(
    symbols: &Symbols<'_>,
    declared: &Declared<'_>,
    target: Node,
    span: Span,
) -> Result<()> {
    let Some(declaration) = declared.get(&target) else {
        let message = "an equation of a `when` reads `variable = …`";
        return Err(Problem::new(span, message)
            .hint("branches of an `if` in it assign the same variables, in the same order"));
    };
    let label = &declaration.label;
    let (message, hint) = if symbols.derivative_of(target).is_some() {
        let message = format!("`{label}` is a state: its value is no equation of a `when`");
        (message, "write `reinit(x, …)`")
    } else if is_outer_input(declaration) {
        let message = format!("the input `{label}` is assigned in a `when`");
        (message, "inputs come from outside")
    } else if declaration.binding.is_some() {
        let message =
            format!("`{label}` has an equation where it is declared, and one in a `when`");
        (message, "give its first value with `start = …`")
    } else {
        return Ok(());
    };
    Err(Problem::new(span, message).hint(hint))
}

/// Whether a variable may change at events alone.
fn is_discrete(declaration: &Declaration) -> bool {
    declaration.is_discrete
        || declaration.type_name == TypeName::Boolean
        || declaration.type_name == TypeName::Integer
}

/// Takes the equations out that give discrete variables of which somebody asks what they were, or by
/// what was: they hold at every event, and between two of them nothing changes.
fn always(
    symbols: &Symbols<'_>,
    declared: &Declared<'_>,
    equations: &mut Vec<FlatEquation>,
    owner: &HashMap<Node, usize>,
) -> Result<Vec<FlatClause>> {
    let events = symbols.events.borrow();
    if events.before.is_empty() {
        return Ok(vec![]);
    }
    let before: HashSet<Node> = events.before.values().map(|known| known.0).collect();
    let variable = |node: &Node| {
        let is_own = declared.get(node).is_some_and(|d| is_discrete(d));
        is_own && !owner.contains_key(node)
    };
    let mut found = vec![];
    let mut taken: HashSet<Node> = HashSet::new();
    equations.retain(|equation| {
        let sides = [equation.left, equation.right];
        let reads = symbols.graph.symbols_of(&sides);
        let asks = reads.iter().any(|symbol| before.contains(symbol));
        let place = sides.iter().position(|side| {
            variable(side) && !taken.contains(side) && (asks || events.before.contains_key(side))
        });
        let Some(place) = place else {
            return true;
        };
        taken.insert(sides[place]);
        found.push(FlatClause {
            group: usize::MAX,
            conditions: vec![],
            assigned: vec![(sides[place], sides[1 - place], equation.span)],
            resets: vec![],
            span: equation.span,
        });
        false
    });
    Ok(found)
}

/// That what was before events is asked of what has it, and where it may be.
fn check_before(
    symbols: &Symbols<'_>,
    declared: &Declared<'_>,
    equations: &[FlatEquation],
    owner: &HashMap<Node, usize>,
) -> Result<()> {
    let events = symbols.events.borrow();
    for (variable, (_, span)) in &events.before {
        if owner.contains_key(variable) || symbols.derivative_of(*variable).is_some() {
            continue;
        }
        let name = symbols.graph.symbol_name(*variable).unwrap_or_default();
        let message = match declared.get(variable).is_some_and(|d| is_discrete(d)) {
            true => format!("`pre({name})`: no equation reads `{name} = …`"),
            false => format!("`pre({name})`: `{name}` is not discrete"),
        };
        return Err(Problem::new(*span, message).hint(HOW_PRE));
    }
    let before: HashSet<Node> = events.before.values().map(|known| known.0).collect();
    if before.is_empty() {
        return Ok(());
    }
    for equation in equations {
        let read = symbols.graph.symbols_of(&[equation.left, equation.right]);
        if read.iter().any(|symbol| before.contains(symbol)) {
            let message =
                "`pre`, `edge` or `change` in an equation of something that is not discrete";
            return Err(Problem::new(equation.span, message)
                .hint("between two events nothing was before: write it in a `when`"));
        }
    }
    Ok(())
}

/// A variable that stays between two events: a state at rest.
fn hold(symbols: &Symbols<'_>, equations: &mut Vec<FlatEquation>, variable: Node, span: Span) {
    if symbols.derivative_of(variable).is_some() {
        return;
    }
    symbols.derivatives.borrow_mut().insert(variable, None);
    if let Some(left) = symbols.derivative(variable) {
        equations.push(FlatEquation {
            left,
            right: symbols.graph.constant(0.0).node(),
            span,
            element: None,
        });
    }
}

/// The variables that clauses assign.
pub(super) fn held(clauses: &[FlatClause]) -> HashSet<Node> {
    let changes = clauses.iter().flat_map(|clause| &clause.assigned);
    changes.map(|change| change.0).collect()
}

/// The clauses over states, inputs and time: algebraic variables have their solution, and what a
/// clause assigns is known to the rest of it.
pub(super) fn whens(
    symbols: &Symbols<'_>,
    clauses: &[FlatClause],
    solution: &HashMap<Node, Node>,
    states: &[Node],
) -> Result<Whens> {
    if clauses.is_empty() {
        return Ok(Whens::default());
    }
    let graph = symbols.graph;
    let discrete = held(clauses);
    let flowing = states.iter().filter(|state| !discrete.contains(state));
    let flowing: HashMap<Node, Node> = flowing
        .map(|&state| (state, symbols.before(state, Span::default())))
        .collect();
    let mut found = vec![];
    for clause in clauses {
        let conditions = graph.substitute(&clause.conditions, solution);
        if conditions
            .iter()
            .any(|&condition| !is_told(graph, condition, &flowing))
        {
            let message = "the condition of this `when` changes where no relation does";
            return Err(Problem::new(clause.span, message)
                .hint("write it with `<`, `<=`, `>` or `>=`: `x >= n` for `integer(x) == n`"));
        }
        let mut known: HashMap<Node, Node> = HashMap::new();
        let solved = |change: &Change| {
            (
                change.0,
                graph.substitute(&[change.1], solution)[0],
                change.2,
            )
        };
        let mut open: Vec<Change> = clause.assigned.iter().map(solved).collect();
        while !open.is_empty() {
            let targets: HashSet<Node> = open.iter().map(|change| change.0).collect();
            let is_ready = |change: &Change| {
                let read = graph.symbols_of(&[change.1]);
                !read.iter().any(|symbol| targets.contains(symbol))
            };
            let Some(place) = open.iter().position(is_ready) else {
                let (target, _, span) = open[0];
                let name = graph.symbol_name(target).unwrap_or_default();
                let message = format!("the new value of `{name}` needs itself");
                return Err(Problem::new(span, message)
                    .hint(format!("what it was before the event is `pre({name})`")));
            };
            let (target, value, _) = open.remove(place);
            let value = graph.substitute(&[value], &known)[0];
            known.insert(target, value);
            for change in &mut open {
                change.1 = graph.substitute(&[change.1], &HashMap::from([(target, value)]))[0];
            }
        }
        let resets = clause.resets.iter().map(solved);
        let resets = resets.map(|(state, value, _)| (state, graph.substitute(&[value], &known)[0]));
        let assigned = clause
            .assigned
            .iter()
            .map(|change| (change.0, known[&change.0]));
        let changes: Vec<(Node, Node)> = assigned.chain(resets).collect();
        // what is always so reads the states as they are now
        let is_always = clause.conditions.is_empty();
        let fixed = |&(state, value): &(Node, Node)| match is_always {
            true => (state, value),
            false => (state, graph.substitute(&[value], &flowing)[0]),
        };
        found.push(Clause {
            group: clause.group,
            conditions,
            changes: changes.iter().map(fixed).collect(),
            line: clause.span.line(symbols.source),
        });
    }
    let events = symbols.events.borrow();
    let before = |&state: &Node| Some((state, events.before.get(&state)?.0));
    Ok(Whens {
        clauses: found,
        before: states.iter().filter_map(before).collect(),
        timers: events.timers.clone(),
    })
}

/// Whether a condition changes only where a relation in it does, as a flow moves these states.
fn is_told(graph: &Graph, condition: Node, flowing: &HashMap<Node, Node>) -> bool {
    let mut open = vec![condition];
    while let Some(node) = open.pop() {
        match graph.op(node) {
            Op::Binary(Binary::Less | Binary::LessEq, ..) => {}
            Op::Binary(Binary::And | Binary::Or | Binary::Equal, ..)
            | Op::Unary(Unary::Not, _)
            | Op::Select(..) => open.extend(graph.arguments(node)),
            _ => {
                let read = graph.symbols_of(&[node]);
                if read.iter().any(|symbol| flowing.contains_key(symbol)) {
                    return false;
                }
            }
        }
    }
    true
}
