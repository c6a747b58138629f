//! Names with what stands behind them: parts, subscripts, arguments.

use super::ast::{Call, ExprId, Kind, PathPart};
use super::expressions::too_many_dimensions;
use super::parser::Parser;
use super::token::{Keyword, Symbol};
use super::{Result, Span};
use crate::limits::MAX_RANK;

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
            let mut subscripts = vec![];
            if self.at(Symbol::OpenBracket) {
                subscripts = self.subscripts()?;
            }
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
