//! Phrases that the theorems of several families share.

use lynkeus_expr::Interval;
use lynkeus_proof::chain::Ultimate;
use lynkeus_structure::Standing;
use lynkeus_structure::{Extended, Region, range};

use crate::{Assumptions, Bounds, Certificate, Constant, DesignError};

/// A number for a sentence.
pub(crate) use lynkeus_structure::short as shown;

/// Bounds of the error of the states that the outputs show: that of the output
/// divided by the least slope.
pub(crate) fn state_noise(
    extended: &Extended<'_>,
    region: &Region,
    noise: &[f64],
) -> Result<Vec<f64>, DesignError> {
    let mut found = vec![];
    for (i, output) in extended.outputs.iter().enumerate() {
        let bound = noise.get(i).copied().unwrap_or(f64::INFINITY);
        let Some((_, slope, _)) = output.state else {
            found.push(f64::INFINITY);
            continue;
        };
        let least = range(extended.graph(), slope, region)?
            .enclosure
            .mignitude();
        found.push(match bound == 0.0 {
            true => 0.0,
            false => (Interval::point(bound) / Interval::point(least)).hi(),
        });
    }
    Ok(found)
}

/// Fills in what the rate σ guarantees, where every hypothesis holds; `of` has the bounds that it leaves
/// for the densities of process noise, by extended state.
pub(crate) fn conclude(
    certificate: &mut Certificate,
    extended: &Extended<'_>,
    σ: f64,
    assumptions: &Assumptions,
    of: impl Fn(&[f64]) -> Result<Option<Ultimate>, DesignError>,
) -> Result<(), DesignError> {
    if certificate.verdict() != Standing::Proved {
        return Ok(());
    }
    let ultimate = of(&vec![0.0; extended.states.len()])?;
    if assumptions.is_moved() {
        certificate.mean_square = of(&assumptions.process_noise)?.and_then(|u| bounds(extended, u));
    }
    let mut constant = |name: &str, value: f64, meaning: &str| {
        certificate
            .constants
            .push(Constant::new(name, value, meaning));
    };
    constant(
        "σ",
        σ,
        "decay rate of the error at the study's θ, 1/time unit",
    );
    if let Some(found) = &ultimate {
        constant(
            "λ1",
            found.overshoot,
            "overshoot: |e(t)| ≤ λ1 e^(−σt) |e(0)| + ultimate bound",
        );
        let gain = (Interval::point(found.overshoot) / Interval::point(σ)).hi();
        constant(
            "λ2",
            gain,
            "λ1/σ: error as t → ∞ per unit of drift, in Euclidean norms",
        );
    }
    certificate.rate = Some(σ);
    certificate.overshoot = ultimate.as_ref().map(|found| found.overshoot);
    match ultimate.and_then(|found| bounds(extended, found)) {
        Some(bounds) => {
            certificate.ultimate_bound = Some(bounds.norm);
            certificate.ultimate = bounds.states;
        }
        None => certificate.notes.push(
            "no ultimate bound: the assumed drift or noise has no bound, or S⁻¹ could not be enclosed".into(),
        ),
    }
    Ok(())
}

/// In the order of the states, whatever that of the chains is; none that are infinite.
fn bounds(extended: &Extended<'_>, found: Ultimate) -> Option<Bounds> {
    let mut states = found.states;
    states.sort_unstable_by_key(|(i, _)| *i);
    let name = |(i, bound): (usize, f64)| (extended.states[i].name.clone(), bound).into();
    let states = states.into_iter().map(name).collect();
    let norm = found.norm;
    norm.is_finite().then_some(Bounds { norm, states })
}

/// What the box means for the guarantee.
pub(crate) fn box_note(clamp: bool) -> String {
    match clamp {
        true => "The guarantee holds while plant and estimate stay in the box. Limiting what the functions see ('clamp') is no prolongation as the paper's: where an estimate is outside of its range, the functions do not react to it any more and the proof does not cover that time.".into(),
        false => "The guarantee holds while plant and estimate stay in the box, or the functions are prolonged outside of it with the same bounds of their partial derivatives.".into(),
    }
}
