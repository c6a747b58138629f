//! Remedies against peaking: low-power form, transient θ, limited innovation.

use std::collections::BTreeMap;

use crate::common::{assert_close, design_with, plant, refused, run, slope};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Design, DesignError, Family, Tuning, Value, block_triangular::BLOCK_TRIANGULAR,
    triangular::TRIANGULAR,
};
use lynkeus_words::Words;

/// Four states in a chain, nonlinear at its end.
const FOUR: &str = "model Four
  Real x1(start = 0.3); Real x2(start = 0); Real x3(start = -0.2); Real x4(start = 0.4);
  output Real y = x1;
equation
  der(x1) = x2; der(x2) = x3; der(x3) = x4; der(x4) = -x1 - 2*x2 - 3*x3 - 2*x4 + sin(x1*x3);
end Four;";

/// Two chains that meet at their ends.
const TWO: &str = "model Two
  Real a(start = 1); Real b(start = 0); Real c(start = -1); Real d(start = 0.5); Real e(start = 0);
  output Real y = a; output Real z = d;
equation
  der(a) = b; der(b) = c; der(c) = -a - 2*b - 2*c + 0.3*sin(e);
  der(d) = -e; der(e) = d - e + 0.2*cos(b);
end Two;";

fn text(word: &str) -> Value {
    Value::Text(word.to_owned())
}

fn list(numbers: &[f64]) -> Value {
    Value::List(numbers.iter().map(|&x| Value::Number(x)).collect())
}

fn with(θ: f64, keys: &[(&str, Value)]) -> Tuning {
    let mut tuning = Tuning::from([("theta", θ)]);
    for (key, value) in keys {
        tuning.values.insert((*key).to_owned(), value.clone());
    }
    tuning.initial.default = Some(0.0);
    tuning
}

fn low_power(θ: f64, keys: &[(&str, Value)]) -> Tuning {
    let form = [("form", text("low-power"))];
    with(θ, &[&form, keys].concat())
}

fn table(entries: &[(&str, f64)]) -> Value {
    let entry = |&(key, x): &(&str, f64)| (key.to_owned(), Value::Number(x));
    Value::Table(BTreeMap::from_iter(entries.iter().map(entry)))
}

fn designed(family: &'static dyn Family, plant: &Plant, tuning: &Tuning) -> Design {
    design_with(family, plant, &[], tuning).unwrap()
}

fn refusal(family: &'static dyn Family, plant: &Plant, tuning: &Tuning) -> String {
    match design_with(family, plant, &[], tuning) {
        Err(DesignError::Tuning(error)) => error.to_string(),
        other => panic!("expected a key to be refused, found {other:?}"),
    }
}

/// Largest error of each estimate in the rows from `from` on.
fn errors(plant: &Plant, design: &Design, until: f64, from: f64) -> Vec<f64> {
    let x0: Vec<f64> = plant.states.iter().map(|s| s.start.unwrap()).collect();
    let rows: Vec<f64> = (0..=200).map(|k| until * k as f64 / 200.0).collect();
    let found = run(plant, design, &[], &x0, &rows, 2e-3);
    let n = x0.len();
    let late = found.rows.iter().filter(|row| row[0] >= from);
    late.fold(vec![0.0; n], |worst: Vec<f64>, row| {
        let error = |i: usize| (row[1 + i] - row[1 + n + i]).abs();
        worst
            .iter()
            .enumerate()
            .map(|(i, w)| w.max(error(i)))
            .collect()
    })
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, x| m.max(*x))
}

#[test]
fn the_low_power_form_converges_with_gains_of_second_power() {
    let plant = plant(FOUR);
    let θ = 12.0;
    let design = designed(TRIANGULAR, &plant, &low_power(θ, &[]));
    assert_eq!(design.observer.states.len(), 2 * 4 - 2);
    assert_eq!(design.observer.estimates.len(), 4);
    // K_i = (2, (4 − i)/i): no gain above 3θ², where the standard one has θ⁴
    // no K on ŷ − y: the factors of the blocks are parameters
    assert!(design.gains.is_empty());
    let factors = design.parameters.iter().filter(|p| p.0.contains(": on "));
    let gains: Vec<f64> = factors.map(|p| p.1.words().parse().unwrap()).collect();
    assert_close(
        &gains,
        &[2.0 * θ, 3.0 * θ * θ, 2.0 * θ, θ * θ, 2.0 * θ, θ * θ / 3.0],
    );
    let standard = designed(TRIANGULAR, &plant, &with(θ, &[]));
    assert!(standard.gains[0].entries[3].1 > 10.0 * gains[1]);
    assert!(largest(&errors(&plant, &design, 8.0, 6.0)) < 1e-6);
}

/// A chain of one state has no block, and so no coefficients.
#[test]
fn a_chain_of_one_state_takes_no_coefficients() {
    let plant = plant("model One Real a; output Real y = a; equation der(a) = -a; end One;");
    let none = Value::List(vec![Value::List(vec![])]);
    let design = designed(
        TRIANGULAR,
        &plant,
        &low_power(2.0, &[("low_power_k", none)]),
    );
    assert_close(
        &slope(&plant, &design, &[0.3], &[], &[0.1]),
        &[-0.3 - 2.0 * 0.2],
    );
}

/// The blocks by hand, with partials −2 and 5: only the second gain of each keeps one.
#[test]
fn partials_enter_one_at_a_time() {
    let plant = plant(
        "model Signs Real a; Real b; Real c; output Real y = a;
         equation der(a) = -2*b; der(b) = 5*c - a; der(c) = -a*b; end Signs;",
    );
    let K = Value::List(vec![Value::List(vec![
        list(&[3.0, 1.0]),
        list(&[4.0, 0.5]),
    ])]);
    let θ = 2.0;
    let (a, b, c, second, y) = (0.3, 0.7, -0.4, 0.9, 0.1);
    let (e1, e2) = (y - a, second - b);
    let expected = [
        -2.0 * second + 3.0 * θ * e1,
        5.0 * c - a + 4.0 * θ * e2,
        -a * b + 0.5 * θ * θ / 5.0 * e2,
        5.0 * c - a + 1.0 * θ * θ / -2.0 * e1,
    ];
    for partials in [false, true] {
        let keys = [
            ("low_power_k", K.clone()),
            ("partials", Value::Flag(partials)),
        ];
        let design = designed(TRIANGULAR, &plant, &low_power(θ, &keys));
        let found = slope(&plant, &design, &[a, b, c, second], &[], &[y]);
        assert_close(&found, &expected);
    }
}

#[test]
fn two_chains_and_one_of_a_single_state() {
    let plant = plant(TWO);
    let poles = Value::List(vec![list(&[-1.0, -1.5, -2.0, -2.5]), list(&[-1.0, -2.0])]);
    let keys = [("low_power_poles", poles), ("delta", list(&[1.0, 1.5]))];
    let design = designed(TRIANGULAR, &plant, &low_power(8.0, &keys));
    assert_eq!(design.observer.states.len(), 4 + 2);
    assert!(largest(&errors(&plant, &design, 8.0, 6.0)) < 1e-6);
    let single = crate::common::plant(
        "model Single Real x(start = 1); output Real y = x; equation der(x) = -x^3; end Single;",
    );
    let design = designed(TRIANGULAR, &single, &low_power(3.0, &[]));
    assert_close(
        &slope(&single, &design, &[0.5], &[], &[1.0]),
        &[-0.125 + 3.0 * 0.5],
    );
}

#[test]
fn the_classical_observer_in_the_low_power_form() {
    // a chain may read the measured head of the next one, and all of the one before
    let plant = plant(&TWO.replace("sin(e)", "sin(d)"));
    let keys = [
        ("correction", text("classical")),
        ("form", text("low-power")),
        ("theta", list(&[6.0, 20.0])),
    ];
    let design = designed(BLOCK_TRIANGULAR, &plant, &with(6.0, &keys));
    assert_eq!(design.observer.states.len(), 4 + 2);
    assert!(largest(&errors(&plant, &design, 8.0, 6.0)) < 1e-5);
    let lee = low_power(6.0, &[]);
    let lee = refused(BLOCK_TRIANGULAR, &plant, &lee);
    assert!(lee.summary.words().contains("correction = \"classical\""));
}

/// With `clamp` the blocks are driven by bounded signals: the last state peaks less.
#[test]
fn limited_copies_do_not_hand_their_peaks_on() {
    let text = FOUR.replace("(start", "(min = -2, max = 2, start");
    let plant = plant(&text);
    let free = designed(TRIANGULAR, &plant, &low_power(12.0, &[]));
    let limited = Tuning {
        clamp: true,
        ..low_power(12.0, &[])
    };
    let limited = designed(TRIANGULAR, &plant, &limited);
    let (free, limited) = (
        errors(&plant, &free, 8.0, 0.0),
        errors(&plant, &limited, 8.0, 0.0),
    );
    assert!(limited[3] < 0.3 * free[3], "{limited:?} against {free:?}");
}

/// θ^j before `until`, the study's after it; both at t = 0, where `slope` looks.
#[test]
fn the_gain_changes_at_the_end_of_the_transient() {
    let plant = plant(FOUR);
    let correction = |transient: Option<Value>| -> Vec<f64> {
        let keys: Vec<(&str, Value)> = transient.map(|t| ("transient", t)).into_iter().collect();
        let design = designed(TRIANGULAR, &plant, &with(8.0, &keys));
        slope(&plant, &design, &[0.0; 4], &[], &[1.0])
    };
    let scaled = |θ: f64| -> Vec<f64> {
        let steady = correction(None);
        let power = |(j, x): (usize, &f64)| x * (θ / 8.0).powi(j as i32 + 1);
        steady.iter().enumerate().map(power).collect()
    };
    let before = table(&[("theta", 2.0), ("until", 1.0)]);
    let after = table(&[("theta", 2.0), ("until", -1.0)]);
    let falling = table(&[("theta", 2.0), ("until", -1.0), ("fall", 0.5)]);
    assert_close(&correction(Some(before)), &scaled(2.0));
    assert_close(&correction(Some(after)), &scaled(8.0));
    assert_close(
        &correction(Some(falling)),
        &scaled(8.0 - 6.0 * (-2f64).exp()),
    );
}

/// A low θ until the error of the measured state is gone takes the peak away, the study's
/// θ then brings the pace: in the run, in both families and in the low-power form.
#[test]
fn a_gentle_transient_peaks_less() {
    let plant = plant(FOUR);
    let gentle = ("transient", table(&[("theta", 3.0), ("until", 2.0)]));
    let tunings: [(&'static dyn Family, Tuning); 3] = [
        (TRIANGULAR, with(12.0, &[])),
        (TRIANGULAR, low_power(12.0, &[])),
        (BLOCK_TRIANGULAR, with(12.0, &[])),
    ];
    for (family, tuning) in tunings {
        let mut switched = tuning.clone();
        switched
            .values
            .insert(gentle.0.to_owned(), gentle.1.clone());
        let plain = errors(&plant, &designed(family, &plant, &tuning), 8.0, 0.0);
        let design = designed(family, &plant, &switched);
        let found = errors(&plant, &design, 8.0, 0.0);
        assert!(found[3] < 0.3 * plain[3], "{found:?} against {plain:?}");
        assert!(largest(&errors(&plant, &design, 8.0, 6.0)) < 1e-5);
        assert!(
            design
                .parameters
                .iter()
                .any(|(name, _)| name == "θ in the transient")
        );
    }
}

/// In the output's unit, y = −2x; below the limit nothing changes.
#[test]
fn the_innovation_is_limited() {
    let plant = plant(
        "model Scaled Real a; Real b; output Real y = -2*a; equation der(a) = b; der(b) = 0; end Scaled;",
    );
    let keys = [("innovation_limit", Value::Number(0.5))];
    for family in [TRIANGULAR, BLOCK_TRIANGULAR] {
        let plain = designed(family, &plant, &with(3.0, &[]));
        let limited = designed(family, &plant, &with(3.0, &keys));
        let at = |design: &Design, y: f64| slope(&plant, design, &[0.0, 0.0], &[], &[y]);
        assert_close(&at(&limited, 0.4), &at(&plain, 0.4));
        assert_close(&at(&limited, 7.0), &at(&plain, 0.5));
        assert_close(&at(&limited, -7.0), &at(&plain, -0.5));
    }
}

#[test]
fn wrong_keys_are_refused_with_what_is_expected() {
    let plant = plant(FOUR);
    let said = |tuning: Tuning| refusal(TRIANGULAR, &plant, &tuning);
    let pairs = |pairs: &[[f64; 2]]| {
        Value::List(vec![Value::List(pairs.iter().map(|p| list(p)).collect())])
    };
    for (tuning, words) in [
        (
            with(1.0, &[("form", text("small"))]),
            "\"standard\" or \"low-power\"",
        ),
        (
            low_power(1.0, &[("r", Value::Number(1.0))]),
            "form = \"low-power\", which does not read it",
        ),
        (
            with(1.0, &[("low_power_k", list(&[1.0]))]),
            "form = \"standard\", which does not read it",
        ),
        (
            low_power(1.0, &[("low_power_k", pairs(&[[1.0, 1.0]]))]),
            "(3 here)",
        ),
        (
            low_power(
                1.0,
                &[("low_power_k", pairs(&[[1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]))],
            ),
            "that make M stable",
        ),
        (
            low_power(
                1.0,
                &[("low_power_poles", Value::List(vec![list(&[-1.0; 5])]))],
            ),
            "(6 here)",
        ),
        (
            low_power(
                1.0,
                &[("low_power_poles", Value::List(vec![list(&[1.0; 6])]))],
            ),
            "2n − 2 negative numbers",
        ),
        (
            with(1.0, &[("transient", Value::Number(1.0))]),
            "a table { theta = …, until = time }",
        ),
        (
            with(1.0, &[("transient", table(&[("theta", 1.0)]))]),
            "until = time",
        ),
        (
            with(
                1.0,
                &[(
                    "transient",
                    table(&[("theta", 1.0), ("until", 1.0), ("then", 1.0)]),
                )],
            ),
            "found { then = 1",
        ),
        (
            with(
                1.0,
                &[("transient", table(&[("theta", -1.0), ("until", 1.0)]))],
            ),
            "positive numbers for theta",
        ),
        (
            with(1.0, &[("innovation_limit", Value::Number(0.0))]),
            "positive numbers",
        ),
    ] {
        let found = said(tuning);
        assert!(found.contains(words), "{found}\nlacks\n{words}");
    }
    let wide = crate::common::plant(
        "model Wide Real a; Real b; output Real y = a; equation der(a) = exp(b); der(b) = 0; end Wide;",
    );
    let found = refusal(TRIANGULAR, &wide, &low_power(1.0, &[]));
    assert!(found.contains("set partials = true"), "{found}");
}
