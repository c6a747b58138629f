//! The runs in words, as JSON and as columns.

use std::fmt;

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_words::figures;
use serde::Serialize;
use serde_json::{Value, json};

use super::statistics::{HIGH, mean, quantile};
use super::{Again, Failure, MonteCarlo, Scattered};
use crate::entries::{Named, finite};
use crate::judge::accuracy::Covered;
use crate::judge::outcome::Ended;
use crate::prepare::headers::Headers;
use crate::{Answer, Error, Series};

/// Seeds of runs that are told one by one.
const TOLD: usize = 20;

/// The errors of a quantity over the last half of the rows, in one figure per run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settled {
    /// The mean over the runs.
    pub mean: f64,
    /// 95 % of the runs are below.
    pub q95: f64,
    /// The worst run.
    pub worst: f64,
}

/// The answer of `simulate` with `runs`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MonteCarloReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// the observer family
    family: &'static str,
    /// runs that were asked for
    runs: usize,
    /// runs that came to their end
    completed: usize,
    /// runs that did not
    failed: Counted<'a>,
    /// runs against which something speaks
    not_credible: Counted<'a>,
    /// whether nothing speaks against the whole
    credible: bool,
    /// why there are no more runs, where a limit ended them
    ended: Option<Ended>,
    /// number of rows
    rows: usize,
    /// each estimated quantity
    quantities: Named<ScatteredEntry<'a>>,
    /// what you should know
    notes: &'a [String],
}

/// Runs that went another way.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Counted<'a> {
    /// how many
    count: usize,
    /// their seeds
    seeds: Vec<u64>,
    /// why the first of them did
    first_reason: Option<&'a str>,
}

/// A quantity over many runs.
#[derive(Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Scattered")
)]
struct ScatteredEntry<'a> {
    /// its unit
    unit: Option<&'a str>,
    /// headers of its columns
    columns: &'a [String],
    /// errors over the last half of the rows, in its unit
    rms_last_half: SettledErrors,
    /// these beside standard deviations
    #[serde(flatten)]
    covered: Covered,
}

/// Root mean square errors over the last half of the rows, over many runs.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SettledErrors {
    /// their mean
    mean: Option<f64>,
    /// 95 % of the runs are below
    q95: Option<f64>,
    /// the worst
    worst: Option<f64>,
    /// the seed of the worst run
    worst_seed: Option<u64>,
}

impl<'a> From<&'a [Failure]> for Counted<'a> {
    fn from(runs: &'a [Failure]) -> Self {
        Self {
            count: runs.len(),
            seeds: runs.iter().map(|f| f.seed).collect(),
            first_reason: runs.first().map(|f| &*f.reason),
        }
    }
}

impl Scattered {
    /// The RMS errors of the runs in three figures.
    #[must_use]
    pub fn settled(&self) -> Settled {
        let mut sorted = self.rms.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        Settled {
            mean: mean(&self.rms),
            q95: quantile(&sorted, HIGH),
            worst: sorted.last().copied().unwrap_or(f64::NAN),
        }
    }
}

impl Again {
    /// How to repeat the run of a seed.
    fn in_words(self, seed: u64) -> String {
        match self {
            Self::Alone => format!("`lynkeus simulate --seed {seed}` repeats it alone"),
            Self::InABatch => format!(
                "`lynkeus simulate --runs 1 --seed {seed}` repeats it; without `--runs` exp, sin and the like are rounded otherwise"
            ),
        }
    }
}

impl fmt::Display for Again {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alone => "--seed repeats one alone",
            Self::InABatch => {
                "--runs 1 --seed repeats one, --seed alone up to the rounding of exp, sin and the like"
            }
        })
    }
}

impl MonteCarlo {
    /// The columns of the table: the time; of every quantity the mean, the 5 % and the 95 % quantile of its
    /// true value (`<name>_mean`, `_q05`, `_q95`) and of its error (`<name>_error_mean`, …), and the largest
    /// |error| (`<name>_error_worst`).
    #[must_use]
    pub fn columns(&self) -> Vec<(String, &[f64])> {
        let mut columns: Vec<(String, &[f64])> = vec![(self.time_header.clone(), &self.time)];
        for q in &self.quantities {
            let (truth, error) = (&q.truth, &q.error);
            let values: [&[f64]; 7] = [
                &truth.mean,
                &truth.low,
                &truth.high,
                &error.mean,
                &error.low,
                &error.high,
                &q.error_worst,
            ];
            columns.extend(q.headers.iter().cloned().zip(values));
        }
        columns
    }

    /// The answer "no" where a run diverged or was refused, its estimate is not credible, or a limit left runs undone.
    #[must_use]
    pub fn refusal(&self) -> Option<Error> {
        let (runs, what) = match self.failures.is_empty() {
            true => (&self.doubtful, "have estimates that are not credible"),
            false => (&self.failures, "did not reach their end"),
        };
        let Some(first) = runs.first() else {
            let limit = Error::refused(self.limit.as_ref()?).at(&self.file);
            return Some(limit.as_ended().hint("allow more time or memory"));
        };
        let message = format!(
            "{} of {} runs {what}; the first, of seed {}: {}",
            runs.len(),
            self.asked,
            first.seed,
            first.reason
        );
        // whether an estimate is credible was asked of the run alone
        let again = match self.failures.is_empty() {
            true => Again::Alone,
            false => self.again,
        };
        Some(Error::refused(message).hint(again.in_words(first.seed)))
    }

    fn worst_seed(&self, quantity: &Scattered) -> Option<u64> {
        self.seeds.get(quantity.worst_run).copied()
    }

    /// For machines.
    #[must_use]
    pub fn entries(&self) -> Value {
        let quantities = self.quantities.iter();
        json!(MonteCarloReport {
            plant: &self.plant,
            family: self.family,
            runs: self.asked,
            completed: self.seeds.len(),
            failed: Counted::from(&*self.failures),
            not_credible: Counted::from(&*self.doubtful),
            credible: self.refusal().is_none(),
            ended: self.limit.as_ref().map(|message| Ended {
                message: message.clone(),
                file: self.file.clone(),
                by_limit: true,
                followed: vec![],
            }),
            rows: self.time.len(),
            quantities: quantities
                .map(|q| (q.name.clone(), self.entry(q)))
                .collect(),
            notes: &self.notes,
        })
    }

    fn entry<'a>(&self, q: &'a Scattered) -> ScatteredEntry<'a> {
        let Settled { mean, q95, worst } = q.settled();
        ScatteredEntry {
            unit: q.unit.as_deref(),
            columns: &q.headers,
            rms_last_half: SettledErrors {
                mean: finite(mean),
                q95: finite(q95),
                worst: finite(worst),
                worst_seed: self.worst_seed(q),
            },
            covered: Covered::from(q.coverage),
        }
    }
}

crate::displayed!(MonteCarlo);

impl Answer for MonteCarlo {
    fn document(&self) -> Document {
        let Self { plant, family, .. } = self;
        let (done, asked) = (self.seeds.len(), self.asked);
        let title = format!("{plant}: {family} observer, {done} of {asked} runs to the end");
        let mut document = Document::new(title);
        if let (Some(first), Some(last)) = (self.seeds.first(), self.seeds.last()) {
            document.line(format!("seeds {first} to {last}; {}", self.again));
        }
        document.heading("RMS errors over the last half of the rows:");
        document.table(self.table());
        let covered = self.quantities.iter().filter_map(|q| {
            let share = figures(100.0 * q.coverage?.within, 3);
            Some(format!("{} {share} %", q.name))
        });
        let covered: Vec<String> = covered.collect();
        if !covered.is_empty() {
            document.line(format!("within 2 sd there: {}", covered.join(", ")));
        }
        for (runs, what) in [
            (&self.failures, "not in these figures, ended early"),
            (&self.doubtful, "in these figures, but not credible"),
        ] {
            if !runs.is_empty() {
                document.line(format!("{what}: seeds {}", told(runs)));
            }
        }
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let columns = Self::columns(self).into_iter();
        columns.map(|(name, x)| (name, x.to_vec().into())).collect()
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.figure()?.to_svg().map(Some)
    }

    #[cfg(feature = "plot")]
    fn panels(&self) -> Result<Option<lynkeus_plot::Figure>, Error> {
        self.figure().map(Some)
    }

    fn refusal(&self) -> Option<Error> {
        Self::refusal(self)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl MonteCarlo {
    fn table(&self) -> Table {
        let titles = [
            "quantity",
            "unit",
            "mean",
            "95 % below",
            "worst",
            "seed of the worst",
        ];
        let rows = self.quantities.iter().map(|q| {
            let Settled { mean, q95, worst } = q.settled();
            let unit = q.unit.clone().unwrap_or_default();
            let figures = [mean, q95, worst].map(|x| Cell::Number(figures(x, 3)));
            let seed = self.worst_seed(q).map_or(String::new(), |s| s.to_string());
            let known = [q.name.as_str().into(), unit.into()].into_iter();
            known.chain(figures).chain([seed.into()]).collect()
        });
        Table::new(titles).with(rows).dense()
    }
}

/// The first seeds, and how many more there are.
fn told(runs: &[Failure]) -> String {
    let seeds = runs.iter().take(TOLD).map(|run| run.seed.to_string());
    let told = seeds.collect::<Vec<_>>().join(", ");
    match runs.len().saturating_sub(TOLD) {
        0 => told,
        more => format!("{told}, … ({more} more)"),
    }
}

/// The headers of a quantity's columns.
pub(super) fn headers_of(name: &str, headers: &mut Headers) -> [String; 7] {
    let columns = [
        ("mean", "the mean"),
        ("q05", "the 5 % quantile"),
        ("q95", "the 95 % quantile"),
        ("error_mean", "the mean error"),
        ("error_q05", "the 5 % quantile of the error"),
        ("error_q95", "the 95 % quantile of the error"),
        ("error_worst", "the largest error"),
    ];
    columns.map(|(suffix, what)| {
        headers.free(&format!("{name}_{suffix}"), &format!("{what} of {name}"))
    })
}
