//! What the theorems 3.1, 4.1 and 4.5 guarantee.
//!
//! e_z' = (A − KC) e_z + Σ_k e_k (r_k − r̂_k) + f, |r_k − r̂_k| ≤ g_k |(e_z, e_a)| in m rows k,
//! f from disturbances, noise, and for (4.22) from n̄(z, x_a)w, which the observer lacks. With E = (√m g_k e_k) the perturbation is E v with
//! |v|² ≤ |e_z|² + |e_a|², and any P of (3.2), (4.7), (4.33) with γ = 1 gives for ν = e_zᵀP⁻¹e_z
//!
//! ν' ≤ −2αν + |e_a|² + 2√ν √(fᵀP⁻¹f)
//!
//! e_a is the error of the filter, zero for (3.1) and (4.1). P is sought for the study's K,
//! not K for a P: the theorems only ask that there is one.

use crate::statement::{sufficient, undecided};
use crate::{Check, Germani};
use lynkeus_gain::vandermonde;
use lynkeus_proof::magnitude::length;
use lynkeus_structure::Extended;
use lynkeus_structure::Verdict;

use super::conditions::Inputs;
use super::form::Form;
use super::gains::{Gains, closed_loop, slowest};
use super::guarantee;
use super::keys::Needed;
use super::lipschitz::{self, Lipschitz};
use super::proof::{Proof, SLOW};
use super::settings::{SLOPES, Settings};
use super::variant::Variant;
use crate::enclosure::figures;
use crate::{Assumptions, Certificate, Constant, DesignError, TuningError};

pub(super) fn certificate(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Form,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let slopes = slopes(extended, settings, form, assumptions)?;
    let lipschitz = lipschitz::bounds(extended, form, &slopes, &assumptions.region)?;
    let u_M = largest_input(extended, assumptions);
    let gains = gains(extended, settings, form)?;
    // not that on inputs, which is about slopes without bounds
    let conditions = form.checks.clone();
    let mut hypotheses = vec![
        conditions.degree,
        conditions.regular,
        conditions.one_to_one,
        conditions.lipschitz,
        conditions.continuous,
        lipschitz.continuous.clone(),
    ];
    hypotheses.extend(of_the_map(extended, form, &slopes, &lipschitz));
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
    let mut constants = of_lipschitz(form, &lipschitz, u_M);
    constants.extend(largest_inputs(extended, form, assumptions)?);
    let mut found = None;
    match &gains {
        Some(gains) => {
            let proof = Proof {
                extended,
                form,
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
            Germani::Gains,
            "the study gives neither poles nor alpha and gamma",
        )),
    }
    let mut certificate = Certificate::new(basis(form.variant), assumptions, hypotheses);
    certificate.constants = constants;
    certificate.notes = notes(extended, form, assumptions);
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

fn notes(extended: &Extended<'_>, form: &Form, assumptions: &Assumptions) -> Vec<String> {
    let mut notes = vec![match form.variant {
        Variant::Practical => "taken for granted, not proved: plant and estimate stay in the box, and so do the filter's estimates of the inputs and of their derivatives; the bound holds once the filter has settled, at the same rate".to_owned(),
        _ => "taken for granted, not proved: plant and estimate stay in the box".to_owned(),
    }];
    let constant = assumptions.constant(extended.plant_states());
    if !constant.is_empty() {
        notes.push(format!(
            "taken as constant: {}; bounds of rates of change go under `slew` in [certify]",
            constant.join(", ")
        ));
    }
    notes.push("where the column rcond is below 6·10⁻⁴ the tool withdraws a part of the correction, and the theorem says nothing".to_owned());
    notes
}

/// Per input bounds of u', u'', …, one more than the observer reads: the family's key, else
/// what holds for every family.
fn slopes(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Form,
    assumptions: &Assumptions,
) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
    let orders: Vec<usize> = match form.variant {
        Variant::Bounded => vec![0; form.U.len()],
        _ => form.U.iter().map(Vec::len).collect(),
    };
    let own = settings.slopes(&Needed::new(extended, orders.clone()))?;
    let general = |j: usize| {
        let bounds = assumptions.input_derivatives.get(j)?;
        bounds.get(..orders[j]).map(<[f64]>::to_vec)
    };
    let own = own.into_iter().enumerate();
    Ok(own
        .map(|(j, bounds)| bounds.or_else(|| general(j)))
        .collect())
}

/// None where the study has no pole yet.
fn gains(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Form,
) -> Result<Option<Gains>, TuningError> {
    match settings.has_poles() {
        true => Gains::new(extended, settings, form).map(Some),
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

/// Ū of Theorem 2.4, where the map reads inputs.
fn largest_inputs(
    extended: &Extended<'_>,
    form: &Form,
    assumptions: &Assumptions,
) -> Result<Option<Constant>, DesignError> {
    if !form.reads_inputs() {
        return Ok(None);
    }
    let inputs = Inputs {
        extended,
        U: &form.U,
        slopes: &[],
        Q̄: &form.Q,
        region: &assumptions.region,
    };
    let meaning = "of Theorem 2.4: det Q̄ ≠ 0 is proved on the box for inputs and derivatives of inputs up to it";
    let found = inputs.largest()?.filter(|radius| radius.is_finite());
    Ok(found.map(|radius| Constant::new("Ū", radius, meaning)))
}

/// Hypotheses 1 and 2 of the theorems.
fn of_the_map(
    extended: &Extended<'_>,
    form: &Form,
    slopes: &[Option<Vec<f64>>],
    found: &Lipschitz,
) -> Vec<Check> {
    let mut checks = vec![];
    if form.reads_inputs() {
        let pairs = form.U.iter().zip(slopes).zip(&extended.inputs);
        let lacking = pairs.filter(|((jet, given), _)| !jet.is_empty() && given.is_none());
        let names: Vec<&str> = lacking.map(|(_, input)| input.name.as_str()).collect();
        let detail = match names.is_empty() {
            true => "assumed, as the study gives them".to_owned(),
            false => format!(
                "no bound of the derivatives of {}: give the key '{}', in [observer] or in [certify]",
                names.join(", "),
                SLOPES.name
            ),
        };
        checks.push(sufficient(
            Germani::InputDerivatives,
            names.is_empty(),
            detail,
        ));
        let mut regular = found.regular.clone();
        if let Verdict::Refuted(_) = regular.verdict {
            // the observer passes such a place, only the proof does not
            regular.detail = format!("{} ({})", regular.detail, regular.verdict);
            regular.verdict = Verdict::open();
        }
        checks.push(regular);
    }
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
    checks.push(sufficient(
        Germani::Inverse,
        found.inverse.is_finite() && found.map.is_finite(),
        detail,
    ));
    let γ = length(&found.drift) + length(&found.input);
    let detail = match γ.is_finite() {
        true => format!("γ = {}", figures(length(&found.drift))),
        false => open_or(found, "the inverse has no bound"),
    };
    checks.push(sufficient(Germani::LastRows, γ.is_finite(), detail));
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
