//! `[serve]`: how a study's estimator runs beside a plant.

use std::path::{Path, PathBuf};

use super::Name;
use super::keys::SERVE;
use super::section::Entry;
use lynkeus_answer::Error;

/// How a study's estimator runs beside a plant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServeSettings {
    /// So long a row that is older than another is waited for, in units of the plant's time.
    pub wait: f64,
    /// The file in which it keeps where it is.
    pub state: Option<PathBuf>,
    /// The files of what was told, one for each day: `%Y`, `%m` and `%d` are its date.
    pub history: Option<PathBuf>,
    /// How many days of it are kept; `None`: all.
    pub keep_days: Option<u64>,
    /// The table of the assets, where there are several.
    pub assets: Option<PathBuf>,
    /// The address of the page, with a port.
    pub http: Option<Name>,
    /// What those who look have to say.
    pub token: Option<Name>,
}

impl ServeSettings {
    /// Files of a study are named from its folder.
    pub(super) fn beside(&mut self, folder: &Path) {
        let paths = [&mut self.state, &mut self.history, &mut self.assets];
        for path in paths.into_iter().flatten() {
            *path = folder.join(&*path);
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<ServeSettings, Error> {
    let mut section = entry.section("[serve]", &SERVE)?;
    Ok(ServeSettings {
        wait: section.optional("wait", waited)?.unwrap_or(0.0),
        state: section.optional("state", path)?,
        history: section.optional("history", history)?,
        keep_days: section.optional("keep_days", |e| e.whole(1))?,
        assets: section.optional("assets", path)?,
        http: section.optional("http", Entry::name)?,
        token: section.optional("token", Entry::name)?,
    })
}

/// A time to wait.
fn waited(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a time >= 0, in units of the plant's time");
    entry.number().ok().filter(|t| *t >= 0.0).ok_or(refusal)
}

fn path(entry: Entry<'_>) -> Result<PathBuf, Error> {
    Ok(PathBuf::from(entry.name()?.text))
}

/// The path of a file for each day.
fn history(entry: Entry<'_>) -> Result<PathBuf, Error> {
    let refusal = entry.wrong("the path of a CSV file with %Y, %m and %d: \"tank-%Y-%m-%d.csv\"");
    let name = entry.name()?.text;
    let is_whole = ["%Y", "%m", "%d"].iter().all(|part| name.contains(part));
    let is_csv = name.ends_with(".csv");
    (is_whole && is_csv)
        .then(|| PathBuf::from(name))
        .ok_or(refusal)
}
