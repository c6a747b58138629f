//! What stands in the sections `equation` and `algorithm`.

use super::ast::{Assert, Equation, EquationKind, ExprId, ForIndex, Statement, StatementKind};
use super::classes::HOW_TO_FLATTEN;
use super::lexer::Token;
use super::parser::Parser;
use super::unquoted;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_ITERATORS;

/// Conditions with what holds under them, and what holds under none.
type Cases<T> = (Vec<(ExprId, Vec<T>)>, Vec<T>);

const NO_EVENTS: &str = "an observer needs continuous equations: use `if` expressions";
const WHERE_DECLARATIONS_STAND: &str =
    "declarations come before the word `equation`, or after `public`";

impl Parser<'_> {
    pub(super) fn equation(&mut self) -> Result<Equation> {
        self.nested(|parser| parser.equation_here())
    }

    fn equation_here(&mut self) -> Result<Equation> {
        self.count(2)?;
        let start = self.span;
        self.refuse_unsupported_equation()?;
        let kind = match self.token {
            Token::Fixed("for") => {
                let (iterators, body) = self.repeated(Self::equation)?;
                EquationKind::For(iterators, body)
            }
            Token::Fixed("if") => {
                let (branches, otherwise) = self.branches(Self::equation)?;
                EquationKind::If(branches, otherwise)
            }
            _ => self.equality()?,
        };
        let span = start.to(self.last);
        self.comment()?;
        self.expect(";")?;
        Ok(Equation { kind, span })
    }

    fn refuse_unsupported_equation(&self) -> Result<()> {
        Err(match self.token {
            Token::Fixed("when" | "elsewhen") => self.refuse("a `when` equation", NO_EVENTS),
            Token::Fixed("while") => self.refuse("`while`", "use a `for` loop"),
            Token::Fixed("connect") => {
                let message = "the model is not flat: it has `connect`";
                Problem::new(self.span, message).hint(HOW_TO_FLATTEN)
            }
            Token::Fixed("parameter" | "constant" | "input" | "output") => self
                .unexpected("an equation")
                .hint(WHERE_DECLARATIONS_STAND),
            _ => return Ok(()),
        })
    }

    fn equality(&mut self) -> Result<EquationKind> {
        let start = self.span;
        if let Some(assert) = self.assert_call()? {
            return Ok(EquationKind::Assert(assert));
        }
        if self.at("(") && self.is_list() {
            let targets = self.targets()?;
            self.expect("=")?;
            return Ok(EquationKind::Several(targets, self.expression()?));
        }
        let left = self.expression()?;
        if self.accept("=")? {
            return Ok(EquationKind::Equality(left, self.expression()?));
        }
        let text = start.text(self.source);
        if matches!(text, "Real" | "Integer") && self.token == Token::Identifier {
            return Err(Problem::new(start, "a declaration among the equations")
                .hint(WHERE_DECLARATIONS_STAND));
        }
        if matches!(text, "terminate" | "reinit") {
            return Err(Problem::new(start, format!("`{text}` is not supported"))
                .hint("models with events are not supported: use `if` expressions"));
        }
        let hint = match self.token {
            Token::Fixed(":=") => Some("`:=` assigns in algorithms; write `=`"),
            Token::Fixed("==") => Some("an equation is written with one `=`"),
            _ => None,
        };
        Err(self.unexpected("`=`").maybe_hint(hint))
    }

    /// `assert(condition, "message", level)`, where one stands here.
    pub(super) fn assert_call(&mut self) -> Result<Option<Assert>> {
        if self.token != Token::Identifier || self.span.text(self.source) != "assert" {
            return Ok(None);
        }
        self.advance()?;
        self.expect("(")?;
        let condition = self.expression()?;
        self.expect(",")?;
        let message = match self.token {
            Token::Text => unquoted(self.span.text(self.source)),
            _ => String::new(),
        };
        // The rest makes a text at the time of the failure: it takes no part in the plant.
        let mut is_warning = false;
        let mut open = 1usize;
        while open > 0 {
            match self.token {
                Token::Fixed("(") => open += 1,
                Token::Fixed(")") => open -= 1,
                Token::Identifier => is_warning |= self.span.text(self.source) == "warning",
                Token::End | Token::Fixed(";") => {
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

    /// Equations or statements behind `if`.
    fn branches<T>(&mut self, one: fn(&mut Self) -> Result<T>) -> Result<Cases<T>> {
        self.advance()?;
        let branches = self.cases(|parser| parser.until_end(one))?;
        let mut otherwise = vec![];
        if self.accept("else")? {
            otherwise = self.until_end(one)?;
        }
        self.end_of("if")?;
        Ok((branches, otherwise))
    }

    /// The iterators and the body of a loop, behind `for`.
    fn repeated<T>(&mut self, one: fn(&mut Self) -> Result<T>) -> Result<(Vec<ForIndex>, Vec<T>)> {
        self.advance()?;
        let iterators = self.iterators()?;
        self.expect("loop")?;
        let body = self.until_end(one)?;
        self.end_of("for")?;
        Ok((iterators, body))
    }

    /// Equations or statements up to `end` or `else`.
    fn until_end<T>(&mut self, one: fn(&mut Self) -> Result<T>) -> Result<Vec<T>> {
        let mut found = vec![];
        let end = Token::Fixed("end");
        while ![
            end,
            Token::Fixed("else"),
            Token::Fixed("elseif"),
            Token::End,
        ]
        .contains(&self.token)
        {
            found.push(one(self)?);
        }
        Ok(found)
    }

    fn end_of(&mut self, word: &'static str) -> Result<()> {
        if !self.accept("end")? {
            return Err(self.unexpected(&format!("`end {word}`")));
        }
        self.expect(word).map(|_| ())
    }

    /// `i in 1:N, j in 1:M`
    pub(super) fn iterators(&mut self) -> Result<Vec<ForIndex>> {
        let mut iterators: Vec<ForIndex> = vec![];
        loop {
            let name = self.identifier("the name of an iterator")?;
            if iterators.len() >= MAX_ITERATORS {
                return Err(Problem::new(
                    name,
                    format!("more than {MAX_ITERATORS} iterators"),
                ));
            }
            self.refuse_repeated(&iterators, name)?;
            if !self.at("in") {
                let problem = self.unexpected("`in` and a range");
                return Err(problem.hint("write `for i in 1:N`"));
            }
            self.advance()?;
            let range = self.expression()?;
            iterators.push(ForIndex { name, range });
            if !self.accept(",")? {
                return Ok(iterators);
            }
        }
    }

    fn refuse_repeated(&self, iterators: &[ForIndex], name: Span) -> Result<()> {
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
            Token::Fixed("for") => {
                let (iterators, body) = self.repeated(Self::statement)?;
                StatementKind::For(iterators, body)
            }
            Token::Fixed("while") => {
                self.advance()?;
                let condition = self.expression()?;
                self.expect("loop")?;
                let body = self.until_end(Self::statement)?;
                self.end_of("while")?;
                StatementKind::While(condition, body)
            }
            Token::Fixed("if") => {
                let (branches, otherwise) = self.branches(Self::statement)?;
                StatementKind::If(branches, otherwise)
            }
            Token::Fixed("break") => {
                self.advance()?;
                StatementKind::Break
            }
            Token::Fixed("return") => {
                self.advance()?;
                StatementKind::Return
            }
            Token::Fixed("when") => {
                return Err(self.refuse("a `when` statement", NO_EVENTS));
            }
            _ => self.assignment()?,
        };
        let span = start.to(self.last);
        self.comment()?;
        self.expect(";")?;
        Ok(Statement { kind, span })
    }

    fn assignment(&mut self) -> Result<StatementKind> {
        if let Some(assert) = self.assert_call()? {
            return Ok(StatementKind::Assert(assert));
        }
        let targets = match self.at("(") {
            true => self.targets()?,
            false => vec![Some(self.expression()?)],
        };
        if !self.at(":=") {
            let hint = "a statement of an algorithm reads `x := …;`";
            return Err(self.unexpected("`:=`").hint(hint));
        }
        self.advance()?;
        let value = self.expression()?;
        Ok(StatementKind::Assign(targets, value))
    }

    /// `(a, , b)` on the left of what gives several values.
    pub(super) fn targets(&mut self) -> Result<Vec<Option<ExprId>>> {
        let start = self.expect("(")?;
        let targets = self.list(|parser| match parser.at(",") || parser.at(")") {
            true => Ok(None),
            false => parser.expression().map(Some),
        })?;
        self.expect(")")?;
        if targets.iter().all(Option::is_none) {
            let message = "expected variables between the parentheses";
            return Err(Problem::new(start, message));
        }
        Ok(targets)
    }
}
