//! Theorem 1: what it guarantees for a plant and a tuning.
//!
//! With x̄ = Δ_θ e, V = x̄ᵀSx̄ and f(x̂) − f(x) = F(u, x̂)e + δf, |δf_p| ≤ Σ_q L_pq|e_q| over the
//! blocks up to p's own (mean value theorem),
//!
//! V' = −θV − θ|Cx̄|² + 2x̄ᵀSΔδf + 2x̄ᵀSΔd + 2θ(Cx̄)ᵀw ≤ −2θμ_θ V + 2√(λ_M V)|Δd| + θ|w|²,
//!
//! μ_θ = ½ − √(λ_M/λ_m) ‖G(θ)‖/θ,  G_pq = L_pq θ^{−(k_p − k_q)},
//!
//! where λ_m ≤ λ(S(t)) ≤ λ_M. The noise costs nothing but θ|w|², for −θ|Cx̄|² pays for its
//! cross term. λ_M follows from the box and S(0); λ_m is assumption A4, δ_0 = e α(θ) λ_m.
//! No box decides A4 where F moves with the inputs, but the observer watches it: while
//! the monitor `excitation` is above its alarm, λ_m is at least that.
//!
//! No θ0 follows from a λ_m that holds at one θ, for λ_m itself falls as θ grows. Let F_k(u, x̂)
//! hide a direction ξ of block k + 1 at an instant t, F_k(t)ξ = 0, and let F be Lipschitz in time
//! along the run. Then |F_k(s)ξ| ≤ D(t − s), each block of Φ̃(s, t)ξ before k + 1 is O((t − s)²θ) and
//! higher powers of θ(t − s) times that, and the weight θe^{−θ(t−s)} makes ξᵀSξ = O(θ⁻²): so α(θ)/θ²
//! stays above a positive number, and (12) does not hold. It can only where every F_k has full column
//! rank all the time, or where inputs jump.
//!
//! S(t) of (8) is bounded from above and, where F and C are numbers, from below.

use lynkeus_expr::Interval;
use lynkeus_gain::UnitFactor;
use lynkeus_proof::chain::Slope;
use lynkeus_proof::definite::least_eigenvalue;
use lynkeus_proof::matrix::{IntervalMatrix, square, sum, upper};
use lynkeus_proof::metzler::spectral_radius;
use lynkeus_proof::search::first;
use lynkeus_structure::output_map::Rows;
use lynkeus_structure::{AugmentedPlant, Region, Standing, Verdict};

use super::form::Form;
use super::observer::alarm;
use super::said::Said;
use super::settings::Settings;
use crate::design::Found;
use crate::estimate::Common;
use crate::statement::{proved, standing, sufficient, undecided};
use crate::theorem::{magnitude, slopes, undeclared};
use crate::{
    Assumptions, Bounds, Certificate, Check, Constant, DesignError, Ltaief, Statement, estimate,
};

pub(super) const BASIS: &str = "Theorem 1 of Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa";

pub(super) fn certificate(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let (θ, S0) = (settings.θ()?, settings.S0(&form.order)?);
    let alarm = alarm(augmented, &form, settings)?;
    let shows = |c: &&Check| matches!(&c.statement, Statement::Ltaief(Ltaief::BlockShows { .. }));
    let always_shown = examination
        .checks
        .iter()
        .filter(shows)
        .all(Check::is_proved);
    let study = Study {
        augmented,
        assumptions,
        form: &form,
        θ,
        S0,
        common: &settings.common,
        alarm,
        always_shown,
    };
    // a direction that numbers hide is a refutation of A4; the rest A4 itself decides
    let hidden = examination.checks.into_iter();
    let hidden = hidden.filter(|c| matches!(c.verdict, Verdict::Refuted(_)));
    study.certificate(hidden.collect())
}

struct Study<'a> {
    augmented: &'a AugmentedPlant<'a>,
    assumptions: &'a Assumptions,
    form: &'a Form,
    θ: f64,
    S0: UnitFactor,
    common: &'a Common,
    alarm: f64,
    /// every F_k has full column rank on the box
    always_shown: bool,
}

/// Entries row by row.
type Table = Vec<Vec<f64>>;

impl Study<'_> {
    fn region(&self) -> &Region {
        &self.assumptions.region
    }

    fn place(&self, state: usize) -> Option<usize> {
        self.form.order.iter().position(|s| *s == state)
    }

    fn certificate(&self, mut checks: Vec<Check>) -> Result<Certificate, DesignError> {
        let next = |row: usize, column: usize| match (self.place(row), self.place(column)) {
            (Some(p), Some(q)) => self.form.block[q] > self.form.block[p],
            _ => false,
        };
        let (slopes, lipschitz) = slopes(self.augmented, self.region(), next)?;
        let (sizes, a1) = self.sizes()?;
        let bounded = lipschitz.is_proved() && a1.is_proved();
        checks.extend([lipschitz, a1, self.uncertainty()]);
        let mut constants = vec![];
        let excitation = self.excitation();
        let mut found = None;
        if bounded {
            let λ = self.spectrum(&sizes, excitation, &mut constants);
            let is_lasting = self.always_shown || excitation.is_some();
            let rate = self.decay(&slopes, λ, is_lasting, &mut checks, &mut constants);
            found = rate.map(|rate| (rate, λ));
        }
        let everything_else = standing(&checks) == Standing::Proved;
        checks.push(self.a4(excitation));
        let mut certificate = Certificate::new(BASIS, self.assumptions, checks);
        certificate.constants = constants;
        let note = estimate::note(self.common, self.augmented, self.region());
        certificate.notes.push(note);
        if let Some((rate, λ)) = found.filter(|_| everything_else) {
            self.conclude(&mut certificate, rate, λ);
        }
        Ok(certificate)
    }

    /// A1: |C| and |F| with the verdict on their bounds.
    fn sizes(&self) -> Result<([Table; 2], Check), DesignError> {
        let graph = self.augmented.graph();
        let size = |node| magnitude(graph, node, self.region());
        let mut open = vec![];
        for &(.., node) in self
            .form
            .blocks
            .factors
            .iter()
            .flat_map(|factor| &factor.entries)
        {
            if size(node)?.is_infinite() {
                open.push(node);
            }
        }
        let check = match open.first() {
            None => proved(Ltaief::A1, Said::Enclosed),
            Some(&node) => {
                let entry = graph.render(node, 60);
                let undeclared = undeclared(self.augmented, &open, self.region());
                undecided(Ltaief::A1, Said::NoBound { entry, undeclared })
            }
        };
        let table = |rows: &Rows| -> Result<Table, DesignError> {
            let entry = |e: &Option<_>| e.map_or(Ok(0.0), size);
            rows.iter()
                .map(|row| row.iter().map(entry).collect())
                .collect()
        };
        Ok(([table(&self.form.C)?, table(&self.form.F)?], check))
    }

    /// A3: the uncertainty is bounded.
    fn uncertainty(&self) -> Check {
        let drift = &self.assumptions.drift;
        let known = |&state: &usize| drift.get(state).is_some_and(|d| d.is_finite());
        match self.form.order.iter().find(|state| !known(state)) {
            None => {
                let constant = self.assumptions.constant(self.augmented.plant_states());
                let constant = constant.into_iter().map(str::to_owned).collect();
                proved(Ltaief::A3, Said::Drift { constant })
            }
            Some(&state) => {
                let name = self.augmented.states[state].name.clone();
                undecided(Ltaief::A3, Said::NoDrift(name))
            }
        }
    }

    /// λ_m where F and C are numbers.
    fn excitation(&self) -> Option<f64> {
        let graph = self.augmented.graph();
        let entry = |e: &Option<_>| e.map_or(Some(0.0), |node| graph.constant_value(node));
        let numbers = |rows: &Rows| -> Option<Table> {
            rows.iter()
                .map(|row| row.iter().map(entry).collect())
                .collect()
        };
        let Form { C, F, blocks, .. } = self.form;
        below(&numbers(C)?, &numbers(F)?, blocks.factors.len())
    }

    fn a4(&self, excitation: Option<f64>) -> Check {
        match excitation {
            Some(λ) => proved(Ltaief::A4, Said::Excited { λ, from: TAU }),
            None => {
                let (alarm, always_shown) = (self.alarm, self.always_shown);
                let watched = Said::Watched {
                    alarm,
                    always_shown,
                };
                undecided(Ltaief::A4, watched)
            }
        }
    }

    /// λ_m and λ_M.
    fn spectrum(
        &self,
        [C, F]: &[Table; 2],
        excitation: Option<f64>,
        constants: &mut Vec<Constant>,
    ) -> [f64; 2] {
        let largest = spectral_radius(&above(&self.S0, C, F, &self.form.block));
        let (smallest, source) = match excitation {
            Some(λ) => (λ, "lower bound of the eigenvalues of S(t), t ≥ 10/θ"),
            None => (
                self.alarm,
                "lower bound of the eigenvalues of S(t) while the monitor raises no flag: the alarm",
            ),
        };
        let mut add = |name: &str, value: f64, meaning: &str| {
            constants.push(Constant::new(name, value, meaning));
        };
        add(
            "λ_M",
            largest,
            "upper bound of the eigenvalues of S(t), all t, any θ",
        );
        add("λ_m", smallest, source);
        let δ0 = std::f64::consts::E * smallest;
        add(
            "δ0/α(θ)",
            δ0,
            "e·λ_m: what (11) has to provide for it, by (16)",
        );
        [smallest, largest]
    }

    /// ‖G(θ)‖ ≤ √ρ(GᵀG)
    fn coupling(&self, slopes: &[Slope], θ: f64) -> f64 {
        let n = self.form.order.len();
        let mut G = vec![vec![0.0; n]; n];
        for slope in slopes {
            if let (Some(p), Some(q)) = (self.place(slope.row), self.place(slope.column)) {
                let power =
                    Interval::point(θ).powi((self.form.block[p] - self.form.block[q]) as i32);
                G[p][q] = (Interval::point(slope.size) / power).hi();
            }
        }
        let product =
            |row: &Vec<f64>, i: usize, j: usize| Interval::point(row[i]) * Interval::point(row[j]);
        let G2 = square(n, |i, j| sum(G.iter().map(|row| product(row, i, j))).hi());
        Interval::point(spectral_radius(&G2)).sqrt().hi()
    }

    /// θμ_θ with the hypothesis μ_θ > 0; a λ_m that is lasting does not fall as θ grows.
    fn decay(
        &self,
        slopes: &[Slope],
        [smallest, largest]: [f64; 2],
        is_lasting: bool,
        checks: &mut Vec<Check>,
        constants: &mut Vec<Constant>,
    ) -> Option<f64> {
        let ratio = (Interval::point(largest) / Interval::point(smallest)).sqrt();
        let μ = |θ: f64| {
            let loss = ratio * Interval::point(self.coupling(slopes, θ)) / Interval::point(θ);
            (Interval::point(0.5) - loss).lo()
        };
        let θ = self.θ;
        // a λ_m that falls as θ grows gives none
        let θ0 = first(θ, |θ| μ(θ) > 0.0).filter(|_| is_lasting);
        let mut add = |name: &str, value: f64, meaning: &str| {
            constants.push(Constant::new(name, value, meaning));
        };
        add(
            "η√α(θ)",
            ratio.hi(),
            "√(λ_M/λ_m), the paper's σ_s and η·√α(θ)",
        );
        add(
            "L",
            self.coupling(slopes, θ),
            "‖G(θ)‖: Lipschitz constant of Fx + φ in the scaled coordinates at the study's θ",
        );
        add("μ_θ", μ(θ), "½ − σ_s L/θ, tends to ½ as θ grows");
        if let Some(θ0) = θ0 {
            add("θ0", θ0, "μ_θ > 0 from here on, for this λ_m");
        }
        if !is_lasting {
            let share = Interval::point(2.0 * self.coupling(slopes, θ)) / Interval::point(θ);
            let needed = Interval::point(largest) * share * share;
            add(
                "λ_m needed",
                needed.hi(),
                "λ_M(2L/θ)²: where λ_min(S) is above it at the study's θ, μ_θ > 0",
            );
        }
        let μ = μ(θ);
        let rate = (Interval::point(θ) * Interval::point(μ)).lo();
        let is_proved = rate > 0.0;
        let said = Said::Rate {
            μ,
            θ0,
            is_lasting,
            is_proved,
        };
        checks.push(sufficient(Ltaief::Theta { θ }, is_proved, said));
        is_proved.then_some(rate)
    }

    /// Rate and ultimate bounds: of the certificate where A4 is proved, else as
    /// constants that hold while the monitor raises no flag.
    fn conclude(&self, certificate: &mut Certificate, rate: f64, [smallest, largest]: [f64; 2]) {
        let θ = Interval::point(self.θ);
        let scale = |p: usize| θ.powi(self.form.block[p] as i32);
        let drift = self.form.order.iter().enumerate().map(|(p, &state)| {
            let d = Interval::point(self.assumptions.drift[state]) / scale(p);
            d * d
        });
        let b = (Interval::point(largest) * sum(drift)).sqrt();
        let count = self.augmented.outputs.len();
        let noise = |i: usize| {
            self.assumptions
                .noise
                .get(i)
                .copied()
                .unwrap_or(f64::INFINITY)
        };
        let w2 = sum((0..count).map(|i| Interval::point(noise(i)) * Interval::point(noise(i))));
        // 2θμ v² − 2b v − θw² = 0 for v = √V; process noise adds tr(ΔSΔQ) to θw² and makes it E V
        let twice = Interval::point(2.0) * Interval::point(rate);
        let root = |added: Interval| {
            let v = (b + (b * b + twice * (θ * w2 + added)).sqrt()) / twice;
            v / Interval::point(smallest).sqrt()
        };
        let densities = self.form.order.iter().enumerate().map(|(p, &state)| {
            Interval::point(self.assumptions.process_noise[state]) / scale(p).powi(2)
        });
        let moved = Interval::point(largest) * sum(densities);
        let radius = root(Interval::ZERO);
        let last = self.form.block.iter().copied().max().unwrap_or(0);
        let norm = |radius: Interval| (θ.powi(last as i32).max(Interval::ONE) * radius).hi();
        let bounds = |radius: Interval| {
            let name = |p: usize| self.augmented.states[self.form.order[p]].name.clone();
            let each =
                (0..self.form.order.len()).map(|p| (name(p), (scale(p) * radius).hi()).into());
            let norm = norm(radius);
            norm.is_finite().then(|| Bounds {
                norm,
                states: each.collect(),
            })
        };
        if certificate.verdict() == Standing::Proved {
            certificate.rate = Some(rate);
            if let Some(bounds) = bounds(radius) {
                certificate.ultimate_bound = Some(bounds.norm);
                certificate.ultimate = bounds.states;
            }
            if self.assumptions.is_moved() {
                certificate.mean_square = bounds(root(moved));
            }
            return;
        }
        let mut add = |name: &str, value: f64, meaning: &str| {
            certificate
                .constants
                .push(Constant::new(name, value, meaning));
        };
        add(
            "θμ_θ",
            rate,
            "decay rate while the monitor raises no flag, 1/time unit",
        );
        if !self.assumptions.is_moved() {
            add(
                "ultimate bound",
                norm(radius),
                "of |e| under the assumed drift and noise, while the monitor raises no flag",
            );
        }
    }
}

/// After this many 1/θ the past is forgotten but for e^{−τ}.
const TAU: f64 = 10.0;

/// |S_ij(t)| ≤ B_ij for all t. Entry by entry (8) is S_ij' = −θ(S_ij − r_ij), so
/// |S_ij| ≤ max(|S_ij(0)|, sup|r_ij|), and r_ij = (CᵀC − FᵀS − SF)_ij has entries of S
/// of earlier blocks only. `block` is the block of each place, from 0; `C` and `F`
/// bound the entries. The paper adds where this takes the larger.
fn above(S0: &UnitFactor, C: &[Vec<f64>], F: &[Vec<f64>], block: &[usize]) -> Vec<Vec<f64>> {
    let n = block.len();
    let start = product(S0);
    let mut B = vec![vec![Interval::ZERO; n]; n];
    let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    pairs.sort_by_key(|&(i, j)| block[i] + block[j]);
    for (i, j) in pairs {
        let point = Interval::point;
        let measured = sum(C.iter().map(|row| point(row[i]) * point(row[j])));
        let right = sum((0..n).map(|k| B[i][k] * point(F[k][j])));
        let left = sum((0..n).map(|k| point(F[k][i]) * B[k][j]));
        B[i][j] = start[i][j].abs().max(measured + right + left);
        B[j][i] = B[i][j];
    }
    upper(&B)
}

/// UᵀDU
fn product(S0: &UnitFactor) -> IntervalMatrix {
    let n = S0.diagonal.len();
    let U = |k: usize, j: usize| Interval::point(S0.U(k, j));
    square(n, |i, j| {
        sum((0..n).map(|k| U(k, i) * Interval::point(S0.diagonal[k]) * U(k, j)))
    })
}

/// A lower bound of the least eigenvalue of S(t) for t ≥ TAU/θ where F and C are
/// numbers: F is nilpotent, and
///
/// S(t) ≥ ∫₀^τ e^{−s} e^{−Fᵀs} CᵀC e^{−Fs} ds = Σ_ab (−1)^{a+b}/(a! b!) I_{a+b} (CF^a)ᵀCF^b,
///
/// I_m = ∫₀^τ e^{−s} s^m ds = m I_{m−1} − e^{−τ} τ^m.
fn below(C: &[Vec<f64>], F: &[Vec<f64>], blocks: usize) -> Option<f64> {
    let n = F.len();
    let τ = Interval::point(TAU);
    let left = (-τ).exp();
    let mut integrals = vec![Interval::ONE - left];
    for m in 1..2 * blocks {
        let before = integrals[m - 1];
        integrals.push(Interval::point(m as f64) * before - left * τ.powi(m as i32));
    }
    // (−1)^a CF^a/a!
    let mut rows: Vec<Vec<Vec<Interval>>> = vec![
        C.iter()
            .map(|row| row.iter().map(|&c| Interval::point(c)).collect())
            .collect(),
    ];
    for a in 1..blocks {
        let step = |row: &Vec<Interval>| -> Vec<Interval> {
            let entry = |j: usize| sum((0..n).map(|k| row[k] * Interval::point(F[k][j])));
            (0..n)
                .map(|j| -entry(j) / Interval::point(a as f64))
                .collect()
        };
        let next = rows[a - 1].iter().map(step).collect();
        rows.push(next);
    }
    let G = square(n, |i, j| {
        let terms = (0..blocks).flat_map(|a| (0..blocks).map(move |b| (a, b)));
        sum(terms.map(|(a, b)| {
            let outer = sum(rows[a].iter().zip(&rows[b]).map(|(x, y)| x[i] * y[j]));
            integrals[a + b] * outer
        }))
    });
    least_eigenvalue(&G, f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two integrators: S(∞) = [1, −1; −1, 2], least eigenvalue (3 − √5)/2; a little
    /// less is left after ten time constants. Then two coupled entries of |S|.
    #[test]
    fn two_integrators() {
        let (C, F) = (vec![vec![1.0, 0.0]], vec![vec![0.0, 1.0], vec![0.0, 0.0]]);
        let found = below(&C, &F, 2).unwrap();
        let limit = (3.0 - 5f64.sqrt()) / 2.0;
        assert!(
            found < limit && found > 0.98 * limit,
            "{found} against {limit}"
        );
        let S0 = UnitFactor::new(&[vec![3.0, 0.0], vec![0.0, 1.0]]).unwrap();
        let B = above(&S0, &C, &F, &[0, 1]);
        assert_eq!(B, [[3.0, 3.0], [3.0, 6.0]].map(|r| r.to_vec()));
    }
}
