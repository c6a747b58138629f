use super::*;

/// What one of the sensors shows where all have this value.
fn measured(sensors: &Sensors, of: usize, value: f64) -> f64 {
    let disturbances: Vec<f64> = sensors.disturbances().collect();
    sensors.shown(&Reals, &vec![value; disturbances.len()], &disturbances)[of]
}

fn draws(seed: u64, outputs: &[&str], of: usize, count: usize) -> Vec<f64> {
    draws_of(Level::Absolute(2.0), seed, outputs, of, count)
}

fn draws_of(level: Level, seed: u64, outputs: &[&str], of: usize, count: usize) -> Vec<f64> {
    let outputs: Vec<String> = outputs.iter().map(ToString::to_string).collect();
    let levels = outputs.iter().map(|n| (n.clone(), level));
    let noise = Noise {
        seed,
        sample_step: None,
        levels: levels.collect(),
        ..Noise::default()
    };
    let mut sensors = Sensors::new(&noise, [&outputs, &[], &[]], 1.0).unwrap();
    let draw = |_| {
        sensors.draw(true);
        measured(&sensors, of, 10.0)
    };
    (0..count).map(draw).collect()
}

#[test]
fn a_sensor_keeps_its_noise_when_another_joins() {
    assert_eq!(draws(7, &["a"], 0, 50), draws(7, &["b", "a"], 1, 50));
    assert_ne!(draws(7, &["a"], 0, 50), draws(7, &["b", "a"], 0, 50));
    assert_ne!(draws(7, &["a"], 0, 50), draws(8, &["a"], 0, 50));
}

/// One draw per seed: mean 0, variance 1, and nothing in common with another name or the
/// noise of a sensor that is called so.
#[test]
fn deviates_of_names_are_normal_and_independent() {
    let n = 20_000;
    let of = |name: &str| -> Vec<f64> { (0..n).map(|seed| deviate(seed, name)).collect() };
    let mean = |z: &mut dyn Iterator<Item = f64>| z.sum::<f64>() / n as f64;
    let (a, b) = (of("a"), of("b"));
    let noise: Vec<f64> = (0..n)
        .map(|s| draws(s, &["a"], 0, 1)[0] / 2.0 - 5.0)
        .collect();
    let four = 4.0 / (n as f64).sqrt();
    assert!(mean(&mut a.iter().copied()).abs() < four);
    let variance = mean(&mut a.iter().map(|z| z * z));
    assert!((variance - 1.0).abs() < four * 2.0_f64.sqrt(), "{variance}");
    for other in [&b, &noise] {
        let common = mean(&mut a.iter().zip(other).map(|(a, b)| a * b));
        assert!(common.abs() < four, "{common}");
    }
}

#[test]
fn the_stream_is_fixed() {
    let expected = [10.756173956702993, 9.441604095252226, 6.108883197852315];
    let found = draws(1, &["y"], 0, 3);
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

#[test]
fn mean_deviation_and_tails_are_normal() {
    let n = 200_000;
    let z: Vec<f64> = draws(3, &["y"], 0, n)
        .iter()
        .map(|y| (y - 10.0) / 2.0)
        .collect();
    let mean = z.iter().sum::<f64>() / n as f64;
    let variance = z.iter().map(|z| z * z).sum::<f64>() / n as f64 - mean * mean;
    let beyond = z.iter().filter(|z| z.abs() > 1.959_964).count() as f64 / n as f64;
    let lag: f64 = z.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
    assert!(mean.abs() < 0.01 && lag.abs() < 0.01, "{mean} {lag}");
    assert!((variance - 1.0).abs() < 0.015, "{variance}");
    assert!((beyond - 0.05).abs() < 0.002, "{beyond}");
}

/// Mean 0, variance a²/3 and fourth moment a⁴/5; no error beyond the bound.
#[test]
fn uniform_noise_fills_its_bound_and_no_more() {
    let n = 200_000;
    let e: Vec<f64> = draws_of(Level::Uniform(0.5), 3, &["y"], 0, n)
        .iter()
        .map(|y| y - 10.0)
        .collect();
    let mean = |power: i32| e.iter().map(|e| e.powi(power)).sum::<f64>() / n as f64;
    // four standard errors of each moment
    assert!(mean(1).abs() < 4.0 * 0.5 / (3.0 * n as f64).sqrt());
    assert!((mean(2) / (0.25 / 3.0) - 1.0).abs() < 0.01, "{}", mean(2));
    assert!(
        (mean(4) / (0.0625 / 5.0) - 1.0).abs() < 0.015,
        "{}",
        mean(4)
    );
    let largest = e.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
    assert!(
        largest <= 0.5 * (1.0 + 1e-14) && largest > 0.4999,
        "{largest}"
    );
    let lag: f64 = e.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
    assert!(lag.abs() < 1e-3, "{lag}");
}

/// Noise is shown where it stays within the range, and no number hides one that is none.
#[test]
fn a_sensor_shows_no_more_than_its_range() {
    let outputs = ["y".to_string()];
    let of = |low, high| Noise {
        levels: [("y".to_string(), Level::Absolute(2.0))].into(),
        limits: [("y".to_string(), Limits { low, high })].into(),
        ..Noise::default()
    };
    let mut sensors = Sensors::new(&of(9.0, 10.5), [&outputs, &[], &[]], 1.0).unwrap();
    let free = draws(0, &["y"], 0, 50);
    let mut inside = 0;
    for free in free {
        sensors.draw(true);
        let shown = measured(&sensors, 0, 10.0);
        assert_eq!(shown, free.clamp(9.0, 10.5));
        inside += usize::from(shown == free);
    }
    assert!(inside > 5 && inside < 45, "{inside}");
    assert!(measured(&sensors, 0, f64::NAN).is_nan());
    for (low, high) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0)] {
        let refused = Sensors::new(&of(low, high), [&outputs, &[], &[]], 1.0);
        assert!(
            matches!(refused, Err(Error::Setting { .. })),
            "{low} {high}"
        );
    }
    let other = ["z".to_string()];
    let unknown = Noise {
        levels: BTreeMap::new(),
        ..of(0.0, 1.0)
    };
    assert!(Sensors::new(&unknown, [&other, &[], &[]], 1.0).is_err());
}

#[test]
fn impossible_levels_are_refused() {
    let outputs = ["y".to_string()];
    for (name, level) in [
        ("z", Level::Absolute(1.0)),
        ("y", Level::Relative(-0.1)),
        ("y", Level::Uniform(f64::INFINITY)),
    ] {
        let noise = Noise {
            levels: [(name.to_string(), level)].into(),
            ..Noise::default()
        };
        let error = Sensors::new(&noise, [&outputs, &[], &[]], 1.0).unwrap_err();
        assert!(matches!(error, Error::Setting { .. }), "{error}");
    }
}
