//! `[estimate]`: how a log is replayed.

use super::Name;
use super::generator::{self, Generator};
use super::keys::{ESTIMATE, INTEGRATOR};
use super::log::LogSettings;
use super::section::{Entry, Section};
use super::simulate::{self, Method, pairs};
use lynkeus_answer::Error;

/// How a log is replayed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimateSettings {
    /// What the observer sees between two rows of the log.
    pub between_samples: BetweenSamples,
    /// The integrator and its steps or tolerances.
    pub method: Method,
    /// What the log's columns are: `[log]`, and `time` and `columns` of `[estimate]`.
    pub log: LogSettings,
    /// Columns of the log that hold u', u'', … of known inputs.
    pub input_derivatives: Vec<(Name, Vec<String>)>,
    /// What makes known inputs.
    pub generator: Vec<(Name, Generator)>,
    /// A log with missing cells in a column that is read, or whose times do not increase, is refused.
    pub strict: bool,
    /// How much later than the row before it a row may come, in units of time.
    pub late: Option<f64>,
    /// Estimates given later rows, too.
    pub smoothing: Option<Smoothing>,
    /// Standard deviations beside the estimates.
    pub deviations: bool,
    /// Innovations of the measured outputs, with theirs.
    pub innovations: bool,
    /// How many particles count, row by row.
    pub effective: bool,
}

impl EstimateSettings {
    /// Whether an observer with a theorem has its errors followed.
    pub fn follows_errors(&self) -> bool {
        self.deviations || self.innovations
    }
}

/// Which later rows an estimate may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothing {
    /// All of the log.
    Interval,
    /// So many.
    Lag(usize),
}

/// What the observer sees between two rows of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BetweenSamples {
    /// The latest row: what a live observer sees.
    #[default]
    Hold,
    /// From each reading on what the model makes of it: the inter-sample predictor.
    Predict,
    /// The straight line to the next row: looks ahead one sample, so only off-line.
    Linear,
}

/// A header, or a list of them.
fn headers(entry: Entry<'_>) -> Result<Vec<String>, Error> {
    let names = match entry.is_list() {
        true => entry.list_of(Entry::name)?,
        false => vec![entry.name()?],
    };
    Ok(names.into_iter().map(|name| name.text).collect())
}

/// Reads `[estimate]`, where the study has it, beside what `[log]` says.
pub(super) fn read(entry: Option<Entry<'_>>, log: LogSettings) -> Result<EstimateSettings, Error> {
    match entry {
        Some(entry) => {
            let section = entry.section("[estimate]", &[&ESTIMATE[..], &INTEGRATOR].concat())?;
            read_section(section, log)
        }
        None => Ok(EstimateSettings {
            log,
            ..EstimateSettings::default()
        }),
    }
}

fn read_section(mut section: Section<'_>, mut log: LogSettings) -> Result<EstimateSettings, Error> {
    log.join(&mut section)?;
    let smooth = section
        .optional("smooth", Entry::boolean)?
        .unwrap_or_default();
    let lag = section.optional("lag", |e| e.whole(1))?;
    let settings = EstimateSettings {
        between_samples: section
            .optional("between_samples", |e| {
                e.choice(&[
                    ("hold", BetweenSamples::Hold),
                    ("predict", BetweenSamples::Predict),
                    ("linear", BetweenSamples::Linear),
                ])
            })?
            .unwrap_or_default(),
        method: simulate::method(&mut section)?,
        smoothing: match (lag, smooth) {
            (Some(lag), _) => Some(Smoothing::Lag(lag as usize)),
            (None, true) => Some(Smoothing::Interval),
            (None, false) => None,
        },
        deviations: section.optional("sd", Entry::boolean)?.unwrap_or_default(),
        innovations: section
            .optional("innovations", Entry::boolean)?
            .unwrap_or_default(),
        effective: section.optional("ess", Entry::boolean)?.unwrap_or_default(),
        log,
        input_derivatives: section
            .optional("input_derivatives", |entry| {
                let pairs = entry.pairs()?.into_iter();
                pairs
                    .map(|(name, value)| Ok((name, headers(value)?)))
                    .collect()
            })?
            .unwrap_or_default(),
        generator: pairs(section.take("generator"), generator::read)?,
        late: section.optional("late", Entry::positive)?,
        strict: section.optional("strict", Entry::boolean)?.unwrap_or(false),
    };
    refuse_two_origins(&settings)?;
    Ok(settings)
}

/// Derivatives of an input come from columns or from its generator.
fn refuse_two_origins(settings: &EstimateSettings) -> Result<(), Error> {
    let columns = |name: &Name| {
        let mut given = settings.input_derivatives.iter();
        given.any(|(own, _)| own.text == name.text)
    };
    let mut generators = settings.generator.iter();
    match generators.find(|(name, _)| columns(name)) {
        None => Ok(()),
        Some((name, _)) => Err(name.blame(Error::input(format!(
            "[estimate]: derivatives of {name} come from columns (`input_derivatives`) and from its `generator`: keep one of the two"
        )))),
    }
}
