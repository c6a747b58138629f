//! How an observer goes from sample to sample.

use crate::{Method, Step};

/// What a signal is between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BetweenSamples {
    /// the value of the last sample: causal, late by half a sample on average
    #[default]
    Hold,
    /// the straight line between the samples. The estimate at a sample's time uses
    /// no later sample, but the path towards it is integrated with the sample at
    /// its end, so an estimate between samples would look ahead by one sample.
    Linear,
}

/// How an [`Estimator`](crate::Estimator) goes from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorSettings {
    /// the signals between samples
    pub between: BetweenSamples,
    /// how the observer is integrated; adaptive methods start anew at each sample
    pub method: Method,
}

impl Default for EstimatorSettings {
    /// Held signals and Runge–Kutta steps that are small enough for the observer.
    fn default() -> Self {
        Self {
            between: BetweenSamples::default(),
            method: Method::Rk4(Step::Auto),
        }
    }
}
