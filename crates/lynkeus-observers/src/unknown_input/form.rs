//! The matrices of the paper for one partition of x¹.

use lynkeus_expr::Node;
use lynkeus_structure::{Extended, Layers, Matrix};

/// A plant in layers with its measured states split as (H4) asks.
#[derive(Clone, Debug)]
pub struct Form<'e, 'p> {
    pub extended: &'e Extended<'p>,
    pub layers: Layers<'p>,
    /// measured outputs of x₁¹
    pub first: Vec<usize>,
    /// measured outputs of x₂¹
    pub second: Vec<usize>,
}

impl<'p> Form<'_, 'p> {
    /// Number q of layers.
    pub fn q(&self) -> usize {
        self.layers.layers.len()
    }

    /// States of x₁¹.
    pub fn x11(&self) -> Vec<usize> {
        self.first
            .iter()
            .map(|&i| self.layers.layers[0][i])
            .collect()
    }

    /// States of the block k = 1 … q of X²: x₂¹, x², …, x^q.
    pub fn block(&self, k: usize) -> Vec<usize> {
        match k {
            1 => self
                .second
                .iter()
                .map(|&i| self.layers.layers[0][i])
                .collect(),
            _ => self.layers.layers[k - 1].clone(),
        }
    }

    /// f̃ of some states.
    pub fn drift(&self, states: &[usize]) -> Vec<Node> {
        states.iter().map(|&i| self.layers.drift[i]).collect()
    }

    /// ∂f̃_rows/∂x_columns
    pub fn jacobian(&self, rows: &[usize], columns: &[usize]) -> Matrix<'p> {
        let x: Vec<Node> = columns
            .iter()
            .map(|&i| self.extended.states[i].node)
            .collect();
        Matrix::jacobian(self.extended.graph(), &self.drift(rows), &x)
    }

    /// G of some states.
    pub fn factors(&self, states: &[usize]) -> Matrix<'p> {
        self.layers.factors.select_rows(states)
    }

    /// G₁¹
    pub fn G11(&self) -> Matrix<'p> {
        self.factors(&self.x11())
    }

    /// γ_k B with γ_k = G^k (G₁¹)⁺, the block k of D (9).
    pub fn γ_times(&self, k: usize, B: &Matrix<'p>) -> Matrix<'p> {
        self.factors(&self.block(k))
            .times(&self.G11().left_divide(B))
    }

    /// ∂f̃^k/∂x^{k+1} for k = 2 … q−1.
    pub fn link(&self, k: usize) -> Matrix<'p> {
        self.jacobian(&self.block(k), &self.block(k + 1))
    }

    /// ∂f̄₁²/∂x², from (10).
    pub fn bent(&self) -> Matrix<'p> {
        let (own, first) = (self.block(1), self.x11());
        let x2 = self.block(2);
        let through = self.γ_times(1, &self.jacobian(&first, &x2));
        self.jacobian(&own, &x2).minus(&through)
    }

    /// The blocks k = 1 … q of Λ₂ (13).
    pub fn Λ2(&self) -> Vec<Matrix<'p>> {
        let mut Λ2 = vec![Matrix::identity(self.extended.graph(), self.second.len())];
        for k in 1..self.q() {
            let link = match k {
                1 => self.bent(),
                _ => self.link(k),
            };
            Λ2.push(Λ2[k - 1].times(&link));
        }
        Λ2
    }

    /// A matrix with the rank of ∂f̄₁²/∂x² plus m, free of divisions: where (i) holds
    /// the Schur complement of GᵀG in
    /// ( GᵀG  Gᵀ ∂f̃₁¹/∂x² ;  G₂¹  ∂f̃₂¹/∂x² ), G = G₁¹, is ∂f̄₁²/∂x².
    pub fn eleven(&self) -> Matrix<'p> {
        let (own, first) = (self.block(1), self.x11());
        let x2 = self.block(2);
        let G = self.G11();
        // a square G₁¹ needs no least squares
        let left = match G.rows == G.columns {
            true => Matrix::identity(self.extended.graph(), G.rows),
            false => G.transposed(),
        };
        let upper = left
            .times(&G)
            .beside(&left.times(&self.jacobian(&first, &x2)));
        let lower = self.factors(&own).beside(&self.jacobian(&own, &x2));
        upper.above(&lower)
    }

    /// The matrix of condition (ii).
    pub fn ii(&self) -> Matrix<'p> {
        let rows = [self.x11(), self.block(1)].concat();
        self.jacobian(&rows, &self.block(2))
            .beside(&self.factors(&rows))
    }
}
