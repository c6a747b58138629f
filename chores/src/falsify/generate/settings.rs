//! Settings of `[observer]` for random plants.

use super::super::case::{Asked, Case, Course, Input, Kind, Noise, Role, Side, Wave};
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
        Kind::Filter => filter(numbers, case),
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

/// What a filter knows, and the run along which it is followed.
fn filter(numbers: &mut Numbers, case: &mut Case) {
    family(case, "ekf");
    let Some(asked) = case.tube.clone() else {
        return;
    };
    let starts = starts(numbers, case, &asked);
    let idle = numbers.chance(0.4);
    let mut variance = vec![];
    case.process.clear();
    for (name, [own, wide]) in starts {
        let share = numbers.size(0.3, 3.0) * (own + 0.01 * wide);
        variance.push(format!("{name} = {:?}", round(share * share)));
        let density = match idle || numbers.chance(0.3) {
            true => 0.0,
            false => round(numbers.size(1e-5, 1e-2) * wide * wide),
        };
        case.process.push((name, density));
    }
    case.key("initial_variance", format!("{{ {} }}", variance.join(", ")));
    let width = case.states[0].width();
    for noise in &mut case.noise {
        *noise = Noise {
            size: round(numbers.size(3e-5, 1e-2) * width),
            is_uniform: numbers.chance(0.5),
        };
    }
    let count = numbers.between(3.0, 16.0).floor();
    course(numbers, case, round(asked.until / count));
}

/// The run along which an observer of the papers is followed.
pub(super) fn followed(numbers: &mut Numbers, case: &mut Case) {
    let Some(asked) = &mut case.tube else {
        return;
    };
    asked.until *= numbers.size(0.05, 1.0);
    let asked = asked.clone();
    starts(numbers, case, &asked);
    let count = numbers.between(3.0, 40.0).floor();
    course(numbers, case, round(asked.until / count));
    if let Some(course) = &mut case.course {
        course.is_predicted = numbers.chance(0.5);
    }
}

/// Where the estimate starts: in the start set or beside it. By names, how wide the start set is and the box.
fn starts(numbers: &mut Numbers, case: &mut Case, asked: &Asked) -> Vec<(String, [f64; 2])> {
    let unknown = |i: &&Input| matches!(i.role, Role::Unknown(_));
    let unknown = case.inputs.iter().filter(unknown).map(|i| i.side.clone());
    let sides: Vec<Side> = case.states.iter().cloned().chain(unknown).collect();
    let (mut initial, mut widths) = (vec![], vec![]);
    for side in sides {
        let own = asked.start.iter().find(|start| start.name == side.name);
        let own = own.unwrap_or(&side);
        let off = numbers.between(-0.6, 0.6) * own.width();
        let start = round(f64::midpoint(own.low, own.high) + off);
        initial.push(format!("{} = {start:?}", side.name));
        widths.push((side.name.clone(), [own.width(), side.width()]));
    }
    case.key("initial", format!("{{ {} }}", initial.join(", ")));
    widths
}

fn course(numbers: &mut Numbers, case: &mut Case, every: f64) {
    let known = case.inputs.iter().filter(|i| i.role == Role::Known);
    let known = known.map(|input| {
        let Side { name, low, high } = &input.side;
        let middle = round(numbers.between(*low, *high));
        let most = (high - middle).min(middle - low).max(0.0);
        let amplitude = match numbers.chance(0.4) {
            true => 0.0,
            false => round(0.9 * most * numbers.unit()),
        };
        let pace = round(numbers.size(0.2, 10.0));
        (
            name.clone(),
            Wave {
                middle,
                amplitude,
                pace,
            },
        )
    });
    case.course = Some(Course {
        known: known.collect(),
        every,
        is_predicted: false,
    });
}
