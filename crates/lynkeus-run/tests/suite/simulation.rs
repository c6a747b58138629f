//! Simulations against closed forms.

use std::ops::ControlFlow;

use crate::common::system;
use lynkeus_expr::{Expr, Graph};
use lynkeus_run::{Error, Level, Method, Noise, Role, Simulation, Step, System, Tolerances};

fn tight() -> Method {
    Method::Adaptive(Tolerances {
        relative: 1e-12,
        absolute: 1e-14,
        ..Tolerances::default()
    })
}

/// x' = a·(u − x), y = x
fn lag(g: &Graph) -> System {
    let (x, u) = (g.symbol("x"), g.symbol("u"));
    system(g, &[("x", 0.5, (u - x) * 2.0)], &["u"], &[("y", x)])
}

fn input<'g>(g: &'g Graph, u: Expr<'g>) -> System {
    system(g, &[], &[], &[("u", u)])
}

/// The lag's answer to an input that is constant between switches.
fn piecewise(times: &[f64], values: &[f64], until: f64) -> f64 {
    let mut x = 0.5;
    for (k, u) in values.iter().enumerate() {
        let from = if k == 0 { 0.0 } else { times[k - 1] };
        let to = times.get(k).copied().unwrap_or(until).min(until);
        if to > from {
            x = u + (x - u) * (-2.0 * (to - from)).exp();
        }
    }
    x
}

fn final_x(simulation: &Simulation) -> f64 {
    let table = simulation.run().expect("a simulation that ends");
    let x = table.column(Role::State.at(0)).expect("the state");
    x[x.len() - 1]
}

#[test]
fn jumps_of_the_input_are_stepped_onto() {
    let g = Graph::new();
    let t = g.symbol("time");
    let high = t.less(g.constant(0.37)).or(t.greater_eq(g.constant(1.61)));
    let u = high.select(g.constant(0.75), g.constant(0.38));
    let expected = piecewise(&[0.37, 1.61], &[0.75, 0.38, 0.75], 3.0);
    // the grid never meets the jumps
    for (method, tolerance) in [
        (tight(), 1e-12),
        (Method::Rk4(Step::AtMost(0.002)), 1e-12),
        (Method::Stiff(Tolerances::default()), 1e-8),
    ] {
        let mut simulation = Simulation::new(lag(&g), input(&g, u), 3.0, 0.5);
        simulation.method = method;
        let error = (final_x(&simulation) - expected).abs();
        assert!(error < tolerance, "{method:?}: {error:e}");
    }
}

#[test]
fn floor_sign_and_relations_that_are_not_affine() {
    let g = Graph::new();
    let t = g.symbol("time");
    // a square wave through mod, and one through a sine
    let modulo = t - (t / 0.7).floor() * 0.7;
    let cases = [
        (modulo.less(g.constant(0.35)), 0.35),
        (
            (t * (std::f64::consts::PI / 0.35))
                .sin()
                .greater(g.constant(0.0)),
            0.35,
        ),
    ];
    for (wave, half_period) in cases {
        let u = wave.select(g.constant(1.0), g.constant(-1.0));
        let times: Vec<f64> = (1..8).map(|k| half_period * f64::from(k)).collect();
        let values: Vec<f64> = (0..8)
            .map(|k| if k % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let mut simulation = Simulation::new(lag(&g), input(&g, u), 2.6, 0.4);
        simulation.method = tight();
        let error = (final_x(&simulation) - piecewise(&times, &values, 2.6)).abs();
        assert!(error < 1e-11, "{error:e}");
    }
    let sign = (t - 1.2345).sign();
    let mut simulation = Simulation::new(lag(&g), input(&g, sign), 2.0, 1.0);
    simulation.method = tight();
    let error = (final_x(&simulation) - piecewise(&[1.2345], &[-1.0, 1.0], 2.0)).abs();
    assert!(error < 1e-12, "{error:e}");
}

#[test]
fn rows_show_the_input_from_the_right() {
    let g = Graph::new();
    let t = g.symbol("time");
    let u = t
        .less(g.constant(0.5))
        .select(g.constant(1.0), g.constant(2.0));
    let table = Simulation::new(lag(&g), input(&g, u), 0.9, 0.25)
        .run()
        .unwrap();
    assert_eq!(table.times(), [0.0, 0.25, 0.5, 0.75, 0.9]);
    assert_eq!(
        table.column(Role::Input.at(0)).unwrap(),
        [1.0, 1.0, 2.0, 2.0, 2.0]
    );
    let names = |role| table.names(role).collect::<Vec<_>>();
    assert_eq!(
        (names(Role::State), names(Role::Input)),
        (vec!["x"], vec!["u"])
    );
}

/// The lag with an observer x̂' = 2(u − x̂) + 5(y − x̂).
fn observed(g: &Graph) -> Simulation {
    let (x_hat, u, y) = (g.symbol("x_hat"), g.symbol("u"), g.symbol("y"));
    let dx = (u - x_hat) * 2.0 + (y - x_hat) * 5.0;
    let observer = system(g, &[("x_hat", -1.0, dx)], &["y", "u"], &[]);
    let mut simulation = Simulation::new(lag(g), input(g, g.symbol("time").sin()), 2.0, 0.1);
    simulation.observer = Some(observer);
    simulation
}

#[test]
fn an_observer_runs_along() {
    let g = Graph::new();
    let mut simulation = observed(&g);
    simulation.method = tight();
    let table = simulation.run().unwrap();
    let (x, x_hat) = (
        table.column(Role::State.at(0)).unwrap(),
        table.column(Role::Estimate.at(0)).unwrap(),
    );
    for ((t, x), x_hat) in table.times().iter().zip(x).zip(x_hat) {
        // e' = −7e
        assert!((x_hat - x + 1.5 * (-7.0 * t).exp()).abs() < 1e-11);
    }
}

/// Whatever a state is called, it is neither the estimate nor the measurement.
#[test]
fn names_that_repeat_change_no_number() {
    let g = Graph::new();
    let run = |name: &str| {
        let (x, u) = (g.symbol("x"), g.symbol("u"));
        let mut simulation = observed(&g);
        let states = [(name.to_string(), x.node(), 0.5)];
        let signals = [("u".to_string(), u.node())];
        let dx = ((u - x) * 2.0).node();
        let outputs = [("y".to_string(), x.node())];
        let time = g.symbol("time").node();
        simulation.plant = System::new(&g, time, &states, &signals, &[dx], &outputs).unwrap();
        simulation.record_outputs = true;
        simulation.noise.levels = [("y".to_string(), Level::Absolute(0.3))].into();
        simulation.run().unwrap()
    };
    let usual = run("x");
    for name in ["x_hat", "y_measured", "y", "u", "t"] {
        let renamed = run(name);
        assert_eq!(
            renamed.names(Role::State).collect::<Vec<_>>(),
            [name],
            "the name is the user's"
        );
        for role in [Role::State, Role::Input, Role::Output, Role::Measured] {
            assert_eq!(renamed.column(role.at(0)), usual.column(role.at(0)));
        }
        let hat = Role::Estimate.at(0);
        assert_eq!(renamed.column(hat), usual.column(hat), "{name}");
    }
}

#[test]
fn a_signal_that_two_columns_provide_is_refused() {
    let g = Graph::new();
    let mut simulation = observed(&g);
    let x = g.symbol("x");
    // the output is called as the input is
    simulation.plant = system(
        &g,
        &[("x", 0.5, (g.symbol("u") - x) * 2.0)],
        &["u"],
        &[("y", x), ("u", x)],
    );
    let error = simulation.run().unwrap_err();
    assert!(
        matches!(&error.error, Error::Ambiguous { reader: "observer", name } if name == "u"),
        "{error}"
    );
}

#[test]
fn noise_is_held_recorded_and_repeatable() {
    let g = Graph::new();
    let mut simulation = observed(&g);
    simulation.record_outputs = true;
    simulation.method = tight();
    simulation.noise = Noise {
        seed: 11,
        sample_step: Some(0.2),
        levels: [("y".to_string(), Level::Absolute(0.3))].into(),
        ..Noise::default()
    };
    let table = simulation.run().unwrap();
    assert_eq!(table, simulation.run().unwrap());
    let (y, measured) = (
        table.column(Role::Output.at(0)).unwrap(),
        table.column(Role::Measured.at(0)).unwrap(),
    );
    let noise: Vec<f64> = measured.iter().zip(y).map(|(m, y)| m - y).collect();
    let x_hat = table.column(Role::Estimate.at(0)).unwrap();
    let mut error = x_hat[0] - y[0];
    for k in 0..20 {
        if k % 2 == 0 {
            assert!(
                (noise[k] - noise[k + 1]).abs() < 1e-15,
                "held over a sample"
            );
        } else {
            assert!((noise[k] - noise[k + 1]).abs() > 1e-6, "drawn anew");
        }
        // e' = −7e + 5·noise, exactly
        let rest = 5.0 / 7.0 * noise[k];
        error = rest + (error - rest) * (-0.7_f64).exp();
        assert!((x_hat[k + 1] - y[k + 1] - error).abs() < 1e-10, "row {k}");
    }
    simulation.noise.seed = 12;
    assert_ne!(table, simulation.run().unwrap());
}

#[test]
fn what_is_not_connected_is_named() {
    let g = Graph::new();
    let nothing = system(&g, &[], &[], &[]);
    let error = Simulation::new(lag(&g), nothing, 1.0, 0.1)
        .run()
        .unwrap_err();
    assert!(
        matches!(&error.error, Error::Unconnected { reader: "plant", name, .. } if name == "u"),
        "{error}"
    );
    let mut simulation = observed(&g);
    let z = g.symbol("z");
    simulation.observer = Some(system(&g, &[("x_hat", 0.0, z)], &["z"], &[]));
    let error = simulation.run().unwrap_err();
    assert!(error.to_string().contains("observer reads 'z'"), "{error}");
    assert!(error.to_string().contains("y, u"), "{error}");
}

#[test]
fn an_undefined_operation_is_named_with_its_time_and_state() {
    let g = Graph::new();
    let h = g.symbol("h");
    let tank = system(&g, &[("h", 1.0, -h.sqrt() - 0.5)], &[], &[]);
    let mut simulation = Simulation::new(tank, system(&g, &[], &[], &[]), 5.0, 0.1);
    for method in [Method::default(), Method::Rk4(Step::AtMost(0.01))] {
        simulation.method = method;
        let error = simulation.run().unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("sqrt(h) is NaN") && text.contains("h = -"),
            "{text}"
        );
        // empty at t = 2 − ln 3
        let last = *error.partial.times().last().unwrap();
        assert!((0.7..0.95).contains(&last), "rows up to {last}");
        assert!(
            error
                .partial
                .column(Role::State.at(0))
                .unwrap()
                .iter()
                .all(|h| h.is_finite())
        );
    }
}

#[test]
fn an_input_that_is_not_finite_is_named() {
    let g = Graph::new();
    let u = (g.symbol("time") - 0.5).ln();
    let error = Simulation::new(lag(&g), input(&g, u), 1.0, 0.1)
        .run()
        .unwrap_err();
    assert!(
        error.to_string().contains("ln(time - 0.5) is NaN"),
        "{error}"
    );
}

#[test]
fn a_run_reports_progress_and_can_be_stopped() {
    let g = Graph::new();
    let mut fractions = vec![];
    let stopped = observed(&g).run_watched(&mut |fraction| {
        fractions.push(fraction);
        if fractions.len() == 5 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let error = stopped.unwrap_err();
    assert!(matches!(error.error, Error::Cancelled { .. }), "{error}");
    assert_eq!((error.partial.len(), fractions[4]), (6, 0.25));
}

#[test]
fn impossible_grids_are_refused() {
    let g = Graph::new();
    let base = observed(&g);
    let changes: [fn(&mut Simulation); 6] = [
        |s| s.until = 0.0,
        |s| s.until = f64::NAN,
        |s| s.output_step = 0.0,
        |s| s.output_step = 1e-12,
        |s| s.start = f64::INFINITY,
        |s| s.noise.sample_step = Some(-1.0),
    ];
    for change in changes {
        let mut simulation = base.clone();
        change(&mut simulation);
        let error = simulation.run().unwrap_err();
        assert!(matches!(error.error, Error::Setting { .. }), "{error}");
    }
}

#[test]
fn too_many_jumps_are_refused() {
    let g = Graph::new();
    let u = (g.symbol("time") * 1e9).floor();
    let error = Simulation::new(lag(&g), input(&g, u), 1.0, 0.1)
        .run()
        .unwrap_err();
    assert!(
        matches!(error.error, Error::TooManySwitches { .. }),
        "{error}"
    );
}

#[test]
fn a_plant_may_have_no_states() {
    let g = Graph::new();
    let u = g.symbol("u");
    let static_plant = system(&g, &[], &["u"], &[("y", u * 2.0)]);
    let mut simulation = Simulation::new(static_plant, input(&g, g.symbol("time")), 1.0, 0.25);
    simulation.record_outputs = true;
    for method in [Method::default(), Method::Rk4(Step::Auto)] {
        simulation.method = method;
        let table = simulation.run().unwrap();
        assert_eq!(
            table.column(Role::Output.at(0)).unwrap(),
            [0.0, 0.5, 1.0, 1.5, 2.0]
        );
    }
}

#[test]
fn a_diverging_observer_keeps_its_rows() {
    let g = Graph::new();
    let (x_hat, y) = (g.symbol("x_hat"), g.symbol("y"));
    let mut simulation = observed(&g);
    let unstable = (x_hat - y) * 30.0;
    simulation.observer = Some(system(&g, &[("x_hat", -1.0, unstable)], &["y"], &[]));
    let error = simulation.run().unwrap_err();
    assert!(
        matches!(&error.error, Error::Diverged { name, .. } if name == "x_hat"),
        "{error}"
    );
    // 1.5·exp(30 t) passes 1e12 at t = 0.91
    assert_eq!(error.partial.times().last(), Some(&0.9));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]

    #[test]
    fn any_steps_of_the_input_match_the_closed_form(
        mut times in proptest::collection::vec(0.01..2.9_f64, 1..6),
        values in proptest::collection::vec(-2.0..2.0_f64, 7),
        output_step in 0.05..3.0_f64,
    ) {
        times.sort_by(f64::total_cmp);
        let g = Graph::new();
        let t = g.symbol("time");
        let u = times.iter().zip(&values).rev().fold(g.constant(values[times.len()]), |rest, (&end, &value)| {
            t.less(g.constant(end)).select(g.constant(value), rest)
        });
        let mut simulation = Simulation::new(lag(&g), input(&g, u), 3.0, output_step);
        simulation.method = tight();
        let expected = piecewise(&times, &values[..=times.len()], 3.0);
        proptest::prop_assert!((final_x(&simulation) - expected).abs() < 1e-11);
    }
}

/// An integrator moved by white noise is a Brownian motion: after a time T its variance is q·T.
#[test]
fn process_noise_moves_states() {
    let g = Graph::new();
    let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name).node());
    let states = [("x".to_string(), x, 0.0), ("v".to_string(), v, 0.0)];
    let zero = g.constant(0.0).node();
    let plant = System::new(&g, time, &states, &[], &[v, zero], &[]).unwrap();
    let inputs = System::new(&g, time, &[], &[], &[], &[]).unwrap();
    let mut simulation = Simulation::new(plant, inputs, 4.0, 0.1);
    simulation.noise.process = [("v".to_string(), 0.25)].into();
    let runs = 2000;
    let (mut last, mut moved) = (vec![], vec![]);
    for seed in 0..runs {
        simulation.noise.seed = seed;
        let run = simulation.run().unwrap();
        let end = |place| *run.column(Role::State.at(place)).unwrap().last().unwrap();
        last.push(end(1));
        moved.push(end(0));
    }
    let variance = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>() / runs as f64;
    // four standard errors of a variance: 4·√(2/runs)
    let within = 4.0 * (2.0 / runs as f64).sqrt();
    assert!((variance(&last) / (0.25 * 4.0) - 1.0).abs() < within);
    // q·T³/3 of its integral, where the noise is held for 1/40 of the time: 0.1 % of it
    assert!((variance(&moved) / (0.25 * 64.0 / 3.0) - 1.0).abs() < within);
    simulation.noise.process = [("w".to_string(), 0.25)].into();
    assert!(simulation.run().unwrap_err().to_string().contains("'w'"));
}
