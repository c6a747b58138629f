//! Pulsed inputs: the integral of an expression of time, however short its pulses.

mod random;

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use crate::common::system;
use lynkeus_expr::{Expr, Graph};
use lynkeus_run::{Error, Method, Role, Simulation, Step, Tolerances};

/// ∫u dt from 0 to `until`, in rows of `output_step`.
fn integral(
    build: impl Fn(Expr<'_>) -> Expr<'_>,
    until: f64,
    output_step: f64,
    method: Method,
) -> Result<f64, Error> {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let plant = system(&g, &[("x", 0.0, u)], &["u"], &[]);
    let inputs = system(&g, &[], &[], &[("u", build(time))]);
    let mut simulation = Simulation::new(plant, inputs, until, output_step);
    simulation.method = method;
    let table = simulation.run().map_err(|interrupted| interrupted.error)?;
    let x = table.column(Role::State.at(0)).expect("the state");
    Ok(x[x.len() - 1])
}

fn check(build: impl Fn(Expr<'_>) -> Expr<'_>, until: f64, expected: f64) {
    for method in [Method::default(), Method::Rk4(Step::Auto)] {
        for output_step in [until, until / 7.3] {
            let found = integral(&build, until, output_step, method).unwrap();
            let error = (found - expected).abs();
            assert!(
                error <= 1e-6 * expected.abs().max(1.0),
                "{method:?} in rows of {output_step}: {found}, expected {expected}"
            );
        }
    }
}

fn c<'g>(like: Expr<'g>, value: f64) -> Expr<'g> {
    like.graph().constant(value)
}

fn modulo(t: Expr<'_>, period: f64) -> Expr<'_> {
    t - (t / period).floor() * period
}

#[test]
fn pulses_of_a_remainder() {
    check(|t| modulo(t, 10.0).less(c(t, 1.0)), 86_400.0, 8640.0);
    // neighbours: another period that no row meets, and a duty of a thousandth
    check(|t| modulo(t, 0.7).less(c(t, 0.2)), 1400.0, 400.0);
    check(|t| modulo(t, 60.0).greater_eq(c(t, 59.94)), 86_400.0, 86.4);
}

/// ∫ of (sin(ω t) > level) from 0 to `until`.
fn above(omega: f64, level: f64, until: f64) -> f64 {
    let (rise, fall) = (level.asin(), PI - level.asin());
    let turns = (omega * until / TAU).floor();
    let rest = omega * until - turns * TAU;
    (turns * (fall - rise) + rest.clamp(rise, fall) - rise) / omega
}

#[test]
fn pulses_of_a_sine() {
    let expected = above(7.0, 0.9, 3600.0);
    assert!((expected - 516.8).abs() < 0.1, "{expected}");
    check(|t| (t * 7.0).sin().greater(c(t, 0.9)), 3600.0, expected);
    check(
        |t| (t * 3.0).sin().greater(c(t, 0.999)),
        5000.0,
        above(3.0, 0.999, 5000.0),
    );
}

fn window(t: Expr<'_>, from: f64, to: f64) -> Expr<'_> {
    t.greater(c(t, from)).and(t.less(c(t, to)))
}

#[test]
fn one_short_pulse_in_a_long_row() {
    check(
        |t| window(t, 1000.0, 1000.001).select(c(t, 1e3), c(t, 0.0)),
        3000.0,
        1.0,
    );
    // a pulse whose relation is not affine in time: |t² − 10⁶| < 10⁻³
    check(
        |t| (t * t - 1e6).abs().less(c(t, 1e-3)) * 1e6,
        3000.0,
        1e6 * ((1e6_f64 + 1e-3).sqrt() - (1e6_f64 - 1e-3).sqrt()),
    );
}

fn high(t: Expr<'_>) -> Expr<'_> {
    modulo(t, 10.0).less(c(t, 1.0))
}

#[test]
fn pulses_within_pulses() {
    // ten of the first hundred seconds, then a tenth of every twentieth
    check(
        |t| {
            let later = modulo(t, 20.0).less(c(t, 2.0)) * 3.0;
            t.less(c(t, 100.0)).select(high(t), later)
        },
        1000.0,
        10.0 + 0.3 * 900.0,
    );
    // the remainder of a remainder, and a product of pulses
    check(
        |t| modulo(modulo(t, 10.0), 3.0).less(c(t, 1.0)),
        1000.0,
        400.0,
    );
    check(
        |t| high(t) * modulo(t + 0.5, 5.0).less(c(t, 1.0)),
        1000.0,
        50.0,
    );
    check(
        |t| t.sin().max(c(t, 0.5)).greater(c(t, 0.75)),
        100.0 * TAU,
        above(1.0, 0.75, 100.0 * TAU),
    );
}

#[test]
fn kinks_are_stops() {
    // ∫ of max(0, sin t) and |sin t| over 100 half-waves
    for method in [Method::default(), Method::Rk4(Step::AtMost(0.05))] {
        let half_waves = |build: Input| integral(build, 100.0 * PI, 100.0 * PI, method).unwrap();
        let rectified = half_waves(|t| t.sin().max(c(t, 0.0)));
        assert!((rectified - 100.0).abs() < 1e-5, "{rectified}");
        let both = half_waves(|t| t.sin().abs());
        assert!((both - 200.0).abs() < 1e-5, "{both}");
    }
}

#[test]
fn roots_that_are_not_simple() {
    // touched, never crossed
    check(|t| t.sin().greater_eq(c(t, 1.0)), 1000.0, 0.0);
    check(|t| t.sin().abs().greater(c(t, 0.0)), 1000.0, 1000.0);
    check(|t| (t - 3.0).powi(2).less_eq(c(t, 0.0)), 7.0, 0.0);
    check(|t| (t - 3.0).powi(3).greater(c(t, 0.0)), 7.0, 4.0);
    // a pole, a domain that ends, a tower that overflows
    check(|t| t.tan().greater(c(t, 1.0)), 100.0 * PI, 25.0 * PI);
    check(|t| (t - 5.0).ln().greater(c(t, 0.0)), 9.0, 3.0);
    check(
        |t| (t * t).exp().greater(c(t, 1e300)),
        30.0,
        30.0 - (300.0 * 10_f64.ln()).sqrt(),
    );
}

/// An input as an expression of time.
type Input = fn(Expr<'_>) -> Expr<'_>;

fn refused(build: Input, expression: &str) -> (Error, Duration) {
    let before = Instant::now();
    let error = integral(build, 1.0, 0.5, Method::default()).unwrap_err();
    assert!(error.to_string().contains(expression), "{error}");
    (error, before.elapsed())
}

#[test]
fn what_switches_without_end_is_named() {
    let one: [(Input, &str); 3] = [
        (|t| (t * 1e15).floor(), "floor("),
        (|t| modulo(t, 1e-12).less(c(t, 1e-13)), "floor("),
        (|t| ((t * 3.0).sin() * 1e15).floor(), "floor(sin("),
    ];
    for (build, expression) in one {
        let (error, spent) = refused(build, expression);
        assert!(matches!(error, Error::TooManySwitches { .. }), "{error}");
        assert!(spent < Duration::from_secs(1), "{spent:?}: {error}");
    }
    // ever faster towards 0
    let (error, _) = refused(|t| (1.0 / t).sin().less(c(t, 0.5)), "sin(1/time)");
    assert!(matches!(error, Error::TooManySwitches { .. }), "{error}");
}

#[test]
fn what_switches_without_end_in_a_run_is_named() {
    // a row has fewer switches than a row may have
    let error = integral(|t| (t * 1e6).floor(), 5.0, 0.05, Method::default()).unwrap_err();
    let Error::TooManySwitches {
        from, to, limit, ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!(from, 0.0);
    assert!(to < 1.0 && limit > 400_000 && limit < 500_000, "{error}");
}

#[test]
fn what_rounding_hides_is_named() {
    let hidden: [(Input, &str); 3] = [
        (
            |t| (t.sin().powi(2) + t.cos().powi(2)).greater_eq(c(t, 1.0)),
            "1 <= ",
        ),
        (|t| (t * 0.1).less_eq(t / 10.0), "time/10"),
        // (t − 0.3)³ written out: its sign is lost around 0.3
        (
            |t| (t.powi(3) - t.powi(2) * 0.9 + t * 0.27 - 0.027).greater(c(t, 0.0)),
            "0 < ",
        ),
    ];
    for (build, expression) in hidden {
        let (error, _) = refused(build, expression);
        assert!(matches!(error, Error::UnresolvedSwitches { .. }), "{error}");
    }
}

#[test]
fn the_budget_is_that_of_a_row_however_many_stops() {
    let run = |budget| {
        let g = Graph::new();
        let [time, x, v, u] = ["time", "x", "v", "u"].map(|name| g.symbol(name));
        let states = [("x", 1.0, v * 100.0), ("v", 0.0, (u - x) * 100.0)];
        let plant = system(&g, &states, &["u"], &[]);
        let inputs = system(&g, &[], &[], &[("u", time.floor())]);
        let mut simulation = Simulation::new(plant, inputs, 10.0, 10.0);
        simulation.method = Method::Explicit(Tolerances {
            budget,
            ..Tolerances::default()
        });
        simulation.run()
    };
    assert!(run(10_000).is_ok());
    // enough from stop to stop, not for the row
    let error = run(300).unwrap_err().error;
    let Error::StepBudget { time, steps, .. } = error else {
        panic!("{error}");
    };
    assert!(time > 2.0 && steps == 300 + 9 * 20, "{time} {steps}");
}
