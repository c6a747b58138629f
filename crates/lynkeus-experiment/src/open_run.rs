//! The plant alone under the inputs of a log: an open run. Nothing corrects it and no noise is added, so that its errors
//! are those of the model. It is what `fit` calls a free run: the same inputs between rows, and the same start.

#[cfg(feature = "plot")]
mod picture;
mod report;

use std::collections::HashMap;
use std::ops::ControlFlow;

use crate::answer::Origin;
use lynkeus_expr::Node;
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_observers::starts;
use lynkeus_run::{Error as RunError, Estimator, Parts, System};
use lynkeus_study::{Generator, Name};
use lynkeus_words::short;

use crate::course::columns::{Log, held, logged};
use crate::course::ended::{is_answer, settle};
use crate::course::fixed_steps::unlocated;
use crate::course::inputs::refuse_strays;
use crate::course::replay::{Watch, replay};
use crate::course::run::{first_readings, told_start};
use crate::course::taken::Interleaved;
use crate::course::{Course, Samples, curved};
use crate::crew::within;
use crate::judge::outcome::{Ended, not_whole};
use crate::prepare::headers::{Headers, header};
use crate::prepare::systems::{self, method, named, run_settings};
use crate::prepare::{self, Prepared};
use crate::words::{explain, in_words};
use crate::{Error, Series, Study, Table};

#[cfg(feature = "schema")]
pub use report::OpenRunReport;

/// The answer of `simulate` with `inputs`.
#[derive(Debug)]
pub struct OpenRun {
    /// name of the plant
    pub plant: String,
    /// the log, as messages call it
    pub log: String,
    /// times of the rows
    pub time: Series,
    time_header: String,
    origin: Option<Origin>,
    /// the unit of time, where the study has one
    pub time_unit: Option<String>,
    /// the variables that its picture shows, where the study says so
    pub show: Option<Vec<Name>>,
    /// the states, the inputs, then the outputs
    pub variables: Vec<Simulated>,
    /// where the states start
    pub starts: Vec<(String, f64)>,
    /// why it ended before its last row, where it did
    pub ended: Option<Ended>,
    /// what of the log contradicts itself, or counts nowhere
    pub warnings: Vec<String>,
    /// what the user should know
    pub notes: Vec<String>,
}

/// A variable of the plant through time.
#[derive(Debug, Default)]
pub struct Simulated {
    /// its name
    pub name: String,
    /// its unit
    pub unit: Option<String>,
    /// what the model says of it
    pub description: Option<String>,
    /// row by row
    pub values: Series,
    /// what the log says of an output
    pub misfit: Option<Misfit>,
}

/// An output beside what the log has of it.
#[derive(Debug)]
pub struct Misfit {
    /// what the log has
    pub readings: Series,
    /// reading − output; no number where there is no reading, or one at an end of its sensor's range
    pub error: Series,
    error_header: String,
    /// rows that count
    pub counted: usize,
    /// rows without a reading
    pub missing: usize,
    /// readings at an end of their sensor's range: nobody knows how far they are off
    pub at_ends: usize,
    /// the mean error
    pub mean: Option<f64>,
    /// the root mean square error
    pub rms: Option<f64>,
    /// 100 (1 − ‖y − ŷ‖/‖y − mean of y‖), in percent
    pub fit: Option<f64>,
}

/// Runs the plant of a study alone, from row to row of a log under its inputs; `watch` is told the fraction done and
/// may stop the run.
///
/// # Errors
/// A study that does not fit its plant, a log without the plant's inputs, a run that has no second row. One that
/// leaves every bound is a result: [`Answer::refusal`](crate::Answer::refusal).
pub fn open_run(
    study: &Study,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<OpenRun, Error> {
    let plant = prepare::plant(study)?;
    let prepared = &Prepared::new(study, &plant)?;
    refuse_strays(prepared)?;
    let log = Log::of_inputs(prepared, table)?;
    let mut notes = log.notes.clone();
    let starts = started(prepared, &log.samples, &mut notes)?;
    let driven = Driven::new(prepared, &log, &mut notes)?;
    let system = driven.system(&plant, &starts)?;
    let mut estimator = Estimator::new(&system, run_settings(&study.estimate)).map_err(explain)?;
    let samples = Samples {
        time: log.samples.time.clone(),
        readings: vec![],
        inputs: driven.columns,
    };
    let mut course = Course::default();
    let told = &mut within(&study.budget, watch);
    let count = system.outputs().len();
    replay(
        &mut estimator,
        &samples,
        count,
        &mut course,
        &mut Watch::only(told),
    )?;
    let rows = course.estimates.first().map_or(0, Series::len);
    settle(&mut course, rows, study, &log.table.place(), is_answer)?;
    notes.append(&mut course.notes);
    notes.extend(unlocated(&plant, method(&study.estimate.method)));
    finished(prepared, &log, course, (starts, notes))
}

/// Where the plant's states start: where an estimate from this log does.
fn started(
    prepared: &Prepared<'_>,
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, Error> {
    let (study, plant) = (prepared.study(), prepared.plant());
    let initial = &study.observer.tuning.initial;
    let starts = starts(prepared.augmented(), initial);
    let mut starts = starts.map_err(|error| study.observer.blame(&error, &study.file))?;
    starts.truncate(plant.states.len());
    for (state, start) in first_readings(prepared, samples) {
        if let Some(own) = starts.get_mut(state) {
            *own = start;
            notes.push(told_start(prepared, state, start));
        }
    }
    let simulated = study.simulate.as_ref().map(|s| &*s.initial);
    for (state, start) in plant.states.iter().zip(&starts) {
        let other = Name::best(simulated.unwrap_or_default(), &state.name);
        if let Some(other) = other.filter(|other| *other != start) {
            notes.push(format!(
                "{} starts at {}, where `estimate` and `fit` start on a log, and not at the {} of `initial` in [simulate]",
                state.name,
                short(*start),
                short(*other)
            ));
        }
    }
    Ok(starts)
}

/// What drives the plant: its inputs in the order of the plant.
#[derive(Default)]
struct Driven {
    /// those that the log has
    signals: Vec<(String, Node)>,
    /// their columns
    columns: Vec<Series>,
    /// what stands for each of the others
    made: HashMap<Node, Node>,
}

impl Driven {
    /// # Errors
    /// An input of which nothing says what it does.
    fn new(prepared: &Prepared<'_>, log: &Log<'_>, notes: &mut Vec<String>) -> Result<Self, Error> {
        let (augmented, plant) = (prepared.augmented(), prepared.plant());
        let mut driven = Self::default();
        let unknown = &augmented.states[augmented.plant_states()..];
        for input in &plant.inputs {
            let is_own = |other: &Variable| other.name == input.name;
            let known = augmented.inputs.iter().position(is_own);
            let column = match known.and_then(|place| log.samples.inputs.get(place)) {
                Some(column) if !column.is_empty() => Some(column.clone()),
                Some(_) => None,
                None if unknown.iter().any(is_own) => of_the_log(prepared, log, input)?,
                // a disturbance, which nobody knows
                None => {
                    let zero = plant.graph.constant(0.0).node();
                    driven.made.insert(input.node, zero);
                    continue;
                }
            };
            match column {
                Some(column) => {
                    driven.signals.push((input.name.clone(), input.node));
                    driven.columns.push(column);
                }
                None => {
                    let node = match known {
                        Some(_) => generated(prepared, log, input)?,
                        None => simulated(prepared, log, input, notes)?,
                    };
                    driven.made.insert(input.node, node);
                }
            }
        }
        Ok(driven)
    }

    /// The plant from these starts, with its states, its inputs and its outputs as outputs.
    fn system(&self, plant: &Plant, starts: &[f64]) -> Result<System, Error> {
        let put = |nodes: &[Node]| plant.graph.substitute(nodes, &self.made);
        let states = named(&plant.states).into_iter().zip(starts);
        let states: Vec<(String, Node, f64)> = states
            .map(|((name, node), start)| (name, node, *start))
            .collect();
        let told = told(plant).map(|variable| variable.node);
        let told = put(&told.collect::<Vec<Node>>());
        let names = self::told(plant).map(|variable| variable.name.clone());
        let outputs: Vec<(String, Node)> = names.zip(told).collect();
        let derivatives = put(&plant.derivatives);
        System::of(&Parts {
            graph: &plant.graph,
            time: plant.time,
            states: &states,
            signals: &self.signals,
            derivatives: &derivatives,
            outputs: &outputs,
            whens: Some(&plant.whens.substituted(&plant.graph, &self.made)),
        })
        .map_err(explain)
    }
}

/// What an open run tells of.
fn told(plant: &Plant) -> impl Iterator<Item = &Variable> {
    plant
        .states
        .iter()
        .chain(&plant.inputs)
        .chain(&plant.outputs)
}

/// The column of an unknown input, where the log happens to have one.
fn of_the_log(
    prepared: &Prepared<'_>,
    log: &Log<'_>,
    input: &Variable,
) -> Result<Option<Series>, Error> {
    let settings = &prepared.study().estimate;
    match logged(&log.table, settings, &log.time, &input.name) {
        Some(_) => {
            let column = held(&log.table, settings, header(settings, &input.name))?;
            Ok(Some(log.held(&column)))
        }
        None => Ok(None),
    }
}

/// A known input that the study makes itself.
fn generated(prepared: &Prepared<'_>, log: &Log<'_>, input: &Variable) -> Result<Node, Error> {
    let settings = &prepared.study().estimate;
    let own = Name::best(&settings.generator, &input.name);
    if let Some(Generator::Time(expression)) = own {
        return systems::expression(prepared.plant(), expression);
    }
    let message = format!(
        "the log has no column \"{}\", and the plant alone reads no command: its `generator` in [estimate] is a filter",
        header(settings, &input.name)
    );
    Err(Error::input(message)
        .at(log.table.place())
        .hint("add the input itself as a column"))
}

/// An unknown input as the study simulates it.
fn simulated(
    prepared: &Prepared<'_>,
    log: &Log<'_>,
    input: &Variable,
    notes: &mut Vec<String>,
) -> Result<Node, Error> {
    let (study, name) = (prepared.study(), &input.name);
    let column = header(&study.estimate, name);
    let given = study.simulate.as_ref().map(|s| &*s.inputs);
    let Some(expression) = Name::best(given.unwrap_or_default(), name) else {
        let message = format!(
            "nothing says what the unknown input \"{name}\" does: the log has no column \"{column}\", and nothing corrects the plant alone"
        );
        return Err(Error::input(message).at(log.table.place()).hint(format!(
            "add the column, or an expression of time: inputs = {{ {name} = \"…\" }} under [simulate]"
        )));
    };
    notes.push(format!(
        "{name} is as `inputs` of [simulate] has it: the log has no column \"{column}\""
    ));
    systems::expression(prepared.plant(), expression)
}

/// A run with what the log says of it.
fn finished(
    prepared: &Prepared<'_>,
    log: &Log<'_>,
    mut course: Course,
    (starts, mut notes): (Vec<f64>, Vec<String>),
) -> Result<OpenRun, Error> {
    let (study, plant) = (prepared.study(), prepared.plant());
    let mut headers = Headers::beside(plant);
    let time_header = headers.time();
    let rows = course.estimates.first().map_or(0, Series::len);
    let columns = std::mem::take(&mut course.estimates);
    let variables = compared(prepared, log, columns, &mut headers);
    let augmented = prepared.augmented();
    let measured = augmented.outputs.iter().zip(&log.samples.readings);
    for (output, _) in measured.filter(|(_, readings)| readings.is_empty()) {
        let column = header(&study.estimate, &output.variable.name);
        notes.push(format!(
            "the log has no column \"{column}\": {} has no errors",
            output.variable.name
        ));
    }
    notes.append(&mut headers.notes);
    course.check()?;
    let names = plant.states.iter().map(|state| state.name.clone());
    Ok(OpenRun {
        plant: plant.name.clone(),
        log: log.table.place(),
        time: log.own(&log.samples.time.shortened(rows)),
        time_header,
        origin: log.table.start(&log.time).map(|instant| Origin {
            instant,
            unit: prepared.study().estimate.log.seconds(),
        }),
        time_unit: study.time_unit.clone(),
        show: study.show.clone(),
        variables,
        starts: names.zip(starts).collect(),
        ended: course
            .ended
            .take()
            .map(|error| ended(study, &course, &error)),
        warnings: [course.warnings, log.warnings.clone()].concat(),
        notes,
    })
}

/// What there is of each variable, outputs beside what the log has of them.
fn compared(
    prepared: &Prepared<'_>,
    log: &Log<'_>,
    columns: Vec<Series>,
    headers: &mut Headers,
) -> Vec<Simulated> {
    let plant = prepared.plant();
    let outputs = plant.states.len() + plant.inputs.len();
    let mut variables: Vec<Simulated> = vec![];
    for (place, (variable, values)) in told(plant).zip(columns).enumerate() {
        let name = &variable.name;
        let readings = match place >= outputs {
            true => readings(prepared, log, name),
            false => None,
        };
        let misfit = readings.map(|readings| {
            let header = headers.free(&format!("{name}_error"), &format!("the error of {name}"));
            let mut readings = readings.shortened(values.len());
            if let Home::Circle { .. } = variable.home {
                readings = curved::lifted(&readings, &values);
            }
            let inserted = log.interleaved.as_ref().map_or(0, Interleaved::inserted);
            let mut misfit = misfit(prepared, (name, &values), readings, header);
            misfit.missing = misfit.missing.saturating_sub(inserted);
            misfit.readings = log.own(&misfit.readings);
            misfit.error = log.own(&misfit.error);
            misfit
        });
        let values = log.own(&values);
        // an output may be a state of the same name
        match variables.iter_mut().find(|known| known.name == *name) {
            Some(known) => known.misfit = misfit,
            None => variables.push(Simulated {
                name: name.clone(),
                unit: variable.unit.clone(),
                description: variable.description.clone(),
                values,
                misfit,
            }),
        }
    }
    variables
}

/// Why a run is not whole.
fn ended(study: &Study, course: &Course, error: &RunError) -> Ended {
    Ended {
        message: match (course.limit, error) {
            (Some(spent), _) => not_whole(spent, error),
            (
                None,
                RunError::Diverged {
                    time, name, value, ..
                },
            ) => {
                format!("the plant alone leaves every bound: '{name}' is {value:e} at t = {time}")
            }
            (None, _) => in_words(error),
        },
        file: study.file.clone(),
        by_limit: course.limit.is_some(),
        followed: vec![],
    }
}

/// What the log has of an output: as the study screens it where its sensors measure it, else as it stands there.
fn readings(prepared: &Prepared<'_>, log: &Log<'_>, name: &str) -> Option<Series> {
    let settings = &prepared.study().estimate;
    let measured = &prepared.augmented().outputs;
    let found = match measured.iter().position(|o| o.variable.name == name) {
        Some(sensor) => log.samples.readings.get(sensor).cloned(),
        None => logged(&log.table, settings, &log.time, name).map(|column| log.spread(column)),
    };
    found.filter(|readings| !readings.is_empty())
}

/// The errors of an output.
fn misfit(
    prepared: &Prepared<'_>,
    (name, output): (&str, &Series),
    readings: Series,
    error_header: String,
) -> Misfit {
    let limits = prepared.declared().limits.of(name).copied();
    let is_at_end = |y: f64| limits.is_some_and(|limits| limits.ends(y));
    let missing = readings.iter().filter(|y| !y.is_finite()).count();
    let at_ends = readings.iter().filter(|y| is_at_end(*y)).count();
    let pairs = readings.iter().zip(output);
    let error = pairs.map(|(y, own)| match is_at_end(y) || !y.is_finite() {
        true => f64::NAN,
        false => y - own,
    });
    let error = Series::gathered(output.store(), error);
    let counts = |(y, error): (f64, f64)| error.is_finite().then_some(y);
    let counted: Vec<f64> = readings.iter().zip(&error).filter_map(counts).collect();
    let count = counted.len() as f64;
    let center = counted.iter().sum::<f64>() / count;
    let spread: f64 = counted.iter().map(|y| (y - center).powi(2)).sum();
    let errors = || error.iter().filter(|e| e.is_finite());
    let squares: f64 = errors().map(|e| e * e).sum();
    let number = |x: f64| Some(x).filter(|x| x.is_finite());
    let mean = number(errors().sum::<f64>() / count);
    Misfit {
        counted: counted.len(),
        missing,
        at_ends,
        mean,
        rms: number((squares / count).sqrt()),
        fit: number(100.0 * (1.0 - (squares / spread).sqrt())).filter(|_| spread > 0.0),
        error_header,
        readings,
        error,
    }
}
