//! `lynkeus fit --next-experiment`.

use serde_json::{Value, json};

use crate::Folder;
use crate::normal::Normal;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

#[track_caller]
fn near(found: &Value, expected: f64, tolerance: f64) {
    let off = (number(found) / expected - 1.0).abs();
    assert!(off < tolerance, "{found} instead of {expected}");
}

/// The candidate of a name.
#[track_caller]
fn tried<'a>(answer: &'a Value, name: &str) -> &'a Value {
    let all = answer["next_experiment"].as_array().unwrap();
    let found = all.iter().find(|next| next["name"] == name);
    found.unwrap_or_else(|| panic!("no \"{name}\" in {answer:#}"))
}

/// x = ∫ g u, and what is measured is off by b: everything can be computed by hand.
const RAMP: &str = r#"model Ramp
  parameter Real g(min = 0.1, max = 10) = 2;
  parameter Real b(min = -10, max = 10) = 1;
  parameter Real far(min = 0.1, max = 10) = 3;
  input Real u(start = 1);
  Real x(start = 0);
  output Real y = x + b;
  output Real slow = far*x;
equation
  der(x) = g*u;
end Ramp;
"#;

const STUDY: &str = r#"plant = "plant.mo"

[sensors]
measured = ["y"]
noise = { y = 0.5 }

[observer]
family = "ekf"
initial = { x = 0 }
initial_variance = { x = 0 }
"#;

const ROWS: usize = 11;

fn ramp(fit: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", RAMP);
    folder.write("study.toml", &format!("{STUDY}{fit}\n"));
    let mut normal = Normal(5);
    let rows = (0..ROWS).map(|k| format!("{k},{},1\n", 2.0 * k as f64 + 1.0 + 0.5 * normal.next()));
    folder.write("log.csv", &format!("t,y,u\n{}", rows.collect::<String>()));
    folder
}

/// Information of readings g a + b with the slopes a, and this noise: (gg, gb, bb).
fn of_slopes(slopes: &[f64], noise: f64) -> [f64; 3] {
    let weight = noise.powi(-2);
    let [one, two] = [1, 2].map(|power| slopes.iter().map(|a| a.powi(power)).sum::<f64>());
    [weight * two, weight * one, weight * slopes.len() as f64]
}

fn sum(all: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|i| all.iter().map(|one| one[i]).sum())
}

/// Variances of g and b, and the determinant of their covariance.
fn errors([gg, gb, bb]: [f64; 3]) -> [f64; 3] {
    let determinant = gg * bb - gb * gb;
    [bb / determinant, gg / determinant, 1.0 / determinant]
}

fn asked(folder: &Folder, logs: &[&str], code: i32) -> Value {
    let options = ["--json", "--next-experiment"];
    let ended = folder.run(&[&["fit", "study.toml"], logs, &options].concat());
    assert_eq!(ended.code, code, "{}", ended.err);
    ended.json()
}

#[test]
fn a_straight_line_has_what_one_computes_by_hand() {
    let folder = ramp(
        r#"[fit]
parameters = ["g", "b"]
[fit.candidates.direct.sensors]
x = 0.25
[fit.candidates.dense]
every = 0.25
duration = 20
[fit.candidates.stronger]
inputs = { u = "if time < 4.5 then 3 else -1" }
"#,
    );
    let answer = asked(&folder, &["log.csv"], 0);
    let [g, b] = ["g", "b"].map(|name| number(&answer["parameters"][name]["value"]));
    let time: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
    let logs = of_slopes(&time, 0.5);
    let now = errors(logs);
    near(&answer["parameters"]["g"]["sd"], now[0].sqrt(), 1e-6);
    let direct = of_slopes(&time, 0.25);
    let dense: Vec<f64> = (0..=80).map(|k| 0.25 * f64::from(k)).collect();
    // held from row to row: 3 until t = 5
    let stronger: Vec<f64> = time
        .iter()
        .map(|t| if *t < 5.0 { 3.0 * t } else { 20.0 - t })
        .collect();
    let cases = [
        ("the same again", 11, sum(&[logs, logs])),
        ("direct", 22, sum(&[logs, logs, [direct[0], 0.0, 0.0]])),
        ("dense", 81, sum(&[logs, of_slopes(&dense, 0.5)])),
        ("stronger", 11, sum(&[logs, of_slopes(&stronger, 0.5)])),
    ];
    assert_eq!(
        answer["next_experiment"].as_array().unwrap().len(),
        cases.len()
    );
    for (name, readings, information) in cases {
        let next = tried(&answer, name);
        let then = errors(information);
        assert_eq!(next["readings"], readings, "{next:#}");
        near(&next["sd"]["g"], then[0].sqrt(), 1e-6);
        near(&next["sd"]["b"], then[1].sqrt(), 1e-6);
        let shares = |[gg, bb, _]: [f64; 3]| [gg.sqrt() / g, bb.sqrt() / b.abs()];
        let (before, after) = (shares(now), shares(then));
        let worst = |[g, b]: [f64; 2]| f64::max(g, b);
        near(&next["relative_sd"], worst(after), 1e-6);
        near(&next["factor"], worst(after) / worst(before), 1e-6);
        near(&next["volume"], (then[2] / now[2]).sqrt(), 1e-6);
        let squares = |[g, b]: [f64; 2]| g * g + b * b;
        near(&next["trace"], squares(after) / squares(before), 1e-6);
        assert_eq!(next["worst"], if after[0] > after[1] { "g" } else { "b" });
    }
    let order = answer["next_experiment"].as_array().unwrap();
    assert!(
        order
            .windows(2)
            .all(|pair| number(&pair[0]["relative_sd"]) <= number(&pair[1]["relative_sd"]))
    );
    assert_eq!(tried(&answer, "direct")["sensors"], json!(["x \u{b1}0.25"]));
    let text = folder.run(&["fit", "study.toml", "log.csv", "--next-experiment"]);
    assert!(
        text.out.contains("the next experiment: with these logs"),
        "{}",
        text.out
    );
    // not asked, not told
    let ended = folder.run(&["fit", "study.toml", "log.csv", "--json"]);
    assert!(ended.json().get("next_experiment").is_none());
}

/// What no output reads now is known with a sensor that there could be.
#[test]
fn what_is_not_told_may_be_made_known() {
    let folder = ramp("[fit]\nparameters = [\"g\", \"b\", \"far\"]");
    let answer = asked(&folder, &["log.csv"], 1);
    assert_eq!(answer["undetermined"], json!(["far"]));
    let best = &answer["next_experiment"][0];
    assert_eq!(best["determines"], json!(["far"]), "{best:#}");
    assert_eq!(best["undetermined"], json!([]));
    assert!(
        best["name"]
            .as_str()
            .unwrap()
            .starts_with("with slow \u{b1}"),
        "{best:#}"
    );
    assert!(best["factor"].is_null() && number(&best["sd"]["far"]) > 0.0);
    let again = tried(&answer, "the same again");
    assert_eq!(again["undetermined"], json!(["far"]));
    assert!(again["sd"]["far"].is_null() && number(&again["sd"]["g"]) > 0.0);
    let text = folder.run(&["fit", "study.toml", "log.csv", "--next-experiment"]);
    assert_eq!(text.code, 1);
    assert!(
        text.out.contains("these logs do not determine all values"),
        "{}",
        text.out
    );
    // with another of the same nothing is won
    let study = folder.read("study.toml");
    let long = study + "[fit.candidates.long]\nduration = 30\n";
    folder.write("study.toml", &long);
    let text = folder.run(&["fit", "study.toml", "log.csv", "--next-experiment"]);
    let vain = "none of them makes known what the logs do not determine";
    assert!(text.out.contains(vain), "{}", text.out);
}

const DECAY: &str = r#"model Decay
  parameter Real k(min = 0.05, max = 5) = 0.5;
  parameter Real g(min = 0.05, max = 5) = 1;
  input Real u(start = 0, min = -5, max = 5);
  Real x(start = 1, min = -20, max = 20);
  output Real y = x;
  output Real rate = g*u - k*x;
equation
  der(x) = -k*x + g*u;
end Decay;
"#;

const DECAY_STUDY: &str = r#"plant = "plant.mo"
parameters = { k = 0.5, g = 1.0 }

[sensors]
measured = ["y", "rate"]
noise = { y = 0.1, rate = 0.05 }

[observer]
family = "ekf"
initial = { x = 1 }
initial_variance = { x = 0.04 }

[fit]
parameters = ["k", "g"]
initial = ["x"]
noise = ["y"]

[fit.candidates.steps]
inputs = { u = "if sin(time) > 0 then 3 else -1" }
every = 0.1
duration = 25

[fit.candidates.rate.sensors]
rate = 0.05
"#;

/// Its exact solution under held inputs, with its readings; `rate` of the second sensor where there is one.
fn recorded(
    seed: u64,
    rows: usize,
    step: f64,
    input: impl Fn(f64) -> f64,
    has_rate: bool,
) -> String {
    let (k, g): (f64, f64) = (0.6, 1.2);
    let mut normal = Normal(seed);
    let keep = (-k * step).exp();
    let mut x = 1.1;
    let mut text = "t,y,rate,u\n".to_owned();
    for row in 0..rows {
        let t = step * row as f64;
        let u = input(t);
        let rate = g * u - k * x + 0.05 * normal.next();
        let rate = if has_rate {
            rate.to_string()
        } else {
            String::new()
        };
        text += &format!("{t},{},{rate},{u}\n", x + 0.1 * normal.next());
        x = keep * x + g * u * (1.0 - keep) / k;
    }
    text
}

/// The experiment is made, and both logs are fitted: the standard errors are those that were foretold.
#[test]
fn what_is_foretold_comes_true() {
    let folder = Folder::empty();
    folder.write("plant.mo", DECAY);
    let first = |t: f64| {
        if (t / 5.0) % 2.0 < 1.0 { 1.0 } else { 0.2 }
    };
    let steps = |t: f64| if t.sin() > 0.0 { 3.0 } else { -1.0 };
    folder.write("log.csv", &recorded(11, 200, 0.2, first, false));
    // what the first log has not is further; `rate` is measured once it is there
    folder.write(
        "study.toml",
        &DECAY_STUDY.replace("measured = [\"y\", \"rate\"]", "measured = [\"y\"]"),
    );
    let answer = asked(&folder, &["log.csv"], 0);
    let now = &answer["parameters"];
    folder.write("steps.csv", &recorded(12, 251, 0.1, steps, false));
    folder.write("rate.csv", &recorded(13, 200, 0.2, first, true));
    for (name, log) in [("steps", "steps.csv"), ("rate", "rate.csv")] {
        if name == "rate" {
            folder.write("study.toml", DECAY_STUDY);
        }
        let ended = folder.run(&["fit", "study.toml", "log.csv", log, "--json"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let both = ended.json();
        let next = tried(&answer, name);
        assert!(number(&next["factor"]) < 0.6, "{next:#}");
        let made = both["readings"].as_u64().unwrap() - answer["readings"].as_u64().unwrap();
        assert_eq!(next["readings"], made, "{next:#}");
        for parameter in ["k", "g"] {
            let found = &both["parameters"][parameter]["sd"];
            let share = number(found) / number(&now[parameter]["sd"]);
            let told = number(&next["sd"][parameter]) / number(&now[parameter]["sd"]);
            assert!(
                (share / told - 1.0).abs() < 0.15,
                "{name}, {parameter}: {share} beside {told}"
            );
        }
    }
}

/// A start that is found is one more unknown of the log to come.
#[test]
fn a_start_of_its_own_is_not_known_before() {
    let folder = ramp("[fit]\nparameters = [\"g\"]\ninitial = [\"x\"]");
    folder.change("plant.mo", "y = x + b", "y = x");
    let answer = asked(&folder, &["log.csv"], 0);
    let next = tried(&answer, "the same again");
    // each log tells g by its slope alone
    near(&next["factor"], 0.5_f64.sqrt(), 1e-6);
    near(
        &next["sd"]["initial.x[1]"],
        {
            let time: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
            let [gg, gb, bb] = of_slopes(&time, 0.5);
            // the slope's variance is halved, and the mean is the log's own
            let slope = bb / (gg * bb - gb * gb);
            (1.0 / bb + (gb / bb).powi(2) * 0.5 * slope).sqrt()
        },
        1e-6,
    );
}

#[test]
fn candidates_that_do_not_fit_are_refused() {
    for (candidate, told) in [
        (
            "sensors = { z = 1 }",
            "`sensors` of a candidate of [fit]: no output or state is called \"z\"; choose from: y, slow, x",
        ),
        ("sensors = { x = 0 }", "a noise above 0"),
        (
            "inputs = { x = 1 }",
            "`inputs` of a candidate of [fit]: no known input is called \"x\"; choose from: u",
        ),
        (
            "inputs = { u = \"x + 1\" }",
            "study.toml:14:16: expression:1:1: unknown name `x`",
        ),
        (
            "inputs = { u = \"1/(time - 3)\" }",
            "an input of [fit] has no value at 3",
        ),
        ("every = 0", "a number > 0"),
        (
            "every = 1e-9",
            "rows, more than 1e6; choose a larger `every`",
        ),
        ("until = 4", "unknown key \"until\" in a candidate of [fit]"),
    ] {
        let folder = ramp(&format!(
            "[fit]\nparameters = [\"g\"]\n[fit.candidates.one]\n{candidate}"
        ));
        let ended = folder.run(&["fit", "study.toml", "log.csv", "--next-experiment"]);
        assert_eq!(ended.code, 2, "{candidate}: {}", ended.err);
        assert!(ended.err.contains(told), "{candidate}: {}", ended.err);
    }
}

/// Where the plant has no value there is nothing to foretell, and the others are told.
#[test]
fn a_candidate_without_value_is_told() {
    let folder = ramp("[fit]\nparameters = [\"g\"]\n[fit.candidates.down]\ninputs = { u = -1 }");
    folder.change("plant.mo", "= g*u;", "= g*u + 0*sqrt(x + 3);");
    let ended = folder.run(&[
        "fit",
        "study.toml",
        "log.csv",
        "--next-experiment",
        "--json",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["next_experiment"][1]["name"], "down");
    assert!(answer["next_experiment"][1]["relative_sd"].is_null());
    assert!(
        answer["notes"]
            .to_string()
            .contains("the next experiment, down: the plant has no value there")
    );
}
