//! Numbers and texts as bytes, and back; files beside others.

use std::path::{Path, PathBuf};

/// What is written.
#[derive(Debug, Default)]
pub(crate) struct Writer(pub Vec<u8>);

impl Writer {
    pub fn word(&mut self, word: u64) {
        self.0.extend_from_slice(&word.to_le_bytes());
    }

    pub fn number(&mut self, number: f64) {
        self.word(number.to_bits());
    }

    pub fn bytes(&mut self, bytes: &[u8]) {
        self.word(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
    }

    pub fn texts<'t>(&mut self, texts: impl ExactSizeIterator<Item = &'t str>) {
        self.word(texts.len() as u64);
        texts.for_each(|text| self.bytes(text.as_bytes()));
    }

    pub fn numbers(&mut self, numbers: &[f64]) {
        self.word(numbers.len() as u64);
        numbers.iter().for_each(|x| self.number(*x));
    }
}

/// What is read; none where there is less than what was written.
#[derive(Debug)]
pub(crate) struct Parser<'b>(pub &'b [u8]);

impl<'b> Parser<'b> {
    pub fn word(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*first))
    }

    pub fn number(&mut self) -> Option<f64> {
        self.word().map(f64::from_bits)
    }

    /// How many there are of what takes so many bytes each.
    pub fn count(&mut self, size: usize) -> Option<usize> {
        let count = usize::try_from(self.word()?).ok()?;
        (count.checked_mul(size)? <= self.0.len()).then_some(count)
    }

    pub fn bytes(&mut self) -> Option<&'b [u8]> {
        let count = self.count(1)?;
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    pub fn text(&mut self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_vec()).ok()
    }

    pub fn texts(&mut self) -> Option<Vec<String>> {
        let count = self.count(8)?;
        (0..count).map(|_| self.text()).collect()
    }

    pub fn numbers(&mut self) -> Option<Vec<f64>> {
        let count = self.count(8)?;
        (0..count).map(|_| self.number()).collect()
    }
}

/// The path of a file with something after its name.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.to_owned().into_os_string();
    name.push(ending);
    PathBuf::from(name)
}
