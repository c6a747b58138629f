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

use std::collections::VecDeque;

use super::extended::Extended;
use super::health::Reading;
use super::model::FilterModel;
use super::root::{Packed, Root, dot};
use super::sensing::Sensing;
use super::smooth::{Adjoint, Correction};
use super::spanned::Rows;
use super::{Belief, Bounds, confine};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings};

/// Most Gauss–Newton steps and changes of the bounds that are met, per sample.
const STEPS: usize = 8;
/// A step smaller than this, in standard deviations, is the last.
const SMALL: f64 = 1e-6;

#[derive(Clone, Debug)]
pub(super) struct Horizon {
    pub engine: Extended,
    length: usize,
    sensors: usize,
    bounds: Vec<Bounds>,
    /// what was known before the first row of the window
    prior: Belief,
    rows: VecDeque<Row>,
}

/// A sample in the window.
#[derive(Clone, Debug, Default)]
struct Row {
    t: f64,
    inputs: Vec<f64>,
    /// (sensor, reading, variance of its noise)
    readings: Vec<(usize, f64, f64)>,
    /// the trajectory about which the problem is linearised
    guess: Vec<f64>,
    /// (state, bound) that are met
    met: Vec<(usize, f64)>,
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
            row.inputs.resize(inputs, 0.0);
            row.guess.resize(states, 0.0);
            row.walk(walk, self.sensors)?;
        }
        Ok(())
    }
}

impl Row {
    fn walk(&mut self, walk: &mut Walk<'_>, sensors: usize) -> Result<(), Damaged> {
        walk.number(&mut self.t)?;
        walk.numbers(&mut self.inputs)?;
        walk.numbers(&mut self.guess)?;
        let count = walk.length(self.readings.len())?;
        self.readings.resize(count, (0, 0.0, 0.0));
        for (sensor, reading, variance) in &mut self.readings {
            walk.below(sensor, sensors)?;
            walk.number(reading)?;
            walk.number(variance)?;
        }
        let count = walk.length(self.met.len())?;
        self.met.resize(count, (0, 0.0));
        for (state, bound) in &mut self.met {
            walk.below(state, self.guess.len())?;
            walk.number(bound)?;
        }
        Ok(())
    }
}

/// A row given the whole window.
struct Smooth {
    x: Vec<f64>,
    /// how hard each bound that is met (its place among `met`) pushes its state upward
    forces: Vec<(usize, f64)>,
}

/// One row of a forward pass.
struct Pass {
    before: Belief,
    after: Belief,
    /// the root before the bounds
    by_readings: Root,
    /// Φ from the row before; none of the first
    transition: Option<Rows>,
    readings: Vec<Correction>,
    /// one per bound that is met, with its place among `met`
    bounds: Vec<(usize, Correction)>,
}

impl Horizon {
    pub fn new(
        model: &FilterModel,
        length: usize,
        bounds: Vec<Bounds>,
        run: EstimatorSettings,
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
        let taken = judged(sensing, belief, t, readings, inputs)?;
        self.rows.push_back(Row {
            t,
            inputs: inputs.to_vec(),
            readings: taken,
            guess: belief.x.clone(),
            met: vec![],
        });
        let passes = self.solve(sensing)?;
        if let Some(last) = passes.last() {
            belief.x.copy_from_slice(&last.after.x);
            belief.root = last.after.root.clone();
            // rounding may leave an estimate a last digit outside
            confine(&mut belief.x, &self.bounds);
        }
        if self.rows.len() > self.length {
            self.prior = self.shortened(passes)?;
            self.rows.pop_front();
        }
        // the flow goes on from the newest row
        self.engine.driven.start(inputs);
        Ok(())
    }

    /// What is known before the second row: the states as the window has them. A bound that was
    /// met there told where the state is, and not that it will never leave.
    fn shortened(&mut self, passes: Vec<Pass>) -> Result<Belief, Error> {
        let mut passes = passes.into_iter();
        let (Some(first), Some(second)) = (passes.next(), passes.next()) else {
            return Ok(self.prior.clone());
        };
        if self.rows[0].met.is_empty() {
            return Ok(second.before);
        }
        let free = Belief {
            x: first.after.x,
            root: first.by_readings,
        };
        let (from, to) = (&self.rows[0], &self.rows[1]);
        Ok(predicted(&mut self.engine, &free, from, to)?.0)
    }

    fn solve(&mut self, sensing: &mut Sensing) -> Result<Vec<Pass>, Error> {
        let mut passes = self.forward(sensing)?;
        for _ in 0..STEPS {
            let found = backward(&passes);
            let step = self.move_to(&found, &passes);
            let changed = self.change_bounds(&found);
            if !changed && step < SMALL {
                break;
            }
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
            row.met.retain(|&(state, bound)| {
                let force = forces.iter().find(|f| f.0 == place).map_or(0.0, |f| f.1);
                place += 1;
                let outward = if bound == bounds[state].low {
                    -force
                } else {
                    force
                };
                outward <= 0.0
            });
            changed |= row.met.len() != before;
            for (i, (x, bounds)) in x.iter().zip(bounds).enumerate() {
                let slack = 1e-9 * (bounds.high - bounds.low).min(x.abs().max(1e-3));
                let exceeded = match (*x < bounds.low - slack, *x > bounds.high + slack) {
                    (true, _) => bounds.low,
                    (_, true) => bounds.high,
                    _ => continue,
                };
                if !row.met.iter().any(|m| m.0 == i) {
                    row.met.push((i, exceeded));
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

/// Readings of a new sample that are believed.
fn judged(
    sensing: &mut Sensing,
    belief: &Belief,
    t: f64,
    readings: &[f64],
    inputs: &[f64],
) -> Result<Vec<(usize, f64, f64)>, Error> {
    let h = sensing.evaluate(t, &belief.x, inputs)?.to_vec();
    let mut projected = vec![0.0; belief.x.len()];
    let mut taken = vec![];
    for (i, reading) in readings.iter().enumerate() {
        belief
            .root
            .transposed_times(&sensing.slopes(i), &mut projected);
        let r = sensing.noise(i, h[i]);
        let variance = dot(&projected, &projected) + r;
        if sensing.judge(i, *reading, h[i], variance).reading == Reading::Taken {
            taken.push((i, *reading, r));
        }
    }
    Ok(taken)
}

/// x⁻ = φ(x̃) + Φ(x − x̃), P⁻ = ΦPΦᵀ + W, linearised at the guess x̃.
fn predicted(
    engine: &mut Extended,
    after: &Belief,
    from: &Row,
    to: &Row,
) -> Result<(Belief, Rows), Error> {
    let mut belief = Belief {
        x: from.guess.clone(),
        root: after.root.clone(),
    };
    if to.t <= from.t {
        // the same instant again
        return Ok((after.clone(), Rows::identity(belief.x.len())));
    }
    engine.driven.start(&from.inputs);
    engine.driven.aim(from.t, to.t, &to.inputs);
    let transition = engine.predict(&mut belief, from.t, to.t, true)?;
    let off: Vec<f64> = after
        .x
        .iter()
        .zip(&from.guess)
        .map(|(x, g)| x - g)
        .collect();
    for (x, (first, row)) in belief.x.iter_mut().zip(transition.iter()) {
        *x += dot(row, &off[first..]);
    }
    Ok((belief, transition))
}

fn corrected(
    sensing: &mut Sensing,
    row: &Row,
    before: Belief,
    transition: Option<Rows>,
) -> Result<Pass, Error> {
    let h = sensing.evaluate(row.t, &row.guess, &row.inputs)?.to_vec();
    let mut after = before.clone();
    let mut readings = vec![];
    for &(i, reading, r) in &row.readings {
        let c = sensing.slopes(i);
        // h linearised at the guess
        let offset = h[i] - dot(&c, &row.guess);
        readings.extend(take(&mut after, c, reading - offset, r));
    }
    let by_readings = after.root.clone();
    let mut bounds = vec![];
    for (place, &(state, bound)) in row.met.iter().enumerate() {
        let mut c = vec![0.0; after.x.len()];
        c[state] = 1.0;
        bounds.extend(take(&mut after, c, bound, 0.0).map(|b| (place, b)));
    }
    Ok(Pass {
        before,
        after,
        by_readings,
        transition,
        readings,
        bounds,
    })
}

/// Corrects by cᵀx = y with noise of variance r.
fn take(belief: &mut Belief, c: Vec<f64>, y: f64, r: f64) -> Option<Correction> {
    let mut projected = vec![0.0; c.len()];
    belief.root.transposed_times(&c, &mut projected);
    let variance = dot(&projected, &projected) + r;
    let innovation = y - dot(&c, &belief.x);
    let gain = belief.root.update(&projected, r)?;
    for (x, k) in belief.x.iter_mut().zip(&gain) {
        *x += k * innovation;
    }
    Some(Correction::single(c, innovation, variance, gain))
}

/// The window's rows given all of it.
fn backward(passes: &[Pass]) -> Vec<Smooth> {
    let n = passes.first().map_or(0, |p| p.after.x.len());
    let mut adjoint = Adjoint::nothing(n);
    let mut rows = vec![];
    for pass in passes.iter().rev() {
        let shift = Packed::of(&pass.after.root).covariance_times(&adjoint.vector);
        let x = pass.after.x.iter().zip(&shift).map(|(x, s)| x - s);
        let x = x.collect();
        let bounds = pass.bounds.iter().rev();
        let forces = bounds.map(|(place, b)| (*place, adjoint.over_vector(b).iter().sum()));
        let forces = forces.collect();
        rows.push(Smooth { x, forces });
        for reading in pass.readings.iter().rev() {
            adjoint.over_vector(reading);
        }
        if let Some(transition) = &pass.transition {
            adjoint.vector_through(transition);
        }
    }
    rows.reverse();
    rows
}
