//! Decay of the error of chained high-gain observers, proved on a box.
//!
//! With ε_j = x̃_j/s_j, s_j = τ^j/|T_j|, the error of a chain obeys
//!
//! ε' = τ (A(a) − g C) ε + Δ⁻¹δf + Δ⁻¹d + g w, w the error of the measured state,
//!
//! A(a) with the partials a_j above its diagonal, g the gain in these coordinates, and
//! |(Δ⁻¹δf)_a| ≤ Σ_b L_ab (s_b/s_a) |ε_b| with L_ab ≥ |∂f_a/∂x_b| on the box (mean
//! value theorem: plant and estimate in the box). With V = Σ_chains εᵀSε and
//! D² = diag S, z = Dε, two inequalities prove the decay:
//!
//! 1. AᵀS + SA − SgC − CᵀgᵀS ≤ −μD² at every vertex of the bounds of a, checked by
//!    an elimination in interval arithmetic ([`definite`](crate::definite); for many vertices and a
//!    tridiagonal S state by state, [`crate::elimination`]);
//! 2. N = −τμ + |S̄|G + Gᵀ|S̄| < 0 with S̄ = D⁻¹SD⁻¹, G_ab = D_a L_ab (s_b/s_a)/D_b,
//!    since V' ≤ |z|ᵀN|z|: off its diagonal N has nothing negative ([`metzler`]).
//!
//! The rate σ is the largest with N + 2σ|S̄| < 0: then V' ≤ −2σV. Entry by entry this
//! is sharper than ‖S‖, λ_min(S) and one Lipschitz constant, and each number is an
//! outward-rounded bound.

use lynkeus_expr::Interval;

use crate::definite::{is_positive_definite, least_eigenvalue};
use crate::elimination::{columns, positive};
use crate::magnitude::Magnitudes;
use crate::matrix::{IntervalMatrix, dot, product, square, sum, upper};
use crate::search::largest;
use crate::vertices::{Bounds, varying, vertices};
use crate::{inverse, metzler};

/// One entry of the Jacobian.
#[derive(Clone, Debug)]
pub struct Slope {
    /// a
    pub row: usize,
    /// b
    pub column: usize,
    /// upper bound of |∂f_a/∂x_b|, infinite where none is known
    pub size: f64,
}

/// One chain of the observer in the coordinates of the proof.
#[derive(Clone, Debug)]
pub struct Chain {
    /// augmented states, the measured one first
    pub states: Vec<usize>,
    /// τ: how fast the chain is
    pub speed: Interval,
    /// s_j: the error of state j is s_j ε_j
    pub scales: Vec<Interval>,
    /// S, symmetric
    pub S: IntervalMatrix,
    /// the gain: ε' holds −τ g ε_1, and g w for an error w of the measured state
    pub g: Vec<Interval>,
    /// the bounds of a_1, a_2, …
    pub partials: Vec<Bounds>,
}

/// Partials that vary up to which all of their vertices are visited.
const VERTICES: usize = 10;

impl Chain {
    fn size(&self) -> usize {
        self.states.len()
    }

    /// μ of the first inequality: proved, and as large as the arithmetic proves.
    pub fn decay(&self) -> Option<f64> {
        if !is_positive_definite(&self.S) {
            return None;
        }
        if varying(&self.partials) > VERTICES {
            return self.eliminated_decay();
        }
        let mut μ = f64::INFINITY;
        for a in vertices(&self.partials) {
            let Q = self.scaled_form(&a);
            μ = least_eigenvalue(&Q, μ)?;
        }
        (μ > 0.0 && μ.is_finite()).then_some(μ)
    }

    /// μ, state by state, for chains whose partials have too many vertices to visit; none for an S that is not tridiagonal.
    fn eliminated_decay(&self) -> Option<f64> {
        let (n, S) = (self.size(), &self.S);
        let far = |i: usize, j: usize| i.abs_diff(j) > 1 && S[i][j].magnitude() != 0.0;
        if (0..n).any(|i| (0..n).any(|j| far(i, j))) {
            return None;
        }
        let D: Vec<Interval> = (0..n).map(|j| self.weight(j)).collect();
        let Sg = self.pushed();
        let first = Interval::point(2.0) * Sg[0] / S[0][0];
        // g = rS⁻¹Cᵀ up to rounding: the rest of Sg is small, its arrow has this norm
        let rest = (1..n).map(|i| (Sg[i] / (D[0] * D[i])).powi(2));
        let stray = sum(rest).sqrt().hi();
        let columns = columns(n, |i, j| S[i][j]);
        let proved = |μ: f64| {
            let shift = (Interval::point(μ) + Interval::point(stray)).hi();
            positive(first, &columns, &self.partials, shift)
        };
        largest(first.hi(), proved)
    }

    /// −D⁻¹(AᵀS + SA − SgC − CᵀgᵀS)D⁻¹
    fn scaled_form(&self, a: &[f64]) -> IntervalMatrix {
        let n = self.size();
        let S = &self.S;
        let Sg = self.pushed();
        let SA = |i: usize, j: usize| match j {
            0 => Interval::ZERO,
            _ => S[i][j - 1] * Interval::point(a[j - 1]),
        };
        let column = |i: usize, j: usize| if j == 0 { Sg[i] } else { Interval::ZERO };
        let entry = |i: usize, j: usize| column(i, j) + column(j, i) - SA(i, j) - SA(j, i);
        square(n, |i, j| entry(i, j) / (S[i][i] * S[j][j]).sqrt())
    }

    /// Sg
    fn pushed(&self) -> Vec<Interval> {
        self.S.iter().map(|row| dot(row, &self.g)).collect()
    }

    /// D_j, the weight of ε_j.
    fn weight(&self, j: usize) -> Interval {
        self.S[j][j].sqrt()
    }
}

/// The second inequality for chains whose first one holds with `μ`.
pub struct Comparison {
    /// N, upper bounds
    N: Magnitudes,
    /// |S̄|, upper bounds
    S̄: Magnitudes,
}

impl Comparison {
    /// The second inequality for chains of which the first one holds with `μ`, chain by
    /// chain, and whose equations are as steep as `slopes`.
    pub fn new(chains: &[Chain], μ: &[f64], slopes: &[Slope]) -> Self {
        let places: Vec<(usize, usize)> = chains
            .iter()
            .enumerate()
            .flat_map(|(i, c)| (0..c.size()).map(move |j| (i, j)))
            .collect();
        let n = places.len();
        let blocks: Vec<IntervalMatrix> = chains.iter().map(normalised).collect();
        let S̄ = square(n, |p, q| match (places[p], places[q]) {
            ((i, j), (l, k)) if i == l => blocks[i][j][k].abs(),
            _ => Interval::ZERO,
        });
        let G = couplings(chains, &places, slopes);
        let H = product(&S̄, &G);
        let N = square(n, |p, q| {
            let (i, _) = places[p];
            let own = match p == q {
                true => -(chains[i].speed * Interval::point(μ[i])),
                false => Interval::ZERO,
            };
            own + H[p][q] + H[q][p]
        });
        Self {
            N: upper(&N),
            S̄: upper(&S̄),
        }
    }

    /// Whether the decay is proved.
    pub fn holds(&self) -> bool {
        metzler::is_negative_definite(&self.N)
    }

    /// σ: V' ≤ −2σV is proved.
    pub fn rate(&self) -> Option<f64> {
        let diagonal = (0..self.N.len()).map(|i| -0.5 * self.N[i][i]);
        let limit = diagonal.fold(f64::INFINITY, f64::min);
        let σ = largest(limit, |σ| {
            let shifted = square(self.N.len(), |p, q| {
                let (N, S̄) = (Interval::point(self.N[p][q]), Interval::point(self.S̄[p][q]));
                (N + Interval::point(2.0 * σ) * S̄).hi()
            });
            metzler::is_negative_definite(&shifted)
        })?;
        (σ > 0.0).then_some(σ)
    }
}

/// G_ab = D_a L_ab (s_b/s_a)/D_b.
fn couplings(chains: &[Chain], places: &[(usize, usize)], slopes: &[Slope]) -> IntervalMatrix {
    let n = places.len();
    let place = |state: usize| {
        places
            .iter()
            .position(|&(i, j)| chains[i].states[j] == state)
    };
    let mut G = vec![vec![Interval::ZERO; n]; n];
    for slope in slopes {
        let (Some(p), Some(q)) = (place(slope.row), place(slope.column)) else {
            continue;
        };
        let ((i, j), (l, k)) = (places[p], places[q]);
        let scale = chains[l].scales[k] / chains[i].scales[j];
        let weight = chains[i].weight(j) / chains[l].weight(k);
        G[p][q] = Interval::point(slope.size) * scale * weight;
    }
    G
}

/// What acts on the chains from outside: per augmented state a bound of the drift,
/// per chain a bound of the error of its measured state.
pub struct Disturbance<'a> {
    /// per augmented state
    pub drift: &'a [f64],
    /// per chain
    pub noise: &'a [f64],
    /// per augmented state the spectral density of white noise on its derivative; with any, what
    /// follows is in mean square
    pub process: &'a [f64],
}

/// What a rate σ guarantees of the error in the plant's coordinates; in mean square, of √(E|e|²).
pub struct Ultimate {
    /// λ₁: |e(t)| ≤ λ₁ e^{−σt} |e(0)| without disturbance
    pub overshoot: f64,
    /// as t → ∞, the Euclidean norm
    pub norm: f64,
    /// as t → ∞: (augmented state, bound)
    pub states: Vec<(usize, f64)>,
}

/// Bounds from √V' ≤ −σ√V + β and |e_j| ≤ s_j √((S⁻¹)_jj V); with process noise from
/// (E V)' ≤ −2σ E V + 2β√(E V) + tr(PQ).
pub fn ultimate(chains: &[Chain], σ: f64, outside: &Disturbance<'_>) -> Option<Ultimate> {
    let (mut β2, mut trace_PQ) = (Interval::ZERO, Interval::ZERO);
    let (mut widest, mut steepest): (f64, f64) = (0.0, 0.0);
    let mut radii: Vec<(usize, Interval)> = vec![];
    for (i, chain) in chains.iter().enumerate() {
        let β = push(chain, outside.drift, *outside.noise.get(i)?)?;
        β2 = β2 + β * β;
        for (j, &state) in chain.states.iter().enumerate() {
            let density = Interval::point(*outside.process.get(state)?);
            trace_PQ = trace_PQ + chain.S[j][j] * density / chain.scales[j].powi(2);
        }
        let steep = inverse::diagonal(&normalised(chain))?;
        let mut trace = Interval::ZERO;
        for (j, bound) in steep.into_iter().enumerate() {
            let square = Interval::point(bound) / chain.S[j][j];
            let radius = chain.scales[j] * square.sqrt();
            trace = trace + radius * radius;
            radii.push((chain.states[j], radius));
        }
        widest = widest.max(trace.hi());
        let n = chain.size();
        let weighted =
            |j: usize, k: usize| chain.S[j][k].abs() / (chain.scales[j] * chain.scales[k]);
        steepest = steepest.max(metzler::spectral_radius(&upper(&square(n, weighted))));
    }
    let level = settled(σ, β2.sqrt(), trace_PQ);
    let states = radii
        .into_iter()
        .map(|(state, radius)| (state, (radius * level).hi()));
    let widest = Interval::point(widest);
    Some(Ultimate {
        overshoot: (widest * Interval::point(steepest)).sqrt().hi(),
        norm: (widest.sqrt() * level).hi(),
        states: states.collect(),
    })
}

/// Where √v settles at most, for v' ≤ −2σv + 2β√v + trace: V itself without process noise (trace 0),
/// else E V, as E√V ≤ √(E V).
pub fn settled(σ: f64, β: Interval, trace: Interval) -> Interval {
    let σ = Interval::point(σ);
    match trace == Interval::ZERO {
        true => β / σ,
        false => {
            let twice = Interval::point(2.0) * σ;
            (β + (β * β + twice * trace).sqrt()) / twice
        }
    }
}

/// β: what drift and noise add to the derivative of √V of one chain.
fn push(chain: &Chain, drift: &[f64], noise: f64) -> Option<Interval> {
    let n = chain.size();
    let mut q = vec![];
    for (j, &state) in chain.states.iter().enumerate() {
        let d = *drift.get(state)?;
        q.push(Interval::point(d) / chain.scales[j]);
    }
    let form = |x: &[Interval], S: &IntervalMatrix| {
        let terms = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        sum(terms.map(|(i, j)| x[i] * S[i][j] * x[j]))
    };
    let drift = form(&q, &square(n, |i, j| chain.S[i][j].abs()));
    let noisy = form(&chain.g, &chain.S);
    let β = drift.sqrt() + Interval::point(noise) * noisy.sqrt();
    β.hi().is_finite().then_some(β)
}

/// S̄ = D⁻¹SD⁻¹
fn normalised(chain: &Chain) -> IntervalMatrix {
    let S = &chain.S;
    square(chain.size(), |i, j| match i == j {
        true => Interval::ONE,
        false => S[i][j] / (S[i][i] * S[j][j]).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(states: &[usize], scales: &[f64], weights: &[f64]) -> Chain {
        let n = states.len();
        let diagonal = |i: usize, j: usize| match i == j {
            true => Interval::point(weights[i] * weights[i]),
            false => Interval::ZERO,
        };
        Chain {
            states: states.to_vec(),
            speed: Interval::ONE,
            scales: scales.iter().copied().map(Interval::point).collect(),
            S: square(n, diagonal),
            g: vec![Interval::ONE; n],
            partials: vec![],
        }
    }

    /// By hand, for D = (2, 3, 5) and s = (1, 4, 0.5): within a chain and from one to the other each slope counts
    /// with its own scales and weights, and one of a state in no chain does not.
    #[test]
    fn couplings_have_the_scales_and_weights_of_both_states() {
        let chains = [
            chain(&[3, 0], &[1.0, 4.0], &[2.0, 3.0]),
            chain(&[1], &[0.5], &[5.0]),
        ];
        let slope = |row, column, size| Slope { row, column, size };
        let slopes = [
            slope(0, 3, 7.0),
            slope(3, 1, 2.0),
            slope(1, 0, 0.25),
            slope(2, 1, 9.0),
        ];
        let places = [(0, 0), (0, 1), (1, 0)];
        let G = couplings(&chains, &places, &slopes);
        // (row, column) in places: D_a L (s_b/s_a)/D_b
        let expected = [
            ((1, 0), 3.0 * 7.0 * (1.0 / 4.0) / 2.0),
            ((0, 2), 2.0 * 2.0 * (0.5 / 1.0) / 5.0),
            ((2, 1), 5.0 * 0.25 * (4.0 / 0.5) / 3.0),
        ];
        assert!(G.len() == 3 && G.iter().all(|row| row.len() == 3));
        for (p, row) in G.iter().enumerate() {
            for (q, found) in row.iter().enumerate() {
                let known = expected.iter().find(|(at, _)| *at == (p, q));
                let value = known.map_or(0.0, |(_, value)| *value);
                assert!(found.contains(value), "{p}, {q}: {found:?} beside {value}");
                assert!(found.hi() - found.lo() < 1e-14, "{p}, {q}: {found:?}");
            }
        }
    }
}
