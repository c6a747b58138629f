//! Parameters of plants that jump and of plants that turn, from logs.

use crate::Folder;

fn folder(model: &str, study: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("s.toml", &format!("plant = \"m.mo\"\n{study}"));
    folder
}

/// Simulates a log, changes where the fit starts, and fits: values with their standard deviations, by name.
fn fitted(folder: &Folder, from: &str, to: &str, names: &[&str]) -> Vec<[f64; 2]> {
    let run = folder.run(&[
        "simulate", "s.toml", "-q", "--log", "log.csv", "-o", "sim.csv",
    ]);
    assert!(run.code <= 1, "{}", run.err);
    folder.change("s.toml", from, to);
    let run = folder.run(&["fit", "s.toml", "log.csv", "--json"]);
    assert_eq!(run.code, 0, "{}\n{}", run.out, run.err);
    let json = run.json();
    let of = |name: &&str| {
        let own = &json["parameters"][*name];
        ["value", "sd"].map(|key| own[key].as_f64().unwrap_or_else(|| panic!("{json}")))
    };
    names.iter().map(of).collect()
}

const BALL: &str = "model Ball
  parameter Real e = 0.8;
  parameter Real g = 9.81;
  Real h(start = 1, min = -0.5, max = 2);
  Real v(start = 0, min = -6, max = 6);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -g;
  when h <= 0 then
    reinit(v, -e*pre(v));
  end when;
end Ball;
";

/// How much of its speed a ball keeps, from four bounces, by the plant alone and along the filter.
#[test]
fn the_restitution_of_a_ball_is_found() {
    for objective in ["simulation", "innovations"] {
        let study = format!(
            "[parameters]\ne = 0.8\ng = 9.81\n[sensors]\nnoise = {{ y = 0.02 }}\n[process_noise]\nv = 1e-3\n[observer]\nfamily = \"ekf\"\ninitial_variance = {{ h = 0.01, v = 0.01 }}\n[simulate]\nuntil = 2.4\noutput_step = 0.04\nseed = 3\n[fit]\nparameters = [\"e\", \"g\"]\nobjective = \"{objective}\"\n"
        );
        let folder = folder(BALL, &study);
        let found = fitted(
            &folder,
            "e = 0.8\ng = 9.81",
            "e = 0.74\ng = 9.5",
            &["e", "g"],
        );
        for ([value, sd], (truth, most)) in found.into_iter().zip([(0.8, 0.01), (9.81, 0.15)]) {
            assert!(sd < most, "{objective}: {value} ± {sd}");
            assert!(
                (value - truth).abs() < 3.0 * sd,
                "{objective}: {value} ± {sd}"
            );
        }
    }
}

/// Both thresholds of a thermostat and its heater, from its temperature.
#[test]
fn the_hysteresis_of_a_thermostat_is_found() {
    let model = "model Thermostat
  parameter Real low = 19;
  parameter Real high = 21;
  parameter Real heat = 8;
  Real T(start = 18.5, min = 0, max = 40);
  Boolean on(start = true);
  output Real y = T;
equation
  der(T) = (if on then heat else 0) - 0.5*(T - 12);
  when T >= high then
    on = false;
  elsewhen T <= low then
    on = true;
  end when;
end Thermostat;
";
    let study = "[parameters]\nlow = 19\nhigh = 21\nheat = 8\n[sensors]\nnoise = { y = 0.1 }\n[process_noise]\nT = 0.01\n[observer]\nfamily = \"ekf\"\ninitial_variance = { T = 0.01 }\n[simulate]\nuntil = 8\noutput_step = 0.05\nseed = 2\n[fit]\nparameters = [\"low\", \"high\", \"heat\"]\n";
    let folder = folder(model, study);
    let (from, to) = (
        "low = 19\nhigh = 21\nheat = 8\n",
        "low = 18.9\nhigh = 21.15\nheat = 8.1\n",
    );
    let found = fitted(&folder, from, to, &["low", "high", "heat"]);
    for ([value, sd], truth) in found.into_iter().zip([19.0, 21.0, 8.0]) {
        assert!(
            sd < 0.1 && (value - truth).abs() < 3.0 * sd,
            "{value} ± {sd} for {truth}"
        );
    }
}

/// How far a gyroscope's rates are off by a factor, from a body that it turns with, along both filters.
#[test]
fn the_scale_of_a_gyroscope_is_found() {
    for family in ["ekf", "ukf"] {
        let folder = crate::manifold::attitude(family, "");
        folder.change("m.mo", "Real r[3];", "Real r[3]; parameter Real k = 1.02;");
        folder.change("m.mo", "r = w - b", "r = k*w - b");
        folder.change("s.toml", "q = [0.5, 0.5, 0.5, 0.5]", "q = [1, 0.1, 0, 0]");
        folder.change("s.toml", "q = 4.0", "q = 0.01");
        folder.change("s.toml", "until = 30", "until = 20");
        folder.change(
            "s.toml",
            "[manifold]",
            "[parameters]\nk = 1.02\n[fit]\nparameters = [\"k\"]\n[manifold]",
        );
        let [[value, sd]] = fitted(&folder, "k = 1.02", "k = 1.0", &["k"])[..] else {
            panic!("one value");
        };
        assert!(
            sd < 0.02 && (value - 1.02).abs() < 3.0 * sd,
            "{family}: {value} ± {sd}"
        );
    }
}
