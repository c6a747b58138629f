//! What one cell of a log says.

use super::instant::{self, Instant};
use super::number::POWERS;
use super::{Decimal, Pattern};

/// What a cell says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// a number, whatever the marks of its column
    Number(f64),
    /// a number whose reading depends on what point and comma mean, with the value if they mean
    /// what `Mark` says
    Marked(f64, Mark),
    /// a date, or a date and a time
    Instant(Instant),
    /// nothing, NaN, an infinity, a word
    Missing,
    /// begins like a number and is none
    Garbled,
}

/// What a cell tells about point and comma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// `0.5`: a decimal point for certain
    Point,
    /// `1.234`: a decimal point, or points that group thousands
    ShortPoint,
    /// `0,5`, `1.234,5`: a decimal comma for certain
    Comma,
    /// `1,234`: a decimal comma, or commas that group thousands; the value is 1234
    ShortComma,
    /// `1,234.5`, `1,234,567`: commas that group thousands for certain
    GroupingComma,
    /// `1.234.567`: points that group thousands for certain
    GroupingPoint,
}

/// Reads a trimmed cell.
pub(super) fn read(text: &str) -> Cell {
    plain(text.as_bytes()).unwrap_or_else(|| other_than_plain(text))
}

/// Reads a trimmed cell whose decimal mark is known.
pub(super) fn read_by(text: &str, decimal: Decimal) -> Cell {
    let (mark, grouping) = match decimal {
        Decimal::Point => ('.', ','),
        Decimal::Comma => (',', '.'),
    };
    let (whole, fraction) = match text.split_once(mark) {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (text, None),
    };
    let unsigned = whole.strip_prefix(['+', '-']).unwrap_or(whole);
    let whole = match whole.contains(grouping) && are_groups(unsigned, grouping) {
        true => whole.replace(grouping, ""),
        false => whole.to_owned(),
    };
    let is_plain = |part: &str| !part.contains([mark, grouping]);
    if is_plain(&whole) && fraction.is_none_or(is_plain) {
        let number = match fraction {
            Some(fraction) => format!("{whole}.{fraction}"),
            None => whole,
        };
        match number.parse::<f64>() {
            Ok(value) if value.is_finite() => return Cell::Number(value),
            Ok(_) => return Cell::Missing,
            Err(_) => {}
        }
    }
    match read(text) {
        Cell::Number(_) | Cell::Marked(..) => Cell::Garbled,
        other => other,
    }
}

/// Reads a trimmed cell that holds a time of this pattern.
pub(super) fn of_pattern(text: &str, pattern: &Pattern) -> Cell {
    match (pattern.instant(text), read(text)) {
        (Some(instant), _) => Cell::Instant(instant),
        (None, Cell::Missing) => Cell::Missing,
        (None, _) => Cell::Garbled,
    }
}

/// Digits of a cell that is read at once: as a whole number they are exact.
const FEW: usize = 15;

/// A cell of few digits, with a point perhaps: most are.
fn plain(text: &[u8]) -> Option<Cell> {
    let digits = text.strip_prefix(b"-").unwrap_or(text);
    if digits.len() > FEW + 1 {
        return None;
    }
    let (mut whole, mut point) = (0, None);
    for (place, byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => whole = 10 * whole + u64::from(byte - b'0'),
            b'.' if point.is_none() => point = Some(place),
            _ => return None,
        }
    }
    let count = digits.len() - usize::from(point.is_some());
    if !(1..=FEW).contains(&count) {
        return None;
    }
    let decimals = count - point.unwrap_or(count);
    // of two exact numbers, so the nearest to the decimal number
    let value = whole as f64 / POWERS[decimals];
    let value = if digits.len() < text.len() {
        -value
    } else {
        value
    };
    Some(match point {
        None => Cell::Number(value),
        Some(1..=3) if decimals == 3 && digits[0] != b'0' => Cell::Marked(value, Mark::ShortPoint),
        Some(_) => Cell::Marked(value, Mark::Point),
    })
}

fn other_than_plain(text: &str) -> Cell {
    match text.parse::<f64>() {
        Ok(value) if !value.is_finite() => Cell::Missing,
        Ok(value) => match text.find('.') {
            None => Cell::Number(value),
            Some(_) if is_short(text, '.') => Cell::Marked(value, Mark::ShortPoint),
            Some(_) => Cell::Marked(value, Mark::Point),
        },
        Err(_) => other(text),
    }
}

fn other(text: &str) -> Cell {
    let unsigned = text.trim_start_matches(['+', '-']);
    // a mark that stands first counts only before a digit: "-", "…" and ".." are words
    let digits = unsigned.trim_start_matches(['.', ',']);
    if !digits.starts_with(|c: char| c.is_ascii_digit()) {
        return Cell::Missing;
    }
    if let Some(instant) = instant::read(text) {
        return Cell::Instant(instant);
    }
    match grouped(text) {
        Some((value, mark)) if value.is_finite() => Cell::Marked(value, mark),
        _ => Cell::Garbled,
    }
}

/// One to three digits that do not start with 0, the mark, three digits: `1,234`.
fn is_short(text: &str, mark: char) -> bool {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let Some((whole, rest)) = unsigned.split_once(mark) else {
        return false;
    };
    !whole.starts_with('0') && is_group(whole, 1) && is_group(rest, 3)
}

/// At least `least` and at most three digits.
fn is_group(text: &str, least: usize) -> bool {
    (least..=3).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit())
}

/// Digits in groups of three between marks, the first group shorter perhaps.
fn are_groups(text: &str, mark: char) -> bool {
    let mut groups = text.split(mark);
    let first = groups.next().is_some_and(|g| is_group(g, 1));
    first && groups.all(|g| is_group(g, 3))
}

/// A number with a comma, or with several points.
fn grouped(text: &str) -> Option<(f64, Mark)> {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let (comma, point) = (unsigned.rfind(','), unsigned.rfind('.'));
    let without = |mark: char| text.replace(mark, "").parse::<f64>().ok();
    let decimal = |text: &str| text.replacen(',', ".", 1).parse::<f64>().ok();
    match (comma, point) {
        (Some(_), None) if unsigned.matches(',').count() > 1 => {
            are_groups(unsigned, ',').then(|| Some((without(',')?, Mark::GroupingComma)))?
        }
        (Some(_), None) if is_short(text, ',') => Some((without(',')?, Mark::ShortComma)),
        (Some(_), None) => Some((decimal(text)?, Mark::Comma)),
        // 1,234.5
        (Some(comma), Some(point)) if comma < point => are_groups(unsigned.get(..point)?, ',')
            .then(|| Some((without(',')?, Mark::GroupingComma)))?,
        // 1.234,5
        (Some(comma), Some(_)) => are_groups(unsigned.get(..comma)?, '.')
            .then(|| Some((decimal(&text.replace('.', ""))?, Mark::Comma)))?,
        (None, Some(_)) => {
            are_groups(unsigned, '.').then(|| Some((without('.')?, Mark::GroupingPoint)))?
        }
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn plain_cells_say_what_others_say(text in "[-+]?[0-9]{0,9}[.,]?[0-9]{0,9}") {
            prop_assert_eq!(read(&text), other_than_plain(&text));
            let told = |cell: Cell| match cell {
                Cell::Number(x) | Cell::Marked(x, _) => x.to_bits(),
                _ => 0,
            };
            prop_assert_eq!(told(read(&text)), told(other_than_plain(&text)));
        }
    }

    #[test]
    fn numbers_tell_their_marks() {
        let marked = [
            ("0.5", 0.5, Mark::Point),
            ("-12.25", -12.25, Mark::Point),
            ("0.125", 0.125, Mark::Point),
            ("1.125e3", 1125.0, Mark::Point),
            ("1.125", 1.125, Mark::ShortPoint),
            ("0,5", 0.5, Mark::Comma),
            ("-0,021", -0.021, Mark::Comma),
            ("1234,567", 1234.567, Mark::Comma),
            ("1,5e-3", 0.0015, Mark::Comma),
            (",5", 0.5, Mark::Comma),
            ("1.234,5", 1234.5, Mark::Comma),
            ("1,000", 1000.0, Mark::ShortComma),
            ("-12,345", -12345.0, Mark::ShortComma),
            ("1,234,567", 1_234_567.0, Mark::GroupingComma),
            ("1,234.5", 1234.5, Mark::GroupingComma),
            ("1.234.567", 1_234_567.0, Mark::GroupingPoint),
        ];
        for (text, value, mark) in marked {
            assert_eq!(read(text), Cell::Marked(value, mark), "{text}");
        }
        assert_eq!(read("-1e3"), Cell::Number(-1000.0));
        assert_eq!(read("1700000000001"), Cell::Number(1_700_000_000_001.0));
    }

    #[test]
    fn a_known_mark_leaves_nothing_open() {
        for (text, by_point, by_comma) in [
            ("1,234", Cell::Number(1234.0), Cell::Number(1.234)),
            ("1.234", Cell::Number(1.234), Cell::Number(1234.0)),
            ("-1,234.5", Cell::Number(-1234.5), Cell::Garbled),
            ("1.234.567,5", Cell::Garbled, Cell::Number(1_234_567.5)),
            ("2,5e-3", Cell::Garbled, Cell::Number(0.0025)),
            ("2.5", Cell::Number(2.5), Cell::Garbled),
            ("1,2,3", Cell::Garbled, Cell::Garbled),
            ("17", Cell::Number(17.0), Cell::Number(17.0)),
            ("NA", Cell::Missing, Cell::Missing),
            ("", Cell::Missing, Cell::Missing),
        ] {
            assert_eq!(read_by(text, Decimal::Point), by_point, "{text}");
            assert_eq!(read_by(text, Decimal::Comma), by_comma, "{text}");
        }
    }

    #[test]
    fn words_are_missing_and_broken_numbers_are_garbled() {
        for text in [
            "", "NaN", "inf", "-inf", "NA", "n/a", "null", "-", "--", "..", "#DIV/0!", "1e400",
        ] {
            assert_eq!(read(text), Cell::Missing, "{text}");
        }
        for text in [
            "12 V",
            "5%",
            "1.2.3",
            "1,23,4",
            "1 000",
            "22.11.2026",
            "1.2,3,4",
            "0x10",
        ] {
            assert_eq!(read(text), Cell::Garbled, "{text}");
        }
    }
}
