//! Classes: their heads, their sections, and the declarations in them.

use super::ast::{
    Attribute, Causality, Class, ClassKind, Declaration, ExprId, Import, Kind, TypeName,
    Variability,
};
use super::lexer::{Token, plain, shortened};
use super::parser::Parser;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_IMPORTS, MAX_NAME, grouped};

impl Parser<'_> {
    pub(super) fn within_clause(&mut self) -> Result<()> {
        if self.accept("within")? {
            while self.token == Token::Identifier || self.at(".") {
                self.advance()?;
            }
            self.expect(";")?;
        }
        Ok(())
    }

    /// A class with those in it, all of which go to the tree.
    pub(super) fn class(&mut self, around: &str) -> Result<()> {
        self.nested(|parser| parser.class_here(around))
    }

    fn class_here(&mut self, around: &str) -> Result<()> {
        self.accept("final")?;
        self.accept("encapsulated")?;
        let is_partial = self.accept("partial")?;
        let kind = self.class_kind()?;
        if self.at("extends") {
            return Err(self.refuse(
                "a model made from another one",
                "write `extends Base;` among its declarations",
            ));
        }
        let name = self.class_name("the name of the model")?;
        let mut class = Class {
            kind,
            is_partial,
            name,
            path: self.path(around, name)?,
            ..Class::default()
        };
        self.count(4)?;
        if self.accept("=")? {
            self.short_definition(&mut class)?;
        } else {
            self.description()?;
            self.class_body(&mut class)?;
            self.class_end(name)?;
        }
        self.ending()?;
        self.classes.push(class);
        Ok(())
    }

    /// A name; compilers write those of inner classes in full.
    fn class_name(&mut self, what: &str) -> Result<Span> {
        let start = self.identifier(what)?;
        self.members(start)
    }

    fn path(&self, around: &str, name: Span) -> Result<String> {
        let own = plain(name.text(self.source));
        if around.is_empty() {
            return Ok(own.into_owned());
        }
        if around.len() + own.len() > MAX_NAME {
            let message = format!("with the classes around it this name is longer than {MAX_NAME}");
            return Err(Problem::new(name, message).hint("choose shorter names"));
        }
        Ok(format!("{around}.{own}"))
    }

    /// The kind of class that begins here; the words before it are read.
    fn class_kind(&mut self) -> Result<ClassKind> {
        const BEFORE: [&str; 4] = ["expandable", "operator", "pure", "impure"];
        while BEFORE.iter().any(|word| self.at(word)) {
            let is_operator = self.at("operator");
            self.advance()?;
            if is_operator && self.token == Token::Identifier {
                return Err(self.refuse("an operator", "write the formula where it is used"));
            }
        }
        let Some(kind) = kind_of_class(self.token) else {
            let problem = self.unexpected("`model`");
            return Err(problem.hint("a file holds one or more `model`s"));
        };
        self.advance()?;
        Ok(kind)
    }

    /// `= Real(unit = "V")` or `= enumeration(one, two)`, behind the `=`.
    fn short_definition(&mut self, class: &mut Class) -> Result<()> {
        if self.accept("enumeration")? {
            self.expect("(")?;
            while !self.at(")") {
                class.literals.push(self.identifier("a literal")?);
                self.comment()?;
                if !self.accept(",")? {
                    break;
                }
            }
            self.expect(")")?;
            return Ok(());
        }
        let mut alias = self.typed(Declaration::default())?;
        alias.attributes = self.modification()?;
        class.alias = Some(alias);
        Ok(())
    }

    fn class_end(&mut self, name: Span) -> Result<()> {
        self.expect("end")?;
        let end = self.class_name("the name of the model after `end`")?;
        let (opened, closed) = (name.text(self.source), end.text(self.source));
        if plain(opened) == plain(closed) {
            return Ok(());
        }
        Err(
            Problem::new(end, format!("`end {closed}` closes model `{opened}`"))
                .hint(format!("write `end {opened};`")),
        )
    }

    fn class_body(&mut self, class: &mut Class) -> Result<()> {
        let mut section = "public";
        loop {
            match self.token {
                Token::Fixed("end") => return Ok(()),
                Token::Fixed("public" | "protected") => {
                    section = "public";
                    self.advance()?;
                }
                Token::Fixed("initial" | "equation" | "algorithm") => {
                    section = self.section()?;
                    if section == "algorithm" {
                        class.algorithms.push(vec![]);
                    }
                }
                Token::End => {
                    let name = class.name.text(self.source);
                    return Err(self.unexpected(&format!("`end {name};`")));
                }
                Token::Fixed("annotation") => {
                    self.annotation()?;
                    self.expect(";")?;
                }
                Token::Fixed("external") => {
                    class.is_external = true;
                    self.skip_to_semicolon()?;
                }
                _ => match (section, class.algorithms.last_mut()) {
                    ("equation", _) => class.equations.push(self.equation()?),
                    ("initial", _) => class.initial.push(self.equation()?),
                    ("initial algorithm", _) => class.initial.push(self.first_value()?),
                    ("algorithm", Some(last)) => last.push(self.statement()?),
                    _ => self.element(class)?,
                },
            }
        }
    }

    /// `equation`, `algorithm`, or `initial` before one of them: the first of these words.
    fn section(&mut self) -> Result<&'static str> {
        let is_initial = self.accept("initial")?;
        if self.accept("equation")? {
            return Ok(if is_initial { "initial" } else { "equation" });
        }
        self.expect("algorithm")?;
        Ok(if is_initial {
            "initial algorithm"
        } else {
            "algorithm"
        })
    }

    fn element(&mut self, class: &mut Class) -> Result<()> {
        let before = "partial encapsulated expandable operator pure impure";
        let is_before = |word| before.split(' ').any(|other| word == Token::Fixed(other));
        if is_before(self.token) || kind_of_class(self.token).is_some() {
            let path = class.path.clone();
            return self.class(&path);
        }
        if self.accept("extends")? {
            let (name, nested) = (self.dotted_name()?, self.modification()?);
            class.bases.push(Attribute {
                name,
                value: None,
                nested,
            });
            return self.ending();
        }
        if self.accept("import")? {
            let import = self.import()?;
            if class.imports.len() >= MAX_IMPORTS {
                let limit = grouped(MAX_IMPORTS as u64);
                let message = format!("a class with more than {limit} imports");
                return Err(Problem::new(self.last, message).hint("write names in full"));
            }
            class.imports.push(import);
            return Ok(());
        }
        self.declarations(&mut class.declarations)
    }

    fn import(&mut self) -> Result<Import> {
        let start = self.span;
        let mut full = self.dotted_import()?;
        let mut short = None;
        if self.accept("=")? {
            short = Some(full);
            full = self.dotted_import()?;
        }
        let whole = self.accept(".*")?;
        if self.at("{") || self.at(".") {
            let problem = Problem::new(start, "an import of several names is not supported");
            return Err(problem.hint("write one `import` for each"));
        }
        self.ending()?;
        if short.is_none() && !whole {
            short = full.rsplit('.').next().map(str::to_owned);
        }
        Ok(Import { short, full })
    }

    /// A name that ends before `.{` and before `.*`.
    fn dotted_import(&mut self) -> Result<String> {
        let start = self.identifier("a name")?;
        while self.accept(".")? && !self.at("{") {
            self.identifier("a name after `.`")?;
        }
        Ok(plain(start.to(self.last).text(self.source)).into_owned())
    }

    fn skip_to_semicolon(&mut self) -> Result<()> {
        while !self.at(";") {
            if self.token == Token::End {
                return Err(self.unexpected("`;`"));
            }
            self.advance()?;
        }
        self.advance()?;
        Ok(())
    }
}

impl Parser<'_> {
    /// `parameter Real a = 1, b[3];`
    fn declarations(&mut self, into: &mut Vec<Declaration>) -> Result<()> {
        self.refuse_unsupported_element()?;
        let is_final = self.accept("final")?;
        let common = self.typed(Declaration {
            is_final,
            ..Declaration::default()
        })?;
        into.extend(self.list(|parser| parser.declarator(common.clone()))?);
        self.expect(";").map(|_| ())
    }

    fn refuse_unsupported_element(&self) -> Result<()> {
        const TAKEN: &str =
            ". final parameter constant discrete input output flow stream enumeration";
        Err(match self.token {
            Token::Identifier => return Ok(()),
            Token::Fixed(word) if TAKEN.split(' ').any(|taken| taken == word) => return Ok(()),
            Token::Fixed("inner" | "outer") => self.refuse("`inner`/`outer`", HOW_TO_FLATTEN),
            Token::Fixed("redeclare" | "replaceable") => {
                self.refuse("a replaceable element", HOW_TO_FLATTEN)
            }
            Token::Fixed("connect" | "when" | "if" | "for") => {
                let problem = self.unexpected("a declaration");
                problem.hint("equations follow after the word `equation`")
            }
            _ => self.unexpected("a declaration, `equation` or `end`"),
        })
    }

    /// `parameter`, `input`, `flow` and their like, and the type.
    fn typed(&mut self, mut declaration: Declaration) -> Result<Declaration> {
        while let Token::Fixed(word) = self.token {
            match word {
                "parameter" => declaration.variability = Variability::Parameter,
                "constant" => declaration.variability = Variability::Constant,
                "discrete" => declaration.is_discrete = true,
                "input" => declaration.causality = Causality::Input,
                "output" => declaration.causality = Causality::Output,
                "flow" | "stream" => declaration.of_connector = Some(self.span),
                _ if word == "enumeration" || !word.starts_with(char::is_alphabetic) => break,
                _ => {
                    self.refuse_unsupported_element()?;
                    return Err(self.unexpected("a type"));
                }
            }
            self.advance()?;
        }
        declaration.type_name = self.type_name()?;
        declaration.dimensions = self.maybe_subscripts()?;
        Ok(declaration)
    }

    fn type_name(&mut self) -> Result<TypeName> {
        if self.at("enumeration") {
            // a choice that the compiler has made already
            let start = self.advance()?;
            if !self.at("(") || !self.skip_brackets()? {
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
            Token::Identifier | Token::Fixed("[" | "(" | ";") | Token::Text
        ) && name != "der"
        {
            return Ok(TypeName::Named(span));
        }
        let message = format!("expected a declaration, found `{}`", shortened(name));
        Err(Problem::new(span, message)
            .hint("a declaration reads `Real x;`; equations follow after the word `equation`"))
    }

    fn declarator(&mut self, mut declaration: Declaration) -> Result<Declaration> {
        self.count(8)?;
        declaration.name = self.variable_name()?;
        declaration.label = plain(declaration.name.text(self.source)).into_owned();
        let mut dimensions = self.maybe_subscripts()?;
        dimensions.append(&mut declaration.dimensions);
        declaration.dimensions = dimensions;
        declaration.attributes = self.modification()?;
        if self.accept("=")? {
            declaration.binding = Some(self.expression()?);
        } else if self.at(":=") {
            let problem = self.unexpected("`=`");
            return Err(problem.hint("a declaration equation is written with `=`"));
        }
        if self.at("if") {
            return Err(self.refuse("a conditional component", "declare it always"));
        }
        declaration.description = self.comment()?;
        Ok(declaration)
    }

    /// `x`, `r1.p.v` or `c[2].x`: compilers write the names of parts in full.
    fn variable_name(&mut self) -> Result<Span> {
        let start = self.identifier("the name of a variable")?;
        loop {
            let name = self.members(start)?;
            if !self.at("[") || !self.is_inner_subscript() {
                return Ok(name);
            }
            self.subscripts()?;
        }
    }

    /// `(start = 1, each min = 0)`, where it stands here.
    fn modification(&mut self) -> Result<Vec<Attribute>> {
        if !self.accept("(")? {
            return Ok(vec![]);
        }
        self.nested(|parser| {
            if parser.accept(")")? {
                return Ok(vec![]);
            }
            let given = parser.list(Self::attribute)?;
            parser.expect(")")?;
            Ok(given)
        })
    }

    fn attribute(&mut self) -> Result<Attribute> {
        if self.at("redeclare") || self.at("replaceable") {
            return Err(self.refuse("a redeclaration", HOW_TO_FLATTEN));
        }
        self.accept("each")?;
        self.accept("final")?;
        let name = self.identifier("the name of an attribute")?;
        let nested = self.modification()?;
        let mut value = None;
        if nested.is_empty() || self.at("=") {
            self.expect("=")?;
            value = Some(self.attribute_value()?);
        }
        self.comment()?;
        Ok(Attribute {
            name,
            value,
            nested,
        })
    }

    fn attribute_value(&mut self) -> Result<ExprId> {
        if self.token != Token::Text {
            return self.expression();
        }
        let (start, first) = (self.span, self.next_id());
        self.advance()?;
        self.push(Kind::Text, start, first)
    }
}

/// What to do with a model that has connectors or components.
pub(crate) const HOW_TO_FLATTEN: &str = "flatten it first: `omc -f -i=MODEL FILE.mo > flat.mo` \
     (OpenModelica), or `python -c 'import rumoca; print(rumoca.Session().load(\"FILE.mo\", \
     model=\"MODEL\").render(\"base-modelica\"))' > flat.mo`";

fn kind_of_class(token: Token) -> Option<ClassKind> {
    Some(match token {
        Token::Fixed("model" | "class" | "block") => ClassKind::Model,
        Token::Fixed("package") => ClassKind::Package,
        Token::Fixed("record") => ClassKind::Record,
        Token::Fixed("function") => ClassKind::Function,
        Token::Fixed("type") => ClassKind::Type,
        Token::Fixed("connector") => ClassKind::Connector,
        _ => return None,
    })
}
