//! Moving-horizon estimation.
//!
//! At every sample the states over the last N samples are estimated anew: they minimise
//!
//! |x_j − x̄|²_{P̄⁻¹} + Σ |y_i − h(x_i)|²_{R⁻¹} + Σ |x_{i+1} − φ(x_i)|²_{W⁻¹}
//!
//! with min ≤ x_i ≤ max, φ the flow between samples and x̄, P̄ what the filter knew before the
//! window. Each Gauss–Newton step is the minimum of the problem linearised along the present
//! trajectory ([`quadratic`]), found by Kalman smoothers, so that its band structure is used and no
//! noise need be invertible. Steps that do not shrink are shortened (P. Deuflhard, *Newton Methods
//! for Nonlinear Problems*, 2004, 4.3: the natural monotonicity test).

mod quadratic;

use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::Arc;

use super::belief::{Belief, confine};
use super::censored::Believed;
use super::model::NoisyModel;
use super::profile::Profile;
use super::root::{Root, dot};
use super::sensing::Sensing;
use super::smoother::{History, Step};
use super::transition::{Propagation, Stage};
use crate::manifold::Manifold;
use crate::noise::Limits;
use crate::runner::Sample;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, Result};
use quadratic::{Linear, Pass, Pin, Problem, Seen, Solution, carried, corrected};

/// Most Gauss–Newton steps per sample,
const STEPS: usize = 40;
/// and the shortest share of one that is tried.
const SHORTEST: f64 = 1.0 / 64.0;
/// A step smaller than this, in standard deviations, is the last.
const SMALL: f64 = 1e-6;
/// A rotation of so many radians is none.
const LEAST_TURN: f64 = 1e-9;
/// Below this a step that is no longer half of the one before is the integration's own error.
const NOISE: f64 = 1e-3;

#[derive(Clone, Debug)]
pub(crate) struct Mhe {
    length: usize,
    inputs: usize,
    sensors: usize,
    bounds: Vec<Limits>,
    manifold: Manifold,
    /// what was known before the first row of the window,
    prior: Belief,
    /// and where it was linearised
    about: Vec<f64>,
    rows: VecDeque<Row>,
    /// what a smoother needs is kept
    keep: bool,
    /// the states of the last window, row after row, for a smoother
    window: Vec<f64>,
    /// the row that left it
    left: Option<Step>,
}

impl Persist for Mhe {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.prior.walk(walk)?;
        walk.numbers(&mut self.about)?;
        let states = self.bounds.len();
        let count = walk.length(self.rows.len())?;
        self.rows.resize_with(count, Row::default);
        for row in &mut self.rows {
            row.walk(walk, [self.inputs, states, self.sensors])?;
        }
        Ok(())
    }
}

impl Mhe {
    pub fn new(model: &NoisyModel, length: usize, keep: bool) -> Result<Self> {
        if length == 0 {
            return Err(Error::setting("horizon", "at least 1 sample", 0));
        }
        let flow = model.flow.system();
        let prior = Belief::on(&model.manifold, flow.start(), &model.initial_variance);
        let mut bounds = model.ranges.clone();
        // a sum that stands for a rotation may be longer than 1
        for place in &model.manifold.rotations {
            if let Some(own) = bounds.get_mut(*place..place + 4) {
                own.fill(Limits {
                    low: f64::NEG_INFINITY,
                    high: f64::INFINITY,
                });
            }
        }
        Ok(Self {
            length,
            inputs: flow.signals().len(),
            sensors: model.sensors.len(),
            bounds,
            manifold: model.manifold.clone(),
            about: prior.x.clone(),
            prior,
            rows: VecDeque::new(),
            keep,
            window: vec![],
            left: None,
        })
    }

    /// The window begins at a sample without readings, before which this was believed.
    pub fn begin(&mut self, sample: &Sample<'_>, belief: &Belief) {
        self.prior = belief.clone();
        self.about.clone_from(&belief.x);
        let mut guess = belief.x.clone();
        confine(&mut guess, &self.bounds);
        self.rows.clear();
        self.rows.push_back(Row {
            t: sample.t,
            inputs: sample.inputs.to_vec(),
            guess,
            ..Row::default()
        });
    }

    /// Leaves to a smoother what the last correction has.
    pub fn leave(&mut self, history: &mut History) {
        history.windows.push(std::mem::take(&mut self.window));
        history.steps.extend(self.left.take());
    }

    /// The rows of the window for a smoother; none where the problem has no value about them.
    pub fn steps(&self, propagation: &Propagation, sensing: &Sensing) -> Option<Vec<Step>> {
        let problem = self.linearise(&mut propagation.clone(), &mut sensing.clone());
        let problem = problem.ok()?;
        let pins: Vec<Vec<Pin>> = self.rows.iter().map(|row| row.met.clone()).collect();
        let passes = problem.forward(&pins).into_iter().zip(&self.rows);
        let steps = passes.map(|(pass, row)| pass.kept(self.touched(&row.guess)));
        let mut steps: Vec<Step> = steps.collect();
        if let (Some(first), Some(row)) = (steps.first_mut(), self.rows.front()) {
            first.transition = self.retold(row.entered.clone(), &self.about, &row.guess);
        }
        Some(steps)
    }

    /// Φ to a row that was told about one guess, told about another.
    fn retold(&self, entered: Option<Profile>, from: &[f64], to: &[f64]) -> Option<Profile> {
        let mut entered = entered?;
        if !self.manifold.is_straight() {
            let entries = entered.entries_mut();
            self.manifold.recharted(from, to, entries, to.len());
        }
        Some(entered)
    }

    /// Where the planes touch in which something is told, where there are planes.
    fn touched(&self, guess: &[f64]) -> Option<Vec<f64>> {
        (!self.manifold.is_straight()).then(|| guess.to_vec())
    }

    /// How many samples before the newest a window reaches.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The first row leaves. What is known before the second are the states as the window has
    /// them. A bound that was met there told where the state is, and not that it will never leave.
    fn shorten(&mut self, solved: GaussNewtonStep) {
        let passes = solved.solution.passes.unwrap_or(solved.free);
        let (mut passes, mut rows) = (passes.into_iter(), solved.rows.into_iter().skip(1));
        let mut from = solved.from.into_iter();
        let (Some(first), Some(second), Some(linear)) = (passes.next(), passes.next(), rows.next())
        else {
            return;
        };
        let (Some(about), Some(next)) = (from.next(), from.next()) else {
            return;
        };
        let mut step = first.leaving(self.touched(&about));
        let met = !self.rows[0].met.is_empty();
        let free = Pass {
            after: first.unpinned(),
            ..first
        };
        self.prior = match met {
            false => second.before,
            true => carried(linear.stage.as_ref(), &self.prior, Some(&free)).0,
        };
        let before = std::mem::replace(&mut self.about, next);
        let left = self.rows.pop_front();
        if let Some(first) = self.rows.front_mut() {
            first.stage = None;
        }
        if self.keep {
            let entered = left.and_then(|row| row.entered);
            step.transition = self.retold(entered, &before, &about);
            self.left = Some(step);
            self.rows[0].entered = second.transition.map(Arc::unwrap_or_clone);
        }
    }

    /// Gauss–Newton steps from the guesses to the minimum.
    fn solve(
        &mut self,
        propagation: &mut Propagation,
        sensing: &mut Sensing,
    ) -> Result<GaussNewtonStep> {
        let mut share = 1.0;
        let mut best: Option<GaussNewtonStep> = None;
        for _ in 0..STEPS {
            let tried = match (self.tried(propagation, sensing), &best) {
                // the plant has no value along a step that was too long
                (Err(_), Some(_)) => None,
                (tried, _) => Some(tried?),
            };
            let before = best.as_ref().map_or(f64::INFINITY, |best| best.step);
            match tried {
                Some(tried) if tried.is_last(before) => return Ok(self.settle(tried, true)),
                Some(tried) if tried.step <= (1.0 - 0.25 * share) * before => {
                    share = (2.0 * share).min(1.0);
                    best = Some(tried);
                }
                _ => share *= 0.5,
            }
            let Some(from) = &best else { break };
            match (share < SHORTEST, self.manifold.is_straight()) {
                (false, _) => self.go(from, share),
                (true, true) => break,
                // Steps are as the sine of the angle that is left: beyond a quarter of a turn they grow on the way.
                (true, false) => {
                    self.go(from, 1.0);
                    (best, share) = (None, 1.0);
                }
            }
        }
        match best {
            Some(best) => Ok(self.settle(best, false)),
            None => {
                let tried = self.tried(propagation, sensing)?;
                Ok(self.settle(tried, false))
            }
        }
    }

    /// One step from the guesses.
    fn tried(
        &self,
        propagation: &mut Propagation,
        sensing: &mut Sensing,
    ) -> Result<GaussNewtonStep> {
        let met = self.rows.iter().map(|row| row.met.clone()).collect();
        let problem = self.linearise(propagation, sensing)?;
        let solution = problem.solve(met);
        let Problem { rows, free, .. } = problem;
        let steps = self.rows.iter().zip(&solution.x).zip(&free);
        let steps = steps.map(|((row, x), pass)| self.largest(&row.guess, x, &pass.before.root));
        let step = steps.fold(0.0, f64::max);
        Ok(GaussNewtonStep {
            from: self.rows.iter().map(|row| row.guess.clone()).collect(),
            step,
            solution,
            rows,
            free,
        })
    }

    /// The largest step of a state of a row, in deviations; of a quaternion those about the body's axes.
    fn largest(&self, guess: &[f64], x: &[f64], root: &Root) -> f64 {
        let n = guess.len();
        let mut step: Vec<f64> = x.iter().zip(guess).map(|(new, old)| new - old).collect();
        let mut root = Cow::Borrowed(root);
        let mut least = vec![f64::MIN_POSITIVE; n];
        if !self.manifold.is_straight() {
            self.manifold.as_vectors(guess, &mut step, 1);
            let own = root.to_mut();
            self.manifold.as_vectors(guess, &mut own.entries, n);
            for place in &self.manifold.rotations {
                least[*place..place + 4].fill(LEAST_TURN);
            }
        }
        let steps = step.iter().zip(least).enumerate();
        let steps = steps.map(|(i, (step, least))| step.abs() / root.deviation(i).max(least));
        steps.fold(0.0, f64::max)
    }

    /// A share of a step from where it was tried.
    fn go(&mut self, tried: &GaussNewtonStep, share: f64) {
        let all = self.rows.iter_mut().zip(&tried.from);
        for ((row, from), (x, met)) in all.zip(tried.solution.x.iter().zip(&tried.solution.met)) {
            for (guess, (from, to)) in row.guess.iter_mut().zip(from.iter().zip(x)) {
                // all of it without rounding
                *guess = match share < 1.0 {
                    true => from + share * (to - from),
                    false => *to,
                };
            }
            self.manifold.retract(from, &mut row.guess);
            confine(&mut row.guess, &self.bounds);
            row.met.clone_from(met);
            row.stage = None;
        }
    }

    /// To the end of the last step.
    fn settle(&mut self, mut last: GaussNewtonStep, converged: bool) -> GaussNewtonStep {
        self.go(&last, 1.0);
        if converged {
            for (row, linear) in self.rows.iter_mut().zip(&last.rows) {
                row.stage.clone_from(&linear.stage);
            }
        }
        last.solution.is_least &= converged;
        last
    }

    /// The problem about the guesses, and the Kalman filter of it without bounds.
    fn linearise(
        &self,
        propagation: &mut Propagation,
        sensing: &mut Sensing,
    ) -> Result<Problem<'_>> {
        let count = self.rows.len();
        let prior = self.prior_of_window();
        let mut rows: Vec<Linear> = Vec::with_capacity(count);
        let mut free: Vec<Pass> = Vec::with_capacity(count);
        for (k, row) in self.rows.iter().enumerate() {
            let stage = match (k.checked_sub(1).map(|k| &self.rows[k]), free.last()) {
                (Some(from), Some(last)) => self.way(propagation, from, row, last)?,
                _ => None,
            };
            let before = carried(stage.as_ref(), &prior, free.last());
            let seen = seen(sensing, row)?;
            free.push(corrected(&seen, None, &[], before));
            rows.push(Linear { stage, seen });
        }
        Ok(Problem {
            prior,
            bounds: &self.bounds,
            rows,
            free,
        })
    }

    /// The way from one row to the next; none where they are of one instant and told alike.
    fn way(
        &self,
        propagation: &mut Propagation,
        from: &Row,
        to: &Row,
        last: &Pass,
    ) -> Result<Option<Arc<Stage>>> {
        let is_straight = self.manifold.is_straight();
        let stage = match (&to.stage, to.t > from.t) {
            (Some(stage), true) => return Ok(Some(Arc::clone(stage))),
            (None, true) => between(propagation, from, to, last)?,
            (_, false) if is_straight => return Ok(None),
            (_, false) => Stage::none(&from.guess),
        };
        Ok(Some(Arc::new(match is_straight {
            true => stage,
            false => stage.told_at(&self.manifold, &to.guess),
        })))
    }

    /// What was known before the window, told about the first row's guess.
    fn prior_of_window(&self) -> Cow<'_, Belief> {
        let (manifold, about) = (&self.manifold, &self.about);
        let mut prior = Cow::Borrowed(&self.prior);
        if let (false, Some(row)) = (manifold.is_straight(), self.rows.front()) {
            let Belief { x, root } = prior.to_mut();
            let n = x.len();
            manifold.recentred(about, &row.guess, x);
            manifold.recharted(about, &row.guess, &mut root.entries, n);
            root.restore();
        }
        prior
    }

    /// The new row's readings are judged by what the filter expects, then the window is solved.
    pub fn correct(
        &mut self,
        propagation: &mut Propagation,
        sensing: &mut Sensing,
        belief: &mut Belief,
        sample: &Sample<'_>,
    ) -> Result<()> {
        (self.window, self.left) = (vec![], None);
        let mut taken = vec![];
        sensing.judge_all(belief, sample, &mut taken)?;
        if let Some(record) = &mut sensing.record {
            let (inside, at_ends): (Vec<_>, Vec<_>) = taken.iter().partition(|b| b.end.is_none());
            record.count(&inside);
            for believed in &at_ends {
                let spread = record.variance(believed.sensor) - believed.variance;
                record.count_at_end(believed, 0.0, spread);
            }
        }
        let mut guess = belief.x.clone();
        confine(&mut guess, &self.bounds);
        self.rows.push_back(Row {
            t: sample.t,
            inputs: sample.inputs.to_vec(),
            readings: taken,
            guess,
            ..Row::default()
        });
        let solved = self.solve(propagation, sensing)?;
        sensing.health.unsolved += usize::from(!solved.solution.is_least);
        if let Some(newest) = self.rows.back() {
            belief.x.copy_from_slice(&newest.guess);
        }
        // A bound that is met says where the estimate is, and not how sure it is: taken for an exact
        // reading it would leave no variance, and a gate that keeps every later reading out.
        let newest = solved.free.last().map(|pass| &pass.after.root);
        belief.root.clone_from(newest.unwrap_or(&self.prior.root));
        if let (false, Some(from)) = (self.manifold.is_straight(), solved.from.last()) {
            let (n, entries) = (belief.x.len(), &mut belief.root.entries);
            self.manifold.recharted(from, &belief.x, entries, n);
            belief.root.restore();
        }
        if self.keep {
            let guesses = self.rows.iter().flat_map(|row| &row.guess);
            self.window = guesses.copied().collect();
        }
        if self.rows.len() > self.length {
            self.shorten(solved);
        }
        // the flow goes on from the newest row
        propagation.driven.start(sample.inputs);
        Ok(())
    }
}

/// The way between two rows, about the guess at the first.
fn between(propagation: &mut Propagation, from: &Row, to: &Row, last: &Pass) -> Result<Stage> {
    propagation.driven.start(&from.inputs);
    propagation.driven.aim(from.t, to.t, &to.inputs);
    let about = Belief {
        x: from.guess.clone(),
        root: last.after.root.clone(),
    };
    propagation.stage(about, from.t, to.t)
}

/// A Gauss–Newton step.
struct GaussNewtonStep {
    from: Vec<Vec<f64>>,
    /// its length, in deviations
    step: f64,
    solution: Solution,
    rows: Vec<Linear>,
    free: Vec<Pass>,
}

impl GaussNewtonStep {
    /// Whether it is no more than the integration's own error.
    fn is_last(&self, before: f64) -> bool {
        self.step < SMALL || (self.step < NOISE && self.step > 0.5 * before)
    }
}

/// A sample in the window.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    pub t: f64,
    pub inputs: Vec<f64>,
    pub readings: Vec<Believed>,
    /// the trajectory about which the problem is linearised
    pub guess: Vec<f64>,
    /// bounds that are met
    pub met: Vec<Pin>,
    /// the way from the row before, about a guess from which the present one differs by no more than the
    /// last step: the next window begins with it
    pub stage: Option<Arc<Stage>>,
    /// Φ from the row before, which has left; where a smoother will ask for it
    pub entered: Option<Profile>,
}

impl Row {
    /// Of a plant with so many inputs, states and sensors.
    pub fn walk(
        &mut self,
        walk: &mut Walk<'_>,
        [inputs, states, sensors]: [usize; 3],
    ) -> Result<(), Damaged> {
        // a row that was not there yet has no room
        self.inputs.resize(inputs, 0.0);
        self.guess.resize(states, 0.0);
        walk.number(&mut self.t)?;
        walk.numbers(&mut self.inputs)?;
        walk.numbers(&mut self.guess)?;
        let count = walk.length(self.readings.len())?;
        self.readings.resize(count, Believed::default());
        for believed in &mut self.readings {
            believed.walk(walk, sensors)?;
        }
        let count = walk.length(self.met.len())?;
        self.met.resize(count, Pin::default());
        for met in &mut self.met {
            walk.below(&mut met.state, states)?;
            walk.number(&mut met.value)?;
        }
        walk.optional(&mut self.stage, |walk, stage| {
            Arc::make_mut(stage).walk(walk, states)
        })?;
        walk.optional(&mut self.entered, |walk, entered| {
            entered.walk(walk, states)
        })
    }
}

/// The readings of a row, h linearised at its guess.
pub(crate) fn seen(sensing: &mut Sensing, row: &Row) -> Result<Vec<Seen>> {
    let map = &mut sensing.output_map;
    let h = map.linearise(row.t, &row.guess, &row.inputs)?.to_vec();
    // an angle or a quaternion that is read may be a turn, or a sign, off the guess by now
    let mut all = vec![f64::NAN; h.len()];
    for believed in &row.readings {
        all[believed.sensor] = believed.reading;
    }
    let signed = sensing.manifold.signed(&all, &h);
    let seen = |believed: &Believed| {
        let mut slopes = vec![0.0; row.guess.len()];
        map.write_slopes(believed.sensor, &mut slopes);
        let offset = h[believed.sensor] - dot(&slopes, &row.guess);
        let predicted = h[believed.sensor];
        let mut own = *believed;
        own.reading = (sensing.manifold).lifted(own.sensor, signed[own.sensor], predicted);
        let (value, variance) = own.about(predicted)?;
        Some(Seen {
            value: value - offset,
            variance,
            slopes,
        })
    };
    Ok(row.readings.iter().filter_map(seen).collect())
}

#[cfg(test)]
mod tests;
