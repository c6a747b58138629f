//! Systems that jump with their state: crossed, slid along, left again; against solutions by
//! hand.

mod pulses;
mod thresholds;

use lynkeus_expr::{Binary, Expr, Graph, Node};
use lynkeus_run::{Integrator, Method, System, Tolerances};

/// x' = f of named states, from a start, at some times.
fn run(
    method: Method,
    start: &[(&str, f64)],
    times: &[f64],
    build: impl for<'g> Fn(Expr<'g>, &[Expr<'g>]) -> Vec<Expr<'g>>,
) -> Vec<Vec<f64>> {
    let g = Graph::new();
    let time = g.symbol("time");
    let x: Vec<Expr<'_>> = start.iter().map(|(name, _)| g.symbol(name)).collect();
    let f: Vec<Node> = build(time, &x).iter().map(|f| f.node()).collect();
    let states: Vec<(String, Node, f64)> = (start.iter().zip(&x))
        .map(|((name, value), x)| (name.to_string(), x.node(), *value))
        .collect();
    let system = System::new(&g, time.node(), &states, &[], &f, &[]).expect("it is well-formed");
    let mut evaluation = system.evaluation();
    let mut integrator = Integrator::new(method, start.len()).expect("it is well-formed");
    let (mut x, mut t, mut rows) = (system.start().to_vec(), 0.0, vec![]);
    for &to in times {
        integrator
            .advance(&mut evaluation, t, to, &mut x)
            .expect("it is well-formed");
        rows.push(x.clone());
        t = to;
    }
    rows
}

fn methods() -> [Method; 3] {
    let fine = Tolerances {
        relative: 1e-9,
        absolute: 1e-12,
        ..Tolerances::default()
    };
    [
        Method::Adaptive(fine),
        Method::Explicit(fine),
        Method::Stiff(fine),
    ]
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-7, "{found} for {expected}");
}

/// w' = u − sign(w) with u = 0.5 brakes to rest in finite time and stays there.
#[test]
fn friction_brakes_to_rest_and_holds() {
    for method in methods() {
        let rows = run(
            method,
            &[("w", 1.0), ("p", 0.0)],
            &[1.0, 3.0, 50.0],
            |_, x| vec![0.5 - x[0].sign(), x[0]],
        );
        close(rows[0][0], 0.5);
        for row in &rows[1..] {
            assert!(row[0].abs() < 1e-12, "{row:?}");
            // ∫ (1 − t/2) over two seconds
            close(row[1], 1.0);
        }
    }
}

/// What bends on the surface makes steps across it inaccurate: x' = 1 + |x − ½| reaches ½ at ln 1.5,
/// from where z' = sign(x − ½) turns, whatever steps are refused on the way there.
#[test]
fn a_bend_on_the_surface_does_not_delay_the_jump() {
    for method in methods() {
        for times in [&[2.0][..], &[0.3, 0.4, 0.41, 1.0, 2.0]] {
            let rows = run(method, &[("x", 0.0), ("z", 0.0)], times, |_, x| {
                let off = x[0] - 0.5;
                vec![1.0 + off.abs(), off.sign()]
            });
            let last = &rows[times.len() - 1];
            close(last[0], 0.5 + ((2.0_f64 - 1.5_f64.ln()).exp() - 1.0));
            close(last[1], 2.0 - 2.0 * 1.5_f64.ln());
        }
    }
}

/// Breakaway: the load grows past the friction at t = 1 and moves on from there.
#[test]
fn rest_ends_when_the_load_exceeds_the_friction() {
    for method in methods() {
        let rows = run(method, &[("w", 0.0)], &[0.7, 2.0, 3.0], |t, x| {
            vec![t - x[0].sign()]
        });
        assert!(rows[0][0].abs() < 1e-12);
        close(rows[1][0], 0.5);
        close(rows[2][0], 2.0);
    }
}

/// The same friction written with `if`: two relations with one surface.
#[test]
fn an_if_is_a_sign() {
    for method in methods() {
        let rows = run(method, &[("w", 1.0)], &[0.5, 5.0, 9.0], |t, x| {
            let (w, one) = (x[0], x[0].graph().constant(1.0));
            let zero = w.graph().constant(0.0);
            let friction = zero.less(w).select(one, w.less(zero).select(-one, zero));
            vec![(0.4 * t).sin() - 1.5 * friction]
        });
        let integral = |t: f64| (1.0 - (0.4 * t).cos()) / 0.4;
        close(rows[0][0], 1.0 + integral(0.5) - 0.75);
        assert!(
            rows[1][0].abs() < 1e-12 && rows[2][0].abs() < 1e-12,
            "{rows:?}"
        );
    }
}

/// A jump that is only crossed: x' = 1 below 1 and 3 above.
#[test]
fn a_threshold_is_crossed_exactly() {
    for method in methods() {
        let rows = run(method, &[("x", 0.0)], &[2.0], |_, x| {
            vec![1.0 + 2.0 * x[0].graph().constant(1.0).less(x[0])]
        });
        assert!((rows[0][0] - 4.0).abs() < 1e-11, "{rows:?}");
    }
}

/// A relay on a switching line x + y = 0: the state slides to the origin along it, x' = −x.
#[test]
fn sliding_on_a_line() {
    for method in methods() {
        let rows = run(method, &[("x", 1.0), ("y", 0.5)], &[3.0, 4.0], |_, s| {
            vec![s[1], -3.0 * (s[0] + s[1]).sign()]
        });
        let (first, second) = (&rows[0], &rows[1]);
        assert!((first[0] + first[1]).abs() < 1e-9, "{first:?}");
        close(second[0], first[0] * (-1.0_f64).exp());
    }
}

/// Two masses with friction of their own, at rest at once, and a third branch without value.
#[test]
fn two_surfaces_at_once_and_a_branch_without_value() {
    for method in methods() {
        let rows = run(
            method,
            &[("v", 1.0), ("w", -1.0), ("h", 1.0)],
            &[1.5, 3.0],
            |_, x| {
                let zero = x[0].graph().constant(0.0);
                let spring = 0.3 * (x[0] - x[1]);
                let outflow = zero.less(x[2]).select(x[2].sqrt(), zero);
                vec![-spring - x[0].sign(), spring - 2.0 * x[1].sign(), -outflow]
            },
        );
        assert!(
            rows[1][0].abs() < 1e-12 && rows[1][1].abs() < 1e-12,
            "{rows:?}"
        );
        // h' = −√h empties at t = 2
        close(rows[0][2], 0.0625);
        assert!(rows[1][2].abs() < 1e-7, "{rows:?}");
    }
}

/// A load that all but stops the motion for a while: inside one long step the speed would
/// pass zero and come back, were the friction not there.
#[test]
fn a_short_rest_is_not_stepped_over() {
    for method in methods() {
        let rows = run(method, &[("w", 0.5)], &[6.0], |t, x| {
            vec![0.5 + 0.5 * (t - 3.0).powi(2) / 9.0 * 2.0 - 0.9 * x[0].sign() - 0.5]
        });
        // w' = (t − 3)²/9 − 0.9 while it moves: Simpson's rule with the rest found by bisection
        let w = |t: f64| 0.5 + ((t - 3.0).powi(3) + 27.0) / 27.0 - 0.9 * t;
        let (mut moving, mut resting) = (0.0, 3.0);
        for _ in 0..60 {
            let middle = 0.5 * (moving + resting);
            if w(middle) > 0.0 {
                moving = middle
            } else {
                resting = middle
            }
        }
        let again = 3.0 + 3.0 * 0.9_f64.sqrt();
        let rise = |t: f64| (t - 3.0).powi(3) / 27.0 - 0.9 * t;
        close(rows[0][0], rise(6.0) - rise(again));
        assert!(resting < again);
    }
}

/// A DC motor with dry friction, through standstill and back. The reference is SciPy's Radau
/// method (rtol 1e-10) with sign(w) written tanh(w/1e-6), which is off by about as much.
#[test]
fn a_motor_with_dry_friction_agrees_with_a_regularised_reference() {
    let reference = [
        (0.02, [0.0, 0.0, 0.09577606]),
        (0.2, [0.78943596, 11.10260568, 0.33171298]),
        (0.5, [4.01274237, 0.73630095, -0.02991577]),
        (0.7, [3.22565378, -11.10260568, -0.33171298]),
        (1.0, [0.00234737, -0.73630095, 0.02991577]),
        (1.5, [4.01274237, 0.73630095, -0.02991577]),
    ];
    let times = reference.map(|(t, _)| t);
    for method in methods() {
        let start = [("th", 0.0), ("w", 0.0), ("i", 0.0)];
        let rows = run(method, &start, &times, |t, x| {
            let (w, i) = (x[1], x[2]);
            let voltage = (std::f64::consts::TAU * t).sin();
            vec![
                w,
                (0.05 * i - 1e-5 * w - 0.01 * w.sign()) / 1e-4,
                (voltage - 1.2 * i - 0.05 * w) / 2e-3,
            ]
        });
        for (row, (t, expected)) in rows.iter().zip(reference) {
            for (found, expected) in row.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-5,
                    "{found} for {expected} at {t}"
                );
            }
        }
        assert!(rows[0][1].abs() < 1e-12, "at rest: {:?}", rows[0]);
    }
}

/// A right-hand side that jumps with time and with the state.
#[test]
fn jumps_of_time_and_of_the_state_go_together() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    let late = g.expr(g.binary(Binary::Less, g.constant(1.0).node(), time.node()));
    let dx = late - (x - 0.5).sign();
    let states = [("x".to_string(), x.node(), 0.0)];
    let system = System::new(&g, time.node(), &states, &[], &[dx.node()], &[]).unwrap();
    let mut state = [0.0];
    let mut integrator = Integrator::new(Method::default(), 1).unwrap();
    // up to 0.5 at t = 0.5, along it, and along it still: the push of 1 is held
    integrator
        .advance(&mut system.evaluation(), 0.0, 2.0, &mut state)
        .unwrap();
    assert!((state[0] - 0.5).abs() < 1e-6, "{state:?}");
}
