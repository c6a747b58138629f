//! Readings that come late, put in their place while an estimator runs.

use std::collections::VecDeque;
use std::ops::{Deref, Range};

use crate::filter::Innovation;
use crate::runner::no_number;
use crate::snapshot::{self, Damaged, Walk};
use crate::standing::Standing;
use crate::{Digest, Error, Estimator, Result, SnapshotFault};

/// Times that differ by less than so many roundings are one: t − delay does not meet the row that is meant to the bit.
const ROUNDINGS: f64 = 4.0;

/// Whether a sample at `taken` that came at `came` is one of the row at `t`.
#[must_use]
pub fn is_of_row(taken: f64, t: f64, came: f64) -> bool {
    let largest = taken.abs().max(t.abs()).max(came.abs());
    (taken - t).abs() <= ROUNDINGS * f64::EPSILON * largest
}

/// So many states are kept to go back to, more than one of them for long rows of samples.
const IMAGES: usize = 64;

/// An estimator that puts late readings in their place: it goes back to a state from before, and on again with all that
/// was read since. What it gives once every late reading has come equals to the bit what an [`Estimator`] gives of the
/// rows in the order of their times, a row for each time.
///
/// It keeps the rows of the time that it waits, and up to 64 states to go back to. All that an estimator tells is told
/// of the newest row.
///
/// ```
/// use lynkeus_expr::Graph;
/// use lynkeus_run::{Estimator, EstimatorSettings, Late, System};
///
/// // x̂' = 2(y − x̂)
/// let g = Graph::new();
/// let [time, x, y] = ["time", "x", "y"].map(|name| g.symbol(name));
/// let states = [("x_hat".to_string(), x.node(), 0.0)];
/// let dx = (y - x) * 2.0;
/// let signal = [("y".to_string(), y.node())];
/// let observer = System::new(&g, time.node(), &states, &signal, &[dx.node()], &[])?;
/// let estimator = || Estimator::new(&observer, EstimatorSettings::default());
///
/// let mut late = Late::new(estimator()?, &[], 5.0)?;
/// for (t, y) in [(0.0, 0.0), (2.0, 2.0), (3.0, 1.0), (1.0, 4.0)] {
///     late.push(t, &[y])?;
/// }
/// assert_eq!(late.revised().len(), 2);
/// let mut sorted = estimator()?;
/// for (t, y) in [(0.0, 0.0), (1.0, 4.0), (2.0, 2.0), (3.0, 1.0)] {
///     sorted.push(t, &[y])?;
/// }
/// assert_eq!(late.estimate(), sorted.estimate());
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Late {
    /// at the newest row
    estimator: Estimator,
    /// by sensor, how much later than its sample is taken a reading comes
    delays: Vec<f64>,
    wait: f64,
    /// of the time that is waited for, in order; the first has an image
    rows: VecDeque<Row>,
    /// from one image to the next, in rows
    stride: usize,
    /// whether the first row is that of the estimator
    is_whole: bool,
    too_late: usize,
    revised: Vec<Revised>,
}

/// What was read at a time.
#[derive(Clone, Debug)]
struct Row {
    t: f64,
    /// NaN where nothing was read; none of a prediction
    signals: Vec<f64>,
    /// not only a late sample's
    is_own: bool,
    /// the estimator before it
    image: Option<Vec<u64>>,
}

/// A row that comes.
struct Arrived {
    row: Row,
    /// signals of which it knows better than what is there, also where nothing was read
    replaced: Range<usize>,
}

/// What an estimator makes of a row that it goes over again.
#[derive(Clone, Debug, PartialEq)]
pub struct Revised {
    /// time of the row
    pub t: f64,
    /// the estimate, in the order of [`Estimator::names`]
    pub estimate: Vec<f64>,
    /// its standard deviations, where the estimator has them
    pub deviations: Option<Vec<f64>>,
    /// what became of its readings, as [`Estimator::innovations`]
    pub innovations: Vec<Innovation>,
}

/// Where a [`Late`] stands, by name, with the rows that it keeps: what one with other numbers goes on from.
#[derive(Clone, Debug, PartialEq)]
pub struct Handover {
    /// where the estimator stood before the rows; none before the first of all
    pub standing: Option<Standing>,
    /// names of the signals
    pub signals: Vec<String>,
    /// in the order of time
    pub rows: Vec<HandoverRow>,
}

/// What was read at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct HandoverRow {
    /// when
    pub t: f64,
    /// by signal, NaN where nothing was read; none of a prediction
    pub signals: Vec<f64>,
    /// it is not only that of a sample that came late
    pub is_own: bool,
}

impl Late {
    /// An estimator before its first sample, whose sensors have these delays (none: no sensor is late), and that waits
    /// so long for rows that come late, at least the largest delay.
    ///
    /// # Errors
    /// [`Error::Setting`]: delays for another number of sensors, a delay or a time to wait that is negative or no
    /// number, or an estimator that has begun.
    pub fn new(estimator: Estimator, delays: &[f64], wait: f64) -> Result<Self> {
        let sensors = estimator.sensors();
        if !delays.is_empty() && delays.len() != sensors {
            return Err(Error::setting(
                "number of delays",
                sensors.to_string(),
                delays.len(),
            ));
        }
        if let Some(delay) = delays.iter().find(|d| !(d.is_finite() && **d >= 0.0)) {
            return Err(Error::setting("a delay", "a finite time >= 0", delay));
        }
        if wait.is_nan() || wait < 0.0 {
            return Err(Error::setting("the time to wait", "a time >= 0", wait));
        }
        if let Some(t) = estimator.time() {
            return Err(Error::setting("time of the estimator", "none so far", t));
        }
        let mut delays = delays.to_vec();
        delays.resize(sensors, 0.0);
        Ok(Self {
            wait: delays.iter().copied().fold(wait, f64::max),
            estimator,
            delays,
            rows: VecDeque::new(),
            stride: 1,
            is_whole: true,
            too_late: 0,
            revised: vec![],
        })
    }

    /// How long rows that come late are waited for.
    #[must_use]
    pub fn wait(&self) -> f64 {
        self.wait
    }

    /// Rows that came later than is waited for.
    #[must_use]
    pub fn too_late(&self) -> usize {
        self.too_late
    }

    /// The rows before the newest that the last call went over, for the first time those that came late themselves.
    #[must_use]
    pub fn revised(&self) -> &[Revised] {
        &self.revised
    }

    /// As [`Estimator::predict`].
    ///
    /// # Errors
    /// As [`Estimator::predict`].
    pub fn predict(&mut self, t: f64) -> Result<&[f64]> {
        self.revised.clear();
        let before = self.estimator.time();
        let image = self.keeps().then(|| self.estimator.image());
        self.estimator.predict(t)?;
        if let Some(image) = image.filter(|_| before != Some(t)) {
            self.rows.push_back(Row {
                image: self.is_due(self.rows.len()).then_some(image),
                ..Row::new(t, vec![], true)
            });
            self.forget(t - self.wait);
        }
        Ok(self.estimator.estimate())
    }

    /// As [`Estimator::push`], of a row that may be late, with readings whose samples were taken before it. What was
    /// read at one time is one row, in which what came last counts.
    ///
    /// # Errors
    /// As [`Estimator::push`], of this row or of one after it; [`Error::TooLate`] for a row that comes later than is
    /// waited for: it is counted, and nothing else changes.
    pub fn push(&mut self, t: f64, signals: &[f64]) -> Result<&[f64]> {
        self.revised.clear();
        if !self.keeps() {
            return self.estimator.push(t, signals);
        }
        self.check(t, signals)?;
        self.arrive(self.taken(t, signals, false), t)
    }

    /// As [`push`](Self::push) of several rows at once, whose readings take the place of those that were there at their
    /// times: one that turns out to be none is taken back.
    ///
    /// # Errors
    /// As [`push`](Self::push), and [`Error::Setting`] where nothing is waited for.
    pub fn correct(&mut self, rows: &[(f64, Vec<f64>)]) -> Result<&[f64]> {
        self.revised.clear();
        if !self.keeps() {
            return Err(Error::setting("the time to wait", "one > 0", self.wait));
        }
        let mut arrived = vec![];
        let mut newest = f64::NEG_INFINITY;
        for (t, signals) in rows {
            self.check(*t, signals)?;
            arrived.append(&mut self.taken(*t, signals, true));
            newest = newest.max(*t);
        }
        arrived.sort_by(|a, b| a.row.t.total_cmp(&b.row.t));
        self.arrive(arrived, newest)
    }

    fn check(&self, t: f64, signals: &[f64]) -> Result<()> {
        let names = self.estimator.signals();
        if signals.len() != names.len() {
            let expected = format!("{}: {}", names.len(), names.join(", "));
            return Err(Error::setting("number of signals", expected, signals.len()));
        }
        match t.is_finite() {
            true => Ok(()),
            false => Err(no_number("t", t)),
        }
    }

    /// Takes rows in the order of time, of which the newest came at `t`.
    fn arrive(&mut self, arrived: Vec<Arrived>, t: f64) -> Result<&[f64]> {
        let came = self.estimator.time().unwrap_or(t).max(t);
        let oldest = came - self.wait;
        let first = self.rows.front().filter(|_| !self.is_whole);
        let is_old = |row: &&Row| {
            let is_before = |t: f64| row.t < t && !is_of_row(row.t, t, came);
            is_before(oldest) || first.is_some_and(|first| is_before(first.t))
        };
        if let Some(old) = arrived.iter().map(|arrived| &arrived.row).find(is_old) {
            self.too_late += 1;
            let time = old.t;
            return Err(Error::TooLate { time, oldest });
        }
        let now = self.estimator.image();
        if let Err(error) = self.take(arrived, came) {
            self.revised.clear();
            self.estimator.go_back(&now);
            return Err(error);
        }
        self.forget(oldest);
        Ok(self.estimator.estimate())
    }

    /// Whether there is something to go back for.
    fn keeps(&self) -> bool {
        self.wait > 0.0
    }

    /// The rows that such a row stands for, in order: itself, and those of samples that were taken before it.
    fn taken(&self, t: f64, signals: &[f64], replaces: bool) -> Vec<Arrived> {
        let mut own = Row::new(t, signals.to_vec(), true);
        let mut rows = vec![];
        for (sensor, delay) in self.delays.iter().enumerate() {
            if *delay > 0.0 && (signals[sensor].is_finite() || replaces) {
                let mut alone = vec![f64::NAN; signals.len()];
                std::mem::swap(&mut alone[sensor], &mut own.signals[sensor]);
                rows.push(Arrived {
                    row: Row::new(t - delay, alone, false),
                    replaced: if replaces { sensor..sensor + 1 } else { 0..0 },
                });
            }
        }
        rows.push(Arrived {
            row: own,
            replaced: if replaces { 0..self.delays.len() } else { 0..0 },
        });
        rows.sort_by(|a, b| a.row.t.total_cmp(&b.row.t));
        rows
    }

    /// Puts what arrived, in order, where it belongs, and goes over all that is after it.
    fn take(&mut self, arrived: Vec<Arrived>, came: f64) -> Result<()> {
        let reached = |row: &Row, t: f64| row.t < t && !is_of_row(t, row.t, came);
        let first = arrived.first().map_or(came, |arrived| arrived.row.t);
        let mut from = self.rows.partition_point(|row| reached(row, first));
        if from < self.rows.len() {
            let mut back = self.rows.range(..=from);
            from = back.rposition(|row| row.image.is_some()).unwrap_or(0);
            if let Some(image) = self.rows.get(from).and_then(|row| row.image.as_ref()) {
                self.estimator.go_back(image);
            }
        }
        let old = self.rows.range(from..);
        let mut again: Vec<Row> = old.map(Row::without_image).collect();
        for Arrived { row, replaced } in arrived {
            let place = again.partition_point(|known| reached(known, row.t));
            let known = again.get_mut(place);
            match known.filter(|known| is_of_row(row.t, known.t, came)) {
                Some(known) => {
                    known.join(&row);
                    // of a sensor whose samples come late this row says nothing
                    let replaced =
                        replaced.filter(|sensor| !row.is_own || self.delays[*sensor] == 0.0);
                    replaced.for_each(|sensor| known.signals[sensor] = row.signals[sensor]);
                }
                None => again.insert(place, row),
            }
        }
        again.retain(Row::is_there);
        if self.estimator.time().is_none() {
            self.begin(&mut again);
        }
        let newest = again.last().map(|row| row.t);
        let mut since = self.since(from);
        for row in &mut again {
            if since >= self.stride {
                row.image = Some(self.estimator.image());
                since = 0;
            }
            since += 1;
            match row.signals.is_empty() {
                true => self.estimator.predict(row.t)?,
                false => self.estimator.push(row.t, &row.signals)?,
            };
            if Some(row.t) != newest && row.is_own {
                self.revised.push(Revised {
                    t: row.t,
                    estimate: self.estimator.estimate().to_vec(),
                    deviations: self.estimator.deviations().map(<[f64]>::to_vec),
                    innovations: self.estimator.innovations().to_vec(),
                });
            }
        }
        self.rows.truncate(from);
        self.rows.extend(again);
        Ok(())
    }

    /// Gives the first row of all the inputs that it has not: the first that come.
    fn begin(&self, rows: &mut [Row]) {
        let inputs = self.estimator.sensors()..self.estimator.signals().len();
        for input in inputs {
            let mut known = rows
                .iter()
                .filter_map(|row| row.signals.get(input).copied());
            let known = known.find(|u| u.is_finite());
            if let (Some(first), Some(known)) = (rows.first_mut(), known)
                && let Some(own) = first.signals.get_mut(input)
                && !own.is_finite()
            {
                *own = known;
            }
        }
    }

    /// How many rows before this place there are without an image; as many as the stride where there is none before it.
    fn since(&self, place: usize) -> usize {
        let mut before = self.rows.range(..place).rev();
        let last = before.position(|row| row.image.is_some());
        last.map_or(self.stride, |last| last + 1)
    }

    fn is_due(&self, place: usize) -> bool {
        self.since(place) >= self.stride
    }

    /// Leaves out what nothing goes back to any more.
    fn forget(&mut self, oldest: f64) {
        let until = self.rows.partition_point(|row| row.t <= oldest);
        let mut before = self.rows.range(..until);
        let first = before.rposition(|row| row.image.is_some()).unwrap_or(0);
        self.is_whole &= first == 0;
        self.rows.drain(..first);
        if self.rows.len() > IMAGES * self.stride {
            self.stride *= 2;
            let images = self.rows.iter_mut().filter(|row| row.image.is_some());
            images.skip(1).step_by(2).for_each(|row| row.image = None);
        }
    }

    /// A number that differs for estimators, delays and times to wait that differ.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let own = self.estimator.fingerprint();
        if !self.keeps() {
            return own;
        }
        let mut digest = Digest::default();
        digest.word(own);
        digest.numbers(&self.delays);
        digest.word(self.wait.to_bits());
        digest.value()
    }

    /// As [`Estimator::snapshot`], with the rows that are kept: what comes late finds its place after
    /// [`restore`](Self::restore), too. Where nothing is waited for it is the estimator's.
    #[must_use]
    pub fn snapshot(&self) -> Vec<u8> {
        if !self.keeps() {
            return self.estimator.snapshot();
        }
        let mut own = self.clone();
        snapshot::seal(self.fingerprint(), |walk| own.walk(walk))
    }

    /// As [`Estimator::restore`].
    ///
    /// # Errors
    /// [`Error::Snapshot`]: damaged, of another version, of another observer, other delays or another time to wait.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<()> {
        let refused = |fault| Error::Snapshot { fault };
        let mut restored = self.clone();
        restored.revised.clear();
        if self.keeps() {
            let state = snapshot::opened(snapshot, self.fingerprint()).map_err(refused)?;
            let loaded = snapshot::load(&state, |walk| restored.walk(walk));
            loaded.map_err(|_| refused(SnapshotFault::Damaged))?;
        } else {
            restored.estimator.restore(snapshot)?;
        }
        *self = restored;
        Ok(())
    }

    /// Where it stands before the rows that it keeps, and these: what [`take_over`](Self::take_over) of another one takes.
    #[must_use]
    pub fn handover(&self) -> Handover {
        let first = self.rows.front().and_then(|row| row.image.as_ref());
        let standing = match first {
            None => self.estimator.standing(),
            Some(image) => {
                let mut before = self.estimator.clone();
                before.go_back(image);
                before.standing()
            }
        };
        let rows = self.rows.iter().map(|row| HandoverRow {
            t: row.t,
            signals: row.signals.clone(),
            is_own: row.is_own,
        });
        Handover {
            standing,
            signals: self.estimator.signals().to_vec(),
            rows: rows.collect(),
        }
    }

    /// Goes on, before its first row, from where another one stands that has the same states and other numbers, as
    /// [`Estimator::resume`]; the rows that the other one keeps are gone over again, so that what comes late finds its
    /// place among them. Where it fails nothing changes.
    ///
    /// # Errors
    /// As [`Estimator::resume`], and of the rows as [`Estimator::push`].
    pub fn take_over(&mut self, from: &Handover) -> Result<()> {
        let mut own = self.clone();
        if let Some(standing) = &from.standing {
            own.estimator.resume(standing)?;
            own.is_whole = false;
            if own.keeps() {
                own.rows.push_back(Row {
                    image: Some(own.estimator.image()),
                    ..Row::new(standing.time, vec![], false)
                });
            }
        }
        let names = own.estimator.signals();
        let places = names
            .iter()
            .map(|name| from.signals.iter().position(|known| known == name));
        let places: Vec<Option<usize>> = places.collect();
        let of = |row: &HandoverRow| {
            let value = |place: &Option<usize>| {
                let value = place.and_then(|place| row.signals.get(place));
                value.copied().unwrap_or(f64::NAN)
            };
            let signals = match row.signals.is_empty() {
                true => vec![],
                false => places.iter().map(value).collect(),
            };
            Row::new(row.t, signals, row.is_own)
        };
        let mut rows: Vec<Row> = from.rows.iter().map(of).collect();
        let newest = rows.last().map(|row| row.t);
        if own.keeps() {
            if let Some(newest) = newest {
                let arrived = rows.into_iter().map(|row| Arrived {
                    row,
                    replaced: 0..0,
                });
                own.take(arrived.collect(), newest)?;
                own.forget(newest - own.wait);
            }
        } else {
            if own.estimator.time().is_none() {
                own.begin(&mut rows);
            }
            for row in &rows {
                match row.signals.is_empty() {
                    true => own.estimator.predict(row.t)?,
                    false => own.estimator.push(row.t, &row.signals)?,
                };
            }
        }
        own.revised.clear();
        *self = own;
        Ok(())
    }

    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.estimator.walk_state(walk)?;
        walk.count(&mut self.stride)?;
        walk.flag(&mut self.is_whole)?;
        walk.count(&mut self.too_late)?;
        let count = walk.length(self.rows.len())?;
        self.rows.resize_with(count, || Row::new(0.0, vec![], true));
        for row in &mut self.rows {
            row.walk(walk)?;
        }
        match self.stride == 0 || self.rows.front().is_some_and(|row| row.image.is_none()) {
            true => Err(Damaged),
            false => Ok(()),
        }
    }
}

impl Deref for Late {
    type Target = Estimator;

    fn deref(&self) -> &Estimator {
        &self.estimator
    }
}

impl Row {
    fn new(t: f64, signals: Vec<f64>, is_own: bool) -> Self {
        Self {
            t,
            signals,
            is_own,
            image: None,
        }
    }

    /// Whether there is something to go over; a prediction has no signals.
    fn is_there(&self) -> bool {
        self.is_own || self.signals.is_empty() || self.signals.iter().any(|y| y.is_finite())
    }

    fn without_image(&self) -> Self {
        Self::new(self.t, self.signals.clone(), self.is_own)
    }

    /// Takes what was read at its time and came after it.
    fn join(&mut self, other: &Self) {
        self.is_own |= other.is_own;
        // a prediction has none
        if self.signals.is_empty() {
            self.signals.clone_from(&other.signals);
        }
        for (own, other) in self.signals.iter_mut().zip(&other.signals) {
            if other.is_finite() {
                *own = *other;
            }
        }
    }

    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.number(&mut self.t)?;
        walk.flag(&mut self.is_own)?;
        let count = walk.length(self.signals.len())?;
        self.signals.resize(count, f64::NAN);
        walk.numbers(&mut self.signals)?;
        walk.optional(&mut self.image, |walk, image| {
            let count = walk.length(image.len())?;
            image.resize(count, 0);
            image.iter_mut().try_for_each(|word| walk.word(word))
        })
    }
}
