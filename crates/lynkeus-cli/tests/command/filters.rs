//! Kalman filters, and every family on logs with gaps.

use std::fs;

use crate::normal::Normal;
use crate::{Folder, csv, run, shared};

/// Against independent filters (SciPy), sensors at two rates with gaps, to 1e-9 at every row. That
/// of `ukf` is [computed anew](filters/pendulum_ukf.py): beside it the shared one has QΔt for W.
#[test]
fn filters_and_smoother_follow_their_references() {
    let Some(path) = shared("filters/pendulum/ekf.csv") else {
        return;
    };
    let folder = path.parent().unwrap();
    let extended = fs::read_to_string(&path).unwrap();
    let unscented = include_str!("filters/pendulum_ukf.csv");
    for (study, reference) in [("ekf.toml", extended.as_str()), ("ukf.toml", unscented)] {
        let (names, expected) = csv(reference);
        let ended = run(folder, &["estimate", study, "log.csv"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let (header, rows) = csv(&ended.out);
        assert_eq!(rows.len(), expected.len());
        for (name, i) in names.iter().zip(0..) {
            let j = header.iter().position(|n| n == name).unwrap();
            for (found, expected) in rows.iter().zip(&expected) {
                let off = (found[j] - expected[i]).abs();
                assert!(
                    off <= 1e-9,
                    "{study}: {name} at t = {}: off by {off}",
                    expected[0]
                );
            }
        }
    }
}

/// Six plants as users have them, on clean and on faulty logs: as good as a filter written by
/// hand for each (at most 1.15 times its error).
#[test]
fn field_plants_are_estimated_as_well_as_by_hand() {
    for trial in ["altitude", "battery", "cstr", "dcmotor", "joint", "sir"] {
        let Some(path) = shared(&format!("trials/{trial}/score.json")) else {
            return;
        };
        let folder = path.parent().unwrap();
        let score: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        let after = score["after"].as_f64().unwrap();
        let truth = csv(&fs::read_to_string(folder.join("truth.csv")).unwrap());
        for (log, errors) in [("log.csv", "rms"), ("log_faulty.csv", "rms_faulty")] {
            let ended = run(folder, &["estimate", "ekf.toml", log]);
            assert_eq!(ended.code, 0, "{trial}: {}", ended.err);
            let estimates = csv(&ended.out);
            for (name, by_hand) in score[errors].as_object().unwrap() {
                let ours = error(&estimates, &truth, name, after);
                let by_hand = by_hand.as_f64().unwrap();
                assert!(
                    ours <= 1.15 * by_hand,
                    "{trial}/{log}: {name} {ours} against {by_hand}"
                );
            }
        }
    }
}

type Csv = (Vec<String>, Vec<Vec<f64>>);

/// Root mean square error after a time, the truth interpolated.
fn error((header, rows): &Csv, (names, truth): &Csv, name: &str, after: f64) -> f64 {
    let hat = format!("{name}_hat");
    let j = header.iter().position(|n| *n == hat).unwrap();
    let k = names.iter().position(|n| n == name).unwrap();
    let squares: Vec<f64> = rows
        .iter()
        .filter(|row| row[0] > after)
        .map(|row| {
            let next = truth.partition_point(|t| t[0] <= row[0] + 1e-9);
            let i = next.saturating_sub(1).min(truth.len() - 2);
            let share = (row[0] - truth[i][0]) / (truth[i + 1][0] - truth[i][0]);
            let share = if share.abs() > 1e-9 { share } else { 0.0 };
            (row[j] - truth[i][k] - share * (truth[i + 1][k] - truth[i][k])).powi(2)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

const DRIFT: &str = "
model Drift
  input Real u(start = 0, min = -5, max = 5);
  Real x(start = 1, min = -5, max = 5);
  Real v(start = 0, min = -5, max = 5);
  output Real y = x;
equation
  der(x) = v;
  der(v) = u - x - 0.2*v;
end Drift;
";

/// x(t) of `DRIFT` with u = 0, exactly.
fn drift(t: f64) -> f64 {
    let w = (1.0_f64 - 0.01).sqrt();
    (-0.1 * t).exp() * ((w * t).cos() + 0.1 / w * (w * t).sin())
}

fn folder(observer: &str, gaps: impl Fn(usize) -> bool) -> Folder {
    let folder = Folder::new();
    fs::write(folder.path.path().join("drift.mo"), DRIFT).unwrap();
    let study = format!("plant = \"drift.mo\"\n[sensors]\nnoise = {{ y = 0.01 }}\n{observer}\n");
    fs::write(folder.path.path().join("drift.toml"), study).unwrap();
    let mut log = "t,y,u\n".to_owned();
    for k in 0..200 {
        let t = 0.1 * k as f64;
        let y = if gaps(k) {
            String::new()
        } else {
            drift(t).to_string()
        };
        log += &format!("{t},{y},0\n");
    }
    fs::write(folder.path.path().join("log.csv"), log).unwrap();
    folder
}

/// Half of the readings missing, in blocks: the model bridges them, for a family with a theorem
/// as for the filter.
#[test]
fn gaps_are_bridged_by_the_model() {
    for observer in [
        "[observer]\nfamily = \"triangular\"\ntheta = 3\ninitial = { x = 0, v = 1 }\n[estimate]\nbetween_samples = \"predict\"",
        "[observer]\nfamily = \"ekf\"\ninitial = { x = 0, v = 1 }",
    ] {
        let folder = folder(observer, |k| k % 20 >= 10);
        let ended = folder.run(&["estimate", "drift.toml", "log.csv"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let (header, rows) = csv(&ended.out);
        let x = header.iter().position(|n| n == "x_hat").unwrap();
        for row in rows.iter().filter(|row| row[0] > 14.0) {
            assert!((row[x] - drift(row[0])).abs() < 2e-3, "{observer}: {row:?}");
        }
    }
}

/// Without a family in the study and none proved with the keys given, the filter runs and says
/// what is lost.
#[test]
fn any_plant_gets_an_estimate() {
    let folder = folder("", |_| false);
    let model = DRIFT.replace("output Real y = x;", "output Real y = x + 0.5*u;");
    fs::write(folder.path.path().join("drift.mo"), model).unwrap();
    let ended = folder.run(&["estimate", "drift.toml", "log.csv", "-o", "o.csv", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let json = ended.json();
    assert_eq!(json["family"], "ekf");
    assert!(
        json["notes"].to_string().contains("theorem"),
        "{}",
        json["notes"]
    );
}

/// The pump of the measured tanks from the lower level alone, smoothed: the overflow, at which the
/// sensor shows 10, is declared and not believed. The sensor is taken to be good to 1 % of its range.
#[test]
fn the_hidden_pump_is_smoothed_through_the_overflow() {
    for file in ["estimation.csv", "validation.csv"] {
        let Some(path) = shared(&format!("data/cascaded-tanks/{file}")) else {
            return;
        };
        let folder = Folder::new();
        let study = "plant = \"two_tanks.mo\"\n[sensors]\nmeasured = [\"level\"]\nunknown = [\"pump\"]\nnoise = { level = 0.1 }\nlimits = { level = [0, 10] }\n[process_noise]\nupper = 1e-4\nlower = 1e-4\npump = 5e-4\n[observer]\nfamily = \"ekf\"\ninitial_variance = { default = 1 }\n[estimate]\ncolumns = { level = \"y\", pump = \"u\" }\nsmooth = true\n";
        folder.write("tanks.toml", study);
        let log = path.canonicalize().unwrap();
        let ended = folder.run(&["estimate", "tanks.toml", log.to_str().unwrap()]);
        assert!(
            ended.err.contains("at a limit of the sensor"),
            "{}",
            ended.err
        );
        let (header, rows) = csv(&ended.out);
        let (names, measured) = csv(&fs::read_to_string(&path).unwrap());
        let column = |names: &[String], rows: &[Vec<f64>], name: &str| {
            let i = names.iter().position(|n| n == name).unwrap();
            rows.iter().map(|row| row[i]).collect::<Vec<f64>>()
        };
        let pump = column(&names, &measured, "u");
        let smooth = crate::references::correlation(&column(&header, &rows, "pump_smooth"), &pump);
        let hat = column(&header, &rows, "pump_hat");
        let filter = (0..60).map(|lag| crate::references::correlation(&hat[lag..], &pump));
        let filter = filter.fold(-1.0, f64::max);
        assert!(
            smooth > 0.885 && filter > 0.885,
            "{file}: {smooth} {filter}"
        );
    }
}

/// The inlet of a measured pipe from its outlet alone: only noises are declared, and how well the start is known follows
/// from the ranges. In 61 states of cells, and nearer in ten of plug flow by moments.
#[test]
fn the_hidden_inlet_of_the_measured_pipe() {
    let cases = [
        (PIPE, "ULg150801.csv", 1.2),
        (PIPE, "ULg160104_2.csv", 0.25),
        (PLUG_FLOW, "ULg150801.csv", 0.6),
        (PLUG_FLOW, "ULg160104_2.csv", 0.24),
    ];
    for (model, file, bound) in cases {
        let Some(path) = shared(&format!("data/district-pipe/{file}")) else {
            return;
        };
        let folder = Folder::empty();
        folder.write("pipe.mo", model);
        let study = "plant = \"pipe.mo\"\n[sensors]\nunknown = [\"T_in\"]\nnoise = { T_out = 0.1 }\n[process_noise]\nT = 1e-3\nW = 1e-3\nT_in = 1\n[observer]\nfamily = \"ekf\"\n[estimate]\nmethod = \"adaptive\"\nrtol = 1e-6\natol = 1e-8\nsmooth = true\n";
        folder.write("pipe.toml", study);
        let log = path.canonicalize().unwrap();
        let ended = folder.run(&["estimate", "pipe.toml", log.to_str().unwrap()]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let (header, rows) = csv(&ended.out);
        let (names, measured) = csv(&fs::read_to_string(&path).unwrap());
        let smooth = header.iter().position(|n| n == "T_in_smooth").unwrap();
        let inlet = names.iter().position(|n| n == "T_in").unwrap();
        let end = measured.last().unwrap()[0];
        let pairs = rows.iter().zip(&measured);
        let inside = pairs.filter(|(row, _)| row[0] > 20.0 && row[0] < end - 90.0);
        let squares: Vec<f64> = inside
            .map(|(r, m)| (r[smooth] - m[inlet]).powi(2))
            .collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms < bound, "{file}: {rms}");
    }
}

const PIPE: &str = "
model Pipe \"Hot-water pipe in 30 cells of water and wall\"
  parameter Integer N = 30;
  parameter Real L = 39, d = 0.05248, D = 0.0603;
  parameter Real UA = 15400 \"water to wall, in all (W/K)\";
  parameter Real pi = 3.141592653589793;
  parameter Real Cw = 1000*4186*pi/4*d^2*L/N;
  parameter Real Cs = 7800*480*pi/4*(D^2-d^2)*L/N;
  parameter Real loss = 2*pi*0.04*L/N/log((D/2+0.013)/(D/2));
  input Real m_flow(start = 1, min = 0, max = 2);
  input Real T_in(start = 17, min = 0, max = 90);
  Real T[N](each start = 17, each min = 0, each max = 90);
  Real W[N](each start = 17, each min = 0, each max = 90);
  output Real T_out = T[N];
equation
  Cw*der(T[1]) = m_flow*4186*(T_in - T[1]) + UA/N*(W[1]-T[1]);
  for i in 2:N loop
    Cw*der(T[i]) = m_flow*4186*(T[i-1] - T[i]) + UA/N*(W[i]-T[i]);
  end for;
  for i in 1:N loop
    Cs*der(W[i]) = UA/N*(T[i]-W[i]) - loss*(W[i]-18);
  end for;
end Pipe;
";

const PLUG_FLOW: &str = "
model Pipe \"Hot-water pipe: plug flow of water along a wall, each by Legendre moments\"
  parameter Integer N = 5;
  parameter Integer M = 4;
  parameter Real L = 39, d = 0.05248, D = 0.0603;
  parameter Real UA = 15400 \"water to wall, in all (W/K)\";
  parameter Real pi = 3.141592653589793;
  parameter Real C = 1000*4186*pi/4*d^2*L;
  parameter Real Cs = 7800*480*pi/4*(D^2-d^2)*L;
  parameter Real loss = 2*pi*0.04*L/log((D/2+0.013)/(D/2));
  input Real m_flow(start = 1, min = 0, max = 2);
  input Real T_in(start = 17, min = 0, max = 90);
  Real T[N](start = {17, 0, 0, 0, 0}) \"moments of the water along the pipe, the first its mean\";
  Real W[M](start = {17, 0, 0, 0}) \"of the wall\";
  output Real T_out = sum(T);
equation
  for i in 1:N loop
    C*der(T[i]) = (2*i - 1)*m_flow*4186*((-1)^(i-1)*T_in + sum((if j <= i then (-1)^(i-j+1) else -1)*T[j] for j in 1:N))
      - UA*(T[i] - (if i <= M then W[min(i, M)] else 0));
  end for;
  for i in 1:M loop
    Cs*der(W[i]) = UA*(T[i] - W[i]) - loss*(W[i] - (if i == 1 then 18 else 0));
  end for;
end Pipe;
";

/// A height that starts anywhere: at the first reading, and not in the middle of its range.
#[test]
fn a_measured_state_starts_where_it_is_read() {
    let folder = folder("[observer]\nfamily = \"triangular\"\ntheta = 1", |_| false);
    let model = DRIFT.replace("x(start = 1, min = -5, max = 5)", "x(min = -5, max = 405)");
    fs::write(folder.path.path().join("drift.mo"), model).unwrap();
    let ended = folder.run(&["estimate", "drift.toml", "log.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended.err.contains("x starts at its first reading, 1:"),
        "{}",
        ended.err
    );
    assert!((csv(&ended.out).1[0][1] - 1.0).abs() < 1e-12);
}

/// A stiffness that nobody knows, from a log: `unknown` names a parameter.
#[test]
fn a_parameter_is_calibrated() {
    let observer = "[observer]\nfamily = \"ekf\"\ninitial_variance = { k = 0.25, default = 1 }\n[estimate]\nsd = true";
    let folder = folder(observer, |_| false);
    let model = DRIFT
        .replace(
            "  input Real u",
            "  parameter Real k(min = 0, max = 4) = 1.5;\n  input Real u",
        )
        .replace("u - x -", "u - k*x -");
    fs::write(folder.path.path().join("drift.mo"), model).unwrap();
    let path = folder.path.path().join("drift.toml");
    let study = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        study.replace("[sensors]", "[sensors]\nunknown = [\"k\"]"),
    )
    .unwrap();
    let ended = folder.run(&["estimate", "drift.toml", "log.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&ended.out);
    let at = |name: &str| header.iter().position(|n| n == name).unwrap();
    let last = rows.last().unwrap();
    // the log was made with k = 1
    assert!(
        (last[at("k_hat")] - 1.0).abs() < 0.01,
        "{}",
        last[at("k_hat")]
    );
    assert!(last[at("k_sd")] < 0.02 && rows[0][at("k_sd")] > 0.4);
    let checked = folder.run(&["check", "drift.toml"]);
    assert_eq!(checked.code, 0, "{}", checked.err);
    assert!(
        checked.out.contains("observable: x, v, k"),
        "{}",
        checked.out
    );
}

/// The standard deviation that a family reports is that of its estimates over noisy logs, where the
/// model follows the plant between samples.
#[test]
fn standard_deviations_are_those_of_many_runs() {
    for observer in [
        "[observer]\nfamily = \"triangular\"\ntheta = 2",
        "[observer]\nfamily = \"drift-observable\"\npoles = [-2, -3]",
    ] {
        let folder = folder(
            &format!("{observer}\n[estimate]\nsd = true\nbetween_samples = \"predict\""),
            |_| false,
        );
        let mut runs = vec![];
        for seed in 0..100 {
            let mut noise = Normal(seed * 7919 + 17);
            let mut log = "t,y,u\n".to_owned();
            for k in 0..150 {
                let t = 0.1 * f64::from(k);
                log += &format!("{t},{},0\n", drift(t) + 0.01 * noise.next());
            }
            fs::write(folder.path.path().join("log.csv"), log).unwrap();
            let ended = folder.run(&["estimate", "drift.toml", "log.csv"]);
            assert_eq!(ended.code, 0, "{}", ended.err);
            runs.push(csv(&ended.out));
        }
        for name in ["x", "v"] {
            let column = |ending: &str| {
                let header = format!("{name}_{ending}");
                let at = runs[0].0.iter().position(|n| *n == header).unwrap();
                runs.iter()
                    .map(|run| run.1[100..].iter().map(|r| r[at]).collect())
                    .collect::<Vec<Vec<f64>>>()
            };
            let (hats, said) = (column("hat"), column("sd"));
            let count = hats.len() as f64;
            let variances = (0..hats[0].len()).map(|row| {
                let mean = hats.iter().map(|h| h[row]).sum::<f64>() / count;
                hats.iter().map(|h| (h[row] - mean).powi(2)).sum::<f64>() / (count - 1.0)
            });
            let found = (variances.sum::<f64>() / hats[0].len() as f64).sqrt();
            let said = said[0].last().unwrap();
            assert!(
                (found / said - 1.0).abs() < 0.15,
                "{observer}: {name} {found} against {said}"
            );
        }
    }
}

/// A plant that goes further than was declared: the window keeps to the range, and says so.
#[test]
fn a_range_that_is_too_narrow_for_the_window_is_told() {
    let observer = "[observer]\nfamily = \"mhe\"\nhorizon = 3\n[estimate]\nsmooth = true";
    let folder = folder(observer, |_| false);
    let least = |ended: &crate::Ended, name: &str| {
        let (header, rows) = csv(&ended.out);
        let at = header.iter().position(|n| n == name).unwrap();
        rows.iter().map(|row| row[at]).fold(0.0, f64::min)
    };
    let words = "x is kept at an end of its range [-0.2, 2]";
    let wide = folder.run(&["estimate", "drift.toml", "log.csv"]);
    assert!(!wide.err.contains("at an end of its range"), "{}", wide.err);
    let goes_to = (0..200)
        .map(|k| drift(0.1 * f64::from(k)))
        .fold(0.0, f64::min);
    for name in ["x_hat", "x_smooth"] {
        assert!((least(&wide, name) - goes_to).abs() < 5e-3, "{name}");
    }
    folder.change("drift.toml", "[sensors]", "[box]\nx = [-0.2, 2]\n[sensors]");
    let narrow = folder.run(&["estimate", "drift.toml", "log.csv"]);
    assert!(narrow.err.contains(words), "{}", narrow.err);
    for name in ["x_hat", "x_smooth"] {
        assert_eq!(least(&narrow, name), -0.2, "{name}");
    }
}
