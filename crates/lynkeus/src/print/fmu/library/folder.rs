//! A temporary folder that a later run removes where this one is killed.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

use tempfile::TempDir;

const PREFIX: &str = ".lynkeus-fmu-";
/// Random characters after it.
const RANDOM: usize = 10;

/// Locked as long as its run lives.
const LOCK: &str = "lock";

/// A folder may be younger than this without a lock: its run is about to take it.
const YOUNG: Duration = Duration::from_secs(60);

/// Removed with its value; and by the next run, if this one is killed.
pub(super) struct Folder {
    folder: TempDir,
    _lock: File,
}

impl Folder {
    /// A new one; what killed runs have left is removed.
    pub fn new() -> io::Result<Self> {
        remove_left(&std::env::temp_dir());
        let mut builder = tempfile::Builder::new();
        let folder = builder.prefix(PREFIX).rand_bytes(RANDOM).tempdir()?;
        let lock = File::create(folder.path().join(LOCK))?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => Err(io::Error::other("it is locked by another run")),
            // some network folders have no locks
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self {
                folder,
                _lock: lock,
            }),
        }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes what killed runs left.
fn remove_left(place: &Path) {
    let Ok(entries) = std::fs::read_dir(place) else {
        return;
    };
    for entry in entries.flatten() {
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_folder && entry.file_name().to_str().is_some_and(is_ours) && is_left(&entry.path()) {
            // another run may have been faster
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

fn is_ours(name: &str) -> bool {
    let random = name.strip_prefix(PREFIX);
    random.is_some_and(|r| r.len() == RANDOM && r.bytes().all(|b| b.is_ascii_alphanumeric()))
}

/// Whether nobody works in a folder any more.
fn is_left(folder: &Path) -> bool {
    let lock = File::open(folder.join(LOCK)).ok();
    let data = lock
        .as_ref()
        .map_or_else(|| folder.metadata(), File::metadata);
    let made = data.and_then(|data| data.modified()).ok();
    let age = made.and_then(|made| made.elapsed().ok());
    age.is_some_and(|age| age > YOUNG) && lock.is_none_or(|lock| lock.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;

    #[test]
    fn what_is_left_goes_and_what_is_in_use_stays() {
        let place = tempfile::tempdir().unwrap();
        let made = |name: &str| {
            let folder = place.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            std::fs::write(folder.join("a.c"), "int a;").unwrap();
            folder
        };
        let before = SystemTime::now() - 2 * YOUNG;
        let locked = |folder: &Path, made: SystemTime| {
            let lock = File::create(folder.join(LOCK)).unwrap();
            lock.set_modified(made).unwrap();
            lock
        };
        let left = made(".lynkeus-fmu-abcDEF1234");
        drop(locked(&left, before));
        let used = made(".lynkeus-fmu-abcDEF1235");
        let lock = locked(&used, before);
        lock.try_lock().unwrap();
        let young = made(".lynkeus-fmu-abcDEF1236");
        // its run has made the lock, and takes it next
        let new = made(".lynkeus-fmu-abcDEF1237");
        let _lock = locked(&new, SystemTime::now());
        let other = made(".lynkeus-fmu-of-somebody");
        remove_left(place.path());
        let is_there = [&left, &used, &young, &new, &other].map(|folder| folder.exists());
        assert_eq!(is_there, [false, true, true, true, true]);
    }
}
