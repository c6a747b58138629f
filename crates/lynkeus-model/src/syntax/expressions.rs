//! Expressions, by precedence.

use super::ast::{BinaryOperator, Call, ExprId, Kind, Relation, UnaryOperator};
use super::parser::Parser;
use super::token::{Keyword, Symbol, Token, shortened};
use super::{Problem, Result, Span};

/// Left-associative operators, loosest first; `not`, relations and signs stand between.
const OR: u8 = 0;
const AND: u8 = 1;
const SUM: u8 = 2;
const PRODUCT: u8 = 3;

impl Parser<'_> {
    /// Any expression but a range.
    pub(super) fn expression(&mut self) -> Result<ExprId> {
        self.nested(|parser| match parser.token {
            Token::Keyword(Keyword::If) => parser.if_expression(),
            _ => parser.simple(),
        })
    }

    /// `a`, `a:b` or `a:step:b`.
    fn simple(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let low = self.chain(OR)?;
        if !self.at(Symbol::Colon) {
            return Ok(low);
        }
        self.advance()?;
        let second = self.chain(OR)?;
        if !self.accept(Symbol::Colon)? {
            return self.push(Kind::Range(low, None, second), start, first);
        }
        let high = self.chain(OR)?;
        self.push(Kind::Range(low, Some(second), high), start, first)
    }

    fn if_expression(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        let mut branches = vec![];
        loop {
            let condition = self.expression()?;
            self.expect_word(Keyword::Then)?;
            branches.push((condition, self.expression()?));
            if !self.accept_word(Keyword::Elseif)? {
                break;
            }
        }
        if !self.at_word(Keyword::Else) {
            let problem = self.unexpected("`else`");
            return Err(problem.hint("an `if` expression has a value in every case"));
        }
        self.advance()?;
        let otherwise = self.expression()?;
        self.push(Kind::If(branches, otherwise), start, first)
    }

    /// Operators of one level, collected from the left into one flat chain.
    fn chain(&mut self, level: u8) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let head = self.chain_operand(level, true)?;
        let mut rest = vec![];
        while let Some(operator) = chain_operator(self.token, level) {
            self.advance()?;
            self.count(1)?;
            rest.push((operator, self.chain_operand(level, false)?));
        }
        if rest.is_empty() {
            return Ok(head);
        }
        self.push(Kind::Chain(head, rest), start, first)
    }

    fn chain_operand(&mut self, level: u8, is_head: bool) -> Result<ExprId> {
        match level {
            OR => self.chain(AND),
            AND => self.logical_factor(),
            // `-a*b` is −(a b): only the first term of a sum carries a sign.
            SUM if is_head && self.sign().is_some() => self.signed(|parser| parser.chain(PRODUCT)),
            SUM => self.chain(PRODUCT),
            _ => self.factor(),
        }
    }

    fn logical_factor(&mut self) -> Result<ExprId> {
        if !self.at_word(Keyword::Not) {
            return self.relation();
        }
        self.nested(|parser| {
            let (start, first) = (parser.advance()?, parser.next_id());
            let operand = parser.logical_factor()?;
            parser.push(Kind::Unary(UnaryOperator::Not, operand), start, first)
        })
    }

    fn relation(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let left = self.chain(SUM)?;
        let Some(relation) = relation_operator(self.token) else {
            return Ok(left);
        };
        self.advance()?;
        let right = self.chain(SUM)?;
        if relation_operator(self.token).is_some() {
            return Err(self
                .unexpected("one comparison")
                .hint("join comparisons with `and`"));
        }
        self.push(Kind::Relation(relation, left, right), start, first)
    }

    fn sign(&self) -> Option<UnaryOperator> {
        match self.token {
            Token::Symbol(Symbol::Minus | Symbol::ElementMinus) => Some(UnaryOperator::Minus),
            Token::Symbol(Symbol::Plus | Symbol::ElementPlus) => Some(UnaryOperator::Plus),
            _ => None,
        }
    }

    fn signed(&mut self, operand: impl FnOnce(&mut Self) -> Result<ExprId>) -> Result<ExprId> {
        let Some(operator) = self.sign() else {
            return operand(self);
        };
        self.nested(|parser| {
            let (start, first) = (parser.advance()?, parser.next_id());
            let operand = match parser.sign() {
                Some(_) => parser.signed(operand)?,
                None => operand(parser)?,
            };
            parser.push(Kind::Unary(operator, operand), start, first)
        })
    }

    /// A power, or a signed one as in `2*-x`.
    fn factor(&mut self) -> Result<ExprId> {
        if self.sign().is_some() {
            return self.signed(Self::power);
        }
        self.power()
    }

    fn power(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let base = self.primary()?;
        let Some(elementwise) = power_operator(self.token) else {
            return Ok(base);
        };
        self.advance()?;
        let exponent = match self.sign() {
            Some(_) => self.signed(Self::primary)?,
            None => self.primary()?,
        };
        if power_operator(self.token).is_some() {
            return Err(self
                .unexpected("one `^`")
                .hint("write `(a^b)^c` or `a^(b^c)`: `^` has no order of its own"));
        }
        self.push(Kind::Power(base, exponent, elementwise), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let kind = match self.token {
            Token::Integer => Kind::Integer(self.integer_value()?),
            Token::Real => Kind::Real(self.real_value()?),
            Token::Text => return Err(self.refuse("a string here", "use numbers")),
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

    fn real_value(&self) -> Result<f64> {
        let text = self.span.text(self.source);
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(Problem::new(
                self.span,
                format!("the number {} is too large", shortened(text)),
            )),
        }
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

    /// A name, with subscripts or arguments behind it.
    fn reference(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let name = self.dotted_name()?;
        if self.at(Symbol::OpenParen) {
            return self.call(name);
        }
        let base = self.push(Kind::Name, start, first)?;
        if !self.at(Symbol::OpenBracket) {
            return Ok(base);
        }
        let subscripts = self.subscripts()?;
        if self.at(Symbol::Dot) || self.at(Symbol::OpenBracket) {
            let hint = "the parts of an array element cannot be taken further";
            return Err(self.unexpected("an operator").hint(hint));
        }
        self.push(Kind::Index(base, subscripts), start, first)
    }

    fn dotted_name(&mut self) -> Result<Span> {
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
            iterators: vec![],
        };
        while !self.at(Symbol::CloseParen) {
            call.arguments.push(self.expression()?);
            if self.at(Symbol::Equal) {
                let hint = "give the arguments in order, without names";
                return Err(self.refuse("a named argument", hint));
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
        }
        self.expect(Symbol::CloseBracket)?;
        Ok(subscripts)
    }
}

fn chain_operator(token: Token, level: u8) -> Option<BinaryOperator> {
    use BinaryOperator as B;
    let (operator, its_level) = match token {
        Token::Keyword(Keyword::Or) => (B::Or, OR),
        Token::Keyword(Keyword::And) => (B::And, AND),
        Token::Symbol(symbol) => match symbol {
            Symbol::Plus => (B::Add, SUM),
            Symbol::Minus => (B::Subtract, SUM),
            Symbol::ElementPlus => (B::ElementAdd, SUM),
            Symbol::ElementMinus => (B::ElementSubtract, SUM),
            Symbol::Times => (B::Multiply, PRODUCT),
            Symbol::Over => (B::Divide, PRODUCT),
            Symbol::ElementTimes => (B::ElementMultiply, PRODUCT),
            Symbol::ElementOver => (B::ElementDivide, PRODUCT),
            _ => return None,
        },
        _ => return None,
    };
    (its_level == level).then_some(operator)
}

fn relation_operator(token: Token) -> Option<Relation> {
    let Token::Symbol(symbol) = token else {
        return None;
    };
    Some(match symbol {
        Symbol::Less => Relation::Less,
        Symbol::LessEqual => Relation::LessEqual,
        Symbol::Greater => Relation::Greater,
        Symbol::GreaterEqual => Relation::GreaterEqual,
        Symbol::EqualEqual => Relation::Equal,
        Symbol::NotEqual => Relation::NotEqual,
        _ => return None,
    })
}

/// Whether `^` (false) or `.^` (true) comes.
fn power_operator(token: Token) -> Option<bool> {
    match token {
        Token::Symbol(Symbol::Power) => Some(false),
        Token::Symbol(Symbol::ElementPower) => Some(true),
        _ => None,
    }
}
