//! Mutations that know what a text is made of: numbers, names, lines, brackets.

use std::ops::Range;

use crate::numbers::Numbers;

/// Numbers on which programs fail.
const ODD: &[&str] = &[
    "0",
    "-1",
    "1",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-320",
    "1e400",
    "nan",
    "inf",
    "-inf",
    "65536",
    "2147483648",
    "9223372036854775807",
    "18446744073709551616",
    "1e15",
    "1e-15",
    "0.1",
    "1e5",
    "0x10",
    "1_000",
    "3.",
    ".5",
    "1e",
    "999,5",
];

/// Names that mean something to the tool or to a language.
const NAMES: &[&str] = &[
    "t",
    "time",
    "der",
    "x1",
    "y",
    "y_measured",
    "x1_hat",
    "lower_hat",
    "rcond",
    "excitation",
    "end",
    "if",
    "'a b'",
    "'\u{1b}[31m'",
    "\u{3b8}",
    "sin",
    "default",
    "theta",
    "S",
    "x[1]",
    "x[99999999]",
];

/// Functions and operations put around a number or a name.
const AROUND: &[(&str, &str)] = &[
    ("sqrt(", ")"),
    ("log(", ")"),
    ("tan(", ")"),
    ("1/(", ")"),
    ("exp(exp(", "))"),
    ("abs(", ")"),
    ("sign(", ")"),
    ("floor(1e9*", ")"),
    ("mod(", ", 0)"),
    ("(", ")^0.5"),
    ("(", ")^(-3)"),
    ("if time > 1 then ", " else 0"),
    ("asin(", ")"),
    ("-", ""),
    ("der(", ")"),
    ("\"", "\""),
    ("[", "]"),
    ("{ a = ", " }"),
];

/// Bytes that texts should not have, and line ends.
const STRANGE: &[&[u8]] = &[
    b"\0",
    b"\x1b[2J",
    b"\xff",
    b"\r",
    b"\r\n",
    b"\xef\xbb\xbf",
    b"\xc2\x9b",
    b"\"",
    b"'",
    b"\\",
    b"\n\n",
    b"\t",
    b",",
    b";",
    b"#",
    b"//",
    b"/*",
    b"[",
    b"(",
    b"{",
    b"=",
    b"\xe2\x80\xae",
];

/// The text with one mutation; `donor` is another text.
pub fn mutated(numbers: &mut Numbers, bytes: &[u8], donor: &[u8]) -> Vec<u8> {
    let pieces = pieces(bytes);
    match numbers.below(14) {
        0..=3 => replace(numbers, bytes, &pieces, b"0123456789", ODD),
        4 | 5 => replace(
            numbers,
            bytes,
            &pieces,
            b"abcdefghijklmnopqrstuvwxyz_",
            NAMES,
        ),
        6 | 7 => around(numbers, bytes, &pieces),
        8 => swapped(numbers, bytes, &pieces),
        9 | 10 => lines(numbers, bytes, donor),
        11 => insert(numbers, bytes, strange),
        12 => insert(numbers, bytes, deep),
        _ => cut(numbers, bytes),
    }
}

/// Words and numbers, as runs of their characters.
fn pieces(bytes: &[u8]) -> Vec<Range<usize>> {
    let is_word = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.');
    let mut pieces = vec![];
    let mut start = None;
    for (i, &byte) in bytes.iter().chain(b" ").enumerate() {
        match (is_word(byte), start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                pieces.push(from..i);
                start = None;
            }
            _ => {}
        }
    }
    pieces
}

fn spliced(bytes: &[u8], range: &Range<usize>, by: &[u8]) -> Vec<u8> {
    [&bytes[..range.start], by, &bytes[range.end..]].concat()
}

/// A piece that begins with one of `first` becomes one of `words`.
fn replace(
    numbers: &mut Numbers,
    bytes: &[u8],
    pieces: &[Range<usize>],
    first: &[u8],
    words: &[&str],
) -> Vec<u8> {
    let fits = |range: &&Range<usize>| first.contains(&bytes[range.start]);
    let fitting: Vec<&Range<usize>> = pieces.iter().filter(fits).collect();
    if fitting.is_empty() {
        return bytes.to_vec();
    }
    let range = *numbers.of(&fitting);
    let word = numbers.of(words).as_bytes();
    spliced(bytes, range, word)
}

fn around(numbers: &mut Numbers, bytes: &[u8], pieces: &[Range<usize>]) -> Vec<u8> {
    if pieces.is_empty() {
        return bytes.to_vec();
    }
    let range = numbers.of(pieces).clone();
    let (before, after) = *numbers.of(AROUND);
    let by = [before.as_bytes(), &bytes[range.clone()], after.as_bytes()].concat();
    spliced(bytes, &range, &by)
}

/// Two pieces change places.
fn swapped(numbers: &mut Numbers, bytes: &[u8], pieces: &[Range<usize>]) -> Vec<u8> {
    if pieces.len() < 2 {
        return bytes.to_vec();
    }
    let (i, j) = (numbers.below(pieces.len()), numbers.below(pieces.len()));
    let (a, b) = (&pieces[i.min(j)], &pieces[i.max(j)]);
    if a == b {
        return bytes.to_vec();
    }
    [
        &bytes[..a.start],
        &bytes[b.clone()],
        &bytes[a.end..b.start],
        &bytes[a.clone()],
        &bytes[b.end..],
    ]
    .concat()
}

/// A line is dropped, doubled, moved, or comes from another text.
fn lines(numbers: &mut Numbers, bytes: &[u8], donor: &[u8]) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = bytes.split_inclusive(|b| *b == b'\n').collect();
    let others: Vec<&[u8]> = donor.split_inclusive(|b| *b == b'\n').collect();
    if lines.is_empty() {
        return bytes.to_vec();
    }
    let (i, j) = (numbers.below(lines.len()), numbers.below(lines.len()));
    match numbers.below(4) {
        0 => drop(lines.remove(i)),
        1 => lines.insert(j, lines[i]),
        2 => lines.swap(i, j),
        _ if others.is_empty() => {}
        _ => lines.insert(i, others[numbers.below(others.len())]),
    }
    lines.concat()
}

fn insert(numbers: &mut Numbers, bytes: &[u8], what: fn(&mut Numbers) -> Vec<u8>) -> Vec<u8> {
    let at = numbers.below(bytes.len() + 1);
    let by = what(numbers);
    spliced(bytes, &(at..at), &by)
}

fn strange(numbers: &mut Numbers) -> Vec<u8> {
    numbers.of(STRANGE).to_vec()
}

/// Brackets within brackets.
fn deep(numbers: &mut Numbers) -> Vec<u8> {
    let depth = numbers.size(2.0, 20_000.0) as usize;
    let open = *numbers.of(&["(", "[", "{", "-", "sin(", "a."]);
    open.repeat(depth).into_bytes()
}

/// A stretch is taken out, or the end.
fn cut(numbers: &mut Numbers, bytes: &[u8]) -> Vec<u8> {
    let start = numbers.below(bytes.len() + 1);
    let end = match numbers.chance(0.3) {
        true => bytes.len(),
        false => bytes.len().min(start + 1 + numbers.below(40)),
    };
    spliced(bytes, &(start..end), b"")
}
