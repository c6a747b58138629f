//! Expressions of the syntax tree to values over the graph; what dotted and subscripted names lead to.

use crate::Assertion;
use std::cell::RefCell;
use std::collections::BTreeSet;

use lynkeus_expr::{Graph, Node, Unary};

use super::scope::{Context, Frame, Local, Mode, Named, Scope};
use super::value::{Scalar, Value, describe_dims, unequal_sizes};
use crate::Tables;
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::{Classes, constant};
use crate::limits::{Budget, MAX_CALL_DEPTH};
use crate::names::did_you_mean;
use crate::syntax::ast::{Ast, ExprId, Kind, PathPart, Term};
use crate::syntax::{plain, shortened};

/// Evaluates expressions of one text. Recursion is bounded by the nesting of the text.
pub(crate) struct Evaluator<'a> {
    pub(super) source: &'a str,
    pub(super) ast: &'a Ast,
    pub(super) graph: &'a Graph,
    pub(super) budget: &'a Budget,
    pub(super) scope: &'a dyn Scope,
    pub(super) mode: Mode,
    /// iterators of the loops around, innermost last
    pub(super) loops: Vec<(&'a str, Scalar)>,
    /// what `end` means in the subscripts around, innermost last
    pub(super) ends: Vec<usize>,
    /// set when an evaluation failed because a parameter has no value
    pub(super) valueless: bool,
    /// the classes of the text, for functions and records
    pub(super) classes: Option<&'a Classes<'a>>,
    /// where names of classes are looked up
    pub(super) scopes: Vec<&'a str>,
    /// variables of the function or algorithm around
    pub(super) frame: Option<Frame>,
    /// functions around, innermost last
    pub(super) calls: Vec<usize>,
    /// expressions and statements around, those of the callers included
    pub(super) depth: usize,
    /// conditions of the `if`s around
    pub(super) conditions: Vec<OnPath>,
    /// what is to hold along a run
    pub(super) claims: Vec<(Assertion, Span)>,
    /// what tables are between their points
    pub(super) tables: Tables,
    /// where it is told of what the points of tables are made
    pub(super) table_points: Option<&'a RefCell<BTreeSet<Node>>>,
}

impl<'a> Evaluator<'a> {
    pub(crate) fn new(
        source: &'a str,
        ast: &'a Ast,
        graph: &'a Graph,
        budget: &'a Budget,
        scope: &'a dyn Scope,
        mode: Mode,
    ) -> Self {
        let (loops, ends, valueless) = (vec![], vec![], false);
        Self {
            source,
            ast,
            graph,
            budget,
            scope,
            mode,
            loops,
            ends,
            valueless,
            classes: None,
            scopes: vec![],
            frame: None,
            calls: vec![],
            depth: 0,
            conditions: vec![],
            claims: vec![],
            tables: Tables::Linear,
            table_points: None,
        }
    }

    /// With the functions and records of a text.
    pub(super) fn within(mut self, context: &Context<'a>) -> Self {
        self.classes = Some(context.classes);
        self.tables = context.options.tables;
        self.table_points = Some(context.table_points);
        self.scopes = context.model.scopes.iter().map(String::as_str).collect();
        self
    }

    pub(super) fn span(&self, id: ExprId) -> Span {
        self.ast.expression(id).span
    }

    pub(super) fn text(&self, span: Span) -> &'a str {
        span.text(self.source)
    }

    /// Goes one level deeper.
    pub(super) fn deeper<T>(
        &mut self,
        span: Span,
        run: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        if self.depth >= MAX_CALL_DEPTH {
            let message = format!(
                "nested more than {MAX_CALL_DEPTH} levels deep where functions are written out"
            );
            return Err(Problem::new(span, message)
                .hint("name the inner parts with variables of their own"));
        }
        self.depth += 1;
        let done = run(self);
        self.depth -= 1;
        done
    }

    /// The value of an expression.
    pub(crate) fn value(&mut self, id: ExprId) -> Result<Value> {
        self.deeper(self.span(id), |evaluator| evaluator.value_here(id))
    }

    fn value_here(&mut self, id: ExprId) -> Result<Value> {
        let expression = self.ast.expression(id);
        let span = expression.span;
        self.budget.charge(1, span)?;
        let scalar = match &expression.kind {
            Kind::Integer(value) => Scalar::Integer(*value),
            Kind::Real(value) => Scalar::Real(self.graph.constant(*value).node()),
            Kind::Boolean(value) => self.truth(*value),
            Kind::Text => {
                return Err(
                    Problem::new(span, "a string here is not supported").hint("use numbers")
                );
            }
            Kind::Path(parts) => return self.path(parts, span),
            Kind::Member(record, name) => return self.member(*record, name, span),
            Kind::All => return Err(Problem::new(span, "`:` stands only in subscripts")),
            Kind::End => self.end(span)?,
            Kind::Name => return self.name(span),
            Kind::Index(base, subscripts) => return self.index(*base, subscripts, span),
            Kind::Call(call) => return self.call(call, span),
            Kind::Array(elements) => return self.array(elements, span),
            Kind::Matrix(rows) => return self.matrix(rows, span),
            Kind::Comprehension(body, iterators) => {
                return self.comprehension(*body, iterators, span);
            }
            Kind::Not(operand) => {
                Scalar::Boolean(self.graph.unary(Unary::Not, self.condition(*operand)?))
            }
            Kind::Plus(operand) => {
                let value = self.value(*operand)?;
                return self.map(value, self.span(*operand), |_, scalar, _| Ok(scalar));
            }
            Kind::Minus(operand) => {
                let value = self.value(*operand)?;
                return self.map(value, self.span(*operand), Self::negated);
            }
            Kind::Chain(head, rest) => return self.chain(*head, rest),
            Kind::Power(base, exponent, elementwise) => {
                let (base, exponent) = (self.value(*base)?, self.value(*exponent)?);
                return self.power(base, exponent, *elementwise, span);
            }
            Kind::Relation(relation, left, right) => self.relation(relation, *left, *right)?,
            Kind::If(branches, otherwise) => return self.conditional(branches, *otherwise),
            Kind::Range(start, step, stop) => return self.range(*start, *step, *stop, span),
        };
        Ok(Value::Scalar(scalar))
    }

    /// The value of an expression that must be scalar.
    pub(crate) fn scalar(&mut self, id: ExprId) -> Result<Scalar> {
        match self.value(id)? {
            Value::Scalar(scalar) => Ok(scalar),
            Value::Array(array) => {
                let found = describe_dims(&array.dims);
                let message = format!("expected a scalar, found an array {found}");
                Err(Problem::new(self.span(id), message))
            }
        }
    }

    /// The value of an expression in which everything must be known.
    pub(crate) fn structural(&mut self, id: ExprId) -> Result<Value> {
        let mode = std::mem::replace(&mut self.mode, Mode::Structural);
        let value = self.value(id);
        self.mode = mode;
        value
    }

    /// An Integer that must be known; `what` names it in the refusal.
    pub(super) fn known_integer(&mut self, id: ExprId, what: &str) -> Result<i64> {
        match self.structural(id)? {
            Value::Scalar(Scalar::Integer(value)) => Ok(value),
            Value::Array(array) => {
                let found = describe_dims(&array.dims);
                let message = format!("{what} must be an Integer, found an array {found}");
                Err(Problem::new(self.span(id), message))
            }
            Value::Scalar(found) => {
                let kind = match found {
                    Scalar::Boolean(_) => "Boolean",
                    _ => "Real",
                };
                let message = format!("{what} must be an Integer, found a {kind}");
                Err(Problem::new(self.span(id), message)
                    .hint("`/` and `^` always give a Real: use `div(a, b)` or `integer(a)`"))
            }
        }
    }

    pub(super) fn truth(&self, value: bool) -> Scalar {
        Scalar::Boolean(self.graph.constant(f64::from(u8::from(value))).node())
    }

    fn end(&self, span: Span) -> Result<Scalar> {
        let size = self.ends.last().and_then(|&size| i64::try_from(size).ok());
        let outside = || Problem::new(span, "`end` stands only in subscripts");
        size.map(Scalar::Integer).ok_or_else(outside)
    }

    pub(super) fn varying(&self, span: Span) -> Box<Problem> {
        let name = self.text(span);
        Problem::new(
            span,
            format!("`{name}` is a variable, but a known value is needed here"),
        )
        .hint("sizes, loop bounds, subscripts, attributes and parameters use parameters only")
    }

    pub(super) fn without_value(&mut self, span: Span) -> Box<Problem> {
        self.valueless = true;
        let name = self.text(span);
        Problem::new(
            span,
            format!("parameter `{name}` has no value, but one is needed here"),
        )
        .hint(format!(
            "write `{name} = …` in its declaration, or give the value on loading"
        ))
    }

    pub(super) fn unknown_name(&self, span: Span) -> Box<Problem> {
        let name = self.text(span);
        if name == "time" {
            return self.varying(span);
        }
        let message = format!("unknown name `{}`", shortened(name));
        if name.contains('.') {
            let declared = self.scope.names();
            let hint = did_you_mean(name, declared.into_iter()).unwrap_or_else(|| {
                "components of other models are not supported, nor other constants of the \
                 library than those of `Modelica.Constants`"
                    .to_owned()
            });
            return Problem::new(span, message).hint(hint);
        }
        let iterators = self.loops.iter().map(|(iterator, _)| *iterator);
        let declared = self.scope.names();
        let known = declared.into_iter().chain(iterators).chain(["time"]);
        let suggestion = did_you_mean(name, known);
        let for_pi = (name == "pi").then(|| "write `Modelica.Constants.pi`".to_owned());
        Problem::new(span, message).maybe_hint(for_pi.or(suggestion))
    }

    fn chain(&mut self, head: ExprId, rest: &'a [Term]) -> Result<Value> {
        let mut value = self.value(head)?;
        let start = self.span(head);
        for &(operation, elementwise, operand) in rest {
            let right = self.value(operand)?;
            let span = start.to(self.span(operand));
            value = self.binary(operation, elementwise, value, right, span)?;
        }
        Ok(value)
    }

    fn relation(&mut self, relation: &str, left: ExprId, right: ExprId) -> Result<Scalar> {
        let span = self.span(left).to(self.span(right));
        let (left, right) = (self.scalar(left)?, self.scalar(right)?);
        self.compare(relation, left, right, span)
    }

    /// The truth value of a condition.
    pub(crate) fn condition(&mut self, id: ExprId) -> Result<Node> {
        let value = self.value(id)?;
        self.boolean(&value, self.span(id))
    }

    fn conditional(
        &mut self,
        branches: &'a [(ExprId, ExprId)],
        otherwise: ExprId,
    ) -> Result<Value> {
        let branches = self.branches(branches.iter().copied(), otherwise)?;
        let around = self.pass(&branches);
        let result = self.chosen(branches);
        self.conditions.truncate(around);
        result
    }

    /// The values of the branches, joined.
    fn chosen(&mut self, branches: Branches<ExprId>) -> Result<Value> {
        let mut result = self.value(branches.last)?;
        for (condition, value) in branches.open.into_iter().rev() {
            let span = self.span(value);
            self.enter();
            let value = self.value(value)?;
            self.conditions.pop();
            if value.dims() != result.dims() {
                return Err(unequal_sizes(value.dims(), result.dims(), span));
            }
            result = self.elementwise(value, result, span, |evaluator, a, b, span| {
                evaluator.select(condition, a, b, span)
            })?;
        }
        Ok(result)
    }
}

/// A condition of an `if` around, and whether it holds in the branch that is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnPath {
    pub condition: Node,
    pub holds: bool,
}

/// What a branch may hold, where that is not known before the variables are.
pub(super) struct Branches<T> {
    /// conditions that may hold, with their branches
    pub open: Vec<(Node, T)>,
    /// the branch where none of them does
    pub last: T,
}

impl Evaluator<'_> {
    /// A condition that is known takes its branch or leaves it unread, so that a loop may hold
    /// `if i == 1 then … else x[i - 1]`.
    pub(super) fn branches<T>(
        &mut self,
        branches: impl Iterator<Item = (ExprId, T)>,
        otherwise: T,
    ) -> Result<Branches<T>> {
        let mut open = vec![];
        for (condition, branch) in branches {
            let node = self.condition(condition)?;
            match self.graph.constant_value(node) {
                Some(0.0) => {}
                Some(_) => return Ok(Branches { open, last: branch }),
                None => open.push((node, branch)),
            }
        }
        Ok(Branches {
            open,
            last: otherwise,
        })
    }

    /// Notes that none of the conditions holds; gives how many there were around.
    pub(super) fn pass<T>(&mut self, branches: &Branches<T>) -> usize {
        let around = self.conditions.len();
        let passed = branches.open.iter().map(|&(condition, _)| OnPath {
            condition,
            holds: false,
        });
        self.conditions.extend(passed);
        around
    }

    /// The last condition that was passed holds.
    pub(super) fn enter(&mut self) {
        if let Some(on_path) = self.conditions.last_mut() {
            on_path.holds = true;
        }
    }
}

impl<'a> Evaluator<'a> {
    pub(super) fn name(&mut self, span: Span) -> Result<Value> {
        let name = plain(self.text(span));
        if let Some(scalar) = self.iterator(&name) {
            return Ok(Value::Scalar(scalar));
        }
        match self.local(&name) {
            Some(Ok(local)) => {
                self.budget.charge(local.elements.len() as u64, span)?;
                return local.value().ok_or_else(|| self.unassigned(&name, span));
            }
            Some(Err(())) => return self.outside_of_function(&name, span),
            None => {}
        }
        let found = self.named(&name);
        if let Named::Array([_, ..], elements) = found {
            self.budget.charge(elements.len() as u64, span)?;
        }
        match found {
            Named::Unknown => match self.builtin(&name) {
                Some(scalar) => Ok(Value::Scalar(scalar)),
                None => Err(self.unknown_name(span)),
            },
            found => self.meant(found, span),
        }
    }

    /// The value that a name means.
    pub(super) fn meant(&mut self, found: Named<'a>, span: Span) -> Result<Value> {
        match found {
            Named::Array([], [scalar]) => Ok(Value::Scalar(*scalar)),
            Named::Array(dims, elements) => Ok(Value::new(dims.to_vec(), elements.to_vec())),
            Named::Scalar(scalar) => Ok(Value::Scalar(scalar)),
            Named::Varying => Err(self.varying(span)),
            Named::Valueless => Err(self.without_value(span)),
            Named::Unknown => Err(self.unknown_name(span)),
        }
    }

    pub(super) fn iterator(&self, name: &str) -> Option<Scalar> {
        let mut loops = self.loops.iter().rev();
        loops
            .find(|(iterator, _)| plain(iterator) == name)
            .map(|(_, value)| *value)
    }

    /// The scope's meaning of a name, in full or as an import shortens it.
    pub(super) fn named(&self, name: &str) -> Named<'a> {
        // The scope outlives this evaluator.
        let scope = self.scope;
        if !self.is_closed() {
            match scope.named(name, self.mode) {
                Named::Unknown => {}
                found => return found,
            }
        }
        let full = self.full_names(name).into_iter();
        let mut found = full.map(|full| scope.constant(&full, self.mode));
        found
            .find(|found| !matches!(found, Named::Unknown))
            .unwrap_or(Named::Unknown)
    }

    /// In a function the model's own names mean nothing.
    pub(super) fn is_closed(&self) -> bool {
        self.frame.as_ref().is_some_and(|frame| frame.is_function)
    }

    pub(super) fn full_names(&self, name: &str) -> Vec<String> {
        match self.classes {
            Some(classes) if !self.scopes.is_empty() => classes.full_names(name, &self.scopes),
            _ => vec![],
        }
    }

    /// Names in a function lead to its own variables, and to constants.
    fn outside_of_function(&mut self, name: &str, span: Span) -> Result<Value> {
        let mode = std::mem::replace(&mut self.mode, Mode::Structural);
        let found = self.named(name);
        self.mode = mode;
        match found {
            found @ (Named::Array(..) | Named::Scalar(_)) => self.meant(found, span),
            _ => match self.builtin(name) {
                Some(scalar) => Ok(Value::Scalar(scalar)),
                None if self.scope.dims(name).is_some() => {
                    let message = format!("`{name}` is not a variable of this function");
                    Err(Problem::new(span, message)
                        .hint("functions read their own variables and constants: add an input"))
                }
                None => Err(self.unknown_name(span)),
            },
        }
    }

    fn builtin(&self, name: &str) -> Option<Scalar> {
        if name == "time" {
            return self.scope.time(self.mode).map(Scalar::Real);
        }
        if let Some(classes) = self.classes
            && let Some(ordinal) = classes.literal(name, &self.scopes)
        {
            return Some(Scalar::Integer(ordinal));
        }
        let known = constant(name);
        let known = known.or_else(|| self.full_names(name).iter().find_map(|full| constant(full)));
        Some(Scalar::Real(self.graph.constant(known?).node()))
    }

    pub(super) fn unassigned(&self, name: &str, span: Span) -> Box<Problem> {
        Problem::new(
            span,
            format!("`{name}` is read before it has a value in every case"),
        )
        .hint("assign it first, in each branch of an `if`")
    }

    /// `a[1].b[2].c`: a name as it is written, or the member `a.b.c` with all subscripts.
    pub(super) fn path(&mut self, parts: &'a [PathPart], span: Span) -> Result<Value> {
        let whole = plain(self.text(span));
        if self.is_known(&whole) {
            return self.name(span);
        }
        let (subscripts, named) = joined(parts, self.source);
        let literal = self.with_numbers(parts);
        if let Some(literal) = literal.filter(|literal| self.is_known(literal)) {
            return self.value_named(&literal, span);
        }
        self.index_named(&named, &subscripts, span)
    }

    fn is_known(&self, name: &str) -> bool {
        matches!(self.local(name), Some(Ok(_))) || !matches!(self.named(name), Named::Unknown)
    }

    /// `c[2].x` for `c[i].x` with i = 2; `None` where a subscript is a range.
    fn with_numbers(&mut self, parts: &'a [PathPart]) -> Option<String> {
        let mut name = String::new();
        for part in parts {
            if !name.is_empty() {
                name.push('.');
            }
            name.push_str(&plain(self.text(part.name)));
            let mut numbers = vec![];
            for &subscript in &part.subscripts {
                numbers.push(
                    self.known_integer(subscript, "a subscript")
                        .ok()?
                        .to_string(),
                );
            }
            if !numbers.is_empty() {
                name.push_str(&format!("[{}]", numbers.join(",")));
            }
        }
        Some(name)
    }

    pub(super) fn value_named(&mut self, name: &str, span: Span) -> Result<Value> {
        if let Some(Ok(local)) = self.local(name) {
            return local.value().ok_or_else(|| self.unassigned(name, span));
        }
        self.meant(self.named(name), span)
    }

    /// A variable of the function or algorithm around; `Err` where a function has none of that
    /// name.
    pub(super) fn local(&self, name: &str) -> Option<std::result::Result<&Local, ()>> {
        let frame = self.frame.as_ref()?;
        match frame.locals.get(name) {
            Some(local) => Some(Ok(local)),
            None if frame.is_function => Some(Err(())),
            None => None,
        }
    }
}

/// The subscripts of all parts, and their names joined.
pub(super) fn joined(parts: &[PathPart], source: &str) -> (Vec<ExprId>, String) {
    let subscripts = parts
        .iter()
        .flat_map(|part| part.subscripts.iter().copied());
    let names = parts.iter().map(|part| plain(part.name.text(source)));
    (subscripts.collect(), names.collect::<Vec<_>>().join("."))
}
