//! What the theorems 3.1, 4.1 and 4.5 guarantee.
//!
//! e_z' = (A − KC) e_z + Σ_k e_k (r_k − r̂_k) + f, |r_k − r̂_k| ≤ g_k |(e_z, e_a)| in m rows k,
//! f from disturbances, noise, and for (4.22) from n̄(z, x_a)w, which the observer lacks. With E = (√m g_k e_k) the perturbation is E v with
//! |v|² ≤ |e_z|² + |e_a|², and any P of (3.2), (4.7), (4.33) with γ = 1 gives for ν = e_zᵀP⁻¹e_z
//!
//! ν' ≤ −2αν + |e_a|² + 2√ν √(fᵀP⁻¹f)
//!
//! Where [`super::together`] proves a faster decay of such a ν, that one counts. e_a is the error of the filter, zero for (3.1) and (4.1). P is sought for the study's K,
//! not K for a P: the theorems only ask that there is one.
//!
//! In (4.39) the print drops γ²_Φ̄⁻¹|e_a|², in (4.40) c₃ lacks the factor γ and c₂ has √γ for γ.
//! (4.23) gives the observer a term n̄(ẑ, x̂_a)w that (4.22) does not have, so that n̄(z, x_a)w drives the
//! error. With P for E = (√m g_k e_k) and γ = 1, so that γ/β of the print is one, (4.35) becomes
//!
//! ν' ≤ −2α₁ν + |e_a|² + 2φ√ν,  φ² ≥ (B n̄ w)ᵀP⁻¹(B n̄ w),
//!
//! hence √ν ≤ √p + q for p' = −2α₁p + |e_a|², q' = −α₁q + φ, and
//!
//! |e_x| ≤ c₁ e^(−α₁t)|e_x(0)| + (c₁ e^(−α₁t) + c₂ √ε + c₄ e^(−α₂t)) |e_a(0)| + c₃,
//! c₁ = γ_Φ̄ γ_Φ̄⁻¹ √cn(P),  c₂ = γ_Φ̄⁻¹ √(‖P‖ cn(P_a)),  c₄ = γ_Φ̄⁻¹ √cn(P_a),
//! c₃ = γ_Φ̄⁻¹ √(‖P‖ (a/√(2α₁) + φ/α₁)² + a²),  a² = ‖P_a‖ w_M²/(2α₂).
//!
//! As t → ∞ the fixed point of ν' says less than c₃: √ν → (φ + √(φ² + 2α₁a²))/(2α₁). There any P of (4.33)
//! will do, also one with a smaller α₁, and the states are bounded one by one.
//! P is that for the study's gain.

use lynkeus_expr::Interval;
use lynkeus_gain::integrators::{self, Pole};
use lynkeus_proof::ellipsoid::Ellipsoid;
use lynkeus_proof::magnitude::{length, plus, size, times, total};
use lynkeus_proof::riccati;
use lynkeus_structure::{AugmentedPlant, Verdict};
use nalgebra::DMatrix;

use super::form::Form;
use super::lipschitz;
use super::lipschitz::Lipschitz;
use super::observer::{Gains, closed_loop, slowest, spread};
use super::said::Said;
use super::settings::{Settings, Variant};
use super::together::{self, Falling};
use crate::design::Found;
use crate::statement::{proved, sufficient, undecided};
use crate::{
    Assumptions, Bounds, Certificate, Check, Constant, DesignError, Germani, Reason, Statement,
    TuningError, UltimateBound,
};

pub(super) fn certificate(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let slopes = slopes(settings, &form, assumptions)?;
    let lipschitz = lipschitz::bounds(augmented, &form, &slopes, &assumptions.region)?;
    let u_M = largest_input(augmented, assumptions);
    let gains = match settings.has_poles() {
        true => Some(Gains::new(augmented, settings, &form)?),
        false => None,
    };
    // not that on inputs, which is about slopes without bounds
    let mut hypotheses = examination.checks;
    hypotheses.retain(|check| !check.is_advisory);
    let continuous = lipschitz.continuous.clone();
    hypotheses.push(Statement::from(Germani::ContinuousRows).with(continuous));
    hypotheses.extend(of_the_map(augmented, &form, &slopes, &lipschitz));
    let mut constants = of_lipschitz(&form, &lipschitz, u_M);
    constants.extend(largest_inputs(augmented, &form, assumptions)?);
    let (mut found, mut is_together) = (None, false);
    match &gains {
        Some(gains) => {
            let proof = Proof {
                augmented,
                form: &form,
                gains,
                lipschitz: &lipschitz,
                A: closed_loop(&gains.K),
                slowest: slowest(&gains.λ),
                w: driving(&form, &slopes),
            };
            let forms = proof.forms(assumptions, &mut constants)?;
            is_together = forms.is_together;
            if is_together {
                // of γ nothing is asked
                hypotheses.retain(|check| check.is_proved() || check.statement != LAST_ROWS);
            }
            hypotheses.extend(forms.checks);
            found = (!forms.P.is_empty()).then_some((proof, forms.P));
        }
        None => hypotheses.push(undecided(Germani::Gains, Said::NoPoles)),
    }
    let basis = basis(form.variant, is_together);
    let mut certificate = Certificate::new(basis, assumptions, hypotheses);
    certificate.constants = constants;
    certificate.notes = notes(augmented, &form, assumptions);
    if let Some((proof, P)) = found.filter(|_| certificate.weakest().is_none()) {
        proof.conclude(&P, assumptions, &mut certificate);
    }
    Ok(certificate)
}

const LAST_ROWS: Statement = Statement::Germani(Germani::LastRows);

fn basis(variant: Variant, is_together: bool) -> &'static str {
    match (variant, is_together) {
        (Variant::Bounded, false) => "Theorem 3.1 of Germani and Manes",
        (Variant::Theoretical, false) => "Theorem 4.1 of Germani and Manes",
        (Variant::Practical, _) => "Theorem 4.5 of Germani and Manes, (4.30) corrected",
        (_, true) => "V = e_zᵀP⁻¹e_z of Germani and Manes, without their Lipschitz constants",
    }
}

fn notes(augmented: &AugmentedPlant<'_>, form: &Form, assumptions: &Assumptions) -> Vec<Reason> {
    let with_filter = form.variant == Variant::Practical;
    let constant = assumptions.constant(augmented.plant_states());
    let constant: Vec<String> = constant.into_iter().map(str::to_owned).collect();
    let constant = (!constant.is_empty()).then_some(Said::TakenAsConstant(constant));
    let notes = std::iter::once(Said::Box { with_filter }).chain(constant);
    notes.chain([Said::Withdrawn]).map(Reason::from).collect()
}

/// Per input bounds of u', u'', …, one more than the observer reads: the family's key, else
/// what holds for every family; empty where there are none.
fn slopes(
    settings: &Settings,
    form: &Form,
    assumptions: &Assumptions,
) -> Result<Vec<Vec<f64>>, TuningError> {
    let orders: Vec<usize> = match form.variant {
        Variant::Bounded => vec![0; form.U.len()],
        _ => form.U.iter().map(Vec::len).collect(),
    };
    let general = |j: usize| {
        let bounds = assumptions.input_derivatives.get(j)?;
        bounds.get(..orders[j]).map(<[f64]>::to_vec)
    };
    let own = settings.slopes(&orders)?.into_iter().enumerate();
    Ok(own
        .map(|(j, bounds)| bounds.or_else(|| general(j)).unwrap_or_default())
        .collect())
}

/// Per input the bound of the derivative that drives the filter.
fn driving(form: &Form, slopes: &[Vec<f64>]) -> Vec<f64> {
    let last = |(jet, bounds): (&Vec<_>, &Vec<f64>)| match jet.is_empty() {
        true => 0.0,
        false => bounds.last().copied().unwrap_or(f64::INFINITY),
    };
    form.U.iter().zip(slopes).map(last).collect()
}

/// The largest |u_j| of the box.
fn largest_input(augmented: &AugmentedPlant<'_>, assumptions: &Assumptions) -> f64 {
    let symbols: Vec<_> = augmented.inputs.iter().map(|i| i.node).collect();
    let sides = assumptions.region.restricted(&symbols).dimensions;
    let largest = sides.iter().map(|d| d.min.abs().max(d.max.abs()));
    largest.fold(0.0, f64::max)
}

/// Ū of Theorem 2.4, where the map reads inputs.
fn largest_inputs(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    assumptions: &Assumptions,
) -> Result<Option<Constant>, DesignError> {
    if !form.reads_inputs() {
        return Ok(None);
    }
    let meaning = "of Theorem 2.4: det Q̄ ≠ 0 is proved on the box for inputs and derivatives of inputs up to it";
    let found = form.largest_inputs(augmented, &assumptions.region)?;
    let found = found.filter(|radius| radius.is_finite());
    Ok(found.map(|radius| Constant::new("Ū", radius, meaning)))
}

/// Hypotheses 1 and 2 of the theorems.
fn of_the_map(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    slopes: &[Vec<f64>],
    found: &Lipschitz,
) -> Vec<Check> {
    let mut checks = vec![];
    if form.reads_inputs() {
        let pairs = form.U.iter().zip(slopes).zip(&augmented.inputs);
        let open = pairs.filter(|((jet, bounds), _)| !jet.is_empty() && bounds.is_empty());
        let open: Vec<String> = open.map(|(_, input)| input.name.clone()).collect();
        let (bounded, open) = (open.is_empty(), Said::InputDerivatives(open));
        checks.push(sufficient(Germani::InputDerivatives, bounded, open));
        let regular = found.regular.clone();
        checks.push(match regular.verdict {
            // the observer passes such a place, only the proof does not
            Verdict::Refuted(_) => undecided(Germani::RegularWithin, Said::OnlyOfTheProof(regular)),
            _ => Statement::from(Germani::RegularWithin).with(regular),
        });
    }
    let open = || found.open.clone();
    let (map, inverse) = (found.map, found.inverse);
    let said = match inverse.is_finite() {
        true => Said::Map { map, inverse },
        false => Said::NoInverse(open()),
    };
    let bounded = inverse.is_finite() && map.is_finite();
    checks.push(sufficient(Germani::Inverse, bounded, said));
    let γ = length(&found.drift);
    let bounded = (γ + length(&found.input)).is_finite();
    let said = match bounded {
        true => Said::LastRows(γ),
        false => Said::NoLastRows(open()),
    };
    checks.push(sufficient(Germani::LastRows, bounded, said));
    checks
}

/// γ_Φ, γ_Φ⁻¹, γ, and σ of Lemma 3.2 for that γ.
fn of_lipschitz(form: &Form, found: &Lipschitz, u_M: f64) -> Vec<Constant> {
    let γ = length(&found.drift);
    let mut list = vec![
        (
            "γ_Φ",
            found.map,
            "Lipschitz constant of the map to the output's derivatives",
        ),
        ("γ_Φ⁻¹", found.inverse, "and of its inverse"),
        ("γ", γ, "of the last derivatives in these coordinates"),
    ];
    if form.variant == Variant::Bounded {
        list.push(("γ_H", length(&found.input), "of what multiplies the input"));
        list.push(("|u|", u_M, "the largest input of the box"));
    }
    if let [n] = form.indices[..] {
        // β² = γ/√n makes the two terms of (3.20) equal where ‖V⁻¹‖ is one
        let β = (γ / (n as f64).sqrt()).max(f64::MIN_POSITIVE).sqrt();
        let lemma = integrators::lemma_3_2(n, SLOW, β, γ / β);
        if let Ok(lemma) = lemma {
            list.push(("σ0", lemma.σ, "θ0 of this family: the smallest σ of Lemma 3.2 whose poles −σ, …, −σⁿ do for γ, without input"));
        }
    }
    let finite = list.into_iter().filter(|c| c.1.is_finite());
    finite
        .map(|(name, value, meaning)| Constant::new(name, value, meaning))
        .collect()
}

/// Shares of the filter's slowest pole tried for α₂.
const FILTER_SHARES: [f64; 4] = [0.5, 0.65, 0.8, 0.9];

/// Steps of a bisection on a logarithmic scale.
const STEPS: usize = 40;

/// Shares of the largest α tried for the bounds as t → ∞.
const SHARES: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 0.9];

/// The Jacobians are taken together where that makes the decay this much faster.
const FASTER: f64 = 1.1;

/// α of the question whether there is any, as a share of the slowest pole.
const SLOW: f64 = 1e-6;

/// The filter: α₂, √cn(P_a), and a bound of |e_a| as t → ∞.
struct Filter {
    α: f64,
    peak: f64,
    rest: f64,
}

/// Everything the conclusions are drawn from.
struct Proof<'a, 'p> {
    augmented: &'a AugmentedPlant<'p>,
    form: &'a Form,
    gains: &'a Gains,
    lipschitz: &'a Lipschitz,
    /// A − KC
    A: DMatrix<f64>,
    /// the slowest pole's absolute value
    slowest: f64,
    /// per input: the bound of the derivative that drives the filter
    w: Vec<f64>,
}

/// Lyapunov functions, the one that falls fastest first, and what is stated of them.
struct Forms {
    P: Vec<Falling>,
    checks: Vec<Check>,
    /// the first is not by the Riccati inequality
    is_together: bool,
}

impl Proof<'_, '_> {
    /// Those of the Riccati inequality, behind those for the Jacobians together where these fall faster.
    fn forms(
        &self,
        assumptions: &Assumptions,
        constants: &mut Vec<Constant>,
    ) -> Result<Forms, DesignError> {
        let u_M = largest_input(self.augmented, assumptions);
        let (mut P, checks) = self.riccati(u_M, constants);
        if !checks.iter().all(Check::is_proved) {
            P.clear();
        }
        let least = P.first().map_or(0.0, |P| FASTER * P.α);
        let (of, A) = ((self.form, self.lipschitz), &self.A);
        // where nothing acts, nothing is left
        let mut acting = assumptions.drift.iter().chain(&assumptions.noise);
        let shares: &[f64] = match acting.any(|size| *size > 0.0) {
            true => &SHARES,
            false => &[],
        };
        let found = together::falling(self.augmented, of, A, least, shares)?;
        let P: Vec<Falling> = P.into_iter().map(Falling::from).collect();
        let Some((faster, parts)) = found else {
            let is_together = false;
            return Ok(Forms {
                P,
                checks,
                is_together,
            });
        };
        let rate = faster.first().map_or(0.0, |found| found.P.α);
        Ok(Forms {
            P: [faster, P].concat(),
            checks: vec![proved(Germani::OneFunction, Said::Falls { rate, parts })],
            is_together: true,
        })
    }

    /// Solutions of the Riccati inequality for the study's gain, any of which proves something: with the
    /// largest α, and with smaller ones, which may leave smaller bounds as t → ∞. And hypothesis 4
    /// with both numbers.
    fn riccati(&self, u_M: f64, constants: &mut Vec<Constant>) -> (Vec<Ellipsoid>, Vec<Check>) {
        let mut checks = vec![];
        let Lipschitz { drift, input, .. } = self.lipschitz;
        let with_input = |u: f64| -> Vec<f64> {
            let row = |(γ, H): (&f64, &f64)| match *H > 0.0 {
                true => plus(*γ, times(u, *H)),
                false => *γ,
            };
            drift.iter().zip(input).map(row).collect()
        };
        let γ = length(drift);
        let limit = self.largest(|s| drift.iter().map(|g| g * s).collect()) * γ;
        let at_most = |found: f64, limit: f64| Reason::AtMost { found, limit };
        let holds = limit >= γ;
        if limit.is_finite() && γ.is_finite() && γ > 0.0 {
            let meaning = "the γ that these poles can bear by the Riccati inequality";
            constants.push(Constant::new("γ*", limit, meaning));
            checks.push(sufficient(Germani::Riccati, holds, at_most(γ, limit)));
            constants.extend(self.scale());
        } else if !γ.is_finite() {
            checks.push(undecided(Germani::Riccati, Said::NoLipschitzConstant));
        }
        if !γ.is_finite() || (γ > 0.0 && !holds) {
            return (vec![], checks);
        }
        if length(input) > 0.0 {
            let limit = self.largest(with_input);
            if limit.is_finite() {
                let meaning = "the largest |u| that these poles can bear";
                constants.push(Constant::new("u_M", limit, meaning));
            }
            checks.push(sufficient(
                Germani::Input,
                u_M <= limit,
                at_most(u_M, limit),
            ));
        }
        let g = with_input(u_M);
        if !g.iter().all(|g| g.is_finite()) {
            return (vec![], checks);
        }
        let E = spread(&g);
        let fastest = riccati::fastest(&self.A, &E, 1.0, self.slowest);
        if fastest.is_none() && checks.iter().all(Check::is_proved) {
            checks.push(undecided(Germani::Riccati, Said::NoP));
        }
        let with_slower = |fastest: Ellipsoid| {
            let at = |share: &f64| riccati::solve(&self.A, &E, share * fastest.α, 1.0);
            let slower: Vec<Ellipsoid> = SHARES.iter().filter_map(at).collect();
            [vec![fastest], slower].concat()
        };
        (fastest.map_or(vec![], with_slower), checks)
    }

    /// The largest s for which g(s) can be borne; 0 where none can, infinite
    /// where all can.
    fn largest(&self, g: impl Fn(f64) -> Vec<f64>) -> f64 {
        let bears = |s: f64| self.bears(&self.A, &g(s), self.slowest);
        edge(|s| !bears(s)).map_or(
            f64::INFINITY,
            |s| if bears(s / 1.01) { s / 1.01 } else { 0.0 },
        )
    }

    fn bears(&self, A: &DMatrix<f64>, g: &[f64], slowest: f64) -> bool {
        g.iter().all(|g| g.is_finite())
            && riccati::solve(A, &spread(g), SLOW * slowest, 1.0).is_some()
    }

    /// The smallest factor of all poles that the Riccati inequality allows.
    fn scale(&self) -> Option<Constant> {
        let bears = |s: f64| {
            let scaled = |λ: &Vec<Pole>| -> Vec<f64> {
                let faster: Vec<Pole> = λ.iter().map(|λ| λ.scaled(s)).collect();
                integrators::place_all(&faster)
            };
            let K: Vec<Vec<f64>> = self.gains.λ.iter().map(scaled).collect();
            self.bears(&closed_loop(&K), &self.lipschitz.drift, s * self.slowest)
        };
        let s = edge(bears)?;
        let meaning = "the Riccati inequality allows these poles times this factor, without input";
        Some(Constant::new("s0", s, meaning))
    }

    /// Rate, peak and bounds as t → ∞, where every hypothesis is proved.
    fn conclude(&self, P: &[Falling], assumptions: &Assumptions, found: &mut Certificate) {
        let Falling { P: fastest, reach } = &P[0];
        let (gains, lipschitz) = (self.gains, self.lipschitz);
        let filtered = self.form.variant == Variant::Practical && self.w.iter().any(|&w| w > 0.0)
            || gains.K2.iter().any(|K| !K.is_empty());
        let filter = if filtered { self.filter() } else { None };
        if filtered && filter.is_none() {
            let check = undecided(Germani::Filter, Said::NoFilterP);
            found.hypotheses.push(check);
            return;
        }
        found.rate = Some(filter.as_ref().map_or(fastest.α, |f| fastest.α.min(f.α)));
        let μ = times(times(fastest.peak(), lipschitz.map), lipschitz.inverse);
        let reached = reach.as_ref().map(|reach| times(reach.form, reach.whole));
        let μ = reached.map_or(μ, |reached| reached.min(μ));
        // with a filter the error peaks by what the filter's leaves as well
        found.overshoot = filter.is_none().then_some(μ);
        self.print(fastest, μ, filter.as_ref(), &mut found.constants);
        let a = filter.map_or(0.0, |f| f.rest);
        let left = P.iter().map(|P| self.left(P, a, assumptions));
        if let Some(left) = left.min_by(|x, y| x.norm.total_cmp(&y.norm)) {
            found.ultimate_bound = Some(left.norm);
            found.ultimate = left.states;
        }
    }

    /// Bounds as t → ∞ by P, where |e_a| → a: √ν settles where 2αν = a² + 2f√ν, and
    /// |e_z,j| ≤ √(P_jj ν). Without a filter [`Reach`](lynkeus_proof::decay::Reach) bounds e_x itself.
    fn left(&self, Falling { P, reach }: &Falling, a: f64, assumptions: &Assumptions) -> Bounds {
        let found = self.lipschitz;
        let f = size(of_rows(P, &found.unseen)) + size(self.forces(P, assumptions));
        let twice = Interval::point(2.0) * Interval::point(P.α);
        let root_ν = (f + (f.powi(2) + twice * size(a).powi(2)).sqrt()) / twice;
        let e_z = Interval::point(P.largest).sqrt() * root_ν;
        let part = |j: usize| (Interval::point(P.P[(j, j)]).sqrt() * root_ν).min(e_z).hi();
        let parts: Vec<f64> = (0..P.P.nrows()).map(part).collect();
        let e_z = e_z.hi();
        let of_state = |(z, of_a): (&Vec<f64>, &f64)| {
            let one_by_one = total(z.iter().zip(&parts).map(|(z, e)| times(*z, *e)));
            let together = times(length(z), e_z);
            plus(one_by_one.min(together), times(*of_a, a))
        };
        let each = found.of_z.iter().zip(&found.of_a);
        let mut each: Vec<f64> = each.map(of_state).collect();
        let mut norm = times(found.inverse, length(&[e_z, a])).min(length(&each));
        if let Some(reach) = reach {
            let by_form = |times: &f64| (Interval::point(*times) * root_ν).hi();
            for (bound, times) in each.iter_mut().zip(&reach.entries) {
                *bound = bound.min(by_form(times));
            }
            norm = norm.min(by_form(&reach.whole)).min(length(&each));
        }
        let names = self.augmented.states.iter().map(|x| x.name.clone());
        let states = names.zip(each).map(UltimateBound::from).collect();
        Bounds { norm, states }
    }

    /// The P_a of (4.27) with the smallest bound of the filter's error.
    fn filter(&self) -> Option<Filter> {
        let gains = self.gains;
        let mut w = vec![];
        for (K, &bound) in gains.K2.iter().zip(&self.w) {
            w.extend((0..K.len()).map(|k| if k + 1 == K.len() { bound } else { 0.0 }));
        }
        let driven = w.iter().any(|&w| w > 0.0);
        let limit = slowest(&gains.filter_λ);
        let A = closed_loop(&gains.K2);
        let one = |share: f64| {
            let P = riccati::solve(&A, &spread(&w), share * limit, 0.0)?;
            let twice = Interval::point(2.0) * Interval::point(P.α);
            let rest = (Interval::point(P.largest) / twice).sqrt().hi();
            Some(Filter {
                α: P.α,
                peak: P.peak(),
                rest: if driven { rest } else { 0.0 },
            })
        };
        let found = FILTER_SHARES.into_iter().filter_map(one);
        found.min_by(|a, b| a.rest.total_cmp(&b.rest))
    }

    /// √(fᵀP⁻¹f) for the disturbances, as the map sees them, and the noise.
    fn forces(&self, P: &Ellipsoid, assumptions: &Assumptions) -> f64 {
        let pushed = |row: &Vec<f64>| {
            let terms = row.iter().zip(&assumptions.drift);
            total(terms.map(|(q, d)| times(*q, *d)))
        };
        let q: Vec<f64> = self.lipschitz.Q.iter().map(pushed).collect();
        let mut sum = of_rows(P, &q);
        let mut start = 0;
        for (i, K) in self.gains.K.iter().enumerate() {
            let noise = assumptions.noise.get(i).copied().unwrap_or(0.0);
            let mut column = vec![0.0; self.A.nrows()];
            column[start..start + K.len()].copy_from_slice(K);
            if noise > 0.0 && !K.is_empty() {
                sum = plus(sum, times(P.weight(&column), noise));
            }
            start += K.len();
        }
        sum
    }

    /// The numbers of (4.30), or of its like without a filter.
    fn print(
        &self, P: &Ellipsoid, μ: f64, filter: Option<&Filter>, constants: &mut Vec<Constant>
    ) {
        let found = self.lipschitz;
        let mut add = |name: &str, value: f64, meaning: &str| {
            constants.push(Constant::new(name, value, meaning));
        };
        for (output, K) in self.augmented.outputs.iter().zip(&self.gains.K) {
            for (k, gain) in K.iter().enumerate() {
                let meaning = format!("gain of {}", output.variable.name);
                add(&format!("K{}", k + 1), *gain, &meaning);
            }
        }
        for lemma in &self.gains.lemma {
            let meaning = "of Lemma 3.2, for the study's alpha, beta and gamma";
            add("σ", lemma.σ, meaning);
        }
        add("‖P‖", P.largest, "largest eigenvalue of P");
        add("λmin(P)", P.smallest, "smallest eigenvalue of P");
        add("α", P.α, "the rate that P proves");
        let Some(filter) = filter else {
            let meaning = "the factor by which the error may peak: √cn(P) γ_Φ γ_Φ⁻¹, or less";
            return add("μ", μ, meaning);
        };
        let (root, α) = (Interval::point(P.largest).sqrt(), Interval::point(P.α));
        let spreading = (root * size(filter.peak)).hi();
        let left = size(filter.rest) / (Interval::point(2.0) * α).sqrt();
        let e_z = (root * (left + size(of_rows(P, &found.unseen)) / α)).hi();
        let c2 = times(found.inverse, spreading);
        let c3 = times(found.inverse, length(&[e_z, filter.rest]));
        let c4 = times(found.inverse, filter.peak);
        let n̄ = length(&found.unseen);
        add("α2", filter.α, "the rate of the filter");
        add("c1", μ, "of (4.30): the factor of the initial errors");
        add(
            "c2",
            c2,
            "of (4.30): the factor of √ε and the filter's initial error",
        );
        add(
            "c3",
            c3,
            "of (4.30), corrected: what the filter and n̄w leave",
        );
        add(
            "|n̄w|",
            n̄,
            "missing in (4.25): the part of the last derivatives that (4.22) lacks",
        );
        add(
            "c4",
            c4,
            "missing in (4.30): the filter's initial error as x sees it",
        );
    }
}

/// √(fᵀP⁻¹f) for every f with |f_k| ≤ `size[k]`.
fn of_rows(P: &Ellipsoid, size: &[f64]) -> f64 {
    let unit = |k: usize| {
        let entry = |i: usize| f64::from(u8::from(i == k));
        (0..size.len()).map(entry).collect::<Vec<_>>()
    };
    let each = size.iter().enumerate().filter(|(_, size)| **size > 0.0);
    let one_by_one = total(each.map(|(k, size)| times(P.weight(&unit(k)), *size)));
    one_by_one.min(P.weight_of_length(length(size)))
}

/// The smallest s > 0 from which on `holds`, to a thousandth, rounded up; none up to 10⁶.
fn edge(holds: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut low, mut high) = (1e-9f64, 1.0f64);
    while !holds(high) {
        (low, high) = (high, high * 4.0);
        if high > 1e6 {
            return None;
        }
    }
    for _ in 0..STEPS {
        let middle = (low * high).sqrt();
        match holds(middle) {
            true => high = middle,
            false => low = middle,
        }
        if high < low * 1.001 {
            break;
        }
    }
    Some(high)
}
