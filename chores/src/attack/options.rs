//! What to attack, and for how long.

use std::path::PathBuf;
use std::time::Duration;

use crate::options;
use xtask::process::{cargo, root, run, target};

/// What was asked for.
#[derive(Clone, Debug)]
pub struct Options {
    pub seed: u64,
    /// cases
    pub count: u64,
    /// after which no further case starts
    pub seconds: Option<u64>,
    /// the longest that a command may run
    pub limit: Duration,
    /// the command; built where none is named
    pub binary: Option<PathBuf>,
    /// where findings are kept
    pub folder: PathBuf,
}

/// The command as `cargo xtask test` has built it. Features of dependencies are those of the whole and of its tests, for which one
/// test has to be asked for: with others, all of it would be compiled again.
const AS_TESTED: [&str; 8] = [
    "build",
    "--workspace",
    "--exclude",
    "chores",
    "--bin",
    "lynkeus",
    "--test",
    "circles",
];

impl Options {
    /// Reads `--seed N --count N --seconds N --limit SECONDS --binary FILE`.
    pub fn read(arguments: &[String]) -> Result<Self, String> {
        let mut asked = Self {
            seed: 1,
            count: 100_000,
            seconds: None,
            limit: Duration::from_secs(60),
            binary: None,
            folder: root().join("target/attack"),
        };
        options::read(arguments, |pair| {
            match pair.key {
                "--seed" => asked.seed = pair.number()?,
                "--count" => asked.count = pair.number()?,
                "--seconds" => asked.seconds = Some(pair.number()?),
                "--limit" => asked.limit = Duration::from_secs(pair.number()?),
                "--binary" => asked.binary = Some(pair.path()),
                _ => return pair.refuse("--seed, --count, --seconds, --limit or --binary"),
            }
            Ok(())
        })?;
        Ok(asked)
    }

    /// The command that is attacked, as an absolute path.
    pub fn binary(&self) -> Result<PathBuf, String> {
        if let Some(path) = &self.binary {
            return path
                .canonicalize()
                .map_err(|e| format!("{}: {e}", path.display()));
        }
        let (build, folder): (&[&str], _) = match cfg!(debug_assertions) {
            true => (&AS_TESTED, "debug"),
            false => (&["build", "--release", "-p", "lynkeus-cli"], "release"),
        };
        run(&mut cargo(build))?;
        let name = format!("lynkeus{}", std::env::consts::EXE_SUFFIX);
        Ok(target().join(folder).join(name))
    }
}
