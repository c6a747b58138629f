//! The estimate and how its error spreads, integrated together.

use crate::driven::Driven;
use crate::{Dynamics, Error};

/// x̂' = f(t, x̂, u) with Φ' = FΦ and W' = FW + WFᵀ + Q/q, F = ∂f/∂x along x̂: from Φ = I and
/// W = 0 at one sample to P⁻ = ΦPΦᵀ + qW at the next, the solution of P' = FP + PFᵀ + Q.
///
/// In this form no error of the integration makes P indefinite. The state is x̂, then the
/// rows of (Φ W); W is left out where Q = 0. q is the largest entry of Q: tolerances then see
/// W in units of time.
pub(super) struct Linearised<'a> {
    pub driven: &'a mut Driven,
    pub entries: &'a [(usize, usize)],
    /// values of the entries of F
    pub slopes: &'a mut [f64],
    /// diagonal of Q/q, empty where Q = 0
    pub noise: &'a [f64],
}

impl Linearised<'_> {
    /// Entries of a row of (Φ W).
    pub fn width(n: usize, noisy: bool) -> usize {
        if noisy { 2 * n } else { n }
    }

    /// The state at a sample.
    pub fn begin(x: &[f64], noisy: bool, z: &mut Vec<f64>) {
        let n = x.len();
        let width = Self::width(n, noisy);
        z.clear();
        z.extend_from_slice(x);
        z.resize(n + n * width, 0.0);
        for i in 0..n {
            z[n + i * width + i] = 1.0;
        }
    }
}

impl Dynamics for Linearised<'_> {
    fn dimension(&self) -> usize {
        let n = self.driven.dimension();
        n + n * Self::width(n, !self.noise.is_empty())
    }

    fn derivatives(&mut self, t: f64, z: &[f64], dz: &mut [f64]) {
        let n = self.driven.dimension();
        let width = Self::width(n, !self.noise.is_empty());
        let (x, rows) = z.split_at(n);
        let (dx, drows) = dz.split_at_mut(n);
        self.driven.derivatives(t, x, dx);
        self.driven.evaluation.outputs(t, x, self.slopes);
        drows.fill(0.0);
        for (&(i, j), slope) in self.entries.iter().zip(&*self.slopes) {
            let into = &mut drows[i * width..(i + 1) * width];
            for (into, from) in into.iter_mut().zip(&rows[j * width..(j + 1) * width]) {
                *into += slope * from;
            }
        }
        // FW is there; its transpose and Q/q are added
        for (i, q) in self.noise.iter().enumerate() {
            for j in 0..i {
                let (a, b) = (i * width + n + j, j * width + n + i);
                let sum = drows[a] + drows[b];
                (drows[a], drows[b]) = (sum, sum);
            }
            let diagonal = &mut drows[i * width + n + i];
            *diagonal = 2.0 * *diagonal + q;
        }
    }

    fn switches(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.driven.switches(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.driven.enter(t);
    }

    fn surfaces(&self) -> usize {
        self.driven.surfaces()
    }

    fn surface_names(&self) -> Vec<String> {
        self.driven.surface_names()
    }

    fn read_surfaces(&mut self, t: f64, z: &[f64], values: &mut [f64]) {
        let n = self.driven.dimension();
        self.driven.read_surfaces(t, &z[..n], values);
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        self.driven.hold(sides);
    }

    fn names(&self) -> Vec<String> {
        self.driven.names()
    }

    fn not_finite(&mut self, t: f64, z: &[f64]) -> Error {
        let n = self.driven.dimension();
        self.driven.not_finite(t, &z[..n.min(z.len())])
    }
}
