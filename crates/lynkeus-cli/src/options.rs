//! Where a command's results go.

use std::path::PathBuf;

use clap::Args;

/// Where results go.
#[derive(Debug, Default, Args)]
pub(super) struct Output {
    /// Write the columns as CSV ("-": standard output, the default without --json)
    #[arg(short, long, value_name = "FILE.csv")]
    pub output: Option<PathBuf>,
    /// Draw the result
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object with the summary
    #[arg(long)]
    pub json: bool,
    /// Print no progress bar and no notes
    #[arg(short, long)]
    pub quiet: bool,
}
