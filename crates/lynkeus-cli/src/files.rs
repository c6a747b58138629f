//! What a command reads and writes, looked at before anything is computed: no result may replace
//! an input of the same command or another result, and every result must be possible to write.

use std::path::{Path, PathBuf};

use lynkeus::Error;

use super::options::Output;
use super::save::{self, is_standard};

/// The files of one command.
#[derive(Debug, Default)]
pub(super) struct Files {
    inputs: Vec<Named>,
    results: Vec<Named>,
    /// What is printed beside them.
    printed: Option<&'static str>,
}

/// The role of a study that is changed in its place.
pub(super) const CHANGED: &str = "--write";

/// A file with its place in the command.
#[derive(Debug)]
struct Named {
    /// "the log", "--plot"
    role: &'static str,
    path: PathBuf,
    content: Content,
}

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    /// anything that its name says
    Any,
    /// SVG, whatever its name says
    Picture,
}

impl Files {
    /// Adds the results that a command is asked for.
    pub fn asked(self, output: &Output) -> Self {
        self.writes("-o", output.output.as_deref())
            .draws("--plot", output.plot.as_deref())
            .prints_json(output.json)
    }

    /// Adds what is read.
    pub fn reads(mut self, role: &'static str, path: Option<&Path>) -> Self {
        self.inputs.extend(named(role, path));
        self
    }

    /// Adds what is written.
    pub fn writes(mut self, option: &'static str, path: Option<&Path>) -> Self {
        self.results.extend(named(option, path));
        self
    }

    /// Adds a picture that is drawn.
    pub fn draws(mut self, option: &'static str, path: Option<&Path>) -> Self {
        let pictures = named(option, path).into_iter().map(|named| Named {
            content: Content::Picture,
            ..named
        });
        self.results.extend(pictures);
        self
    }

    /// With `--json` the object is printed, beside everything that is written.
    pub fn prints_json(mut self, json: bool) -> Self {
        self.printed = json.then_some("--json");
        self
    }

    /// Refuses what would lose a file or mix two results.
    ///
    /// # Errors
    /// A result is an input or another result, a picture has the name of another format, two of them go to standard output or come from standard input,
    /// or a result cannot be written.
    pub fn check(&self) -> Result<(), Error> {
        self.standard()?;
        let identities: Vec<Option<Identity>> = self.results.iter().map(Named::identity).collect();
        for (i, (result, identity)) in self.results.iter().zip(&identities).enumerate() {
            let Some(identity) = identity else { continue };
            let is_same = |input: &&Named| input.identity().as_ref() == Some(identity);
            if let Some(input) = self.inputs.iter().find(is_same) {
                return Err(result.would_replace(input));
            }
            let earlier = self.results.iter().zip(&identities).take(i);
            let mut twice = earlier.filter(|(_, other)| other.as_ref() == Some(identity));
            if let Some((other, _)) = twice.next() {
                return Err(result.meets(other));
            }
        }
        self.results
            .iter()
            .try_for_each(Named::is_called_as_it_is)?;
        let mut to_files = self.results.iter().filter(|r| !is_standard(&r.path));
        to_files.try_for_each(|r| save::probe(&r.path, r.role == CHANGED))
    }

    fn standard(&self) -> Result<(), Error> {
        let among = |files: &[Named]| -> Vec<String> {
            let standard = files.iter().filter(|f| is_standard(&f.path));
            standard.map(|f| format!("{} -", f.role)).collect()
        };
        let read = among(&self.inputs);
        if read.len() > 1 {
            let both = read.join(" and ");
            return Err(
                Error::input(format!("{both} would both read standard input"))
                    .hint("name a file for one of them"),
            );
        }
        let mut written = among(&self.results);
        written.extend(self.printed.map(str::to_owned));
        if written.len() > 1 {
            let all = written.join(" and ");
            return Err(Error::input(format!(
                "only one result can go to standard output, found {all}"
            ))
            .hint("name a file for each of the others"));
        }
        Ok(())
    }
}

fn named(role: &'static str, path: Option<&Path>) -> Option<Named> {
    let path = path?.to_owned();
    let content = Content::Any;
    Some(Named {
        role,
        path,
        content,
    })
}

impl Named {
    fn would_replace(&self, input: &Self) -> Error {
        let (option, to) = (self.role, self.path.display());
        let (role, from) = (input.role, input.path.display());
        let same = match self.path == input.path {
            true => format!("{option} {to} would replace {role} that this command reads"),
            false => format!("{option} {to} would replace {role} {from}: they are the same file"),
        };
        Error::input(same).hint("give the result another name")
    }

    fn meets(&self, other: &Self) -> Error {
        Error::input(format!(
            "{} {} and {} {} would write the same file",
            other.role,
            other.path.display(),
            self.role,
            self.path.display()
        ))
        .hint("give each result a name of its own")
    }

    /// Refuses a picture whose name says another format.
    fn is_called_as_it_is(&self) -> Result<(), Error> {
        let kind = self
            .path
            .extension()
            .filter(|_| self.content == Content::Picture);
        match kind {
            Some(kind) if !kind.eq_ignore_ascii_case("svg") => Err(Error::input(format!(
                "{} {}: pictures are SVG, found the name of another format",
                self.role,
                self.path.display()
            ))
            .hint("name it *.svg, which browsers and editors open and convert")),
            _ => Ok(()),
        }
    }

    /// None where nothing can be lost: a device, a pipe, a terminal.
    fn identity(&self) -> Option<Identity> {
        if is_standard(&self.path) {
            return None;
        }
        let place = save::destination(&self.path);
        match std::fs::metadata(&place) {
            Ok(data) if data.is_file() => Some(existing(&place, &data)),
            Ok(_) => None,
            Err(_) => Some(Identity::Place(to_come(&place))),
        }
    }
}

/// What two names of the same file have in common.
#[derive(Debug, PartialEq)]
enum Identity {
    #[cfg(unix)]
    Inode {
        device: u64,
        inode: u64,
    },
    Place(PathBuf),
}

#[cfg(unix)]
fn existing(_: &Path, data: &std::fs::Metadata) -> Identity {
    use std::os::unix::fs::MetadataExt;
    Identity::Inode {
        device: data.dev(),
        inode: data.ino(),
    }
}

#[cfg(not(unix))]
fn existing(place: &Path, _: &std::fs::Metadata) -> Identity {
    Identity::Place(std::fs::canonicalize(place).unwrap_or_else(|_| place.to_owned()))
}

/// The place of a file that does not exist: its folder, however that was reached, and its name.
fn to_come(place: &Path) -> PathBuf {
    let folder = save::folder(place);
    let folder = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let name = place.file_name().unwrap_or_default();
    // where file names usually differ by more than their case
    match cfg!(any(windows, target_os = "macos")) {
        true => folder.join(name.to_string_lossy().to_lowercase()),
        false => folder.join(name),
    }
}
