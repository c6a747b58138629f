//! The study file: what is measured, what is unknown, which observer, how to run it.
//!
//! ```toml
//! plant = "two-tanks.mo"            # relative to this file; `model = "…"` if it holds several
//! [parameters]                      # values that replace those of the plant
//! k1 = 0.04
//! [sensors]
//! measured = ["level"]              # default: every output of the plant
//! unknown = ["pump"]                # inputs nobody measures
//! noise = { level = "5%" }          # or a standard deviation
//! [process_noise]                   # spectral densities: how fast an unknown input wanders
//! pump = 0.01
//! [observer]
//! theta = 0.03
//! initial = { default = 0.5, "x[1]" = 0.9 }
//! [simulate]
//! until = 4000
//! output_step = 4
//! inputs = { pump = "if time < 1000 then 2 else 3" }
//! [estimate]
//! between_samples = "linear"
//! ```
//!
//! A key is declared once (`keys`): reader, default, schema and refusals follow. This crate knows what
//! a study says and which keys the families have; whether its names are the plant's is seen by who loads both.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod certify;
mod estimate;
mod fit;
mod generator;
mod keys;
mod log;
mod manifold;
mod observer;
mod schema;
mod section;
mod sensors;
mod serve;
mod simulate;
mod source;
mod swept;
mod tune;
mod whole;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::de::DeTable;

pub use certify::{Box, CertifySettings};
pub use estimate::{BetweenSamples, EstimateSettings, Smoothing};
pub use fit::{Candidate, Chosen, FitSettings, Objective, Prior};
pub use generator::Generator;
pub use log::{LogSettings, seconds_in};
pub use manifold::ManifoldSettings;
pub use observer::ObserverSettings;
pub use schema::schema;
pub use sensors::{Late, Noise, Screen, Sensors, bias_of};
pub use serve::{MqttSettings, MqttVersion, OpcuaSettings, ServeSettings};
pub use simulate::{Expression, Method, Rk4Step, SimulateSettings, Solver};
pub use source::{Name, Place};
pub use tune::{Scale, Swept, TuneSettings, Values};
pub use whole::Whole;

use lynkeus_expr::Budget;
use lynkeus_model::{MAX_DELAY_STATES, Tables};

use lynkeus_answer::Error;
use section::Section;
use source::Source;

/// A study: everything beside the plant's equations.
#[derive(Clone, Debug, Default)]
pub struct Study {
    /// The study file as the user named it, for messages; empty for studies made in Rust.
    pub file: String,
    /// The Modelica file, resolved against the study's folder.
    pub plant: Option<PathBuf>,
    /// The plant's text where it is at hand; `plant` then only names it, in messages, and tells
    /// its language. `None`: the file is read.
    pub plant_text: Option<Arc<str>>,
    /// The model to take where the Modelica file holds several.
    pub model: Option<String>,
    /// Parameter values that replace those of the plant.
    pub parameters: BTreeMap<String, f64>,
    /// What the plant's tables are between their points.
    pub tables: Tables,
    /// States of each delay of the plant.
    pub delay_states: Option<usize>,
    /// What is measured and what is not.
    pub sensors: Sensors,
    /// White noise on states' derivatives: (name, spectral density), in the square of the state's
    /// unit per unit of time; for an unknown input, how fast it wanders.
    pub process_noise: Vec<(Name, f64)>,
    /// What is an angle or a rotation.
    pub manifold: ManifoldSettings,
    /// The observer family and its tuning.
    pub observer: ObserverSettings,
    /// Ranges narrower than the model's.
    pub narrower: Box,
    /// What a certificate takes for granted.
    pub certify: CertifySettings,
    /// How to simulate; `None` where the study has no `[simulate]`.
    pub simulate: Option<SimulateSettings>,
    /// How to replay a log.
    pub estimate: EstimateSettings,
    /// Which tuning to sweep and how to judge it.
    pub tune: TuneSettings,
    /// What is found from logs, and how.
    pub fit: FitSettings,
    /// The families that `compare` runs; `None` means each that fits, and the filters.
    pub compare: Option<Vec<Name>>,
    /// How its estimator runs beside a plant.
    pub serve: ServeSettings,
    /// The quantities to draw, one panel each; `None` lets the tool choose.
    pub show: Option<Vec<Name>>,
    /// The plant's unit of time, of `[plot]` or of `[log]`: the one on the time axis.
    pub time_unit: Option<String>,
    /// What a replay keeps of a filter's corrections; no file has it.
    pub records: Records,
    /// The time and the memory that the work on the study may take; no file has it.
    pub budget: Budget,
}

/// What is kept of a filter's corrections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Records {
    /// Nothing.
    #[default]
    Nothing,
    /// How likely the readings were, and what was expected of them.
    Likelihood,
    /// All that they are made of.
    All,
}

/// Whether a file is a model by its name.
fn is_model(path: &Path) -> bool {
    let kind = path.extension().and_then(|e| e.to_str());
    matches!(kind, Some("mo" | "jl"))
}

impl Study {
    /// Reads a study file.
    ///
    /// # Errors
    /// The file is missing, is not UTF-8 or not TOML, has an unknown key, a value of the wrong
    /// type or out of range, or a number that is not finite; the message names the place.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::of_file(&lynkeus_table::files::read_text(path, "study")?, path)
    }

    /// The same for somebody who does not wait for ever for one that comes through a pipe.
    ///
    /// # Errors
    /// As [`Study::load`], or the budget is spent.
    pub fn load_within(path: impl AsRef<Path>, budget: &Budget) -> Result<Self, Error> {
        let path = path.as_ref();
        if !lynkeus_table::files::is_stream(path) {
            return Self::load(path);
        }
        let name = path.display().to_string();
        let text = lynkeus_table::Incoming::open(path, "study", budget)?.text(&name)?;
        Self::of_file(&text, path)
    }

    /// Reads the text of that file.
    fn of_file(text: &str, path: &Path) -> Result<Self, Error> {
        let file = path.display().to_string();
        if is_model(path) {
            return Err(Error::input("expected a study (TOML), found a model")
                .at(&file)
                .hint(format!(
                    "`lynkeus check {file}` makes a study to begin with"
                )));
        }
        let mut study = Self::parse(text, &file)?;
        if let (Some(plant), Some(folder)) = (study.plant.as_mut(), path.parent()) {
            *plant = folder.join(&*plant);
        }
        study.serve.beside(path.parent().unwrap_or(Path::new("")));
        Ok(study)
    }

    /// Reads a study; a model file (`.mo`, `.jl`) stands for the study in which every output
    /// is measured and every input known. `model` chooses among several in such a file.
    ///
    /// # Errors
    /// As [`Study::load`].
    pub fn load_or_bare(path: impl AsRef<Path>, model: Option<String>) -> Result<Self, Error> {
        let path = path.as_ref();
        let mut study = match Self::bare(path) {
            Some(study) => study,
            None => Self::load(path)?,
        };
        study.model = model.or(study.model);
        Ok(study)
    }

    /// What stands for a model; none where the file is none by its name.
    pub fn bare(path: &Path) -> Option<Self> {
        is_model(path).then(|| Self {
            file: path.display().to_string(),
            plant: Some(path.to_owned()),
            ..Self::default()
        })
    }

    /// Whether it stands for a bare model: see [`Study::load_or_bare`].
    pub fn is_bare(&self) -> bool {
        self.plant.as_deref() == Some(Path::new(&self.file))
    }

    /// Reads a study from text; `file` names it in messages.
    ///
    /// # Errors
    /// As [`Study::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let source = Source {
            file: Arc::from(file),
            text,
        };
        let table = DeTable::parse(text).map_err(|e| not_toml(&source, &e))?;
        let known = [&keys::KEYS[..], &keys::SECTIONS].concat();
        let mut top = Section::new(&source, "the study", table.into_inner(), &known)?;
        let simulate = top.optional("simulate", simulate::read)?;
        let (show, time_unit) = top.optional("plot", plot)?.unwrap_or_default();
        let log = top.optional("log", log::read)?.unwrap_or_default();
        let time_unit = log.unit_beside(time_unit)?;
        let sensors = top.optional("sensors", sensors::read)?.unwrap_or_default();
        let mut observer = top
            .optional("observer", observer::read)?
            .unwrap_or_default();
        let manifold = top
            .optional("manifold", manifold::read)?
            .unwrap_or_default();
        observer.live_on(&manifold)?;
        if observer.may_be_a_filter() {
            sensors.doubt(&mut observer.tuning);
        }
        Ok(Self {
            file: file.to_owned(),
            plant: top
                .optional("plant", section::Entry::name)?
                .map(|name| PathBuf::from(name.text)),
            plant_text: None,
            model: top
                .optional("model", section::Entry::name)?
                .map(|name| name.text),
            parameters: top.optional("parameters", parameters)?.unwrap_or_default(),
            tables: top.optional("tables", tables)?.unwrap_or_default(),
            delay_states: top.optional("delay_states", delay_states)?,
            sensors,
            manifold,
            process_noise: simulate::pairs(top.take("process_noise"), density)?,
            observer,
            narrower: top.optional("box", certify::read_box)?.unwrap_or_default(),
            certify: top.optional("certify", certify::read)?.unwrap_or_default(),
            simulate,
            estimate: estimate::read(top.take("estimate"), log)?,
            tune: top.optional("tune", tune::read)?.unwrap_or_default(),
            fit: top.optional("fit", fit::read)?.unwrap_or_default(),
            compare: top.optional("compare", compare)?.flatten(),
            serve: top.optional("serve", serve::read)?.unwrap_or_default(),
            show,
            time_unit,
            records: Records::default(),
            budget: Budget::default(),
        })
    }
}

/// A spectral density.
fn density(entry: section::Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a spectral density >= 0: variance per unit of time");
    entry.number().ok().filter(|q| *q >= 0.0).ok_or(refusal)
}

fn not_toml(source: &Source<'_>, error: &toml::de::Error) -> Error {
    let message = error.message().replace('\n', "; ");
    let refusal = Error::input(format!("not a TOML file: {message}"));
    match error.span() {
        Some(span) => refusal.at(source.place(&span)),
        None => refusal.at(&source.file),
    }
}

fn parameters(entry: section::Entry<'_>) -> Result<BTreeMap<String, f64>, Error> {
    entry
        .pairs()?
        .into_iter()
        .map(|(name, value)| Ok((name.text, value.number()?)))
        .collect()
}

fn tables(entry: section::Entry<'_>) -> Result<Tables, Error> {
    entry.choice(&[("linear", Tables::Linear), ("monotone", Tables::Monotone)])
}

/// States of a delay.
fn delay_states(entry: section::Entry<'_>) -> Result<usize, Error> {
    let refusal = entry.wrong(&format!("a whole number from 1 to {MAX_DELAY_STATES}"));
    let count = entry
        .whole(1)
        .ok()
        .and_then(|count| usize::try_from(count).ok());
    count
        .filter(|count| *count <= MAX_DELAY_STATES)
        .ok_or(refusal)
}

/// `families` of `[compare]`.
fn compare(entry: section::Entry<'_>) -> Result<Option<Vec<Name>>, Error> {
    let mut section = entry.section("[compare]", &keys::COMPARE)?;
    section.optional("families", |e| e.list_of(section::Entry::name))
}

/// `show` and `time_unit` of `[plot]`.
fn plot(entry: section::Entry<'_>) -> Result<(Option<Vec<Name>>, Option<Name>), Error> {
    let mut section = entry.section("[plot]", &keys::PLOT)?;
    let show = section.optional("show", |e| e.list_of(section::Entry::name))?;
    let unit = section.optional("time_unit", section::Entry::name)?;
    Ok((show, unit))
}

#[cfg(test)]
mod tests;
