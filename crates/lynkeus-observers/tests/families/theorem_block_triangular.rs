//! Theorem 1 of Lee, Yee and Park against independent computations.

use crate::common::{
    Guaranteed, assert_safely, constant, design_with, hypothesis, numbers, plant, run,
};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Tuning, Value, block_triangular::BLOCK_TRIANGULAR};
use lynkeus_structure::Standing;
use lynkeus_words::Words;

fn study<'a>(plant: &'a Plant, tuning: Tuning) -> Guaranteed<'a> {
    Guaranteed {
        family: BLOCK_TRIANGULAR,
        plant,
        unknown: &[],
        tuning,
        drift: vec![0.0; plant.states.len()],
        noise: vec![0.0; plant.outputs.len()],
    }
}

fn tuning(θ: &[f64], correction: &str) -> Tuning {
    let mut tuning = Tuning::default();
    let θ = θ.iter().map(|&x| Value::Number(x)).collect();
    tuning.values.insert("theta".into(), Value::List(θ));
    tuning
        .values
        .insert("correction".into(), Value::Text(correction.into()));
    tuning
}

fn lee() -> Plant {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/lee/lee.mo");
    let text = std::fs::read_to_string(path).unwrap();
    Plant::from_modelica(&text, "lee.mo", &LoadOptions::default()).unwrap()
}

/// NumPy and SciPy: the roots of the largest eigenvalue of the 4×4 comparison matrix
/// along θ2 = θ1², and norms at θ = (3, 9), from bounds by hand: |x1|, |x3| ≤ 6, |x2|,
/// |x4| ≤ 8, |u| ≤ 2; for (7) |M_21| ≤ 35, R widths, |y − x̂_1| ≤ 12.
#[test]
fn the_example_of_the_paper() {
    let plant = lee();
    let classical = study(&plant, tuning(&[3.0, 9.0], "classical")).certificate();
    assert_eq!(
        (classical.verdict(), classical.rate),
        (Standing::Undecided, None)
    );
    let close = |found: f64, exact: f64| {
        assert!(
            (0.0..2e-5).contains(&(found / exact - 1.0)),
            "{found} against {exact}"
        );
    };
    close(constant(&classical, "θ0"), 114.460_223_368_070_03);
    close(constant(&classical, "μ11"), 162.684_486_406_835_28);
    close(constant(&classical, "μ21"), 0.756_834_466_383_139_7);
    close(constant(&classical, "μ22"), 125.036_255_847_102_35);
    let seven = study(&plant, tuning(&[3.0, 9.0], "lee")).certificate();
    assert_eq!(seven.verdict(), Standing::Undecided);
    close(constant(&seven, "θ0"), 1_373.924_083_437_994_3);
    assert!(
        seven
            .notes
            .iter()
            .any(|n| n.words().contains("moves with the correction"))
    );
    // from θ0 on the decay is proved
    let fast = study(&plant, tuning(&[115.0, 115.0 * 115.0], "classical")).certificate();
    assert_eq!(fast.verdict(), Standing::Proved, "{fast:#?}");
    assert!(fast.rate.unwrap() > 0.0);
}

const PENDULUM: &str = "model Pendulum
  Real angle(min = -1, max = 1); Real speed(min = -1, max = 1); output Real y = angle;
equation
  der(angle) = speed; der(speed) = -0.5*sin(angle);
end Pendulum;";

/// P = [½, −½; −½, 3/2] and μ = 2/3. The classical observer has L_21 = 0.5 and θ0 = 3/2;
/// for (7) M = I, and the width ½(1 − cos 1) of F_21 stands in its place. SciPy's figures.
#[test]
fn a_pendulum_by_hand() {
    let plant = plant(PENDULUM);
    let certificate = |correction: &str| {
        let mut study = study(&plant, tuning(&[4.0], correction));
        study.drift = vec![0.0, 0.1];
        study.noise = vec![0.01];
        study.certificate()
    };
    let classical = certificate("classical");
    assert_eq!(classical.verdict(), Standing::Proved);
    assert_safely(constant(&classical, "θ0"), 1.5, true);
    assert_safely(classical.rate.unwrap(), 0.734_728_701_687_525_7, false);
    assert_safely(
        classical.ultimate_bound.unwrap(),
        0.472_290_033_578_402_5,
        true,
    );
    assert_safely(constant(&classical, "μ11"), 0.426_776_695_296_636_87, true);
    let seven = certificate("lee");
    assert_safely(constant(&seven, "θ0"), 1.017_015_148_263_136, true);
    assert_safely(seven.rate.unwrap(), 0.795_021_825_562_789_7, false);
}

/// What is missing is said: with an input in M, a bound of its derivative.
#[test]
fn an_input_in_m_needs_a_bound_of_its_derivative() {
    let plant = plant(
        "model U input Real u(min = 0, max = 1); Real a(min = -1, max = 1); Real b(min = -1, max = 1);
         output Real y = a; equation der(a) = b; der(b) = -u*b; end U;",
    );
    let found = study(&plant, tuning(&[50.0], "lee")).certificate();
    assert_eq!(found.verdict(), Standing::Undecided);
    assert!(
        hypothesis(&found, "Ṁ M⁻¹").reason.words().contains(
            "where M depends on an input, bound its derivative under `input_derivatives`"
        )
    );
    let classical = study(&plant, tuning(&[50.0], "classical")).certificate();
    assert_eq!(classical.verdict(), Standing::Proved);
}

/// Without a box the classical observer of a plant with bounded slopes is covered,
/// and a plant without them is told which variables lack a range.
#[test]
fn without_a_box() {
    let text = |f: &str| {
        format!(
            "model N Real a; Real b; output Real y = a; equation der(a) = b; der(b) = {f}; end N;"
        )
    };
    let bounded = plant(&text("sin(a) + cos(b)"));
    let found = study(&bounded, tuning(&[20.0], "classical")).certificate();
    assert_eq!(found.verdict(), Standing::Proved);
    let cubic = plant(&text("-b^3"));
    let found = study(&cubic, tuning(&[20.0], "classical")).certificate();
    assert!(
        hypothesis(&found, "every ∂f/∂x")
            .reason
            .words()
            .contains("declare min and max of b")
    );
}

/// Where M depends on the second state, the correction moves it by θ²e_1 and the bound
/// of Ṁ keeps pace with the decay: no θ0 exists for that bound.
#[test]
fn a_transformation_that_moves_too_fast() {
    let plant = plant(
        "model F Real a(min = -2, max = 2); Real b(min = -2, max = 2); output Real y = a;
         equation der(a) = b; der(b) = -b^3; end F;",
    );
    let found = study(&plant, tuning(&[50.0], "lee")).certificate();
    assert_eq!(found.verdict(), Standing::Undecided);
    assert!(
        hypothesis(&found, "large enough")
            .reason
            .words()
            .contains("no θ0")
    );
    assert!(found.constants.iter().all(|c| c.name != "θ0"));
}

/// From random starts the error of both observers stays below λ1 e^{−σt}|e(0)|, for
/// twenty plants of two coupled chains whose states stay in their box.
#[test]
fn simulations_keep_the_guarantee() {
    let mut random = numbers(11);
    for case in 0..20 {
        let x = "(min = -2, max = 2)";
        let plant = plant(&format!(
            "model R Real a{x}; Real b{x}; Real c{x}; Real d{x}; output Real y = a; output Real z = c;
             equation der(a) = b - 0.1*a; der(b) = -a + {}*b*sin(a) + {}*sin(c) - 0.5*b;
             der(c) = d + {}*sin(a) - 0.1*c; der(d) = -c + {}*cos(c)*b - 0.6*d; end R;",
            0.3 * random(), 0.2 * random(), 0.2 * random(), 0.4 * random()
        ));
        let correction = if case % 2 == 0 { "classical" } else { "lee" };
        let probe = study(&plant, tuning(&[4.0, 16.0], correction)).certificate();
        let θ = 1.1 * constant(&probe, "θ0").max(2.0);
        let mut tuning = tuning(&[θ, θ * θ], correction);
        let start = |x: f64| 0.5 * x - 0.25;
        let hats = ["a", "b", "c", "d"].map(|n| (n.to_owned(), start(random())));
        tuning.initial.values = hats.into_iter().collect();
        let found = study(&plant, tuning.clone()).certificate();
        assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
        let (σ, λ1) = (found.rate.unwrap(), constant(&found, "λ1"));
        let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &tuning).unwrap();
        let x0: Vec<f64> = (0..4).map(|_| start(random())).collect();
        let rows: Vec<f64> = (0..=20).map(|k| k as f64 * 3.0 / σ / 20.0).collect();
        let run = run(&plant, &design, &[], &x0, &rows, 0.2 / (θ * θ));
        let error = |row: &[f64]| {
            (1..=4)
                .map(|i| (row[i] - row[4 + i]).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let initial = error(&run.rows[0]);
        for row in &run.rows {
            let bound = λ1 * (-σ * row[0]).exp() * initial;
            assert!(
                error(row) <= bound * (1.0 + 1e-6) + 1e-9,
                "{correction}, t = {}: {} above {bound}",
                row[0],
                error(row)
            );
        }
    }
}
