//! Theorems 1 and 2 of Hammouri, Targui and Armanet against independent computations.

use std::collections::BTreeMap;

use crate::common::{
    Guaranteed, assert_safely, constant, design_with, hypothesis, numbers, plant, run,
};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Certificate, Initial, Tuning, Value, triangular::TRIANGULAR};
use lynkeus_structure::{Standing, Verdict};
use lynkeus_words::Words;

fn study<'a>(plant: &'a Plant, tuning: Tuning) -> Guaranteed<'a> {
    Guaranteed {
        family: TRIANGULAR,
        plant,
        unknown: &[],
        tuning,
        drift: vec![0.0; plant.states.len()],
        noise: vec![0.0; plant.outputs.len()],
    }
}

fn list(x: &[f64]) -> Value {
    Value::List(x.iter().map(|&x| Value::Number(x)).collect())
}

fn matrices(all: &[(&[f64], &[f64])]) -> Value {
    let table = |(diag, off): &(&[f64], &[f64])| {
        Value::Table(BTreeMap::from([
            ("diag".to_owned(), list(diag)),
            ("off".to_owned(), list(off)),
        ]))
    };
    Value::List(all.iter().map(table).collect())
}

const PENDULUM: &str = "model Pendulum
  Real angle(min = -10, max = 10); Real speed(min = -10, max = 10);
  output Real y = angle;
equation
  der(angle) = speed; der(speed) = -0.5*sin(angle);
end Pendulum;";

/// x1' = x2, x2' = −0.5 sin x1. With S = [1, −0.325; −0.325, 0.316875], μ the least
/// eigenvalue of [2, −1/√s₂₂; ·, 0.65/s₂₂], g = √s₂₂/(2θ) and c = 1/√3 the comparison
/// matrix is [2cg − θμ, g; g, −θμ]: θ0² = ½√s₂₂ (c + √(c² + 1))/μ. The other
/// figures are NumPy's and SciPy's.
#[test]
fn a_pendulum_by_hand() {
    let plant = plant(PENDULUM);
    let mut study = study(&plant, Tuning::from([("theta", 4.0)]));
    study.drift = vec![0.0, 0.1];
    study.noise = vec![0.01];
    let found = study.certificate();
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
    assert_safely(constant(&found, "η"), 0.078_899_853_457_099_75, false);
    assert_safely(constant(&found, "θ0"), 1.399_243_184_057_801, true);
    assert_safely(constant(&found, "ρ_min"), 1.0 / 0.65, true);
    assert_safely(found.rate.unwrap(), 0.279_866_040_234_261_3, false);
    assert_safely(constant(&found, "λ1"), 8.817_954_624_466_813, true);
    assert_safely(found.ultimate_bound.unwrap(), 1.980_352_701_167_238_8, true);
    for (bound, expected) in found
        .ultimate
        .iter()
        .zip([("angle", 0.275_973_92), ("speed", 1.961_029_12)])
    {
        assert!(
            bound.name == expected.0 && (bound.value - expected.1).abs() < 1e-7,
            "{bound:?}"
        );
    }
}

const THREE: &str = "model Three
  Real a1(min = -2, max = 2); Real a2(min = -2, max = 2); Real a3(min = -2, max = 2);
  Real b1(min = -2, max = 2); Real b2(min = -2, max = 2); Real c1(min = -2, max = 2); Real c2(min = -2, max = 2);
  output Real y = a1; output Real z = b1; output Real w = c1;
equation
  der(a1) = a2; der(a2) = a3 - 0.3*sin(a1); der(a3) = -a1 - 2*a2 - 2*a3 + 0.2*sin(b2) + 0.1*c2;
  der(b1) = b2 + 0.1*sin(a3); der(b2) = -b1 - b2 + 0.2*cos(a2) + 0.1*c2;
  der(c1) = c2 + 0.1*a2; der(c2) = -c1 - c2 + 0.2*a3 + 0.1*sin(b2);
end Three;";

/// Chains of 3, 2 and 2 states: δ = 1, 2, 2, windows (5/3, 7/3) behind the first chain and (3/5, 5/3) between the
/// others.
#[test]
fn three_chains_have_a_theorem_with_a_window_for_each_pair() {
    let plant = plant(THREE);
    let found = study(&plant, Tuning::from([("theta", 100.0)])).certificate();
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
    for (name, expected) in [
        ("(2n1−1)/(2n2−1)", 5.0 / 3.0),
        ("(2n1+1)/(2n3−1)", 7.0 / 3.0),
        ("(2n2−1)/(2n3+1)", 0.6),
        ("(2n2+1)/(2n3−1)", 5.0 / 3.0),
        ("δ3/δ1", 2.0),
        ("δ3/δ2", 1.0),
    ] {
        assert!((constant(&found, name) - expected).abs() < 1e-12, "{name}");
    }
    let θ0 = constant(&found, "θ0");
    assert!(1.0 < θ0 && θ0 < 100.0, "{θ0}");
    let above = study(&plant, Tuning::from([("theta", 1.001 * θ0)])).certificate();
    assert_eq!(above.verdict(), Standing::Proved);
    // (n₂δ₂ − n₃δ₃) outside
    let mut outside = Tuning::from([("theta", 100.0)]);
    outside
        .values
        .insert("delta".into(), list(&[1.0, 2.3, 1.3]));
    let found = study(&plant, outside).certificate();
    assert_eq!(found.verdict(), Standing::Undecided);
}

/// Below θ0 nothing is claimed, and nothing refuted: the theorem is sufficient.
#[test]
fn below_θ0_the_theorem_is_silent() {
    let plant = plant(PENDULUM);
    let found = study(&plant, Tuning::from([("theta", 1.3)])).certificate();
    assert_eq!((found.verdict(), found.rate), (Standing::Undecided, None));
    let check = hypothesis(&found, "at least θ0");
    assert!(
        check.reason.words().contains("θ0 = 1.39924"),
        "{}",
        check.reason.words()
    );
    let above = study(&plant, Tuning::from([("theta", 1.3993)])).certificate();
    assert_eq!(above.verdict(), Standing::Proved);
}

fn integrators(n: usize) -> Plant {
    let states: Vec<String> = (1..=n).map(|i| format!("Real x{i};")).collect();
    let equations: Vec<String> = (1..n).map(|i| format!("der(x{i}) = x{};", i + 1)).collect();
    plant(&format!(
        "model I {} output Real y = x1; equation {} der(x{n}) = 0; end I;",
        states.join(" "),
        equations.join(" ")
    ))
}

const PRINTED: (&[f64], &[f64]) = (
    &[1.5, 2.0, 4.0, 8.0, 10.5, 15.5, 17.5],
    &[-0.5, -1.5, -2.0, -3.0, -4.0, -5.0],
);

/// The eigenvalue is NumPy's for the 6×6 matrix on the kernel of C.
#[test]
fn the_printed_matrix_is_refuted_with_its_direction() {
    let plant = integrators(7);
    let mut tuning = Tuning::from([("theta", 3.5), ("r", 1.0)]);
    tuning.values.insert("S".into(), matrices(&[PRINTED]));
    let found = study(&plant, tuning).certificate();
    assert_eq!((found.verdict(), found.rate), (Standing::Refuted, None));
    let check = hypothesis(&found, "Lemma 1");
    let Verdict::Refuted(witness) = &check.verdict else {
        panic!("{check:?}")
    };
    let point = &witness.points[0];
    assert!(
        (point.value - 8.747_348_170_830_902).abs() < 1e-9,
        "{point:?}"
    );
    assert_eq!(point.coordinates.len(), 6);
    assert!(
        point
            .coordinates
            .iter()
            .all(|c| c.name.starts_with('a') && c.value == 1.0)
    );
    assert!(
        check.reason.words().contains("for no ρ") && check.reason.words().contains("·x"),
        "{}",
        check.reason.words()
    );
}

/// Integrators need no box and no θ0; the gain of the same chain by Lemma 1 is proved.
#[test]
fn linear_chains_need_no_box() {
    let plant = integrators(5);
    let found = study(&plant, Tuning::from([("theta", 1.0)])).certificate();
    assert_eq!(
        (found.verdict(), constant(&found, "θ0")),
        (Standing::Proved, 0.0)
    );
}

/// Other gains of the family are other observers: nothing is claimed for them.
#[test]
fn other_gains_are_not_covered() {
    let plant = plant(PENDULUM);
    let mut tuning = Tuning::default();
    let gain = Value::Text("lmi".into());
    tuning.values.insert("gain".into(), gain);
    let found = study(&plant, tuning).certificate();
    assert_eq!((found.verdict(), found.rate), (Standing::Undecided, None));
    assert!(
        hypothesis(&found, "constant gain")
            .reason
            .words()
            .contains("'gain'")
    );
}

/// What lacks a bound is named, what is known is said.
#[test]
fn a_missing_box_is_named() {
    let free = plant(
        "model Free Real a; Real b; Real c(min = 0, max = 1); output Real y = a;
         equation der(a) = b + b^3; der(b) = c; der(c) = -a*b; end Free;",
    );
    let found = study(&free, Tuning::from([("theta", 1.0)])).certificate();
    assert_eq!(found.verdict(), Standing::Undecided, "{found:?}");
    let lemma = hypothesis(&found, "Lemma 1");
    assert!(
        lemma.reason.words().contains("declare min and max of b"),
        "{}",
        lemma.reason.words()
    );
    let slopes = hypothesis(&found, "every ∂f/∂x");
    assert!(
        slopes.reason.words().contains("declare min and max of"),
        "{}",
        slopes.reason.words()
    );
    assert!(
        found.notes[0].words().contains("1 of 2 partials"),
        "{}",
        found.notes[0].words()
    );
}

#[test]
fn a_varying_gain_is_not_covered_a_scaled_one_is() {
    let text = |f: &str| {
        format!(
            "model G Real a(min = 0, max = 1); Real b(min = 0, max = 1); output Real y = a;
          equation der(a) = {f}; der(b) = -a; end G;"
        )
    };
    let mut tuning = Tuning::from([("theta", 20.0)]);
    tuning.values.insert("partials".into(), Value::Flag(true));
    let varying = plant(&text("b + b^2"));
    let found = study(&varying, tuning.clone()).certificate();
    assert_eq!(found.verdict(), Standing::Undecided, "{found:?}");
    assert!(
        hypothesis(&found, "gain is constant")
            .reason
            .words()
            .contains("vary on the box")
    );
    let scaled = plant(&text("-3*b"));
    assert_eq!(
        study(&scaled, tuning).certificate().verdict(),
        Standing::Proved
    );
}

fn column(own: bool) -> Certificate {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/column/column.mo"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let plant = Plant::from_modelica(&text, "column.mo", &LoadOptions::default()).unwrap();
    let mut tuning = Tuning::from([("theta", 3.5)]);
    if !own {
        tuning.values.insert("r".into(), Value::Number(1.0));
        tuning.values.insert(
            "S".into(),
            matrices(&[PRINTED, (&PRINTED.0[..6], &PRINTED.1[..5])]),
        );
    }
    let mut study = study(&plant, tuning);
    study.unknown = &["Zf"];
    study.drift = vec![0.0; 13];
    study.certificate()
}

/// Over the actual box the printed matrices fail by more than with a = 1.
#[test]
fn the_column_of_the_paper() {
    let found = column(false);
    assert_eq!(found.verdict(), Standing::Refuted);
    let broken: Vec<f64> = found
        .hypotheses
        .iter()
        .filter_map(|c| match &c.verdict {
            Verdict::Refuted(witness) => Some(witness.points[0].value),
            _ => None,
        })
        .collect();
    // NumPy over the 2⁶ and 2⁴ vertices; the enclosures of the partials are a little wider
    for (found, exact) in broken
        .iter()
        .zip([252.023_823_373_142_82, 59.405_290_827_014_504])
    {
        assert!((found / exact - 1.0).abs() < 1e-3, "{broken:?}");
    }
    assert_eq!(broken.len(), 2);
    let window = [
        constant(&found, "(2n1−1)/(2n2−1)"),
        constant(&found, "δ2/δ1"),
        constant(&found, "(2n1+1)/(2n2−1)"),
    ];
    assert_eq!(window, [13.0 / 11.0, 14.0 / 11.0, 15.0 / 11.0]);
    let own = column(true);
    assert_eq!(own.verdict(), Standing::Undecided);
    assert!(constant(&own, "η of chain 1") > 7e-6 && constant(&own, "η of chain 2") > 1.9e-3);
    let θ0 = constant(&own, "θ0");
    assert!((1e7..3e7).contains(&θ0), "{θ0}");
}

/// Twenty plants of two to four states with random partials and nonlinearities:
/// from random starts the error stays below λ1 e^{−σt}|e(0)|.
#[test]
fn simulations_keep_the_guarantee() {
    let mut random = numbers(7);
    for _ in 0..20 {
        let n = 2 + (3.0 * random()) as usize;
        let mut states = String::new();
        let mut equations = String::new();
        for i in 1..=n {
            states += &format!("Real x{i};");
            let next = match i < n {
                true => format!(
                    "{}*x{1} + {2}*sin(x{1})",
                    1.0 + random(),
                    i + 1,
                    0.5 * random()
                ),
                false => "0".into(),
            };
            equations += &format!(
                "der(x{i}) = {next} + {}*cos(x1) - {}*atan(x{i});",
                2.0 * random() - 1.0,
                random()
            );
        }
        let plant = plant(&format!(
            "model R {states} output Real y = x1; equation {equations} end R;"
        ));
        let probe = study(&plant, Tuning::from([("theta", 1.0)])).certificate();
        let θ = 1.2 * constant(&probe, "θ0");
        let mut tuning = Tuning::from([("theta", θ)]);
        let values = (1..=n)
            .map(|i| (format!("x{i}"), 4.0 * random() - 2.0))
            .collect();
        tuning.initial = Initial {
            default: None,
            values,
        };
        let found = study(&plant, tuning.clone()).certificate();
        assert_eq!(found.verdict(), Standing::Proved);
        let (σ, λ1) = (found.rate.unwrap(), constant(&found, "λ1"));
        let design = design_with(TRIANGULAR, &plant, &[], &tuning).unwrap();
        let x0: Vec<f64> = (0..n).map(|_| 4.0 * random() - 2.0).collect();
        let rows: Vec<f64> = (0..=40)
            .map(|k| k as f64 * 4.0 / σ.max(0.5) / 40.0)
            .collect();
        let run = run(&plant, &design, &[], &x0, &rows, 0.02 / θ);
        let error = |row: &[f64]| {
            (1..=n)
                .map(|i| (row[i] - row[n + i]).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let start = error(&run.rows[0]);
        for row in &run.rows {
            let bound = λ1 * (-σ * row[0]).exp() * start;
            assert!(
                error(row) <= bound * (1.0 + 1e-6) + 1e-9,
                "t = {}: {} above {bound}",
                row[0],
                error(row)
            );
        }
    }
}

/// Two chains of two, tied through their ends: for the weight c that was found, θ0 is
/// where NumPy's largest eigenvalue of the 4×4 comparison matrix crosses zero (SciPy's
/// brentq); the best of 601 weights in [1e-3, 1e3] gives 2.58624, c = 1 gives 2.59894.
#[test]
fn two_chains_against_numpy() {
    let plant = plant(
        "model Two Real a; Real b; Real c; Real d; output Real y = a; output Real z = c;
         equation der(a) = b; der(b) = 0.3*sin(c) + 0.2*d; der(c) = d + 0.1*sin(b); der(d) = -0.4*a; end Two;",
    );
    let found = study(&plant, Tuning::from([("theta", 50.0)])).certificate();
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
    assert!((constant(&found, "c of V") - 1.154_781_984_689_458_3).abs() < 1e-12);
    assert_safely(constant(&found, "θ0"), 2.5862169279122824, true);
}
