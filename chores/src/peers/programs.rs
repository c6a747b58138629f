//! What runs the peers, and where.

use std::fs;
use std::path::PathBuf;

use super::peer::text;
use xtask::process::root;
use xtask::python;

pub(super) const REQUIREMENTS: &str = include_str!("../../peers/requirements.txt");

/// What runs the peers.
pub(super) struct Programs {
    /// for studies, logs, programs and tables
    pub folder: PathBuf,
    pub python: PathBuf,
    this: PathBuf,
    /// the command
    pub lynkeus: PathBuf,
}

impl Programs {
    /// # Errors
    /// No Python, or no command `lynkeus` beside this program.
    pub fn new() -> Result<Self, String> {
        let this = std::env::current_exe().map_err(|error| error.to_string())?;
        let name = format!("lynkeus{}", std::env::consts::EXE_SUFFIX);
        let programs = Self {
            folder: root().join("target").join("peers"),
            python: python::environment(".venv-peers", REQUIREMENTS)?,
            lynkeus: this.with_file_name(name),
            this,
        };
        if !programs.lynkeus.exists() {
            return Err(format!(
                "{}: expected the command beside this program; `cargo build --release` makes it",
                programs.lynkeus.display()
            ));
        }
        let folder = &programs.folder;
        fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(programs)
    }

    /// The command of a script beside the peers.
    pub fn script(&self, name: &str, arguments: &[&str]) -> Vec<String> {
        let script = root().join("chores").join("peers").join(name);
        let files = [&self.python, &script].map(|path| text(path));
        let arguments = arguments.iter().map(|&a| a.to_owned());
        files.into_iter().chain(arguments).collect()
    }

    /// The command of one of ours.
    pub fn ours(&self, what: &str) -> Vec<String> {
        vec![text(&self.this), "bench-ours".to_owned(), what.to_owned()]
    }

    /// What prints processor time, clock and peak memory of a command.
    pub fn measured(&self, command: &[String]) -> Vec<String> {
        let command: Vec<&str> = command.iter().map(String::as_str).collect();
        self.script("column.py", &[&["measure"], &command[..]].concat())
    }
}
