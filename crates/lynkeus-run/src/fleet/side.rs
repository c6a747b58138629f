//! Filters in lanes.

use std::array;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use lynkeus_native::Buffer;

use super::apart::Apart;
use super::code::{Correction, Many, OF_READING, OF_SENSOR, Steps, triangle};
use crate::divergence::Bound;
use crate::filter::censored::FAR;
use crate::filter::sensing::SURPRISE;
use crate::filter::{Beside, Filter, FilterSettings, Innovation, NoisyModel, Reading, Row, Sensor};
use crate::integrator::{check_interval, fixed_steps, instant};
use crate::lanes::Engine;
use crate::noise::Limits;
use crate::runner::{Runner, Sample, check_time, no_number};
use crate::{Blueprint, Error, EstimatorSettings, Level, Method, Result, Step, Updates};

/// What a fleet asks of filters in lanes, of whatever number of lanes.
pub(super) trait Side: Debug + Send + Sync {
    fn push(&mut self, rows: &[Option<Row<'_>>]) -> Vec<(usize, Error)>;

    fn is_exact(&self) -> bool;

    fn assets(&self) -> &[Asset];

    fn places(&self) -> &Places;

    fn names(&self) -> &[String];

    /// Numbers at their [`Places`], of each the values of all lanes, and how many lanes there are.
    fn values(&self) -> (&[f64], usize);

    fn copied(&self) -> Box<dyn Side>;
}

impl Clone for Box<dyn Side> {
    fn clone(&self) -> Self {
        (**self).copied()
    }
}

impl dyn Side {
    /// How many of the filters did something alone.
    #[cfg(test)]
    pub fn alone(&self) -> usize {
        let alone = self.assets().iter().filter(|asset| asset.alone.is_some());
        alone.count()
    }

    /// Some numbers of a lane.
    pub fn numbers(&self, lane: usize, places: Range<usize>) -> impl Iterator<Item = f64> + '_ {
        let (values, lanes) = self.values();
        places.map(move |place| values[place * lanes + lane])
    }

    pub fn innovation(&self, lane: usize, sensor: usize, reading: Reading) -> Innovation {
        let (values, lanes) = self.values();
        let first = self.places().readings.start + OF_READING * sensor;
        let [predicted, value, deviation] = [0, 1, 2].map(|k| values[(first + k) * lanes + lane]);
        Innovation {
            value: if reading == Reading::Missing {
                0.0
            } else {
                value
            },
            deviation,
            settled: deviation,
            predicted,
            reading,
        }
    }
}

/// Where numbers stand in the two buffers. Before a sample: a belief, what the last correction wrote
/// beside it, then what a step reads. After a step: a belief, whether it is sound, then what else a correction
/// reads.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// x̂
    pub x: Range<usize>,
    /// x̂ and S
    belief: Range<usize>,
    pub readings: Range<usize>,
    pub deviations: Range<usize>,
    /// whether a correction is sound
    sound: usize,
    /// t, h, the unit of the noise and its densities
    step: usize,
    densities: Range<usize>,
    inputs: Range<usize>,
    /// what no estimate exceeds, t, u and the sensors of a correction; before them stands whether the step is sound
    most: usize,
    row: usize,
    row_inputs: Range<usize>,
    sensors: usize,
    row_end: usize,
}

impl Places {
    fn new((n, m, p): (usize, usize, usize), densities: usize) -> Self {
        let after = |before: &Range<usize>, count: usize| before.end..before.end + count;
        let belief = 0..n + triangle(n);
        let readings = after(&belief, OF_READING * p);
        let deviations = after(&readings, n);
        let sound = deviations.end;
        let step = sound + 1;
        let densities = step + 3..step + 3 + densities;
        let inputs = after(&densities, m);
        let most = belief.end + 1;
        let row = most + 1;
        let row_inputs = row + 1..row + 1 + m;
        Self {
            x: 0..n,
            row,
            sensors: row_inputs.end,
            row_end: row_inputs.end + OF_SENSOR * p,
            belief,
            readings,
            deviations,
            sound,
            step,
            densities,
            inputs,
            most,
            row_inputs,
        }
    }

    /// What a correction writes.
    fn found(&self) -> Range<usize> {
        0..self.step
    }
}

/// One of the filters, beside its lane.
#[derive(Clone, Debug)]
pub(super) struct Asset {
    model: Arc<NoisyModel>,
    pub time: Option<f64>,
    pub readings: Vec<Reading>,
    /// of known inputs that were missing the values before
    pub beside: Beside,
    /// does what is out of the ordinary
    alone: Option<Box<Filter>>,
}

impl Asset {
    fn new(model: &NoisyModel) -> Self {
        Self {
            time: None,
            readings: vec![Reading::Missing; model.sensors.len()],
            beside: Beside::new(model),
            model: Arc::new(model.clone()),
            alone: None,
        }
    }
}

/// What a filter does in a push.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Rests,
    /// a row at the time where it is
    Stays,
    /// so many steps to its row
    Goes(usize),
    /// by its own filter
    Alone,
}

fn goes(way: &Way) -> bool {
    matches!(way, Way::Goes(_))
}

/// Copies the numbers of a lane.
fn copy<const L: usize>(from: &[[f64; L]], to: &mut [[f64; L]], lane: usize) {
    for (from, to) in from.iter().zip(to) {
        to[lane] = from[lane];
    }
}

/// Known inputs of which the last value holds.
fn missing(row: &Row<'_>) -> usize {
    row.inputs.iter().filter(|u| !u.is_finite()).count()
}

/// From one sample to the next.
#[derive(Clone, Copy, Debug)]
struct Interval {
    from: f64,
    to: f64,
    /// none where it cannot be divided
    steps: Option<usize>,
    /// length of the first step
    h: f64,
}

impl Interval {
    fn new(step: Step, from: f64, to: f64) -> Self {
        let count = || {
            let length = step.length(to - from)?;
            check_interval(from, to).ok()?;
            fixed_steps(from, to, length).ok()
        };
        let steps = count();
        let h = steps.map_or(0.0, |steps| instant(from, to, steps, 1) - from);
        Self { from, to, steps, h }
    }
}

/// Filters in the lanes of a register.
#[derive(Clone, Debug)]
pub(super) struct Lanes<const L: usize> {
    steps: Arc<Steps<L>>,
    one: Engine<L>,
    many: Option<Many<L>>,
    correct: Engine<L>,
    is_exact: bool,
    /// whether readings are looked at closely
    is_choosy: bool,
    settings: FilterSettings,
    run: EstimatorSettings,
    step: Step,
    /// the last one that was asked for
    interval: Interval,
    places: Places,
    /// before and after a sample in turn
    held: [Buffer<L>; 2],
    now: usize,
    /// between them
    row: Buffer<L>,
    room: [Vec<[f64; L]>; 4],
    assets: Vec<Asset>,
}

fn parts(filter: &Blueprint) -> Result<(&NoisyModel, &FilterSettings), Apart> {
    match &filter.updates {
        Updates::Filter { model, settings } => Ok((model, settings)),
        Updates::Jumps { .. } => Err(Apart::Kind),
    }
}

fn noisy(model: &NoisyModel) -> Vec<bool> {
    model.process_noise.iter().map(|q| *q > 0.0).collect()
}

/// Whether its readings are looked at closely.
fn is_choosy(sensor: &Sensor) -> bool {
    sensor.limits.is_some() || is_share(sensor.noise)
}

fn is_share(level: Level) -> bool {
    matches!(level, Level::Relative(_))
}

/// Whether two models differ in nothing but numbers.
fn are_alike(a: &NoisyModel, b: &NoisyModel) -> bool {
    let mut sensors = a.sensors.iter().zip(&b.sensors);
    a.flow.system().has_code_of(b.flow.system())
        && a.output_map.system().has_code_of(b.output_map.system())
        && noisy(a) == noisy(b)
        && a.sensors.len() == b.sensors.len()
        && sensors.all(|(a, b)| is_share(a.noise) == is_share(b.noise))
}

impl<const L: usize> Lanes<L> {
    pub fn new(filters: &[Blueprint]) -> Result<Self, Apart> {
        let first = &filters[0];
        let (model, settings) = parts(first)?;
        let Method::Rk4(step) = first.run.method else {
            return Err(Apart::Step);
        };
        for filter in filters {
            let (other, kept) = parts(filter)?;
            if kept != settings || filter.run != first.run || !are_alike(model, other) {
                return Err(Apart::Different);
            }
            let noiseless = other.sensors.iter().find(|s| s.noise.size() == 0.0);
            if let Some(sensor) = noiseless {
                return Err(Apart::Noiseless(sensor.name.clone()));
            }
            let states = other.flow.system().states().len();
            let sound = settings.check(states, other.ranges.len());
            let sound = sound.and_then(|()| filter.run.method.check());
            sound.map_err(Apart::Fault)?;
        }
        let flow = model.flow.system();
        let (n, m, p) = (
            flow.states().len(),
            flow.signals().len(),
            model.sensors.len(),
        );
        let relative = model.sensors.iter().map(|s| is_share(s.noise)).collect();
        let correction = Correction::<L>::of(&model.output_map, n, relative).ok_or(Apart::Large)?;
        let acting = noisy(model).iter().filter(|acts| **acts).count();
        let places = Places::new((n, m, p), acting);
        let passed = places.step - places.belief.end;
        let steps = Steps::<L>::of(&model.flow, noisy(model), passed).ok_or(Apart::Large)?;
        let all = filters.iter().flat_map(parts);
        let mut sensors = all.flat_map(|(model, _)| &model.sensors);
        let mut made = Self {
            one: steps.one.clone(),
            many: None,
            correct: correction.code.clone(),
            is_exact: !correction.has_functions && !steps.has_functions,
            is_choosy: settings.gate.is_some() || sensors.any(is_choosy),
            settings: settings.clone(),
            run: first.run,
            step,
            interval: Interval::new(step, 0.0, 1.0),
            held: array::from_fn(|_| Buffer::new(places.inputs.end)),
            now: 0,
            row: Buffer::new(places.row_end),
            room: array::from_fn(|_| vec![]),
            places,
            steps,
            assets: vec![],
        };
        for lane in 0..L {
            // lanes without a filter compute what the first one does, and nobody looks
            let (model, _) = parts(filters.get(lane).unwrap_or(first))?;
            made.place(lane, model);
            if lane < filters.len() {
                made.assets.push(Asset::new(model));
            }
        }
        Ok(made)
    }

    /// A filter at its start.
    fn place(&mut self, lane: usize, model: &NoisyModel) {
        let scale = model.process_noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let places = &self.places;
        let root = model.initial_variance.iter().map(|v| v.sqrt());
        for buffer in &mut self.held {
            let values = buffer.values_mut();
            for (i, (x, s)) in model
                .flow
                .system()
                .start()
                .iter()
                .zip(root.clone())
                .enumerate()
            {
                values[i][lane] = *x;
                values[places.x.end + triangle(i) + i][lane] = s;
                values[places.deviations.start + i][lane] = s;
            }
            values[places.step + 1][lane] = 1.0;
            values[places.step + 2][lane] = scale;
            let densities = places.densities.clone();
            let acting = self.steps.acting(&model.process_noise);
            for (place, density) in densities.zip(acting) {
                values[place][lane] = density / scale;
            }
        }
        let row = self.row.values_mut();
        for (i, sensor) in model.sensors.iter().enumerate() {
            // the variance, or that of a value of 1
            row[places.sensors + OF_SENSOR * i + 2][lane] = sensor.noise.variance(1.0);
        }
    }

    /// Takes a row in; what the filter does then.
    fn enter(&mut self, lane: usize, row: &Row<'_>) -> Result<Way> {
        let asset = &self.assets[lane];
        let counts = [
            (
                "number of readings",
                asset.readings.len(),
                row.readings.len(),
            ),
            (
                "number of inputs",
                asset.beside.inputs.len(),
                row.inputs.len(),
            ),
        ];
        for (what, expected, found) in counts {
            if expected != found {
                return Err(Error::setting(what, expected.to_string(), found));
            }
        }
        check_time(asset.time, row.t)?;
        if asset.time.is_none()
            && let Some(i) = row.inputs.iter().position(|u| !u.is_finite())
        {
            let names = asset.model.flow.system().signals();
            return Err(no_number(&names[i], row.inputs[i]));
        }
        let places = &self.places;
        let values = self.row.values_mut();
        values[places.row][lane] = row.t;
        let inputs = row.inputs.iter().zip(&asset.beside.inputs);
        for (place, (new, old)) in places.row_inputs.clone().zip(inputs) {
            values[place][lane] = if new.is_finite() { *new } else { *old };
        }
        for (i, reading) in row.readings.iter().enumerate() {
            let place = places.sensors + OF_SENSOR * i;
            let is_there = reading.is_finite();
            values[place][lane] = if is_there { *reading } else { 0.0 };
            values[place + 1][lane] = f64::from(u8::from(is_there));
        }
        let Some(from) = asset.time.filter(|from| *from < row.t) else {
            return Ok(Way::Stays);
        };
        // filters of one plant are often sampled at the same times
        if (self.interval.from, self.interval.to) != (from, row.t) {
            self.interval = Interval::new(self.step, from, row.t);
        }
        let Interval { steps, h, .. } = self.interval;
        let Some(steps) = steps else {
            return Ok(Way::Alone);
        };
        let held = self.held[self.now].values_mut();
        held[places.step][lane] = from;
        held[places.step + 1][lane] = h;
        Ok(Way::Goes(steps))
    }

    /// Takes those that go to the times of their rows.
    fn go(&mut self, ways: &mut [Way; L]) {
        let steps = ways.iter().map(|way| match way {
            Way::Goes(steps) => *steps,
            _ => 0,
        });
        match steps.fold(0, usize::max) {
            0 => {}
            1 => {
                let (held, row) = (self.held[self.now].values(), self.row.values_mut());
                self.one.eval(held, &mut row[..self.places.most]);
            }
            _ => self.go_far(ways),
        }
        let places = &self.places;
        let (held, row) = (self.held[self.now].values(), self.row.values_mut());
        for (lane, _) in ways.iter().enumerate().filter(|(_, way)| !goes(way)) {
            copy(
                &held[..places.belief.end],
                &mut row[..places.belief.end],
                lane,
            );
            row[places.belief.end][lane] = 1.0;
        }
    }

    /// The same where one of them has several steps to go. A lane that has no finite numbers on the way goes alone.
    fn go_far(&mut self, ways: &mut [Way; L]) {
        let flow = &self.assets[0].model.flow;
        if self.many.is_none() {
            self.many = self.steps.many(flow).cloned();
        }
        let places = &self.places;
        let Some(many) = &mut self.many else {
            let far = ways.iter_mut().filter(|way| goes(way));
            far.for_each(|way| *way = Way::Alone);
            return;
        };
        let held = self.held[self.now].values();
        let [head, z, next, carried] = &mut self.room;
        let n = places.x.end;
        z.resize(many.numbers, [0.0; L]);
        next.resize(many.numbers, [0.0; L]);
        carried.resize(triangle(n) + 1, [0.0; L]);
        let steps = ways.map(|way| match way {
            Way::Goes(steps) => steps,
            _ => 0,
        });
        let ends: [f64; L] = self.row.values()[places.row];
        for i in 0..steps.iter().copied().fold(0, usize::max) {
            head.clear();
            let times = held[places.step];
            let ends_of = |i: usize| -> [f64; L] {
                array::from_fn(|lane| match steps[lane] {
                    0 => times[lane] + i as f64,
                    steps => instant(times[lane], ends[lane], steps, i),
                })
            };
            let (begin, end) = (if i == 0 { times } else { ends_of(i) }, ends_of(i + 1));
            head.push(begin);
            head.push(array::from_fn(|lane| end[lane] - begin[lane]));
            head.extend_from_slice(&held[places.densities.start..places.inputs.end]);
            match i {
                0 => head.extend_from_slice(&held[places.x.clone()]),
                _ => head.extend_from_slice(z),
            }
            let engine = if i == 0 {
                &mut many.first
            } else {
                &mut many.later
            };
            engine.eval(head, next);
            for lane in 0..L {
                if i < steps[lane] {
                    if next.iter().any(|row| !row[lane].is_finite()) {
                        ways[lane] = Way::Alone;
                    }
                    copy(next, z, lane);
                }
            }
        }
        head.clear();
        head.push(held[places.step + 2]);
        head.extend_from_slice(&held[n..places.belief.end]);
        head.extend_from_slice(z);
        many.carry.eval(head, carried);
        let row = self.row.values_mut();
        row[places.x.clone()].copy_from_slice(&z[..n]);
        row[n..places.most].copy_from_slice(carried);
    }

    /// Whether a lane is out of the ordinary after a correction.
    fn is_unusual(&self, lane: usize, way: Way) -> bool {
        let places = &self.places;
        let (row, found) = (self.row.values(), self.held[1 - self.now].values());
        let is_outside = |beliefs: &[[f64; L]]| {
            let ranges = &self.assets[lane].model.ranges;
            let mut states = beliefs[places.x.clone()].iter().zip(ranges);
            states.any(|(x, Limits { low, high })| !(low <= &x[lane] && &x[lane] <= high))
        };
        way == Way::Alone
            || found[places.sound][lane] != 1.0
            || self.is_choosy && self.is_odd(lane, found)
            || self.settings.projects && (is_outside(row) || is_outside(found))
    }

    /// Whether a reading is one that is looked at closely.
    fn is_odd(&self, lane: usize, found: &[[f64; L]]) -> bool {
        let sensors = self.assets[lane].model.sensors.iter().enumerate();
        let mut odd = sensors.map(|(i, sensor)| {
            let place = self.places.sensors + OF_SENSOR * i;
            let [reading, is_there] = [0, 1].map(|k| self.row.values()[place + k][lane]);
            let place = self.places.readings.start + OF_READING * i;
            let [predicted, innovation, deviation] = [0, 1, 2].map(|k| found[place + k][lane]);
            if is_there == 0.0 {
                return false;
            }
            let off = innovation.abs();
            let is_near_an_end = sensor.limits.is_some_and(|Limits { low, high }| {
                let is_inside = low < reading && reading < high;
                let room = (predicted - low).min(high - predicted) / deviation;
                !is_inside || room < FAR
            });
            let is_outlier = self
                .settings
                .gate
                .is_some_and(|gate| off > gate * deviation);
            let is_surprise = is_share(sensor.noise) && off > SURPRISE * deviation;
            is_near_an_end || is_outlier || is_surprise
        });
        odd.any(|odd| odd)
    }

    /// A filter takes its row alone, from where the lane was, and gives back what it comes to.
    fn alone(&mut self, lane: usize, row: &Row<'_>) -> Result<()> {
        let places = &self.places;
        let inputs: Vec<f64> = places
            .row_inputs
            .clone()
            .map(|place| self.row.values()[place][lane])
            .collect();
        let asset = &mut self.assets[lane];
        let held = self.held[self.now].values();
        let filter = match &mut asset.alone {
            Some(filter) => filter,
            None => {
                let filter = Filter::new(&asset.model, &self.settings, self.run)?;
                asset.alone.insert(Box::new(filter))
            }
        };
        let entries = held[places.belief.clone()].iter().map(|row| row[lane]);
        filter.resume(entries, &asset.beside);
        let sample = Sample {
            t: row.t,
            readings: row.readings,
            inputs: &inputs,
            held: missing(row),
        };
        match asset.time {
            None => filter.begin(&sample)?,
            Some(before) if row.t > before => filter.advance(before, &sample)?,
            Some(_) => {}
        }
        filter.update(&sample)?;
        filter.report(row.t)?;
        let found = self.held[1 - self.now].values_mut();
        let deviations = filter.deviations().unwrap_or_default();
        let deviations = deviations.iter().zip(places.deviations.clone());
        deviations.for_each(|(value, place)| found[place][lane] = *value);
        for (i, innovation) in filter.innovations().iter().enumerate() {
            let place = places.readings.start + OF_READING * i;
            found[place][lane] = innovation.predicted;
            found[place + 1][lane] = innovation.value;
            found[place + 2][lane] = innovation.deviation;
            asset.readings[i] = innovation.reading;
        }
        let (entries, beside) = filter.standing();
        for (value, place) in entries.zip(places.belief.clone()) {
            found[place][lane] = value;
        }
        asset.beside = beside;
        asset.time = Some(row.t);
        Ok(())
    }

    /// The lane is where it was.
    fn keep(&mut self, lane: usize) {
        let found = self.places.found();
        let [a, b] = &mut self.held;
        let (before, after) = if self.now == 0 { (a, b) } else { (b, a) };
        let before = &before.values()[found.clone()];
        copy(before, &mut after.values_mut()[found], lane);
    }

    /// What the lane came to counts.
    fn settle(&mut self, lane: usize, row: &Row<'_>) {
        let places = &self.places;
        let found = self.held[1 - self.now].values();
        let asset = &mut self.assets[lane];
        let beside = &mut asset.beside;
        beside.health.inputs_held += missing(row);
        for (i, reading) in row.readings.iter().enumerate() {
            let place = places.readings.start + OF_READING * i;
            let is_there = reading.is_finite();
            let innovation = Innovation {
                value: found[place + 1][lane],
                deviation: found[place + 2][lane],
                reading: if is_there {
                    Reading::Taken
                } else {
                    Reading::Missing
                },
                ..Innovation::default()
            };
            beside.health.sensors[i].count(&innovation);
            asset.readings[i] = innovation.reading;
            if is_there {
                beside.rejected[i] = (0, *reading);
            }
        }
        asset.time = Some(row.t);
        let inputs = beside.inputs.iter_mut().zip(places.row_inputs.clone());
        inputs.for_each(|(u, place)| *u = self.row.values()[place][lane]);
    }
}

impl<const L: usize> Side for Lanes<L> {
    fn push(&mut self, rows: &[Option<Row<'_>>]) -> Vec<(usize, Error)> {
        let mut failed = vec![];
        let mut ways = [Way::Rests; L];
        for (lane, row) in rows.iter().enumerate() {
            let Some(row) = row else { continue };
            match self.enter(lane, row) {
                Ok(way) => ways[lane] = way,
                Err(error) => failed.push((lane, error)),
            }
        }
        if ways.iter().all(|way| *way == Way::Rests) {
            return failed;
        }
        // what widens a bound does so before anything is judged
        let before: [Option<Bound>; L] = array::from_fn(|lane| {
            let asset = self.assets.get_mut(lane)?;
            let before = asset.beside.bound;
            if goes(&ways[lane]) {
                asset.beside.bound.see(&asset.beside.inputs);
            }
            self.row.values_mut()[self.places.most][lane] = asset.beside.bound.most();
            Some(before)
        });
        self.go(&mut ways);
        let found = self.places.found();
        let after = self.held[1 - self.now].values_mut();
        self.correct.eval(self.row.values(), &mut after[found]);
        for (lane, row) in rows.iter().enumerate() {
            let is_done = match (row, ways[lane]) {
                (None, _) | (_, Way::Rests) => false,
                (Some(row), _) if !self.is_unusual(lane, ways[lane]) => {
                    self.settle(lane, row);
                    true
                }
                (Some(row), _) => {
                    if let Some(before) = before[lane] {
                        self.assets[lane].beside.bound = before;
                    }
                    match self.alone(lane, row) {
                        Ok(()) => true,
                        Err(error) => {
                            failed.push((lane, error));
                            false
                        }
                    }
                }
            };
            if !is_done {
                self.keep(lane);
            }
        }
        (rows.len()..L).for_each(|lane| self.keep(lane));
        self.now = 1 - self.now;
        let inputs = self.held[self.now].values_mut();
        for (lane, asset) in self.assets.iter().enumerate() {
            for (place, u) in self.places.inputs.clone().zip(&asset.beside.inputs) {
                inputs[place][lane] = *u;
            }
        }
        failed
    }

    fn is_exact(&self) -> bool {
        self.is_exact
    }

    fn assets(&self) -> &[Asset] {
        &self.assets
    }

    fn places(&self) -> &Places {
        &self.places
    }

    fn names(&self) -> &[String] {
        self.assets[0].model.flow.system().states()
    }

    fn values(&self) -> (&[f64], usize) {
        (self.held[self.now].values().as_flattened(), L)
    }

    fn copied(&self) -> Box<dyn Side> {
        Box::new(self.clone())
    }
}
