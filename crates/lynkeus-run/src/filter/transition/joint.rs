//! The estimate and its variational equation, integrated together.

use std::sync::Arc;

use super::series::Transition;
use super::straight::Straight;
use crate::Evaluation;
use crate::events::{Cause, Clauses, JumpSlopes, Memory, Seen};
use crate::filter::belief::Belief;
use crate::filter::profile::Profile;
use crate::filter::root::Root;
use crate::integrator::{check_interval, fixed_steps, instant};
use crate::method::are_finite;
use crate::{Dynamics, Error, Events, Integrator, Linearised, Method, Place, Result, Slopes, Step};

/// x̂, Φ and W by one integration, for flows with few states.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub integrator: Integrator,
    equation: Equation,
    /// the first step from a sample, where steps are those of Runge and Kutta
    straight: Option<Straight>,
    step: Option<Step>,
    /// q, the largest entry of Q
    scale: f64,
    /// the state of [`Variational`]
    z: Vec<f64>,
}

impl Joint {
    pub fn new(flow: &Linearised, process_noise: &[f64], method: Method) -> Result<Self> {
        let scale = process_noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let noise = match scale > 0.0 {
            true => process_noise.iter().map(|q| q / scale).collect(),
            false => vec![],
        };
        let step = match method {
            Method::Rk4(step) => Some(step),
            _ => None,
        };
        let noisy = || process_noise.iter().map(|q| *q > 0.0).collect();
        let equation = Equation::new(flow, noise);
        // a step with an event in it is none as one function
        let has_clauses = flow.system().has_clauses();
        Ok(Self {
            integrator: Integrator::new(method, equation.dimension())?,
            equation,
            straight: step
                .filter(|_| !has_clauses)
                .map(|_| Straight::new(flow, noisy())),
            step,
            scale,
            z: vec![],
        })
    }

    /// Takes `x` to the next sample and writes Φ and W. What it makes of the root of a covariance is
    /// [taken](Self::take) afterwards, where it was found on the way.
    pub fn advance(
        &mut self,
        driven: &mut Evaluation,
        root: &Root,
        from: f64,
        to: f64,
        x: &mut [f64],
        transition: &mut Transition<Profile>,
    ) -> Result<()> {
        let equation = &mut self.equation;
        let (n, width) = (equation.n, equation.width);
        self.z.clear();
        self.z.extend_from_slice(x);
        self.z.resize(equation.dimension(), 0.0);
        (0..n).for_each(|i| self.z[n + i * width + i] = 1.0);
        let first = self.straight.as_mut();
        let mut flow = Variational {
            driven,
            equation,
            first: first.map(|straight| First {
                straight,
                root,
                scale: self.scale,
                is_over: false,
            }),
        };
        self.integrator.advance(&mut flow, from, to, &mut self.z)?;
        x.copy_from_slice(&self.z[..n]);
        self.write(&self.z, transition);
        Ok(())
    }

    /// Takes the state of a belief to the next sample where that is one step, and one function; the transition is
    /// [written](Self::write_last) when somebody asks for it, and its root may be [taken](Self::take).
    pub fn leap(
        &mut self,
        driven: &mut Evaluation,
        belief: &mut Belief,
        from: f64,
        to: f64,
    ) -> bool {
        let Some(straight) = &mut self.straight else {
            return false;
        };
        let length = self.step.and_then(|step| step.length(to - from));
        let steps = length.and_then(|length| fixed_steps(from, to, length).ok());
        let is_one = steps == Some(1) && check_interval(from, to).is_ok();
        if !is_one || driven.system().has_instants() {
            return false;
        }
        let h = instant(from, to, 1, 1) - from;
        let noise = (&*self.equation.noise, self.scale);
        if !straight.run(driven, (from, h), &belief.x, noise, &belief.root) {
            return false;
        }
        let next = straight.next();
        let is_sound = are_finite(next);
        if is_sound {
            belief.x.copy_from_slice(&next[..self.equation.n]);
        }
        is_sound
    }

    /// Goes on by the loops alone.
    #[cfg(test)]
    pub fn forget_code(&mut self) {
        self.straight = None;
    }

    /// Writes Φ and W of the last leap.
    pub fn write_last(&self, transition: &mut Transition<Profile>) {
        if let Some(straight) = &self.straight {
            self.write(straight.next(), transition);
        }
    }

    fn write(&self, z: &[f64], transition: &mut Transition<Profile>) {
        let (n, width) = (self.equation.n, self.equation.width);
        let columns = |first: usize, scale: f64| {
            let rows = z[n..].chunks_exact(width);
            let entries = rows.flat_map(move |row| &row[first..first + n]);
            entries.map(move |e| scale * e)
        };
        transition.matrix.fill(columns(0, 1.0));
        if let Some(noise) = &mut transition.noise {
            noise.fill(columns(n, self.scale));
        }
    }

    /// Writes the root of ΦPΦᵀ + W over the last way, where one step made it.
    pub fn take(&mut self, root: &mut Root) -> bool {
        let mut straight = self.straight.iter_mut();
        straight.any(|straight| straight.take(root))
    }
}

/// x̂' = f(t, x̂, u) with Φ' = FΦ and W' = FW + WFᵀ + Q/q, F = ∂f/∂x along x̂: from Φ = I and
/// W = 0 at one sample to P⁻ = ΦPΦᵀ + qW at the next, the solution of P' = FP + PFᵀ + Q.
///
/// In this form no error of the integration makes P indefinite. The state is x̂, then the
/// rows of (Φ W); W is left out where Q = 0. q is the largest entry of Q: tolerances then see
/// W in units of time.
struct Variational<'a> {
    driven: &'a mut Evaluation,
    equation: &'a mut Equation,
    first: Option<First<'a>>,
}

/// Steps as functions; the first one is from Φ = I and W = 0.
struct First<'a> {
    straight: &'a mut Straight,
    root: &'a Root,
    scale: f64,
    is_over: bool,
}

/// What the variational equation is made of, and how the right-hand sides f, FΦ and FW + WFᵀ depend on
/// x̂, Φ and W: F on each column, and through ∂F/∂x on x̂.
#[derive(Clone, Debug)]
struct Equation {
    n: usize,
    /// numbers in a row of (Φ W)
    width: usize,
    /// where F has entries
    entries: Vec<(usize, usize)>,
    /// their values
    slopes: Vec<f64>,
    /// diagonal of Q/q, empty where Q = 0
    noise: Vec<f64>,
    /// of the last jump
    jump: JumpSlopes,
    /// ∂F/∂x: its rows are the entries of F
    second: Slopes,
    /// where the entries of ∂F/∂x were when the terms were made
    known: Option<Arc<[Place]>>,
    places: Arc<[Place]>,
    terms: Vec<Term>,
}

/// One entry of the Jacobian.
#[derive(Clone, Copy, Debug)]
enum Term {
    /// an entry of F
    First(usize),
    /// an entry of ∂F/∂x times a number of the state
    Second { entry: usize, of: usize },
}

impl Dynamics for Variational<'_> {
    fn dimension(&self) -> usize {
        self.equation.dimension()
    }

    fn derivatives(&mut self, t: f64, z: &[f64], dz: &mut [f64]) {
        if let Some(first) = &mut self.first {
            first.straight.forget();
        }
        let equation = &mut *self.equation;
        let (n, width, slopes) = (equation.n, equation.width, &mut equation.slopes);
        let (x, rows) = z.split_at(n);
        let (dx, drows) = dz.split_at_mut(n);
        self.driven.derivatives(t, x, dx);
        self.driven.outputs(t, x, slopes);
        drows.fill(0.0);
        for (&(i, j), slope) in equation.entries.iter().zip(&*slopes) {
            let into = &mut drows[i * width..(i + 1) * width];
            for (into, from) in into.iter_mut().zip(&rows[j * width..(j + 1) * width]) {
                *into += slope * from;
            }
        }
        // FW is there; its transpose and Q/q are added
        for (i, q) in equation.noise.iter().enumerate() {
            for j in 0..i {
                let (a, b) = (i * width + n + j, j * width + n + i);
                let sum = drows[a] + drows[b];
                (drows[a], drows[b]) = (sum, sum);
            }
            let diagonal = &mut drows[i * width + n + i];
            *diagonal = 2.0 * *diagonal + q;
        }
    }

    fn steps(&mut self, steps: &[[f64; 2]], z: &[f64], next: &mut [f64]) -> bool {
        let (Some(first), &[[t, h]]) = (&mut self.first, steps) else {
            return false;
        };
        let noise = &*self.equation.noise;
        let straight = &mut first.straight;
        if std::mem::replace(&mut first.is_over, true) {
            return straight.go_on(self.driven, (t, h), z, noise, next);
        }
        let x = &z[..self.equation.n];
        let noise = (noise, first.scale);
        let is_done = straight.run(self.driven, (t, h), x, noise, first.root);
        if is_done {
            next.copy_from_slice(straight.next());
        }
        is_done
    }

    fn slopes(&mut self, t: f64, z: &[f64], slopes: &mut Slopes) -> bool {
        let Self {
            driven, equation, ..
        } = self;
        let x = &z[..equation.n];
        if !driven.output_slopes(t, x, &mut equation.second) {
            return false;
        }
        driven.outputs(t, x, &mut equation.slopes);
        equation.write_jacobian(z, slopes);
        true
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.driven.events()
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.driven.clauses()
    }

    fn watch(&mut self, t: f64, z: &[f64], seen: &mut Vec<Seen>) {
        self.driven.watch(t, z, seen);
    }

    fn rates(&mut self, t: f64, z: &[f64], dz: &[f64]) -> Vec<f64> {
        self.driven.rates(t, z, dz)
    }

    fn truths(&mut self, t: f64, z: &[f64]) -> Result<Vec<bool>> {
        self.driven.truths(t, z)
    }

    fn happen(&mut self, t: f64, z: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        let jump = &mut self.equation.jump;
        self.driven.jump(t, z, memory, Some(jump))
    }

    /// Φ⁺ = ΞΦ and W⁺ = ΞWΞᵀ.
    fn settle(
        &mut self,
        (t, z): (f64, &[f64]),
        jumped: &mut [f64],
        [before, after]: [&[f64]; 2],
        cause: Option<Cause>,
        line: usize,
    ) -> Result<()> {
        let (n, width) = (self.equation.n, self.equation.width);
        let rates = [&before[..n], &after[..n]];
        let jump = &self.equation.jump;
        let (matrix, moved) = self.driven.saltation((t, z), jump, rates, cause, line)?;
        for (x, moved) in jumped.iter_mut().zip(moved) {
            *x += moved;
        }
        let rows = jumped[n..].to_vec();
        for (i, into) in jumped[n..].chunks_exact_mut(width).enumerate() {
            into.fill(0.0);
            for (entry, row) in matrix[i * n..(i + 1) * n]
                .iter()
                .zip(rows.chunks_exact(width))
            {
                into.iter_mut()
                    .zip(row)
                    .for_each(|(into, x)| *into += entry * x);
            }
        }
        if width > n {
            for row in jumped[n..].chunks_exact_mut(width) {
                let half = row[n..].to_vec();
                for (j, into) in row[n..].iter_mut().enumerate() {
                    let xi = &matrix[j * n..(j + 1) * n];
                    *into = half.iter().zip(xi).map(|(w, xi)| w * xi).sum();
                }
            }
        }
        Ok(())
    }

    fn names(&self) -> Vec<String> {
        self.driven.names()
    }

    fn not_finite(&mut self, t: f64, z: &[f64]) -> Error {
        let n = self.equation.n;
        self.driven.not_finite(t, &z[..n.min(z.len())])
    }
}

impl Equation {
    fn new(flow: &Linearised, noise: Vec<f64>) -> Self {
        let n = flow.system().states().len();
        Self {
            n,
            width: if noise.is_empty() { n } else { 2 * n },
            entries: flow.jacobians().state.places().to_vec(),
            slopes: vec![0.0; flow.system().outputs().len()],
            noise,
            jump: JumpSlopes::default(),
            second: Slopes::default(),
            known: None,
            places: Arc::default(),
            terms: vec![],
        }
    }

    fn dimension(&self) -> usize {
        self.n + self.n * self.width
    }

    /// Writes the Jacobian at the state z, F and ∂F/∂x being those there.
    fn write_jacobian(&mut self, z: &[f64], slopes: &mut Slopes) {
        let second = self.second.places();
        if self.known.as_ref().is_none_or(|k| !Arc::ptr_eq(k, second)) {
            self.known = Some(second.clone());
            self.arrange();
        }
        let values = slopes.at(&self.places);
        for (value, term) in values.iter_mut().zip(&self.terms) {
            *value = match *term {
                Term::First(entry) => self.slopes[entry],
                Term::Second { entry, of } => self.second.values()[entry] * z[of],
            };
        }
    }

    fn arrange(&mut self) {
        let mut all: Vec<(Place, Term)> = vec![];
        let mut add = |row, column, term| all.push((Place { row, column }, term));
        for (entry, &(i, j)) in self.entries.iter().enumerate() {
            add(i, j, Term::First(entry));
            for (row, of) in self.affected(i, j) {
                add(row, of, Term::First(entry));
            }
        }
        // outputs that are no entries of F may follow them
        let places = self.second.places().iter().enumerate();
        for (entry, at) in places.filter(|(_, at)| at.row < self.entries.len()) {
            let (i, j) = self.entries[at.row];
            for (row, of) in self.affected(i, j) {
                add(row, at.column, Term::Second { entry, of });
            }
        }
        self.places = all.iter().map(|(place, _)| *place).collect();
        self.terms = all.into_iter().map(|(_, term)| term).collect();
    }

    /// Which derivatives the entry (i, j) of F adds to, and of what it adds its multiple: (FΦ)ᵢ꜀ has
    /// Φⱼ꜀, and so has (FW)ᵢ꜀ and its mirror image.
    fn affected(&self, i: usize, j: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (n, width) = (self.n, self.width);
        let at = move |row: usize, column: usize| n + row * width + column;
        let transition = (0..n).map(move |c| (at(i, c), at(j, c)));
        let noise = (0..width - n).flat_map(move |c| {
            let of = at(j, n + c);
            [(at(i, n + c), of), (at(c, n + i), of)]
        });
        transition.chain(noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BetweenSamples, Function};
    use lynkeus_expr::Graph;

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
        let derivatives = dx.map(|dx| dx.node());
        let states = x.map(|x| ("x".to_owned(), x.node(), 0.0));
        let signals = [("w".to_owned(), w.node())];
        let flow = Linearised::flow(
            &g,
            time.node(),
            &states,
            &signals,
            &derivatives,
            &Default::default(),
        )
        .unwrap();
        let mut driven = flow.system().driven(BetweenSamples::Hold);
        driven.start(&[0.7]);
        for noise in [vec![], vec![0.3, 1.0, 0.5]] {
            let mut linearised = Variational {
                driven: &mut driven,
                equation: &mut Equation::new(&flow, noise),
                first: None,
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
