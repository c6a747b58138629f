//! The search for a start, inputs, disturbances and noise that break a certificate.

use super::case::{Case, Noise, Role};
use super::claims::Claim;
use super::integrate::{Flow, Limits, follow};
use super::pair::Pair;
use super::run::Run;
use super::signals::{self, Signal};
use crate::numbers::Numbers;

/// Everything that the adversary chooses.
#[derive(Clone, Debug)]
pub struct Plan {
    pub start: f64,
    /// places in the box, from 0 to 1
    pub plant: Vec<f64>,
    pub estimate: Vec<f64>,
    pub inputs: Vec<Signal>,
    pub noise: Vec<Signal>,
    /// disturbances, noise and slews at rest
    pub quiet: bool,
    /// from sample to sample, in the longest intervals that are claimed; over again at their end
    pub gaps: Vec<f64>,
}

/// The worst that was seen of one plan.
#[derive(Clone, Debug, Default)]
pub struct Worst {
    /// found over allowed
    pub ratio: f64,
    pub what: String,
    /// whether a time constant of a claim was followed inside the box
    pub long: bool,
}

pub struct Attack<'a> {
    pub case: &'a Case,
    pub pair: &'a mut Pair,
    pub claims: &'a [Claim],
    /// the box of what is estimated, in its order
    pub sides: Vec<[f64; 2]>,
    /// observer states beside the estimate that have to stay in a box, too
    pub guards: Vec<(usize, [f64; 2])>,
    /// the longest interval between samples of an observer whose last states follow the measurements
    pub samples: Option<f64>,
}

/// Samples of a run at most, and different gaps between them.
const SAMPLES: usize = 300;
const GAPS: usize = 12;

impl Attack<'_> {
    /// The worst plan of a search of about `runs` simulations, seen again at a
    /// tighter tolerance.
    pub fn search(&mut self, numbers: &mut Numbers, runs: usize) -> (Plan, Worst) {
        let mut best: Option<(Plan, Worst)> = None;
        let mut long = false;
        for run in 0..runs {
            let plan = match &best {
                Some((plan, _)) if run > runs / 3 => self.changed(numbers, plan, run),
                _ => self.plan(numbers),
            };
            let worst = self.run(&plan, 1e-8, 400);
            long |= worst.long;
            let better = best.as_ref().is_none_or(|(_, b)| worst.ratio > b.ratio);
            if better {
                best = Some((plan, worst));
            }
            if best.as_ref().is_some_and(|(_, b)| b.ratio > 1.05) {
                break;
            }
        }
        let (plan, mut worst) = best.unwrap_or_else(|| (self.plan(numbers), Worst::default()));
        if worst.ratio > 1.0 {
            worst = self.run(&plan, 1e-11, 40_000);
        }
        worst.long |= long;
        (plan, worst)
    }

    fn place(&self, numbers: &mut Numbers, count: usize) -> Vec<f64> {
        let manner = numbers.below(4);
        let depth = numbers.unit();
        let one = |_| match manner {
            0 => f64::from(u8::from(numbers.chance(0.5))),
            1 => numbers.unit(),
            _ => 0.5 + depth * (numbers.unit() - 0.5),
        };
        (0..count).map(one).collect()
    }

    fn plan(&self, numbers: &mut Numbers) -> Plan {
        let n = self.pair.estimates();
        // what is claimed of samples is so of a plant that nothing else acts on
        let quiet = self.samples.is_some() || numbers.chance(0.3);
        let plant = self.place(numbers, n);
        let estimate = match numbers.chance(0.3) {
            true => {
                let near = numbers.size(1e-4, 0.3);
                let moved = plant
                    .iter()
                    .map(|x| (x + near * numbers.normal()).clamp(0.0, 1.0));
                moved.collect()
            }
            false => self.place(numbers, n),
        };
        let mut plan = Plan {
            start: numbers.between(-10.0, 10.0),
            plant,
            estimate,
            inputs: vec![],
            noise: vec![],
            quiet,
            gaps: gaps(numbers),
        };
        plan.inputs = self.signals(numbers, quiet);
        plan.noise = self.errors(numbers, quiet);
        plan
    }

    /// Everything that acts, from a start in the inner half of the box.
    pub fn noisy(&self, numbers: &mut Numbers) -> Plan {
        let mut plan = self.plan(numbers);
        plan.quiet = false;
        plan.plant.iter_mut().for_each(|x| *x = 0.25 + 0.5 * *x);
        plan.inputs = self.signals(numbers, false);
        plan.noise = self.errors(numbers, false);
        plan
    }

    /// The standard deviation of each reading's noise, 0 where it is not Gaussian.
    pub fn gaussian(&self) -> Vec<f64> {
        let of = |noise: &Noise| if noise.is_uniform { 0.0 } else { noise.size };
        self.case.noise.iter().map(of).collect()
    }

    /// Near the middle of the box, with a small error and nothing that acts.
    pub fn rest(&self, numbers: &mut Numbers, error: f64) -> Plan {
        let n = self.pair.estimates();
        let plant: Vec<f64> = (0..n).map(|_| numbers.between(0.45, 0.55)).collect();
        let estimate = plant.iter().map(|x| x + error * numbers.normal()).collect();
        let constant = |_: &Signal| Signal::Constant(0.0);
        let inputs = self.signals(numbers, true);
        let still = |signal: Signal| match signal {
            Signal::Constant(_) => signal,
            moving => Signal::Constant(moving.value(0.0, &[])),
        };
        Plan {
            start: 0.0,
            plant,
            estimate,
            noise: self.errors(numbers, true).iter().map(constant).collect(),
            inputs: inputs.into_iter().map(still).collect(),
            quiet: true,
            gaps: vec![1.0],
        }
    }

    fn signals(&self, numbers: &mut Numbers, quiet: bool) -> Vec<Signal> {
        let n = self.pair.estimates();
        let inputs = self.case.inputs.iter();
        inputs
            .map(|i| signals::of_role(numbers, &i.side, i.role, self.case.slope, quiet, n))
            .collect()
    }

    fn errors(&self, numbers: &mut Numbers, quiet: bool) -> Vec<Signal> {
        let n = self.pair.estimates();
        let of = |noise: &Noise| match quiet || noise.size == 0.0 {
            true => Signal::Constant(0.0),
            false => signals::free(numbers, [-noise.bound(), noise.bound()], n),
        };
        self.case.noise.iter().map(of).collect()
    }

    /// The plan with one of its parts changed.
    fn changed(&self, numbers: &mut Numbers, plan: &Plan, run: usize) -> Plan {
        let mut plan = plan.clone();
        let pace = numbers.size(1e-3, 0.5) / (1.0 + 0.02 * run as f64);
        match numbers.below(if self.samples.is_some() { 8 } else { 6 }) {
            0 | 1 => shake(numbers, &mut plan.plant, pace),
            2 | 3 => shake(numbers, &mut plan.estimate, pace),
            4 => plan.inputs = self.signals(numbers, plan.quiet),
            6 | 7 => plan.gaps = gaps(numbers),
            _ => plan.noise = self.errors(numbers, plan.quiet),
        }
        plan
    }

    /// Follows a plan.
    pub fn run(&mut self, plan: &Plan, tolerance: f64, budget: usize) -> Worst {
        let n = self.pair.states;
        let inside = |share: &f64, side: &[f64; 2]| match side {
            [low, high] if low.is_finite() && high.is_finite() => low + share * (high - low),
            _ => 4.0 * share - 2.0,
        };
        let x = plan
            .plant
            .iter()
            .zip(&self.sides)
            .map(|(s, side)| inside(s, side));
        let hat: Vec<f64> = plan
            .estimate
            .iter()
            .zip(&self.sides)
            .map(|(s, side)| inside(s, side))
            .collect();
        let mut state: Vec<f64> = x.take(n).collect();
        let mut z = self.pair.start.clone();
        for (held, hat) in self.pair.held.iter().zip(&hat) {
            if let Some(held) = held {
                z[*held] = *hat;
            }
        }
        self.settle(plan, &mut z);
        state.extend(z);
        let mut scale = vec![1e-3; state.len()];
        for (i, side) in self.sides.iter().enumerate() {
            let width = if side[1] - side[0] < 1e300 {
                side[1] - side[0]
            } else {
                1.0
            };
            if i < n {
                scale[i] = 1e-2 * width;
            }
            if let Some(held) = self.pair.held[i] {
                scale[n + held] = 1e-2 * width;
            }
        }
        let rate = self
            .claims
            .iter()
            .map(|c| c.rate)
            .fold(f64::INFINITY, f64::min);
        let length = (40.0 / rate).min(1e6);
        let mut run = Run::new(plan, self.claims, &self.sides, &self.guards, self.pair);
        let mut out = vec![0.0; state.len()];
        if self.samples.is_some() {
            run.read(plan.start, &mut state);
        }
        run.slope(plan.start, &state, &mut out);
        if run.seen(plan.start, &state) {
            let limits = Limits {
                tolerance,
                scale: &scale,
                budget,
            };
            let until = plan.start + length;
            match self.samples {
                None => drop(follow(&mut run, &state, [plan.start, until], &limits)),
                Some(longest) => sampled(&mut run, state, [plan.start, until], longest, &limits),
            }
        }
        run.worst
    }

    /// Filters of known inputs start where these are: what they do to the error from
    /// elsewhere is no part of the claims.
    fn settle(&self, plan: &Plan, z: &mut [f64]) {
        let mut guards = self.guards.iter();
        for (input, signal) in self.case.inputs.iter().zip(&plan.inputs) {
            if input.role != Role::Known {
                continue;
            }
            let per_input = self.guards.len()
                / self
                    .case
                    .inputs
                    .iter()
                    .filter(|i| i.role == Role::Known)
                    .count();
            for (order, (index, _)) in guards.by_ref().take(per_input).enumerate() {
                z[*index] = match order {
                    0 => signal.value(plan.start, &[]),
                    _ => signal.derivative(plan.start, order),
                };
            }
        }
    }
}

/// As far apart as is claimed, or less, once in a while or always.
fn gaps(numbers: &mut Numbers) -> Vec<f64> {
    let often = numbers.unit();
    let gap = |_| match numbers.chance(often) {
        true => 1.0,
        false => numbers.unit().max(1e-3),
    };
    (0..GAPS).map(gap).collect()
}

/// Follows a plan whose measurements are states, set to what the plant shows at every sample.
fn sampled(
    run: &mut Run<'_>,
    mut state: Vec<f64>,
    [start, until]: [f64; 2],
    longest: f64,
    limits: &Limits<'_>,
) {
    let mut t = start;
    for k in 0..SAMPLES {
        if t >= until {
            return;
        }
        let next = t + longest * run.gap(k);
        run.read(t, &mut state);
        match follow(run, &state, [t, next], limits) {
            Some(reached) => (t, state) = (next, reached),
            None => return,
        }
    }
}

fn shake(numbers: &mut Numbers, places: &mut [f64], pace: f64) {
    let all = numbers.chance(0.4);
    let one = numbers.below(places.len().max(1));
    for (i, place) in places.iter_mut().enumerate() {
        if all || i == one {
            *place = (*place + pace * numbers.normal()).clamp(0.0, 1.0);
        }
    }
}
