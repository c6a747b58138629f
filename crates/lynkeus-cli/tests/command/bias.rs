//! Offsets of sensors that are estimated along: `bias` of `[sensors]`.

use crate::Folder;

const PLANT: &str = "model Wheel
  input Real gyro;
  input Real torque;
  Real angle(start = 0);
  Real slip(start = 0.1);
  output Real y[2];
equation
  der(angle) = gyro;
  der(slip) = -0.5*slip + torque;
  y[1] = angle;
  y[2] = slip;
end Wheel;
";

const BY_HAND: &str = "model Wheel
  input Real gyro;
  input Real torque;
  Real angle(start = 0);
  Real slip(start = 0.1);
  Real gyro_bias(start = 0);
  Real y_bias[2](start = {0, 0});
  output Real y[2];
equation
  der(angle) = gyro - gyro_bias;
  der(slip) = -0.5*slip + torque;
  der(gyro_bias) = 0;
  der(y_bias[1]) = 0;
  der(y_bias[2]) = 0;
  y[1] = angle;
  y[2] = slip + y_bias[2];
end Wheel;
";

const STUDY: &str = "plant = \"plant.mo\"
process_noise = { slip = 0.01, gyro_bias = 1e-6 }
[observer]
family = \"ekf\"
";

/// The gyro reads 0.05 too much, the second sensor 0.3.
fn log() -> String {
    let mut text = "t,gyro,torque,\"y[1]\",\"y[2]\"\n".to_owned();
    let mut slip = 0.1;
    for row in 0..200 {
        let t = 0.1 * f64::from(row);
        let (angle, rate) = (2.0 - 2.0 * (0.5 * t).cos(), (0.5 * t).sin());
        text += &format!("{t},{},0.2,{angle},{}\n", rate + 0.05, slip + 0.3);
        slip = 0.4 + (slip - 0.4) * (-0.05_f64).exp();
    }
    text
}

fn folder(plant: &str, sensors: &str, observer: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", plant);
    folder.write(
        "study.toml",
        &format!("{STUDY}{observer}\n[sensors]\nnoise = {{ y = 0.05 }}\n{sensors}\n"),
    );
    folder.write("log.csv", &log());
    folder
}

fn estimate(folder: &Folder) -> String {
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder.read("out.csv")
}

/// The column of that header.
fn column(table: &str, header: &str) -> Vec<f64> {
    let mut rows = table.lines();
    let mut headers = rows.next().unwrap().split(',');
    let place = headers.position(|name| name.trim_matches('"') == header);
    let place = place.unwrap_or_else(|| panic!("no {header} in {table:.200}"));
    rows.map(|row| row.split(',').nth(place).unwrap().parse().unwrap())
        .collect()
}

#[test]
fn an_offset_is_what_a_model_with_a_state_for_it_finds() {
    let with = folder(
        PLANT,
        "bias = { gyro = 0.1, \"y[2]\" = 0.5 }",
        "initial_variance = { angle = 0.01 }",
    );
    let with = estimate(&with);
    let by_hand = folder(
        BY_HAND,
        "",
        "initial_variance = { angle = 0.01, gyro_bias = 0.010000000000000002, y_bias = 0.25 }",
    );
    let by_hand = estimate(&by_hand);
    for name in ["angle_hat", "slip_hat", "gyro_bias_hat", "y_bias[2]_hat"] {
        let pairs = column(&with, name).into_iter().zip(column(&by_hand, name));
        for (own, other) in pairs {
            assert!((own - other).abs() < 1e-9, "{name}: {own} {other}");
        }
    }
    let last = |name: &str| *column(&with, name).last().unwrap();
    assert!((last("gyro_bias_hat") - 0.05).abs() < 0.01);
    assert!((last("y_bias[2]_hat") - 0.3).abs() < 0.05);
}

/// A sensor of a state that is an output itself: its readings have the state's name, and the offset is beside it.
#[test]
fn a_state_that_is_read_has_an_offset_beside_it() {
    let model = |output: &str, reading: &str| {
        format!(
            "model Tank\n  {output}Real x(start = 1);\n  Real v(start = 0.2);\n{reading}\n  der(v) = -0.3*v + 0.1;\nend Tank;\n"
        )
    };
    let own = model("output ", "equation\n  der(x) = v - 0.5*x;");
    let by_hand = model(
        "",
        "  Real x_bias(start = 0);\n  output Real y = x + x_bias;\nequation\n  der(x_bias) = 0;\n  der(x) = v - 0.5*x;",
    );
    let rows = (0..60).map(|k| {
        let t = 0.1 * f64::from(k);
        format!(
            "{t},{}\n",
            0.9 + 0.3 * (-0.5 * t).exp() + 0.05 * (7.0 * t).sin()
        )
    });
    let rows: String = rows.collect();
    let estimates = [(own, "x", "bias = { x = 0.5 }", ""), (by_hand, "y", "", ", x_bias = 0.25")].map(
        |(model, header, bias, variance)| {
            let folder = Folder::empty();
            folder.write("plant.mo", &model);
            folder.write(
                "study.toml",
                &format!("plant = \"plant.mo\"\nprocess_noise = {{ v = 0.01 }}\n[observer]\nfamily = \"ekf\"\ninitial_variance = {{ x = 0.04{variance} }}\n[sensors]\nnoise = {{ {header} = 0.05 }}\n{bias}\n"),
            );
            folder.write("log.csv", &format!("t,{header}\n{rows}"));
            let checked = folder.run(&["check", "study.toml"]);
            let told = "states observable: x, v, x_bias";
            assert!(checked.out.contains(told), "{} {}", checked.out, checked.err);
            estimate(&folder)
        },
    );
    for name in ["x_hat", "v_hat", "x_bias_hat"] {
        let [own, by_hand] = estimates.each_ref().map(|table| column(table, name));
        for (own, by_hand) in own.into_iter().zip(by_hand) {
            assert!((own - by_hand).abs() < 1e-9, "{name}: {own} {by_hand}");
        }
    }
}

/// Nothing tells the offset of the only sensor of an integrator from where this started.
#[test]
fn what_no_sensor_tells_apart_is_told() {
    let folder = folder(PLANT, "bias = { gyro = 0.1, y = 0.5 }", "");
    let ended = folder.run(&["check", "study.toml"]);
    assert!(
        ended.out.contains("y_bias[1]") && ended.out.contains("states not observable: angle"),
        "{}",
        ended.out
    );
}

#[test]
fn what_has_no_offset_is_refused() {
    for (sensors, told) in [
        (
            "bias = { z = 1 }",
            "`bias` of [sensors]: no output and no input is called \"z\"",
        ),
        (
            "unknown = [\"torque\"]\nbias = { torque = 1 }",
            "nobody reads the input torque",
        ),
        ("bias = { y = 0 }", "a standard deviation > 0"),
    ] {
        let folder = folder(PLANT, sensors, "");
        let ended = folder.run(&["check", "study.toml"]);
        assert_eq!(ended.code, 2, "{sensors}: {}", ended.err);
        assert!(ended.err.contains(told), "{sensors}: {}", ended.err);
    }
}
