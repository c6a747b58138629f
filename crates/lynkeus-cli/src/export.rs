//! `lynkeus export`: an estimator as source code, or a plant for simulators.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use lynkeus::{Error, ExportOptions, FmiVersion, Precision, Subject, Target};

use super::ending::Ending;
use super::inputs::Source;
use super::output;
use super::save::Results;

/// [`Subject`] in the words of the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum System {
    /// The observer or filter, fed with samples
    Estimator,
    /// The model alone
    Plant,
    /// The observer in continuous time, with measurements as inputs
    Observer,
}

impl From<System> for Subject {
    fn from(system: System) -> Self {
        match system {
            System::Estimator => Self::Estimator,
            System::Plant => Self::Plant,
            System::Observer => Self::Observer,
        }
    }
}

/// [`FmiVersion`] in the words of the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum Fmi {
    /// FMI 2.0
    #[value(name = "2")]
    Two,
    /// FMI 3.0
    #[default]
    #[value(name = "3")]
    Three,
}

/// [`Precision`] in the words of the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum Numbers {
    /// double
    #[default]
    F64,
    /// float
    F32,
}

#[derive(Debug, Args)]
pub(super) struct Options {
    /// Language or format to write
    #[arg(long, value_parser = targets(), value_name = "WHAT")]
    to: Target,
    /// Folder for the files; must be new or empty without --force
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Replace files of the same names
    #[arg(long)]
    force: bool,
    /// Type of numbers
    #[arg(long, value_enum, default_value_t, value_name = "TYPE")]
    precision: Numbers,
    /// Longest step of the integration, in the unit of time (default: the study's)
    #[arg(long, value_name = "STEP")]
    step: Option<f64>,
    /// With --to c, js, rust or st: make θ, or its equivalent, adjustable while the estimator runs (always so in an
    /// FMU)
    #[arg(long)]
    tunable: bool,
    /// With --to fmu: version of the standard
    #[arg(long, value_enum, default_value_t, value_name = "VERSION")]
    fmi: Fmi,
    /// With --to fmu: system to export (default: the estimator of a study, the plant of a model)
    #[arg(long, value_enum, value_name = "WHAT")]
    system: Option<System>,
    /// Print no notes
    #[arg(short, long)]
    quiet: bool,
}

/// Everything is made before the first file is written.
pub(super) fn export(source: &Source, options: &Options) -> Result<Ending, Error> {
    let wanted = ExportOptions {
        to: options.target()?,
        subject: options.system.map(Subject::from),
        precision: match options.precision {
            Numbers::F64 => Precision::F64,
            Numbers::F32 => Precision::F32,
        },
        step: options.step,
        tunable: options.tunable,
    };
    let folder = &options.output;
    if !options.force {
        must_be_empty(folder)?;
    }
    let made = lynkeus::export(&source.study, &wanted)?;
    let failed = |e: std::io::Error| {
        Error::input(format!("the folder cannot be made: {e}")).at(folder.display())
    };
    let mut results = Results::default();
    for file in &made.files {
        let path = folder.join(&file.name);
        if let Some(inner) = path.parent() {
            std::fs::create_dir_all(inner).map_err(failed)?;
        }
        results.put(&path, file.bytes.as_slice())?;
    }
    results.keep()?;
    if !options.quiet {
        made.notes.iter().for_each(|note| output::note(note));
        let names: Vec<&str> = made.files.iter().map(|file| file.name.as_str()).collect();
        output::note(&format!("{}: {}", folder.display(), names.join(", ")));
    }
    Ok(Ending::Done)
}

/// The words for targets, with what each writes.
fn targets() -> impl TypedValueParser<Value = Target> {
    let words = Target::ALL.iter();
    let words = words.map(|target| PossibleValue::new(target.word()).help(target.about()));
    PossibleValuesParser::new(words)
        .try_map(|word| Target::named(&word).ok_or("expected one of these words"))
}

impl Options {
    /// The target in the version of the standard; that is given to nothing else.
    fn target(&self) -> Result<Target, Error> {
        match (self.to, self.fmi) {
            (Target::Fmu(_), Fmi::Two) => Ok(Target::Fmu(FmiVersion::Two)),
            (Target::Fmu(_), Fmi::Three) => Ok(Target::Fmu(FmiVersion::Three)),
            (_, Fmi::Two) => Err(Error::input("--fmi 2: expected --to fmu with it")),
            (to, Fmi::Three) => Ok(to),
        }
    }
}

fn must_be_empty(folder: &Path) -> Result<(), Error> {
    let is_full = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_some(),
        // it is made, or that fails with a word of its own
        Err(_) => folder.exists(),
    };
    match is_full {
        false => Ok(()),
        true => Err(
            Error::input("expected an empty folder or none, found one with files")
                .at(folder.display())
                .hint("name another after -o, or replace what has the same names with --force"),
        ),
    }
}
