//! What `push` says, and what becomes of a reading: the words of the draft for it, each with what it
//! means. Every language has the same numbers.

use super::device::Device;

/// What `push` of every device can say, from 1 on.
const CODES: [(&str, &str); 5] = [
    (
        "TIME",
        "the time is no number, or before that of the last sample",
    ),
    ("INPUT", "the first value of an input is no number"),
    (
        "INTERVAL",
        "the interval is too short, or takes more than a million steps",
    ),
    ("DIVERGED", "an estimate has run away"),
    ("NOT_FINITE", "the equations have no value there"),
];

/// What it says of numbers that may be changed, after the other codes.
const TUNING: (&str, &str) = (
    "TUNING",
    "a number that may be changed is not finite and above 0",
);

/// So many samples in a row that are refused because the equations have no value, or an estimate has run
/// away, are behind an absurd reading that was taken: from the next on it starts anew.
pub(super) const PATIENCE: usize = 5;

/// What `push` of a device can say, from 1 on.
pub(super) fn codes(device: &Device<'_>) -> impl Iterator<Item = (&'static str, &'static str)> {
    codes_of(!device.tunables.is_empty())
}

fn codes_of(is_tunable: bool) -> impl Iterator<Item = (&'static str, &'static str)> {
    CODES.into_iter().chain(is_tunable.then_some(TUNING))
}

/// What can become of a reading of a filter, from 0 on.
pub(super) const READINGS: [(&str, &str); 4] = [
    ("MISSING", "the sensor did not report"),
    ("TAKEN", "it corrected the estimate"),
    ("REJECTED", "the gate kept it out"),
    (
        "AT_LIMIT",
        "at an end of the sensor's range, beyond which the estimate is anyway",
    ),
];

/// What a verdict of 1, or true, says.
pub(super) const CREDIBLE: &str =
    "the last sample had an estimate, and the latest readings of no sensor contradict it";

/// The number of a word of the draft, where it is one of these.
pub(super) fn number(word: &str) -> Option<usize> {
    let is_it = |own: &(&str, &str)| own.0 == word;
    let code = codes_of(true)
        .position(|own| is_it(&own))
        .map(|place| place + 1);
    code.or_else(|| READINGS.iter().position(is_it))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_has_one_number() {
        let words = codes_of(true).chain(READINGS);
        let words: Vec<&str> = words.map(|word| word.0).collect();
        for (place, word) in words.iter().enumerate() {
            assert!(!words[..place].contains(word), "{word}");
        }
        let of = |words: &[&str]| words.iter().map(|w| number(w)).collect::<Vec<_>>();
        assert_eq!(
            of(&["TIME", "TUNING", "MISSING", "AT_LIMIT", "STATE"]),
            [Some(1), Some(6), Some(0), Some(3), None]
        );
    }
}
