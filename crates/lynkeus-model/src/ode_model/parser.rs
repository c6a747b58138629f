//! A model's equations to a syntax tree; expressions have the precedence they have in Julia.

use super::lexer::{Lexer, Token};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_NESTING, MAX_SYNTAX_NODES, grouped};
use crate::names::did_you_mean;
use crate::syntax::ast::{Ast, BinaryOperator, Call, ExprId, Expression, Kind, UnaryOperator};
use crate::syntax::shortened;

/// A parsed model.
pub(super) struct Model {
    /// the word `@ODEmodel`
    pub head: Span,
    pub equations: Vec<Equation>,
    /// names on the right sides, in order
    pub mentions: Vec<Mention>,
    pub ast: Ast,
}

/// `x'(t) = right` or `y(t) = right`.
pub(super) struct Equation {
    pub name: Span,
    pub is_derivative: bool,
    pub right: ExprId,
}

/// A name on a right side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mention {
    pub name: Span,
    /// `x(t)` and not `x`
    pub is_function: bool,
}

/// Recursive-descent parser with one token of lookahead.
pub(super) struct Parser<'s> {
    pub(super) source: &'s str,
    lexer: Lexer<'s>,
    pub(super) token: Token,
    pub(super) span: Span,
    /// the token before the current one
    pub(super) last: Span,
    depth: usize,
    nodes: usize,
    pub(super) model: Model,
}

/// Parses the model that begins with the word at `head`.
pub(super) fn parse(source: &str, head: Span) -> Result<Model> {
    let mut parser = Parser {
        source,
        lexer: Lexer::new(source, head.end as usize),
        token: Token::End,
        span: head,
        last: head,
        depth: 0,
        nodes: 0,
        model: Model {
            head,
            equations: vec![],
            mentions: vec![],
            ast: Ast::default(),
        },
    };
    parser.opening()?;
    parser.equations()?;
    Ok(parser.model)
}

impl Parser<'_> {
    /// The parenthesis behind `@ODEmodel`.
    fn opening(&mut self) -> Result<()> {
        let rest = self
            .source
            .get(self.span.end as usize..)
            .unwrap_or_default();
        if !rest.starts_with('(') {
            let problem = Problem::new(self.span, "expected `(` directly behind `@ODEmodel`");
            return Err(problem.hint("a model reads `@ODEmodel(x'(t) = …, y(t) = …)`"));
        }
        self.advance()?;
        self.advance()?;
        Ok(())
    }

    fn equations(&mut self) -> Result<()> {
        while !self.at(")") {
            self.equation()?;
            if self.at(")") || self.accept(",")? {
                continue;
            }
            let between = Span::new(self.last.end as usize, self.span.start as usize);
            let is_next_line = between.text(self.source).contains('\n');
            if !is_next_line || self.token == Token::End {
                return Err(self.unexpected("an operator, `,` or `)`"));
            }
        }
        if self.model.equations.is_empty() {
            let problem = Problem::new(self.model.head, "the model has no equations");
            return Err(problem.hint("write `x'(t) = …` for states and `y(t) = …` for outputs"));
        }
        Ok(())
    }

    fn equation(&mut self) -> Result<()> {
        let name = self.left_name()?;
        let is_derivative = self.accept("'")?;
        if is_derivative && self.at("'") {
            return Err(self.second_derivative(name));
        }
        if self.at("=") {
            let text = name.text(self.source);
            let prime = if is_derivative { "'" } else { "" };
            let problem = self.unexpected(&format!("`(t)` behind `{text}{prime}`"));
            let hint = format!("write `{text}'(t) = …` for a state, `{text}(t) = …` for an output");
            return Err(problem.hint(hint));
        }
        self.expect("(")?;
        self.time_argument(name)?;
        if self.at("'") {
            let text = name.text(self.source);
            let problem = self.unexpected("`=`");
            return Err(problem.hint(format!("a derivative reads `{text}'(t)`")));
        }
        self.expect("=")?;
        let right = self.expression()?;
        self.count(1)?;
        self.model.equations.push(Equation {
            name,
            is_derivative,
            right,
        });
        Ok(())
    }

    fn left_name(&mut self) -> Result<Span> {
        if self.token == Token::Name {
            return self.advance();
        }
        let problem = self.unexpected("an equation or `)`");
        let hint = "equations read `x'(t) = …` for a state, `y(t) = …` for an output";
        Err(match self.token {
            Token::End => problem,
            _ => problem.hint(hint),
        })
    }

    fn second_derivative(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let span = name.to(self.span);
        Problem::new(span, "derivatives of higher order are not supported").hint(format!(
            "add a state for the velocity: `{text}'(t) = v(t)` and `v'(t) = …`"
        ))
    }

    /// `t)` behind the opening parenthesis of the function `name`.
    pub(super) fn time_argument(&mut self, name: Span) -> Result<()> {
        if self.at_time() {
            self.advance()?;
            if self.accept(")")? {
                return Ok(());
            }
        }
        let text = name.text(self.source);
        Err(self
            .unexpected(&format!("`{text}(t)`"))
            .hint("functions have the argument `t` alone: no delays, no discrete time"))
    }

    pub(super) fn at_time(&self) -> bool {
        self.token == Token::Name && self.span.text(self.source) == "t"
    }

    /// Moves to the next token; returns the span of the one left behind.
    pub(super) fn advance(&mut self) -> Result<Span> {
        self.last = self.span;
        (self.token, self.span) = self.lexer.next()?;
        Ok(self.last)
    }

    pub(super) fn at(&self, symbol: &'static str) -> bool {
        self.token == Token::Symbol(symbol)
    }

    pub(super) fn accept(&mut self, symbol: &'static str) -> Result<bool> {
        let found = self.at(symbol);
        if found {
            self.advance()?;
        }
        Ok(found)
    }

    pub(super) fn expect(&mut self, symbol: &'static str) -> Result<Span> {
        match self.at(symbol) {
            true => self.advance(),
            false => Err(self.unexpected(&format!("`{symbol}`"))),
        }
    }

    /// "expected …, found …" at the current token.
    pub(super) fn unexpected(&self, expected: &str) -> Problem {
        let found = self.token.describe(self.span.text(self.source));
        let problem = Problem::new(self.span, format!("expected {expected}, found {found}"));
        if self.token != Token::End {
            return problem;
        }
        let line = self.model.head.line(self.source);
        problem.hint(format!("close the model of line {line} with `)`"))
    }

    /// Runs a part of the grammar one level deeper.
    pub(super) fn nested<T>(&mut self, parse: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.depth >= MAX_NESTING {
            let message = format!("nested more than {MAX_NESTING} levels deep");
            return Err(Problem::new(self.span, message).hint("write it with fewer parentheses"));
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    /// Counts parts of the syntax tree.
    pub(super) fn count(&mut self, weight: usize) -> Result<()> {
        self.nodes += weight;
        if self.nodes > MAX_SYNTAX_NODES {
            let limit = grouped(MAX_SYNTAX_NODES as u64);
            let message = format!("the model has more than {limit} operands and operators");
            return Err(Problem::new(self.span, message));
        }
        Ok(())
    }

    /// The id the next expression will get.
    pub(super) fn next_id(&self) -> ExprId {
        ExprId(self.model.ast.expressions.len() as u32)
    }

    /// Adds an expression that spans from `start` to the last token.
    pub(super) fn push(&mut self, kind: Kind, start: Span, first: ExprId) -> Result<ExprId> {
        let span = start.to(self.last);
        self.push_at(kind, span, first)
    }

    /// Adds an expression with a span of its own.
    pub(super) fn push_at(&mut self, kind: Kind, span: Span, first: ExprId) -> Result<ExprId> {
        self.count(1)?;
        let id = self.next_id();
        let expression = Expression { kind, span, first };
        self.model.ast.expressions.push(expression);
        Ok(id)
    }
}

/// How tightly operators bind, loosest first. `1/2//3` is `1/(2//3)`.
const SUM: u8 = 0;
const PRODUCT: u8 = 1;
const RATIONAL: u8 = 2;

/// Functions of numbers. The original takes rational right sides only.
const FUNCTIONS: [&str; 17] = [
    "exp", "log", "log10", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh",
    "tanh", "abs", "sign", "min", "max",
];

/// Whether the name is that of a function of numbers.
pub(super) fn is_elementary(name: &str) -> bool {
    FUNCTIONS.contains(&name)
}

impl Parser<'_> {
    /// Any expression.
    pub(super) fn expression(&mut self) -> Result<ExprId> {
        self.operators(SUM)
    }

    /// Operands joined by operators that bind at least as tightly as `least`.
    fn operators(&mut self, least: u8) -> Result<ExprId> {
        self.nested(|parser| parser.operators_here(least))
    }

    /// Operators of one level make one flat chain, so that the depth of the tree does not grow
    /// with its length.
    fn operators_here(&mut self, least: u8) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let mut left = self.operand()?;
        while let Some((_, level)) = infix(self.token).filter(|(_, level)| *level >= least) {
            let mut rest = vec![];
            while let Some((operator, _)) = infix(self.token).filter(|(_, next)| *next == level) {
                self.advance()?;
                self.count(1)?;
                rest.push((operator, self.operators(level + 1)?));
            }
            left = self.push(Kind::Chain(left, rest), start, first)?;
        }
        Ok(left)
    }

    /// A power with signs before it: `-x^2` is −(x²).
    fn operand(&mut self) -> Result<ExprId> {
        let operator = match self.token {
            Token::Symbol("-") => UnaryOperator::Minus,
            Token::Symbol("+") => UnaryOperator::Plus,
            _ => return self.power(),
        };
        let (start, first) = (self.advance()?, self.next_id());
        let operand = self.nested(Self::operand)?;
        self.push(Kind::Unary(operator, operand), start, first)
    }

    /// `a^b`, from the right; or a number directly before its factor, which binds tighter than
    /// any operator but the power: `1/2x^2` is 1/(2x²).
    fn power(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let is_number = self.token == Token::Number;
        let base = self.primary()?;
        let is_adjacent = self.last.end == self.span.start;
        if is_number && is_adjacent && (self.token == Token::Name || self.at("(")) {
            let factor = self.nested(Self::power)?;
            let product = vec![(BinaryOperator::Multiply, factor)];
            return self.push(Kind::Chain(base, product), start, first);
        }
        if !self.accept("^")? {
            return Ok(base);
        }
        let exponent = self.nested(Self::operand)?;
        self.push(Kind::Power(base, exponent, false), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        match self.token {
            Token::Number => self.number(),
            Token::Name => self.name(),
            Token::Symbol("(") => {
                self.advance()?;
                let inner = self.expression()?;
                self.expect(")")?;
                Ok(inner)
            }
            Token::Symbol("=") => {
                let problem = self.unexpected("an operand");
                Err(problem.hint("an equation has one `=`"))
            }
            _ => Err(self.unexpected("an operand")),
        }
    }

    fn number(&mut self) -> Result<ExprId> {
        let (span, first) = (self.span, self.next_id());
        let text = span.text(self.source);
        match text.replace('_', "").parse::<f64>() {
            Ok(value) if value.is_finite() => {
                self.advance()?;
                self.push(Kind::Real(value), span, first)
            }
            _ => {
                let message = format!("the number {} is too large", shortened(text));
                Err(Problem::new(span, message))
            }
        }
    }

    /// `a`, `x(t)`, `exp(…)`.
    fn name(&mut self) -> Result<ExprId> {
        let first = self.next_id();
        let is_time = self.at_time();
        let name = self.advance()?;
        if self.at("'") {
            return Err(self.derivative(name));
        }
        let is_function = self.at("(");
        if is_function && is_elementary(name.text(self.source)) {
            return self.call(name, first);
        }
        if is_function {
            self.advance()?;
            if !self.at_time() {
                return Err(self.unknown_function(name));
            }
            self.time_argument(name)?;
            if self.at("'") {
                return Err(self.derivative(name));
            }
        }
        if is_function || !is_time {
            let mention = Mention { name, is_function };
            self.model.mentions.push(mention);
        }
        self.push_at(Kind::Name, name, first)
    }

    fn call(&mut self, function: Span, first: ExprId) -> Result<ExprId> {
        self.advance()?;
        let mut arguments = vec![];
        while !self.at(")") {
            arguments.push(self.expression()?);
            if !self.accept(",")? {
                break;
            }
        }
        self.expect(")")?;
        let call = Call {
            named: vec![],
            function,
            arguments,
            iterators: vec![],
        };
        self.push(Kind::Call(call), function, first)
    }

    fn derivative(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let span = name.to(self.span);
        Problem::new(span, "a derivative on a right side is not supported").hint(format!(
            "write what `{text}'(t)` is equal to, from its own equation"
        ))
    }

    fn unknown_function(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let hint = did_you_mean(text, FUNCTIONS.into_iter()).unwrap_or_else(|| {
            let known = FUNCTIONS.join(" ");
            format!("functions of time read `{text}(t)`, products `{text}*(…)`; there are {known}")
        });
        let message = format!("unknown function `{}`", shortened(text));
        Problem::new(name, message).hint(hint)
    }
}

fn infix(token: Token) -> Option<(BinaryOperator, u8)> {
    let Token::Symbol(symbol) = token else {
        return None;
    };
    match symbol {
        "+" => Some((BinaryOperator::Add, SUM)),
        "-" => Some((BinaryOperator::Subtract, SUM)),
        "*" => Some((BinaryOperator::Multiply, PRODUCT)),
        "/" => Some((BinaryOperator::Divide, PRODUCT)),
        "//" => Some((BinaryOperator::Divide, RATIONAL)),
        _ => None,
    }
}
