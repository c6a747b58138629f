//! Identifiers out of names that models give.

use std::collections::HashSet;

use lynkeus_answer::visible::is_hidden;

/// Words with blanks for what is hidden.
pub(crate) fn seen(words: &str) -> String {
    words.replace(is_hidden, " ")
}

/// Identifiers that are given out, each once: letters, digits and `_`, which every language takes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    taken: HashSet<String>,
    /// numbers given out
    numbered: usize,
}

impl Names {
    /// Without those that are taken already.
    pub fn without<'a>(taken: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            taken: taken.into_iter().map(str::to_owned).collect(),
            numbered: 0,
        }
    }

    /// A letter and the next number.
    pub fn numbered(&mut self, letter: char) -> String {
        loop {
            self.numbered += 1;
            let found = format!("{letter}{}", self.numbered);
            if self.taken.insert(found.clone()) {
                return found;
            }
        }
    }

    /// An identifier that reads like the name and is nobody else's.
    pub fn identifier(&mut self, name: &str, is_reserved: impl Fn(&str) -> bool) -> String {
        let letters = name.chars().map(|c| match c {
            c if c.is_ascii_alphanumeric() => c,
            '\'' => 'p',
            _ => '_',
        });
        let mut stem: String = letters.collect();
        while stem.ends_with('_') && stem.len() > 1 {
            stem.pop();
        }
        if !stem.starts_with(|c: char| c.is_ascii_alphabetic()) {
            stem.insert(0, 'v');
        }
        let mut found = stem.clone();
        let mut number = 0;
        while is_reserved(&found) || self.taken.contains(&found) {
            number += 1;
            found = format!("{stem}_{number}");
        }
        self.taken.insert(found.clone());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_legal_and_distinct() {
        let mut names = Names::without(["x"]);
        let mut of = |name: &str| names.identifier(name, |word| word == "in");
        assert_eq!(of("level"), "level");
        assert_eq!(of("x"), "x_1");
        assert_eq!(of("in"), "in_1");
        assert_eq!(of("r1.p.v"), "r1_p_v");
        assert_eq!(of("T[3]"), "T_3");
        assert_eq!(of("T_3"), "T_3_1");
        assert_eq!(of("u'"), "up");
        assert_eq!(of("µ; import os"), "v___import_os");
        assert_eq!(of(""), "v");
        assert_eq!(of("v1"), "v1");
        assert_eq!(names.numbered('v'), "v2");
    }
}
