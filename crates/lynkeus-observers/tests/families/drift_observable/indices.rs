//! Which derivatives of which outputs: two outputs against independent formulas, the search, and
//! poles that are given before the indices are known.

use std::collections::BTreeMap;

use crate::common::{design_with, plant, run, slope};
use lynkeus_observers::{
    DesignError, Examination, Tuning, Value, drift_observable::DRIFT_OBSERVABLE,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing, Verdict};
use lynkeus_words::Words;

use super::{assert_near, list, parameter};

fn with(keys: &[(&str, Value)]) -> Tuning {
    let values = keys.iter().map(|(k, v)| ((*k).to_owned(), v.clone()));
    Tuning {
        values: values.collect(),
        ..Tuning::default()
    }
}

fn pair(re: f64, im: f64) -> Value {
    let parts = [("re", re), ("im", im)];
    let parts = parts.map(|(name, x)| (name.to_owned(), Value::Number(x)));
    Value::Table(BTreeMap::from(parts))
}

fn examine(text: &str, tuning: &Tuning) -> Result<Examination, DesignError> {
    let plant = plant(text);
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    DRIFT_OBSERVABLE.examine(&augmented, tuning)
}

/// Indices (2, 3); rows of Q by hand, and Q s = b by substitution.
const FIVE: &str = "model Five input Real u(min = -1, max = 1);
  Real a1(start = 0.3, min = -2, max = 2); Real a2(start = -0.2, min = -2, max = 2);
  Real b1(start = 0.5, min = -2, max = 2); Real b2(start = 0.1, min = -2, max = 2);
  Real b3(start = -0.4, min = -2, max = 2); output Real y = a1; output Real z = b1;
  equation der(a1) = a2 + 0.2*sin(b1); der(a2) = -a1 - 0.1*a2*b2; der(b1) = b2 + 0.1*a1^2;
    der(b2) = b3; der(b3) = -b1 - b2 - 2*b3 - 0.3*sin(a2) + u; end Five;";

fn five(x: [f64; 5], u: f64, y: f64, z: f64) -> Vec<f64> {
    let [a1, a2, b1, b2, b3] = x;
    let f = [
        a2 + 0.2 * b1.sin(),
        -a1 - 0.1 * a2 * b2,
        b2 + 0.1 * a1 * a1,
        b3,
        -b1 - b2 - 2.0 * b3 - 0.3 * a2.sin() + u,
    ];
    // (s + 3)(s + 4), and (s + 5)((s + 3)² + 1)
    let (ey, ez) = (y - a1, z - b1);
    let [c1, c2] = [7.0 * ey, 12.0 * ey];
    let [c3, c4, c5] = [11.0 * ez, 40.0 * ez, 50.0 * ez];
    let s1 = c1;
    let s3 = c3;
    let s2 = c2 - 0.2 * b1.cos() * s3;
    let s4 = c4 - 0.2 * a1 * s1;
    let s5 = c5 - 0.2 * f[0] * s1 - 0.2 * a1 * s2 - 0.04 * a1 * b1.cos() * s3;
    let s = [s1, s2, s3, s4, s5];
    f.iter().zip(s).map(|(f, s)| f + s).collect()
}

#[test]
fn indices_2_3_against_substitution_by_hand() {
    let plant = plant(FIVE);
    let poles = Value::List(vec![
        list(&[-3.0, -4.0]),
        Value::List(vec![Value::Number(-5.0), pair(-3.0, -1.0)]),
    ]);
    let design = design_with(DRIFT_OBSERVABLE, &plant, &[], &with(&[("poles", poles)])).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    let summary = &design.examination.summary.words();
    assert!(summary.contains("y, y', z, z', z''"), "{summary}");
    assert_eq!(parameter(&design, "λ of z"), "-5, -3 ± 1i");
    assert_eq!(parameter(&design, "K of z"), "11, 40, 50");
    for k in 0..20 {
        let x: [f64; 5] = std::array::from_fn(|i| (1.7 * f64::from(k) + 2.3 * i as f64).sin());
        let (u, y, z) = (0.3, 0.4 * f64::from(k).cos(), -0.2);
        let found = slope(&plant, &design, &x, &[u], &[y, z]);
        assert_near(&found, &five(x, u, y, z), 1e-12);
    }
    let start = [0.3, -0.2, 0.5, 0.1, -0.4];
    let mut wrong = with(&[(
        "poles",
        Value::List(vec![list(&[-3.0, -4.0]), list(&[-3.0, -4.0, -5.0])]),
    )]);
    wrong.initial.default = Some(0.0);
    let design = design_with(DRIFT_OBSERVABLE, &plant, &[], &wrong).unwrap();
    let found = run(
        &plant,
        &design,
        &[("u", "sin(time)")],
        &start,
        &[0.0, 8.0],
        1e-3,
    );
    let last = &found.rows[1];
    for i in 1..6 {
        assert!((last[i] - last[i + 5]).abs() < 1e-6, "state {i}");
    }
}

/// [2, 2] are found first and det Q = 2·a2·… vanishes in the middle; [3, 1] is regular everywhere.
const SINGULAR: &str = "model L input Real u(min = -1, max = 1); Real a1(start = 0.5, min = -2, max = 2);
  Real a2(start = 0.1, min = -2, max = 2); Real a3(start = 0.2, min = -2, max = 2); Real b1(start = 0.5, min = -2, max = 2);
  output Real ya = a1; output Real yb = b1;
  equation der(a1) = a2; der(a2) = a3; der(a3) = -a1 - 3*a2 - 3*a3 + u; der(b1) = -b1 + a2*a3; end L;";

#[test]
fn indices_that_are_regular_everywhere_are_preferred() {
    let slowest = with(&[("poles", list(&[-3.0, -3.5]))]);
    let found = examine(SINGULAR, &slowest).unwrap();
    assert_eq!(found.fit(), Standing::Proved, "{:#?}", found);
    assert!(
        found.summary.words().contains("ya, ya', ya'', yb,"),
        "{}",
        found.summary.words()
    );
    for told in ["; indices [3, 1] (others: ", "[2, 2] does not fit"] {
        assert!(
            found.summary.words().contains(told),
            "{}",
            found.summary.words()
        );
    }
    let design = design_with(DRIFT_OBSERVABLE, &plant(SINGULAR), &[], &slowest).unwrap();
    assert_eq!(
        parameter(&design, "λ of ya"),
        "-3, -3.5999999999999996, -4.32"
    );
    assert_eq!(parameter(&design, "λ of yb"), "-3.5");
}

/// What the study says stands: by the key, or by the lengths of the lists of poles.
#[test]
fn given_indices_are_not_overruled() {
    let four = Value::List(vec![list(&[-3.0, -3.0]), list(&[-3.0, -3.0])]);
    for tuning in [
        with(&[("poles", four)]),
        with(&[("indices", list(&[2.0, 2.0]))]),
    ] {
        let found = examine(SINGULAR, &tuning).unwrap();
        assert_eq!(found.fit(), Standing::Refuted);
        assert!(matches!(found.checks[1].verdict, Verdict::Refuted(_)));
    }
    // one of them is enough, where the other chain has its slowest pole
    let partly = Value::List(vec![Value::Number(-2.0), list(&[-3.0])]);
    let found = examine(SINGULAR, &with(&[("poles", partly)])).unwrap();
    assert!(
        found.summary.words().contains("ya, ya', ya'', yb,"),
        "{}",
        found.summary.words()
    );
}

#[test]
fn poles_that_fit_no_indices_are_refused_with_those_that_do() {
    let text = |poles: Value| match examine(SINGULAR, &with(&[("poles", poles)])) {
        Err(DesignError::Tuning(error)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let five = Value::List(vec![list(&[-1.0; 3]), list(&[-1.0; 2])]);
    assert!(text(five).contains("as many poles as states (4) in all"));
    let three = Value::List(vec![list(&[-1.0]), list(&[-1.0]), list(&[-1.0])]);
    assert!(text(three).contains("for each measured output (2)"));
    let unstable = Value::List(vec![
        Value::List(vec![pair(1.0, 1.0), Value::Number(-1.0)]),
        list(&[-1.0]),
    ]);
    assert!(text(unstable).contains("negative numbers, found 1"));
    let real = Value::List(vec![
        Value::List(vec![pair(-1.0, 0.0)]),
        Value::Number(-1.0),
    ]);
    assert!(text(real).contains("im ≠ 0"));
    let half = Value::Table([("re".to_owned(), Value::Number(-1.0))].into());
    let half = Value::List(vec![Value::List(vec![half]), Value::Number(-1.0)]);
    assert!(text(half).contains("{ re = number, im = number }"));
}

/// y' = b + u d, d' = −d + v: y'' reads u v, though L_g L_f^k h is zero for v.
#[test]
fn an_input_that_another_brings_along_is_seen() {
    let text = "model B input Real u(min = -0.1, max = 0.1); input Real v(min = -1, max = 1);
      Real a(min = -2, max = 2); Real b(min = -2, max = 2); Real c(min = -2, max = 2); Real d(min = -2, max = 2);
      output Real y = a; output Real z = d;
      equation der(a) = b + u*d; der(b) = c; der(c) = -a - 3*b - 3*c; der(d) = -d + v; end B;";
    let found = examine(text, &with(&[("indices", list(&[3.0, 1.0]))])).unwrap();
    assert!(
        found.summary.words().contains("which read u, u', v;"),
        "{}",
        found.summary.words()
    );
    assert!(
        found.checks[0]
            .reason
            .words()
            .contains("y: r = 2, v appears in y^(2)"),
        "{}",
        found.checks[0].reason.words()
    );
}

/// Seven states in a chain that bends: Q is unit lower triangular.
#[test]
fn long_chains_are_proved_regular() {
    let n = 7;
    let declared: String = (1..=n)
        .map(|i| format!("Real x{i}(min = -1, max = 1); "))
        .collect();
    let equations: String = (1..n)
        .map(|i| format!("der(x{i}) = x{} + 0.1*sin(x{i}); ", i + 1))
        .collect();
    let text = format!(
        "model Long {declared} output Real y = x1; equation {equations} der(x{n}) = -x1; end Long;"
    );
    let found = examine(&text, &Tuning::default()).unwrap();
    assert_eq!(found.fit(), Standing::Proved, "{:#?}", found.checks);
    assert!(
        found.checks[1]
            .reason
            .words()
            .contains("|det| lies in [1, 1]"),
        "{}",
        found.checks[1].reason.words()
    );
}
