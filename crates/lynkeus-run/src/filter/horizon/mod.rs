//! Moving-horizon estimation.
//!
//! At every sample the states over the last N samples are estimated anew: they minimise
//!
//! |x_j − x̄|²_{P̄⁻¹} + Σ |y_i − h(x_i)|²_{R⁻¹} + Σ |x_{i+1} − φ(x_i)|²_{W⁻¹}
//!
//! with min ≤ x_i ≤ max, φ the flow between samples and x̄, P̄ what the filter knew before the
//! window. Each Gauss–Newton step is the Kalman smoother of the problem linearised along the
//! present trajectory, so that its band structure is used and no noise need be invertible. A
//! bound that is met is an exact reading of that state; it is let go where it would pull inward.

mod pass;
mod row;

use std::collections::VecDeque;

use super::extended::Extended;
use super::model::FilterModel;
use super::root::Root;
use super::sensing::Sensing;
use super::smooth::Step;
use super::{Belief, Bounds, confine};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings};
use pass::{Pass, Smooth, backward, corrected, judged, predicted};
use row::{Met, Row};

/// Most Gauss–Newton steps and changes of the bounds that are met, per sample.
const STEPS: usize = 8;
/// A step smaller than this, in standard deviations, is the last.
const SMALL: f64 = 1e-6;
/// Below this a step that is no longer half of the one before is the integration's own error.
const NOISE: f64 = 1e-3;

#[derive(Clone, Debug)]
pub(super) struct Horizon {
    pub engine: Extended,
    length: usize,
    sensors: usize,
    bounds: Vec<Bounds>,
    /// what was known before the first row of the window
    prior: Belief,
    rows: VecDeque<Row>,
    /// what a smoother needs is kept
    keep: bool,
    /// what the last correction leaves for a smoother
    done: Done,
}

/// What a correction leaves for a smoother.
#[derive(Clone, Debug, Default)]
pub(super) struct Done {
    /// the states of the window, row after row
    pub window: Vec<f64>,
    /// the row that left
    pub left: Option<Step>,
}

impl Persist for Horizon {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.engine.walk(walk)?;
        self.prior.walk(walk)?;
        let states = self.bounds.len();
        let inputs = self.engine.driven.evaluation.signals().len();
        let count = walk.length(self.rows.len())?;
        self.rows.resize_with(count, Row::default);
        for row in &mut self.rows {
            // a row that was not there yet has no room
            row.make_room(inputs, states);
            row.walk(walk, self.sensors)?;
        }
        Ok(())
    }
}

impl Horizon {
    pub fn new(
        model: &FilterModel,
        length: usize,
        bounds: Vec<Bounds>,
        run: EstimatorSettings,
        keep: bool,
    ) -> Result<Self, Error> {
        if length == 0 {
            return Err(Error::setting("horizon", "at least 1 sample", 0));
        }
        if bounds.len() != model.dimension() {
            let expected = format!("{}, one pair per state", model.dimension());
            return Err(Error::setting("bounds", expected, bounds.len()));
        }
        Ok(Self {
            engine: Extended::new(&model.flow, &model.flow_entries, &model.process_noise, run)?,
            length,
            sensors: model.sensors.len(),
            bounds,
            prior: Belief {
                x: model.flow.start().to_vec(),
                root: Root::diagonal(&model.initial_variance),
            },
            rows: VecDeque::new(),
            keep,
            done: Done::default(),
        })
    }

    /// The new row's readings are judged by what the filter expects, then the window is solved.
    pub fn correct(
        &mut self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        t: f64,
        readings: &[f64],
        inputs: &[f64],
    ) -> Result<(), Error> {
        self.done = Done::default();
        let taken = judged(sensing, belief, t, readings, inputs)?;
        self.rows.push_back(Row {
            t,
            inputs: inputs.to_vec(),
            readings: taken,
            guess: belief.x.clone(),
            ..Row::default()
        });
        let passes = self.solve(sensing)?;
        if let Some(last) = passes.last() {
            belief.x.copy_from_slice(&last.after.x);
            belief.root = match self.meets_bounds() {
                true => self.free_root(sensing)?,
                false => last.after.root.clone(),
            };
            // rounding may leave an estimate a last digit outside
            confine(&mut belief.x, &self.bounds);
        }
        if self.keep {
            let guesses = self.rows.iter().flat_map(|row| &row.guess);
            self.done.window = guesses.copied().collect();
        }
        if self.rows.len() > self.length {
            self.shorten(passes)?;
        }
        // the flow goes on from the newest row
        self.engine.driven.start(inputs);
        Ok(())
    }

    /// What the last correction leaves for a smoother.
    pub fn take_done(&mut self) -> Done {
        std::mem::take(&mut self.done)
    }

    /// The rows of the window for a smoother; none where the problem has no value about them.
    pub fn steps(&self, sensing: &Sensing) -> Option<Vec<Step>> {
        let mut own = self.clone();
        let passes = own.forward(&mut sensing.clone()).ok()?;
        let mut steps: Vec<Step> = passes.into_iter().map(Pass::kept).collect();
        if let (Some(first), Some(row)) = (steps.first_mut(), self.rows.front()) {
            first.transition.clone_from(&row.entered);
        }
        Some(steps)
    }

    pub fn bounds(&self) -> &[Bounds] {
        &self.bounds
    }

    /// How many samples before the newest a window reaches.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The first row leaves. What is known before the second are the states as the window has
    /// them. A bound that was met there told where the state is, and not that it will never leave.
    fn shorten(&mut self, passes: Vec<Pass>) -> Result<(), Error> {
        let mut passes = passes.into_iter();
        let (Some(first), Some(second)) = (passes.next(), passes.next()) else {
            return Ok(());
        };
        let mut step = first.leaving();
        self.prior = match self.rows[0].met.is_empty() {
            true => second.before,
            false => {
                let free = Belief {
                    x: first.after.x,
                    root: first.by_readings,
                };
                let (from, to) = (&self.rows[0], &self.rows[1]);
                predicted(&mut self.engine, &free, from, to)?.0
            }
        };
        let left = self.rows.pop_front();
        if self.keep {
            step.transition = left.and_then(|row| row.entered);
            self.done.left = Some(step);
            self.rows[0].entered = second.transition;
        }
        Ok(())
    }

    fn meets_bounds(&self) -> bool {
        self.rows.iter().any(|row| !row.met.is_empty())
    }

    /// The root of the newest row's covariance by the readings alone. A bound that is met says
    /// where the estimate is, and not how sure it is: taken for an exact reading it would leave no
    /// variance, and a gate that keeps every later reading out.
    fn free_root(&mut self, sensing: &mut Sensing) -> Result<Root, Error> {
        let met: Vec<Vec<Met>> = self
            .rows
            .iter_mut()
            .map(|row| std::mem::take(&mut row.met))
            .collect();
        let passes = self.forward(sensing);
        for (row, met) in self.rows.iter_mut().zip(met) {
            row.met = met;
        }
        let newest = passes?.pop();
        Ok(newest.map_or_else(|| self.prior.root.clone(), |pass| pass.after.root))
    }

    fn solve(&mut self, sensing: &mut Sensing) -> Result<Vec<Pass>, Error> {
        let mut passes = self.forward(sensing)?;
        let mut before = f64::INFINITY;
        for _ in 0..STEPS {
            let found = backward(&passes);
            let step = self.move_to(&found, &passes);
            let changed = self.change_bounds(&found);
            let is_last = step < SMALL || (step < NOISE && step > 0.5 * before);
            if !changed && is_last {
                break;
            }
            before = step;
            passes = self.forward(sensing)?;
        }
        Ok(passes)
    }

    /// The smoothed states as the next guess; how far the guess moved, in deviations.
    fn move_to(&mut self, found: &[Smooth], passes: &[Pass]) -> f64 {
        let mut largest = 0.0_f64;
        for ((row, found), pass) in self.rows.iter_mut().zip(found).zip(passes) {
            for (i, (old, new)) in row.guess.iter_mut().zip(&found.x).enumerate() {
                let deviation = pass.before.root.deviation(i).max(f64::MIN_POSITIVE);
                largest = largest.max((*new - *old).abs() / deviation);
                *old = new.max(self.bounds[i].low).min(self.bounds[i].high);
            }
        }
        largest
    }

    /// Bounds that are exceeded are met from now on; those that pull inward are let go.
    fn change_bounds(&mut self, found: &[Smooth]) -> bool {
        let mut changed = false;
        for (row, Smooth { x, forces }) in self.rows.iter_mut().zip(found) {
            let before = row.met.len();
            let bounds = &self.bounds;
            let mut place = 0;
            row.met.retain(|&Met { state, bound }| {
                let force = forces.iter().find(|f| f.place == place);
                let force = force.map_or(0.0, |f| f.push);
                place += 1;
                let Bounds { low, high } = bounds[state];
                let outward = if bound == low { -force } else { force };
                // a single value pushes either way
                low == high || outward <= 0.0
            });
            changed |= row.met.len() != before;
            for (i, (x, bounds)) in x.iter().zip(bounds).enumerate() {
                let slack = 1e-9 * (bounds.high - bounds.low).min(x.abs().max(1e-3));
                let exceeded = match (*x < bounds.low - slack, *x > bounds.high + slack) {
                    (true, _) => bounds.low,
                    (_, true) => bounds.high,
                    _ => continue,
                };
                if !row.met.iter().any(|m| m.state == i) {
                    row.met.push(Met {
                        state: i,
                        bound: exceeded,
                    });
                    changed = true;
                }
            }
        }
        changed
    }

    /// The Kalman filter of the problem linearised about the guesses.
    fn forward(&mut self, sensing: &mut Sensing) -> Result<Vec<Pass>, Error> {
        let mut passes: Vec<Pass> = vec![];
        for k in 0..self.rows.len() {
            let (before, transition) = match passes.last() {
                None => (self.prior.clone(), None),
                Some(last) => {
                    let (from, to) = (&self.rows[k - 1], &self.rows[k]);
                    let (before, transition) = predicted(&mut self.engine, &last.after, from, to)?;
                    (before, Some(transition))
                }
            };
            passes.push(corrected(sensing, &self.rows[k], before, transition)?);
        }
        Ok(passes)
    }
}

#[cfg(test)]
mod tests;
