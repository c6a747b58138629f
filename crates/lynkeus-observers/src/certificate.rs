//! What can be guaranteed about an observer, and why.

use derive_more::From;
use lynkeus_expr::{Interval, MissingInput, Node, Spent};
use lynkeus_structure::{AugmentedPlant, Dimension, Measurement, Region, Standing, range};
use nalgebra::DMatrix;

use crate::statement::{proved, standing, undecided};
use crate::{Check, Reason, Statement};

/// The measurement error of an output, which is a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingError {
    /// bound of what disturbances add
    pub disturbed: f64,
    /// bound of a uniform noise
    pub uniform: f64,
    /// standard deviation of a Gaussian noise
    pub deviation: f64,
}

impl ReadingError {
    /// Gaussian measurement errors are taken to stay within this many standard deviations.
    pub const DEVIATIONS: f64 = 3.0;

    /// A bound, of Gaussian noise within [`Self::DEVIATIONS`].
    #[must_use]
    pub fn bound(&self) -> f64 {
        let [disturbed, uniform, deviation, times] = [
            self.disturbed,
            self.uniform,
            self.deviation,
            Self::DEVIATIONS,
        ]
        .map(Interval::point);
        // no deviation is none, however many
        let normal = if self.deviation == 0.0 {
            Interval::ZERO
        } else {
            times * deviation
        };
        (disturbed + uniform + normal).hi()
    }
}

/// What a guarantee may take for granted beside the plant's equations.
#[derive(Clone, Debug)]
pub struct Assumptions {
    /// the box in which plant and estimate stay: augmented states, known inputs, time
    pub region: Region,
    /// per augmented state: a bound of |x' − f(x, u)|, that is of what acts on the
    /// plant and the observer does not know (disturbances; v' of an unknown input)
    pub drift: Vec<f64>,
    /// per measured output: a bound of the measurement error, in the output's unit
    pub noise: Vec<f64>,
    /// the same error, apart by what is known of it; empty where only its bound is
    pub readings: Vec<ReadingError>,
    /// per augmented state: the spectral density of white noise on x'
    pub process_noise: Vec<f64>,
    /// per known input: bounds of |u'|, |u''|, …, as many as are known
    pub input_derivatives: Vec<Vec<f64>>,
    /// f and h have values on that box and do not jump
    regularity: Check,
    /// no reading is beyond what its sensor can show; none where every sensor shows everything
    within_limits: Option<Check>,
    /// of the augmented states, then of the measured outputs
    names: Vec<String>,
    time: Node,
}

impl Assumptions {
    /// That plant and estimate stay in the box, and nothing else acts: neither drift nor noise of any
    /// kind; the inputs' derivatives have the bounds of the plant. That is examined there: what
    /// has no value or jumps is covered by no proof.
    ///
    /// # Errors
    /// [`MissingInput`] where the plant has parameters without value.
    pub fn new(augmented: &AugmentedPlant<'_>, region: Region) -> Result<Self, MissingInput> {
        Ok(Self {
            drift: vec![0.0; augmented.states.len()],
            noise: vec![0.0; augmented.outputs.len()],
            readings: vec![],
            process_noise: vec![0.0; augmented.states.len()],
            input_derivatives: augmented.input_derivatives.clone(),
            within_limits: None,
            time: augmented.plant.time,
            names: augmented
                .states
                .iter()
                .chain(augmented.outputs.iter().map(|o| &o.variable))
                .map(|v| v.name.clone())
                .collect(),
            regularity: Statement::PlantIsRegular.with(augmented.regularity(&region)?),
            region,
        })
    }

    /// That what acts on the plant and on its sensors has bounds; nothing where nothing acts.
    fn what_acts(&self) -> Option<Check> {
        let sizes = self.drift.iter().chain(&self.noise);
        let acting = self
            .names
            .iter()
            .zip(sizes)
            .filter(|(_, size)| **size != 0.0);
        let (bounded, open): (Vec<_>, Vec<_>) = acting.partition(|(_, size)| size.is_finite());
        let open: Vec<String> = open.iter().map(|(name, _)| (*name).clone()).collect();
        let any = !(bounded.is_empty() && open.is_empty());
        any.then(|| match open.is_empty() {
            true => proved(Statement::WhatActs, Reason::Assumed),
            false => undecided(Statement::WhatActs, Reason::ActsWithoutBound(open)),
        })
    }

    /// With bounds of what acts on the plant, one per augmented state.
    #[must_use]
    pub fn with_drift(mut self, drift: Vec<f64>) -> Self {
        self.drift = drift;
        self
    }

    /// With the spectral densities of white noise on the derivatives, one per augmented state.
    #[must_use]
    pub fn with_process_noise(mut self, densities: Vec<f64>) -> Self {
        self.process_noise = densities;
        self
    }

    /// The states that process noise moves.
    fn moved(&self) -> Vec<String> {
        let pairs = self.names.iter().zip(&self.process_noise);
        let moved = pairs.filter(|(_, density)| **density > 0.0);
        moved.map(|(name, _)| name.clone()).collect()
    }

    /// The unknown inputs, from state `first` on, that neither a bound of their rate of change nor process
    /// noise lets move.
    pub(crate) fn constant(&self, first: usize) -> Vec<&str> {
        let acting = [&self.drift, &self.process_noise];
        let moves = |i: usize| {
            acting
                .iter()
                .any(|sizes| sizes.get(i).is_some_and(|size| *size > 0.0))
        };
        let still = (first..self.drift.len()).filter(|i| !moves(*i));
        still.map(|i| self.names[i].as_str()).collect()
    }

    /// Whether process noise moves the plant.
    pub(crate) fn is_moved(&self) -> bool {
        !self.moved().is_empty()
    }

    /// With bounds of the measurement errors, one per measured output.
    #[must_use]
    pub fn with_noise(mut self, noise: Vec<f64>) -> Self {
        self.noise = noise;
        self.readings = vec![];
        self
    }

    /// With measurement errors of which more is known than their bounds, one per measured output.
    #[must_use]
    pub fn with_readings(mut self, readings: Vec<ReadingError>) -> Self {
        self.noise = readings.iter().map(ReadingError::bound).collect();
        self.readings = readings;
        self
    }

    /// Whether Gaussian noise is on a reading.
    pub(crate) fn is_gaussian(&self) -> bool {
        self.readings.iter().any(|error| error.deviation > 0.0)
    }

    /// With the ranges that the sensors can show, one per measured output. A reading is h on the box
    /// and its measurement error, whose bounds are given before.
    ///
    /// # Errors
    /// [`MissingInput`] where an output reads what has no range.
    pub fn with_limits(
        mut self,
        augmented: &AugmentedPlant<'_>,
        limits: &[Option<Interval>],
    ) -> Result<Self, MissingInput> {
        let mut beyond = vec![];
        for (j, output) in augmented.outputs.iter().enumerate() {
            let Some(limits) = limits.get(j).copied().flatten() else {
                continue;
            };
            let reading = self.reading(augmented, j, output)?;
            let is_shown = reading.is_defined() && reading.is_subset(limits);
            self.within_limits.get_or_insert_with(|| {
                proved(Statement::ReadingsAreShown, Reason::ReadingsOnTheBox)
            });
            if !is_shown {
                beyond.push((output.variable.name.clone(), reading, limits));
            }
        }
        if !beyond.is_empty() {
            let reason = Reason::BeyondSensors(beyond);
            self.within_limits = Some(undecided(Statement::ReadingsAreShown, reason));
        }
        Ok(self)
    }

    fn reading(
        &self,
        augmented: &AugmentedPlant<'_>,
        j: usize,
        output: &Measurement,
    ) -> Result<Interval, MissingInput> {
        let values = range(augmented.graph(), output.variable.node, &self.region)?.enclosure;
        Ok(match self.noise.get(j).copied().unwrap_or(0.0) {
            0.0 => values,
            error => values.inflate(error),
        })
    }

    /// Whether a sensor may be at an end of its range: then the observer is not the system that is
    /// certified.
    pub(crate) fn may_saturate(&self) -> bool {
        self.within_limits
            .as_ref()
            .is_some_and(|check| !check.is_proved())
    }

    /// The bound of the derivative of that order, from 1, of a known input; infinite where none is known.
    pub(crate) fn input_derivative(&self, input: usize, order: usize) -> f64 {
        let bounds = self.input_derivatives.get(input);
        let bound = bounds.and_then(|bounds| bounds.get(order.checked_sub(1)?));
        bound.copied().unwrap_or(f64::INFINITY)
    }

    /// With bounds of |u'|, |u''|, … per known input, as many as are known.
    #[must_use]
    pub fn with_input_derivatives(mut self, bounds: Vec<Vec<f64>>) -> Self {
        self.input_derivatives = bounds;
        self
    }
}

/// A number that a proof rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// its letter in the paper, e.g. `θ0`
    pub name: String,
    /// its value
    pub value: f64,
    /// what it is, in a few words
    pub meaning: String,
    /// numbers that stand in the place of `{}` in the meaning
    pub numbers: Vec<f64>,
}

impl Constant {
    /// The constant `name` = `value`.
    pub fn new(name: impl Into<String>, value: f64, meaning: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            value,
            meaning: meaning.into(),
            numbers: vec![],
        }
    }
}

/// What the error of a quantity ends within.
#[derive(Clone, Debug, PartialEq, From)]
pub struct UltimateBound {
    /// name of the augmented state
    pub name: String,
    /// of the absolute value, in the state's unit
    pub value: f64,
}

/// What the error as a whole and quantity by quantity ends within.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// of the Euclidean norm
    pub norm: f64,
    /// per augmented state
    pub states: Vec<UltimateBound>,
}

impl Bounds {
    /// The smaller of two that both hold, one by one.
    pub(crate) fn smaller(self, other: Self) -> Self {
        let states = self.states.into_iter().zip(other.states);
        Self {
            norm: self.norm.min(other.norm),
            states: states
                .map(|(a, b)| if a.value <= b.value { a } else { b })
                .collect(),
        }
    }
}

/// A guarantee: |x̂(t) − x(t)| ≤ c·e^(−rate·t)·|x̂(0) − x(0)| + ultimate bound,
/// while plant and estimate stay in the box.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// what proves it, e.g. `Theorem 2 of Hammouri, Targui and Armanet` or
    /// `linear matrix inequality`
    pub basis: &'static str,
    /// guaranteed decay rate, 1/time unit; only where proved
    pub rate: Option<f64>,
    /// c of the bound above: the factor by which the error may peak; only where proved
    pub overshoot: Option<f64>,
    /// guaranteed bound of the Euclidean norm of the error as t → ∞, under the
    /// assumed drift and noise; only where proved
    pub ultimate_bound: Option<f64>,
    /// the same per augmented state; empty where not known
    pub ultimate: Vec<UltimateBound>,
    /// under Gaussian noise of the process or of readings, what √(E|x̂ − x|²) ends within: of an error that
    /// process noise moves nothing has a bound for certain
    pub mean_square: Option<Bounds>,
    /// under such noise, what |x̂ − x| is within in the end, at any one time with the probability
    /// [`PROBABILITY`](lynkeus_proof::noise::PROBABILITY)
    pub probable: Option<Bounds>,
    /// the box
    pub region: Vec<Dimension>,
    /// what has to hold, with verdicts and witnesses
    pub hypotheses: Vec<Check>,
    /// the numbers of the proof
    pub constants: Vec<Constant>,
    /// P of the Lyapunov function V = eᵀPe, V' ≤ −2·rate·V, in the order of the
    /// augmented states; only where the proof has one
    pub lyapunov: Option<DMatrix<f64>>,
    /// what the reader should know
    pub notes: Vec<Reason>,
}

impl Certificate {
    /// A constant by its name.
    #[must_use]
    pub fn constant(&self, name: &str) -> Option<f64> {
        let mut constants = self.constants.iter();
        constants.find(|c| c.name == name).map(|c| c.value)
    }

    /// A certificate without rate, bounds, constants and notes; its verdict is
    /// that of the hypotheses, of which the first is always that the plant has values on
    /// the box of the assumptions and does not jump there.
    pub fn new(basis: &'static str, assumptions: &Assumptions, hypotheses: Vec<Check>) -> Self {
        let bounded = |d: &&Dimension| d.symbol != assumptions.time || d.max.is_finite();
        let sides = assumptions.region.dimensions.iter().filter(bounded);
        let first = std::iter::once(assumptions.regularity.clone()).chain(assumptions.what_acts());
        let first = first.chain(assumptions.within_limits.clone());
        let hypotheses: Vec<Check> = first.chain(hypotheses).collect();
        Self {
            basis,
            rate: None,
            overshoot: None,
            ultimate_bound: None,
            ultimate: vec![],
            mean_square: None,
            probable: None,
            region: sides.cloned().collect(),
            hypotheses,
            constants: vec![],
            lyapunov: None,
            notes: vec![],
        }
    }

    /// What is left of it where process noise moves the plant: that is Gaussian, no error has a bound for
    /// certain, and what would hold without it becomes a note.
    pub(crate) fn under(mut self, assumptions: &Assumptions) -> Self {
        let states = assumptions.moved();
        if states.is_empty() || self.verdict() != Standing::Proved {
            return self;
        }
        let in_mean_square = self.mean_square.is_some();
        self.notes.push(Reason::Moved {
            states,
            in_mean_square,
        });
        let states = std::mem::take(&mut self.ultimate);
        let without = self.ultimate_bound.take().filter(|norm| *norm > 0.0);
        self.notes.extend(without.map(|norm| {
            let states = states.into_iter().map(|b| (b.name, b.value)).collect();
            Reason::WithoutNoise { norm, states }
        }));
        self
    }

    /// Of a Kalman filter, of which nothing is certified.
    pub(crate) fn of_filter(basis: &'static str, assumptions: &Assumptions) -> Self {
        let check = undecided(Statement::FilterConverges, Reason::GainOfTheRun);
        Self::new(basis, assumptions, vec![check])
    }

    /// A limit ended the work: nothing is decided.
    pub(crate) fn ended(basis: &'static str, assumptions: &Assumptions, spent: Spent) -> Self {
        let check = undecided(Statement::Finished, Reason::Spent(spent));
        Self::new(basis, assumptions, vec![check])
    }

    /// Proved: the error decays at the stated rate, for everything in the box. Refuted: a point
    /// of the box shows that a hypothesis fails.
    pub fn verdict(&self) -> Standing {
        standing(&self.hypotheses)
    }

    /// The first hypothesis that is not proved.
    pub fn weakest(&self) -> Option<&Check> {
        self.hypotheses.iter().find(|check| !check.is_proved())
    }
}
