//! Studies and logs, from files or from standard input.

use std::path::{Path, PathBuf};

use lynkeus::expr::Budget;
use lynkeus::{Error, Incoming, Study, Table};

use super::files::Files;
use super::save::is_standard;

/// What messages call standard input.
const STANDARD: &str = "standard input";

/// A study and the file that it came from.
pub(super) struct Source {
    pub study: Study,
    path: PathBuf,
}

impl Source {
    /// A study, read and worked on under a budget of time and memory.
    pub fn load(path: &Path, budget: Budget) -> Result<Self, Error> {
        let mut study = match is_standard(path) {
            true => Study::parse(&Incoming::standard(&budget).text(STANDARD)?, STANDARD),
            false => Study::load_within(path, &budget),
        }?;
        study.budget = budget;
        Ok(Self {
            study,
            path: path.to_owned(),
        })
    }

    /// A study, or a model that stands for one.
    pub fn load_or_bare(path: &Path, model: Option<String>, budget: Budget) -> Result<Self, Error> {
        let mut source = match Study::bare(path).filter(|_| !is_standard(path)) {
            Some(study) => Self {
                study: Study { budget, ..study },
                path: path.to_owned(),
            },
            None => Self::load(path, budget)?,
        };
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

/// The log of a study.
pub(super) fn log(study: &Study, path: &Path) -> Result<Table, Error> {
    match is_standard(path) {
        true => lynkeus::log_of(study, Incoming::standard(&study.budget), STANDARD),
        false => lynkeus::log(study, path),
    }
}
