//! A draft in words, numbers, signs and comments.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Word,
    Number,
    Sign,
    Comment,
    /// after everything, on a line of its own
    End,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token<'t> {
    pub kind: Kind,
    pub text: &'t str,
    /// on which it begins, from 1 on
    pub line: usize,
}

impl Token<'_> {
    /// The line on which it ends.
    pub fn last_line(&self) -> usize {
        self.line + self.text.matches('\n').count()
    }
}

/// Signs of two characters; all others have one.
const LONG: [&str; 14] = [
    "->", "++", "--", "+=", "-=", "*=", "/=", "<=", ">=", "==", "!=", "&&", "||", ">>",
];

pub(super) fn tokens(draft: &str) -> Vec<Token<'_>> {
    let mut tokens = vec![];
    let mut rest = draft;
    let mut line = 1;
    loop {
        let trimmed = rest.trim_start();
        line += lines(&rest[..rest.len() - trimmed.len()]);
        if trimmed.is_empty() {
            break;
        }
        let (kind, length) = first(trimmed);
        let (text, left) = trimmed.split_at(length);
        tokens.push(Token { kind, text, line });
        line += lines(text);
        rest = left;
    }
    tokens.push(Token {
        kind: Kind::End,
        text: "",
        line: draft.lines().count() + 1,
    });
    tokens
}

fn lines(text: &str) -> usize {
    text.matches('\n').count()
}

/// What a text begins with, and how long that is in bytes.
fn first(text: &str) -> (Kind, usize) {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let word = text.find(|c| !is_word(c)).unwrap_or(text.len());
    if text.starts_with("/*") {
        let end = text.find("*/").map_or(text.len(), |end| end + 2);
        return (Kind::Comment, end);
    }
    if text.starts_with(|c: char| c.is_ascii_digit()) {
        return (Kind::Number, number(text));
    }
    if word > 0 {
        return (Kind::Word, word);
    }
    let long = LONG.iter().find(|sign| text.starts_with(**sign));
    let length = match long {
        Some(sign) => sign.len(),
        None => text.chars().next().map_or(0, char::len_utf8),
    };
    (Kind::Sign, length)
}

/// The length of a number: digits, a point, an exponent with its sign.
fn number(text: &str) -> usize {
    let mut before = ' ';
    let end = text.find(|c: char| {
        let is_sign = matches!(c, '+' | '-') && matches!(before, 'e' | 'E');
        before = c;
        !(c.is_ascii_alphanumeric() || c == '.' || is_sign)
    });
    end.unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_falls_into_tokens() {
        let draft = "a1 += R(1.5e-9) - 2e3-b->c; /* to\n   there */\n\nx--";
        let found = tokens(draft);
        let texts: Vec<&str> = found.iter().map(|token| token.text).collect();
        let expected = [
            "a1",
            "+=",
            "R",
            "(",
            "1.5e-9",
            ")",
            "-",
            "2e3",
            "-",
            "b",
            "->",
            "c",
            ";",
            "/* to\n   there */",
            "x",
            "--",
            "",
        ];
        assert_eq!(texts, expected);
        assert_eq!(found[13].last_line(), 2);
        assert_eq!(found[14].line, 4);
        assert_eq!(found[16].line, 5);
    }
}
