//! Text to tokens, one at a time, so that memory does not grow with the text; and what the text
//! of a token means.

use std::borrow::Cow;

use super::language::Language;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_NAME;

/// One token; its text is the source under its span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Identifier,
    Integer,
    Real,
    Text,
    /// a reserved word, an operator or a bracket: what is always written so
    Fixed(&'static str),
    /// the end of the text
    End,
}

impl Token {
    /// How a message names it.
    pub(crate) fn describe(self, text: &str) -> String {
        match self {
            Token::Identifier | Token::Integer | Token::Real => format!("`{}`", shortened(text)),
            Token::Text => "a string".to_owned(),
            Token::Fixed(text) => format!("`{text}`"),
            Token::End => "the end of the text".to_owned(),
        }
    }
}

/// At most 40 characters of a text.
pub(crate) fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The text of a string token without quotes and escapes.
pub(crate) fn unquoted(token: &str) -> String {
    let inner = token.strip_prefix('"').unwrap_or(token);
    let inner = inner.strip_suffix('"').unwrap_or(inner);
    let mut text = String::with_capacity(inner.len());
    let mut characters = inner.chars();
    while let Some(character) = characters.next() {
        match character {
            '\\' => text.extend(characters.next().map(|escaped| match escaped {
                'n' => '\n',
                't' => '\t',
                other => other,
            })),
            other => text.push(other),
        }
    }
    text
}

/// Reads tokens from a text.
#[derive(Clone)]
pub(crate) struct Lexer<'s> {
    pub(crate) source: &'s str,
    pub(crate) language: &'static Language,
    pub(crate) position: usize,
}

impl<'s> Lexer<'s> {
    pub(crate) fn new(source: &'s str, language: &'static Language) -> Self {
        // A byte order mark is not part of the text.
        let position = if source.starts_with('\u{feff}') { 3 } else { 0 };
        Self {
            source,
            language,
            position,
        }
    }

    pub(crate) fn rest(&self) -> &'s str {
        self.source.get(self.position..).unwrap_or_default()
    }

    fn byte(&self, ahead: usize) -> Option<u8> {
        self.source.as_bytes().get(self.position + ahead).copied()
    }

    fn digit_at(&self, ahead: usize) -> bool {
        self.byte(ahead).is_some_and(|byte| byte.is_ascii_digit())
    }

    /// Passes over the characters of a name; returns them.
    pub(crate) fn name(&mut self) -> &'s str {
        let rest = self.rest();
        let length = rest.find(|character| !(self.language.continues_name)(character));
        let name = &rest[..length.unwrap_or(rest.len())];
        self.position += name.len();
        name
    }

    /// Passes over the comment that begins here; false where none does.
    pub(crate) fn comment(&mut self) -> Result<bool> {
        let rest = self.rest();
        if rest.starts_with(self.language.comment[0]) {
            return self.comment_within().map(|()| true);
        }
        let found = rest.starts_with(self.language.line_comment);
        if found {
            self.position += rest.find('\n').unwrap_or(rest.len());
        }
        Ok(found)
    }

    fn comment_within(&mut self) -> Result<()> {
        let [opening, closing] = self.language.comment;
        let (start, bytes) = (self.position, self.source.as_bytes());
        let mut open = 1usize;
        self.position += opening.len();
        while open > 0 {
            let rest = bytes.get(self.position..).unwrap_or_default();
            if rest.is_empty() {
                return Err(no_end("comment", start, opening, closing));
            } else if rest.starts_with(closing.as_bytes()) {
                open -= 1;
                self.position += closing.len();
            } else if self.language.nests && rest.starts_with(opening.as_bytes()) {
                open += 1;
                self.position += opening.len();
            } else {
                self.position += 1;
            }
        }
        Ok(())
    }

    fn skip_blank(&mut self) -> Result<()> {
        loop {
            let rest = self.rest();
            self.position += rest.len() - rest.trim_start_matches(self.language.is_blank).len();
            if !self.comment()? {
                return Ok(());
            }
        }
    }

    /// The next token; `Token::End` from the end of the text on.
    pub(crate) fn token(&mut self) -> Result<(Token, Span)> {
        self.skip_blank()?;
        let (start, rest, language) = (self.position, self.rest(), self.language);
        let token = match rest.chars().next() {
            None => Token::End,
            Some(character) if (language.starts_name)(character) => self.word()?,
            Some(character) if character.is_ascii_digit() => self.number()?,
            Some('.') if language.on_paper && self.digit_at(1) => self.number()?,
            Some(_) => match self.quoted()? {
                Some(token) => token,
                None => self.symbol()?,
            },
        };
        let span = Span::new(start, self.position);
        if token == Token::Identifier && self.position - start > MAX_NAME {
            let message = format!("this name is longer than {MAX_NAME} characters");
            return Err(Problem::new(span, message).hint("choose a shorter name"));
        }
        Ok((token, span))
    }

    fn word(&mut self) -> Result<Token> {
        let start = self.position;
        let Some(word) = (self.language.reserved)(self.name()) else {
            return Ok(Token::Identifier);
        };
        let Some(instead) = self.language.instead else {
            return Ok(Token::Fixed(word));
        };
        let span = Span::new(start, self.position);
        let message = format!("`{word}` is not supported in a model");
        Err(Problem::new(span, message).hint(instead))
    }

    /// Digits, with what may separate them.
    fn digits(&mut self) {
        let separators = self.language.separators;
        while self.digit_at(0) || (self.rest().starts_with(separators) && self.digit_at(1)) {
            self.position += 1;
        }
    }

    /// Digits, with a point and an exponent.
    fn number(&mut self) -> Result<Token> {
        let (start, language) = (self.position, self.language);
        let mut is_whole = !language.on_paper;
        self.digits();
        // `2.*x` is the elementwise product `2 .* x`, not `2.` times `x`.
        let elementwise = matches!(self.byte(1), Some(b'*' | b'/' | b'^' | b'+' | b'-'));
        if self.byte(0) == Some(b'.') && !elementwise {
            is_whole = false;
            self.position += 1;
            self.digits();
        }
        let sign = usize::from(matches!(self.byte(1), Some(b'+' | b'-')));
        if self.rest().starts_with(language.exponents) && self.digit_at(1 + sign) {
            is_whole = false;
            self.position += 1 + sign;
            self.digits();
        }
        let end = self.position;
        let wrong = (language.wrong_number)(&self.source[start..end], self.name());
        if let Some([message, hint]) = wrong {
            return Err(Problem::new(Span::new(start, self.position), message).hint(hint));
        }
        self.position = end;
        Ok(if is_whole {
            Token::Integer
        } else {
            Token::Real
        })
    }

    /// What stands between quotes, where some begin here.
    pub(crate) fn quoted(&mut self) -> Result<Option<Token>> {
        let (start, rest) = (self.position, self.rest());
        let mut quotes = self.language.quotes.iter();
        let Some(&(quote, what)) = quotes.find(|(quote, _)| rest.starts_with(quote)) else {
            return Ok(None);
        };
        self.position += quote.len();
        while let Some(byte) = self.byte(0) {
            if self.rest().starts_with(quote) {
                self.position += quote.len();
                let is_text = quote.starts_with('"');
                return Ok(Some(if is_text {
                    Token::Text
                } else {
                    Token::Identifier
                }));
            }
            self.position += if byte == b'\\' { 2 } else { 1 };
        }
        Err(no_end(what, start, quote, quote))
    }

    /// An operator; for other characters a refusal with what to write instead.
    fn symbol(&mut self) -> Result<Token> {
        let rest = self.rest();
        let mut symbols = self.language.symbols.iter();
        if let Some(text) = symbols.find(|text| rest.starts_with(**text)) {
            self.position += text.len();
            return Ok(Token::Fixed(text));
        }
        let found = rest.chars().next().unwrap_or_default();
        let span = Span::new(self.position, self.position + found.len_utf8());
        let zero = (found == '\0').then_some("the text holds a zero byte: is this a text file?");
        let problem = Problem::new(span, format!("unexpected character {found:?}"));
        Err(problem.maybe_hint((self.language.hint)(found).or(zero)))
    }
}

/// The refusal of what begins somewhere and does not end.
fn no_end(what: &str, start: usize, opening: &str, closing: &str) -> Problem {
    let span = Span::new(start, start + opening.len());
    Problem::new(span, format!("this {what} has no end")).hint(format!("close it with `{closing}`"))
}

/// A name without quotes, blanks and a leading dot: `'r1.p.v'`, `'r1'.'p'.v` and `r1.p.v` are
/// one name.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    let is_plain = |byte: u8| byte != b'\'' && byte != b'/' && !byte.is_ascii_whitespace();
    let text = text.strip_prefix('.').unwrap_or(text);
    if text.bytes().all(is_plain) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(without_quotes(text))
}

fn without_quotes(text: &str) -> String {
    let mut name = String::with_capacity(text.len());
    let (mut quoted, mut comment) = (false, false);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '\'' if !comment => quoted = !quoted,
            _ if quoted => name.push(character),
            '/' if !comment && characters.peek() == Some(&'*') => comment = true,
            '*' if comment && characters.peek() == Some(&'/') => {
                comment = false;
                characters.next();
            }
            _ if comment || character.is_whitespace() => {}
            _ => name.push(character),
        }
    }
    name
}

#[cfg(test)]
mod tests {
    use super::super::language::{MODELICA, ODE_MODEL};
    use super::*;

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        all(text, &MODELICA)
    }

    fn all<'s>(text: &'s str, language: &'static Language) -> Vec<(Token, &'s str)> {
        let mut lexer = Lexer::new(text, language);
        let mut all = vec![];
        loop {
            let (token, span) = lexer.token().unwrap();
            if token == Token::End {
                return all;
            }
            all.push((token, span.text(text)));
        }
    }

    #[test]
    fn numbers() {
        assert_eq!(
            tokens("1 1.5 2. 3e-4 1.e3"),
            [
                (Token::Integer, "1"),
                (Token::Real, "1.5"),
                (Token::Real, "2."),
                (Token::Real, "3e-4"),
                (Token::Real, "1.e3"),
            ]
        );
    }

    #[test]
    fn elementwise_after_a_number() {
        assert_eq!(tokens("2.*x")[1].0, Token::Fixed(".*"));
        assert_eq!(tokens("1:N")[1].0, Token::Fixed(":"));
    }

    #[test]
    fn comments_and_quoted_names() {
        assert_eq!(
            tokens("a // b\n/* c\n */ 'd e' \"f\\\"g\""),
            [
                (Token::Identifier, "a"),
                (Token::Identifier, "'d e'"),
                (Token::Text, "\"f\\\"g\""),
            ]
        );
    }

    #[test]
    fn unterminated() {
        for text in ["/* x", "\"x", "'x", "\"x\\"] {
            let refused = Lexer::new(text, &MODELICA).token().unwrap_err();
            assert!(refused.into_details().message.contains("no end"));
        }
    }

    #[test]
    fn refuses_strange_characters() {
        for text in ["\0", "θ", "#", "2x"] {
            assert!(Lexer::new(text, &MODELICA).token().is_err(), "{text:?}");
        }
    }

    #[test]
    fn quotes_blanks_and_comments_are_no_part_of_a_name() {
        for text in [
            "r1.p.v",
            "'r1.p.v'",
            "'r1'.'p'.'v'",
            ".r1 . p.v",
            "r1./* a */p.v",
        ] {
            assert_eq!(plain(text), "r1.p.v", "{text}");
        }
        assert_eq!(plain("'m[1].x'"), "m[1].x");
        assert_eq!(plain("m[1] .x"), "m[1].x");
        assert_eq!(plain("'a b'"), "a b");
    }

    #[test]
    fn numbers_of_ode_models() {
        for text in ["1", "1_000", "1.5", ".5", "2.", "1.0e-3", "1e6", "2E+3"] {
            assert_eq!(all(text, &ODE_MODEL), [(Token::Real, text)]);
        }
        let factor = [(Token::Real, "2"), (Token::Identifier, "e")];
        assert_eq!(all("2e", &ODE_MODEL), factor);
        for text in ["1f0", "0x1f", "0b1", "0o7"] {
            assert!(Lexer::new(text, &ODE_MODEL).token().is_err(), "{text}");
        }
    }

    #[test]
    fn names_and_comments_of_ode_models() {
        for name in ["β", "x₁", "_a", "ẋ", "x\u{302}", "In", "δₜ"] {
            assert_eq!(all(name, &ODE_MODEL), [(Token::Identifier, name)]);
        }
        assert_eq!(all("a # b\n #= c #= d =# =# e", &ODE_MODEL).len(), 2);
    }

    #[test]
    fn refuses_what_no_ode_model_has() {
        for text in ["\0", "[", "!", "\"", "2.*x", "begin", "#=", ";"] {
            let mut lexer = Lexer::new(text, &ODE_MODEL);
            let first = lexer.token();
            assert!(first.and_then(|_| lexer.token()).is_err(), "{text:?}");
        }
    }
}
