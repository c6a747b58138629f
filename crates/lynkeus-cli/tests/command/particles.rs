//! What no Gaussian holds: a particle filter from the study to the answer.

use serde_json::Value;

use crate::{Ended, Folder};

const TERRAIN: &str = "model Terrain
  Real x(start = 11, unit = \"km\");
  Real drift(start = 0.03);
  input Real speed;
  output Real height = 3*sin(0.6*x) + 2*sin(0.23*x + 1) + sin(1.4*x);
equation
  der(x) = speed + drift;
  der(drift) = 0;
end Terrain;
";

/// Where it is, a vehicle knows to 10 km; the height below it is that of several places.
fn terrain(observer: &str, rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("terrain.mo", TERRAIN);
    let study = format!(
        "plant = \"terrain.mo\"
sensors = {{ measured = [\"height\"], noise = {{ height = 0.3 }} }}
process_noise = {{ x = 0.002, drift = 0.00002 }}
observer = {{ initial = {{ x = 0, drift = 0 }}, initial_variance = {{ x = 100, drift = 0.001 }}, {observer} }}
[simulate]
until = 40
output_step = 0.5
inputs = {{ speed = \"0.5\" }}
seed = 2
{rest}
"
    );
    folder.write("study.toml", &study);
    folder
}

const DRAWN: &str = "family = \"particle\", particles = 2000";

fn summary(folder: &Folder, arguments: &[&str]) -> (i32, Value) {
    let ended = folder.run(arguments);
    (ended.code, ended.json())
}

fn succeed(folder: &Folder, arguments: &[&str]) {
    let Ended { code, err, .. } = folder.run(arguments);
    assert_eq!(code, 0, "{err}");
}

/// A Kalman filter takes the hill that is next to where it starts, and is certain of it; particles keep all of them until
/// one is left.
#[test]
fn particles_find_the_hill_that_a_kalman_filter_misses() {
    let folder = terrain(DRAWN, "[estimate]\nsd = true\ness = true");
    let (code, found) = summary(
        &folder,
        &["simulate", "study.toml", "--json", "-o", "out.csv"],
    );
    assert_eq!(
        (code, &found["credible"]),
        (0, &Value::Bool(true)),
        "{found}"
    );
    let error = found["rms_error_last_half"]["x"].as_f64().unwrap();
    assert!(error < 0.5, "{error}");
    let told = &found["particles"];
    assert_eq!(
        (&told["particles"], &told["updates"], &told["starved"]),
        (&2000.into(), &81.into(), &0.into())
    );
    assert!(told["resampled"].as_u64().unwrap() > 3, "{told}");
    let lowest = told["lowest_ess"].as_f64().unwrap();
    let table = folder.read("out.csv");
    let mut rows = table.lines();
    let place = rows
        .next()
        .unwrap()
        .split(',')
        .position(|h| h == "ess")
        .unwrap();
    let column: Vec<f64> = rows
        .map(|row| row.split(',').nth(place).unwrap().parse().unwrap())
        .collect();
    let least = column.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((least / lowest - 1.0).abs() < 1e-6, "{least} {lowest}");
    for other in ["family = \"ekf\"", "family = \"ukf\""] {
        let (_, found) = summary(&terrain(other, ""), &["simulate", "study.toml", "--json"]);
        let wrong = found["rms_error_last_half"]["x"].as_f64().unwrap();
        assert!(wrong > 5.0 * error, "{other} {wrong} {error}");
    }
}

/// On a log `compare` tells by the likelihood of the readings which of them knows what it does not know.
#[test]
fn compare_tells_who_foresees_the_readings() {
    let families = "[compare]\nfamilies = [\"ekf\", \"particle\"]";
    let folder = terrain(DRAWN, families);
    succeed(&folder, &["simulate", "study.toml", "--log", "log.csv"]);
    let (_, found) = summary(&folder, &["compare", "study.toml", "log.csv", "--json"]);
    let rows = found["families"]
        .as_array()
        .unwrap_or_else(|| panic!("{found}"));
    let chance = |place: usize| {
        rows[place]["nll_per_reading"]
            .as_f64()
            .unwrap_or(f64::INFINITY)
    };
    assert!(chance(1) < 1.0 && chance(0) > chance(1) + 0.5, "{found}");
}

/// The same seed gives the same file.
#[test]
fn a_run_can_be_repeated() {
    let folder = terrain(
        &format!("{DRAWN}, proposal = \"auxiliary\""),
        "[estimate]\nsd = true\ness = true",
    );
    succeed(&folder, &["simulate", "study.toml", "--log", "log.csv"]);
    for out in ["one.csv", "two.csv"] {
        succeed(
            &folder,
            &["estimate", "study.toml", "log.csv", "-o", out, "-q"],
        );
    }
    assert_eq!(folder.read("one.csv"), folder.read("two.csv"));
    assert!(folder.read("one.csv").contains("ess"));
}

/// Readings that nothing explains are no estimate, and never NaN.
#[test]
fn particles_that_explain_nothing_are_not_credible() {
    let folder = terrain("family = \"particle\", particles = 300", "");
    let study = folder
        .read("study.toml")
        .replace("height = 0.3", "height = { uniform = 0.3 }");
    folder.write("study.toml", &study);
    let rows = (0..12).map(|k| format!("{k},{},0.5\n", if k < 6 { 4.0 } else { 90.0 }));
    folder.write(
        "log.csv",
        &("t,height,speed\n".to_owned() + &rows.collect::<String>()),
    );
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended.err.contains("no particle explains the readings of"),
        "{}",
        ended.err
    );
    assert!(!folder.read("out.csv").contains("NaN"));
}

#[test]
fn what_particles_cannot_do_is_refused_with_a_reason() {
    for (observer, rest, arguments, told) in [
        (
            DRAWN,
            "[estimate]\nsmooth = true",
            &["simulate", "study.toml"][..],
            "has no smoother",
        ),
        (
            DRAWN,
            "",
            &["export", "study.toml", "--to", "c", "-o", "c"][..],
            "not exported",
        ),
        (
            "family = \"particle\", particles = 1",
            "",
            &["simulate", "study.toml"][..],
            "`particles`",
        ),
        (
            "family = \"particle\", resample_below = 2",
            "",
            &["simulate", "study.toml"][..],
            "`resample_below`",
        ),
        (
            "family = \"particle\", proposal = \"magic\"",
            "",
            &["simulate", "study.toml"][..],
            "`proposal`",
        ),
        (
            "family = \"particle\", bounds = \"project\"",
            "",
            &["simulate", "study.toml"][..],
            "`bounds`",
        ),
    ] {
        let ended = terrain(observer, rest).run(arguments);
        assert!(
            ended.code != 0 && ended.err.contains(told),
            "{told}: {}",
            ended.err
        );
    }
}

/// Errors of an input's reading are drawn anew in every row, of every particle: a linear plant's deviations are those of the
/// Kalman filter, which are exact, within what 4,000 particles scatter.
#[test]
fn errors_of_inputs_are_new_in_every_row() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M\n  input Real u;\n  Real x(start = 1);\n  output Real y = x;\nequation\n  der(x) = u - x;\nend M;\n",
    );
    let deviation = |observer: &str| {
        let study = format!(
            "plant = \"m.mo\"\nsensors = {{ measured = [\"y\"], noise = {{ y = 0.3 }}, input_noise = {{ u = 1 }} }}\n\
             observer = {{ initial_variance = {{ x = 0.1 }}, {observer} }}\n\
             [simulate]\nuntil = 20\noutput_step = 0.5\ninputs = {{ u = \"1\" }}\n[estimate]\nsd = true\n"
        );
        folder.write("study.toml", &study);
        succeed(&folder, &["simulate", "study.toml", "--log", "log.csv"]);
        succeed(
            &folder,
            &["estimate", "study.toml", "log.csv", "-o", "out.csv"],
        );
        let table = folder.read("out.csv");
        let place = table
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|h| h == "x_sd")
            .unwrap();
        let rows = table.lines().skip(20);
        let all: Vec<f64> = rows
            .map(|row| row.split(',').nth(place).unwrap().parse().unwrap())
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let exact = deviation("family = \"ekf\"");
    let drawn = deviation("family = \"particle\", particles = 4000");
    assert!((drawn / exact - 1.0).abs() < 0.02, "{drawn} {exact}");
}
