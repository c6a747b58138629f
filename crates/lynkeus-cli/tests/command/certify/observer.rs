//! What is proved of the error of an observer of the papers from a set of starts.

use serde_json::Value;

use super::{folder, says};
use crate::Folder;

const OSCILLATOR: &str = "\
model Oscillator
  Real x(start = 1.4, min = -3, max = 3);
  Real y(start = 2.4, min = -3, max = 3);
  output Real position = x;
equation
  der(x) = y;
  der(y) = (1 - x^2)*y - x;
end Oscillator;
";

const STUDY: &str = "\
plant = \"m.mo\"
[observer]
family = \"triangular\"
theta = 5
initial = { x = 1.4, y = 2.2 }
[certify]
start = { x = [1.3, 1.5], y = [2.35, 2.45] }
until = 3
";

/// The plant of Ltaief et al. without its uncertainty: what shows x2 and x3 is one row of inputs.
const EXCITED: &str = "\
model Excited
  input Real u1(min = -1, max = 1);
  input Real u2(min = -1, max = 1);
  input Real u3(min = -5, max = 5);
  Real x1(start = 1, min = 0.2, max = 4);
  Real x2(start = 0.5, min = -2, max = 2);
  Real x3(start = 0.5, min = -2, max = 2);
  output Real y = x1;
equation
  der(x1) = u1*x1*x2 + u2*x1^2*x3 + x1*u3;
  der(x2) = x3 - 10*x2 + u3 - x2^3;
  der(x3) = -x3 - 2*x1*x2 - 10*u1*x2;
end Excited;
";

const EXCITED_STUDY: &str = "\
plant = \"m.mo\"
[observer]
family = \"state-affine\"
theta = 10
S0 = 1
initial = { x1 = 1, x2 = 0.7, x3 = 0.3 }
[simulate]
until = 1
output_step = 0.05
inputs = { u1 = \"sin(11*pi*time)\", u2 = \"cos(11*pi*time)\", u3 = \"5*cos(2*pi*time)\" }
[certify]
start = { x1 = [0.99, 1.01], x2 = [0.49, 0.51], x3 = [0.49, 0.51] }
";

fn tube(folder: &Folder) -> Value {
    let ended = folder.run(&["certify", "study.toml", "--json"]);
    ended.json()["certificate"]["error_tube"].clone()
}

fn ends(range: &Value) -> [f64; 2] {
    [0, 1].map(|i| range[i].as_f64().unwrap())
}

/// The numbers of columns of a file.
fn columns(folder: &Folder, file: &str, names: &[String]) -> Vec<Vec<f64>> {
    let text = folder.read(file);
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let place = |name: &String| head.iter().position(|own| own == name).unwrap();
    let places: Vec<usize> = names.iter().map(place).collect();
    let row = |cells: Vec<&str>| places.iter().map(|&i| cells[i].parse().unwrap()).collect();
    lines.map(row).collect()
}

/// The largest share of the ranges that the errors of a run from such a start have, row by row: of a simulation, whose
/// observer reads continuously, or of an estimate from the log that it leaves.
fn share(plant: &str, study: &str, start: &str, found: &Value, is_sampled: bool) -> f64 {
    let run = study.replace("[simulate]", &format!("[simulate]\ninitial = {start}"));
    let folder = folder(plant, &run);
    let simulate = [
        "simulate",
        "study.toml",
        "-o",
        "run.csv",
        "--log",
        "log.csv",
        "-q",
    ];
    let estimate = ["estimate", "study.toml", "log.csv", "-o", "hat.csv", "-q"];
    for command in [&simulate[..], &estimate] {
        let ended = folder.run(command);
        assert!(ended.code <= 1, "{ended:?}");
    }
    let errors = found["noisy"]["error_end"].as_object().unwrap();
    let names: Vec<String> = errors.keys().cloned().collect();
    let hats: Vec<String> = names.iter().map(|name| format!("{name}_hat")).collect();
    let truth = columns(
        &folder,
        "run.csv",
        &[vec!["t".to_owned()], names.clone()].concat(),
    );
    let hats = columns(
        &folder,
        if is_sampled { "hat.csv" } else { "run.csv" },
        &hats,
    );
    assert_eq!(truth.len(), hats.len());
    let rows = found["noisy"]["rows"].as_array().unwrap();
    let mut largest = 0.0_f64;
    for (truth, hats) in truth.iter().zip(&hats) {
        let of = |end: &str, row: &Value| row[end].as_f64().unwrap();
        let here = rows
            .iter()
            .filter(|row| of("from", row) <= truth[0] && truth[0] <= of("to", row));
        for row in here {
            for ((name, x), hat) in names.iter().zip(&truth[1..]).zip(hats) {
                let [low, high] = ends(&row["error"][name]);
                let off = (hat - x - 0.5 * (low + high)).abs();
                largest = largest.max(off / (0.5 * (high - low) + 1e-7));
            }
        }
    }
    largest
}

#[test]
fn sensors_that_are_read_continuously() {
    let ended = folder(OSCILLATOR, STUDY).run(&["certify", "study.toml"]);
    says(
        &ended.out,
        &[
            "the observer's error until 3: proved",
            "the plant from x in [1.3, 1.5], y in [2.35, 2.45] at 0, the estimate from x = 1.4, y = 2.2",
            "sensors that are read continuously",
        ],
    );
    let found = tube(&folder(OSCILLATOR, STUDY));
    assert_eq!(found["verdict"], "proved");
    assert!(found["every"].is_null());
    let [low, high] = ends(&found["noisy"]["error_end"]["y"]);
    // it converges, and slopes cost nothing
    assert!(low > -0.01 && high < 0.01, "{low} {high}");
}

#[test]
fn samples_with_noise_held_and_predicted() {
    let study = format!(
        "{STUDY}[sensors]\nnoise = {{ position = {{ uniform = 0.01 }} }}\n[simulate]\nuntil = 3\nsample_step = 0.02\noutput_step = 0.02\n"
    );
    let found = tube(&folder(OSCILLATOR, &study));
    assert_eq!(
        (&found["verdict"], &found["every"]),
        (&"proved".into(), &0.02.into())
    );
    assert_eq!(found["readings"]["position"], 0.01);
    let mut largest = 0.0_f64;
    for (x, y) in [
        (1.3, 2.35),
        (1.3, 2.45),
        (1.5, 2.35),
        (1.5, 2.45),
        (1.4, 2.4),
    ] {
        let start = format!("{{ x = {x}, y = {y} }}");
        largest = largest.max(share(OSCILLATOR, &study, &start, &found, true));
    }
    assert!(largest > 0.9 && largest <= 1.0, "{largest}");
    // what is held falls behind where the plant moves; a prediction does not
    let predicted = format!("{study}[estimate]\nbetween_samples = \"predict\"\n");
    let predicted = tube(&folder(OSCILLATOR, &predicted));
    let far = |found: &Value| {
        let [low, high] = ends(&found["exact"]["error_end"]["y"]);
        low.abs().max(high.abs())
    };
    assert!(far(&found) > 5.0 * far(&predicted), "{found} {predicted}");
}

#[test]
fn the_gain_is_a_state_and_its_excitation_is_proved() {
    let study = folder(EXCITED, EXCITED_STUDY);
    let ended = study.run(&["certify", "study.toml"]);
    says(
        &ended.out,
        &[
            "the observer's error until 1: proved",
            "excitation at least 0.0",
        ],
    );
    let found = tube(&study);
    let [excitation, _] = ends(&found["noisy"]["monitors"]["excitation"]);
    let run = study.run(&["simulate", "study.toml", "-o", "run.csv", "-q"]);
    assert!(run.code <= 1, "{run:?}");
    let text = study.read("run.csv");
    let place = |line: &str| line.split(',').position(|name| name == "excitation");
    let place = place(text.lines().next().unwrap()).unwrap();
    let cells = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(place).unwrap());
    let least = cells
        .map(|cell| cell.parse::<f64>().unwrap())
        .fold(f64::INFINITY, f64::min);
    assert!(
        excitation <= least && excitation > 0.1 * least,
        "{excitation} {least}"
    );
    for start in [
        "{ x1 = 0.99, x2 = 0.51, x3 = 0.49 }",
        "{ x1 = 1.01, x2 = 0.49, x3 = 0.51 }",
    ] {
        let share = share(EXCITED, EXCITED_STUDY, start, &found, false);
        assert!(share > 0.5 && share <= 1.0, "{start}: {share}");
    }
}

/// On a log known inputs are held from row to row: the tube is that of `estimate`, and not that of a plant whose observer
/// sees its inputs all the time.
#[test]
fn known_inputs_are_held_between_samples() {
    let plant = "\
model Driven
  input Real u(min = -2, max = 2);
  Real x(start = 0, min = -3, max = 3);
  Real v(start = 0, min = -5, max = 5);
  output Real y = x;
equation
  der(x) = v;
  der(v) = u - v - x;
end Driven;
";
    let study = "\
plant = \"m.mo\"
[observer]
family = \"triangular\"
theta = 1
[simulate]
until = 3
sample_step = 0.2
output_step = 0.2
inputs = { u = \"2*sin(3*time)\" }
[estimate]
between_samples = \"predict\"
[certify]
start = { x = [-0.01, 0.01] }
";
    let found = tube(&folder(plant, study));
    assert_eq!(found["verdict"], "proved");
    for start in ["{ x = -0.01, v = 0 }", "{ x = 0.01, v = 0 }"] {
        let share = share(plant, study, start, &found, true);
        assert!(share > 0.3 && share <= 1.0, "{start}: {share}");
    }
    let lines = study.replace("\"predict\"", "\"linear\"");
    let found = tube(&folder(plant, &lines));
    says(
        found["obstacle"].as_str().unwrap(),
        &["`between_samples = \"linear\"`"],
    );
}

/// The sample at the end counts, although 3·0.1 is more than 0.3 by a rounding error: the reading's error is in the estimate.
#[test]
fn the_last_sample_is_not_lost_to_rounding() {
    let plant = "\
model Decay
  Real x(start = 0, min = -3, max = 3);
  output Real y = x;
equation
  der(x) = -8*x;
end Decay;
";
    let study = "\
plant = \"m.mo\"
[sensors]
noise = { y = { uniform = 0.1 } }
[process_noise]
x = 1
[observer]
family = \"ekf\"
initial = { x = 0 }
initial_variance = { x = 1 }
[simulate]
until = 0.3
sample_step = 0.1
[certify]
start = { x = [-0.01, 0.01] }
";
    let found = tube(&folder(plant, study));
    let rows = found["noisy"]["rows"].as_array().unwrap();
    let width = |row: &Value| {
        let [low, high] = ends(&row["error"]["x"]);
        high - low
    };
    // it jumps there by most of the reading's error
    let [before, last] = [rows.len() - 2, rows.len() - 1].map(|i| width(&rows[i]));
    assert!(last > 1.3 * before, "{before} {last}");
}

/// An unknown constant in a wide range: the whole is too much for one tube, its parts are not.
#[test]
fn a_wide_start_set_is_taken_in_parts() {
    let plant = "\
model Tank
  input Real inflow(min = 3, max = 10);
  Real level(start = 4, min = 0.5, max = 20);
  output Real shown = level;
equation
  der(level) = 0.1*inflow - 0.25*sqrt(level);
end Tank;
";
    let study = "\
plant = \"m.mo\"
[sensors]
unknown = [\"inflow\"]
noise = { shown = { uniform = 0.02 } }
[observer]
family = \"triangular\"
theta = 0.5
initial = { level = 4, inflow = 5 }
[simulate]
until = 10
sample_step = 0.2
inputs = { inflow = \"5\" }
[certify]
start = { level = [3.5, 4.5] }
";
    let found = tube(&folder(plant, study));
    assert_eq!(found["verdict"], "proved", "{}", found["obstacle"]);
    let [low, high] = ends(&found["noisy"]["error_end"]["inflow"]);
    assert!(-2.0 < low && high < 2.0, "{low} {high}");
}

#[test]
fn what_is_not_followed_is_said() {
    let refused = |study: &str, said: &str| {
        let found = tube(&folder(OSCILLATOR, study));
        assert_eq!(found["verdict"], "undecided", "{said}");
        says(found["obstacle"].as_str().unwrap(), &[said]);
    };
    let limits = format!("{STUDY}[sensors]\nlimits = {{ position = [-2, 2] }}\n");
    refused(&limits, "`limits` of sensors");
    let without = EXCITED_STUDY.replace(
        &EXCITED_STUDY
            [EXCITED_STUDY.find("[simulate]").unwrap()..EXCITED_STUDY.find("[certify]").unwrap()],
        "",
    );
    let found = tube(&folder(EXCITED, &format!("{without}until = 1\n")));
    says(
        found["obstacle"].as_str().unwrap(),
        &["`inputs` of [simulate]"],
    );
}
