//! Other gains for a case: what a theorem asks for, and much larger ones.

use lynkeus::Study;
use lynkeus::prepare::Prepared;
use lynkeus::structure::AugmentedPlant;

use super::case::{Case, Kind, Role};
use super::claims::{self, Claim, Findings};
use super::facts;
use super::judge::{Desk, Flaw, Violation, attack};
use super::pair::Pair;
use crate::numbers::Numbers;

/// Gains above these make equations that no explicit method follows.
const LARGEST: f64 = 3e3;

/// Whether the case was changed toward a proof.
pub fn raised(
    case: &mut Case,
    found: &Findings,
    augmented: &AugmentedPlant<'_>,
    numbers: &mut Numbers,
) -> bool {
    if found.counts.proved > 1 || (found.counts.proved == 1 && numbers.chance(0.7)) {
        return false;
    }
    match case.kind {
        Kind::DriftObservable => bounded(case, found, augmented, numbers) | faster(case, found),
        Kind::Triangular | Kind::BlockTriangular | Kind::StateAffine => {
            let θ0 = claims::constant(&found.certificates, "θ0");
            let now = case.setting("theta").and_then(|θ| θ.parse::<f64>().ok());
            match (θ0, now) {
                (Some(θ0), Some(θ)) if θ0 > θ && θ0 < LARGEST / 10.0 => {
                    let θ = numbers.between(1.02, 1.5) * θ0;
                    case.key("theta", format!("{θ:?}"));
                    true
                }
                _ => false,
            }
        }
        Kind::UnknownInput => {
            let of = |name| claims::constant(&found.certificates, name);
            match (of("θ1,0"), of("θ2,0")) {
                (Some(θ1), Some(θ2)) if θ1 < LARGEST && case.setting("theta").is_some() => {
                    let θ1 = (1.1 * θ1).max(1.0);
                    case.key("theta", format!("[{θ1:?}, {θ2:?}]"));
                    true
                }
                _ => false,
            }
        }
        Kind::Designed | Kind::Filter => false,
    }
}

/// Bounds of the inputs' derivatives, where the observer has use for them.
fn bounded(
    case: &mut Case,
    found: &Findings,
    augmented: &AugmentedPlant<'_>,
    numbers: &mut Numbers,
) -> bool {
    let Some(design) = &found.design else {
        return false;
    };
    let known = case.inputs.iter().filter(|i| i.role == Role::Known).count();
    if case.slope.is_some()
        || known != 1
        || design.observer.estimates.len() != augmented.states.len()
    {
        return false;
    }
    let observer = &design.observer;
    let order = match case.setting("variant") {
        Some("\"practical\"") => observer.states.len() - augmented.states.len(),
        Some("\"theoretical\"") => 1 + observer.input_derivatives.len(),
        _ => return false,
    };
    if order == 0 {
        return false;
    }
    let slope = (numbers.size(0.01, 1.0) * 1e3).round() / 1e3;
    case.slope = Some(slope);
    let bounds = vec![format!("{slope:?}"); order];
    case.key("input_derivatives", format!("[{}]", bounds.join(", ")));
    true
}

/// Poles that are fast enough, by the certificate's own factor.
fn faster(case: &mut Case, found: &Findings) -> bool {
    let factor = claims::constant(&found.certificates, "s0");
    match factor {
        Some(s) if s > 1.0 && s < 300.0 => scale(case, 1.1 * s),
        _ => false,
    }
}

/// θ or the poles times a factor; false where the case has neither.
fn scale(case: &mut Case, factor: f64) -> bool {
    for key in ["theta", "poles"] {
        let Some(text) = case.setting(key) else {
            continue;
        };
        let is_list = text.starts_with('[');
        let numbers = text.trim_matches(['[', ']']).split(", ");
        let scaled: Option<Vec<String>> = numbers
            .map(|x| Some(format!("{:?}", factor * x.parse::<f64>().ok()?)))
            .collect();
        if let Some(scaled) = scaled {
            let text = scaled.join(", ");
            case.key(key, if is_list { format!("[{text}]") } else { text });
            return true;
        }
    }
    false
}

/// Whether the plant itself is faster somewhere on its box than any gain that is tried.
fn is_stiff(pair: &mut Pair, augmented: &AugmentedPlant<'_>, numbers: &mut Numbers) -> bool {
    let plant = augmented.plant;
    let side = |v: &lynkeus::model::Variable| facts::finite(v.min, v.max);
    let sides: Vec<[f64; 2]> = plant.states.iter().map(side).collect();
    let acting: Vec<[f64; 2]> = plant.inputs.iter().map(side).collect();
    (0..60).any(|_| {
        let mut place = |sides: &[[f64; 2]]| -> Vec<f64> {
            let point = sides.iter().map(|s| numbers.between(s[0], s[1]));
            point.collect()
        };
        let (x, u) = (place(&sides), place(&acting));
        let slopes = pair.plant(0.0, &x, &u).iter().zip(&sides);
        slopes
            .into_iter()
            .any(|(x, side)| x.abs() > LARGEST * (side[1] - side[0]))
    })
}

/// Where every condition is proved, some gain has to make a small error shrink. Looks
/// for a plant on which the error grows a hundredfold for each of several gains.
pub fn diverges(
    case: &Case,
    desk: &Desk,
    numbers: &mut Numbers,
) -> Result<Option<Violation>, String> {
    let mut evidence = vec![];
    for factor in [1.0, 10.0, 100.0] {
        let mut faster = case.clone();
        if !scale(&mut faster, factor) {
            return Ok(None);
        }
        let study = desk.write(&faster).map_err(|e| e.to_string())?;
        let study = Study::load(&study).map_err(|e| e.to_string())?;
        let plant = lynkeus::prepare::plant(&study).map_err(|e| e.to_string())?;
        let prepared = Prepared::new(&study, &plant).map_err(|e| e.to_string())?;
        let augmented = prepared.augmented();
        let Ok(design) = prepared.design() else {
            return Ok(None);
        };
        let Ok(mut pair) = Pair::new(&plant, augmented, &design.observer) else {
            return Ok(None);
        };
        // states beside the estimate have a start of their own to forget
        let more = design.observer.states.len() != augmented.states.len();
        if more
            || pair.estimates() != augmented.states.len()
            || pair.held.iter().any(Option::is_none)
        {
            return Ok(None);
        }
        if is_stiff(&mut pair, augmented, numbers) {
            return Ok(None);
        }
        let n = augmented.states.len() as i32;
        // a claim that nothing meets but an error that grows far beyond any peak
        let peak = 100.0 * (10.0 * factor).powi(n - 1);
        let claim = Claim {
            basis: "every condition proved".into(),
            rate: 0.2,
            overshoot: Some(peak * (8f64).exp()),
            ultimate: None,
            each: vec![],
            probable: None,
            lyapunov: None,
            sides: vec![],
        };
        let claims = [claim];
        let mut attack = attack(&faster, augmented, &mut pair, &claims);
        let mut grew = None;
        for _ in 0..4 {
            let plan = attack.rest(numbers, 1e-6 / peak);
            let worst = attack.run(&plan, 1e-10, 3000);
            if worst.ratio > 1.0 {
                grew = Some(worst.what);
            }
        }
        match grew {
            Some(what) => evidence.push(what),
            None => return Ok(None),
        }
    }
    Ok(Some(Violation {
        flaw: Flaw::Diverges,
        evidence: evidence.join("\n"),
    }))
}
