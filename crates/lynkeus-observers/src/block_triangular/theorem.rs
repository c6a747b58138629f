//! Theorem 1: what it guarantees for a plant and a tuning.
//!
//! With ẽ_i = Δ_θi M_i(x̂) e_i (M = I for the classical observer), P_i from
//! (A − KC)ᵀP + P(A − KC) = −I and V = Σ c_i ẽ_iᵀP_iẽ_i the decay is proved by the
//! comparison matrix of [`lynkeus_proof::chain`] at the study's θ; `transformed` has the
//! bounds of its entries. The paper's constants μ_ij are formed of the same bounds.

use lynkeus_expr::Interval;
use lynkeus_proof::chain::{Chain, Comparison, Disturbance, Slope, Ultimate, ultimate};
use lynkeus_proof::magnitude::{plus, product, times};
use lynkeus_proof::matrix::{square, sum};
use lynkeus_proof::search::{first, lightest};
use lynkeus_proof::{lyapunov, metzler};
use lynkeus_structure::{AugmentedPlant, Blocks, Standing};
use nalgebra::DMatrix;

use super::form::{Form, chain_rule};
use super::said::{Correction, Lee, Said};
use super::settings::Settings;
use super::transformed::{Plant, Similar, Table, Term};
use crate::conditions::{GainedChain, Partial, along, names};
use crate::design::Found;
use crate::peaking::departure;
use crate::statement::{proved, standing, undecided};
use crate::theorem::{as_computed, conclude, is_along, slopes, state_noise};
use crate::{Assumptions, Certificate, Check, Constant, DesignError, Reason, Tuning, estimate};

pub(super) const BASIS: &str = "Theorem 1 of Lee, Yee and Park";

pub(super) fn certificate(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, .. }: Found<Form>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let (lmi, blocks) = (settings.lmi()?, &form.blocks);
    if let Some(check) = departure(Lee::Observer, lmi, &settings.remedies) {
        return Ok(Certificate::new(BASIS, assumptions, vec![check]));
    }
    let order: Vec<usize> = blocks.order.iter().map(|(output, _)| *output).collect();
    let by_output = settings.θ()?;
    let K = settings.K(&blocks.lengths());
    let noise = state_noise(augmented, &assumptions.region, &assumptions.noise)?;
    let pick = |x: &[f64]| order.iter().map(|&o| x[o]).collect::<Vec<f64>>();
    let plant = Plant {
        augmented,
        blocks,
        assumptions,
        K: order.iter().map(|&o| K[o].clone()).collect(),
        noise: pick(&noise),
    };
    let mut study = Study {
        classical: settings.correction == Correction::Classical,
        θ: pick(&by_output),
        rule: chain_rule(blocks, &by_output),
        plant: &plant,
        common: &settings.common,
        partials: vec![],
        similar: vec![],
        terms: vec![],
    };
    let checks = study.examine()?;
    study.certificate(checks)
}

struct Study<'a> {
    plant: &'a Plant<'a>,
    common: &'a Tuning,
    classical: bool,
    /// in the order of the blocks
    θ: Vec<f64>,
    /// what breaks Lemma 2's rule
    rule: Option<Reason>,
    // what does not depend on θ
    partials: Vec<Vec<(f64, f64)>>,
    similar: Vec<Similar>,
    terms: Vec<Term>,
}

impl Study<'_> {
    fn blocks(&self) -> &Blocks {
        self.plant.blocks
    }

    fn certificate(&self, mut checks: Vec<Check>) -> Result<Certificate, DesignError> {
        let augmented = self.plant.augmented;
        let mut constants = vec![];
        let mut found = None;
        if standing(&checks) != Standing::Refuted
            && let Some((P, μ)) = self.first_inequality(&mut checks)
        {
            self.paper_constants(&P, &mut constants);
            found = self.second_inequality(&P, &μ, &mut checks, &mut constants);
        }
        let mut certificate = Certificate::new(BASIS, self.plant.assumptions, checks);
        certificate.constants = constants;
        certificate.notes = self.notes();
        if let Some((σ, chains)) = found {
            let left = |process: &[f64]| self.ultimate(&chains, σ, process);
            conclude(&mut certificate, augmented, σ, self.plant.assumptions, left)?;
        }
        Ok(certificate)
    }

    /// Finds what does not depend on θ, with what has to hold of it.
    fn examine(&mut self) -> Result<Vec<Check>, DesignError> {
        let (augmented, classical) = (self.plant.augmented, self.classical);
        let region = &self.plant.assumptions.region;
        let order = &self.blocks().order;
        let places = order.iter().map(|(output, c)| (*output, &c[..]));
        let (partials, mut checks) = along(augmented, places, region)?;
        let range = |partial: &Partial| match classical {
            // M takes the partials out: a chain of integrators is left
            false => (1.0, 1.0),
            true => partial.range(),
        };
        let ranges = partials
            .iter()
            .map(|chain| chain.iter().map(range).collect());
        let (plain, check) = slopes(augmented, region, |a, b| self.skipped(a, b))?;
        checks.push(check);
        let count = if classical { 0 } else { order.len() };
        let similar = (0..count).map(|i| self.plant.similar(i));
        let similar: Vec<Similar> = similar.collect::<Result<_, _>>()?;
        self.terms = match classical {
            true => plain.into_iter().map(Term::from).collect(),
            false => self.plant.terms(&similar)?,
        };
        (self.partials, self.similar) = (ranges.collect(), similar);
        let mut sizes = self.terms.iter().map(|term| term.at(&self.θ).size);
        if sizes.any(|size| !size.is_finite()) && standing(&checks) == Standing::Proved {
            checks.push(undecided(Lee::Assumption1, Said::NoBounds));
        }
        Ok(checks)
    }

    /// The partial along a chain, which is in A, and measured heads of later chains.
    fn skipped(&self, row: usize, column: usize) -> bool {
        let order = &self.blocks().order;
        let place = |state: usize| order.iter().position(|(_, c)| c.contains(&state));
        let along = order.iter().any(|(_, c)| is_along(c, row, column));
        along || place(column) > place(row)
    }

    /// P_i and μ_i of the first inequality, where it holds for every chain.
    fn first_inequality(&self, checks: &mut Vec<Check>) -> Option<(Vec<DMatrix<f64>>, Vec<f64>)> {
        let (mut all, mut decays) = (vec![], vec![]);
        for (i, (_, chain)) in self.blocks().order.iter().enumerate() {
            let states = names(self.plant.augmented, chain);
            let name = Lee::Lyapunov { states };
            let gained = GainedChain {
                K: &self.plant.K[i],
                partials: &self.partials[i],
            };
            let middle = gained
                .middle()
                .and_then(|a| lyapunov::of_chain(gained.K, &a));
            let found = middle.and_then(|P| {
                let μ = self.chain(i, &P, self.θ[i], 1.0).decay()?;
                Some((P, μ))
            });
            match found {
                Some((P, μ)) => {
                    checks.push(proved(name, Said::Decays(μ)));
                    all.push(P);
                    decays.push(μ);
                }
                None => checks.push(undecided(name, Said::NoDecay)),
            }
        }
        (all.len() == self.θ.len()).then_some((all, decays))
    }

    fn chain(&self, i: usize, P: &DMatrix<f64>, θ: f64, c: f64) -> Chain {
        let states = self.blocks().order[i].1.clone();
        let speed = Interval::point(θ);
        let weighed = |i, j| Interval::point(c) * Interval::point(P[(i, j)]);
        Chain {
            scales: (1..=states.len()).map(|j| speed.powi(j as i32)).collect(),
            states,
            speed,
            S: square(P.nrows(), weighed),
            g: as_computed(self.plant.K[i].iter().copied()),
            partials: self.partials[i].iter().map(|&range| range.into()).collect(),
        }
    }

    fn chains(&self, P: &[DMatrix<f64>], θ: &[f64], c: &[f64]) -> Vec<Chain> {
        (0..P.len())
            .map(|i| self.chain(i, &P[i], θ[i], c[i]))
            .collect()
    }

    fn comparison(&self, P: &[DMatrix<f64>], μ: &[f64], θ: &[f64], c: &[f64]) -> Comparison {
        let slopes: Vec<Slope> = self.terms.iter().map(|t| t.at(θ)).collect();
        Comparison::new(&self.chains(P, θ, c), μ, &slopes)
    }

    /// σ with the chains it was proved for.
    fn second_inequality(
        &self,
        P: &[DMatrix<f64>],
        μ: &[f64],
        checks: &mut Vec<Check>,
        constants: &mut Vec<Constant>,
    ) -> Option<(f64, Vec<Chain>)> {
        // θ_i = θ^ν_i: along this curve through the study's θ
        let ν: Vec<f64> = self.θ.iter().map(|θ| θ.ln() / self.θ[0].ln()).collect();
        let curve = |θ: f64| ν.iter().map(|ν| θ.powf(*ν)).collect::<Vec<f64>>();
        let falls = self.θ[0] > 1.0 && self.falls(&ν);
        let at = |c: &[f64]| {
            let holds = |θ: f64| self.comparison(P, μ, &curve(θ), c).holds();
            if falls {
                first(self.θ[0], holds)
            } else {
                None
            }
        };
        let (c, θ0) = lightest(P.len(), at);
        let σ = self.comparison(P, μ, &self.θ, &c).rate();
        for (i, c) in c.iter().enumerate().skip(1) {
            constants.push(Constant::new(
                format!("c{}", i + 1),
                *c,
                "weight of V_i in V, the paper has 1",
            ));
        }
        if let Some(θ0) = θ0 {
            constants.push(Constant {
                name: "θ0".to_owned(),
                value: θ0,
                meaning: "the decay is proved for θ_i = θ^ν_i, ν = ({}), and every θ from here on"
                    .to_owned(),
                numbers: ν.to_vec(),
            });
        }
        let name = Lee::Theta {
            θ: self.θ.clone()
        };
        checks.push(match (σ, θ0) {
            (Some(_), _) => proved(name, Said::NegativeDefinite),
            (None, θ0) => undecided(name, Said::Threshold(θ0)),
        });
        σ.map(|σ| (σ, self.chains(P, &self.θ, &c)))
    }

    /// Whether no entry of the comparison matrix, divided by the speeds, grows along
    /// the curve: then what holds at θ0 holds beyond.
    fn falls(&self, ν: &[f64]) -> bool {
        let place = |state: usize| {
            let mut chains = self.blocks().order.iter().enumerate();
            chains.find_map(|(i, (_, c))| Some((i, c.iter().position(|s| *s == state)? + 1)))
        };
        self.terms.iter().all(|term| {
            let (Some((i, l)), Some((k, m))) = (place(term.steady.row), place(term.steady.column))
            else {
                return false;
            };
            let steady = ν[k] * m as f64 - ν[i] * l as f64 - 0.5 * (ν[i] + ν[k]);
            let powers = term.powers.iter().map(|&(c, power, _)| ν[c] * power as f64);
            let largest = powers.fold(0.0, f64::max);
            let there = term.steady.size > 0.0 || !term.powers.is_empty();
            !there || steady + largest <= 0.0
        })
    }

    /// Where the estimate may be: M of observer (7) moves with it, so the box bounds it.
    fn place(&self) -> Reason {
        match self.classical {
            true => {
                let region = &self.plant.assumptions.region;
                estimate::note(self.common, self.plant.augmented, region)
            }
            false => Reason::InTheBox {
                clamp: self.common.clamp,
            },
        }
    }

    fn notes(&self) -> Vec<Reason> {
        let moving = (!self.classical).then(|| Said::MovingM.into());
        let notes = std::iter::once(self.place()).chain(self.rule.clone());
        notes.chain(moving).collect()
    }
}

impl Study<'_> {
    /// μ_ij and θ_i0 as in the proof, with norms, at the study's θ.
    fn paper_constants(&self, P: &[DMatrix<f64>], constants: &mut Vec<Constant>) {
        let count = P.len();
        let λ: Vec<f64> = P
            .iter()
            .map(|P| metzler::spectral_radius(&square(P.nrows(), |i, j| P[(i, j)].abs())))
            .collect();
        let mut μ = vec![vec![0.0; count]; count];
        for i in 0..count {
            for j in 0..=i {
                let norm = self.scaled_norm(i, j);
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
    fn scaled_norm(&self, i: usize, j: usize) -> f64 {
        let (rows, columns) = (&self.blocks().order[i].1, &self.blocks().order[j].1);
        let mut H = vec![vec![0.0; columns.len()]; rows.len()];
        for term in &self.terms {
            let l = rows.iter().position(|s| *s == term.steady.row);
            let m = columns.iter().position(|s| *s == term.steady.column);
            if let (Some(l), Some(m)) = (l, m) {
                let scale = |θ: f64, k: usize| Interval::point(θ).powi(k as i32 + 1);
                let size = Interval::point(term.at(&self.θ).size);
                H[l][m] = (size * scale(self.θ[j], m) / scale(self.θ[i], l)).hi();
            }
        }
        metzler::spectral_norm(&H)
    }

    /// The bounds of ē taken back to e = M⁻¹ ē.
    fn ultimate(
        &self,
        chains: &[Chain],
        σ: f64,
        process: &[f64],
    ) -> Result<Option<Ultimate>, DesignError> {
        let drift = self.drift()?;
        let outside = Disturbance {
            drift: &drift,
            noise: &self.plant.noise,
            process: &self.process(process),
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
            let back = match self.similar.get(i) {
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
            let all = self.similar.iter();
            let all = all.map(|s| metzler::spectral_norm(table(s)));
            Interval::point(all.fold(1.0, f64::max))
        };
        let factor = norms(|s| &s.M) * norms(|s| &s.inverse);
        found.overshoot = (Interval::point(found.overshoot) * factor).hi();
        Ok(Some(found))
    }

    /// Densities on ē' that make no smaller a trace than those of M ξ, ξ white with the densities given:
    /// m mᵀ ≤ n·diag(m_a²) for a column m of n entries.
    fn process(&self, given: &[f64]) -> Vec<f64> {
        let mut found = given.to_vec();
        for (i, (_, chain)) in self.blocks().order.iter().enumerate() {
            let Some(similar) = self.similar.get(i) else {
                continue;
            };
            let count = Interval::point(chain.len() as f64);
            for (&state, row) in chain.iter().zip(&similar.M) {
                let terms = row.iter().zip(chain).filter(|(_, k)| given[**k] > 0.0);
                let terms =
                    terms.map(|(m, k)| Interval::point(*m).powi(2) * Interval::point(given[*k]));
                found[state] = (count * sum(terms)).hi();
            }
        }
        found
    }

    /// What acts on ē beside K·noise: M d, L w, and the noise of the heads of later
    /// chains, which the equations read.
    fn drift(&self) -> Result<Vec<f64>, DesignError> {
        let order = &self.blocks().order;
        let given = &self.plant.assumptions.drift;
        let mut drift = vec![0.0; self.plant.augmented.states.len()];
        for (i, (_, chain)) in order.iter().enumerate() {
            let mut column: Table = vec![];
            for &state in chain {
                let mut d = Interval::point(given.get(state).copied().unwrap_or(f64::INFINITY));
                for (k, (_, later)) in order.iter().enumerate().skip(i + 1) {
                    let slope = self.plant.jacobian(&[state], &later[..1])?[0][0];
                    if slope != 0.0 && self.plant.noise[k] != 0.0 {
                        d = d + Interval::point(slope) * Interval::point(self.plant.noise[k]);
                    }
                }
                column.push(vec![d.hi()]);
            }
            let (column, L) = match self.similar.get(i) {
                Some(similar) => (product(&similar.M, &column), similar.L.clone()),
                None => (column, vec![0.0; chain.len()]),
            };
            for ((&state, d), l) in chain.iter().zip(column).zip(L) {
                let noisy = times(l, self.plant.noise[i]);
                drift[state] = plus(d[0], noisy);
            }
        }
        Ok(drift)
    }
}
