//! The implicit Radau IIA method of order 5 (three stages), after Hairer and
//! Wanner, Solving Ordinary Differential Equations II, sections IV.8 and IV.5.
//!
//! Names are theirs: Z are the stages minus x, W = T⁻¹Z, γ and α ± iβ the
//! eigenvalues of A⁻¹, E₁ = γ/h·I − J, E₂ = (α + iβ)/h·I − J.

use nalgebra::{Complex, DVector};

use super::factors::{Factors, Shifted};
use super::one_step::OneStep;
use crate::events::{Ahead, Filippov, Poly, Span};
use crate::method::are_finite;
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

/// Most iterations of a step.
const NEWTON_ITERATIONS: usize = 7;

const T: [[f64; 3]; 3] = [
    [
        9.123_239_487_089_295e-2,
        -1.412_552_950_209_542e-1,
        -3.002_919_410_514_742_4e-2,
    ],
    [
        2.417_179_327_071_07e-1,
        2.041_293_522_937_999_4e-1,
        3.829_421_127_572_619e-1,
    ],
    [9.660_481_826_150_93e-1, 1.0, 0.0],
];
const T_INVERSE: [[f64; 3]; 3] = [
    [
        4.325_579_890_063_155,
        3.391_992_518_158_098_4e-1,
        5.417_705_399_358_749e-1,
    ],
    [
        -4.178_718_591_551_905,
        -3.276_828_207_610_623_7e-1,
        4.766_235_545_005_504_4e-1,
    ],
    [
        -5.028_726_349_457_868e-1,
        2.571_926_949_855_605,
        -5.960_392_048_282_249e-1,
    ],
];

/// Working memory and what is kept from step to step.
#[derive(Clone, Debug)]
pub(super) struct Radau {
    /// derivative at the present state, where it is known
    f0: DVector<f64>,
    has_begun: bool,
    /// nothing tells how long a step may be
    careful: bool,
    z: [DVector<f64>; 3],
    w: [DVector<f64>; 3],
    stage: DVector<f64>,
    k: [DVector<f64>; 3],
    scale: DVector<f64>,
    /// J, where it is known
    slopes: Slopes,
    is_known: bool,
    shifted: Shifted,
    factors: Option<StageFactors>,
    /// step, stages of the last accepted step (to extrapolate), its error
    last: Option<(f64, [DVector<f64>; 3], f64)>,
    /// contraction of the last Newton iteration
    θ: f64,
    /// a point where the derivative is not finite
    bad: Option<(f64, Vec<f64>)>,
}

/// Factors of E₁ and E₂ for a step.
#[derive(Clone, Debug)]
struct StageFactors {
    h: f64,
    e1: Factors<f64>,
    e2: Factors<Complex<f64>>,
}

impl OneStep for Radau {
    fn new(n: usize) -> Self {
        let zero = || DVector::zeros(n);
        let three = || [zero(), zero(), zero()];
        Self {
            f0: zero(),
            has_begun: false,
            careful: true,
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

    /// A jump of f makes all of it wrong.
    fn restart(&mut self, careful: bool) {
        self.careful = careful;
        self.has_begun = false;
        self.is_known = false;
        self.factors = None;
        self.last = None;
    }

    fn begin(&mut self, f: &mut dyn Dynamics, t: f64, x: &[f64]) -> bool {
        self.bad = None;
        if !self.has_begun {
            f.derivatives(t, x, self.f0.as_mut_slice());
            self.has_begun = true;
        }
        are_finite(self.f0.as_slice())
    }

    /// From the size of the derivative.
    fn first_step(
        &mut self,
        _f: &mut dyn Dynamics,
        (_t, x): (f64, &[f64]),
        span: f64,
        tolerances: &Tolerances,
    ) -> f64 {
        self.set_scale(x, tolerances);
        let speed = rms(&self.f0, &self.scale);
        (1e-3 / speed.sqrt()).min(0.01 * span)
    }

    fn attempt(
        &mut self,
        f: &mut dyn Dynamics,
        at: (f64, &[f64]),
        h: f64,
        tolerances: &Tolerances,
    ) -> Result<f64, f64> {
        self.set_scale(at.1, tolerances);
        let tried = self.tried(f, at, h, transformed(tolerances.relative));
        // after a rejection the step must not grow at once
        let most = if self.careful { h } else { f64::INFINITY };
        self.careful = tried.is_err();
        tried.map(|next| next.min(most))
    }

    fn reached(&self) -> &[f64] {
        self.stage.as_slice()
    }

    fn bad(&self) -> Option<&(f64, Vec<f64>)> {
        self.bad.as_ref()
    }

    fn ahead(&mut self, f: &mut Filippov<'_>, span: &Span<'_>) -> Option<Ahead> {
        let ahead = f.ahead(span, |state| self.between(state, span.from.1[state]));
        (ahead != Ahead::Nothing).then_some(ahead)
    }
}

impl Radau {
    /// Scales of the error norm.
    fn set_scale(&mut self, x: &[f64], tolerances: &Tolerances) {
        let relative = transformed(tolerances.relative);
        let absolute = relative * tolerances.absolute / tolerances.relative;
        for (scale, x) in self.scale.iter_mut().zip(x) {
            *scale = absolute + relative * x.abs();
        }
    }

    /// Tries a step: the one to go on with.
    ///
    /// # Errors
    /// The step to retry with.
    fn tried(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        h: f64,
        relative: f64,
    ) -> Result<f64, f64> {
        let fresh = !self.is_known;
        let factors = self.factors_for(f, t, x, h).ok_or(0.25 * h)?;
        self.extrapolate(h);
        let newton = self.newton(f, (t, x), &factors, relative);
        let iterations = newton.map_err(|shrink| {
            // an old Jacobian may be the cause: a new one for the next try
            if !fresh {
                self.is_known = false;
            }
            self.last = None;
            shrink * h
        })?;
        let error = self.error(f, (t, x), &factors);
        if !error.is_finite() {
            self.factors = Some(factors);
            return Err(0.25 * h);
        }
        let next = self.next_step(h, error, iterations);
        self.factors = Some(factors);
        if error >= 1.0 {
            return Err(next.min(0.9 * h));
        }
        if !self.accept(f, (t, x), h, error) {
            return Err(0.25 * h);
        }
        // an unchanged step saves a factorisation
        let kept = self.θ < KEEP_JACOBIAN && next >= h && next <= KEEP_STEP * h;
        Ok(if kept { h } else { next })
    }

    /// What a state is between the ends of the step accepted last, which began at `from`: the polynomial
    /// of the collocation.
    fn between(&self, state: usize, from: f64) -> Poly {
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
    fn factors_for(
        &mut self,
        f: &mut dyn Dynamics,
        t: f64,
        x: &[f64],
        h: f64,
    ) -> Option<StageFactors> {
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
        Some(StageFactors {
            h,
            e1: self.shifted.factors(one, &self.slopes)?,
            e2: self.shifted.factors(pair, &self.slopes)?,
        })
    }

    /// The local error relative to the tolerance.
    fn error(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        factors: &StageFactors,
    ) -> f64 {
        let [z1, z2, z3] = &self.z;
        let from_stages = (ERROR[0] * z1 + ERROR[1] * z2 + ERROR[2] * z3) / factors.h;
        let mut estimate = &from_stages + &self.f0;
        factors.e1.solve(&mut estimate);
        let error = rms(&estimate, &self.scale);
        if error < 1.0 || !self.careful {
            return error.max(1e-10);
        }
        // at the first step and after a rejection: a sharper estimate for stiff parts
        for i in 0..x.len() {
            self.stage[i] = x[i] + estimate[i];
        }
        f.derivatives(t, self.stage.as_slice(), self.k[0].as_mut_slice());
        let mut sharper = &from_stages + &self.k[0];
        factors.e1.solve(&mut sharper);
        let sharper = rms(&sharper, &self.scale);
        match sharper.is_finite() {
            true => sharper.max(1e-10),
            false => error,
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
    fn accept(&mut self, f: &mut dyn Dynamics, (t, x): (f64, &[f64]), h: f64, error: f64) -> bool {
        self.place(x, 2);
        f.derivatives(t + h, self.stage.as_slice(), self.f0.as_mut_slice());
        if !are_finite(self.f0.as_slice()) {
            self.bad = Some((t + h, self.stage.as_slice().to_vec()));
            f.derivatives(t, x, self.f0.as_mut_slice());
            return false;
        }
        self.last = Some((h, self.z.clone(), error.max(1e-2)));
        if self.θ >= KEEP_JACOBIAN {
            self.is_known = false;
        }
        true
    }

    /// Starts Newton's iteration from the last step's collocation polynomial.
    fn extrapolate(&mut self, h: f64) {
        let Some((last, z, _)) = &self.last else {
            for v in self.z.iter_mut().chain(&mut self.w) {
                v.fill(0.0);
            }
            return;
        };
        // q(s) interpolates 0 at s = −1 (the old x) and z at the old nodes; s = 0 now
        for (new, c) in self.z.iter_mut().zip(C) {
            let [b1, b2, b3] = lagrange(c * h / last);
            for i in 0..new.len() {
                new[i] = b1 * z[0][i] + b2 * z[1][i] + (b3 - 1.0) * z[2][i];
            }
        }
        combine(&T_INVERSE, &self.z, &mut self.w);
    }

    /// Simplified Newton iteration for Z, in the variables W that split the system into a real and
    /// a complex one: how many iterations it took.
    ///
    /// # Errors
    /// The factor on the step to retry with.
    fn newton(
        &mut self,
        f: &mut dyn Dynamics,
        (t, x): (f64, &[f64]),
        factors: &StageFactors,
        relative: f64,
    ) -> Result<usize, f64> {
        let tolerance = (10.0 * f64::EPSILON / relative).max(relative.sqrt().min(0.03));
        let mut before: Option<f64> = None;
        self.θ = 2.0 * KEEP_JACOBIAN;
        for iteration in 1..=NEWTON_ITERATIONS {
            if !self.evaluate_stages(f, (t, x), factors.h) {
                return Err(0.25);
            }
            let Some(size) = self.correct(factors) else {
                return Err(0.5);
            };
            if let Some(before) = before {
                self.θ = size / before;
                let left = (NEWTON_ITERATIONS - iteration) as i32;
                let reach = self.θ.powi(left) / (1.0 - self.θ) * size;
                if self.θ >= 0.99 || reach > tolerance && left == 0 {
                    return Err(0.5);
                }
                if reach > tolerance {
                    // it will not converge in the iterations left
                    let excess = (reach / tolerance).clamp(1e-4, 20.0);
                    return Err(0.8 * excess.powf(-1.0 / (4 + left) as f64));
                }
            }
            combine(&T, &self.w, &mut self.z);
            let remaining = match before {
                Some(_) => self.θ / (1.0 - self.θ) * size,
                None => size,
            };
            if remaining <= tolerance || size == 0.0 {
                return Ok(iteration);
            }
            before = Some(size);
        }
        Err(0.5)
    }

    /// K = f at the stages; false where it is not finite.
    fn evaluate_stages(&mut self, f: &mut dyn Dynamics, (t, x): (f64, &[f64]), h: f64) -> bool {
        for (stage, c) in C.iter().enumerate() {
            self.place(x, stage);
            let t = t + c * h;
            f.derivatives(t, self.stage.as_slice(), self.k[stage].as_mut_slice());
            if !are_finite(self.k[stage].as_slice()) {
                self.bad = Some((t, self.stage.as_slice().to_vec()));
                return false;
            }
        }
        true
    }

    /// The state of a stage.
    fn place(&mut self, x: &[f64], stage: usize) {
        let moved = x.iter().zip(&self.z[stage]);
        for (to, (x, z)) in self.stage.iter_mut().zip(moved) {
            *to = x + z;
        }
    }

    /// Adds Newton's correction to W; its size in the error norm.
    fn correct(&mut self, factors: &StageFactors) -> Option<f64> {
        let h = factors.h;
        let n = self.f0.len();
        let mut r = [DVector::zeros(n), DVector::zeros(n), DVector::zeros(n)];
        combine(&T_INVERSE, &self.k, &mut r);
        let [w1, w2, w3] = &self.w;
        let mut first = &r[0] - GAMMA / h * w1;
        let mut pair = DVector::from_fn(n, |i, _| {
            Complex::new(r[1][i], r[2][i])
                - Complex::new(ALPHA / h, BETA / h) * Complex::new(w2[i], w3[i])
        });
        if !factors.e1.solve(&mut first) || !factors.e2.solve(&mut pair) {
            return None;
        }
        let mut sum = 0.0;
        for i in 0..n {
            let (d1, d2, d3) = (first[i], pair[i].re, pair[i].im);
            self.w[0][i] += d1;
            self.w[1][i] += d2;
            self.w[2][i] += d3;
            sum += (d1 * d1 + d2 * d2 + d3 * d3) / (self.scale[i] * self.scale[i]);
        }
        let size = (sum / (3 * n) as f64).sqrt();
        size.is_finite().then_some(size)
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

/// Lagrange's basis at `s` of the nodes −1, c₁ − 1, c₂ − 1, 0, without the first.
fn lagrange(s: f64) -> [f64; 3] {
    let nodes = [-1.0, C[0] - 1.0, C[1] - 1.0, 0.0];
    [1, 2, 3].map(|i| {
        let others = (0..4).filter(|&j| j != i);
        let factors = others.map(|j| (s - nodes[j]) / (nodes[i] - nodes[j]));
        factors.product()
    })
}

/// `to` = M · `from`, componentwise over three vectors.
fn combine(m: &[[f64; 3]; 3], from: &[DVector<f64>; 3], to: &mut [DVector<f64>; 3]) {
    for (row, to) in m.iter().zip(to) {
        for i in 0..to.len() {
            to[i] = row[0] * from[0][i] + row[1] * from[1][i] + row[2] * from[2][i];
        }
    }
}
