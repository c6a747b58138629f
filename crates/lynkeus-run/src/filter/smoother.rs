//! Smoothers: the estimate at a sample given later ones.

use super::belief::Belief;
use super::profile::Profile;
use super::root::dot;
use crate::manifold::Manifold;
use crate::snapshot::{Damaged, Persist, Walk};

/// What readings did that were taken together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Correction {
    /// their rows of C
    pub slopes: Vec<Vec<f64>>,
    /// their columns of K
    pub gains: Vec<Vec<f64>>,
    /// A⁻¹, A the covariance of their innovations, row by row
    pub information: Vec<f64>,
    /// A⁻¹ν, ν their innovations after the readings before them
    pub weighed: Vec<f64>,
}

impl Correction {
    /// Of one reading: its row of C, its innovation with the variance of that, its gain.
    pub fn single(slopes: Vec<f64>, innovation: f64, variance: f64, gain: Vec<f64>) -> Self {
        Self {
            slopes: vec![slopes],
            gains: vec![gain],
            information: vec![1.0 / variance],
            weighed: vec![innovation / variance],
        }
    }
}

/// What one sample did.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// Φ from the sample before; none at the first and at repeated times
    pub transition: Option<Profile>,
    /// where the planes touch in which all of it is told of quaternions, if not at x̂⁺
    pub touched: Option<Vec<f64>>,
    /// x̂⁺, P⁺
    pub belief: Belief,
    pub corrections: Vec<Correction>,
}

impl Correction {
    /// The same in what it was carried over to.
    pub fn transport(&mut self, manifold: &Manifold, from: &[f64], to: &[f64]) {
        for column in self.slopes.iter_mut().chain(&mut self.gains) {
            manifold.transport(from, to, column, 1);
        }
    }

    /// Of n states.
    fn walk(&mut self, walk: &mut Walk<'_>, n: usize) -> Result<(), Damaged> {
        let count = walk.length(self.gains.len())?;
        for columns in [&mut self.slopes, &mut self.gains] {
            columns.resize_with(count, || vec![0.0; n]);
            columns.iter_mut().try_for_each(|c| walk.numbers(c))?;
        }
        let entries = walk.length(self.information.len())?;
        if Some(entries) != count.checked_mul(count) {
            return Err(Damaged);
        }
        self.information.resize(entries, 0.0);
        walk.numbers(&mut self.information)?;
        self.weighed.resize(count, 0.0);
        walk.numbers(&mut self.weighed)
    }
}

impl Step {
    /// Of n states, to be walked over.
    fn nothing(n: usize) -> Self {
        let none = vec![0.0; n];
        Self {
            transition: None,
            touched: None,
            belief: Belief::new(&none, &none),
            corrections: vec![],
        }
    }

    /// Given what later samples say.
    fn given(&self, adjoint: &Adjoint, manifold: &Manifold) -> Smoothed {
        let Belief { x, root } = &self.belief;
        let n = x.len();
        let shift = root.covariance_times(&adjoint.vector);
        let mut estimate: Vec<f64> = x.iter().zip(&shift).map(|(x, s)| x - s).collect();
        manifold.retract(self.touched.as_ref().unwrap_or(x), &mut estimate);
        // without Λ there is nothing to tell
        let told = if adjoint.matrix.is_empty() { 0 } else { n };
        let deviations = (0..told).map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            let column = root.covariance_times(&unit);
            let less = quadratic(&adjoint.matrix, &column);
            // what later samples say is lost where numbers end: without it the deviation is no smaller
            let left = column[i] - if less.is_finite() { less } else { 0.0 };
            left.max(0.0).sqrt()
        });
        Smoothed {
            estimate,
            deviations: deviations.collect(),
        }
    }

    /// From after this sample to after the one before it.
    fn back(&self, adjoint: &mut Adjoint) {
        for correction in self.corrections.iter().rev() {
            adjoint.over(correction);
        }
        if let Some(transition) = &self.transition {
            adjoint.through(transition);
        }
    }

    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        let n = self.belief.x.len();
        self.belief.walk(walk)?;
        let transition = &mut self.transition;
        walk.optional(transition, |walk, transition| transition.walk(walk, n))?;
        walk.optional(&mut self.touched, |walk, touched| {
            touched.resize(n, 0.0);
            walk.numbers(touched)
        })?;
        let count = walk.length(self.corrections.len())?;
        self.corrections.resize_with(count, Correction::default);
        let mut corrections = self.corrections.iter_mut();
        corrections.try_for_each(|c| c.walk(walk, n))
    }
}

/// The estimate at a sample given later ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// x̂ˢ
    pub estimate: Vec<f64>,
    /// its standard deviations; empty where they were not asked for
    pub deviations: Vec<f64>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    pub steps: Vec<Step>,
    /// of a moving horizon: the states of the window at each sample, row after row
    pub windows: Vec<Vec<f64>>,
    pub manifold: Manifold,
}

/// What later samples say: x̂ˢ = x̂⁺ − P⁺λ, Pˢ = P⁺ − P⁺ΛP⁺.
pub(crate) struct Adjoint {
    pub vector: Vec<f64>,
    /// Λ, row by row; empty where no deviations are asked for
    matrix: Vec<f64>,
}

impl History {
    /// Of a filter of n states.
    pub fn walk(&mut self, walk: &mut Walk<'_>, n: usize) -> Result<(), Damaged> {
        let count = walk.length(self.steps.len())?;
        self.steps.resize_with(count, || Step::nothing(n));
        self.steps.iter_mut().try_for_each(|step| step.walk(walk))?;
        let count = walk.length(self.windows.len())?;
        self.windows.resize_with(count, Vec::new);
        self.windows.iter_mut().try_for_each(|window| {
            let count = walk.length(window.len())?;
            if n == 0 || !count.is_multiple_of(n) {
                return Err(Damaged);
            }
            window.resize(count, 0.0);
            walk.numbers(window)
        })
    }

    /// By the recursion of Bryson and Frazier, backward from the last sample or from `lag`
    /// samples later: λ = 0, Λ = 0 there, and over readings y = Cx + v with gain K
    /// λ ← (I − KC)ᵀλ − CᵀA⁻¹ν, Λ ← (I − KC)ᵀΛ(I − KC) + CᵀA⁻¹C, then over the flow
    /// λ ← Φᵀλ, Λ ← ΦᵀΛΦ. It equals the smoother of Rauch, Tung and Striebel,
    /// x̂ˢ = x̂⁺ + P⁺Φᵀ(P⁻)⁻¹(x̂ˢ' − x̂⁻'), and never inverts P⁻.
    ///
    /// `newest` are samples after those that are kept.
    pub fn smoothed(&self, newest: &[Step], lag: Option<usize>, deviations: bool) -> Vec<Smoothed> {
        let steps: Vec<&Step> = self.steps.iter().chain(newest).collect();
        let count = steps.len();
        let n = steps.first().map_or(0, |step| step.belief.x.len());
        let mut result = vec![];
        match lag {
            None => {
                let mut adjoint = Adjoint::nothing(n, deviations);
                for step in steps.iter().rev() {
                    result.push(step.given(&adjoint, &self.manifold));
                    step.back(&mut adjoint);
                }
                result.reverse();
            }
            Some(lag) => {
                for (k, step) in steps.iter().enumerate() {
                    let mut adjoint = Adjoint::nothing(n, deviations);
                    let last = k.saturating_add(lag).min(count - 1);
                    for later in steps[k + 1..=last].iter().rev() {
                        later.back(&mut adjoint);
                    }
                    result.push(step.given(&adjoint, &self.manifold));
                }
            }
        }
        result
    }

    /// The estimates, as each window has its rows: of n states, given up to `lag` later samples.
    pub fn in_windows(&self, n: usize, lag: usize) -> impl Iterator<Item = &[f64]> {
        let count = self.windows.len();
        (0..count).filter_map(move |k| {
            let last = (k + lag).min(count - 1);
            let window = &self.windows[last];
            let end = window.len().checked_sub((last - k) * n)?;
            window.get(end.checked_sub(n)?..end)
        })
    }
}

fn quadratic(matrix: &[f64], v: &[f64]) -> f64 {
    let rows = matrix.chunks_exact(v.len().max(1));
    rows.zip(v).map(|(row, x)| x * dot(row, v)).sum()
}

impl Adjoint {
    /// That they say nothing; whether deviations are asked for.
    pub fn nothing(n: usize, deviations: bool) -> Self {
        Self {
            vector: vec![0.0; n],
            matrix: vec![0.0; if deviations { n * n } else { 0 }],
        }
    }

    /// λ over readings; returns how hard each of them pushes along its row of C.
    pub fn over_vector(&mut self, correction: &Correction) -> Vec<f64> {
        let known = correction.gains.iter().zip(&correction.weighed);
        let pulls: Vec<f64> = known.map(|(k, w)| dot(k, &self.vector) + w).collect();
        for (c, pull) in correction.slopes.iter().zip(&pulls) {
            for (l, c) in self.vector.iter_mut().zip(c) {
                *l -= c * pull;
            }
        }
        pulls
    }

    /// Φᵀλ.
    pub fn vector_through(&mut self, transition: &Profile) {
        self.vector = transition.transposed_times(&self.vector);
    }

    fn over(&mut self, correction: &Correction) {
        self.over_vector(correction);
        if self.matrix.is_empty() {
            return;
        }
        // Λ − Cᵀ(ΛK)ᵀ − (ΛK)C + Cᵀ(KᵀΛK + A⁻¹)C
        let Correction { slopes, gains, .. } = correction;
        let (n, m) = (self.vector.len(), gains.len());
        let rows = || self.matrix.chunks_exact(n);
        let along = |k: &Vec<f64>| rows().map(|row| dot(row, k)).collect();
        let along: Vec<Vec<f64>> = gains.iter().map(along).collect();
        for a in 0..m {
            // what is taken from each row along C's row a
            let mut taken = along[a].clone();
            for b in 0..m {
                let both = dot(&gains[a], &along[b]) + correction.information[a * m + b];
                for (taken, c) in taken.iter_mut().zip(&slopes[b]) {
                    *taken -= both * c;
                }
            }
            for (i, row) in self.matrix.chunks_exact_mut(n).enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry -= slopes[a][i] * taken[j] + along[a][i] * slopes[a][j];
                }
            }
        }
        self.mirror();
    }

    /// Λ exactly symmetric: readings do not take away what rounding leaves of its difference from
    /// its transpose, and the flow of an unstable plant lets that grow.
    fn mirror(&mut self) {
        let n = self.vector.len();
        for i in 0..n {
            for j in 0..i {
                self.matrix[j * n + i] = self.matrix[i * n + j];
            }
        }
    }

    fn through(&mut self, transition: &Profile) {
        let n = self.vector.len();
        self.vector_through(transition);
        if self.matrix.is_empty() {
            return;
        }
        // ΦᵀΛ, then its rows times Φ
        let mut half = vec![0.0; n * n];
        for ((first, row), from) in transition.rows().zip(self.matrix.chunks_exact(n)) {
            for (phi, into) in row.iter().zip(half.chunks_exact_mut(n).skip(first)) {
                for (into, from) in into.iter_mut().zip(from) {
                    *into += phi * from;
                }
            }
        }
        let rows = half.chunks_exact(n);
        let rows = rows.flat_map(|row| transition.transposed_times(row));
        self.matrix = rows.collect();
        self.mirror();
    }
}
