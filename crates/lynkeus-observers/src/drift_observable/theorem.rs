//! What the theorems 3.1, 4.1 and 4.5 guarantee.
//!
//! e_z' = (A − KC) e_z + Σ_k e_k (r_k − r̂_k) + f, |r_k − r̂_k| ≤ g_k |(e_z, e_a)| in m rows k,
//! f from disturbances and noise. With E = (√m g_k e_k) the perturbation is E v with
//! |v|² ≤ |e_z|² + |e_a|², and any P of (3.2), (4.7), (4.33) with γ = 1 gives for ν = e_zᵀP⁻¹e_z
//!
//! ν' ≤ −2αν + |e_a|² + 2√ν √(fᵀP⁻¹f)
//!
//! e_a is the error of the filter, zero for (3.1) and (4.1). P is sought for the study's K,
//! not K for a P: the theorems only ask that there is one.

use lynkeus_gain::riccati::Riccati;
use lynkeus_gain::vandermonde;
use lynkeus_structure::{Check, Condition, Extended};

use super::conditions::Form;
use super::guarantee;
use super::keys::{Gains, SLOPES, Variant, slopes};
use super::lipschitz::{self, Lipschitz};
use crate::enclosure::{figures, length, up};
use crate::{Assumptions, Certificate, Constant, DesignError, Tuning, TuningError};

/// Steps of a bisection on a logarithmic scale.
const STEPS: usize = 40;
/// α of the question whether there is any, as a share of the slowest pole.
const SLOW: f64 = 1e-6;

/// Everything the conclusions are drawn from.
pub(super) struct Proof<'a, 'p> {
    pub extended: &'a Extended<'p>,
    pub form: &'a Form,
    pub gains: &'a Gains,
    pub lipschitz: &'a Lipschitz,
    /// A − KC
    pub A: Vec<Vec<f64>>,
    /// the slowest pole's absolute value
    pub slowest: f64,
    /// per input: the bound of the derivative that drives the filter
    pub w: Vec<f64>,
}

pub(super) fn certificate(
    extended: &Extended<'_>,
    tuning: &Tuning,
    form: Form,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let slopes = slopes(extended, tuning, &form)?;
    let lipschitz = lipschitz::bounds(extended, &form, &slopes, &assumptions.region)?;
    let u_M = largest_input(extended, assumptions);
    let gains = gains(extended, tuning, &form)?;
    // the last check of the family is on inputs without bounds on their slopes
    let mut hypotheses: Vec<Check> = form.examination.checks.iter().take(3).cloned().collect();
    hypotheses.extend(of_the_map(extended, &form, &slopes, &lipschitz));
    let order = |jet: &Vec<_>, given: &Option<Vec<f64>>| match (jet.is_empty(), given) {
        (true, _) => 0.0,
        (_, Some(bounds)) => bounds.last().copied().unwrap_or(0.0),
        (_, None) => f64::INFINITY,
    };
    let w = form
        .U
        .iter()
        .zip(&slopes)
        .map(|(jet, given)| order(jet, given));
    let mut constants = of_lipschitz(&form, &lipschitz, u_M);
    let mut found = None;
    match &gains {
        Some(gains) => {
            let proof = Proof {
                extended,
                form: &form,
                gains,
                lipschitz: &lipschitz,
                A: closed_loop(&gains.K),
                slowest: slowest(&gains.λ),
                w: w.collect(),
            };
            let (P, checks) = proof.riccati(u_M, &mut constants);
            hypotheses.extend(checks);
            found = P.map(|P| (proof, P));
        }
        None => hypotheses.push(undecided(
            "K and P solve the Riccati inequality",
            "the study gives neither poles nor alpha and gamma",
        )),
    }
    let mut certificate = Certificate::new(basis(form.variant), assumptions, hypotheses);
    certificate.constants = constants;
    certificate.notes = notes(&form);
    if let Some((proof, P)) = found.filter(|_| certificate.weakest().is_none()) {
        guarantee::conclude(&proof, &P, assumptions, &mut certificate);
    }
    Ok(certificate)
}

fn basis(variant: Variant) -> &'static str {
    match variant {
        Variant::Bounded => "Theorem 3.1 of Germani and Manes",
        Variant::Theoretical => "Theorem 4.1 of Germani and Manes",
        Variant::Practical => "Theorem 4.5 of Germani and Manes, (4.30) corrected",
    }
}

fn notes(form: &Form) -> Vec<String> {
    let mut notes = vec!["where the column rcond is below 6·10⁻⁴ the tool withdraws a part of the correction, and the theorem says nothing".to_owned()];
    if form.variant == Variant::Practical {
        notes.push("in the box beside plant and estimate: the filter's estimates of the inputs and their derivatives; the bound holds once the filter has settled, at the same rate".to_owned());
    }
    notes
}

/// None where the study has no pole yet.
fn gains(
    extended: &Extended<'_>,
    tuning: &Tuning,
    form: &Form,
) -> Result<Option<Gains>, TuningError> {
    let has = |key: &str| tuning.values.contains_key(key);
    match has("poles") || has("alpha") {
        true => Gains::new(extended, tuning, form).map(Some),
        false => Ok(None),
    }
}

/// The largest |u_j| of the box.
fn largest_input(extended: &Extended<'_>, assumptions: &Assumptions) -> f64 {
    let symbols: Vec<_> = extended.inputs.iter().map(|i| i.node).collect();
    let sides = assumptions.region.restricted(&symbols).dimensions;
    let largest = sides.iter().map(|d| d.min.abs().max(d.max.abs()));
    largest.fold(0.0, f64::max)
}

pub(super) fn slowest(λ: &[Vec<f64>]) -> f64 {
    λ.iter().flatten().fold(f64::INFINITY, |m, λ| m.min(-λ))
}

/// A − KC, a block per chain.
pub(super) fn closed_loop(K: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = K.iter().map(Vec::len).sum();
    let mut A = vec![vec![0.0; n]; n];
    let mut start = 0;
    for K in K {
        for (k, gain) in K.iter().enumerate() {
            A[start + k][start] = -gain;
            if k + 1 < K.len() {
                A[start + k][start + k + 1] += 1.0;
            }
        }
        start += K.len();
    }
    A
}

/// Columns √m s_k e_k for the m numbers s_k > 0.
pub(super) fn spread(s: &[f64]) -> Vec<Vec<f64>> {
    let rows: Vec<usize> = (0..s.len()).filter(|&k| s[k] > 0.0).collect();
    let root = (rows.len() as f64).sqrt();
    let row = |k: usize| {
        let entry = |&column: &usize| if column == k { up(root * s[k]) } else { 0.0 };
        rows.iter().map(entry).collect()
    };
    (0..s.len()).map(row).collect()
}

pub(super) fn undecided(name: &str, detail: impl Into<String>) -> Check {
    Check {
        name: name.to_owned(),
        verdict: Condition::Undecided(vec![]),
        detail: detail.into(),
    }
}

fn check(name: &str, holds: bool, detail: String) -> Check {
    Check {
        verdict: match holds {
            true => Condition::Proved,
            false => Condition::Undecided(vec![]),
        },
        ..undecided(name, detail)
    }
}

/// Hypotheses 1 and 2 of the theorems.
fn of_the_map(
    extended: &Extended<'_>,
    form: &Form,
    slopes: &[Option<Vec<f64>>],
    found: &Lipschitz,
) -> Vec<Check> {
    let mut checks = vec![];
    let reads = form.variant != Variant::Bounded && form.U.iter().any(|jet| !jet.is_empty());
    if reads {
        let pairs = form.U.iter().zip(slopes).zip(&extended.inputs);
        let lacking = pairs.filter(|((jet, given), _)| !jet.is_empty() && given.is_none());
        let names: Vec<&str> = lacking.map(|(_, input)| input.name.as_str()).collect();
        let detail = match names.is_empty() {
            true => "assumed, as the study gives them".to_owned(),
            false => format!(
                "no bound of the derivatives of {}: give the key '{SLOPES}'",
                names.join(", ")
            ),
        };
        checks.push(check(
            "the derivatives of the inputs are bounded",
            names.is_empty(),
            detail,
        ));
        let mut regular = found.regular.clone();
        if let Condition::Refuted(_) = regular.verdict {
            // the observer passes such a place, only the proof does not
            regular.detail = format!("{} ({})", regular.detail, regular.verdict);
            regular.verdict = Condition::Undecided(vec![]);
        }
        checks.push(regular);
    }
    let name = "the map from x to the output's derivatives has a Lipschitz inverse on the box";
    let detail = match found.inverse.is_finite() {
        true => format!(
            "γ_Φ = {}, γ_Φ⁻¹ = {}",
            figures(found.map),
            figures(found.inverse)
        ),
        false => format!(
            "the means of its Jacobian over lines in the box are not known to be regular: {}",
            open_or(found, "take a smaller box")
        ),
    };
    checks.push(check(
        name,
        found.inverse.is_finite() && found.map.is_finite(),
        detail,
    ));
    let γ = length(&found.drift) + length(&found.input);
    let detail = match γ.is_finite() {
        true => format!("γ = {}", figures(length(&found.drift))),
        false => open_or(found, "the inverse has no bound"),
    };
    checks.push(check(
        "the last rows are Lipschitz in these coordinates",
        γ.is_finite(),
        detail,
    ));
    checks
}

fn open_or(found: &Lipschitz, otherwise: &str) -> String {
    match found.open.is_empty() {
        true => otherwise.to_owned(),
        false => {
            let shown: Vec<&str> = found.open.iter().map(String::as_str).take(4).collect();
            format!("no bound of {}: declare min and max", shown.join(", "))
        }
    }
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
        let lemma = vandermonde::lemma_3_2(n, SLOW, β, γ / β);
        if let Ok(lemma) = lemma {
            list.push(("σ0", lemma.σ, "θ0 of this family: the smallest σ of Lemma 3.2 whose poles −σ, …, −σⁿ do for γ, without input"));
        }
    }
    let finite = list.into_iter().filter(|c| c.1.is_finite());
    finite
        .map(|(name, value, meaning)| Constant::new(name, value, meaning))
        .collect()
}

impl Proof<'_, '_> {
    /// The fastest P for the study's gain, and hypothesis 4 with both numbers.
    fn riccati(&self, u_M: f64, constants: &mut Vec<Constant>) -> (Option<Riccati>, Vec<Check>) {
        let mut checks = vec![];
        let drift = &self.lipschitz.drift;
        let with_input = |u: f64| -> Vec<f64> {
            let pairs = drift.iter().zip(&self.lipschitz.input);
            pairs
                .map(|(γ, H)| if *H > 0.0 { up(γ + u * H) } else { *γ })
                .collect()
        };
        let γ = length(drift);
        let limit = self.largest(|s| drift.iter().map(|g| g * s).collect()) * γ;
        let name = "γ ≤ γ*: K and some P > 0 solve the Riccati inequality";
        let holds = limit >= γ;
        if limit.is_finite() && γ.is_finite() && γ > 0.0 {
            constants.push(Constant::new("γ*", limit, "what these poles can bear"));
            let word = if holds { "≤" } else { ">" };
            let detail = format!("{} {word} {}", figures(γ), figures(limit));
            checks.push(check(name, holds, detail));
            constants.extend(self.scale());
        } else if !γ.is_finite() {
            checks.push(undecided(name, "γ has no bound"));
        }
        if !γ.is_finite() || (γ > 0.0 && !holds) {
            return (None, checks);
        }
        if length(&self.lipschitz.input) > 0.0 {
            let limit = self.largest(with_input);
            if limit.is_finite() {
                let meaning = "the largest |u| that these poles can bear";
                constants.push(Constant::new("u_M", limit, meaning));
            }
            let word = if u_M <= limit { "≤" } else { ">" };
            let detail = format!("{} {word} {}", figures(u_M), figures(limit));
            checks.push(check("|u| ≤ u_M", u_M <= limit, detail));
        }
        let g = with_input(u_M);
        if !g.iter().all(|g| g.is_finite()) {
            return (None, checks);
        }
        let P = Riccati::fastest(&self.A, &spread(&g), 1.0, self.slowest);
        if P.is_none() && checks.iter().all(|c| c.verdict == Condition::Proved) {
            checks.push(undecided(name, "no P was found for these poles"));
        }
        (P, checks)
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

    fn bears(&self, A: &[Vec<f64>], g: &[f64], slowest: f64) -> bool {
        g.iter().all(|g| g.is_finite())
            && Riccati::solve(A, &spread(g), SLOW * slowest, 1.0).is_some()
    }

    /// The smallest factor of all poles that the proof allows.
    fn scale(&self) -> Option<Constant> {
        let bears = |s: f64| {
            let scaled = |λ: &Vec<f64>| -> Vec<f64> {
                vandermonde::place(&λ.iter().map(|λ| λ * s).collect::<Vec<_>>())
            };
            let K: Vec<Vec<f64>> = self.gains.λ.iter().map(scaled).collect();
            self.bears(&closed_loop(&K), &self.lipschitz.drift, s * self.slowest)
        };
        let s = edge(bears)?;
        let meaning = "the proof allows these poles times this factor, without input";
        Some(Constant::new("s0", s, meaning))
    }
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
