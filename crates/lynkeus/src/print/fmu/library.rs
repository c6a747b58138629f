//! The library of an archive, by the system's C compiler.

mod folder;

use std::env::consts::{ARCH, DLL_EXTENSION, OS};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lynkeus_export::curly::fmu::Version;
use lynkeus_expr::Budget;

use folder::Folder;

/// Compilers that take the options of cc, in the order in which they are tried.
const COMPILERS: [&str; 3] = ["cc", "gcc", "clang"];

/// A compiler that is not done by then is stopped.
const LONGEST: Duration = Duration::from_secs(60);

/// Where the library of this machine lies in the archive.
pub(super) fn place(name: &str, version: Version) -> String {
    let system = match OS {
        "macos" => "darwin",
        other => other,
    };
    let platform = match (version, ARCH, system) {
        (Version::Two, "x86_64", "linux") => "linux64".to_owned(),
        (Version::Two, "x86_64", "darwin") => "darwin64".to_owned(),
        (Version::Two, "x86_64", "windows") => "win64".to_owned(),
        _ => format!("{ARCH}-{system}"),
    };
    format!("binaries/{platform}/{name}.{}", extension(system))
}

fn extension(system: &str) -> &'static str {
    match system {
        "darwin" => "dylib",
        _ => DLL_EXTENSION,
    }
}

/// What a compiler writes of what it refuses.
const ERRORS: &str = "errors.txt";

/// Why there is no library.
#[derive(Debug, PartialEq)]
pub(super) enum Missing {
    /// no compiler, or none that can be run here
    Compiler(String),
    /// a compiler that does not take the sources: which, and its first lines
    Refused { compiler: String, told: String },
}

impl From<String> for Missing {
    fn from(why: String) -> Self {
        Self::Compiler(why)
    }
}

/// The library of the sources among the files, within the limits of the command.
///
/// # Errors
/// Why there is none.
pub(super) fn compile(
    name: &str,
    files: &[(String, Vec<u8>)],
    budget: &Budget,
) -> Result<Vec<u8>, Missing> {
    let folder = Folder::new().map_err(|e| format!("no temporary folder: {e}"))?;
    let mut sources = vec![];
    for (path, content) in files {
        let Some(file) = path.strip_prefix("sources/") else {
            continue;
        };
        let written = std::fs::write(folder.path().join(file), content);
        written.map_err(|e| format!("a temporary file cannot be written: {e}"))?;
        if file.ends_with(".c") {
            sources.push(file.to_owned());
        }
    }
    let library = format!("{name}.{DLL_EXTENSION}");
    for compiler in COMPILERS {
        if let Some(started) = start(compiler, folder.path(), &library, &sources, budget) {
            finish(compiler, started?, folder.path(), budget)?;
            return std::fs::read(folder.path().join(&library))
                .map_err(|e| format!("{compiler} left no library: {e}").into());
        }
    }
    let compilers = COMPILERS.join(", ");
    Err(Missing::Compiler(format!(
        "no C compiler was found ({compilers})"
    )))
}

/// The compiler at work; none where there is no such compiler.
fn start(
    compiler: &str,
    folder: &Path,
    library: &str,
    sources: &[String],
    budget: &Budget,
) -> Option<Result<Child, String>> {
    let mut command = confined(compiler, budget.room())?;
    command.args(["-std=c99", "-O2", "-shared", "-fvisibility=hidden"]);
    // the same digits as `estimate`
    command.arg("-ffp-contract=off");
    if !cfg!(windows) {
        command.arg("-fPIC");
    }
    command.args(["-o", library]).args(sources).arg("-lm");
    command.current_dir(folder).stdin(Stdio::null());
    // a file, which is never full: nobody reads before the end
    let errors = match File::create(folder.join(ERRORS)) {
        Ok(file) => Stdio::from(file),
        Err(e) => return Some(Err(format!("a temporary file cannot be written: {e}"))),
    };
    command.stdout(Stdio::null()).stderr(errors);
    match command.spawn() {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        started => Some(started.map_err(|e| format!("{compiler} cannot be started: {e}"))),
    }
}

/// A compiler that gets no more memory than this, where the system can see to it; none where there is
/// no such compiler.
#[cfg(target_os = "linux")]
fn confined(compiler: &str, room: Option<usize>) -> Option<Command> {
    use std::os::unix::process::CommandExt;
    let is_there = |folder: std::path::PathBuf| folder.join(compiler).is_file();
    let path = std::env::var_os("PATH")?;
    if !std::env::split_paths(&path).any(is_there) {
        return None;
    }
    let mut command = match room {
        None => Command::new(compiler),
        Some(bytes) => {
            let mut shell = Command::new("/bin/sh");
            let script = "ulimit -v \"$0\" && exec \"$@\"";
            shell.args(["-c", script, &(bytes >> 10).to_string(), compiler]);
            shell
        }
    };
    // what it starts itself ends with it
    command.process_group(0);
    Some(command)
}

#[cfg(not(target_os = "linux"))]
fn confined(compiler: &str, _: Option<usize>) -> Option<Command> {
    Some(Command::new(compiler))
}

/// Ends the compiler and what it has started.
fn stop(child: &mut Child) {
    if cfg!(target_os = "linux") {
        let group = format!("-{}", child.id());
        let mut kill = Command::new("/bin/sh");
        kill.args(["-c", "kill -KILL \"$0\"", &group]);
        let _ = kill.stderr(Stdio::null()).status();
    }
    let _ = child.kill();
    let _ = child.wait();
}

fn finish(compiler: &str, mut child: Child, folder: &Path, budget: &Budget) -> Result<(), Missing> {
    let began = Instant::now();
    let ended = loop {
        match child.try_wait() {
            Err(e) => return Err(format!("{compiler} cannot be waited for: {e}").into()),
            Ok(Some(status)) => break status,
            Ok(None) if began.elapsed() > LONGEST => {
                stop(&mut child);
                return Err(format!("{compiler} was not done after {LONGEST:?}").into());
            }
            Ok(None) if let Some(spent) = budget.spent() => {
                stop(&mut child);
                return Err(format!("{compiler} was stopped: {spent}").into());
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    if ended.success() {
        return Ok(());
    }
    let mut told = vec![];
    if let Ok(errors) = File::open(folder.join(ERRORS)) {
        // a few lines say why
        let _ = errors.take(4096).read_to_end(&mut told);
    }
    Err(Missing::Refused {
        compiler: format!("{compiler} ({ended})"),
        told: first_errors(&String::from_utf8_lossy(&told)),
    })
}

/// The lines that name errors, else the first ones: three at most.
fn first_errors(told: &str) -> String {
    let lines = || told.lines().map(str::trim).filter(|line| !line.is_empty());
    let mut first: Vec<&str> = lines().filter(|l| l.contains("error")).take(3).collect();
    if first.is_empty() {
        first = lines().take(3).collect();
    }
    first.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_come_before_what_leads_to_them() {
        let told = "a.c: In function 'f':\na.c:3:1: error: one\n   3 | x\na.c:4:1: error: two\n";
        assert_eq!(
            first_errors(told),
            "a.c:3:1: error: one; a.c:4:1: error: two"
        );
        assert_eq!(first_errors("cc: out of disk\n\n"), "cc: out of disk");
        assert_eq!(first_errors(""), "");
    }
}
