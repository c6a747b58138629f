//! A sample in the window.

use std::sync::Arc;

use crate::filter::sensing::Believed;
use crate::filter::spanned::Rows;
use crate::filter::stage::Stage;
use crate::snapshot::{Damaged, Walk};

#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub t: f64,
    pub inputs: Vec<f64>,
    pub readings: Vec<Believed>,
    /// the trajectory about which the problem is linearised
    pub guess: Vec<f64>,
    pub met: Vec<Met>,
    /// the way from the row before, about a guess from which the present one differs by no more than the
    /// last step: the next window begins with it
    pub stage: Option<Arc<Stage>>,
    /// Φ from the row before, which has left; where a smoother will ask for it
    pub entered: Option<Rows>,
}

/// A bound that is met.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Met {
    pub state: usize,
    pub bound: f64,
}

impl Row {
    /// Of so many inputs and states, for a walk over it.
    pub fn make_room(&mut self, inputs: usize, states: usize) {
        self.inputs.resize(inputs, 0.0);
        self.guess.resize(states, 0.0);
    }

    /// Of a plant with so many sensors.
    pub fn walk(&mut self, walk: &mut Walk<'_>, sensors: usize) -> Result<(), Damaged> {
        let states = self.guess.len();
        walk.number(&mut self.t)?;
        walk.numbers(&mut self.inputs)?;
        walk.numbers(&mut self.guess)?;
        let count = walk.length(self.readings.len())?;
        self.readings.resize(count, Believed::default());
        for believed in &mut self.readings {
            believed.walk(walk, sensors)?;
        }
        let count = walk.length(self.met.len())?;
        self.met.resize(count, Met::default());
        for met in &mut self.met {
            walk.below(&mut met.state, states)?;
            walk.number(&mut met.bound)?;
        }
        walk.optional(&mut self.stage, |walk, stage| {
            Arc::make_mut(stage).walk(walk, states)
        })?;
        walk.optional(&mut self.entered, |walk, entered| {
            entered.walk(walk, states)
        })
    }
}
