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
//! ([`lynkeus_proof::decay`]); interval arithmetic accepts or rejects it. Where the slopes are too many apart, they are
//! taken as they come together at every point of the box ([`lynkeus_proof::decay::holds_together`]).
//!
//! What is left of the error as t → ∞ when something acts on the plant that the
//! observer does not know, and when the measurements err.
//!
//! With e' = A e + w − Eν, |w_i| ≤ drift_i and |ν_j| ≤ noise_j, V = eᵀPe obeys
//! (√V)' ≤ −rate·√V + √(wᵀPw), so in the end √V ≤ r = max √(wᵀPw)/rate, |e| ≤ r/√λ_min(P)
//! and |e_i| ≤ r·√(P⁻¹)_ii.
//!
//! Process noise, white with the densities Q on x', adds tr(PQ) to (E V)'. What it and Gaussian errors of readings leave
//! in mean square and in probability is in [`lynkeus_proof::noise`]; √(E e_i²) obeys what |e_i| did.

mod conditioned;
mod correction;
mod error_system;
mod lmi;
mod refute;
mod said;
mod sampled;
mod together;

pub use correction::{Correction, Injection};
pub use lmi::is_certified_gain;
pub(crate) use lmi::{LMI, LMI_KEYS, design_lmi, is_asked};
use lynkeus_expr::{Budget, Interval};
use lynkeus_proof::chain::settled;
use lynkeus_proof::decay::Proof;
use lynkeus_proof::definite::is_below;
use lynkeus_proof::magnitude::times;
use lynkeus_proof::matrix::sum;
use lynkeus_proof::noise::{Noise, largest};
use lynkeus_proof::{decay, spectrum};
use lynkeus_structure::{AugmentedPlant, Standing};
use nalgebra::DMatrix;
pub use said::{Inequality, Obstacle, Said};
pub use sampled::{AtSamples, SampledDecay, between_samples};

use crate::statement::{proved, undecided};
use crate::{
    Assumptions, Bounds, Certificate, Check, Constant, DesignError, Observer, ReadingError, Reason,
};
use error_system::ErrorSystem;
use refute::Sample;

const BASIS: &str = "linear matrix inequality, checked by interval arithmetic";

/// The share of the time that is left in which a Lyapunov function is sought.
const SEARCH: f64 = 0.8;

/// Slopes are taken together where that makes the decay this much faster.
const FASTER: f64 = 1.1;

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
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    claim: Claim,
) -> Result<Certificate, DesignError> {
    if observer.filter.is_some() {
        return Ok(Certificate::of_filter(BASIS, assumptions));
    }
    let graph = augmented.graph();
    let certified = graph.budgeted(graph.budget().part(1.0), || {
        let certificate = certified(augmented, observer, assumptions, claim)?;
        Ok(certificate.under(assumptions))
    });
    certified.unwrap_or_else(|spent| Ok(Certificate::ended(BASIS, assumptions, spent)))
}

fn certified(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    assumptions: &Assumptions,
    claim: Claim,
) -> Result<Certificate, DesignError> {
    let system = match ErrorSystem::new(augmented, observer, assumptions)? {
        Ok(system) => system,
        Err(said) => {
            let check = undecided(Inequality::StatesAreTheEstimate, said);
            return Ok(Certificate::new(BASIS, assumptions, vec![check]));
        }
    };
    let mut hypotheses = vec![system.bounded()];
    if assumptions.may_saturate() {
        return Ok(Certificate::new(BASIS, assumptions, hypotheses));
    }
    let sample = refute::worst(augmented.graph(), &system);
    // where it ends, what is proved by then still has to be told
    let search = augmented.graph().budget().part(SEARCH);
    if let Some(check) = refute::growing(augmented, observer, &system, &sample)? {
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
    let wanted = match (&found, claim) {
        (None, Claim::At(rate)) => Some(together::Wanted::At(rate)),
        (Some(_), Claim::At(_)) => None,
        (None, Claim::Fastest) => Some(together::Wanted::From(0.0)),
        (Some(apart), Claim::Fastest) => {
            let least = apart.rate.max(0.0) * FASTER;
            (least < sample.limit).then_some(together::Wanted::From(least))
        }
    };
    let together = match wanted {
        Some(wanted) if system.is_bounded() && !sample.unstable => {
            let wanted = (wanted, sample.limit);
            together::together(augmented, observer, &system, wanted, &search)?
        }
        _ => None,
    };
    let spent = search.marked();
    hypotheses.push(match (&found, &together, spent) {
        (None, None, Some(spent)) => {
            undecided(Inequality::OneLyapunovFunction, Reason::Spent(spent))
        }
        (_, Some(together), _) => {
            let (rate, parts) = (together.proof.rate, together.parts);
            proved(
                Inequality::OneLyapunovFunction,
                Said::HoldsTogether { rate, parts },
            )
        }
        _ => inequality(&system, &sample, found.as_ref()),
    });
    let found = together.map(|together| together.proof).or(found);
    let mut certificate = Certificate::new(BASIS, assumptions, hypotheses);
    match found {
        Some(proof) => {
            fill(&mut certificate, augmented, &system, &proof, assumptions);
            let is_random = assumptions.is_moved() || assumptions.is_gaussian();
            if is_random && certificate.verdict() == Standing::Proved {
                let random = random(augmented, &system, &proof, assumptions, &search);
                (certificate.mean_square, certificate.probable) = random;
            }
            let faster = |spent| Said::FasterSought(spent).into();
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

fn inequality(system: &ErrorSystem, sample: &Sample, proof: Option<&Proof>) -> Check {
    let slopes = system.slopes.slopes.len();
    let name = Inequality::OneLyapunovFunction;
    match (proof.filter(|proof| proof.rate > 0.0), sample.unstable) {
        (Some(proof), _) => {
            let rate = proof.rate;
            proved(name, Said::Holds { rate, slopes })
        }
        (None, true) => undecided(name, Said::Unstable(sample.worst.clone())),
        (None, false) => undecided(name, Said::NotFound { slopes }),
    }
}

/// What can be said without a proof on the whole box.
fn still_said(system: &ErrorSystem, sample: &Sample, search: &Budget) -> Vec<Reason> {
    let slowest = sample.slowest.filter(|slowest| *slowest > 0.0);
    let stable = slowest.map(|slowest| Said::StableEverywhere { slowest });
    let share = system
        .is_bounded()
        .then(|| lmi::provable_share(system, search));
    let share = share.flatten().map(Said::HoldsForShare);
    stable.into_iter().chain(share).map(Reason::from).collect()
}

/// Rate, bounds and constants of a proof.
fn fill(
    certificate: &mut Certificate,
    augmented: &AugmentedPlant<'_>,
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
    if let Some(spread) = spread(&proof.P) {
        certificate.overshoot = Some(spread);
        certificate.constants.push(Constant::new(
            "√cond(P)",
            spread,
            "|e(t)| is at most this times e^(−rate·t)·|e(0)|",
        ));
    }
    match bounds(augmented, system, proof, assumptions) {
        Some(bounds) => {
            certificate.ultimate_bound = Some(bounds.norm);
            certificate.ultimate = bounds.states;
        }
        None => certificate.notes.push(Said::NoUltimateBound.into()),
    }
    certificate.notes.push(Said::StaysNear.into());
}

/// A guessed bound of a quadratic form is raised by this before it is tried.
const RESERVE: f64 = 1e-6;

/// How often it is raised further.
const TRIES: usize = 40;

/// Slower rates whose P may leave a smaller mean square, as shares of the fastest.
const SLOWER: [f64; 3] = [0.85, 0.6, 0.35];

/// What random noise leaves in mean square, and in probability, by the P of the proof and those of slower rates:
/// each of the bounds holds.
fn random(
    augmented: &AugmentedPlant<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
    budget: &Budget,
) -> (Option<Bounds>, Option<Bounds>) {
    let slower = SLOWER.iter().filter_map(|share| {
        decay::prove(&system.models, &system.scale, share * proof.rate, budget)
    });
    let each: Vec<Proof> = std::iter::once(proof.clone()).chain(slower).collect();
    let best = |r: &dyn Fn(&Noise) -> Interval| {
        let each = each.iter().filter_map(|proof| {
            let noise = noise(system, proof, assumptions)?;
            finite_bounds(augmented, &proof.P, r(&noise))
        });
        each.reduce(|a, b| a.smaller(b))
    };
    (best(&Noise::in_mean_square), best(&Noise::in_probability))
}

/// How eᵀPe moves under noise; none where an assumed size is infinite.
fn noise(system: &ErrorSystem, proof: &Proof, assumptions: &Assumptions) -> Option<Noise> {
    let P = &proof.P;
    let bounded = |e: &ReadingError| Interval::point(e.disturbed) + Interval::point(e.uniform);
    let usual = |e: &ReadingError| {
        let uniform = Interval::point(e.uniform) / Interval::point(3.0).sqrt();
        Interval::point(e.disturbed) + uniform
    };
    let certain = push(system, P, assumptions, &bounded)?;
    let usual = push(system, P, assumptions, &usual)?;
    let column = |(j, error): (usize, &ReadingError)| match error.deviation > 0.0 {
        true => weighed(P, &column(system, j)).map(|c| c * Interval::point(error.deviation)),
        false => Some(Interval::ZERO),
    };
    let normal: Option<Vec<Interval>> = assumptions
        .readings
        .iter()
        .enumerate()
        .map(column)
        .collect();
    let densities = &assumptions.process_noise;
    let diagonal = |(i, q): (usize, &f64)| Interval::point(P[(i, i)]) * Interval::point(*q);
    Some(Noise {
        rate: proof.rate,
        certain,
        usual,
        normal: sum(normal?.into_iter()),
        trace: sum(densities.iter().enumerate().map(diagonal)),
        largest: largest(P, densities)?,
    })
}

/// Sizes of what the error of an output adds to e'.
fn column(system: &ErrorSystem, output: usize) -> Vec<Interval> {
    let rows = system.injection.iter();
    rows.map(|row| Interval::point(row[output])).collect()
}

/// What √(E|x̂ − x|²) ends within where nothing of a reading's error is known but its bound, or what the
/// error itself does: √(wᵀPw)/rate.
fn bounds(
    augmented: &AugmentedPlant<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
) -> Option<Bounds> {
    let bound = |e: &ReadingError| Interval::point(e.bound());
    let push = push(system, &proof.P, assumptions, &bound)?;
    finite_bounds(
        augmented,
        &proof.P,
        settled(proof.rate, push, Interval::ZERO),
    )
}

/// √(wᵀPw) at most, for drift and errors of readings of such sizes; where nothing but a bound is known of the
/// errors, of this size. None where a size is infinite.
fn push(
    system: &ErrorSystem,
    P: &DMatrix<f64>,
    assumptions: &Assumptions,
    size: &dyn Fn(&ReadingError) -> Interval,
) -> Option<Interval> {
    let sizes: Vec<Interval> = match assumptions.readings.is_empty() {
        true => assumptions
            .noise
            .iter()
            .map(|ν| Interval::point(*ν))
            .collect(),
        false => assumptions.readings.iter().map(size).collect(),
    };
    let through = |i: usize| {
        let columns = system.injection[i].iter().zip(&sizes);
        sum(columns.map(|(e, ν)| match times(*e, ν.hi()) == 0.0 {
            true => Interval::ZERO,
            false => Interval::point(*e) * *ν,
        }))
    };
    let drift = |i: usize| assumptions.drift.get(i).copied().unwrap_or(0.0);
    let w: Vec<Interval> = (0..P.nrows())
        .map(|i| Interval::point(drift(i)) + through(i))
        .collect();
    weighed(P, &w)
}

/// √(wᵀPw) at most for vectors of such sizes; none where one is infinite.
fn weighed(P: &DMatrix<f64>, w: &[Interval]) -> Option<Interval> {
    let n = w.len();
    if !w.iter().all(|w| w.hi().is_finite()) {
        return None;
    }
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    Some(sum(pairs.map(|(i, j)| Interval::point(P[(i, j)]).abs() * w[i] * w[j])).sqrt())
}

/// Bounds of e where √(eᵀPe) ≤ r; none where they are infinite.
fn finite_bounds(augmented: &AugmentedPlant<'_>, P: &DMatrix<f64>, r: Interval) -> Option<Bounds> {
    let n = augmented.states.len();
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    let state = |i: usize| {
        let mut unit = DMatrix::zeros(n, n);
        unit[(i, i)] = 1.0;
        let bound = finite((r * width(P, &unit)?).hi())?;
        Some((augmented.states[i].name.clone(), bound).into())
    };
    Some(Bounds {
        norm: finite((r * width(P, &DMatrix::identity(n, n))?).hi())?,
        states: (0..n).map(state).collect::<Option<_>>()?,
    })
}

/// √cond(P), not below it: computed eigenvalues of a matrix in units of very different
/// size may have no correct digit at the lower end.
fn spread(P: &DMatrix<f64>) -> Option<f64> {
    let n = P.nrows();
    let unit = DMatrix::identity(n, n);
    let largest = spectrum::symmetric(P.clone())?.eigenvalues.max();
    let largest = raised(largest, |α| {
        is_below(P, 1.0, &(&unit * α)).then(|| Interval::point(α).sqrt())
    })?;
    Some((largest * width(P, &unit)?).hi())
}

/// The smallest β, to six digits, that is proved to satisfy |Q^½ e| ≤ β·√(eᵀPe) for a
/// projection Q.
fn width(P: &DMatrix<f64>, Q: &DMatrix<f64>) -> Option<Interval> {
    // the largest eigenvalue of P^−½ Q P^−½ is that of QP⁻¹Q
    let inverse = P.clone().cholesky()?.inverse();
    let projected = Q * inverse * Q;
    let largest = spectrum::symmetric(projected)?.eigenvalues.max();
    raised(largest, |β| {
        let share = 1.0 / β;
        is_below(Q, share, P).then(|| (Interval::ONE / Interval::point(share)).sqrt())
    })
}

/// What is proved of the smallest number above a guess for which there is a proof.
fn raised(guess: f64, proved: impl Fn(f64) -> Option<Interval>) -> Option<Interval> {
    let mut bound = guess * (1.0 + RESERVE);
    for _ in 0..TRIES {
        if let Some(found) = proved(bound) {
            return Some(found);
        }
        bound *= 1.1;
    }
    None
}
