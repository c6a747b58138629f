//! Signals between two samples.

use std::sync::Arc;

use crate::events::Guards;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{BetweenSamples, Dynamics, Error, Evaluation, Events, Slopes, System};

/// A system with its signals between two samples.
#[derive(Clone, Debug)]
pub(crate) struct Driven {
    pub(crate) evaluation: Evaluation,
    between: BetweenSamples,
    from: f64,
    to: f64,
    last: Vec<f64>,
    next: Vec<f64>,
}

impl Driven {
    pub(crate) fn new(system: &System, between: BetweenSamples) -> Self {
        let count = system.signals().len();
        Self {
            evaluation: system.evaluation(),
            between,
            from: 0.0,
            to: 1.0,
            last: vec![0.0; count],
            next: vec![0.0; count],
        }
    }

    /// The first sample.
    pub(crate) fn start(&mut self, signals: &[f64]) {
        self.next.copy_from_slice(signals);
        self.arrive();
    }

    /// The sample at the end of the interval to come, of the first signals; others stay.
    pub(crate) fn aim(&mut self, from: f64, to: f64, signals: &[f64]) {
        (self.from, self.to) = (from, to);
        self.next.copy_from_slice(&self.last);
        self.next[..signals.len()].copy_from_slice(signals);
    }

    /// The signals at t.
    fn read_signals(&mut self, t: f64) {
        if self.between == BetweenSamples::Linear {
            let s = (t - self.from) / (self.to - self.from);
            let ends = self.last.iter().zip(&self.next);
            for (signal, (last, next)) in self.evaluation.signals_mut().iter_mut().zip(ends) {
                *signal = last + s * (next - last);
            }
        }
    }

    /// Writes the derivatives of the outputs by the states at (t, x), where they are known.
    pub(crate) fn output_slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.read_signals(t);
        self.evaluation.output_slopes(t, x, slopes)
    }

    /// The interval is over: its last sample is the present one.
    pub(crate) fn arrive(&mut self) {
        self.last.copy_from_slice(&self.next);
        self.evaluation.signals_mut().copy_from_slice(&self.last);
    }
}

impl Persist for Driven {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.evaluation.walk(walk)?;
        walk.numbers(&mut self.last)?;
        walk.numbers(&mut self.next)
    }
}

impl Dynamics for Driven {
    fn dimension(&self) -> usize {
        self.evaluation.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.read_signals(t);
        self.evaluation.derivatives(t, x, dx);
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.read_signals(t);
        self.evaluation.slopes(t, x, slopes)
    }

    fn step(&mut self, t: f64, h: f64, x: &[f64], next: &mut [f64]) -> bool {
        self.between == BetweenSamples::Hold && self.evaluation.step(t, h, x, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn names(&self) -> Vec<String> {
        self.evaluation.names()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.evaluation.not_finite(t, x)
    }
}

impl Events for Driven {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.evaluation.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.evaluation.enter(t);
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.evaluation.guards()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.read_signals(t);
        self.evaluation.indicators(t, x, values);
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        self.evaluation.hold(sides);
    }

    fn beside(&mut self, t: f64, values: &mut Vec<[f64; 2]>) {
        self.read_signals(t);
        self.evaluation.beside(t, values);
        if self.between == BetweenSamples::Linear {
            let ends = self.last.iter().zip(&self.next);
            for ([_, speed], (last, next)) in values.iter_mut().zip(ends) {
                *speed = (next - last) / (self.to - self.from);
            }
        }
    }
}
