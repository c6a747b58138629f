//! Several unknown inputs, more outputs in x₁¹ than unknown inputs, blocks that are not
//! square: against NumPy and against simulations.

use crate::common::{assert_close, constant, design_with, hypothesis, plant, slope};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Assumptions, Certificate, DesignError, Tuning, unknown_input::UNKNOWN_INPUT,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing, Verdict};
use lynkeus_words::Words;

use super::{tuning, with_partition};

/// (14) written for any plant with NumPy (`pinv`, the Jacobian by hand), at
/// x̂ = (.3, −.2, .5, .1, .7, −.4), v̂ = (.6, −.8), y = (.1, .2, .4, −.1), θ = (6, 3).
#[test]
fn two_unknown_inputs_with_four_outputs() {
    let plant = plant(
        "model Two input Real v1(min = -1, max = 1); input Real v2(min = -1, max = 1);
         Real a1(min = -1, max = 1); Real a2(min = -1, max = 1); Real b1(min = -1, max = 1);
         Real b2(min = -1, max = 1); Real c1(min = -1, max = 1); Real c2(min = -1, max = 1);
         output Real y1 = a1; output Real y2 = a2; output Real y3 = b1; output Real y4 = b2;
         equation
         der(a1) = -a1 + 0.5*c1 + (2 + sin(b1))*v1 + v2; der(a2) = b2 + 0.2*c2 - v1 + 3*v2;
         der(b1) = c1 + 0.5*c2 + v1; der(b2) = 2*c2 - 0.1*c1^3 + v2;
         der(c1) = -c1 + v2; der(c2) = 0.3*c1*c2 - v1; end Two;",
    );
    let given = with_partition(tuning(6.0, 3.0), &["y1", "y2"]);
    let design = design_with(UNKNOWN_INPUT, &plant, &["v1", "v2"], &given).unwrap();
    let chosen = &design.examination;
    assert_eq!(chosen.fit(), Standing::Proved, "{:#?}", chosen.checks);
    let state = [0.3, -0.2, 0.5, 0.1, 0.7, -0.4, 0.6, -0.8];
    let found = slope(&plant, &design, &state, &[], &[0.1, 0.2, 0.4, -0.1]);
    let expected = [
        -1.7163489946148098,
        1.8200000000000003,
        -0.9691020249053233,
        -1.7240006749684407,
        -0.8578364349643959,
        -0.20221239934193191,
        -4.4073060747159705,
        3.3308979750946786,
    ];
    assert_close(&found, &expected);
    // G reads b1: no constant K
    assert!(design.gains.is_empty());
}

/// m₁ = 2 > m = 1: v is read from two outputs by least squares. NumPy as above, at
/// x̂ = (.3, −.2, .5, .1, .7), v̂ = .6, the states measured as (.1, .2, .4), θ = (5, 2).
#[test]
fn more_outputs_in_x11_than_unknown_inputs() {
    let plant = plant(
        "model More input Real v(min = -1, max = 1); Real a(min = -1, max = 1);
         Real b(min = -1, max = 1); Real c(min = -1, max = 1); Real d(min = -1, max = 1);
         Real e(min = -1, max = 1);
         output Real ya = a; output Real yb = 2*b + 1; output Real yc = c;
         equation
         der(a) = -a + 0.3*d + (1 + c^2)*v; der(b) = sin(a) - b + 2*v;
         der(c) = d + 0.1*d^3 + 0.5*v; der(d) = e - d*c + c*v; der(e) = -e + a - v; end More;",
    );
    let given = with_partition(tuning(5.0, 2.0), &["ya", "yb"]);
    let design = design_with(UNKNOWN_INPUT, &plant, &["v"], &given).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    let state = [0.3, -0.2, 0.5, 0.1, 0.7, 0.6];
    let found = slope(&plant, &design, &state, &[], &[0.1, 1.4, 0.4]);
    let expected = [
        -1.5739999999999998,
        5.69552020666134,
        0.33137806046094,
        0.08240990210382904,
        -2.884297818431828,
        2.6563903023046995,
    ];
    assert_close(&found, &expected);
}

/// x₂¹ = (b, c) for layers (d) and (e): Λ₂ has columns.
pub(super) const TALL: &str =
    "model Tall input Real v(min = -1, max = 1); input Real n(min = -1, max = 1);
  Real a(min = -1, max = 1); Real b(min = -1, max = 1); Real c(min = -1, max = 1);
  Real d(min = -1, max = 1); Real e(min = -1, max = 1);
  output Real ya = a + n; output Real yb = b - n; output Real yc = c + n;
  equation
  der(a) = -a + 0.1*d + v; der(b) = d + 0.2*sin(b) + 0.4*v; der(c) = -0.5*d - c;
  der(d) = e - 0.1*sin(d) + 0.2*v; der(e) = -0.3*e; end Tall;";

pub(super) fn sensors() -> Sensors {
    Sensors {
        unknown: vec!["v".into()],
        disturbances: vec!["n".into()],
        ..Sensors::default()
    }
}

fn certificate(plant: &Plant, tuning: &Tuning, slew: f64, noise: f64) -> Certificate {
    let augmented = AugmentedPlant::new(plant, &sensors()).unwrap();
    let mut drift = vec![0.0; augmented.states.len()];
    drift[augmented.plant_states()] = slew;
    let assumptions = Assumptions::new(&augmented, augmented.region())
        .unwrap()
        .with_drift(drift)
        .with_noise(vec![noise; augmented.outputs.len()]);
    UNKNOWN_INPUT
        .theorem(&augmented, tuning, &assumptions)
        .unwrap()
}

/// (14) for the plant above by NumPy, at x̂ = (.3, −.2, .5, .1, .7), v̂ = .6,
/// y = (.1, .2, .4), θ = (5, 2); and K: x̂' = f(x̂) − K(ŷ − y).
#[test]
fn a_left_inverse_in_the_gain() {
    let plant = plant(TALL);
    let augmented = AugmentedPlant::new(&plant, &sensors()).unwrap();
    let given = with_partition(tuning(5.0, 2.0), &["ya"]);
    let design = UNKNOWN_INPUT.design(&augmented, &given).unwrap();
    let (state, y) = ([0.3, -0.2, 0.5, 0.1, 0.7, 0.6], [0.1, 0.2, 0.4]);
    let found = slope(&plant, &design, &state, &[], &y);
    let expected = [
        -1.6899999999999997,
        1.9002661338409883,
        -1.15,
        4.855219799339072,
        2.75346876066917,
        -5.0,
    ];
    assert_close(&found, &expected);
    let [a, b, c, d, e, v] = state;
    let f = [
        -a + 0.1 * d + v,
        d + 0.2 * b.sin() + 0.4 * v,
        -0.5 * d - c,
        e - 0.1 * d.sin() + 0.2 * v,
        -0.3 * e,
        0.0,
    ];
    let names = ["a", "b", "c", "d", "e", "v"];
    let mut printed = f;
    for gain in &design.gains {
        let j = ["ya", "yb", "yc"].iter().position(|y| *y == gain.output);
        let j = j.unwrap();
        for (name, k) in &gain.entries {
            let i = names.iter().position(|n| n == name).unwrap();
            printed[i] -= k * (state[j] - y[j]);
        }
    }
    assert_close(&printed, &expected);
}

/// c₁ … c₅ by hand for this plant: γ₁ = (0.4, 0), γ₂ = 0.2, γ₃ = 0, Λ₂'s columns (0.96, −0.5),
/// diagonals (1, 2, 6) of S₂ and (3, 5, 1) of S₂⁻¹. What x₂¹ has too much costs 3 for √3 in c₅.
#[test]
fn the_constants_of_a_left_inverse() {
    let found = certificate(&plant(TALL), &tuning(300.0, 15.0), 0.0, 0.0);
    assert_eq!(found.verdict(), Standing::Proved, "{:#?}", found.hypotheses);
    let P = (0.96f64 * 0.96 + 0.25).sqrt();
    let W = P / (0.96 * 0.96 + 0.25);
    let Y1 = (0.4f64 + 0.08 + 0.96 * 0.2).hypot(0.1);
    let Y2 = 0.2 - (0.1 * 1f64.cos() + 0.02) * 0.2;
    let expected = [
        ("c1", 8f64.sqrt() * 0.98),
        ("c2", 2.0 * 0.1 * W * 5f64.sqrt()),
        (
            "c4",
            2.0 * (3f64.sqrt() + 10f64.sqrt() * 0.12 * P * W + 6f64.sqrt() * 0.3 * P * W),
        ),
        ("c5", 8f64.sqrt() * (Y1 + 2f64.sqrt() * P * Y2 + 3.0 * 0.4)),
    ];
    for (name, expected) in expected {
        let value = constant(&found, name);
        let excess = value / expected - 1.0;
        assert!((0.0..1e-3).contains(&excess), "{name}: {value}, {expected}");
    }
}

/// Λ₂ that changes with X² turns the range of its left inverse; the key that helps is said.
#[test]
fn where_a_left_inverse_is_not_covered_it_is_undecided() {
    let bent = TALL
        .replace("der(b) = d +", "der(b) = d + 0.1*d^3 +")
        .replace("der(c) = -0.5*d - c", "der(c) = -0.5*d - c + 2*v");
    let found = certificate(&plant(&bent), &tuning(300.0, 15.0), 0.0, 0.0);
    assert_eq!((found.verdict(), found.rate), (Standing::Undecided, None));
    let open = hypothesis(&found, "Λ₂Λ₂⁺");
    assert!(
        open.reason.words().contains("Λ₂ changes with X²"),
        "{}",
        open.reason.words()
    );
    assert!(
        open.reason
            .words()
            .contains("square with partition = [\"ya\", \"yb\"]"),
        "{}",
        open.reason.words()
    );
    let given = with_partition(tuning(300.0, 15.0), &["ya", "yb"]);
    let found = certificate(&plant(&bent), &given, 0.0, 0.0);
    assert_eq!(hypothesis(&found, "Λ₂Λ₂⁺").verdict, Verdict::Proved);
}

/// A chain that ends early has the first gains of a longer one.
fn narrowing(layers: usize, end: usize) -> String {
    let mut text = "model Narrow input Real v; Real a; output Real ya = a;
        output Real yb = b1; output Real yc = c1;\n"
        .to_owned();
    let mut equations = "der(a) = v;".to_owned();
    for (name, length) in [("b", layers), ("c", end)] {
        for k in 1..=length {
            text += &format!("Real {name}{k}; ");
            let next = match k == length {
                true => "0".to_owned(),
                false => format!("{name}{}", k + 1),
            };
            equations += &format!("der({name}{k}) = {next}; ");
        }
    }
    format!("{text} equation {equations} end Narrow;")
}

/// s⁷ + 12 s⁶ + 66 s⁵ + … + 792 has zeros at 0.057 ± …i (NumPy): with twelve layers the
/// error of a chain that ends in the seventh grows like e^{0.057 θ₂ t}.
#[test]
fn shortened_chains_that_the_papers_gains_make_unstable_are_refused() {
    let Err(DesignError::Refused(examination)) = design_with(
        UNKNOWN_INPUT,
        &plant(&narrowing(12, 7)),
        &["v"],
        &tuning(10.0, 2.0),
    ) else {
        panic!()
    };
    let refuted = examination.refuted().unwrap();
    assert!(
        refuted.statement.words().contains("ends in layer 7"),
        "{}",
        refuted.statement.words()
    );
    let fine = design_with(
        UNKNOWN_INPUT,
        &plant(&narrowing(4, 2)),
        &["v"],
        &tuning(10.0, 2.0),
    );
    let fine = fine.unwrap();
    assert_eq!(fine.examination.fit(), Standing::Proved);
    // f − K(ŷ − y): C(4, 1)θ₂ and C(4, 2)θ₂² on the short chain
    let short = fine.gains.iter().find(|g| g.output == "yc").unwrap();
    let entries = [("c1".to_owned(), 8.0), ("c2".to_owned(), 24.0)];
    assert_eq!(short.entries, entries);
    let plant = plant(&narrowing(4, 2));
    let sensors = Sensors {
        unknown: vec!["v".into()],
        ..Sensors::default()
    };
    let augmented = AugmentedPlant::new(&plant, &sensors).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region())
        .unwrap()
        .with_drift(vec![0.0; augmented.states.len()])
        .with_noise(vec![0.0; 3]);
    let found = UNKNOWN_INPUT
        .theorem(&augmented, &tuning(1e4, 20.0), &assumptions)
        .unwrap();
    assert_eq!(found.verdict(), Standing::Undecided);
    let open = hypothesis(&found, "Λ₂Λ₂⁺");
    assert!(
        open.reason.words().contains("chains that end early"),
        "{}",
        open.reason.words()
    );
}

/// A disturbance or an error without bound has no ultimate bound, but a rate.
#[test]
fn what_has_no_bound_gives_none() {
    let plant = plant(TALL);
    for (slew, noise) in [(f64::INFINITY, 0.0), (0.0, f64::INFINITY)] {
        let found = certificate(&plant, &tuning(300.0, 15.0), slew, noise);
        assert_eq!(found.ultimate_bound, None, "{slew} {noise}");
        assert!(found.ultimate.is_empty());
    }
    let open = certificate(&plant, &tuning(300.0, 15.0), f64::INFINITY, 0.0);
    assert_eq!(open.verdict(), Standing::Undecided);
}

/// The matrices that the paper names, for a gain that is no constant: at x̂ = (0.5, 0.5, 0.5)
/// G₁¹ = 2.5, D = 0.2/2.5, and Λ₂ = 1 + 0.3·0.25.
#[test]
fn the_matrices_of_the_paper_are_shown() {
    let plant = plant(
        "model Shown input Real v(min = -1, max = 1); Real a; Real b(min = -1, max = 1);
         Real c(min = -1, max = 1); output Real ya = a; output Real yb = b;
         equation der(a) = (2 + b)*v; der(b) = c + 0.1*c^3; der(c) = 0.2*v; end Shown;",
    );
    let mut tuning = tuning(10.0, 5.0);
    tuning.initial.default = Some(0.5);
    let design = design_with(UNKNOWN_INPUT, &plant, &["v"], &tuning).unwrap();
    assert!(design.gains.is_empty());
    let value = |name: &str| {
        let found = design.parameters.iter().find(|(n, _)| n == name);
        found
            .unwrap_or_else(|| panic!("{name}: {:?}", design.parameters))
            .1
            .words()
    };
    assert_eq!(value("G₁¹"), "[[b + 2]]");
    assert_eq!(value("(G₁¹)⁺ at the start"), "[[0.4]]");
    assert_eq!(value("D at the start, 2"), "[[0.08]]");
    assert_eq!(value("S₂⁻¹C₂ᵀ"), "[[2, 1]]");
    assert_eq!(value("Λ₂⁺ at the start, 2"), "[[0.930233]]");
    assert!(value("Λ₂ 2").contains("c^2"), "{}", value("Λ₂ 2"));
}

/// (H3): G₁¹ = 2 + u turns with u, whose derivative the assumptions bound or do not.
#[test]
fn a_moving_input_needs_a_bound_of_its_derivative() {
    let plant = plant(
        "model Moving input Real v(min = -1, max = 1); input Real u(min = -0.5, max = 0.5);
         Real a(min = -1, max = 1); Real b(min = -1, max = 1); Real c(min = -1, max = 1);
         output Real ya = a; output Real yb = b;
         equation der(a) = (2 + u)*v; der(b) = c; der(c) = -b; end Moving;",
    );
    let sensors = Sensors {
        unknown: vec!["v".into()],
        ..Sensors::default()
    };
    let augmented = AugmentedPlant::new(&plant, &sensors).unwrap();
    let finite = |bounds: Vec<Vec<f64>>| {
        let assumptions = Assumptions::new(&augmented, augmented.region())
            .unwrap()
            .with_input_derivatives(bounds);
        let found = UNKNOWN_INPUT
            .theorem(&augmented, &tuning(50.0, 10.0), &assumptions)
            .unwrap();
        hypothesis(&found, "c1, c2, c4 and c5").is_proved()
    };
    assert!(!finite(vec![]));
    assert!(finite(vec![vec![0.3]]));
}
