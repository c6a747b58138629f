//! Random operations on one estimator, with a twin that was restored from a snapshot of it.

use std::fmt;

use lynkeus::run::{Error, Estimator};

use super::subjects::Subject;
use crate::numbers::Numbers;

/// Counts of one or more sessions.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub operations: u64,
    /// that gave an estimate
    pub estimated: u64,
    /// that were refused, as they had to be or not
    pub refused: u64,
    /// after which a restored twin was found to be the same
    pub compared: u64,
}

impl Tally {
    pub fn add(&mut self, other: &Self) {
        self.operations += other.operations;
        self.estimated += other.estimated;
        self.refused += other.refused;
        self.compared += other.compared;
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            operations,
            estimated,
            refused,
            compared,
        } = self;
        write!(
            f,
            "{operations} operations: {estimated} estimates, {refused} refused, {compared} equal to a restored twin's"
        )
    }
}

/// What is done to both twins.
#[derive(Clone, Debug)]
enum Operation {
    Push(f64, Vec<f64>),
    Predict(f64),
    Update(Vec<f64>),
}

/// Every number that an estimator tells, by its bits.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    time: Option<u64>,
    numbers: Vec<u64>,
}

pub struct Session<'s> {
    subject: &'s Subject,
    other: &'s Subject,
    estimator: Estimator,
    twin: Option<Estimator>,
    snapshots: Vec<Vec<u8>>,
    tally: Tally,
}

impl<'s> Session<'s> {
    pub fn new(subject: &'s Subject, other: &'s Subject) -> Self {
        Self {
            subject,
            other,
            estimator: subject.estimator.clone(),
            twin: None,
            snapshots: vec![],
            tally: Tally::default(),
        }
    }

    /// So many operations; the first that is a finding ends them.
    pub fn run(mut self, count: u64, numbers: &mut Numbers) -> Result<Tally, String> {
        for _ in 0..count {
            self.tally.operations += 1;
            match numbers.unit() {
                x if x < 0.03 => self.save()?,
                x if x < 0.045 => self.go_back(numbers)?,
                x if x < 0.06 => self.offer_what_does_not_fit(numbers)?,
                _ => {
                    let operation = self.operation(numbers);
                    self.apply(&operation)?;
                }
            }
            // far in time every usual step is below its resolution
            let far = self
                .estimator
                .time()
                .is_some_and(|t| t.abs() > 1e6 * self.subject.step);
            if far {
                self.estimator = self.subject.estimator.clone();
                self.twin = None;
            }
        }
        Ok(self.tally)
    }

    fn operation(&self, numbers: &mut Numbers) -> Operation {
        let t = self.time(numbers);
        match numbers.unit() {
            x if x < 0.15 => Operation::Predict(t),
            x if x < 0.25 => Operation::Update(self.signals(numbers)),
            _ => Operation::Push(t, self.signals(numbers)),
        }
    }

    fn time(&self, numbers: &mut Numbers) -> f64 {
        let (now, step) = (self.estimator.time().unwrap_or(0.0), self.subject.step);
        let usual = if self.subject.is_adaptive {
            0.9995
        } else {
            0.93
        };
        if numbers.chance(usual) {
            return now + step * numbers.between(0.2, 1.5);
        }
        let odd = [
            now,
            now - step,
            now + 1e-12 * step,
            now + 1e3 * step,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            1e300,
            -1e300,
            f64::MAX,
        ];
        *numbers.of(&odd)
    }

    fn signals(&self, numbers: &mut Numbers) -> Vec<f64> {
        let usual = self.estimator.signals().len();
        let count = match numbers.chance(0.01) {
            true => numbers.below(usual + 3),
            false => usual,
        };
        let odd = [
            f64::NAN,
            f64::NAN,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            1e300,
            -1e300,
            f64::MAX,
            f64::MIN_POSITIVE,
            0.0,
            -0.0,
        ];
        let size = self.subject.size;
        let signal = |_| match numbers.chance(0.08) {
            true => *numbers.of(&odd),
            false => size * numbers.between(0.5, 1.1),
        };
        (0..count).map(signal).collect()
    }

    /// The operation on both twins.
    fn apply(&mut self, operation: &Operation) -> Result<(), String> {
        let before = told(&self.estimator);
        let result = done(&mut self.estimator, operation);
        let after = told(&self.estimator);
        let shown = || format!("{operation:?} gave {result:?}");
        match &result {
            Ok(()) => self.tally.estimated += 1,
            Err(_) => self.tally.refused += 1,
        }
        if result.is_err() && after != before {
            return Err(format!("{}, and the estimate changed", shown()));
        }
        let is_finite = |bits: &u64| f64::from_bits(*bits).is_finite();
        if !after.numbers.iter().all(is_finite) {
            return Err(format!("{}, and a number is not finite", shown()));
        }
        if let Some(twin) = &mut self.twin {
            let again = done(twin, operation);
            let same = format!("{again:?}") == format!("{result:?}") && told(twin) == after;
            if !same {
                return Err(format!(
                    "{}, and a restored twin {again:?} or another estimate",
                    shown()
                ));
            }
            self.tally.compared += 1;
        }
        Ok(())
    }

    /// A snapshot, from which a new twin is restored.
    fn save(&mut self) -> Result<(), String> {
        let snapshot = self.estimator.snapshot();
        let mut twin = self.subject.estimator.clone();
        twin.restore(&snapshot)
            .map_err(|e| format!("its own snapshot: {e}"))?;
        if told(&twin) != told(&self.estimator) || twin.snapshot() != snapshot {
            return Err("what was restored is another estimate".to_owned());
        }
        self.twin = Some(twin);
        self.snapshots.push(snapshot);
        Ok(())
    }

    /// To an earlier snapshot.
    fn go_back(&mut self, numbers: &mut Numbers) -> Result<(), String> {
        if self.snapshots.is_empty() {
            return Ok(());
        }
        let snapshot = numbers.of(&self.snapshots).clone();
        let restored = self.estimator.restore(&snapshot);
        restored.map_err(|e| format!("an earlier snapshot: {e}"))?;
        let mut twin = self.subject.estimator.clone();
        twin.restore(&snapshot).map_err(|e| e.to_string())?;
        self.twin = Some(twin);
        Ok(())
    }

    /// Damaged bytes and another observer's: refused, and nothing changes.
    fn offer_what_does_not_fit(&mut self, numbers: &mut Numbers) -> Result<(), String> {
        let before = told(&self.estimator);
        let mut bytes = match numbers.chance(0.3) {
            true => self.other.estimator.snapshot(),
            false => self.estimator.snapshot(),
        };
        let place = numbers.below(bytes.len());
        match numbers.chance(0.3) {
            true => bytes.truncate(place),
            false => bytes[place] ^= 1 << numbers.below(8),
        }
        self.tally.refused += 1;
        match self.estimator.restore(&bytes) {
            Err(Error::Snapshot { .. }) if told(&self.estimator) == before => Ok(()),
            found => Err(format!(
                "a damaged snapshot gave {found:?}, or changed something"
            )),
        }
    }
}

fn done(estimator: &mut Estimator, operation: &Operation) -> Result<(), Error> {
    match operation {
        Operation::Push(t, signals) => estimator.push(*t, signals),
        Operation::Predict(t) => estimator.predict(*t),
        Operation::Update(signals) => estimator.update(signals),
    }
    .map(drop)
}

fn told(estimator: &Estimator) -> Told {
    let deviations = estimator.deviations().unwrap_or_default();
    let numbers = estimator.estimate().iter().chain(deviations);
    Told {
        time: estimator.time().map(f64::to_bits),
        numbers: numbers.map(|x| x.to_bits()).collect(),
    }
}
