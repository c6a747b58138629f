//! The verdict `credible`: of short logs, of every family, on the whole run.

use std::fmt::Write;

use crate::{Ended, Folder, csv};

const CONSTANT: &str =
    "model M\n  Real x(start = 1);\n  output Real y = x;\nequation\n  der(x) = 0;\nend M;\n";
const WELLS: &str = "model M\n  Real x(start = 1, min = -2, max = 2);\n  output Real y = x;\nequation\n  der(x) = x - x^3;\nend M;\n";

/// A log of y at whole times, `estimate`d with `--json`.
fn estimated(model: &str, study: &str, y: impl Iterator<Item = f64>) -> (Folder, Ended) {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    let sensors = "plant = \"m.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = { y = 0.01 }\n";
    folder.write("s.toml", &format!("{sensors}{study}"));
    let mut log = "t,y\n".to_owned();
    for (k, y) in y.enumerate() {
        let cell = if y.is_nan() {
            String::new()
        } else {
            y.to_string()
        };
        writeln!(log, "{k},{cell}").unwrap();
    }
    folder.write("log.csv", &log);
    let ended = folder.run(&["estimate", "s.toml", "log.csv", "--json", "-o", "o.csv"]);
    (folder, ended)
}

/// ±0.01, the same in every run.
fn noise(k: usize) -> f64 {
    0.01 * if (k * k / 3).is_multiple_of(2) {
        1.0
    } else {
        -1.0
    }
}

fn levels(ended: &Ended, level: &str) -> Vec<String> {
    let json = ended.json();
    let doubts = json["doubts"].as_array().unwrap();
    let own = doubts.iter().filter(|d| d["level"] == level);
    own.map(|d| {
        format!(
            "{} {}",
            d["kind"].as_str().unwrap(),
            d["name"].as_str().unwrap()
        )
    })
    .collect()
}

const EKF: &str =
    "[process_noise]\nx = 0\n[observer]\nfamily = \"ekf\"\ninitial_variance = { x = 0.01 }\n";

/// A constant that grows by a hundred noises per row is refused from two readings on, one that is
/// constant never.
#[test]
fn short_logs_are_judged() {
    for rows in [2, 3, 5, 8, 13, 19, 25, 60] {
        let (folder, wrong) = estimated(CONSTANT, EKF, (0..rows).map(|k| 1.0 + k as f64));
        assert_eq!(wrong.code, 1, "{rows}: {}", wrong.err);
        assert!(
            wrong.err.contains("not credible: the innovations of y"),
            "{}",
            wrong.err
        );
        assert_eq!(levels(&wrong, "refusal"), ["innovations y"]);
        assert_eq!(csv(&folder.read("o.csv")).1.len(), rows);
        let (_, right) = estimated(CONSTANT, EKF, (0..rows).map(|k| 1.0 + noise(k)));
        assert_eq!(
            (right.code, right.json()["credible"].as_bool()),
            (0, Some(true))
        );
    }
}

/// A third of the run, wherever it is, and however few readings there are.
#[test]
fn a_stretch_counts_as_the_end_does() {
    for rows in [30, 300] {
        for from in [rows / 9, rows / 3] {
            let hang = from..from + rows / 3;
            let drifting = "[process_noise]\nx = 1e-8\n[observer]\nfamily = \"ekf\"\n";
            let y = move |k: usize| {
                1.0 + noise(k)
                    + if hang.contains(&k) {
                        0.3 * k as f64
                    } else {
                        0.0
                    }
            };
            let (_, ended) = estimated(CONSTANT, drifting, (0..rows).map(y));
            assert_eq!(ended.code, 1, "{rows} {from}: {}", ended.out);
        }
    }
}

/// An estimate in the wrong well, with a gain that is too small to bring it over, and one that does.
#[test]
fn families_are_judged_by_their_own_sensors() {
    for sd in ["sd = true", "sd = false", "between_samples = \"linear\""] {
        let study = |theta: f64| {
            format!(
                "[observer]\nfamily = \"triangular\"\ntheta = {theta}\ninitial = {{ x = -1 }}\n[estimate]\n{sd}\n"
            )
        };
        let y = || (0..80).map(|k| 1.0 + noise(k));
        let (_, wrong) = estimated(WELLS, &study(0.1), y());
        assert_eq!(wrong.code, 1, "{sd}: {}", wrong.out);
        assert_eq!(levels(&wrong, "refusal"), ["innovations y"]);
        let (_, right) = estimated(WELLS, &study(4.0), y());
        assert_eq!(right.code, 0, "{sd}: {}", right.err);
    }
}

/// A constant that grows by five noises per row: an observer that follows it lags by as much, which its
/// error system does not explain, whether or not deviations are told.
#[test]
fn families_are_judged_by_their_error_system() {
    for sd in ["sd = true", "sd = false", "between_samples = \"linear\""] {
        let study = format!(
            "[observer]\nfamily = \"triangular\"\ntheta = 1\ninitial = {{ x = 1 }}\n[estimate]\n{sd}\n"
        );
        let y = |slope: f64| (0..80).map(move |k| 1.0 + slope * f64::from(k) + noise(k as usize));
        let (_, wrong) = estimated(CONSTANT, &study, y(0.05));
        assert_eq!(levels(&wrong, "refusal"), ["innovations y"], "{sd}");
        let (_, right) = estimated(CONSTANT, &study, y(0.0));
        assert_eq!(right.code, 0, "{sd}: {}", right.err);
    }
}

/// A noise that is declared a hundred times too large is told, and refuses nothing.
#[test]
fn too_small_is_a_warning() {
    let (_, ended) = estimated(CONSTANT, EKF, (0..60).map(|k| 1.0 + 0.01 * noise(k)));
    assert_eq!(ended.code, 0);
    assert_eq!(levels(&ended, "warning"), ["noise y"]);
    assert!(
        ended.err.contains("note: the innovations of y are"),
        "{}",
        ended.err
    );
}

#[test]
fn innovations_are_columns() {
    let families = [EKF, "[observer]\nfamily = \"triangular\"\ntheta = 1\n"];
    for (family, model) in families.iter().zip([CONSTANT, WELLS]) {
        let y = |k: usize| if k == 7 { f64::NAN } else { 1.0 + noise(k) };
        let study = format!("{family}[estimate]\ninnovations = true\n");
        let (folder, ended) = estimated(model, &study, (0..20).map(y));
        assert_eq!(ended.code, 0, "{}", ended.err);
        // what is not there is an empty cell
        let text = folder
            .read("o.csv")
            .replace(",,", ",NaN,")
            .replace(",\n", ",NaN\n");
        let (header, rows) = csv(&text);
        assert_eq!(header, ["t", "x_hat", "y_innovation", "y_innovation_sd"]);
        for (k, row) in rows.iter().enumerate().filter(|(k, _)| *k > 0) {
            if k == 7 {
                assert!(row[2].is_nan() && row[3].is_nan());
                continue;
            }
            // x is constant between the rows of the first model, so that y is expected where x was
            if model == CONSTANT {
                assert!(
                    (row[2] - (y(k) - rows[k - 1][1])).abs() < 1e-9,
                    "{k}: {row:?}"
                );
            }
            assert!(
                row[3] >= 0.01 && row[2].abs() < 6.0 * row[3],
                "{k}: {row:?}"
            );
        }
    }
}

const PENDULUM: &str = "model M\n  Real y0(start = 0.3, min = -4, max = 4);\n  Real v(start = 0, min = -8, max = 8);\n  output Real y = y0;\nequation\n  der(y0) = v;\n  der(v) = -4*sin(y0) - 0.5*v;\nend M;\n";
const TRIANGULAR: &str = "[process_noise]\nv = 0.001\n[observer]\nfamily = \"triangular\"\ntheta = 4\n[estimate]\nsd = true\n";

/// A few rows of a right log, from 0.21 beside the declared start: the observer has had no time, which says nothing
/// against it.
#[test]
fn a_start_that_is_not_forgotten_is_no_contradiction() {
    let slow = PENDULUM.replace("-4*sin(y0) - 0.5*v", "-1e-6*sin(y0)");
    let slow = slow.replace("der(y0) = v", "der(y0) = 0.05*v");
    for rows in [3, 5, 10] {
        let right = (0..rows).map(|k| 0.51 + noise(k));
        let study = TRIANGULAR.replace("theta = 4", "theta = 0.05");
        let (_, ended) = estimated(&slow, &study, right);
        assert_eq!(ended.code, 0, "{rows}: {}", ended.err);
    }
}

/// Readings of the wrong sign take the estimate where the model has no value.
#[test]
fn a_run_that_readings_end_names_them() {
    let model = "model M\n  Real h(start = 1, min = 0.1, max = 4);\n  Real q(start = 0.1, min = 0, max = 1);\n  output Real y = h;\nequation\n  der(h) = q - 0.2*sqrt(h);\n  der(q) = 0;\nend M;\n";
    let study = "[process_noise]\nq = 1e-4\n[observer]\nfamily = \"triangular\"\ntheta = 2\n";
    let (folder, ended) = estimated(model, study, (0..40).map(|k| -1.0 - noise(k)));
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(
        ended.err.contains("the estimate is not credible: ")
            && ended.err.contains("it followed the readings of y ("),
        "{}",
        ended.err
    );
    assert!(!folder.read("o.csv").is_empty());
}

/// One number for the whole log, though the noise that is declared is a hundred of its last digits; one whose last
/// digit is coarser than the noise may well stand still.
#[test]
fn a_dead_sensor_is_refused() {
    let (_, ended) = estimated(CONSTANT, EKF, (0..60).map(|_| 0.9871));
    assert_eq!(levels(&ended, "refusal"), ["frozen y"], "{}", ended.err);
    let (_, ended) = estimated(CONSTANT, EKF, (0..60).map(|_| 1.0));
    assert_eq!(ended.code, 0, "{}", ended.err);
}

/// Kelvin where the model has a range in degrees.
#[test]
fn readings_in_another_range_are_refused() {
    let study = EKF.replace("x = 0\n", "x = 1\n").replace("0.01 }", "1e6 }");
    let ranged = CONSTANT.replace("start = 1", "start = 1, min = 0, max = 100");
    let (_, ended) = estimated(&ranged, &study, (0..40).map(|k| 300.0 + noise(k)));
    let refusals = levels(&ended, "refusal");
    assert!(refusals.contains(&"range y".to_owned()), "{refusals:?}");
    // of the usual changes only one leads into this range
    let narrow = CONSTANT.replace("start = 1", "start = 25, min = 20, max = 29");
    let (_, ended) = estimated(&narrow, &study, (0..40).map(|k| 300.0 + noise(k)));
    for words in ["in kelvin beside a model in °C", "y - 273.15"] {
        assert!(ended.out.contains(words), "{}", ended.out);
    }
}

/// Readings may take an observer to where no number of steps is enough: that is an answer, and the rows before are kept.
#[test]
fn a_log_that_takes_the_observer_where_steps_do_not_suffice_is_not_credible() {
    let folder = Folder::empty();
    let plant = "model M
  Real p(start=1,min=-5,max=5);
  Real v(start=0,min=-50,max=50);
  output Real y = p;
equation
  der(p) = v;
  der(v) = -p - 0.5*v - sin(p^3);
end M;
";
    folder.write("m.mo", plant);
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 3\n",
    );
    // from the hundredth row on in another unit
    let row = |k: i32| {
        let t = 0.05 * f64::from(k);
        let unit = if k < 100 { 1.0 } else { 1000.0 };
        format!("{t},{}\n", unit * t.cos())
    };
    let rows: String = (0..200).map(row).collect();
    folder.write("log.csv", &format!("t,y\n{rows}"));
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    for words in [
        "the estimate is not credible: 100000 steps took the integration only to t = 5.0",
        "it followed the readings of y (the 102 rows before are written)",
    ] {
        assert!(ended.err.contains(words), "{}", ended.err);
    }
    assert_eq!(ended.out.lines().count(), 103);
}

/// A state that is measured leaves its declared range by more than 5 % with the plant; a reading
/// that is missing there does not make the estimate a doubt.
#[test]
fn a_gap_beyond_the_declared_range_is_no_doubt() {
    let model = "model M\n  Real x(start = 0, min = -1, max = 1);\n  output Real y = x;\nequation\n  der(x) = 0;\nend M;\n";
    let study = "[process_noise]\nx = 0.0004\n[observer]\nfamily = \"ekf\"\ninitial_variance = { x = 0.01 }\n";
    let y = |k: usize| match k % 10 {
        // the last row is one of those
        3 | 6 | 9 => f64::NAN,
        _ => 1.6 * (1.0 - (-0.02 * k as f64).exp()) + noise(k),
    };
    let (_, ended) = estimated(model, study, (0..200).map(y));
    assert_eq!(levels(&ended, "refusal"), [""; 0], "{}", ended.err);
    let plant = &ended.json()["outside_box"]["plant"]["quantities"]["x"];
    assert!(
        plant["farthest"].as_f64().is_some_and(|x| x > 1.5),
        "{plant}"
    );
    assert_eq!(
        (ended.code, ended.json()["credible"].as_bool()),
        (0, Some(true))
    );
}

/// Two wells at ±1, read in other units: the change that makes the log agree is named. Where several do, none is: ten
/// times too large is as well a thousand times, of a plant that rests at 0; nor where the plant is another one.
#[test]
fn a_column_in_another_unit_is_named() {
    let study = "[process_noise]\nx = 1e-4\n[observer]\nfamily = \"ekf\"\ninitial_variance = { x = 0.04 }\n";
    let named = |unit: fn(f64) -> f64| {
        let y = (0..200).map(|k| unit(1.0 + noise(k)));
        let (_, ended) = estimated(WELLS, study, y);
        assert_eq!(ended.code, 1, "{}", ended.err);
        let json = ended.json();
        let doubts = json["doubts"].as_array().unwrap();
        let texts = doubts.iter().filter_map(|doubt| doubt["text"].as_str());
        let text = texts.filter(|text| text.contains("looks as if"));
        text.map(str::to_owned).collect::<Vec<_>>().join("; ")
    };
    for (unit, expression) in [
        ((|y| 1.8 * y + 32.0) as fn(f64) -> f64, "(y - 32) / 1.8"),
        (|y| 273.15 + y, "y - 273.15"),
    ] {
        let text = named(unit);
        let column = format!("`columns = {{ y = \"{expression}\" }}`");
        assert!(text.contains(&column), "{text}");
    }
    assert_eq!(named(|y| 10.0 * y), "");
    assert_eq!(named(|y| 1.5 + 4.0 * (y - 1.0)), "");
}
