//! Independent trajectories and measured data.

use crate::{Folder, csv, examples, run, shared};

/// The paper's column at θ = 3.5 against an independent integration, every row
/// and column to 1e-6 relative.
#[test]
fn the_column_follows_its_reference() {
    let Some(path) = shared("reference/hammouri_theta3.5.csv") else {
        return;
    };
    let (names, expected) = csv(&std::fs::read_to_string(path).unwrap());
    let ended = run(&examples().join("column"), &["simulate", "study.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&ended.out);
    let plain: Vec<String> = header.iter().map(|n| n.replace(['[', ']'], "")).collect();
    for row in &expected {
        let found = rows.iter().find(|r| (r[0] - row[0]).abs() < 1e-9).unwrap();
        for (name, value) in names.iter().zip(row) {
            let x = found[plain.iter().position(|n| n == name).unwrap()];
            assert!(
                (x - value).abs() <= 1e-6 * value.abs(),
                "{name} at t = {}: {x} against {value}",
                row[0]
            );
        }
    }
}

/// The pump of the measured tanks, rebuilt from the lower level alone.
#[test]
fn the_hidden_pump_of_the_measured_tanks() {
    for file in ["estimation.csv", "validation.csv"] {
        let Some(path) = shared(&format!("data/cascaded-tanks/{file}")) else {
            return;
        };
        let (header, log) = csv(&std::fs::read_to_string(&path).unwrap());
        let u = header.iter().position(|n| n == "u").unwrap();
        let pump: Vec<f64> = log.iter().map(|row| row[u]).collect();
        let folder = Folder::new();
        folder.change(
            "study.toml",
            "[estimate]",
            "[estimate]\ncolumns = { level = \"y\", pump = \"u\" }",
        );
        // the measured levels go further, and their noise wants a slower observer
        folder.change("study.toml", "theta = 0.09", "theta = 0.03");
        folder.change("study.toml", "[2, 8]", "[0.05, 10]");
        folder.change("study.toml", "[1, 10]", "[0.05, 10]");
        let path = path.canonicalize().unwrap();
        let ended = folder.run(&["estimate", "study.toml", path.to_str().unwrap()]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let hat: Vec<f64> = csv(&ended.out).1.iter().map(|row| row[3]).collect();
        let best = (0..60)
            .map(|lag| correlation(&hat[lag..], &pump))
            .fold(-1.0, f64::max);
        assert!(best >= 0.84, "{file}: {best}");
    }
}

/// Pearson's correlation over the shorter of the two.
pub fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len());
    let mean = |v: &[f64]| v[..n].iter().sum::<f64>() / n as f64;
    let (mx, my) = (mean(x), mean(y));
    let pairs = || x.iter().zip(y).take(n);
    let covariance: f64 = pairs().map(|(x, y)| (x - mx) * (y - my)).sum();
    let vx: f64 = pairs().map(|(x, _)| (x - mx).powi(2)).sum();
    let vy: f64 = pairs().map(|(_, y)| (y - my).powi(2)).sum();
    covariance / (vx * vy).sqrt()
}
