//! Text made safe to show: what a terminal would obey, or what would reorder a line, is spelled out.
//!
//! Names, units and cells come from files of others. A control character in one of them could
//! recolour, clear or fake what a terminal shows.

use std::borrow::Cow;

/// Control characters, line and paragraph separators, and what changes the direction of writing: a
/// reviewer would not see the code that a compiler reads.
pub fn is_hidden(c: char) -> bool {
    let reorders = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || reorders || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}')
}

/// Text for a terminal: everything but line ends and tabs that has no width of its own is
/// written as `\u{1b}`.
pub fn lines(text: &str) -> Cow<'_, str> {
    spelled(text, &['\n', '\t'], |c| {
        format!("\\u{{{:x}}}", u32::from(c))
    })
}

/// As [`lines`], where line ends and tabs are spelled out as well: a name inside a message.
pub fn line(text: &str) -> Cow<'_, str> {
    spelled(text, &[], |c| c.escape_default().to_string())
}

/// JSON text whose strings are spelled in JSON's own way. (Such characters stand nowhere else.)
pub fn json(text: &str) -> Cow<'_, str> {
    spelled(text, &['\n'], |c| format!("\\u{:04x}", u32::from(c)))
}

fn spelled<'t>(text: &'t str, kept: &[char], spell: impl Fn(char) -> String) -> Cow<'t, str> {
    let is_hidden = |c: char| is_hidden(c) && !kept.contains(&c);
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_hidden(c) {
            true => out.push_str(&spell(c)),
            false => out.push(c),
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_spelled_out() {
        let text = "a\u{1b}[31m\u{9b}2J\r\u{7f}\u{202e}\tb\nµ θ̂ 🐈";
        assert_eq!(
            lines(text),
            "a\\u{1b}[31m\\u{9b}2J\\u{d}\\u{7f}\\u{202e}\tb\nµ θ̂ 🐈"
        );
        assert_eq!(line("a\tb\nc\u{1b}"), "a\\tb\\nc\\u{1b}");
        assert!(matches!(lines("plain\ntext"), Cow::Borrowed(_)));
    }

    #[test]
    fn json_stays_the_same_value() {
        let value = serde_json::json!({ "n\u{9b}": "\u{1b}[1m\u{7f}\u{202e}\u{2028}" });
        let text = format!("{value:#}\n");
        let safe = json(&text);
        assert!(
            !safe.contains(|c: char| c != '\n' && is_hidden(c)),
            "{safe}"
        );
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&safe).unwrap(),
            value
        );
    }
}
