//! Text to tokens, one at a time, so that memory does not grow with the text; and what the text
//! of a token means.

use std::borrow::Cow;

use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_NAME;

/// One token; its text is the source under its span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Identifier,
    Integer,
    Real,
    Text,
    Keyword(Keyword),
    Symbol(Symbol),
    /// the end of the text
    End,
}

macro_rules! words {
    ($(#[$doc:meta])* $kind:ident, $($name:ident = $text:literal),* $(,)?) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum $kind { $($name),* }

        impl $kind {
            /// How it is written.
            pub(crate) fn text(self) -> &'static str {
                match self { $(Self::$name => $text),* }
            }

            /// Every one, with how it is written.
            pub(crate) const ALL: &[(&'static str, Self)] = &[$(($text, Self::$name)),*];
        }
    };
}

words! {
    /// Reserved words.
    Keyword,
    Algorithm = "algorithm", And = "and", Annotation = "annotation", Block = "block",
    Break = "break", Class = "class", Connect = "connect", Connector = "connector",
    Constant = "constant", Constrainedby = "constrainedby", Der = "der", Discrete = "discrete",
    Each = "each", Else = "else", Elseif = "elseif", Elsewhen = "elsewhen",
    Encapsulated = "encapsulated", End = "end", Enumeration = "enumeration",
    Equation = "equation", Expandable = "expandable", Extends = "extends",
    External = "external", False = "false", Final = "final", Flow = "flow", For = "for",
    Function = "function", If = "if", Import = "import", Impure = "impure", In = "in",
    Initial = "initial", Inner = "inner", Input = "input", Loop = "loop", Model = "model",
    Not = "not", Operator = "operator", Or = "or", Outer = "outer", Output = "output",
    Package = "package", Parameter = "parameter", Partial = "partial", Protected = "protected",
    Public = "public", Pure = "pure", Record = "record", Redeclare = "redeclare",
    Replaceable = "replaceable", Return = "return", Stream = "stream", Then = "then",
    True = "true", Type = "type", When = "when", While = "while", Within = "within",
}

words! {
    /// Operators and punctuation; longer ones first.
    Symbol,
    ElementPlus = ".+", ElementMinus = ".-", ElementTimes = ".*", ElementOver = "./",
    ElementPower = ".^", Assign = ":=", NotEqual = "<>", LessEqual = "<=",
    GreaterEqual = ">=", EqualEqual = "==", Plus = "+", Minus = "-", Times = "*", Over = "/",
    Power = "^", Equal = "=", Less = "<", Greater = ">", OpenParen = "(", CloseParen = ")",
    OpenBracket = "[", CloseBracket = "]", OpenBrace = "{", CloseBrace = "}", Comma = ",",
    Semicolon = ";", Colon = ":", Dot = ".",
    // of `@ODEmodel` texts alone; in Modelica they begin comments and quoted names
    Rational = "//", Prime = "'",
}

/// What the parser asks of a language.
pub(crate) trait Language {
    /// What to do about parts that are nested too deep.
    const NESTED: &'static str;

    /// The next token; `Token::End` from the end of the text on.
    fn next(&mut self) -> Result<(Token, Span)>;

    /// The refusal of more than so many parts.
    fn too_large(&self, limit: &str, span: Span) -> Problem;

    /// What to do where the text ends too early.
    fn hint_at_end(&self) -> Option<String>;
}

impl Token {
    /// How a message names it.
    pub(crate) fn describe(self, text: &str) -> String {
        match self {
            Token::Identifier | Token::Integer | Token::Real => format!("`{}`", shortened(text)),
            Token::Text => "a string".to_owned(),
            Token::Keyword(keyword) => format!("`{}`", keyword.text()),
            Token::Symbol(symbol) => format!("`{}`", symbol.text()),
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
    source: &'s str,
    position: usize,
}

impl<'s> Lexer<'s> {
    pub(crate) fn new(source: &'s str) -> Self {
        // A byte order mark is not part of the text.
        let position = if source.starts_with('\u{feff}') { 3 } else { 0 };
        Self { source, position }
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

impl Language for Lexer<'_> {
    const NESTED: &'static str = "name the inner parts with variables of their own";

    fn next(&mut self) -> Result<(Token, Span)> {
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
        let span = Span::new(start, self.position);
        if token == Token::Identifier {
            check_name(span)?;
        }
        Ok((token, span))
    }

    fn too_large(&self, limit: &str, span: Span) -> Problem {
        let message = format!("the text has more than {limit} operands and operators");
        Problem::new(span, message).hint("write repetition as `for` loops")
    }

    fn hint_at_end(&self) -> Option<String> {
        None
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

/// A name without quotes, blanks and a leading dot: `'r1.p.v'`, `'r1'.'p'.v` and `r1.p.v` are
/// one name.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    let is_plain = |byte: u8| byte != b'\'' && byte != b'/' && !byte.is_ascii_whitespace();
    let text = text.strip_prefix('.').unwrap_or(text);
    if text.bytes().all(is_plain) {
        return Cow::Borrowed(text);
    }
    if let Some(inner) = text.strip_prefix('\'').and_then(|t| t.strip_suffix('\''))
        && !inner.contains('\'')
    {
        return Cow::Borrowed(inner);
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
