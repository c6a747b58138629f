//! From one sample to the next: the estimate x̂, the state-transition matrix Φ and the covariance W of
//! what the process noise comes to.

mod joint;
mod piecewise;
mod series;

use std::sync::Arc;

use super::belief::Belief;
use super::profile::{Profile, Skyline};
use super::root::{Factor, Root, dot};
use crate::Evaluation;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, Linearised, Method, Step};
use joint::Joint;
use piecewise::Piecewise;
use series::Transition;

/// Up to so many states x̂, Φ and W are integrated together, and wherever steps are given: these are
/// then the steps of all three.
const FEW: usize = 8;

/// Φ' = FΦ and W' = FW + WFᵀ + Q along the estimate, from Φ = I and W = 0 at a sample: the
/// transition, and W = ∫ Φ(T,s) Q Φ(T,s)ᵀ ds, what the process noise comes to at the next sample.
#[derive(Clone, Debug)]
pub(crate) struct Propagation {
    way: Scheme,
    transition: Transition<Profile>,
    /// of W
    factor: Factor,
    n: usize,
}

/// How Φ and W are found.
#[derive(Clone, Debug)]
enum Scheme {
    Joint(Box<Joint>),
    Piecewise(Box<Piecewise>),
}

impl Propagation {
    /// Of a flow with F, and the densities of the noise on its states.
    pub fn new(flow: &Linearised, process_noise: &[f64], method: Method) -> Result<Self, Error> {
        let n = flow.system().states().len();
        let is_given = matches!(method, Method::Rk4(Step::AtMost(_) | Step::Substeps(_)));
        let way = match n <= FEW || is_given {
            true => Scheme::Joint(Box::new(Joint::new(flow, process_noise, method)?)),
            false => Scheme::Piecewise(Box::new(Piecewise::new(flow, process_noise, method)?)),
        };
        Ok(Self {
            way,
            transition: Transition::start(n, process_noise.iter().any(|q| *q > 0.0)),
            factor: Factor::default(),
            n,
        })
    }

    /// Takes `x` to the next sample, from the belief's estimate.
    pub fn advance(
        &mut self,
        driven: &mut Evaluation,
        belief: &Belief,
        from: f64,
        to: f64,
        x: &mut Vec<f64>,
    ) -> Result<(), Error> {
        match &mut self.way {
            Scheme::Joint(joint) => joint.advance(driven, from, to, x, &mut self.transition)?,
            Scheme::Piecewise(variation) => {
                self.transition = variation.advance(driven, belief, from, to, x)?;
            }
        }
        Ok(())
    }

    /// Φ of the last way.
    pub fn transition(&self) -> &Profile {
        &self.transition.matrix
    }

    /// Adds the rows of Lᵀ, W = LLᵀ.
    pub fn push_root(&mut self, rows: &mut Vec<f64>) {
        let Some(noise) = &self.transition.noise else {
            return;
        };
        let n = self.n;
        let lower = self.factor.of(noise.entries(), n);
        let first = rows.len();
        rows.resize(first + n * n, 0.0);
        let rows = &mut rows[first..];
        for (i, row) in lower.chunks_exact(n).enumerate() {
            for (k, entry) in row[..=i].iter().enumerate() {
                rows[k * n + i] = *entry;
            }
        }
    }
}

impl Persist for Propagation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        match &mut self.way {
            Scheme::Joint(joint) => joint.walk(walk),
            Scheme::Piecewise(variation) => variation.walk(walk),
        }
    }
}

/// x⁻ = φ(x̃) + Φ(x − x̃) and P⁻ = ΦPΦᵀ + W about a state x̃.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stage {
    /// x̃
    pub about: Vec<f64>,
    /// φ(x̃)
    pub end: Vec<f64>,
    pub transition: Arc<Skyline>,
    /// rows whose sum of squares is W; none where nothing disturbs the states
    pub noise: Vec<f64>,
}

impl Stage {
    /// Of so many states.
    pub fn walk(&mut self, walk: &mut Walk<'_>, states: usize) -> Result<(), Damaged> {
        for vector in [&mut self.about, &mut self.end] {
            vector.resize(states, 0.0);
            walk.numbers(vector)?;
        }
        Arc::make_mut(&mut self.transition).walk(walk, states)?;
        let mut is_disturbed = !self.noise.is_empty();
        walk.flag(&mut is_disturbed)?;
        let count = if is_disturbed { states * states } else { 0 };
        self.noise.resize(count, 0.0);
        walk.numbers(&mut self.noise)
    }

    /// What is believed at the next sample.
    pub fn carry(&self, after: &Belief) -> Belief {
        let n = self.end.len();
        let off: Vec<f64> = after
            .x
            .iter()
            .zip(&self.about)
            .map(|(x, a)| x - a)
            .collect();
        let moved = self.end.iter().zip(self.transition.rows());
        let x = moved.map(|(x, (first, row))| x + dot(row, &off[first..]));
        let x = x.collect();
        let mut rows = Vec::with_capacity(self.noise.len() + n * n);
        rows.extend_from_slice(&self.noise);
        let mut sums = vec![0.0; n];
        push_carried(self.transition.rows(), &after.root, &mut rows, &mut sums);
        let mut root = Root {
            n,
            entries: vec![0.0; n * n],
        };
        root.of_rows_with(&mut rows, &mut sums);
        Belief { x, root }
    }
}

/// Adds the rows of (ΦS)ᵀ, for the rows of Φ; with room for n numbers.
pub(crate) fn push_carried<'m>(
    transition: impl Iterator<Item = (usize, &'m [f64])>,
    root: &Root,
    rows: &mut Vec<f64>,
    sums: &mut [f64],
) {
    let n = root.n;
    let begin = rows.len();
    rows.resize(begin + n * n, 0.0);
    for (i, (first, row)) in transition.enumerate() {
        sums.fill(0.0);
        for (j, phi) in (first..).zip(row) {
            for (sum, s) in sums.iter_mut().zip(&root.row(j)[..=j]) {
                *sum += phi * s;
            }
        }
        let column = rows[begin + i..].iter_mut().step_by(n);
        column.zip(&*sums).for_each(|(into, sum)| *into = *sum);
    }
}
