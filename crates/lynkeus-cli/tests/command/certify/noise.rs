//! What Gaussian noise leaves of the error, in mean square and in probability.

use serde_json::Value;

use crate::Folder;

/// e' = −(0.5 + k) e + k ν − w.
fn certified(noise: &str) -> (Value, f64) {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M\n  Real a(start = 0, min = -1, max = 1);\n  output Real y = a;\nequation\n  der(a) = -0.5*a;\nend M;\n",
    );
    let study =
        format!("plant = \"m.mo\"\n{noise}\n[observer]\nfamily = \"triangular\"\ntheta = 2\n");
    folder.write("study.toml", &study);
    let report = folder.run(&["certify", "study.toml", "--json"]).json();
    let k = report["gain"]["a"]["y"].as_f64().unwrap();
    assert!(k > 0.5, "{k}");
    (report["certificate"].clone(), k)
}

/// A little above what the formula gives.
#[track_caller]
fn near(found: &Value, exact: f64) {
    let found = found.as_f64().unwrap();
    assert!((exact..1.01 * exact).contains(&found), "{found} {exact}");
}

#[test]
fn bounds_of_a_scalar_are_those_of_the_formulas() {
    let (sd, q) = (0.05, 0.04);
    let (both, k) = certified("[sensors]\nnoise = { y = 0.05 }\n[process_noise]\na = 0.04");
    let (rate, push) = (0.5 + k, k * sd);
    assert!(both["ultimate_bound"].is_null());
    let mean_square = (push + (push * push + 2.0 * rate * q).sqrt()) / (2.0 * rate);
    near(&both["mean_square_bounds"]["a"], mean_square);
    let process = (q / (2.0 * rate)).sqrt() + (q * 100_f64.ln() / rate).sqrt();
    near(
        &both["probable_bounds"]["a"],
        process + 2.8920 * push / rate,
    );

    let (readings, _) = certified("[sensors]\nnoise = { y = 0.05 }");
    near(&readings["ultimate_bounds"]["a"], 3.0 * push / rate);
    near(&readings["mean_square_bounds"]["a"], push / rate);
    near(&readings["probable_bounds"]["a"], 2.8920 * push / rate);

    // a uniform noise counts with its root mean square beside process noise, and with its bound in probability
    let (uniform, _) =
        certified("[sensors]\nnoise = { y = { uniform = 0.05 } }\n[process_noise]\na = 0.04");
    let usual = push / 3_f64.sqrt();
    let mean_square = (usual + (usual * usual + 2.0 * rate * q).sqrt()) / (2.0 * rate);
    near(&uniform["mean_square_bounds"]["a"], mean_square);
    near(&uniform["probable_bounds"]["a"], process + push / rate);

    // alone it has a bound for certain, which says all
    let (bounded, _) = certified("[sensors]\nnoise = { y = { uniform = 0.05 } }");
    near(&bounded["ultimate_bounds"]["a"], push / rate);
    assert!(bounded["mean_square_bound"].is_null() && bounded["probable_bound"].is_null());
}

/// Runs under both noises: the root mean square and the share beyond the probable bound.
#[test]
fn runs_keep_to_what_is_said_of_them() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M
  Real a(start = 0, min = -5, max = 5);
  Real b(start = 0, min = -5, max = 5);
  output Real y = a;
equation
  der(a) = b - 0.3*a;
  der(b) = -b + 0.2*sin(b);
end M;",
    );
    for noise in ["a = 0.01\nb = 0.02", "a = 0"] {
        let study = format!(
            "plant = \"m.mo\"\n[sensors]\nnoise = {{ y = 0.1 }}\n[process_noise]\n{noise}\n[observer]\nfamily = \"triangular\"\ntheta = 2\n[simulate]\nuntil = 400\nsample_step = 0.05\noutput_step = 0.05\n"
        );
        folder.write("study.toml", &study);
        let certified = folder.run(&["certify", "study.toml", "--json"]).json();
        let certificate = &certified["certificate"];
        let run = folder
            .run(&["simulate", "study.toml", "-o", "run.csv", "--json"])
            .json();
        let table = folder.read("run.csv");
        let mut lines = table
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let column = |name: &str| head.iter().position(|h| *h == name).unwrap();
        let rows: Vec<Vec<f64>> = lines
            .map(|line| line.iter().map(|cell| cell.parse().unwrap()).collect())
            .collect();
        for name in ["a", "b"] {
            let of = |kind: &str| certificate[kind][name].as_f64().unwrap();
            let seen = run["rms_error_last_half"][name].as_f64().unwrap();
            let bound = of("mean_square_bounds");
            assert!(
                seen < bound && seen > 0.02 * bound,
                "{noise} {name}: {seen} {bound}"
            );
            let (x, hat) = (column(name), column(&format!("{name}_hat")));
            let late = &rows[rows.len() / 2..];
            let probable = of("probable_bounds");
            let beyond = late
                .iter()
                .filter(|row| (row[hat] - row[x]).abs() > probable)
                .count();
            assert!(
                beyond * 100 <= late.len(),
                "{noise} {name}: {beyond} of {}",
                late.len()
            );
        }
    }
}
