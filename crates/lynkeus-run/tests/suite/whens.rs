//! Plants whose state jumps: `when` clauses, in runs and in filters.

use lynkeus_expr::Node;
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, NoisyModel, NoisyPlant, Sensor, SigmaPoints,
};
use lynkeus_run::{
    Blueprint, Error, Estimator, EstimatorSettings, Level, Method, Parts, Role, Simulation, Step,
    System, Tolerances, Trajectory,
};

const METHODS: [Method; 2] = [
    Method::Explicit(Tolerances {
        relative: 1e-11,
        absolute: 1e-12,
        budget: 1_000_000,
    }),
    Method::Rk4(Step::Substeps(40)),
];

fn plant(text: &str) -> Plant {
    Plant::from_modelica(text, "m.mo", &LoadOptions::default()).unwrap()
}

fn states(plant: &Plant) -> Vec<(String, Node, f64)> {
    let states = plant.states.iter();
    let start = |s: &lynkeus_model::Variable| s.start.unwrap_or(0.0);
    states.map(|s| (s.name.clone(), s.node, start(s))).collect()
}

fn run(text: &str, until: f64, rows: f64, method: Method) -> Result<Trajectory, Error> {
    let plant = plant(text);
    let (graph, time) = (&plant.graph, plant.time);
    let system = System::of(&Parts {
        graph,
        time,
        states: &states(&plant),
        signals: &[],
        derivatives: &plant.derivatives,
        outputs: &[],
        whens: Some(&plant.whens),
    });
    let inputs = System::new(graph, time, &[], &[], &[], &[])?;
    let mut simulation = Simulation::new(system?, inputs, until, rows);
    simulation.method = method;
    simulation.run().map_err(|interrupted| interrupted.error)
}

/// The state named so, row by row.
fn column(table: &Trajectory, name: &str) -> Vec<f64> {
    let place = table.names(Role::State).position(|n| n == name).unwrap();
    table.column(Role::State.at(place)).unwrap().to_vec()
}

fn last(table: &Trajectory, name: &str) -> f64 {
    *column(table, name).last().unwrap()
}

const BALL: &str = "model M
  Real h(start = 1);
  Real v(start = 0);
  discrete Integer n(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -9.81;
  when h <= 0 then
    reinit(v, -0.8*pre(v));
    n = pre(n) + 1;
  end when;
end M;";

/// Height, speed and bounces of the ball by hand.
fn ball(t: f64) -> (f64, f64, f64) {
    let (g, mut start, mut v, mut n) =
        (9.81, -(2.0_f64 / 9.81).sqrt(), (2.0 * 9.81_f64).sqrt(), 0.0);
    let mut length = 2.0 * v / g;
    while t >= start + length {
        (start, v, n) = (start + length, 0.8 * v, n + 1.0);
        length = 2.0 * v / g;
    }
    let s = t - start;
    (s * (v - 0.5 * g * s), v - g * s, n)
}

#[test]
fn a_ball_bounces_where_and_when_it_does_by_hand() {
    for method in METHODS {
        let table = run(BALL, 2.9, 0.1, method).unwrap();
        let [h, v, n] = ["h", "v", "n"].map(|name| column(&table, name));
        for (k, &t) in table.times().iter().enumerate() {
            let (height, speed, bounces) = ball(t);
            assert!(
                (h[k] - height).abs() < 1e-9,
                "{t}: {} beside {height}",
                h[k]
            );
            assert!((v[k] - speed).abs() < 1e-9, "{t}: {} beside {speed}", v[k]);
            assert_eq!(n[k], bounces, "{t}");
        }
    }
}

/// The bounces add up to t = 4.0637: from there on the model has no solution.
#[test]
fn a_zeno_point_is_told() {
    for method in METHODS {
        for rows in [1.0, 0.01] {
            let error = run(BALL, 6.0, rows, method).unwrap_err();
            let Error::EndlessEvents { time, line, .. } = error else {
                panic!("{error}");
            };
            assert!(line == 9 && (4.063..5.1).contains(&time), "{time}");
        }
    }
}

/// The model of the language's specification ends its bounces itself.
#[test]
fn a_ball_that_knows_rest_comes_to_rest() {
    let text = "model M
      Real h(start = 1); Real v(start = 0); Boolean flying(start = true); Boolean impact;
      Real v_new; output Real y = h;
    equation
      impact = h <= 0.0;
      der(v) = if flying then -9.81 else 0;
      der(h) = v;
      when {h <= 0.0 and v <= 0.0, impact} then
        v_new = if edge(impact) then -0.7*pre(v) else 0;
        flying = v_new > 0;
        reinit(v, v_new);
      end when;
    end M;";
    for method in METHODS {
        let table = run(text, 4.0, 0.5, method).unwrap();
        assert_eq!((last(&table, "v"), last(&table, "flying")), (0.0, 0.0));
        assert!(last(&table, "h").abs() < 1e-9, "{}", last(&table, "h"));
    }
}

#[test]
fn a_chain_of_events_without_end_is_told() {
    let text = "model M
      Real x(start = 0); Boolean a(start = false); output Real y = x;
    equation
      der(x) = 1;
      when x >= 0.5 and not a then
        a = true;
      elsewhen a then
        a = false;
      end when;
    end M;";
    for method in METHODS {
        let error = run(text, 1.0, 0.1, method).unwrap_err();
        assert!(
            matches!(error, Error::EndlessEvents { line: 5 | 7, .. }),
            "{error}"
        );
        assert!(error.to_string().contains("at t = 0.5"), "{error}");
    }
}

/// A threshold without hysteresis: the relay would switch for ever at 20.
#[test]
fn a_relay_that_chatters_is_told() {
    let text = "model M
      Real T(start = 18); Boolean on(start = true); output Real y = T;
    equation
      der(T) = if on then 1 else -1;
      when T > 20 then
        on = false;
      elsewhen T < 20 then
        on = true;
      end when;
    end M;";
    for method in METHODS {
        let error = run(text, 5.0, 0.5, method).unwrap_err();
        assert!(matches!(error, Error::EndlessEvents { .. }), "{error}");
    }
}

/// Times by hand: T = 5 + (T0 − 5) e^(−t/10) without the heater, towards 35 with it.
#[test]
fn a_thermostat_switches_at_its_thresholds() {
    for equation in [
        "when T <= 19 then on = true; elsewhen T >= 21 then on = false; end when;",
        "on = T < 19 or (pre(on) and T < 21);",
        "algorithm when T <= 19 then on := true; elsewhen T >= 21 then on := false; end when;",
    ] {
        let text = format!(
            "model M Real T(start = 20); Boolean on(start = true); output Real y = T;
             equation der(T) = (5 - T)/10 + (if on then 3 else 0); {equation} end M;"
        );
        let heated = |from: f64, to: f64| 10.0 * ((35.0 - from) / (35.0 - to)).ln();
        let cooled = |from: f64, to: f64| 10.0 * ((from - 5.0) / (to - 5.0)).ln();
        for method in METHODS {
            let until = heated(20.0, 21.0) + 3.0 * (cooled(21.0, 19.0) + heated(19.0, 21.0)) + 0.5;
            let table = run(&text, until, until / 50.0, method).unwrap();
            let expected = 5.0 + 16.0 * (-0.05_f64).exp();
            let found = last(&table, "T");
            assert!((found - expected).abs() < 1e-8, "{found} beside {expected}");
            assert_eq!(last(&table, "on"), 0.0);
        }
    }
}

#[test]
fn samples_come_when_they_are_due_and_edges_once() {
    let text = "model M
      Real x(start = 0); discrete Real held(start = -1); Integer n(start = 0); Integer m(start = 0);
      Integer late(start = 0); Boolean b(start = false); output Real y = x;
    equation
      der(x) = 2;
      when sample(0.1, 0.25) then held = x; n = pre(n) + 1; end when;
      when time >= 0.7 then b = true; end when;
      when edge(b) then m = n; end when;
      when {change(m), initial()} then late = pre(late) + 1; end when;
    end M;";
    for method in METHODS {
        let table = run(text, 1.2, 0.3, method).unwrap();
        let held = column(&table, "held");
        // at 0, 0.3, 0.6, 0.9 and 1.2
        for (found, expected) in held.iter().zip([-1.0, 0.2, 0.7, 1.7, 2.2]) {
            assert!((found - expected).abs() < 1e-12, "{held:?}");
        }
        assert_eq!(column(&table, "n"), [0.0, 1.0, 2.0, 4.0, 5.0]);
        assert_eq!(column(&table, "m"), [0.0, 0.0, 0.0, 3.0, 3.0]);
        assert_eq!(column(&table, "late"), [0.0, 1.0, 1.0, 2.0, 2.0]);
    }
}

/// An extended filter of a plant that nobody measures.
fn filter(text: &str, variances: &[f64], noise: &[f64], method: Method) -> Estimator {
    filter_from(text, None, variances, noise, method)
}

fn filter_from(
    text: &str,
    starts: Option<&[f64]>,
    variances: &[f64],
    noise: &[f64],
    method: Method,
) -> Estimator {
    filter_of(
        FilterKind::Extended,
        text,
        starts,
        [variances, noise],
        method,
    )
}

fn filter_of(
    kind: FilterKind,
    text: &str,
    starts: Option<&[f64]>,
    [variances, noise]: [&[f64]; 2],
    method: Method,
) -> Estimator {
    let plant = plant(text);
    let mut all = states(&plant);
    for (state, start) in all.iter_mut().zip(starts.into_iter().flatten()) {
        state.2 = *start;
    }
    let model = NoisyModel::new(&NoisyPlant {
        graph: &plant.graph,
        time: plant.time,
        states: all,
        derivatives: plant.derivatives.clone(),
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: plant.outputs[0].node,
            noise: Level::Absolute(0.05),
            limits: None,
        }],
        process_noise: noise.to_vec(),
        initial_variance: variances.to_vec(),
        ranges: vec![],
        confined: None,
        whens: plant.whens.clone(),
    });
    let run = EstimatorSettings {
        method,
        ..EstimatorSettings::default()
    };
    let settings = FilterSettings {
        keep_history: true,
        ..FilterSettings::of(kind)
    };
    let blueprint = Blueprint::filter(model.unwrap(), settings, run);
    blueprint.estimator().unwrap()
}

const DRUM: &str = "model M
  Real x(start = 1); Real v(start = 0.3); Real k(start = 2); Real c(start = 0); output Real y = x;
equation
  der(x) = v; der(v) = -k*x - 0.1*v^3; der(k) = -0.05*k;
  when x <= 0.4*sin(3*time) then
reinit(v, 0.7*abs(v) + 0.2*x + 0.1*time); c = pre(c) + x^2;
  end when;
  when sample(0.5, 0.7) then reinit(x, x + 0.1*v); end when;
  when time >= 1.3 then reinit(k, 1.5*k + x*v); end when;
end M;";

/// Without noise and readings the deviations are |Φ| times the one at the start, and Φ is what
/// differences of runs from neighbouring starts tell: through jumps that the state, time and both cause.
#[test]
fn deviations_go_through_jumps_as_neighbouring_runs_do() {
    let pairs = [(BALL, 1.6, 3), (DRUM, 2.0, 4)];
    for (text, until, n) in pairs {
        for method in METHODS {
            for column in 0..if n == 3 { 2 } else { 3 } {
                let mut variances = vec![0.0; n];
                variances[column] = 1e-4;
                let mut estimator = filter(text, &variances, &vec![0.0; n], method);
                let go = |e: &mut Estimator| {
                    e.push(0.0, &[f64::NAN]).unwrap();
                    for k in 1..=8 {
                        e.predict(until * f64::from(k) / 8.0).unwrap();
                    }
                    e.estimate().to_vec()
                };
                go(&mut estimator);
                let found = estimator.deviations().unwrap().to_vec();
                let plant = plant(text);
                let starts: Vec<f64> = states(&plant).iter().map(|s| s.2).collect();
                let step = 1e-6;
                let moved = |by: f64| {
                    let mut starts = starts.clone();
                    starts[column] += by;
                    go(&mut filter_from(
                        text,
                        Some(&starts),
                        &variances,
                        &vec![0.0; n],
                        method,
                    ))
                };
                let (above, below) = (moved(step), moved(-step));
                for i in 0..n {
                    let slope = (above[i] - below[i]) / (2.0 * step);
                    let expected = 0.01 * slope.abs();
                    let off = (found[i] - expected).abs();
                    assert!(
                        off < 1e-6 * (1.0 + expected),
                        "{i} {column}: {} beside {expected}",
                        found[i]
                    );
                }
            }
        }
    }
}

const UNSCENTED: FilterKind = FilterKind::Unscented(SigmaPoints {
    alpha: 1.0,
    beta: 0.0,
    kappa: 0.0,
});

/// Points that are near to each other deviate as the saltation matrix says, and rows near an event find all on one side:
/// with process noise and without.
#[test]
fn points_go_through_jumps_as_deviations_do() {
    for (text, until, n) in [(BALL, 1.6, 3), (DRUM, 2.0, 4)] {
        for method in METHODS {
            for noise in [0.0, 1e-8] {
                let mut variances = vec![0.0; n];
                variances[..2].copy_from_slice(&[1e-8, 4e-8]);
                let mut noises = vec![0.0; n];
                noises[1] = noise;
                let numbers = [&variances[..], &noises[..]];
                let [mut points, mut extended] = [UNSCENTED, FilterKind::Extended]
                    .map(|kind| filter_of(kind, text, None, numbers, method));
                for k in 0..=60 {
                    let t = until * f64::from(k) / 60.0;
                    for filter in [&mut points, &mut extended] {
                        filter.push(t, &[f64::NAN]).unwrap();
                    }
                    let pairs = points.estimate().iter().zip(extended.estimate());
                    for (i, (a, b)) in pairs.enumerate() {
                        assert!((a - b).abs() < 1e-6, "{i} at {t}: {a} beside {b}");
                    }
                    let [a, b] = [&points, &extended].map(|f| f.deviations().unwrap());
                    for (i, (a, b)) in a.iter().zip(b).enumerate() {
                        let off = (a - b).abs();
                        assert!(off < 3e-3 * b + 1e-8, "{i} at {t}: {a} beside {b}");
                    }
                }
            }
        }
    }
}

/// What was saved in the middle goes on to the bit.
#[test]
fn a_snapshot_remembers_what_has_happened() {
    let kinds = [
        (FilterKind::Extended, 0.02),
        (UNSCENTED, 0.02),
        (UNSCENTED, 0.0),
    ];
    for (method, (kind, noise)) in METHODS
        .into_iter()
        .flat_map(|m| kinds.clone().map(|kind| (m, kind)))
    {
        let numbers: [&[f64]; 2] = [&[0.01, 0.04, 0.0], &[0.0, noise, 0.0]];
        let new = || filter_of(kind.clone(), BALL, None, numbers, method);
        let reading = |t: f64| [ball(t).0 + 0.02 * (40.0 * t).sin()];
        let mut whole = new();
        let mut half = new();
        for k in 0..40 {
            let t = 0.05 * f64::from(k);
            whole.push(t, &reading(t)).unwrap();
            if k == 17 {
                half.restore(&whole.snapshot()).unwrap();
            }
            if k > 17 {
                assert_eq!(half.push(t, &reading(t)).unwrap(), whole.estimate());
                assert_eq!(half.deviations(), whole.deviations());
            }
        }
        assert_eq!(whole.estimate()[2], ball(1.95).2);
    }
}

#[test]
fn other_filters_refuse_and_a_touch_is_told() {
    let text = "model M Real x(start = 1); Real v(start = -2); output Real y = x;
      equation der(x) = v; der(v) = 2; when x <= 0 then reinit(v, -v); end when; end M;";
    for method in METHODS {
        let mut estimator = filter(text, &[0.01, 0.01], &[0.0, 0.0], method);
        estimator.push(0.0, &[f64::NAN]).unwrap();
        match estimator.predict(2.0) {
            // x = (1 − t)²: rounding tells whether there is an event at t = 1 at all
            Ok(x) => assert!((x[0] - 1.0).abs() < 1e-6),
            Err(error) => assert!(matches!(error, Error::Grazing { line: 2, .. }), "{error}"),
        }
    }
}
