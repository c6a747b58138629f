//! What an estimator for another machine is, and what it says of samples and readings. Every language has the same numbers for that.

use lynkeus_run::{Blueprint, Level};

/// An estimator and what its text says of it.
#[derive(Clone, Copy, Debug)]
pub struct Device<'a> {
    /// its name in files and functions
    pub name: &'a str,
    /// the estimator
    pub blueprint: &'a Blueprint,
    /// states that start at the first reading of a sensor, where it reports at the first sample
    pub first_readings: &'a [FirstReading],
    /// measured outputs, then known inputs, in the order in which they are given
    pub signals: &'a [Entry],
    /// what is reported: estimates, their standard deviations where there are any, monitors
    pub estimates: &'a [Entry],
    /// how many of them are monitors
    pub monitors: usize,
    /// whether a filter's standard deviations are reported
    pub deviations: bool,
    /// states that are told in one turn: their places, and where it begins
    pub turns: &'a [(usize, f64)],
    /// numbers that may be changed while it runs: those of a sampled observer's
    /// [`tuned`](lynkeus_run::Updates::Jumps), in its order; of a filter none, or a factor on
    /// its process noise
    pub tunables: &'a [Tunable],
    /// of each measured output the noise that is declared, by which an observer that is no filter is
    /// judged; a filter has its own
    pub noises: &'a [Option<Level>],
    /// units and meanings of the model's names, where there are any
    pub words: &'a [Entry],
    /// how much later than its sample is taken a reading comes, by sensor; none where no sensor is late
    pub delays: &'a [f64],
    /// lines for people: the study, the design, the certificate
    pub about: &'a [String],
}

/// An entry of a vector.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    /// what the model calls it
    pub name: String,
    /// its unit and what it is, in words
    pub about: String,
}

impl Entry {
    /// Without words.
    pub fn named(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            about: String::new(),
        }
    }
}

/// A number that may be changed while the estimator runs. It is finite and above 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Tunable {
    /// what it is called, and what it does
    pub entry: Entry,
    /// its value until it is changed
    pub start: f64,
}

/// A state that starts where a sensor's first reading says: (reading − offset)/slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstReading {
    /// place of the sensor among the measured outputs
    pub sensor: usize,
    /// place of the state
    pub state: usize,
    /// how the output depends on the state
    pub slope: f64,
    /// the output where the state is 0
    pub offset: f64,
}

impl Device<'_> {
    /// Number of measured outputs.
    pub(super) fn sensors(&self) -> usize {
        self.blueprint.sensors.len()
    }
}

/// A reason of `push`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reason {
    pub word: &'static str,
    pub number: usize,
    pub about: &'static str,
}

/// What `push` can say; a number is taken once, whatever a device has.
const CODES: [Reason; 8] = [
    Reason {
        word: "TIME",
        number: 1,
        about: "the time is no number, or before that of the last sample",
    },
    Reason {
        word: "INPUT",
        number: 2,
        about: "the first value of an input is no number",
    },
    Reason {
        word: "INTERVAL",
        number: 3,
        about: "the interval is too short, or takes more than a million steps",
    },
    Reason {
        word: "DIVERGED",
        number: 4,
        about: "an estimate has run away",
    },
    Reason {
        word: "NOT_FINITE",
        number: 5,
        about: "the equations have no value there",
    },
    Reason {
        word: "TUNING",
        number: 6,
        about: "a number that may be changed is not finite and above 0",
    },
    Reason {
        word: "ROOM",
        number: 7,
        about: "the rows that are kept end after a late sample: raise ROWS",
    },
    Reason {
        word: "EVENTS",
        number: 8,
        about: "events follow each other without end, or one is touched and not crossed",
    },
];

/// So many samples in a row that are refused because the equations have no value, or an estimate has run
/// away, are behind an absurd reading that was taken: from the next on it starts anew.
pub(super) const PATIENCE: usize = 5;

/// What `push` of a device can say.
pub(super) fn codes(device: &Device<'_>) -> impl Iterator<Item = Reason> {
    let is_tunable = !device.tunables.is_empty();
    let is_late = !device.delays.is_empty();
    let has_events = device.blueprint.flow.has_clauses();
    CODES.into_iter().filter(move |reason| match reason.word {
        "TUNING" => is_tunable,
        "ROOM" => is_late,
        "EVENTS" => has_events,
        _ => true,
    })
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
pub(super) fn number_of(word: &str) -> Option<usize> {
    let code = CODES.iter().find(|own| own.word == word);
    let reading = READINGS.iter().position(|own| own.0 == word);
    code.map(|own| own.number).or(reading)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_has_one_number() {
        let codes = CODES.iter().map(|reason| reason.word);
        let words: Vec<&str> = codes.chain(READINGS.map(|word| word.0)).collect();
        for (place, word) in words.iter().enumerate() {
            assert!(!words[..place].contains(word), "{word}");
        }
        let of = |words: &[&str]| words.iter().map(|w| number_of(w)).collect::<Vec<_>>();
        assert_eq!(
            of(&["TIME", "TUNING", "EVENTS", "MISSING", "AT_LIMIT", "STATE"]),
            [Some(1), Some(6), Some(8), Some(0), Some(3), None]
        );
    }
}
