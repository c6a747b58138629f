//! Dates and times of RFC 3339, and its relaxations that leave no doubt.

/// A point in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instant {
    /// since 1970-01-01T00:00:00, UTC or local
    nanoseconds: i128,
    /// it says how far its clock is from UTC
    pub(super) zoned: bool,
}

/// Nanoseconds in a second.
const SECOND: i128 = 1_000_000_000;

impl Instant {
    /// So many nanoseconds after 1970-01-01T00:00:00, in UTC where it is `zoned`.
    #[must_use]
    pub fn at(nanoseconds: i128, zoned: bool) -> Self {
        Self { nanoseconds, zoned }
    }

    /// Nanoseconds since 1970-01-01T00:00:00, in UTC where it [has a zone](Self::is_zoned).
    #[must_use]
    pub fn nanoseconds(self) -> i128 {
        self.nanoseconds
    }

    /// Whether it says how far its clock is from UTC.
    #[must_use]
    pub fn is_zoned(self) -> bool {
        self.zoned
    }

    /// What a text says: RFC 3339, or a relaxation of it that leaves no doubt.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        read(text)
    }

    /// So many seconds after this one, to the nanosecond.
    pub(super) fn later(self, seconds: f64) -> Self {
        let whole = seconds.floor();
        let part = ((seconds - whole) * SECOND as f64).round();
        Self {
            nanoseconds: self.nanoseconds + whole as i128 * SECOND + part as i128,
            ..self
        }
    }

    /// From `origin` to here in seconds, rounded once where that is less than 104 days.
    #[must_use]
    pub fn seconds_since(self, origin: Self) -> f64 {
        seconds(self.nanoseconds - origin.nanoseconds)
    }
}

/// Nanoseconds in seconds, rounded once where they are less than 104 days.
pub(super) fn seconds(nanoseconds: i128) -> f64 {
    match i64::try_from(nanoseconds) {
        Ok(short) if short.unsigned_abs() < 1 << 53 => return short as f64 / SECOND as f64,
        _ => {}
    }
    let part = nanoseconds.rem_euclid(SECOND) as f64 / SECOND as f64;
    nanoseconds.div_euclid(SECOND) as f64 + part
}

/// As RFC 3339 has it.
impl std::fmt::Display for Instant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let seconds = self.nanoseconds.div_euclid(SECOND);
        let (mut year, mut day) = (1970, seconds.div_euclid(86_400));
        // whole cycles of the calendar, then years, then months
        year += 400 * day.div_euclid(146_097);
        day = day.rem_euclid(146_097);
        let length = |year: i64| 337 + i128::from(days(year, 2));
        let mut year = i64::try_from(year).unwrap_or(0);
        while day >= length(year) {
            day -= length(year);
            year += 1;
        }
        let mut month = 1;
        while day >= i128::from(days(year, month)) {
            day -= i128::from(days(year, month));
            month += 1;
        }
        let of_day = seconds.rem_euclid(86_400);
        let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
        write!(
            f,
            "{year:04}-{month:02}-{:02}T{hour:02}:{minute:02}:{second:02}",
            day + 1
        )?;
        let fraction = self.nanoseconds.rem_euclid(SECOND);
        if fraction > 0 {
            let digits = format!("{fraction:09}");
            write!(f, ".{}", digits.trim_end_matches('0'))?;
        }
        f.write_str(if self.zoned { "Z" } else { "" })
    }
}

/// `2026-11-22`, `2026-11-22T01:02:03.456+01:00`; a blank in the place of T, a comma before the
/// fraction, and no seconds or no zone are understood.
pub(super) fn read(text: &str) -> Option<Instant> {
    let mut scan = Scan {
        bytes: text.as_bytes(),
    };
    let year = scan.number(4, 0..=9999)?;
    scan.one_of(b"-")?;
    let month = scan.number(2, 1..=12)?;
    scan.one_of(b"-")?;
    let day = scan.number(2, 1..=days(year, month))?;
    let date = i128::from(days_since_1970(year, month, day)) * 86_400 * SECOND;
    if scan.bytes.is_empty() {
        let zoned = false;
        return Some(Instant {
            nanoseconds: date,
            zoned,
        });
    }
    scan.one_of(b"Tt ")?;
    let time = scan.clock()?;
    let offset = scan.offset()?;
    scan.bytes.is_empty().then_some(Instant {
        nanoseconds: date + time - offset.unwrap_or(0),
        zoned: offset.is_some(),
    })
}

/// A point in time by calendar and clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Civil {
    pub year: i64,
    pub month: i64,
    pub day: i64,
    pub hour: i64,
    pub minute: i64,
    /// 60 is a leap second
    pub second: i64,
    pub nanoseconds: i128,
    /// nanoseconds by which the clock is ahead of UTC, where that is said
    pub offset: Option<i128>,
}

/// The beginning of 1970.
impl Default for Civil {
    fn default() -> Self {
        Self {
            year: 1970,
            month: 1,
            day: 1,
            hour: 0,
            minute: 0,
            second: 0,
            nanoseconds: 0,
            offset: None,
        }
    }
}

impl Civil {
    /// None where there is no such day or time of day.
    pub(super) fn instant(self) -> Option<Instant> {
        let is_there = (0..=9999).contains(&self.year)
            && (1..=12).contains(&self.month)
            && (1..=days(self.year, self.month)).contains(&self.day)
            && (0..=23).contains(&self.hour)
            && (0..=59).contains(&self.minute)
            && (0..=60).contains(&self.second);
        let day = is_there.then(|| days_since_1970(self.year, self.month, self.day))?;
        let clock = (self.hour * 60 + self.minute) * 60 + self.second;
        let seconds = i128::from(day) * 86_400 + i128::from(clock);
        Some(Instant {
            nanoseconds: seconds * SECOND + self.nanoseconds - self.offset.unwrap_or(0),
            zoned: self.offset.is_some(),
        })
    }
}

/// What is left of a text.
pub(super) struct Scan<'a> {
    bytes: &'a [u8],
}

impl<'a> Scan<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        let bytes = text.as_bytes();
        Self { bytes }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Passes over blanks.
    pub(super) fn blanks(&mut self) {
        self.bytes = self.bytes.trim_ascii_start();
    }

    /// Passes over a character.
    pub(super) fn same(&mut self, character: char) -> Option<()> {
        let mut room = [0; 4];
        let wanted = character.encode_utf8(&mut room).as_bytes();
        self.bytes = self.bytes.strip_prefix(wanted)?;
        Some(())
    }

    /// A number of at most so many digits.
    pub(super) fn digits(&mut self, most: usize) -> Option<i64> {
        let digits = self.bytes.iter().take(most);
        let count = digits.take_while(|b| b.is_ascii_digit()).count();
        if count == 0 {
            return None;
        }
        self.number(count, 0..=i64::MAX)
    }

    /// Letters, in lower case.
    pub(super) fn word(&mut self) -> String {
        let letters = self.bytes.iter().take_while(|b| b.is_ascii_alphabetic());
        let (word, rest) = self.bytes.split_at(letters.count());
        self.bytes = rest;
        String::from_utf8_lossy(word).to_lowercase()
    }

    fn one_of(&mut self, set: &[u8]) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        set.contains(first).then(|| self.bytes = rest)?;
        Some(*first)
    }

    /// A number of so many digits.
    fn number(&mut self, digits: usize, within: std::ops::RangeInclusive<i64>) -> Option<i64> {
        let (text, rest) = self.bytes.split_at_checked(digits)?;
        let digit = |b: &u8| b.is_ascii_digit().then(|| i64::from(b - b'0'));
        let number = text.iter().try_fold(0, |n, b| Some(10 * n + digit(b)?))?;
        self.bytes = rest;
        within.contains(&number).then_some(number)
    }

    /// Nanoseconds since midnight.
    fn clock(&mut self) -> Option<i128> {
        let hour = self.number(2, 0..=23)?;
        self.one_of(b":")?;
        let minute = self.number(2, 0..=59)?;
        // 60 is a leap second
        let second = match self.one_of(b":") {
            Some(_) => self.number(2, 0..=60)?,
            None => 0,
        };
        let fraction = match self.one_of(b".,") {
            Some(_) => self.fraction()?,
            None => 0,
        };
        Some(i128::from((hour * 60 + minute) * 60 + second) * SECOND + fraction)
    }

    /// Digits after the second, as nanoseconds; what is finer is dropped.
    pub(super) fn fraction(&mut self) -> Option<i128> {
        let (mut value, mut unit, mut digits) = (0, SECOND, 0);
        while let Some(digit) = self.one_of(b"0123456789") {
            unit /= 10;
            value += unit * i128::from(digit - b'0');
            digits += 1;
        }
        (digits > 0).then_some(value)
    }

    /// Nanoseconds by which the clock is ahead of UTC; an inner none where that is not said.
    pub(super) fn offset(&mut self) -> Option<Option<i128>> {
        if self.bytes.is_empty() {
            return Some(None);
        }
        let sign = match self.one_of(b"Zz+-")? {
            b'+' => 1,
            b'-' => -1,
            _ => return Some(Some(0)),
        };
        let hours = self.number(2, 0..=23)?;
        let _ = self.one_of(b":");
        let minutes = self.number(2, 0..=59)?;
        Some(Some(
            i128::from(sign * (hours * 60 + minutes) * 60) * SECOND,
        ))
    }
}

fn days(year: i64, month: i64) -> i64 {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    match month {
        2 => 28 + i64::from(leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days of the Gregorian calendar (Howard Hinnant, `days_from_civil`).
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    // years that start in March, so that the leap day is their last
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let of_era = year.rem_euclid(400);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    fn since_1970(text: &str) -> f64 {
        let origin = Instant {
            nanoseconds: 0,
            zoned: false,
        };
        read(text).unwrap().seconds_since(origin)
    }

    #[test]
    fn epochs_of_known_times() {
        // GNU date -d … +%s
        assert_eq!(since_1970("1970-01-01"), 0.0);
        assert_eq!(since_1970("2000-02-29T12:00:00Z"), 951_825_600.0);
        assert_eq!(since_1970("2026-11-22T01:02:03.25+01:00"), 1_795_305_723.25);
        assert_eq!(since_1970("1969-12-31 23:59:59.5Z"), -0.5);
        assert_eq!(since_1970("2016-12-31T23:59:60Z"), since_1970("2017-01-01"));
        assert_eq!(
            since_1970("2026-11-22 01:02"),
            since_1970("2026-11-22t01:02:00z")
        );
        assert_eq!(
            since_1970("2026-11-22T01:02:03,5-0330"),
            since_1970("2026-11-22T04:32:03.5Z")
        );
    }

    #[test]
    fn nanoseconds_are_kept() {
        let at = |text| read(text).unwrap();
        let (a, b) = (
            at("2026-11-22T00:00:00.000000001Z"),
            at("2026-11-22T00:00:00Z"),
        );
        assert_eq!(a.seconds_since(b), 1e-9);
        assert!(a.zoned && !at("2026-11-22").zoned);
    }

    #[test]
    fn what_is_shown_is_read() {
        let nanoseconds = (-1000..1000).map(|i: i128| i * 86_399_999_999_999 * 37 + 5);
        for instant in nanoseconds.map(|n| Instant::at(n, true)) {
            assert_eq!(read(&instant.to_string()), Some(instant), "{instant}");
        }
        assert_eq!(
            Instant::at(951_825_600 * SECOND, false).to_string(),
            "2000-02-29T12:00:00"
        );
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "2026-13-01",
            "2026-02-29",
            "2026-11-22T24:00:00Z",
            "2026-11-22T01:02:03.Z",
            "26-11-22",
            "2026-11-22T01:02:03+1",
            "2026-11-22x",
            "22.11.2026",
            "2026-11-22 ",
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
