//! `[simulate]`: how plant and observer are run together.

use lynkeus_run::Tolerances;

use super::Name;
use super::keys::{INTEGRATOR, SIMULATE};
use super::section::{Entry, Section};
use lynkeus_answer::Error;

/// How plant and observer are simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulateSettings {
    /// The first instant, in the plant's unit of time.
    pub start: f64,
    /// The last instant.
    pub until: f64,
    /// The spacing of the rows of the result; `None` gives 500 of them.
    pub output_step: Option<f64>,
    /// The spacing of the sensor's samples where there is noise; `None` takes the output step.
    pub sample_step: Option<f64>,
    /// The plant's inputs as expressions of time.
    pub inputs: Vec<(Name, Expression)>,
    /// Start values that replace those of the plant.
    pub initial: Vec<(Name, f64)>,
    /// Lists that stand in `initial` for the elements of arrays, with their lengths.
    pub lists: Vec<(Name, usize)>,
    /// The integrator and its steps or tolerances.
    pub method: Method,
    /// The seed of the noise and of `spread`.
    pub seed: u64,
    /// Standard deviations of the plant's starts and parameters from run to run, by the name of a
    /// state or of a parameter, in its unit.
    pub spread: Vec<(Name, f64)>,
}

/// Rows of a result whose study does not say how many.
const ROWS: f64 = 500.0;

impl SimulateSettings {
    /// The spacing of the rows of the result.
    #[must_use]
    pub fn row_step(&self) -> f64 {
        let span = self.until - self.start;
        self.output_step.unwrap_or(span / ROWS)
    }
}

/// A Modelica expression of time, such as `if time < 20 then 0.75 else 0.38`.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// The expression as written.
    pub source: Name,
}

impl From<f64> for Expression {
    fn from(value: f64) -> Self {
        Self {
            source: Name::from(format!("{value:?}").as_str()),
        }
    }
}

impl From<&str> for Expression {
    fn from(source: &str) -> Self {
        Self {
            source: Name::from(source),
        }
    }
}

/// The integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Steps whose length is controlled by their error.
    Adaptive {
        /// Which kind of solver.
        solver: Solver,
        /// Relative tolerance per step.
        rtol: f64,
        /// Absolute tolerance per step.
        atol: f64,
    },
    /// The classical Runge–Kutta method with fixed steps.
    Rk4(Rk4Step),
}

/// The kind of an error-controlled solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// Explicit where that is fast enough, else implicit.
    #[default]
    Auto,
    /// An explicit Runge–Kutta pair.
    Explicit,
    /// An implicit method for stiff equations.
    Stiff,
}

/// How long a step of the classical Runge–Kutta method is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rk4Step {
    /// At most this long, in the plant's unit of time.
    Length(f64),
    /// This many steps from one row to the next.
    PerRow(u64),
}

impl Default for Method {
    fn default() -> Self {
        Self::Adaptive {
            solver: Solver::Auto,
            rtol: 1e-9,
            atol: 1e-12,
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<SimulateSettings, Error> {
    let no_end = entry.refuse_key("needs the key `until`, the time at which the run ends");
    let mut section = entry.section("[simulate]", &[&SIMULATE[..], &INTEGRATOR].concat())?;
    let start = section.optional("start", Entry::number)?.unwrap_or(0.0);
    let until = section.take("until").ok_or(no_end)?;
    let too_early = until.wrong(&format!("a time after the start, {start}"));
    let until = until.number()?;
    if until <= start {
        return Err(too_early);
    }
    let mut lists = vec![];
    let initial = section.optional("initial", |entry| {
        let all = entry.elements(&mut lists)?.into_iter();
        all.map(|(name, value)| Ok((name, value.number()?)))
            .collect::<Result<Vec<_>, Error>>()
    })?;
    Ok(SimulateSettings {
        start,
        until,
        output_step: section.optional("output_step", Entry::positive)?,
        sample_step: section.optional("sample_step", Entry::positive)?,
        inputs: pairs(section.take("inputs"), expression)?,
        initial: initial.unwrap_or_default(),
        lists,
        method: method(&mut section)?,
        seed: section
            .optional("seed", |e| e.whole(0))?
            .unwrap_or_default(),
        spread: pairs(section.take("spread"), deviation)?,
    })
}

fn deviation(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a standard deviation, a number >= 0");
    entry.number().ok().filter(|sd| *sd >= 0.0).ok_or(refusal)
}

/// Reads `method` with the keys that go with it.
pub(super) fn method(section: &mut Section<'_>) -> Result<Method, Error> {
    let step = section.optional("step", Entry::positive)?;
    let substeps = section.optional("substeps", |e| e.whole(1))?;
    let rtol = section.optional("rtol", |e| e.within(&Tolerances::RELATIVE))?;
    let rtol = rtol.unwrap_or(1e-9);
    let atol = section.optional("atol", Entry::positive)?.unwrap_or(1e-12);
    let fixed = match (step, substeps) {
        (Some(step), _) => Rk4Step::Length(step),
        (None, Some(count)) => Rk4Step::PerRow(count),
        (None, None) => Rk4Step::PerRow(16),
    };
    let adaptive = |solver| Method::Adaptive { solver, rtol, atol };
    let chosen = section.optional("method", |e| {
        e.choice(&[
            ("adaptive", adaptive(Solver::Auto)),
            ("rk4", Method::Rk4(fixed)),
            ("explicit", adaptive(Solver::Explicit)),
            ("stiff", adaptive(Solver::Stiff)),
        ])
    })?;
    Ok(chosen.unwrap_or_else(|| adaptive(Solver::Auto)))
}

pub(super) fn expression(entry: Entry<'_>) -> Result<Expression, Error> {
    if entry.as_text().is_some() {
        return Ok(Expression {
            source: entry.name()?,
        });
    }
    let place = entry.place();
    let refusal = entry.wrong("a finite number or a Modelica expression of time in quotes");
    let value = entry.number().map_err(|_| refusal)?;
    let mut expression = Expression::from(value);
    expression.source.place = Some(place);
    Ok(expression)
}

pub(super) fn pairs<'a, T>(
    entry: Option<Entry<'a>>,
    read: impl Fn(Entry<'a>) -> Result<T, Error>,
) -> Result<Vec<(Name, T)>, Error> {
    entry.map_or(Ok(Vec::new()), |table| {
        table
            .pairs()?
            .into_iter()
            .map(|(name, value)| Ok((name, read(value)?)))
            .collect()
    })
}
