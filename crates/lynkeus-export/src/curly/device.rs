//! What an estimator for another machine is.

use lynkeus_run::{Blueprint, Level};

use super::function::Entry;

/// An estimator and what its text says of it.
#[derive(Clone, Copy, Debug)]
pub struct Device<'a> {
    /// its name in files and functions
    pub name: &'a str,
    /// the estimator
    pub blueprint: &'a Blueprint,
    /// states that start at the first reading of a sensor, where it reports at the first sample
    pub first_readings: &'a [FirstReading],
    /// measured outputs, then known inputs, in the order in which they are given
    pub signals: &'a [Entry],
    /// what is reported: estimates, their standard deviations where there are any, monitors
    pub estimates: &'a [Entry],
    /// how many of them are monitors
    pub monitors: usize,
    /// whether a filter's standard deviations are reported
    pub deviations: bool,
    /// numbers that may be changed while it runs: those of a sampled observer's
    /// [`tuned`](lynkeus_run::SampledObserver::tuned), in its order; of a filter none, or a factor on
    /// its process noise
    pub tunables: &'a [Tunable],
    /// of each measured output the noise that is declared, by which an observer that is no filter is
    /// judged; a filter has its own
    pub noises: &'a [Option<Level>],
    /// units and meanings of the model's names, where there are any
    pub words: &'a [Entry],
    /// lines for people: the study, the design, the certificate
    pub about: &'a [String],
}

/// A number that may be changed while the estimator runs. It is finite and above 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Tunable {
    /// what it is called, and what it does
    pub entry: Entry,
    /// its value until it is changed
    pub start: f64,
}

/// A state that starts where a sensor's first reading says: (reading − offset)/slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstReading {
    /// place of the sensor among the measured outputs
    pub sensor: usize,
    /// place of the state
    pub state: usize,
    /// how the output depends on the state
    pub slope: f64,
    /// the output where the state is 0
    pub offset: f64,
}

impl Device<'_> {
    /// Number of measured outputs.
    pub(super) fn sensors(&self) -> usize {
        match self.blueprint {
            Blueprint::Sampled { observer, .. } => observer.sensors.len(),
            Blueprint::Filter { model, .. } => model.sensors().len(),
        }
    }
}
