//! What can be exported, how, and what comes of it.

use lynkeus_export::Refusal;
use lynkeus_export::curly::c::{self, File, Precision, Sources};
use lynkeus_export::curly::fmu::Version;
use lynkeus_export::curly::{Device, javascript, rust, structured};

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
    Html,
}

/// What is declared of a [`Target`]: all that the command, its refusals and the dispatch know of it.
pub(crate) struct Declared {
    /// on the command line and in Python
    word: &'static str,
    /// what is written, in words
    about: &'static str,
    /// whether its numbers may be `float`
    pub has_float: bool,
    pub writes: Writes,
}

/// What makes the files of a target.
pub(crate) enum Writes {
    /// source text
    Sources(fn(&Device<'_>, Precision) -> Result<Sources, Refusal>),
    /// an archive, in which what can be tuned always is
    Archive(Version),
    /// the page of `lynkeus report`
    Page,
}

impl Target {
    /// All of them, an FMU in the version that is usual.
    pub const ALL: &[Self] = &[
        Self::C,
        Self::JavaScript,
        Self::Rust,
        Self::StructuredText,
        Self::Html,
        Self::Fmu(Version::Three),
    ];

    pub(crate) fn declared(self) -> Declared {
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

fn javascript_module(device: &Device<'_>, _: Precision) -> Result<Sources, Refusal> {
    Ok(Sources::from(File {
        name: format!("{}.mjs", c::prefix(device.name)),
        text: javascript::module(device)?,
    }))
}
