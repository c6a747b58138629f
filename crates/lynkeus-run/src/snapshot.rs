//! States as words of 64 bits, and back; snapshots as bytes.
//!
//! What a state is made of is written down once: the same walk over its parts saves and loads.

use std::fmt;

/// What a snapshot starts with.
const MAGIC: &[u8; 8] = b"LYNKSNAP";
/// Raised whenever what is saved changes.
const VERSION: u64 = 6;
/// Magic, version, fingerprint, length; the checksum comes last.
const HEAD: usize = 32;
const TAIL: usize = 8;

/// Why a snapshot cannot be restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotFault {
    /// the bytes are something else
    #[error("the bytes are no snapshot of an estimator")]
    NotOne,
    /// of another version of this crate
    #[error("it has version {found}, expected {VERSION}")]
    Version {
        /// its version
        found: u64,
    },
    /// cut short or changed
    #[error("it is damaged or cut short: its checksum does not fit")]
    Damaged,
    /// of an estimator with other equations, settings, noises or start values
    #[error("it is of another observer: equations, settings, noises or start values differ")]
    OtherObserver,
}

/// A sum over words by which changes are found. Every step is a bijection of the sum and of the
/// word: a single word that differs is always seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u64);

impl Default for Digest {
    fn default() -> Self {
        Self(0x243F_6A88_85A3_08D3)
    }
}

impl Digest {
    /// Takes a word.
    pub fn word(&mut self, word: u64) {
        let mixed = (self.0 ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 32);
    }

    /// Takes numbers by their bits, and how many they are.
    pub fn numbers(&mut self, numbers: &[f64]) {
        self.word(numbers.len() as u64);
        numbers.iter().for_each(|x| self.word(x.to_bits()));
    }

    /// Takes bytes, and how many they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.word(bytes.len() as u64);
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.word(u64::from_le_bytes(word));
        }
    }

    /// The sum so far.
    #[must_use]
    pub fn value(&self) -> u64 {
        self.0
    }
}

/// Text byte by byte: in whatever pieces it comes.
impl fmt::Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.bytes().for_each(|byte| self.word(u64::from(byte)));
        Ok(())
    }
}

/// The bytes do not hold what is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damaged;

/// One walk over the parts of a state.
#[derive(Debug)]
pub(crate) enum Walk<'a> {
    Save(&'a mut Vec<u64>),
    Load(&'a [u64]),
}

/// What has a state to save.
pub(crate) trait Persist {
    /// Walks over every part that the future depends on.
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged>;
}

impl Walk<'_> {
    #[inline]
    pub fn word(&mut self, word: &mut u64) -> Result<(), Damaged> {
        match self {
            Walk::Save(words) => words.push(*word),
            Walk::Load(words) => {
                let (first, rest) = words.split_first().ok_or(Damaged)?;
                (*word, *words) = (*first, rest);
            }
        }
        Ok(())
    }

    #[inline]
    pub fn number(&mut self, number: &mut f64) -> Result<(), Damaged> {
        let mut bits = number.to_bits();
        self.word(&mut bits)?;
        *number = f64::from_bits(bits);
        Ok(())
    }

    #[inline]
    pub fn count(&mut self, count: &mut usize) -> Result<(), Damaged> {
        let mut word = *count as u64;
        self.word(&mut word)?;
        *count = usize::try_from(word).map_err(|_| Damaged)?;
        Ok(())
    }

    /// A count below a limit.
    pub fn below(&mut self, count: &mut usize, limit: usize) -> Result<(), Damaged> {
        self.count(count)?;
        match *count < limit {
            true => Ok(()),
            false => Err(Damaged),
        }
    }

    #[inline]
    pub fn flag(&mut self, flag: &mut bool) -> Result<(), Damaged> {
        let mut word = u64::from(*flag);
        self.word(&mut word)?;
        *flag = word != 0;
        Ok(())
    }

    /// Numbers whose count never changes.
    #[inline]
    pub fn numbers(&mut self, numbers: &mut [f64]) -> Result<(), Damaged> {
        match self {
            Walk::Save(words) => words.extend(numbers.iter().map(|x| x.to_bits())),
            Walk::Load(words) => {
                let (own, rest) = words.split_at_checked(numbers.len()).ok_or(Damaged)?;
                let pairs = numbers.iter_mut().zip(own);
                pairs.for_each(|(x, word)| *x = f64::from_bits(*word));
                *words = rest;
            }
        }
        Ok(())
    }

    /// How many parts there are of what is `length` long now; each takes a word at least, so that
    /// no damaged count asks for more memory than the snapshot has.
    pub fn length(&mut self, length: usize) -> Result<usize, Damaged> {
        let mut found = length;
        self.count(&mut found)?;
        match self {
            Walk::Load(words) if found > words.len() => Err(Damaged),
            _ => Ok(found),
        }
    }

    /// What may be absent.
    #[inline]
    pub fn optional<T: Default>(
        &mut self,
        value: &mut Option<T>,
        each: impl FnOnce(&mut Self, &mut T) -> Result<(), Damaged>,
    ) -> Result<(), Damaged> {
        let mut is_there = value.is_some();
        self.flag(&mut is_there)?;
        match is_there {
            true => each(self, value.get_or_insert_default()),
            false => {
                *value = None;
                Ok(())
            }
        }
    }
}

/// Loads everything from words, and nothing is left.
pub(crate) fn load(
    words: &[u64],
    state: impl FnOnce(&mut Walk<'_>) -> Result<(), Damaged>,
) -> Result<(), Damaged> {
    let mut walk = Walk::Load(words);
    state(&mut walk)?;
    match walk {
        Walk::Load([]) => Ok(()),
        _ => Err(Damaged),
    }
}

/// A state with what it takes to know it again.
pub(crate) fn seal(
    fingerprint: u64,
    state: impl FnOnce(&mut Walk<'_>) -> Result<(), Damaged>,
) -> Vec<u8> {
    let mut words = vec![];
    // a state that is there can be walked over
    let _ = state(&mut Walk::Save(&mut words));
    let length = 8 * words.len() as u64;
    let head = [VERSION, fingerprint, length].into_iter();
    let mut bytes = MAGIC.to_vec();
    bytes.extend(head.chain(words).flat_map(u64::to_le_bytes));
    let sum = checksum(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

fn checksum(bytes: &[u8]) -> u64 {
    let mut digest = Digest::default();
    digest.bytes(bytes);
    digest.value()
}

/// The state in a snapshot.
///
/// # Errors
/// Why it cannot be restored.
pub(crate) fn opened(bytes: &[u8], fingerprint: u64) -> Result<Vec<u64>, SnapshotFault> {
    let word = |at: usize| {
        let bytes = bytes.get(at..at + 8).and_then(|b| b.try_into().ok());
        bytes.map_or(0, u64::from_le_bytes)
    };
    if !bytes.starts_with(MAGIC) {
        return Err(SnapshotFault::NotOne);
    }
    if bytes.len() >= 16 && word(8) != VERSION {
        return Err(SnapshotFault::Version { found: word(8) });
    }
    let Some(end) = bytes.len().checked_sub(TAIL).filter(|end| *end >= HEAD) else {
        return Err(SnapshotFault::Damaged);
    };
    if word(24) != (end - HEAD) as u64 || word(end) != checksum(&bytes[..end]) {
        return Err(SnapshotFault::Damaged);
    }
    if word(16) != fingerprint {
        return Err(SnapshotFault::OtherObserver);
    }
    match bytes[HEAD..end].as_chunks() {
        (words, []) => Ok(words.iter().copied().map(u64::from_le_bytes).collect()),
        _ => Err(SnapshotFault::Damaged),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, Default, PartialEq)]
    struct State {
        x: f64,
        fixed: [f64; 2],
        list: Vec<f64>,
        maybe: Option<f64>,
        flag: bool,
    }

    impl Persist for State {
        fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
            walk.number(&mut self.x)?;
            walk.numbers(&mut self.fixed)?;
            let length = walk.length(self.list.len())?;
            self.list.resize(length, 0.0);
            walk.numbers(&mut self.list)?;
            walk.optional(&mut self.maybe, Walk::number)?;
            walk.flag(&mut self.flag)
        }
    }

    fn state() -> State {
        State {
            x: -0.0,
            fixed: [1.5, f64::MIN_POSITIVE],
            list: vec![3.0, 4.0, 5.0],
            maybe: Some(7.0),
            flag: true,
        }
    }

    #[test]
    fn what_is_saved_is_loaded() {
        let bytes = seal(42, |walk| state().walk(walk));
        let mut found = State::default();
        load(&opened(&bytes, 42).unwrap(), |walk| found.walk(walk)).unwrap();
        assert_eq!(found, state());
        assert!(found.x.is_sign_negative());
    }

    #[test]
    fn every_change_and_every_cut_is_found() {
        let bytes = seal(42, |walk| state().walk(walk));
        let fault = |bytes: &[u8], fingerprint| opened(bytes, fingerprint).unwrap_err();
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << (place % 8);
            fault(&changed, 42);
            fault(&bytes[..place], 42);
        }
        assert_eq!(fault(&bytes, 43), SnapshotFault::OtherObserver);
        assert_eq!(fault(b"t,y\n0,1\n", 42), SnapshotFault::NotOne);
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(fault(&longer, 42), SnapshotFault::Damaged);
    }

    #[test]
    fn damaged_lengths_ask_for_no_memory() {
        let mut words = vec![];
        state().walk(&mut Walk::Save(&mut words)).unwrap();
        words[3] = u64::MAX;
        assert!(load(&words, |walk| State::default().walk(walk)).is_err());
        assert!(load(&words[..2], |walk| State::default().walk(walk)).is_err());
    }
}
