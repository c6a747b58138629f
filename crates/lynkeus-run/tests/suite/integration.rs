//! Integrators against solutions that are known.

use lynkeus_expr::Graph;
use lynkeus_run::{Error, Function, Integrator, Method, Step, System, Tolerances};

fn tight() -> Tolerances {
    Tolerances {
        relative: 1e-10,
        absolute: 1e-13,
        ..Tolerances::default()
    }
}

fn adaptive_methods() -> [Method; 3] {
    [
        Method::Adaptive(tight()),
        Method::Explicit(tight()),
        Method::Stiff(tight()),
    ]
}

fn run<const N: usize>(
    method: Method,
    f: impl FnMut(f64, &[f64], &mut [f64]),
    start: [f64; N],
    stops: &[f64],
) -> Result<[f64; N], Error> {
    let mut f = Function::new(N, f);
    let mut x = start;
    let mut t = 0.0;
    let mut integrator = Integrator::new(method, N)?;
    for &stop in stops {
        integrator.advance(&mut f, t, stop, &mut x)?;
        t = stop;
    }
    Ok(x)
}

fn close(found: f64, expected: f64, relative: f64) {
    let error = (found - expected).abs() / expected.abs();
    assert!(
        error <= relative,
        "{found} is {error:e} away from {expected}"
    );
}

#[test]
fn linear_and_logistic_equations() {
    for method in adaptive_methods() {
        let oscillator = |_: f64, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[1];
            dx[1] = -x[0];
        };
        let x = run(method, oscillator, [0.0, 1.0], &[3.0, 10.0]).unwrap();
        close(x[0], 10.0_f64.sin(), 2e-8);
        let logistic = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = x[0] * (1.0 - x[0]);
        let x = run(method, logistic, [0.1], &[7.0]).unwrap();
        close(x[0], 1.0 / (1.0 + 9.0 * (-7.0_f64).exp()), 1e-9);
    }
}

fn robertson(_: f64, x: &[f64], dx: &mut [f64]) {
    dx[0] = -0.04 * x[0] + 1e4 * x[1] * x[2];
    dx[2] = 3e7 * x[1] * x[1];
    dx[1] = -dx[0] - dx[2];
}

#[test]
fn robertson_is_found_stiff_and_solved() {
    let stops = [0.4, 4.0, 40.0, 400.0, 4000.0, 4e4];
    for method in [Method::Adaptive(tight()), Method::Stiff(tight())] {
        let x = run(method, robertson, [1.0, 0.0, 0.0], &stops).unwrap();
        // Radau and LSODA of SciPy at a relative tolerance of 1e-11
        close(x[0], 0.038_983_377_09, 5e-9);
        close(x[1], 1.621_768_316e-7, 5e-9);
        close(x[2], 0.961_016_460_73, 5e-9);
    }
}

#[test]
fn van_der_pol_with_many_stops() {
    let van_der_pol = |_: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = x[1];
        dx[1] = 1000.0 * ((1.0 - x[0] * x[0]) * x[1]) - x[0];
    };
    let grid: Vec<f64> = (1..=2000).map(f64::from).collect();
    for stops in [&[2000.0][..], &grid] {
        let x = run(Method::Adaptive(tight()), van_der_pol, [2.0, 0.0], stops).unwrap();
        // the reference of the test set for initial value problem solvers, rescaled
        close(x[0], 1.706_167_732_17, 1e-8);
        close(x[1], -8.928_097_010_248e-4, 1e-7);
    }
}

#[test]
fn stiff_forcing_does_not_cost_small_steps() {
    let mut evaluations = 0;
    let forced = |t: f64, x: &[f64], dx: &mut [f64]| {
        evaluations += 1;
        dx[0] = -1e6 * (x[0] - t.cos()) - t.sin();
    };
    let x = run(Method::default(), forced, [1.5], &[10.0]).unwrap();
    close(x[0], 10.0_f64.cos(), 1e-7);
    // an explicit method alone would need 10·1e6/6 steps of 15 evaluations
    assert!(evaluations < 20_000, "{evaluations} evaluations");
}

#[test]
fn the_explicit_method_can_be_forced_on_a_stiff_system() {
    let forced = |t: f64, x: &[f64], dx: &mut [f64]| dx[0] = -2e3 * (x[0] - t.cos()) - t.sin();
    let x = run(Method::Explicit(tight()), forced, [1.5], &[10.0]).unwrap();
    close(x[0], 10.0_f64.cos(), 1e-9);
}

#[test]
fn stiffness_may_end() {
    // stiff before t = 1, then an oscillation with many periods
    let count = |method| {
        let mut evaluations = 0;
        let changing = |t: f64, x: &[f64], dx: &mut [f64]| {
            evaluations += 1;
            let rate = 1e6 * (1.0 - t).clamp(0.0, 1.0).powi(6);
            dx[0] = 40.0 * x[1];
            dx[1] = -40.0 * x[0];
            dx[2] = -rate * (x[2] - 1.0);
        };
        let x = run(method, changing, [0.0, 1.0, 0.0], &[1.0, 20.0]).unwrap();
        assert!((x[0] - 800.0_f64.sin()).abs() < 1e-5 && (x[2] - 1.0).abs() < 1e-7);
        evaluations
    };
    let (auto, stiff) = (
        count(Method::default()),
        count(Method::Stiff(Tolerances::default())),
    );
    assert!(2 * auto < stiff, "{auto} evaluations, {stiff} all stiff");
}

#[test]
fn intervals_below_the_resolution_of_time_are_refused() {
    let still = |_: f64, _: &[f64], dx: &mut [f64]| dx[0] = 1.0;
    for method in [Method::default(), Method::Rk4(Step::Auto)] {
        let mut x = [0.0];
        let mut integrator = Integrator::new(method, 1).unwrap();
        for to in [1.7e9, 1.7e9 + 1e-5, f64::NAN] {
            let mut f = Function::new(1, still);
            let error = integrator.advance(&mut f, 1.7e9, to, &mut x).unwrap_err();
            assert!(matches!(error, Error::Setting { .. }), "{error}");
        }
    }
}

#[test]
fn a_finite_escape_is_reported_where_it_happens() {
    for method in adaptive_methods() {
        let escape = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = x[0] * x[0];
        let error = run(method, escape, [1.0], &[2.0]).unwrap_err();
        let (Error::StepUnderflow { time, .. }
        | Error::StepBudget { time, .. }
        | Error::NotFinite { time, .. }) = error
        else {
            panic!("{method:?}: {error}");
        };
        assert!((time - 1.0).abs() < 1e-6, "{method:?}: {error}");
    }
}

#[test]
fn leaving_the_domain_is_reported_where_it_happens() {
    for method in adaptive_methods() {
        // reaches 0 at t = 2 and cannot go on
        let emptying = |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = -x[0].sqrt() - 1e-3;
        let error = run(method, emptying, [1.0], &[4.0]).unwrap_err();
        let Error::NotFinite { time, .. } = error else {
            panic!("{method:?}: {error}");
        };
        assert!((time - 2.0).abs() < 0.02, "{method:?}: {error}");
    }
}

#[test]
fn a_step_into_the_undefined_is_only_rejected() {
    for method in adaptive_methods() {
        // f is defined for x > 0 only; x decays fast and stays positive
        let decay =
            |_: f64, x: &[f64], dx: &mut [f64]| dx[0] = -50.0 * x[0] * (1.0 + 0.1 * x[0].ln());
        let x = run(method, decay, [1.0], &[5.0]).unwrap();
        // ln x + 10 = 10·exp(−5t)
        close(x[0], (10.0 * (-25.0_f64).exp() - 10.0).exp(), 1e-7);
    }
}

#[test]
fn the_budget_ends_a_run() {
    let tolerances = Tolerances {
        budget: 20,
        ..tight()
    };
    let fast = |_: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = 100.0 * x[1];
        dx[1] = -100.0 * x[0];
    };
    let error = run(Method::Explicit(tolerances), fast, [0.0, 1.0], &[10.0]).unwrap_err();
    assert!(
        matches!(error, Error::StepBudget { steps: 20, .. }),
        "{error}"
    );
}

#[test]
fn what_chatters_ends_within_the_steps_of_a_run() {
    // a relay: every row takes fewer steps than the budget of a row
    let relay = |_: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = x[1];
        dx[1] = -1e9 * x[0].signum() - x[1];
    };
    let rows: Vec<f64> = (1..=100).map(|row| 0.05 * f64::from(row)).collect();
    let error = run(Method::default(), relay, [1.0, 0.0], &rows).unwrap_err();
    let Error::StepBudget { time, steps, .. } = error else {
        panic!("{error}");
    };
    assert!(time > 0.05 && time < 5.0, "{error}");
    assert!((300_000..=320_000).contains(&steps), "{error}");
    assert!(!error.to_string().contains("budget"), "{error}");
    // a long run of ordinary rows has steps enough
    let oscillator = |_: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = 40.0 * x[1];
        dx[1] = -40.0 * x[0];
    };
    let rows: Vec<f64> = (1..=20_000).map(f64::from).collect();
    let x = run(Method::default(), oscillator, [0.0, 1.0], &rows).unwrap();
    close(x[0].hypot(x[1]), 1.0, 1e-3);
}

#[test]
fn automatic_fixed_steps_are_stable() {
    let stiff = |t: f64, x: &[f64], dx: &mut [f64]| dx[0] = -500.0 * (x[0] - t);
    let x = run(Method::Rk4(Step::Auto), stiff, [1.0], &[1.0, 2.0]).unwrap();
    close(x[0], 2.0 - 1.0 / 500.0, 1e-6);
    let impossible = |t: f64, x: &[f64], dx: &mut [f64]| dx[0] = -1e9 * (x[0] - t);
    let error = run(Method::Rk4(Step::Auto), impossible, [1.0], &[1.0]).unwrap_err();
    assert!(matches!(error, Error::TooStiff { .. }), "{error}");
}

#[test]
fn impossible_settings_are_refused() {
    let bad = [
        Method::Rk4(Step::AtMost(0.0)),
        Method::Rk4(Step::AtMost(f64::NAN)),
        Method::Rk4(Step::Substeps(0)),
        Method::Adaptive(Tolerances {
            relative: 0.0,
            ..tight()
        }),
        Method::Stiff(Tolerances {
            absolute: f64::NAN,
            ..tight()
        }),
    ];
    for method in bad {
        let error = Integrator::new(method, 1).unwrap_err();
        assert!(matches!(error, Error::Setting { .. }), "{error}");
    }
}

/// Heat in a rod of 400 cells: an eigenmode decays at its own rate, −2(1 − cos(π/401))·10⁴ beside
/// rates up to 4·10⁴, which takes a Jacobian of the graph and factors of three bands.
#[test]
fn a_stiff_rod_of_many_cells_cools_like_its_slowest_mode() {
    let (n, pace) = (400, 1e4);
    let g = Graph::new();
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
    let wave = std::f64::consts::PI / (n + 1) as f64;
    let mode = |i: usize| (wave * (i + 1) as f64).sin();
    let end = g.constant(0.0);
    let around = |i: usize| {
        let left = if i > 0 { x[i - 1] } else { end };
        let right = x.get(i + 1).copied().unwrap_or(end);
        ((left - x[i] * 2.0 + right) * pace).node()
    };
    let dx: Vec<_> = (0..n).map(around).collect();
    let states = x.iter().enumerate();
    let states: Vec<_> = states
        .map(|(i, x)| (format!("x{i}"), x.node(), mode(i)))
        .collect();
    let time = g.symbol("time").node();
    let rod = System::new(&g, time, &states, &[], &dx, &[]).unwrap();
    let rate = 2.0 * (1.0 - wave.cos()) * pace;
    for method in [Method::Adaptive(tight()), Method::Stiff(tight())] {
        let mut x = rod.start().to_vec();
        let mut integrator = Integrator::new(method, n).unwrap();
        let mut f = rod.evaluation();
        integrator.advance(&mut f, 0.0, 2.0, &mut x).unwrap();
        for (i, x) in x.iter().enumerate() {
            close(*x, mode(i) * (-2.0 * rate).exp(), 1e-7);
        }
    }
}
