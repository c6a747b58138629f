//! The tree of a draft.

use super::expression::named;
use super::lexer::{Kind, Token, tokens};
use super::{
    Declaration, Expr, Function, If, Item, Line, Operator, Otherwise, Parameter, Statement, Type,
    Value,
};
use crate::Refusal;

/// The tree of a draft from which has been [chosen](crate::curly::template::chosen).
///
/// # Errors
/// [`Refusal::Draft`]: what is no draft, which is a defect of this crate.
pub(in crate::curly) fn parsed(draft: &str) -> Result<Vec<Item>, Refusal> {
    let tokens = tokens(draft);
    let mut parser = Parser {
        tokens: &tokens,
        place: 0,
    };
    let mut items = vec![];
    loop {
        for _ in parser.last_line() + 1..parser.next().line {
            items.push(Item::Blank);
        }
        match parser.next().kind {
            Kind::End => return Ok(items),
            Kind::Comment => items.push(Item::Comment(parser.take().text.to_owned())),
            _ => items.push(parser.item()?),
        }
    }
}

pub(super) struct Parser<'t> {
    /// the last one is an end
    tokens: &'t [Token<'t>],
    place: usize,
}

const END: Token<'_> = Token {
    kind: Kind::End,
    text: "",
    line: 0,
};

impl<'t> Parser<'t> {
    pub fn next(&self) -> Token<'t> {
        self.after(0)
    }

    /// The token after so many others.
    pub fn after(&self, count: usize) -> Token<'t> {
        let last = self.tokens.len().saturating_sub(1);
        let found = self.tokens.get((self.place + count).min(last));
        found.copied().unwrap_or(END)
    }

    /// The line on which what was taken ends; 0 at the beginning.
    fn last_line(&self) -> usize {
        let before = self.place.checked_sub(1);
        let before = before.and_then(|place| self.tokens.get(place));
        before.map_or(0, Token::last_line)
    }

    pub fn take(&mut self) -> Token<'t> {
        let token = self.next();
        self.place += 1;
        token
    }

    pub fn is(&self, text: &str) -> bool {
        self.next().text == text
    }

    pub fn takes(&mut self, text: &str) -> bool {
        let is = self.is(text);
        self.place += usize::from(is);
        is
    }

    pub fn expect(&mut self, text: &str) -> Result<(), Refusal> {
        match self.takes(text) {
            true => Ok(()),
            false => Err(self.refused(format!("`{text}`"))),
        }
    }

    pub fn refused(&self, expected: impl Into<String>) -> Refusal {
        let Token { text, line, .. } = self.next();
        Refusal::Draft {
            line,
            expected: expected.into(),
            found: text.to_owned(),
        }
    }

    pub fn word(&mut self) -> Result<String, Refusal> {
        match self.next().kind {
            Kind::Word => Ok(self.take().text.to_owned()),
            _ => Err(self.refused("a name")),
        }
    }

    fn kind(&mut self) -> Result<Type, Refusal> {
        let kind = named(self.next().text).ok_or_else(|| self.refused("a type"))?;
        self.take();
        Ok(kind)
    }

    fn item(&mut self) -> Result<Item, Refusal> {
        if self.takes("typedef") {
            return self.alias();
        }
        self.expect("static")?;
        if self.is("const") {
            let table = self.declaration()?;
            self.expect(";")?;
            return Ok(Item::Table(table));
        }
        Ok(Item::Function(Function {
            kind: self.kind()?,
            name: self.word()?,
            parameters: self.parameters()?,
            body: self.block()?,
        }))
    }

    /// `void (*field)(…);`
    fn alias(&mut self) -> Result<Item, Refusal> {
        for text in ["void", "(", "*", "field", ")"] {
            self.expect(text)?;
        }
        let parameters = self.parameters()?;
        self.expect(";")?;
        Ok(Item::Alias(parameters))
    }

    fn parameters(&mut self) -> Result<Vec<Parameter>, Refusal> {
        let mut parameters = vec![];
        self.expect("(")?;
        loop {
            let is_const = self.takes("const");
            parameters.push(Parameter {
                kind: self.kind()?,
                is_pointer: self.takes("*"),
                name: self.word()?,
                is_const,
            });
            if !self.takes(",") {
                break;
            }
        }
        self.expect(")")?;
        Ok(parameters)
    }

    fn block(&mut self) -> Result<Vec<Line>, Refusal> {
        let mut lines = vec![];
        self.expect("{")?;
        while !self.takes("}") {
            let statement = match self.next().kind {
                Kind::Comment => Statement::Comment(self.take().text.to_owned()),
                _ => self.statement()?,
            };
            let next = self.next();
            let is_beside = next.kind == Kind::Comment && next.line == self.last_line();
            let comment = is_beside.then(|| self.take().text.to_owned());
            lines.push(Line { statement, comment });
        }
        Ok(lines)
    }

    fn statement(&mut self) -> Result<Statement, Refusal> {
        Ok(match self.next().text {
            "if" => Statement::If(self.conditional()?),
            "for" => self.repeated()?,
            "while" => {
                self.take();
                Statement::While {
                    condition: self.condition()?,
                    body: self.block()?,
                }
            }
            _ => {
                let simple = self.simple()?;
                self.expect(";")?;
                simple
            }
        })
    }

    /// What stands before a semicolon.
    fn simple(&mut self) -> Result<Statement, Refusal> {
        if self.takes("continue") {
            return Ok(Statement::Continue);
        }
        if self.takes("return") {
            return Ok(Statement::Return(self.expression()?));
        }
        if self.is("(") && self.after(1).text == "void" {
            for text in ["(", "void", ")"] {
                self.expect(text)?;
            }
            return match self.expression()? {
                Expr::Name(name) => Ok(Statement::Unused(name)),
                call @ Expr::Call(..) => Ok(Statement::Call(call)),
                _ => Err(self.refused("a name or a call after (void)")),
            };
        }
        let is_type = named(self.next().text).is_some() && self.after(1).kind == Kind::Word;
        if self.is("const") || is_type {
            return Ok(Statement::Declare(self.declaration()?));
        }
        self.change()
    }

    fn change(&mut self) -> Result<Statement, Refusal> {
        let target = self.postfix()?;
        if self.is("++") || self.is("--") {
            let is_up = self.take().text == "++";
            return Ok(Statement::Count { target, is_up });
        }
        if self.is(";") && matches!(target, Expr::Call(..)) {
            return Ok(Statement::Call(target));
        }
        let operator = match self.next().text {
            "=" => None,
            "+=" => Some(Operator::Add),
            "-=" => Some(Operator::Sub),
            "*=" => Some(Operator::Mul),
            "/=" => Some(Operator::Div),
            _ => return Err(self.refused("an assignment")),
        };
        self.take();
        Ok(Statement::Assign {
            target,
            operator,
            value: self.expression()?,
        })
    }

    fn declaration(&mut self) -> Result<Declaration, Refusal> {
        let is_const = self.takes("const");
        let kind = self.kind()?;
        let name = self.word()?;
        let mut size = None;
        if self.takes("[") {
            size = Some(self.expression()?);
            self.expect("]")?;
        }
        let value = match (self.takes("="), self.takes("{")) {
            (true, true) => {
                let list = self.list("}")?;
                Value::List(list)
            }
            (true, false) => Value::One(self.expression()?),
            _ => Value::None,
        };
        Ok(Declaration {
            is_const,
            kind,
            name,
            size,
            value,
        })
    }

    fn condition(&mut self) -> Result<Expr, Refusal> {
        self.expect("(")?;
        let condition = self.expression()?;
        self.expect(")")?;
        Ok(condition)
    }

    fn conditional(&mut self) -> Result<If, Refusal> {
        self.expect("if")?;
        Ok(If {
            condition: self.condition()?,
            then: self.block()?,
            otherwise: match (self.takes("else"), self.is("if")) {
                (true, true) => Otherwise::If(Box::new(self.conditional()?)),
                (true, false) => Otherwise::Block(self.block()?),
                (false, _) => Otherwise::Nothing,
            },
        })
    }

    fn repeated(&mut self) -> Result<Statement, Refusal> {
        self.expect("for")?;
        self.expect("(")?;
        let start = match self.is(";") {
            true => None,
            false => Some(self.declaration()?),
        };
        self.expect(";")?;
        let condition = self.expression()?;
        self.expect(";")?;
        let step = Box::new(self.change()?);
        self.expect(")")?;
        Ok(Statement::For {
            start,
            condition,
            step,
            body: self.block()?,
        })
    }
}

#[cfg(test)]
mod tests;
