//! Expressions, by precedence; names with what stands behind them: parts, subscripts, arguments.

use lynkeus_expr::Binary;

use super::ast::{Call, ExprId, Kind, PathPart};
use super::lexer::{Token, shortened};
use super::parser::{NOT, OR, POWER, PRODUCT, Parser};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_RANK;
use crate::names::did_you_mean;

impl Parser<'_> {
    /// Any expression.
    pub(crate) fn expression(&mut self) -> Result<ExprId> {
        if self.at("if") {
            return self.nested(Self::if_expression);
        }
        self.range()
    }

    /// `a`, `a:b` or `a:step:b`.
    fn range(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let low = self.operators(OR)?;
        if !self.accept(":")? {
            return Ok(low);
        }
        let second = self.operators(OR)?;
        if !self.accept(":")? {
            return self.push(Kind::Range(low, None, second), start, first);
        }
        let high = self.operators(OR)?;
        self.push(Kind::Range(low, Some(second), high), start, first)
    }

    fn if_expression(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        let branches = self.cases(Self::expression)?;
        if !self.accept("else")? {
            let problem = self.unexpected("`else`");
            return Err(problem.hint("an `if` expression has a value in every case"));
        }
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
            self.expect("then")?;
            cases.push((condition, then(self)?));
            if !self.accept("elseif")? {
                return Ok(cases);
            }
        }
    }

    /// An operand, or `not` or a sign with what it applies to: `-a*b` is −(a b), `2*-a^2` is
    /// 2 (−(a²)). On paper `-a*b` is (−a) b.
    pub(super) fn prefixed(&mut self, least: u8) -> Result<ExprId> {
        let on_paper = self.lexer.language.on_paper;
        let signed = least.max(if on_paper { POWER } else { PRODUCT });
        let (kind, level): (fn(ExprId) -> Kind, u8) = match self.token {
            Token::Fixed("not") if least <= NOT => (Kind::Not, NOT),
            Token::Fixed("-" | ".-") => (Kind::Minus, signed),
            Token::Fixed("+" | ".+") => (Kind::Plus, signed),
            _ => return self.primary(),
        };
        let (start, first) = (self.advance()?, self.next_id());
        if level != NOT {
            self.refuse_sign("an operand after the sign", "as in `-(-3)`")?;
        }
        let operand = self.operators(level)?;
        self.push(kind(operand), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let kind = match self.token {
            Token::Real if self.lexer.language.on_paper => return self.coefficient(),
            Token::Identifier if self.lexer.language.on_paper => return self.function_of_time(),
            Token::Integer => Kind::Integer(self.integer_value()?),
            Token::Real => Kind::Real(self.real_value()?),
            Token::Text => Kind::Text,
            Token::Fixed("true") => Kind::Boolean(true),
            Token::Fixed("false") => Kind::Boolean(false),
            Token::Fixed("end") => Kind::End,
            Token::Fixed("if") => {
                let problem = self.unexpected("an operand");
                return Err(problem.hint("put parentheses around an `if` within a formula"));
            }
            Token::Fixed("(") => return self.parenthesised(),
            Token::Fixed("{") => return self.braces(),
            Token::Fixed("[") => return self.matrix(),
            Token::Identifier | Token::Fixed("." | "der" | "initial") => return self.reference(),
            _ => return Err(self.unexpected("an operand")),
        };
        self.advance()?;
        self.push(kind, start, first)
    }

    /// A number; or one directly before its factor, where it binds tighter than any operator but
    /// the power: `1/2x^2` is 1/(2x²).
    fn coefficient(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let value = self.real_value()?;
        self.advance()?;
        let number = self.push(Kind::Real(value), start, first)?;
        let is_adjacent = self.last.end == self.span.start;
        if !is_adjacent || !(self.token == Token::Identifier || self.at("(")) {
            return Ok(number);
        }
        let factor = (Binary::Mul, false, self.operators(POWER)?);
        self.push(Kind::Chain(number, vec![factor]), start, first)
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
        if self.at(",") && !self.lexer.language.on_paper {
            let hint = "write one equation for each component";
            return Err(self.refuse("a list in parentheses", hint));
        }
        self.expect(")")?;
        if self.at("[") {
            let (start, first) = (self.span, self.ast.expression(inner).first);
            let subscripts = self.subscripts()?;
            return self.push(Kind::Index(inner, subscripts), start, first);
        }
        Ok(inner)
    }

    fn braces(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        if self.at("}") {
            let problem = self.unexpected("an element");
            return Err(problem.hint("for no elements write `zeros(0)`"));
        }
        let elements = self.list(Self::expression)?;
        if elements.len() == 1 && self.accept("for")? {
            let iterators = self.iterators()?;
            self.expect("}")?;
            return self.push(Kind::Comprehension(elements[0], iterators), start, first);
        }
        self.expect("}")?;
        self.push(Kind::Array(elements), start, first)
    }

    fn matrix(&mut self) -> Result<ExprId> {
        let (start, first) = (self.advance()?, self.next_id());
        let mut rows = vec![self.list(Self::expression)?];
        while self.accept(";")? {
            rows.push(self.list(Self::expression)?);
        }
        self.expect("]")?;
        self.push(Kind::Matrix(rows), start, first)
    }
}

/// Refuses arrays of more dimensions than the limit.
pub(crate) fn too_many_dimensions(span: Span) -> Problem {
    Problem::new(span, format!("an array of more than {MAX_RANK} dimensions"))
}

impl Parser<'_> {
    /// A name, with subscripts or arguments behind it.
    pub(super) fn reference(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let name = self.dotted_name()?;
        if self.at("(") {
            let call = self.call(name)?;
            if !self.at("[") {
                return Ok(call);
            }
            let subscripts = self.subscripts()?;
            return self.push(Kind::Index(call, subscripts), start, first);
        }
        let base = self.push(Kind::Name, start, first)?;
        if !self.at("[") {
            return Ok(base);
        }
        let subscripts = self.subscripts()?;
        if self.at("[") {
            let hint = "write all subscripts in one pair of brackets: `x[i, j]`";
            return Err(self.unexpected("an operator").hint(hint));
        }
        if self.at(".") {
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
        while self.accept(".")? {
            let name = self.identifier("a name after `.`")?;
            let subscripts = self.maybe_subscripts()?;
            self.count(1)?;
            parts.push(PathPart { name, subscripts });
        }
        self.push(Kind::Path(parts), start, first)
    }

    pub(super) fn dotted_name(&mut self) -> Result<Span> {
        let start = self.span;
        if self.accept("der")? || self.accept("initial")? {
            return Ok(start);
        }
        self.accept(".")?;
        self.identifier("a name")?;
        self.members(start)
    }

    /// `.b.c`, where it stands here; the whole name that begins at `start`.
    pub(super) fn members(&mut self, start: Span) -> Result<Span> {
        while self.accept(".")? {
            self.identifier("a name after `.`")?;
        }
        Ok(start.to(self.last))
    }

    /// `a`, `x(t)`, `x'(t)` or `exp(…)`, where functions of time are written so: those are calls
    /// without arguments, of a name that ends with its primes.
    pub(crate) fn function_of_time(&mut self) -> Result<ExprId> {
        let (name, first) = (self.advance()?, self.next_id());
        while self.accept("'")? {}
        let function = name.to(self.last);
        if !self.at("(") {
            return self.push(Kind::Name, name, first);
        }
        let known = self.lexer.language.functions;
        if known.contains(&function.text(self.source)) {
            return self.call(function);
        }
        self.advance()?;
        let is_time = self.token == Token::Identifier && self.span.text(self.source) == "t";
        if !is_time && function == name {
            return Err(self.unknown_function(name));
        }
        if is_time {
            self.advance()?;
        }
        if !is_time || !self.at(")") {
            let text = name.text(self.source);
            let problem = self.unexpected(&format!("`{text}(t)`"));
            let hint = "functions have the argument `t` alone: no delays, no discrete time";
            return Err(problem.hint(hint));
        }
        self.advance()?;
        let call = Call {
            function,
            ..Call::default()
        };
        self.push_at(Kind::Call(call), function, first)
    }

    fn unknown_function(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let known = self.lexer.language.functions;
        let hint = did_you_mean(text, known.iter().copied()).unwrap_or_else(|| {
            let known = known.join(" ");
            format!("functions of time read `{text}(t)`, products `{text}*(…)`; there are {known}")
        });
        let message = format!("unknown function `{}`", shortened(text));
        Problem::new(name, message).hint(hint)
    }

    fn call(&mut self, function: Span) -> Result<ExprId> {
        let first = self.next_id();
        self.advance()?;
        let mut call = Call {
            function,
            ..Call::default()
        };
        while !self.at(")") {
            let argument = self.expression()?;
            if self.accept("=")? {
                let name = self.ast.expression(argument).span;
                call.named.push((name, self.expression()?));
            } else if call.named.is_empty() {
                call.arguments.push(argument);
            } else {
                let problem = self.unexpected("an argument with its name, as before it");
                return Err(problem.hint("arguments without names stand first"));
            }
            if call.arguments.len() == 1 && self.accept("for")? {
                call.iterators = self.iterators()?;
                break;
            }
            if !self.accept(",")? {
                break;
            }
        }
        self.expect(")")?;
        self.push(Kind::Call(call), function, first)
    }

    /// `[1, :, 2:end]`, where it stands here.
    pub(super) fn maybe_subscripts(&mut self) -> Result<Vec<ExprId>> {
        match self.at("[") {
            true => self.subscripts(),
            false => Ok(vec![]),
        }
    }

    /// `[1, :, 2:end]`
    pub(super) fn subscripts(&mut self) -> Result<Vec<ExprId>> {
        self.expect("[")?;
        let mut subscripts = vec![];
        loop {
            let (start, first) = (self.span, self.next_id());
            if self.accept(":")? {
                subscripts.push(self.push(Kind::All, start, first)?);
            } else {
                subscripts.push(self.expression()?);
            }
            if !self.accept(",")? {
                break;
            }
            if subscripts.len() >= MAX_RANK {
                return Err(too_many_dimensions(self.span));
            }
        }
        self.expect("]")?;
        Ok(subscripts)
    }
}
