//! Plants with `delay`.

use crate::{Folder, csv};

const PLANT: &str = "model Heater
  input Real u(start = 0);
  input Real w(min = -5, max = 5);
  Real T(start = 0, min = -10, max = 10);
  output Real y;
  output Real v = delay(u, 1);
equation
  der(T) = delay(u, 1) + w - T;
  y = delay(T, 0.5);
end Heater;
";

const STUDY: &str = "plant = \"heater.mo\"
[sensors]
measured = [\"y\"]
unknown = [\"w\"]
noise = { y = 0.01 }
[process_noise]
w = 0.1
T = 1e-4
[observer]
family = \"ekf\"
[simulate]
until = 20
sample_step = 0.05
inputs = { u = \"sin(time)\", w = \"cos(0.5*time)\" }
";

fn folder(more: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("heater.mo", PLANT);
    folder.write("study.toml", &format!("{more}\n{STUDY}"));
    folder
}

fn column(text: &str, name: &str) -> Vec<f64> {
    let (header, rows) = csv(text);
    let place = header.iter().position(|n| n == name).unwrap();
    rows.iter().map(|row| row[place]).collect()
}

/// What was fed in comes out as late, and a filter finds the state behind a delay.
#[test]
fn a_delayed_plant_is_simulated_and_estimated() {
    let folder = folder("delay_states = 8");
    let ended = folder.run(&[
        "simulate",
        "study.toml",
        "--log",
        "log.csv",
        "-o",
        "run.csv",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("held by 8 states"), "{}", ended.err);
    let run = folder.read("run.csv");
    let (time, truth, hat) = (column(&run, "t"), column(&run, "T"), column(&run, "T_hat"));
    let moments: Vec<Vec<f64>> = (1..=8)
        .map(|i| column(&run, &format!("u_delay[{i}]")))
        .collect();
    for row in (0..time.len()).filter(|row| time[*row] > 6.0) {
        let late: f64 = moments.iter().map(|z| z[row]).sum();
        assert!(
            (late - (time[row] - 1.0).sin()).abs() < 1e-6,
            "{}",
            time[row]
        );
    }
    let last = time
        .iter()
        .zip(truth.iter().zip(&hat))
        .filter(|(t, _)| **t > 5.0);
    let errors: Vec<f64> = last
        .map(|(_, (truth, hat))| (truth - hat).powi(2))
        .collect();
    let rms = (errors.iter().sum::<f64>() / errors.len() as f64).sqrt();
    assert!(rms < 0.1, "{rms}");
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
}

/// A few states are not all of a delay.
#[test]
fn nothing_is_proved_of_a_delay() {
    let folder = folder("");
    let ended = folder.run(&["check", "study.toml"]);
    assert!(
        ended.out.contains("is held by 6 states"),
        "{}{}",
        ended.out,
        ended.err
    );
    let ended = folder.run(&["certify", "study.toml"]);
    assert!(
        ended.out.contains("ekf observer, undecided"),
        "{}{}",
        ended.out,
        ended.err
    );
    let folder = self::folder("delay_states = 11");
    let ended = folder.run(&["check", "study.toml"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.err.contains("a whole number from 1 to 10"),
        "{}",
        ended.err
    );
}
