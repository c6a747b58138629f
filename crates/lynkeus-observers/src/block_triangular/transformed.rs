//! Bounds of what the proof of Theorem 1 meets, in the coordinates ē = M(x̂) e.
//!
//! ē_i' = (A − Δ⁻¹K C) ē_i + (M R M⁻¹ + Ṁ M⁻¹) ē_i + Σ_{j<i} M_i G_ij M_j⁻¹ ē_j,
//!
//! R = F(η) − F(x̂) with both arguments in the box, so |R_ab| is at most the width of
//! the range of F_ab. Matrices are bounded entry by entry, products by products of
//! the bounds.
//!
//! Ṁ is where the print has a gap. M depends on the estimate, whose derivative
//! contains the correction M⁻¹(L + Δ⁻¹K)(y − x̂_1): it grows with θ and with the
//! error, and Assumption 1 does not make it bounded independently of θ (Lemma 2 ii).
//! On the box |y − x̂_1| is at most the width of the range of x_1, so Ṁ has a bound
//! with powers of θ, and the terms here carry them.

use lynkeus_expr::{Expr, Interval, Node, jacobian};
use lynkeus_proof::chain::Slope;
use lynkeus_proof::magnitude::{plus, product, times};
use lynkeus_proof::matrix::sum;
use lynkeus_structure::{AugmentedPlant, Blocks, Chain, Matrix, range};

use super::observer::{Steps, slopes};
use crate::sparse::Sparse;
use crate::theorem::magnitude;
use crate::{Assumptions, DesignError};

/// A table of upper bounds, row by row.
pub(super) type Table = Vec<Vec<f64>>;

/// |∂ē_row'/∂ē_column| ≤ size + Σ coefficient·θ_chain^power.
pub(super) struct Term {
    /// what does not grow with θ
    pub steady: Slope,
    /// (place of the chain, power, coefficient)
    pub powers: Vec<(usize, usize, f64)>,
}

impl From<Slope> for Term {
    fn from(steady: Slope) -> Self {
        let powers = vec![];
        Self { steady, powers }
    }
}

impl Term {
    pub fn at(&self, θ: &[f64]) -> Slope {
        let grown = self.powers.iter().map(|&(c, k, coefficient)| {
            Interval::point(coefficient) * Interval::point(θ[c]).powi(k as i32)
        });
        let size = (Interval::point(self.steady.size) + sum(grown)).hi();
        Slope {
            size,
            ..self.steady
        }
    }
}

/// M, M⁻¹ and L of a chain as upper bounds of their entries.
pub(super) struct Similar {
    pub M: Table,
    pub inverse: Table,
    pub L: Vec<f64>,
    nodes: Vec<Vec<Option<Node>>>,
}

/// What the bounds are taken of.
pub(super) struct Plant<'a> {
    pub augmented: &'a AugmentedPlant<'a>,
    pub blocks: &'a Blocks,
    pub assumptions: &'a Assumptions,
    /// K, in the order of the blocks
    pub K: Vec<Vec<f64>>,
    /// bounds of the errors of the measured states, in the order of the blocks
    pub noise: Vec<f64>,
}

impl Plant<'_> {
    fn size(&self, node: Option<Node>) -> Result<f64, DesignError> {
        match node {
            None => Ok(0.0),
            Some(node) => magnitude(self.augmented.graph(), node, &self.assumptions.region),
        }
    }

    fn table(&self, nodes: &[Vec<Option<Node>>]) -> Result<Table, DesignError> {
        let row = |row: &Vec<_>| row.iter().map(|&x| self.size(x)).collect();
        nodes.iter().map(row).collect()
    }

    fn chain(&self, place: usize) -> &Chain {
        &self.blocks.order[place].1
    }

    pub fn similar(&self, place: usize) -> Result<Similar, DesignError> {
        let found = Steps::new(self.augmented, self.chain(place));
        let nodes = found.M();
        let L = found.L.iter().map(|l| self.size(l.map(Expr::node)));
        Ok(Similar {
            L: L.collect::<Result<_, _>>()?,
            M: self.table(&nodes)?,
            inverse: self.table(&found.inverse())?,
            nodes,
        })
    }

    /// Every term of every chain for observer (7).
    pub fn terms(&self, similar: &[Similar]) -> Result<Vec<Term>, DesignError> {
        let mut terms = vec![];
        for (i, own) in similar.iter().enumerate() {
            let rest = product(&product(&own.M, &self.widths(i)?), &own.inverse);
            let mut found = self.entries(i, i, &rest);
            self.moving(i, similar, &mut found)?;
            terms.extend(found);
            for (j, before) in similar.iter().enumerate().take(i) {
                let slopes = self.jacobian(self.chain(i), self.chain(j))?;
                let coupled = product(&product(&own.M, &slopes), &before.inverse);
                terms.extend(self.entries(i, j, &coupled));
            }
        }
        Ok(terms)
    }

    fn entries(&self, i: usize, j: usize, table: &Table) -> Vec<Term> {
        let (rows, columns) = (self.chain(i), self.chain(j));
        let pairs = table.iter().zip(rows).flat_map(|(entries, &row)| {
            let columns = entries.iter().zip(columns);
            columns.map(move |(&size, &column)| Slope { row, column, size }.into())
        });
        pairs.collect()
    }

    /// Widths of the ranges of the entries of F_i.
    fn widths(&self, i: usize) -> Result<Table, DesignError> {
        let (graph, region) = (self.augmented.graph(), &self.assumptions.region);
        let width = |entry: &Sparse<'_>| -> Result<f64, DesignError> {
            let Some(node) = entry.map(Expr::node) else {
                return Ok(0.0);
            };
            let found = range(graph, node, region)?;
            let span =
                Interval::point(found.enclosure.hi()) - Interval::point(found.enclosure.lo());
            let fine = found.enclosure.is_defined() && span.hi().is_finite();
            Ok(match (graph.constant_value(node), fine) {
                (Some(_), _) => 0.0,
                (None, true) => span.hi(),
                (None, false) => f64::INFINITY,
            })
        };
        let row = |row: &Vec<Sparse<'_>>| row.iter().map(width).collect();
        let own = self.chain(i);
        slopes(self.augmented, own, own).iter().map(row).collect()
    }

    /// |∂f/∂x| for the equations of `rows` and the states `columns`.
    pub fn jacobian(&self, rows: &[usize], columns: &[usize]) -> Result<Table, DesignError> {
        let size = |entry: &Sparse<'_>| self.size(entry.map(Expr::node));
        let row = |row: &Vec<Sparse<'_>>| row.iter().map(size).collect();
        let slopes = slopes(self.augmented, rows, columns);
        slopes.iter().map(row).collect()
    }

    /// Adds Ṁ M⁻¹ to the terms of chain i.
    fn moving(&self, i: usize, similar: &[Similar], terms: &mut [Term]) -> Result<(), DesignError> {
        for (c, (_, chain)) in self.blocks.order.iter().enumerate() {
            for (place, &state) in chain.iter().enumerate() {
                let slope = self.slope_of_M(&similar[i], self.augmented.states[state].node)?;
                let product = product(&slope, &similar[i].inverse);
                if product.iter().flatten().all(|x| *x == 0.0) {
                    continue;
                }
                let (steady, powers) = self.speed(c, place, i, similar)?;
                for (p, &factor) in product.iter().flatten().enumerate() {
                    let term = &mut terms[p];
                    term.steady.size = plus(term.steady.size, times(factor, steady));
                    let grown = powers.iter().map(|&(k, x)| (c, k, times(factor, x)));
                    term.powers.extend(grown.filter(|g| g.2 != 0.0));
                }
            }
        }
        // time itself has slope one
        let inputs = self.augmented.inputs.iter().enumerate();
        let inputs = inputs.map(|(j, u)| (u.node, self.assumptions.input_derivative(j, 1)));
        for (symbol, speed) in inputs.chain([(self.augmented.plant.time, 1.0)]) {
            let slope = self.slope_of_M(&similar[i], symbol)?;
            let product = product(&slope, &similar[i].inverse);
            for (p, &size) in product.iter().flatten().enumerate() {
                let steady = &mut terms[p].steady.size;
                *steady = plus(*steady, times(size, speed));
            }
        }
        Ok(())
    }

    /// |∂M/∂symbol|; `Matrix` drops what cancels, as the inputs in M often do.
    fn slope_of_M(&self, similar: &Similar, symbol: Node) -> Result<Table, DesignError> {
        let graph = self.augmented.graph();
        let n = similar.nodes.len();
        let slope = |i: usize, j: usize| {
            let entry = similar.nodes[i][j]?;
            jacobian::forward(graph, &[entry], &[symbol]).get(0, 0)
        };
        let slopes = Matrix::from_fn(graph, (n, n), slope);
        let row = |i: usize| (0..n).map(|j| slopes.get(i, j)).collect();
        self.table(&(0..n).map(row).collect::<Vec<_>>())
    }

    /// |x̂'| of the state at `place` in chain c ≤ i, as (steady part, powers of θ_c);
    /// of a later chain only the measured head occurs in M_i, with its own x'.
    fn speed(
        &self,
        c: usize,
        place: usize,
        i: usize,
        similar: &[Similar],
    ) -> Result<(f64, Vec<(usize, f64)>), DesignError> {
        let state = self.chain(c)[place];
        let f = self.size(Some(self.augmented.derivatives[state]))?;
        if c > i {
            let drift = self.assumptions.drift.get(state);
            let drift = drift.copied().unwrap_or(f64::INFINITY);
            // a noisy signal has no derivative, nor has one that process noise moves
            let moved = self.assumptions.process_noise.get(state);
            let smooth = self.noise[c] == 0.0 && moved.is_none_or(|density| *density == 0.0);
            let noisy = if smooth { 0.0 } else { f64::INFINITY };
            return Ok((
                (Interval::point(f) + Interval::point(drift)).hi() + noisy,
                vec![],
            ));
        }
        let head = &self.augmented.states[self.chain(c)[0]];
        let mut sides = self.assumptions.region.dimensions.iter();
        let side = sides.find(|d| d.symbol == head.node);
        let width = side.map_or(f64::INFINITY, |d| plus(d.max, -d.min));
        let innovation = plus(width, self.noise[c]);
        let row = &similar[c].inverse[place];
        let column = |x: &[f64]| x.iter().map(|&x| vec![x]).collect::<Table>();
        let steady = product(
            &product(std::slice::from_ref(row), &column(&similar[c].L)),
            &[vec![innovation]],
        );
        let power = |(k, &m): (usize, &f64)| {
            let gain = times(m, self.K[c][k].abs());
            (k + 1, times(gain, innovation))
        };
        let powers = row.iter().enumerate().map(power).collect();
        Ok((plus(f, steady[0][0]), powers))
    }
}
