//! What Julia's characters are: names, and comments between tokens.

use crate::syntax::{Problem, Result, Span};

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
