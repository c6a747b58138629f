//! The `lynkeus` command, as a program and inside the Python package.

mod ending;
mod export;
mod files;
mod fit;
mod how_well;
mod inputs;
mod limits;
#[cfg(test)]
mod listing;
mod lsp;
mod monte_carlo;
mod options;
mod output;
mod progress;
mod report;
mod run;
mod save;
#[cfg(feature = "serve")]
mod serve;
mod shell;
mod signals;
mod tune;
mod written;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{CommandFactory, Parser, Subcommand, ValueEnum};

use lynkeus::run::{Backend, fuse_steps};
use lynkeus::{CheckOptions, Error, interrupt};

use inputs::Source;
use options::Output;

pub use ending::Ending;
use limits::Limits;
pub use limits::allocated;

/// Estimate hidden states and unknown inputs from a plant's equations and a few sensors.
#[derive(Debug, Parser)]
#[command(name = "lynkeus", version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// How to evaluate the equations; the results are the same, the speed differs
    #[arg(long, global = true, value_enum, default_value_t, value_name = "WHICH")]
    backend: Engine,
    /// Use fused multiply-add in Runge–Kutta steps of fixed length,
    /// except in filters: faster, the last digits differ, the same with every backend
    #[arg(long, global = true)]
    fuse: bool,
}

/// [`Backend`] in the words of the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Engine {
    /// The interpreter, and machine code for frequent evaluations
    #[default]
    Auto,
    /// The interpreter alone
    Interpreter,
    /// Machine code from the first evaluation on, where possible
    Native,
}

impl From<Engine> for Backend {
    fn from(engine: Engine) -> Self {
        match engine {
            Engine::Auto => Self::Auto,
            Engine::Interpreter => Self::Interpreter,
            Engine::Native => Self::Native,
        }
    }
}

const EXAMPLES: &str = "\
Examples:
  lynkeus check study.toml
  lynkeus check model.mo --parameters --about 'k1*k2'
  lynkeus check study.toml --how-well --sensors --plot errors.svg
  lynkeus design study.toml
  lynkeus certify study.toml
  lynkeus simulate study.toml -o run.csv --plot run.svg
  lynkeus simulate study.toml --runs 1000 --plot spread.svg
  lynkeus simulate study.toml --inputs log.csv --plot open.svg
  lynkeus estimate study.toml log.csv -o estimates.csv --plot estimates.svg
  lynkeus fit study.toml log.csv --write
  lynkeus tune study.toml --plot tune.svg
  lynkeus serve study.toml --stdio json
  lynkeus export study.toml --to c -o device
  lynkeus export model.mo --to fmu -o plant
  lynkeus report study.toml log.csv -o report.html

The file name - means standard input or output.

Exit codes: 0 done; 1 the answer is no (a refuted condition, a divergence, an estimate that is not
credible, whose table is still written; a picture with nothing to draw); 2 bad input; 3 a limit of time or memory.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Decide what these sensors can estimate, by which observer, and which conditions fail where
    Check {
        /// Study (TOML; "-": standard input), or a model (.mo, .jl) with every output measured and every input known
        study: PathBuf,
        /// Choose the model in a file that holds several
        #[arg(long, value_name = "NAME")]
        model: Option<String>,
        /// Include the parameters as unknown constants
        #[arg(long)]
        parameters: bool,
        /// Also decide on an expression, e.g. "k1*k2" (repeatable)
        #[arg(long, value_name = "EXPRESSION")]
        about: Vec<String>,
        /// Draw where, in the box of two states, the outputs' derivatives do not distinguish states
        #[arg(long, value_name = "FILE.svg")]
        singular: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// Print errors and warnings as diagnostics of the Language Server Protocol, for editors
        #[arg(long, conflicts_with_all = ["json", "about", "singular", "how_well"])]
        lsp: bool,
        #[command(flatten)]
        limits: Limits,
        #[command(flatten)]
        how_well: how_well::Options,
    },
    /// Compute gains, matrices and parameters of the observer
    Design {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        /// Write the text (or the JSON) to a file
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// Prove or refute that the observer converges, with rate and bounds; the verdict may be undecided
    Certify {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        /// Write the text (or the JSON) to a file
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// Simulate the plant and its observer with noise; many runs with --runs; the plant alone on a log's inputs with --inputs
    Simulate {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        output: Output,
        /// Seed of the noise (default: the study's)
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Also write the log of a data logger (t, measured outputs, inputs), for `estimate`
        #[arg(long, value_name = "FILE.csv")]
        log: Option<PathBuf>,
        /// Simulate the plant alone, without observer and noise, under the inputs of this log; compare its outputs with the log's readings
        #[arg(long, value_name = "LOG", conflicts_with_all = ["log", "runs", "seed"])]
        inputs: Option<PathBuf>,
        /// Run N simulations with the seeds S, S+1, … (S: the study's, or --seed) on all processors: means, quantiles and the worst. Run k equals that of --seed S+k (with fixed steps up to the rounding of exp, sin and the like); `spread` of [simulate] varies starts and parameters
        #[arg(long, value_name = "N", conflicts_with = "log", value_parser = runs)]
        runs: Option<usize>,
        #[command(flatten)]
        limits: Limits,
    },
    /// Run the observer on a measured log
    Estimate {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        /// Log (CSV with a header, or Parquet): a time column, the measured outputs and the known inputs by name ("-": standard input)
        log: PathBuf,
        #[command(flatten)]
        output: Output,
        /// Save progress in this file: after a kill or a limit the same command continues there. It is removed when the result is written
        #[arg(long, value_name = "FILE")]
        checkpoint: Option<PathBuf>,
        #[command(flatten)]
        limits: Limits,
    },
    /// Estimate parameters, noises and starts from logs by maximum likelihood, and list what the logs do not determine
    Fit {
        /// Study with [fit] (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        options: fit::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Sweep the tuning, in simulation or on a log, and find the knee of the trade-off
    Tune {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        options: tune::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Run several families on the same data, and tabulate errors, peaks, settling and cost
    Compare {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        /// Log (CSV or Parquet; default: the study's simulation)
        log: Option<PathBuf>,
        /// Draw the estimates of each family
        #[arg(long, value_name = "FILE.svg")]
        plot: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// Print no progress bar
        #[arg(short, long)]
        quiet: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// Export the estimator as source code with fixed steps for other machines, or the plant for simulators
    Export {
        /// Study (TOML; "-": standard input), or a model (.mo, .jl), whose plant --to fmu exports
        study: PathBuf,
        /// Choose the model in a file that holds several
        #[arg(long, value_name = "NAME")]
        model: Option<String>,
        #[command(flatten)]
        options: export::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Write one self-contained page: observability, the design, its certificate, and estimates with sliders
    Report {
        /// Study (TOML; "-": standard input)
        study: PathBuf,
        /// Log (CSV or Parquet; default: the study's simulation)
        log: Option<PathBuf>,
        #[command(flatten)]
        options: report::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Run the estimator beside a plant: read rows, write estimates, until it is stopped
    #[cfg(feature = "serve")]
    Serve {
        /// Study with [serve] (TOML)
        study: PathBuf,
        #[command(flatten)]
        options: serve::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Print the JSON Schema of a study, for editors that complete and check TOML
    Schema,
    /// Print a script with which a shell completes commands, options and files
    Completions {
        /// Shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// Print the manual page of lynkeus or of one of its commands, as roff for man(1)
    Man {
        /// Command (default: lynkeus itself)
        command: Option<String>,
    },
}

/// Runs a command line, of which the first word is the program's name. Help, a wrong option and a signal end the process.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Ending {
    let cli = Cli::parse_from(arguments);
    signals::watch();
    Backend::from(cli.backend).choose();
    fuse_steps(cli.fuse);
    match execute(cli.command) {
        Ok(_) if interrupt::interrupted() => signals::end(),
        Ok(ending) => ending,
        Err(_) if interrupt::interrupted() => signals::end(),
        Err(error) => {
            output::complain(&error);
            Ending::of(&error)
        }
    }
}

fn execute(command: Command) -> Result<Ending, Error> {
    match command {
        Command::Check {
            study,
            model,
            parameters,
            about,
            singular,
            json,
            lsp,
            limits,
            how_well,
        } => {
            if lsp {
                let options = CheckOptions { parameters, about };
                return lsp::lsp(&study, model, &options, &limits);
            }
            let source = Source::load_or_bare(&study, model, limits.budget())?;
            if how_well.is_asked() {
                return how_well::how_well(&source, &how_well, json);
            }
            let options = CheckOptions { parameters, about };
            run::check(&source, &options, singular.as_deref(), json)
        }
        Command::Design {
            study,
            output,
            json,
            limits,
        } => {
            let source = Source::load(&study, limits.for_a_proof())?;
            run::design(&source, output.as_deref(), json)
        }
        Command::Certify {
            study,
            output,
            json,
            limits,
        } => {
            let source = Source::load(&study, limits.for_a_proof())?;
            run::certify(&source, output.as_deref(), json)
        }
        Command::Simulate {
            study,
            output,
            seed,
            log,
            inputs,
            runs,
            limits,
        } => {
            let mut source = Source::load(&study, limits.budget())?;
            if let (Some(seed), Some(settings)) = (seed, &mut source.study.simulate) {
                settings.seed = seed;
            }
            match (runs, inputs) {
                (Some(runs), _) => monte_carlo::monte_carlo(&source, &output, runs),
                (None, Some(inputs)) => run::open_run(&source, &inputs, &output),
                (None, None) => run::simulate(&source, &output, log.as_deref()),
            }
        }
        Command::Estimate {
            study,
            log,
            output,
            checkpoint,
            limits,
        } => {
            let source = Source::load(&study, limits.budget())?;
            run::estimate(&source, &log, &output, checkpoint.as_deref())
        }
        Command::Fit {
            study,
            options,
            limits,
        } => fit::fit(&study, &options, &limits),
        Command::Tune {
            study,
            options,
            limits,
        } => tune::tune(&study, &options, &limits),
        Command::Compare {
            study,
            log,
            plot,
            json,
            quiet,
            limits,
        } => {
            let source = Source::load(&study, limits.budget())?;
            let output = Output {
                output: None,
                plot,
                json,
                quiet,
            };
            run::compare(&source, log.as_deref(), &output)
        }
        Command::Export {
            study,
            model,
            options,
            limits,
        } => {
            let source = Source::load_or_bare(&study, model, limits.for_a_proof())?;
            export::export(&source, &options)
        }
        Command::Report {
            study,
            log,
            options,
            limits,
        } => {
            let source = Source::load(&study, limits.for_a_proof())?;
            report::report(&source, log.as_deref(), &options)
        }
        #[cfg(feature = "serve")]
        Command::Serve {
            study,
            options,
            limits,
        } => {
            let source = Source::load(&study, limits.budget())?;
            serve::serve(&source, &options)
        }
        Command::Schema => {
            output::print(output::json(&lynkeus::schema()).as_bytes())?;
            Ok(Ending::Done)
        }
        Command::Completions { shell } => shell::completions(Cli::command(), shell),
        Command::Man { command } => shell::manual(Cli::command(), command.as_deref()),
    }
}

/// A number of runs.
fn runs(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| *count > 0);
    count.ok_or_else(|| "expected a whole number, 1 or above".to_owned())
}
