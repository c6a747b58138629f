//! Names as the rest of the reader knows them.

use std::borrow::Cow;

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
