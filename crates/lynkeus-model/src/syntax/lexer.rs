//! Text to tokens, one at a time, so that memory does not grow with the text.

use super::token::{Keyword, Symbol, Token};
use super::{Problem, Result, Span};
use crate::limits::MAX_NAME;

/// Reads tokens from a text.
#[derive(Clone)]
pub(crate) struct Lexer<'s> {
    source: &'s str,
    position: usize,
}

impl<'s> Lexer<'s> {
    pub(crate) fn new(source: &'s str) -> Self {
        // A byte order mark is not part of the text.
        let position = if source.starts_with('\u{feff}') { 3 } else { 0 };
        Self { source, position }
    }

    /// The next token; `Token::End` from the end of the text on.
    pub(crate) fn next(&mut self) -> Result<(Token, Span)> {
        self.skip_blank()?;
        let start = self.position;
        let token = match self.peek(0) {
            None => Token::End,
            Some(byte) if is_name_start(byte) => self.word(),
            Some(byte) if byte.is_ascii_digit() => self.number()?,
            Some(b'"') => self.quoted(b'"', "string", Token::Text)?,
            Some(b'\'') => self.quoted(b'\'', "quoted name", Token::Identifier)?,
            Some(_) => self.symbol()?,
        };
        if token == Token::Identifier && self.position - start > MAX_NAME {
            let span = Span::new(start, self.position);
            let message = format!("this name is longer than {MAX_NAME} characters");
            return Err(Problem::new(span, message).hint("choose a shorter name"));
        }
        Ok((token, Span::new(start, self.position)))
    }

    fn peek(&self, ahead: usize) -> Option<u8> {
        self.source.as_bytes().get(self.position + ahead).copied()
    }

    fn take_while(&mut self, accept: impl Fn(u8) -> bool) {
        while self.peek(0).is_some_and(&accept) {
            self.position += 1;
        }
    }

    fn skip_blank(&mut self) -> Result<()> {
        loop {
            self.take_while(|byte| byte.is_ascii_whitespace() || byte == 0x0b);
            match (self.peek(0), self.peek(1)) {
                (Some(b'/'), Some(b'/')) => self.take_while(|byte| byte != b'\n'),
                (Some(b'/'), Some(b'*')) => self.skip_comment()?,
                _ => return Ok(()),
            }
        }
    }

    fn skip_comment(&mut self) -> Result<()> {
        let start = self.position;
        let Some(length) = self.source[start + 2..].find("*/") else {
            return Err(
                Problem::new(Span::new(start, start + 2), "this comment has no end")
                    .hint("close it with `*/`"),
            );
        };
        self.position = start + 2 + length + 2;
        Ok(())
    }

    fn word(&mut self) -> Token {
        let start = self.position;
        self.take_while(is_name_part);
        let word = &self.source[start..self.position];
        let keyword = Keyword::ALL.iter().find(|(text, _)| *text == word);
        keyword.map_or(Token::Identifier, |&(_, keyword)| Token::Keyword(keyword))
    }

    fn number(&mut self) -> Result<Token> {
        let start = self.position;
        let mut token = Token::Integer;
        self.take_while(|byte| byte.is_ascii_digit());
        // `2.*x` is the elementwise product `2 .* x`, not `2.` times `x`.
        let elementwise = matches!(self.peek(1), Some(b'*' | b'/' | b'^' | b'+' | b'-'));
        if self.peek(0) == Some(b'.') && !elementwise {
            token = Token::Real;
            self.position += 1;
            self.take_while(|byte| byte.is_ascii_digit());
        }
        if matches!(self.peek(0), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(self.peek(1), Some(b'+' | b'-')));
            if self
                .peek(1 + sign)
                .is_some_and(|byte| byte.is_ascii_digit())
            {
                token = Token::Real;
                self.position += 1 + sign;
                self.take_while(|byte| byte.is_ascii_digit());
            }
        }
        if self.peek(0).is_some_and(is_name_part) {
            self.take_while(is_name_part);
            let span = Span::new(start, self.position);
            return Err(Problem::new(span, "a number runs into a name")
                .hint("write a product with `*`; a name starts with a letter"));
        }
        Ok(token)
    }

    fn quoted(&mut self, quote: u8, what: &str, token: Token) -> Result<Token> {
        let start = self.position;
        self.position += 1;
        while let Some(byte) = self.peek(0) {
            self.position += 1;
            match byte {
                b'\\' => self.position = self.source.len().min(self.position + 1),
                _ if byte == quote => return Ok(token),
                _ => {}
            }
        }
        let span = Span::new(start, start + 1);
        Err(Problem::new(span, format!("this {what} has no end"))
            .hint(format!("close it with `{}`", char::from(quote))))
    }

    fn symbol(&mut self) -> Result<Token> {
        let rest = &self.source[self.position..];
        let known = Symbol::ALL.iter().find(|(text, _)| rest.starts_with(text));
        if let Some(&(text, symbol)) = known {
            self.position += text.len();
            return Ok(Token::Symbol(symbol));
        }
        let found = rest.chars().next().unwrap_or_default();
        let span = Span::new(self.position, self.position + found.len_utf8());
        let problem = Problem::new(span, format!("unexpected character {found:?}"));
        Err(problem.maybe_hint(character_hint(found)))
    }
}

fn character_hint(found: char) -> Option<String> {
    let hint = match found {
        '!' => "write `not a`, or `<>` for \"not equal\"",
        '&' => "write `and`",
        '|' => "write `or`",
        '%' => "write `mod(a, b)` or `rem(a, b)`",
        '\0' => "the text holds a zero byte: is this a text file?",
        _ if found.is_alphabetic() => {
            "names are ASCII letters, digits and `_`; put other names in single quotes"
        }
        _ => return None,
    };
    Some(hint.to_owned())
}

fn is_name_start(byte: u8) -> bool {
    // compilers name what they add with `$`
    byte.is_ascii_alphabetic() || byte == b'_' || byte == b'$'
}

fn is_name_part(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'$'
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        let mut lexer = Lexer::new(text);
        let mut all = vec![];
        loop {
            let (token, span) = lexer.next().unwrap();
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
        assert_eq!(tokens("2.*x")[1].0, Token::Symbol(Symbol::ElementTimes));
        assert_eq!(tokens("1:N")[1].0, Token::Symbol(Symbol::Colon));
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
                    .next()
                    .unwrap_err()
                    .into_details()
                    .message
                    .contains("no end")
            );
        }
    }

    #[test]
    fn refuses_strange_characters() {
        for text in ["\0", "θ", "#", "2x"] {
            assert!(Lexer::new(text).next().is_err(), "{text:?}");
        }
    }
}
