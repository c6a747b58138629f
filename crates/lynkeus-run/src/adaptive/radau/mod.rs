//! The implicit Radau IIA method of order 5 (three stages), after Hairer and
//! Wanner, Solving Ordinary Differential Equations II, sections IV.8 and IV.5.
//!
//! Names are theirs: Z are the stages minus x, W = T⁻¹Z, γ and α ± iβ the
//! eigenvalues of A⁻¹, E₁ = γ/h·I − J, E₂ = (α + iβ)/h·I − J.

mod newton;
mod ordering;
mod shifted;
mod sparse;

use nalgebra::{Complex, DVector};

use newton::{NEWTON_ITERATIONS, Newton};
use shifted::Shifted;

use super::{Leg, Point};
use crate::relays::Poly;
use crate::{Dynamics, Slopes, Tolerances};

const SQRT_6: f64 = 2.449_489_742_783_178;
const C: [f64; 3] = [(4.0 - SQRT_6) / 10.0, (4.0 + SQRT_6) / 10.0, 1.0];
const GAMMA: f64 = 3.637_834_252_744_496;
const ALPHA: f64 = 2.681_082_873_627_752;
const BETA: f64 = 3.050_430_199_247_410_5;

/// Weights of Z/h in the error estimate.
const ERROR: [f64; 3] = [
    -(13.0 + 7.0 * SQRT_6) / 3.0,
    (-13.0 + 7.0 * SQRT_6) / 3.0,
    -1.0 / 3.0,
];

const SAFETY: f64 = 0.9;

/// Newton contraction below which the Jacobian is kept.
const KEEP_JACOBIAN: f64 = 1e-3;

/// Growth of the step below which the step, and with it the factors, are kept.
const KEEP_STEP: f64 = 1.2;

/// Working memory and what is kept from step to step.
#[derive(Clone, Debug)]
pub(super) struct Radau {
    /// derivative at the present state
    f0: DVector<f64>,
    z: [DVector<f64>; 3],
    w: [DVector<f64>; 3],
    stage: DVector<f64>,
    k: [DVector<f64>; 3],
    scale: DVector<f64>,
    /// J, where it is known
    slopes: Slopes,
    is_known: bool,
    shifted: Shifted,
    factors: Option<Factors>,
    /// step, stages of the last accepted step (to extrapolate), its error
    last: Option<(f64, [DVector<f64>; 3], f64)>,
    /// contraction of the last Newton iteration
    θ: f64,
    /// a point where the derivative is not finite
    pub(super) bad: Option<Point>,
}

#[derive(Clone, Debug)]
struct Factors {
    h: f64,
    e1: shifted::Factors<f64>,
    e2: shifted::Factors<Complex<f64>>,
}

impl Radau {
    pub(super) fn new(n: usize) -> Self {
        let zero = || DVector::zeros(n);
        let three = || [zero(), zero(), zero()];
        Self {
            f0: zero(),
            z: three(),
            w: three(),
            stage: zero(),
            k: three(),
            scale: zero(),
            slopes: Slopes::default(),
            is_known: false,
            shifted: Shifted::new(n),
            factors: None,
            last: None,
            θ: 1.0,
            bad: None,
        }
    }

    /// Forgets what a jump of f makes wrong.
    pub(super) fn restart(&mut self, f: &mut impl Dynamics, t: f64, x: &[f64]) {
        f.derivatives(t, x, self.f0.as_mut_slice());
        self.is_known = false;
        self.factors = None;
        self.last = None;
        self.bad = None;
    }

    /// A first step from the size of the derivative.
    pub(super) fn first_step(&mut self, leg: &Leg<'_>, tolerances: &Tolerances) -> f64 {
        self.set_scale(leg.x, tolerances);
        let speed = rms(&self.f0, &self.scale);
        let guess = if speed > 0.0 {
            1e-3 / speed.sqrt()
        } else {
            f64::MAX
        };
        guess.min(0.01 * (leg.to - leg.t))
    }

    /// Scales of the error norm.
    fn set_scale(&mut self, x: &[f64], tolerances: &Tolerances) {
        let relative = transformed(tolerances.relative);
        let absolute = relative * tolerances.absolute / tolerances.relative;
        for (scale, x) in self.scale.iter_mut().zip(x) {
            *scale = absolute + relative * x.abs();
        }
    }

    /// Tries a step; true with the next step, or false with the step to retry.
    pub(super) fn attempt(
        &mut self,
        f: &mut impl Dynamics,
        leg: &mut Leg<'_>,
        h: f64,
        careful: bool,
        tolerances: &Tolerances,
    ) -> (bool, f64) {
        self.set_scale(leg.x, tolerances);
        let fresh = !self.is_known;
        let Some(factors) = self.factors_for(f, leg.t, leg.x, h) else {
            return (false, 0.25 * h);
        };
        self.extrapolate(h);
        let newton = self.newton(f, leg, h, &factors, transformed(tolerances.relative));
        let iterations = match newton {
            Newton::Converged { iterations } => iterations,
            Newton::Failed { shrink } => {
                // an old Jacobian may be the cause: a new one for the next try
                if !fresh {
                    self.is_known = false;
                }
                self.last = None;
                return (false, shrink * h);
            }
        };
        let error = self.error(f, leg, h, &factors, careful);
        if !error.is_finite() {
            self.factors = Some(factors);
            return (false, 0.25 * h);
        }
        let next = self.next_step(h, error, iterations);
        self.factors = Some(factors);
        if error >= 1.0 {
            return (false, next.min(0.9 * h));
        }
        if !self.accept(f, leg, h, error) {
            return (false, 0.25 * h);
        }
        // an unchanged step saves a factorisation
        let kept = self.θ < KEEP_JACOBIAN && next >= h && next <= KEEP_STEP * h;
        (true, if kept { h } else { next })
    }

    /// What a state is between the ends of the step accepted last, which began at `from`: the polynomial
    /// of the collocation.
    pub(super) fn between(&self, state: usize, from: f64) -> Poly {
        let [a, b] = [C[0], C[1]];
        let [z1, z2, z3] = [0, 1, 2].map(|k| self.z[k][state]);
        // divided differences over 0, c₁, c₂, 1
        let (first, second, third) = (z1 / a, (z2 - z1) / (b - a), (z3 - z2) / (1.0 - b));
        let (bends, late) = ((second - first) / b, (third - second) / (1.0 - a));
        let twists = late - bends;
        let mut poly = Poly::line(from, first - a * bends + a * b * twists);
        poly.0[2] = bends - (a + b) * twists;
        poly.0[3] = twists;
        poly
    }

    /// Factors of E₁ and E₂ for this step, kept ones where they fit.
    fn factors_for(&mut self, f: &mut impl Dynamics, t: f64, x: &[f64], h: f64) -> Option<Factors> {
        if !self.is_known {
            self.slopes.look(f, t, x);
            if !self.slopes.are_finite() {
                self.bad = Some((t, x.to_vec()));
                return None;
            }
            self.shifted.fit(&self.slopes);
            self.is_known = true;
            self.factors = None;
        }
        let kept = self.factors.take().filter(|factors| factors.h == h);
        if kept.is_some() {
            return kept;
        }
        let (one, pair) = (GAMMA / h, Complex::new(ALPHA / h, BETA / h));
        Some(Factors {
            h,
            e1: self.shifted.factors(one, &self.slopes)?,
            e2: self.shifted.factors(pair, &self.slopes)?,
        })
    }

    /// The local error relative to the tolerance.
    fn error(
        &mut self,
        f: &mut impl Dynamics,
        leg: &Leg<'_>,
        h: f64,
        factors: &Factors,
        careful: bool,
    ) -> f64 {
        let [z1, z2, z3] = &self.z;
        let from_stages = (ERROR[0] * z1 + ERROR[1] * z2 + ERROR[2] * z3) / h;
        let mut estimate = &from_stages + &self.f0;
        factors.e1.solve(&mut estimate);
        let error = rms(&estimate, &self.scale);
        if error < 1.0 || !careful {
            return error.max(1e-10);
        }
        // at the first step and after a rejection: a sharper estimate for stiff parts
        for i in 0..leg.x.len() {
            self.stage[i] = leg.x[i] + estimate[i];
        }
        f.derivatives(leg.t, self.stage.as_slice(), self.k[0].as_mut_slice());
        let mut sharper = &from_stages + &self.k[0];
        factors.e1.solve(&mut sharper);
        let sharper = rms(&sharper, &self.scale);
        if sharper.is_finite() {
            sharper.max(1e-10)
        } else {
            error
        }
    }

    /// The step that the error and the work of Newton's iteration suggest.
    fn next_step(&self, h: f64, error: f64, iterations: usize) -> f64 {
        let work = (1 + 2 * NEWTON_ITERATIONS) as f64 / (iterations + 2 * NEWTON_ITERATIONS) as f64;
        let safety = SAFETY * work.min(1.0);
        let mut growth = (safety * error.powf(-0.25)).clamp(0.125, 5.0);
        if let Some((last, _, last_error)) = &self.last {
            // Gustafsson's controller: follows the trend of the error
            let trend = h / last * (last_error / (error * error)).powf(0.25) * SAFETY;
            growth = growth.min(trend.clamp(0.125, 5.0));
        }
        h * growth
    }

    /// Moves to the end of the step; false where the derivative there is not finite.
    fn accept(&mut self, f: &mut impl Dynamics, leg: &mut Leg<'_>, h: f64, error: f64) -> bool {
        for i in 0..leg.x.len() {
            self.stage[i] = leg.x[i] + self.z[2][i];
        }
        f.derivatives(leg.t + h, self.stage.as_slice(), self.f0.as_mut_slice());
        if self.f0.iter().any(|v| !v.is_finite()) {
            self.bad = Some((leg.t + h, self.stage.as_slice().to_vec()));
            f.derivatives(leg.t, leg.x, self.f0.as_mut_slice());
            return false;
        }
        leg.x.copy_from_slice(self.stage.as_slice());
        self.last = Some((h, self.z.clone(), error.max(1e-2)));
        if self.θ >= KEEP_JACOBIAN {
            self.is_known = false;
        }
        true
    }
}

/// The relative tolerance of the error estimate: of order 3 where the solution is
/// of order 5, it may be looser. RADAU5 has 0.1·rtol^(2/3); this is between that
/// and rtol, since very stiff forced modes lose orders and then miss rtol.
fn transformed(relative: f64) -> f64 {
    0.02 * relative.powf(0.75)
}

fn rms(v: &DVector<f64>, scale: &DVector<f64>) -> f64 {
    let sum: f64 = v.iter().zip(scale).map(|(v, s)| (v / s) * (v / s)).sum();
    (sum / v.len() as f64).sqrt()
}
