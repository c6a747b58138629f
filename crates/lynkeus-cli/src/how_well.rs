//! `lynkeus check --how-well`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use lynkeus::Error;
use lynkeus::precision::{self, Candidates};

use super::ending::Ending;
use super::inputs::Source;
use super::options::Output;
use super::progress::Alive;
use super::save::Results;

/// How well, where the answer goes, and which sensors to try.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Compute standard errors along the simulated run, for its noise and sampling
    #[arg(long)]
    how_well: bool,
    /// Rank further sensors, every output of the model or with `all` also every state
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "outputs")]
    sensors: Option<Which>,
    /// Longest horizon, in the plant's unit of time (default: the whole run)
    #[arg(long, value_name = "TIME")]
    horizon: Option<f64>,
    /// Draw a bar for every state and the errors over the horizon ("-": standard output)
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write the standard errors over the horizon as CSV ("-": standard output)
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Which {
    /// Every output of the model
    Outputs,
    /// Every output and every state
    All,
}

impl Options {
    /// Whether the question is how well; what only makes sense with it asks for it.
    pub(super) fn is_asked(&self) -> bool {
        let has_file = self.plot.is_some() || self.output.is_some();
        self.how_well || self.sensors.is_some() || self.horizon.is_some() || has_file
    }
}

/// Everything is computed before the first file is written.
pub(super) fn how_well(source: &Source, options: &Options, json: bool) -> Result<Ending, Error> {
    let output = Output {
        output: options.output.clone(),
        plot: options.plot.clone(),
        json,
        quiet: false,
    };
    source.files().asked(&output).check()?;
    let asked = precision::Options {
        horizon: options.horizon,
        sensors: options.sensors.map(|which| match which {
            Which::Outputs => Candidates::Outputs,
            Which::All => Candidates::All,
        }),
    };
    let alive = Alive::new("computing standard errors");
    let report = lynkeus::precision(&source.study, &asked);
    drop(alive);
    let report = report?;
    Results::default().tell(&report, &output)
}
