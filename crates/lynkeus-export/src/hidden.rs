//! Characters that nobody sees where they stand.

/// Control characters, line and paragraph separators, and what changes the direction of writing: a
/// reviewer would not see the code that a compiler reads.
pub fn is_hidden(c: char) -> bool {
    let reorders = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || reorders || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}')
}

/// Words with blanks for what is hidden.
pub(crate) fn seen(words: &str) -> String {
    words.replace(is_hidden, " ")
}
