//! Where the models of a Julia script begin, and the tokens of a model.
//!
//! Nothing else of the script can change what `@ODEmodel` means, so all other code is skipped;
//! only comments and strings have to be known, as they may speak of models.

use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::{Language, Symbol, Token, check_name};

/// Whether a name may begin so.
pub(super) fn starts_name(character: char) -> bool {
    character.is_alphabetic() || character == '_'
}

/// Whether a name may go on so: letters, digits, subscripts, accents, and `′`.
pub(super) fn continues_name(character: char) -> bool {
    let is_accent = matches!(character, '\u{300}'..='\u{36f}' | '\u{20d0}'..='\u{20ff}');
    starts_name(character) || character.is_numeric() || is_accent || character == '′'
}

/// The end of the name that begins at `start`.
pub(super) fn name_end(source: &str, start: usize) -> usize {
    let rest = source.get(start..).unwrap_or_default();
    let length = rest.find(|character| !continues_name(character));
    start + length.unwrap_or(rest.len())
}

/// The end of the comment that begins at `start`: `# …` to the end of the line, or `#= … =#`,
/// which may hold further ones.
pub(super) fn comment_end(source: &str, start: usize) -> Result<usize> {
    let bytes = source.as_bytes();
    let pair = |at: usize| (bytes.get(at), bytes.get(at + 1));
    if pair(start) != (Some(&b'#'), Some(&b'=')) {
        let rest = source.get(start..).unwrap_or_default();
        return Ok(start + rest.find('\n').unwrap_or(rest.len()));
    }
    let (mut at, mut open) = (start + 2, 1usize);
    while open > 0 {
        at += match pair(at) {
            (Some(b'#'), Some(b'=')) => {
                open += 1;
                2
            }
            (Some(b'='), Some(b'#')) => {
                open -= 1;
                2
            }
            (Some(_), _) => 1,
            (None, _) => {
                let span = Span::new(start, start + 2);
                return Err(
                    Problem::new(span, "this comment has no end").hint("close it with `=#`")
                );
            }
        };
    }
    Ok(at)
}

const MACRO: &str = "@ODEmodel";

/// The beginning of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    /// the variable that the model is assigned to
    pub name: Option<Span>,
    /// the word `@ODEmodel`
    pub place: Span,
}

/// Every model, in order.
pub(super) fn heads(source: &str) -> Result<Vec<Head>> {
    let mut heads = vec![];
    let (mut at, mut last) = (0, None);
    while let Some(character) = source.get(at..).and_then(|rest| rest.chars().next()) {
        let next = match character {
            '#' => comment_end(source, at)?,
            '"' => string_end(source, at)?,
            '\'' if !ends_operand(last) => character_end(source, at),
            '@' => name_end(source, at + 1),
            _ if starts_name(character) => name_end(source, at),
            _ => at + character.len_utf8(),
        };
        if source.get(at..next) == Some(MACRO) {
            let name = assigned_name(source, at);
            let place = Span::new(at, next);
            heads.push(Head { name, place });
        }
        last = Some(character);
        at = next;
    }
    Ok(heads)
}

/// Whether `'` behind this character is a prime and opens no character literal.
fn ends_operand(last: Option<char>) -> bool {
    last.is_some_and(|last| continues_name(last) || matches!(last, ')' | ']' | '}' | '\'' | '.'))
}

/// The end of `"…"` or `"""…"""`.
fn string_end(source: &str, start: usize) -> Result<usize> {
    let rest = source.get(start..).unwrap_or_default();
    let quote = if rest.starts_with("\"\"\"") {
        "\"\"\""
    } else {
        "\""
    };
    let mut at = start + quote.len();
    while let Some(rest) = source.as_bytes().get(at..).filter(|rest| !rest.is_empty()) {
        if rest.starts_with(quote.as_bytes()) {
            return Ok(at + quote.len());
        }
        at += if rest.starts_with(b"\\") { 2 } else { 1 };
    }
    let problem = Problem::new(Span::new(start, start + 1), "this string has no end");
    Err(problem.hint(format!("close it with `{quote}`")))
}

/// The end of a character literal such as `'"'`; the quote alone where there is none.
fn character_end(source: &str, start: usize) -> usize {
    let mut characters = source
        .get(start..)
        .unwrap_or_default()
        .char_indices()
        .skip(1);
    let escaped = characters
        .next()
        .is_some_and(|(_, character)| character == '\\');
    let mut behind = characters.skip(usize::from(escaped));
    match behind.next() {
        Some((length, '\'')) => start + length + 1,
        _ => start + 1,
    }
}

/// `name` of `name = @ODEmodel`, also where the module stands before the `@`.
fn assigned_name(source: &str, at: usize) -> Option<Span> {
    let mut before = source.get(..at)?;
    if let Some(module) = before.strip_suffix('.') {
        before = module.trim_end_matches(continues_name);
    }
    let before = before.trim_end().strip_suffix('=')?.trim_end();
    let start = before.trim_end_matches(continues_name).len();
    let name = before.get(start..)?;
    let is_name = name.chars().next().is_some_and(starts_name);
    is_name.then(|| Span::new(start, before.len()))
}

/// Operators and punctuation; longer ones first.
const SYMBOLS: [Symbol; 11] = [
    Symbol::Rational,
    Symbol::Plus,
    Symbol::Minus,
    Symbol::Times,
    Symbol::Over,
    Symbol::Power,
    Symbol::Equal,
    Symbol::OpenParen,
    Symbol::CloseParen,
    Symbol::Comma,
    Symbol::Prime,
];

/// Words of Julia that cannot be names.
const RESERVED: [&str; 16] = [
    "begin", "end", "if", "else", "elseif", "for", "while", "function", "let", "do", "return",
    "true", "false", "const", "in", "isa",
];

/// A model while it is read: where the next token begins, and what was found so far.
pub(super) struct Lexer<'s> {
    source: &'s str,
    position: usize,
    /// the word `@ODEmodel`
    head: Span,
    /// names on the right sides, in order
    pub mentions: Vec<Mention>,
}

/// A name on a right side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mention {
    pub name: Span,
    /// `x(t)` and not `x`
    pub is_function: bool,
}

impl Language for Lexer<'_> {
    const NESTED: &'static str = "write it with fewer parentheses";

    fn next(&mut self) -> Result<(Token, Span)> {
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

    fn too_large(&self, limit: &str, span: Span) -> Problem {
        let message = format!("the model has more than {limit} operands and operators");
        Problem::new(span, message)
    }

    fn hint_at_end(&self) -> Option<String> {
        let line = self.head.line(self.source);
        Some(format!("close the model of line {line} with `)`"))
    }
}

impl<'s> Lexer<'s> {
    /// Reads the model that begins with the word at `head`.
    pub(super) fn new(source: &'s str, head: Span) -> Self {
        Self {
            source,
            position: head.end as usize,
            head,
            mentions: vec![],
        }
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
        check_name(span)?;
        if RESERVED.contains(&name) {
            let message = format!("`{name}` is not supported in a model");
            let hint = "a model holds equations such as `x'(t) = …` only";
            return Err(Problem::new(span, message).hint(hint));
        }
        Ok(Token::Identifier)
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
            false => Ok(Token::Real),
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
        if let Some(symbol) = SYMBOLS.iter().find(|s| rest.starts_with(s.text())) {
            self.position += symbol.text().len();
            return Ok(Token::Symbol(*symbol));
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

    fn names(text: &str) -> Vec<Option<&str>> {
        let heads = heads(text).unwrap();
        heads
            .iter()
            .map(|head| head.name.map(|name| name.text(text)))
            .collect()
    }

    #[test]
    fn names_of_models() {
        assert_eq!(names("ode=@ODEmodel()"), [Some("ode")]);
        assert_eq!(names("β₁ = SI.@ODEmodel()"), [Some("β₁")]);
        assert_eq!(names("@ODEmodel() :a => @ODEmodel()"), [None, None]);
        assert_eq!(names("2 = @ODEmodel() = @ODEmodel()"), [None, None]);
        assert_eq!(names("@ODEmodels @odemodel ODEmodel"), []);
    }

    #[test]
    fn comments_and_literals_hold_no_models() {
        for text in [
            "# @ODEmodel",
            "#= #= =# @ODEmodel =#",
            "\"\\\" @ODEmodel\"",
            "\"\"\" \" @ODEmodel \"\"\"",
            "'\"' # \"",
            "'\\'' #",
        ] {
            assert_eq!(names(text), [], "{text}");
        }
        assert_eq!(names("'\"' @ODEmodel '\"'").len(), 1);
        assert_eq!(names("x' y' @ODEmodel(x'(t))").len(), 1);
    }

    #[test]
    fn what_has_no_end() {
        for text in ["#=", "\"", "\"\"\" \"", "\"\\"] {
            let message = heads(text).unwrap_err().into_details().message;
            assert!(message.contains("no end"), "{text}");
        }
    }

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        let mut lexer = Lexer::new(text, Span::default());
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
            assert_eq!(tokens(text), [(Token::Real, text)]);
        }
        assert_eq!(tokens("2e"), [(Token::Real, "2"), (Token::Identifier, "e")]);
        for text in ["1f0", "0x1f", "0b1", "0o7"] {
            assert!(Lexer::new(text, Span::default()).next().is_err(), "{text}");
        }
    }

    #[test]
    fn names_and_comments() {
        let names = ["β", "x₁", "_a", "ẋ", "x\u{302}", "In", "δₜ"];
        for name in names {
            assert_eq!(tokens(name), [(Token::Identifier, name)]);
        }
        assert_eq!(tokens("a # b\n #= c #= d =# =# e").len(), 2);
    }

    #[test]
    fn refuses_strange_characters() {
        for text in ["\0", "[", "!", "\"", "2.*x", "begin", "#=", ";"] {
            let mut lexer = Lexer::new(text, Span::default());
            let first = lexer.next();
            assert!(first.and_then(|_| lexer.next()).is_err(), "{text:?}");
        }
    }
}
