//! The family `triangular` against hand-computed observers.

use std::collections::BTreeMap;

use crate::common::{assert_close, design_with, plant, slope};
use lynkeus_model::Plant;
use lynkeus_observers::{Design, DesignError, Initial, Tuning, Value, triangular::TRIANGULAR};
use lynkeus_structure::{Standing, Verdict};
use lynkeus_words::Words;

fn design(plant: &Plant, unknown: &[&str], tuning: &Tuning) -> Result<Design, DesignError> {
    design_with(TRIANGULAR, plant, unknown, tuning)
}

fn matrix(diag: &[f64], off: &[f64]) -> Value {
    let list = |x: &[f64]| Value::List(x.iter().map(|&x| Value::Number(x)).collect());
    let table = BTreeMap::from([
        ("diag".to_owned(), list(diag)),
        ("off".to_owned(), list(off)),
    ]);
    Value::List(vec![Value::Table(table)])
}

/// S with S⁻¹Cᵀ = (3, 3, 1).
fn with_poles(θ: f64) -> Tuning {
    let mut tuning = Tuning::from([("theta", θ)]);
    let s = matrix(&[4.0 / 3.0, 10.0 / 9.0, 1.0], &[-1.0, -1.0 / 3.0]);
    tuning.values.insert("S".into(), s);
    tuning
}

const TANKS: &str = "model Tanks
  parameter Real k1 = 0.04; parameter Real k2 = 0.07; parameter Real k3 = 0.066; parameter Real k4 = 0.03;
  input Real pump(min = 0, max = 10);
  Real upper(start = 4, min = 0.05, max = 10); Real lower(start = 5, min = 0.05, max = 10);
  output Real level = lower;
equation
  der(upper) = k4*pump - k1*sqrt(upper);
  der(lower) = k2*sqrt(upper) - k3*sqrt(lower);
end Tanks;";

/// With `partials`: 3θ, 3θ²/b, θ³/(b k4) with b = k2/(2√upper).
#[test]
fn division_by_the_partials() {
    let plant = plant(TANKS);
    let θ = 0.03;
    let mut tuning = with_poles(θ);
    tuning.values.insert("partials".into(), Value::Flag(true));
    let design = design(&plant, &["pump"], &tuning).unwrap();
    let (upper, lower, pump, y) = (4.0f64, 5.0f64, 2.0, 4.5);
    let b = 0.07 / (2.0 * upper.sqrt());
    let e = lower - y;
    let expected = [
        0.03 * pump - 0.04 * upper.sqrt() - 3.0 * θ * θ / b * e,
        0.07 * upper.sqrt() - 0.066 * lower.sqrt() - 3.0 * θ * e,
        -θ.powi(3) / (b * 0.03) * e,
    ];
    assert_close(
        &slope(&plant, &design, &[upper, lower, pump], &[], &[y]),
        &expected,
    );
    let starts: Vec<f64> = design
        .observer
        .states
        .iter()
        .map(|(_, start)| *start)
        .collect();
    assert_eq!(
        starts,
        [4.0, 5.0, 5.0],
        "start, start, and the middle of the pump's range"
    );
}

/// The model's functions see the limited estimate, the innovation the estimate itself.
#[test]
fn clamping_limits_what_the_functions_see() {
    let plant = plant(TANKS);
    let tuning = Tuning {
        clamp: true,
        ..with_poles(0.03)
    };
    let design = design(&plant, &["pump"], &tuning).unwrap();
    let found = slope(&plant, &design, &[-1.0, 12.0, 11.0], &[], &[10.0]);
    let (low, high, e) = (0.05f64.sqrt(), 10f64.sqrt(), 2.0);
    let expected = [
        0.03 * 10.0 - 0.04 * low - 3.0 * 0.03 * 0.03 * e,
        0.07 * low - 0.066 * high - 3.0 * 0.03 * e,
        -0.03f64.powi(3) * e,
    ];
    assert_close(&found, &expected);
}

/// Remark 2: signs multiply along the chain. x1' = −x2, x2' = −x3: gains (+, −, +).
#[test]
fn negative_partials_flip_the_gains() {
    let plant = plant(
        "model Flip Real a; Real b; Real c; output Real y = a;
         equation der(a) = -b; der(b) = -c; der(c) = 0; end Flip;",
    );
    let design = design(&plant, &[], &with_poles(2.0)).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    let found = slope(&plant, &design, &[1.0, 0.0, 0.0], &[], &[0.0]);
    assert_close(&found, &[-3.0 * 2.0, 3.0 * 4.0, -8.0]);
}

/// y = 2 x + u: the innovation is taken in the units of the state.
#[test]
fn an_affine_output_is_solved_for_its_state() {
    let plant = plant(
        "model Affine input Real u; Real a; Real b; output Real y = 2*a + u;
         equation der(a) = b; der(b) = u; end Affine;",
    );
    let design = design(&plant, &[], &Tuning::from([("theta", 1.0)])).unwrap();
    let rest = slope(&plant, &design, &[1.0, 0.0], &[0.5], &[2.5]);
    assert_close(&rest, &[0.0, 0.5]);
}

/// The counter-example of the paper, u ∈ {−1, +1} as u = 2s − 1 with a whole s.
#[test]
fn the_counter_example_is_refused_with_its_witness() {
    let plant = plant(
        "model CounterExample input Integer s(min = 0, max = 1); Real u; Real x1; Real x2; output Real y = x1;
         equation u = 2*s - 1; der(x1) = u*x2; der(x2) = 0; end CounterExample;",
    );
    let Err(DesignError::Refused(examination)) =
        design(&plant, &[], &Tuning::from([("theta", 1.0)]))
    else {
        panic!("a constant gain was found where none exists")
    };
    let Verdict::Refuted(witness) = &examination.refuted().unwrap().verdict else {
        panic!()
    };
    let found: Vec<(f64, f64)> = witness
        .points
        .iter()
        .map(|p| (p.coordinates[0].value, p.value))
        .collect();
    assert_eq!(found, [(0.0, -1.0), (1.0, 1.0)]);
}

#[test]
fn a_square_is_refused_at_its_zero() {
    let plant = plant(
        "model Square Real x1; Real x2(min = -1, max = 1); output Real y = x1;
         equation der(x1) = x2^2; der(x2) = 0; end Square;",
    );
    let error = design(&plant, &[], &Tuning::from([("theta", 1.0)])).unwrap_err();
    let text = error.words();
    assert!(
        text.contains("∂f(x1)/∂x2 keeps its sign: refuted: it is 0 at x2 = 0"),
        "{text}"
    );
}

/// Two chains with the default δ₂ = 2n₁/(2n₂−1) and gains r θ^{jδ} s_j.
#[test]
fn two_chains_have_the_exponents_of_theorem_2() {
    let plant = plant(
        "model Two Real a; Real b; Real c; output Real y = a; output Real z = c;
         equation der(a) = b; der(b) = -a + c; der(c) = -c + a*b; end Two;",
    );
    let design = design(&plant, &[], &Tuning::from([("theta", 4.0)])).unwrap();
    let δ = design.parameters[1].1.words();
    // (a, b) leads with n₁ = 2, (c) follows with n₂ = 1: δ₂ = 4/1
    assert_eq!(δ, "1, 4");
    assert!(design.notes.is_empty());
    assert_eq!(design.gains[1].entries, [("c".to_owned(), 4f64.powi(4))]);
}

#[test]
fn exponents_outside_the_window_are_noted() {
    let plant = plant(
        "model Two Real a; Real b; Real c; output Real y = a; output Real z = c;
         equation der(a) = b; der(b) = -a + c; der(c) = -c + a*b; end Two;",
    );
    let mut tuning = Tuning::from([("theta", 4.0)]);
    let δ = Value::List(vec![Value::Number(1.0), Value::Number(9.0)]);
    tuning.values.insert("delta".into(), δ);
    let design = design(&plant, &[], &tuning).unwrap();
    assert!(
        design.notes[0].words().contains("window of Theorem 2"),
        "{:?}",
        design.notes
    );
}

#[test]
fn keys_that_cannot_be_used_are_named() {
    let plant = plant(TANKS);
    let text = |tuning: &Tuning| match design(&plant, &["pump"], tuning) {
        Err(DesignError::Tuning(error)) => format!("{}: {error}", error.key),
        other => panic!("{other:?}"),
    };
    assert!(text(&Tuning::default()).starts_with("theta: "));
    assert!(text(&Tuning::from([("theta", -1.0)])).contains("positive"));
    let mut two = with_poles(1.0);
    two.values
        .insert("theta".into(), Value::List(vec![Value::Number(1.0); 2]));
    assert!(text(&two).contains("one per measured output (1)"));
    let mut indefinite = with_poles(1.0);
    indefinite
        .values
        .insert("S".into(), matrix(&[1.0, 1.0, 1.0], &[2.0, 0.0]));
    assert!(text(&indefinite).contains("not positive definite"));
    let values = BTreeMap::from([("lever".to_owned(), 1.0)]);
    let initial = Tuning {
        initial: Initial {
            default: None,
            values,
        },
        ..with_poles(1.0)
    };
    assert!(text(&initial).contains("upper, lower, pump"));
}
