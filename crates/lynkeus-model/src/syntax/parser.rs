//! The parser's hands: the current token, what may come next, and the limits.

use lynkeus_expr::Binary;

use super::ast::{Ast, Class, ExprId, Expression, Kind, Term};
use super::language::{MODELICA, is_fixed};
use super::lexer::{Lexer, Token, shortened, unquoted};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_NESTING, MAX_SOURCE_BYTES, MAX_SYNTAX_NODES, grouped};

/// How tightly operators bind.
pub(super) const OR: u8 = 0;
pub(super) const AND: u8 = 1;
pub(super) const NOT: u8 = 2;
pub(super) const RELATION: u8 = 3;
pub(super) const SUM: u8 = 4;
pub(super) const PRODUCT: u8 = 5;
/// of `//`: `1/2//3` is `1/(2//3)`
pub(super) const RATIONAL: u8 = 6;
pub(super) const POWER: u8 = 7;

/// Recursive-descent parser with one token of lookahead.
pub(crate) struct Parser<'s> {
    pub(crate) source: &'s str,
    pub(super) lexer: Lexer<'s>,
    pub(crate) token: Token,
    pub(crate) span: Span,
    /// the token before the current one
    pub(crate) last: Span,
    depth: usize,
    nodes: usize,
    pub(crate) ast: Ast,
    pub(super) classes: Vec<Class>,
}

/// Refuses texts whose positions would not fit a [`Span`].
pub(crate) fn check_length(source: &str) -> Result<()> {
    if source.len() > MAX_SOURCE_BYTES {
        let limit = grouped(MAX_SOURCE_BYTES as u64);
        let message = format!("the text is longer than {limit} bytes");
        return Err(Problem::new(Span::new(0, 0), message));
    }
    Ok(())
}

/// Parses a whole file: its expressions, and every class of it, inner ones before those around
/// them.
pub(crate) fn parse_file(source: &str) -> Result<(Ast, Vec<Class>)> {
    let mut parser = modelica(source)?;
    parser.within_clause()?;
    while parser.token != Token::End {
        parser.class("")?;
    }
    Ok((parser.ast, parser.classes))
}

/// Parses a text that is one expression.
pub(crate) fn parse_single_expression(source: &str) -> Result<(Ast, ExprId)> {
    let mut parser = modelica(source)?;
    let root = parser.expression()?;
    if parser.token != Token::End {
        return Err(parser.unexpected("an operator or the end of the expression"));
    }
    Ok((parser.ast, root))
}

fn modelica(source: &str) -> Result<Parser<'_>> {
    check_length(source)?;
    Parser::at_first(Lexer::new(source, &MODELICA))
}

impl<'s> Parser<'s> {
    /// A parser at the first token of the lexer.
    pub(crate) fn at_first(lexer: Lexer<'s>) -> Result<Self> {
        let mut parser = Self {
            source: lexer.source,
            lexer,
            token: Token::End,
            span: Span::default(),
            last: Span::default(),
            depth: 0,
            nodes: 0,
            ast: Ast::default(),
            classes: vec![],
        };
        parser.advance()?;
        Ok(parser)
    }

    /// Moves to the next token; returns the span of the one left behind.
    pub(crate) fn advance(&mut self) -> Result<Span> {
        self.last = self.span;
        (self.token, self.span) = self.lexer.token()?;
        Ok(self.last)
    }

    /// True at what is always written so.
    pub(crate) fn at(&self, text: &'static str) -> bool {
        debug_assert!(is_fixed(text), "nothing is always written `{text}`");
        self.token == Token::Fixed(text)
    }

    pub(crate) fn accept(&mut self, text: &'static str) -> Result<bool> {
        let found = self.at(text);
        if found {
            self.advance()?;
        }
        Ok(found)
    }

    pub(crate) fn expect(&mut self, text: &'static str) -> Result<Span> {
        if self.at(text) {
            return self.advance();
        }
        Err(match text {
            ";" => self.missing_semicolon(),
            _ => self.unexpected(&format!("`{text}`")),
        })
    }

    /// One or more of something, with commas between them.
    pub(crate) fn list<T>(&mut self, one: impl Fn(&mut Self) -> Result<T>) -> Result<Vec<T>> {
        let mut items = vec![one(self)?];
        while self.accept(",")? {
            items.push(one(self)?);
        }
        Ok(items)
    }

    pub(crate) fn identifier(&mut self, what: &str) -> Result<Span> {
        if self.token == Token::Identifier {
            return self.advance();
        }
        Err(self.unexpected(what))
    }

    /// Points behind the last token when `;` is missing at the end of its line.
    fn missing_semicolon(&self) -> Problem {
        let between = Span::new(self.last.end as usize, self.span.start as usize);
        if !between.text(self.source).contains('\n') && self.token != Token::End {
            return self.unexpected("`;`");
        }
        let end = self.last.end as usize;
        let place = Span::new(end.saturating_sub(1), end);
        Problem::new(place, "expected `;` after this")
            .hint("every declaration and every equation ends with `;`")
    }

    /// "expected …, found …" at the current token.
    pub(crate) fn unexpected(&self, expected: &str) -> Problem {
        let found = self.token.describe(self.span.text(self.source));
        let mut advice = self.lexer.language.advice.iter();
        let advice = advice.find(|(sign, _)| self.token == Token::Fixed(sign));
        Problem::new(self.span, format!("expected {expected}, found {found}"))
            .maybe_hint(advice.map(|(_, what)| *what))
    }

    /// Operands joined by operators that bind at least as tightly as `least`.
    pub(crate) fn operators(&mut self, least: u8) -> Result<ExprId> {
        self.nested(|parser| parser.operators_here(least))
    }

    /// The operator that stands here, and how tightly it binds.
    fn operator(&self) -> Option<(&'static str, u8)> {
        match self.token {
            Token::Fixed(text) => Some((text, level(text)?)),
            _ => None,
        }
    }

    /// Precedence climbing. Operators of one level make one flat chain, so that the depth of
    /// the tree does not grow with its length.
    fn operators_here(&mut self, least: u8) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let mut left = self.prefixed(least)?;
        while let Some((text, level)) = self.operator().filter(|(_, level)| *level >= least) {
            let kind = match level {
                RELATION => {
                    let right =
                        self.only_operand(RELATION, "comparison", "join comparisons with `and`")?;
                    Kind::Relation(text, left, right)
                }
                POWER if self.lexer.language.on_paper => {
                    self.advance()?;
                    Kind::Power(left, self.operators(POWER)?, false)
                }
                POWER => {
                    let hint = "write `(a^b)^c` or `a^(b^c)`: `^` has no order of its own";
                    let right = self.only_operand(POWER, "`^`", hint)?;
                    Kind::Power(left, right, text == ".^")
                }
                _ => Kind::Chain(left, self.chain(level)?),
            };
            left = self.push(kind, start, first)?;
        }
        Ok(left)
    }

    /// Operators of one level, each with the operand behind it.
    fn chain(&mut self, level: u8) -> Result<Vec<Term>> {
        let mut rest = vec![];
        while let Some((text, _)) = self.operator().filter(|(_, next)| *next == level) {
            self.advance()?;
            let operation = match text.trim_start_matches('.') {
                "+" => Binary::Add,
                "-" => Binary::Sub,
                "*" => Binary::Mul,
                "and" => Binary::And,
                "or" => Binary::Or,
                _ => Binary::Div,
            };
            let operand = self.operators(level + 1)?;
            self.count(1)?;
            rest.push((operation, text.starts_with('.'), operand));
        }
        Ok(rest)
    }

    /// The operand behind an operator that may not stand twice: comparisons and powers have no
    /// order among themselves.
    fn only_operand(&mut self, level: u8, what: &str, hint: &str) -> Result<ExprId> {
        self.advance()?;
        if level == POWER {
            self.refuse_sign("an exponent without sign", "as in `2^(-1)`")?;
        }
        let operand = self.operators(level + 1)?;
        match self.operator() {
            Some((_, next)) if next == level => {
                Err(self.unexpected(&format!("one {what}")).hint(hint))
            }
            _ => Ok(operand),
        }
    }

    /// Modelica has no sign behind `^` or behind another sign.
    pub(super) fn refuse_sign(&self, expected: &str, example: &str) -> Result<()> {
        match self.token {
            Token::Fixed("-" | ".-" | "+" | ".+") if !self.lexer.language.on_paper => {
                Err(self.unexpected(expected).hint(format!(
                    "Modelica takes no sign here: put it in parentheses, {example}"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Runs a part of the grammar one level deeper.
    pub(crate) fn nested<T>(&mut self, parse: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.depth >= MAX_NESTING {
            let message = format!("nested more than {MAX_NESTING} levels deep");
            return Err(Problem::new(self.span, message).hint(self.lexer.language.too_deep));
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    /// Counts one more part of the syntax tree, as many as its memory weighs.
    pub(crate) fn count(&mut self, weight: usize) -> Result<()> {
        self.nodes += weight;
        if self.nodes > MAX_SYNTAX_NODES {
            let limit = grouped(MAX_SYNTAX_NODES as u64);
            let message = format!("the text has more than {limit} operands and operators");
            let hint = self.lexer.language.too_large;
            return Err(Problem::new(self.span, message).maybe_hint(hint));
        }
        Ok(())
    }

    /// Adds an expression that spans from `start` to the last token.
    pub(crate) fn push(&mut self, kind: Kind, start: Span, first: ExprId) -> Result<ExprId> {
        self.push_at(kind, start.to(self.last), first)
    }

    /// Adds an expression with a span of its own.
    pub(crate) fn push_at(&mut self, kind: Kind, span: Span, first: ExprId) -> Result<ExprId> {
        self.count(1)?;
        let id = self.next_id();
        self.ast.expressions.push(Expression { kind, span, first });
        Ok(id)
    }

    /// The id the next expression will get.
    pub(crate) fn next_id(&self) -> ExprId {
        ExprId(self.ast.expressions.len() as u32)
    }

    /// The value of a number, at its token.
    pub(crate) fn real_value(&self) -> Result<f64> {
        let text = self.span.text(self.source);
        match text.replace('_', "").parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let message = format!("the number {} is too large", shortened(text));
                Err(Problem::new(self.span, message))
            }
        }
    }
}

/// How tightly an operator between two operands binds.
fn level(operator: &str) -> Option<u8> {
    Some(match operator {
        "or" => OR,
        "and" => AND,
        "<" | "<=" | ">" | ">=" | "==" | "<>" => RELATION,
        "+" | "-" | ".+" | ".-" => SUM,
        "*" | "/" | ".*" | "./" => PRODUCT,
        "//" => RATIONAL,
        "^" | ".^" => POWER,
        _ => return None,
    })
}

impl Parser<'_> {
    /// So many tokens behind the current one.
    fn ahead(&self, count: usize) -> impl Iterator<Item = Token> {
        let mut lexer = self.lexer.clone();
        let tokens = std::iter::from_fn(move || Some(lexer.token().ok()?.0));
        tokens.take(count).take_while(|token| *token != Token::End)
    }

    /// At an opening parenthesis: true where a comma stands between it and the one that closes
    /// it, outside of other brackets. Looks at a line's worth of tokens at most.
    pub(super) fn is_list(&self) -> bool {
        let mut open = 1usize;
        for token in self.ahead(400) {
            match token {
                Token::Fixed(",") if open == 1 => return true,
                Token::Fixed("(" | "[" | "{") => open += 1,
                Token::Fixed(")" | "]" | "}") if open > 1 => open -= 1,
                Token::Fixed(")" | "]" | "}" | ";") => return false,
                _ => {}
            }
        }
        false
    }

    /// At an opening bracket: true where a dot follows the one that closes it.
    pub(super) fn is_inner_subscript(&self) -> bool {
        let mut behind = self
            .ahead(41)
            .skip_while(|token| *token != Token::Fixed("]"));
        behind.nth(1) == Some(Token::Fixed("."))
    }

    /// "… is not supported" at the current token.
    pub(super) fn refuse(&self, what: &str, hint: &str) -> Problem {
        Problem::new(self.span, format!("{what} is not supported")).hint(hint)
    }

    /// An optional description string.
    pub(super) fn description(&mut self) -> Result<Option<String>> {
        if self.token != Token::Text {
            return Ok(None);
        }
        let mut text = unquoted(self.advance()?.text(self.source));
        while self.accept("+")? {
            if self.token != Token::Text {
                return Err(self.unexpected("a string"));
            }
            text.push_str(&unquoted(self.advance()?.text(self.source)));
        }
        Ok(Some(text))
    }

    /// A description and an annotation, as after every declaration and equation.
    pub(super) fn comment(&mut self) -> Result<Option<String>> {
        let description = self.description()?;
        if self.at("annotation") {
            self.annotation()?;
        }
        Ok(description)
    }

    /// The comment behind something, and its semicolon.
    pub(super) fn ending(&mut self) -> Result<()> {
        self.comment()?;
        self.expect(";").map(|_| ())
    }

    /// `annotation(…)`: skipped by counting brackets.
    pub(super) fn annotation(&mut self) -> Result<()> {
        let start = self.advance()?;
        if !self.at("(") {
            return Err(self.unexpected("`(` after `annotation`"));
        }
        if self.skip_brackets()? {
            return Ok(());
        }
        Err(Problem::new(start, "this annotation has no end").hint("close it with `)`"))
    }

    /// From an opening bracket to behind the one that closes it; false where none does.
    pub(super) fn skip_brackets(&mut self) -> Result<bool> {
        let mut open = 0usize;
        loop {
            match self.token {
                Token::Fixed("(") => open += 1,
                Token::Fixed(")") => open = open.saturating_sub(1),
                Token::End => return Ok(false),
                _ => {}
            }
            self.advance()?;
            if open == 0 {
                return Ok(true);
            }
        }
    }
}
