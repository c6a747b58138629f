//! Rate, peak and ultimate bound once the hypotheses hold.
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

use crate::Germani;
use crate::statement::undecided;
use lynkeus_expr::Interval;
use lynkeus_proof::magnitude::{length, plus, size, times, total};
use lynkeus_proof::riccati::Riccati;

use super::gains::{closed_loop, slowest, spread};
use super::lipschitz::Share;
use super::proof::{Proof, Solutions};
use super::variant::Variant;
use crate::{Assumptions, Certificate, Constant, UltimateBound};

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
    solutions: &Solutions,
    assumptions: &Assumptions,
    found: &mut Certificate,
) {
    let P = &solutions.fastest;
    let filtered = proof.form.variant == Variant::Practical && proof.w.iter().any(|&w| w > 0.0)
        || proof.gains.K2.iter().any(|K| !K.is_empty());
    let filter = match filtered {
        true => match filter(proof) {
            Some(filter) => Some(filter),
            None => {
                let detail = "no P_a was found for the filter's poles";
                found.hypotheses.push(undecided(Germani::Filter, detail));
                return;
            }
        },
        false => None,
    };
    let peak = P.peak();
    let α = filter.as_ref().map_or(P.α, |f| P.α.min(f.α));
    found.rate = Some(α);
    let φ = of_rows(P, &proof.lipschitz.unseen);
    let parts = filter.as_ref().zip(Some(φ));
    let μ = times(times(peak, proof.lipschitz.map), proof.lipschitz.inverse);
    // with a filter the error peaks by what the filter's leaves as well
    found.overshoot = filter.is_none().then_some(μ);
    print(proof, P, μ, parts, &mut found.constants);
    let a = filter.map_or(0.0, |f| f.rest);
    let left = std::iter::once(P)
        .chain(&solutions.slower)
        .map(|P| Left::of(proof, P, a, assumptions));
    if let Some(left) = left.min_by(|x, y| x.whole.total_cmp(&y.whole)) {
        let names = proof.extended.states.iter().map(|x| x.name.clone());
        found.ultimate_bound = Some(left.whole);
        found.ultimate = names.zip(left.each).map(UltimateBound::from).collect();
    }
}

/// Bounds as t → ∞.
struct Left {
    /// of every state's error
    each: Vec<f64>,
    /// of the length of the error
    whole: f64,
}

impl Left {
    /// By P, where |e_a| → a: √ν settles where 2αν = a² + 2f√ν, and |e_z,j| ≤ √(P_jj ν).
    fn of(proof: &Proof<'_, '_>, P: &Riccati, a: f64, assumptions: &Assumptions) -> Self {
        let f = size(of_rows(P, &proof.lipschitz.unseen)) + size(forces(proof, P, assumptions));
        let twice = Interval::point(2.0) * Interval::point(P.α);
        let root_ν = (f + (f.powi(2) + twice * size(a).powi(2)).sqrt()) / twice;
        let e_z = Interval::point(P.largest).sqrt() * root_ν;
        let part = |j: usize| (Interval::point(P.P[j][j]).sqrt() * root_ν).min(e_z).hi();
        let parts: Vec<f64> = (0..P.P.len()).map(part).collect();
        let e_z = e_z.hi();
        let of_state = |share: &Share| {
            let one_by_one = total(share.z.iter().zip(&parts).map(|(z, e)| times(*z, *e)));
            let together = times(length(&share.z), e_z);
            plus(one_by_one.min(together), times(share.through, a))
        };
        let each: Vec<f64> = proof.lipschitz.states.iter().map(of_state).collect();
        let whole = times(proof.lipschitz.inverse, length(&[e_z, a])).min(length(&each));
        Self { each, whole }
    }
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
        let twice = Interval::point(2.0) * Interval::point(P.α);
        let rest = (Interval::point(P.largest) / twice).sqrt().hi();
        Some(Filter {
            α: P.α,
            peak: P.peak(),
            rest: if driven { rest } else { 0.0 },
        })
    };
    let found = SHARES.into_iter().filter_map(one);
    found.min_by(|a, b| a.rest.total_cmp(&b.rest))
}

/// √(fᵀP⁻¹f) for every f with |f_k| ≤ `size[k]`.
fn of_rows(P: &Riccati, size: &[f64]) -> f64 {
    let unit = |k: usize| {
        let entry = |i: usize| f64::from(u8::from(i == k));
        (0..size.len()).map(entry).collect::<Vec<_>>()
    };
    let each = size.iter().enumerate().filter(|(_, size)| **size > 0.0);
    let one_by_one = total(each.map(|(k, size)| times(P.weight(&unit(k)), *size)));
    one_by_one.min(P.weight_of_length(length(size)))
}

/// √(fᵀP⁻¹f) for the disturbances, as the map sees them, and the noise.
fn forces(proof: &Proof<'_, '_>, P: &Riccati, assumptions: &Assumptions) -> f64 {
    let n = proof.A.len();
    let pushed = |row: &Vec<f64>| {
        let terms = row.iter().zip(&assumptions.drift);
        total(terms.map(|(q, d)| times(*q, *d)))
    };
    let q: Vec<f64> = proof.lipschitz.Q.iter().map(pushed).collect();
    let mut sum = of_rows(P, &q);
    let mut start = 0;
    for (i, K) in proof.gains.K.iter().enumerate() {
        let noise = assumptions.noise.get(i).copied().unwrap_or(0.0);
        let mut column = vec![0.0; n];
        column[start..start + K.len()].copy_from_slice(K);
        if noise > 0.0 && !K.is_empty() {
            sum = plus(sum, times(P.weight(&column), noise));
        }
        start += K.len();
    }
    sum
}

fn print(
    proof: &Proof<'_, '_>,
    P: &Riccati,
    μ: f64,
    filter: Option<(&Filter, f64)>,
    constants: &mut Vec<Constant>,
) {
    let inverse = proof.lipschitz.inverse;
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
    let Some((filter, φ)) = filter else {
        add(
            "μ",
            μ,
            "√cn(P) γ_Φ γ_Φ⁻¹: the factor by which the error may peak",
        );
        return;
    };
    let (root, α) = (Interval::point(P.largest).sqrt(), Interval::point(P.α));
    let spreading = (root * size(filter.peak)).hi();
    let left = size(filter.rest) / (Interval::point(2.0) * α).sqrt();
    let e_z = (root * (left + size(φ) / α)).hi();
    let n̄ = length(&proof.lipschitz.unseen);
    add("α2", filter.α, "the rate of the filter");
    add("c1", μ, "of (4.30): the factor of the initial errors");
    add(
        "c2",
        times(inverse, spreading),
        "of (4.30): the factor of √ε and the filter's initial error",
    );
    add(
        "c3",
        times(inverse, length(&[e_z, filter.rest])),
        "of (4.30), corrected: what the filter and n̄w leave",
    );
    add(
        "|n̄w|",
        n̄,
        "missing in (4.25): the part of the last derivatives that (4.22) lacks",
    );
    add(
        "c4",
        times(inverse, filter.peak),
        "missing in (4.30): the filter's initial error as x sees it",
    );
}
