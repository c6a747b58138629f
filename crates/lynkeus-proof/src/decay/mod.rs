//! Guaranteed decay of e' = (A(θ) − KC) e for every θ(t) in a box: quadratic Lyapunov
//! functions V = eᵀPe with V' ≤ −2·rate·V, found by linear matrix inequalities and
//! accepted by interval arithmetic.
//!
//! A(θ) = A₀ + Σ_k θ_k b_k e_{s_k}ᵀ has one uncertain number per nonlinear term and
//! state. With θ_k = m_k + δ_k h_k, |δ_k| ≤ 1 and one multiplier t_k > 0 for each, the
//! S-procedure gives one inequality of polynomial size,
//!
//! [ He(PA_m) + 2·rate·P + Σ t_k e_{s_k} e_{s_k}ᵀ   P B ]
//! [ BᵀP                                            −T ] < 0,    B = (h_k b_k), T = diag t
//!
//! (Boyd, El Ghaoui, Feron and Balakrishnan 1994, section 5.1: the diagonal norm-bound
//! inclusion). What multiplies several terms at once, such as a flow rate, is not made
//! an uncertain number but a list of models, one per vertex of its range, with one P
//! for all.

use lynkeus_expr::Interval;
use nalgebra::{DMatrix, DVector};

use crate::matrix::IntervalMatrix;
use crate::vertices::{Bounds, varying, vertices};

pub use analysis::{fastest, prove};
pub use check::{holds, holds_between_samples};
pub use growth::is_unstable;
pub use implicit::{ImplicitProof, fastest_implicit, holds_implicit, prove_implicit};
pub use reach::Reach;
pub use sampled::{longest, prove_between_samples};
pub use samples::{Samples, holds_between_samples_together};
pub use synthesis::{Aim, Gain, NoGain, Request, design, is_reachable};
pub use together::{Covered, Field, Together, fastest_together, holds_together, prove_together};

mod analysis;
mod check;
mod frame;
mod growth;
mod implicit;
mod reach;
mod sampled;
mod samples;
mod synthesis;
mod together;

/// A Lyapunov function with its multipliers: what has to be checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// V' ≤ −2·rate·V
    pub rate: f64,
    /// V = eᵀPe
    pub P: DMatrix<f64>,
    /// per model: one multiplier per sector
    pub multipliers: Vec<DVector<f64>>,
}

/// A Lyapunov function that knows the time τ since the last sample: V = zᵀP(τ)z over z = (e, ε), where ε = w − y is
/// how far a measurement that follows the model has come from the plant's own, in units of the state that its sensor
/// shows. P(τ) goes along lines between its values at the ends of pieces of equal length.
///
/// A sample sets ε to 0. With P(0) without entries between e and ε, and P(τ) no smaller than what P(0) makes of e, no
/// sample raises V, whenever it comes; and V' ≤ −2·rate·V between samples. So eᵀP(0)e ≤ V falls for every sequence of
/// samples none of which is further than `interval` from the next (Briat, *Automatica* 49 (2013) 3449, with the clock
/// free at its end).
#[derive(Clone, Debug, PartialEq)]
pub struct SampledProof {
    /// the longest time from a sample to the next
    pub interval: f64,
    /// V' ≤ −2·rate·V
    pub rate: f64,
    /// P at the ends of the pieces, from τ = 0 on
    pub P: Vec<DMatrix<f64>>,
    /// per piece, at its two ends: per model one multiplier per sector
    pub multipliers: Vec<[Vec<DVector<f64>>; 2]>,
}

/// S with (e, σ) = S (e, ε) and back: σ_j = e_s − ε_j for the state s that sensor j shows.
///
/// # Panics
/// Where more are shown than `size` has room for, or a state that is none.
pub fn between_errors(size: usize, shown: &[usize]) -> DMatrix<f64> {
    let mut S = DMatrix::identity(size, size);
    for (row, &state) in (size - shown.len()..).zip(shown) {
        S[(row, row)] = -1.0;
        S[(row, state)] = 1.0;
    }
    S
}

/// θ b e_sᵀ with θ in a range: the slope of one nonlinear term in one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Sector {
    /// s, the state the term depends on
    pub column: usize,
    /// b, the weight of the term in each equation
    pub direction: Vec<Interval>,
    /// range of the slope θ
    pub range: Interval,
}

impl Sector {
    /// m, the middle of the range.
    pub fn middle(&self) -> f64 {
        self.range.midpoint()
    }

    /// h with m − h ≤ θ ≤ m + h.
    pub fn half(&self) -> f64 {
        let from_middle = self.range - Interval::point(self.middle());
        from_middle.magnitude()
    }

    fn weight(&self, row: usize) -> f64 {
        self.direction[row].midpoint()
    }
}

/// e' = (A₀ + Σ θ_k b_k e_{s_k}ᵀ) e
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorModel {
    /// A₀, n×n
    pub constant: IntervalMatrix,
    /// the uncertain terms
    pub sectors: Vec<Sector>,
}

impl ErrorModel {
    /// Number of states.
    pub fn size(&self) -> usize {
        self.constant.len()
    }

    /// The model with A₀ − KC, where output j shows the state `measured[j]`.
    pub fn corrected(&self, K: &DMatrix<f64>, measured: &[usize]) -> Self {
        let mut corrected = self.clone();
        for (i, row) in corrected.constant.iter_mut().enumerate() {
            for (j, &state) in measured.iter().enumerate() {
                row[state] = row[state] - Interval::point(K[(i, j)]);
            }
        }
        corrected
    }

    /// The model of e/scale: A becomes D⁻¹AD with D = diag(scale), over `unit` of time.
    pub fn scaled(&self, scale: &[f64], unit: f64) -> Self {
        let point = Interval::point;
        let factor = |i: usize, j: usize| point(scale[j]) / point(scale[i]) * point(unit);
        let mut scaled = self.clone();
        for (i, row) in scaled.constant.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = *entry * factor(i, j);
            }
        }
        for sector in &mut scaled.sectors {
            for (i, entry) in sector.direction.iter_mut().enumerate() {
                *entry = *entry * factor(i, sector.column);
            }
        }
        scaled
    }

    /// The middles of the ranges.
    pub fn middles(&self) -> Vec<f64> {
        self.sectors.iter().map(Sector::middle).collect()
    }

    /// A₀ + Σ m_k b_k e_{s_k}ᵀ, in numbers.
    fn nominal(&self) -> DMatrix<f64> {
        self.at(&self.middles())
    }

    /// A(θ), in numbers.
    pub fn at(&self, θ: &[f64]) -> DMatrix<f64> {
        let n = self.size();
        let mut A = DMatrix::from_fn(n, n, |i, j| self.constant[i][j].midpoint());
        for (sector, θ) in self.sectors.iter().zip(θ) {
            for i in 0..n {
                A[(i, sector.column)] += θ * sector.weight(i);
            }
        }
        A
    }

    /// B = (h_k b_k), in numbers.
    fn spread(&self) -> DMatrix<f64> {
        let n = self.size();
        DMatrix::from_fn(n, self.sectors.len(), |i, k| {
            self.sectors[k].half() * self.sectors[k].weight(i)
        })
    }

    /// The rows e_{s_k}ᵀ: which state each uncertain term reads.
    fn reads(&self) -> DMatrix<f64> {
        unit_rows(self.sectors.iter().map(|s| s.column), self.size())
    }

    /// Whether every number is finite.
    pub fn is_bounded(&self) -> bool {
        let entries = self.constant.iter().flatten();
        let directions = self.sectors.iter().flat_map(|s| &s.direction);
        let ranges = self.sectors.iter().map(|s| &s.range);
        let mut all = entries.chain(directions).chain(ranges);
        all.all(|x| x.is_bounded())
    }

    /// The model with every range shrunk about its middle, θ_k = m_k + factor_k·(…).
    pub fn shrunk(&self, factor: impl Fn(usize) -> f64) -> Self {
        let mut shrunk = self.clone();
        for (k, sector) in shrunk.sectors.iter_mut().enumerate() {
            let (middle, half) = (sector.middle(), sector.half() * factor(k));
            // a half-width that is finite leaves ordered bounds
            sector.range = Interval::new(middle - half, middle + half).unwrap_or(sector.range);
        }
        shrunk
    }

    fn ranges(&self) -> Vec<Bounds> {
        let ranges = self.sectors.iter().map(|s| s.range);
        ranges
            .map(|range| (range.lo(), range.hi()).into())
            .collect()
    }

    /// The model with these slopes, exactly enclosed: without sectors.
    fn fixed(&self, θ: &[f64]) -> Self {
        let mut constant = self.constant.clone();
        for (sector, &θ) in self.sectors.iter().zip(θ) {
            for (row, weight) in constant.iter_mut().zip(&sector.direction) {
                row[sector.column] = row[sector.column] + Interval::point(θ) * *weight;
            }
        }
        let sectors = vec![];
        Self { constant, sectors }
    }
}

/// The rows e_sᵀ of n entries, for the places s.
fn unit_rows(places: impl ExactSizeIterator<Item = usize>, n: usize) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(places.len(), n);
    for (k, place) in places.enumerate() {
        rows[(k, place)] = 1.0;
    }
    rows
}

/// The same error systems by their vertices where these are at most `limit`: an
/// inequality at every vertex asks for less than one with multipliers.
pub fn expanded(models: &[ErrorModel], limit: usize) -> Vec<ErrorModel> {
    let count = |m: &ErrorModel| 1_usize.checked_shl(varying(&m.ranges()) as u32);
    let total = models
        .iter()
        .try_fold(0_usize, |sum, m| sum.checked_add(count(m)?));
    match total {
        Some(total) if total <= limit && models.iter().all(ErrorModel::is_bounded) => {
            let fixed = |m: &ErrorModel| {
                let ends = vertices(&m.ranges());
                ends.map(|θ| m.fixed(&θ)).collect::<Vec<_>>()
            };
            models.iter().flat_map(fixed).collect()
        }
        _ => models.to_vec(),
    }
}
