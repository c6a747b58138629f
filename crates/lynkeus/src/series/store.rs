//! A temporary file for what does not fit into memory.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::Error;

/// Keeps blocks of numbers; its clones are the same one. The file has no name, so nothing is
/// left of it whatever ends the program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Store(Arc<Mutex<Kept>>);

#[derive(Debug, Default)]
struct Kept {
    /// made for the first block
    medium: Option<Medium>,
    /// bytes kept
    end: u64,
    /// room for the bytes of a block
    bytes: Vec<u8>,
    /// the first failure
    failed: Option<String>,
}

#[derive(Debug)]
enum Medium {
    File(File),
    /// where no file can be made
    Memory(Vec<u8>),
}

/// Bytes of a number.
const SIZE: usize = size_of::<f64>();

impl Store {
    /// Keeps a block; its place.
    pub fn keep(&self, values: &[f64]) -> u64 {
        let mut kept = self.lock();
        let mut bytes = std::mem::take(&mut kept.bytes);
        bytes.clear();
        values
            .iter()
            .for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        let place = kept.end;
        let medium = kept.medium.get_or_insert_with(Medium::new);
        match medium.append(place, &bytes) {
            Ok(()) => kept.end += bytes.len() as u64,
            Err(e) => kept.fail(&e),
        }
        kept.bytes = bytes;
        place
    }

    /// Numbers of the block at a place, from one of them on; NaN where they cannot be read.
    pub fn read(&self, place: u64, from: usize, into: &mut [f64]) {
        let mut kept = self.lock();
        let mut bytes = std::mem::take(&mut kept.bytes);
        bytes.resize(SIZE * into.len(), 0);
        let place = place + (SIZE * from) as u64;
        let read = match &mut kept.medium {
            Some(medium) => medium.read(place, &mut bytes),
            None => Err(io::ErrorKind::NotFound.into()),
        };
        match read {
            Ok(()) => {
                let (words, _) = bytes.as_chunks();
                let values = words.iter().map(|word| f64::from_le_bytes(*word));
                into.iter_mut().zip(values).for_each(|(to, x)| *to = x);
            }
            Err(e) => {
                into.fill(f64::NAN);
                kept.fail(&e);
            }
        }
        kept.bytes = bytes;
    }

    /// Whether everything was kept and read.
    ///
    /// # Errors
    /// The disk was full, or failed.
    pub fn check(&self) -> Result<(), Error> {
        match &self.lock().failed {
            None => Ok(()),
            Some(why) => Err(Error::input(format!(
                "cannot keep long columns in a temporary file: {why}"
            ))
            .hint("free some space, or name a folder with more of it in TMPDIR")),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn fail(&mut self, error: &io::Error) {
        self.failed.get_or_insert_with(|| error.to_string());
    }
}

impl Medium {
    fn new() -> Self {
        let folders = [folder(), std::env::temp_dir()];
        let mut made = folders
            .iter()
            .filter_map(|folder| tempfile::tempfile_in(folder).ok());
        made.next().map_or(Self::Memory(vec![]), Self::File)
    }

    fn append(&mut self, place: u64, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::File(file) => {
                file.seek(SeekFrom::Start(place))?;
                file.write_all(bytes)
            }
            Self::Memory(kept) => {
                kept.try_reserve(bytes.len())
                    .map_err(|_| io::ErrorKind::OutOfMemory)?;
                kept.extend_from_slice(bytes);
                Ok(())
            }
        }
    }

    fn read(&mut self, place: u64, bytes: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(file) => {
                file.seek(SeekFrom::Start(place))?;
                file.read_exact(bytes)
            }
            Self::Memory(kept) => {
                let from = usize::try_from(place).unwrap_or(usize::MAX);
                kept.get(from..).unwrap_or_default().read_exact(bytes)
            }
        }
    }
}

/// The folder for large temporary files: the one that the environment names in `TMPDIR`, else one
/// that is on a disk and not in memory, if there is one.
#[must_use]
pub fn folder() -> PathBuf {
    let on_disk = PathBuf::from("/var/tmp");
    match std::env::var_os("TMPDIR").is_none() && on_disk.is_dir() {
        true => on_disk,
        false => std::env::temp_dir(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_kept_and_told() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let unwritable = File::open(file.path()).unwrap();
        let store = Store::default();
        store.lock().medium = Some(Medium::File(unwritable));
        assert!(store.check().is_ok());
        let place = store.keep(&[1.0, 2.0]);
        let mut found = [0.0; 2];
        store.read(place, 0, &mut found);
        assert!(found.iter().all(|x| x.is_nan()));
        let told = store.clone().check().unwrap_err().to_string();
        assert!(
            told.contains("temporary file") && told.contains("TMPDIR"),
            "{told}"
        );
    }

    #[test]
    fn memory_stands_in_where_no_file_can_be_made() {
        let store = Store::default();
        store.lock().medium = Some(Medium::Memory(vec![]));
        let places = [store.keep(&[1.0, 2.0]), store.keep(&[3.0, 4.0])];
        let mut found = [0.0];
        store.read(places[1], 1, &mut found);
        assert_eq!(found, [4.0]);
        assert!(store.check().is_ok());
    }
}
