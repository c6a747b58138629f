//! Times as a study says that they are written: `%d.%m.%Y %H:%M:%S`.

use super::instant::{Civil, Instant, Scan};

/// What a time is written like, in the directives of `strftime`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    text: String,
    parts: Vec<Part>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// a character as it is
    Same(char),
    /// `%Y`, …
    Field(char),
}

/// Names of months, of which three letters suffice.
const MONTHS: [&str; 12] = [
    "january",
    "february",
    "march",
    "april",
    "may",
    "june",
    "july",
    "august",
    "september",
    "october",
    "november",
    "december",
];

impl Pattern {
    /// The directives that are known.
    pub const FIELDS: &'static str = "%Y %y %m %b %B %d %H %I %p %M %S %f %z %T %F %%";

    /// A pattern; none where it has a directive that is not known, or none at all.
    #[must_use]
    pub fn new(text: &str) -> Option<Self> {
        let spelled = text.replace("%T", "%H:%M:%S").replace("%F", "%Y-%m-%d");
        let mut characters = spelled.chars();
        let mut parts = vec![];
        while let Some(character) = characters.next() {
            parts.push(match character {
                '%' => match characters.next()? {
                    '%' => Part::Same('%'),
                    field if "YymbBdHIpMSfz".contains(field) => Part::Field(field),
                    _ => return None,
                },
                other => Part::Same(other),
            });
        }
        let has_field = parts.iter().any(|part| matches!(part, Part::Field(_)));
        let text = text.to_owned();
        has_field.then_some(Self { text, parts })
    }

    /// The pattern as it was given.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The time that a text says; none where it is not written so.
    #[must_use]
    pub fn instant(&self, text: &str) -> Option<Instant> {
        let mut scan = Scan::new(text);
        let mut civil = Civil::default();
        let mut is_afternoon = None;
        for part in &self.parts {
            match part {
                Part::Same(' ') => scan.blanks(),
                Part::Same(character) => scan.same(*character)?,
                Part::Field('Y') => civil.year = scan.digits(4)?,
                Part::Field('y') => {
                    let short = scan.digits(2)?;
                    // as POSIX has it
                    civil.year = short + if short < 69 { 2000 } else { 1900 };
                }
                Part::Field('m') => civil.month = scan.digits(2)?,
                Part::Field('b' | 'B') => civil.month = month(&scan.word())?,
                Part::Field('d') => civil.day = scan.digits(2)?,
                Part::Field('H' | 'I') => civil.hour = scan.digits(2)?,
                Part::Field('M') => civil.minute = scan.digits(2)?,
                Part::Field('S') => civil.second = scan.digits(2)?,
                Part::Field('f') => civil.nanoseconds = scan.fraction()?,
                Part::Field('p') => {
                    is_afternoon = Some(match scan.word().as_str() {
                        "am" => false,
                        "pm" => true,
                        _ => return None,
                    });
                }
                Part::Field(_) => civil.offset = Some(scan.offset()??),
            }
        }
        if let Some(is_afternoon) = is_afternoon {
            let hour = Some(civil.hour).filter(|hour| (1..=12).contains(hour))?;
            civil.hour = hour % 12 + if is_afternoon { 12 } else { 0 };
        }
        scan.is_empty().then(|| civil.instant())?
    }
}

/// A month by its name, or the first three letters of it.
fn month(word: &str) -> Option<i64> {
    let is_meant = |name: &&str| *name == word || name.get(..3) == Some(word);
    let place = MONTHS.iter().position(is_meant)?;
    i64::try_from(place + 1).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instant::read;

    #[test]
    fn times_are_read_as_they_are_written() {
        for (pattern, text, meant) in [
            (
                "%d.%m.%Y %H:%M:%S",
                "22.11.2026 01:02:03",
                "2026-11-22T01:02:03",
            ),
            ("%d.%m.%Y %H:%M", "2.1.2026  1:02", "2026-01-02T01:02:00"),
            (
                "%m/%d/%Y %I:%M:%S %p",
                "11/22/2026 12:02:03 AM",
                "2026-11-22T00:02:03",
            ),
            (
                "%m/%d/%Y %I:%M %p",
                "11/22/2026 1:02 pm",
                "2026-11-22T13:02:00",
            ),
            ("%Y%m%d%H%M%S", "20261122010203", "2026-11-22T01:02:03"),
            (
                "%d-%b-%y %T.%f",
                "22-Nov-26 01:02:03.25",
                "2026-11-22T01:02:03.25",
            ),
            ("%d %B %Y", "1 March 1999", "1999-03-01"),
            (
                "%F %T %z",
                "2026-11-22 01:02:03 +0100",
                "2026-11-22T01:02:03+01:00",
            ),
            (
                "%Y-%m-%dT%H:%M:%S%z",
                "2026-11-22T01:02:03Z",
                "2026-11-22T01:02:03Z",
            ),
            ("%H:%M %%", "01:02 %", "1970-01-01T01:02:00"),
        ] {
            let found = Pattern::new(pattern).unwrap().instant(text);
            assert_eq!(found, read(meant), "{pattern} {text}");
            assert!(found.is_some(), "{pattern}");
        }
    }

    #[test]
    fn other_texts_are_no_times() {
        let german = Pattern::new("%d.%m.%Y").unwrap();
        for text in [
            "22.13.2026",
            "31.4.2026",
            "22.11.2026 1",
            "22-11-2026",
            "",
            "1.1.",
        ] {
            assert_eq!(german.instant(text), None, "{text}");
        }
        let clock = Pattern::new("%I %p").unwrap();
        assert_eq!(clock.instant("13 pm"), None);
        for pattern in ["%Q", "", "time", "%"] {
            assert_eq!(Pattern::new(pattern), None, "{pattern}");
        }
    }
}
