//! The tree of a draft, from its words, numbers, signs and comments.

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

struct Parser<'t> {
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
    fn next(&self) -> Token<'t> {
        self.after(0)
    }

    /// The token after so many others.
    fn after(&self, count: usize) -> Token<'t> {
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

    fn take(&mut self) -> Token<'t> {
        let token = self.next();
        self.place += 1;
        token
    }

    fn is(&self, text: &str) -> bool {
        self.next().text == text
    }

    fn takes(&mut self, text: &str) -> bool {
        let is = self.is(text);
        self.place += usize::from(is);
        is
    }

    fn expect(&mut self, text: &str) -> Result<(), Refusal> {
        match self.takes(text) {
            true => Ok(()),
            false => Err(self.refused(format!("`{text}`"))),
        }
    }

    fn refused(&self, expected: impl Into<String>) -> Refusal {
        let Token { text, line, .. } = self.next();
        Refusal::Draft {
            line,
            expected: expected.into(),
            found: text.to_owned(),
        }
    }

    fn word(&mut self) -> Result<String, Refusal> {
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

impl Parser<'_> {
    /// What stands between commas, and the sign at the end.
    fn list(&mut self, end: &str) -> Result<Vec<Expr>, Refusal> {
        let mut list = vec![];
        if self.takes(end) {
            return Ok(list);
        }
        loop {
            list.push(self.expression()?);
            if !self.takes(",") {
                self.expect(end)?;
                return Ok(list);
            }
        }
    }

    fn expression(&mut self) -> Result<Expr, Refusal> {
        let condition = self.operation(0)?;
        if !self.takes("?") {
            return Ok(condition);
        }
        let then = self.expression()?;
        self.expect(":")?;
        let otherwise = self.expression()?;
        Ok(Expr::Choice(
            Box::new(condition),
            Box::new(then),
            Box::new(otherwise),
        ))
    }

    /// Operations that bind more tightly than a level.
    fn operation(&mut self, level: u8) -> Result<Expr, Refusal> {
        let mut left = self.prefixed()?;
        while let Some(operator) = self.operator(level) {
            self.take();
            let right = self.operation(operator.level())?;
            left = Expr::Binary(operator, Box::new(left), Box::new(right));
        }
        Ok(left)
    }

    fn operator(&self, level: u8) -> Option<Operator> {
        let next = self.next().text;
        let known = Operator::SIGNS.iter().find(|known| known.0 == next);
        let operator = known.map(|known| known.1);
        operator.filter(|operator| operator.level() > level)
    }

    fn prefixed(&mut self) -> Result<Expr, Refusal> {
        for sign in ["-", "!", "&"] {
            if self.takes(sign) {
                return Ok(Expr::Prefix(sign, Box::new(self.prefixed()?)));
            }
        }
        let cast = named(self.after(1).text).filter(|_| self.is("(") && self.after(2).text == ")");
        match cast {
            Some(kind) => {
                let _ = (self.take(), self.take(), self.take());
                Ok(Expr::Cast(kind, Box::new(self.prefixed()?)))
            }
            None => self.postfix(),
        }
    }

    fn postfix(&mut self) -> Result<Expr, Refusal> {
        let mut value = self.atom()?;
        while self.takes("[") {
            let place = self.expression()?;
            self.expect("]")?;
            value = Expr::Index(Box::new(value), Box::new(place));
        }
        Ok(value)
    }

    fn atom(&mut self) -> Result<Expr, Refusal> {
        if self.takes("(") {
            let inner = self.expression()?;
            self.expect(")")?;
            return Ok(Expr::Group(Box::new(inner)));
        }
        let token = self.next();
        let text = token.text.to_owned();
        match token.kind {
            Kind::Number => {
                self.take();
                Ok(Expr::Number(text))
            }
            Kind::Word => {
                self.take();
                self.name(text)
            }
            _ => Err(self.refused("a value")),
        }
    }

    /// A name and what it may be followed by.
    fn name(&mut self, name: String) -> Result<Expr, Refusal> {
        if name == "s" && self.takes("->") {
            return Ok(Expr::Part(self.word()?));
        }
        if !self.takes("(") {
            return Ok(Expr::Name(name));
        }
        if name != "R" {
            return Ok(Expr::Call(name, self.list(")")?));
        }
        let is_negative = self.takes("-");
        let digits = self.next();
        if digits.kind != Kind::Number {
            return Err(self.refused("digits in R()"));
        }
        self.take();
        self.expect(")")?;
        let number = Expr::Real(digits.text.to_owned());
        Ok(match is_negative {
            true => Expr::Prefix("-", Box::new(number)),
            false => number,
        })
    }
}

/// The type that a word names.
fn named(word: &str) -> Option<Type> {
    Some(match word {
        "void" => Type::Void,
        "real" => Type::Real,
        "double" => Type::Double,
        "int" => Type::Int,
        "truth" => Type::Truth,
        "STATE" => Type::State,
        "field" => Type::Field,
        _ => return None,
    })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Word,
    Number,
    Sign,
    Comment,
    /// after everything, on a line of its own
    End,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Token<'t> {
    pub kind: Kind,
    pub text: &'t str,
    /// on which it begins, from 1 on
    pub line: usize,
}

impl Token<'_> {
    /// The line on which it ends.
    fn last_line(&self) -> usize {
        self.line + self.text.matches('\n').count()
    }
}

/// Signs of two characters; all others have one.
const LONG: [&str; 14] = [
    "->", "++", "--", "+=", "-=", "*=", "/=", "<=", ">=", "==", "!=", "&&", "||", ">>",
];

fn tokens(draft: &str) -> Vec<Token<'_>> {
    let mut tokens = vec![];
    let mut rest = draft;
    let mut line = 1;
    loop {
        let trimmed = rest.trim_start();
        line += lines(&rest[..rest.len() - trimmed.len()]);
        if trimmed.is_empty() {
            break;
        }
        let (kind, length) = first(trimmed);
        let (text, left) = trimmed.split_at(length);
        tokens.push(Token { kind, text, line });
        line += lines(text);
        rest = left;
    }
    tokens.push(Token {
        kind: Kind::End,
        text: "",
        line: draft.lines().count() + 1,
    });
    tokens
}

fn lines(text: &str) -> usize {
    text.matches('\n').count()
}

/// What a text begins with, and how long that is in bytes.
fn first(text: &str) -> (Kind, usize) {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let word = text.find(|c| !is_word(c)).unwrap_or(text.len());
    if text.starts_with("/*") {
        let end = text.find("*/").map_or(text.len(), |end| end + 2);
        return (Kind::Comment, end);
    }
    if text.starts_with(|c: char| c.is_ascii_digit()) {
        return (Kind::Number, number(text));
    }
    if word > 0 {
        return (Kind::Word, word);
    }
    let long = LONG.iter().find(|sign| text.starts_with(**sign));
    let length = match long {
        Some(sign) => sign.len(),
        None => text.chars().next().map_or(0, char::len_utf8),
    };
    (Kind::Sign, length)
}

/// The length of a number: digits, a point, an exponent with its sign.
fn number(text: &str) -> usize {
    let mut before = ' ';
    let end = text.find(|c: char| {
        let is_sign = matches!(c, '+' | '-') && matches!(before, 'e' | 'E');
        before = c;
        !(c.is_ascii_alphanumeric() || c == '.' || is_sign)
    });
    end.unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_falls_into_tokens() {
        let draft = "a1 += R(1.5e-9) - 2e3-b->c; /* to\n   there */\n\nx--";
        let found = tokens(draft);
        let texts: Vec<&str> = found.iter().map(|token| token.text).collect();
        let expected = [
            "a1",
            "+=",
            "R",
            "(",
            "1.5e-9",
            ")",
            "-",
            "2e3",
            "-",
            "b",
            "->",
            "c",
            ";",
            "/* to\n   there */",
            "x",
            "--",
            "",
        ];
        assert_eq!(texts, expected);
        assert_eq!(found[13].last_line(), 2);
        assert_eq!(found[14].line, 4);
        assert_eq!(found[16].line, 5);
    }
}
