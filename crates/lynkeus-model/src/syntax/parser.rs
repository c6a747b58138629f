//! The parser's hands: the current token, what may come next, and the limits.

use super::ast::{Ast, ExprId, Expression, Kind};
use super::lexer::{Keyword, Language, Lexer, Symbol, Token, shortened, unquoted};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_NESTING, MAX_SOURCE_BYTES, MAX_SYNTAX_NODES, grouped};

/// Recursive-descent parser with one token of lookahead.
pub(crate) struct Parser<'s, L = Lexer<'s>> {
    pub(crate) source: &'s str,
    pub(crate) lexer: L,
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

impl<'s, L: Language> Parser<'s, L> {
    /// A parser whose first token is behind `place`.
    pub(crate) fn behind(place: Span, source: &'s str, lexer: L) -> Self {
        Self {
            source,
            lexer,
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
        (self.token, self.span) = self.lexer.next()?;
        Ok(self.last)
    }

    pub(crate) fn at(&self, symbol: Symbol) -> bool {
        self.token == Token::Symbol(symbol)
    }

    pub(crate) fn accept(&mut self, symbol: Symbol) -> Result<bool> {
        self.accept_token(Token::Symbol(symbol))
    }

    fn accept_token(&mut self, token: Token) -> Result<bool> {
        let found = self.token == token;
        if found {
            self.advance()?;
        }
        Ok(found)
    }

    pub(crate) fn expect(&mut self, symbol: Symbol) -> Result<Span> {
        if self.at(symbol) {
            return self.advance();
        }
        let expected = format!("`{}`", symbol.text());
        Err(match symbol {
            Symbol::Semicolon => self.missing_semicolon(),
            _ => self.unexpected(&expected),
        })
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
        Problem::new(
            Span::new(end.saturating_sub(1), end),
            "expected `;` after this",
        )
        .hint("every declaration and every equation ends with `;`")
    }

    /// "expected …, found …" at the current token.
    pub(crate) fn unexpected(&self, expected: &str) -> Problem {
        let found = self.token.describe(self.span.text(self.source));
        let problem = Problem::new(self.span, format!("expected {expected}, found {found}"));
        let is_end = self.token == Token::End;
        problem.maybe_hint(is_end.then(|| self.lexer.hint_at_end()).flatten())
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
            return Err(self.lexer.too_large(&limit, self.span));
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
    /// At an opening parenthesis: true where a comma stands between it and the one that closes
    /// it, outside of other brackets. Looks at a line's worth of tokens at most.
    pub(super) fn is_list(&self) -> bool {
        const AHEAD: usize = 400;
        let mut lexer = self.lexer.clone();
        let mut open = 1usize;
        for _ in 0..AHEAD {
            match lexer.next() {
                Ok((Token::Symbol(Symbol::Comma), _)) if open == 1 => return true,
                Ok((Token::Symbol(symbol), _)) => match symbol {
                    Symbol::OpenParen | Symbol::OpenBracket | Symbol::OpenBrace => open += 1,
                    Symbol::CloseParen | Symbol::CloseBracket | Symbol::CloseBrace => open -= 1,
                    Symbol::Semicolon => return false,
                    _ => {}
                },
                Ok((Token::End, _)) | Err(_) => return false,
                _ => {}
            }
            if open == 0 {
                return false;
            }
        }
        false
    }

    /// At an opening bracket: true where a dot follows the one that closes it.
    pub(super) fn is_inner_subscript(&self) -> bool {
        const AHEAD: usize = 40;
        let mut lexer = self.lexer.clone();
        for _ in 0..AHEAD {
            match lexer.next() {
                Ok((Token::Symbol(Symbol::CloseBracket), _)) => {
                    return matches!(lexer.next(), Ok((Token::Symbol(Symbol::Dot), _)));
                }
                Ok((Token::End, _)) | Err(_) => return false,
                _ => {}
            }
        }
        false
    }

    pub(super) fn at_word(&self, keyword: Keyword) -> bool {
        self.token == Token::Keyword(keyword)
    }

    pub(super) fn accept_word(&mut self, keyword: Keyword) -> Result<bool> {
        self.accept_token(Token::Keyword(keyword))
    }

    pub(super) fn expect_word(&mut self, keyword: Keyword) -> Result<Span> {
        if self.at_word(keyword) {
            return self.advance();
        }
        Err(self.unexpected(&format!("`{}`", keyword.text())))
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
        let mut text = unquoted(self.span.text(self.source));
        self.advance()?;
        while self.at(Symbol::Plus) {
            self.advance()?;
            if self.token != Token::Text {
                return Err(self.unexpected("a string"));
            }
            text.push_str(&unquoted(self.span.text(self.source)));
            self.advance()?;
        }
        Ok(Some(text))
    }

    /// A description and an annotation, as after every declaration and equation.
    pub(super) fn comment(&mut self) -> Result<Option<String>> {
        let description = self.description()?;
        if self.at_word(Keyword::Annotation) {
            self.annotation()?;
        }
        Ok(description)
    }

    /// `annotation(…)`: skipped by counting brackets.
    pub(super) fn annotation(&mut self) -> Result<()> {
        let start = self.advance()?;
        if !self.at(Symbol::OpenParen) {
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
                Token::Symbol(Symbol::OpenParen) => open += 1,
                Token::Symbol(Symbol::CloseParen) => open = open.saturating_sub(1),
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
