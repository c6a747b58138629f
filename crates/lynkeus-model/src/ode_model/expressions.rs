//! Expressions, with the precedence they have in Julia.

use super::lexer::Token;
use super::parser::{Mention, Parser};
use crate::names::did_you_mean;
use crate::syntax::ast::{BinaryOperator, Call, ExprId, Kind, UnaryOperator};
use crate::syntax::{Problem, Result, Span, shortened};

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
