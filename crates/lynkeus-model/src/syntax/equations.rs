//! What stands in the sections `equation` and `algorithm`.

use super::ast::{
    Assert, Equation, EquationKind, ExprId, ForIndex, Placed, Statement, StatementKind,
};
use super::classes::HOW_TO_FLATTEN;
use super::lexer::Token;
use super::parser::Parser;
use super::unquoted;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_ITERATORS;

/// Conditions with what holds under them.
type Cases<T> = Vec<(ExprId, Vec<T>)>;

const WHERE_DECLARATIONS_STAND: &str =
    "declarations come before the word `equation`, or after `public`";

impl Parser<'_> {
    pub(super) fn equation(&mut self) -> Result<Equation> {
        self.placed(|parser| {
            parser.refuse_unsupported_equation()?;
            match parser.token {
                Token::Fixed("for") => parser.repeated(Self::equation, EquationKind::For),
                Token::Fixed("if") => parser.branches(Self::equation, EquationKind::If),
                Token::Fixed("when") => parser.whens(Self::equation, EquationKind::When),
                _ => parser.equality(),
            }
        })
    }

    /// An equation or a statement up to its semicolon.
    fn placed<K>(&mut self, kind: impl FnOnce(&mut Self) -> Result<K>) -> Result<Placed<K>> {
        self.nested(|parser| {
            parser.count(2)?;
            let start = parser.span;
            let kind = kind(parser)?;
            let span = start.to(parser.last);
            parser.ending()?;
            Ok(Placed { kind, span })
        })
    }

    fn refuse_unsupported_equation(&self) -> Result<()> {
        Err(match self.token {
            Token::Fixed("elsewhen") => self.unexpected("`when` before it"),
            Token::Fixed("while") => self.refuse("`while`", "use a `for` loop"),
            Token::Fixed("connect") => {
                let message = "the model is not flat: it has `connect`";
                Problem::new(self.span, message).hint(HOW_TO_FLATTEN)
            }
            Token::Fixed("parameter" | "constant" | "input" | "output") => {
                let problem = self.unexpected("an equation");
                problem.hint(WHERE_DECLARATIONS_STAND)
            }
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
        if let Some(reinit) = self.reinit_call()? {
            return Ok(reinit);
        }
        let left = self.expression()?;
        if self.accept("=")? {
            return Ok(EquationKind::Equality(left, self.expression()?));
        }
        let text = start.text(self.source);
        if matches!(text, "Real" | "Integer") && self.token == Token::Identifier {
            let problem = Problem::new(start, "a declaration among the equations");
            return Err(problem.hint(WHERE_DECLARATIONS_STAND));
        }
        if text == "terminate" {
            return Err(Problem::new(start, "`terminate` is not supported")
                .hint("the study says until when: `until` of [simulate], the end of the log"));
        }
        let hint = match self.token {
            Token::Fixed(":=") => Some("`:=` assigns in algorithms; write `=`"),
            Token::Fixed("==") => Some("an equation is written with one `=`"),
            _ => None,
        };
        Err(self.unexpected("`=`").maybe_hint(hint))
    }

    /// `reinit(x, e)`, where one stands here.
    fn reinit_call(&mut self) -> Result<Option<EquationKind>> {
        if self.token != Token::Identifier || self.span.text(self.source) != "reinit" {
            return Ok(None);
        }
        self.advance()?;
        self.expect("(")?;
        let state = self.expression()?;
        self.expect(",")?;
        let value = self.expression()?;
        self.expect(")")?;
        Ok(Some(EquationKind::Reinit(state, value)))
    }

    /// What stands behind `when`, and behind each `elsewhen`.
    fn whens<T, K>(
        &mut self,
        one: fn(&mut Self) -> Result<T>,
        kind: fn(Cases<T>) -> K,
    ) -> Result<K> {
        let mut clauses = vec![];
        loop {
            self.advance()?;
            let condition = self.expression()?;
            self.expect("then")?;
            clauses.push((condition, self.until_end(one)?));
            if !self.at("elsewhen") {
                break;
            }
        }
        self.end_of("when")?;
        Ok(kind(clauses))
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
    fn branches<T, K>(
        &mut self,
        one: fn(&mut Self) -> Result<T>,
        kind: fn(Cases<T>, Vec<T>) -> K,
    ) -> Result<K> {
        self.advance()?;
        let branches = self.cases(|parser| parser.until_end(one))?;
        let mut otherwise = vec![];
        if self.accept("else")? {
            otherwise = self.until_end(one)?;
        }
        self.end_of("if")?;
        Ok(kind(branches, otherwise))
    }

    /// Equations or statements behind `for`.
    fn repeated<T, K>(
        &mut self,
        one: fn(&mut Self) -> Result<T>,
        kind: fn(Vec<ForIndex>, Vec<T>) -> K,
    ) -> Result<K> {
        self.advance()?;
        let iterators = self.iterators()?;
        Ok(kind(iterators, self.looped("for", one)?))
    }

    /// What stands between `loop` and its end.
    fn looped<T>(&mut self, of: &'static str, one: fn(&mut Self) -> Result<T>) -> Result<Vec<T>> {
        self.expect("loop")?;
        let body = self.until_end(one)?;
        self.end_of(of)?;
        Ok(body)
    }

    /// Equations or statements up to `end` or `else`.
    fn until_end<T>(&mut self, one: fn(&mut Self) -> Result<T>) -> Result<Vec<T>> {
        let mut found = vec![];
        while !matches!(
            self.token,
            Token::Fixed("end" | "else" | "elseif" | "elsewhen") | Token::End
        ) {
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
                let message = format!("more than {MAX_ITERATORS} iterators");
                return Err(Problem::new(name, message));
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
        let mut names = iterators.iter().map(|other| other.name.text(self.source));
        if names.any(|other| other == text) {
            let message = format!("iterator `{text}` is used twice");
            return Err(Problem::new(name, message));
        }
        Ok(())
    }
}

impl Parser<'_> {
    pub(super) fn statement(&mut self) -> Result<Statement> {
        self.placed(|parser| match parser.token {
            Token::Fixed("for") => parser.repeated(Self::statement, StatementKind::For),
            Token::Fixed("while") => {
                parser.advance()?;
                let condition = parser.expression()?;
                let body = parser.looped("while", Self::statement)?;
                Ok(StatementKind::While(condition, body))
            }
            Token::Fixed("if") => parser.branches(Self::statement, StatementKind::If),
            Token::Fixed("break") => parser.advance().map(|_| StatementKind::Break),
            Token::Fixed("return") => parser.advance().map(|_| StatementKind::Return),
            Token::Fixed("when") => parser.whens(Self::statement, StatementKind::When),
            _ => parser.assignment(),
        })
    }

    /// `x := e;` of an `initial algorithm`, which says what an initial equation does.
    pub(super) fn first_value(&mut self) -> Result<Equation> {
        let Placed { kind, span } = self.statement()?;
        match kind {
            StatementKind::Assign(targets, value) if let [Some(target)] = targets[..] => {
                Ok(Placed {
                    kind: EquationKind::Equality(target, value),
                    span,
                })
            }
            _ => {
                let message = "an `initial algorithm` that does more than assign values";
                Err(Problem::new(span, message).hint(
                    "give the start values in the declarations with `start = …`, or write an \
                     `initial equation`",
                ))
            }
        }
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
