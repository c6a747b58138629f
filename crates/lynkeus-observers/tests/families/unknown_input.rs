//! The family `unknown-input` against the formulas of its paper.

mod promises;
mod shapes;
mod theorem;

use crate::common::{
    assert_close, assert_follows, design_with, plant, reference, refused, run, slope,
};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Design, DesignError, FAMILIES, Family, Tuning, TuningError, Value, unknown_input::UNKNOWN_INPUT,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing, Verdict};
use lynkeus_words::Words;

/// System (15) with a = 1, which the paper leaves open.
const EXAMPLE: &str = "model Farza
  parameter Real a = 1;
  input Real v(min = -6, max = 6);
  Real x1(start = 1, min = -12, max = 12); Real x2(start = 1, min = -12, max = 12);
  Real x3(start = 1, min = -5, max = 5); Real x4(start = 2, min = -4, max = 4);
  Real x5(start = 10, min = -20, max = 20);
  output Real y1 = x1; output Real y2 = x2; output Real y3 = x3;
equation
  der(x1) = (a - x3)*x4 - x3*v - x1;
  der(x2) = x3*x4 + (a - x3)*v - x2;
  der(x3) = x4*(1 + x4^2) - x3^3 - 10*sin(time)*v;
  der(x4) = x5 - x4^3 - 2*cos(time)*v;
  der(x5) = 5*sin(2*time)*v;
end Farza;";

/// θ = [60, 15] and the starts of section 4.1.
fn tuning(θ1: f64, θ2: f64) -> Tuning {
    let mut tuning = Tuning::default();
    let θ = vec![Value::Number(θ1), Value::Number(θ2)];
    tuning.values.insert("theta".into(), Value::List(θ));
    tuning
}

fn starts(mut tuning: Tuning, names: [&str; 3]) -> Tuning {
    tuning.initial.values = names
        .iter()
        .map(|n| n.to_string())
        .zip([0.0, 0.0, -1.0])
        .collect();
    tuning
}

fn with_partition(mut tuning: Tuning, outputs: &[&str]) -> Tuning {
    let outputs = outputs.iter().map(|o| Value::Text(o.to_string())).collect();
    tuning
        .values
        .insert("partition".into(), Value::List(outputs));
    tuning
}

fn design(plant: &Plant, tuning: &Tuning) -> Result<Design, DesignError> {
    design_with(UNKNOWN_INPUT, plant, &["v"], tuning)
}

/// (14) written out for the example, at time 0.
fn by_hand(x: [f64; 5], v: f64, y: [f64; 3], θ1: f64, θ2: f64) -> [f64; 6] {
    let (s, sin, cos, sin2) = (y[2], 0.0, 1.0, 0.0);
    let G = [-s, 1.0 - s];
    let gram = G[0] * G[0] + G[1] * G[1];
    let left = [G[0] / gram, G[1] / gram];
    let e1 = [x[0] - y[0], x[1] - y[1]];
    let v_error = left[0] * e1[0] + left[1] * e1[1];
    let e2 = x[2] - y[2];
    let factors = [-10.0 * sin, -2.0 * cos, 5.0 * sin2];
    let [d1, d2, d3] = factors.map(|g| g * v_error);
    let (tilde3, tilde4, _) = (x[2] - d1, x[3] - d2, x[4] - d3);
    let through = left[0] * (1.0 - tilde3) + left[1] * tilde3;
    let bent = 1.0 + 3.0 * tilde4 * tilde4 - factors[0] * through;
    [
        (1.0 - x[2]) * x[3] - x[0] + G[0] * v - 2.0 * θ1 * e1[0],
        x[2] * x[3] - x[1] + G[1] * v - 2.0 * θ1 * e1[1],
        x[3] * (1.0 + x[3] * x[3]) - x[2].powi(3) + factors[0] * v - 3.0 * θ2 * e2 - 2.0 * θ1 * d1,
        x[4] - x[3].powi(3) + factors[1] * v - 3.0 * θ2 * θ2 / bent * e2 - 2.0 * θ1 * d2,
        factors[2] * v - θ2.powi(3) / bent * e2 - 2.0 * θ1 * d3,
        -θ1 * θ1 * v_error,
    ]
}

#[test]
fn the_observer_of_the_example() {
    let plant = plant(EXAMPLE);
    let design = design(&plant, &tuning(6.0, 3.0)).unwrap();
    let examination = &design.examination;
    assert_eq!(
        examination.fit(),
        Standing::Proved,
        "{:#?}",
        examination.checks
    );
    let [first, second, ..] = &examination.chains[..] else {
        panic!()
    };
    assert_eq!(
        (first, second),
        (&vec!["x1".to_owned(), "x2".into()], &vec!["x3".into()])
    );
    let (x, v, y) = ([0.4, -0.7, 1.2, 0.9, 3.0], 1.5, [0.5, -0.4, 0.8]);
    let found = slope(&plant, &design, &[&x[..], &[v]].concat(), &[], &y);
    assert_close(&found, &by_hand(x, v, y, 6.0, 3.0));
}

/// Of all partitions only the paper's has G₁¹ of rank 1 everywhere.
#[test]
fn the_only_possible_partition() {
    let plant = plant(EXAMPLE);
    for outputs in [&["y1"][..], &["y2"], &["y3"], &["y1", "y3"]] {
        let tuning = with_partition(tuning(60.0, 15.0), outputs);
        let Err(DesignError::Refused(examination)) = design(&plant, &tuning) else {
            panic!("{outputs:?}")
        };
        let refuted = examination.refuted().unwrap();
        assert!(
            refuted.statement.words().contains("(i)"),
            "{}",
            refuted.statement.words()
        );
    }
    let tuning = with_partition(tuning(60.0, 15.0), &["y2", "y1"]);
    assert_eq!(
        design(&plant, &tuning).unwrap().examination.fit(),
        Standing::Proved
    );
}

fn followed(plant: &Plant, tuning: &Tuning, rows: &[f64], step: f64) -> Vec<Vec<f64>> {
    let design = design(plant, tuning).unwrap();
    let x0: Vec<f64> = plant.states.iter().map(|s| s.start.unwrap()).collect();
    run(plant, &design, &[("v", "5*sin(5*time)")], &x0, rows, step).rows
}

#[test]
fn the_reference_trajectory() {
    let Some((_, expected)) = reference("farza_a1.csv") else {
        return;
    };
    let times: Vec<f64> = expected.iter().map(|row| row[0]).collect();
    let tuning = starts(tuning(60.0, 15.0), ["x4", "x5", "v"]);
    let found = followed(&plant(EXAMPLE), &tuning, &times, 2e-4);
    assert_follows(&found, &expected);
}

/// The error of v̂ after the transient falls like 1/θ₁: v̂ lags by about 2v'/θ₁.
#[test]
fn the_error_of_the_unknown_input_against_theta() {
    let plant = plant(EXAMPLE);
    let times: Vec<f64> = (0..=500).map(|k| 0.02 * f64::from(k)).collect();
    let error = |θ1: f64| {
        let tuning = starts(tuning(θ1, 15.0), ["x4", "x5", "v"]);
        let rows = followed(&plant, &tuning, &times, 5e-4);
        let late = rows.iter().filter(|row| row[0] > 2.0);
        late.map(|row| (row[11] - 5.0 * (5.0 * row[0]).sin()).abs())
            .fold(0.0, f64::max)
    };
    let errors = [30.0, 60.0, 120.0, 240.0].map(error);
    println!("largest |v̂ − v| on [2, 10] for θ1 = 30, 60, 120, 240: {errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.6 * pair[0], "{errors:?}");
    }
}

#[test]
fn order_and_names_do_not_matter() {
    let renamed = "model Other
      input Real d(min = -6, max = 6);
      Real e(start = 10, min = -20, max = 20); Real c(start = 1, min = -5, max = 5);
      Real q(start = 2, min = -4, max = 4); Real b(start = 1, min = -12, max = 12);
      Real f(start = 1, min = -12, max = 12);
      output Real oc = c; output Real of = f; output Real ob = b;
    equation
      der(q) = e - q^3 - 2*cos(time)*d;
      der(c) = q*(1 + q^2) - c^3 - 10*sin(time)*d;
      der(e) = 5*sin(2*time)*d;
      der(b) = c*q + (1 - c)*d - b;
      der(f) = (1 - c)*q - c*d - f;
    end Other;";
    let times: Vec<f64> = (0..=10).map(|k| 0.1 * f64::from(k)).collect();
    let original = followed(
        &plant(EXAMPLE),
        &starts(tuning(60.0, 15.0), ["x4", "x5", "v"]),
        &times,
        1e-3,
    );
    let plant = plant(renamed);
    let tuning = starts(tuning(60.0, 15.0), ["q", "e", "d"]);
    let design = design_with(UNKNOWN_INPUT, &plant, &["d"], &tuning).unwrap();
    let x0: Vec<f64> = plant.states.iter().map(|s| s.start.unwrap()).collect();
    let other = run(
        &plant,
        &design,
        &[("d", "5*sin(5*time)")],
        &x0,
        &times,
        1e-3,
    )
    .rows;
    // e, c, q, b, f are x5, x3, x4, x2, x1
    let order = [10, 8, 9, 7, 6, 11];
    for (row, other) in original.iter().zip(&other) {
        for (k, &place) in order.iter().enumerate() {
            let (a, b) = (row[place], other[6 + k]);
            assert!((a - b).abs() <= 1e-9 * a.abs().max(1.0), "{a} against {b}");
        }
    }
}

/// Two unknown inputs, three layers, the unknown inputs in every equation, and
/// nothing nonlinear: the error's eigenvalues are −θ₁ four times and −θ₂ three times.
#[test]
fn the_error_of_a_linear_plant_has_the_poles_of_the_paper() {
    let plant = plant(
        "model Linear input Real v1; input Real v2; Real d; Real c; Real a1; Real b; Real a2;
         output Real y1 = 2*a1 + 1; output Real y2 = b; output Real y3 = a2;
         equation
         der(a1) = v1; der(a2) = 2*v2 + v1; der(b) = c + 3*v1 + v2;
         der(c) = 2*d - v2; der(d) = v1; end Linear;",
    );
    let (θ1, θ2) = (2.0, 3.0);
    let tuning = with_partition(tuning(θ1, θ2), &["y1", "y3"]);
    let design = design_with(UNKNOWN_INPUT, &plant, &["v1", "v2"], &tuning).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    let rest = slope(&plant, &design, &[0.0; 7], &[], &[1.0, 0.0, 0.0]);
    assert_close(&rest, &[0.0; 7]);
    let column = |i: usize| {
        let mut x = [0.0; 7];
        x[i] = 1.0;
        slope(&plant, &design, &x, &[], &[1.0, 0.0, 0.0])
    };
    let J: Vec<Vec<f64>> = (0..7).map(column).collect();
    // columns of (J + θ I)·A
    let shifted = |θ: f64, A: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let product = |a: &Vec<f64>| {
            (0..7)
                .map(|r| θ * a[r] + (0..7).map(|k| J[k][r] * a[k]).sum::<f64>())
                .collect()
        };
        A.iter().map(product).collect()
    };
    let mut power: Vec<Vec<f64>> = (0..7)
        .map(|i| (0..7).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for θ in [θ1, θ1, θ2, θ2, θ2] {
        assert!(power.iter().flatten().any(|x| x.abs() > 1e-3));
        power = shifted(θ, &power);
    }
    assert!(power.iter().flatten().all(|x| x.abs() < 1e-9), "{power:?}");
}

/// Lemma 1 of the paper fails for m₁ > m: (ii) holds and ∂f̄₁²/∂x² is zero.
#[test]
fn a_counter_example_to_lemma_1() {
    let plant = plant(
        "model Gap input Real v; Real a; Real b; Real c; Real d;
         output Real ya = a; output Real yb = b; output Real yc = c;
         equation der(a) = v; der(b) = d; der(c) = -c; der(d) = -d; end Gap;",
    );
    let given = with_partition(tuning(10.0, 5.0), &["ya", "yb"]);
    let Err(DesignError::Refused(examination)) = design(&plant, &given) else {
        panic!()
    };
    assert!(
        examination
            .refuted()
            .unwrap()
            .statement
            .words()
            .starts_with("(11)")
    );
    // the search finds x₁¹ = (a), with x₂¹ = (b, c) taller than x² = (d)
    let found = design(&plant, &tuning(10.0, 5.0)).unwrap();
    assert_eq!(found.examination.fit(), Standing::Proved);
    assert_eq!(found.examination.chains[..2], [vec!["a"], vec!["b", "c"]]);
    let slope = slope(&plant, &found, &[0.0, 1.0, 2.0, 0.0, 0.0], &[], &[0.0; 3]);
    assert_close(&slope, &[0.0, -10.0, -2.0 - 20.0, -25.0, 0.0]);
}

const SMALL: &str = "model Small input Real v(min = -1, max = 1);
  Real a(min = -1, max = 1); Real b(min = -1, max = 1); Real c(min = -1, max = 1);
  output Real ya = a; output Real yb = b;
  equation der(a) = -a + v; der(b) = c; der(c) = -sin(c) + 0.5*v; end Small;";

/// Without theta the inequality of the proof gives one, and the observer converges.
#[test]
fn theta_from_the_proof() {
    let plant = plant(SMALL);
    let design = design(&plant, &Tuning::default()).unwrap();
    assert!(
        design.notes[0].words().contains("proof of Theorem 1"),
        "{:?}",
        design.notes
    );
    let θ: Vec<f64> = design.parameters[..2]
        .iter()
        .map(|p| p.1.words().parse().unwrap())
        .collect();
    assert!(θ[0] > θ[1] && θ[1] >= 1.0 && θ[0] < 1e4, "{θ:?}");
    let rows = run(
        &plant,
        &design,
        &[("v", "0.5")],
        &[0.2, 0.3, -0.4],
        &[0.0, 10.0],
        0.2 / θ[0],
    )
    .rows;
    let last = &rows[1];
    for (x, x̂) in [(1, 4), (2, 5), (3, 6)] {
        assert!((last[x] - last[x̂]).abs() < 1e-3, "{last:?}");
    }
    assert!((last[7] - 0.5).abs() < 1e-3, "{last:?}");
}

fn wrong(plant: &Plant, tuning: &Tuning) -> TuningError {
    match design(plant, tuning) {
        Err(DesignError::Tuning(error)) => error,
        other => panic!("expected a wrong key, found {other:?}"),
    }
}

#[test]
fn theta_is_asked_for_where_no_bound_is_known() {
    let unbounded = SMALL
        .replace("(min = -1, max = 1)", "")
        .replace("sin(c)", "c^2");
    let large = wrong(&plant(EXAMPLE), &Tuning::default());
    assert!(large.expected.contains("far more than needed"), "{large}");
    let error = wrong(&plant(&unbounded), &Tuning::default());
    assert_eq!(
        (error.key.as_str(), error.found.as_str()),
        ("theta", "nothing")
    );
    assert!(
        error.expected.contains("declare min and max of c"),
        "{error}"
    );
}

#[test]
fn wrong_keys_are_named() {
    let plant = plant(EXAMPLE);
    let one = wrong(&plant, &Tuning::from([("theta", 3.0)]));
    assert!(
        one.expected.contains("[θ1, θ2]") && one.found == "1 number(s)",
        "{one}"
    );
    assert_eq!(wrong(&plant, &tuning(60.0, -1.0)).found, "-1");
    for (outputs, found) in [
        (&["y1", "x4"][..], "\"x4\""),
        (&["y1", "y1"], "\"y1\""),
        (&["y1", "y2", "y3"], "3 outputs"),
        (&[], "0 outputs"),
    ] {
        let error = wrong(&plant, &with_partition(tuning(60.0, 15.0), outputs));
        assert_eq!(
            (error.key.as_str(), error.found.as_str()),
            ("partition", found),
            "{error}"
        );
    }
}

#[test]
fn what_is_missing_is_said() {
    let examination = refused(UNKNOWN_INPUT, &plant(EXAMPLE), &tuning(60.0, 15.0));
    assert!(
        examination.summary.words().contains("'unknown'"),
        "{}",
        examination.summary.words()
    );
    let hidden = EXAMPLE.replace("- 2*cos(time)*v", "- x5*v");
    let Err(DesignError::Refused(examination)) = design(&plant(&hidden), &tuning(60.0, 15.0))
    else {
        panic!()
    };
    assert!(
        examination
            .summary
            .words()
            .contains("equation of x4 the factor of v depends on x5"),
        "{}",
        examination.summary.words()
    );
}

/// x₄² instead of x₄(1 + x₄²): nothing shows the sign of x₄ where x₃ gives no hint.
#[test]
fn a_rank_that_is_lost_is_refuted() {
    let flat = plant(
        "model Flat input Real v(min = -1, max = 1); Real a(min = -1, max = 1);
         Real b(min = -1, max = 1); Real c(min = -1, max = 1);
         output Real ya = a; output Real yb = b;
         equation der(a) = v; der(b) = c^2; der(c) = -c; end Flat;",
    );
    let Err(DesignError::Refused(examination)) = design(&flat, &tuning(60.0, 15.0)) else {
        panic!()
    };
    let refuted = examination.refuted().unwrap();
    assert!(
        refuted.statement.words().starts_with("(H1)"),
        "{}",
        refuted.statement.words()
    );
    assert!(matches!(refuted.verdict, Verdict::Refuted(_)));
}

/// `auto` takes the first family that fits: of this plant no other does for sure.
#[test]
fn no_family_before_it_fits_the_example() {
    let plant = plant(EXAMPLE);
    let sensors = Sensors {
        unknown: vec!["v".into()],
        ..Sensors::default()
    };
    let augmented = AugmentedPlant::new(&plant, &sensors).unwrap();
    let fits = |family: &&&'static dyn Family| {
        let found = family.examine(&augmented, &Tuning::default()).unwrap();
        found.fit() == Standing::Proved
    };
    let first = FAMILIES.iter().find(fits).unwrap();
    assert_eq!(first.name(), "unknown-input");
}
