//! What the kinds of observers have in common, and what tells one from another.

use std::fmt::Write;
use std::sync::OnceLock;

use crate::filter::{Filter, Health, Innovation};
use crate::flow::Flow;
use crate::intake::Sample;
use crate::sampled::Sampled;
use crate::snapshot::{Digest, Persist};
use crate::{Error, System};

/// What the kinds of observers differ in. Any of the steps may fail half-way: the estimator
/// then goes back to where it was.
pub(crate) trait Runner: Persist {
    /// The first sample, before its readings count.
    fn begin(&mut self, sample: &Sample<'_>) -> Result<(), Error>;

    /// From the sample before to the time of this one; only its inputs count.
    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<(), Error>;

    /// The readings and inputs of a sample at its time.
    fn update(&mut self, sample: &Sample<'_>) -> Result<(), Error>;

    /// Estimates and deviations at a time, all of them finite.
    fn report(&mut self, t: f64) -> Result<(), Error>;

    fn estimate(&self) -> &[f64];

    fn deviations(&self) -> Option<&[f64]> {
        None
    }

    fn innovations(&self) -> &[Innovation] {
        &[]
    }

    fn health(&self) -> &Health;
}

/// An observer of any kind.
#[derive(Clone, Debug)]
pub(crate) enum Core {
    Flow(Box<Flow>),
    Sampled(Box<Sampled>),
    Filter(Box<Filter>),
}

impl Core {
    pub fn runner(&self) -> &dyn Runner {
        match self {
            Self::Flow(flow) => &**flow,
            Self::Sampled(sampled) => &**sampled,
            Self::Filter(filter) => &**filter,
        }
    }

    pub fn runner_mut(&mut self) -> &mut dyn Runner {
        match self {
            Self::Flow(flow) => &mut **flow,
            Self::Sampled(sampled) => &mut **sampled,
            Self::Filter(filter) => &mut **filter,
        }
    }
}

/// What an estimator's numbers follow from, to tell one from another.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    systems: Vec<System>,
    settings: String,
    fingerprint: OnceLock<u64>,
}

impl Program {
    pub fn new(systems: Vec<System>, settings: String) -> Self {
        Self {
            systems,
            settings,
            fingerprint: OnceLock::new(),
        }
    }

    /// A number that differs for other programs; computed once.
    pub fn fingerprint(&self, signals: &[String]) -> u64 {
        *self.fingerprint.get_or_init(|| self.digest(signals))
    }

    fn digest(&self, signals: &[String]) -> u64 {
        let mut digest = Digest::default();
        // a digest takes any text
        let _ = write!(digest, "{signals:?} {}", self.settings);
        for system in &self.systems {
            system.tell(&mut digest);
        }
        digest.value()
    }
}
