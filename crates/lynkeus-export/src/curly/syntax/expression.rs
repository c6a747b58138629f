//! Values of a draft.

use super::lexer::Kind;
use super::parser::Parser;
use super::{Expr, Operator, Type};
use crate::Refusal;

impl Parser<'_> {
    /// What stands between commas, and the sign at the end.
    pub fn list(&mut self, end: &str) -> Result<Vec<Expr>, Refusal> {
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

    pub fn expression(&mut self) -> Result<Expr, Refusal> {
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

    pub fn postfix(&mut self) -> Result<Expr, Refusal> {
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
pub(super) fn named(word: &str) -> Option<Type> {
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
