//! Theorem 1 of Ltaief et al. against independent computations.

use crate::common::{
    Guaranteed, assert_safely, constant, design_with, hypothesis, numbers, plant, run,
};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Initial, Ltaief, Tuning, state_affine::STATE_AFFINE};
use lynkeus_structure::Standing;
use lynkeus_words::Words;

fn study<'a>(plant: &'a Plant, tuning: Tuning) -> Guaranteed<'a> {
    Guaranteed {
        family: STATE_AFFINE,
        plant,
        unknown: &[],
        tuning,
        drift: vec![0.0; plant.states.len()],
        noise: vec![0.0; plant.outputs.len()],
    }
}

const PENDULUM: &str = "model Pendulum
  Real angle; Real speed; output Real y = angle;
equation
  der(angle) = speed; der(speed) = -0.5*sin(angle);
end Pendulum;";

/// C and F are numbers, so A4 is proved: λ_m of ∫₀¹⁰ e^{−s}(Ce^{−Fs})ᵀCe^{−Fs} ds, λ_M of
/// [1, 1; 1, 2], L = 0.5/θ, θ0² = √(λ_M/λ_m). SciPy's figures.
#[test]
fn a_pendulum_by_hand() {
    let plant = plant(PENDULUM);
    let mut study = study(&plant, Tuning::from([("theta", 4.0)]));
    study.drift = vec![0.0, 0.1];
    study.noise = vec![0.01];
    let found = study.certificate();
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
    assert_safely(constant(&found, "λ_M"), 2.618_033_988_749_895, true);
    assert_safely(constant(&found, "λ_m"), 0.3808467174576985, false);
    assert_safely(constant(&found, "θ0"), 1.6192215156133203, true);
    assert_safely(found.rate.unwrap(), 1.6722652104218627, false);
    assert_safely(found.ultimate_bound.unwrap(), 0.18408116959964893, true);
    let below = study_at(&plant, 1.0);
    assert_eq!((below.verdict(), below.rate), (Standing::Undecided, None));
}

fn study_at(plant: &Plant, θ: f64) -> lynkeus_observers::Certificate {
    study(plant, Tuning::from([("theta", θ)])).certificate()
}

/// A4 stays open; the constants hold while the monitor is above its alarm. NumPy's
/// figures: λ_M of [1, 4, 16; 4, 32, 128; 16, 128, 512] and L, with |u1|, |u2| ≤ 1, |u3| ≤ 5,
/// x1 ≤ 4 and |x2|, |x3| ≤ 2.
#[test]
fn the_example_of_the_paper() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/ltaief/ltaief.mo"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let plant = Plant::from_modelica(&text, "ltaief.mo", &LoadOptions::default()).unwrap();
    let close = |found: f64, exact: f64| {
        assert!(
            (-1e-14..1e-5).contains(&(found / exact - 1.0)),
            "{found} against {exact}"
        );
    };
    for (alarm, θ0) in [(1e-6, 1328208.743255971), (0.005, 18783.708184359228)] {
        let tuning = Tuning::from([("theta", 10.0), ("alarm", alarm)]);
        let found = study(&plant, tuning).certificate();
        assert_eq!((found.verdict(), found.rate), (Standing::Undecided, None));
        close(constant(&found, "λ_M"), 544.5004595584355);
        close(constant(&found, "L"), 28.463402635597934);
        // λ_m falls like θ⁻² here: no θ0 follows, only what λ_min(S) would have to be at this θ
        assert!(!found.constants.iter().any(|c| c.name == "θ0"));
        let needed = 544.5004595584355 * (2.0 * 28.463402635597934_f64 / 10.0).powi(2);
        close(constant(&found, "λ_m needed"), needed);
        assert!(hypothesis(&found, "A4").reason.words().contains("(12)"));
        assert!(constant(&found, "μ_θ") < 0.0);
        assert!(
            hypothesis(&found, "A4")
                .reason
                .words()
                .contains("monitor 'excitation'")
        );
        let tuning = Tuning::from([("theta", 1.01 * θ0), ("alarm", alarm)]);
        let fast = study(&plant, tuning).certificate();
        assert!(constant(&fast, "θμ_θ") > 0.0 && fast.verdict() == Standing::Undecided);
        assert_eq!(fast.weakest().unwrap().statement, Ltaief::A4.into());
    }
}

#[test]
fn what_is_missing_is_said() {
    let free = plant(
        "model Free input Real u; Real a; Real b; output Real y = a;
         equation der(a) = u*b; der(b) = -b; end Free;",
    );
    let found = study_at(&free, 5.0);
    assert_eq!(found.verdict(), Standing::Undecided);
    assert!(
        hypothesis(&found, "A1")
            .reason
            .words()
            .contains("declare min and max of u")
    );
}

/// Twenty plants of two or three states with numbers in F: from random starts the
/// error stays below the curve that starts where the memory of S(0) is gone, t = 10/θ.
#[test]
fn simulations_keep_the_guarantee() {
    let mut random = numbers(3);
    for _ in 0..20 {
        let n = 2 + (2.0 * random()) as usize;
        let (mut states, mut equations) = (String::new(), String::new());
        for i in 1..=n {
            states += &format!("Real x{i};");
            let next = match i < n {
                true => format!("{}*x{}", 1.0 + random(), i + 1),
                false => "0".into(),
            };
            equations += &format!(
                "der(x{i}) = {next} + {}*sin(x1) - {}*atan(x{i});",
                random() - 0.5,
                0.5 * random()
            );
        }
        let plant = plant(&format!(
            "model R {states} output Real y = x1; equation {equations} end R;"
        ));
        let θ = 1.2 * constant(&study_at(&plant, 1.0), "θ0");
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
        let (σ, ratio) = (found.rate.unwrap(), constant(&found, "η√α(θ)"));
        let design = design_with(STATE_AFFINE, &plant, &[], &tuning).unwrap();
        let x0: Vec<f64> = (0..n).map(|_| 4.0 * random() - 2.0).collect();
        let rows: Vec<f64> = (0..=30).map(|k| k as f64 * 10.0 / θ / 5.0).collect();
        let run = run(&plant, &design, &[], &x0, &rows, 0.01 / θ);
        let scaled = |row: &[f64]| {
            let e = |i: usize| (row[1 + i] - row[1 + n + i]) / θ.powi(i as i32);
            (0..n).map(|i| e(i).powi(2)).sum::<f64>().sqrt()
        };
        let from = &run.rows[5];
        for row in &run.rows[5..] {
            let bound = ratio * (-σ * (row[0] - from[0])).exp() * scaled(from);
            assert!(
                scaled(row) <= bound * (1.0 + 1e-6) + 1e-9,
                "t = {}: {} above {bound}",
                row[0],
                scaled(row)
            );
        }
    }
}

/// An unknown input is taken as constant, and the certificate says so; with a bound of its
/// rate the error is allowed for.
#[test]
fn an_unknown_input_is_said_to_be_constant() {
    let text = "model Pushed Real place; input Real force; output Real y = place;
      equation der(place) = force; end Pushed;";
    let plant = plant(text);
    let of = |slew: f64| {
        let mut study = study(&plant, Tuning::from([("theta", 4.0)]));
        study.unknown = &["force"];
        study.drift = vec![0.0, slew];
        study.certificate()
    };
    let still = of(0.0);
    assert_eq!(still.verdict(), Standing::Proved);
    let bounded = hypothesis(&still, "(A3)");
    assert!(
        bounded.reason.words().contains("takes force as constant"),
        "{}",
        bounded.reason.words()
    );
    assert_eq!(still.ultimate_bound, Some(0.0));
    let moving = of(0.5);
    assert!(
        !hypothesis(&moving, "(A3)")
            .reason
            .words()
            .contains("constant")
    );
    assert!(moving.ultimate_bound.unwrap() > 0.0);
}
