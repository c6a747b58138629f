use super::*;

/// A tank that is filled at an unknown rate; the level is measured.
const PLANT: &str = "model Tank
  input Real u(start = 1);
  input Real leak(start = 0.1);
  Real level(start = 2, min = 0, max = 4);
  Real warmth(start = 300);
  output Real y = level;
  output Real z = level + 0.01*warmth;
equation
  der(level) = u - leak - 0.5*level;
  der(warmth) = -0.1*(warmth - 280);
end Tank;";

fn report(sensors: &str, options: &Options) -> Result<Report, Error> {
    let folder = tempfile::tempdir().unwrap();
    let plant = folder.path().join("tank.mo");
    std::fs::write(&plant, PLANT).unwrap();
    let text = format!(
        "plant = '{}'\n[sensors]\n{sensors}\n[simulate]\nuntil = 10\noutput_step = 0.5\n",
        plant.display()
    );
    precision(&Study::parse(&text, "study.toml").unwrap(), options)
}

fn all() -> Options {
    Options {
        sensors: Some(Candidates::All),
        ..Options::default()
    }
}

#[test]
fn what_nothing_shows_is_not_seen_and_the_sensor_for_it_is_found() {
    let report = report("measured = ['y']\nunknown = ['leak']", &all()).unwrap();
    assert_eq!(report.names, ["level", "warmth", "leak"]);
    assert!(!report.is_positive());
    assert!(report.last().unwrap().present[1].is_infinite());
    let json = report.entries();
    assert!(json["standard_error"]["warmth"].is_null());
    assert!(json["standard_error"]["leak"].as_f64().unwrap() > 0.0);
    assert_eq!(json["ranked"][0], "warmth");
    let text = report.to_string();
    for words in [
        "y ±0.04 (assumed)",
        "not seen",
        "which 1 sensor (all 3 tried)",
        "best addition: y, warmth",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(text.lines().count() < 40);
    assert!(report.to_svg().unwrap().contains("not seen"));
}

#[test]
fn candidates_are_as_noisy_as_what_is_measured() {
    let noises = |sensors: &str| -> Vec<String> {
        let report = report(sensors, &all()).unwrap();
        let told = report.sensors.iter();
        told.map(|s| format!("{} {}", s.name, s.noise)).collect()
    };
    assert_eq!(
        noises("measured = ['y']\nnoise = { y = '2%' }"),
        [
            "y ±2 % of its value",
            "z ±2 % of its value",
            "warmth ±2 % of its value"
        ]
    );
    // 2 % of the range of the level; of the magnitude where there is no range
    let absolute = noises("measured = ['y']\nnoise = { y = 0.08 }");
    assert_eq!(absolute[2], "warmth ±6");
    // √(a²/3); the standard errors are those of Gaussian noise of this deviation
    let even = noises("measured = ['y']\nnoise = { y = { uniform = 0.12 } }");
    assert_eq!(even[0], "y ±0.06928 (even within ±0.12)");
    let errors = |noise: &str| {
        let sensors = format!("measured = ['y']\nnoise = {{ y = {noise} }}");
        let found = report(&sensors, &Options::default()).unwrap();
        found.last().unwrap().present[0]
    };
    let (even, normal) = (errors("{ uniform = 0.12 }"), errors("0.06928203230275509"));
    assert!((even / normal - 1.0).abs() < 1e-12, "{even} {normal}");
    // no noise would tell everything at once
    assert_eq!(noises("measured = ['y']\nnoise = { y = 0 }")[0], "y ±0.04");
}

#[test]
fn more_samples_tell_more() {
    let report = report("measured = ['z']\nunknown = ['leak']", &Options::default()).unwrap();
    let columns = report.columns();
    assert_eq!(columns[0].1.last(), Some(&10.0));
    for (name, values) in &columns[1..] {
        let seen: Vec<f64> = values.iter().copied().filter(|σ| σ.is_finite()).collect();
        assert!(seen.len() > 3, "{name}");
        assert!(seen.last() < seen.first(), "{name}: {seen:?}");
    }
}

#[test]
fn a_horizon_beyond_the_run_is_refused() {
    for horizon in [10.5, 0.1, f64::NAN] {
        let options = Options {
            horizon: Some(horizon),
            sensors: None,
        };
        let error = report("measured = ['y']", &options)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("study.toml: the horizon: expected"),
            "{error}"
        );
    }
}
