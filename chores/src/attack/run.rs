//! One command at a time in a folder of its own, with a limit on time and memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::commands::Command;
use super::{Case, Finding, oracle};

/// The address space of a command in KiB, where the system can limit it.
#[cfg(unix)]
const MEMORY: u64 = 3 << 20;

/// Every file of a folder.
pub type Snapshot = BTreeMap<String, Vec<u8>>;

/// A folder in which commands run.
pub struct Desk {
    folder: PathBuf,
    binary: PathBuf,
    limit: Duration,
}

/// How a command ended.
pub struct Ended {
    /// none where it had to be ended
    pub status: Option<ExitStatus>,
    pub out: Vec<u8>,
    pub err: Vec<u8>,
}

impl Desk {
    pub fn new(
        folder: &Path,
        number: usize,
        binary: &Path,
        limit: Duration,
    ) -> Result<Self, String> {
        let folder = folder.join(format!("desk-{number}"));
        std::fs::create_dir_all(folder.join("case"))
            .map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(Self {
            folder,
            binary: binary.to_owned(),
            limit,
        })
    }

    /// Runs the commands of a case up to the first that does what it must not.
    pub fn attack(&self, case: &Case) -> Result<(usize, Option<Finding>), String> {
        let place = self.folder.join("case");
        let failed = |e: std::io::Error| format!("{}: {e}", place.display());
        std::fs::remove_dir_all(&place).map_err(failed)?;
        std::fs::create_dir(&place).map_err(failed)?;
        for (name, bytes) in &case.files {
            std::fs::write(place.join(name), bytes).map_err(failed)?;
        }
        for (i, command) in case.commands.iter().enumerate() {
            let before = snapshot(&place).map_err(failed)?;
            let ended = self.run(&place, command).map_err(failed)?;
            let after = snapshot(&place).map_err(failed)?;
            let finding = oracle::judge(command, &ended, &before, &after);
            if finding.is_some() {
                return Ok((i + 1, finding));
            }
        }
        Ok((case.commands.len(), None))
    }

    fn run(&self, place: &Path, command: &Command) -> std::io::Result<Ended> {
        let [out, err] = ["out", "err"].map(|name| self.folder.join(name));
        let mut child = self
            .process()
            .args(&command.arguments)
            .current_dir(place)
            .stdin(Stdio::null())
            .stdout(File::create(&out)?)
            .stderr(File::create(&err)?)
            .spawn()?;
        let since = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break Some(status);
            }
            if since.elapsed() > self.limit {
                child.kill()?;
                child.wait()?;
                break None;
            }
            std::thread::sleep(
                (since.elapsed() / 10).clamp(Duration::from_millis(1), Duration::from_millis(100)),
            );
        };
        Ok(Ended {
            status,
            out: std::fs::read(out)?,
            err: std::fs::read(err)?,
        })
    }

    #[cfg(unix)]
    fn process(&self) -> Process {
        let mut shell = Process::new("sh");
        let script = format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\"");
        shell.args(["-c", &script]).arg(&self.binary);
        shell
    }

    #[cfg(not(unix))]
    fn process(&self) -> Process {
        Process::new(&self.binary)
    }
}

fn snapshot(folder: &Path) -> std::io::Result<Snapshot> {
    let mut files = Snapshot::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        files.insert(name, std::fs::read(entry.path())?);
    }
    Ok(files)
}
