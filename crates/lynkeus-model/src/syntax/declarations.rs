//! Declarations: prefixes, type, dimensions, modification, binding.

use super::ast::{Attribute, Causality, Declaration, Kind, Prefix, Variability};
use super::parser::Parser;
use super::token::{Keyword, Symbol, Token, shortened};
use super::{Problem, Result, Span};

impl Parser<'_> {
    /// `parameter Real a = 1, b[3];`
    pub(super) fn declarations(&mut self, into: &mut Vec<Declaration>) -> Result<()> {
        self.refuse_unsupported_element()?;
        let prefix = self.prefix()?;
        loop {
            let declaration = self.declarator(prefix.clone())?;
            into.push(declaration);
            if !self.accept(Symbol::Comma)? {
                break;
            }
        }
        self.expect(Symbol::Semicolon)?;
        Ok(())
    }

    fn refuse_unsupported_element(&self) -> Result<()> {
        use Keyword::*;
        let Token::Keyword(word) = self.token else {
            return match self.token {
                Token::Identifier | Token::Symbol(Symbol::Dot) => Ok(()),
                _ => Err(self.unexpected("a declaration, `equation` or `end`")),
            };
        };
        let (what, hint) = match word {
            Final | Parameter | Constant | Input | Output => return Ok(()),
            Extends => (
                "`extends`",
                "copy the declarations and equations of the base model",
            ),
            Import => (
                "`import`",
                "write full names, such as `Modelica.Constants.pi`",
            ),
            Discrete => (
                "a `discrete` variable",
                "only continuous variables are supported",
            ),
            Flow | Stream => (
                "a connector variable",
                "write the equations without connectors",
            ),
            Inner | Outer => ("`inner`/`outer`", "declare the variable in this model"),
            Redeclare | Replaceable => ("a replaceable element", "declare it plainly"),
            Function | Pure | Impure => (
                "a function definition",
                "write the formula where it is used",
            ),
            Model | Block | Class | Connector | Package | Record | Type | Operator | Partial
            | Encapsulated | Expandable => (
                "a class inside a model",
                "write its contents into this model",
            ),
            Connect | When | If | For => {
                let found = format!("expected a declaration, found `{}`", word.text());
                return Err(Problem::new(self.span, found)
                    .hint("equations follow after the word `equation`"));
            }
            _ => return Err(self.unexpected("a declaration, `equation` or `end`")),
        };
        Err(self.refuse(what, hint))
    }

    fn prefix(&mut self) -> Result<Prefix> {
        let mut prefix = Prefix {
            is_final: self.accept_word(Keyword::Final)?,
            variability: Variability::Continuous,
            causality: Causality::Local,
            integer: false,
            dimensions: vec![],
        };
        loop {
            match self.token {
                Token::Keyword(Keyword::Parameter) => prefix.variability = Variability::Parameter,
                Token::Keyword(Keyword::Constant) => prefix.variability = Variability::Constant,
                Token::Keyword(Keyword::Input) => prefix.causality = Causality::Input,
                Token::Keyword(Keyword::Output) => prefix.causality = Causality::Output,
                Token::Keyword(_) => {
                    self.refuse_unsupported_element()?;
                    return Err(self.unexpected("a type"));
                }
                _ => break,
            }
            self.advance()?;
        }
        prefix.integer = self.type_name()?;
        if self.at(Symbol::OpenBracket) {
            prefix.dimensions = self.subscripts()?;
        }
        Ok(prefix)
    }

    /// `Real` or `Integer`; true for the latter.
    fn type_name(&mut self) -> Result<bool> {
        let start = self.span;
        self.accept(Symbol::Dot)?;
        self.identifier("a type")?;
        while self.accept(Symbol::Dot)? {
            self.identifier("a name after `.`")?;
        }
        let span = start.to(self.last);
        let name = span.text(self.source);
        let refuse = |message: String, hint: &str| Err(Problem::new(span, message).hint(hint));
        match name {
            "Real" => Ok(false),
            "Integer" => Ok(true),
            "Boolean" => refuse(
                "Boolean variables are not supported".to_owned(),
                "use a Real and compare it, as in `if u > 0.5 then …`",
            ),
            "String" => refuse("String variables are not supported".to_owned(), "remove it"),
            _ if name.starts_with("Modelica.") || name.starts_with("SI.") => refuse(
                format!("the library type `{}` is not supported", shortened(name)),
                "write `Real` with `unit = \"…\"`",
            ),
            _ if !matches!(
                self.token,
                Token::Identifier | Token::Symbol(Symbol::OpenBracket)
            ) =>
            {
                refuse(
                    format!("expected a declaration, found `{}`", shortened(name)),
                    "a declaration reads `Real x;`; equations follow after the word `equation`",
                )
            }
            _ => refuse(
                format!("unknown type `{}`", shortened(name)),
                "components of other models are not supported: the types are `Real` and `Integer`",
            ),
        }
    }

    fn declarator(&mut self, prefix: Prefix) -> Result<Declaration> {
        self.count(8)?;
        let name = self.identifier("the name of a variable")?;
        let mut dimensions = vec![];
        if self.at(Symbol::OpenBracket) {
            dimensions = self.subscripts()?;
        }
        dimensions.extend(&prefix.dimensions);
        let mut attributes = vec![];
        if self.accept(Symbol::OpenParen)? {
            self.modification(&mut attributes)?;
        }
        let mut binding = None;
        if self.accept(Symbol::Equal)? {
            binding = Some(self.expression()?);
        } else if self.at(Symbol::Assign) {
            return Err(self
                .unexpected("`=`")
                .hint("a declaration equation is written with `=`"));
        }
        if self.at_word(Keyword::If) {
            return Err(self.refuse("a conditional component", "declare it always"));
        }
        let description = self.comment()?;
        Ok(Declaration {
            prefix,
            name,
            dimensions,
            attributes,
            binding,
            description,
        })
    }

    /// `start = 1, each min = 0)`, behind the opening parenthesis.
    fn modification(&mut self, into: &mut Vec<Attribute>) -> Result<()> {
        if self.accept(Symbol::CloseParen)? {
            return Ok(());
        }
        loop {
            if self.at_word(Keyword::Redeclare) || self.at_word(Keyword::Replaceable) {
                return Err(self.refuse("a redeclaration", "remove it"));
            }
            self.accept_word(Keyword::Each)?;
            self.accept_word(Keyword::Final)?;
            let name = self.identifier("the name of an attribute")?;
            self.check_attribute(name)?;
            self.expect(Symbol::Equal)?;
            let value = self.attribute_value()?;
            into.push(Attribute { name, value });
            if !self.accept(Symbol::Comma)? {
                break;
            }
        }
        self.expect(Symbol::CloseParen)?;
        Ok(())
    }

    fn attribute_value(&mut self) -> Result<super::ast::ExprId> {
        if self.token != Token::Text {
            return self.expression();
        }
        let (start, first) = (self.span, self.next_id());
        self.advance()?;
        self.push(Kind::Text, start, first)
    }

    fn check_attribute(&self, name: Span) -> Result<()> {
        const KNOWN: [&str; 10] = [
            "start",
            "min",
            "max",
            "nominal",
            "unit",
            "displayUnit",
            "quantity",
            "fixed",
            "stateSelect",
            "unbounded",
        ];
        let text = name.text(self.source);
        if KNOWN.contains(&text) {
            return Ok(());
        }
        let message = format!("unknown attribute `{}`", shortened(text));
        Err(Problem::new(name, message).hint(format!("the attributes are {}", KNOWN.join(", "))))
    }
}
