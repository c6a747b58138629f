//! Results written whole or not at all.
//!
//! A result is first written beside its place under a temporary name, and put on disk; when all
//! results of a command got that far, each takes its place by a rename. The temporary file is locked as long
//! as its writer lives: one that is not locked was left by a run that was killed, and is removed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use lynkeus::{Answer, Error, interrupt};
use tempfile::{NamedTempFile, SpooledTempFile};

use super::ending::Ending;
use super::options::Output;
use super::{output, signals};

/// The name that stands for standard input or output.
const STANDARD: &str = "-";

/// Whether a path is the name of standard input or output.
pub(super) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD
}

const PREFIX: &str = ".lynkeus-";
const SUFFIX: &str = ".part";
/// Random characters between them.
const RANDOM: usize = 10;

/// Links of links that are followed.
const MOST_LINKS: usize = 40;

/// Bytes for standard output or a device that are kept in memory.
const SPOOLED: usize = 1 << 20;

/// Bytes written between two looks at whether the user wants to stop.
const PIECE: usize = 1 << 20;

/// The results of a command, none of which is seen before all are complete.
#[derive(Debug, Default)]
pub(super) struct Results {
    files: Vec<Staged>,
    /// a table for standard output
    table: Option<SpooledTempFile>,
    printed: String,
    undrawn: Option<Error>,
}

/// A complete result that is not yet in its place.
#[derive(Debug)]
struct Staged {
    path: PathBuf,
    place: PathBuf,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Beside(NamedTempFile),
    /// For a device or a pipe, which is written to and never replaced.
    Device(SpooledTempFile),
}

impl Results {
    /// Adds a result; "-" prints it.
    pub fn put(&mut self, path: &Path, content: impl Into<Vec<u8>>) -> Result<(), Error> {
        let bytes = content.into();
        self.write(path, |to| to.write_all(&bytes))
    }

    /// Adds a result that is written piece by piece, straight to the disk where it is a file: a
    /// table takes no room but its own.
    pub fn write(
        &mut self,
        path: &Path,
        write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
    ) -> Result<(), Error> {
        let failed = |e: io::Error| refusal(path, &e);
        let place = destination(path);
        let is_device = std::fs::metadata(&place).is_ok_and(|data| !data.is_file());
        if !is_standard(path) && !is_device {
            let file = stage(&place, write).map_err(failed)?;
            return self.stage(path, place, Content::Beside(file));
        }
        let content = spool(write).map_err(failed)?;
        if is_standard(path) {
            self.table = Some(content);
            return Ok(());
        }
        self.stage(path, place, Content::Device(content))
    }

    fn stage(&mut self, path: &Path, place: PathBuf, content: Content) -> Result<(), Error> {
        let path = path.to_owned();
        self.files.push(Staged {
            path,
            place,
            content,
        });
        Ok(())
    }

    /// Adds a picture; that one cannot be drawn is told after everything else was written.
    pub fn picture(&mut self, path: &Path, svg: Result<String, Error>) -> Result<(), Error> {
        match svg {
            Ok(svg) => self.put(path, svg),
            Err(error) => {
                self.undrawn = Some(error.as_refusal());
                Ok(())
            }
        }
    }

    /// Whether a result goes to standard output.
    pub fn has_printed(&self) -> bool {
        self.table.is_some() || !self.printed.is_empty()
    }

    /// Adds text to standard output.
    pub fn print(&mut self, text: &str) {
        self.printed.push_str(text);
    }

    /// Adds an answer: JSON, or words for people where nothing else goes to standard output.
    pub fn answer(&mut self, json: bool, answer: &dyn Answer) {
        if json {
            self.print(&output::json(&answer.to_json()));
        } else if !self.has_printed() {
            self.print(&answer.text());
        }
    }

    /// Adds an answer with its files, puts all in its place, and tells what speaks against it.
    ///
    /// # Errors
    /// As [`keep`](Self::keep).
    pub fn tell(mut self, answer: &dyn Answer, asked: &Output) -> Result<Ending, Error> {
        output::remarks(answer, asked.quiet);
        self.files(answer, asked.plot.as_deref(), asked.output.as_deref())?;
        self.answer(asked.json, answer);
        self.keep()?;
        Ok(output::verdict(answer))
    }

    /// Adds the picture and the columns of an answer, where they are asked for.
    pub fn files(
        &mut self,
        answer: &dyn Answer,
        plot: Option<&Path>,
        table: Option<&Path>,
    ) -> Result<(), Error> {
        if let (Some(path), Some(svg)) = (plot, answer.svg().transpose()) {
            self.picture(path, svg)?;
        }
        if let Some(path) = table {
            let columns = answer.columns();
            self.write(path, |to| output::table(path, &columns, to))?;
        }
        Ok(())
    }

    /// Puts every result in its place.
    ///
    /// # Errors
    /// A result cannot take its place, the user wants to stop, or a picture could not be drawn.
    pub fn keep(self) -> Result<(), Error> {
        // what was found by then is told; a file is written whole or not at all
        let files = match interrupt::interrupted() {
            true => vec![],
            false => self.files,
        };
        for staged in files {
            let path = staged.path;
            take_place(staged.content, &staged.place).map_err(|e| refusal(&path, &e))?;
        }
        if let Some(table) = self.table {
            output::print(table)?;
        }
        if !self.printed.is_empty() {
            output::print(self.printed.as_bytes())?;
        }
        self.undrawn.map_or(Ok(()), Err)
    }
}

/// Refuses a path that cannot be written, before the work is done. A file that is marked as read-only counts as one
/// even where the user's rights would do, unless it is the very one that the command is asked to change.
pub(super) fn probe(path: &Path, is_changed: bool) -> Result<(), Error> {
    let place = destination(path);
    let shown = path.display();
    if place.file_name().is_none() || shown.to_string().ends_with(std::path::MAIN_SEPARATOR) {
        return Err(
            Error::input(format!("cannot write {shown}: it is a folder")).hint("name a file in it"),
        );
    }
    match std::fs::metadata(&place) {
        Ok(data) if data.is_dir() => {
            let why = format!("cannot write {shown}: it is a folder");
            return Err(Error::input(why).hint("name a file in it"));
        }
        Ok(data) if !data.is_file() => return Ok(()),
        Ok(data) if data.permissions().readonly() && !is_changed => {
            let why = format!("cannot write {shown}: the file is read-only");
            return Err(Error::input(why).hint("allow writing to it, or give another name"));
        }
        Ok(_) => {
            let opened = OpenOptions::new().write(true).open(&place);
            opened.map_err(|e| refusal(path, &e))?;
        }
        Err(_) => {}
    }
    let folder = folder(&place);
    if !folder.is_dir() {
        let missing = folder.display();
        let why = format!("cannot write {shown}: there is no folder {missing}");
        return Err(Error::input(why).hint("make it first"));
    }
    let tried = temporary(folder, None);
    tried.map(drop).map_err(|e| refusal(path, &e))
}

fn refusal(path: &Path, error: &io::Error) -> Error {
    let why = match (error.raw_os_error(), error.kind()) {
        (None, kind) if kind != io::ErrorKind::Other => {
            // else it tells the name of the temporary file
            io::Error::from(kind).to_string()
        }
        _ => error.to_string(),
    };
    Error::input(format!("cannot write {}: {why}", path.display()))
}

/// The file that a path leads to: links are followed, also one to a file that is not there yet.
pub(super) fn destination(path: &Path) -> PathBuf {
    if let Ok(data) = std::fs::metadata(path) {
        return match data.is_file() {
            true => std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            // the link to an open pipe leads to no name
            false => path.to_owned(),
        };
    }
    let mut place = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(next) = std::fs::read_link(&place) else {
            break;
        };
        place = folder(&place).join(next);
    }
    place
}

/// The folder that a file is in.
pub(super) fn folder(place: &Path) -> &Path {
    match place.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A file that is written only as long as the user does not want to stop.
struct Watched<'f>(&'f mut File);

impl Write for Watched<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match interrupt::interrupted() {
            true => Err(io::Error::other("interrupted")),
            false => self.0.write(&bytes[..bytes.len().min(PIECE)]),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// The result in a temporary file beside its place, on disk, with the permissions it will have.
fn stage(
    place: &Path,
    write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> io::Result<NamedTempFile> {
    let folder = folder(place);
    remove_left(folder);
    let replaced = std::fs::metadata(place).ok();
    let mut file = temporary(folder, replaced.as_ref())?;
    let mut buffered = BufWriter::new(Watched(file.as_file_mut()));
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    if let Some(replaced) = replaced {
        inherit(file.as_file(), &replaced)?;
    }
    on_disk(file.as_file())?;
    Ok(file)
}

/// What can only be shown once it is whole, from its beginning: in memory, or, where it is long, in a
/// temporary file without a name.
fn spool(
    write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> io::Result<SpooledTempFile> {
    let mut content = tempfile::spooled_tempfile_in(SPOOLED, lynkeus::series::folder());
    write(&mut content)?;
    content.rewind()?;
    Ok(content)
}

/// A new locked file. One that replaces none has the permissions that the user's mask leaves to new files.
fn temporary(folder: &Path, replaced: Option<&std::fs::Metadata>) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    if replaced.is_none() {
        ordinary(&mut builder);
    }
    // another run that cleans up may take a file for a left one until it is locked
    for _ in 0..16 {
        let file = builder.tempfile_in(folder)?;
        signals::is_temporary(file.path());
        let locked = match file.as_file().try_lock() {
            Err(TryLockError::WouldBlock) => false,
            // some network folders have no locks
            Ok(()) | Err(TryLockError::Error(_)) => true,
        };
        if locked && file.path().exists() {
            return Ok(file);
        }
    }
    Err(io::Error::other(
        "temporary files beside it vanish again and again",
    ))
}

#[cfg(unix)]
fn ordinary(builder: &mut tempfile::Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(std::fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn ordinary(_: &mut tempfile::Builder<'_, '_>) {}

/// The owner, as far as that is allowed, and the permissions of the file that is replaced.
#[cfg(unix)]
fn inherit(file: &File, replaced: &std::fs::Metadata) -> io::Result<()> {
    use std::os::unix::fs::{MetadataExt, fchown};
    let own = file.metadata()?;
    if (own.uid(), own.gid()) != (replaced.uid(), replaced.gid()) {
        // only the superuser may give files away
        let _ = fchown(file, Some(replaced.uid()), Some(replaced.gid()));
    }
    file.set_permissions(replaced.permissions())
}

#[cfg(not(unix))]
fn inherit(_: &File, _: &std::fs::Metadata) -> io::Result<()> {
    Ok(())
}

/// Waits until the file is on disk, where there is one.
fn on_disk(file: &File) -> io::Result<()> {
    match file.sync_all() {
        Err(e)
            if matches!(
                e.kind(),
                io::ErrorKind::Unsupported | io::ErrorKind::InvalidInput
            ) =>
        {
            Ok(())
        }
        synced => synced,
    }
}

fn take_place(content: Content, place: &Path) -> io::Result<()> {
    match content {
        Content::Device(mut content) => {
            let written = OpenOptions::new()
                .write(true)
                .open(place)
                .and_then(|mut device| io::copy(&mut content, &mut device).map(drop));
            match written {
                // a reader that went away is no error
                Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                written => written,
            }
        }
        Content::Beside(file) => {
            file.persist(place).map_err(|e| e.error)?;
            // the rename itself; where a folder cannot be opened as a file, it is on disk a little later
            if let Ok(folder) = File::open(folder(place)) {
                let _ = folder.sync_all();
            }
            Ok(())
        }
    }
}

/// Removes what killed runs left in a folder.
fn remove_left(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !is_file || !entry.file_name().to_str().is_some_and(is_ours) {
            continue;
        }
        let free = File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if free {
            // another run may have been faster
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Whether a file's name is one that [`temporary`] makes.
fn is_ours(name: &str) -> bool {
    let random = name
        .strip_prefix(PREFIX)
        .and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|r| r.len() == RANDOM && r.bytes().all(|b| b.is_ascii_alphanumeric()))
}
