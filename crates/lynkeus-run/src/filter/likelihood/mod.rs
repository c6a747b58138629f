//! How likely a log is, and how that changes with what is not known: parameters of the plant, noises, starts.
//!
//! Along an extended filter every reading has an innovation ν = y − ŷ with a variance σ², and
//! −log L = ½ Σ (ν²/σ² + log 2πσ²) (F. C. Schweppe, *IEEE Transactions on Information Theory* 11 (1965) 61–70).
//! A sample is straight-line code over expressions ([`super::expressions`]), so that its derivatives are
//! expressions, too: ∂x̂/∂θ and ∂S/∂θ are carried beside x̂ and S, one parameter in each lane. The same tangents
//! give Fisher's information, Σ (∂ν ∂νᵀ/σ² + ½ ∂σ² ∂σ²ᵀ/σ⁴), with which a search takes its steps and whose
//! inverse is the covariance of what it finds (K. J. Åström, *Automatica* 16 (1980) 551–574).

mod code;
mod followed;
mod interval;
mod plant;
mod sample;
mod score;
mod stiff;
mod unscented;

use lynkeus_expr::Tape;
use lynkeus_native::Function;

use super::censored::{End, Tail};
use super::{FilterSettings, SigmaPoints};
use crate::integrator::fixed_steps;
use crate::manifold::Manifold;
use crate::noise::Limits;
use crate::{Error, Method, Result, Step};
use code::{Bundle, Code, passes};
use followed::Followed;
use interval::{GRADED, Interval, MOST_GRADED};
pub use plant::{ParametricLevel, ParametricPlant, ParametricSensor};
use sample::Sample;
pub use score::{Row, Score, Seen};
use score::{Tangents, check};
use unscented::{Points, Unscented};

/// [`Score`]s of one plant: compiled once, for any log and any θ.
///
/// ```
/// use lynkeus_expr::Graph;
/// use lynkeus_run::filter::{Likelihood, ParametricLevel, ParametricPlant, ParametricSensor, Row};
/// use lynkeus_run::Step;
///
/// // a level that nobody moves: its value is the mean of the readings
/// let g = Graph::new();
/// let [time, x, level] = ["time", "x", "level"].map(|name| g.symbol(name));
/// let number = |value: f64| g.constant(value).node();
/// let mut likelihood = Likelihood::new(&ParametricPlant {
///     graph: &g,
///     time: time.node(),
///     states: vec![x.node()],
///     derivatives: vec![number(0.0)],
///     inputs: vec![],
///     sensors: vec![ParametricSensor {
///         output: x.node(),
///         noise: ParametricLevel::Variance(number(1.0)),
///         limits: None,
///         is_dial: false,
///     }],
///     process_noise: vec![number(0.0)],
///     ranges: vec![],
///     start: vec![(level.node(), number(0.0))],
///     drawn: 0,
///     whens: Default::default(),
///     parameters: vec![level.node()],
/// })?;
/// let rows = [1.0, 2.0, 6.0].map(|y| [y]);
/// let log = |k: usize| Row { t: k as f64, readings: &rows[k], inputs: &[] };
/// let score = likelihood.score(&[3.0], (0..3).map(log), Step::Substeps(1))?;
/// assert!(score.gradient[0].abs() < 1e-12);
/// assert!((score.information[0] - 3.0).abs() < 1e-12);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Likelihood(Wide);

/// As many parameters in a pass as the processor takes.
#[derive(Clone, Debug)]
enum Wide {
    Four(Box<Passes<4>>),
    Eight(Box<Passes<8>>),
    /// none: the filter itself is followed
    Followed(Box<Followed>),
}

impl Likelihood {
    /// Compiles a plant.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol, [`Error::Setting`] for wrong numbers of
    /// expressions.
    pub fn new(plant: &ParametricPlant<'_>) -> Result<Self> {
        plant.check()?;
        plant.refuse_events()?;
        Self::of(&Sample::new(plant), None)
    }

    /// The same along an unscented filter.
    ///
    /// # Errors
    /// As [`Self::new`], and those of [`SigmaPoints::weights`].
    pub fn unscented(plant: &ParametricPlant<'_>, points: SigmaPoints) -> Result<Self> {
        plant.check()?;
        plant.refuse_events()?;
        let weights = points.weights(plant.states.len())?;
        let shown = unscented::shown(plant);
        let sample = Sample::full(&shown);
        let own = Unscented {
            plant,
            sample: &sample,
            weights,
        };
        Self::of(&sample, Some(&own))
    }

    /// The same along a filter with such settings itself, of a plant whose states and readings live on a manifold: events
    /// ([`ParametricPlant::whens`]) and iterated corrections are followed. Derivatives are differences then, of
    /// innovations and their variances, to about six digits.
    ///
    /// # Errors
    /// As [`Self::new`]; [`Error::Setting`] for a filter without a covariance, for what it does not take, and for a noise that
    /// depends on more than θ.
    pub fn along(
        plant: &ParametricPlant<'_>,
        settings: &FilterSettings,
        manifold: Manifold,
    ) -> Result<Self> {
        plant.check()?;
        let followed = Followed::new(plant, settings, manifold)?;
        Ok(Self(Wide::Followed(Box::new(followed))))
    }

    /// Whether it may have knees and steps: where an event passes a reading.
    pub fn has_knees(&self) -> bool {
        match &self.0 {
            Wide::Followed(followed) => followed.has_events(),
            Wide::Four(_) | Wide::Eight(_) => false,
        }
    }

    /// Why the last score has no value, where a filter is followed.
    pub fn failure(&self) -> Option<&Error> {
        match &self.0 {
            Wide::Followed(followed) => followed.failure(),
            Wide::Four(_) | Wide::Eight(_) => None,
        }
    }

    fn of(sample: &Sample<'_, '_>, points: Option<&Unscented<'_, '_>>) -> Result<Self> {
        let is_wide = lynkeus_native::widest() == 8 && sample.plant().parameters.len() > 4;
        Ok(Self(match is_wide {
            true => Wide::Eight(Box::new(Passes::new(
                sample,
                points,
                Function::<8>::compile,
            )?)),
            false => Wide::Four(Box::new(Passes::new(
                sample,
                points,
                Function::<4>::compile,
            )?)),
        }))
    }

    /// From now on by implicit steps, for stiff plants, or not; whether it has such: those of a plant alone, which no
    /// noise disturbs and whose start is known, have them unless their equations are too many.
    pub fn implicit(&mut self, is_implicit: bool) -> bool {
        match &mut self.0 {
            Wide::Four(passes) => passes.implicit(is_implicit),
            Wide::Eight(passes) => passes.implicit(is_implicit),
            Wide::Followed(_) => false,
        }
    }

    /// From now on by so many times as many steps in every interval between two rows.
    pub fn shorten(&mut self, times: usize) {
        match &mut self.0 {
            Wide::Four(passes) => passes.times = times.max(1),
            Wide::Eight(passes) => passes.times = times.max(1),
            Wide::Followed(followed) => followed.shorten(times),
        }
    }

    /// −log L of a log at θ, its gradient and Fisher's information; from row to row by such steps of Runge and
    /// Kutta ([`Step::Auto`]: one), or of Rosenbrock's kind ([`Self::implicit`]).
    ///
    /// # Errors
    /// [`Error::Setting`] for another number of parameters, readings or inputs, a step that is no length or too
    /// many of them; [`Error::NoNumber`] for a time that is none, [`Error::TimeBefore`] for rows that run back.
    pub fn score<'a>(
        &mut self,
        parameters: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        step: Step,
    ) -> Result<Score> {
        self.watched(parameters, rows, step, |_| {})
    }

    /// The same; `see` is told every innovation.
    ///
    /// # Errors
    /// As [`Self::score`].
    pub fn watched<'a>(
        &mut self,
        parameters: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        step: Step,
        see: impl FnMut(Seen),
    ) -> Result<Score> {
        Method::Rk4(step).check()?;
        match &mut self.0 {
            Wide::Four(passes) => passes.score(parameters, rows, step, see),
            Wide::Eight(passes) => passes.score(parameters, rows, step, see),
            Wide::Followed(followed) => followed.score(parameters, rows, step, see),
        }
    }
}

/// The code of a sample, and x̂ and S with their tangents, by pass.
#[derive(Clone, Debug)]
struct Passes<const L: usize> {
    parameters: usize,
    /// of θ: x̂ and S at the start
    begin: Code<L>,
    /// of t, h, u, x̂, S and θ: x̂ and S a step later
    predict: Predict<L>,
    /// of t, u, x̂, S and θ, along an unscented filter: what the sensors show beside x̂
    show: Option<Code<L>>,
    /// of t, u, x̂, S and θ: the variances of noises that are shares of an output
    levels: Option<Code<L>>,
    /// from row to row by a step for stiff equations
    implicit: Option<Predict<L>>,
    is_implicit: bool,
    /// so many times as many steps as are asked for
    times: usize,
    /// inputs that move the states
    drives: Vec<bool>,
    spare: Option<Spare<L>>,
    sensors: Vec<Sensor<L>>,
    inputs: usize,
    states: usize,
    /// places in the belief of what is drawn anew in every row, with its numbers
    drawn: Vec<(usize, f64)>,
    belief: Vec<Bundle<L>>,
    /// at the row before its readings count: x̂, and the variances of noises that are shares
    at: Vec<Bundle<L>>,
    seen: Tangents,
}

/// From one row to the next.
#[derive(Clone, Debug)]
enum Predict<const L: usize> {
    /// x̂ and S, step by step
    Sample(Code<L>),
    /// by points
    Points(Box<Points<L>>),
}

impl<const L: usize> Predict<L> {
    fn place(&mut self, parameters: &[f64]) {
        match self {
            Self::Sample(code) => code.place(parameters),
            Self::Points(points) => points.place(parameters),
        }
    }

    fn run(&mut self, interval: &Interval<'_>, belief: &mut [Bundle<L>]) {
        match self {
            Self::Sample(code) => interval.run(code, belief),
            Self::Points(points) => points.run(interval, belief),
        }
    }
}

/// For intervals on which the plant has no value where the estimate is.
#[derive(Clone, Debug)]
struct Spare<const L: usize> {
    /// as the other, of the plant that sees the states within their ranges
    predict: Predict<L>,
    ranges: Vec<Limits>,
    /// x̂ and S at the row
    before: Vec<Bundle<L>>,
}

/// A sensor's code.
#[derive(Clone, Debug)]
struct Sensor<const L: usize> {
    /// of t, y, u, what was known at the row, x̂, S and θ: x̂ and S after it, ν and σ²
    correct: Code<L>,
    limited: Option<Limited<L>>,
}

/// That of a reading at an end of the range.
#[derive(Clone, Debug)]
struct Limited<const L: usize> {
    limits: Limits,
    /// of the same: ν and σ² alone, and the variance of the noise
    view: Code<L>,
    /// of the same, and ν and R as they count: x̂ and S after it
    weigh: Code<L>,
}

impl<const L: usize> Passes<L> {
    fn new(
        sample: &Sample<'_, '_>,
        points: Option<&Unscented<'_, '_>>,
        compile: fn(&Tape) -> Option<Function<L>>,
    ) -> Result<Self> {
        let plant = sample.plant();
        let (states, parameters) = (plant.states.len(), plant.parameters.len());
        let sensors = plant.sensors.iter().enumerate().map(|(i, sensor)| {
            Ok(Sensor {
                correct: sample.correct(i, compile)?,
                limited: (sensor.limits)
                    .map(|limits| -> Result<_> {
                        Ok(Limited {
                            limits,
                            view: sample.view(i, compile)?,
                            weigh: sample.weigh(i, compile)?,
                        })
                    })
                    .transpose()?,
            })
        });
        let belief = vec![vec![[0.0; L]; 2 * sample.numbers()]; passes(parameters, L)];
        let has_ends = |range: &Limits| range.low.is_finite() || range.high.is_finite();
        let spare = match plant.ranges.iter().any(has_ends) {
            false => None,
            true => Some(Spare {
                predict: match points {
                    None => Predict::Sample(sample.confined(compile)?),
                    Some(points) => {
                        let n = points.plant.states.len();
                        let limited = plant.limited();
                        Predict::Points(Box::new(points.predict(&limited[..n], compile)?))
                    }
                },
                ranges: plant.ranges.clone(),
                before: belief.clone(),
            }),
        };
        Ok(Self {
            parameters,
            begin: sample.begin(compile)?,
            predict: match points {
                None => Predict::Sample(sample.predict(compile)?),
                Some(points) => {
                    let own = points.predict(&points.plant.derivatives, compile)?;
                    Predict::Points(Box::new(own))
                }
            },
            show: points.map(|points| points.show(compile)).transpose()?,
            levels: sample.levels(compile)?,
            implicit: sample.implicit(compile)?.map(Predict::Sample),
            is_implicit: false,
            times: 1,
            drives: sample.drives(),
            spare,
            sensors: sensors.collect::<Result<_>>()?,
            inputs: plant.inputs.len(),
            states,
            drawn: sample.drawn(points.map_or(states, |points| points.plant.states.len())),
            at: vec![vec![[0.0; L]; 2 * sample.known_before()]; belief.len()],
            belief,
            seen: Tangents {
                dν: vec![0.0; parameters],
                dσ2: vec![0.0; parameters],
                ..Tangents::default()
            },
        })
    }

    fn implicit(&mut self, is_implicit: bool) -> bool {
        self.is_implicit = is_implicit && self.implicit.is_some();
        self.implicit.is_some()
    }

    fn score<'a>(
        &mut self,
        parameters: &[f64],
        rows: impl IntoIterator<Item = Row<'a>>,
        step: Step,
        mut see: impl FnMut(Seen),
    ) -> Result<Score> {
        let count = self.parameters;
        check("number of parameters", count, parameters.len())?;
        self.place(parameters);
        let mut score = Score::none(count);
        for (pass, belief) in self.belief.iter_mut().enumerate() {
            belief.copy_from_slice(self.begin.run(pass, [], &[]));
        }
        let mut before: Option<f64> = None;
        let mut inputs: Vec<f64> = vec![];
        let mut jumps = true;
        for (place, row) in rows.into_iter().enumerate() {
            check("number of readings", self.sensors.len(), row.readings.len())?;
            check("number of inputs", self.inputs, row.inputs.len())?;
            if !row.t.is_finite() {
                let (signal, value) = ("t".to_owned(), row.t);
                return Err(Error::NoNumber { signal, value });
            }
            if let Some(from) = before.filter(|from| *from != row.t) {
                score.confined += usize::from(self.advance((from, row.t), step, &inputs, jumps)?);
                jumps = false;
            }
            let moved = inputs.iter().zip(row.inputs).zip(&self.drives);
            jumps |= moved
                .into_iter()
                .any(|((old, new), drives)| *drives && old != new);
            before = Some(row.t);
            inputs.clear();
            inputs.extend_from_slice(row.inputs);
            self.take(&row, &mut score, &mut |seen| {
                see(Seen { row: place, ..seen });
            });
            if !score.value.is_finite() {
                return Ok(score);
            }
        }
        Ok(score)
    }

    fn place(&mut self, parameters: &[f64]) {
        self.begin.place(parameters);
        self.predict.place(parameters);
        for code in self.show.iter_mut().chain(&mut self.levels) {
            code.place(parameters);
        }
        if let Some(implicit) = &mut self.implicit {
            implicit.place(parameters);
        }
        if let Some(spare) = &mut self.spare {
            spare.predict.place(parameters);
        }
        for sensor in &mut self.sensors {
            sensor.correct.place(parameters);
            if let Some(limited) = &mut sensor.limited {
                limited.view.place(parameters);
                limited.weigh.place(parameters);
            }
        }
    }

    /// From one row to the next, where what drives the plant may have jumped; whether the estimate had to be put where
    /// the plant has a value.
    fn advance(
        &mut self,
        (from, to): (f64, f64),
        step: Step,
        inputs: &[f64],
        jumps: bool,
    ) -> Result<bool> {
        if to < from {
            let (reached, time) = (from, to);
            return Err(Error::TimeBefore { reached, time });
        }
        let is_graded = jumps && self.is_implicit;
        let length = step.length(to - from).unwrap_or(to - from);
        let steps = match is_graded {
            // those that grow reach any distance
            true => GRADED * ((to - from) / length).clamp(1.0, MOST_GRADED).ceil() as usize,
            false => fixed_steps(from, to, length)?,
        };
        let interval = Interval {
            from,
            to,
            steps: steps.saturating_mul(self.times),
            is_graded,
            inputs,
        };
        let predict = match &mut self.implicit {
            Some(implicit) if self.is_implicit => implicit,
            _ => &mut self.predict,
        };
        let Some(spare) = &mut self.spare else {
            predict.run(&interval, &mut self.belief);
            return Ok(false);
        };
        for (before, belief) in spare.before.iter_mut().zip(&self.belief) {
            before.copy_from_slice(belief);
        }
        predict.run(&interval, &mut self.belief);
        let is_value = |x: &[f64; L]| x[0].is_finite();
        if self.belief[0].iter().all(is_value) {
            return Ok(false);
        }
        for (before, belief) in spare.before.iter().zip(&mut self.belief) {
            belief.copy_from_slice(before);
            let half = belief.len() / 2;
            for (i, range) in spare.ranges.iter().enumerate() {
                let x = belief[i][0];
                let inside = x.max(range.low).min(range.high);
                if inside != x {
                    belief[i] = [inside; L];
                    belief[half + i] = [0.0; L];
                }
            }
        }
        spare.predict.run(&interval, &mut self.belief);
        Ok(true)
    }

    /// The readings of a row, one after the other; h and its slopes are those at the estimate before them.
    fn take(&mut self, row: &Row<'_>, score: &mut Score, see: &mut impl FnMut(Seen)) {
        for belief in &mut self.belief {
            let half = belief.len() / 2;
            for &(place, number) in &self.drawn {
                (belief[place], belief[half + place]) = ([number; L], [0.0; L]);
            }
        }
        if let Some(show) = &mut self.show {
            for (pass, belief) in self.belief.iter_mut().enumerate() {
                let found = show.run(pass, [&[row.t], row.inputs], &[belief]);
                belief.copy_from_slice(found);
            }
        }
        let n = self.states;
        for (pass, (at, belief)) in self.at.iter_mut().zip(&self.belief).enumerate() {
            let count = at.len() / 2;
            let (values, tangents) = at.split_at_mut(count);
            let half = belief.len() / 2;
            values[..n].copy_from_slice(&belief[..n]);
            tangents[..n].copy_from_slice(&belief[half..half + n]);
            if let Some(levels) = &mut self.levels {
                let found = levels.run(pass, [&[row.t], row.inputs], &[belief]);
                let (own, along) = found.split_at(found.len() / 2);
                values[n..].copy_from_slice(own);
                tangents[n..].copy_from_slice(along);
            }
        }
        for sensor in 0..self.sensors.len() {
            let reading = row.readings[sensor];
            if !reading.is_finite() {
                continue;
            }
            let limits = self.sensors[sensor].limited.as_ref().map(|l| l.limits);
            let end = limits.and_then(|limits| Some((limits, End::of(limits, reading)?)));
            match end {
                Some((limits, end)) => self.take_end(sensor, row, (end, end.value(limits)), score),
                None => self.take_reading(sensor, row, reading, score),
            }
            see(Seen {
                row: 0,
                sensor,
                innovation: self.seen.ν,
                variance: self.seen.σ2,
                is_at_end: end.is_some(),
            });
        }
    }

    fn take_reading(&mut self, sensor: usize, row: &Row<'_>, reading: f64, score: &mut Score) {
        let code = &mut self.sensors[sensor].correct;
        for (pass, belief) in self.belief.iter_mut().enumerate() {
            let known: [&[f64]; 2] = [&[row.t, reading], row.inputs];
            let found = code.run(pass, known, &[&self.at[pass], belief]);
            let (m, half) = (belief.len() / 2, found.len() / 2);
            self.seen
                .take(pass, [&found[m], &found[m + 1]], |k| found[half + m + k]);
            if self.seen.is_certain() {
                continue;
            }
            belief[..m].copy_from_slice(&found[..m]);
            belief[m..].copy_from_slice(&found[half..half + m]);
        }
        score.count(&self.seen);
    }

    /// A reading at an end of the range: see [`super::censored`].
    fn take_end(
        &mut self,
        sensor: usize,
        row: &Row<'_>,
        (end, value): (End, f64),
        score: &mut Score,
    ) {
        let Some(limited) = &mut self.sensors[sensor].limited else {
            return;
        };
        let known: [&[f64]; 2] = [&[row.t, value], row.inputs];
        for (pass, belief) in self.belief.iter_mut().enumerate() {
            let parts: [&[[f64; L]]; 2] = [&self.at[pass], belief];
            let found = limited.view.run(pass, known, &parts);
            self.seen
                .take(pass, [&found[0], &found[1]], |k| found[3 + k]);
            let weighed = weighed(end, found).filter(|_| !self.seen.is_certain());
            let Some(weighed) = weighed else {
                continue;
            };
            let parts: [&[[f64; L]]; 3] = [&self.at[pass], belief, &weighed];
            let found = limited.weigh.run(pass, known, &parts);
            belief.copy_from_slice(found);
        }
        score.count_end(end, &self.seen);
    }
}

/// ν and R with which a reading at an end corrects, with their tangents; none where it says nothing. `found`
/// are ν, σ² and R of the end as a reading.
fn weighed<const L: usize>(end: End, found: &[[f64; L]]) -> Option<[[f64; L]; 4]> {
    let [ν, σ2, r] = [found[0][0], found[1][0], found[2][0]];
    let sign = end.sign();
    let σ = σ2.sqrt();
    let tail = Tail::beyond(sign * ν / σ);
    let (value, noise) = end.weighed(ν, σ2 - r, r)?;
    let told = tail.told();
    let mut all = [[value; L], [noise; L], [0.0; L], [0.0; L]];
    for lane in 0..L {
        let [dν, dσ2, dr] = [3, 4, 5].map(|k: usize| found[k][lane]);
        let dσ = 0.5 * dσ2 / σ;
        let da = sign * (dν - ν / σ * dσ) / σ;
        // λ' = δ, (λ − a)' = δ − 1
        let dexcess = (told - 1.0) * da;
        let dtold = (told * tail.excess + tail.mean * (told - 1.0)) * da;
        all[2][lane] = sign * (dσ - σ / tail.excess * dexcess) / tail.excess;
        all[3][lane] = dr + dσ2 * (1.0 / told - 1.0) - σ2 * dtold / (told * told);
    }
    Some(all)
}
