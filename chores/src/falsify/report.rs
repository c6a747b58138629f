//! What was asked for, and what was found.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use super::case::{Case, Kind};
use super::judge::{Effort, Flaw, Violation};
use super::tally::{Counts, Tally};
use crate::options;

const KEYS: &str = "--seed, --count, --refutations, --plants, --seconds or --family";

/// What to search, and for how long.
#[derive(Clone, Debug)]
pub struct Options {
    pub seed: u64,
    /// certificates to reach, proved ones
    pub count: usize,
    /// refutations to look at
    pub refutations: usize,
    /// plants at most
    pub plants: Option<u64>,
    /// after which the search ends, reached or not
    pub seconds: Option<u64>,
    /// all where none is named
    pub kind: Option<Kind>,
    /// where false claims are kept
    pub folder: PathBuf,
}

impl Options {
    /// Reads `--seed N --count N --refutations N --plants N --seconds N --family F`.
    pub fn read(arguments: &[String]) -> Result<Self, String> {
        let mut asked = Self {
            seed: 1,
            count: 20_000,
            refutations: 5_000,
            plants: None,
            seconds: None,
            kind: None,
            folder: PathBuf::from("target/falsify"),
        };
        options::read(arguments, |pair| {
            match pair.key {
                "--seed" => asked.seed = pair.number()?,
                "--count" => asked.count = pair.number()? as usize,
                "--refutations" => asked.refutations = pair.number()? as usize,
                "--plants" => asked.plants = Some(pair.number()?),
                "--seconds" => asked.seconds = Some(pair.number()?),
                "--family" => asked.kind = Some(kind(pair.value)?),
                _ => return pair.refuse(KEYS),
            }
            Ok(())
        })?;
        Ok(asked)
    }

    /// All families examine one plant in sixteen, for their refutations; every one, and
    /// nothing else, once enough is proved.
    pub fn effort(&self, index: u64, proved: usize) -> Effort {
        let enough = proved >= self.count;
        Effort {
            runs: 30,
            targets: 4,
            thorough: enough || index.is_multiple_of(16),
            facts: true,
            refutations_only: enough,
        }
    }
}

fn kind(word: &str) -> Result<Kind, String> {
    let words: Vec<&str> = Kind::ALL.iter().map(|k| k.word()).collect();
    let found = Kind::ALL.into_iter().find(|k| k.word() == word);
    found.ok_or_else(|| {
        format!(
            "--family: expected one of {}, found \"{word}\"",
            words.join(", ")
        )
    })
}

/// A false claim, as small as it could be made.
pub struct Found {
    pub index: u64,
    pub case: Case,
    pub violation: Violation,
}

impl Found {
    /// False claims of one sort probably have one cause.
    fn sort(&self) -> String {
        let kind = self.case.kind.word();
        let evidence = &self.violation.evidence;
        // what is said first is what the claim rests on
        let basis = evidence.split([':', '\n']).next().unwrap_or_default();
        match &self.violation.flaw {
            flaw @ (Flaw::Exceeded | Flaw::Witness | Flaw::Panic) => {
                format!("{flaw:?}, {kind}, {basis}")
            }
            flaw => format!("{flaw:?}, {kind}"),
        }
    }
}

pub struct Report {
    pub tally: Tally,
    pub found: Vec<Found>,
    started: Instant,
    said: usize,
}

/// False claims that are kept; many more are of the same kind.
const KEPT: usize = 400;

impl Report {
    pub fn new() -> Self {
        Self {
            tally: Tally::default(),
            found: vec![],
            started: Instant::now(),
            said: 0,
        }
    }

    /// Whether a flaw of a kind of case has been made small often enough.
    pub fn is_common(&self, kind: Kind, flaw: &Flaw) -> bool {
        let alike = |found: &&Found| found.case.kind == kind && found.violation.flaw == *flaw;
        self.found.iter().filter(alike).count() >= 3
    }

    pub fn is_enough(&self, options: &Options) -> bool {
        let total = self.tally.total();
        let reached = total.proved >= options.count && total.refutations >= options.refutations;
        let late = options
            .seconds
            .is_some_and(|s| self.started.elapsed().as_secs() >= s);
        // a search in which nothing is proved ends, too
        let wanted = options.count.saturating_add(options.refutations).max(50);
        reached || late || total.plants >= wanted.saturating_mul(40)
    }

    pub fn add(
        &mut self,
        options: &Options,
        kind: Kind,
        index: u64,
        counts: &Counts,
        found: Option<(Case, Violation)>,
    ) -> Result<(), String> {
        self.tally.add(kind, counts);
        let total = self.tally.total();
        if total.plants / 2000 > self.said {
            self.said = total.plants / 2000;
            let seconds = self.started.elapsed().as_secs();
            eprintln!(
                "{} plants, {} certificates proved, {} false, {} refutations, {} wrong, {seconds} s",
                total.plants,
                total.proved,
                self.found.len(),
                total.refutations,
                total.wrong
            );
        }
        let Some((case, violation)) = found else {
            return Ok(());
        };
        if self.found.len() < KEPT {
            let folder = options.folder.join(format!("{}-{index}", options.seed));
            keep(&folder, &case, &violation).map_err(|e| format!("{}: {e}", folder.display()))?;
        }
        self.found.push(Found {
            index,
            case,
            violation,
        });
        Ok(())
    }

    /// The table, then the false claims by sort.
    pub fn text(&self) -> String {
        let seconds = self.started.elapsed().as_secs();
        let mut text = self.tally.table();
        text += &format!(
            "\n{seconds} s; witnesses of further conditions: {}\n",
            self.tally.total().unread
        );
        let mut sorts = BTreeMap::<_, Vec<u64>>::new();
        for found in &self.found {
            sorts.entry(found.sort()).or_default().push(found.index);
        }
        for (sort, indices) in sorts {
            let first: Vec<String> = indices.iter().take(5).map(u64::to_string).collect();
            text += &format!("{sort}: {}, e.g. {}\n", indices.len(), first.join(", "));
        }
        text
    }
}

/// The case as a folder that the command can be run on, with the evidence.
fn keep(folder: &std::path::Path, case: &Case, violation: &Violation) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("plant.mo"), case.model())?;
    std::fs::write(folder.join("study.toml"), case.study())?;
    let text = format!("{:?}\n{}\n", violation.flaw, violation.evidence);
    std::fs::write(folder.join("evidence.txt"), text)
}
