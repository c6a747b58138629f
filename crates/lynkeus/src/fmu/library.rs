//! The library of an archive, by the system's C compiler.

use std::env::consts::{ARCH, DLL_EXTENSION, OS};
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lynkeus_export::curly::fmu::Version;

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

/// The library of the sources among the files, or why there is none.
pub(super) fn compile(name: &str, files: &[(String, Vec<u8>)]) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
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
        if let Some(started) = start(compiler, folder.path(), &library, &sources) {
            finish(compiler, started?)?;
            return std::fs::read(folder.path().join(&library))
                .map_err(|e| format!("{compiler} left no library: {e}"));
        }
    }
    Err(format!(
        "no C compiler was found ({})",
        COMPILERS.join(", ")
    ))
}

/// The compiler at work; none where there is no such compiler.
fn start(
    compiler: &str,
    folder: &Path,
    library: &str,
    sources: &[String],
) -> Option<Result<Child, String>> {
    let mut command = Command::new(compiler);
    command.args(["-std=c99", "-O2", "-shared", "-fvisibility=hidden"]);
    // the same digits as `estimate`
    command.arg("-ffp-contract=off");
    if !cfg!(windows) {
        command.arg("-fPIC");
    }
    command.args(["-o", library]).args(sources).arg("-lm");
    command.current_dir(folder).stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    match command.spawn() {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        started => Some(started.map_err(|e| format!("{compiler} cannot be started: {e}"))),
    }
}

fn finish(compiler: &str, mut child: Child) -> Result<(), String> {
    let began = Instant::now();
    let ended = loop {
        match child.try_wait() {
            Err(e) => return Err(format!("{compiler} cannot be waited for: {e}")),
            Ok(Some(status)) => break status,
            Ok(None) if began.elapsed() > LONGEST => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("{compiler} was not done after {LONGEST:?}"));
            }
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    if ended.success() {
        return Ok(());
    }
    let mut told = vec![];
    if let Some(errors) = child.stderr.take() {
        // a few lines say why
        let _ = errors.take(4096).read_to_end(&mut told);
    }
    let told = String::from_utf8_lossy(&told);
    let first = told.lines().next().unwrap_or_default();
    Err(format!("{compiler} ended with {ended}: {first}"))
}
