//! Runs of a study's own filter or observer that try to leave the tube of its error: starts, errors of readings and disturbances at the ends that
//! the slopes of one error, or of one deviation, ask for.

use lynkeus::expr::{Evaluator, Interval, Node, Tape};
use lynkeus::model::Variable;
use lynkeus::run::Estimator;
use lynkeus::structure::AugmentedPlant;
use lynkeus::{ErrorTube, Followed, Study};

use super::case::{Case, Wave};
use super::facts;
use super::integrate::{Flow, Limits, follow};
use crate::numbers::Numbers;

/// What filter and plant may be off for reasons of their own: of an error beside the sizes of the states, of a deviation
/// as its share.
const SLACK: f64 = 1e-8;
const SHARE: f64 = 1e-6;
/// Of the plant's integration, and its steps between two looks.
const TOLERANCE: f64 = 1e-11;
const STEPS: usize = 20_000;
/// A choice is moved by this to see what follows from it; all are between −1 and 1.
const NUDGE: f64 = 1e-3;

/// What was seen of runs.
#[derive(Clone, Debug, Default)]
pub struct Worst {
    /// the largest distance from the middle of a range, in halves of its width
    pub ratio: f64,
    pub what: String,
    /// whether a run came to where the tube ends
    pub is_whole: bool,
}

/// Errors, then deviations, at every look; fewer where a run ends early.
type Seen = Vec<Vec<f64>>;

pub struct Attack<'a> {
    tube: &'a ErrorTube,
    followed: &'a Followed,
    /// at its start
    estimator: Estimator,
    /// (time, x, inputs) → x', outputs without disturbances' names lost
    plant: Evaluator,
    /// how many of the inputs' numbers the plant's evaluator takes, and where each comes from
    inputs: Vec<Source>,
    /// states of the plant
    states: usize,
    /// per unknown input, which of the varying ones is its rate of change
    rates: Vec<Option<usize>>,
    /// per signal of the filter
    signals: Vec<Signal>,
    /// of the filter's estimates, one per state of the tube
    places: Vec<usize>,
    /// half the range of the reading's error, per output
    errors: Vec<f64>,
    scale: Vec<f64>,
    /// all of them, and those that are followed
    samples: Vec<f64>,
    times: Vec<f64>,
}

/// Where the plant finds an input.
enum Source {
    Known(Wave),
    /// among the unknown inputs
    Unknown(usize),
    /// among what varies as it likes
    Varying(usize),
}

/// What the filter is given.
enum Signal {
    Reading(usize),
    Known(Wave),
}

impl<'a> Attack<'a> {
    /// On the tube with errors of readings, or on that with exact ones; what is missing where it cannot be followed.
    pub fn new(
        case: &Case,
        study: &Study,
        augmented: &AugmentedPlant<'_>,
        tube: &'a ErrorTube,
        is_exact: bool,
    ) -> Result<Self, String> {
        let plant = augmented.plant;
        let course = case.course.as_ref().ok_or("no course")?;
        let followed = if is_exact { &tube.exact } else { &tube.noisy };
        let followed = followed.as_ref().ok_or("nothing was followed")?;
        let estimator = lynkeus::estimator(study).map_err(|e| e.to_string())?;
        let place = |names: &[String], name: &str| {
            let found = names.iter().position(|n| n == name);
            found.ok_or_else(|| format!("{name} is nowhere"))
        };
        let names: Vec<String> = tube.start.iter().map(|(name, _)| name.clone()).collect();
        let varying: Vec<String> = tube.inputs.iter().map(|(name, _)| name.clone()).collect();
        let wave = |name: &str| course.known.iter().find(|(own, _)| own == name);
        let states = plant.states.len();
        let source = |input: &Variable| match wave(&input.name) {
            Some((_, wave)) => Ok(Source::Known(wave.clone())),
            None => match place(&names[states..], &input.name) {
                Ok(unknown) => Ok(Source::Unknown(unknown)),
                Err(_) => place(&varying, &input.name).map(Source::Varying),
            },
        };
        let outputs: Vec<String> = tube.readings.iter().map(|r| r.output.clone()).collect();
        let shown = |name: &String| {
            let own = plant.outputs.iter().find(|o| o.name == *name);
            own.map(|o| o.node)
                .ok_or_else(|| format!("{name} is nowhere"))
        };
        let shown = outputs
            .iter()
            .map(shown)
            .collect::<Result<Vec<Node>, _>>()?;
        let nodes = |of: &[Variable]| -> Vec<Node> { of.iter().map(|v| v.node).collect() };
        let symbols = [vec![plant.time], nodes(&plant.states), nodes(&plant.inputs)].concat();
        let right = [&plant.derivatives[..], &shown].concat();
        let tape = Tape::new(&plant.graph, &symbols, &right).map_err(|e| format!("{e:?}"))?;
        let signal = |(i, name): (usize, &String)| match i < estimator.sensors() {
            true => place(&outputs, name).map(Signal::Reading),
            false => match wave(name) {
                Some((_, wave)) => Ok(Signal::Known(wave.clone())),
                None => Err(format!("{name} is nowhere")),
            },
        };
        let signals = estimator.signals().iter().enumerate().map(signal);
        let signals = signals.collect::<Result<_, _>>()?;
        let places = names.iter().map(|name| place(estimator.names(), name));
        let places = places.collect::<Result<_, _>>()?;
        let rate = |name: &String| place(&varying, &format!("der({name})")).ok();
        let error = |name: &String| {
            let place = outputs.iter().position(|own| own == name);
            let noise = place.and_then(|_| name.strip_prefix('y')?.parse::<usize>().ok());
            let noise = noise.and_then(|i| case.noise.get(i - 1));
            noise.map_or(0.0, |noise| if is_exact { 0.0 } else { noise.bound() })
        };
        let width = |v: &Variable| {
            let [low, high] = facts::finite(v.min, v.max);
            high - low
        };
        let every = course.every;
        let count = ((tube.until - tube.from) / every + 1e-9).floor();
        let samples: Vec<f64> = (0..=count as usize)
            .map(|k| (tube.from + k as f64 * every).min(tube.until))
            .collect();
        let is_whole = followed.reached >= tube.until;
        let counts = |t: &f64| *t < followed.reached || (is_whole && *t <= tube.until);
        Ok(Self {
            tube,
            followed,
            plant: tape.evaluator(),
            inputs: plant.inputs.iter().map(source).collect::<Result<_, _>>()?,
            states,
            rates: names[states..].iter().map(rate).collect(),
            signals,
            places,
            errors: outputs.iter().map(error).collect(),
            scale: augmented.states.iter().map(width).collect(),
            times: samples.iter().copied().filter(counts).collect(),
            samples,
            estimator,
        })
    }

    /// The worst of the runs that slopes lead to, and of random ones.
    pub fn search(&mut self, numbers: &mut Numbers, targets: usize) -> Worst {
        let mut worst = Worst::default();
        let mut best = vec![0.0; self.choices()];
        let ends = |numbers: &mut Numbers, count: usize| -> Vec<f64> {
            let sign = |_| if numbers.chance(0.5) { 1.0 } else { -1.0 };
            (0..count).map(sign).collect()
        };
        for _ in 0..4 {
            let plan = ends(numbers, self.choices());
            self.look(&plan, &mut worst, &mut best);
        }
        for target in 0..targets {
            let from = match numbers.below(3) {
                0 => best.clone(),
                1 => vec![0.0; self.choices()],
                _ => ends(numbers, self.choices())
                    .iter()
                    .map(|x| 0.5 * x)
                    .collect(),
            };
            let quantity = numbers.below(self.quantities());
            // at the end, or at any time
            let at = match target % 2 {
                0 => 1.0,
                _ => numbers.unit(),
            };
            let sign = if numbers.chance(0.5) { 1.0 } else { -1.0 };
            let mut plan = from;
            for _ in 0..2 {
                match self.steepest(&plan, quantity, at, sign) {
                    Some(next) if next != plan => plan = next,
                    _ => break,
                }
                self.look(&plan, &mut worst, &mut best);
            }
            if worst.ratio > 1.0 {
                return worst;
            }
        }
        for _ in 0..4 * targets {
            let mut plan = best.clone();
            let one = numbers.below(plan.len().max(1));
            if let Some(choice) = plan.get_mut(one) {
                *choice = if numbers.chance(0.5) {
                    -*choice
                } else {
                    numbers.between(-1.0, 1.0)
                };
            }
            self.look(&plan, &mut worst, &mut best);
        }
        worst
    }

    fn look(&mut self, plan: &[f64], worst: &mut Worst, best: &mut Vec<f64>) {
        let mut own = Worst::default();
        self.run(plan, Some(&mut own));
        let is_whole = worst.is_whole | own.is_whole;
        if own.ratio > worst.ratio {
            *worst = own;
            best.clear();
            best.extend_from_slice(plan);
            if worst.ratio > 1.0 {
                worst.what = format!("{} (ratio {})\n{plan:?}", worst.what, worst.ratio);
            }
        }
        worst.is_whole = is_whole;
    }

    /// Places in the start set; then per sample those of the errors of readings, of what varies as it is read,
    /// and as it is until the next one.
    fn choices(&self) -> usize {
        self.tube.start.len() + self.times.len() * self.per_sample()
    }

    /// Errors, and a filter's deviations.
    fn quantities(&self) -> usize {
        match self.tube.is_filter {
            true => 2 * self.places.len(),
            false => self.places.len(),
        }
    }

    fn per_sample(&self) -> usize {
        self.errors.len() + 2 * self.tube.inputs.len()
    }

    /// The ends at which a quantity grows fastest, by differences.
    fn steepest(&mut self, plan: &[f64], quantity: usize, at: f64, sign: f64) -> Option<Vec<f64>> {
        let own = self.run(plan, None);
        let look = ((own.len().checked_sub(1)?) as f64 * at).round() as usize;
        let slope = |i: usize, this: &mut Self| {
            let step = if plan[i] > 0.0 { -NUDGE } else { NUDGE };
            let mut moved = plan.to_vec();
            moved[i] += step;
            let there = this.run(&moved, None);
            let there = there.get(look).map_or(f64::NAN, |z| z[quantity]);
            (there - own[look][quantity]) / step
        };
        let end = |i: usize, this: &mut Self| match slope(i, this) {
            0.0 => plan[i],
            slope if slope.is_nan() => plan[i],
            slope => sign * slope.signum(),
        };
        Some((0..plan.len()).map(|i| end(i, self)).collect())
    }

    /// Follows a plan to where the tube ends.
    fn run(&mut self, plan: &[f64], mut worst: Option<&mut Worst>) -> Seen {
        let within = |share: f64, range: &Interval| {
            (range.midpoint() + 0.5 * share * range.width()).clamp(range.lo(), range.hi())
        };
        let (start, rest) = plan.split_at(self.tube.start.len());
        let start = start.iter().zip(&self.tube.start);
        let mut x: Vec<f64> = start.map(|(s, (_, range))| within(*s, range)).collect();
        let mut estimator = self.estimator.clone();
        let (errors, varying) = (self.errors.len(), self.tube.inputs.len());
        let mut seen = vec![];
        let every = self.times.get(1).map_or(0.0, |t| t - self.times[0]);
        for k in 0..self.times.len() {
            let t = self.times[k];
            let choices = &rest[k * self.per_sample()..(k + 1) * self.per_sample()];
            let ranges = self.tube.inputs.iter().cycle();
            let moved = choices[errors..].iter().zip(ranges);
            let moved: Vec<f64> = moved.map(|(s, (_, range))| within(*s, range)).collect();
            let signals = self.read(t, &x, &moved[..varying], &choices[..errors]);
            if estimator.push(t, &signals).is_err() {
                return seen;
            }
            self.judge(t, &x, &estimator, &mut worst, &mut seen);
            let next = self.times.get(k + 1).copied();
            let half = next.map(|_| t + 0.5 * every);
            let last = next.unwrap_or(self.followed.reached);
            for until in half.into_iter().chain([last]) {
                let from = estimator.time().unwrap_or(t);
                if until <= from {
                    continue;
                }
                let Some(reached) = self.flow(&x, [from, until], &moved[varying..]) else {
                    return seen;
                };
                x = reached;
                if estimator.predict(until).is_err() {
                    return seen;
                }
                self.judge(until, &x, &estimator, &mut worst, &mut seen);
            }
        }
        if let Some(worst) = worst {
            worst.is_whole = true;
            // whether it ends before a sample or after it is not said
            let until = self.followed.reached;
            if until >= self.tube.until || !self.samples.contains(&until) {
                self.end(&x, &estimator, worst);
            }
        }
        seen
    }

    /// What the filter is given of the plant there.
    fn read(&mut self, t: f64, x: &[f64], varying: &[f64], errors: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.states + self.errors.len()];
        evaluate(
            &mut self.plant,
            &self.inputs,
            (t, x, varying),
            self.states,
            &mut out,
        );
        let shown = out[self.states..].iter().zip(errors).zip(&self.errors);
        let shown: Vec<f64> = shown.map(|((y, share), size)| y + share * size).collect();
        let value = |signal: &Signal| match signal {
            Signal::Reading(i) => shown[*i],
            Signal::Known(wave) => wave.value(t),
        };
        self.signals.iter().map(value).collect()
    }

    fn flow(&mut self, x: &[f64], span: [f64; 2], varying: &[f64]) -> Option<Vec<f64>> {
        let small: Vec<f64> = self.scale.iter().map(|width| 1e-2 * width).collect();
        let mut out = vec![0.0; self.states + self.errors.len()];
        let mut way = Way {
            plant: &mut self.plant,
            inputs: &self.inputs,
            rates: &self.rates,
            states: self.states,
            varying,
            out: &mut out,
        };
        let limits = Limits {
            tolerance: TOLERANCE,
            scale: &small,
            budget: STEPS,
        };
        follow(&mut way, x, span, &limits)
    }

    fn judge(
        &self,
        t: f64,
        x: &[f64],
        estimator: &Estimator,
        worst: &mut Option<&mut Worst>,
        seen: &mut Seen,
    ) {
        let found = self.found(x, estimator);
        if let Some(worst) = worst {
            let rows = &self.followed.rows;
            let row = rows.get(rows.partition_point(|row| row.1 < t));
            match row.filter(|row| row.0 <= t && row.2.len() >= found.len()) {
                Some(row) => self.compare(t, x, &found, &row.2, worst, "there"),
                None => {
                    worst.ratio = f64::INFINITY;
                    worst.what = format!("no part of the tube has {t}");
                }
            }
            let all = [&self.followed.error[..], &self.followed.deviation].concat();
            self.compare(t, x, &found, &all, worst, "over all of the time");
        }
        seen.push(found);
    }

    fn end(&self, x: &[f64], estimator: &Estimator, worst: &mut Worst) {
        let ranges = [&self.followed.error_end[..], &self.followed.deviation_end].concat();
        let found = self.found(x, estimator);
        self.compare(
            self.followed.reached,
            x,
            &found,
            &ranges,
            worst,
            "at its end",
        );
    }

    /// Errors and deviations.
    fn found(&self, x: &[f64], estimator: &Estimator) -> Vec<f64> {
        let hat = estimator.estimate();
        let errors = self.places.iter().zip(x).map(|(&i, x)| hat[i] - x);
        if !self.tube.is_filter {
            return errors.collect();
        }
        let sd = estimator.deviations().unwrap_or(&[]);
        let sd = self
            .places
            .iter()
            .map(|&i| sd.get(i).copied().unwrap_or(f64::NAN));
        errors.chain(sd).collect()
    }

    fn compare(
        &self,
        t: f64,
        x: &[f64],
        found: &[f64],
        ranges: &[Interval],
        worst: &mut Worst,
        place: &str,
    ) {
        for (i, (found, range)) in found.iter().zip(ranges).enumerate() {
            let n = x.len();
            let slack = match i < n {
                true => SLACK * (x[i].abs() + self.scale[i]),
                false => SHARE * found.abs() + SLACK * self.scale[i - n],
            };
            let off = (found - range.midpoint()).abs() / (0.5 * range.width() + slack);
            // what is no number is outside
            let ratio = if off.is_nan() { f64::INFINITY } else { off };
            if ratio > worst.ratio {
                let (name, _) = &self.tube.start[i % n];
                let what = if i < n { "error" } else { "deviation" };
                worst.ratio = ratio;
                worst.what =
                    format!("{what} of {name} = {found:e} at {t}, the tube has {range} {place}");
            }
        }
    }
}

/// (x', outputs) of plant states and unknown inputs, with what varies at numbers.
fn evaluate(
    plant: &mut Evaluator,
    inputs: &[Source],
    (t, x, varying): (f64, &[f64], &[f64]),
    states: usize,
    out: &mut [f64],
) {
    let value = |source: &Source| match source {
        Source::Known(wave) => wave.value(t),
        Source::Unknown(i) => x[states + i],
        Source::Varying(i) => varying[*i],
    };
    let arguments = std::iter::once(t).chain(x[..states].iter().copied());
    let arguments: Vec<f64> = arguments.chain(inputs.iter().map(value)).collect();
    plant.eval(&arguments, out);
}

/// Plant and unknown inputs while what varies stays as it is.
struct Way<'a> {
    plant: &'a mut Evaluator,
    inputs: &'a [Source],
    rates: &'a [Option<usize>],
    states: usize,
    varying: &'a [f64],
    out: &'a mut [f64],
}

impl Flow for Way<'_> {
    fn slope(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        evaluate(
            self.plant,
            self.inputs,
            (t, x, self.varying),
            self.states,
            self.out,
        );
        out[..self.states].copy_from_slice(&self.out[..self.states]);
        for (out, rate) in out[self.states..].iter_mut().zip(self.rates) {
            *out = rate.map_or(0.0, |rate| self.varying[rate]);
        }
    }

    fn next_break(&self, _: f64) -> f64 {
        f64::INFINITY
    }

    fn seen(&mut self, _: f64, _: &[f64]) -> bool {
        true
    }
}
