//! One plant under way: its estimator, what was told of it, and whether that is credible.

use std::collections::VecDeque;
use std::sync::Arc;

use lynkeus::run::filter::{Innovation, Reading};
use lynkeus::run::{Handover, Late, Revised, is_of_row};
use lynkeus::stream::Stream;
use lynkeus::study::Screen;
use lynkeus::table::Instant;
use lynkeus::{Error, explain};

use crate::bytes::{Parser, Writer};
use crate::consistency::Consistency;
use crate::handover;
use crate::row::Stamp;
use crate::sensor::{Sensor, Steps};

/// A row so many usual steps after the one before says that the clock went on, or that nobody sent any.
const JUMP: f64 = 100.0;
/// In widths of its declared range: an estimate so far outside is none.
const AWAY: f64 = 1.0;

/// What is told of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// when the row was sampled
    pub stamp: Stamp,
    /// estimates, then monitors, in the order of the [`Stream`]
    pub estimate: Vec<f64>,
    /// standard deviations of the estimates, where there are any
    pub deviations: Vec<f64>,
    /// whether nothing speaks against the estimate
    pub is_credible: bool,
    /// how many times the row was told before
    pub revision: u64,
    /// what speaks against it, and what the user should know
    pub notes: Vec<String>,
    /// it was told so before: its row came once more
    pub is_repeated: bool,
    /// by sensor, reading less expectation and the deviation of that; none where it was not judged
    pub innovations: Vec<Option<(f64, f64)>>,
}

/// A row that was told, and may be told again.
#[derive(Clone, Debug)]
struct Published {
    t: f64,
    stamp: Stamp,
    /// as it came
    read: Vec<f64>,
    estimate: Vec<f64>,
    deviations: Vec<f64>,
    revision: u64,
    /// of the row that it came with
    sequence: u64,
}

/// One plant.
#[derive(Clone, Debug)]
pub(crate) struct Asset {
    stream: Arc<Stream>,
    /// a screen of a sensor looks at the readings before
    looks_back: bool,
    /// its first row, once there is one
    first: Vec<f64>,
    late: Option<Late>,
    /// what counts as zero, where times are dates
    origin: Option<Instant>,
    /// in the order of time
    published: VecDeque<Published>,
    /// by sensor
    consistencies: Vec<Consistency>,
    /// by sensor
    sensors: Vec<Sensor>,
    /// the same before the rows that may still be joined by others
    before: Vec<Sensor>,
    /// so many rows that were told are older than these
    settled: usize,
    /// of rows
    steps: Steps,
    /// up to this row of all it is what a state says
    since: u64,
    /// by channel, where it stood in rows from before the study changed
    moved: Option<Vec<Option<usize>>>,
}

impl Asset {
    /// Before its first row.
    pub fn new(stream: Arc<Stream>) -> Self {
        let sensors = stream.channels.iter().filter(|c| c.is_sensor).count();
        let mut screens = stream.channels.iter().flat_map(|channel| &channel.screens);
        Self {
            looks_back: screens.any(|screen| !matches!(screen, Screen::Plausible(..))),
            first: vec![],
            late: None,
            origin: None,
            published: VecDeque::new(),
            consistencies: vec![Consistency::default(); sensors],
            sensors: vec![Sensor::default(); sensors],
            before: vec![Sensor::default(); sensors],
            settled: 0,
            steps: Steps::default(),
            since: 0,
            moved: None,
            stream,
        }
    }

    /// Its study.
    pub fn stream(&self) -> &Stream {
        &self.stream
    }

    /// A number that differs for assets of other studies or parameters.
    pub fn fingerprint(&self) -> u64 {
        self.stream.fingerprint()
    }

    /// Takes a row, which is the `sequence`-th of all; what is told of it and of rows before. Of the last `keep` rows
    /// of all it is known whether they are told again.
    ///
    /// # Errors
    /// Why the row cannot be used: nothing has changed.
    pub fn take(
        &mut self,
        stamp: Stamp,
        values: &[f64],
        (sequence, keep): (u64, u64),
    ) -> Result<Vec<Line>, String> {
        if sequence <= self.since {
            return Ok(vec![]);
        }
        let t = self.time(stamp)?;
        if let Some(line) = self.again(t, values)? {
            return Ok(vec![Line {
                is_repeated: true,
                ..line
            }]);
        }
        self.refuse(t, stamp, values)?;
        let newest = self.newest();
        let is_new = newest.is_none_or(|newest| t > newest);
        // what fails changes nothing
        let Screened { sensors, rows } = self.screened(t, values, is_new);
        match (&mut self.late, rows.as_slice()) {
            (Some(late), [(_, readings)]) if is_new || !self.looks_back => {
                late.push(t, readings).map_err(said)?;
            }
            (Some(late), rows) => {
                late.correct(rows).map_err(said)?;
            }
            (None, rows) => {
                let readings = rows.first().map_or(values, |(_, readings)| readings);
                let begun = self.stream.begin(readings);
                let mut late = begun.map_err(|error| error.message().to_owned())?;
                late.push(t, readings).map_err(said)?;
                self.late = Some(late);
                self.first = readings.to_vec();
                self.origin = match stamp {
                    Stamp::Date(instant) => Some(instant),
                    Stamp::Number(_) => None,
                };
            }
        }
        self.sensors = sensors;
        let jumped = is_new.then(|| self.steps.lacks(t, JUMP)).flatten();
        if is_new {
            self.steps.take(t);
        }
        let row = Published {
            t,
            stamp,
            read: values.to_vec(),
            estimate: vec![],
            deviations: vec![],
            revision: 0,
            sequence,
        };
        let lines = self.publish(row, jumped);
        self.settle();
        self.forget(keep);
        Ok(lines)
    }

    /// A time as the plant counts it.
    fn time(&self, stamp: Stamp) -> Result<f64, String> {
        let found = match stamp {
            Stamp::Number(_) => "a number",
            Stamp::Date(_) => "a date",
        };
        match (stamp, self.origin) {
            (Stamp::Number(t), None) => Ok(t),
            (Stamp::Date(instant), origin) if origin.is_some() || self.late.is_none() => {
                let origin = origin.unwrap_or(instant);
                if origin.is_zoned() != instant.is_zoned() {
                    return Err(format!(
                        "the time {stamp}: some rows say how far their clock is from UTC, and some do not"
                    ));
                }
                let seconds = self.stream.seconds.ok_or_else(|| {
                    "dates count in seconds, and `time_unit` of [plot] says that the plant's time does not: write it under [log]".to_owned()
                })?;
                Ok(instant.seconds_since(origin) / seconds)
            }
            _ => Err(format!(
                "the time {stamp} is {found}, and the first row's is none"
            )),
        }
    }

    /// The time of the newest row.
    pub fn newest(&self) -> Option<f64> {
        self.late.as_ref().and_then(|late| late.time())
    }

    /// The line of a row that was told and comes once more.
    fn again(&self, t: f64, values: &[f64]) -> Result<Option<Line>, String> {
        let Some(newest) = self.newest() else {
            return Ok(None);
        };
        let is_it = |row: &&Published| is_of_row(row.t, t, newest.max(t));
        if t > newest && !is_of_row(t, newest, t) {
            return Ok(None);
        }
        let Some(known) = self.published.iter().rev().find(is_it) else {
            return Ok(None);
        };
        let same = |(own, known): (&f64, &f64)| own.is_nan() || own == known;
        if values.iter().zip(&known.read).all(same) {
            return Ok(Some(self.line(known, self.doubts(), vec![])));
        }
        match self.stream.wait() > 0.0 {
            true => Ok(None),
            false => Err(format!(
                "the row at {} was there with other values; with `wait` of [serve] the later one would count",
                known.stamp
            )),
        }
    }

    /// What was told last of the rows that may still be corrected, in the order of their times.
    pub fn recent(&self) -> Vec<Line> {
        let Some(newest) = self.newest() else {
            return vec![];
        };
        let oldest = newest - self.stream.wait();
        let rows = self.published.iter();
        let rows = rows.filter(|row| row.t >= oldest || is_of_row(row.t, oldest, newest));
        rows.map(|row| self.line(row, self.doubts(), vec![]))
            .collect()
    }

    /// Refuses what cannot be used.
    fn refuse(&self, t: f64, stamp: Stamp, values: &[f64]) -> Result<(), String> {
        if self.stream.is_strict() {
            let mut channels = self.stream.channels.iter().zip(values);
            if let Some((channel, _)) = channels.find(|(_, y)| y.is_nan()) {
                return Err(format!(
                    "{} is missing, and [estimate] says `strict`",
                    channel.name
                ));
            }
        }
        let newest = self.newest().filter(|newest| t < *newest);
        let before = newest.zip(self.published.back());
        match before {
            Some((newest, row)) if t < newest - self.stream.wait() => Err(format!(
                "the row at {stamp} comes too late after the one at {}: older rows are waited for for {}, `wait` of [serve]",
                row.stamp,
                self.stream.wait()
            )),
            _ => Ok(()),
        }
    }

    /// A row without what is no reading, and those after it of which it changes what are readings: a screen that looks at
    /// the one before sees the samples in their order, whenever they came.
    fn screened(&self, t: f64, values: &[f64], is_new: bool) -> Screened {
        if is_new {
            let mut sensors = self.sensors.clone();
            let readings = self.taken(&mut sensors, t, values);
            let rows = vec![(t, readings)];
            return Screened { sensors, rows };
        }
        let newest = self.newest().unwrap_or(t);
        let is_own = |row: &Published| is_of_row(row.t, t, newest);
        let open = self
            .published
            .range(self.settled.min(self.published.len())..);
        let place = open.clone().position(|row| row.t >= t || is_own(row));
        let (mut sensors, mut as_it_was) = (self.before.clone(), self.before.clone());
        let mut rows = vec![];
        let mut own = |sensors: &mut [Sensor], read: &[f64]| {
            let readings = self.taken(sensors, t, read);
            // what was read before at this time counts for the screens, and is there
            let came = readings
                .iter()
                .zip(values)
                .map(|(y, value)| match value.is_nan() {
                    true if !self.looks_back => f64::NAN,
                    _ => *y,
                });
            rows.push((t, came.collect::<Vec<f64>>()));
        };
        let mut changed = vec![];
        for (i, row) in open.enumerate() {
            let is_joined = is_own(row);
            if Some(i) == place && !is_joined {
                own(&mut sensors, values);
            }
            let was = self.taken(&mut as_it_was, row.t, &row.read);
            if is_joined {
                let mut read = row.read.clone();
                join(&mut read, values);
                own(&mut sensors, &read);
                continue;
            }
            let is = self.taken(&mut sensors, row.t, &row.read);
            if bits(&is) != bits(&was) {
                changed.push((row.t, is));
            }
        }
        if place.is_none() {
            own(&mut sensors, values);
        }
        rows.append(&mut changed);
        Screened { sensors, rows }
    }

    /// The readings of a row after those that some sensors have seen; NaN where there is none.
    fn taken(&self, sensors: &mut [Sensor], t: f64, values: &[f64]) -> Vec<f64> {
        let mut readings = values.to_vec();
        let channels = self.stream.channels.iter().zip(sensors);
        for (y, (channel, sensor)) in readings.iter_mut().zip(channels) {
            *y = sensor.take(t, *y, channel);
        }
        readings
    }

    /// Rows that nothing can join any more are those before the others.
    fn settle(&mut self) {
        let newest = self.newest().unwrap_or_default();
        let oldest = newest - self.stream.wait();
        let mut before = std::mem::take(&mut self.before);
        while let Some(row) = self.published.get(self.settled)
            && row.t < oldest
            && !is_of_row(row.t, oldest, newest)
        {
            self.taken(&mut before, row.t, &row.read);
            self.settled += 1;
        }
        self.before = before;
    }

    /// What the last push changed: the row itself, and those after it.
    fn publish(&mut self, row: Published, jumped: Option<f64>) -> Vec<Line> {
        let Some(late) = &self.late else {
            return vec![];
        };
        let newest = late.time().unwrap_or(row.t);
        let mut changed = late.revised().to_vec();
        changed.push(Revised {
            t: newest,
            estimate: late.estimate().to_vec(),
            deviations: late.deviations().map(<[f64]>::to_vec),
            innovations: late.innovations().to_vec(),
        });
        let mut told = vec![];
        let judged = |innovation: &Innovation| match innovation.reading {
            Reading::Missing | Reading::AtLimit => None,
            Reading::Taken | Reading::Rejected => Some((innovation.value, innovation.deviation)),
        };
        for revised in changed {
            let Revised {
                t,
                estimate,
                deviations,
                innovations,
            } = revised;
            let deviations = deviations.unwrap_or_default();
            for (consistency, innovation) in self.consistencies.iter_mut().zip(&innovations) {
                consistency.take(t, innovation);
            }
            let place = self.published.partition_point(|known| known.t < t);
            let known = self.published.get_mut(place).filter(|known| known.t == t);
            let is_own = is_of_row(t, row.t, newest);
            match known {
                Some(known) => {
                    if is_own {
                        join(&mut known.read, &row.read);
                        known.sequence = row.sequence;
                    }
                    let was = (bits(&known.estimate), bits(&known.deviations));
                    if was == (bits(&estimate), bits(&deviations)) && !is_own {
                        continue;
                    }
                    known.revision += 1;
                    (known.estimate, known.deviations) = (estimate, deviations);
                }
                None if is_own => self.published.insert(
                    place,
                    Published {
                        t,
                        estimate,
                        deviations,
                        ..row.clone()
                    },
                ),
                // it was told so long ago that nobody asks
                None => continue,
            }
            told.push((place, innovations.iter().map(judged).collect()));
        }
        let doubts = self.doubts();
        let notes = |place: usize| match jumped {
            Some(step) if place + 1 == self.published.len() => {
                vec![format!("no row for {step}: silence, or the clock went on")]
            }
            _ => vec![],
        };
        let rows = told.into_iter().filter_map(|(place, innovations)| {
            let row = self.published.get(place)?;
            Some(Line {
                innovations,
                ..self.line(row, doubts.clone(), notes(place))
            })
        });
        rows.collect()
    }

    /// What is told of a row.
    fn line(&self, row: &Published, doubts: Doubts, mut notes: Vec<String>) -> Line {
        let mut estimate = row.estimate.clone();
        let told = self.stream.estimates.iter();
        for (x, told) in estimate.iter_mut().zip(told.clone()) {
            if let Some(from) = told.turn {
                *x -= std::f64::consts::TAU * ((*x - from) / std::f64::consts::TAU).floor();
            }
        }
        let mut is_credible = doubts.is_credible;
        notes.extend(doubts.notes);
        for (x, told) in estimate.iter().zip(told.clone()) {
            let (low, high) = told.range;
            let width = high - low;
            if width.is_finite() && (*x < low - AWAY * width || *x > high + AWAY * width) {
                is_credible = false;
                notes.push(format!("{} is far outside of its range", told.name));
            }
        }
        let monitors = estimate.iter().skip(told.len()).zip(&self.stream.monitors);
        let low = monitors.filter(|(x, monitor)| **x < monitor.below);
        notes.extend(
            low.map(|(_, monitor)| format!("{} is low: {}", monitor.header, monitor.meaning)),
        );
        let has_deviations = self.stream.estimates.iter().any(|t| t.deviation.is_some());
        Line {
            stamp: row.stamp,
            deviations: match has_deviations {
                true => row.deviations.clone(),
                false => vec![],
            },
            estimate,
            is_credible,
            revision: row.revision,
            notes,
            is_repeated: false,
            innovations: vec![],
        }
    }

    /// What the sensors say against the estimate.
    fn doubts(&self) -> Doubts {
        let mut doubts = Doubts {
            is_credible: true,
            notes: vec![],
        };
        let t = self.newest().unwrap_or_default();
        let channels = self.stream.channels.iter().filter(|c| c.is_sensor);
        let sensors = self.sensors.iter().zip(&self.consistencies);
        let mut silent = 0;
        for (channel, (sensor, consistency)) in channels.zip(sensors) {
            let name = &channel.name;
            if let Some(since) = sensor.is_silent(t) {
                silent += 1;
                doubts.notes.push(format!("{name}: no reading for {since}"));
            }
            if let Some(run) = sensor.hangs(channel) {
                doubts.is_credible = false;
                let text = format!("{name} is frozen: {run} equal readings, although it has noise");
                doubts.notes.push(text);
            }
            if consistency.contradicts(self.stream.by) {
                doubts.is_credible = false;
                let text = format!("the readings of {name} are not what is expected of them");
                doubts.notes.push(text);
            }
        }
        if silent > 0 && silent == self.sensors.len() {
            doubts.is_credible = false;
        }
        doubts
    }

    /// Leaves out what nobody asks for any more; the newest row stays.
    fn forget(&mut self, keep: u64) {
        let newest = self.newest().unwrap_or_default();
        let last = self.published.back().map_or(0, |row| row.sequence);
        let oldest = newest - self.stream.wait();
        let is_old = |row: &Published| {
            row.t < oldest && !is_of_row(row.t, oldest, newest) && row.sequence + keep <= last
        };
        while self.published.len() > 1 && self.published.front().is_some_and(is_old) {
            self.published.pop_front();
            self.settled = self.settled.saturating_sub(1);
        }
    }

    /// Everything that the future depends on.
    pub fn save(&self, to: &mut Writer) {
        let channels = self.stream.channels.iter();
        to.texts(channels.map(|channel| channel.name.as_str()));
        let told = self.told();
        to.texts(told.iter().map(String::as_str));
        to.numbers(&self.stream.seconds.map_or(vec![], |seconds| vec![seconds]));
        to.numbers(&self.first);
        let Some(late) = &self.late else {
            return;
        };
        to.bytes(&late.snapshot());
        handover::save(&late.handover(), to);
        to.word(u64::from(self.origin.is_some()));
        if let Some(origin) = self.origin {
            Stamp::Date(origin).save(to);
        }
        to.word(self.published.len() as u64);
        for row in &self.published {
            to.number(row.t);
            row.stamp.save(to);
            to.numbers(&row.read);
            to.numbers(&row.estimate);
            to.numbers(&row.deviations);
            to.word(row.revision);
            to.word(row.sequence);
        }
        to.word(self.sensors.len() as u64);
        self.sensors
            .iter()
            .chain(&self.before)
            .for_each(|s| s.save(to));
        to.word(self.settled as u64);
        self.consistencies.iter().for_each(|c| c.save(to));
        self.steps.save(to);
    }

    /// What a line has, with the units.
    fn told(&self) -> Vec<String> {
        let estimates = self.stream.estimates.iter();
        let estimates = estimates.map(|told| match &told.unit {
            Some(unit) => format!("{} in {unit}", told.name),
            None => told.name.clone(),
        });
        let monitors = self.stream.monitors.iter();
        estimates
            .chain(monitors.map(|m| m.header.clone()))
            .collect()
    }

    /// To where an asset of this study was after so many rows of all; none where that is no state of it.
    pub fn resume(&mut self, saved: Saved, sequence: u64) -> Option<()> {
        self.since = sequence;
        self.first = saved.first;
        let Some(begun) = saved.begun else {
            return Some(());
        };
        if begun.sensors.len() != self.sensors.len() {
            return None;
        }
        let mut late = self.stream.begin(&self.first).ok()?;
        late.restore(&begun.snapshot).ok()?;
        self.late = Some(late);
        self.origin = begun.origin;
        self.published = begun.published.into();
        self.consistencies = begun.consistencies;
        (self.sensors, self.before) = (begun.sensors, begun.before);
        self.settled = begun.settled;
        self.steps = begun.steps;
        Some(())
    }

    /// To where an asset of a study with other numbers was after so many rows of all: estimates and what is known of their
    /// errors go on, and what is known of sensors; whether the estimate is credible is judged anew.
    ///
    /// # Errors
    /// Why that is impossible.
    pub fn take_over(&mut self, saved: Saved, sequence: u64) -> Result<(), Error> {
        let other = |text: String| Err(Error::input(text));
        if self.stream.seconds != saved.seconds {
            return other("the plant's unit of time is another one".to_owned());
        }
        let told = self.told();
        let estimates = told.len() - self.stream.monitors.len();
        let is_told = |name: &&String| saved.told.contains(name);
        if let Some(name) = told.iter().take(estimates).find(|name| !is_told(name)) {
            return other(format!(
                "this study estimates {name}, and there are {}",
                saved.told.join(", ")
            ));
        }
        let names = self.stream.channels.iter();
        let places = names.map(|channel| saved.channels.iter().position(|c| *c == channel.name));
        let places: Vec<Option<usize>> = places.collect();
        self.since = sequence;
        self.moved = Some(places);
        let Some(begun) = saved.begun else {
            return Ok(());
        };
        self.first = self.at_places(&saved.first);
        self.late = Some(self.stream.take_over(&self.first, &begun.handover)?);
        self.origin = begun.origin;
        let estimates = self.stream.estimates.iter();
        let lacks = estimates.filter(|told| told.deviation.is_some()).count() > 0
            && begun.published.iter().any(|row| row.deviations.is_empty());
        if told == saved.told && !lacks {
            let rows = begun.published.into_iter().map(|row| Published {
                read: self.at_places(&row.read),
                ..row
            });
            self.published = rows.collect();
            self.settled = begun.settled;
        }
        // of rows that are not known any more nothing is taken back
        let before = if self.published.is_empty() {
            &begun.sensors
        } else {
            &begun.before
        };
        let places = self.moved.iter().flatten();
        let sensors = self.sensors.iter_mut().zip(&mut self.before);
        for ((own, own_before), place) in sensors.zip(places) {
            let Some(place) = *place else { continue };
            if let (Some(sensor), Some(before)) = (begun.sensors.get(place), before.get(place)) {
                (*own, *own_before) = (sensor.clone(), before.clone());
            }
        }
        self.steps = begun.steps;
        Ok(())
    }

    /// The values of a row that was written down before the study changed.
    pub fn at_places(&self, values: &[f64]) -> Vec<f64> {
        let Some(moved) = &self.moved else {
            return values.to_vec();
        };
        let value = |place: &Option<usize>| place.and_then(|place| values.get(place)).copied();
        moved
            .iter()
            .map(|place| value(place).unwrap_or(f64::NAN))
            .collect()
    }
}

/// What a state says of an asset.
#[derive(Debug)]
pub(crate) struct Saved {
    channels: Vec<String>,
    told: Vec<String>,
    seconds: Option<f64>,
    first: Vec<f64>,
    /// none before its first row
    begun: Option<Begun>,
}

/// What it says of one that had a row.
#[derive(Debug)]
struct Begun {
    snapshot: Vec<u8>,
    handover: Handover,
    origin: Option<Instant>,
    published: Vec<Published>,
    sensors: Vec<Sensor>,
    before: Vec<Sensor>,
    settled: usize,
    consistencies: Vec<Consistency>,
    steps: Steps,
}

impl Saved {
    /// What was [saved](Asset::save); none where that is something else.
    pub fn load(from: &mut Parser<'_>) -> Option<Self> {
        let (channels, told) = (from.texts()?, from.texts()?);
        let seconds = from.numbers()?.first().copied();
        let first = from.numbers()?;
        let begun = match first.is_empty() {
            true => None,
            false => Some(Begun::load(from)?),
        };
        Some(Self {
            channels,
            told,
            seconds,
            first,
            begun,
        })
    }
}

impl Begun {
    fn load(from: &mut Parser<'_>) -> Option<Self> {
        let snapshot = from.bytes()?.to_vec();
        let handover = handover::load(from)?;
        let origin = match from.word()? {
            1 => match Stamp::load(from)? {
                Stamp::Date(origin) => Some(origin),
                Stamp::Number(_) => return None,
            },
            _ => None,
        };
        let mut published = vec![];
        for _ in 0..from.count(56)? {
            published.push(Published {
                t: from.number()?,
                stamp: Stamp::load(from)?,
                read: from.numbers()?,
                estimate: from.numbers()?,
                deviations: from.numbers()?,
                revision: from.word()?,
                sequence: from.word()?,
            });
        }
        let count = from.count(64)?;
        let sensors = (0..count).map(|_| Sensor::load(from));
        let sensors = sensors.collect::<Option<_>>()?;
        let before = (0..count).map(|_| Sensor::load(from));
        let before = before.collect::<Option<_>>()?;
        let settled = usize::try_from(from.word()?).ok()?;
        let consistencies = (0..count).map(|_| Consistency::load(from));
        Some(Self {
            snapshot,
            handover,
            origin,
            published,
            sensors,
            before,
            settled,
            consistencies: consistencies.collect::<Option<_>>()?,
            steps: Steps::load(from)?,
        })
    }
}

/// Rows without what is no reading.
struct Screened {
    /// after them
    sensors: Vec<Sensor>,
    /// the row that came, then those of which other readings count
    rows: Vec<(f64, Vec<f64>)>,
}

/// What speaks against an estimate.
#[derive(Clone, Debug)]
struct Doubts {
    is_credible: bool,
    notes: Vec<String>,
}

/// Why a row was not taken, in words.
fn said(error: lynkeus::run::Error) -> String {
    explain(error).message().to_owned()
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// What was read at one time, the later reading before the earlier.
fn join(read: &mut [f64], later: &[f64]) {
    for (own, later) in read.iter_mut().zip(later) {
        if later.is_finite() {
            *own = *later;
        }
    }
}
