//! The parser's hands: the current token, what may come next, and the limits.

use lynkeus_expr::Binary;

use super::ast::{Ast, ExprId, Expression, Kind, Term};
use super::lexer::{Lexer, Token, shortened, unquoted};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_NESTING, MAX_SOURCE_BYTES, MAX_SYNTAX_NODES, grouped};

/// How tightly operators bind that languages share, loosest first.
pub(crate) const RELATION: u8 = 3;
pub(crate) const SUM: u8 = 4;
pub(crate) const PRODUCT: u8 = 5;
pub(crate) const POWER: u8 = 7;

/// What the parser asks of a language.
pub(crate) trait Language<'s>: Sized {
    /// What to do about parts that are nested too deep.
    const NESTED: &'static str;

    /// The next token; `Token::End` from the end of the text on.
    fn next(&mut self) -> Result<(Token, Span)>;

    /// How tightly an operator between two operands binds.
    fn level(operator: &str) -> Option<u8>;

    /// What stands before an operator, behind one of the level `least`.
    fn operand(parser: &mut Parser<'s, Self>, least: u8) -> Result<ExprId>;

    /// The refusal of more than so many parts.
    fn too_large(&self, limit: &str, span: Span) -> Box<Problem>;

    /// What to do where the text ends too early.
    fn hint_at_end(&self) -> Option<String> {
        None
    }
}

/// Recursive-descent parser with one token of lookahead.
pub(crate) struct Parser<'s, L = Lexer<'s>> {
    pub(crate) source: &'s str,
    pub(crate) language: L,
    pub(crate) token: Token,
    pub(crate) span: Span,
    /// the token before the current one
    pub(crate) last: Span,
    depth: usize,
    nodes: usize,
    pub(crate) ast: Ast,
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

/// Parses a whole file.
pub(crate) fn parse_file(source: &str) -> Result<Ast> {
    let mut parser = modelica(source)?;
    parser.within_clause()?;
    while parser.token != Token::End {
        parser.class("")?;
    }
    Ok(parser.ast)
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
    let mut parser = Parser::behind(Span::default(), source, Lexer::new(source));
    parser.advance()?;
    Ok(parser)
}

impl<'s, L: Language<'s>> Parser<'s, L> {
    /// A parser whose first token is behind `place`.
    pub(crate) fn behind(place: Span, source: &'s str, language: L) -> Self {
        Self {
            source,
            language,
            token: Token::End,
            span: place,
            last: place,
            depth: 0,
            nodes: 0,
            ast: Ast::default(),
        }
    }

    /// Moves to the next token; returns the span of the one left behind.
    pub(crate) fn advance(&mut self) -> Result<Span> {
        self.last = self.span;
        (self.token, self.span) = self.language.next()?;
        Ok(self.last)
    }

    /// True at what is always written so.
    pub(crate) fn at(&self, text: &'static str) -> bool {
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
    fn missing_semicolon(&self) -> Box<Problem> {
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
    pub(crate) fn unexpected(&self, expected: &str) -> Box<Problem> {
        let found = self.token.describe(self.span.text(self.source));
        let problem = Problem::new(self.span, format!("expected {expected}, found {found}"));
        let is_end = self.token == Token::End;
        problem.maybe_hint(is_end.then(|| self.language.hint_at_end()).flatten())
    }

    /// Operands joined by operators that bind at least as tightly as `least`.
    pub(crate) fn operators(&mut self, least: u8) -> Result<ExprId> {
        self.nested(|parser| parser.operators_here(least))
    }

    /// The operator that stands here, and how tightly it binds.
    fn operator(&self) -> Option<(&'static str, u8)> {
        match self.token {
            Token::Fixed(text) => Some((text, L::level(text)?)),
            _ => None,
        }
    }

    /// Precedence climbing. Operators of one level make one flat chain, so that the depth of
    /// the tree does not grow with its length.
    fn operators_here(&mut self, least: u8) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let mut left = L::operand(self, least)?;
        while let Some((text, level)) = self.operator().filter(|(_, level)| *level >= least) {
            let kind = match level {
                RELATION => {
                    let right =
                        self.only_operand(RELATION, "comparison", "join comparisons with `and`")?;
                    Kind::Relation(text, left, right)
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
            Token::Fixed("-" | ".-" | "+" | ".+") => Err(self.unexpected(expected).hint(format!(
                "Modelica takes no sign here: put it in parentheses, {example}"
            ))),
            _ => Ok(()),
        }
    }

    /// Runs a part of the grammar one level deeper.
    pub(crate) fn nested<T>(&mut self, parse: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        if self.depth >= MAX_NESTING {
            let message = format!("nested more than {MAX_NESTING} levels deep");
            return Err(Problem::new(self.span, message).hint(L::NESTED));
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
            return Err(self.language.too_large(&limit, self.span));
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

impl Parser<'_> {
    /// So many tokens behind the current one.
    fn ahead(&self, count: usize) -> impl Iterator<Item = Token> {
        let mut lexer = self.language.clone();
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
    pub(super) fn refuse(&self, what: &str, hint: &str) -> Box<Problem> {
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
