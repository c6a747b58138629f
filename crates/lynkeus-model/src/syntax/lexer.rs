//! Text to tokens, one at a time, so that memory does not grow with the text; and what the text
//! of a token means.

use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::LazyLock;

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

/// Words of Modelica that cannot be names.
static RESERVED: LazyLock<HashSet<&str>> = LazyLock::new(|| {
    "algorithm and annotation block break class connect connector constant constrainedby der \
     discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends \
     external false final flow for function if import impure in initial inner input loop model \
     not operator or outer output package parameter partial protected public pure record \
     redeclare replaceable return stream then true type when while within"
        .split_whitespace()
        .collect()
});

/// Operators and punctuation; longer ones first.
const SYMBOLS: [&str; 28] = [
    ".+", ".-", ".*", "./", ".^", ":=", "<>", "<=", ">=", "==", "+", "-", "*", "/", "^", "=", "<",
    ">", "(", ")", "[", "]", "{", "}", ",", ";", ":", ".",
];

/// At most 40 characters of a text.
pub(crate) fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Refuses names beyond the limit.
pub(crate) fn check_name(span: Span) -> Result<()> {
    if (span.end - span.start) as usize <= MAX_NAME {
        return Ok(());
    }
    let message = format!("this name is longer than {MAX_NAME} characters");
    Err(Problem::new(span, message).hint("choose a shorter name"))
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
    pub(crate) position: usize,
}

/// What all languages have.
impl<'s> Lexer<'s> {
    pub(crate) fn rest(&self) -> &'s str {
        self.source.get(self.position..).unwrap_or_default()
    }

    pub(crate) fn byte(&self, ahead: usize) -> Option<u8> {
        self.source.as_bytes().get(self.position + ahead).copied()
    }

    pub(crate) fn digit_at(&self, ahead: usize) -> bool {
        self.byte(ahead).is_some_and(|byte| byte.is_ascii_digit())
    }

    /// Digits, with what may separate them.
    fn digits(&mut self, separators: &[char]) {
        while self.digit_at(0) || (self.rest().starts_with(separators) && self.digit_at(1)) {
            self.position += 1;
        }
    }

    /// Digits, with a point and an exponent behind one of these letters.
    pub(crate) fn number(&mut self, exponents: &[char], separators: &[char]) -> Token {
        let mut token = Token::Integer;
        self.digits(separators);
        // `2.*x` is the elementwise product `2 .* x`, not `2.` times `x`.
        let elementwise = matches!(self.byte(1), Some(b'*' | b'/' | b'^' | b'+' | b'-'));
        if self.byte(0) == Some(b'.') && !elementwise {
            token = Token::Real;
            self.position += 1;
            self.digits(separators);
        }
        let sign = usize::from(matches!(self.byte(1), Some(b'+' | b'-')));
        if self.rest().starts_with(exponents) && self.digit_at(1 + sign) {
            token = Token::Real;
            self.position += 1 + sign;
            self.digits(separators);
        }
        token
    }

    /// One of the operators; for other characters a refusal with what to write instead.
    pub(crate) fn symbol(
        &mut self,
        known: &[&'static str],
        hint: fn(char) -> Option<&'static str>,
    ) -> Result<Token> {
        let rest = self.rest();
        if let Some(text) = known.iter().find(|text| rest.starts_with(**text)) {
            self.position += text.len();
            return Ok(Token::Fixed(text));
        }
        let found = rest.chars().next().unwrap_or_default();
        let span = Span::new(self.position, self.position + found.len_utf8());
        let zero = (found == '\0').then_some("the text holds a zero byte: is this a text file?");
        let problem = Problem::new(span, format!("unexpected character {found:?}"));
        Err(problem.maybe_hint(hint(found).or(zero)))
    }
}

/// Those of Modelica.
impl<'s> Lexer<'s> {
    pub(crate) fn new(source: &'s str) -> Self {
        // A byte order mark is not part of the text.
        let position = if source.starts_with('\u{feff}') { 3 } else { 0 };
        Self { source, position }
    }

    fn take_while(&mut self, accept: impl Fn(u8) -> bool) {
        while self.byte(0).is_some_and(&accept) {
            self.position += 1;
        }
    }

    fn skip_blank(&mut self) -> Result<()> {
        loop {
            self.take_while(|byte| byte.is_ascii_whitespace() || byte == 0x0b);
            if self.rest().starts_with("//") {
                self.take_while(|byte| byte != b'\n');
            } else if self.rest().starts_with("/*") {
                let behind = self.position + 2;
                let length = self.source[behind..].find("*/");
                let length = length.ok_or_else(|| no_end("comment", self.position, "/*", "*/"))?;
                self.position = behind + length + 2;
            } else {
                return Ok(());
            }
        }
    }

    /// The next token; `Token::End` from the end of the text on.
    pub(crate) fn token(&mut self) -> Result<(Token, Span)> {
        self.skip_blank()?;
        let start = self.position;
        let token = match self.byte(0) {
            None => Token::End,
            Some(byte) if is_name_start(byte) => self.word(),
            Some(byte) if byte.is_ascii_digit() => self.number_alone()?,
            Some(b'"') => self.quoted("\"", "string", Token::Text)?,
            Some(b'\'') => self.quoted("'", "quoted name", Token::Identifier)?,
            Some(_) => self.symbol(&SYMBOLS, character_hint)?,
        };
        let span = Span::new(start, self.position);
        if token == Token::Identifier {
            check_name(span)?;
        }
        Ok((token, span))
    }

    fn word(&mut self) -> Token {
        let start = self.position;
        self.take_while(is_name_part);
        let reserved = RESERVED.get(&self.source[start..self.position]);
        reserved.map_or(Token::Identifier, |text| Token::Fixed(text))
    }

    fn number_alone(&mut self) -> Result<Token> {
        let start = self.position;
        let token = self.number(&['e', 'E'], &[]);
        let end = self.position;
        self.take_while(is_name_part);
        if self.position == end {
            return Ok(token);
        }
        let span = Span::new(start, self.position);
        Err(Problem::new(span, "a number runs into a name")
            .hint("write a product with `*`; a name starts with a letter"))
    }

    fn quoted(&mut self, quote: &str, what: &str, token: Token) -> Result<Token> {
        let start = self.position;
        self.position += 1;
        while let Some(byte) = self.byte(0) {
            self.position += 1;
            match byte {
                b'\\' => self.position = self.source.len().min(self.position + 1),
                _ if quote.as_bytes() == [byte] => return Ok(token),
                _ => {}
            }
        }
        Err(no_end(what, start, quote, quote))
    }
}

/// The refusal of what begins somewhere and does not end.
pub(crate) fn no_end(what: &str, start: usize, opening: &str, closing: &str) -> Box<Problem> {
    let span = Span::new(start, start + opening.len());
    Problem::new(span, format!("this {what} has no end")).hint(format!("close it with `{closing}`"))
}

fn character_hint(found: char) -> Option<&'static str> {
    Some(match found {
        '!' => "write `not a`, or `<>` for \"not equal\"",
        '&' => "write `and`",
        '|' => "write `or`",
        '%' => "write `mod(a, b)` or `rem(a, b)`",
        _ if found.is_alphabetic() => {
            "names are ASCII letters, digits and `_`; put other names in single quotes"
        }
        _ => return None,
    })
}

fn is_name_start(byte: u8) -> bool {
    // compilers name what they add with `$`
    byte.is_ascii_alphabetic() || byte == b'_' || byte == b'$'
}

fn is_name_part(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'$'
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
    use super::*;

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        let mut lexer = Lexer::new(text);
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
            assert!(
                Lexer::new(text)
                    .token()
                    .unwrap_err()
                    .message
                    .contains("no end")
            );
        }
    }

    #[test]
    fn refuses_strange_characters() {
        for text in ["\0", "θ", "#", "2x"] {
            assert!(Lexer::new(text).token().is_err(), "{text:?}");
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
}
