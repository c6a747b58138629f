//! A plant beside its observer, as what flows and jumps: z = (x, e, …), with the plant's states and unknown inputs x, the
//! error e = x̂ − x, and what else the observer keeps.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Interval, Node, Tape};
use lynkeus_model::{Home, Variable};
use lynkeus_observers::{Observer, ReadingError};
use lynkeus_proof::tube::{Problem, Sampled};
use lynkeus_structure::AugmentedPlant;
use lynkeus_study::{Name, Noise, bias_of};

use super::super::tube::{bounded, first_of, refuse_others, side};
use super::beside::{Beside, Equations, Reading};
use super::{filter, flow};
use crate::Error;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::Declared;
use lynkeus_experiment::prepare::systems::sampled_every;
use lynkeus_experiment::words::explain;

/// Samples beyond which nothing is followed.
const SAMPLES: f64 = 100_000.0;

/// What is followed, and what its numbers stand for.
pub(super) struct System {
    /// plant states, then unknown inputs
    pub states: Vec<Variable>,
    /// where the estimate starts
    pub estimate: Vec<f64>,
    /// the measured outputs with the bounds of their errors
    pub readings: Vec<Reading>,
    /// disturbances, and rates of change of unknown inputs
    pub inputs: Vec<Variable>,
    /// the time from one sample to the next; none for sensors that are read continuously
    pub every: Option<f64>,
    pub sampled: Sampled,
    /// places of the variances in z, of an observer that has them
    pub variances: Vec<usize>,
    /// names of the observer's monitors, and what these are in z, time and what moves
    pub monitors: (Vec<String>, Tape),
    pub notes: Vec<String>,
}

impl System {
    /// Places of the errors in z.
    pub fn errors(&self) -> std::ops::Range<usize> {
        let n = self.states.len();
        n..2 * n
    }

    /// Of a study, or why nothing can be said of its observer.
    ///
    /// # Errors
    /// Inputs without value; names that the plant does not have.
    pub fn of(
        prepared: &Prepared<'_>,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        start: &[(Name, f64, f64)],
        (from, until): (f64, f64),
    ) -> Result<Result<Self, String>, Error> {
        let is_filter = observer.filter.is_some();
        let own = match is_filter {
            true => filter::excluded(prepared, augmented, observer),
            false => flow::excluded(augmented, observer),
        };
        if let Some(what) = own.or_else(|| excluded(prepared, augmented).map(str::to_owned)) {
            return Ok(Err(format!("the tube of the error does not follow {what}")));
        }
        let study = prepared.study();
        let run = study.simulate.as_ref();
        let every = run.and_then(|run| sampled_every(study, run));
        let unsaid = match run {
            Some(_) if every.is_some() || !is_filter => None,
            None if !is_filter && augmented.inputs.is_empty() => None,
            None if !is_filter => {
                Some("the known inputs over time are not known: `inputs` of [simulate] says them")
            }
            _ => Some("when the sensors report is not known: `sample_step` of [simulate] says it"),
        };
        if let Some(unsaid) = unsaid {
            return Ok(Err(unsaid.to_owned()));
        }
        // rounding loses no sample at the end
        let whole = |every: f64| (until - from) / every * (1.0 + 4.0 * f64::EPSILON);
        let count = every.map_or(0.0, |every| whole(every).floor());
        if count > SAMPLES {
            return Ok(Err(format!(
                "{count} samples are too many to be followed one by one: an earlier `until`"
            )));
        }
        let times = every.map_or(vec![], |every| {
            let time = |k: usize| (from + k as f64 * every).min(until);
            (0..=count as usize).map(time).collect()
        });
        let beside = Beside::of(prepared, augmented, observer, run, from)?;
        let mut notes = vec![];
        let span = run.map_or(0.0, |run| run.until - run.start);
        let equations = match is_filter {
            true => filter::equations(&beside, prepared, span, &mut notes),
            false => flow::equations(&beside, study.estimate.between_samples, every),
        };
        let equations = match equations {
            Ok(equations) => equations,
            Err(obstacle) => return Ok(Err(obstacle)),
        };
        notes.extend(remarks(prepared, is_filter));
        let ranges = bounded(prepared, &beside.inputs)?;
        let start = starts(prepared, augmented, start)?;
        let mut system = Self::new(beside, equations, ranges, start, (every, times))?;
        system.notes = notes;
        Ok(system.unbounded().map_or(Ok(system), Err))
    }

    fn new(
        beside: Beside<'_, '_>,
        equations: Equations,
        ranges: Vec<Interval>,
        start: Vec<Interval>,
        (every, times): (Option<f64>, Vec<f64>),
    ) -> Result<Self, Error> {
        let n = beside.x.len();
        let mut ranges = ranges;
        let z = [&beside.x[..], &beside.e, &equations.others].concat();
        let bounds: Vec<f64> = beside.sensors.iter().map(|r| r.bound).collect();
        let mut moving: Vec<Node> = beside.inputs.iter().map(|v| v.node).collect();
        let mut errors = (beside.errors.clone(), bounds);
        match every {
            // what disturbs an output is at the sample wherever the plant is then, in the box or not
            Some(_) => {
                let read = beside.graph.symbols_of(&beside.shown);
                let disturbed = moving.iter().zip(&ranges);
                let disturbed = disturbed.filter(|(node, _)| read.contains(node));
                errors.extend(disturbed.map(|(&node, range)| (node, range.magnitude())));
            }
            None => {
                let around =
                    |bound: &f64| Interval::new(-bound, *bound).unwrap_or(Interval::ENTIRE);
                moving.extend(std::mem::take(&mut errors.0));
                ranges.extend(std::mem::take(&mut errors.1).iter().map(around));
            }
        }
        let (errors, sizes) = errors;
        let tape = |inputs: &[&[Node]], outputs: &[Node]| {
            Tape::new(beside.graph, &inputs.concat(), outputs).map_err(explain)
        };
        let right: Vec<Node> = beside
            .put(&beside.actual)
            .iter()
            .map(|x| x.node())
            .chain(equations.right)
            .collect();
        let time = [beside.time.0];
        let monitors = beside.observer.monitors.iter();
        let sampled = Sampled {
            flow: Problem {
                right: tape(&[&z, &time, &moving], &right)?,
                from: beside.time.1,
                start,
                constants: vec![],
                inputs: ranges,
            },
            first: tape(&[&beside.x], &equations.first)?,
            sample: tape(&[&z, &time, &errors], &equations.sample)?,
            errors: sizes,
            times,
        };
        Ok(Self {
            states: beside.augmented.states.clone(),
            estimate: beside.observer.states.iter().take(n).map(|s| s.1).collect(),
            readings: beside.sensors,
            inputs: beside.inputs,
            every,
            sampled,
            variances: equations
                .variances
                .iter()
                .map(|place| 2 * n + place)
                .collect(),
            monitors: (
                monitors.map(|m| m.name.clone()).collect(),
                tape(&[&z, &time, &moving], &equations.monitors)?,
            ),
            notes: vec![],
        })
    }

    /// Whether any readings have noise.
    pub fn is_noisy(&self) -> bool {
        self.readings.iter().any(|r| r.bound > 0.0)
    }

    /// The same with readings without noise.
    pub fn exact(&self) -> Sampled {
        let mut exact = self.sampled.clone();
        let count = self.readings.len();
        match self.every {
            // after the noise of each output stands what disturbs them, which stays
            Some(_) => exact.errors[..count].fill(0.0),
            None => {
                let inputs = &mut exact.flow.inputs;
                let first = inputs.len() - count;
                inputs[first..].fill(Interval::ZERO);
            }
        }
        exact
    }

    /// Where the monitors are while z and time are in ranges.
    pub fn monitored(&self, z: &[Interval], time: Interval) -> Vec<Interval> {
        let moving = &self.sampled.flow.inputs;
        let values = [z, &[time], moving].concat();
        self.monitors.1.eval_in(&Intervals, &values)
    }

    /// What has no bounds, which leaves nothing to be proved.
    fn unbounded(&self) -> Option<String> {
        let flow = &self.sampled.flow;
        let starts = self.states.iter().zip(&flow.start);
        let variables = starts.chain(self.inputs.iter().zip(&flow.inputs));
        let open = variables
            .filter(|(_, range)| !range.is_bounded())
            .map(|(v, _)| &v.name);
        let readings = self.readings.iter();
        let mut open = open.chain(
            readings
                .filter(|reading| !reading.bound.is_finite())
                .map(|reading| &reading.output),
        );
        let name = open.next()?;
        Some(format!(
            "{name} has no bounds: give its range, `min` and `max` in the model or {name} = [smallest, largest] in [box]"
        ))
    }
}

/// What no tube of an error counts.
fn excluded(prepared: &Prepared<'_>, augmented: &AugmentedPlant<'_>) -> Option<&'static str> {
    let Declared {
        ranges: _,
        noise: _,
        limits,
        samples: _,
        process_noise: _,
        disturbances: _,
        slew: _,
        input_derivatives: _,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = prepared.declared();
    let plant = prepared.plant();
    let curved = augmented.states.iter().any(|v| v.home != Home::Line);
    let found = [
        (!plant.whens.is_empty(), "events (`when`)"),
        (!plant.delays.is_empty(), "delays"),
        (limits.is_declared(), "`limits` of sensors"),
        (screens.is_declared(), "screened readings"),
        (late.is_declared(), "late readings"),
        (manifold.is_declared() || curved, "angles and rotations"),
        (input_noise.acts(), "`input_noise`"),
        (correlation.acts(), "correlated noise"),
    ];
    found.into_iter().find(|(is, _)| *is).map(|(_, what)| what)
}

/// What the reader should know.
fn remarks(prepared: &Prepared<'_>, is_filter: bool) -> Vec<String> {
    let declared = prepared.declared();
    let moves = declared.process_noise.acts();
    let is_gaussian = declared
        .noise
        .iter()
        .any(|(_, noise)| matches!(noise, Noise::Absolute(_) | Noise::Relative(_)));
    [
        Some(match is_filter {
            true => "of the filter in exact arithmetic, which holds known inputs from sample to sample: what its integrator leaves is not counted",
            false => "of the observer in exact arithmetic: what its integrator leaves is not counted",
        }),
        moves.then_some(match is_filter {
            true => "the filter counts the process noise in P, but the plant is followed without it: Gaussian noise leaves every bound",
            false => "the plant is followed without its process noise: Gaussian noise leaves every bound",
        }),
        is_gaussian.then_some("Gaussian readings are taken to lie within 3 standard deviations, all of them, however they conspire"),
    ]
    .into_iter()
    .flatten()
    .map(str::to_owned)
    .collect()
}

/// Where the plant and its unknown inputs start.
fn starts(
    prepared: &Prepared<'_>,
    augmented: &AugmentedPlant<'_>,
    given: &[(Name, f64, f64)],
) -> Result<Vec<Interval>, Error> {
    let (states, unknown) = augmented.states.split_at(augmented.plant_states());
    let given: Vec<(Name, Interval)> = given
        .iter()
        .filter_map(|(name, low, high)| Some((name.clone(), Interval::new(*low, *high).ok()?)))
        .collect();
    refuse_others(&given, &prepared.plant().name, augmented.states.iter())?;
    // an offset of a sensor is anywhere within three of its deviations, as noise is
    let bias = &prepared.study().sensors.bias;
    let offset = |v: &Variable| {
        let mut outputs = prepared.plant().outputs.iter();
        let output = outputs.find(|o| bias_of(&o.name) == v.name)?;
        let most = ReadingError::DEVIATIONS * Name::best(bias, &output.name)?;
        Interval::new(-most, most).ok()
    };
    let own = |v: &Variable| Name::best(&given, &v.name).copied().or_else(|| offset(v));
    let usual = first_of(prepared)?;
    let states = states.iter().zip(usual);
    let states = states.map(|(v, usual)| own(v).unwrap_or(Interval::point(usual)));
    Ok(states
        .chain(unknown.iter().map(|v| own(v).unwrap_or(side(v))))
        .collect())
}
