//! A model's equations to a syntax tree.

use super::lexer::{Lexer, Token};
use crate::limits::{MAX_NESTING, MAX_SYNTAX_NODES, grouped};
use crate::syntax::ast::{Ast, ExprId, Expression, Kind};
use crate::syntax::{Problem, Result, Span};

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
