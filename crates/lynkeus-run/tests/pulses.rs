//! Pulsed inputs: the integral of an expression of time, however short its pulses.

mod common;

use std::f64::consts::{PI, TAU};
use std::time::{Duration, Instant};

use common::system;
use lynkeus_expr::{Expr, Graph};
use lynkeus_run::{Error, Method, Simulation, Step};

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
    let x = table.column("x").expect("the state");
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

#[test]
fn one_short_pulse_in_a_long_row() {

    let found = |build: fn(Expr<'_>) -> Expr<'_>| integral(build, 3000.0, 100.0, Method::default());
    let width = 1000.001 - 1000.0;
    assert!((found(|t| window_of(t, 1000.0, 1000.001)).unwrap() / width - 1.0).abs() < 1e-9);
    check(|t| window_of(t, 1234.5, 1234.500_5) * 1e4, 3000.0, 5.0);
    // a pulse that is no relation affine in time: |t² − 10⁶| < 10⁻³
    check(
        |t| (t * t - 1e6).abs().less(c(t, 1e-3)) * 1e6,
        3000.0,
        1e6 * ((1e6_f64 + 1e-3).sqrt() - (1e6_f64 - 1e-3).sqrt()),
    );
}

fn window_of(t: Expr<'_>, from: f64, to: f64) -> Expr<'_> {
    t.greater(c(t, from)).and(t.less(c(t, to)))
}

fn refused_within_a_second(build: fn(Expr<'_>) -> Expr<'_>, needle: &str) -> Error {
    let before = Instant::now();
    let error = integral(build, 1.0, 0.5, Method::default()).unwrap_err();
    let spent = before.elapsed();
    assert!(spent < Duration::from_secs(1), "{spent:?}: {error}");
    assert!(error.to_string().contains(needle), "{error}");
    error
}

#[test]
fn what_switches_without_end_is_named() {
    let limit = refused_within_a_second(|t| (t * 1e15).floor(), "floor(");
    assert!(matches!(limit, Error::TooManySwitches { .. }), "{limit}");
    let limit = refused_within_a_second(|t| modulo(t, 1e-12).less(c(t, 1e-13)), "floor(");
    assert!(matches!(limit, Error::TooManySwitches { .. }), "{limit}");
    let before = Instant::now();
    let error = integral(
        |t| (t * 1e12).sin().less(c(t, 0.5)),
        1.0,
        1.0,
        Method::default(),
    );
    println!("{:?} {error:?}", before.elapsed());
    let before = Instant::now();
    let error = integral(
        |t| (1.0 / t).sin().less(c(t, 0.5)),
        1.0,
        1.0,
        Method::default(),
    );
    println!("{:?} {error:?}", before.elapsed());
}
