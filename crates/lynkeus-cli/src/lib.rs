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

/// Estimates what nobody measures: hidden states and unknown inputs, from a plant's equations and a few sensors.
#[derive(Debug, Parser)]
#[command(name = "lynkeus", version, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// What evaluates the equations; all give the same digits, it is a matter of speed
    #[arg(long, global = true, value_enum, default_value_t, value_name = "WHICH")]
    backend: Engine,
    /// Round a product and a sum once in Runge–Kutta steps of fixed length (fused multiply-add): faster, other last
    /// digits; the same ones by every backend. Filters never do
    #[arg(long, global = true)]
    fuse: bool,
}

/// [`Backend`] in the words of the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Engine {
    /// The interpreter, and machine code for what is evaluated often
    #[default]
    Auto,
    /// The interpreter alone
    Interpreter,
    /// Machine code from the first evaluation on, wherever it can be made
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

A file called - is standard input or output.

Exit codes: 0 done, 1 the answer is no (a condition refuted, a divergence, an estimate that is not
credible: the table is written all the same; a picture with nothing to draw), 2 bad input, 3 a limit ended it.";

#[derive(Debug, Subcommand)]
enum Command {
    /// What can be estimated from these sensors, by which observer, and what fails where
    Check {
        /// The study (TOML; "-": standard input), or a model (.mo, .jl): then every output is measured and every input known
        study: PathBuf,
        /// Which model, where a bare file holds several
        #[arg(long, value_name = "NAME")]
        model: Option<String>,
        /// Take the parameters as unknown constants and ask for them too
        #[arg(long)]
        parameters: bool,
        /// Decide on an expression as well, e.g. "k1*k2" (may be given several times)
        #[arg(long, value_name = "EXPRESSION")]
        about: Vec<String>,
        /// Draw where in the box of two states the outputs' derivatives do not tell states apart
        #[arg(long, value_name = "FILE.svg")]
        singular: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// Print what is wrong with the study and its model as diagnostics of the Language Server Protocol, for editors
        #[arg(long, conflicts_with_all = ["json", "about", "singular", "how_well"])]
        lsp: bool,
        #[command(flatten)]
        limits: Limits,
        #[command(flatten)]
        how_well: how_well::Options,
    },
    /// Gains, matrices and parameters of the observer
    Design {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        /// Save the text (or the JSON) instead of printing it
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// One JSON object
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// Proves, refutes or leaves undecided that the observer converges, with rate and bounds
    Certify {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        /// Save the text (or the JSON) instead of printing it
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
        /// One JSON object
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// Run the plant and its observer together, with noise; many times with --runs; the plant alone on a log's inputs with --inputs
    Simulate {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        output: Output,
        /// Seed of the noise, instead of the study's
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Also write what a logger would have seen (t, measured outputs, inputs), ready for `estimate`
        #[arg(long, value_name = "FILE.csv")]
        log: Option<PathBuf>,
        /// The plant alone instead, without observer and noise: from row to row of this log under its inputs, with the errors of its outputs beside the log's readings
        #[arg(long, value_name = "LOG", conflicts_with_all = ["log", "runs", "seed"])]
        inputs: Option<PathBuf>,
        /// Run it N times with the seeds S, S+1, … (S: the study's, or --seed), on all processors: means, quantiles and the worst. Run k is what --seed S+k gives alone (fixed steps: but for the rounding of exp, sin and the like); `spread` of [simulate] moves starts and parameters
        #[arg(long, value_name = "N", conflicts_with = "log", value_parser = runs)]
        runs: Option<usize>,
        #[command(flatten)]
        limits: Limits,
    },
    /// Replay a measured log through the observer
    Estimate {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        /// The log (CSV with a header; a time column and the measured outputs and known inputs by name; "-": standard input)
        log: PathBuf,
        #[command(flatten)]
        output: Output,
        /// Keep the replay in this file while it runs: the same command goes on there after it was killed or a limit ended it. Removed once the result is written
        #[arg(long, value_name = "FILE")]
        checkpoint: Option<PathBuf>,
        #[command(flatten)]
        limits: Limits,
    },
    /// Find parameters, noises and starts from logs, by their likelihood, and say what the logs cannot tell
    Fit {
        /// The study with its [fit] (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        options: fit::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Sweep the tuning, in simulation or on a log, and find the knee of the trade-off
    Tune {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        #[command(flatten)]
        options: tune::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// Run several families on the same data: one table of errors, peaks, settling and cost
    Compare {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        /// A log (CSV or Parquet); without one the study's simulation
        log: Option<PathBuf>,
        /// Draw the estimates of each family
        #[arg(long, value_name = "FILE.svg")]
        plot: Option<PathBuf>,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// No progress bar
        #[arg(short, long)]
        quiet: bool,
        #[command(flatten)]
        limits: Limits,
    },
    /// The estimator as source code for other machines, with its fixed steps; a plant for simulators
    Export {
        /// The study (TOML; "-": standard input), or a model (.mo, .jl): then the plant, with --to fmu
        study: PathBuf,
        /// Which model, where a bare file holds several
        #[arg(long, value_name = "NAME")]
        model: Option<String>,
        #[command(flatten)]
        options: export::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// One self-contained page: what can be known, the design, its certificate, and estimates with sliders
    Report {
        /// The study (TOML; "-": standard input)
        study: PathBuf,
        /// A log (CSV or Parquet); without one the study's simulation
        log: Option<PathBuf>,
        #[command(flatten)]
        options: report::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// The estimator beside a plant: rows in, estimates out, for as long as the plant runs
    #[cfg(feature = "serve")]
    Serve {
        /// The study (TOML), with [serve]
        study: PathBuf,
        #[command(flatten)]
        options: serve::Options,
        #[command(flatten)]
        limits: Limits,
    },
    /// The JSON Schema of a study, for editors that complete and check TOML
    Schema,
    /// A script that lets a shell complete commands, options and files
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// The manual page of lynkeus or of one of its commands, as roff for man(1)
    Man {
        /// The command; without it lynkeus itself
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
