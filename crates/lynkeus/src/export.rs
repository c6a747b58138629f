//! A study's estimator as source code for other machines; what is exported otherwise is in `continuous`.

use lynkeus_export::Refusal;
use lynkeus_export::curly::c::{self, File, Precision, Sources};
use lynkeus_export::curly::fmu::Version;
use lynkeus_export::curly::{Device, Entry, FirstReading, Tunable, javascript, rust, structured};
use lynkeus_model::Variable;
use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Level};

#[cfg(feature = "tune")]
use crate::ReportOptions;
use crate::choice::Choice;
use crate::estimate::at_readings;
use crate::fixed_steps::{bends, hasty, stepped};
use crate::headers::Headers;
use crate::inputs::on_device;
use crate::live::blueprint;
use crate::prepare::{self, Prepared};
use crate::study::BetweenSamples;
use crate::systems::hat;
use crate::{Error, Study, continuous, fmu, tunable};

mod head;

use head::{about, beyond_float};
pub(crate) use head::{designed, file_name, origin};

/// The language of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Target {
    /// C99: a header, a source, a bench and how they are built
    #[default]
    C,
    /// a JavaScript module
    JavaScript,
    /// a crate without the standard library, with an example that replays a log
    Rust,
    /// Structured Text of IEC 61131-3: a function block with its functions, and a program that calls it
    StructuredText,
    /// a functional mock-up unit: C in an archive with a description and, where a C compiler is at hand, a
    /// library for this machine; a note says where there is none
    Fmu(Version),
    /// a page that explains the estimates and moves them: [`report()`](crate::report())
    #[cfg(feature = "tune")]
    Html,
}

/// What is declared of a [`Target`]: all that the command, its refusals and the dispatch know of it.
struct Declared {
    /// on the command line and in Python
    word: &'static str,
    /// what is written, in words
    about: &'static str,
    /// whether its numbers may be `float`
    has_float: bool,
    writes: Writes,
}

/// What makes the files of a target.
enum Writes {
    /// source text
    Sources(fn(&Device<'_>, Precision) -> Result<Sources, Refusal>),
    /// an archive, in which what can be tuned always is
    Archive(Version),
    /// the page of `lynkeus report`
    #[cfg(feature = "tune")]
    Page,
}

impl Target {
    /// All of them, an FMU in the version that is usual.
    pub const ALL: &[Self] = &[
        Self::C,
        Self::JavaScript,
        Self::Rust,
        Self::StructuredText,
        #[cfg(feature = "tune")]
        Self::Html,
        Self::Fmu(Version::Three),
    ];

    fn declared(self) -> Declared {
        match self {
            Self::C => Declared {
                word: "c",
                about: "C99: a header, a source, a bench that replays a log, a CMakeLists.txt",
                has_float: true,
                writes: Writes::Sources(c::sources),
            },
            Self::JavaScript => Declared {
                word: "js",
                about: "A JavaScript module, for pages and Node",
                has_float: false,
                writes: Writes::Sources(javascript_module),
            },
            Self::Rust => Declared {
                word: "rust",
                about: "A Rust crate without the standard library, with an example that replays a log",
                has_float: true,
                writes: Writes::Sources(rust::sources),
            },
            Self::StructuredText => Declared {
                word: "st",
                about: "Structured Text of IEC 61131-3: a function block for programmable controllers",
                has_float: true,
                writes: Writes::Sources(structured::sources),
            },
            Self::Fmu(version) => Declared {
                word: "fmu",
                about: "An archive for tools of simulation: the estimator for FMI co-simulation; a plant or an observer in continuous time for model exchange, too",
                has_float: true,
                writes: Writes::Archive(version),
            },
            #[cfg(feature = "tune")]
            Self::Html => Declared {
                word: "html",
                about: "The page of `lynkeus report`, on the study's simulation",
                has_float: false,
                writes: Writes::Page,
            },
        }
    }

    /// What the command line and Python call it: `c`, `js`, `rust`, `st`, `fmu` or `html`.
    pub fn word(self) -> &'static str {
        self.declared().word
    }

    /// What is written, in words.
    pub fn about(self) -> &'static str {
        self.declared().about
    }

    /// The target of a [word](Self::word).
    pub fn named(word: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|target| target.word() == word)
    }
}

/// What of a study is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// the estimator: it takes samples, and goes from one to the next
    Estimator,
    /// the plant in continuous time: its inputs and outputs are those of the model
    Plant,
    /// the observer in continuous time, as its family's paper has it: measurements are inputs
    Observer,
}

/// How an estimator is exported.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportOptions {
    /// the language
    pub to: Target,
    /// what is exported; by default the estimator of a study, the plant of a bare model
    pub subject: Option<Subject>,
    /// the type of numbers, in C and Rust
    pub precision: Precision,
    /// longest step of the integration, in the unit of time, instead of the study's
    pub step: Option<f64>,
    /// θ, or what stands for it, may be changed while the estimator runs, where its family allows that;
    /// a functional mock-up unit has it anyway
    pub tunable: bool,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artifact {
    /// its name in the folder
    pub name: String,
    /// what it holds
    pub bytes: Vec<u8>,
}

impl From<File> for Artifact {
    fn from(File { name, text }: File) -> Self {
        Self {
            name,
            bytes: text.into_bytes(),
        }
    }
}

/// The answer of `lynkeus export`.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// files of one folder
    pub files: Vec<Artifact>,
    /// what the user should know
    pub notes: Vec<String>,
}

/// The study's estimator as source code, as `[estimate]` says: with the same fixed step it gives what
/// [`estimate()`](crate::estimate()) gives. Where the study has no fixed step, one that is short
/// enough for the fastest mode at the start is taken, and told. With another [`Subject`], and of a bare
/// model, the plant or the observer in continuous time for simulators ([`Target::Fmu`]).
///
/// # Errors
/// As [`estimator`](crate::estimator()); and what cannot run elsewhere: a moving horizon, plants
/// that jump with time, loops that are searched, smoothing.
pub fn export(study: &Study, options: &ExportOptions) -> Result<Export, Error> {
    let Declared {
        has_float, writes, ..
    } = options.to.declared();
    if options.precision == Precision::F32 && !has_float {
        let message = "--precision f32: expected f64, the numbers of JavaScript";
        return Err(Error::input(message));
    }
    match options.subject {
        None if study.is_bare() => return continuous::plant(study, options),
        Some(Subject::Plant) => return continuous::plant(study, options),
        Some(Subject::Observer) => return continuous::observer(study, options),
        None | Some(Subject::Estimator) => {}
    }
    let precision = options.precision;
    match writes {
        #[cfg(feature = "tune")]
        Writes::Page if options.tunable => {
            let message = "what is tunable: expected C, JavaScript, Rust, Structured Text or an FMU, found a page, whose slider moves it";
            Err(Error::input(message))
        }
        #[cfg(feature = "tune")]
        Writes::Page => page(study, options.step),
        Writes::Sources(write) => written(study, options, options.tunable, |made, notes| {
            let sources = write(made.device, precision)?;
            notes.extend(beyond_float(&sources.lost));
            Ok(sources.files.into_iter().map(Artifact::from).collect())
        }),
        Writes::Archive(version) => written(study, options, true, |made, notes| {
            if precision == Precision::F32 {
                notes.extend(beyond_float(&c::lost_in_float(made.device)?));
            }
            Ok(vec![fmu::archive(made, version, precision, notes)?])
        }),
    }
}

/// The study's estimator as `write` makes files of it; with what may be changed while it runs.
fn written(
    study: &Study,
    options: &ExportOptions,
    is_tunable: bool,
    write: impl FnOnce(&fmu::Made<'_>, &mut Vec<String>) -> Result<Vec<Artifact>, Refusal>,
) -> Result<Export, Error> {
    let mut notes = vec![];
    let study = &causal(study, &mut notes);
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    let mut design = match is_tunable {
        true => tunable::design(&prepared)?,
        false => prepared.design()?,
    };
    on_device(&prepared, &mut design)?;
    let choice = prepared.choice()?.filter(|choice| choice.ended.is_some());
    notes.extend(choice.map(Choice::notes).into_iter().flatten());
    let made = blueprint(&prepared, &design)?;
    let made = stepped(&prepared, made, options.step, &mut notes)?;
    notes.extend(bends(made.flow()));
    if is_tunable {
        notes.push(tunable::note(&design, &made));
    }
    let hasty = hasty(&prepared, &made);
    notes.extend(hasty.clone());
    let about = about(study, &made, hasty);
    let files = printed(&prepared, &design, &made, &about, |device, told| {
        notes.extend(told);
        let of = fmu::Made {
            device,
            prepared: &prepared,
            design: &design,
        };
        write(&of, &mut notes)
    })?;
    Ok(Export { files, notes })
}

fn javascript_module(device: &Device<'_>, _: Precision) -> Result<Sources, Refusal> {
    Ok(Sources::from(File {
        name: format!("{}.mjs", c::prefix(device.name)),
        text: javascript::module(device)?,
    }))
}

/// The report on the study's simulation.
#[cfg(feature = "tune")]
fn page(study: &Study, step: Option<f64>) -> Result<Export, Error> {
    let watch = &mut |_| std::ops::ControlFlow::Continue(());
    let page = crate::report::report(study, None, &ReportOptions { step }, watch)?;
    Ok(Export {
        files: vec![Artifact {
            name: page.name,
            bytes: page.html.into_bytes(),
        }],
        notes: page.notes,
    })
}

/// What `print` makes of an estimator, with `about` at its head, and of notes on names.
///
/// # Errors
/// What cannot run elsewhere.
pub(crate) fn printed<T>(
    prepared: &Prepared<'_>,
    design: &Design,
    made: &Blueprint,
    about: &[String],
    print: impl FnOnce(&Device<'_>, Vec<String>) -> Result<T, Refusal>,
) -> Result<T, Error> {
    let told = Told::of(prepared, design, made);
    let first: Vec<FirstReading> = at_readings(prepared)
        .iter()
        .map(|at| FirstReading {
            sensor: at.sensor,
            state: at.state,
            slope: at.slope,
            offset: at.offset,
        })
        .collect();
    let study = prepared.study();
    let declared = prepared.declared();
    let measured = design.observer.measured.iter();
    let noises = measured.map(|signal| declared.noise.of(&signal.name).map(|n| Level::from(*n)));
    let noises: Vec<Option<Level>> = noises.collect();
    let device = Device {
        name: &prepared.plant().name,
        blueprint: made,
        first_readings: &first,
        signals: &told.signals,
        estimates: &told.estimates,
        monitors: told.monitors,
        deviations: study.estimate.deviations,
        tunables: &told.tunables,
        noises: &noises,
        words: &told.words,
        about,
    };
    print(&device, told.notes)
        .map_err(|refusal| Error::refused(refusal.to_string()).at(&study.file))
}

/// The study without what looks ahead, which a device cannot.
pub(crate) fn causal(study: &Study, notes: &mut Vec<String>) -> Study {
    let mut study = study.clone();
    let settings = &mut study.estimate;
    if settings.between_samples == BetweenSamples::Linear {
        settings.between_samples = BetweenSamples::Hold;
        notes.push(
            "between_samples = \"linear\" of [estimate] looks ahead: here signals are held between samples"
                .to_owned(),
        );
    }
    if settings.smoothing.take().is_some() {
        notes.push("smoothing looks ahead: the estimates are those of the filter".to_owned());
    }
    study
}

/// What the code says of names.
struct Told {
    signals: Vec<Entry>,
    estimates: Vec<Entry>,
    monitors: usize,
    tunables: Vec<Tunable>,
    words: Vec<Entry>,
    notes: Vec<String>,
}

impl Told {
    fn of(prepared: &Prepared<'_>, design: &Design, made: &Blueprint) -> Self {
        let plant = prepared.plant();
        let variables = plant
            .inputs
            .iter()
            .chain(&plant.outputs)
            .chain(&plant.states);
        let words: Vec<Entry> = variables.map(entry).collect();
        let known = |name: &str| {
            let own = words.iter().find(|entry| entry.name == name);
            own.cloned().unwrap_or_else(|| Entry::named(name))
        };
        let observer = &design.observer;
        let read = observer.measured.iter().chain(&observer.inputs);
        let mut headers = Headers::beside(plant).of_variables();
        // as in the table of estimates, which has a column of time besides
        let _ = headers.time();
        headers.notes.clear();
        let has_deviations = prepared.study().estimate.deviations;
        let mut deviations = vec![];
        let mut estimates = vec![];
        for estimate in &observer.estimates {
            let name = &estimate.variable.name;
            let about = known(name).about;
            let header = headers.free(&hat(name), &format!("the estimate of {name}"));
            estimates.push(Entry {
                name: header,
                about,
            });
            if has_deviations {
                let about = format!("standard deviation of {name}");
                deviations.push(Entry {
                    name: headers.free(&format!("{name}_sd"), &format!("the {about}")),
                    about,
                });
            }
        }
        let monitors: Vec<Entry> = match made {
            Blueprint::Filter { .. } => vec![],
            Blueprint::Sampled { .. } => observer
                .monitors
                .iter()
                .map(|monitor| Entry {
                    name: headers.free(&monitor.name, &monitor.name),
                    about: format!("{}, where below {}", monitor.meaning, monitor.alarm_below),
                })
                .collect(),
        };
        Self {
            signals: read.map(|signal| known(&signal.name)).collect(),
            monitors: monitors.len(),
            estimates: estimates
                .into_iter()
                .chain(deviations)
                .chain(monitors)
                .collect(),
            tunables: tunable::printed(design, made),
            words,
            notes: headers.notes,
        }
    }
}

/// A variable with its unit and what it is.
fn entry(variable: &Variable) -> Entry {
    let unit = variable.unit.as_ref().map(|unit| format!("[{unit}]"));
    let words = [unit, variable.description.clone()];
    Entry {
        name: variable.name.clone(),
        about: words.into_iter().flatten().collect::<Vec<_>>().join(" "),
    }
}
