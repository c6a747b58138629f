//! Studies and logs, from files or from standard input.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use lynkeus::expr::Budget;
use lynkeus::{Error, Study, Table};

use super::files::{Files, is_standard};

/// What messages call standard input.
const STANDARD: &str = "standard input";

/// A study and the file that it came from.
pub(super) struct Source {
    pub study: Study,
    path: PathBuf,
}

impl Source {
    pub fn load(path: &Path) -> Result<Self, Error> {
        let study = match is_standard(path) {
            true => Study::parse(&standard_input()?, STANDARD),
            false => Study::load(path),
        };
        Ok(Self {
            study: study?,
            path: path.to_owned(),
        })
    }

    /// The same under a budget of time and memory.
    pub fn within(mut self, budget: Budget) -> Self {
        self.study.budget = budget;
        self
    }

    /// A study, or a model that stands for one.
    pub fn load_or_bare(path: &Path, model: Option<String>) -> Result<Self, Error> {
        if !is_standard(path) {
            return Ok(Self {
                study: Study::load_or_bare(path, model)?,
                path: path.to_owned(),
            });
        }
        let mut source = Self::load(path)?;
        source.study.model = model.or(source.study.model);
        Ok(source)
    }

    /// What the study makes a command read.
    pub fn files(&self) -> Files {
        self.plant().reads("the study", Some(&self.path))
    }

    /// The model alone, for a command that writes the study.
    pub fn plant(&self) -> Files {
        Files::default().reads("the model", self.study.plant.as_deref())
    }
}

/// A log.
pub(super) fn log(path: &Path) -> Result<Table, Error> {
    match is_standard(path) {
        true => Table::read(io::stdin().lock(), STANDARD),
        false => Table::load(path),
    }
}

fn standard_input() -> Result<String, Error> {
    let mut text = String::new();
    let read = io::stdin().lock().read_to_string(&mut text);
    read.map_err(|e| Error::input(format!("cannot read {STANDARD}: {e}")))?;
    match text.strip_prefix('\u{feff}') {
        Some(rest) => Ok(rest.to_owned()),
        None => Ok(text),
    }
}
