//! Pieces of the runtime, as they are written once for all languages.

/// Lines between `//? name` (or `//? !name`) and `//?` stay where the name is (not) among those
/// that hold.
pub(super) fn chosen(text: &str, holds: &[&str]) -> String {
    let mut is_kept = true;
    let mut kept = String::new();
    for line in text.lines() {
        match line.strip_prefix("//?").map(str::trim) {
            Some("") => is_kept = true,
            Some(name) => {
                is_kept = match name.strip_prefix('!') {
                    Some(name) => !holds.contains(&name),
                    None => holds.contains(&name),
                };
            }
            None if is_kept => {
                kept += line;
                kept.push('\n');
            }
            None => {}
        }
    }
    kept
}

/// The parts of a text that begin with a line `//= name`: names and texts.
pub(super) fn parts(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split("//= ").skip(1).filter_map(|part| {
        let (name, rest) = part.split_once('\n')?;
        Some((name, rest.trim_end()))
    })
}

fn is_in_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// A text in pieces: words and numbers, and what stands between them. A comment is no word.
fn pieces(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let kind = is_in_word(rest.chars().next()?);
        let end = match comment_end(rest) {
            Some(end) => end,
            None => {
                let end = rest.find(|c| is_in_word(c) != kind).unwrap_or(rest.len());
                // a comment begins a piece of its own
                rest[..end].find("/*").unwrap_or(end)
            }
        };
        let (piece, left) = rest.split_at(end);
        rest = left;
        Some(piece)
    })
}

/// Where the comment ends that a text begins with.
fn comment_end(text: &str) -> Option<usize> {
    let inside = text.strip_prefix("/*")?;
    Some(inside.find("*/").map_or(text.len(), |place| place + 4))
}

/// A text with what is between its comments rewritten.
pub(super) fn outside_comments(text: &str, write: impl Fn(&str) -> String) -> String {
    let mut result = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(place) = rest.find("/*") {
        let (code, comment) = rest.split_at(place);
        result += &write(code);
        let end = comment_end(comment).unwrap_or(comment.len());
        result += &comment[..end];
        rest = &comment[end..];
    }
    result + &write(rest)
}

/// The text with words exchanged.
pub(super) fn exchanged<'t>(text: &'t str, other: impl Fn(&'t str) -> Option<String>) -> String {
    let mut result = String::with_capacity(text.len());
    for piece in pieces(text) {
        let new = match piece.starts_with(is_in_word) {
            true => other(piece),
            false => None,
        };
        match new {
            Some(new) => result += &new,
            None => result += piece,
        }
    }
    result
}

/// Whether a word stands in a text.
pub(super) fn mentions(text: &str, word: &str) -> bool {
    pieces(text).any(|piece| piece == word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_stay_where_their_condition_holds() {
        let text = "a\n//? gate\nb\n//?\n//? !gate\nc\n//?\nd\n";
        assert_eq!(chosen(text, &["gate"]), "a\nb\nd\n");
        assert_eq!(chosen(text, &[]), "a\nc\nd\n");
    }

    #[test]
    fn only_whole_words_are_exchanged() {
        let other = |word: &str| (word == "x").then(|| "z".to_owned());
        assert_eq!(exchanged("x + x1*ax (x)", other), "z + x1*ax (z)");
        assert_eq!(exchanged("x /* x */ + x", other), "z /* x */ + z");
        assert!(!mentions("a = b; /* its sign */", "sign"));
        assert_eq!(exchanged("x /* open x", other), "z /* open x");
        assert!(mentions("a = sign(b)", "sign") && !mentions("assign", "sign"));
    }
}
