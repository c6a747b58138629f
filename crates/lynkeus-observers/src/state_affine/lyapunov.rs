//! The Lyapunov ODE (8) in the factors of S.
//!
//! S' = −θ (S + FᵀS + SF − CᵀC) with S = UᵀDU, U unit upper triangular and
//! D = diag(d_1, …, d_n), states in the order of the blocks.
//!
//! *Derivation.* Let R = D^½U, so that S = RᵀR, and M = R'R⁻¹, upper triangular.
//! Multiplying (8) by R⁻ᵀ from the left and R⁻¹ from the right,
//!
//! Mᵀ + M = −θ (I + Gᵀ + G − wwᵀ),  G = RFR⁻¹,  w = R⁻ᵀCᵀ = D^−½v,  v = U⁻ᵀCᵀ.
//!
//! F has its entries above the blocks of the diagonal, so G is strictly upper
//! triangular like F, and the upper triangular M with this symmetric part is
//! M = θ (−½I − G + ½diag(wwᵀ) + up(wwᵀ)), up(·) being what is above the diagonal.
//! By R = D^½U also M = ½D'D⁻¹ + D^½U'U⁻¹D^−½. Diagonal and rest give
//!
//! d_i' = θ (‖v_i‖² − d_i),  U' = θ (−UF + up(D⁻¹vvᵀ) U),
//!
//! v_i being row i of v, one entry per output. v solves the unit triangular
//! Uᵀv = Cᵀ: no division, no inverse. The observer integrates δ_i = ln d_i:
//!
//! δ_i' = θ ((‖v_i‖² + d_least) e^{−δ_i} − 1).
//!
//! *S stays symmetric positive definite* because whatever real numbers stand in
//! U and δ, ξᵀSξ = ‖D^½Uξ‖² with D > 0 and U invertible: no error of an
//! integrator, however large its step, can take it away.
//!
//! d_least = 1e-100 is not in (8). Where nothing excites a direction (8) lets d_i
//! decay like e^{−θt} for good, and after t = 700/θ its inverse overflows; so it
//! decays to d_least. At any d_i above 1e-84 the term is below rounding.

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_gain::UnitFactor;

use crate::Signal;

/// The smallest d_i that forgetting leaves.
const D_LEAST: f64 = 1e-100;

/// An entry that may be zero everywhere.
pub(super) type Sparse<'g> = Option<Expr<'g>>;

/// The states of the factors as symbols.
pub(super) struct Factor<'g> {
    graph: &'g Graph,
    /// ln d_i
    pub δ: Vec<Expr<'g>>,
    /// U row by row, dense; the diagonal and below are not used
    U: Vec<Vec<Sparse<'g>>>,
    /// with their starts, in the order of [`Factor::derivatives`]
    pub states: Vec<(Signal, f64)>,
}

/// Σ of the terms that are not zero everywhere.
fn sum<'g>(terms: impl Iterator<Item = Sparse<'g>>) -> Sparse<'g> {
    terms.flatten().reduce(|a, b| a + b)
}

fn times<'g>(a: Sparse<'g>, b: Sparse<'g>) -> Sparse<'g> {
    Some(a? * b?)
}

fn minus<'g>(a: Sparse<'g>, b: Sparse<'g>) -> Sparse<'g> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a - b),
        (None, Some(b)) => Some(-b),
        (a, None) => a,
    }
}

impl<'g> Factor<'g> {
    /// Symbols for the factors of S, named after the states and starting at S(0).
    pub fn new(graph: &'g Graph, names: &[&str], start: &UnitFactor) -> Self {
        let n = names.len();
        let mut states = vec![];
        let mut state = |name: String, start: f64| {
            let expr = graph.fresh(format!("factor {name}"));
            let symbol = expr.node();
            states.push((Signal { name, symbol }, start));
            expr
        };
        let δ = (0..n)
            .map(|i| state(format!("ln d({})", names[i]), start.diagonal[i].ln()))
            .collect();
        let mut U = vec![vec![None; n]; n];
        for i in 0..n {
            for j in i + 1..n {
                let name = format!("u({}, {})", names[i], names[j]);
                U[i][j] = Some(state(name, start.upper[i][j - i - 1]));
            }
        }
        Self {
            graph,
            δ,
            U,
            states,
        }
    }

    /// 1/d_i
    fn inverse(&self, i: usize) -> Expr<'g> {
        (-self.δ[i]).exp()
    }

    /// v with Uᵀv = c, for one row c of C.
    pub fn forward(&self, c: &[Sparse<'g>]) -> Vec<Sparse<'g>> {
        let mut v: Vec<Sparse<'g>> = vec![];
        for (i, &c) in c.iter().enumerate() {
            let known = sum((0..i).map(|k| times(self.U[k][i], v[k])));
            v.push(minus(c, known));
        }
        v
    }

    /// z = S⁻¹Cᵀe from v = U⁻ᵀCᵀ, one row per output: b = D⁻¹ve, then Uz = b.
    pub fn gain(&self, v: &[Vec<Sparse<'g>>], e: &[Expr<'g>]) -> Vec<Sparse<'g>> {
        let n = self.δ.len();
        let mut z: Vec<Sparse<'g>> = vec![None; n];
        for i in (0..n).rev() {
            let ve = sum(v.iter().zip(e).map(|(v, &e)| times(v[i], Some(e))));
            let b = times(ve, Some(self.inverse(i)));
            let known = sum((i + 1..n).map(|k| times(self.U[i][k], z[k])));
            z[i] = minus(b, known);
        }
        z
    }

    /// δ' and U', in the order of `states`.
    pub fn derivatives(
        &self,
        θ: Expr<'g>,
        F: &[Vec<Sparse<'g>>],
        v: &[Vec<Sparse<'g>>],
    ) -> Vec<Node> {
        let n = self.δ.len();
        let δ = (0..n).map(|i| {
            let square = sum(v.iter().map(|v| v[i].map(|x| x.powi(2))));
            let new = square.map_or(self.graph.constant(D_LEAST), |s| s + D_LEAST);
            θ * (new * self.inverse(i) - 1.0)
        });
        let above = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        let zero = self.graph.constant(0.0);
        let U = above.map(|(i, j)| self.slope_above(i, j, F, v).map_or(zero, |s| θ * s));
        δ.chain(U).map(Expr::node).collect()
    }

    /// −UF + up(D⁻¹vvᵀ)U at (i, j); rows i and j of U have their ones at i and j.
    fn slope_above(
        &self,
        i: usize,
        j: usize,
        F: &[Vec<Sparse<'g>>],
        v: &[Vec<Sparse<'g>>],
    ) -> Sparse<'g> {
        let w = |k: usize| {
            let vv = sum(v.iter().map(|v| times(v[i], v[k])));
            times(vv, Some(self.inverse(i)))
        };
        let UF = (i + 1..j).map(|k| times(self.U[i][k], F[k][j]));
        let wU = (i + 1..j).map(|k| times(w(k), self.U[k][j]));
        minus(sum(wU.chain([w(j)])), sum(UF.chain([F[i][j]])))
    }

    /// The entries (i, j), j ≥ i, of S⁻¹ = U⁻¹D⁻¹U⁻ᵀ: for its trace, not for the gain.
    pub fn inverse_entries(&self) -> Vec<Vec<Expr<'g>>> {
        let n = self.δ.len();
        let Y: Vec<Vec<Sparse<'g>>> = (0..n).map(|i| self.inverse_row(i)).collect();
        let entry = |i: usize, j: usize| {
            let terms = (j..n).map(|k| {
                let product = times(Y[i][k], Y[j][k]);
                times(product, Some(self.inverse(k)))
            });
            sum(terms).unwrap_or(self.graph.constant(0.0))
        };
        (0..n)
            .map(|i| (i..n).map(|j| entry(i, j)).collect())
            .collect()
    }

    /// Row i of U⁻¹.
    fn inverse_row(&self, i: usize) -> Vec<Sparse<'g>> {
        let mut row: Vec<Sparse<'g>> = vec![None; i];
        row.push(Some(self.graph.constant(1.0)));
        for j in i + 1..self.δ.len() {
            let known = sum((i..j).map(|k| times(row[k], self.U[k][j])));
            row.push(known.map(|x| -x));
        }
        row
    }
}
