//! Expressions, by precedence; names with what stands behind them: parts, subscripts, arguments.

use super::ast::{BinaryOperator, Call, ExprId, Kind, PathPart, Relation, UnaryOperator};
use super::lexer::{Keyword, Symbol, Token, shortened};
use super::parser::Parser;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_RANK;

/// How tightly operators bind, loosest first.
const OR: u8 = 0;
const AND: u8 = 1;
const NOT: u8 = 2;
const RELATION: u8 = 3;
const SUM: u8 = 4;
const PRODUCT: u8 = 5;
const POWER: u8 = 6;
const OPERAND: u8 = 7;

/// What may stand between two operands.
enum Infix {
    Chain(BinaryOperator),
    Relation(Relation),
    /// true for `.^`
    Power(bool),
}

/// Operators of one level, collected from the left.
type Pending = Vec<(BinaryOperator, ExprId)>;

impl Parser<'_> {
    /// Any expression.
    pub(super) fn expression(&mut self) -> Result<ExprId> {
        if self.at_word(Keyword::If) {
            return self.nested(Self::if_expression);
        }
        self.range()
    }

    /// `a`, `a:b` or `a:step:b`.
    fn range(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let low = self.operators(OR)?;
        if !self.at(Symbol::Colon) {
            return Ok(low);
        }
        self.advance()?;
        let second = self.operators(OR)?;
        if !self.accept(Symbol::Colon)? {
            return self.push(Kind::Range(low, None, second), start, first);
        }
        let high = self.operators(OR)?;
        self.push(Kind::Range(low, Some(second), high), start, first)
    }

    fn if_expression(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        let branches = self.cases(Self::expression)?;
        if !self.at_word(Keyword::Else) {
            let problem = self.unexpected("`else`");
            return Err(problem.hint("an `if` expression has a value in every case"));
        }
        self.advance()?;
        let otherwise = self.expression()?;
        self.push(Kind::If(branches, otherwise), start, first)
    }

    /// Conditions with what stands behind their `then`, up to `else` or `end`.
    pub(super) fn cases<T>(
        &mut self,
        then: impl Fn(&mut Self) -> Result<T>,
    ) -> Result<Vec<(ExprId, T)>> {
        let mut cases = vec![];
        loop {
            let condition = self.expression()?;
            self.expect_word(Keyword::Then)?;
            cases.push((condition, then(self)?));
            if !self.accept_word(Keyword::Elseif)? {
                return Ok(cases);
            }
        }
    }

    /// Operands joined by operators that bind at least as tightly as `least`.
    fn operators(&mut self, least: u8) -> Result<ExprId> {
        self.nested(|parser| parser.operators_here(least))
    }

    /// Precedence climbing. Operators of one level make one flat chain, so that the depth of
    /// the tree does not grow with its length.
    fn operators_here(&mut self, least: u8) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let mut left = self.prefixed(least)?;
        let mut pending: Pending = vec![];
        let mut pending_level = OPERAND;
        while let Some((infix, level)) = infix(self.token).filter(|(_, level)| *level >= least) {
            if level != pending_level {
                left = self.close(left, &mut pending, start, first)?;
                pending_level = level;
            }
            self.advance()?;
            if let Infix::Power(_) = infix {
                self.refuse_sign("an exponent without sign", "as in `2^(-1)`")?;
            }
            let right = self.operators(level + 1)?;
            match infix {
                Infix::Chain(operator) => {
                    self.count(1)?;
                    pending.push((operator, right));
                    continue;
                }
                Infix::Relation(relation) => {
                    self.refuse_second(RELATION, "comparison", "join comparisons with `and`")?;
                    left = self.push(Kind::Relation(relation, left, right), start, first)?;
                }
                Infix::Power(elementwise) => {
                    let hint = "write `(a^b)^c` or `a^(b^c)`: `^` has no order of its own";
                    self.refuse_second(POWER, "`^`", hint)?;
                    left = self.push(Kind::Power(left, right, elementwise), start, first)?;
                }
            }
            pending_level = OPERAND;
        }
        self.close(left, &mut pending, start, first)
    }

    fn close(
        &mut self,
        head: ExprId,
        pending: &mut Pending,
        start: Span,
        first: ExprId,
    ) -> Result<ExprId> {
        if pending.is_empty() {
            return Ok(head);
        }
        self.push(Kind::Chain(head, std::mem::take(pending)), start, first)
    }

    /// Comparisons and powers have no order among themselves.
    fn refuse_second(&self, level: u8, what: &str, hint: &str) -> Result<()> {
        match infix(self.token) {
            Some((_, next)) if next == level => {
                Err(self.unexpected(&format!("one {what}")).hint(hint))
            }
            _ => Ok(()),
        }
    }

    /// Modelica has no sign behind `^` or behind another sign.
    fn refuse_sign(&self, expected: &str, example: &str) -> Result<()> {
        match self.token {
            Token::Symbol(
                Symbol::Minus | Symbol::ElementMinus | Symbol::Plus | Symbol::ElementPlus,
            ) => Err(self.unexpected(expected).hint(format!(
                "Modelica takes no sign here: put it in parentheses, {example}"
            ))),
            _ => Ok(()),
        }
    }

    /// An operand, or `not` or a sign with what it applies to: `-a*b` is −(a b), `2*-a^2` is
    /// 2 (−(a²)).
    fn prefixed(&mut self, least: u8) -> Result<ExprId> {
        let (operator, level) = match self.token {
            Token::Keyword(Keyword::Not) if least <= NOT => (UnaryOperator::Not, NOT),
            Token::Symbol(Symbol::Minus | Symbol::ElementMinus) => {
                (UnaryOperator::Minus, least.max(PRODUCT))
            }
            Token::Symbol(Symbol::Plus | Symbol::ElementPlus) => {
                (UnaryOperator::Plus, least.max(PRODUCT))
            }
            _ => return self.primary(),
        };
        let (start, first) = (self.advance()?, self.next_id());
        if operator != UnaryOperator::Not {
            self.refuse_sign("an operand after the sign", "as in `-(-3)`")?;
        }
        let operand = self.operators(level)?;
        self.push(Kind::Unary(operator, operand), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let kind = match self.token {
            Token::Integer => Kind::Integer(self.integer_value()?),
            Token::Real => Kind::Real(self.real_value()?),
            Token::Text => Kind::Text,
            Token::Keyword(Keyword::True) => Kind::Boolean(true),
            Token::Keyword(Keyword::False) => Kind::Boolean(false),
            Token::Keyword(Keyword::End) => Kind::End,
            Token::Keyword(Keyword::If) => {
                let problem = self.unexpected("an operand");
                return Err(problem.hint("put parentheses around an `if` within a formula"));
            }
            Token::Symbol(Symbol::OpenParen) => return self.parenthesised(),
            Token::Symbol(Symbol::OpenBrace) => return self.braces(),
            Token::Symbol(Symbol::OpenBracket) => return self.matrix(),
            Token::Identifier | Token::Symbol(Symbol::Dot) | Token::Keyword(Keyword::Der) => {
                return self.reference();
            }
            Token::Keyword(Keyword::Initial) => {
                return Err(self.refuse("`initial()`", "use `time` or a parameter"));
            }
            _ => return Err(self.unexpected("an operand")),
        };
        self.advance()?;
        self.push(kind, start, first)
    }

    fn integer_value(&self) -> Result<i64> {
        let text = self.span.text(self.source);
        text.parse().map_err(|_| {
            let message = format!("the Integer {} is too large", shortened(text));
            Problem::new(self.span, message).hint("write it as a Real, with `.0` behind it")
        })
    }

    fn parenthesised(&mut self) -> Result<ExprId> {
        self.advance()?;
        let inner = self.expression()?;
        if self.at(Symbol::Comma) {
            return Err(self.refuse(
                "a list in parentheses",
                "write one equation for each component",
            ));
        }
        self.expect(Symbol::CloseParen)?;
        if self.at(Symbol::OpenBracket) {
            let (start, first) = (self.span, self.ast.expression(inner).first);
            let subscripts = self.subscripts()?;
            return self.push(Kind::Index(inner, subscripts), start, first);
        }
        Ok(inner)
    }

    fn braces(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        if self.at(Symbol::CloseBrace) {
            return Err(self
                .unexpected("an element")
                .hint("for no elements write `zeros(0)`"));
        }
        let mut elements = vec![self.expression()?];
        if self.accept_word(Keyword::For)? {
            let iterators = self.iterators()?;
            self.expect(Symbol::CloseBrace)?;
            return self.push(Kind::Comprehension(elements[0], iterators), start, first);
        }
        while self.accept(Symbol::Comma)? {
            elements.push(self.expression()?);
        }
        self.expect(Symbol::CloseBrace)?;
        self.push(Kind::Array(elements), start, first)
    }

    fn matrix(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        let mut rows = vec![];
        loop {
            let mut row = vec![self.expression()?];
            while self.accept(Symbol::Comma)? {
                row.push(self.expression()?);
            }
            rows.push(row);
            if !self.accept(Symbol::Semicolon)? {
                break;
            }
        }
        self.expect(Symbol::CloseBracket)?;
        self.push(Kind::Matrix(rows), start, first)
    }
}

/// Refuses arrays of more dimensions than the limit.
pub(crate) fn too_many_dimensions(span: Span) -> Problem {
    Problem::new(span, format!("an array of more than {MAX_RANK} dimensions"))
}

fn infix(token: Token) -> Option<(Infix, u8)> {
    use BinaryOperator as B;
    let chain = |operator, level| Some((Infix::Chain(operator), level));
    let relation = |relation| Some((Infix::Relation(relation), RELATION));
    let symbol = match token {
        Token::Keyword(Keyword::Or) => return chain(B::Or, OR),
        Token::Keyword(Keyword::And) => return chain(B::And, AND),
        Token::Symbol(symbol) => symbol,
        _ => return None,
    };
    match symbol {
        Symbol::Plus => chain(B::Add, SUM),
        Symbol::Minus => chain(B::Subtract, SUM),
        Symbol::ElementPlus => chain(B::ElementAdd, SUM),
        Symbol::ElementMinus => chain(B::ElementSubtract, SUM),
        Symbol::Times => chain(B::Multiply, PRODUCT),
        Symbol::Over => chain(B::Divide, PRODUCT),
        Symbol::ElementTimes => chain(B::ElementMultiply, PRODUCT),
        Symbol::ElementOver => chain(B::ElementDivide, PRODUCT),
        Symbol::Less => relation(Relation::Less),
        Symbol::LessEqual => relation(Relation::LessEqual),
        Symbol::Greater => relation(Relation::Greater),
        Symbol::GreaterEqual => relation(Relation::GreaterEqual),
        Symbol::EqualEqual => relation(Relation::Equal),
        Symbol::NotEqual => relation(Relation::NotEqual),
        Symbol::Power => Some((Infix::Power(false), POWER)),
        Symbol::ElementPower => Some((Infix::Power(true), POWER)),
        _ => None,
    }
}

impl Parser<'_> {
    /// A name, with subscripts or arguments behind it.
    pub(super) fn reference(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let name = self.dotted_name()?;
        if self.at(Symbol::OpenParen) {
            let call = self.call(name)?;
            if !self.at(Symbol::OpenBracket) {
                return Ok(call);
            }
            let subscripts = self.subscripts()?;
            return self.push(Kind::Index(call, subscripts), start, first);
        }
        let base = self.push(Kind::Name, start, first)?;
        if !self.at(Symbol::OpenBracket) {
            return Ok(base);
        }
        let subscripts = self.subscripts()?;
        if self.at(Symbol::OpenBracket) {
            let hint = "write all subscripts in one pair of brackets: `x[i, j]`";
            return Err(self.unexpected("an operator").hint(hint));
        }
        if self.at(Symbol::Dot) {
            return self.path_behind(start, first, subscripts);
        }
        self.push(Kind::Index(base, subscripts), start, first)
    }

    /// `.b[2].c`, behind `a[1]`.
    fn path_behind(
        &mut self,
        start: Span,
        first: ExprId,
        subscripts: Vec<ExprId>,
    ) -> Result<ExprId> {
        let name = self.ast.expression(first).span;
        let mut parts = vec![PathPart { name, subscripts }];
        while self.accept(Symbol::Dot)? {
            let name = self.identifier("a name after `.`")?;
            let subscripts = self.maybe_subscripts()?;
            self.count(1)?;
            parts.push(PathPart { name, subscripts });
        }
        self.push(Kind::Path(parts), start, first)
    }

    pub(super) fn dotted_name(&mut self) -> Result<Span> {
        let start = self.span;
        if !self.accept_word(Keyword::Der)? {
            self.accept(Symbol::Dot)?;
            self.identifier("a name")?;
            while self.at(Symbol::Dot) {
                self.advance()?;
                self.identifier("a name after `.`")?;
            }
        }
        Ok(start.to(self.last))
    }

    fn call(&mut self, function: Span) -> Result<ExprId> {
        let first = self.next_id();
        self.advance()?;
        let mut call = Call {
            function,
            arguments: vec![],
            named: vec![],
            iterators: vec![],
        };
        while !self.at(Symbol::CloseParen) {
            let argument = self.expression()?;
            if self.accept(Symbol::Equal)? {
                let name = self.ast.expression(argument).span;
                call.named.push((name, self.expression()?));
            } else if call.named.is_empty() {
                call.arguments.push(argument);
            } else {
                let problem = self.unexpected("an argument with its name, as before it");
                return Err(problem.hint("arguments without names stand first"));
            }
            if call.arguments.len() == 1 && self.accept_word(Keyword::For)? {
                call.iterators = self.iterators()?;
                break;
            }
            if !self.accept(Symbol::Comma)? {
                break;
            }
        }
        self.expect(Symbol::CloseParen)?;
        self.push(Kind::Call(call), function, first)
    }

    /// `[1, :, 2:end]`, where it stands here.
    pub(super) fn maybe_subscripts(&mut self) -> Result<Vec<ExprId>> {
        match self.at(Symbol::OpenBracket) {
            true => self.subscripts(),
            false => Ok(vec![]),
        }
    }

    /// `[1, :, 2:end]`
    pub(super) fn subscripts(&mut self) -> Result<Vec<ExprId>> {
        self.expect(Symbol::OpenBracket)?;
        let mut subscripts = vec![];
        loop {
            let (start, first) = (self.span, self.next_id());
            if self.accept(Symbol::Colon)? {
                subscripts.push(self.push(Kind::All, start, first)?);
            } else {
                subscripts.push(self.expression()?);
            }
            if !self.accept(Symbol::Comma)? {
                break;
            }
            if subscripts.len() >= MAX_RANK {
                return Err(too_many_dimensions(self.span));
            }
        }
        self.expect(Symbol::CloseBracket)?;
        Ok(subscripts)
    }
}
