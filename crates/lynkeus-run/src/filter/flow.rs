//! The estimate and how its error spreads, integrated together.

use super::curvature::{Curvature, Layout};
use super::taylor::Moments;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::system::Driven;
use crate::{Dynamics, Error, Events, Integrator, Method, Slopes};

/// x̂, Φ and W by one integration, for flows with few states.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    integrator: Integrator,
    entries: Vec<(usize, usize)>,
    slopes: Vec<f64>,
    curvature: Curvature,
    /// Q/q, empty where Q = 0
    noise: Vec<f64>,
    /// q, the largest entry of Q
    scale: f64,
    /// the state of [`Linearised`]
    z: Vec<f64>,
}

impl Joint {
    pub fn new(
        n: usize,
        outputs: usize,
        entries: &[(usize, usize)],
        process_noise: &[f64],
        method: Method,
    ) -> Result<Self, Error> {
        let scale = process_noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let noise = match scale > 0.0 {
            true => process_noise.iter().map(|q| q / scale).collect(),
            false => vec![],
        };
        let dimension = n + n * Linearised::width(n, scale > 0.0);
        Ok(Self {
            integrator: Integrator::new(method, dimension)?,
            entries: entries.to_vec(),
            slopes: vec![0.0; outputs],
            curvature: Curvature::default(),
            noise,
            scale,
            z: vec![],
        })
    }

    /// Takes `x` to the next sample and writes Φ and W.
    pub fn advance(
        &mut self,
        driven: &mut Driven,
        from: f64,
        to: f64,
        x: &mut [f64],
        moments: &mut Moments,
    ) -> Result<(), Error> {
        let n = x.len();
        let noisy = !self.noise.is_empty();
        let width = Linearised::width(n, noisy);
        Linearised::begin(x, noisy, &mut self.z);
        let mut flow = Linearised {
            driven,
            entries: &self.entries,
            slopes: &mut self.slopes,
            curvature: &mut self.curvature,
            noise: &self.noise,
        };
        self.integrator.advance(&mut flow, from, to, &mut self.z)?;
        x.copy_from_slice(&self.z[..n]);
        let columns = |first: usize, scale: f64| {
            let rows = self.z[n..].chunks_exact(width);
            let entries = rows.flat_map(move |row| &row[first..first + n]);
            entries.map(move |e| scale * e)
        };
        moments.transition.fill(columns(0, 1.0));
        if let Some(noise) = &mut moments.noise {
            noise.fill(columns(n, self.scale));
        }
        Ok(())
    }
}

impl Persist for Joint {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.integrator.walk(walk)
    }
}

/// x̂' = f(t, x̂, u) with Φ' = FΦ and W' = FW + WFᵀ + Q/q, F = ∂f/∂x along x̂: from Φ = I and
/// W = 0 at one sample to P⁻ = ΦPΦᵀ + qW at the next, the solution of P' = FP + PFᵀ + Q.
///
/// In this form no error of the integration makes P indefinite. The state is x̂, then the
/// rows of (Φ W); W is left out where Q = 0. q is the largest entry of Q: tolerances then see
/// W in units of time.
struct Linearised<'a> {
    driven: &'a mut Driven,
    entries: &'a [(usize, usize)],
    /// values of the entries of F
    slopes: &'a mut [f64],
    curvature: &'a mut Curvature,
    /// diagonal of Q/q, empty where Q = 0
    noise: &'a [f64],
}

impl Linearised<'_> {
    /// Entries of a row of (Φ W).
    fn width(n: usize, noisy: bool) -> usize {
        if noisy { 2 * n } else { n }
    }

    /// The state at a sample.
    fn begin(x: &[f64], noisy: bool, z: &mut Vec<f64>) {
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

    fn slopes(&mut self, t: f64, z: &[f64], slopes: &mut Slopes) -> bool {
        let n = self.driven.dimension();
        let width = Self::width(n, !self.noise.is_empty());
        if !(self.driven).output_slopes(t, &z[..n], &mut self.curvature.second) {
            return false;
        }
        self.driven.evaluation.outputs(t, &z[..n], self.slopes);
        let layout = Layout { n, width };
        self.curvature
            .write(layout, self.entries, self.slopes, z, slopes);
        true
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.driven.events()
    }

    fn names(&self) -> Vec<String> {
        self.driven.names()
    }

    fn not_finite(&mut self, t: f64, z: &[f64]) -> Error {
        let n = self.driven.dimension();
        self.driven.not_finite(t, &z[..n.min(z.len())])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BetweenSamples, Function, System};
    use lynkeus_expr::{Graph, Node, jacobian};

    /// The Jacobian of x̂, Φ and W together against differences, where F depends on x̂ and W is
    /// not even symmetric; with and without W.
    #[test]
    fn the_jacobian_of_the_variational_equation_is_exact() {
        let g = Graph::new();
        let [time, w] = ["time", "w"].map(|name| g.symbol(name));
        let x = ["x", "y", "z"].map(|name| g.symbol(name));
        let dx = [
            x[1] * x[2] + w,
            (x[0] * 3.0).sin(),
            x[2] * x[2] * x[0] - x[1],
        ];
        let symbols = x.map(|x| x.node());
        let derivatives = dx.map(|dx| dx.node());
        let F = jacobian::forward(&g, &derivatives, &symbols).entries;
        let entries: Vec<(usize, usize)> = F.iter().map(|e| (e.0, e.1)).collect();
        let outputs: Vec<(String, Node)> = F.iter().map(|e| (String::new(), e.2)).collect();
        let states = x.map(|x| ("x".to_owned(), x.node(), 0.0));
        let signals = [("w".to_owned(), w.node())];
        let flow = System::new(&g, time.node(), &states, &signals, &derivatives, &outputs);
        let mut driven = Driven::new(&flow.unwrap(), BetweenSamples::Hold);
        driven.start(&[0.7]);
        for noise in [vec![], vec![0.3, 1.0, 0.5]] {
            let mut linearised = Linearised {
                driven: &mut driven,
                entries: &entries,
                slopes: &mut vec![0.0; entries.len()],
                curvature: &mut Curvature::default(),
                noise: &noise,
            };
            let dimension = linearised.dimension();
            let z: Vec<f64> = (0..dimension)
                .map(|i| 1.5 + (1.3 * i as f64).sin())
                .collect();
            let (mut exact, mut differences) = (Slopes::default(), Slopes::default());
            assert!(linearised.slopes(0.0, &z, &mut exact));
            let mut f = Function::new(dimension, |t, z: &[f64], dz: &mut [f64]| {
                linearised.derivatives(t, z, dz);
            });
            differences.look(&mut f, 0.0, &z);
            let off = exact.dense(dimension) - differences.dense(dimension);
            assert!(off.amax() < 1e-6, "{}", off.amax());
        }
    }
}
