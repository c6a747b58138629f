//! Smoothers: the estimate at a sample given later ones.

use super::root::{Root, dot};
use crate::snapshot::{Damaged, Persist, Walk};

/// What one reading did.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Correction {
    /// its row of C
    pub slopes: Vec<f64>,
    /// its innovation after the readings before it
    pub innovation: f64,
    /// the innovation's variance α
    pub variance: f64,
    /// k
    pub gain: Vec<f64>,
}

/// What one sample did.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// Φ from the sample before, row by row; none at the first and at repeated times
    pub transition: Option<Vec<f64>>,
    /// x̂⁺ and a root of P⁺
    pub x: Vec<f64>,
    pub root: Root,
    pub corrections: Vec<Correction>,
}

impl Correction {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(&mut self.slopes)?;
        walk.number(&mut self.innovation)?;
        walk.number(&mut self.variance)?;
        walk.numbers(&mut self.gain)
    }
}

impl Step {
    fn nothing(n: usize) -> Self {
        Self {
            transition: None,
            x: vec![0.0; n],
            root: Root::diagonal(&vec![0.0; n]),
            corrections: vec![],
        }
    }

    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        let n = self.x.len();
        walk.numbers(&mut self.x)?;
        self.root.walk(walk)?;
        walk.optional(&mut self.transition, |walk, transition: &mut Vec<f64>| {
            transition.resize(n * n, 0.0);
            walk.numbers(transition)
        })?;
        let count = walk.length(self.corrections.len())?;
        let room = Correction {
            slopes: vec![0.0; n],
            gain: vec![0.0; n],
            ..Correction::default()
        };
        self.corrections.resize(count, room);
        self.corrections.iter_mut().try_for_each(|c| c.walk(walk))
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
pub(super) struct History {
    steps: Vec<Step>,
}

/// What later samples say: x̂ˢ = x̂⁺ − P⁺λ, Pˢ = P⁺ − P⁺ΛP⁺.
pub(super) struct Adjoint {
    pub vector: Vec<f64>,
    /// Λ, row by row; empty where no deviations are asked for
    matrix: Vec<f64>,
}

impl History {
    /// Of a filter of n states.
    pub fn walk(&mut self, walk: &mut Walk<'_>, n: usize) -> Result<(), Damaged> {
        let count = walk.length(self.steps.len())?;
        self.steps.resize_with(count, || Step::nothing(n));
        self.steps.iter_mut().try_for_each(|step| step.walk(walk))
    }

    pub fn push(&mut self, step: Step) {
        self.steps.push(step);
    }

    /// By the recursion of Bryson and Frazier, backward from the last sample or from `lag`
    /// samples later: λ = 0, Λ = 0 there, and over each reading y = cᵀx + v with gain k
    /// λ ← (I − k cᵀ)ᵀλ − c ν/α, Λ ← (I − k cᵀ)ᵀΛ(I − k cᵀ) + c cᵀ/α, then over the flow
    /// λ ← Φᵀλ, Λ ← ΦᵀΛΦ. It equals the smoother of Rauch, Tung and Striebel,
    /// x̂ˢ = x̂⁺ + P⁺Φᵀ(P⁻)⁻¹(x̂ˢ' − x̂⁻'), and never inverts P⁻.
    pub fn smoothed(&self, lag: Option<usize>, deviations: bool) -> Vec<Smoothed> {
        let count = self.steps.len();
        let mut result = vec![];
        match lag {
            None => {
                let mut adjoint = self.nothing(deviations);
                for k in (0..count).rev() {
                    result.push(self.at(k, &adjoint));
                    self.back(k, &mut adjoint);
                }
                result.reverse();
            }
            Some(lag) => {
                for k in 0..count {
                    let mut adjoint = self.nothing(deviations);
                    for later in (k + 1..=(k + lag).min(count - 1)).rev() {
                        self.back(later, &mut adjoint);
                    }
                    result.push(self.at(k, &adjoint));
                }
            }
        }
        result
    }

    fn nothing(&self, deviations: bool) -> Adjoint {
        let n = self.steps.first().map_or(0, |s| s.x.len());
        match deviations {
            true => Adjoint::with_matrix(n),
            false => Adjoint::nothing(n),
        }
    }

    fn at(&self, k: usize, adjoint: &Adjoint) -> Smoothed {
        let Step { x, root, .. } = &self.steps[k];
        let n = x.len();
        let shift = root.covariance_times(&adjoint.vector);
        let estimate = x.iter().zip(&shift).map(|(x, s)| x - s).collect();
        // without Λ there is nothing to tell
        let told = if adjoint.matrix.is_empty() { 0 } else { n };
        let deviations = (0..told).map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            let column = root.covariance_times(&unit);
            let less = quadratic(&adjoint.matrix, &column);
            (column[i] - less).max(0.0).sqrt()
        });
        Smoothed {
            estimate,
            deviations: deviations.collect(),
        }
    }

    /// From after sample k to after the sample before it.
    fn back(&self, k: usize, adjoint: &mut Adjoint) {
        let step = &self.steps[k];
        for correction in step.corrections.iter().rev() {
            adjoint.over(correction);
        }
        if let Some(transition) = &step.transition {
            adjoint.through(transition);
        }
    }
}

fn quadratic(matrix: &[f64], v: &[f64]) -> f64 {
    let rows = matrix.chunks_exact(v.len().max(1));
    rows.zip(v).map(|(row, x)| x * dot(row, v)).sum()
}

impl Adjoint {
    pub fn nothing(n: usize) -> Self {
        Self {
            vector: vec![0.0; n],
            matrix: vec![],
        }
    }

    fn with_matrix(n: usize) -> Self {
        Self {
            matrix: vec![0.0; n * n],
            ..Self::nothing(n)
        }
    }

    /// λ over a reading; returns how hard the reading pushes along its row of C.
    pub fn over_vector(&mut self, correction: &Correction) -> f64 {
        let pull =
            dot(&correction.gain, &self.vector) + correction.innovation / correction.variance;
        for (l, c) in self.vector.iter_mut().zip(&correction.slopes) {
            *l -= c * pull;
        }
        pull
    }

    /// Φᵀλ.
    pub fn vector_through(&mut self, transition: &[f64]) {
        let mut vector = vec![0.0; self.vector.len()];
        for (l, row) in self
            .vector
            .iter()
            .zip(transition.chunks_exact(vector.len().max(1)))
        {
            for (into, phi) in vector.iter_mut().zip(row) {
                *into += l * phi;
            }
        }
        self.vector = vector;
    }

    fn over(&mut self, correction: &Correction) {
        self.over_vector(correction);
        if self.matrix.is_empty() {
            return;
        }
        let Correction {
            slopes: c,
            variance,
            gain: k,
            ..
        } = correction;
        let n = c.len();
        // Λ − c (Λk)ᵀ − (Λk) cᵀ + c cᵀ (kᵀΛk + 1/α)
        let along: Vec<f64> = self.matrix.chunks_exact(n).map(|row| dot(row, k)).collect();
        let both = dot(k, &along) + 1.0 / variance;
        for (i, row) in self.matrix.chunks_exact_mut(n).enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry += c[i] * c[j] * both - c[i] * along[j] - along[i] * c[j];
            }
        }
    }

    fn through(&mut self, transition: &[f64]) {
        let n = self.vector.len();
        self.vector_through(transition);
        if self.matrix.is_empty() {
            return;
        }
        // ΛΦ, then Φᵀ(ΛΦ)
        let mut half = vec![0.0; n * n];
        for (i, row) in transition.chunks_exact(n).enumerate() {
            for (from, into) in self.matrix.chunks_exact(n).zip(half.chunks_exact_mut(n)) {
                for (into, phi) in into.iter_mut().zip(row) {
                    *into += from[i] * phi;
                }
            }
        }
        let mut matrix = vec![0.0; n * n];
        for (row, half) in transition.chunks_exact(n).zip(half.chunks_exact(n)) {
            for (phi, into) in row
                .iter()
                .zip(matrix.chunks_exact_mut(n))
                .filter(|(phi, _)| **phi != 0.0)
            {
                for (into, h) in into.iter_mut().zip(half) {
                    *into += phi * h;
                }
            }
        }
        self.matrix = matrix;
    }
}
