//! A study's estimator for rows that come one by one under the names of a log, and what is told of them.

use lynkeus_expr::{Graph, Tape};
use lynkeus_model::{Home, Plant, parse_expression};
use lynkeus_run::credible::By;
use lynkeus_run::{Handover, Late, Standing};

use super::live::{blueprint, late};
use crate::course::Samples;
use crate::course::computed;
use crate::course::inputs::on_device;
use crate::course::run::{at_readings, start_at_readings};
use crate::prepare::headers::{Headers, header, log_time};
use crate::prepare::systems::hat;
use crate::prepare::{self, Prepared, StudyDesign};
use crate::words::explain;
use crate::{Error, Series, Study};
use lynkeus_study::{Name, Noise, Screen, seconds_in};
use lynkeus_table::Pattern;

/// Estimates that differ by such a share of their size are the same but for rounding.
const SAME: f64 = 1e-6;

/// What a service knows of a study: which values a row has, what is told of it, and the estimator between them.
#[derive(Debug)]
pub struct Stream {
    study: Study,
    /// under which name a row has its time
    pub time: String,
    /// under which name a line tells it
    pub told_time: String,
    /// what a time is written like, where the study says so
    pub pattern: Option<Pattern>,
    /// seconds of the plant's unit of time, into which dates are converted; none where the study leaves it open
    pub seconds: Option<f64>,
    /// what the estimator reads, in the order of its signals
    pub channels: Vec<Channel>,
    /// what is told, in the order of the estimator's names
    pub estimates: Vec<Told>,
    /// how far that can be trusted, after them
    pub monitors: Vec<Alarm>,
    /// what says how large an innovation may be
    pub by: By,
    /// channels whose first reading is where the estimator starts
    starts: Vec<usize>,
    /// before its first row
    late: Late,
    /// what the user should know of the observer
    pub notes: Vec<String>,
}

/// A value of a row.
#[derive(Clone, Debug)]
pub struct Channel {
    /// the output or the input of the plant, or another name that an observer reads
    pub name: String,
    /// where it stands in a row
    pub given: Given,
    /// whether it is a reading, which may be missing
    pub is_sensor: bool,
    /// the noise that the study declares
    pub noise: Option<Noise>,
    /// the ends of what the sensor can show
    pub limits: Option<(f64, f64)>,
    /// which values are no readings
    pub screens: Vec<Screen>,
    /// the unit in which the model has it
    pub unit: Option<String>,
}

/// Where the value of a channel stands in a row.
#[derive(Clone, Debug)]
pub enum Given {
    /// under this name
    Key(String),
    /// it is computed of the values under these names, unless the row has one under the text of the expression
    Computed {
        /// the expression
        text: String,
        /// what it reads
        keys: Vec<String>,
        /// its value
        tape: Tape,
    },
}

/// A quantity that is told.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// its name in the plant
    pub name: String,
    /// the name of its estimate in a line
    pub header: String,
    /// that of its standard deviation, where the estimator has them
    pub deviation: Option<String>,
    /// its unit
    pub unit: Option<String>,
    /// what it is
    pub description: Option<String>,
    /// least and largest declared value
    pub range: (f64, f64),
    /// where the turn begins in which an angle is shown
    pub turn: Option<f64>,
}

/// A monitor of the observer.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarm {
    /// its name in a line
    pub header: String,
    /// it warns below this
    pub below: f64,
    /// what it warns of
    pub meaning: String,
}

impl Stream {
    /// Of a study: rows that come late are put in their place for as long as `wait` of its `[serve]` says.
    ///
    /// # Errors
    /// As [`estimator`](crate::estimator), but for readings that come late; and what a line cannot tell: rotations, a time that is an
    /// expression.
    pub fn new(study: &Study) -> Result<Self, Error> {
        let mut study = study.clone();
        // what is followed for `estimate` is told here
        study.estimate.deviations |= study.estimate.innovations;
        let plant = prepare::plant(&study)?;
        let prepared = Prepared::new(&study, &plant)?;
        refuse_untold(&study, &plant)?;
        let design = prepared.design()?;
        let estimator = waiting(&prepared, design.clone())?;
        let mut headers = Headers::beside(&plant);
        let told_time = headers.time();
        let told = told(&prepared, &design, &mut headers);
        let monitors = design.observer.monitors.iter().map(|monitor| Alarm {
            header: headers.free(&monitor.name, &format!("the monitor {}", monitor.name)),
            below: monitor.alarm_below,
            meaning: monitor.meaning.to_string(),
        });
        let monitors: Vec<Alarm> = monitors.collect();
        let sensors = estimator.sensors();
        let named = estimator.signals().iter().enumerate();
        let channels = named.map(|(place, name)| channel(&prepared, name, place < sensors));
        let channels: Vec<Channel> = channels.collect();
        let mut notes = design.notes.clone();
        notes.append(&mut headers.notes);
        Ok(Self {
            time: log_time(&plant, &study.estimate),
            told_time,
            pattern: study.estimate.log.format.times.clone(),
            seconds: seconds(&study),
            by: match design.observer.filter {
                Some(_) => By::Filter,
                None => By::ErrorSystem,
            },
            starts: at_readings(&prepared).iter().map(|at| at.sensor).collect(),
            estimates: told,
            monitors,
            late: estimator,
            channels,
            notes,
            study,
        })
    }

    /// What a first row lacks: known inputs, and sensors at whose first reading the estimate starts.
    #[must_use]
    pub fn lacking(&self, row: &[f64]) -> Vec<&str> {
        let is_missing = |place: &usize| !row.get(*place).is_some_and(|y| y.is_finite());
        let inputs = self.late.sensors()..self.channels.len();
        let needed = self.starts.iter().copied().chain(inputs);
        needed
            .filter(is_missing)
            .filter_map(|place| Some(self.channels.get(place)?.name.as_str()))
            .collect()
    }

    /// The estimator, waiting for its first row, which is this one.
    ///
    /// # Errors
    /// It starts at the first reading of a channel that the row does not have, or needs the first value of an input.
    pub fn begin(&self, row: &[f64]) -> Result<Late, Error> {
        let lacking = self.lacking(row);
        if !lacking.is_empty() {
            return Err(Error::input(format!(
                "the first row needs {}: the estimate starts there",
                lacking.join(", ")
            )));
        }
        if self.starts.is_empty() {
            return Ok(self.late.clone());
        }
        let plant = prepare::plant(&self.study)?;
        let prepared = Prepared::new(&self.study, &plant)?;
        let mut design = prepared.design()?;
        let readings = row.iter().map(|y| Series::from(vec![*y]));
        let first = Samples {
            readings: readings.take(self.late.sensors()).collect(),
            ..Samples::default()
        };
        start_at_readings(&prepared, &first, &mut design);
        waiting(&prepared, design)
    }

    /// The estimator that goes on where that of another study was, whose first row was this one: states and what is known
    /// of their errors are taken over by name, and the rows that it keeps are gone over again.
    ///
    /// # Errors
    /// As [`begin`](Self::begin); it has other states, or they mean something else under these numbers.
    pub fn take_over(&self, first: &[f64], from: &Handover) -> Result<Late, Error> {
        let mut late = self.begin(first)?;
        if let Some(standing) = &from.standing {
            let mut at_once = late.clone();
            let alone = Handover {
                rows: vec![],
                ..from.clone()
            };
            at_once.take_over(&alone).map_err(explain)?;
            self.refuse_other_meaning(&at_once, standing)?;
        }
        late.take_over(from).map_err(explain)?;
        Ok(late)
    }

    /// What an observer estimates may be a function of its states in which its numbers stand.
    fn refuse_other_meaning(&self, late: &Late, standing: &Standing) -> Result<(), Error> {
        let estimates = late.names().iter().zip(late.estimate());
        for (name, x) in estimates.take(self.estimates.len()) {
            let mut known = standing.estimates.iter();
            let Some((_, known)) = known.find(|(known, _)| known == name) else {
                continue;
            };
            if (x - known).abs() > SAME * (x.abs() + known.abs()) {
                return Err(Error::input(format!(
                    "the states of this observer mean something else under other numbers: with what is taken over {name} would be {x} and was {known}"
                )));
            }
        }
        Ok(())
    }

    /// The channels whose first readings say where the estimate starts.
    #[must_use]
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// How long rows that come late are waited for.
    #[must_use]
    pub fn wait(&self) -> f64 {
        self.late.wait()
    }

    /// Whether a row with a missing value is refused.
    #[must_use]
    pub fn is_strict(&self) -> bool {
        self.study.estimate.strict
    }

    /// The study.
    #[must_use]
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// The file of the study, for messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.study.file
    }

    /// A number that differs for studies whose estimators, rows or lines differ.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut digest = lynkeus_run::Digest::default();
        digest.word(self.late.fingerprint());
        let names = self.channels.iter().map(|channel| channel.given.text());
        let told = self.estimates.iter().map(|told| told.header.as_str());
        for name in names.chain(told).chain([self.time.as_str()]) {
            digest.bytes(name.as_bytes());
        }
        digest.value()
    }
}

impl Given {
    /// A header, or an expression of headers.
    fn new(text: &str) -> Self {
        let own = || Self::Key(text.to_owned());
        let keys = computed::names(text);
        if keys.is_empty() || keys == [text] {
            return own();
        }
        let graph = Graph::new();
        let root = parse_expression(text, &graph, &|name| Some(graph.symbol(name).node()));
        let Ok(root) = root else { return own() };
        let symbols = graph.symbols_of(&[root]);
        let keys = symbols
            .iter()
            .filter_map(|symbol| graph.symbol_name(*symbol));
        let keys: Vec<String> = keys.collect();
        match Tape::new(&graph, &symbols, &[root]) {
            Ok(tape) => Self::Computed {
                text: text.to_owned(),
                keys,
                tape,
            },
            Err(_) => own(),
        }
    }

    /// The name or the expression.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Key(text) | Self::Computed { text, .. } => text,
        }
    }
}

/// The estimator of a design, before its first row.
fn waiting(prepared: &Prepared<'_>, mut design: StudyDesign) -> Result<Late, Error> {
    let study = prepared.study();
    on_device(prepared, &mut design)?;
    let mut made = blueprint(prepared, &design)?;
    // readings are judged as they come, where there is something to judge them by
    made.judges = study.estimate.deviations && !study.sensors.noise.is_empty();
    let estimator = made.estimator().map_err(explain)?;
    late(prepared, estimator, study.serve.wait)
}

fn told(prepared: &Prepared<'_>, design: &StudyDesign, headers: &mut Headers) -> Vec<Told> {
    let plant = prepared.plant();
    let has_deviations = design.observer.filter.is_some() || prepared.study().estimate.deviations;
    let augmented = &prepared.augmented().states;
    let estimates = design.observer.estimates.iter().map(|estimate| {
        let variable = &estimate.variable;
        let what = format!("the estimate of {}", variable.name);
        let header = headers.free(&hat(&variable.name), &what);
        let wanted = format!("{}_sd", variable.name);
        let deviation = format!("the deviation of {what}");
        let deviation = has_deviations.then(|| headers.free(&wanted, &deviation));
        let home = plant.states.iter().find(|s| s.name == variable.name);
        let range = augmented.iter().find(|s| s.name == variable.name);
        let range = range.unwrap_or(variable);
        Told {
            name: variable.name.clone(),
            header,
            deviation,
            unit: variable.unit.clone(),
            description: variable.description.clone(),
            range: (range.min, range.max),
            turn: match home.map(|state| state.home) {
                Some(Home::Circle { from }) => from,
                _ => None,
            },
        }
    });
    estimates.collect()
}

fn channel(prepared: &Prepared<'_>, name: &str, is_sensor: bool) -> Channel {
    let (study, declared) = (prepared.study(), prepared.declared());
    let plant = prepared.plant();
    let mut variables = plant.outputs.iter().chain(&plant.inputs);
    let limits = declared.limits.of(name);
    Channel {
        name: name.to_owned(),
        given: Given::new(header(&study.estimate, name)),
        is_sensor,
        noise: declared.noise.of(name).copied(),
        limits: limits.map(|limits| (limits.low, limits.high)),
        screens: declared.screens.of(name).cloned().unwrap_or_default(),
        unit: variables
            .find(|v| v.name == name)
            .and_then(|v| v.unit.clone()),
    }
}

/// Seconds of the plant's unit of time, where `[log]` says it or nobody says another one.
fn seconds(study: &Study) -> Option<f64> {
    let log = &study.estimate.log;
    let other = study.time_unit.as_deref().and_then(seconds_in);
    match (&log.time_unit, other) {
        (None, Some(other)) if other != 1.0 => None,
        _ => Some(log.seconds()),
    }
}

/// What a line cannot tell.
fn refuse_untold(study: &Study, plant: &Plant) -> Result<(), Error> {
    let rotation = |home: Home| matches!(home, Home::Rotation { .. } | Home::Signed { .. });
    if let Some(state) = plant.states.iter().find(|state| rotation(state.home)) {
        let message = format!(
            "{} is of a rotation, which a live estimate does not tell so far",
            state.name
        );
        let hint =
            "leave out `quaternion` of [manifold], or take `lynkeus.Study.estimator` in Python";
        return Err(Error::input(message).at(&study.file).hint(hint));
    }
    let settings = &study.estimate;
    let is_expression = |time: &&Name| {
        let names = computed::names(&time.text);
        !names.is_empty() && names != [time.text.as_str()]
    };
    if let Some(time) = settings.log.time.as_ref().filter(is_expression) {
        let message = format!(
            "`time` of [log]: expected the name under which a row has its time, found the expression {time}"
        );
        return Err(time.blame(Error::input(message)));
    }
    Ok(())
}
