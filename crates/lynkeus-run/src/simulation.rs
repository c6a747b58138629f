//! What is simulated: a plant, its inputs and its observer.

use crate::{Manifold, Method, Noise, System};

/// A plant under known inputs and, if wished, an observer of its measured
/// outputs.
///
/// The plant and the observer are integrated as one system. The observer's
/// signals are found by name among the outputs of the plant (as measured, noise
/// included) and the inputs. The integration stops at every output point, at every
/// noise sample, and at every instant where an expression of time jumps.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// what is simulated; its signals are inputs
    pub plant: System,
    /// the inputs: a system without states or signals whose outputs are functions
    /// of time, named as the plant's signals
    pub inputs: System,
    /// what estimates the plant's state, if anything does
    pub observer: Option<System>,
    /// first time
    pub start: f64,
    /// last time
    pub until: f64,
    /// time between two rows; the last row is at `until` in any case
    pub output_step: f64,
    /// how it is integrated
    pub method: Method,
    /// noise on the plant's outputs and states
    pub noise: Noise,
    /// also record the plant's outputs, exact and as measured
    pub record_outputs: bool,
    /// where the plant's states live
    pub manifold: Manifold,
}

impl Simulation {
    /// From t = 0 to `until`, exact measurements, default method, no observer.
    pub fn new(plant: System, inputs: System, until: f64, output_step: f64) -> Self {
        Self {
            plant,
            inputs,
            observer: None,
            start: 0.0,
            until,
            output_step,
            method: Method::default(),
            noise: Noise::default(),
            record_outputs: false,
            manifold: Manifold::default(),
        }
    }
}
