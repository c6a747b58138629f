//! `lynkeus fit`.

use serde_json::Value;

use crate::Folder;
use crate::normal::Normal;

const PLANT: &str = r#"model Decay "Of first order"
  parameter Real k(min = 0.05, max = 5) = 0.5 "Rate";
  parameter Real g(min = 0.05, max = 5) = 1 "Gain";
  parameter Real idle(min = 0, max = 5) = 1 "No output reads it";
  input Real u(start = 0, min = -5, max = 5);
  Real x(start = 1, min = -20, max = 20);
  output Real y = x;
equation
  der(x) = -k*x + g*u;
end Decay;
"#;

const STUDY: &str = r#"plant = "plant.mo"
parameters = { k = 0.5, g = 1.0 }  # a guess

[sensors]
measured = ["y"]
noise = { y = 0.2 }

[observer]
family = "ekf"
initial = { x = 1 }
initial_variance = { x = 0.04 }

[fit]
"#;

/// What the logs are made of.
pub(crate) const K: f64 = 0.6;
const G: f64 = 1.2;
pub(crate) const R: f64 = 0.1;

/// Readings of x by its exact solution, 200 in 40 s; `read` gives that of x by two random numbers.
fn log(start: f64, density: f64, seed: u64, read: impl Fn(f64, f64) -> f64) -> String {
    let mut normal = Normal(seed);
    let step: f64 = 0.2;
    let keep = (-K * step).exp();
    let wander = (density * (1.0 - keep * keep) / (2.0 * K)).sqrt();
    let mut x = start;
    let mut text = "t,y,u\n".to_owned();
    for row in 0..200 {
        let u = if row / 25 % 2 == 0 { 1.0 } else { 0.2 };
        let y = read(x, normal.next());
        text += &format!("{},{y},{u}\n", step * f64::from(row));
        x = keep * x + G * u * (1.0 - keep) / K + wander * normal.next();
    }
    text
}

fn noisy(x: f64, random: f64) -> f64 {
    x + R * random
}

/// The plant, a log of it, and a study with these lines in `[fit]`.
pub(crate) fn folder(fit: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    folder.write("study.toml", &format!("{STUDY}{fit}\n"));
    folder.write("log.csv", &log(1.1, 0.0, 11, noisy));
    folder
}

pub(crate) const ALL: &str = "parameters = [\"k\", \"g\"]\nnoise = true";

/// The answer of a fit that ends well.
pub(crate) fn fitted(folder: &Folder, more: &[&str]) -> Value {
    let ended = folder.run(&[&["fit", "study.toml", "log.csv", "--json"], more].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    ended.json()
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The value is the truth by no more than three of its standard deviations.
#[track_caller]
pub(crate) fn holds(found: &Value, truth: f64) {
    let [value, sd] = ["value", "sd"].map(|key| number(&found[key]));
    assert!((value - truth).abs() < 3.0 * sd, "{truth}: {found:#}");
    assert!(sd < 0.2 * truth, "{found:#}");
}

#[test]
fn parameters_and_noise_are_found() {
    let folder = folder(ALL);
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["g"], G);
    holds(&answer["noise"]["y"], R);
    assert_eq!(answer["converged"], true);
    assert_eq!(answer["readings"], 200);
    assert!(answer["evaluations"].as_u64().unwrap() > 3);
    for empty in ["process_noise", "initial"] {
        assert_eq!(answer[empty], serde_json::json!({}));
    }
    for empty in ["undetermined", "warnings"] {
        assert_eq!(answer[empty], serde_json::json!([]));
    }
    let nll = number(&answer["nll"]);
    assert!(nll < number(&answer["nll_at_start"]));
    assert!((number(&answer["aic"]) - 2.0 * nll - 6.0).abs() < 1e-9);
    assert!((number(&answer["bic"]) - 2.0 * nll - 3.0 * 200_f64.ln()).abs() < 1e-9);
    assert_eq!(answer["optima"][0]["found"], 1);
    assert_eq!(number(&answer["optima"][0]["nll"]), nll);
    // sd and interval by the contract: even about a parameter, by a factor about a noise
    let k = &answer["parameters"]["k"];
    let [value, sd] = ["value", "sd"].map(|key| number(&k[key]));
    assert!((number(&k["interval"][1]) - value - 1.96 * sd).abs() < 1e-4 * sd);
    let y = &answer["noise"]["y"];
    let [value, sd] = ["value", "sd"].map(|key| number(&y[key]));
    assert!((number(&y["interval"][0]) / value - (-1.96 * sd / value).exp()).abs() < 1e-5);
    assert_eq!(y["at_bound"], false);
    let correlation = &answer["correlation"];
    assert_eq!(
        correlation["names"],
        serde_json::json!(["k", "g", "noise.y"])
    );
    let matrix = &correlation["matrix"];
    assert_eq!(number(&matrix[1][1]), 1.0);
    let off = number(&matrix[0][1]) - number(&matrix[1][0]);
    assert!(off.abs() < 1e-12, "{matrix}");
    assert!(number(&matrix[0][1]) > 0.3 && number(&matrix[0][2]).abs() < 0.1);
    // a profile of a likelihood that is nearly a parabola is nearly the same
    let profiles = fitted(&folder, &["--profiles"]);
    let own = &profiles["parameters"]["k"]["interval"];
    for end in 0..2 {
        let off = number(&own[end]) - number(&k["interval"][end]);
        assert!(
            off != 0.0 && off.abs() < 0.1 * number(&k["sd"]),
            "{own} {k:#}"
        );
    }
}

/// Only the numbers change, and from there nothing is left to gain.
#[test]
fn the_values_are_written() {
    let folder = folder(ALL);
    let before = folder.read("study.toml");
    let answer = fitted(&folder, &["--write"]);
    assert_eq!(answer["written"].as_array().unwrap().len(), 3, "{answer:#}");
    let after = folder.read("study.toml");
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let words = |text: &str| text.replace(is_number, "");
    assert_eq!(words(&before), words(&after));
    assert_ne!(before, after);
    let again = fitted(&folder, &[]);
    let [nll, start] = [&again["nll"], &again["nll_at_start"]].map(number);
    assert!((start - nll).abs() < 1e-6, "{start} beside {nll}");
    assert!((number(&answer["nll"]) - nll).abs() < 1e-9);
    assert!(again["evaluations"].as_u64() < answer["evaluations"].as_u64());
}

#[test]
fn what_is_not_there_is_written_anew() {
    let folder = folder("parameters = [\"k\"]\nprocess_noise = [\"x\"]\ninitial = [\"x\"]");
    folder.write("log.csv", &log(1.1, 0.02, 3, noisy));
    let answer = fitted(&folder, &["--write"]);
    holds_loosely(&answer["process_noise"]["x"], 0.02);
    let study = folder.read("study.toml");
    assert!(study.contains("[process_noise]\nx = 0.0"), "{study}");
    assert!(!study.contains("initial = { x = 1 }"), "{study}");
    let again = fitted(&folder, &[]);
    let gain = number(&again["nll_at_start"]) - number(&again["nll"]);
    assert!(gain.abs() < 1e-6, "{gain}");
}

/// Of a density, of which a log of 200 readings does not tell much.
#[track_caller]
fn holds_loosely(found: &Value, truth: f64) {
    let [low, high] = [0, 1].map(|end| number(&found["interval"][end]));
    assert!(0.5 * low < truth && truth < 2.0 * high, "{found:#}");
}

#[test]
fn each_log_has_its_own_start() {
    let folder = folder("parameters = [\"k\", \"g\"]\nnoise = [\"y\"]\ninitial = [\"x\"]");
    folder.write("other.csv", &log(3.0, 0.0, 2, noisy));
    let before = folder.read("study.toml");
    let answer = fitted(&folder, &["other.csv", "--write", "-o", "rows.csv"]);
    assert_eq!(answer["readings"], 400);
    let starts = &answer["initial"]["x"];
    assert_eq!(starts.as_array().unwrap().len(), 2);
    holds(&starts[0], 1.1);
    holds(&starts[1], 3.0);
    holds(&answer["parameters"]["k"], K);
    let names = answer["correlation"]["names"].to_string();
    assert!(
        names.contains("initial.x[1]") && names.contains("initial.x[2]"),
        "{names}"
    );
    let nll = number(&answer["nll"]);
    assert!((number(&answer["aic"]) - 2.0 * nll - 10.0).abs() < 1e-9);
    // starts of several logs stay out of the study
    let initial = "initial = { x = 1 }";
    assert!(before.contains(initial) && folder.read("study.toml").contains(initial));
    let rows = folder.read("rows.csv");
    assert!(
        rows.starts_with("log,t,y_innovation,y_innovation_sd,y_free_run_error\n1,0,"),
        "{rows}"
    );
    assert_eq!(rows.lines().count(), 401);
    assert!(rows.lines().last().unwrap().starts_with("2,39.8"));
}

/// The same answer as least squares: all errors are the sensor's.
#[test]
fn the_free_run_is_fitted() {
    let folder = folder(&format!("{ALL}\nobjective = \"simulation\""));
    let answer = fitted(&folder, &["-o", "rows.csv"]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["g"], G);
    let rows = folder.read("rows.csv");
    let squares = rows.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        assert_eq!(cells[1], cells[3], "the free run's error is what is fitted");
        cells[1].parse::<f64>().unwrap().powi(2)
    });
    let least = (squares.sum::<f64>() / 200.0).sqrt();
    let r = number(&answer["noise"]["y"]["value"]);
    assert!((r - least).abs() < 1e-5 * r, "{r} beside {least}");
    // nothing is uncertain about the start
    let study = folder.read("study.toml").replace("0.04", "4");
    folder.write("study.toml", &study);
    assert_eq!(fitted(&folder, &[])["nll"], answer["nll"]);
}

#[test]
fn a_prior_pulls() {
    let free = number(&fitted(&folder(ALL), &[])["parameters"]["k"]["value"]);
    let prior = format!("{ALL}\npriors = {{ k = {{ mean = 0.7, sd = 0.005 }} }}");
    let answer = fitted(&folder(&prior), &[]);
    let pulled = &answer["parameters"]["k"];
    let value = number(&pulled["value"]);
    assert!(value > free + 0.01 && value < 0.7, "{value} beside {free}");
    assert!(number(&pulled["sd"]) < 0.005);
    // the criteria are those of the likelihood alone
    assert!((number(&answer["aic"]) - 2.0 * number(&answer["nll"]) - 6.0).abs() < 1e-9);
}

#[test]
fn what_no_output_reads_is_told_before_the_search() {
    let folder = folder("parameters = [\"k\", \"idle\"]\nnoise = true");
    let before = folder.read("study.toml");
    let ended = folder.run(&["fit", "study.toml", "log.csv", "--json", "--write"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["undetermined"], serde_json::json!(["idle"]));
    assert_eq!(answer["converged"], false);
    assert_eq!(number(&answer["parameters"]["k"]["value"]), 0.5);
    assert!(answer["parameters"]["idle"]["sd"].is_null());
    assert!(
        ended
            .err
            .contains("the logs do not determine idle; leave one"),
        "{}",
        ended.err
    );
    assert_eq!(folder.read("study.toml"), before);
    // a prior fixes it
    let priors = "priors = { idle = { mean = 2, sd = 0.1 } }\n";
    folder.write("study.toml", &(before + priors));
    let answer = fitted(&folder, &[]);
    let idle = &answer["parameters"]["idle"];
    assert!(
        (number(&idle["value"]) - 2.0).abs() < 1e-6 && (number(&idle["sd"]) - 0.1).abs() < 1e-6
    );
}

/// Nothing moves from 0 without an input.
#[test]
fn a_log_without_information_is_told() {
    let folder = folder(ALL);
    let study = folder.read("study.toml");
    let still = study.replace("x = 1 }", "x = 0 }").replace("0.04", "0");
    folder.write("study.toml", &still);
    let row = |k: i32| format!("{k},{},0\n", 0.01 * f64::from(k * 7 % 5 - 2));
    let rows: String = (0..100).map(row).collect();
    folder.write("log.csv", &format!("t,y,u\n{rows}"));
    let ended = folder.run(&["fit", "study.toml", "log.csv", "--json"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert_eq!(
        ended.json()["undetermined"],
        serde_json::json!(["k", "g"]),
        "{}",
        ended.out
    );
    assert!(ended.err.contains("a log in which inputs excite it"));
    folder.write("log.csv", "t,y,u\n0,,0\n1,,0\n");
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("log.csv") && ended.err.contains("\"y\""));
}

/// Exit code 2, with the place and what to do.
#[test]
fn what_does_not_fit_is_refused() {
    for (fit, told) in [
        (
            "parameters = [\"kk\"]",
            "study.toml:14:15: `parameters` of [fit]: no parameter is called \"kk\"; did you mean \"k\"?",
        ),
        ("parameters = [\"u\"]", "choose from: k, g, idle"),
        (
            "parameters = [\"k\", \"k\"]",
            "study.toml:14:20: `parameters` of [fit] names k twice",
        ),
        (
            "parameters = [\"k\"]\nlog = [\"gg\"]",
            "study.toml:15:8: `log` of [fit]: no parameter is called \"gg\"",
        ),
        (
            "parameters = [\"k\"]\nlog = [\"g\"]",
            "study.toml:15:8: `log` of [fit] names g, which is not among its `parameters`",
        ),
        (
            "noise = [\"z\"]",
            "study.toml:14:10: `noise` of [fit]: no measured output is called \"z\"; choose from: y",
        ),
        (
            "process_noise = [\"z\"]",
            "study.toml:14:18: `process_noise` of [fit]: no state or unknown input",
        ),
        (
            "process_noise = true",
            "[process_noise] declares no density above 0; name the states",
        ),
        (
            "process_noise = [\"x\"]\nobjective = \"simulation\"",
            "reads no densities",
        ),
        (
            "initial = [\"z\"]",
            "study.toml:14:12: `initial` of [fit]: no state is called \"z\"; choose from: x",
        ),
        (
            "parameters = [\"k\"]\nbounds = { z = [1, 2] }",
            "study.toml:15:12: `bounds` of [fit]: no quantity that is fitted is called \"z\"; choose from: k",
        ),
        (
            "parameters = [\"k\"]\nbounds = { k = [2, 1] }",
            "[least, greatest value]",
        ),
        (
            "parameters = [\"k\"]\nbounds = { k = [1, 2] }",
            "study.toml:15:12: the search for k starts at 0.5, which its bounds [1, 2] exclude; start it within its bounds",
        ),
        (
            "parameters = [\"k\"]\nlog = [\"k\"]\nbounds = { k = [0, 2] }",
            "k is searched as a logarithm: expected a range above 0",
        ),
        (
            "noise = true\nbounds = { \"noise.y\" = [1, 2] }",
            "the search for the noise of y starts at 0.2",
        ),
        (
            "parameters = [\"k\"]\npriors = { z = { mean = 1, sd = 1 } }",
            "study.toml:15:12: `priors` of [fit]",
        ),
        (
            "parameters = [\"k\"]\npriors = { k = { mean = 1 } }",
            "`sd` is missing",
        ),
        (
            "parameters = [\"k\"]\npriors = { k = { mean = 1, sd = 0 } }",
            "sd",
        ),
        (
            "objective = \"innovation\"",
            "\"innovations\", \"simulation\"",
        ),
        ("starts = 0", "a whole number from 1 to 100000"),
        (
            "starts = 9000000000000000000",
            "a whole number from 1 to 100000",
        ),
        (
            "parameter = [\"k\"]",
            "study.toml:14:1: unknown key \"parameter\" in [fit]; did you mean \"parameters\"?",
        ),
        (
            "",
            "[fit] names nothing to find; add `parameters`, `noise`, `process_noise` or `initial` to [fit]",
        ),
    ] {
        let folder = folder(fit);
        let ended = folder.run(&["fit", "study.toml", "log.csv", "--json"]);
        assert_eq!(ended.code, 2, "{fit}: {}", ended.err);
        assert!(ended.err.contains(told), "{fit}: {}", ended.err);
        assert_eq!(ended.out, "", "{fit}");
    }
}

#[test]
fn a_name_in_unknown_and_in_fit_is_refused() {
    let folder = folder("parameters = [\"k\", \"g\"]");
    folder.change(
        "study.toml",
        "measured = [\"y\"]",
        "measured = [\"y\"]\nunknown = [\"g\"]",
    );
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    let told =
        "study.toml:15:20: g is in `unknown` of [sensors] and in `parameters` of [fit]; keep one";
    assert!(ended.err.contains(told), "{}", ended.err);
}

/// No square root of what is negative: the start has no likelihood, and the search from others goes on.
#[test]
fn a_start_without_a_likelihood_is_left() {
    let folder = folder("parameters = [\"k\"]\nnoise = true\nbounds = { k = [0.2, 1] }");
    folder.change("plant.mo", "-k*x", "-k*x + 0*sqrt(k - 0.55)");
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the likelihood has no value at the study's own values"),
        "{}",
        ended.err
    );
    assert!(ended.err.contains("more `starts`"), "{}", ended.err);
    let study = folder.read("study.toml").replace("g = 1.0", "g = 1.2");
    for more in ["", "starts = 6\nseed = 1\n"] {
        folder.write("study.toml", &(study.clone() + more));
        let answer = fitted(&folder, &[]);
        holds(&answer["parameters"]["k"], K);
        holds(&answer["noise"]["y"], R);
        assert!(answer["nll_at_start"].is_null());
    }
}

/// An oscillator's rate has many optima: the first search ends in one whose errors are not white, which is seen.
#[test]
fn a_doubtful_end_is_left_for_further_starts() {
    let folder = folder("parameters = [\"w\"]\nnoise = true\nobjective = \"simulation\"");
    folder.write(
        "plant.mo",
        "model Swing\n  parameter Real w(min = 0.2, max = 5) = 0.9;\n  Real x(start = 1);\n  Real v(start = 0);\n  output Real y = x;\nequation\n  der(x) = w*v;\n  der(v) = -w*x;\nend Swing;\n",
    );
    folder.change(
        "study.toml",
        "parameters = { k = 0.5, g = 1.0 }  # a guess\n",
        "",
    );
    folder.change("study.toml", "initial_variance = { x = 0.04 }\n", "");
    let mut normal = Normal(5);
    let row = |k: u32| {
        let t = 0.1 * f64::from(k);
        format!("{t},{}\n", (2.3 * t).cos() + R * normal.next())
    };
    folder.write(
        "log.csv",
        &("t,y\n".to_owned() + &(0..200).map(row).collect::<String>()),
    );
    let study = folder.read("study.toml");
    folder.write("study.toml", &(study.clone() + "starts = 1\n"));
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert!(
        ended
            .err
            .contains("errors of y are not white: the model misses something"),
        "{}{}",
        ended.out,
        ended.err
    );
    folder.write("study.toml", &study);
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["w"], 2.3);
    holds(&answer["noise"]["y"], R);
    assert!(
        answer.to_string().contains("further starts were tried"),
        "{answer:#}"
    );
}

/// The fast state settles within a step between rows, and its uncertainty falls below every number.
#[test]
fn a_stiff_plant_has_short_steps() {
    let folder = folder("parameters = [\"k\", \"g\"]\nnoise = true");
    folder.change(
        "plant.mo",
        "  output Real y",
        "  Real valve(start = 0, min = -20, max = 20);\n  output Real y",
    );
    folder.change(
        "plant.mo",
        "-k*x + g*u;",
        "-k*x + g*valve;\n  der(valve) = -900*(valve - u);",
    );
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["g"], G);
    holds(&answer["noise"]["y"], R);
}

#[test]
fn several_starts_end_in_one_optimum() {
    let folder = folder(&format!("{ALL}\nstarts = 5\nseed = 3"));
    let answer = fitted(&folder, &[]);
    assert_eq!(answer["optima"].as_array().unwrap().len(), 1, "{answer:#}");
    assert_eq!(answer["optima"][0]["found"], 5);
    assert_eq!(fitted(&folder, &[])["parameters"], answer["parameters"]);
}

#[test]
fn a_limit_leaves_the_best_so_far() {
    let folder = folder(&format!("{ALL}\nstarts = 20000"));
    let limited = |limit: &str| {
        folder.run(&[
            "fit",
            "study.toml",
            "log.csv",
            "--json",
            "--time-limit",
            limit,
        ])
    };
    let ended = limited("2");
    assert_eq!(ended.code, 3, "{}", ended.err);
    let answer = ended.json();
    assert!(number(&answer["nll"]) < number(&answer["nll_at_start"]) - 1.0);
    assert!((number(&answer["parameters"]["k"]["value"]) - K).abs() < 0.1);
    // before there is a likelihood there is nothing to tell but that
    let ended = limited("0.00001");
    assert_eq!(ended.code, 3, "{}", ended.err);
    assert!(
        ended.err.contains("the limit of 0.00001 s ended it"),
        "{}",
        ended.err
    );
}

/// One-sided: the log says how large the noise is at most.
#[test]
fn a_noise_that_is_none_is_told_so() {
    let folder = folder(&format!("{ALL}\nprocess_noise = [\"x\"]"));
    let (mut at_bound, mut told) = (0, 0);
    let without = folder.read("study.toml");
    for seed in 0..12 {
        folder.write("log.csv", &log(1.1, 0.0, 100 + seed, noisy));
        let answer = fitted(&folder, &["--profiles"]);
        let x = &answer["process_noise"]["x"];
        let is_told = answer["warnings"]
            .to_string()
            .contains("the process noise of x: the log cannot tell it from 0");
        told += u32::from(is_told);
        if x["at_bound"] == true {
            at_bound += 1;
            assert!(is_told && x["sd"].is_null());
        }
        let [value, low, high] = [&x["value"], &x["interval"][0], &x["interval"][1]].map(number);
        assert_eq!(is_told, low < 1e-6, "{answer:#}");
        assert!(value <= high && high < 0.02, "{answer:#}");
        holds(&answer["noise"]["y"], R);
        // with the density at the end of its interval −log L is half of 2.71 higher
        if x["at_bound"] == true {
            let own = without.replace("process_noise = [\"x\"]", "")
                + &format!("[process_noise]\nx = {high:e}\n");
            folder.write("study.toml", &own);
            let rise = number(&fitted(&folder, &[])["nll"]) - number(&answer["nll"]);
            assert!((rise - 1.3528).abs() < 0.01, "{rise}");
            folder.write("study.toml", &without);
        }
        // what is told has one side even where no profile is asked for
        let brief = fitted(&folder, &[]);
        if is_told {
            assert_eq!(brief["process_noise"], answer["process_noise"]);
        }
        assert_ne!(brief["parameters"], answer["parameters"]);
    }
    assert!(at_bound >= 3 && told >= 10, "{at_bound} {told}");
    // where there is one, it is told
    folder.write("log.csv", &log(1.1, 0.02, 3, noisy));
    let answer = fitted(&folder, &["--profiles"]);
    assert_eq!(answer["warnings"], serde_json::json!([]));
    assert!(number(&answer["process_noise"]["x"]["interval"][0]) > 1e-3);
}

/// A bound that the study declares is not 0.
#[test]
fn a_parameter_at_its_bound_has_one_side() {
    let folder = folder(&format!("{ALL}\nbounds = {{ k = [0.2, 0.55] }}"));
    let answer = fitted(&folder, &[]);
    let k = &answer["parameters"]["k"];
    assert_eq!(k["at_bound"], true);
    assert!(k["sd"].is_null());
    assert_eq!(number(&k["value"]), 0.55);
    assert_eq!(number(&k["interval"][1]), 0.55);
    let low = number(&k["interval"][0]);
    assert!(0.4 < low && low < 0.55, "{k:#}");
    assert!(
        answer["warnings"]
            .to_string()
            .contains("k is at its bound, 0.55")
    );
    let names = answer["correlation"]["names"].to_string();
    assert!(!names.contains("\"k\""), "{names}");
}

/// A sensor that shows no more than its range says where it is there, which ordinary readings would not.
#[test]
fn a_sensor_s_range_is_censored() {
    let folder = folder(ALL);
    let ends = |x: f64, random: f64| noisy(x, random).clamp(0.6, 1.7);
    folder.write("log.csv", &log(1.1, 0.0, 4, ends));
    folder.change(
        "study.toml",
        "noise = {",
        "limits = { y = [0.6, 1.7] }\nnoise = {",
    );
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["g"], G);
    holds(&answer["noise"]["y"], R);
    // readings at an end say nothing of that
    let squares = number(&answer["errors"]["y"]["fitted"]["squares"]);
    assert!((0.7..1.2).contains(&squares), "{squares}");
    folder.change("study.toml", "limits = { y = [0.6, 1.7] }\n", "");
    let naive = fitted(&folder, &[]);
    assert!(number(&naive["parameters"]["g"]["value"]) < 0.95 * G);
}

#[test]
fn noises_keep_the_form_that_the_study_has() {
    let folder = folder(ALL);
    folder.write(
        "log.csv",
        &log(3.0, 0.0, 5, |x, random| x * (1.0 + 0.04 * random)),
    );
    folder.change("study.toml", "g = 1.0 }", "g = 1.0 }  # near");
    folder.change("study.toml", "y = 0.2", "y = \"20%\"");
    folder.change("study.toml", "[observer]\n", "[observer]\n# share\n");
    let answer = fitted(&folder, &["--write"]);
    let share = number(&answer["noise"]["y"]["value"]);
    let study = folder.read("study.toml");
    let written = study
        .split("y = \"")
        .nth(1)
        .and_then(|rest| rest.split('%').next());
    let written: f64 = written.unwrap().parse().unwrap();
    assert!((written - 100.0 * share).abs() < 0.01, "{study}");
    assert!((share - 0.04).abs() < 0.02, "{answer:#}");
    folder.change(
        "study.toml",
        &format!("\"{written}%\""),
        "{ uniform = 0.4 }",
    );
    let mut uniform = Normal(9);
    let mut read = log(1.1, 0.0, 6, |x, _| x);
    read = read
        .lines()
        .enumerate()
        .map(|(row, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            match row {
                0 => format!("{line}\n"),
                _ => {
                    let y = cells[1].parse::<f64>().unwrap() + 0.4 * uniform.uniform() - 0.2;
                    format!("{},{y},{}\n", cells[0], cells[2])
                }
            }
        })
        .collect();
    folder.write("log.csv", &read);
    let answer = fitted(&folder, &["--write"]);
    let bound = number(&answer["noise"]["y"]["value"]);
    assert!((bound - 0.2).abs() < 0.03, "{answer:#}");
    let study = folder.read("study.toml");
    assert!(study.contains("y = { uniform = 0."), "{study}");
    assert!(!study.contains("uniform = 0.4 "), "{study}");
}

#[test]
fn a_simulated_log_gives_back_its_plant() {
    let folder = folder(ALL);
    let truth = "k = 0.6, g = 1.2";
    let study = folder.read("study.toml");
    let simulated = study.replace("k = 0.5, g = 1.0", truth).replace(
        "[fit]",
        "[simulate]\nuntil = 40\nsample_step = 0.2\nseed = 7\ninputs = { u = \"if time < 15 then 1 else -0.5\" }\n[fit]",
    );
    folder.write("truth.toml", &simulated);
    let ended = folder.run(&["simulate", "truth.toml", "--log", "log.csv", "-o", "o.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = fitted(&folder, &[]);
    holds(&answer["parameters"]["k"], K);
    holds(&answer["parameters"]["g"], G);
    holds(&answer["noise"]["y"], 0.2);
}

/// On a linear plant both filters are one; on another they are not, and each has its own likelihood.
#[test]
fn an_unscented_filter_has_its_own_likelihood() {
    let folder = folder(&format!("{ALL}\nprocess_noise = [\"x\"]"));
    folder.write("log.csv", &log(1.1, 0.02, 3, noisy));
    let both = |folder: &Folder| {
        ["ekf", "ukf"].map(|family| {
            let study = folder.read("study.toml");
            folder.write(
                "own.toml",
                &study.replace("\"ekf\"", &format!("\"{family}\"")),
            );
            let ended = folder.run(&["fit", "own.toml", "log.csv", "--json"]);
            assert_eq!(ended.code, 0, "{}", ended.err);
            assert!(!ended.err.contains("note:"), "{}", ended.err);
            ended.json()
        })
    };
    let [ekf, ukf] = both(&folder);
    assert!((number(&ekf["nll"]) - number(&ukf["nll"])).abs() < 1e-6);
    for name in ["k", "g"] {
        let [a, b] = [&ekf, &ukf].map(|answer| number(&answer["parameters"][name]["value"]));
        assert!((a - b).abs() < 1e-5 * b, "{name}: {a} beside {b}");
    }
    folder.change("plant.mo", "-k*x + g*u", "-k*x + 0.05*sin(3*x) + g*u");
    let [ekf, ukf] = both(&folder);
    let apart = (number(&ekf["nll"]) - number(&ukf["nll"])).abs();
    assert!((1e-5..1.0).contains(&apart), "{apart}");
}
