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

/// A folder without a lock that is as old as this was left before it had one.
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
    match File::open(folder.join(LOCK)) {
        Ok(lock) => lock.try_lock().is_ok(),
        Err(_) => {
            let changed = folder.metadata().and_then(|data| data.modified());
            let age = changed.ok().and_then(|changed| changed.elapsed().ok());
            age.is_some_and(|age| age > YOUNG)
        }
    }
}

#[cfg(test)]
mod tests {
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
        let left = made(".lynkeus-fmu-abcDEF1234");
        drop(File::create(left.join(LOCK)).unwrap());
        let used = made(".lynkeus-fmu-abcDEF1235");
        let lock = File::create(used.join(LOCK)).unwrap();
        lock.try_lock().unwrap();
        let young = made(".lynkeus-fmu-abcDEF1236");
        let other = made(".lynkeus-fmu-of-somebody");
        remove_left(place.path());
        let is_there = [&left, &used, &young, &other].map(|folder| folder.exists());
        assert_eq!(is_there, [false, true, true, true]);
    }
}
