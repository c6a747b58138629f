//! Declarations: prefixes, type, dimensions, modification, binding.

use super::ast::{Attribute, Causality, Declaration, Kind, Prefix, TypeName, Variability};
use super::names::plain;
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
            Final | Parameter | Constant | Input | Output | Flow | Stream | Enumeration => {
                return Ok(());
            }
            Discrete => (
                "a `discrete` variable",
                "only continuous variables are supported",
            ),
            Inner | Outer => ("`inner`/`outer`", crate::flat::HOW_TO_FLATTEN),
            Redeclare | Replaceable => ("a replaceable element", crate::flat::HOW_TO_FLATTEN),
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
        let mut prefix = Prefix::plain();
        prefix.is_final = self.accept_word(Keyword::Final)?;
        self.causality(&mut prefix)?;
        prefix.type_name = self.type_name()?;
        if self.at(Symbol::OpenBracket) {
            prefix.dimensions = self.subscripts()?;
        }
        Ok(prefix)
    }

    /// `parameter`, `input`, `flow` and their like.
    pub(super) fn causality(&mut self, prefix: &mut Prefix) -> Result<()> {
        loop {
            match self.token {
                Token::Keyword(Keyword::Parameter) => prefix.variability = Variability::Parameter,
                Token::Keyword(Keyword::Constant) => prefix.variability = Variability::Constant,
                Token::Keyword(Keyword::Input) => prefix.causality = Causality::Input,
                Token::Keyword(Keyword::Output) => prefix.causality = Causality::Output,
                Token::Keyword(Keyword::Flow | Keyword::Stream) => {
                    prefix.of_connector = Some(self.span);
                }
                Token::Keyword(Keyword::Enumeration) => return Ok(()),
                Token::Keyword(_) => {
                    self.refuse_unsupported_element()?;
                    return Err(self.unexpected("a type"));
                }
                _ => return Ok(()),
            }
            self.advance()?;
        }
    }

    pub(super) fn type_name(&mut self) -> Result<TypeName> {
        if self.at_word(Keyword::Enumeration) {
            // a choice that the compiler has made already
            let start = self.advance()?;
            if !self.at(Symbol::OpenParen) || !self.skip_brackets()? {
                let message = "expected the literals of the enumeration in parentheses";
                return Err(Problem::new(start, message));
            }
            return Ok(TypeName::String);
        }
        let span = self.dotted_name()?;
        let name = match span.text(self.source) {
            "Real" => return Ok(TypeName::Real),
            "Integer" => return Ok(TypeName::Integer),
            "Boolean" => return Ok(TypeName::Boolean),
            "String" => return Ok(TypeName::String),
            name => name,
        };
        if matches!(
            self.token,
            Token::Identifier
                | Token::Symbol(Symbol::OpenBracket | Symbol::OpenParen | Symbol::Semicolon)
                | Token::Text
        ) && name != "der"
        {
            return Ok(TypeName::Named(span));
        }
        let message = format!("expected a declaration, found `{}`", shortened(name));
        Err(Problem::new(span, message)
            .hint("a declaration reads `Real x;`; equations follow after the word `equation`"))
    }

    fn declarator(&mut self, prefix: Prefix) -> Result<Declaration> {
        self.count(8)?;
        let name = self.variable_name()?;
        let label = plain(name.text(self.source)).into_owned();
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
            label,
            dimensions,
            attributes,
            binding,
            description,
            package: None,
        })
    }

    /// `x`, `r1.p.v` or `c[2].x`: compilers write the names of parts in full.
    fn variable_name(&mut self) -> Result<Span> {
        let start = self.identifier("the name of a variable")?;
        loop {
            if self.at(Symbol::Dot) {
                self.advance()?;
                self.identifier("a name after `.`")?;
            } else if self.at(Symbol::OpenBracket) && self.is_inner_subscript() {
                self.subscripts()?;
            } else {
                return Ok(start.to(self.last));
            }
        }
    }

    /// `start = 1, each min = 0)`, behind the opening parenthesis.
    pub(super) fn modification(&mut self, into: &mut Vec<Attribute>) -> Result<()> {
        self.nested(|parser| parser.modification_here(into))
    }

    fn modification_here(&mut self, into: &mut Vec<Attribute>) -> Result<()> {
        if self.accept(Symbol::CloseParen)? {
            return Ok(());
        }
        loop {
            if self.at_word(Keyword::Redeclare) || self.at_word(Keyword::Replaceable) {
                return Err(self.refuse("a redeclaration", crate::flat::HOW_TO_FLATTEN));
            }
            self.accept_word(Keyword::Each)?;
            self.accept_word(Keyword::Final)?;
            let name = self.identifier("the name of an attribute")?;
            let mut nested = vec![];
            if self.accept(Symbol::OpenParen)? {
                self.modification(&mut nested)?;
            }
            let mut value = None;
            if nested.is_empty() {
                self.expect(Symbol::Equal)?;
                value = Some(self.attribute_value()?);
            } else if self.accept(Symbol::Equal)? {
                value = Some(self.attribute_value()?);
            }
            self.comment()?;
            into.push(Attribute {
                name,
                value,
                nested,
            });
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
}

impl Prefix {
    /// A Real variable, with nothing before it.
    pub(super) fn plain() -> Self {
        Self {
            is_final: false,
            variability: Variability::Continuous,
            causality: Causality::Local,
            of_connector: None,
            type_name: TypeName::Real,
            dimensions: vec![],
        }
    }
}
