//! The tokens of a model.

use super::characters::{comment_end, name_end, starts_name};
use crate::limits::MAX_NAME;
use crate::syntax::{Problem, Result, Span, shortened};

/// One token; its text is the source under its span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token {
    Name,
    Number,
    Symbol(&'static str),
    /// the end of the text
    End,
}

/// Operators and punctuation; longer ones first.
const SYMBOLS: [&str; 11] = ["//", "+", "-", "*", "/", "^", "=", "(", ")", ",", "'"];

/// Words of Julia that cannot be names.
const RESERVED: [&str; 16] = [
    "begin", "end", "if", "else", "elseif", "for", "while", "function", "let", "do", "return",
    "true", "false", "const", "in", "isa",
];

impl Token {
    /// How a message names it.
    pub(super) fn describe(self, text: &str) -> String {
        match self {
            Token::Name | Token::Number => format!("`{}`", shortened(text)),
            Token::Symbol(symbol) => format!("`{symbol}`"),
            Token::End => "the end of the text".to_owned(),
        }
    }
}

/// Reads tokens from a text.
pub(super) struct Lexer<'s> {
    source: &'s str,
    position: usize,
}

impl<'s> Lexer<'s> {
    pub(super) fn new(source: &'s str, position: usize) -> Self {
        Self { source, position }
    }

    /// The next token; `Token::End` from the end of the text on.
    pub(super) fn next(&mut self) -> Result<(Token, Span)> {
        self.skip_blank()?;
        let start = self.position;
        let token = match self.rest().chars().next() {
            None => Token::End,
            Some(character) if starts_name(character) => self.name()?,
            Some(character) if character.is_ascii_digit() => self.number()?,
            Some('.') if self.digit_at(1) => self.number()?,
            Some(character) => self.symbol(character)?,
        };
        Ok((token, Span::new(start, self.position)))
    }

    fn rest(&self) -> &'s str {
        self.source.get(self.position..).unwrap_or_default()
    }

    fn byte(&self, ahead: usize) -> Option<u8> {
        self.source.as_bytes().get(self.position + ahead).copied()
    }

    fn digit_at(&self, ahead: usize) -> bool {
        self.byte(ahead).is_some_and(|byte| byte.is_ascii_digit())
    }

    fn skip_blank(&mut self) -> Result<()> {
        loop {
            let rest = self.rest();
            self.position += rest.len() - rest.trim_start().len();
            if self.byte(0) != Some(b'#') {
                return Ok(());
            }
            self.position = comment_end(self.source, self.position)?;
        }
    }

    fn name(&mut self) -> Result<Token> {
        let start = self.position;
        self.position = name_end(self.source, start);
        let span = Span::new(start, self.position);
        let name = span.text(self.source);
        if name.len() > MAX_NAME {
            let message = format!("this name is longer than {MAX_NAME} characters");
            return Err(Problem::new(span, message).hint("choose a shorter name"));
        }
        if RESERVED.contains(&name) {
            let message = format!("`{name}` is not supported in a model");
            let hint = "a model holds equations such as `x'(t) = …` only";
            return Err(Problem::new(span, message).hint(hint));
        }
        Ok(Token::Name)
    }

    /// `1`, `1_000`, `1.5`, `.5`, `2.`, `1.0e-3`.
    fn number(&mut self) -> Result<Token> {
        let start = self.position;
        let is_prefixed =
            self.byte(0) == Some(b'0') && matches!(self.byte(1), Some(b'x' | b'b' | b'o'));
        self.digits();
        if self.byte(0) == Some(b'.') && !self.is_dotted_operator() {
            self.position += 1;
            self.digits();
        }
        if matches!(self.byte(0), Some(b'e' | b'E' | b'f')) {
            let is_single = self.byte(0) == Some(b'f');
            let sign = usize::from(matches!(self.byte(1), Some(b'+' | b'-')));
            if self.digit_at(1 + sign) {
                self.position += 1 + sign;
                self.digits();
                if is_single {
                    return Err(self.strange_number(start));
                }
            }
        }
        match is_prefixed {
            true => Err(self.strange_number(start)),
            false => Ok(Token::Number),
        }
    }

    /// Digits, with `_` between them.
    fn digits(&mut self) {
        while self.digit_at(0) || (self.byte(0) == Some(b'_') && self.digit_at(1)) {
            self.position += 1;
        }
    }

    /// `.*` and its like behind a number, as in `2.*x`.
    fn is_dotted_operator(&self) -> bool {
        matches!(self.byte(1), Some(b'*' | b'/' | b'^' | b'+' | b'-'))
    }

    fn strange_number(&self, start: usize) -> Problem {
        let span = Span::new(start, name_end(self.source, self.position));
        Problem::new(span, "this form of number is not supported")
            .hint("numbers read `12`, `1_000`, `1//2`, `0.5` or `1.0e-3`")
    }

    fn symbol(&mut self, found: char) -> Result<Token> {
        let rest = self.rest();
        if let Some(symbol) = SYMBOLS.iter().find(|symbol| rest.starts_with(**symbol)) {
            self.position += symbol.len();
            return Ok(Token::Symbol(symbol));
        }
        let span = Span::new(self.position, self.position + found.len_utf8());
        let problem = Problem::new(span, format!("unexpected character {found:?}"));
        Err(problem.maybe_hint(character_hint(found)))
    }
}

fn character_hint(found: char) -> Option<String> {
    let hint = match found {
        ';' => "separate equations by commas",
        '[' | ']' => "arrays are not supported: write every element as a function of its own",
        '.' => "operators on arrays are not supported: write the operator without `.`",
        '<' | '>' | '?' | '≤' | '≥' | '≠' => "conditions are not supported in this notation",
        '%' | '÷' => "remainders and whole quotients are not supported",
        '√' => "write `sqrt(…)`",
        '−' => "write the ASCII sign `-`",
        '·' | '⋅' | '×' => "write `*`",
        '~' => "an equation has the sign `=`",
        '@' => "macros within a model are not supported",
        '$' => "values from outside are not supported: write a parameter",
        '!' => "names have letters, digits and `_`",
        '"' => "use names and numbers",
        '\0' => "the text holds a zero byte: is this a text file?",
        _ => return None,
    };
    Some(hint.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        let mut lexer = Lexer::new(text, 0);
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
        for text in ["1", "1_000", "1.5", ".5", "2.", "1.0e-3", "1e6", "2E+3"] {
            assert_eq!(tokens(text), [(Token::Number, text)]);
        }
        assert_eq!(tokens("2e"), [(Token::Number, "2"), (Token::Name, "e")]);
        for text in ["1f0", "0x1f", "0b1", "0o7"] {
            assert!(Lexer::new(text, 0).next().is_err(), "{text}");
        }
    }

    #[test]
    fn names_and_comments() {
        let names = ["β", "x₁", "_a", "ẋ", "x\u{302}", "In", "δₜ"];
        for name in names {
            assert_eq!(tokens(name), [(Token::Name, name)]);
        }
        assert_eq!(tokens("a # b\n #= c #= d =# =# e").len(), 2);
    }

    #[test]
    fn refuses_strange_characters() {
        for text in ["\0", "[", "!", "\"", "2.*x", "begin", "#=", ";"] {
            let mut lexer = Lexer::new(text, 0);
            let first = lexer.next();
            assert!(first.and_then(|_| lexer.next()).is_err(), "{text:?}");
        }
    }
}
