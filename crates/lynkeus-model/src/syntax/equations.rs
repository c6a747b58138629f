//! The `equation` section.

use super::ast::{Equation, EquationKind, Iterator};
use super::parser::Parser;
use super::token::{Keyword, Symbol, Token};
use super::{Problem, Result, Span};
use crate::limits::MAX_ITERATORS;

impl Parser<'_> {
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
                ("`connect`", "write the equations of the connection")
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
        let left = self.expression()?;
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
        if matches!(text, "assert" | "terminate" | "reinit") {
            return Err(Problem::new(start, format!("`{text}` is not supported"))
                .hint("give bounds with `min` and `max` in the declarations"));
        }
        let hint = match self.token {
            Token::Symbol(Symbol::Assign) => Some("`:=` assigns in algorithms; write `=`"),
            Token::Symbol(Symbol::EqualEqual) => Some("an equation is written with one `=`"),
            _ => None,
        };
        Err(self.unexpected("`=`").maybe_hint(hint.map(str::to_owned)))
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

    fn end_of(&mut self, keyword: Keyword) -> Result<()> {
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
