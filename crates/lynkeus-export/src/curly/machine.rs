//! A drafted estimator: its state, its tables, and what is done with them.

use lynkeus_run::{Blueprint, Method, Step, System};

use super::device::{Device, FirstReading};
use super::function::{Arguments, Entry, Target, draft};
use super::tables::number;
use super::template::{chosen, mentions, parts};
use crate::code::{Part, Solver};
use crate::{Code, Refusal};

/// A part of the state that is carried from sample to sample.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub name: &'static str,
    pub kind: Kind,
    /// number of entries; none for a single number
    pub count: Option<usize>,
    pub about: String,
    /// at the start
    pub start: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Real,
    Double,
    Int,
    /// 0 or 1
    Truth,
}

/// The estimator as a draft, but for the frame that each language has of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Machine {
    pub sizes: Vec<(String, usize)>,
    pub fields: Vec<Field>,
    pub tables: String,
    /// functions, in the order of their use
    pub source: String,
}

const LIBRARY: &str = include_str!("runtime/library.c");
const STEPS: &str = include_str!("runtime/steps.c");
const INTEGRATE: &str = include_str!("runtime/integrate.c");
const PUSH: &str = include_str!("runtime/push.c");

impl Machine {
    /// # Errors
    /// [`Refusal`]: what solves an optimisation, looks ahead, has no fixed step or jumps with time,
    /// and operations that no language has.
    pub fn of(device: &Device<'_>) -> Result<Self, Refusal> {
        let mut machine = Self::default();
        let sensors = device.sensors();
        machine.size("SENSORS", sensors);
        machine.size("INPUTS", device.signals.len().saturating_sub(sensors));
        machine.size("SIGNALS", device.signals.len());
        machine.size("REPORTED", device.estimates.len());
        machine.single("time", Kind::Double, "of the last sample", 0.0);
        machine.single("started", Kind::Truth, "whether there was one", 0.0);
        machine.single(
            "scale",
            Kind::Real,
            "the largest start, reading or input so far",
            1.0,
        );
        let about = "samples in a row for which the equations had no value or an estimate ran away";
        machine.single("refused", Kind::Int, about, 0.0);
        machine.steps(device.blueprint.method())?;
        let mut holds = vec![];
        match device.blueprint {
            Blueprint::Sampled { observer, .. } => {
                holds.push("sampled");
                machine.sampled(device, observer)?;
            }
            Blueprint::Filter { .. } => machine.filter(device)?,
        }
        if !device.first_readings.is_empty() {
            holds.push("first");
        }
        if !device.tunables.is_empty() {
            holds.push("tunable");
        }
        let first: Vec<String> = device.first_readings.iter().map(first_reading).collect();
        machine.add(&chosen(PUSH, &holds).replace("        FIRST_READINGS\n", &first.concat()));
        Ok(machine)
    }

    /// The functions of the library that are called, those that others call first.
    pub fn library(&self) -> Vec<(&'static str, &'static str)> {
        let mut needed: Vec<(&str, &str)> = vec![];
        let all: Vec<(&str, &str)> = parts(LIBRARY).collect();
        for part in all.into_iter().rev() {
            let is_called = |text: &str| mentions(text, part.0);
            if is_called(&self.source) || needed.iter().any(|other| is_called(other.1)) {
                needed.insert(0, part);
            }
        }
        needed
    }

    /// Sizes, tables, what is called of the library, and the functions.
    pub fn text(&self) -> String {
        let sizes = self.sizes.iter();
        let sizes: Vec<String> = sizes.map(|(name, n)| format!("    {name} = {n}")).collect();
        let sizes = sizes.join(",\n");
        let library = self.library().into_iter();
        let library: String = library.map(|(_, text)| format!("{text}\n\n")).collect();
        let tables = match self.tables.is_empty() {
            true => String::new(),
            false => format!("{}\n", self.tables),
        };
        format!("enum {{\n{sizes}\n}};\n\n{tables}{library}{}", self.source)
    }

    /// How an interval is divided.
    pub fn steps(&mut self, method: Method) -> Result<(), Refusal> {
        self.add(&STEPS.replace("STEP_LENGTH", &step_length(method)?));
        Ok(())
    }

    /// The classical Runge-Kutta method for x' that [`Machine::flow`] writes.
    pub fn integrate(&mut self, dimension: usize) {
        self.size("DIMENSION", dimension);
        self.add(FIELD);
        self.add(INTEGRATE);
    }

    pub fn size(&mut self, name: impl Into<String>, value: usize) {
        self.sizes.push((name.into(), value));
    }

    pub fn field(&mut self, name: &'static str, kind: Kind, about: &str, start: Vec<f64>) {
        self.fields.push(Field {
            name,
            kind,
            count: Some(start.len()),
            about: about.into(),
            start,
        });
    }

    fn single(&mut self, name: &'static str, kind: Kind, about: &str, start: f64) {
        self.fields.push(Field {
            name,
            kind,
            count: None,
            about: about.into(),
            start: vec![start],
        });
    }

    pub fn add(&mut self, text: &str) {
        self.source += text;
        self.source.push('\n');
    }

    /// x' alone.
    pub fn flow(&mut self, system: &System, arguments: &Arguments) -> Result<(), Refusal> {
        refuse_jumps(system)?;
        let text = draft(
            "The derivatives.",
            "flow",
            &code(&[Part::all(system.derivative_tape())])?,
            arguments,
            &[Target::all("dx", system.states().len())],
        )?;
        self.add(&text);
        Ok(())
    }
}

/// How a state changes, as a type.
pub(super) const FIELD: &str = "/* How a state changes: writes dx. */\ntypedef void (*field)(real t, const real *x, const real *w, real *dx);\n";

pub(super) fn code(parts: &[Part<'_>]) -> Result<Code, Refusal> {
    Code::of_parts(parts, Solver::Conditioned)
}

/// The length of a step, for an interval of some `length`.
fn step_length(method: Method) -> Result<String, Refusal> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Ok(format!("(length < {h:?} ? length : {h:?})")),
        Method::Rk4(Step::Substeps(n)) => Ok(format!("(length / {n}.0)")),
        _ => Err(Refusal::NoFixedStep),
    }
}

/// What jumps with time alone needs its instants found.
pub(super) fn refuse_jumps(system: &System) -> Result<(), Refusal> {
    match system.modes() {
        0 => Ok(()),
        _ => Err(Refusal::JumpsWithTime),
    }
}

fn first_reading(first: &FirstReading) -> String {
    let FirstReading {
        sensor,
        state,
        slope,
        offset,
    } = first;
    let (slope, offset) = (number(*slope), number(*offset));
    format!(
        "        if (isfinite(signals[{sensor}])) {{\n            s->x[{state}] = (signals[{sensor}] - ({offset})) / ({slope});\n        }}\n"
    )
}

/// States and signals with what the device knows of them.
pub(super) fn arguments(states: &[String], signals: &[String], device: &Device<'_>) -> Arguments {
    let known = |name: &String| device.words.iter().find(|entry| entry.name == *name);
    let entry = |name: &String| known(name).cloned().unwrap_or_else(|| Entry::named(name));
    Arguments {
        x: states.iter().map(entry).collect(),
        w: signals.iter().map(entry).collect(),
    }
}
