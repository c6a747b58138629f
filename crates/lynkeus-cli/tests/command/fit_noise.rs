//! Noises that are parameters or variables of the model, and sensors of several logs.

use crate::Folder;
use crate::fit::{K, R, fitted, holds, number};
use crate::normal::Normal;

const SHARED: &str = r#"model Decay
  parameter Real k(min = 0.05, max = 5) = 0.5;
  parameter Real s(min = 0.001, max = 5) = 0.3;
  input Real u;
  Real x(start = 1, fixed = true);
  Real wide = 2*s;
  output Real y = x;
  output Real z = 3*x;
equation
  der(x) = -k*x + u;
end Decay;
"#;

const NAMED: &str = r#"plant = "plant.mo"
[observer]
family = "ekf"
[fit]
objective = "simulation"
parameters = ["k", "s"]
log = ["s"]
noise = { y = "s", z = "wide" }
"#;

/// Two sensors whose noises are s and 2s, by the exact solution for u = 1.
fn shared_log(has_z: bool) -> String {
    let mut normal = Normal(5);
    let mut text = "t,y,z,u\n".to_owned();
    for row in 0..150 {
        let t = 0.05 * f64::from(row);
        let x = 1.0 / K + (1.0 - 1.0 / K) * (-K * t).exp();
        let (y, z) = (x + R * normal.next(), 3.0 * x + 2.0 * R * normal.next());
        match has_z {
            true => text += &format!("{t},{y},{z},1\n"),
            false => text += &format!("{t},{y},,1\n"),
        }
    }
    text
}

#[test]
fn sensors_may_share_a_noise_that_is_a_parameter() {
    let folder = Folder::empty();
    folder.write("plant.mo", SHARED);
    folder.write("study.toml", NAMED);
    folder.write("log.csv", &shared_log(true));
    let answer = fitted(&folder, &["-o", "rows.csv"]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["s"], R);
    assert!(answer["noise"].as_object().unwrap().is_empty());
    // s² is the mean of the squares, each over its factor
    let rows = folder.read("rows.csv");
    let mut header = rows.lines().next().unwrap().split(',');
    let places = ["y_innovation", "z_innovation"].map(|name| {
        let place = header.clone().position(|column| column == name);
        place.unwrap_or_else(|| {
            panic!(
                "{name} is not among {:?}",
                header.by_ref().collect::<Vec<_>>()
            )
        })
    });
    let squares = rows.lines().skip(1).map(|row| {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells[places[0]].powi(2) + (0.5 * cells[places[1]]).powi(2)
    });
    let least = (squares.sum::<f64>() / 300.0).sqrt();
    let s = number(&answer["parameters"]["s"]["value"]);
    assert!((s - least).abs() < 1e-4 * s, "{s} beside {least}");
    for (found, told) in [
        (
            "z = \"widely\"",
            "no parameter or variable is called \"widely\"",
        ),
        ("q = \"wide\"", "no measured output is called \"q\""),
        (
            "z = 3",
            "true, or the name of a parameter or a variable of the model",
        ),
    ] {
        folder.write("study.toml", &NAMED.replace("z = \"wide\"", found));
        let ended = folder.run(&["fit", "study.toml", "log.csv"]);
        assert_eq!(ended.code, 2, "{}", ended.err);
        assert!(ended.err.contains(told), "{}", ended.err);
    }
}

#[test]
fn a_sensor_may_be_silent_in_one_of_several_logs() {
    let folder = Folder::empty();
    folder.write("plant.mo", SHARED);
    folder.write("study.toml", NAMED);
    folder.write("log.csv", &shared_log(false));
    folder.write("other.csv", &shared_log(true));
    let alone = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(alone.code, 2);
    assert!(
        alone.err.contains("column \"z\" has no number"),
        "{}",
        alone.err
    );
    let both = folder.run(&["fit", "study.toml", "log.csv", "other.csv", "--json"]);
    assert_eq!(both.code, 0, "{}", both.err);
    assert_eq!(both.json()["readings"], 450);
    assert_eq!(both.json()["errors"]["z"]["fitted"]["readings"], 150);
}

#[test]
fn a_stiff_plant_alone_has_implicit_steps() {
    let folder = Folder::empty();
    let stiff = SHARED
        .replace(
            "Real wide = 2*s;",
            "Real wide = 2*s;\n  Real fast(start = 1, fixed = true);",
        )
        .replace(
            "der(x) = -k*x + u;",
            "der(x) = -k*fast + u;\n  der(fast) = 1e7*(x - fast);",
        );
    folder.write("plant.mo", &stiff);
    folder.write("study.toml", NAMED);
    folder.write("log.csv", &shared_log(true));
    let found = fitted(&folder, &[]);
    // fast follows x within 1e-7
    folder.write("plant.mo", SHARED);
    let slow = fitted(&folder, &[]);
    for name in ["k", "s"] {
        let [a, b] = [&found, &slow].map(|answer| number(&answer["parameters"][name]["value"]));
        assert!((a - b).abs() < 1e-4 * b, "{name}: {a} beside {b}");
    }
    assert!((number(&found["nll"]) - number(&slow["nll"])).abs() < 1e-3);
}

/// At rest at 0 the share of the output is no noise: the reading there is told, and the others count.
#[test]
fn a_share_of_what_is_zero_for_certain_is_told() {
    let folder = Folder::empty();
    folder.write(
        "plant.mo",
        "model Filling
  parameter Real k(min = 0.05, max = 5) = 0.5;
  Real x(start = 0, fixed = true);
  output Real y = x;
equation
  der(x) = 1 - k*x;
end Filling;
",
    );
    folder.write(
        "study.toml",
        "plant = \"plant.mo\"\n[sensors]\nnoise = { y = \"5%\" }\n[observer]\nfamily = \"ekf\"\n\
         [fit]\nobjective = \"simulation\"\nparameters = [\"k\"]\n",
    );
    let mut normal = Normal(5);
    let rows = (0..80).map(|row| {
        let t = 0.05 * f64::from(row);
        let x = (1.0 - (-K * t).exp()) / K;
        format!("{t},{}\n", x * (1.0 + 0.05 * normal.next()))
    });
    folder.write("log.csv", &format!("t,y\n{}", rows.collect::<String>()));
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["k"], K);
    assert_eq!(answer["readings"], 79);
    let warnings = answer["warnings"].as_array().unwrap();
    let is_told = |warning: &serde_json::Value| {
        let told = warning.as_str().unwrap();
        told.starts_with("1 reading of y did not count")
    };
    assert!(warnings.iter().any(is_told), "{warnings:?}");
}
