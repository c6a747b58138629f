//! Lines of a file, one by one, split into cells.

use std::borrow::Cow;
use std::io::{self, BufRead};
use std::str::Utf8Error;

/// Most bytes of a row.
const LONGEST: usize = 4 << 20;

/// The rows of a delimited text; a row is a line, or several where a quoted cell has line ends.
pub(super) struct Rows<R> {
    input: R,
    bytes: Vec<u8>,
    cells: Vec<Cell>,
    /// lines read
    lines: u64,
    /// the line on which the present row starts
    start: u64,
    after_return: bool,
}

/// The place of a cell in its row, blanks and quotes left out.
#[derive(Clone, Copy, Debug)]
struct Cell {
    from: usize,
    to: usize,
    /// it holds doubled quotes
    doubled: bool,
}

/// Why a row could not be read.
#[derive(Debug)]
pub(super) enum Broken {
    Io(io::Error),
    /// it is longer than [`LONGEST`]
    Long,
    /// it holds bytes that no text has
    Binary,
}

impl<R: BufRead> Rows<R> {
    pub(super) fn new(input: R) -> Self {
        Self {
            input,
            bytes: Vec::new(),
            cells: Vec::new(),
            lines: 0,
            start: 0,
            after_return: false,
        }
    }

    /// Passes over lines, as far as there are so many.
    pub(super) fn skip(&mut self, lines: u64) -> Result<(), Broken> {
        for _ in 0..lines {
            self.bytes.clear();
            if !self.line()? {
                break;
            }
        }
        Ok(())
    }

    /// Goes to the next row that is not blank; false at the end.
    pub(super) fn next(&mut self) -> Result<bool, Broken> {
        loop {
            self.bytes.clear();
            self.start = self.lines + 1;
            if !self.line()? {
                return Ok(false);
            }
            if self.start == 1 && self.bytes.starts_with(b"\xef\xbb\xbf") {
                self.bytes.drain(..3);
            }
            if self.bytes.iter().any(|b| !b.is_ascii_whitespace()) {
                break;
            }
        }
        if memchr::memchr2(b'"', 0, &self.bytes).is_none() {
            return Ok(true);
        }
        // an open quote: the row goes on
        let mut is_open = is_odd(&self.bytes);
        while is_open {
            self.bytes.push(b'\n');
            let before = self.bytes.len();
            if !self.line()? {
                break;
            }
            is_open ^= is_odd(self.bytes.get(before..).unwrap_or_default());
        }
        match memchr::memchr(0, &self.bytes) {
            Some(_) => Err(Broken::Binary),
            None => Ok(true),
        }
    }

    /// Appends a line without its end; false at the end of the file.
    fn line(&mut self) -> Result<bool, Broken> {
        let mut any = false;
        loop {
            let block = self.input.fill_buf().map_err(Broken::Io)?;
            if block.is_empty() {
                self.lines += u64::from(any);
                return Ok(any);
            }
            if std::mem::take(&mut self.after_return) && block.first() == Some(&b'\n') {
                self.input.consume(1);
                continue;
            }
            any = true;
            let end = memchr::memchr2(b'\n', b'\r', block);
            let text = block.get(..end.unwrap_or(block.len())).unwrap_or_default();
            if self.bytes.len() + text.len() > LONGEST {
                return Err(match text.contains(&0) {
                    true => Broken::Binary,
                    false => Broken::Long,
                });
            }
            self.bytes.extend_from_slice(text);
            let used = text.len() + usize::from(end.is_some());
            if let Some(end) = end {
                self.after_return = block.get(end) == Some(&b'\r');
                self.lines += 1;
            }
            self.input.consume(used);
            if end.is_some() {
                return Ok(true);
            }
        }
    }

    /// The line on which the row starts, from 1.
    pub(super) fn number(&self) -> u64 {
        self.start
    }

    /// The row as it stands.
    pub(super) fn raw(&self) -> &[u8] {
        &self.bytes
    }

    /// Cuts the row into cells; returns how many.
    pub(super) fn split(&mut self, delimiter: u8) -> usize {
        self.cells.clear();
        let (mut from, mut quoted) = (0, false);
        for (i, byte) in self.bytes.iter().enumerate() {
            if *byte == b'"' {
                quoted = !quoted;
            } else if *byte == delimiter && !quoted {
                self.cells.push(trimmed(&self.bytes, from, i));
                from = i + 1;
            }
        }
        self.cells
            .push(trimmed(&self.bytes, from, self.bytes.len()));
        self.cells.len()
    }

    /// The texts of the cells.
    ///
    /// # Errors
    /// The row is not UTF-8.
    pub(super) fn texts(&self) -> Result<impl Iterator<Item = Cow<'_, str>>, Utf8Error> {
        let row = str::from_utf8(&self.bytes)?;
        let text = |cell: &Cell| {
            let text = row.get(cell.from..cell.to).unwrap_or_default();
            match cell.doubled {
                true => Cow::Owned(text.replace("\"\"", "\"")),
                false => Cow::Borrowed(text),
            }
        };
        Ok(self.cells.iter().map(text))
    }
}

/// Whether the number of quotes is odd.
fn is_odd(text: &[u8]) -> bool {
    memchr::memchr_iter(b'"', text).count() % 2 == 1
}

/// The cell in `from..to` without blanks and quotes around it.
fn trimmed(bytes: &[u8], from: usize, to: usize) -> Cell {
    let shrink = |mut from: usize, mut to: usize| {
        let blank = |i: usize| bytes.get(i).is_some_and(u8::is_ascii_whitespace);
        while from < to && blank(from) {
            from += 1;
        }
        while from < to && blank(to - 1) {
            to -= 1;
        }
        (from, to)
    };
    let (mut from, mut to) = shrink(from, to);
    let at = |i: usize| bytes.get(i) == Some(&b'"');
    let quoted = to - from >= 2 && at(from) && at(to - 1);
    if quoted {
        (from, to) = shrink(from + 1, to - 1);
    }
    let inside = bytes.get(from..to).unwrap_or_default();
    let doubled = quoted && inside.windows(2).any(|pair| pair == b"\"\"");
    Cell { from, to, doubled }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Vec<(u64, Vec<String>)> {
        let mut rows = Rows::new(text.as_bytes());
        let mut found = vec![];
        while rows.next().unwrap() {
            rows.split(b',');
            let cells = rows.texts().unwrap().map(Cow::into_owned);
            found.push((rows.number(), cells.collect()));
        }
        found
    }

    #[test]
    fn quotes_blanks_and_line_ends() {
        let text = "\u{feff}a, b \r\n\r\n1,\"x, \"\"y\"\"\"\r2,\"p\nq\"\n\n\" \",3";
        let expected = [
            (1, vec!["a", "b"]),
            (3, vec!["1", "x, \"y\""]),
            (4, vec!["2", "p\nq"]),
            (7, vec!["", "3"]),
        ];
        let found = rows(text);
        assert_eq!(found.len(), expected.len());
        for ((line, cells), (at, texts)) in found.iter().zip(expected) {
            assert_eq!(
                (*line, cells),
                (at, &texts.iter().map(|t| t.to_string()).collect())
            );
        }
    }

    #[test]
    fn endless_and_binary_rows_are_refused() {
        let endless = std::io::repeat(b'7');
        let mut rows = Rows::new(std::io::BufReader::new(endless));
        assert!(matches!(rows.next(), Err(Broken::Long)));
        let open: Vec<u8> = [b"a,\"b\n".to_vec(), b"1,2\n".repeat(LONGEST / 3)].concat();
        assert!(matches!(Rows::new(&open[..]).next(), Err(Broken::Long)));
        let zeros = std::io::repeat(0);
        let mut rows = Rows::new(std::io::BufReader::new(zeros));
        assert!(matches!(rows.next(), Err(Broken::Binary)));
        assert!(matches!(
            Rows::new(&b"a\0,b\n"[..]).next(),
            Err(Broken::Binary)
        ));
    }
}
