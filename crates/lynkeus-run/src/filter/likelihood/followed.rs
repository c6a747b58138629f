//! The likelihood along a filter itself, which goes where straight-line code does not: through events, along
//! rotations, by corrections that are iterated.
//!
//! Derivatives are differences: beside the filter at θ run two for each parameter, a little less and a little more,
//! row by row, and what is differenced are the innovations and their variances, so that gradient and Fisher's
//! information are of the same form as with tangents. A step is a small share of what the log tells of its
//! parameter. Where an event passes a reading between the two, an innovation jumps; the side on which it does not
//! counts.

use lynkeus_expr::{Node, Reals, Tape};

use super::plant::{ParametricLevel, ParametricPlant};
use super::score::{Row, Score, Seen, Tangents, check};
use crate::filter::censored::End;
use crate::filter::record::Independent;
use crate::filter::{Filter, FilterSettings, NoisyModel, NoisyPlant, Sensor};
use crate::manifold::Manifold;
use crate::runner::{Runner, Sample, check_time};
use crate::{Error, EstimatorSettings, Level, Method, Result, Step};

/// A step moves all innovations together by this many of their deviations: rounding is far below, bends far above.
const AIM: f64 = 1e-3;

/// As much less or more is as good.
const GOOD: f64 = 100.0;

/// The first step that is tried, and the largest, as shares of a value.
const FIRST: f64 = 1e-5;
const LARGEST: f64 = 1e-2;

/// Steps that are tried for a parameter.
const TRIALS: usize = 4;

/// An innovation that bends by more than this many deviations over a step has jumped.
const JUMP: f64 = 0.1;

/// A plant with its filter, as a function of θ.
#[derive(Clone, Debug)]
pub(super) struct Followed {
    /// the parameters are its last inputs
    model: NoisyModel,
    settings: FilterSettings,
    /// of θ: first estimates, their deviations, densities, and how strong noises are
    numbers: Tape,
    /// of each sensor whether its noise is a share
    shares: Vec<bool>,
    parameters: usize,
    inputs: usize,
    times: usize,
    /// steps of the differences, as shares of a size, with the least size
    steps: Option<Vec<(f64, f64)>>,
    /// why there was no value, the last time that there was none
    failure: Option<Error>,
}

impl Followed {
    /// Of a plant whose states and readings live on a manifold.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol, [`Error::Setting`] for what the filter does
    /// not take, and for a noise that depends on more than θ.
    pub fn new(
        plant: &ParametricPlant<'_>,
        settings: &FilterSettings,
        manifold: Manifold,
    ) -> Result<Self> {
        let g = plant.graph;
        let named = |node: &Node| (g.render(*node, 60), *node);
        let sizes = plant.sensors.iter().map(|sensor| match sensor.noise {
            ParametricLevel::Variance(variance) => g.expr(variance).sqrt().node(),
            ParametricLevel::Share(share) => share,
        });
        let sizes: Vec<Node> = sizes.collect();
        let symbols = g.symbols_of(&sizes);
        if symbols.iter().any(|s| !plant.parameters.contains(s)) {
            let expected = "a number or a parameter, where events or rotations are followed";
            return Err(Error::setting("noise", expected, "one that moves"));
        }
        let (means, deviations): (Vec<Node>, Vec<Node>) = plant.start.iter().copied().unzip();
        let numbers = [means, deviations, plant.process_noise.clone(), sizes].concat();
        let inputs = plant.inputs.iter().chain(&plant.parameters);
        let sensors = plant.sensors.iter().zip(1..).map(|(sensor, i)| Sensor {
            name: format!("y{i}"),
            output: sensor.output,
            noise: level(is_share(sensor.noise), 1.0),
            limits: sensor.limits,
        });
        let model = NoisyModel::new(&NoisyPlant {
            graph: g,
            time: plant.time,
            states: (plant.states.iter())
                .map(|state| (g.render(*state, 60), *state, 0.0))
                .collect(),
            derivatives: plant.derivatives.clone(),
            inputs: inputs.map(named).collect(),
            sensors: sensors.collect(),
            process_noise: vec![0.0; plant.states.len()],
            initial_variance: vec![0.0; plant.states.len()],
            ranges: plant.ranges.clone(),
            confined: confined(plant),
            whens: plant.whens.clone(),
        })?;
        Ok(Self {
            model: model.drawing(plant.drawn).on(manifold),
            settings: settings.clone(),
            numbers: Tape::new(g, &plant.parameters, &numbers)?,
            shares: plant.sensors.iter().map(|s| is_share(s.noise)).collect(),
            parameters: plant.parameters.len(),
            inputs: plant.inputs.len(),
            times: 1,
            steps: None,
            failure: None,
        })
    }

    pub fn shorten(&mut self, times: usize) {
        self.times = times.max(1);
    }

    pub fn has_events(&self) -> bool {
        self.model.flow.system().has_clauses()
    }

    /// Why there was no value.
    pub fn failure(&self) -> Option<&Error> {
        self.failure.as_ref()
    }

    /// As [`Likelihood::watched`](super::Likelihood::watched).
    pub fn score<'a>(
        &mut self,
        parameters: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        step: Step,
        mut see: impl FnMut(Seen),
    ) -> Result<Score> {
        check("number of parameters", self.parameters, parameters.len())?;
        self.failure = None;
        let Some(steps) = self.steps.clone() else {
            let rows: Vec<Row<'a>> = rows.into_iter().collect();
            let score = self.settle(parameters, &rows, step)?;
            return match score {
                Some(score) => Ok(score),
                None => self.score(parameters, rows, step, see),
            };
        };
        let steps: Vec<f64> = (steps.iter().zip(parameters))
            .map(|((share, least), value)| share * value.abs().max(*least))
            .collect();
        Ok(self.pass(parameters, &steps, rows, step, &mut see)?.0)
    }

    /// Finds the steps of the differences; a score where there is no value, and so none.
    fn settle(&mut self, at: &[f64], rows: &[Row<'_>], step: Step) -> Result<Option<Score>> {
        let own = |value: f64| if value == 0.0 { 1.0 } else { value.abs() };
        let mut shares = vec![FIRST; at.len()];
        for _ in 0..TRIALS {
            let steps: Vec<f64> = shares.iter().zip(at).map(|(s, x)| s * own(*x)).collect();
            let rows = rows.iter().copied();
            let (score, moved) = self.pass(at, &steps, rows, step, &mut |_| {})?;
            if !score.value.is_finite() {
                return Ok(Some(score));
            }
            let mut is_good = true;
            for (share, moved) in shares.iter_mut().zip(moved) {
                let factor = (AIM / moved).clamp(1e-4, 1e4);
                let largest = *share >= LARGEST && factor > 1.0;
                if (GOOD.recip()..GOOD).contains(&factor) || largest {
                    continue;
                }
                *share = (*share * factor).min(LARGEST);
                is_good = false;
            }
            if is_good {
                break;
            }
        }
        // a value that comes near zero has still the size that it had
        let least = |value: f64| {
            if value == 0.0 {
                1.0
            } else {
                0.01 * value.abs()
            }
        };
        let found = shares.iter().zip(at).map(|(share, x)| (*share, least(*x)));
        self.steps = Some(found.collect());
        Ok(None)
    }

    /// The score with such steps, and by how many deviations each moves the innovations.
    fn pass<'a>(
        &mut self,
        at: &[f64],
        steps: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        step: Step,
        see: &mut dyn FnMut(Seen),
    ) -> Result<(Score, Vec<f64>)> {
        let count = at.len();
        let mut score = Score::none(count);
        let mut moved = vec![0.0; count];
        let mut center = Some(self.walk(at, step)?);
        let beside = (0..2 * count).map(|k| {
            let mut there = at.to_vec();
            there[k / 2] += if k % 2 == 0 {
                -steps[k / 2]
            } else {
                steps[k / 2]
            };
            // where it cannot begin the other side counts
            self.walk(&there, step).ok()
        });
        let mut beside: Vec<Option<Walk>> = beside.collect();
        let mut tangents = Tangents {
            dν: vec![0.0; count],
            dσ2: vec![0.0; count],
            ..Tangents::default()
        };
        for (place, row) in rows.into_iter().enumerate() {
            check("number of readings", self.shares.len(), row.readings.len())?;
            check("number of inputs", self.inputs, row.inputs.len())?;
            if let Err(error) = follow(&mut center, &row)? {
                self.failure = Some(error);
                score.value = f64::INFINITY;
                return Ok((score, moved));
            }
            for walk in &mut beside {
                // one that breaks off says nothing more
                let _ = follow(walk, &row)?;
            }
            let own = seen(&center);
            for (k, found) in own.iter().enumerate() {
                (tangents.ν, tangents.σ2) = (found.innovation, found.variance);
                for (p, sides) in beside.chunks_exact(2).enumerate() {
                    let [less, more] = [0, 1].map(|side| {
                        let there = seen(&sides[side]).get(k);
                        there.filter(|there| there.is_like(found))
                    });
                    let slopes = slopes(found, [less, more], steps[p]);
                    (tangents.dν[p], tangents.dσ2[p]) = slopes;
                    let [ν, σ2] = [slopes.0, slopes.1].map(|slope| slope * steps[p]);
                    if found.variance > 0.0 {
                        moved[p] += ν * ν / found.variance;
                        moved[p] += 0.5 * (σ2 / found.variance).powi(2);
                    }
                }
                match found.end {
                    None => score.count(&tangents),
                    Some(end) => score.count_end(end, &tangents),
                }
                see(Seen {
                    row: place,
                    sensor: found.sensor,
                    innovation: found.innovation,
                    variance: found.variance,
                    is_at_end: found.end.is_some(),
                });
            }
            if !score.value.is_finite() {
                break;
            }
        }
        moved.iter_mut().for_each(|m: &mut f64| *m = m.sqrt());
        Ok((score, moved))
    }

    /// A filter at θ, before the first row.
    fn walk(&self, at: &[f64], step: Step) -> Result<Walk> {
        let n = self.model.process_noise.len();
        let numbers = self.numbers.eval_in(&Reals, at);
        let mut parts = numbers.chunks(n);
        let mut next = || parts.next().unwrap_or_default().to_vec();
        let (means, deviations, densities) = (next(), next(), next());
        let mut model = self.model.clone();
        model.start_with(means, deviations.iter().map(|d| d * d).collect(), densities)?;
        let sizes = &numbers[3 * n..];
        for ((sensor, is_share), size) in model.sensors.iter_mut().zip(&self.shares).zip(sizes) {
            sensor.noise = level(*is_share, *size);
        }
        let run = EstimatorSettings {
            method: Method::Rk4(shortened(step, self.times)),
            ..EstimatorSettings::default()
        };
        let mut filter = Filter::new(&model, &self.settings, run)?;
        filter.keep_record();
        Ok(Walk {
            filter,
            parameters: at.to_vec(),
            inputs: vec![],
            before: None,
        })
    }
}

/// A filter on its way.
struct Walk {
    filter: Filter,
    parameters: Vec<f64>,
    /// those of the row, then the parameters
    inputs: Vec<f64>,
    before: Option<f64>,
}

/// To the next row; none of one that broke off. What breaks off a filter is no error of the log.
fn follow(walk: &mut Option<Walk>, row: &Row<'_>) -> Result<Result<()>> {
    let Some(own) = walk else { return Ok(Ok(())) };
    check_time(own.before, row.t)?;
    let done = own.go(row);
    if done.is_err() {
        *walk = None;
    }
    match done {
        // a step of which there are too many, not a place without a value
        Err(error @ Error::Setting { .. }) => Err(error),
        done => Ok(done),
    }
}

impl Walk {
    fn go(&mut self, row: &Row<'_>) -> Result<()> {
        self.inputs.clear();
        self.inputs.extend_from_slice(row.inputs);
        self.inputs.extend_from_slice(&self.parameters);
        let sample = Sample {
            t: row.t,
            readings: row.readings,
            inputs: &self.inputs,
            held: 0,
        };
        match self.before.replace(row.t) {
            Some(before) => self.filter.advance(before, &sample)?,
            None => self.filter.begin(&sample)?,
        }
        self.filter.update(&sample)?;
        self.filter.report(row.t)
    }
}

/// What became of the readings of the last row.
fn seen(walk: &Option<Walk>) -> &[Independent] {
    let record = walk.as_ref().and_then(|walk| walk.filter.record());
    record.map_or(&[], |record| &record.independent)
}

/// The slopes of an innovation and of its variance by a parameter, of those a step less and a step more.
fn slopes(at: &Independent, sides: [Option<&Independent>; 2], step: f64) -> (f64, f64) {
    let [less, more] =
        sides.map(|side| side.map(|s| [s.innovation - at.innovation, s.variance - at.variance]));
    let σ = at.variance.sqrt();
    let found = match (less, more) {
        (Some(less), Some(more)) => {
            let bends = (less[0] + more[0]).abs() > JUMP * σ
                || (less[1] + more[1]).abs() > JUMP * at.variance;
            let nearer = less[0].abs() / σ + less[1].abs() / at.variance
                < more[0].abs() / σ + more[1].abs() / at.variance;
            match (bends, nearer) {
                (false, _) => [0, 1].map(|i| 0.5 * (more[i] - less[i])),
                (true, true) => less.map(|x| -x),
                (true, false) => more,
            }
        }
        (Some(less), None) => less.map(|x| -x),
        (None, Some(more)) => more,
        (None, None) => [0.0; 2],
    };
    (found[0] / step, found[1] / step)
}

impl Independent {
    /// Whether it is the same reading, told the same way.
    fn is_like(&self, other: &Self) -> bool {
        let end = |own: &Self| own.end.map(End::sign);
        self.sensor == other.sensor && end(self) == end(other)
    }
}

fn is_share(level: ParametricLevel) -> bool {
    matches!(level, ParametricLevel::Share(_))
}

fn level(is_share: bool, size: f64) -> Level {
    match is_share {
        true => Level::Relative(size),
        false => Level::Absolute(size),
    }
}

/// So many times as many steps.
fn shortened(step: Step, times: usize) -> Step {
    match step {
        Step::Auto => Step::Substeps(times),
        Step::AtMost(length) => Step::AtMost(length / times as f64),
        Step::Substeps(count) => Step::Substeps(count.saturating_mul(times)),
    }
}

/// The derivatives within the ranges, for where they have no value; events have a say where the state is.
fn confined(plant: &ParametricPlant<'_>) -> Option<Vec<Node>> {
    let has_ends = plant
        .ranges
        .iter()
        .any(|range| range.low.is_finite() || range.high.is_finite());
    (plant.whens.is_empty() && has_ends).then(|| plant.limited())
}
