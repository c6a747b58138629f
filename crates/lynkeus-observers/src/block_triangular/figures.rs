//! The paper's constants, and what the decay of ẽ says of the error itself.

use lynkeus_expr::Interval;
use lynkeus_proof::chain::{Chain, Disturbance, Ultimate, ultimate};
use lynkeus_proof::magnitude::{plus, product, times};
use lynkeus_proof::matrix::{square, sum};
use lynkeus_proof::metzler;
use nalgebra::DMatrix;

use super::theorem::{Facts, Study};
use super::transformed::{Similar, Table};
use crate::{Constant, DesignError};

impl Study<'_> {
    /// μ_ij and θ_i0 as in the proof, with norms, at the study's θ.
    pub(super) fn paper_constants(
        &self,
        facts: &Facts,
        P: &[DMatrix<f64>],
        constants: &mut Vec<Constant>,
    ) {
        let count = P.len();
        let λ: Vec<f64> = P
            .iter()
            .map(|P| metzler::spectral_radius(&square(P.nrows(), |i, j| P[(i, j)].abs())))
            .collect();
        let mut μ = vec![vec![0.0; count]; count];
        for i in 0..count {
            for j in 0..=i {
                let norm = self.scaled_norm(facts, i, j);
                match i == j {
                    true => μ[i][i] += (Interval::point(2.0 * λ[i]) * Interval::point(norm)).hi(),
                    // 2ab ≤ a² + b²
                    false => {
                        let half = (Interval::point(λ[i]) * Interval::point(norm)).hi();
                        μ[i][j] = half;
                        μ[j][i] = half;
                    }
                }
            }
        }
        for (i, row) in μ.iter().enumerate() {
            for (j, &μ) in row.iter().enumerate().filter(|(_, μ)| **μ > 0.0) {
                let name = format!("μ{}{}", i + 1, j + 1);
                constants.push(Constant::new(
                    &name,
                    μ,
                    "of (13), norms bounded at the study's θ",
                ));
            }
            let needed = row
                .iter()
                .fold(Interval::ZERO, |s, &μ| s + Interval::point(μ))
                .hi();
            let name = format!("θ{}0", i + 1);
            constants.push(Constant::new(
                &name,
                needed,
                "Σ_j μ_ij: what the proof of the paper asks of θ_i",
            ));
        }
    }

    /// ‖Δ_i H_ij Δ_j⁻¹‖ at the study's θ.
    fn scaled_norm(&self, facts: &Facts, i: usize, j: usize) -> f64 {
        let (rows, columns) = (
            &self.blocks().order[i].1.states,
            &self.blocks().order[j].1.states,
        );
        let mut H = vec![vec![0.0; columns.len()]; rows.len()];
        for term in &facts.terms {
            let l = rows.iter().position(|s| *s == term.row);
            let m = columns.iter().position(|s| *s == term.column);
            if let (Some(l), Some(m)) = (l, m) {
                let scale = |θ: f64, k: usize| Interval::point(θ).powi(k as i32 + 1);
                let size = Interval::point(term.at(&self.θ).size);
                H[l][m] = (size * scale(self.θ[j], m) / scale(self.θ[i], l)).hi();
            }
        }
        metzler::spectral_norm(&H)
    }

    /// The bounds of ē taken back to e = M⁻¹ ē.
    pub(super) fn ultimate(
        &self,
        facts: &Facts,
        chains: &[Chain],
        σ: f64,
        process: &[f64],
    ) -> Result<Option<Ultimate>, DesignError> {
        let drift = self.drift(facts)?;
        let outside = Disturbance {
            drift: &drift,
            noise: &self.plant.noise,
            process: &self.process(facts, process),
        };
        let Some(mut found) = ultimate(chains, σ, &outside) else {
            return Ok(None);
        };
        let mut states = vec![];
        let mut next = found.states.iter();
        for (i, chain) in chains.iter().enumerate() {
            let column: Table = next
                .by_ref()
                .take(chain.states.len())
                .map(|&(_, b)| vec![b])
                .collect();
            let back = match facts.similar.get(i) {
                Some(similar) => product(&similar.inverse, &column),
                None => column,
            };
            states.extend(
                chain
                    .states
                    .iter()
                    .copied()
                    .zip(back.iter().map(|row| row[0])),
            );
        }
        let squares = states
            .iter()
            .map(|&(_, b)| Interval::point(b) * Interval::point(b));
        found.norm = sum(squares).sqrt().hi();
        found.states = states;
        // e(0) goes through M of that time, ē(t) back through M⁻¹ of another
        let norms = |table: fn(&Similar) -> &Table| {
            let all = facts
                .similar
                .iter()
                .map(|s| metzler::spectral_norm(table(s)));
            Interval::point(all.fold(1.0, f64::max))
        };
        let factor = norms(|s| &s.M) * norms(|s| &s.inverse);
        found.overshoot = (Interval::point(found.overshoot) * factor).hi();
        Ok(Some(found))
    }

    /// Densities on ē' that make no smaller a trace than those of M ξ, ξ white with the densities given:
    /// m mᵀ ≤ n·diag(m_a²) for a column m of n entries.
    fn process(&self, facts: &Facts, given: &[f64]) -> Vec<f64> {
        let mut found = given.to_vec();
        for (i, (_, chain)) in self.blocks().order.iter().enumerate() {
            let Some(similar) = facts.similar.get(i) else {
                continue;
            };
            let count = Interval::point(chain.states.len() as f64);
            for (&state, row) in chain.states.iter().zip(&similar.M) {
                let terms = row
                    .iter()
                    .zip(&chain.states)
                    .filter(|(_, k)| given[**k] > 0.0);
                let terms =
                    terms.map(|(m, k)| Interval::point(*m).powi(2) * Interval::point(given[*k]));
                found[state] = (count * sum(terms)).hi();
            }
        }
        found
    }

    /// What acts on ē beside K·noise: M d, L w, and the noise of the heads of later
    /// chains, which the equations read.
    fn drift(&self, facts: &Facts) -> Result<Vec<f64>, DesignError> {
        let order = &self.blocks().order;
        let given = &self.plant.assumptions.drift;
        let mut drift = vec![0.0; self.plant.extended.states.len()];
        for (i, (_, chain)) in order.iter().enumerate() {
            let mut column: Table = vec![];
            for &state in &chain.states {
                let mut d = Interval::point(given.get(state).copied().unwrap_or(f64::INFINITY));
                for (k, (_, later)) in order.iter().enumerate().skip(i + 1) {
                    let slope = self.plant.jacobian(&[state], &later.states[..1])?[0][0];
                    if slope != 0.0 && self.plant.noise[k] != 0.0 {
                        d = d + Interval::point(slope) * Interval::point(self.plant.noise[k]);
                    }
                }
                column.push(vec![d.hi()]);
            }
            let (column, L) = match facts.similar.get(i) {
                Some(similar) => (product(&similar.M, &column), similar.L.clone()),
                None => (column, vec![0.0; chain.states.len()]),
            };
            for ((&state, d), l) in chain.states.iter().zip(column).zip(L) {
                let noisy = times(l, self.plant.noise[i]);
                drift[state] = plus(d[0], noisy);
            }
        }
        Ok(drift)
    }
}
