//! Settings of `[observer]` for random plants.

use super::super::case::{Case, Kind, Role};
use super::terms::round;
use crate::numbers::Numbers;

pub fn choose(numbers: &mut Numbers, case: &mut Case) {
    match case.kind {
        Kind::Triangular => triangular(numbers, case),
        Kind::BlockTriangular => block_triangular(numbers, case),
        Kind::Designed => designed(numbers, case),
        Kind::StateAffine => state_affine(numbers, case),
        Kind::DriftObservable => drift_observable(numbers, case),
        Kind::UnknownInput => unknown_input(numbers, case),
    }
}

fn family(case: &mut Case, name: &str) {
    case.key("family", format!("{name:?}"));
}

fn theta(numbers: &mut Numbers, case: &mut Case) -> f64 {
    let θ = round(numbers.size(1.0, 40.0));
    case.key("theta", format!("{θ:?}"));
    θ
}

fn triangular(numbers: &mut Numbers, case: &mut Case) {
    family(case, "triangular");
    let θ = theta(numbers, case);
    match numbers.below(10) {
        0 => case.key("partials", "true"),
        1 => case.key("r", "1.5"),
        2 => remedy(numbers, case, θ),
        _ => {}
    }
}

/// A remedy against peaking.
fn remedy(numbers: &mut Numbers, case: &mut Case, θ: f64) {
    let slow = 0.4 * θ;
    match numbers.below(4) {
        0 => case.key("innovation_limit", format!("{:?}", numbers.size(0.05, 2.0))),
        1 => case.key("transient", format!("{{ theta = {slow:?}, until = 1.0 }}")),
        2 => case.key(
            "transient",
            format!("{{ theta = {slow:?}, until = 0.5, fall = 0.3 }}"),
        ),
        _ => case.key("form", "\"low-power\""),
    }
}

fn block_triangular(numbers: &mut Numbers, case: &mut Case) {
    family(case, "block-triangular");
    let θ = theta(numbers, case);
    let correction = if numbers.chance(0.6) {
        "classical"
    } else {
        "lee"
    };
    match numbers.below(10) {
        0 => remedy(numbers, case, θ),
        _ => case.key("correction", format!("{correction:?}")),
    }
}

fn designed(numbers: &mut Numbers, case: &mut Case) {
    let name = *numbers.of(&["triangular", "block-triangular"]);
    family(case, name);
    case.key("gain", "\"lmi\"");
    case.key("rate", format!("{:?}", round(numbers.size(0.05, 2.0))));
    let aim = *numbers.of(&["noise", "gain", "peak"]);
    case.key("minimise", format!("{aim:?}"));
}

fn state_affine(numbers: &mut Numbers, case: &mut Case) {
    family(case, "state-affine");
    theta(numbers, case);
    if numbers.chance(0.3) {
        case.key("S0", format!("{:?}", round(numbers.size(0.05, 20.0))));
    }
}

fn drift_observable(numbers: &mut Numbers, case: &mut Case) {
    family(case, "drift-observable");
    let n = case.states.len();
    if case.outputs.len() == 1 {
        let slowest = -numbers.size(1.0, 20.0);
        let pole = |k: usize| format!("{:?}", round(slowest * 1.3f64.powi(k as i32)));
        let poles: Vec<String> = (0..n).map(pole).collect();
        case.key("poles", format!("[{}]", poles.join(", ")));
    } else {
        case.key("alpha", "1.0");
        case.key("gamma", "1.0");
    }
    if case.inputs.iter().all(|i| i.role != Role::Known) {
        return;
    }
    let variant = match numbers.below(4) {
        0 => "bounded",
        1 => "theoretical",
        2 => "practical",
        _ => return,
    };
    case.key("variant", format!("{variant:?}"));
}

fn unknown_input(numbers: &mut Numbers, case: &mut Case) {
    family(case, "unknown-input");
    if numbers.chance(0.2) {
        let (first, second) = (numbers.size(2.0, 300.0), numbers.size(1.0, 20.0));
        case.key(
            "theta",
            format!("[{:?}, {:?}]", round(first), round(second)),
        );
    }
}
