//! Where the models of a Julia script begin, and the tokens of a model.
//!
//! Nothing else of the script can change what `@ODEmodel` means, so all other code is skipped;
//! only comments and strings have to be known, as they may speak of models.

use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::{Lexer, Token, check_name, no_end};

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
    let rest = source.get(start..).unwrap_or_default();
    if !rest.starts_with("#=") {
        return Ok(start + rest.find('\n').unwrap_or(rest.len()));
    }
    let (mut at, mut open) = (2, 1usize);
    while open > 0 {
        at += match rest.as_bytes().get(at..) {
            Some([b'#', b'=', ..]) => {
                open += 1;
                2
            }
            Some([b'=', b'#', ..]) => {
                open -= 1;
                2
            }
            Some([_, ..]) => 1,
            _ => return Err(no_end("comment", start, "#=", "=#")),
        };
    }
    Ok(start + at)
}

const MACRO: &str = "@ODEmodel";

/// Every model, in order: the variable that it is assigned to, or else `stem`, and the word
/// `@ODEmodel`.
pub(super) fn heads<'s>(source: &'s str, stem: &'s str) -> Result<Vec<(&'s str, Span)>> {
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
            let name = assigned_name(source, at).unwrap_or(stem);
            heads.push((name, Span::new(at, next)));
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
    Err(no_end("string", start, "\"", quote))
}

/// The end of a character literal such as `'"'`; the quote alone where there is none.
fn character_end(source: &str, start: usize) -> usize {
    let inner = source.get(start + 1..).unwrap_or_default();
    let escaped = usize::from(inner.starts_with('\\'));
    match inner.char_indices().nth(1 + escaped) {
        Some((length, '\'')) => start + 1 + length + 1,
        _ => start + 1,
    }
}

/// `name` of `name = @ODEmodel`, also where the module stands before the `@`.
fn assigned_name(source: &str, at: usize) -> Option<&str> {
    let mut before = source.get(..at)?;
    if let Some(module) = before.strip_suffix('.') {
        before = module.trim_end_matches(continues_name);
    }
    let before = before.trim_end().strip_suffix('=')?.trim_end();
    let start = before.trim_end_matches(continues_name).len();
    let name = before.get(start..)?;
    name.starts_with(starts_name).then_some(name)
}

/// Operators and punctuation; longer ones first.
const SYMBOLS: [&str; 11] = ["//", "+", "-", "*", "/", "^", "=", "(", ")", ",", "'"];

/// Words of Julia that cannot be names.
const RESERVED: [&str; 16] = [
    "begin", "end", "if", "else", "elseif", "for", "while", "function", "let", "do", "return",
    "true", "false", "const", "in", "isa",
];

/// The next token; `Token::End` from the end of the text on.
pub(super) fn token(lexer: &mut Lexer<'_>) -> Result<(Token, Span)> {
    skip_blank(lexer)?;
    let start = lexer.position;
    let token = match lexer.rest().chars().next() {
        None => Token::End,
        Some(character) if starts_name(character) => name(lexer)?,
        Some(character) if character.is_ascii_digit() => number(lexer)?,
        Some('.') if lexer.digit_at(1) => number(lexer)?,
        Some(_) => lexer.symbol(&SYMBOLS, character_hint)?,
    };
    Ok((token, Span::new(start, lexer.position)))
}

fn skip_blank(lexer: &mut Lexer<'_>) -> Result<()> {
    loop {
        let rest = lexer.rest();
        lexer.position += rest.len() - rest.trim_start().len();
        if lexer.byte(0) != Some(b'#') {
            return Ok(());
        }
        lexer.position = comment_end(lexer.source, lexer.position)?;
    }
}

fn name(lexer: &mut Lexer<'_>) -> Result<Token> {
    let start = lexer.position;
    lexer.position = name_end(lexer.source, start);
    let span = Span::new(start, lexer.position);
    let name = span.text(lexer.source);
    check_name(span)?;
    if RESERVED.contains(&name) {
        let message = format!("`{name}` is not supported in a model");
        let hint = "a model holds equations such as `x'(t) = …` only";
        return Err(Problem::new(span, message).hint(hint));
    }
    Ok(Token::Identifier)
}

/// `1`, `1_000`, `1.5`, `.5`, `2.`, `1.0e-3`.
fn number(lexer: &mut Lexer<'_>) -> Result<Token> {
    let start = lexer.position;
    let is_prefixed = ["0x", "0b", "0o"]
        .iter()
        .any(|prefix| lexer.rest().starts_with(prefix));
    lexer.number(&['e', 'E', 'f'], &['_']);
    let is_single = Span::new(start, lexer.position)
        .text(lexer.source)
        .contains('f');
    if is_prefixed || is_single {
        let span = Span::new(start, name_end(lexer.source, lexer.position));
        return Err(Problem::new(span, "this form of number is not supported")
            .hint("numbers read `12`, `1_000`, `1//2`, `0.5` or `1.0e-3`"));
    }
    Ok(Token::Real)
}

fn character_hint(found: char) -> Option<&'static str> {
    Some(match found {
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
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<&str> {
        let heads = heads(text, "?").unwrap().into_iter();
        heads.map(|(name, _)| name).collect()
    }

    #[test]
    fn names_of_models() {
        assert_eq!(names("ode=@ODEmodel()"), ["ode"]);
        assert_eq!(names("β₁ = SI.@ODEmodel()"), ["β₁"]);
        assert_eq!(names("@ODEmodel() :a => @ODEmodel()"), ["?", "?"]);
        assert_eq!(names("2 = @ODEmodel() = @ODEmodel()"), ["?", "?"]);
        assert_eq!(names("@ODEmodels @odemodel ODEmodel"), [""; 0]);
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
            assert_eq!(names(text), [""; 0], "{text}");
        }
        assert_eq!(names("'\"' @ODEmodel '\"'").len(), 1);
        assert_eq!(names("x' y' @ODEmodel(x'(t))").len(), 1);
    }

    #[test]
    fn what_has_no_end() {
        for text in ["#=", "\"", "\"\"\" \"", "\"\\"] {
            let message = heads(text, "?").unwrap_err().message;
            assert!(message.contains("no end"), "{text}");
        }
    }

    fn tokens(text: &str) -> Vec<(Token, &str)> {
        let mut lexer = Lexer::new(text);
        let mut all = vec![];
        loop {
            let (found, span) = token(&mut lexer).unwrap();
            if found == Token::End {
                return all;
            }
            all.push((found, span.text(text)));
        }
    }

    #[test]
    fn numbers() {
        for text in ["1", "1_000", "1.5", ".5", "2.", "1.0e-3", "1e6", "2E+3"] {
            assert_eq!(tokens(text), [(Token::Real, text)]);
        }
        assert_eq!(tokens("2e"), [(Token::Real, "2"), (Token::Identifier, "e")]);
        for text in ["1f0", "0x1f", "0b1", "0o7"] {
            assert!(token(&mut Lexer::new(text)).is_err(), "{text}");
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
            let mut lexer = Lexer::new(text);
            let first = token(&mut lexer);
            assert!(first.and_then(|_| token(&mut lexer)).is_err(), "{text:?}");
        }
    }
}
