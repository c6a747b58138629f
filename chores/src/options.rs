//! Options of a task: pairs of a key and its value.

use std::path::PathBuf;

/// One option as it was given.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    pub key: &'a str,
    pub value: &'a str,
}

/// Hands every `KEY VALUE` to `take`.
///
/// # Errors
/// A key without a value, and what `take` refuses.
pub fn read<'a>(
    arguments: &'a [String],
    mut take: impl FnMut(Pair<'a>) -> Result<(), String>,
) -> Result<(), String> {
    for pair in arguments.chunks(2) {
        match pair {
            [key, value] => take(Pair { key, value })?,
            _ => return Err(format!("{}: expected a value", pair[0])),
        }
    }
    Ok(())
}

impl Pair<'_> {
    /// # Errors
    /// No whole number from 0 on.
    pub fn number(self) -> Result<u64, String> {
        self.value.parse().map_err(|_| {
            let Self { key, value } = self;
            format!("{key}: expected a whole number, found \"{value}\"")
        })
    }

    pub fn path(self) -> PathBuf {
        PathBuf::from(self.value)
    }

    /// The refusal of a key that is none of `expected`.
    pub fn refuse<T>(self, expected: &str) -> Result<T, String> {
        Err(format!("expected {expected}, found {}", self.key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_read_and_refused_by_their_key() {
        let texts = |texts: &[&str]| texts.iter().map(|&t| t.to_owned()).collect::<Vec<_>>();
        let sum = |arguments: &[&str]| {
            let mut sum = 0;
            read(&texts(arguments), |pair| match pair.key {
                "--add" => pair.number().map(|number| sum += number),
                _ => pair.refuse("--add"),
            })
            .map(|()| sum)
        };
        assert_eq!(sum(&["--add", "2", "--add", "3"]), Ok(5));
        assert_eq!(sum(&["--add"]).unwrap_err(), "--add: expected a value");
        assert_eq!(
            sum(&["--add", "-1"]).unwrap_err(),
            "--add: expected a whole number, found \"-1\""
        );
        assert_eq!(
            sum(&["--take", "1"]).unwrap_err(),
            "expected --add, found --take"
        );
    }
}
