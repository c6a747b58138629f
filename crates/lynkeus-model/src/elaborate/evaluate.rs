//! Expressions of the syntax tree to values over the graph; what dotted and subscripted names lead to.

use lynkeus_expr::{Graph, Node, Unary};

use super::clauses::{Change, FlatClause};
use super::scope::{Frame, Local, Mode, Named};
use super::symbols::Symbols;
use super::value::{Scalar, Value, describe_dims, expected_number};
use crate::Assertion;
use crate::balance::FlatEquation;
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::constant;
use crate::limits::{Budget, MAX_CALL_DEPTH};
use crate::names::did_you_mean;
use crate::syntax::ast::{Ast, Declaration, ExprId, Kind, PathPart, Term};
use crate::syntax::{plain, shortened};

/// What to do about a Real where an Integer is needed.
pub(super) const HOW_TO_BE_WHOLE: &str =
    "`/` and `^` always give a Real: use `div(a, b)` or `integer(a)`";

/// Evaluates expressions of one text, carries out its statements and writes out its equations.
/// Recursion is bounded by the nesting of the text.
pub(crate) struct Evaluator<'a> {
    pub(super) source: &'a str,
    pub(super) ast: &'a Ast,
    pub(super) graph: &'a Graph,
    pub(super) budget: &'a Budget,
    pub(super) symbols: &'a Symbols<'a>,
    pub(super) mode: Mode,
    /// where what is read now stands: an expression, an equation, a statement
    pub(super) at: Span,
    /// iterators of the loops around, innermost last
    pub(super) loops: Vec<(&'a str, Scalar)>,
    /// what `end` means in the subscripts around, innermost last
    pub(super) ends: Vec<usize>,
    /// set when an evaluation failed because a parameter has no value
    pub(super) valueless: bool,
    /// where names of classes are looked up
    pub(super) scopes: Vec<&'a str>,
    /// variables of the function or algorithm around
    pub(super) frame: Frame,
    /// names of the functions around, innermost last
    pub(super) calls: Vec<&'a str>,
    /// expressions and statements around, those of the callers included
    pub(super) depth: usize,
    /// conditions of the `if`s around, each with whether it holds in the branch that is taken
    pub(super) conditions: Vec<(Node, bool)>,
    /// what is to hold along a run
    pub(super) claims: Vec<(Assertion, Span)>,
    pub(super) equations: Vec<FlatEquation>,
    /// what is read now stands in a `when`
    pub(super) is_in_when: bool,
    pub(super) clauses: Vec<FlatClause>,
    /// of the `when` that is read now
    pub(super) resets: Vec<Change>,
}

impl<'a> Evaluator<'a> {
    pub(crate) fn new(symbols: &'a Symbols<'a>, mode: Mode) -> Self {
        let scopes = symbols.model.scopes.iter();
        Self {
            source: symbols.source,
            ast: symbols.ast,
            graph: symbols.graph,
            budget: &symbols.budget,
            symbols,
            mode,
            at: Span::default(),
            loops: vec![],
            ends: vec![],
            valueless: false,
            scopes: scopes.map(String::as_str).collect(),
            frame: Frame::default(),
            calls: vec![],
            depth: 0,
            conditions: vec![],
            claims: vec![],
            equations: vec![],
            is_in_when: false,
            clauses: vec![],
            resets: vec![],
        }
    }

    /// For what stands in a declaration: in one of a package, only what that knows.
    pub(super) fn of(symbols: &'a Symbols<'a>, declaration: &'a Declaration, mode: Mode) -> Self {
        let mut evaluator = Self::new(symbols, mode);
        if let Some(package) = &declaration.package {
            evaluator.scopes = vec![package];
            evaluator.frame = Frame::closed();
        }
        evaluator
    }

    pub(super) fn span(&self, id: ExprId) -> Span {
        self.ast.expression(id).span
    }

    pub(super) fn text(&self, span: Span) -> &'a str {
        span.text(self.source)
    }

    /// What is wrong here.
    pub(super) fn problem(&self, message: impl Into<String>) -> Problem {
        Problem::new(self.at, message)
    }

    /// Takes what is written out here from the budget.
    pub(super) fn charge(&self, count: u64) -> Result<()> {
        self.budget.charge(count, self.at)
    }

    /// Reads what stands at another place.
    pub(super) fn standing<T>(
        &mut self,
        at: Span,
        run: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let around = std::mem::replace(&mut self.at, at);
        let done = run(self);
        self.at = around;
        done
    }

    /// Reads what stands there, one level deeper.
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
        let done = self.standing(span, run);
        self.depth -= 1;
        done
    }

    /// The value of an expression.
    pub(crate) fn value(&mut self, id: ExprId) -> Result<Value> {
        self.deeper(self.span(id), |evaluator| evaluator.value_here(id))
    }

    fn value_here(&mut self, id: ExprId) -> Result<Value> {
        let expression = self.ast.expression(id);
        self.charge(1)?;
        match &expression.kind {
            Kind::Integer(value) => Ok(Scalar::Integer(*value).into()),
            Kind::Real(value) => Ok(Scalar::Real(self.graph.constant(*value).node()).into()),
            Kind::Boolean(value) => {
                let truth = self.graph.constant(f64::from(*value));
                Ok(Scalar::Boolean(truth.node()).into())
            }
            Kind::Text => Err(self
                .problem("a string here is not supported")
                .hint("use numbers")),
            Kind::Path(parts) => self.path(id, parts),
            Kind::Member(record, name) => self.member(*record, name),
            Kind::All => Err(self.problem("`:` stands only in subscripts")),
            Kind::End => self.end(),
            Kind::Name => self.name(),
            Kind::Index(base, subscripts) => self.index(*base, subscripts),
            Kind::Call(call) => self.call(call),
            Kind::Array(elements) => self.array(elements),
            Kind::Matrix(rows) => self.matrix(rows),
            Kind::Comprehension(body, iterators) => self.comprehension(*body, iterators),
            Kind::Not(operand) => {
                let node = self.condition(*operand)?;
                Ok(Scalar::Boolean(self.graph.unary(Unary::Not, node)).into())
            }
            Kind::Plus(operand) => {
                let value = self.value(*operand)?;
                self.at = self.span(*operand);
                self.map(value, Ok)
            }
            Kind::Minus(operand) => {
                let value = self.value(*operand)?;
                self.at = self.span(*operand);
                self.map(value, |scalar| self.negated(scalar))
            }
            Kind::Chain(head, rest) => self.chain(*head, rest),
            Kind::Power(base, exponent, elementwise) => {
                let (base, exponent) = (self.value(*base)?, self.value(*exponent)?);
                self.power(base, exponent, *elementwise)
            }
            Kind::Relation(relation, left, right) => self.relation(relation, *left, *right),
            Kind::If(branches, otherwise) => self.conditional(branches, *otherwise),
            Kind::Range(start, step, stop) => self.range(*start, *step, *stop),
        }
    }

    /// The value of an expression that must be scalar.
    pub(crate) fn scalar(&mut self, id: ExprId) -> Result<Scalar> {
        let value = self.value(id)?;
        value.as_scalar().ok_or_else(|| {
            let found = describe_dims(&value.dims);
            let message = format!("expected a scalar, found an array {found}");
            Problem::new(self.span(id), message)
        })
    }

    /// The value of an expression in which everything must be known.
    pub(crate) fn structural(&mut self, id: ExprId) -> Result<Value> {
        let mode = std::mem::replace(&mut self.mode, Mode::Structural);
        let value = self.value(id);
        self.mode = mode;
        value
    }

    /// The value of an expression; `None` where it needs a parameter without value and these are
    /// allowed.
    pub(super) fn value_if_known(&mut self, id: ExprId) -> Result<Option<Value>> {
        match self.value(id) {
            Ok(value) => Ok(Some(value)),
            Err(_) if self.valueless && self.symbols.options.symbolic_parameters => Ok(None),
            Err(problem) => Err(problem),
        }
    }

    /// An Integer that must be known; `what` names it in the refusal.
    pub(super) fn known_integer(&mut self, id: ExprId, what: &str) -> Result<i64> {
        let value = self.structural(id)?;
        let (found, hint) = match value.as_scalar() {
            Some(Scalar::Integer(value)) => return Ok(value),
            Some(Scalar::Boolean(_)) => ("a Boolean".to_owned(), Some(HOW_TO_BE_WHOLE)),
            Some(Scalar::Real(_)) => ("a Real".to_owned(), Some(HOW_TO_BE_WHOLE)),
            None => (format!("an array {}", describe_dims(&value.dims)), None),
        };
        let message = format!("{what} must be an Integer, found {found}");
        Err(Problem::new(self.span(id), message).maybe_hint(hint.map(str::to_owned)))
    }

    fn end(&self) -> Result<Value> {
        let size = self.ends.last().map(|&size| Scalar::of_size(size).into());
        size.ok_or_else(|| self.problem("`end` stands only in subscripts"))
    }

    pub(super) fn varying(&self, span: Span) -> Problem {
        let name = self.text(span);
        let message = format!("`{name}` is a variable, but a known value is needed here");
        Problem::new(span, message)
            .hint("sizes, loop bounds, subscripts, attributes and parameters use parameters only")
    }

    pub(super) fn without_value(&mut self, span: Span) -> Problem {
        self.valueless = true;
        let name = self.text(span);
        let message = format!("parameter `{name}` has no value, but one is needed here");
        Problem::new(span, message).hint(format!(
            "write `{name} = …` in its declaration, or give the value on loading"
        ))
    }

    pub(super) fn unknown_name(&self, span: Span) -> Problem {
        let name = self.text(span);
        if name == "time" {
            return self.varying(span);
        }
        let message = format!("unknown name `{}`", shortened(name));
        if name.contains('.') {
            let declared = self.symbols.names();
            let hint = did_you_mean(name, declared.into_iter()).unwrap_or_else(|| {
                "components of other models are not supported, nor other constants of the \
                 library than those of `Modelica.Constants`"
                    .to_owned()
            });
            return Problem::new(span, message).hint(hint);
        }
        let iterators = self.loops.iter().map(|(iterator, _)| *iterator);
        let declared = self.symbols.names();
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
            self.at = start.to(self.span(operand));
            value = self.binary(operation, elementwise, value, right)?;
        }
        Ok(value)
    }

    fn relation(&mut self, relation: &str, left: ExprId, right: ExprId) -> Result<Value> {
        self.at = self.span(left).to(self.span(right));
        let (left, right) = (self.scalar(left)?, self.scalar(right)?);
        let holds = self.compare(relation, left, right)?;
        Ok(Scalar::Boolean(holds).into())
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
        let take = |evaluator: &mut Self, id| Ok((evaluator.value(id)?, evaluator.span(id)));
        let join = |evaluator: &mut Self, condition, (yes, span): (Value, Span), no| {
            let (no, _): (Value, Span) = no;
            evaluator.at = span;
            if yes.dims != no.dims {
                return Err(evaluator.unequal_sizes(&yes.dims, &no.dims));
            }
            let select = |a: Scalar, b| {
                let chosen = a.select(condition, b, evaluator.graph);
                chosen.ok_or_else(|| expected_number(evaluator.at))
            };
            Ok((evaluator.elementwise(yes, no, select)?, span))
        };
        let chosen = self.chosen(branches.iter().copied(), otherwise, take, join);
        chosen.map(|(value, _)| value)
    }

    /// What the branch gives whose condition holds; else what all that may be taken give, the last
    /// first, joined by their conditions. A condition that is known takes its branch or leaves it
    /// unread, so that a loop may hold `if i == 1 then … else x[i - 1]`.
    pub(super) fn chosen<B, T>(
        &mut self,
        branches: impl Iterator<Item = (ExprId, B)>,
        otherwise: B,
        mut take: impl FnMut(&mut Self, B) -> Result<T>,
        mut join: impl FnMut(&mut Self, Node, T, T) -> Result<T>,
    ) -> Result<T> {
        let (mut open, mut last) = (vec![], otherwise);
        for (condition, branch) in branches {
            let node = self.condition(condition)?;
            match self.graph.constant_value(node) {
                Some(0.0) => {}
                Some(_) => {
                    last = branch;
                    break;
                }
                None => open.push((node, branch)),
            }
        }
        let around = self.conditions.len();
        let passed = open.iter().map(|&(condition, _)| (condition, false));
        self.conditions.extend(passed);
        let done = take(self, last).and_then(|mut result| {
            for (condition, branch) in open.into_iter().rev() {
                self.conditions.pop();
                self.conditions.push((condition, true));
                let taken = take(self, branch)?;
                self.conditions.pop();
                result = join(self, condition, taken, result)?;
            }
            Ok(result)
        });
        self.conditions.truncate(around);
        done
    }
}

impl<'a> Evaluator<'a> {
    /// What the name that stands here means.
    pub(super) fn name(&mut self) -> Result<Value> {
        let span = self.at;
        let name = plain(self.text(span));
        if let Some(scalar) = self.iterator(&name) {
            return Ok(scalar.into());
        }
        if let Some(local) = self.local(&name) {
            self.charge(local.elements.len() as u64)?;
            return local.value().ok_or_else(|| self.unassigned(&name, span));
        }
        // names in a function lead to its own variables, and to constants
        let is_closed = self.is_closed();
        let mode = if is_closed {
            Mode::Structural
        } else {
            self.mode
        };
        let found = self.named_in(mode, &name);
        if let Named::Array([_, ..], elements) = found {
            self.charge(elements.len() as u64)?;
        }
        match found {
            Named::Array(..) | Named::Scalar(_) => return self.meant(found, span),
            Named::Varying | Named::Valueless if !is_closed => return self.meant(found, span),
            _ => {}
        }
        let builtin = self.builtin(&name).map(Value::from);
        builtin.ok_or_else(|| match is_closed && self.symbols.dims(&name).is_some() {
            true => {
                let message = format!("`{name}` is not a variable of this function");
                self.problem(message)
                    .hint("functions read their own variables and constants: add an input")
            }
            false => self.unknown_name(span),
        })
    }

    /// The value that a name means.
    pub(super) fn meant(&mut self, found: Named<'a>, span: Span) -> Result<Value> {
        match found {
            Named::Array(dims, elements) => Ok(Value {
                dims: dims.to_vec(),
                elements: elements.to_vec(),
            }),
            Named::Scalar(scalar) => Ok(scalar.into()),
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

    /// What the declarations say of a name, in full or as an import shortens it.
    pub(super) fn named(&self, name: &str) -> Named<'a> {
        self.named_in(self.mode, name)
    }

    fn named_in(&self, mode: Mode, name: &str) -> Named<'a> {
        // The symbols outlive this evaluator.
        let symbols = self.symbols;
        if !self.is_closed() {
            match symbols.named(name, mode) {
                Named::Unknown => {}
                found => return found,
            }
        }
        let full = self.full_names(name).into_iter();
        let mut found = full.map(|full| symbols.constant(&full, mode));
        found
            .find(|found| !matches!(found, Named::Unknown))
            .unwrap_or(Named::Unknown)
    }

    /// In a function the model's own names mean nothing.
    pub(super) fn is_closed(&self) -> bool {
        self.frame.is_function
    }

    pub(super) fn full_names(&self, name: &str) -> Vec<String> {
        match self.scopes[..] {
            [] => vec![],
            _ => self.symbols.classes.full_names(name, &self.scopes),
        }
    }

    fn builtin(&self, name: &str) -> Option<Scalar> {
        if name == "time" {
            let is_known = self.mode == Mode::Continuous;
            return is_known.then(|| Scalar::Real(self.symbols.time()));
        }
        if let Some(ordinal) = self.symbols.classes.literal(name, &self.scopes) {
            return Some(Scalar::Integer(ordinal));
        }
        let known = constant(name);
        let known = known.or_else(|| self.full_names(name).iter().find_map(|full| constant(full)));
        Some(Scalar::Real(self.graph.constant(known?).node()))
    }

    pub(super) fn unassigned(&self, name: &str, span: Span) -> Problem {
        let message = format!("`{name}` is read before it has a value in every case");
        Problem::new(span, message).hint("assign it first, in each branch of an `if`")
    }

    /// `a[1].b[2].c`: a name as it is written, or the member `a.b.c` with all subscripts.
    fn path(&mut self, id: ExprId, parts: &'a [PathPart]) -> Result<Value> {
        let span = self.at;
        let whole = plain(self.text(span));
        if self.is_known(&whole) {
            return self.name();
        }
        let literal = self.with_numbers(parts);
        if let Some(literal) = literal.filter(|literal| self.is_known(literal)) {
            return self.value_named(&literal, span);
        }
        let (name, subscripts) = reference(self.source, self.ast, id).unwrap_or_default();
        self.index_named(&name, &subscripts, span)
    }

    fn is_known(&self, name: &str) -> bool {
        self.local(name).is_some() || !matches!(self.named(name), Named::Unknown)
    }

    /// `c[2].x` for `c[i].x` with i = 2; `None` where a subscript is a range.
    fn with_numbers(&mut self, parts: &'a [PathPart]) -> Option<String> {
        let mut names = vec![];
        for part in parts {
            let mut name = plain(self.text(part.name)).into_owned();
            if !part.subscripts.is_empty() {
                let numbers = self.numbers(&part.subscripts).ok()?;
                name.push_str(&format!("[{numbers}]"));
            }
            names.push(name);
        }
        Some(names.join("."))
    }

    /// Subscripts that are known, as `1,2`.
    pub(super) fn numbers(&mut self, subscripts: &[ExprId]) -> Result<String> {
        let mut numbers = vec![];
        for &subscript in subscripts {
            numbers.push(self.known_integer(subscript, "a subscript")?.to_string());
        }
        Ok(numbers.join(","))
    }

    pub(super) fn value_named(&mut self, name: &str, span: Span) -> Result<Value> {
        if let Some(local) = self.local(name) {
            return local.value().ok_or_else(|| self.unassigned(name, span));
        }
        self.meant(self.named(name), span)
    }

    /// A variable of the function or algorithm around.
    pub(super) fn local(&self, name: &str) -> Option<&Local> {
        self.frame.locals.get(name)
    }
}

/// The name that an expression is, and its subscripts: `a.b` of `a[1].b[2]`.
pub(super) fn reference(source: &str, ast: &Ast, id: ExprId) -> Option<(String, Vec<ExprId>)> {
    let name = |span: Span| plain(span.text(source));
    match &ast.expression(id).kind {
        Kind::Name => Some((name(ast.expression(id).span).into_owned(), vec![])),
        Kind::Index(base, subscripts) => {
            let base = name(ast.expression(*base).span);
            Some((base.into_owned(), subscripts.clone()))
        }
        Kind::Path(parts) => {
            let names: Vec<_> = parts.iter().map(|part| name(part.name)).collect();
            let subscripts = parts.iter().flat_map(|part| &part.subscripts);
            Some((names.join("."), subscripts.copied().collect()))
        }
        _ => None,
    }
}
