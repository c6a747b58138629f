//! What stands in the sections `equation` and `algorithm`.

use super::ast::{Assert, Equation, EquationKind, ExprId, Iterator, Statement, StatementKind};
use super::classes::HOW_TO_FLATTEN;
use super::lexer::{Keyword, Symbol, Token};
use super::parser::Parser;
use super::unquoted;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_ITERATORS;

/// What begins with a parenthesis on the left of an equation.
enum Listed {
    One(ExprId),
    Several(Vec<Option<ExprId>>),
}

impl Parser<'_> {
    /// `(a, , b)`, or an expression that begins with a parenthesis.
    fn list_or_expression(&mut self) -> Result<Listed> {
        match self.is_list() {
            true => Ok(Listed::Several(self.targets()?)),
            false => Ok(Listed::One(self.expression()?)),
        }
    }

    pub(super) fn equation(&mut self) -> Result<Equation> {
        self.nested(|parser| parser.equation_here())
    }

    fn equation_here(&mut self) -> Result<Equation> {
        self.count(2)?;
        let start = self.span;
        self.refuse_unsupported_equation()?;
        let kind = match self.token {
            Token::Keyword(Keyword::For) => self.for_equation()?,
            Token::Keyword(Keyword::If) => self.if_equation()?,
            _ => self.equality()?,
        };
        let span = start.to(self.last);
        self.comment()?;
        self.expect(Symbol::Semicolon)?;
        Ok(Equation { kind, span })
    }

    fn refuse_unsupported_equation(&self) -> Result<()> {
        let (what, hint) = match self.token {
            Token::Keyword(Keyword::When | Keyword::Elsewhen) => (
                "a `when` equation",
                "an observer needs continuous equations: use `if` expressions",
            ),
            Token::Keyword(Keyword::Connect) => {
                return Err(
                    Problem::new(self.span, "the model is not flat: it has `connect`")
                        .hint(HOW_TO_FLATTEN),
                );
            }
            Token::Keyword(Keyword::While) => ("`while`", "use a `for` loop"),
            Token::Keyword(
                Keyword::Parameter | Keyword::Constant | Keyword::Input | Keyword::Output,
            ) => {
                return Err(self
                    .unexpected("an equation")
                    .hint("declarations come before the word `equation`, or after `public`"));
            }
            _ => return Ok(()),
        };
        Err(self.refuse(what, hint))
    }

    fn equality(&mut self) -> Result<EquationKind> {
        let start = self.span;
        if let Some(assert) = self.assert_call()? {
            return Ok(EquationKind::Assert(assert));
        }
        let left = match self.at(Symbol::OpenParen) {
            true => match self.list_or_expression()? {
                Listed::One(left) => left,
                Listed::Several(targets) => {
                    self.expect(Symbol::Equal)?;
                    return Ok(EquationKind::Several(targets, self.expression()?));
                }
            },
            false => self.expression()?,
        };
        if self.at(Symbol::Equal) {
            self.advance()?;
            let right = self.expression()?;
            return Ok(EquationKind::Equality(left, right));
        }
        let text = start.text(self.source);
        if matches!(text, "Real" | "Integer") && self.token == Token::Identifier {
            return Err(Problem::new(start, "a declaration among the equations")
                .hint("declarations come before the word `equation`, or after `public`"));
        }
        if matches!(text, "terminate" | "reinit") {
            return Err(Problem::new(start, format!("`{text}` is not supported"))
                .hint("models with events are not supported: use `if` expressions"));
        }
        let hint = match self.token {
            Token::Symbol(Symbol::Assign) => Some("`:=` assigns in algorithms; write `=`"),
            Token::Symbol(Symbol::EqualEqual) => Some("an equation is written with one `=`"),
            _ => None,
        };
        Err(self.unexpected("`=`").maybe_hint(hint.map(str::to_owned)))
    }

    /// `assert(condition, "message", level)`, where one stands here.
    pub(super) fn assert_call(&mut self) -> Result<Option<Assert>> {
        if self.token != Token::Identifier || self.span.text(self.source) != "assert" {
            return Ok(None);
        }
        self.advance()?;
        self.expect(Symbol::OpenParen)?;
        let condition = self.expression()?;
        self.expect(Symbol::Comma)?;
        let message = match self.token {
            Token::Text => unquoted(self.span.text(self.source)),
            _ => String::new(),
        };
        // The rest makes a text at the time of the failure: it takes no part in the plant.
        let mut is_warning = false;
        let mut open = 1usize;
        while open > 0 {
            match self.token {
                Token::Symbol(Symbol::OpenParen) => open += 1,
                Token::Symbol(Symbol::CloseParen) => open -= 1,
                Token::Identifier => is_warning |= self.span.text(self.source) == "warning",
                Token::End | Token::Symbol(Symbol::Semicolon) => {
                    return Err(self.unexpected("`)` after the message of the `assert`"));
                }
                _ => {}
            }
            self.advance()?;
        }
        Ok(Some(Assert {
            condition,
            message,
            is_warning,
        }))
    }

    fn for_equation(&mut self) -> Result<EquationKind> {
        self.advance()?;
        let iterators = self.iterators()?;
        self.expect_word(Keyword::Loop)?;
        let body = self.equations_until_end()?;
        self.end_of(Keyword::For)?;
        Ok(EquationKind::For(iterators, body))
    }

    fn if_equation(&mut self) -> Result<EquationKind> {
        self.advance()?;
        let mut branches = vec![];
        loop {
            let condition = self.expression()?;
            self.expect_word(Keyword::Then)?;
            branches.push((condition, self.equations_until_end()?));
            if !self.accept_word(Keyword::Elseif)? {
                break;
            }
        }
        let mut otherwise = vec![];
        if self.accept_word(Keyword::Else)? {
            otherwise = self.equations_until_end()?;
        }
        self.end_of(Keyword::If)?;
        Ok(EquationKind::If(branches, otherwise))
    }

    fn equations_until_end(&mut self) -> Result<Vec<Equation>> {
        let mut equations = vec![];
        while !matches!(
            self.token,
            Token::Keyword(Keyword::End | Keyword::Else | Keyword::Elseif) | Token::End
        ) {
            equations.push(self.equation()?);
        }
        Ok(equations)
    }

    pub(super) fn end_of(&mut self, keyword: Keyword) -> Result<()> {
        if !self.accept_word(Keyword::End)? {
            return Err(self.unexpected(&format!("`end {}`", keyword.text())));
        }
        self.expect_word(keyword)?;
        Ok(())
    }

    /// `i in 1:N, j in 1:M`
    pub(super) fn iterators(&mut self) -> Result<Vec<Iterator>> {
        let mut iterators: Vec<Iterator> = vec![];
        loop {
            let name = self.identifier("the name of an iterator")?;
            if iterators.len() >= MAX_ITERATORS {
                return Err(Problem::new(
                    name,
                    format!("more than {MAX_ITERATORS} iterators"),
                ));
            }
            self.refuse_repeated(&iterators, name)?;
            if !self.at_word(Keyword::In) {
                let problem = self.unexpected("`in` and a range");
                return Err(problem.hint("write `for i in 1:N`"));
            }
            self.advance()?;
            let range = self.expression()?;
            iterators.push(Iterator { name, range });
            if !self.accept(Symbol::Comma)? {
                return Ok(iterators);
            }
        }
    }

    fn refuse_repeated(&self, iterators: &[Iterator], name: Span) -> Result<()> {
        let text = name.text(self.source);
        if iterators
            .iter()
            .any(|other| other.name.text(self.source) == text)
        {
            return Err(Problem::new(
                name,
                format!("iterator `{text}` is used twice"),
            ));
        }
        Ok(())
    }
}

impl Parser<'_> {
    pub(super) fn statement(&mut self) -> Result<Statement> {
        self.nested(|parser| parser.statement_here())
    }

    fn statement_here(&mut self) -> Result<Statement> {
        self.count(2)?;
        let start = self.span;
        let kind = match self.token {
            Token::Keyword(Keyword::For) => {
                self.advance()?;
                let iterators = self.iterators()?;
                self.expect_word(Keyword::Loop)?;
                let body = self.statements()?;
                self.end_of(Keyword::For)?;
                StatementKind::For(iterators, body)
            }
            Token::Keyword(Keyword::While) => {
                self.advance()?;
                let condition = self.expression()?;
                self.expect_word(Keyword::Loop)?;
                let body = self.statements()?;
                self.end_of(Keyword::While)?;
                StatementKind::While(condition, body)
            }
            Token::Keyword(Keyword::If) => self.if_statement()?,
            Token::Keyword(Keyword::Break) => {
                self.advance()?;
                StatementKind::Break
            }
            Token::Keyword(Keyword::Return) => {
                self.advance()?;
                StatementKind::Return
            }
            Token::Keyword(Keyword::When) => {
                return Err(self.refuse(
                    "a `when` statement",
                    "an observer needs continuous equations: use `if` expressions",
                ));
            }
            _ => self.assignment()?,
        };
        let span = start.to(self.last);
        self.comment()?;
        self.expect(Symbol::Semicolon)?;
        Ok(Statement { kind, span })
    }

    fn if_statement(&mut self) -> Result<StatementKind> {
        self.advance()?;
        let mut branches = vec![];
        loop {
            let condition = self.expression()?;
            self.expect_word(Keyword::Then)?;
            branches.push((condition, self.statements()?));
            if !self.accept_word(Keyword::Elseif)? {
                break;
            }
        }
        let mut otherwise = vec![];
        if self.accept_word(Keyword::Else)? {
            otherwise = self.statements()?;
        }
        self.end_of(Keyword::If)?;
        Ok(StatementKind::If(branches, otherwise))
    }

    fn statements(&mut self) -> Result<Vec<Statement>> {
        let mut statements = vec![];
        while !matches!(
            self.token,
            Token::Keyword(Keyword::End | Keyword::Else | Keyword::Elseif) | Token::End
        ) {
            statements.push(self.statement()?);
        }
        Ok(statements)
    }

    fn assignment(&mut self) -> Result<StatementKind> {
        if let Some(assert) = self.assert_call()? {
            return Ok(StatementKind::Assert(assert));
        }
        let targets = match self.at(Symbol::OpenParen) {
            true => self.targets()?,
            false => vec![Some(self.expression()?)],
        };
        if !self.at(Symbol::Assign) {
            let hint = "a statement of an algorithm reads `x := …;`";
            return Err(self.unexpected("`:=`").hint(hint));
        }
        self.advance()?;
        let value = self.expression()?;
        Ok(StatementKind::Assign(targets, value))
    }

    /// `(a, , b)` on the left of what gives several values.
    pub(super) fn targets(&mut self) -> Result<Vec<Option<ExprId>>> {
        let start = self.expect(Symbol::OpenParen)?;
        let mut targets = vec![];
        loop {
            let is_left_out = self.at(Symbol::Comma) || self.at(Symbol::CloseParen);
            targets.push(match is_left_out {
                true => None,
                false => Some(self.expression()?),
            });
            if !self.accept(Symbol::Comma)? {
                break;
            }
        }
        self.expect(Symbol::CloseParen)?;
        if targets.iter().all(Option::is_none) {
            let message = "expected variables between the parentheses";
            return Err(Problem::new(start, message));
        }
        Ok(targets)
    }
}
