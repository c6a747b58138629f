//! What scatters, and what is said of it.

use crate::{Folder, csv};

fn column(table: &str, name: &str) -> Vec<f64> {
    let (names, rows) = csv(table);
    let place = names.iter().position(|n| n == name).unwrap();
    rows.iter().map(|row| row[place]).collect()
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|v| (v - mean).powi(2));
    (squares.sum::<f64>() / values.len() as f64).sqrt()
}

/// x' = −ax + w with density 1 scatters with 1/√(2a), and an oscillator q'' = −ω²q − 2dq' + w with
/// 1/√(4dω²), however far apart the samples are; alone and among many runs.
#[test]
fn simulated_noise_is_white_for_fast_states() {
    let folder = Folder::empty();
    folder.write(
        "model.mo",
        "model M\n  Real x(start = 0);\n  Real q(start = 0);\n  Real p(start = 0);\n  output Real y = x;\nequation\n  der(x) = -5*x;\n  der(q) = p;\n  der(p) = -49*q - p;\nend M;\n",
    );
    for step in [1.0, 0.3] {
        folder.write(
            "study.toml",
            &format!(
                "plant = \"model.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 10 }}\n[process_noise]\nx = 1\np = 4\n[observer]\nfamily = \"ekf\"\n[simulate]\nuntil = {}\noutput_step = {step}\n",
                2000.0 * step
            ),
        );
        let ended = folder.run(&["simulate", "study.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        for (name, expected) in [("x", 0.1_f64.sqrt()), ("q", (4.0_f64 / 98.0).sqrt())] {
            let found = deviation(&column(&ended.out, name));
            assert!(
                (found / expected - 1.0).abs() < 0.07,
                "{name} every {step}: {found} for {expected}"
            );
        }
    }
}

/// A stiff mode that no noise moves needs no draws of its own.
#[test]
fn a_stiff_mode_at_rest_costs_no_draws() {
    let folder = Folder::empty();
    folder.write(
        "model.mo",
        "model M\n  Real x(start = 0);\n  Real z(start = 0);\n  output Real y = x;\nequation\n  der(x) = z - x;\n  der(z) = -1e11*z;\nend M;\n",
    );
    folder.write(
        "study.toml",
        "plant = \"model.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = { y = 1 }\n[process_noise]\nx = 1\n[observer]\nfamily = \"ekf\"\n[simulate]\nuntil = 10\noutput_step = 0.5\nmethod = \"stiff\"\n[estimate]\nmethod = \"stiff\"\n",
    );
    let ended = folder.run(&["simulate", "study.toml", "-o", "o.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(!ended.err.contains("a draw is held"), "{}", ended.err);
}

/// x moves by 0.2 between samples: the row's estimate has not seen the row's reading.
#[test]
fn a_family_counts_what_the_plant_does_between_samples() {
    let folder = Folder::empty();
    folder.write(
        "model.mo",
        "model M\n  Real x(start = 0, min = -5, max = 5);\n  output Real y = x;\nequation\n  der(x) = -0.01*x;\nend M;\n",
    );
    folder.write(
        "study.toml",
        "plant = \"model.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = { y = 0.001 }\n[process_noise]\nx = 0.04\n[observer]\nfamily = \"triangular\"\ntheta = 1.9\nS = [{ diag = [1], off = [] }]\n[estimate]\nsd = true\nbetween_samples = \"hold\"\n",
    );
    let rows: String = (0..60).map(|t| format!("{t},0\n")).collect();
    folder.write("log.csv", &format!("t,y\n{rows}"));
    let told = |folder: &Folder| {
        let ended = folder.run(&["estimate", "study.toml", "log.csv"]);
        *column(&ended.out, "x_sd").last().unwrap()
    };
    // a = exp(−(0.01 + θ))
    let a = (-1.91_f64).exp();
    let exact = (0.04 * (1.0 - (-0.02_f64).exp()) / 0.02 / (1.0 - a * a)).sqrt();
    for between in ["hold", "predict"] {
        folder.change(
            "study.toml",
            "between_samples = \"hold\"",
            &format!("between_samples = \"{between}\""),
        );
        let found = told(&folder);
        assert!(
            (found / exact - 1.0).abs() < 0.01,
            "{between}: {found} for {exact}"
        );
        folder.change(
            "study.toml",
            &format!("between_samples = \"{between}\""),
            "between_samples = \"hold\"",
        );
    }
}

/// What a held reading falls behind by is part of the error: x rises by 3 per second, and is read
/// every half.
#[test]
fn a_held_reading_that_lags_makes_the_deviation_larger() {
    let folder = Folder::empty();
    folder.write(
        "model.mo",
        "model M\n  Real x(start = 0, min = -500, max = 500);\n  output Real y = x;\nequation\n  der(x) = 3;\nend M;\n",
    );
    folder.write(
        "study.toml",
        "plant = \"model.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = { y = 0.01 }\n[observer]\nfamily = \"triangular\"\ntheta = 2\nS = [{ diag = [1], off = [] }]\ninitial = { x = 0 }\n[estimate]\nsd = true\n",
    );
    let rows: String = (0..80)
        .map(|k| {
            format!(
                "{},{},{}\n",
                0.5 * f64::from(k),
                1.5 * f64::from(k),
                1.5 * f64::from(k)
            )
        })
        .collect();
    folder.write("log.csv", &format!("t,y,x\n{rows}"));
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "o.csv", "--json"]);
    let table = folder.read("o.csv");
    let last = |name: &str| *column(&table, name).last().unwrap();
    let error = (last("x_hat") - 1.5 * 79.0).abs();
    assert!(
        error > 0.3 && (last("x_sd") / error - 1.0).abs() < 0.02,
        "{error} {}",
        last("x_sd")
    );
    let told = &ended.json()["errors"]["x"];
    assert_eq!(told["within_2_sd"], 1.0, "{told}");
    assert!(
        (told["rms_in_sd"].as_f64().unwrap() - 1.0).abs() < 0.1,
        "{told}"
    );
}

const WINDOW: &str = "plant = \"model.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = { y = 0.151 }\n[process_noise]\nx0 = 0.0022\nx1 = 0.0029\nx2 = 0.0016\n[observer]\nfamily = \"mhe\"\nhorizon = 20\ninitial = { x0 = -0.024, x1 = 0.288, x2 = -0.067 }\ninitial_variance = { x0 = 0.261, x1 = 0.546, x2 = 0.207 }\n[estimate]\nrtol = 1e-11\natol = 1e-13\n";

/// Bounds that are met and let go in circles: the minimum by SciPy's `lsq_linear` (bvls).
#[test]
fn a_window_whose_bounds_go_round_is_at_its_minimum() {
    let folder = Folder::empty();
    folder.write(
        "model.mo",
        "model M\n Real x0(start = -0.024, min = -0.4, max = 0.4);\n Real x1(start = 0.288, min = -0.4, max = 0.4);\n Real x2(start = -0.067, min = -0.4, max = 0.4);\n output Real y = -0.54*x0 - 1.11*x1 + 0.57*x2;\nequation\n der(x0) = -0.98*x0 + 0.48*x1;\n der(x1) = -1.53*x0 + 0.37*x1 + 0.04*x2;\n der(x2) = -0.35*x0 + 0.41*x1 - 0.27*x2;\nend M;\n",
    );
    folder.write("study.toml", WINDOW);
    folder.write("log.csv", "t,y\n0.0,-0.377\n0.2,0.093\n");
    let ended = folder.run(&["estimate", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    for (name, expected) in [("x0_hat", 0.3182), ("x1_hat", -0.1696), ("x2_hat", -0.1346)] {
        let found = column(&ended.out, name);
        assert!((found[1] - expected).abs() < 1e-4, "{name}: {found:?}");
    }
}
