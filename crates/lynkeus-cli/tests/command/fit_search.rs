//! What the search of `lynkeus fit` cannot see by itself, and what it is told of its logs.

use crate::Folder;
use crate::fit::{ALL, fitted, folder, holds, number};
use crate::normal::Normal;

const SINE: &str = r#"model Sine
  parameter Real w(min = 0.2, max = 10) = 5.5;
  parameter Real a(min = 0, max = 10) = 1;
  Real z(start = 0, min = -20, max = 20);
  output Real y = a*sin(w*time) + z;
equation
  der(z) = 0;
end Sine;
"#;

/// From 5.5 the search ends at a hill's foot where nothing oscillates; the profile of w runs into the real one.
#[test]
fn the_search_goes_on_where_a_profile_falls() {
    let folder = Folder::empty();
    let mut normal = Normal(11);
    let mut log = "t,y\n".to_owned();
    for row in 0..40 {
        let t = 0.1 * f64::from(row);
        log += &format!("{t},{}\n", 1.5 * (2.3 * t).sin() + 0.3 * normal.next());
    }
    folder.write("plant.mo", SINE);
    folder.write("log.csv", &log);
    folder.write(
        "study.toml",
        "plant = \"plant.mo\"\nsensors = { noise = { y = 0.3 } }\nobserver = { initial_variance = { z = 0 } }\n[fit]\nparameters = [\"w\", \"a\"]\nnoise = true\nstarts = 1\n",
    );
    let alone = fitted(&folder, &[]);
    assert!(number(&alone["parameters"]["w"]["value"]) > 4.0);
    let answer = fitted(&folder, &["--profiles"]);
    holds(&answer["parameters"]["w"], 2.3);
    holds(&answer["parameters"]["a"], 1.5);
    let optima = answer["optima"].as_array().unwrap();
    assert_eq!(optima[0]["nll"], answer["nll"]);
    let first = &optima[optima.len() - 1]["nll"];
    assert!((number(first) - number(&alone["nll"])).abs() < 1e-3);
    assert!(
        answer["notes"]
            .to_string()
            .contains("a profile met a lower"),
        "{}",
        answer["notes"]
    );
}

/// −log L has steps along the instant of a jump, and its derivative is 0 between them.
#[test]
fn a_parameter_that_only_moves_a_jump_is_refused() {
    let folder = folder("parameters = [\"k\", \"late\"]");
    folder.change(
        "plant.mo",
        "  input",
        "  parameter Real late(min = 1, max = 30) = 5;\n  input",
    );
    folder.change(
        "plant.mo",
        "+ g*u",
        "+ g*u + (if time > late then 0.5 else 0)",
    );
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended.err.contains("late moves where the model jumps"),
        "{}",
        ended.err
    );
    // where the branches meet, there is a slope
    folder.change(
        "plant.mo",
        "(if time > late then 0.5 else 0)",
        "(if time > late then 0.01*(time - late) else 0)",
    );
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert!(!ended.err.contains("jumps"), "{}", ended.err);
}

#[test]
fn a_whole_number_is_not_searched() {
    let folder = folder("parameters = [\"stages\"]");
    folder.change(
        "plant.mo",
        "  input",
        "  parameter Integer stages = 2;\n  input",
    );
    folder.change("plant.mo", "-k*x", "-k*x/stages");
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("\"stages\" is an Integer"),
        "{}",
        ended.err
    );
}

#[test]
fn a_prior_beside_its_bounds_is_told() {
    let folder = folder(&format!(
        "{ALL}\npriors = {{ k = {{ mean = 7, sd = 10 }} }}"
    ));
    let warnings = fitted(&folder, &[])["warnings"].to_string();
    assert!(
        warnings.contains("the prior of k has its mean, 7, outside of the bounds [0.05, 5]"),
        "{warnings}"
    );
}

#[test]
fn as_many_values_as_readings_leave_nothing_to_judge_by() {
    let folder = folder("parameters = [\"k\", \"g\"]");
    folder.write("log.csv", "t,y,u\n0,1.1,1\n4,1.9,1\n");
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert!(
        ended
            .err
            .contains("2 readings for 2 values: nothing is left"),
        "{}",
        ended.err
    );
}

#[test]
fn a_gap_that_parts_two_logs_is_told_as_such() {
    let folder = folder(ALL);
    let mut log = folder.read("log.csv");
    log += "500000,1,1\n";
    folder.write("log.csv", &log);
    let ended = folder.run(&["fit", "study.toml", "log.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("log.csv: no row between 39.8 and 500000")
            && ended.err.contains("as two logs"),
        "{}",
        ended.err
    );
}

#[test]
fn what_is_said_of_several_logs_names_them() {
    let folder = folder(ALL);
    let log = folder.read("log.csv");
    folder.write("other.csv", &log.replacen("\n0.2,", "\n0.1,nan,1\n0.2,", 1));
    let ended = folder.run(&["fit", "study.toml", "log.csv", "other.csv"]);
    assert!(
        ended.err.contains("note: other.csv: column \"y\""),
        "{}",
        ended.err
    );
}

/// A boiler with C and, in the study, this one.
fn boiler(c: f64, fit: &str) -> Folder {
    let folder = Folder::empty();
    let mut normal = Normal(5);
    let (mut log, mut level) = ("t,power,y\n".to_owned(), 20.0);
    for row in 0..240 {
        let power = if row % 80 < 40 { 2.0 } else { 0.2 };
        let t = f64::from(row) / 60.0;
        log += &format!("{t},{power},{}\n", level + 0.5 * normal.next());
        level += (power - 0.012 * (level - 20.0)) / 0.35 / 60.0 * 1.1;
    }
    folder.write("log.csv", &log);
    folder.write(
        "plant.mo",
        &format!(
            "model Boiler
  input Real power;
  parameter Real C(min = 0.05, max = 5) = {c};
  parameter Real k(min = 0.001, max = 1) = 0.012;
  Real T(start = 20, min = 0, max = 200);
  output Real y = T;
equation
  C*der(T) = power - k*(T - 20);
end Boiler;
"
        ),
    );
    folder.write(
        "study.toml",
        &format!(
            "plant = \"plant.mo\"\nprocess_noise = {{ T = 0.5 }}\nsensors = {{ noise = {{ y = 0.5 }} }}\nobserver = {{ family = \"ekf\" }}\n[fit]\nnoise = true\nprocess_noise = [\"T\"]\n{fit}\n"
        ),
    );
    folder
}

/// The density ends at nothing, where a logarithm has no slope; beside C's own value there is a better one. A profile
/// that stayed at nothing ended where −log L is 1.73 above its least.
#[test]
fn a_profile_does_not_stay_where_a_noise_is_nothing() {
    let answer = fitted(
        &boiler(0.35, "parameters = [\"C\", \"k\"]"),
        &["--profiles"],
    );
    for end in 0..2 {
        let edge = number(&answer["parameters"]["C"]["interval"][end]);
        let there = boiler(edge, "parameters = [\"k\"]\nstarts = 8");
        let rise = number(&fitted(&there, &[])["nll"]) - number(&answer["nll"]);
        assert!((rise - 1.92).abs() < 0.02, "{edge}: {rise}");
    }
}

/// Values of a model that does not hold: a decay, fitted to one that swings ten deviations of the noise about it.
#[test]
fn values_that_the_readings_contradict_are_not_credible() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model Decay
  parameter Real k = 0.4;
  Real x(start = 1, fixed = true);
  output Real y = x;
equation
  der(x) = -k*x;
end Decay;
",
    );
    let study = "plant = \"m.mo\"\n[parameters]\nk = 0.4\n[sensors]\nnoise = { y = 0.01 }\n[observer]\nfamily = \"ekf\"\ninitial_variance = { x = 1e-4 }\n[fit]\nparameters = [\"k\"]\n";
    folder.write("s.toml", study);
    let log = |swing: f64| {
        let rows = (0..100).map(|i| {
            let t = 0.1 * f64::from(i);
            let noise = 0.01 * (1.7 * f64::from(i * i)).sin();
            format!(
                "{t},{}\n",
                (-0.5 * t).exp() + swing * (2.0 * t).sin() + noise
            )
        });
        format!("t,y\n{}", rows.collect::<String>())
    };
    folder.write("log.csv", &log(0.1));
    let arguments = ["fit", "s.toml", "log.csv", "--json", "--write"];
    let run = folder.run(&arguments);
    assert_eq!(run.code, 1, "{}\n{}", run.out, run.err);
    let told = run.json();
    assert_eq!(
        (&told["converged"], &told["credible"]),
        (&true.into(), &false.into())
    );
    assert!(
        told["doubts"][0]["text"].as_str().unwrap().contains("of y"),
        "{told}"
    );
    assert!(
        run.err
            .contains("the values are not credible: the innovations of y"),
        "{}",
        run.err
    );
    assert_eq!(folder.read("s.toml"), study);
    let said = folder.run(&arguments[..3]).out;
    assert!(
        said.lines()
            .next()
            .unwrap()
            .contains("not credible: the innovations of y"),
        "{said}"
    );
    // without the swing they are
    folder.write("log.csv", &log(0.0));
    let run = folder.run(&arguments);
    assert_eq!(run.code, 0, "{}\n{}", run.out, run.err);
    assert_eq!(run.json()["credible"], true);
    assert_ne!(folder.read("s.toml"), study);
}
