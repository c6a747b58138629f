//! A model's equations to a syntax tree; expressions have the precedence they have in Julia.

use super::lexer::{Lexer, Mention};
use crate::diagnostic::{Problem, Result, Span};
use crate::names::did_you_mean;
use crate::syntax::ast::{Ast, BinaryOperator, Call, ExprId, Kind, UnaryOperator};
use crate::syntax::{Parser, Symbol, Token, shortened};

/// A parsed model.
pub(super) struct ParsedModel {
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

/// Parses the model that begins with the word at `head`.
pub(super) fn parse(source: &str, head: Span) -> Result<ParsedModel> {
    let mut parser = Parser::behind(head, source, Lexer::new(source, head));
    parser.opening()?;
    let equations = parser.equations(head)?;
    Ok(ParsedModel {
        head,
        equations,
        mentions: parser.lexer.mentions,
        ast: parser.ast,
    })
}

impl Parser<'_, Lexer<'_>> {
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

    fn equations(&mut self, head: Span) -> Result<Vec<Equation>> {
        let mut equations = vec![];
        while !self.at(Symbol::CloseParen) {
            equations.push(self.equation()?);
            if self.at(Symbol::CloseParen) || self.accept(Symbol::Comma)? {
                continue;
            }
            let between = Span::new(self.last.end as usize, self.span.start as usize);
            let is_next_line = between.text(self.source).contains('\n');
            if !is_next_line || self.token == Token::End {
                return Err(self.unexpected("an operator, `,` or `)`"));
            }
        }
        if equations.is_empty() {
            let problem = Problem::new(head, "the model has no equations");
            return Err(problem.hint("write `x'(t) = …` for states and `y(t) = …` for outputs"));
        }
        Ok(equations)
    }

    fn equation(&mut self) -> Result<Equation> {
        let name = self.left_name()?;
        let is_derivative = self.accept(Symbol::Prime)?;
        if is_derivative && self.at(Symbol::Prime) {
            return Err(self.second_derivative(name));
        }
        if self.at(Symbol::Equal) {
            let text = name.text(self.source);
            let prime = if is_derivative { "'" } else { "" };
            let problem = self.unexpected(&format!("`(t)` behind `{text}{prime}`"));
            let hint = format!("write `{text}'(t) = …` for a state, `{text}(t) = …` for an output");
            return Err(problem.hint(hint));
        }
        self.expect(Symbol::OpenParen)?;
        self.time_argument(name)?;
        if self.at(Symbol::Prime) {
            let text = name.text(self.source);
            let problem = self.unexpected("`=`");
            return Err(problem.hint(format!("a derivative reads `{text}'(t)`")));
        }
        self.expect(Symbol::Equal)?;
        let right = self.expression()?;
        self.count(1)?;
        Ok(Equation {
            name,
            is_derivative,
            right,
        })
    }

    fn left_name(&mut self) -> Result<Span> {
        if self.token == Token::Identifier {
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
            if self.accept(Symbol::CloseParen)? {
                return Ok(());
            }
        }
        let text = name.text(self.source);
        Err(self
            .unexpected(&format!("`{text}(t)`"))
            .hint("functions have the argument `t` alone: no delays, no discrete time"))
    }

    pub(super) fn at_time(&self) -> bool {
        self.token == Token::Identifier && self.span.text(self.source) == "t"
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

impl Parser<'_, Lexer<'_>> {
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
            Token::Symbol(Symbol::Minus) => UnaryOperator::Minus,
            Token::Symbol(Symbol::Plus) => UnaryOperator::Plus,
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
        let is_number = self.token == Token::Real;
        let base = self.primary()?;
        let is_adjacent = self.last.end == self.span.start;
        if is_number
            && is_adjacent
            && (self.token == Token::Identifier || self.at(Symbol::OpenParen))
        {
            let factor = self.nested(Self::power)?;
            let product = vec![(BinaryOperator::Multiply, factor)];
            return self.push(Kind::Chain(base, product), start, first);
        }
        if !self.accept(Symbol::Power)? {
            return Ok(base);
        }
        let exponent = self.nested(Self::operand)?;
        self.push(Kind::Power(base, exponent, false), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        match self.token {
            Token::Real => self.number(),
            Token::Identifier => self.name(),
            Token::Symbol(Symbol::OpenParen) => {
                self.advance()?;
                let inner = self.expression()?;
                self.expect(Symbol::CloseParen)?;
                Ok(inner)
            }
            Token::Symbol(Symbol::Equal) => {
                let problem = self.unexpected("an operand");
                Err(problem.hint("an equation has one `=`"))
            }
            _ => Err(self.unexpected("an operand")),
        }
    }

    fn number(&mut self) -> Result<ExprId> {
        let (span, first) = (self.span, self.next_id());
        let value = self.real_value()?;
        self.advance()?;
        self.push(Kind::Real(value), span, first)
    }

    /// `a`, `x(t)`, `exp(…)`.
    fn name(&mut self) -> Result<ExprId> {
        let first = self.next_id();
        let is_time = self.at_time();
        let name = self.advance()?;
        if self.at(Symbol::Prime) {
            return Err(self.derivative(name));
        }
        let is_function = self.at(Symbol::OpenParen);
        if is_function && is_elementary(name.text(self.source)) {
            return self.call(name, first);
        }
        if is_function {
            self.advance()?;
            if !self.at_time() {
                return Err(self.unknown_function(name));
            }
            self.time_argument(name)?;
            if self.at(Symbol::Prime) {
                return Err(self.derivative(name));
            }
        }
        if is_function || !is_time {
            let mention = Mention { name, is_function };
            self.lexer.mentions.push(mention);
        }
        self.push_at(Kind::Name, name, first)
    }

    fn call(&mut self, function: Span, first: ExprId) -> Result<ExprId> {
        self.advance()?;
        let mut arguments = vec![];
        while !self.at(Symbol::CloseParen) {
            arguments.push(self.expression()?);
            if !self.accept(Symbol::Comma)? {
                break;
            }
        }
        self.expect(Symbol::CloseParen)?;
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
        Symbol::Plus => Some((BinaryOperator::Add, SUM)),
        Symbol::Minus => Some((BinaryOperator::Subtract, SUM)),
        Symbol::Times => Some((BinaryOperator::Multiply, PRODUCT)),
        Symbol::Over => Some((BinaryOperator::Divide, PRODUCT)),
        Symbol::Rational => Some((BinaryOperator::Divide, RATIONAL)),
        _ => None,
    }
}
