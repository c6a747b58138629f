//! A temporary file for what does not fit into memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lynkeus_answer::Error;

/// Keeps blocks of numbers; its clones are the same one. The file has no name, so nothing is
/// left of it whatever ends the program.
#[derive(Clone, Debug, Default)]
pub struct Store(Arc<Mutex<Kept>>);

#[derive(Debug, Default)]
struct Kept {
    /// made for the first block; a process that was forked goes on in one of its own
    parts: Vec<Part>,
    /// bytes kept
    end: u64,
    /// room for the bytes of a block
    bytes: Vec<u8>,
    /// the first failure
    failed: Option<String>,
}

/// What one process keeps.
#[derive(Debug)]
struct Part {
    process: u32,
    /// bytes kept before it
    before: u64,
    medium: Medium,
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
        let part = kept.writable();
        let at = place - part.before;
        match part.medium.append(at, &bytes) {
            Ok(()) => kept.end += bytes.len() as u64,
            Err(e) => kept.fail(&e),
        }
        kept.bytes = bytes;
        place
    }

    /// Numbers of the block at a place, from one of them on; NaN where they cannot be read.
    pub fn read(&self, place: u64, from: usize, into: &mut [f64]) {
        self.with(place, from, into.len(), |found| match found {
            Some(words) => {
                let values = words.iter().map(|word| f64::from_le_bytes(*word));
                into.iter_mut().zip(values).for_each(|(to, x)| *to = x);
            }
            None => into.fill(f64::NAN),
        });
    }

    /// The same behind other numbers.
    pub fn append(&self, place: u64, from: usize, count: usize, to: &mut Vec<f64>) {
        self.with(place, from, count, |found| match found {
            Some(words) => to.extend(words.iter().map(|word| f64::from_le_bytes(*word))),
            None => to.extend(std::iter::repeat_n(f64::NAN, count)),
        });
    }

    /// The words of a block, or none where they cannot be read.
    fn with(
        &self,
        place: u64,
        from: usize,
        count: usize,
        take: impl FnOnce(Option<&[[u8; SIZE]]>),
    ) {
        let mut kept = self.lock();
        let mut bytes = std::mem::take(&mut kept.bytes);
        bytes.resize(SIZE * count, 0);
        let place = place + (SIZE * from) as u64;
        let read = match kept.part_of(place) {
            Some(part) => part.medium.read(place - part.before, &mut bytes),
            None => Err(io::ErrorKind::NotFound.into()),
        };
        match read {
            Ok(()) => take(Some(bytes.as_chunks().0)),
            Err(e) => {
                take(None);
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
    /// The part that this process adds to: never one that a process shares with its fork.
    fn writable(&mut self) -> &mut Part {
        let process = std::process::id();
        if self.parts.last().is_none_or(|p| p.process != process) {
            self.parts.push(Part {
                process,
                before: self.end,
                medium: Medium::new(),
            });
        }
        let last = self.parts.len() - 1;
        &mut self.parts[last]
    }

    fn part_of(&self, place: u64) -> Option<&Part> {
        self.parts.iter().rev().find(|part| part.before <= place)
    }

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
            Self::File(file) => at::write(file, place, bytes),
            Self::Memory(kept) => {
                kept.try_reserve(bytes.len())
                    .map_err(|_| io::ErrorKind::OutOfMemory)?;
                kept.extend_from_slice(bytes);
                Ok(())
            }
        }
    }

    fn read(&self, place: u64, bytes: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(file) => at::read(file, place, bytes),
            Self::Memory(kept) => {
                let from = usize::try_from(place).unwrap_or(usize::MAX);
                kept.get(from..).unwrap_or_default().read_exact(bytes)
            }
        }
    }
}

/// Files at a place: without the cursor, which a process shares with its forks.
#[cfg(unix)]
mod at {
    use std::fs::File;
    use std::io;
    use std::os::unix::fs::FileExt;

    pub fn read(file: &File, place: u64, bytes: &mut [u8]) -> io::Result<()> {
        file.read_exact_at(bytes, place)
    }

    pub fn write(file: &File, place: u64, bytes: &[u8]) -> io::Result<()> {
        file.write_all_at(bytes, place)
    }
}

/// Files at a place; no process forks here.
#[cfg(not(unix))]
mod at {
    use std::fs::File;
    use std::io::{self, Read, Seek, SeekFrom, Write};

    pub fn read(mut file: &File, place: u64, bytes: &mut [u8]) -> io::Result<()> {
        file.seek(SeekFrom::Start(place))?;
        file.read_exact(bytes)
    }

    pub fn write(mut file: &File, place: u64, bytes: &[u8]) -> io::Result<()> {
        file.seek(SeekFrom::Start(place))?;
        file.write_all(bytes)
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

    impl Store {
        fn begin(&self, process: u32, medium: Medium) {
            let mut kept = self.lock();
            let before = kept.end;
            kept.parts.push(Part {
                process,
                before,
                medium,
            });
        }
    }

    /// What another process wrote is read, and never written to.
    #[test]
    fn a_forked_process_goes_on_in_a_file_of_its_own() {
        let store = Store::default();
        let parent = tempfile::tempfile().unwrap();
        store.begin(u32::MAX, Medium::File(parent.try_clone().unwrap()));
        let bytes: Vec<u8> = [1.0_f64, 2.0]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        at::write(&parent, 0, &bytes).unwrap();
        store.lock().end = 16;
        let place = store.keep(&[3.0]);
        assert_eq!(parent.metadata().unwrap().len(), 16);
        let mut found = [0.0; 2];
        store.read(0, 0, &mut found);
        store.read(place, 0, &mut found[..1]);
        assert_eq!(found, [3.0, 2.0]);
        assert!(store.check().is_ok());
    }

    #[test]
    fn a_failure_is_kept_and_told() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let unwritable = File::open(file.path()).unwrap();
        let store = Store::default();
        store.begin(std::process::id(), Medium::File(unwritable));
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
        store.begin(std::process::id(), Medium::Memory(vec![]));
        let places = [store.keep(&[1.0, 2.0]), store.keep(&[3.0, 4.0])];
        let mut found = [0.0];
        store.read(places[1], 1, &mut found);
        assert_eq!(found, [4.0]);
        assert!(store.check().is_ok());
    }
}
