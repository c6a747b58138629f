//! Guarantees by linear matrix inequalities, for any observer whose states are the
//! estimate itself.
//!
//! Such an observer x̂' = F(x̂, u, y) reproduces the plant where it is right,
//! F(x, u, h(x)) = f(x, u). So the error e = x̂ − x obeys
//!
//! e' = F(x̂, u, h(x)) − F(x, u, h(x)) = A(θ) e,
//!
//! with the slopes θ of the nonlinear terms of F ([`lynkeus_structure::slopes`]). A
//! common Lyapunov function eᵀPe for every θ on the box proves the decay, whatever
//! family the observer is of. Linear matrix inequalities find P
//! ([`lynkeus_proof::decay`]); interval arithmetic accepts or rejects it.

mod blocking;
mod correction;
mod edges;
mod equilibrium;
mod error_system;
mod innovation;
mod lmi;
mod refute;
mod ultimate;

use crate::kalman::NO_THEOREM;
use crate::statement::{Statement, proved, undecided};
use crate::{Check, Inequality};
use lynkeus_expr::Budget;
use lynkeus_proof::decay::{self, ErrorModel, Proof};
use lynkeus_structure::Standing;
use lynkeus_structure::{Extended, short};

use crate::{Assumptions, Certificate, Constant, DesignError, Observer};
pub use correction::{Correction, Injection};
use error_system::ErrorSystem;
pub(crate) use lmi::Lmi;
pub(crate) use lmi::{KEYS as LMI_KEYS, design as design_lmi};
use refute::Sample;

const BASIS: &str = "linear matrix inequality, checked by interval arithmetic";
/// Vertices up to which slopes are taken by their ends instead of by multipliers.
const VERTICES: usize = 32;
/// The share of the time that is left in which a Lyapunov function is sought.
const SEARCH: f64 = 0.8;

/// What to prove.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Claim {
    /// decay at the fastest rate that can be proved
    Fastest,
    /// decay at this rate
    At(f64),
}

/// Whether decay of the observer's error is proved on the box, refuted by a state at which
/// the plant can rest (or by an error system that does not depend on the plant), or neither.
///
/// # Errors
/// Parameters without value.
pub fn certify(
    extended: &Extended<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    claim: Claim,
) -> Result<Certificate, DesignError> {
    if observer.filter.is_some() {
        let check = undecided(Statement::FilterConverges, NO_THEOREM);
        return Ok(Certificate::new(BASIS, assumptions, vec![check]));
    }
    let graph = extended.graph();
    let certified = graph.budgeted(graph.budget().part(1.0), || {
        let certificate = certified(extended, observer, assumptions, claim)?;
        Ok(certificate.under(assumptions))
    });
    certified.unwrap_or_else(|spent| Ok(Certificate::ended(BASIS, assumptions, spent)))
}

fn certified(
    extended: &Extended<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    claim: Claim,
) -> Result<Certificate, DesignError> {
    let system = match ErrorSystem::new(extended, observer, assumptions)? {
        Ok(system) => system,
        Err(reason) => return Ok(not_covered(assumptions, reason)),
    };
    let mut hypotheses = vec![system.bounded()];
    if assumptions.may_saturate() {
        return Ok(Certificate::new(BASIS, assumptions, hypotheses));
    }
    let sample = refute::worst(extended.graph(), &system);
    // where it ends, what is proved by then still has to be told
    let search = extended.graph().budget().part(SEARCH);
    if let Some(check) = refute::growing(extended, observer, &system, &sample)? {
        hypotheses.push(check);
        return Ok(Certificate::new(BASIS, assumptions, hypotheses));
    }
    let found = match (system.is_bounded() && !sample.unstable, claim) {
        (false, _) => None,
        (true, Claim::Fastest) => {
            decay::fastest(&system.models, &system.scale, sample.limit, &search)
        }
        (true, Claim::At(rate)) => decay::prove(&system.models, &system.scale, rate, &search),
    };
    let spent = search.marked();
    hypotheses.push(match (&found, spent) {
        (None, Some(spent)) => undecided(Inequality::OneLyapunovFunction, spent.to_string()),
        _ => inequality(&system, &sample, found.as_ref()),
    });
    let mut certificate = Certificate::new(BASIS, assumptions, hypotheses);
    match found {
        Some(proof) => {
            fill(&mut certificate, extended, &system, &proof, assumptions);
            if assumptions.is_moved() && certificate.verdict() == Standing::Proved {
                certificate.mean_square =
                    ultimate::mean_square(extended, &system, &proof, assumptions, &search);
            }
            let faster = |spent| format!("a faster rate was sought: {spent}");
            certificate.notes.extend(spent.map(faster));
        }
        None if claim == Claim::Fastest => {
            let said = still_said(&system, &sample, &search);
            certificate.notes.extend(said);
        }
        None => {}
    }
    Ok(certificate)
}

fn not_covered(assumptions: &Assumptions, reason: String) -> Certificate {
    let check = undecided(Inequality::StatesAreTheEstimate, reason);
    Certificate::new(BASIS, assumptions, vec![check])
}

fn inequality(system: &ErrorSystem, sample: &Sample, proof: Option<&Proof>) -> Check {
    let slopes = match system.slopes.slopes.len() {
        0 => String::new(),
        1 => " for the one slope within its range".to_owned(),
        count => format!(" for all {count} slopes within their ranges"),
    };
    let name = Inequality::OneLyapunovFunction;
    match proof.filter(|proof| proof.rate > 0.0) {
        Some(proof) => proved(
            name,
            format!(
                "He(P J) + 2·{}·P < 0{slopes}, by interval Cholesky factorisation",
                short(proof.rate)
            ),
        ),
        None => undecided(
            name,
            match sample.unstable {
                true => format!(
                    "there is none in these coordinates: the largest real part of an eigenvalue of the error's Jacobian is {}. This refutes no convergence: the plant is not seen to rest at such a point, and while it moves the Jacobian changes",
                    sample.worst
                ),
                false => format!("none was found{slopes}"),
            },
        ),
    }
}

/// What can be said without a proof on the whole box.
fn still_said(system: &ErrorSystem, sample: &Sample, search: &Budget) -> Vec<String> {
    let mut notes = vec![];
    if let Some(slowest) = sample.slowest.filter(|slowest| *slowest > 0.0) {
        notes.push(format!(
            "at every point examined the error's Jacobian is stable, the slowest mode decaying at {}",
            short(slowest)
        ));
    }
    if system.is_bounded()
        && let Some(share) = blocking::provable_share(system, search)
    {
        notes.push(format!(
            "the inequality holds once every slope's range is cut to {:.0} % about its middle: a smaller box would do",
            100.0 * share
        ));
    }
    notes
}

/// Rate, bounds and constants of a proof.
fn fill(
    certificate: &mut Certificate,
    extended: &Extended<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
) {
    if certificate.verdict() != Standing::Proved {
        return;
    }
    certificate.rate = Some(proof.rate);
    certificate.lyapunov = Some(proof.P.clone());
    certificate.constants = vec![Constant::new(
        "rate",
        proof.rate,
        "V' ≤ −2·rate·V for V = eᵀPe",
    )];
    if let Some(spread) = ultimate::spread(&proof.P) {
        certificate.overshoot = Some(spread);
        certificate.constants.push(Constant::new(
            "√cond(P)",
            spread,
            "|e(t)| is at most this times e^(−rate·t)·|e(0)|",
        ));
    }
    match ultimate::bounds(extended, system, proof, assumptions) {
        Some(bounds) => {
            certificate.ultimate_bound = Some(bounds.norm);
            certificate.ultimate = bounds.states;
        }
        None => certificate.notes.push(
            "no ultimate bound: what acts on the plant unknown to the observer, or a measurement error, has no bound".into(),
        ),
    }
    certificate.notes.push(
        "holds while plant and estimate stay in the box; an estimate that starts near the plant stays near it".into(),
    );
}

/// The models by their vertices where these are few.
fn expanded(models: &[ErrorModel]) -> Vec<ErrorModel> {
    decay::expanded(models, VERTICES)
}
