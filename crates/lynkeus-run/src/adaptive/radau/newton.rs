//! Simplified Newton iteration for the stages, in the variables W that split the
//! system into a real and a complex one.

use nalgebra::{Complex, DVector};

use super::{ALPHA, BETA, C, Factors, GAMMA, KEEP_JACOBIAN, Radau};
use crate::Dynamics;
use crate::adaptive::Leg;

/// Most iterations of a step.
pub(super) const NEWTON_ITERATIONS: usize = 7;

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

/// How Newton's iteration ended.
pub(super) enum Newton {
    Converged {
        iterations: usize,
    },
    /// try again with the step times this
    Failed {
        shrink: f64,
    },
}

impl Radau {
    /// Starts Newton's iteration from the last step's collocation polynomial.
    pub(super) fn extrapolate(&mut self, h: f64) {
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

    /// Simplified Newton iteration for Z.
    pub(super) fn newton(
        &mut self,
        f: &mut impl Dynamics,
        leg: &Leg<'_>,
        h: f64,
        factors: &Factors,
        relative: f64,
    ) -> Newton {
        let tolerance = (10.0 * f64::EPSILON / relative).max(relative.sqrt().min(0.03));
        let mut before: Option<f64> = None;
        self.θ = 2.0 * KEEP_JACOBIAN;
        for iteration in 1..=NEWTON_ITERATIONS {
            if !self.evaluate_stages(f, leg, h) {
                return Newton::Failed { shrink: 0.25 };
            }
            let Some(size) = self.correct(h, factors) else {
                return Newton::Failed { shrink: 0.5 };
            };
            if let Some(before) = before {
                self.θ = size / before;
                let left = (NEWTON_ITERATIONS - iteration) as i32;
                let reach = self.θ.powi(left) / (1.0 - self.θ) * size;
                if self.θ >= 0.99 || reach > tolerance && left == 0 {
                    return Newton::Failed { shrink: 0.5 };
                }
                if reach > tolerance {
                    // it will not converge in the iterations left
                    let excess = (reach / tolerance).clamp(1e-4, 20.0);
                    let shrink = 0.8 * excess.powf(-1.0 / (4 + left) as f64);
                    return Newton::Failed { shrink };
                }
            }
            combine(&T, &self.w, &mut self.z);
            let remaining = match before {
                Some(_) => self.θ / (1.0 - self.θ) * size,
                None => size,
            };
            if remaining <= tolerance || size == 0.0 {
                return Newton::Converged {
                    iterations: iteration,
                };
            }
            before = Some(size);
        }
        Newton::Failed { shrink: 0.5 }
    }

    /// K = f at the stages; false where it is not finite.
    fn evaluate_stages(&mut self, f: &mut impl Dynamics, leg: &Leg<'_>, h: f64) -> bool {
        for (stage, c) in C.iter().enumerate() {
            for i in 0..leg.x.len() {
                self.stage[i] = leg.x[i] + self.z[stage][i];
            }
            let t = leg.t + c * h;
            f.derivatives(t, self.stage.as_slice(), self.k[stage].as_mut_slice());
            if self.k[stage].iter().any(|v| !v.is_finite()) {
                self.bad = Some((t, self.stage.as_slice().to_vec()));
                return false;
            }
        }
        true
    }

    /// Adds Newton's correction to W; its size in the error norm.
    fn correct(&mut self, h: f64, factors: &Factors) -> Option<f64> {
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

/// Lagrange's basis at `s` of the nodes −1, c₁ − 1, c₂ − 1, 0, without the first.
fn lagrange(s: f64) -> [f64; 3] {
    let nodes = [-1.0, C[0] - 1.0, C[1] - 1.0, 0.0];
    [1, 2, 3].map(|i| {
        let others = (0..4).filter(|&j| j != i);
        others
            .map(|j| (s - nodes[j]) / (nodes[i] - nodes[j]))
            .product()
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
