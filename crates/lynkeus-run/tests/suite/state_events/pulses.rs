//! Pulses of the state, however short beside the steps: what they add up to, against the instants
//! known in closed form.

use lynkeus_expr::{Binary, Expr};
use lynkeus_run::{Method, Simulation};
use proptest::prelude::*;

use super::{methods, run};
use crate::common::system;

fn modulo(x: Expr<'_>, period: f64) -> Expr<'_> {
    x - (x / period).floor() * period
}

fn c<'g>(like: Expr<'g>, value: f64) -> Expr<'g> {
    like.graph().constant(value)
}

fn max<'g>(a: Expr<'g>, b: Expr<'g>) -> Expr<'g> {
    a.graph()
        .expr(a.graph().binary(Binary::Max, a.node(), b.node()))
}

/// ∫ g(x) dt with x' = 1 from 0 to `until`.
fn added(method: Method, until: f64, build: impl for<'g> Fn(Expr<'g>) -> Expr<'g>) -> f64 {
    let rows = run(method, &[("x", 0.0), ("z", 0.0)], &[until], |_, x| {
        vec![c(x[0], 1.0), build(x[0])]
    });
    rows[0][1]
}

fn check(until: f64, expected: f64, build: impl for<'g> Fn(Expr<'g>) -> Expr<'g>) {
    for method in methods() {
        let found = added(method, until, &build);
        assert!(
            (found - expected).abs() <= 1e-6 * expected.abs().max(1.0),
            "{method:?}: {found}, expected {expected}"
        );
    }
}

#[test]
fn remainders_floors_waves_and_windows() {
    check(10.0, 10.0, |x| modulo(x, 1.0).less(c(x, 0.5)) * 2.0);
    check(100.0, 100.0, |x| modulo(x, 10.0).less(c(x, 0.01)) * 1000.0);
    check(7.5, 21.0 + 3.5, |x| x.floor());
    check(7.5, -28.0 - 4.0, |x| (-x).floor());
    // one within another: four of seven whole numbers, and the first tenth of these
    check(70.0, 40.0, |x| {
        modulo(x.floor(), 7.0).less(c(x, 3.5)) * modulo(x, 1.0).less(c(x, 0.1)) * 10.0
    });
    // whole numbers that come to lie on a threshold
    check(9.5, 6.5, |x| c(x, 3.0).less_eq(x.floor()) * 1.0);
    check(9.5, 4.0, |x| x.floor().less_eq(c(x, 3.0)) * 1.0);
    check(9.5, 5.5, |x| x.floor().greater(c(x, 3.0)) * 1.0);
    // an equality of what counts
    check(10.0, 1.0, |x| {
        let g = x.graph();
        g.expr(g.binary(Binary::Equal, x.floor().node(), g.constant(3.0).node()))
    });
    check(10.0, 2.0, |x| (x - 2.5234).abs().less(c(x, 1e-4)) * 1e4);
    check(10.0, 1.0, |x| {
        x.greater(c(x, 7.3)) * x.less(c(x, 7.300_01)) * 1e5
    });
    // sin 50x > 0.999: acos(0.999)/π of the time
    let share = 0.999_f64.acos() / std::f64::consts::PI;
    let turns = 2.0 * std::f64::consts::PI / 50.0;
    check(40.0 * turns, 40.0 * turns * share, |x| {
        (x * 50.0).sin().greater(c(x, 0.999))
    });
}

/// A peak that bends and does not jump.
#[test]
fn peaks_without_a_jump() {
    check(10.0, 1.0, |x| {
        max(c(x, 0.0), 1.0 - (x - 2.5234).abs() * 1e3) * 1e3
    });
    check(10.0, 0.5, |x| {
        let rise =
            max(x - 6.01, c(x, 0.0)) - max(x - 6.02, c(x, 0.0)) * 2.0 + max(x - 6.03, c(x, 0.0));
        rise * 5e3
    });
}

/// A surface that is only just reached, and one that is only just not: x = 1 − (t − 3)² tops at 1.
#[test]
fn tops_at_a_threshold() {
    for (level, width) in [(1.0 - 1e-6, 2e-3), (1.0 - 1e-8, 2e-4), (1.0 + 1e-6, 0.0)] {
        for method in methods() {
            let start = [("v", 6.0), ("x", -8.0), ("z", 0.0)];
            let rows = run(method, &start, &[6.0], |_, x| {
                vec![c(x[0], -2.0), x[0], x[1].greater(c(x[1], level)) * 1e3]
            });
            let found = rows[0][2] / 1e3;
            assert!(
                (found - width).abs() < 2e-6,
                "{method:?}: {found} for {width}"
            );
        }
    }
}

/// The measured time that cos ωt spends in the pulses of a remainder.
fn swung(ω: f64, until: f64, period: f64, duty: f64) -> f64 {
    let whole = (1.0 / period).ceil() as i64 + 1;
    let mut instants = vec![0.0, until];
    for k in -whole..=whole {
        for level in [k as f64 * period, (k as f64 + duty) * period] {
            if level.abs() < 1.0 {
                let turns = (ω * until / std::f64::consts::TAU).ceil() as i64 + 1;
                for turn in -turns..=turns {
                    for sign in [-1.0, 1.0] {
                        let angle = sign * level.acos() + turn as f64 * std::f64::consts::TAU;
                        instants.push(angle / ω);
                    }
                }
            }
        }
    }
    instants.retain(|t| (0.0..=until).contains(t));
    instants.sort_unstable_by(f64::total_cmp);
    let pieces = instants.windows(2).map(|pair| {
        let x = (ω * 0.5 * (pair[0] + pair[1])).cos();
        match x.rem_euclid(period) < duty * period {
            true => pair[1] - pair[0],
            false => 0.0,
        }
    });
    pieces.sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// A ramp of any speed through pulses whose periods differ by four decades.
    #[test]
    fn trains_along_a_ramp(
        speed in -3.0..3.0_f64,
        period in (-2.0..2.0_f64).prop_map(|e| 10.0_f64.powf(e)),
        duty in (-3.0..-0.31_f64).prop_map(|e| 10.0_f64.powf(e)),
        pulses in 1.0..60.0_f64,
    ) {
        let speed = speed + 0.1_f64.copysign(speed);
        let until = pulses * period / speed.abs();
        let way = |x: f64| {
            let whole = (x / period).floor();
            whole * duty * period + (x - whole * period).min(duty * period)
        };
        let expected = way(speed * until) / speed;
        for method in methods() {
            let rows = run(method, &[("x", 0.0), ("z", 0.0)], &[until], |_, x| {
                vec![c(x[0], speed), modulo(x[0], period).less(c(x[0], duty * period)) / duty]
            });
            let found = rows[0][1] * duty;
            prop_assert!((found - expected).abs() <= 1e-6 * expected.abs(), "{method:?}: {found}, expected {expected}");
        }
    }

    /// An oscillation that goes through some of them and turns within others.
    #[test]
    fn trains_along_a_swing(
        ω in (-1.0..1.0_f64).prop_map(|e| 10.0_f64.powf(e)),
        period in (-1.5..0.3_f64).prop_map(|e| 10.0_f64.powf(e)),
        duty in (-3.0..-0.31_f64).prop_map(|e| 10.0_f64.powf(e)),
        turns in 0.3..2.0_f64,
    ) {
        let until = turns * std::f64::consts::TAU / ω;
        let expected = swung(ω, until, period, duty);
        for method in methods() {
            let start = [("x", 1.0), ("v", 0.0), ("z", 0.0)];
            let rows = run(method, &start, &[until], |_, x| {
                vec![x[1], x[0] * (-ω * ω), modulo(x[0], period).less(c(x[0], duty * period)) * 1.0]
            });
            // at a turn within a pulse the instants are as sensitive as a root is
            let error = (rows[0][2] - expected).abs();
            prop_assert!(error <= 1e-6 * until, "{method:?}: {}, expected {expected}", rows[0][2]);
        }
    }
}

/// A plant beside its inputs: the threshold of a state moves with an input of time.
#[test]
fn a_simulation_finds_them_too() {
    let g = lynkeus_expr::Graph::new();
    let [time, x, z, u] = ["time", "x", "z", "u"].map(|name| g.symbol(name));
    let pulse = modulo(x + u, 1.0).less(c(x, 0.001)) * 1e3;
    let plant = system(&g, &[("x", 0.0, c(x, 1.0)), ("z", 0.0, pulse)], &["u"], &[]);
    let _ = z;
    // x + u = 2t + 0.25
    let inputs = system(&g, &[], &[], &[("u", time + 0.25)]);
    for output_step in [10.0, 1.0, 0.37] {
        let simulation = Simulation::new(plant.clone(), inputs.clone(), 10.0, output_step);
        let table = simulation.run().expect("it runs");
        let z = table
            .column(lynkeus_run::Role::State.at(1))
            .expect("the state");
        let found = z[z.len() - 1];
        assert!((found - 10.0).abs() < 1e-6, "{found}");
    }
}
