//! Angles and rotations: `[manifold]`.

use crate::{Folder, csv};

/// A rotor that turns many times, seen by an encoder.
pub(crate) const ROTOR: &str = "model Rotor
  Real theta(min = -3.14159, max = 3.14159, start = 0.5);
  Real omega(min = -30, max = 30, start = 7);
  input Real u(min = -5, max = 5, start = 0);
  output Real enc = theta;
equation
  der(theta) = omega;
  der(omega) = -2*sin(theta) - 0.02*omega + u;
end Rotor;
";

/// A body that turns, with a gyroscope of unknown offset, seen by two vectors.
const BODY: &str = "model Body
  Real q[4](start = {2, 0, 0, 0});
  Real b[3];
  input Real w[3];
  Real r[3];
  output Real acc[3]; output Real mag[3];
equation
  r = w - b;
  der(q[1]) = 0.5*(-q[2]*r[1] - q[3]*r[2] - q[4]*r[3]);
  der(q[2]) = 0.5*( q[1]*r[1] + q[3]*r[3] - q[4]*r[2]);
  der(q[3]) = 0.5*( q[1]*r[2] - q[2]*r[3] + q[4]*r[1]);
  der(q[4]) = 0.5*( q[1]*r[3] + q[2]*r[2] - q[3]*r[1]);
  der(b) = zeros(3);
  acc[1] = 2*(q[2]*q[4] - q[1]*q[3]);
  acc[2] = 2*(q[3]*q[4] + q[1]*q[2]);
  acc[3] = q[1]^2 - q[2]^2 - q[3]^2 + q[4]^2;
  mag[1] = 0.5*(q[1]^2 + q[2]^2 - q[3]^2 - q[4]^2) - 0.866*acc[1];
  mag[2] = (q[2]*q[3] - q[1]*q[4]) - 0.866*acc[2];
  mag[3] = (q[2]*q[4] + q[1]*q[3]) - 0.866*acc[3];
end Body;
";

fn folder(model: &str, study: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("s.toml", study);
    folder
}

pub(crate) fn rotor(family: &str, more: &str) -> Folder {
    let study = format!(
        "plant = \"m.mo\"
[manifold]
circle = [\"theta\"]
[sensors]
noise = {{ enc = 0.05 }}
[process_noise]
omega = 0.05
[observer]
family = \"{family}\"
initial = {{ theta = -2.0, omega = 3.0 }}
initial_variance = {{ theta = 4.0, omega = 25.0 }}
{more}
[simulate]
until = 20
output_step = 0.02
inputs = {{ u = \"sin(time/3)\" }}
method = \"rk4\"
step = 0.01
[estimate]
sd = true
method = \"rk4\"
step = 0.01
"
    );
    folder(ROTOR, &study)
}

pub(crate) fn attitude(family: &str, more: &str) -> Folder {
    let study = format!(
        "plant = \"m.mo\"
[manifold]
quaternion = [\"q\"]
[sensors]
noise = {{ acc = 0.05, mag = 0.05 }}
[process_noise]
q = 1e-4
b = 1e-6
[observer]
family = \"{family}\"
initial = {{ q = [0.5, 0.5, 0.5, 0.5] }}
initial_variance = {{ q = 4.0, b = 0.01 }}
{more}
[simulate]
until = 30
output_step = 0.05
inputs = {{ \"w[1]\" = \"0.5*sin(0.7*time)\", \"w[2]\" = \"0.4*cos(0.5*time)\", \"w[3]\" = \"0.3*sin(0.3*time + 1)\" }}
initial = {{ b = [0.05, -0.03, 0.02] }}
method = \"rk4\"
step = 0.05
[estimate]
sd = true
method = \"rk4\"
step = 0.05
"
    );
    folder(BODY, &study)
}

/// The rotor turns a dozen times and more: every filter is credible on the log of a wrapped encoder, its estimates
/// stay in the declared turn, and its errors are counted modulo a turn.
#[test]
fn a_rotor_that_turns_is_credible_and_exact() {
    for family in ["ekf", "ukf", "mhe"] {
        let folder = rotor(family, "");
        folder.change("s.toml", "sd = true", "sd = true\nsmooth = true");
        let run = folder.run(&[
            "simulate", "s.toml", "--log", "log.csv", "-o", "sim.csv", "--plot", "sim.svg",
            "--json",
        ]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        let json = run.json();
        assert!(json["credible"].as_bool().unwrap(), "{family}");
        assert!(json["doubts"].as_array().unwrap().is_empty(), "{json}");
        let errors = &json["errors"]["theta"];
        assert!(errors["rms_last_half"].as_f64().unwrap() < 0.03, "{errors}");
        assert!(errors["peak"].as_f64().unwrap() < 0.3, "{errors}");
        assert!(errors["within_2_sd"].as_f64().unwrap() > 0.9, "{errors}");
        assert!(json["outside_box"]["estimate"].is_null());
        let (header, rows) = csv(&folder.read("sim.csv"));
        let column = |name: &str| header.iter().position(|h| h == name).unwrap();
        for name in ["theta", "theta_hat", "theta_smooth"] {
            let values = rows.iter().map(|row| row[column(name)]);
            assert!(values.clone().all(|x| (-3.15..3.15).contains(&x)), "{name}");
            let turns = rows.windows(2);
            let turns = turns.filter(|w| (w[1][column(name)] - w[0][column(name)]).abs() > 3.0);
            assert!(turns.count() > 15, "{family}: {name}");
        }
        let (_, log) = csv(&folder.read("log.csv"));
        assert!(log.iter().all(|row| row[1].abs() < 3.15));
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-o", "out.csv"]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        // without [manifold] the same log is not credible
        folder.change("s.toml", "[manifold]\ncircle = [\"theta\"]\n", "");
        folder.change("m.mo", "min = -3.14159, max = 3.14159, ", "");
        let torn = folder.run(&["estimate", "s.toml", "log.csv", "-o", "torn.csv"]);
        assert_eq!(torn.code, 1, "{family}: {}", torn.err);
    }
}

/// No line of the picture goes from one end of the turn to the other.
#[test]
fn a_picture_lifts_the_pen_at_a_new_turn() {
    let folder = rotor("ekf", "");
    let run = folder.run(&["simulate", "s.toml", "--plot", "sim.svg", "-q"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let svg = folder.read("sim.svg");
    let mut steps = vec![];
    for line in svg.split("points=\"").skip(1) {
        let points = line.split('"').next().unwrap().split_whitespace();
        let heights = points.filter_map(|p| p.split(',').nth(1)?.parse::<f64>().ok());
        let heights: Vec<f64> = heights.collect();
        steps.extend(heights.windows(2).map(|w| (w[1] - w[0]).abs()));
    }
    assert!(steps.len() > 500, "{}", steps.len());
    let tall = steps.iter().filter(|step| **step > 100.0).count();
    // the frames of the bands have two each
    assert!(tall < 120, "{tall} of {}", steps.len());
}

/// From 120° off with a deviation of 115° about each axis: exact in the end, one column of deviations, and the rotation's
/// angle for its error.
#[test]
fn an_attitude_is_found_from_far_off() {
    for (family, more) in [("ekf", ""), ("ukf", "alpha = 0.2"), ("mhe", "horizon = 3")] {
        let folder = attitude(family, more);
        folder.change("s.toml", "sd = true", "sd = true\nsmooth = true");
        let run = folder.run(&[
            "simulate", "s.toml", "-o", "sim.csv", "--log", "log.csv", "--json",
        ]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        let json = run.json();
        let errors = json["errors"].as_object().unwrap();
        let names: Vec<&str> = errors.keys().map(String::as_str).collect();
        assert_eq!(names, ["q", "b[1]", "b[2]", "b[3]"]);
        let error = errors["q"]["rms_last_half"].as_f64().unwrap();
        assert!(error < 0.04, "{family}: {error}");
        assert_eq!(json["rms_error_last_half"]["q"].as_f64(), Some(error));
        assert!(json["credible"].as_bool().unwrap());
        let (header, rows) = csv(&folder.read("sim.csv"));
        let own: Vec<&str> = header
            .iter()
            .map(String::as_str)
            .filter(|h| h.contains("_sd"))
            .collect();
        assert_eq!(
            own,
            [
                "q_sd",
                "b[1]_sd",
                "b[2]_sd",
                "b[3]_sd",
                "q_smooth_sd",
                "b[1]_smooth_sd",
                "b[2]_smooth_sd",
                "b[3]_smooth_sd"
            ]
        );
        let first = header.iter().position(|h| h == "q[1]_hat").unwrap();
        for row in &rows {
            let squares: f64 = row[first..first + 4].iter().map(|x| x * x).sum();
            assert!((squares - 1.0).abs() < 1e-10);
        }
        let run = folder.run(&["simulate", "s.toml", "--runs", "12", "--json"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let own = &run.json()["quantities"]["q"];
        assert!(own["within_2_sd"].as_f64().unwrap() > 0.9, "{own}");
    }
}

/// An ensemble of attitudes from a third of a turn off is where the filter is, and as sure.
#[test]
fn an_ensemble_moves_rotations_about_their_mean() {
    let mut found = vec![];
    for (family, more) in [
        ("ekf", ""),
        ("particle", "proposal = \"ensemble\"\nparticles = 400"),
    ] {
        let folder = attitude(family, more);
        folder.change(
            "s.toml",
            "q = [0.5, 0.5, 0.5, 0.5]",
            "q = [1, 0.2, -0.2, 0.3]",
        );
        folder.change("s.toml", "q = 4.0", "q = 0.2");
        folder.change("s.toml", "until = 30", "until = 10");
        let run = folder.run(&["simulate", "s.toml", "-o", "sim.csv", "--json"]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        let error = &run.json()["errors"]["q"];
        found.push(["rms_last_half", "rms_in_sd"].map(|key| error[key].as_f64().unwrap()));
    }
    let [filter, ensemble] = found[..] else {
        panic!("two")
    };
    for (own, by) in ensemble.iter().zip(filter) {
        assert!((own / by - 1.0).abs() < 0.2, "{own} beside {by}");
    }
}

#[test]
fn what_is_known_is_known_up_to_a_turn() {
    let told = rotor("ekf", "").run(&["check", "s.toml"]).out;
    assert!(told.contains("(theta: known up to a full turn)"), "{told}");
    assert!(told.contains("counted: angles and rotations"), "{told}");
    let told = attitude("ekf", "").run(&["check", "s.toml"]).out;
    assert!(told.contains("q and -q are one rotation"), "{told}");
    assert!(
        told.contains("states observable: q[1], q[2], q[3], q[4], b[1]"),
        "{told}"
    );
    // without a magnetometer nobody knows the heading, whatever the length
    let folder = attitude("ekf", "");
    folder.change("s.toml", "[sensors]\n", "[sensors]\nmeasured = [\"acc\"]\n");
    let told = folder.run(&["check", "s.toml"]).out;
    assert!(
        told.contains("not observable: q[1], q[2], q[3], q[4]"),
        "{told}"
    );
}

fn refused(folder: &Folder, command: &[&str], parts: &[&str]) {
    let ended = folder.run(command);
    assert!(ended.code != 0, "{command:?}: {}", ended.out);
    for part in parts {
        assert!(ended.err.contains(part), "{part} in:\n{}", ended.err);
    }
}

/// A file with a text and what stands in its place, the command, and parts of the message.
type Refused<'t> = (&'t str, &'t str, &'t str, &'t [&'t str], &'t [&'t str]);

/// What cannot be is refused at its place, with what to do.
#[test]
fn what_is_no_angle_and_no_rotation_is_refused() {
    let check = &["check", "s.toml"][..];
    let with = |folder: Folder, file: &str, from: &str, to: &str| {
        folder.change(file, from, to);
        folder
    };
    let simulate = &["simulate", "s.toml"][..];
    let rotors: [Refused<'_>; 8] = [
        (
            "s.toml",
            "[\"theta\"]",
            "[\"thet\"]",
            check,
            &[
                "s.toml:3:11",
                "no state and no output is called \"thet\"",
                "theta",
            ],
        ),
        (
            "m.mo",
            "max = 3.14159",
            "max = 10",
            check,
            &[
                "s.toml:3:11",
                "which is 13.14 wide",
                "no range",
                "min = -3.14159",
            ],
        ),
        (
            "m.mo",
            "min = -3.14159, max = 3.14159",
            "min = 0, max = 360",
            check,
            &["in radians"],
        ),
        (
            "m.mo",
            "-2*sin(theta)",
            "-2*sin(theta/2)",
            check,
            &["theta is no angle of which a full turn changes nothing: der(omega)"],
        ),
        (
            "s.toml",
            "circle = [\"theta\"]",
            "circle = [\"theta\", \"enc\", \"theta\"]",
            check,
            &["names theta twice"],
        ),
        (
            "s.toml",
            "enc = 0.05",
            "enc = \"5%\"",
            check,
            &["`noise` of [sensors]: enc is an angle"],
        ),
        (
            "s.toml",
            "noise = { enc = 0.05 }",
            "noise = { enc = 0.05 }\nlimits = { enc = [-3, 3] }",
            check,
            &["`limits` of [sensors]: enc is an angle"],
        ),
        (
            "s.toml",
            "circle = [\"theta\"]",
            "quaternion = [\"theta\"]",
            check,
            &["is 1 of the states, expected four"],
        ),
    ];
    for (file, from, to, command, parts) in rotors {
        refused(&with(rotor("ekf", ""), file, from, to), command, parts);
    }
    let bodies: [Refused<'_>; 8] = [
        (
            "m.mo",
            "(start = {2, 0, 0, 0})",
            "",
            simulate,
            &[
                "the quaternion q starts with length 0",
                "Real q[4](start = {1, 0, 0, 0})",
            ],
        ),
        (
            "s.toml",
            "[\"q\"]",
            "[\"b\"]",
            check,
            &["\"b\" is 3 of the states, expected four"],
        ),
        (
            "m.mo",
            "0.5*( q[1]*r[3]",
            "0.5*(-q[1]*r[3]",
            check,
            &["q does not keep its length", "der(q) = 0.5*{"],
        ),
        (
            "m.mo",
            "acc[1] = 2*(q[2]*q[4] - q[1]*q[3])",
            "acc[1] = q[2]",
            check,
            &["q and -q are one rotation, and mag[1] is"],
        ),
        (
            "s.toml",
            "q = 1e-4",
            "q = 1e-4\n\"q[2]\" = 1e-3",
            simulate,
            &["[process_noise]: expected one number for the quaternion q"],
        ),
        (
            "s.toml",
            "q = 4.0",
            "q = 4.0, \"q[2]\" = 1.0",
            simulate,
            &["`initial_variance` of [observer]: expected one number"],
        ),
        (
            "s.toml",
            "q = [0.5, 0.5, 0.5, 0.5]",
            "q = [1, 0, 0]",
            check,
            &[
                "s.toml:11:13",
                "q has 4 elements in the plant 'Body', and this list 3",
                "\"q[1]\" = …",
            ],
        ),
        (
            "s.toml",
            "b = [0.05, -0.03, 0.02]",
            "b = [0.05, [1], 0.02]",
            check,
            &["s.toml:18:24", "entry 2 of \"b\""],
        ),
    ];
    for (file, from, to, command, parts) in bodies {
        refused(&with(attitude("ekf", ""), file, from, to), command, parts);
    }
    let folder = rotor("ekf", "");
    folder.change(
        "s.toml",
        "initial_variance = { theta = 4.0, omega = 25.0 }\n",
        "",
    );
    folder.change("s.toml", "\"ekf\"", "\"triangular\"");
    refused(
        &folder,
        check,
        &["s.toml:9:10", "triangular takes no [manifold]"],
    );
    let folder = attitude("ekf", "");
    folder.change("s.toml", "q = [0.5, 0.5, 0.5, 0.5]", "q = [0, 0, 0, 0]");
    refused(
        &folder,
        simulate,
        &["estimate: the quaternion q starts with length 0"],
    );
}

/// A star tracker: the attitude itself, of which it tells now q and now −q.
pub(crate) fn tracked(family: &str) -> Folder {
    let folder = attitude(family, "");
    folder.change("m.mo", "output Real mag[3];", "output Real star[4] = q;");
    for row in ["mag[1] =", "mag[2] =", "mag[3] ="] {
        let text = folder.read("m.mo");
        let line = text.lines().find(|line| line.contains(row)).unwrap();
        folder.change("m.mo", &format!("{line}\n"), "");
    }
    folder.change("s.toml", "mag = 0.05", "star = 0.02");
    folder
}

#[test]
fn a_quaternion_that_is_read_may_have_either_sign() {
    for family in ["ekf", "ukf", "mhe"] {
        let folder = tracked(family);
        let run = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-o", "a.csv"]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        let (header, rows) = csv(&folder.read("log.csv"));
        let first = header.iter().position(|h| h == "star[1]").unwrap();
        let mut turned = folder.read("log.csv").lines().next().unwrap().to_owned() + "\n";
        for (k, mut row) in rows.into_iter().enumerate() {
            if k % 3 == 1 {
                row[first..first + 4].iter_mut().for_each(|x| *x = -*x);
            }
            let cells: Vec<String> = row.iter().map(f64::to_string).collect();
            turned += &(cells.join(",") + "\n");
        }
        folder.write("log.csv", &turned);
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-o", "b.csv"]);
        assert_eq!(run.code, 0, "{family}: {}", run.err);
        assert_eq!(folder.read("a.csv"), folder.read("b.csv"));
    }
}

/// A family is chosen among those that take angles, and the others are told why not.
#[test]
fn no_theorem_is_about_angles() {
    let folder = rotor("ekf", "");
    folder.change("s.toml", "family = \"ekf\"\n", "");
    folder.change(
        "s.toml",
        "initial_variance = { theta = 4.0, omega = 25.0 }\n",
        "",
    );
    let told = folder.run(&["check", "s.toml"]);
    assert_eq!(told.code, 0, "{}", told.err);
    assert!(
        told.out.contains(
            "not examined, as their theorems are about errors that are differences of real numbers"
        ),
        "{}",
        told.out
    );
    let compared = folder.run(&["compare", "s.toml"]);
    assert_eq!(compared.code, 0, "{}", compared.err);
    assert!(!compared.out.contains("triangular"), "{}", compared.out);
}

/// A fit sees wrapped readings as they are meant: k of −k sin θ by a log of many turns.
#[test]
fn a_parameter_is_found_from_wrapped_readings() {
    for (family, more) in [("ekf", ""), ("ukf", ""), ("ekf", "iterations = 3")] {
        let folder = rotor(family, more);
        folder.change("m.mo", "-2*sin", "-k*sin");
        folder.change(
            "m.mo",
            "  Real theta",
            "  parameter Real k(min = 0, max = 10) = 2;\n  Real theta",
        );
        let run = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let study = folder.read("s.toml") + "[parameters]\nk = 3\n[fit]\nparameters = [\"k\"]\n";
        folder.write("s.toml", &study);
        let run = folder.run(&["fit", "s.toml", "log.csv", "--json"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let found = &run.json()["parameters"]["k"];
        let [k, sd] = ["value", "sd"].map(|name| found[name].as_f64().unwrap());
        assert!((k - 2.0).abs() < 3.0 * sd && sd < 0.3, "{k} ± {sd}");
    }
}

/// The plant alone beside a wrapped log.
#[test]
fn the_plant_alone_is_compared_modulo_a_turn() {
    let folder = rotor("ekf", "");
    let run = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let run = folder.run(&["simulate", "s.toml", "--inputs", "log.csv", "--json"]);
    let error = &run.json()["errors"]["enc"]["rms"];
    assert!(error.as_f64().is_some_and(|rms| rms < 2.0), "{}", run.out);
}

/// From starts that are off by a radian about each axis errors are as large as is claimed once corrections are
/// iterated; with corrections that are linearised once, about the wrong attitude, they are several times larger.
#[test]
fn deviations_are_right_from_far_off() {
    let size = |more: &str| {
        let folder = attitude("ekf", more);
        let text = folder.read("s.toml");
        let initial = text.lines().find(|line| line.contains("q = [0.5"));
        folder.change("s.toml", &format!("{}\n", initial.unwrap()), "");
        folder.change("s.toml", "q = 4.0", "q = 1.0");
        folder.change("s.toml", "until = 30", "until = 6\nspread = { q = 1.0 }");
        let run = folder.run(&["simulate", "s.toml", "--runs", "40", "--json"]);
        assert!(run.code <= 1, "{}", run.err);
        let own = run.json()["quantities"]["q"].clone();
        (
            own["rms_in_sd"].as_f64().unwrap(),
            own["within_2_sd"].as_f64().unwrap(),
        )
    };
    let (whole, within) = size("");
    assert!(
        (0.7..1.3).contains(&whole) && within > 0.9,
        "{whole} {within}"
    );
    let (once, _) = size("iterations = 1");
    assert!(once > 3.0, "{once}");
}
