//! What is proved of an extended Kalman filter from a set of starts.

use serde_json::Value;

use super::{folder, says};
use crate::Folder;

const OSCILLATOR: &str = "model Oscillator
  Real x(start = 1.4, min = -3, max = 3);
  Real y(start = 2.2, min = -3, max = 3);
  output Real position = x;
equation
  der(x) = y;
  der(y) = (1 - x^2)*y - x;
end Oscillator;
";

const STUDY: &str = "plant = \"m.mo\"
[sensors]
noise = { position = { uniform = 0.01 } }
[observer]
family = \"ekf\"
initial = { x = 1.4, y = 2.2 }
initial_variance = { x = 0.01, y = 0.04 }
[simulate]
until = 3
sample_step = 0.1
output_step = 0.1
[estimate]
sd = true
[certify]
start = { x = [1.35, 1.45], y = [2.1, 2.3] }
";

/// Two sensors, one of a product; an input that varies, a disturbance, a constant that nobody knows.
const REACTOR: &str = "model Reactor
  input Real u(min = 0, max = 2);
  input Real load(start = 0.3, min = 0, max = 0.6);
  input Real d(min = -0.01, max = 0.01);
  Real a(start = 1, min = 0.1, max = 3);
  Real b(start = 0.5, min = 0.1, max = 3);
  output Real first = a;
  output Real both = a*b;
equation
  der(a) = u - 0.8*a*b - load + d;
  der(b) = 0.5*a - 0.7*b^2;
end Reactor;
";

const REACTORS: &str = "plant = \"m.mo\"
[sensors]
measured = [\"first\", \"both\"]
unknown = [\"load\"]
disturbances = [\"d\"]
noise = { first = { uniform = 0.004 }, both = { uniform = 0.008 } }
[observer]
family = \"ekf\"
initial = { a = 1.02, b = 0.52, load = 0.28 }
initial_variance = { a = 0.01, b = 0.01, load = 0.01 }
[process_noise]
load = 0
[simulate]
until = 2
sample_step = 0.2
output_step = 0.2
method = \"rk4\"
step = 0.01
inputs = { u = \"0.8 + 0.2*sin(3*time)\", load = \"0.3\", d = \"if time < 1 then 0.01 else -0.01\" }
[estimate]
sd = true
[certify]
start = { a = [0.97, 1.03], b = [0.47, 0.55], load = [0.25, 0.33] }
";

fn filter(folder: &Folder) -> Value {
    let ended = folder.run(&["certify", "study.toml", "--json"]);
    let found = ended.json()["certificate"].clone();
    let leaves = found["tube"]["verdict"] == "refuted";
    assert_eq!(ended.code, i32::from(leaves), "{ended:?}");
    found["error_tube"].clone()
}

/// The hull of what rows have at a time.
fn at(found: &Value, time: f64, what: &str, name: &str) -> [f64; 2] {
    let rows = found["rows"].as_array().unwrap().iter();
    let close = rows.filter(|row| {
        let [from, to] = ["from", "to"].map(|end| row[end].as_f64().unwrap());
        from - 1e-9 <= time && time <= to + 1e-9
    });
    close.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], row| {
        let [own, end] = [0, 1].map(|i| row[what][name][i].as_f64().unwrap());
        [low.min(own), high.max(end)]
    })
}

/// How near to the bounds of errors and of deviations runs from everywhere in the start set come.
struct Seen {
    /// largest error late in the run, as a share of its bound
    error: f64,
    /// the same beside the bound of exact readings
    exact: f64,
    /// widest range of a deviation, as a share of it
    width: f64,
}

/// Runs of the filter with noise, from the corners: all errors and deviations have to be in the ranges.
fn attacked(plant: &str, study: &str, corners: &[(&str, [f64; 2])], names: &[&str]) -> Seen {
    let folder = folder(plant, study);
    let found = filter(&folder);
    assert_eq!(found["verdict"], "proved", "{}", found["obstacle"]);
    let mut seen = Seen {
        error: 0.0,
        exact: 0.0,
        width: 0.0,
    };
    for seed in 0..8_usize {
        let corner = corners.iter().enumerate();
        let corner = corner.map(|(i, (name, ends))| format!("{name} = {}", ends[seed >> i & 1]));
        let corner = corner.collect::<Vec<_>>().join(", ");
        let run = format!("[simulate]\ninitial = {{ {corner} }}");
        folder.write("run.toml", &study.replace("[simulate]", &run));
        let run = folder.run(&[
            "simulate",
            "run.toml",
            "--seed",
            &seed.to_string(),
            "-o",
            "run.csv",
        ]);
        // a disturbance that the filter does not know of is no reason for it to be credible
        assert!(run.code < 2, "{run:?}");
        let table = folder.read("run.csv");
        let mut lines = table
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let rows: Vec<Vec<f64>> = lines
            .map(|line| line.iter().map(|cell| cell.parse().unwrap()).collect())
            .collect();
        let last = rows.last().unwrap()[0];
        for (row, name) in rows
            .iter()
            .flat_map(|row| names.iter().map(move |name| (row, *name)))
        {
            let cell = |name: String| row[head.iter().position(|h| *h == name).unwrap()];
            let error = cell(format!("{name}_hat")) - cell(name.to_owned());
            let deviation = cell(format!("{name}_sd"));
            let time = row[0];
            let [low, high] = at(&found["noisy"], time, "error", name);
            assert!(
                low - 1e-6 <= error && error <= high + 1e-6,
                "{seed} {time} {name}: {error} [{low}, {high}]"
            );
            let [least, most] = at(&found["noisy"], time, "deviation", name);
            let is_inside = least * (1.0 - 1e-4) <= deviation && deviation <= most * (1.0 + 1e-4);
            assert!(
                is_inside,
                "{seed} {time} {name}: {deviation} [{least}, {most}]"
            );
            if time > 0.6 * last {
                seen.error = seen.error.max(error.abs() / high.max(-low));
                let [low, high] = at(&found["exact"], time, "error", name);
                seen.exact = seen.exact.max(error.abs() / high.max(-low));
            }
        }
        for name in names {
            let [least, most] =
                [0, 1].map(|i| found["noisy"]["deviation_end"][name][i].as_f64().unwrap());
            seen.width = seen.width.max((most - least) / least);
        }
    }
    seen
}

#[test]
fn runs_of_a_filter_stay_in_its_tube() {
    let corners = [("x", [1.35, 1.45]), ("y", [2.1, 2.3])];
    let seen = attacked(OSCILLATOR, STUDY, &corners, &["x", "y"]);
    // wide enough for noise, which is much more than what the start leaves; and no wider than it has to be
    assert!(
        seen.error > 0.15 && seen.exact > 3.0 && seen.width < 0.6,
        "{} {} {}",
        seen.error,
        seen.exact,
        seen.width
    );
}

#[test]
fn two_sensors_an_input_a_disturbance_and_a_constant() {
    let corners = [("a", [0.97, 1.03]), ("b", [0.47, 0.55])];
    let seen = attacked(REACTOR, REACTORS, &corners, &["a", "b", "load"]);
    assert!(
        seen.error > 0.05 && seen.width < 0.6,
        "{} {} {}",
        seen.error,
        seen.exact,
        seen.width
    );
}

/// A disturbance in a reading grows with the plant, which leaves its box: what it does there is counted, and not what it
/// would do in the box. The filter takes all of it for an error of 0.1 of x, whatever its gain.
#[test]
fn a_disturbed_reading_of_a_plant_that_leaves_its_box() {
    let plant = "model Growth
  input Real d(min = -0.1, max = 0.1);
  Real x(start = 1, min = -1, max = 1);
  output Real y = x + d*x;
equation
  der(x) = x;
end Growth;
";
    let study = "plant = \"m.mo\"
[sensors]
disturbances = [\"d\"]
noise = { y = { uniform = 0.01 } }
[observer]
family = \"ekf\"
initial = { x = 1 }
initial_variance = { x = 0.01 }
[simulate]
until = 2
sample_step = 0.1
output_step = 0.1
inputs = { d = \"0.1\" }
[estimate]
sd = true
[certify]
start = { x = [0.99, 1] }
";
    let seen = attacked(plant, study, &[("x", [0.99, 1.0])], &["x"]);
    assert!(
        // without noise all of it is left
        seen.error > 0.8 && (0.8..1.2).contains(&seen.exact),
        "{} {}",
        seen.error,
        seen.exact
    );
    let found = filter(&folder(plant, study));
    assert_eq!(found["readings"]["y"], 0.01);
}

#[test]
fn the_answer_says_what_is_proved_and_from_where() {
    let ended = folder(OSCILLATOR, STUDY).run(&["certify", "study.toml"]);
    says(
        &ended.out,
        &[
            "undecided: neither a proof nor a counterexample; the filter's error has bounds from these starts until 3 (proved)",
            "the filter's error until 3: proved",
            "the plant from x in [1.35, 1.45], y in [2.1, 2.3] at 0, the estimate from x = 1.4, y = 2.2",
            "a sample every 0.1, whatever the errors of its readings are within ±0.01 of position",
            "in exact arithmetic",
        ],
    );
}

#[test]
fn what_is_not_followed_is_undecided() {
    let refused = |change: &dyn Fn(&str) -> String, said: &str| {
        let found = filter(&folder(OSCILLATOR, &change(STUDY)));
        assert_eq!(found["verdict"], "undecided", "{said}");
        says(found["obstacle"].as_str().unwrap(), &[said]);
        assert!(found["noisy"].is_null() && found["exact"].is_null());
    };
    let with = |key: &'static str| {
        move |study: &str| study.replace("[observer]", &format!("[observer]\n{key}"))
    };
    refused(&with("gate = 4"), "a `gate`");
    refused(&with("bounds = \"project\""), "`bounds`");
    refused(&with("iterations = 3"), "`iterations`");
    refused(
        &|study| study.replace("\"ekf\"", "\"ukf\""),
        "another filter",
    );
    refused(
        &|study| study.replace("{ uniform = 0.01 }", "\"1 %\""),
        "noise of position",
    );
    refused(
        &|study| study.replace("[observer]", "limits = { position = [-2, 2] }\n[observer]"),
        "`limits`",
    );
    let wide = STUDY.replace("uniform = 0.01", "uniform = 0.5");
    let found = filter(&folder(OSCILLATOR, &wide));
    assert_eq!(found["verdict"], "undecided");
    says(
        found["obstacle"].as_str().unwrap(),
        &["no step could be proved"],
    );
    // what is proved of exact readings stands
    assert_eq!(found["exact"]["reached"], 3.0);
    assert!(found["noisy"]["reached"].as_f64().unwrap() < 3.0);
    // without starts nobody asks
    let unasked = STUDY.split("[certify]").next().unwrap();
    assert!(filter(&folder(OSCILLATOR, unasked)).is_null());
}
