use lynkeus_expr::Graph;

use super::*;

fn quantity(name: &str, node: Node, start: f64) -> Quantity {
    Quantity {
        name: name.to_owned(),
        node,
        start,
        scale: 2.0,
        is_known: false,
    }
}

fn sensor(name: &str, node: Node, deviation: f64) -> Sensor {
    Sensor {
        name: name.to_owned(),
        node,
        noise: Deviation::Absolute(deviation),
        limits: None,
    }
}

fn near(found: f64, expected: f64, tolerance: f64) {
    let error = (found / expected - 1.0).abs();
    assert!(error < tolerance, "found {found}, expected {expected}");
}

/// x' = −a·x, measured directly.
fn decay(a: f64, horizons: Vec<usize>) -> Precision {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|n| g.symbol(n).node());
    let window = Window {
        start: 3.0,
        step: 0.5,
        horizons,
    };
    let experiment = Experiment {
        states: vec![quantity("x", x, 1.5)],
        derivatives: vec![(g.expr(x) * -a).node()],
        sensors: vec![sensor("y", x, 0.1)],
        ..Experiment::new(&g, time, window)
    };
    experiment.run().unwrap()
}

#[test]
fn a_decaying_state_is_known_as_the_geometric_series_says() {
    let found = decay(0.7, vec![1, 4, 40, 400]);
    for (horizon, k) in [1, 4, 40, 400].into_iter().enumerate() {
        let information: f64 = (0..=k).map(|i| (-0.7 * f64::from(i)).exp()).sum::<f64>() / 0.01;
        let σ = found.deviations(horizon, &[0]);
        near(σ.start[0], information.sqrt().recip(), 1e-7);
        let left = (-0.35 * f64::from(k)).exp();
        if left > 1e-8 {
            near(σ.present[0], left * information.sqrt().recip(), 1e-6);
        }
    }
}

#[test]
fn an_unknown_constant_input_is_the_slope_of_a_straight_line() {
    // x' = v with the course v = sin t: the error of v is what counts
    let g = Graph::new();
    let [time, x, v] = ["time", "x", "v"].map(|n| g.symbol(n).node());
    let window = Window {
        start: 0.0,
        step: 0.25,
        horizons: vec![1, 19],
    };
    let experiment = Experiment {
        states: vec![quantity("x", x, 0.0)],
        derivatives: vec![v],
        unknown: vec![quantity("v", v, 0.0)],
        inputs: vec![(v, g.expr(time).sin().node())],
        sensors: vec![sensor("y", x, 0.3)],
        ..Experiment::new(&g, time, window)
    };
    let found = experiment.run().unwrap();
    for (horizon, n) in [2.0_f64, 20.0].into_iter().enumerate() {
        let σ = found.deviations(horizon, &[0]);
        let slope = 0.3 / 0.25 * (12.0 / (n * (n * n - 1.0))).sqrt();
        let end = 0.3 * (2.0 * (2.0 * n - 1.0) / (n * (n + 1.0))).sqrt();
        near(σ.present[1], slope, 1e-7);
        near(σ.start[0], end, 1e-7);
        near(σ.present[0], end, 1e-7);
    }
}

/// Two states of which only the sum is measured, and a third that is measured alone.
fn sum_of_two(rates: [f64; 2], horizon: usize) -> Precision {
    let g = Graph::new();
    let [time, a, b, c] = ["time", "a", "b", "c"].map(|n| g.symbol(n));
    let window = Window {
        start: 0.0,
        step: 0.1,
        horizons: vec![horizon],
    };
    let experiment = Experiment {
        states: ["a", "b", "c"]
            .map(|n| quantity(n, g.symbol(n).node(), 1.0))
            .to_vec(),
        derivatives: vec![
            (a * -rates[0]).node(),
            (b * -rates[1]).node(),
            (c * -0.1).node(),
        ],
        sensors: vec![
            sensor("sum", (a + b).node(), 0.1),
            sensor("c", c.node(), 0.1),
            sensor("nothing", (c * 0.0).node(), 0.1),
        ],
        ..Experiment::new(&g, time.node(), window)
    };
    experiment.run().unwrap()
}

#[test]
fn what_only_shows_in_a_sum_is_not_seen_alone() {
    let found = sum_of_two([1.0, 1.0], 20);
    let σ = found.deviations(0, &[0, 1, 2]);
    assert_eq!((σ.rank.seen, σ.rank.of), (2, 3));
    assert!(σ.present[0].is_infinite() && σ.start[1].is_infinite());
    assert!(σ.present[2] < 0.1, "{σ:?}");
    assert!(!found.is_doubtful(0, &[0, 1, 2]));
    // rates that differ make the two distinguishable
    let σ = sum_of_two([1.0, 1.1], 20).deviations(0, &[0, 1]);
    assert_eq!(σ.rank.seen, 3);
    assert!(σ.present[0].is_finite());
    // rates that differ by as little as the integrator's tolerance leave it open
    let equal = sum_of_two([1.0, 1.0 + 1e-6], 20);
    assert!(equal.is_doubtful(0, &[0, 1]));
}

#[test]
fn what_is_not_seen_but_long_gone_is_known_at_present() {
    let σ = sum_of_two([1.0, 1.0], 200).deviations(0, &[0]);
    assert!(σ.start[0].is_infinite());
    assert!(σ.present[0] < 1e-6, "{σ:?}");
    assert!(σ.present[2].is_infinite());
    // no sensor at all
    let blind = sum_of_two([1.0, 1.0], 20).deviations(0, &[2]);
    assert_eq!(blind.rank.seen, 0);
    assert!(blind.present.iter().all(|s| s.is_infinite()));
}

#[test]
fn the_best_sensor_comes_first() {
    let found = sum_of_two([1.0, 1.1], 20);
    let advice = found.advise(&[0], &[0, 1, 2]);
    assert_eq!(advice.present.unseen, 1);
    assert_eq!(advice.additions[0].sensors, [0, 1]);
    assert_eq!(advice.additions[0].unseen, 0);
    assert_eq!(advice.pairs.len(), 3);
    assert_eq!(advice.same_size, advice.singles);
}

#[test]
fn horizons_grow_by_ratios_and_end_at_the_span() {
    let window = Window::log_spaced(0.0, 10.0, 0.1, 5);
    assert_eq!(window.horizons, [1, 3, 10, 32, 100]);
    assert_eq!(Window::log_spaced(0.0, 0.1, 0.1, 5).horizons, [1]);
}

#[test]
fn impossible_numbers_are_named() {
    let g = Graph::new();
    let x = g.symbol("x").node();
    let window = Window {
        start: 0.0,
        step: 0.1,
        horizons: vec![3],
    };
    let mut experiment = Experiment {
        states: vec![quantity("x", x, 1.0)],
        derivatives: vec![x],
        sensors: vec![sensor("y", x, 0.0)],
        ..Experiment::new(&g, g.symbol("time").node(), window)
    };
    let text = experiment.run().unwrap_err().to_string();
    assert!(text.contains("noise of 'y'"), "{text}");
    experiment.sensors.clear();
    experiment.window.horizons = vec![3, 3];
    assert!(experiment.run().is_err());
}
