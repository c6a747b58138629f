//! Statements of algorithms.

use super::ast::{ExprId, Statement, StatementKind};
use super::parser::Parser;
use super::token::{Keyword, Symbol, Token};
use super::{Problem, Result};

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
