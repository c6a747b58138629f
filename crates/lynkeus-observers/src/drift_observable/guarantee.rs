//! Rate, peak and ultimate bound once the hypotheses hold.
//!
//! In (4.39) the print drops γ²_Φ̄⁻¹|e_a|², in (4.40) c₃ lacks the factor γ and c₂ has √γ for γ.
//! With P for E = (√m g_k e_k) and γ = 1, so that γ/β of the print is one,
//!
//! |e_x| ≤ c₁ e^(−α₁t)|e_x(0)| + (c₁ e^(−α₁t) + c₂ √ε + c₄ e^(−α₂t)) |e_a(0)| + c₃,
//! c₁ = γ_Φ̄ γ_Φ̄⁻¹ √cn(P),  c₂ = γ_Φ̄⁻¹ √(‖P‖ cn(P_a)),  c₄ = γ_Φ̄⁻¹ √cn(P_a),
//! c₃ = γ_Φ̄⁻¹ a √(‖P‖/(2α₁) + 1),  a² = ‖P_a‖ w_M²/(2α₂).

use lynkeus_gain::riccati::Riccati;

use super::keys::Variant;
use super::theorem::{Proof, closed_loop, slowest, spread, undecided};
use crate::enclosure::{length, up};
use crate::{Assumptions, Certificate, Constant, Verdict};

/// Shares of the filter's slowest pole tried for α₂.
const SHARES: [f64; 4] = [0.5, 0.65, 0.8, 0.9];

/// The filter: α₂, √cn(P_a), and a bound of |e_a| as t → ∞.
struct Filter {
    α: f64,
    peak: f64,
    rest: f64,
}

pub(super) fn conclude(
    proof: &Proof<'_, '_>,
    P: &Riccati,
    assumptions: &Assumptions,
    found: &mut Certificate,
) {
    let filtered = proof.form.variant == Variant::Practical && proof.w.iter().any(|&w| w > 0.0)
        || proof.gains.K2.iter().any(|K| !K.is_empty());
    let filter = match filtered {
        true => match filter(proof) {
            Some(filter) => Some(filter),
            None => {
                let detail = "no P_a was found for the filter's poles";
                found
                    .hypotheses
                    .push(undecided("K2 and P_a solve (4.27)", detail));
                found.verdict = Verdict::Undecided;
                return;
            }
        },
        false => None,
    };
    let (γ, peak) = (proof.lipschitz.inverse, up((P.largest / P.smallest).sqrt()));
    let α = filter.as_ref().map_or(P.α, |f| P.α.min(f.α));
    found.rate = Some(α);
    print(proof, P, peak, filter.as_ref(), &mut found.constants);
    let a = filter.map_or(0.0, |f| f.rest);
    let f = forces(proof, P, assumptions);
    let root_ν = up((f + (f * f + 2.0 * P.α * a * a).sqrt()) / (2.0 * P.α));
    let e_z = up(P.largest.sqrt() * root_ν);
    found.ultimate_bound = Some(up(γ * length(&[e_z, a])));
    let states = proof.extended.states.iter().zip(&proof.lipschitz.states);
    let ultimate = states.map(|(x, (z, through))| (x.name.clone(), up(z * e_z + through * a)));
    found.ultimate = ultimate.collect();
}

/// The P_a of (4.27) with the smallest bound of the filter's error.
fn filter(proof: &Proof<'_, '_>) -> Option<Filter> {
    let gains = proof.gains;
    let mut w = vec![];
    for (K, &bound) in gains.K2.iter().zip(&proof.w) {
        w.extend((0..K.len()).map(|k| if k + 1 == K.len() { bound } else { 0.0 }));
    }
    let driven = w.iter().any(|&w| w > 0.0);
    let limit = slowest(&gains.filter_λ);
    let A = closed_loop(&gains.K2);
    let one = |share: f64| {
        let P = Riccati::solve(&A, &spread(&w), share * limit, 0.0)?;
        let rest = up((P.largest / (2.0 * P.α)).sqrt());
        Some(Filter {
            α: P.α,
            peak: up((P.largest / P.smallest).sqrt()),
            rest: if driven { rest } else { 0.0 },
        })
    };
    let found = SHARES.into_iter().filter_map(one);
    found.min_by(|a, b| a.rest.total_cmp(&b.rest))
}

/// √(fᵀP⁻¹f) for the disturbances, as the map sees them, and the noise.
fn forces(proof: &Proof<'_, '_>, P: &Riccati, assumptions: &Assumptions) -> f64 {
    let n = proof.A.len();
    let pushed = |row: &Vec<f64>| {
        let terms = row.iter().zip(&assumptions.drift);
        up(terms.map(|(q, d)| if *d > 0.0 { q * d } else { 0.0 }).sum())
    };
    let q: Vec<f64> = proof.lipschitz.Q.iter().map(pushed).collect();
    let unit = |k: usize| {
        (0..n)
            .map(|i| f64::from(u8::from(i == k)))
            .collect::<Vec<_>>()
    };
    let each = q.iter().enumerate().filter(|(_, q)| **q > 0.0);
    let one_by_one: f64 = each.map(|(k, q)| P.weight(&unit(k)) * q).sum();
    let together = length(&q) / P.smallest.sqrt();
    let mut sum = one_by_one.min(together);
    let mut start = 0;
    for (i, K) in proof.gains.K.iter().enumerate() {
        let noise = assumptions.noise.get(i).copied().unwrap_or(0.0);
        let mut column = vec![0.0; n];
        column[start..start + K.len()].copy_from_slice(K);
        if noise > 0.0 && !K.is_empty() {
            sum += P.weight(&column) * noise;
        }
        start += K.len();
    }
    up(sum)
}

fn print(
    proof: &Proof<'_, '_>,
    P: &Riccati,
    peak: f64,
    filter: Option<&Filter>,
    constants: &mut Vec<Constant>,
) {
    let (map, inverse) = (proof.lipschitz.map, proof.lipschitz.inverse);
    let μ = up(peak * map * inverse);
    let mut add = |name: &str, value: f64, meaning: &str| {
        constants.push(Constant::new(name, value, meaning));
    };
    for (output, K) in proof.extended.outputs.iter().zip(&proof.gains.K) {
        for (k, gain) in K.iter().enumerate() {
            let meaning = format!("gain of {}", output.variable.name);
            add(&format!("K{}", k + 1), *gain, &meaning);
        }
    }
    for lemma in &proof.gains.lemma {
        add(
            "σ",
            lemma.σ,
            "of Lemma 3.2, for the study's alpha, beta and gamma",
        );
    }
    add("‖P‖", P.largest, "largest eigenvalue of P");
    add("λmin(P)", P.smallest, "smallest eigenvalue of P");
    add("α", P.α, "the rate that P proves");
    let Some(filter) = filter else {
        add(
            "μ",
            μ,
            "√cn(P) γ_Φ γ_Φ⁻¹: the factor by which the error may peak",
        );
        return;
    };
    let spreading = P.largest.sqrt() * filter.peak;
    let rest = (P.largest / (2.0 * P.α) + 1.0).sqrt();
    add("α2", filter.α, "the rate of the filter");
    add("c1", μ, "of (4.30): the factor of the initial errors");
    add(
        "c2",
        up(inverse * spreading),
        "of (4.30): the factor of √ε and the filter's initial error",
    );
    add(
        "c3",
        up(inverse * filter.rest * rest),
        "of (4.30), corrected: what the filter leaves",
    );
    add(
        "c4",
        up(inverse * filter.peak),
        "missing in (4.30): the filter's initial error as x sees it",
    );
}
