//! How often process noise is drawn.
//!
//! What is held for δ is white only for what is slow beside δ: the variance of x' = −ax + w then comes
//! out as tanh(aδ/2)/(aδ/2) of what it is. Draws are as dense as the linearised plant needs.

use nalgebra::DMatrix;

use crate::jacobian::fastest;
use crate::{Dynamics, Events, Noise, Role, Simulation, Slopes};

/// A variance of a state at the end of the run may be off by this share.
const OFF: f64 = 0.02;

/// Points of a run without noise at which the plant is linearised.
const PLACES: usize = 8;

/// States with noise from whose axes the plant is looked at,
const AXES: usize = 8;

/// so many of the deviations away that the noise makes there,
const AWAY: f64 = 1.5;

/// which are found to 30 %, from those that nothing draws back.
const SHRINKS: usize = 40;

/// Larger plants are judged by their fastest mode alone,
const SMALL: usize = 48;

/// which may turn by so much while noise is held: its variance is then off by 2 %.
const TURN: f64 = 0.5;

/// Most draws of a run.
const MOST: f64 = 3e5;

/// Most doublings of a step.
const DOUBLINGS: usize = 60;

/// How often process noise is drawn from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProcessDraws {
    /// draws from one sample to the next
    pub per_sample: usize,
    /// the time that each holds
    pub hold: f64,
    /// whether they are dense enough for the plant's time scales; too many would be needed otherwise
    pub are_enough: bool,
}

/// How often the process noise of a simulation has to be drawn so that the plant, linearised at some
/// points of its run without noise and where the noise takes it from there, scatters as under white noise to 1 % of every standard deviation.
/// It depends on neither seed nor observer.
pub fn process_draws(simulation: &Simulation) -> ProcessDraws {
    let sample = (simulation.noise.sample_step).unwrap_or(simulation.output_step);
    let samples = ((simulation.until - simulation.start) / sample).max(1.0);
    let states = simulation.plant.states();
    let density = |name: &String| simulation.noise.process.get(name).copied().unwrap_or(0.0);
    let densities: Vec<f64> = states.iter().map(density).collect();
    let (mut per_sample, mut are_enough) = (1, true);
    if densities.iter().any(|q| *q > 0.0) && samples.is_finite() && sample > 0.0 {
        let most = (MOST / samples).max(1.0).log2().floor() as usize;
        let needed = halvings(simulation, &densities, [sample, samples], most + 1);
        (per_sample, are_enough) = (1 << needed.min(most), needed <= most);
    }
    ProcessDraws {
        per_sample,
        hold: sample / per_sample as f64,
        are_enough,
    }
}

/// How often a sampling interval, of which the run has so many, has to be halved along the plant's run
/// without noise, as far as that goes, and about it; `most` where that is too often.
fn halvings(
    simulation: &Simulation,
    densities: &[f64],
    [sample, samples]: [f64; 2],
    most: usize,
) -> usize {
    let time = simulation.until - simulation.start;
    let quiet = Simulation {
        observer: None,
        record_outputs: false,
        noise: Noise::default(),
        output_step: time / PLACES as f64,
        ..simulation.clone()
    };
    let run = quiet.run().unwrap_or_else(|ended| ended.partial);
    let mut plant = simulation.plant.evaluation();
    let (n, inputs) = (plant.dimension(), plant.signals().len());
    let mut slopes = Slopes::default();
    let mut needed = 0;
    for (row, &t) in run.times().iter().enumerate() {
        let value = |role: Role, i: usize| run.column(role.at(i)).map_or(f64::NAN, |c| c[row]);
        let x: Vec<f64> = (0..n).map(|i| value(Role::State, i)).collect();
        for i in 0..inputs {
            plant.signals_mut()[i] = value(Role::Input, i);
        }
        plant.enter(t);
        if n > SMALL {
            let rate = fastest(&mut plant, t, &x, Some(&[])).radius;
            let fits = |j: &usize| rate * sample / 2.0_f64.powi(*j as i32) <= TURN;
            if rate.is_finite() {
                needed = needed.max((0..most).find(fits).unwrap_or(most));
            }
            continue;
        }
        let mut slope = |x: &[f64]| {
            slopes.look(&mut plant, t, x);
            slopes.dense(n)
        };
        let mut places = vec![slope(&x)];
        let noisy = densities.iter().enumerate().filter(|(_, q)| **q > 0.0);
        for (i, q) in noisy.take(AXES) {
            places.extend(about(&x, i, *q, time, &mut slope));
        }
        for F in places {
            needed = needed.max(halvings_at(&F, densities, [sample, samples], most));
        }
    }
    needed
}

/// As [`halvings`], of a linear plant; a plant without slopes tells nothing.
fn halvings_at(
    F: &DMatrix<f64>,
    densities: &[f64],
    [sample, samples]: [f64; 2],
    most: usize,
) -> usize {
    if !F.iter().all(|f| f.is_finite()) {
        return 0;
    }
    let Q = DMatrix::from_diagonal(&densities.to_vec().into());
    let (steps, whole) = transitions(F, &Q, sample, samples);
    let fits = |j: &usize| {
        let steps = whole.checked_sub(*j).and_then(|first| steps.get(first..));
        steps.is_none_or(|steps| may_hold(steps, &Q, sample / 2.0_f64.powi(*j as i32)))
    };
    (0..most).find(fits).unwrap_or(most)
}

/// Where noise of density q on state i takes a plant within some time, as far as its own slope there lets it: s² = q/2|F|.
fn about(
    x: &[f64],
    i: usize,
    q: f64,
    time: f64,
    slope: &mut dyn FnMut(&[f64]) -> DMatrix<f64>,
) -> [DMatrix<f64>; 2] {
    let mut at = |s: f64| {
        let mut x = x.to_vec();
        x[i] += s;
        slope(&x)
    };
    [-1.0, 1.0].map(|sign| {
        let mut s = (q * time).sqrt();
        for _ in 0..SHRINKS {
            let rate = at(sign * s)[(i, i)].abs();
            if 2.0 * rate * s * s <= q {
                break;
            }
            s *= 0.7;
        }
        at(sign * AWAY * s)
    })
}

/// Φ = exp(Fh), ∫ exp(Fs) ds and W = ∫ exp(Fs) Q exp(Fᵀs) ds over h.
struct Transition {
    transition: DMatrix<f64>,
    integral: DMatrix<f64>,
    noise: DMatrix<f64>,
}

impl Transition {
    /// Over a step in which F turns little: by series.
    fn short(F: &DMatrix<f64>, Q: &DMatrix<f64>, h: f64) -> Self {
        const TERMS: usize = 12;
        let n = F.nrows();
        let one = DMatrix::<f64>::identity(n, n);
        let mut step = Self {
            transition: one.clone(),
            integral: &one * h,
            noise: Q * h,
        };
        let (mut power, mut part) = (one, Q * h);
        for k in 1..=TERMS {
            power = F * power * (h / k as f64);
            step.transition += &power;
            step.integral += &power * (h / (k + 1) as f64);
            let next = F * &part;
            part = (&next + next.transpose()) * (h / (k + 1) as f64);
            step.noise += &part;
        }
        step
    }

    /// Over twice the time.
    fn doubled(&self) -> Self {
        let flow = &self.transition;
        Self {
            transition: flow * flow,
            integral: &self.integral + flow * &self.integral,
            noise: &self.noise + flow * &self.noise * flow.transpose(),
        }
    }
}

/// A linear plant x' = Fx + w over 1/2^k of a sampling interval, then over the interval, then over more
/// and more of them; and which of these is the interval.
fn transitions(
    F: &DMatrix<f64>,
    Q: &DMatrix<f64>,
    interval: f64,
    samples: f64,
) -> (Vec<Transition>, usize) {
    let turn = (F.norm() * interval).max(f64::MIN_POSITIVE);
    let halvings = (turn / 0.125).log2().ceil().clamp(0.0, DOUBLINGS as f64) as usize;
    let h = interval / 2.0_f64.powi(halvings as i32);
    let all = halvings + (samples.log2().ceil() as usize).min(DOUBLINGS);
    let (mut steps, mut next) = (vec![], Transition::short(F, Q, h));
    for count in 0..=all {
        let size = next.noise.norm() + next.transition.norm();
        if count > halvings && (size.is_nan() || size >= 1e150) {
            break;
        }
        let twice = next.doubled();
        steps.push(std::mem::replace(&mut next, twice));
    }
    (steps, halvings)
}

/// Whether noise that is held for the first of these steps makes the variances of the states that white
/// noise makes, at the end.
fn may_hold(steps: &[Transition], Q: &DMatrix<f64>, hold: f64) -> bool {
    let [.., last] = steps else {
        return true;
    };
    let mut held = &steps[0].integral * Q * steps[0].integral.transpose() / hold;
    for step in &steps[..steps.len() - 1] {
        held += &step.transition * &held * step.transition.transpose();
    }
    (0..held.nrows()).all(|i| {
        let white = last.noise[(i, i)];
        let off = (held[(i, i)] - white).abs();
        // what is no number tells nothing
        off.is_nan() || white.is_nan() || off <= OFF * white.abs()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::System;
    use lynkeus_expr::Graph;

    fn needed(F: &[f64], densities: &[f64], samples: f64) -> usize {
        let n = densities.len();
        halvings_at(
            &DMatrix::from_row_slice(n, n, F),
            densities,
            [1.0, samples],
            30,
        )
    }

    /// x' = −ax + w: tanh(aδ/2)/(aδ/2) is within 2 % of 1 where aδ is below 0.496.
    #[test]
    fn a_fast_state_is_drawn_often_and_a_slow_one_as_before() {
        assert_eq!(needed(&[-0.4], &[1.0], 1e4), 0);
        assert_eq!(needed(&[-0.6], &[1.0], 1e4), 1);
        assert_eq!(needed(&[-5.0], &[1.0], 1e4), 4);
        assert_eq!(needed(&[0.0], &[1.0], 1e4), 0);
        assert_eq!(needed(&[0.1], &[1.0], 1e4), 0);
    }

    /// Where a run would need too many draws there are as many as it can have, and it is told.
    #[test]
    fn too_many_draws_are_told() {
        let of = |rate: f64, until: f64| {
            let g = Graph::new();
            let (x, time) = (g.symbol("x"), g.symbol("time").node());
            let states = [("x".to_owned(), x.node(), 0.0)];
            let plant = System::new(&g, time, &states, &[], &[(x * -rate).node()], &[]).unwrap();
            let inputs = System::new(&g, time, &[], &[], &[], &[]).unwrap();
            let mut simulation = Simulation::new(plant, inputs, until, 1.0);
            simulation.noise.process.insert("x".to_owned(), 1.0);
            process_draws(&simulation)
        };
        assert_eq!(of(0.1, 100.0).per_sample, 1);
        let fast = of(5.0, 3000.0);
        assert_eq!((fast.per_sample, fast.are_enough), (16, true));
        assert_eq!(fast.hold, 1.0 / 16.0);
        let stiff = of(1e7, 3000.0);
        assert!(!stiff.are_enough && stiff.per_sample as f64 * 3000.0 <= MOST);
    }

    /// An oscillator turns; what is stiff and driven by nothing but a slow state needs no more draws.
    #[test]
    fn what_noise_moves_counts() {
        let oscillator = |w: f64| needed(&[0.0, 1.0, -w * w, -0.02 * w], &[0.0, 1.0], 1e4);
        assert_eq!(oscillator(0.3), 0);
        assert!(oscillator(7.0) >= 4, "{}", oscillator(7.0));
        let slaved = [-0.1, 0.0, 1e5, -1e5];
        assert_eq!(needed(&slaved, &[1.0, 0.0], 1e4), 0);
        assert!(needed(&slaved, &[0.0, 1.0], 1e4) > 15);
        // integrators have no time of their own, and are seen over the whole run
        let chain = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        assert_eq!(needed(&chain, &[0.0, 0.0, 1.0], 100.0), 0);
        assert_eq!(needed(&[f64::NAN], &[1.0], 10.0), 0);
    }
}
