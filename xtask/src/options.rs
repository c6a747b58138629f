//! `--key value` pairs of a task.

/// The text after a key.
#[derive(Clone, Copy, Debug)]
pub struct Value<'a> {
    key: &'a str,
    pub text: &'a str,
}

impl Value<'_> {
    pub fn number(&self) -> Result<u64, String> {
        let Self { key, text } = self;
        let number = text.parse::<u64>();
        number.map_err(|_| format!("{key}: expected a whole number, found \"{text}\""))
    }
}

/// Hands out every pair; a key that is not among those known is refused.
pub fn read(
    arguments: &[String],
    known: &[&str],
    mut take: impl FnMut(&str, Value<'_>) -> Result<(), String>,
) -> Result<(), String> {
    for pair in arguments.chunks(2) {
        let [key, rest @ ..] = pair else { continue };
        if !known.contains(&key.as_str()) {
            return Err(format!("expected {}, found {key}", known.join(", ")));
        }
        let [text] = rest else {
            return Err(format!("{key}: expected a value"));
        };
        take(key, Value { key, text })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::read;

    fn found(arguments: &[&str]) -> Result<u64, String> {
        let arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
        let mut seed = 0;
        read(&arguments, &["--seed"], |_, value| {
            seed = value.number()?;
            Ok(())
        })?;
        Ok(seed)
    }

    #[test]
    fn pairs_are_read_and_others_named() {
        assert_eq!(found(&["--seed", "7"]), Ok(7));
        for (arguments, words) in [
            (&["--sed", "7"][..], "expected --seed, found --sed"),
            (&["--seed"], "--seed: expected a value"),
            (&["--seed", "x"], "expected a whole number, found \"x\""),
        ] {
            assert!(found(arguments).unwrap_err().contains(words));
        }
    }
}
